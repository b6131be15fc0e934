//! Where a particle belongs, sixteen at a time.
//!
//! Along each axis the place is ⌊(p − low)·scale⌋ between zero and the last; places are numbered with
//! x fastest. [`Places::of`] is the definition; the kernels give the same numbers.

use fearless_simd::{f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::{Block, Lattice, Particle};

/// How many particles the kernels take at once.
pub const BATCH: usize = 16;

/// Equal cubes along three axes, numbered.
#[derive(Clone, Copy, Debug)]
pub struct Places {
    low: [f32; 3],
    /// Cubes per unit of length.
    scale: f32,
    /// The last cube along each axis.
    last: [u32; 3],
    /// What one cube farther along each axis adds to the number.
    stride: [u32; 3],
}

impl Places {
    /// The blocks of a lattice.
    pub fn of_blocks(lattice: &Lattice) -> Self {
        Self::new(lattice.low, lattice.edge, lattice.dims)
    }

    /// The cells of a block.
    pub fn of_cells(block: &Block) -> Self {
        Self::new(block.cell_low, block.cell_edge, block.cells)
    }

    /// `dims` cubes along the axes, at least one each, from `low` on with this edge.
    pub fn new(low: Vec3, edge: f32, dims: [u32; 3]) -> Self {
        let [nx, ny, _] = dims;
        let last = dims.map(|d| d - 1);
        Self { low: low.to_array(), scale: 1.0 / edge, last, stride: [1, nx, nx * ny] }
    }

    /// The place of point `p` along each axis.
    #[inline(always)]
    pub fn along(&self, p: [f32; 3]) -> [u32; 3] {
        // `as` truncates, saturates and sends NaN to zero.
        let place = |i: usize| (((p[i] - self.low[i]) * self.scale) as u32).min(self.last[i]);
        [place(0), place(1), place(2)]
    }

    /// The number of the place of point `p`.
    #[inline(always)]
    pub fn of(&self, p: [f32; 3]) -> u32 {
        let [x, y, z] = self.along(p);
        x + y * self.stride[1] + z * self.stride[2]
    }

    /// The constants of sixteen points in a row, x, y, z, x, y, ….
    pub fn in_rows(&self) -> Rows {
        Rows {
            low: std::array::from_fn(|i| self.low[i % 3]),
            last: std::array::from_fn(|i| self.last[i % 3]),
            stride: std::array::from_fn(|i| self.stride[i % 3]),
            scale: self.scale,
        }
    }
}

/// [`Places`], repeated for points of three numbers that lie side by side.
pub struct Rows {
    low: [f32; 3 * BATCH],
    last: [u32; 3 * BATCH],
    stride: [u32; 3 * BATCH],
    scale: f32,
}

/// The numbers of the places of sixteen points. Called in a kernel.
#[inline(always)]
pub fn of_points<S: Simd>(simd: S, rows: &Rows, points: &[[f32; 3]]) -> [u32; BATCH] {
    let points: &[f32] = bytemuck::cast_slice(points);
    let scale = f32x16::splat(simd, rows.scale);
    let mut parts = [0; 3 * BATCH];
    for at in [0, BATCH, 2 * BATCH] {
        let lanes = at..at + BATCH;
        let p = f32x16::from_slice(simd, &points[lanes.clone()]);
        let low = f32x16::from_slice(simd, &rows.low[lanes.clone()]);
        let last = u32x16::from_slice(simd, &rows.last[lanes.clone()]);
        let stride = u32x16::from_slice(simd, &rows.stride[lanes.clone()]);
        let place = ((p - low) * scale).to_int_precise::<u32x16<S>>().min(last);
        (place * stride).store_slice(&mut parts[lanes]);
    }
    let mut sums = [0; BATCH];
    for i in 0..BATCH {
        sums[i] = parts[3 * i] + parts[3 * i + 1] + parts[3 * i + 2];
    }
    sums
}

/// The numbers of the places of `particles`, less `first`.
#[simd]
pub(crate) fn number<S: Simd>(
    simd: S,
    places: &Places,
    particles: &[Particle],
    first: u32,
    numbers: &mut [u32],
) {
    let batches = particles.chunks_exact(BATCH);
    let rest = batches.remainder();
    let (whole, last) = numbers.split_at_mut(particles.len() - rest.len());
    for (batch, numbers) in batches.zip(whole.chunks_exact_mut(BATCH)) {
        of_sixteen(simd, places, bytemuck::cast_slice(batch), first).store_slice(numbers);
    }
    for (particle, number) in rest.iter().zip(last) {
        *number = places.of(particle.center) - first;
    }
}

#[inline(always)]
fn of_sixteen<S: Simd>(simd: S, places: &Places, numbers: &[f32], first: u32) -> u32x16<S> {
    // x y z i x y z i … becomes x z x z … and y i y i …, and these x …, z … and y ….
    let load = [0, BATCH, 2 * BATCH, 3 * BATCH];
    let a = f32x16::from_slice(simd, &numbers[load[0]..load[0] + BATCH]);
    let b = f32x16::from_slice(simd, &numbers[load[1]..load[1] + BATCH]);
    let c = f32x16::from_slice(simd, &numbers[load[2]..load[2] + BATCH]);
    let d = f32x16::from_slice(simd, &numbers[load[3]..load[3] + BATCH]);
    let (xz0, yi0) = a.deinterleave(b);
    let (xz1, yi1) = c.deinterleave(d);
    let (x, z) = xz0.deinterleave(xz1);
    let y = yi0.unzip_low(yi1);
    let x = along(simd, places, 0, x);
    let y = along(simd, places, 1, y) * u32x16::splat(simd, places.stride[1]);
    let z = along(simd, places, 2, z) * u32x16::splat(simd, places.stride[2]);
    x + y + z - u32x16::splat(simd, first)
}

#[inline(always)]
fn along<S: Simd>(simd: S, places: &Places, axis: usize, p: f32x16<S>) -> u32x16<S> {
    let low = f32x16::splat(simd, places.low[axis]);
    let at = (p - low) * f32x16::splat(simd, places.scale);
    at.to_int_precise::<u32x16<S>>().min(u32x16::splat(simd, places.last[axis]))
}

/// Least and greatest coordinates of `points`; `None` if one of them is not finite.
#[simd]
pub fn bounds_of_points<S: Simd>(simd: S, points: &[[f32; 3]]) -> Option<(Vec3, Vec3)> {
    let batches = points.chunks_exact(BATCH);
    let rest = batches.remainder();
    let zero = f32x16::splat(simd, 0.0);
    let mut low = [f32x16::splat(simd, f32::INFINITY); 3];
    let mut high = [f32x16::splat(simd, f32::NEG_INFINITY); 3];
    // Zero as long as all are finite: ∞·0 and NaN·0 are NaN.
    let mut nothing = zero;
    for batch in batches {
        let numbers: &[f32] = bytemuck::cast_slice(batch);
        for row in 0..3 {
            let p = f32x16::from_slice(simd, &numbers[row * BATCH..(row + 1) * BATCH]);
            nothing += p * zero;
            low[row] = low[row].min(p);
            high[row] = high[row].max(p);
        }
    }
    if !nothing.simd_eq(zero).all_true() {
        return None;
    }
    let (mut lows, mut highs) = ([0.0; 3 * BATCH], [0.0; 3 * BATCH]);
    for row in 0..3 {
        low[row].store_slice(&mut lows[row * BATCH..(row + 1) * BATCH]);
        high[row].store_slice(&mut highs[row * BATCH..(row + 1) * BATCH]);
    }
    let ends: &[[f32; 3]] = bytemuck::cast_slice(&lows);
    let low = ends.iter().fold(Vec3::INFINITY, |a, p| a.min(Vec3::from_array(*p)));
    let ends: &[[f32; 3]] = bytemuck::cast_slice(&highs);
    let high = ends.iter().fold(Vec3::NEG_INFINITY, |a, p| a.max(Vec3::from_array(*p)));
    rest.iter()
        .map(|p| Vec3::from_array(*p))
        .try_fold((low, high), |(low, high), p| p.is_finite().then(|| (low.min(p), high.max(p))))
}

/// Least and greatest coordinates of `particles`, all finite.
#[simd]
pub(crate) fn bounds_of_particles<S: Simd>(simd: S, particles: &[Particle]) -> (Vec3, Vec3) {
    let fours = particles.chunks_exact(4);
    let rest = fours.remainder();
    let mut low = f32x16::splat(simd, f32::INFINITY);
    let mut high = f32x16::splat(simd, f32::NEG_INFINITY);
    for four in fours {
        // Every fourth lane holds indices, and is not used.
        let p = f32x16::from_slice(simd, bytemuck::cast_slice(four));
        low = low.min(p);
        high = high.max(p);
    }
    let (mut lows, mut highs) = ([0.0; BATCH], [0.0; BATCH]);
    low.store_slice(&mut lows);
    high.store_slice(&mut highs);
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for lane in (0..BATCH).step_by(4) {
        low = low.min(Vec3::from_slice(&lows[lane..]));
        high = high.max(Vec3::from_slice(&highs[lane..]));
    }
    for particle in rest {
        let p = Vec3::from_array(particle.center);
        (low, high) = (low.min(p), high.max(p));
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    fn points(n: usize) -> Vec<[f32; 3]> {
        let number = |i: usize| (i.wrapping_mul(2_654_435_761) % 100_003) as f32 / 100_003.0;
        (0..n).map(|i| [number(3 * i), number(3 * i + 1) * 7.0, number(3 * i + 2) - 0.5]).collect()
    }

    #[test]
    fn kernels_number_places_as_the_definition_does() {
        let points = points(1000);
        let lattice = Lattice { low: Vec3::new(0.1, 0.0, -0.5), edge: 0.01, dims: [80, 700, 9] };
        let places = Places::of_blocks(&lattice);
        let expected: Vec<u32> = points.iter().map(|p| places.of(*p)).collect();
        let particles: Vec<Particle> =
            points.iter().map(|p| Particle { center: *p, index: u32::MAX }).collect();
        let rows = places.in_rows();
        for level in [Level::baseline(), Level::new()] {
            let mut numbers = vec![0; 1000];
            dispatch!(level, simd => number(simd, &places, &particles, 0, &mut numbers));
            assert_eq!(numbers, expected);
            for (batch, expected) in points.chunks_exact(16).zip(expected.chunks_exact(16)) {
                let numbers = dispatch!(level, simd => of_points(simd, &rows, batch));
                assert_eq!(numbers, expected);
            }
        }
    }

    #[test]
    fn bounds_are_those_of_one_by_one() {
        let mut points = points(1003);
        let low = points.iter().fold(Vec3::INFINITY, |a, p| a.min(Vec3::from_array(*p)));
        let high = points.iter().fold(Vec3::NEG_INFINITY, |a, p| a.max(Vec3::from_array(*p)));
        let particles: Vec<Particle> =
            points.iter().map(|p| Particle { center: *p, index: u32::MAX }).collect();
        let level = Level::new();
        let of_points = dispatch!(level, simd => bounds_of_points(simd, &points));
        assert_eq!(of_points, Some((low, high)));
        let of_particles = dispatch!(level, simd => bounds_of_particles(simd, &particles));
        assert_eq!(of_particles, (low, high));
        for (at, bad) in [(7, f32::NAN), (1001, f32::INFINITY), (500, f32::NEG_INFINITY)] {
            let good = std::mem::replace(&mut points[at][1], bad);
            assert_eq!(dispatch!(level, simd => bounds_of_points(simd, &points)), None);
            points[at][1] = good;
        }
    }
}
