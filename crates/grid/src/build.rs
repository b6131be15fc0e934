//! Construction: two counting sorts, parallel, with the same result for any number of threads.
//!
//! The first ([`scatter`](crate::scatter)) brings particles into buckets that fit the cache, in the
//! array that becomes the grid's; the second ([`sort`](crate::sort)) orders each bucket by block and
//! cell, in place. Both are stable, so that the order within a cell is the file's. Few bytes are
//! touched besides the result, for new memory costs more than sorting.

use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};

use fearless_simd::Level;
use glam::Vec3;
use rayon::prelude::*;

use crate::cells::most_cells;
use crate::groups::groups_of;
use crate::places::Places;
use crate::scatter::{Buckets, Source, Survey, scatter};
use crate::sort::{Bucket, Rules, Scratch};
use crate::{Block, Grid, Lattice, Pages, Radii};

/// How fine a grid is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// λ, cells per particle (Gribble et al. 2007, §4.2), for tracing.
    CellsPerParticle(f32),
    /// Edge length of a cell, for neighbours and fullness.
    CellEdge(f32),
}

/// How to build a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// How fine.
    pub resolution: Resolution,
    /// M, cells along a block's edge where particles are evenly spread.
    pub block_cells: u32,
}

impl Default for Params {
    /// λ = 1 and M = 6, Gribble's choice (§5).
    fn default() -> Self {
        Self { resolution: Resolution::CellsPerParticle(1.0), block_cells: 6 }
    }
}

impl Grid {
    /// Builds a grid over those of `positions` that `chosen` lists (all, if `None`).
    ///
    /// `radii` is in the order of `positions`. Particles whose position is not finite are left out.
    /// Positions that are handed over are freed as soon as they are no longer needed.
    ///
    /// # Panics
    /// If there are more than 2³² − 2 positions, or radii and positions differ in number.
    pub fn build<'a>(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        radii: Radii<&[f32]>,
        chosen: Option<&[u32]>,
        params: Params,
    ) -> Self {
        Self::empty().rebuild(positions, radii, chosen, params)
    }

    /// [`Grid::build`] in the memory of a grid that is no longer needed, such as the last frame's.
    ///
    /// # Panics
    /// As [`Grid::build`].
    pub fn rebuild<'a>(
        self,
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        radii: Radii<&[f32]>,
        chosen: Option<&[u32]>,
        params: Params,
    ) -> Self {
        let positions = positions.into();
        assert!(positions.len() < u32::MAX as usize, "too many particles for 32-bit indices");
        if let Radii::Each(each) = radii {
            assert_eq!(each.len(), positions.len(), "one radius per position");
        }
        let level = Level::new();
        let source = Source { positions, radii, chosen };
        let survey = source.survey(level);
        if survey.count == 0 {
            return Self::empty();
        }
        let lattice = lattice_for(&survey, params);
        let buckets = Buckets::new(&source, &survey, &lattice, level);

        let spare = self;
        let mut grid = Self {
            particles: match source.owns() && spare.particles.is_empty() {
                true => Pages::zeroed_by_and_by(survey.count),
                false => spare.particles.reused(survey.count),
            },
            radius: match (radii, spare.radius) {
                (Radii::Uniform(r), _) => Radii::Uniform(r),
                (_, Radii::Each(spare)) => Radii::Each(spare.reused(survey.count)),
                _ => Radii::Each(Pages::zeroed(survey.count)),
            },
            cell_starts: spare.cell_starts,
            blocks: spare.blocks,
            lattice,
            low: survey.low,
            high: survey.high,
            ..Self::empty()
        };
        let radius = grid.radius.each_mut();
        scatter(source, (&survey, &buckets), &mut grid.particles, radius, level);
        let places = Places::of_blocks(&lattice);
        let rules = Rules { lattice: &lattice, places, params, radii, level };
        grid.sort_buckets((&buckets.starts(), &buckets.blocks), &rules);
        grid.sum_up();
        grid
    }

    /// A grid without particles.
    pub fn empty() -> Self {
        Self {
            lattice: Lattice { low: Vec3::ZERO, edge: 1.0, dims: [1, 1, 1] },
            blocks: vec![Block::default(); 2],
            groups: Vec::new(),
            cell_starts: Pages::zeroed(1),
            particles: Pages::new(),
            radius: Radii::Uniform(0.0),
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            least_radius: 0.0,
            greatest_radius: 0.0,
            crowded: Vec::new(),
        }
    }

    /// The second sort: each bucket by itself. Takes where each begins among particles and blocks.
    fn sort_buckets(&mut self, (starts, firsts): (&[usize], &[usize]), rules: &Rules<'_>) {
        self.blocks.resize(rules.lattice.count() + 1, Block::default());
        let counts = || starts.windows(2).map(|pair| pair[1] - pair[0]);
        let each = matches!(self.radius, Radii::Each(_));
        let radii_counts = counts().map(|n| if each { n } else { 0 });
        let end_block = self.blocks.len() - 1;
        let block_counts = || firsts.windows(2).map(|pair| pair[1] - pair[0]);
        let cell_counts: Vec<usize> =
            counts().zip(block_counts()).map(|(n, b)| most_cells(n, b, rules.params)).collect();
        let cells: usize = cell_counts.iter().sum();
        self.cell_starts = std::mem::take(&mut self.cell_starts).reused(cells + 1);

        let mut first_cell = 0;
        let buckets: Vec<Bucket<'_>> = split(&mut self.blocks, block_counts())
            .zip(split(&mut self.particles, counts()))
            .zip(split(self.radius.each_mut(), radii_counts))
            .zip(split(&mut self.cell_starts, cell_counts.into_iter()))
            .enumerate()
            .map(|(b, (((blocks, particles), radii), starts_of_cells))| {
                let bucket = Bucket {
                    first_block: firsts[b],
                    blocks,
                    first: starts[b],
                    particles,
                    radii,
                    first_cell,
                    starts: starts_of_cells,
                };
                first_cell += bucket.starts.len();
                bucket
            })
            .collect();
        // As many as there are threads at work.
        let memories = Mutex::new(Vec::<Scratch>::new());
        let lend = || memories.lock().unwrap_or_else(PoisonError::into_inner);
        let crowded: Vec<Vec<u32>> = buckets
            .into_par_iter()
            .with_max_len(1)
            .map(|bucket| {
                let mut memory = lend().pop().unwrap_or_default();
                let crowded = bucket.sort(rules, &mut memory);
                lend().push(memory);
                crowded
            })
            .collect();
        self.crowded = crowded.concat();
        self.cell_starts[cells] = self.particles.len() as u32;
        self.blocks[end_block] = Block::empty(rules.lattice.low, rules.lattice.edge);
        self.blocks[end_block].first = self.particles.len() as u32;
        self.blocks[end_block].first_cell = cells as u32;
    }

    /// What follows from the blocks.
    fn sum_up(&mut self) {
        self.groups = groups_of(&self.lattice, &self.blocks);
        self.greatest_radius = self.groups.iter().map(|g| g.greatest_radius).fold(0.0, f32::max);
        self.least_radius =
            self.blocks.iter().map(|b| b.least_radius).fold(f32::INFINITY, f32::min);
    }
}

impl Radii<Pages<f32>> {
    /// The radii where they differ, else nothing.
    fn each_mut(&mut self) -> &mut [f32] {
        match self {
            Self::Uniform(_) => &mut [],
            Self::Each(radii) => radii,
        }
    }
}

fn lattice_for(survey: &Survey, params: Params) -> Lattice {
    let (low, high, count) = (survey.low, survey.high, survey.count as f64);
    let m = f64::from(params.block_cells.max(1));
    // A lattice may not be larger than a few times its particles.
    let most = 4.0 * count + 64.0;
    match params.resolution {
        Resolution::CellsPerParticle(lambda) => {
            let blocks = (f64::from(lambda) * count / (m * m * m)).clamp(1.0, most);
            Lattice::with_blocks(low, high, blocks)
        }
        Resolution::CellEdge(edge) => {
            let least = Lattice::with_blocks(low, high, most).edge.into();
            Lattice::with_edge(low, high, (f64::from(edge) * m).max(least))
        }
    }
}

/// Cuts a slice into parts of these lengths; what lies after the last is left out.
fn split<T>(
    slice: &mut [T],
    lengths: impl Iterator<Item = usize>,
) -> impl Iterator<Item = &mut [T]> {
    let mut rest = slice;
    lengths.map(move |length| {
        let (part, after) = std::mem::take(&mut rest).split_at_mut(length);
        rest = after;
        part
    })
}
