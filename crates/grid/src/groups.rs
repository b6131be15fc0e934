//! Groups of blocks: the level above them, for those who look at a grid from afar.

use glam::Vec3;

use crate::{Block, Lattice};

/// Blocks along each edge of a group.
pub const GROUP_EDGE: u32 = 4;

/// A cube of 4×4×4 places of the lattice of blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Group {
    /// Least coordinates of its particles' centres.
    pub low: Vec3,
    /// Greatest coordinates of its particles' centres.
    pub high: Vec3,
    /// Greatest radius.
    pub greatest_radius: f32,
    /// How many particles it holds, at least 1.
    pub particles: u32,
    /// The block with the least coordinates; a multiple of [`GROUP_EDGE`] along each axis.
    pub first_block: [u32; 3],
    /// Which of its blocks hold particles: bit (z·4 + y)·4 + x, counted from `first_block`. Places
    /// beyond the lattice are never set.
    pub occupied: u64,
}

impl Group {
    /// The blocks that hold particles, as places in the list of blocks.
    pub fn blocks(self, lattice: &Lattice) -> impl Iterator<Item = usize> + use<> {
        let [x, y, z] = self.first_block;
        let lattice = *lattice;
        let mut left = self.occupied;
        std::iter::from_fn(move || {
            let bit = (left != 0).then(|| left.trailing_zeros())?;
            left &= left - 1;
            let (dx, dy, dz) = (bit % GROUP_EDGE, bit / GROUP_EDGE % GROUP_EDGE, bit / 16);
            Some(lattice.index([x + dx, y + dy, z + dz]))
        })
    }
}

/// The groups that hold particles, x fastest. `blocks` has one more, which closes the last.
pub(crate) fn groups_of(lattice: &Lattice, blocks: &[Block]) -> Vec<Group> {
    let [nx, ny, nz] = lattice.dims.map(|d| d.div_ceil(GROUP_EDGE));
    let mut groups = Vec::new();
    for place in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z]))) {
        let first_block = place.map(|p| p * GROUP_EDGE);
        groups.extend(group_at(lattice, blocks, first_block));
    }
    groups
}

/// The group that begins at `first_block`, if it holds particles.
fn group_at(lattice: &Lattice, blocks: &[Block], first_block: [u32; 3]) -> Option<Group> {
    let mut group = Group {
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
        greatest_radius: 0.0,
        particles: 0,
        first_block,
        occupied: 0,
    };
    let [x, y, z] = first_block;
    let [nx, ny, nz] = lattice.dims;
    for dz in 0..GROUP_EDGE.min(nz - z) {
        for dy in 0..GROUP_EDGE.min(ny - y) {
            let row = lattice.index([x, y + dy, z + dz]);
            for dx in 0..GROUP_EDGE.min(nx - x) {
                let place = row + dx as usize;
                let block = &blocks[place];
                if block.cells[0] == 0 {
                    continue;
                }
                group.low = group.low.min(block.low);
                group.high = group.high.max(block.high);
                group.greatest_radius = group.greatest_radius.max(block.greatest_radius);
                group.particles += blocks[place + 1].first - block.first;
                group.occupied |= 1 << ((dz * GROUP_EDGE + dy) * GROUP_EDGE + dx);
            }
        }
    }
    (group.particles > 0).then_some(group)
}
