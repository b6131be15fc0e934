//! The density field: particles by tile, the rough field, the fine field.

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use rayon::prelude::*;

use crate::bins::{Bins, Survey, Tiles};
use crate::fine::{self, Desk, Rows, Source, WIDE};
use crate::lattice::{Lattice, reach};
use crate::params::{Params, Particles};
use crate::rough::{self, Rough};

/// Rows of cells along a tile's edge, at the least.
const TILE: usize = 4;
/// Edge of a voxel in mean radii, at the least: finer ones would show nothing more.
const LEAST_VOXEL: f32 = 0.25;

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
    desks: Vec<Desk>,
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
            self.desks.clear();
            self.values.clear();
            self.values.resize(self.stride() * 16, 0.0);
            return;
        }
        let (radius, mean) = (survey.greatest_radius, (survey.radii / survey.count as f64) as f32);
        let voxel = params.voxel.max(LEAST_VOXEL * mean);
        let params = &Params { voxel, ..*params };
        self.lattice = Lattice::new((survey.low, survey.high), radius, params);
        let lattice = self.lattice;
        let far = reach(radius, lattice.voxel, params) / lattice.voxel;
        let half = far.ceil() as usize;
        let rough_edge = rough::edge(mean, lattice.voxel);
        // Of tiles that are not neighbours, particles reach no row in common.
        let edge = (2 * half - 1).max(rough_edge).max(TILE).next_power_of_two();
        self.bins.fill(particles, &lattice, edge);
        let Self { bins, desks, .. } = self;
        // Their memory is kept.
        desks.resize_with(bins.tiles.count(), Desk::default);
        desks.par_iter_mut().enumerate().with_max_len(1).for_each(|(tile, desk)| {
            desk.sort(bins.of(tile), (&lattice, bins.tiles), bins.tiles.first(tile));
        });
        if params.rough {
            self.rough.fill((desks, bins.tiles, particles), &lattice, (rough_edge, far));
        }
        self.add::<COUNTED>(particles, params, (half, level));
        let sum = |of: fn(&Desk) -> u64| self.desks.iter().map(of).sum();
        let (visits, updates) = (sum(|desk| desk.visits), sum(|desk| desk.updates));
        self.counts = Counts { particles: survey.count as u64, visits, updates };
    }

    /// Adds up the densities of all particles, which are sorted; the colors of tiles one after the other.
    fn add<const COUNTED: bool>(
        &mut self,
        particles: &Particles<'_>,
        params: &Params,
        (half, level): (usize, Level),
    ) {
        let (stride, lattice) = (self.stride(), self.lattice);
        let Self { values, bins, desks, rough, .. } = self;
        let rough = params.rough.then_some(&*rough);
        let source = Source::new(*particles, (&lattice, params), rough);
        values.resize(stride * lattice.dims[1] * lattice.dims[2], 0.0);
        begin(values, stride, &source);
        let masked = params.masked && particles.masks.is_some();
        for color in 0..4 {
            let mut some = of_color(color, (values, desks), (bins.tiles, half), (stride, &lattice));
            some.par_iter_mut().with_max_len(1).for_each(|(desk, rows)| {
                dispatch!(level, simd => match (masked, params.rough) {
                    (true, true) => fine::add::<_, true, true, COUNTED>(simd, &source, desk, rows),
                    (true, false) => fine::add::<_, true, false, COUNTED>(simd, &source, desk, rows),
                    (false, true) => fine::add::<_, false, true, COUNTED>(simd, &source, desk, rows),
                    (false, false) => fine::add::<_, false, false, COUNTED>(simd, &source, desk, rows),
                });
            });
        }
    }

    /// Numbers in a row: a vector may begin at any node.
    pub fn stride(&self) -> usize {
        self.lattice.dims[0].next_multiple_of(WIDE) + WIDE
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

    /// The particles of a tile, by cell.
    pub(crate) fn desks(&self) -> &[Desk] {
        &self.desks
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

/// Sets all to what the rough field says.
fn begin(values: &mut [f32], stride: usize, source: &Source<'_>) {
    let ny = source.lattice.dims[1];
    values.par_chunks_mut(stride * ny).enumerate().for_each(|(z, plane)| {
        plane.fill(0.0);
        let Some(rough) = source.rough else { return };
        for (y, row) in plane.chunks_exact_mut(stride).enumerate() {
            rough.visit_row([y, z], |run| {
                if let Some(voxels) = row.get_mut(run) {
                    voxels.fill(source.params.saturation);
                }
            });
        }
    });
}

/// A tile's particles, and the rows that they reach.
type Work<'a> = (&'a mut Desk, Rows<'a>);

/// The tiles of a color, of four, and the rows less than `half` from their cells. Of two colors
/// along each axis, tiles of one are so far apart that no row is of two.
fn of_color<'a>(
    color: usize,
    (values, desks): (&'a mut [f32], &'a mut [Desk]),
    (tiles, half): (Tiles, usize),
    (stride, lattice): (usize, &Lattice),
) -> Vec<Work<'a>> {
    let own = [color % 2, color / 2];
    let many = [0, 1].map(|a| (tiles.dims[a] + 1 - own[a]) / 2);
    // Rows count from the first tile's first one on, which may lie before all.
    let begin = [0, 1].map(|a| own[a] * tiles.edge);
    let (period, high) = (2 * tiles.edge, tiles.edge + 2 * half - 1);
    let place = |a: usize, row: usize| {
        let from = (row + half - 1).checked_sub(begin[a])?;
        let number = from / period;
        (number < many[a] && from % period < high).then_some(number)
    };
    let mut some: Vec<Work<'a>> = Vec::with_capacity(many[0] * many[1]);
    for (number, desk) in desks.iter_mut().enumerate() {
        let at = [number % tiles.dims[0], number / tiles.dims[0]];
        if (0..2).all(|a| at[a] % 2 == own[a]) {
            let along = [0, 1].map(|a| {
                let first = (at[a] * tiles.edge + 1).saturating_sub(half);
                let end = (at[a] * tiles.edge + tiles.edge + half).min(lattice.dims[a + 1]);
                [first, end.saturating_sub(first)]
            });
            let rows = Vec::with_capacity(along[0][1] * along[1][1]);
            let first = along.map(|[first, _]| first);
            some.push((desk, Rows { rows, first, along: along[0][1] }));
        }
    }
    for (number, row) in values.chunks_exact_mut(stride).enumerate() {
        let (y, z) = (number % lattice.dims[1], number / lattice.dims[1]);
        if let (Some(y), Some(z)) = (place(0, y), place(1, z)) {
            some[z * many[0] + y].1.rows.push(row);
        }
    }
    some
}
