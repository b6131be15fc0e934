//! What the spans are made of and how.

use motes_grid::{Grid, Radii, Visibility};

/// The particles of a liquid.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The particles.
    pub particles: Particles<'a>,
    /// What their radii are multiplied by: a particle stands for more than the sphere it is drawn as.
    pub radius_scale: f32,
}

/// Where the particles are.
#[derive(Clone, Copy, Debug)]
pub enum Particles<'a> {
    /// In arrays, in any order; a particle's index is its place. Those without a finite position or a
    /// positive radius are left out.
    Unsorted(&'a [[f32; 3]], Radii<&'a [f32]>),
    /// In grids, one per radius class, of which some are seen; a particle's index is the grid's.
    Grids(&'a [Grid], &'a [Visibility]),
}

/// How spans are made (Zirr & Dachsbacher 2015).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// The longest stretch of a ray, in world units, that is empty and yet no gap (§3.2's g).
    pub gap: f32,
    /// How many spans a pixel stores (§3.1's k), at least 1.
    pub spans: u32,
    /// Which particles are left out, since they are deep inside (§3.1).
    pub cull: Cull,
    /// Edge of the cells that tell what is inside, in mean radii of the particles (scaled).
    pub cell: f32,
    /// What becomes of particles by themselves.
    pub spray: Spray,
    /// Whether balls at the surface are fitted to it. Not where there are no cells, which tell what is inside.
    pub fit: bool,
    /// How a column is held while it is made.
    pub representation: Representation,
    /// Pixels along a tile's edge: a multiple of 4, at most 1024.
    pub tile: u32,
    /// Whether each surface is to know its particle.
    pub ids: bool,
}

/// When a cell of the lattice is full. Cells that are full, as all 26 around them, are liquid throughout,
/// and spheres that lie wholly in such cells are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cull {
    /// It holds a particle: no empty place is larger than two cells.
    Occupancy,
    /// It holds at least so many particles: for incompressible liquids (§3.1). At most 255.
    Count(u32),
    /// No cell is: the liquid is the spheres alone.
    Off,
}

/// What becomes of spray: particles with few others in the cells around them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spray {
    /// The same as of all others.
    Liquid,
    /// Their radii, scaled like all, are multiplied by this: drops as large as what a particle stands for.
    Drops(f32),
    /// They are left out.
    Dropped,
}

/// How a column is held while it is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Representation {
    /// As stretches of the ray, merged when they meet: exact.
    Intervals,
    /// As bits (§3.1): depths are those of layers.
    Bits(Bits),
}

/// The layers of a perspective bit grid (§4.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bits {
    /// The least angle, degrees, between surfaces that differ by one layer from pixel to pixel (§4.2's α).
    pub angle: f32,
    /// Most layers; where they do not suffice for the angle, they are farther apart.
    pub layers: u32,
    /// What of a sphere is marked.
    pub marks: Marks,
}

/// What of a sphere is marked in the bit grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marks {
    /// All layers that it overlaps.
    Whole,
    /// Where the ray enters and leaves it, and as many layers in between as keep gaps bridged (§4.4).
    Surface,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            gap: 0.0,
            spans: 7,
            cull: Cull::Occupancy,
            cell: 2.3,
            spray: Spray::Liquid,
            fit: false,
            representation: Representation::Intervals,
            tile: 64,
            ids: false,
        }
    }
}

impl Default for Bits {
    fn default() -> Self {
        Self { angle: 14.0, layers: 16_384, marks: Marks::Whole }
    }
}
