//! The rays of one tile of the picture, sixteen to a block.
//!
//! A tile has 16 × 16 blocks of 16 rays. A block is 4 × 4 pixels with one sample each, 2 × 2 with four,
//! or one pixel with sixteen, so that one SIMD vector always holds rays that lie together. More samples
//! come in rounds of these.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::Clip;
use motes_scene::{Projection, Rays};

use crate::clip::Stretches;
use crate::lanes::Lanes;
use crate::packet::{BLOCKED, LANES, NO_SLOT};

/// Blocks along a tile's side.
pub(crate) const SIDE_BLOCKS: usize = 16;
/// Rays of a tile.
pub(crate) const TILE_RAYS: usize = SIDE_BLOCKS * SIDE_BLOCKS * LANES;

/// Where the rays of a block lie: 1, 4 or 16 samples in each of its pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pattern {
    /// Pixels along a block's side: 4, 2 or 1.
    pub side: u32,
    /// Samples in each pixel: 1, 4 or 16.
    pub samples: u32,
    /// The pixel of each ray, from the block's corner.
    pub pixel: [(u8, u8); LANES],
    /// Place of each ray from the block's corner, pixels.
    pub x: [f32; LANES],
    pub y: [f32; LANES],
    /// Least and greatest place of a sample within its pixel, along x and along y.
    pub inset: [(f32, f32); 2],
}

impl Pattern {
    /// The pattern of these samples of a pixel; of the first 16, 4 or 1 of them, as many as there are.
    pub fn of(offsets: &[[f32; 2]]) -> Self {
        let (side, samples) = match offsets.len() {
            16.. => (1, 16),
            4.. => (2, 4),
            _ => (4, 1),
        };
        let offsets = &offsets[..samples as usize];
        let mut pattern = Self {
            side,
            samples,
            pixel: [(0, 0); LANES],
            x: [0.0; LANES],
            y: [0.0; LANES],
            inset: [(1.0, 0.0); 2],
        };
        for lane in 0..LANES as u32 {
            let (pixel, sample) = (lane / samples, (lane % samples) as usize);
            pattern.pixel[lane as usize] = ((pixel % side) as u8, (pixel / side) as u8);
            pattern.x[lane as usize] = (pixel % side) as f32 + offsets[sample][0];
            pattern.y[lane as usize] = (pixel / side) as f32 + offsets[sample][1];
        }
        for offset in offsets {
            for (inset, at) in pattern.inset.iter_mut().zip(offset) {
                *inset = (inset.0.min(*at), inset.1.max(*at));
            }
        }
        pattern
    }

    /// Samples along a pixel's side, were they a square: 1, 2 or 4.
    pub fn samples_along(&self) -> u32 {
        4 / self.side
    }

    /// Pixels along a tile's side.
    pub fn tile_side(&self) -> u32 {
        self.side * SIDE_BLOCKS as u32
    }

    /// The ray of sample `sample` in the tile's pixel (x, y).
    pub fn ray(&self, (x, y): (u32, u32), sample: u32) -> usize {
        let block = (y / self.side) as usize * SIDE_BLOCKS + (x / self.side) as usize;
        let pixel = y % self.side * self.side + x % self.side;
        block * LANES + (pixel * self.samples + sample) as usize
    }

    /// Which of its pixel's samples a ray is.
    pub fn sample(&self, ray: usize) -> u32 {
        (ray % LANES) as u32 % self.samples
    }

    /// The pixel of a ray within the tile.
    pub fn pixel_of(&self, ray: usize) -> (u32, u32) {
        let (block, (dx, dy)) = (ray / LANES, self.pixel[ray % LANES]);
        let (x, y) = ((block % SIDE_BLOCKS) as u32, (block / SIDE_BLOCKS) as u32);
        (x * self.side + u32::from(dx), y * self.side + u32::from(dy))
    }
}

/// The rays of a tile and what each has hit first.
#[derive(Debug)]
pub(crate) struct RayTile {
    pub pattern: Pattern,
    /// Where all rays start, if they start at one point; else each has its own `origin`.
    pub eye: Option<Vec3>,
    pub origin: [Lanes<f32>; 3],
    pub direction: [Lanes<f32>; 3],
    /// Distance of the nearest hit; +∞ for none, [`BLOCKED`] for rays that are not wanted.
    pub distance: Lanes<f32>,
    /// Where in the grids of the system at hand the nearest sphere lies, if that system has it.
    pub slot: Lanes<u32>,
    /// The slot of the nearest sphere of all systems, or [`NO_SLOT`].
    pub hit_slot: Lanes<u32>,
    /// The system of the nearest sphere.
    pub hit_system: Vec<u16>,
    /// What of the rays is left where the spheres at hand are cut.
    pub stretches: Stretches,
}

/// Which part of the picture a tile is: its first pixel, and how many of its pixels are in the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub corner: (u32, u32),
    pub size: (u32, u32),
}

impl RayTile {
    pub fn new() -> Self {
        let zeros = || [(); 3].map(|()| Lanes::new(0.0, TILE_RAYS));
        Self {
            pattern: Pattern::of(&[[0.5; 2]]),
            eye: None,
            origin: zeros(),
            direction: zeros(),
            distance: Lanes::new(BLOCKED, TILE_RAYS),
            slot: Lanes::new(NO_SLOT, TILE_RAYS),
            hit_slot: Lanes::new(NO_SLOT, TILE_RAYS),
            hit_system: vec![0; TILE_RAYS],
            stretches: Stretches::new(),
        }
    }

    /// The camera's rays through the tile. Those outside the picture, and those of pixels that are
    /// `finished` (pixel by pixel, `place.size.0` to a row), meet nothing.
    ///
    /// Fused multiply-adds are exact ones, so that every instruction set has the same rays.
    #[simd]
    pub fn aim<S: Simd>(
        &mut self,
        simd: S,
        rays: &Rays,
        (place, pattern): (Place, Pattern),
        finished: Option<&[bool]>,
    ) {
        self.pattern = pattern;
        let perspective = rays.projection == Projection::Perspective;
        self.eye = perspective.then_some(rays.origin);
        let (from, (right, up)) =
            (if perspective { rays.forward } else { rays.origin }, (rays.right, rays.up));
        let pixel = f32x16::splat(simd, rays.pixel);
        let place_x = f32x16::from_slice(simd, &pattern.x);
        let place_y = f32x16::from_slice(simd, &pattern.y);
        for block in 0..SIDE_BLOCKS * SIDE_BLOCKS {
            let at_x = (place.corner.0 + (block % SIDE_BLOCKS) as u32 * pattern.side) as f32;
            let at_y = (place.corner.1 + (block / SIDE_BLOCKS) as u32 * pattern.side) as f32;
            let a = (place_x + at_x - rays.center[0]) * pixel;
            let b = (f32x16::splat(simd, rays.center[1]) - (place_y + at_y)) * pixel;
            let x = b.mul_add_precise(
                splat(simd, up.x),
                a.mul_add_precise(splat(simd, right.x), splat(simd, from.x)),
            );
            let y = b.mul_add_precise(
                splat(simd, up.y),
                a.mul_add_precise(splat(simd, right.y), splat(simd, from.y)),
            );
            let z = b.mul_add_precise(
                splat(simd, up.z),
                a.mul_add_precise(splat(simd, right.z), splat(simd, from.z)),
            );
            let lanes = block * LANES..(block + 1) * LANES;
            if perspective {
                let length = z.mul_add_precise(z, y.mul_add_precise(y, x * x)).sqrt();
                let scale = f32x16::splat(simd, 1.0) / length;
                (x * scale).store_slice(&mut self.direction[0][lanes.clone()]);
                (y * scale).store_slice(&mut self.direction[1][lanes.clone()]);
                (z * scale).store_slice(&mut self.direction[2][lanes]);
            } else {
                x.store_slice(&mut self.origin[0][lanes.clone()]);
                y.store_slice(&mut self.origin[1][lanes.clone()]);
                z.store_slice(&mut self.origin[2][lanes.clone()]);
                for axis in 0..3 {
                    self.direction[axis][lanes.clone()].fill(rays.forward[axis]);
                }
            }
        }
        self.hit_slot.fill(NO_SLOT);
        self.distance.fill(f32::INFINITY);
        self.leave_out(place.size, finished);
    }

    fn leave_out(&mut self, (width, height): (u32, u32), finished: Option<&[bool]>) {
        let side = self.pattern.tile_side();
        if finished.is_none() && width >= side && height >= side {
            return;
        }
        for ray in 0..TILE_RAYS {
            let (x, y) = self.pattern.pixel_of(ray);
            let outside = x >= width || y >= height;
            if outside || finished.is_some_and(|f| f[(y * width + x) as usize]) {
                self.distance[ray] = BLOCKED;
            }
        }
    }

    /// Where ray `ray` starts.
    pub fn origin_of(&self, ray: usize) -> Vec3 {
        self.eye.unwrap_or_else(|| {
            Vec3::new(self.origin[0][ray], self.origin[1][ray], self.origin[2][ray])
        })
    }

    /// Unit direction of ray `ray`.
    pub fn direction_of(&self, ray: usize) -> Vec3 {
        Vec3::new(self.direction[0][ray], self.direction[1][ray], self.direction[2][ray])
    }

    /// Begins a system: no ray has hit it yet.
    pub fn begin_system(&mut self) {
        self.slot.fill(NO_SLOT);
    }

    /// Ends a system: where its spheres are nearest, they are the hits.
    pub fn end_system(&mut self, system: u16) {
        if system == 0 {
            // The first system's are all there are yet.
            std::mem::swap(&mut self.slot, &mut self.hit_slot);
            self.hit_system.fill(0);
            return;
        }
        for ray in (0..TILE_RAYS).filter(|ray| self.slot[*ray] != NO_SLOT) {
            self.hit_slot[ray] = self.slot[ray];
            self.hit_system[ray] = system;
        }
    }

    /// As [`crate::Packet::continue_system`].
    pub fn continue_system(&mut self, first: u16) {
        for ray in 0..TILE_RAYS {
            let held = self.hit_slot[ray] != NO_SLOT && self.hit_system[ray] >= first;
            self.slot[ray] = if held { self.hit_slot[ray] } else { NO_SLOT };
        }
    }

    /// As [`crate::Packet::end_part`].
    pub fn end_part(&mut self, (first, part): (u16, u16)) {
        for ray in (0..TILE_RAYS).filter(|ray| self.slot[*ray] != NO_SLOT) {
            let held = self.hit_slot[ray] == self.slot[ray] && self.hit_system[ray] >= first;
            if !held {
                self.hit_slot[ray] = self.slot[ray];
                self.hit_system[ray] = part;
            }
        }
    }

    /// Finds what a clip leaves of the rays.
    #[inline(always)]
    pub fn clip_to<S: Simd>(&mut self, simd: S, clip: &Clip) {
        self.stretches.begin(clip, TILE_RAYS / LANES);
        for vector in 0..TILE_RAYS / LANES {
            let rays = self.sixteen(simd, vector * LANES);
            self.stretches.find(simd, clip, vector, rays);
        }
    }

    /// Origins and directions of the sixteen rays from `first` on.
    #[inline(always)]
    pub fn sixteen<S: Simd>(&self, simd: S, first: usize) -> [[f32x16<S>; 3]; 2] {
        let lanes = first..first + LANES;
        let [dx, dy, dz] = &self.direction;
        let direction = [
            f32x16::from_slice(simd, &dx[lanes.clone()]),
            f32x16::from_slice(simd, &dy[lanes.clone()]),
            f32x16::from_slice(simd, &dz[lanes.clone()]),
        ];
        let [ox, oy, oz] = &self.origin;
        let origin = match self.eye {
            Some(eye) => [splat(simd, eye.x), splat(simd, eye.y), splat(simd, eye.z)],
            None => [
                f32x16::from_slice(simd, &ox[lanes.clone()]),
                f32x16::from_slice(simd, &oy[lanes.clone()]),
                f32x16::from_slice(simd, &oz[lanes]),
            ],
        };
        [origin, direction]
    }
}

// A closure would leave the instruction set of its surroundings.
#[inline(always)]
fn splat<S: Simd>(simd: S, value: f32) -> f32x16<S> {
    f32x16::splat(simd, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_has_a_ray_of_its_own() {
        for samples in [1, 4, 16] {
            let offsets: Vec<[f32; 2]> =
                (0..samples).map(|i| [(i as f32 + 0.5) / samples as f32; 2]).collect();
            let pattern = Pattern::of(&offsets);
            assert_eq!(pattern.samples, samples);
            let mut seen = vec![false; TILE_RAYS];
            for y in 0..pattern.tile_side() {
                for x in 0..pattern.tile_side() {
                    for sample in 0..samples {
                        let ray = pattern.ray((x, y), sample);
                        assert_eq!(pattern.pixel_of(ray), (x, y));
                        assert!(!std::mem::replace(&mut seen[ray], true));
                        let lane = ray % LANES;
                        let offset = offsets[sample as usize][0];
                        assert_eq!(pattern.x[lane], (x % pattern.side) as f32 + offset);
                    }
                }
            }
            assert!(seen.iter().all(|s| *s));
        }
    }
}
