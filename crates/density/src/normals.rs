//! Normals: the gradient of the density.
//!
//! "A normal vector can be easily obtained from the gradient at the detected position" (Yasuda et al. 2009,
//! §3): central differences at the nodes, trilinear between them, so that a normal turns without jumps from
//! cell to cell.

use fearless_simd::{f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;

use crate::field::Field;
use crate::lanes::{LANES, Lanes, V3};

/// Gradients of places, in rows of whole vectors, which they take.
#[simd]
pub(crate) fn gradients<S: Simd>(simd: S, field: &Field, rows: &mut [Vec<f32>; 3]) {
    for at in (0..rows[0].len() / LANES * LANES).step_by(LANES) {
        let found = sixteen(simd, field, V3::load(simd, rows, at));
        for a in 0..3 {
            found.0[a].store_slice(&mut rows[a][at..at + LANES]);
        }
    }
}

/// The gradients of sixteen places.
#[inline(always)]
pub(crate) fn sixteen<S: Simd>(simd: S, field: &Field, V3(place): V3<S>) -> V3<S> {
    let dims = field.lattice.dims;
    let (one, stride) = (f32x16::splat(simd, 1.0), field.stride());
    let (mut u, mut cell) = (place, [u32x16::splat(simd, 0); 3]);
    for a in 0..3 {
        // A node more on each side.
        let last = f32x16::splat(simd, (dims[a] - 3) as f32);
        let low = place[a].floor().max(one).min(last);
        u[a] = place[a] - low;
        cell[a] = low.to_int();
    }
    let row = cell[2] * u32x16::splat(simd, dims[1] as u32) + cell[1];
    let index = row * u32x16::splat(simd, stride as u32) + cell[0];
    let mut indices = Lanes([0_u32; LANES]);
    index.store_slice(&mut indices.0);
    // Four along x in the four rows about the place; two along x in the eight rows around these: beside along
    // y, then along z.
    let (down, plane) = (stride, stride * dims[1]);
    let about = [0, down, plane, plane + down].map(|row| row + plane - 1);
    let beside = [plane - down, plane + 2 * down, 2 * plane - down, 2 * plane + 2 * down];
    let beyond = [0, 3 * plane, down, 3 * plane + down];
    let mut inner = [Lanes([[0.0; 4]; LANES]); 4];
    let mut outer = [Lanes([[0.0; 2]; LANES]); 8];
    for lane in 0..LANES {
        let near = &field.values[indices.0[lane] as usize - plane..][..3 * plane + down + 2];
        for r in 0..4 {
            let at = about[r];
            inner[r].0[lane] = [near[at], near[at + 1], near[at + 2], near[at + 3]];
            outer[r].0[lane] = [near[beside[r]], near[beside[r] + 1]];
            outer[4 + r].0[lane] = [near[beyond[r]], near[beyond[r] + 1]];
        }
    }
    let part = |row: &[f32], at: usize| f32x16::from_slice(simd, &row[at * LANES..][..LANES]);
    let mix = |a: f32x16<S>, b: f32x16<S>, u: f32x16<S>| (b - a).mul_add(u, a);
    let [ux, uy, uz] = u;
    // Along x in each row, then between rows.
    let (mut slopes, mut middles) = ([one; 4], [one; 4]);
    for r in 0..4 {
        let row = inner[r].0.as_flattened();
        let (one, other) =
            (part(row, 0).deinterleave(part(row, 1)), part(row, 2).deinterleave(part(row, 3)));
        let (a, c) = one.0.deinterleave(other.0);
        let (b, d) = one.1.deinterleave(other.1);
        slopes[r] = mix(c - a, d - b, ux);
        middles[r] = mix(b, c, ux);
    }
    let gx = mix(mix(slopes[0], slopes[1], uy), mix(slopes[2], slopes[3], uy), uz);
    let mut sides = [one; 8];
    for r in 0..8 {
        let row = outer[r].0.as_flattened();
        let (low, high) = part(row, 0).deinterleave(part(row, 1));
        sides[r] = mix(low, high, ux);
    }
    // Rows before and behind, at the two sides of the cell.
    let near = mix(middles[1] - sides[0], sides[1] - middles[0], uy);
    let far = mix(middles[3] - sides[2], sides[3] - middles[2], uy);
    let gy = mix(near, far, uz);
    let left = mix(middles[2] - sides[4], sides[5] - middles[0], uz);
    let right = mix(middles[3] - sides[6], sides[7] - middles[1], uz);
    let gz = mix(left, right, uy);
    V3([gx, gy, gz])
}
