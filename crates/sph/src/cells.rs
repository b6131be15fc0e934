//! Cells of the kernel's support, and the order of particles by cell.
//!
//! The longest side of the domain is the slowest axis, so that planes of cells are many and can be
//! worked at in parallel ([`crate::pairs`]). A rim of empty cells lies around the domain: no cell with a
//! particle lacks a neighbour. The order is by two stable counting sorts, by plane and by cell, and the
//! same for any number of threads.

use fearless_simd::{Level, dispatch, f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use rayon::prelude::*;

/// How many particles are sorted by plane at a time.
const CHUNK: usize = 1 << 13;

/// Where the cells lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    low: [f32; 3],
    per_length: f32,
    /// Cells along x, y, z, the rim included.
    dims: [usize; 3],
    /// From a cell to the next along x, y, z.
    strides: [usize; 3],
    /// From a cell to the next row, and to the next plane.
    pub row: usize,
    pub plane: usize,
    /// How many planes there are.
    pub planes: usize,
}

impl Lattice {
    /// Cells of `edge` over the box `low..high`.
    pub fn new(low: [f32; 3], high: [f32; 3], edge: f32) -> Self {
        // A hair wider, so that rounding never puts two within reach two cells apart.
        let per_length = 1.0 / (edge * 1.0001);
        let dims: [usize; 3] =
            std::array::from_fn(|a| ((high[a] - low[a]) * per_length).max(0.0) as usize + 3);
        let mut axes = [0, 1, 2];
        axes.sort_by_key(|a| dims[*a]);
        let mut strides = [0; 3];
        strides[axes[0]] = 1;
        strides[axes[1]] = dims[axes[0]];
        strides[axes[2]] = dims[axes[0]] * dims[axes[1]];
        let (row, plane) = (strides[axes[1]], strides[axes[2]]);
        Self { low, per_length, dims, strides, row, plane, planes: dims[axes[2]] }
    }

    /// How many cells there are.
    pub fn cells(&self) -> usize {
        self.plane * self.planes
    }

    /// The cell of a point; of one outside, the nearest inside the rim.
    #[inline(always)]
    pub fn cell(&self, p: [f32; 3]) -> usize {
        let mut cell = 0;
        for (a, p) in p.iter().enumerate() {
            let along = ((p - self.low[a]) * self.per_length) as usize;
            cell += (along.min(self.dims[a] - 3) + 1) * self.strides[a];
        }
        cell
    }

    /// Whether a point is within `reach` of a cell.
    pub fn reaches(&self, cell: usize, point: [f32; 3], reach: f32) -> bool {
        let edge = 1.0 / self.per_length;
        let square: f32 = (0..3)
            .map(|a| {
                let along = cell / self.strides[a] % self.dims[a];
                let from = self.low[a] + (along as f32 - 1.0) * edge;
                (from - point[a]).max(point[a] - from - edge).max(0.0).powi(2)
            })
            .sum();
        square <= reach * reach
    }
}

/// The cells of points, as [`Lattice::cell`] has them.
#[allow(clippy::needless_range_loop)] // iterators leave the instruction set of a kernel
#[simd]
fn cells<S: Simd>(simd: S, lattice: &Lattice, points: [&[f32]; 3], keys: &mut [u32]) {
    let whole = keys.len() / 16 * 16;
    for (n, keys) in keys[..whole].chunks_exact_mut(16).enumerate() {
        let mut cell = u32x16::splat(simd, 0);
        for axis in 0..3 {
            let at = f32x16::from_slice(simd, &points[axis][n * 16..n * 16 + 16]);
            let along = (at - lattice.low[axis]) * lattice.per_length;
            let most = (lattice.dims[axis] - 3) as u32;
            let along = along.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, most as f32));
            let along = along.to_int::<u32x16<S>>().min(u32x16::splat(simd, most));
            cell += (along + 1) * lattice.strides[axis] as u32;
        }
        cell.store_slice(keys);
    }
    for (i, key) in keys.iter_mut().enumerate().skip(whole) {
        *key = lattice.cell([points[0][i], points[1][i], points[2][i]]) as u32;
    }
}

/// Particles sorted by cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Order {
    /// Before: the particle that comes at each place.
    pub from: Vec<u32>,
    /// First particle of each cell, and the number of particles.
    pub starts: Vec<u32>,
    keys: Vec<u32>,
    by_plane: Vec<u32>,
}

impl Order {
    /// Sorts `count` particles at `positions` (longer, perhaps).
    pub fn sort(&mut self, level: Level, lattice: &Lattice, positions: [&[f32]; 3], count: usize) {
        self.keys.resize(count, 0);
        self.by_plane.resize(count, 0);
        self.from.resize(count, 0);
        self.starts.resize(lattice.cells() + 1, 0);
        let [x, y, z] = positions.map(|p| &p[..count]);

        // Each chunk by plane: where its particles of each plane begin in it.
        let chunk_starts: Vec<Vec<u32>> = self
            .keys
            .par_chunks_mut(CHUNK)
            .zip(self.by_plane.par_chunks_mut(CHUNK))
            .enumerate()
            .map(|(chunk, (keys, by_plane))| {
                let first = chunk * CHUNK;
                let end = first + keys.len();
                let points = [&x[first..end], &y[first..end], &z[first..end]];
                dispatch!(level, simd => cells(simd, lattice, points, keys));
                let plane = lattice.plane as u32;
                let mut starts = vec![0u32; lattice.planes + 1];
                for key in &*keys {
                    starts[(key / plane) as usize + 1] += 1;
                }
                for plane in 0..lattice.planes {
                    starts[plane + 1] += starts[plane];
                }
                let mut next = starts.clone();
                for (i, key) in keys.iter().enumerate() {
                    let next = &mut next[(key / plane) as usize];
                    by_plane[*next as usize] = (first + i) as u32;
                    *next += 1;
                }
                starts
            })
            .collect();

        let mut first = 0;
        let mut from = &mut self.from[..];
        let mut planes = Vec::with_capacity(lattice.planes);
        for (plane, cells) in self.starts[..lattice.cells()].chunks_mut(lattice.plane).enumerate() {
            let count: u32 = chunk_starts.iter().map(|s| s[plane + 1] - s[plane]).sum();
            let (own, rest) = from.split_at_mut(count as usize);
            from = rest;
            planes.push((plane, first, cells, own));
            first += count;
        }
        let (keys, by_plane) = (&self.keys, &self.by_plane);
        planes.into_par_iter().for_each(|(plane, first, cells, from)| {
            let members = || {
                chunk_starts.iter().enumerate().flat_map(move |(chunk, starts)| {
                    let begin = chunk * CHUNK;
                    let (a, b) = (starts[plane] as usize, starts[plane + 1] as usize);
                    by_plane[begin + a..begin + b].iter().copied()
                })
            };
            let in_plane = |i: u32| keys[i as usize] as usize - plane * lattice.plane;
            cells.fill(0);
            members().for_each(|i| cells[in_plane(i)] += 1);
            let mut sum = 0;
            for cell in cells.iter_mut() {
                (*cell, sum) = (sum, sum + *cell);
            }
            for i in members() {
                let next = &mut cells[in_plane(i)];
                from[*next as usize] = i;
                *next += 1;
            }
            // Each cell now says where it ends, which is where the next begins.
            let mut begin = first;
            for cell in cells.iter_mut() {
                (*cell, begin) = (begin, first + *cell);
            }
        });
        self.starts[lattice.cells()] = count as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::points;

    #[test]
    fn particles_lie_in_their_cells_in_stable_order() {
        let [x, y, z] = points(20_000, [1.0, 2.0, 0.3]);
        let lattice = Lattice::new([0.0; 3], [1.0, 2.0, 0.3], 0.07);
        let mut order = Order::default();
        order.sort(Level::new(), &lattice, [&x, &y, &z], 20_000);
        let mut seen = 0;
        for cell in 0..lattice.cells() {
            let members = &order.from[order.starts[cell] as usize..order.starts[cell + 1] as usize];
            assert!(members.windows(2).all(|pair| pair[0] < pair[1]));
            for i in members.iter().map(|i| *i as usize) {
                assert_eq!(lattice.cell([x[i], y[i], z[i]]), cell);
            }
            seen += members.len();
        }
        assert_eq!(seen, 20_000);
        assert_eq!(lattice.planes, (2.0f32 / 0.070007) as usize + 3);
    }
}
