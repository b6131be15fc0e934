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
    // Four along x in the four rows about the place; two along x in the eight rows around these.
    let mut inner = [[Lanes([0.0; LANES]); 4]; 4];
    let mut outer = [[Lanes([0.0; LANES]); 2]; 8];
    let (down, plane) = (stride, stride * dims[1]);
    for lane in 0..LANES {
        let first = indices.0[lane] as usize;
        let starts = [first, first + down, first + plane, first + plane + down];
        for r in 0..4 {
            let values = &field.values[starts[r] - 1..starts[r] + 3];
            for k in 0..4 {
                inner[r][k].0[lane] = values[k];
            }
        }
        // Beside along y, then along z.
        let around = [
            [starts[0] - down, starts[1] + down, starts[2] - down, starts[3] + down],
            [starts[0] - plane, starts[2] + plane, starts[1] - plane, starts[3] + plane],
        ];
        for axis in 0..2 {
            for r in 0..4 {
                let values = &field.values[around[axis][r]..around[axis][r] + 2];
                outer[4 * axis + r][0].0[lane] = values[0];
                outer[4 * axis + r][1].0[lane] = values[1];
            }
        }
    }
    let load = |lanes: &Lanes<f32>| f32x16::from_slice(simd, &lanes.0);
    let mix = |a: f32x16<S>, b: f32x16<S>, u: f32x16<S>| (b - a).mul_add(u, a);
    let [ux, uy, uz] = u;
    // Along x in each row, then between rows.
    let (mut slopes, mut middles) = ([one; 4], [one; 4]);
    for r in 0..4 {
        let [a, b, c, d] =
            [load(&inner[r][0]), load(&inner[r][1]), load(&inner[r][2]), load(&inner[r][3])];
        slopes[r] = mix(c - a, d - b, ux);
        middles[r] = mix(b, c, ux);
    }
    let gx = mix(mix(slopes[0], slopes[1], uy), mix(slopes[2], slopes[3], uy), uz);
    let mut sides = [one; 8];
    for r in 0..8 {
        sides[r] = mix(load(&outer[r][0]), load(&outer[r][1]), ux);
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
