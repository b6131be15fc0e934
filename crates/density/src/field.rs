//! The density field: particles by tile, the rough field, the fine field.

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use rayon::prelude::*;

use crate::bins::{Bins, Survey};
use crate::fine::{self, LANES, Source, Tile};
use crate::lattice::{Lattice, reach};
use crate::params::{Params, Particles};
use crate::rough::{self, Rough};

/// Rows along a tile's edge, at the least.
const TILE: usize = 8;
/// Edge of a voxel in mean radii, at the least: finer ones would show nothing more.
const LEAST_VOXEL: f32 = 0.25;
/// Rows that are worth larger tiles, which fewer particles share.
const MANY_ROWS: usize = 1 << 13;

/// What was done for a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Particles that have a density.
    pub particles: u64,
    /// How often one was visited, by tiles.
    pub visits: u64,
    /// Voxels written by particles, one after the other; where asked for.
    pub updates: u64,
}

/// A density field. It keeps its memory from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Field {
    /// Where its nodes lie.
    pub lattice: Lattice,
    /// Density of each node, x fastest; rows are [`Self::stride`] long.
    pub values: Vec<f32>,
    /// What was done.
    pub counts: Counts,
    bins: Bins,
    rough: Rough,
}

impl Field {
    /// Makes the field of `particles` in place of the last.
    pub fn fill(&mut self, particles: &Particles<'_>, params: &Params, level: Level) {
        self.make::<false>(particles, params, level);
    }

    /// As [`Self::fill`], and counts the voxels that are written.
    pub fn fill_counted(&mut self, particles: &Particles<'_>, params: &Params, level: Level) {
        self.make::<true>(particles, params, level);
    }

    fn make<const COUNTED: bool>(
        &mut self,
        particles: &Particles<'_>,
        params: &Params,
        level: Level,
    ) {
        let survey = Survey::new(particles);
        if survey.count == 0 {
            *self = Self { lattice: Lattice::default(), ..std::mem::take(self) };
            self.counts = Counts::default();
            self.values.clear();
            self.values.resize(self.stride() * 16, 0.0);
            return;
        }
        let (radius, mean) = (survey.greatest_radius, (survey.radii / survey.count as f64) as f32);
        let voxel = params.voxel.max(LEAST_VOXEL * mean);
        let params = &Params { voxel, ..*params };
        self.lattice = Lattice::new((survey.low, survey.high), radius, params);
        let lattice = self.lattice;
        let edge = rough::edge(mean, lattice.voxel);
        let tile = if lattice.dims[1] * lattice.dims[2] >= MANY_ROWS { 2 * TILE } else { TILE };
        self.bins.fill(particles, &lattice, (params, edge.max(tile)));
        if params.rough {
            let far = reach(radius, lattice.voxel, params) / lattice.voxel;
            self.rough.fill((&self.bins, particles), &lattice, (edge, far));
        }
        let rough = params.rough.then_some(&self.rough);
        let source = Source::new(*particles, (&lattice, params), rough);
        let stride = self.stride();
        self.values.resize(stride * lattice.dims[1] * lattice.dims[2], 0.0);
        let bins = &self.bins;
        let mut tiles = tiles(&mut self.values, stride, (bins, &lattice));
        let masked = params.masked && particles.masks.is_some();
        tiles.par_iter_mut().enumerate().with_max_len(1).for_each(|(number, tile)| {
            begin(tile, &source);
            for entries in bins.parts(number) {
                dispatch!(level, simd => match (masked, params.rough) {
                    (true, true) => fine::add::<_, true, true, COUNTED>(simd, &source, entries, tile),
                    (true, false) => fine::add::<_, true, false, COUNTED>(simd, &source, entries, tile),
                    (false, true) => fine::add::<_, false, true, COUNTED>(simd, &source, entries, tile),
                    (false, false) => fine::add::<_, false, false, COUNTED>(simd, &source, entries, tile),
                });
            }
        });
        let sum = |of: fn(&Tile<'_>) -> u64| tiles.iter().map(of).sum();
        self.counts = Counts {
            particles: survey.count as u64,
            visits: sum(|t| t.visits),
            updates: sum(|t| t.updates),
        };
    }

    /// Numbers in a row: a vector may begin at any node.
    pub fn stride(&self) -> usize {
        self.lattice.dims[0].next_multiple_of(LANES) + LANES
    }

    /// The density at a place in voxels, trilinear between nodes; 0 outside.
    pub fn at(&self, place: Vec3) -> f32 {
        let cells = self.lattice.cells();
        let cell = place.floor();
        let inside = (0..3).all(|a| cell[a] >= 0.0 && (cell[a] as usize) < cells[a]);
        if !inside {
            return 0.0;
        }
        let [x, y, z] = cell.to_array().map(|v| v as usize);
        let u = place - cell;
        let along = |y: usize, z: usize| {
            let at = self.index([x, y, z]);
            self.values[at] + (self.values[at + 1] - self.values[at]) * u.x
        };
        let plane = |z: usize| along(y, z) + (along(y + 1, z) - along(y, z)) * u.y;
        plane(z) + (plane(z + 1) - plane(z)) * u.z
    }

    /// Where the value of a node is.
    #[inline(always)]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.lattice.dims[1] + y) * self.stride() + x
    }

    /// Bytes of all parts.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }
}

/// The rows of each tile.
fn tiles<'a>(
    values: &'a mut [f32],
    stride: usize,
    (bins, lattice): (&Bins, &Lattice),
) -> Vec<Tile<'a>> {
    let empty = |tile: usize| {
        let [y, z] = bins.tiles.rows(tile, lattice).map(|rows| [rows.start, rows.len()]);
        Tile { rows: Vec::with_capacity(y[1] * z[1]), y, z, updates: 0, visits: 0 }
    };
    let mut tiles: Vec<Tile<'a>> = (0..bins.tiles.count()).map(empty).collect();
    for (number, row) in values.chunks_exact_mut(stride).enumerate() {
        let (y, z) = (number % lattice.dims[1], number / lattice.dims[1]);
        tiles[bins.tiles.of_row([y, z])].rows.push(row);
    }
    tiles
}

/// Sets the rows of a tile to what the rough field says.
fn begin(tile: &mut Tile<'_>, source: &Source<'_>) {
    for (number, row) in tile.rows.iter_mut().enumerate() {
        row.fill(0.0);
        let Some(rough) = source.rough else { continue };
        let [y, z] = [tile.y[0] + number % tile.y[1], tile.z[0] + number / tile.y[1]];
        rough.visit_row([y, z], |run| {
            if let Some(voxels) = row.get_mut(run) {
                voxels.fill(source.params.saturation);
            }
        });
    }
}
