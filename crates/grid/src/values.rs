//! A property of the particles in the order of a grid's cells, and its range in every block.

use rayon::prelude::*;

use crate::Grid;

/// One property for one grid, for culling by range (Gribble et al. 2007, §4.3): blocks that a range leaves
/// out, or keeps whole, are known without touching their particles.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockValues {
    /// The value of each particle, in the order of cells.
    pub values: Vec<f32>,
    /// What there is in each block.
    pub ranges: Vec<BlockRange>,
}

/// The values in one block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockRange {
    /// Least value; +∞ where none is a number.
    pub low: f32,
    /// Greatest value; −∞ where none is a number.
    pub high: f32,
    /// Whether some value is not a number, and so in no range.
    pub gaps: bool,
}

impl BlockRange {
    const NOTHING: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY, gaps: false };

    fn with(self, value: f32) -> Self {
        Self {
            low: self.low.min(value),
            high: self.high.max(value),
            gaps: self.gaps || value.is_nan(),
        }
    }
}

impl BlockValues {
    /// Those of `value`, a function of a particle's index in the file's order. NaN is in no range.
    pub fn of(grid: &Grid, value: impl Fn(u32) -> f32 + Sync) -> Self {
        let particles = grid.particles.par_iter().with_min_len(1 << 12);
        let values: Vec<f32> = particles.map(|p| value(p.index)).collect();
        let range = |block| {
            let own = &values[grid.particles_of(block)];
            own.iter().fold(BlockRange::NOTHING, |range, value| range.with(*value))
        };
        let blocks = (0..grid.blocks.len() - 1).into_par_iter().with_min_len(64);
        let ranges = blocks.map(range).collect();
        Self { values, ranges }
    }

    /// Bytes it holds.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..]) + size_of_val(&self.ranges[..])
    }
}
