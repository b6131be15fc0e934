//! The surfaces that the rays of a tile have hit first.

use fearless_simd::{f32x4, f32x8, f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Grid, Particle, Radii};

use crate::clip::{Stretches, cap_normals};
use crate::intersect::{columns, transposed};
use crate::lanes::Lanes;
use crate::packet::{LANES, NO_SLOT, Surface};
use crate::render::{Cap, Center};
use crate::tile::{RayTile, TILE_RAYS};
use crate::traverse::Spheres;

/// What each ray of a tile has hit, coordinate by coordinate; where it has hit nothing, nothing of
/// meaning.
#[derive(Debug)]
pub(crate) struct Hits {
    /// Per block, which of its rays have hit something.
    pub mask: [u16; TILE_RAYS / LANES],
    pub position: [Lanes<f32>; 3],
    /// Unit normal, towards where the ray came from.
    pub normal: [Lanes<f32>; 3],
    /// Radius of the sphere.
    pub radius: Lanes<f32>,
    /// Its index in the file's order.
    pub index: Lanes<u32>,
    /// Where a cut has laid the surface open, the owner of the face plus one; else 0.
    pub cap: Lanes<u32>,
    /// Whether it has anywhere.
    pub capped: bool,
    /// What of a block's rays is left.
    stretches: Stretches,
}

impl Hits {
    pub fn new() -> Self {
        let zeros = || [(); 3].map(|()| Lanes::new(0.0, TILE_RAYS));
        Self {
            mask: [0; TILE_RAYS / LANES],
            position: zeros(),
            normal: zeros(),
            radius: Lanes::new(0.0, TILE_RAYS),
            index: Lanes::new(0, TILE_RAYS),
            cap: Lanes::new(0, TILE_RAYS),
            capped: false,
            stretches: Stretches::new(),
        }
    }

    /// Finds the surfaces that the rays have hit. Gives how many there are.
    #[simd]
    pub fn gather<S: Simd>(&mut self, simd: S, rays: &RayTile, systems: &[Spheres<'_>]) -> usize {
        let mut count = 0;
        if std::mem::take(&mut self.capped) {
            self.cap.fill(0);
        }
        let cut = systems.iter().any(|system| system.clip.is_some());
        // Most pictures show one grid, in which a slot is a place.
        let only = match systems {
            [system] if system.classes.grids.len() == 1 => Some(&system.classes.grids[0]),
            _ => None,
        };
        for block in 0..TILE_RAYS / LANES {
            let first = block * LANES;
            let slots = u32x16::from_slice(simd, &rays.hit_slot[first..first + LANES]);
            let mask = slots.simd_lt(u32x16::splat(simd, NO_SLOT)).to_bitmask();
            self.mask[block] = mask as u16;
            if mask == 0 {
                continue;
            }
            count += mask.count_ones() as usize;
            let centers = match only {
                Some(grid) => self.of_grid(simd, (rays, first), grid),
                None => self.of_any(simd, (rays, first), systems, mask),
            };
            self.surfaces(simd, rays, (first, centers));
            if cut {
                self.cut(simd, rays, (first, centers), systems);
            }
        }
        count
    }

    /// Centres of the spheres that a block's rays have hit, all of one grid; the others' are those of any.
    #[inline(always)]
    fn of_grid<S: Simd>(
        &mut self,
        simd: S,
        (rays, first): (&RayTile, usize),
        grid: &Grid,
    ) -> [f32x16<S>; 3] {
        let lanes = first..first + LANES;
        let slots = &rays.hit_slot[lanes.clone()];
        let [x, y, z, index] = columns([
            four(simd, grid, &slots[..4]),
            four(simd, grid, &slots[4..8]),
            four(simd, grid, &slots[8..12]),
            four(simd, grid, &slots[12..]),
        ]);
        index.bitcast::<u32x16<S>>().store_slice(&mut self.index[lanes.clone()]);
        match &grid.radius {
            Radii::Uniform(radius) => self.radius[lanes].fill(*radius),
            Radii::Each(radii) => {
                for (radius, slot) in self.radius[lanes].iter_mut().zip(slots) {
                    *radius = radii[(*slot as usize).min(radii.len() - 1)];
                }
            }
        }
        [x, y, z]
    }

    /// Centres of the spheres that a block's rays have hit, of any grid.
    #[inline(always)]
    fn of_any<S: Simd>(
        &mut self,
        simd: S,
        (rays, first): (&RayTile, usize),
        systems: &[Spheres<'_>],
        mask: u64,
    ) -> [f32x16<S>; 3] {
        let mut particles = [Particle::default(); LANES];
        let mut left = mask;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let system = rays.hit_system[first + lane] as usize;
            let (grid, place) = systems[system].locate(rays.hit_slot[first + lane]);
            particles[lane] = grid.particles[place];
            self.radius[first + lane] = grid.radius_at(place);
            self.index[first + lane] = particles[lane].index;
        }
        transposed(simd, bytemuck::cast_slice(&particles))
    }

    /// Positions and normals of a block's hits.
    #[inline(always)]
    fn surfaces<S: Simd>(
        &mut self,
        simd: S,
        rays: &RayTile,
        (first, centers): (usize, [f32x16<S>; 3]),
    ) {
        let lanes = first..first + LANES;
        let t = f32x16::from_slice(simd, &rays.distance[lanes.clone()]);
        let dx = f32x16::from_slice(simd, &rays.direction[0][lanes.clone()]);
        let dy = f32x16::from_slice(simd, &rays.direction[1][lanes.clone()]);
        let dz = f32x16::from_slice(simd, &rays.direction[2][lanes.clone()]);
        let (ox, oy, oz) = match rays.eye {
            Some(eye) => {
                (f32x16::splat(simd, eye.x), f32x16::splat(simd, eye.y), f32x16::splat(simd, eye.z))
            }
            None => (
                f32x16::from_slice(simd, &rays.origin[0][lanes.clone()]),
                f32x16::from_slice(simd, &rays.origin[1][lanes.clone()]),
                f32x16::from_slice(simd, &rays.origin[2][lanes.clone()]),
            ),
        };
        let px = t.mul_add_precise(dx, ox);
        let py = t.mul_add_precise(dy, oy);
        let pz = t.mul_add_precise(dz, oz);
        let [cx, cy, cz] = centers;
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

    /// What cuts make of a block's hits: caps, and walls seen from within.
    #[inline(always)]
    fn cut<S: Simd>(
        &mut self,
        simd: S,
        rays: &RayTile,
        (first, [cx, cy, cz]): (usize, [f32x16<S>; 3]),
        systems: &[Spheres<'_>],
    ) {
        let lanes = first..first + LANES;
        let distance = f32x16::from_slice(simd, &rays.distance[lanes.clone()]);
        let [[ox, oy, oz], [dx, dy, dz]] = rays.sixteen(simd, first);
        let (x, y, z) = (cx - ox, cy - oy, cz - oz);
        let middle = z.mul_add_precise(dz, y.mul_add_precise(dy, x * dx));
        let to_center2 = z.mul_add_precise(z, y.mul_add_precise(y, x * x));
        let radius = f32x16::from_slice(simd, &self.radius[lanes.clone()]);
        let outside = to_center2.simd_ge(radius * radius);
        let hit = self.mask[first / LANES];
        for (system, spheres) in systems.iter().enumerate() {
            let Some(clip) = spheres.clip else { continue };
            let of = &rays.hit_system[lanes.clone()];
            let own = match systems.len() {
                1 => u64::from(hit),
                _ => of_system(of, system as u16) & u64::from(hit),
            };
            if own == 0 {
                continue;
            }
            let own = mask32x16::from_bitmask(simd, own);
            let lines = [[ox, oy, oz], [dx, dy, dz]];
            self.stretches.begin(clip, 1);
            self.stretches.find(simd, clip, 0, lines);
            let on = own & self.stretches.on_cap(simd, 0, distance);
            // Met where the ray leaves the sphere, from outside it.
            let wall = own & outside & distance.simd_gt(middle);
            let (normal, owners) = cap_normals(simd, clip, lines, (distance, on));
            for axis in 0..3 {
                let row = &mut self.normal[axis][lanes.clone()];
                let sphere = f32x16::from_slice(simd, row);
                let sphere = wall.select(-sphere, sphere);
                on.select(normal[axis], sphere).store_slice(row);
            }
            if on.any_true() {
                self.capped = true;
                for (cap, owner) in self.cap[lanes.clone()].iter_mut().zip(owners) {
                    *cap = (*cap).max(owner);
                }
            }
        }
    }

    /// The cap that ray `ray` has hit, if it has hit one.
    #[inline(always)]
    pub fn cap_of(&self, ray: usize) -> Option<Cap> {
        let owner = self.cap[ray].checked_sub(1)?;
        Some(Cap { owner: owner as u16, point: self.position_of(ray) })
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

    /// The rays that have hit something.
    pub fn rays(&self) -> impl Iterator<Item = usize> {
        (0..TILE_RAYS).filter(|ray| self.has(*ray))
    }

    /// Whether ray `ray` has hit something.
    pub fn has(&self, ray: usize) -> bool {
        self.mask[ray / LANES] >> (ray % LANES) & 1 == 1
    }

    /// The surface that ray `ray` has hit.
    pub fn surface(&self, rays: &RayTile, ray: usize) -> Surface {
        Surface {
            distance: rays.distance[ray],
            system: rays.hit_system[ray],
            index: self.index[ray],
        }
    }

    /// What ray `ray` has hit.
    pub fn center(&self, rays: &RayTile, ray: usize) -> Center {
        if !self.has(ray) {
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

/// Which of sixteen hits are of one system.
fn of_system(systems: &[u16], system: u16) -> u64 {
    let same = systems.iter().enumerate().map(|(lane, s)| u64::from(*s == system) << lane);
    same.fold(0, |all, bit| all | bit)
}

/// The particles at four slots of a grid; where there is none, its last.
#[inline(always)]
fn four<S: Simd>(simd: S, grid: &Grid, slots: &[u32]) -> f32x16<S> {
    let particles = &grid.particles[..];
    let last = particles.len() - 1;
    let low = two(simd, particles, (slots[0] as usize).min(last), (slots[1] as usize).min(last));
    low.combine(two(simd, particles, (slots[2] as usize).min(last), (slots[3] as usize).min(last)))
}

#[inline(always)]
fn two<S: Simd>(simd: S, particles: &[Particle], a: usize, b: usize) -> f32x8<S> {
    let low = f32x4::from_slice(simd, bytemuck::cast_slice(&particles[a..=a]));
    low.combine(f32x4::from_slice(simd, bytemuck::cast_slice(&particles[b..=b])))
}
