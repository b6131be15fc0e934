//! The grid itself: blocks, cells, and the particles in cell order.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::{Group, Lattice, Pages};

/// Radii of particles, all equal or one each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radii<T = Vec<f32>> {
    /// All the same.
    Uniform(f32),
    /// One each.
    Each(T),
}

/// A particle of the grid: 16 bytes, so that four fill a line of cache.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Particle {
    /// Its centre, about the grid's origin.
    pub center: [f32; 3],
    /// Its index in the file's own order.
    pub index: u32,
}

/// A block of cells of the lattice (Gribble's macrocell, Chaudhari's block).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Block {
    /// Its first particle; it ends where the next block begins.
    pub first: u32,
    /// Where its cells begin in the list of cells.
    pub first_cell: u32,
    /// Cells along each axis, x fastest in the list of cells; 0 in an empty block.
    pub cells: [u32; 3],
    /// Edge of a cell.
    pub cell_edge: f32,
    /// The corner its cells start from.
    pub cell_low: Vec3,
    /// Least radius.
    pub least_radius: f32,
    /// Greatest radius.
    pub greatest_radius: f32,
    /// Least coordinates of its particles' centres.
    pub low: Vec3,
    /// Greatest coordinates of its particles' centres.
    pub high: Vec3,
}

/// Particles in cell order under a lattice of blocks.
///
/// Blocks are cubes of one size. Built by λ, an occupied block divides the box around its own
/// particles into cubic cells so that λ holds in it: in evenly filled space these are the cells of
/// one uniform grid, M along each axis, and a dense cluster or a thin sheet gets the finer cells it
/// needs. Built by cell length, cells are those of one uniform grid throughout. The particles of a
/// row of cells along x are one contiguous run.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Where the blocks lie.
    pub lattice: Lattice,
    /// One per place of the lattice, x fastest, and one more that closes the last.
    pub blocks: Vec<Block>,
    /// The groups of blocks that hold particles, x fastest.
    pub groups: Vec<Group>,
    /// First particle of each cell, block after block, and the number of particles at the end.
    pub cell_starts: Pages<u32>,
    /// The particles in cell order.
    pub particles: Pages<Particle>,
    /// Radii in cell order.
    pub radius: Radii<Pages<f32>>,
    /// Least coordinates of all centres; +∞ without particles.
    pub low: Vec3,
    /// Greatest coordinates of all centres; −∞ without particles.
    pub high: Vec3,
    /// Least radius of all.
    pub least_radius: f32,
    /// Greatest radius of all (r_max of Gribble et al. 2007, §4.1).
    pub greatest_radius: f32,
    /// Blocks in which particles coincide exactly; see [`crate::Visibility`]. Cleared, none hides another.
    pub crowded: Vec<u32>,
}

impl Grid {
    /// How many particles the grid holds.
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    /// The particles of block `block`, as a range of the cell order.
    #[inline]
    pub fn particles_of(&self, block: usize) -> std::ops::Range<usize> {
        self.blocks[block].first as usize..self.blocks[block + 1].first as usize
    }

    /// Whether block `block` holds no particle.
    pub fn is_empty_block(&self, block: usize) -> bool {
        self.blocks[block].cells[0] == 0
    }

    /// The centre of the particle at `slot` of the cell order.
    #[inline]
    pub fn center(&self, slot: usize) -> Vec3 {
        Vec3::from_array(self.particles[slot].center)
    }

    /// The index, in the file's own order, of the particle at `slot` of the cell order.
    #[inline]
    pub fn index(&self, slot: usize) -> u32 {
        self.particles[slot].index
    }

    /// The radius of the particle at `slot` of the cell order.
    #[inline]
    pub fn radius_at(&self, slot: usize) -> f32 {
        match &self.radius {
            Radii::Uniform(r) => *r,
            Radii::Each(radii) => radii[slot],
        }
    }

    /// Bytes of the particle data itself: positions, and radii where they differ.
    pub fn data_bytes(&self) -> usize {
        let radii = if let Radii::Each(r) = &self.radius { r.len() * 4 } else { 0 };
        self.particles.len() * 12 + radii
    }

    /// Bytes beyond the particle data: index, cells, blocks and their groups.
    pub fn structure_bytes(&self) -> usize {
        (self.particles.len() + self.cell_starts.len() + self.crowded.len()) * 4
            + self.blocks.len() * size_of::<Block>()
            + self.groups.len() * size_of::<Group>()
    }
}
