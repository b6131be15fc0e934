//! What rays go through: the field, and how far they may jump in it.
//!
//! A cell is *active* if the threshold lies between the densities of its corners, or if a drop touches it.
//! Each cell knows a number n such that no cell within n − 1 of it (the greatest of the three differences)
//! is active: a ray may go on to where it leaves the cube of these. n is 1, 2, 4, 8 or 16, from the cells that
//! active ones reach when they grow by 1, 3, 7 and 15, all made by shifting whole words.

use fearless_simd::{Level, dispatch, mask8x64, prelude::*, u8x64};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use crate::bits::Bits;
use crate::drops::Drops;
use crate::field::Field;
use crate::params::{Params, Particles};

/// Of a cell with a surface.
pub(crate) const SURFACE: u8 = 0;
/// Of a cell with drops, and a surface perhaps.
pub(crate) const DROPS: u8 = 255;

/// What rays go through. It keeps its memory from one field to the next.
#[derive(Clone, Debug, Default)]
pub struct Space {
    /// Density at the surface.
    pub threshold: f32,
    /// [`SURFACE`], [`DROPS`], or how far a ray may jump; rows are `row` long.
    pub(crate) jumps: Vec<u8>,
    /// From a row of cells to the next.
    pub(crate) row: usize,
    /// Cells along each axis.
    pub(crate) cells: [usize; 3],
    /// The box of all active cells, in voxels: low and high corner.
    pub(crate) bounds: [Vec3; 2],
    /// Particles by themselves.
    pub(crate) drops: Drops,
    /// Cells deeper in the liquid than all of their corners.
    inside: Bits,
    active: Bits,
    grown: [Bits; 4],
    flat: Bits,
}

impl Space {
    /// Finds what rays can skip in `field`, which `particles` have made.
    pub fn fill(
        &mut self,
        field: &Field,
        (particles, params): (&Particles<'_>, &Params),
        level: Level,
    ) {
        self.threshold = params.threshold;
        self.cells = field.lattice.cells();
        self.find_active(field, level);
        self.drops.find(field, (particles, params), &self.inside);
        let Self { drops, active, .. } = self;
        drops.cells().for_each(|cell| active.set(cell));
        let none = [[0; 3]; 2];
        let [low, high] = self.active.bounds().unwrap_or(none);
        let corner =
            |cell: [usize; 3], more: usize| Vec3::from_array(cell.map(|c| (c + more) as f32));
        let empty = self.active.bits.iter().all(|w| *w == 0);
        self.bounds = [corner(low, 0), corner(high, usize::from(!empty))];
        self.find_jumps(level);
        for cell in self.drops.cells() {
            let at = (cell[2] * self.cells[1] + cell[1]) * self.row + cell[0];
            self.jumps[at] = DROPS;
        }
    }

    /// How many particles are drops.
    pub fn drop_count(&self) -> usize {
        self.drops.len()
    }

    /// Bytes of all parts.
    pub fn bytes(&self) -> usize {
        let bits = [&self.inside, &self.active, &self.flat].into_iter().chain(&self.grown);
        self.jumps.len() + bits.map(|b| size_of_val(&b.bits[..])).sum::<usize>()
    }

    /// Cells with a surface, and those inside.
    fn find_active(&mut self, field: &Field, level: Level) {
        let dims = field.lattice.dims;
        // Of nodes.
        self.flat.resize(dims);
        let (words, threshold, stride) = (self.flat.words, self.threshold, field.stride());
        let rows = self.flat.bits.par_chunks_mut(words * dims[1]);
        rows.zip(field.values.par_chunks(stride * dims[1])).for_each(|(bits, values)| {
            for (bits, values) in bits.chunks_exact_mut(words).zip(values.chunks_exact(stride)) {
                dispatch!(level, simd => above(simd, &values[..dims[0]], threshold, bits));
            }
        });
        self.active.resize(self.cells);
        self.inside.resize(self.cells);
        let (nodes, [nx, ny, _]) = (&self.flat, self.cells);
        let plane = self.active.plane();
        let active = self.active.bits.par_chunks_mut(plane);
        active.zip(self.inside.bits.par_chunks_mut(plane)).enumerate().for_each(|(z, (a, i))| {
            let own = self.cells[0].div_ceil(64);
            for y in 0..ny {
                let row = |y: usize, z: usize| {
                    let from = (z * dims[1] + y) * words;
                    &nodes.bits[from..from + words]
                };
                let rows = [row(y, z), row(y + 1, z), row(y, z + 1), row(y + 1, z + 1)];
                for word in 0..own {
                    let (any, all) = corners(&rows, word);
                    let left = nx - word * 64;
                    let there = if left >= 64 { u64::MAX } else { (1 << left) - 1 };
                    a[y * own + word] = any & !all & there;
                    i[y * own + word] = all & there;
                }
            }
        });
    }

    /// How far rays may jump from each cell.
    fn find_jumps(&mut self, level: Level) {
        let [one, three, seven, fifteen] = &mut self.grown;
        one.spread(&self.active, 1, &mut self.flat);
        three.spread(one, 2, &mut self.flat);
        seven.spread(three, 4, &mut self.flat);
        fifteen.spread(seven, 8, &mut self.flat);
        self.row = self.active.words * 64;
        self.jumps.resize(self.active.bits.len() * 64, 0);
        let chunk = self.active.plane();
        let sets = [&self.active, &*one, &*three, &*seven, &*fifteen];
        self.jumps.par_chunks_mut(chunk * 64).enumerate().for_each(|(plane, jumps)| {
            let words = sets.map(|set| &set.bits[plane * chunk..(plane + 1) * chunk]);
            dispatch!(level, simd => spell(simd, words, jumps));
        });
    }
}

/// Bits of the values that are not below the threshold.
#[simd]
fn above<S: Simd>(simd: S, values: &[f32], threshold: f32, bits: &mut [u64]) {
    let threshold = fearless_simd::f32x16::splat(simd, threshold);
    for (values, word) in values.chunks(64).zip(bits) {
        *word = 0;
        for (part, values) in values.chunks(16).enumerate() {
            let found = match values.len() {
                16 => {
                    fearless_simd::f32x16::from_slice(simd, values).simd_ge(threshold).to_bitmask()
                }
                _ => {
                    let mut last = [f32::NEG_INFINITY; 16];
                    last[..values.len()].copy_from_slice(values);
                    fearless_simd::f32x16::from_slice(simd, &last).simd_ge(threshold).to_bitmask()
                }
            };
            *word |= found << (16 * part);
        }
    }
}

/// Whether any of the corners of 64 cells is above the threshold, and whether all are, from the rows of nodes
/// about them.
#[inline(always)]
fn corners(rows: &[&[u64]; 4], word: usize) -> (u64, u64) {
    let (mut any, mut all) = (0, u64::MAX);
    for row in rows {
        let next = row.get(word + 1).copied().unwrap_or(0);
        let right = row[word] >> 1 | next << 63;
        any |= row[word] | right;
        all &= row[word] & right;
    }
    (any, all)
}

/// Writes out what bits say of each cell.
#[simd]
fn spell<S: Simd>(simd: S, [active, one, three, seven, fifteen]: [&[u64]; 5], jumps: &mut [u8]) {
    for (word, jumps) in jumps.chunks_exact_mut(64).enumerate() {
        let mut value = u8x64::splat(simd, 16);
        for (bits, jump) in [(fifteen, 8), (seven, 4), (three, 2), (one, 1), (active, SURFACE)] {
            let near = mask8x64::from_bitmask(simd, bits[word]);
            value = near.select(u8x64::splat(simd, jump), value);
        }
        value.store_slice(jumps);
    }
}
