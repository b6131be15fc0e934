//! The lattice of blocks: where a point's block lies.
//!
//! N_x = d_x ∛(λN/V) (Gribble et al. 2007, §4.2), solved over the axes that have any extent.

use glam::Vec3;

use crate::places::Places;

/// The lattice of cubic blocks that covers the particles' centres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The corner with the least coordinates.
    pub low: Vec3,
    /// Edge length of a block.
    pub edge: f32,
    /// Blocks along each axis, each at least 1.
    pub dims: [u32; 3],
}

/// No lattice has more blocks along an axis: coordinates stay exact in f32 arithmetic.
const MOST_BLOCKS_PER_AXIS: f64 = (1 << 20) as f64;

impl Lattice {
    /// Covers `low..high` with blocks so that there are about `blocks` of them.
    pub fn with_blocks(low: Vec3, high: Vec3, blocks: f64) -> Self {
        let extent = (high.as_dvec3() - low.as_dvec3()).to_array();
        let edge = edge_for_count(extent, blocks.max(1.0));
        Self::with_edge(low, high, edge)
    }

    /// Covers `low..high` with blocks of the given edge; it grows where more than 2²⁰ would fit
    /// along an axis.
    pub fn with_edge(low: Vec3, high: Vec3, edge: f64) -> Self {
        let extent = (high.as_dvec3() - low.as_dvec3()).to_array();
        let longest = extent.into_iter().fold(0.0, f64::max);
        let edge = edge.max(longest / MOST_BLOCKS_PER_AXIS).max(f64::from(f32::MIN_POSITIVE));
        // A hair wider, so that the greatest coordinate falls inside the last block.
        let edge = ((edge * (1.0 + 1e-6)) as f32).min(f32::MAX);
        let dims = extent.map(|e| ((e / f64::from(edge)).ceil() as u32).max(1));
        Self { low, edge, dims }
    }

    /// The number of blocks.
    pub fn count(&self) -> usize {
        self.dims.iter().map(|d| *d as usize).product()
    }

    /// The block along each axis that holds point `p`; points outside fall into the nearest block.
    pub fn block_of(&self, p: Vec3) -> [u32; 3] {
        Places::of_blocks(self).along(p.to_array())
    }

    /// The position of a block in the list of blocks: x fastest.
    #[inline]
    pub fn index(&self, block: [u32; 3]) -> usize {
        let [x, y, z] = block.map(|b| b as usize);
        let [nx, ny, _] = self.dims.map(|d| d as usize);
        (z * ny + y) * nx + x
    }

    /// The block at a position in the list of blocks.
    pub fn block_at(&self, index: usize) -> [u32; 3] {
        let [nx, ny, _] = self.dims.map(|d| d as usize);
        [(index % nx) as u32, (index / nx % ny) as u32, (index / (nx * ny)) as u32]
    }

    /// The corner of a block with the least coordinates.
    pub fn corner(&self, block: [u32; 3]) -> Vec3 {
        self.low + Vec3::from_array(block.map(|b| b as f32)) * self.edge
    }
}

/// The edge h for which ∏ max(1, dᵢ/h) = `count`; an axis shorter than h counts as one.
pub(crate) fn edge_for_count(extent: [f64; 3], count: f64) -> f64 {
    let mut sorted = extent;
    sorted.sort_by(f64::total_cmp);
    // Drop the shortest axes while they are thinner than the edge the others ask for.
    for thin in 0..3 {
        let thick = &sorted[thin..];
        let edge = (thick.iter().product::<f64>() / count).powf(1.0 / thick.len() as f64);
        if edge <= thick[0] && edge > 0.0 {
            return edge;
        }
    }
    // One holds all.
    if sorted[2] > 0.0 { sorted[2] } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_is_cut_into_as_many_blocks_as_asked() {
        let lattice = Lattice::with_blocks(Vec3::ZERO, Vec3::ONE, 1000.0);
        assert_eq!(lattice.dims, [10, 10, 10]);
        assert_eq!(lattice.block_of(Vec3::ONE), [9, 9, 9]);
        assert_eq!(lattice.block_of(Vec3::splat(0.05)), [0, 0, 0]);
    }

    #[test]
    fn planes_lines_and_points_have_lattices_too() {
        let plane = Lattice::with_blocks(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), 100.0);
        assert_eq!(plane.dims, [10, 10, 1]);
        let line = Lattice::with_blocks(Vec3::ZERO, Vec3::new(0.0, 5.0, 0.0), 7.0);
        assert_eq!(line.dims, [1, 7, 1]);
        let point = Lattice::with_blocks(Vec3::ONE, Vec3::ONE, 1e6);
        assert_eq!(point.dims, [1, 1, 1]);
    }

    #[test]
    fn index_and_block_are_inverse() {
        let lattice = Lattice { low: Vec3::ZERO, edge: 1.0, dims: [3, 4, 5] };
        for i in 0..lattice.count() {
            assert_eq!(lattice.index(lattice.block_at(i)), i);
        }
    }
}
