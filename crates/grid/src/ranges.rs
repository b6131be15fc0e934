//! Least and greatest values of a property per block.

use rayon::prelude::*;

use crate::Grid;

/// The range of one property in every block of one grid, for culling by range (Gribble et al. 2007,
/// §4.3) without touching the particles.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockRanges {
    /// Least and greatest value per block; (+∞, −∞) where no value is a number.
    pub ranges: Vec<(f32, f32)>,
}

impl BlockRanges {
    /// The ranges of `value`, a function of a particle's index in the file's order. NaN is in no range.
    pub fn of(grid: &Grid, value: impl Fn(u32) -> f32 + Sync) -> Self {
        let blocks = grid.blocks.len() - 1;
        let ranges = (0..blocks)
            .into_par_iter()
            .with_min_len(64)
            .map(|block| {
                grid.particles[grid.particles_of(block)]
                    .iter()
                    .map(|p| value(p.index))
                    .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| {
                        (low.min(v), high.max(v))
                    })
            })
            .collect();
        Self { ranges }
    }
}
