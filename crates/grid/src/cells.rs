//! How a block is cut into cells.

use glam::Vec3;

use crate::lattice::edge_for_count;
use crate::{Block, Params, Resolution};

/// A cell is at least this many greatest radii wide: finer cells would only be visited, not culled by.
const LEAST_CELL_EDGE_RADII: f32 = 1.0;
/// A bucket has room for this many times the cells that λ wants: rounding to whole cells makes some
/// blocks have more.
const SLACK: f64 = 1.0625;

impl Block {
    /// A block without particles.
    pub(crate) fn empty(corner: Vec3, cell_edge: f32) -> Self {
        Self {
            cell_low: corner,
            cell_edge,
            least_radius: f32::INFINITY,
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            ..Self::default()
        }
    }

    /// Chooses the cells of a block with `count` particles, at least one: no more than `most`.
    pub(crate) fn divide(
        &mut self,
        (count, most): (usize, usize),
        params: Params,
        block_edge: f64,
    ) {
        self.cells = match params.resolution {
            Resolution::CellEdge(_) => [params.block_cells.max(1); 3],
            Resolution::CellsPerParticle(lambda) => {
                let extent = (self.high.as_dvec3() - self.low.as_dvec3()).to_array();
                let wanted = (f64::from(lambda) * count as f64).max(1.0);
                let most = (1.5 * wanted).min(most as f64);
                let even = edge_for_count(extent, wanted);
                // Whole numbers of cells near the even edge, and an edge with which they cover the box.
                let dims = extent.map(|e| (e / even).round().max(1.0));
                let cover = (0..3).map(|i| extent[i] / dims[i]).fold(0.0, f64::max);
                let least = f64::from(LEAST_CELL_EDGE_RADII * self.greatest_radius);
                // Particles at one point need no cells finer than their block.
                let mut edge = if cover > 0.0 { cover.max(least) } else { block_edge };
                let cells = |edge: f64| extent.map(|e| ((e / edge * (1.0 - 1e-6)).ceil()).max(1.0));
                while cells(edge).iter().product::<f64>() > most {
                    edge *= 1.1;
                }
                self.cell_low = self.low;
                self.cell_edge = (edge as f32).min(f32::MAX);
                cells(edge).map(|c| c as u32)
            }
        };
    }
}

/// How many cells `particles` in the first `blocks` blocks of a bucket have at most. Where the cells of
/// a bucket begin is thus known before it is sorted.
pub(crate) fn most_cells(particles: usize, blocks: usize, params: Params) -> usize {
    match params.resolution {
        Resolution::CellEdge(_) => {
            blocks.min(particles) * params.block_cells.max(1).pow(3) as usize
        }
        Resolution::CellsPerParticle(lambda) => {
            (SLACK * f64::from(lambda) * particles as f64) as usize + blocks.min(particles)
        }
    }
}
