//! Where the voxels lie.
//!
//! Values stand at the nodes of a cubic lattice; a cell is the cube between eight nodes. Positions inside
//! it are told in edges of a voxel from its first node.

use glam::Vec3;

use crate::params::Params;

/// Nodes there are at the most; where more would be needed, voxels are larger.
const MOST_NODES: f64 = (1 << 27) as f64;
/// Nodes along an axis at the most: positions have to be told apart by a few ten-thousandths of a voxel.
const MOST_ALONG: f64 = 2048.0;
/// Edge of a voxel at the most: what is reached is a number of single precision.
const MOST_VOXEL: f32 = 1e36;
/// Nodes without density at each side, for gradients.
const RIM: f32 = 2.0;
/// Least reach of a particle, in voxels: it meets several nodes wherever it is.
const LEAST_REACH: f32 = 2.0;

/// The lattice of voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The first node, about the origin of the particles.
    pub low: Vec3,
    /// Edge of a voxel.
    pub voxel: f32,
    /// Nodes along each axis.
    pub dims: [usize; 3],
}

impl Default for Lattice {
    fn default() -> Self {
        Self { low: Vec3::ZERO, voxel: 1.0, dims: [4; 3] }
    }
}

impl Lattice {
    /// Covers particles with centres in `low..high` and radii up to `radius`. Nodes lie at whole voxels from
    /// the origin, so that a liquid at rest looks the same wherever others go.
    pub fn new((low, high): (Vec3, Vec3), radius: f32, params: &Params) -> Self {
        let mut voxel = params.voxel.clamp(f32::MIN_POSITIVE, MOST_VOXEL);
        loop {
            let pad = reach(radius, voxel, params).max(params.drop * radius);
            let lattice = Self::with_voxel((low, high), voxel, pad);
            let along = lattice.map(|(_, nodes)| nodes);
            if along.iter().product::<f64>() <= MOST_NODES && along.iter().all(|n| *n <= MOST_ALONG)
            {
                let low = lattice.map(|(low, _)| low as f32);
                return Self { low: low.into(), voxel, dims: along.map(|n| n as usize) };
            }
            voxel *= 1.25;
        }
    }

    /// First coordinate and number of nodes along each axis.
    fn with_voxel((low, high): (Vec3, Vec3), voxel: f32, reach: f32) -> [(f64, f64); 3] {
        let (voxel, pad) = (f64::from(voxel), f64::from(reach + RIM * voxel));
        [0, 1, 2].map(|a| {
            let first = ((f64::from(low[a]) - pad) / voxel).floor();
            let last = ((f64::from(high[a]) + pad) / voxel).ceil();
            (first * voxel, last - first + 1.0)
        })
    }

    /// A place in voxels.
    #[inline]
    pub fn place(&self, point: Vec3) -> Vec3 {
        (point - self.low) * (1.0 / self.voxel)
    }

    /// The point at a place.
    #[inline]
    pub fn point(&self, place: Vec3) -> Vec3 {
        self.low + place * self.voxel
    }

    /// Cells along each axis.
    pub fn cells(&self) -> [usize; 3] {
        self.dims.map(|n| n - 1)
    }
}

/// How far the density of a particle reaches.
#[inline]
pub(crate) fn reach(radius: f32, voxel: f32, params: &Params) -> f32 {
    (params.support * radius).max(LEAST_REACH * voxel)
}
