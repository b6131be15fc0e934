//! The surfaces that the rays of a tile have hit first.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::packet::{LANES, NO_SLOT};
use crate::render::Center;
use crate::tile::{RayTile, TILE_RAYS};
use crate::traverse::Spheres;

/// What each ray of a tile has hit, coordinate by coordinate; where it has hit nothing, nothing of
/// meaning.
#[derive(Debug)]
pub(crate) struct Hits {
    /// Per block, which of its rays have hit something.
    pub mask: [u16; TILE_RAYS / LANES],
    pub position: [Vec<f32>; 3],
    /// Unit normal, towards where the ray came from.
    pub normal: [Vec<f32>; 3],
    /// Radius of the sphere.
    pub radius: Vec<f32>,
    /// Its index in the file's order.
    pub index: Vec<u32>,
}

impl Hits {
    pub fn new() -> Self {
        let zeros = || [vec![0.0; TILE_RAYS], vec![0.0; TILE_RAYS], vec![0.0; TILE_RAYS]];
        Self {
            mask: [0; TILE_RAYS / LANES],
            position: zeros(),
            normal: zeros(),
            radius: vec![0.0; TILE_RAYS],
            index: vec![0; TILE_RAYS],
        }
    }

    /// Finds the surfaces that the rays have hit. Gives how many there are.
    #[simd]
    pub fn gather<S: Simd>(&mut self, simd: S, rays: &RayTile, systems: &[Spheres<'_>]) -> usize {
        let mut count = 0;
        for block in 0..TILE_RAYS / LANES {
            let first = block * LANES;
            let mut centers = [[0.0; LANES]; 3];
            let mut mask = 0;
            for lane in 0..LANES {
                let slot = rays.hit_slot[first + lane];
                if slot == NO_SLOT {
                    continue;
                }
                mask |= 1 << lane;
                let system = &systems[rays.hit_system[first + lane] as usize];
                let (grid, place) = system.locate(slot);
                let center = grid.center(place);
                centers[0][lane] = center.x;
                centers[1][lane] = center.y;
                centers[2][lane] = center.z;
                self.radius[first + lane] = grid.radius_at(place);
                self.index[first + lane] = grid.index(place);
            }
            self.mask[block] = mask;
            if mask != 0 {
                count += mask.count_ones() as usize;
                self.surfaces(simd, rays, (first, &centers));
            }
        }
        count
    }

    /// Positions and normals of a block's hits.
    #[inline(always)]
    fn surfaces<S: Simd>(
        &mut self,
        simd: S,
        rays: &RayTile,
        (first, centers): (usize, &[[f32; LANES]; 3]),
    ) {
        let lanes = first..first + LANES;
        let t = f32x16::from_slice(simd, &rays.distance[lanes.clone()]);
        let dx = f32x16::from_slice(simd, &rays.direction[0][lanes.clone()]);
        let dy = f32x16::from_slice(simd, &rays.direction[1][lanes.clone()]);
        let dz = f32x16::from_slice(simd, &rays.direction[2][lanes.clone()]);
        let (ox, oy, oz) = match rays.eye {
            Some(eye) => (
                f32x16::splat(simd, eye.x),
                f32x16::splat(simd, eye.y),
                f32x16::splat(simd, eye.z),
            ),
            None => (
                f32x16::from_slice(simd, &rays.origin[0][lanes.clone()]),
                f32x16::from_slice(simd, &rays.origin[1][lanes.clone()]),
                f32x16::from_slice(simd, &rays.origin[2][lanes.clone()]),
            ),
        };
        let px = t.mul_add_precise(dx, ox);
        let py = t.mul_add_precise(dy, oy);
        let pz = t.mul_add_precise(dz, oz);
        let cx = f32x16::from_slice(simd, &centers[0]);
        let cy = f32x16::from_slice(simd, &centers[1]);
        let cz = f32x16::from_slice(simd, &centers[2]);
        let (nx, ny, nz) = (px - cx, py - cy, pz - cz);
        let length2 = nz.mul_add_precise(nz, ny.mul_add_precise(ny, nx * nx));
        // Rounding cannot flip it: a grazing ray's normal is at a right angle to the ray at most.
        let (ex, ey, ez) = (cx - ox, cy - oy, cz - oz);
        let to_center2 = ez.mul_add_precise(ez, ey.mul_add_precise(ey, ex * ex));
        let radius = f32x16::from_slice(simd, &self.radius[lanes.clone()]);
        let inside = to_center2.simd_lt(radius * radius);
        let one = f32x16::splat(simd, 1.0);
        let scale = inside.select(-one, one) / length2.sqrt();
        // A sphere so small that its surface rounds to its centre faces the eye.
        let sized = length2.simd_gt(f32x16::splat(simd, 0.0));
        px.store_slice(&mut self.position[0][lanes.clone()]);
        py.store_slice(&mut self.position[1][lanes.clone()]);
        pz.store_slice(&mut self.position[2][lanes.clone()]);
        sized.select(nx * scale, -dx).store_slice(&mut self.normal[0][lanes.clone()]);
        sized.select(ny * scale, -dy).store_slice(&mut self.normal[1][lanes.clone()]);
        sized.select(nz * scale, -dz).store_slice(&mut self.normal[2][lanes]);
    }

    /// Where ray `ray` has hit something.
    #[inline(always)]
    pub fn position_of(&self, ray: usize) -> Vec3 {
        Vec3::new(self.position[0][ray], self.position[1][ray], self.position[2][ray])
    }

    /// The normal there.
    #[inline(always)]
    pub fn normal_of(&self, ray: usize) -> Vec3 {
        Vec3::new(self.normal[0][ray], self.normal[1][ray], self.normal[2][ray])
    }

    /// What ray `ray` has hit.
    pub fn center(&self, rays: &RayTile, ray: usize) -> Center {
        if self.mask[ray / LANES] >> (ray % LANES) & 1 == 0 {
            return Center::NOTHING;
        }
        Center {
            depth: rays.distance[ray],
            normal: [self.normal[0][ray], self.normal[1][ray], self.normal[2][ray]],
            id: i64::from(self.index[ray]),
            system: rays.hit_system[ray],
        }
    }
}
