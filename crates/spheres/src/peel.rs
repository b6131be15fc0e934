//! What lies behind what is translucent: surface after surface along the same rays.
//!
//! A sphere shows its front, or its inner wall to an eye inside it, once. Along a ray, surfaces come in
//! exact order: by distance, then system, then index in the file, so that coincident spheres have their
//! order too. With opacity α each, surface i has the part αᵢ·∏ⱼ﹤ᵢ(1 − αⱼ) of a sample, front to back until
//! less than [`LEAST`] of it is left.

use crate::hits::Hits;
use crate::lanes::Lanes;
use crate::packet::{BLOCKED, NO_SLOT};
use crate::shade::Paint;
use crate::tile::{RayTile, TILE_RAYS};

/// A ray of which less than this is left goes no further: half a step of an 8-bit channel.
pub(crate) const LEAST: f32 = 1.0 / 512.0;

/// How far the rays of a tile are.
#[derive(Debug)]
pub(crate) struct Peel {
    /// Of each ray, the part that the surface at hand makes of its sample.
    pub part: Lanes<f32>,
    /// What is left for those behind.
    left: Lanes<f32>,
}

impl Peel {
    pub fn new() -> Self {
        Self { part: Lanes::new(0.0, TILE_RAYS), left: Lanes::new(1.0, TILE_RAYS) }
    }

    /// Begins with the first surfaces of a tile.
    pub fn begin(&mut self) {
        self.left.fill(1.0);
    }

    /// Finds what part of their samples the surfaces at hand make.
    pub fn weigh(&mut self, rays: &RayTile, hits: &Hits, paint: &dyn Paint) {
        for ray in hits.rays() {
            let opacity = paint.opacity(rays.hit_system[ray], hits.index[ray]).clamp(0.0, 1.0);
            self.part[ray] = self.left[ray] * opacity;
            self.left[ray] *= 1.0 - opacity;
        }
    }

    /// Stops the rays that have nothing left or nothing more to meet. Gives whether others go on.
    pub fn goes_on(&self, rays: &mut RayTile, hits: &Hits) -> bool {
        let mut any = false;
        for ray in 0..TILE_RAYS {
            if hits.has(ray) && self.left[ray] >= LEAST {
                any = true;
            } else {
                rays.distance[ray] = BLOCKED;
                rays.hit_slot[ray] = NO_SLOT;
            }
        }
        any
    }
}
