//! Filter: surfaces made smooth along their links.
//!
//! Zirr & Dachsbacher 2015, §3.4 and §4.6: reciprocal depth (which is linear over a plane in the picture) is
//! smoothed over connected surfaces, so that spans never cross; how far goes by the distance, so that the
//! radius is the same in the world. The default way is in `recursion.rs`;
//! the paper's own and another are in `flow.rs`.

use rayon::prelude::*;

use crate::{Spans, View};
use motes_scene::Projection;

/// Leaps of so many standard deviations end a surface for the recursion.
const LEAP: f32 = 8.0;
/// What is thicker than a drop by this part is smoothed fully.
const THICK: f32 = 0.5;

/// How near each surface is: reciprocal depth in perspective, depth backwards in orthographic projection.
/// Nearer is greater, and a plane is linear over the picture.
pub fn nearness(spans: &Spans, projection: Projection) -> Vec<f32> {
    let of = |depth: &f32| match projection {
        Projection::Perspective => 1.0 / depth,
        Projection::Orthographic => -depth,
    };
    spans.depths.par_iter().with_min_len(1 << 14).map(of).collect()
}

/// The depth of a nearness.
#[inline]
pub fn depth(nearness: f32, projection: Projection) -> f32 {
    match projection {
        Projection::Perspective => 1.0 / nearness,
        Projection::Orthographic => -nearness,
    }
}

/// The scale of smoothing at each nearness.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Standard deviation, pixels: this in orthographic projection, times nearness in perspective.
    sigma: f32,
    /// What is a leap, in the world: in orthographic projection, and in perspective, times nearness twice.
    pub(crate) leap: [f32; 2],
    /// Diameter of a drop, in the world, and what part of smoothing each unit of thickness brings beyond it.
    pub(crate) drop: f32,
    pub(crate) per_thickness: f32,
    pub(crate) projection: Projection,
}

impl Scale {
    /// Smoothing with the standard deviation `radius`, in world units, as `view` shows it, of what is thicker
    /// than a `drop`.
    pub fn new(radius: f32, drop: f32, view: &View) -> Self {
        Self {
            sigma: radius / view.rays.pixel,
            leap: match view.rays.projection {
                Projection::Perspective => [0.0, LEAP * radius],
                Projection::Orthographic => [LEAP * radius, 0.0],
            },
            drop,
            per_thickness: 1.0 / (THICK * drop).max(f32::MIN_POSITIVE),
            projection: view.rays.projection,
        }
    }

    /// Standard deviation, pixels.
    #[inline]
    pub fn sigma(&self, nearness: f32) -> f32 {
        match self.projection {
            Projection::Perspective => self.sigma * nearness,
            Projection::Orthographic => self.sigma,
        }
    }

    /// The difference of nearness that is a leap.
    #[inline(always)]
    pub fn leap(&self, nearness: f32) -> f32 {
        self.leap[0] + self.leap[1] * nearness * nearness
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::Vec3;
    use motes_scene::Rays;

    pub(crate) fn view(size: (u32, u32), projection: Projection) -> View {
        let rays = Rays {
            origin: Vec3::ZERO,
            forward: Vec3::Z,
            right: Vec3::X,
            up: -Vec3::Y,
            center: [size.0 as f32 / 2.0, size.1 as f32 / 2.0],
            pixel: 0.01,
            projection,
        };
        View { rays, size, near: 0.1, far: 100.0 }
    }

    /// One span in every column, from `entry` on, two long.
    pub(crate) fn sheet(size: (u32, u32), entry: impl Fn(u32, u32) -> f32) -> Spans {
        let pixels = size.0 * size.1;
        let at = |i: u32| entry(i % size.0, i / size.0);
        Spans {
            size,
            near: 0.1,
            far: 100.0,
            starts: (0..=pixels).collect(),
            depths: (0..pixels).flat_map(|i| [at(i), at(i) + 2.0]).collect(),
            ..Spans::default()
        }
    }
}
