//! Where the spans are seen from.

use glam::{DVec3, Vec3};
use motes_scene::{Projection, Rays};

/// A picture of columns: one ray through the centre of each pixel, between two depths.
///
/// Depth is the distance along `rays.forward`; it is the parameter of the rays of [`Rays`], whose
/// directions are not normalised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The rays, relative to the origin of the positions.
    pub rays: Rays,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Depth of the near plane; above zero in perspective.
    pub near: f32,
    /// Depth of the far plane.
    pub far: f32,
}

impl View {
    /// The ray of the column of pixel (column `i`, row `j`): its point at depth 0 and its direction,
    /// whose part along `forward` is 1.
    pub fn column(&self, i: u32, j: u32) -> (DVec3, DVec3) {
        let rays = &self.rays;
        let a = (f64::from(i) + 0.5 - f64::from(rays.center[0])) * f64::from(rays.pixel);
        let b = (f64::from(rays.center[1]) - f64::from(j) - 0.5) * f64::from(rays.pixel);
        let [origin, forward, right, up] =
            [rays.origin, rays.forward, rays.right, rays.up].map(Vec3::as_dvec3);
        let across = right * a + up * b;
        match rays.projection {
            Projection::Perspective => (origin, forward + across),
            Projection::Orthographic => (origin + across, forward),
        }
    }

    /// How many pixels there are.
    pub fn pixels(&self) -> usize {
        self.size.0 as usize * self.size.1 as usize
    }
}
