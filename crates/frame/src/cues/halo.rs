//! What is dark behind something nearer.
//!
//! The picture is divided into cells. Each counts its surfaces by distance, in slices of the visible range:
//! N_s, how many are nearer than slice s. Smoothed over the cells around, N at the place and distance of a
//! surface, less a structure's depth, is the part of its surroundings that lies before it. A surface is never
//! before itself, so that nothing falls onto what casts it. (As occlusion from the depths of a picture, Luft,
//! Colditz & Deussen 2006, but each neighbour counts no more than once, however near it is.)

#![allow(clippy::needless_range_loop)] // closures and iterators leave the instruction set of a kernel

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use super::patch::Layers;
use super::{Cues, Stroke};

const SLICES: usize = 16;
/// The last slice.
const LAST: f32 = (SLICES - 1) as f32;
/// Cells from the middle of a halo to its end.
const REACH: usize = 4;

/// How many surfaces are nearer than each slice, 1 for all that a cell could hold.
pub(super) type Counts = [f32; SLICES];

/// How much is before each place of a picture.
pub(super) struct Shade {
    strength: f32,
    /// Edge of a cell, pixels.
    cell: usize,
    size: [usize; 2],
    cells: Vec<Counts>,
    near: f32,
    /// Slices per world unit.
    per_unit: f32,
    /// What is nearer by less is not before, slices.
    clear: f32,
}

impl Shade {
    pub fn new(cues: &Cues, halo: Stroke, layers: &Layers<'_>, level: Level) -> Self {
        let [width, height] = layers.size;
        let reach = halo.width * height as f32;
        let cell = (reach / REACH as f32).round().max(1.0) as usize;
        let [near, far] = cues.range;
        let per_unit = LAST / (far - near).max(f32::MIN_POSITIVE);
        let mut shade = Self {
            strength: halo.strength,
            cell,
            size: [width.div_ceil(cell), height.div_ceil(cell)],
            cells: Vec::new(),
            near,
            per_unit,
            clear: 1.0 + cues.structure * per_unit,
        };
        let mut cells = vec![[0.0; SLICES]; shade.size[0] * shade.size[1]];
        let columns = shade.size[0];
        let rows = cells.par_chunks_mut(columns).enumerate();
        rows.for_each(|(row, cells)| shade.count(layers, row, cells));
        let weights = weights(reach / cell as f32);
        let mut across = vec![[0.0; SLICES]; cells.len()];
        across.par_chunks_mut(columns).zip(cells.par_chunks(columns)).for_each(|(to, from)| {
            dispatch!(level, simd => average_row(simd, &weights, from, to));
        });
        let rows = cells.par_chunks_mut(columns).enumerate();
        rows.for_each(|(y, to)| {
            dispatch!(level, simd => average_column(simd, &weights, (&across, y), to));
        });
        shade.cells = cells;
        shade
    }

    /// Counts what the cells of a row hold, by the slice that is behind it.
    fn count(&self, layers: &Layers<'_>, row: usize, cells: &mut [Counts]) {
        let ([width, height], cell) = (layers.size, self.cell);
        // A part of the pixels says enough, evenly spread.
        let step = if cell < 3 { 1 } else { 2 };
        for y in row * cell..((row + 1) * cell).min(height) {
            let distances = layers.depth[y * width..][..width].chunks(cell);
            for (counts, distances) in cells.iter_mut().zip(distances) {
                for distance in distances.iter().skip(y % step).step_by(step) {
                    if *distance < f32::INFINITY {
                        let slice = ((distance - self.near) * self.per_unit).clamp(0.0, LAST);
                        let at = slice as usize;
                        let part = slice - at as f32;
                        counts[at.min(SLICES - 1)] += 1.0 - part;
                        counts[(at + 1).min(SLICES - 1)] += part;
                    }
                }
            }
        }
        let all = step as f32 / (cell * cell) as f32;
        for counts in cells {
            let mut sum = 0.0;
            for count in counts {
                sum += *count * all;
                *count = sum;
            }
        }
    }

    /// How much is before the surfaces of a row of the picture from pixel (x, y) on, at `distances`, times the
    /// strength. `line` is memory for a row of cells.
    #[inline(always)]
    pub fn behind<S: Simd>(
        &self,
        simd: S,
        ([first, y], line): ([usize; 2], &mut Vec<Counts>),
        distances: &[f32],
        halo: &mut [f32],
    ) {
        let [columns, rows] = self.size;
        let per_pixel = 1.0 / self.cell as f32;
        let (above, below, v) = beside((y as f32 + 0.5) * per_pixel - 0.5, rows);
        line.resize(columns, [0.0; SLICES]);
        let cells = first / self.cell..((first + distances.len()) / self.cell + 2).min(columns);
        let first_cell = cells.start.saturating_sub(1);
        for (x, counts) in line[..cells.end].iter_mut().enumerate().skip(first_cell) {
            let above = f32x16::from_slice(simd, &self.cells[above * columns + x]);
            let below = f32x16::from_slice(simd, &self.cells[below * columns + x]);
            (above + (below - above) * v).store_slice(counts);
        }
        for (x, (halo, distance)) in halo.iter_mut().zip(distances).enumerate() {
            // Counted from the slice before the first, in which nothing is.
            let slice = (distance - self.near) * self.per_unit - self.clear + 1.0;
            if slice <= 0.0 || *distance == f32::INFINITY {
                *halo = 0.0;
                continue;
            }
            let slice = slice.min(LAST + 1.0);
            let low = slice as usize;
            let (left, right, u) = beside(((first + x) as f32 + 0.5) * per_pixel - 0.5, columns);
            let (left, right) = (&line[left], &line[right]);
            let high = low.min(SLICES - 1);
            let after = left[high] + (right[high] - left[high]) * u;
            let before = match low.checked_sub(1) {
                Some(low) => left[low] + (right[low] - left[low]) * u,
                None => 0.0,
            };
            // Half of what is around an edge is before it.
            let part = 2.0 * (before + (after - before) * (slice - low as f32));
            *halo = part.min(1.0) * self.strength;
        }
    }
}

/// The two of `count` cells that a place lies between, counted in cells, and how near it is to the second.
#[inline(always)]
fn beside(place: f32, count: usize) -> (usize, usize, f32) {
    let place = place.max(0.0);
    let low = place as usize;
    (low.min(count - 1), (low + 1).min(count - 1), place - low as f32)
}

/// The weights of cells by how far away they are, all together 1.
fn weights(reach: f32) -> [f32; REACH + 1] {
    let weight = |d: usize| (1.0 - (d as f32 / (reach + 0.5)).powi(2)).max(0.0).powi(2);
    let weights: [f32; REACH + 1] = std::array::from_fn(weight);
    let sum = 2.0 * weights.iter().sum::<f32>() - weights[0];
    weights.map(|weight| weight / sum)
}

#[simd]
fn average_row<S: Simd>(simd: S, weights: &[f32], from: &[Counts], to: &mut [Counts]) {
    let last = from.len() - 1;
    for (x, to) in to.iter_mut().enumerate() {
        let mut sum = f32x16::from_slice(simd, &from[x]) * weights[0];
        for (d, weight) in weights.iter().enumerate().skip(1) {
            let before = f32x16::from_slice(simd, &from[x.saturating_sub(d)]);
            let after = f32x16::from_slice(simd, &from[(x + d).min(last)]);
            sum += (before + after) * *weight;
        }
        sum.store_slice(to);
    }
}

#[simd]
fn average_column<S: Simd>(
    simd: S,
    weights: &[f32],
    (from, y): (&[Counts], usize),
    to: &mut [Counts],
) {
    let columns = to.len();
    let last = from.len() / columns - 1;
    for (x, to) in to.iter_mut().enumerate() {
        let mut sum = f32x16::from_slice(simd, &from[y * columns + x]) * weights[0];
        for (d, weight) in weights.iter().enumerate().skip(1) {
            let before = f32x16::from_slice(simd, &from[y.saturating_sub(d) * columns + x]);
            let after = f32x16::from_slice(simd, &from[(y + d).min(last) * columns + x]);
            sum += (before + after) * *weight;
        }
        sum.store_slice(to);
    }
}
