//! What the field is made of and how.

use motes_grid::Radii;

/// How much of a particle's surroundings is filled: +x, −x, +y, −y, +z, −z, each 0 to 1 (Yasuda et al. 2009,
/// §4.2.2).
pub type Mask = [f32; 6];

/// The particles of a liquid, in any order. Those without a finite position or a positive
/// radius of at most 10³⁶ are left out.
#[derive(Clone, Copy, Debug)]
pub struct Particles<'a> {
    /// Centres.
    pub positions: &'a [[f32; 3]],
    /// Radii.
    pub radii: Radii<&'a [f32]>,
    /// Their masks, for [`Params::masked`].
    pub masks: Option<&'a [Mask]>,
}

impl Particles<'_> {
    /// The radius of a particle.
    #[inline]
    pub(crate) fn radius(&self, index: usize) -> f32 {
        match self.radii {
            Radii::Uniform(r) => r,
            Radii::Each(radii) => radii[index],
        }
    }
}

/// How the field is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Edge of a voxel, world units; larger where there would be too many, and at least a quarter of a radius.
    pub voxel: f32,
    /// How far the density of a particle reaches, in its radii; at least two voxels.
    pub support: f32,
    /// Density at the surface; deep in a liquid at rest it is about 1.
    pub threshold: f32,
    /// Density from which on a voxel is saturated (§4.2.4).
    pub saturation: f32,
    /// Whether there is a rough field first (§4.2.1).
    pub rough: bool,
    /// Whether densities are deformed by masks (§4.2.2), where there are any.
    pub masked: bool,
    /// Radius of a drop, a particle by itself, in its radii.
    pub drop: f32,
}

impl Params {
    /// The defaults, with voxels of a certain edge.
    pub fn with_voxel(voxel: f32) -> Self {
        Self {
            voxel,
            support: 5.0,
            threshold: 0.2,
            saturation: 2.0,
            rough: true,
            masked: false,
            drop: 1.24,
        }
    }
}
