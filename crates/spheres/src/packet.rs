//! A packet of rays and what each has hit so far.

use fearless_simd::{f32x16, prelude::*};
use glam::Vec3;
use motes_grid::Clip;

use crate::clip::Stretches;

/// Rays tested side by side by one SIMD instruction.
pub const LANES: usize = 16;
/// Most rays of a packet: 16 × 16 (Gribble et al. 2007, Table 2).
pub const MOST_RAYS: usize = 256;
/// The slot of a ray that has hit nothing of the current system.
pub const NO_SLOT: u32 = u32::MAX;

/// The distance of a ray that has met something and looks no further.
pub(crate) const BLOCKED: f32 = -1.0;

/// Up to 256 rays, coordinate by coordinate, and each one's nearest hit.
///
/// # Invariants
/// The number of lanes in use is a multiple of [`LANES`]; lanes past the last ray repeat ray 0, so
/// that no bound over the lanes is wider than over the rays.
#[derive(Clone, Debug)]
pub struct Packet {
    pub(crate) rays: usize,
    /// Whether any hit ends a ray, not only the nearest.
    pub(crate) any_hit: bool,
    /// Whether spheres outside the frustum are left out.
    pub(crate) culls: bool,
    pub(crate) origin: [[f32; MOST_RAYS]; 3],
    pub(crate) direction: [[f32; MOST_RAYS]; 3],
    /// Distance of the nearest hit; +∞ for none.
    pub(crate) distance: [f32; MOST_RAYS],
    /// Where in the grids of the system at hand the nearest sphere lies, if that system has it.
    pub(crate) slot: [u32; MOST_RAYS],
    /// The slot of the nearest sphere of all systems.
    hit_slot: [u32; MOST_RAYS],
    /// The system of the nearest sphere.
    hit_system: [u16; MOST_RAYS],
    /// Whether rays look for what comes after a surface they have met.
    pub(crate) peels: bool,
    /// That surface: its distance, and its system and index.
    pub(crate) after: [f32; MOST_RAYS],
    pub(crate) after_sphere: [(u16, u32); MOST_RAYS],
    /// The system at hand.
    pub(crate) system: u16,
    /// Optical depth of what each ray has met, for rays that go through.
    pub(crate) optical: [u32; MOST_RAYS],
    /// Whether the spheres at hand are cut, and what of the rays is left then.
    pub(crate) clipped: bool,
    pub(crate) stretches: Stretches,
}

/// A surface that a ray has met. Along a ray, surfaces come by distance, then system, then index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Distance along the ray.
    pub distance: f32,
    /// System of the sphere.
    pub system: u16,
    /// Its index in the file's own order.
    pub index: u32,
}

impl Packet {
    /// A packet without rays.
    pub fn new() -> Self {
        Self {
            rays: 0,
            any_hit: false,
            culls: true,
            origin: [[0.0; MOST_RAYS]; 3],
            direction: [[0.0; MOST_RAYS]; 3],
            distance: [f32::INFINITY; MOST_RAYS],
            slot: [NO_SLOT; MOST_RAYS],
            hit_slot: [NO_SLOT; MOST_RAYS],
            hit_system: [0; MOST_RAYS],
            peels: false,
            after: [0.0; MOST_RAYS],
            after_sphere: [(0, 0); MOST_RAYS],
            system: 0,
            optical: [0; MOST_RAYS],
            clipped: false,
            stretches: Stretches::new(),
        }
    }

    /// Removes all rays and hits; the rays to come look for what is nearest.
    pub fn clear(&mut self) {
        self.rays = 0;
        (self.any_hit, self.peels) = (false, false);
    }

    /// Removes all rays and hits; the rays to come only ask whether there is anything.
    pub fn clear_for_any_hit(&mut self) {
        self.rays = 0;
        (self.any_hit, self.peels) = (true, false);
    }

    /// Removes all rays and hits; the rays to come look for the nearest surface after one they have met.
    pub fn clear_for_next(&mut self) {
        self.rays = 0;
        (self.any_hit, self.peels) = (false, true);
    }

    /// From now on tests every sphere of the cells its frustum overlaps, culling none: what Gribble et
    /// al. 2007 compare with in Table 6. The hits are the same.
    pub fn test_all(&mut self) {
        self.culls = false;
    }

    /// Adds a ray; `direction` has unit length.
    ///
    /// # Panics
    /// If the packet is full.
    pub fn push(&mut self, origin: Vec3, direction: Vec3) {
        self.push_within(origin, direction, f32::INFINITY);
    }

    /// Adds a ray that looks no farther than `reach`.
    ///
    /// # Panics
    /// If the packet is full.
    pub fn push_within(&mut self, origin: Vec3, direction: Vec3, reach: f32) {
        let i = self.rays;
        for axis in 0..3 {
            self.origin[axis][i] = origin[axis];
            self.direction[axis][i] = direction[axis];
        }
        self.distance[i] = reach;
        self.hit_slot[i] = NO_SLOT;
        self.optical[i] = 0;
        self.rays += 1;
    }

    /// Adds a ray that looks for what comes after `met`, to a packet cleared for that.
    ///
    /// # Panics
    /// If the packet is full.
    pub fn push_after(&mut self, origin: Vec3, direction: Vec3, met: Surface) {
        self.after[self.rays] = met.distance;
        self.after_sphere[self.rays] = (met.system, met.index);
        self.push(origin, direction);
    }

    /// How many rays there are.
    pub fn len(&self) -> usize {
        self.rays
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rays == 0
    }

    /// Lanes in use.
    pub(crate) fn lanes(&self) -> usize {
        self.rays.next_multiple_of(LANES)
    }

    /// Fills the lanes past the last ray with ray 0.
    pub(crate) fn pad(&mut self) {
        for i in self.rays..self.lanes() {
            for axis in 0..3 {
                self.origin[axis][i] = self.origin[axis][0];
                self.direction[axis][i] = self.direction[axis][0];
            }
            self.distance[i] = self.distance[0];
            self.slot[i] = self.slot[0];
            self.after[i] = self.after[0];
            self.after_sphere[i] = self.after_sphere[0];
        }
    }

    /// Origin of ray `i`.
    pub fn origin_of(&self, i: usize) -> Vec3 {
        Vec3::from_array(self.origin.map(|v| v[i]))
    }

    /// Direction of ray `i`.
    pub fn direction_of(&self, i: usize) -> Vec3 {
        Vec3::from_array(self.direction.map(|v| v[i]))
    }

    /// Begins a system: no ray has hit it yet.
    pub fn begin_system(&mut self) {
        let lanes = self.lanes();
        self.slot[..lanes].fill(NO_SLOT);
        self.pad();
    }

    /// Goes on with more of the grids of a system that `first` was the first part of: what rays have hit of
    /// it stays.
    pub(crate) fn continue_system(&mut self, first: u16) {
        for i in 0..self.rays {
            let held = self.hit_slot[i] != NO_SLOT && self.hit_system[i] >= first;
            self.slot[i] = if held { self.hit_slot[i] } else { NO_SLOT };
        }
        self.pad();
    }

    /// Ends a system: where its spheres are nearest, they are the hits.
    pub fn end_system(&mut self, system: u16) {
        for i in (0..self.rays).filter(|i| self.slot[*i] != NO_SLOT) {
            self.hit_slot[i] = self.slot[i];
            self.hit_system[i] = system;
        }
    }

    /// Ends a part of a system that goes on with others: no two parts share spheres, so that what is held
    /// has been hit before.
    pub(crate) fn end_part(&mut self, (first, part): (u16, u16)) {
        for i in (0..self.rays).filter(|i| self.slot[*i] != NO_SLOT) {
            let held = self.hit_slot[i] == self.slot[i] && self.hit_system[i] >= first;
            if !held {
                self.hit_slot[i] = self.slot[i];
                self.hit_system[i] = part;
            }
        }
    }

    /// Lets the rays meet what a clip leaves, or, without one, everything.
    #[inline(always)]
    pub(crate) fn clip_to<S: Simd>(&mut self, simd: S, clip: Option<&Clip>) {
        self.clipped = clip.is_some();
        let Some(clip) = clip else { return };
        self.stretches.begin(clip, self.lanes() / LANES);
        for first in (0..self.lanes()).step_by(LANES) {
            let rays = [sixteen(simd, &self.origin, first), sixteen(simd, &self.direction, first)];
            self.stretches.find(simd, clip, first / LANES, rays);
        }
    }

    /// What ray `i` has hit first: distance, system and slot.
    pub fn hit(&self, i: usize) -> Option<(f32, u16, u32)> {
        (self.hit_slot[i] != NO_SLOT)
            .then(|| (self.distance[i], self.hit_system[i], self.hit_slot[i]))
    }

    /// Whether ray `i` of an any-hit packet has met something.
    pub fn is_blocked(&self, i: usize) -> bool {
        self.distance[i] == BLOCKED
    }

    /// Ray `i` alone.
    pub(crate) fn single(&self, i: usize) -> Self {
        let mut one = Self::new();
        (one.any_hit, one.culls) = (self.any_hit, self.culls);
        (one.peels, one.system) = (self.peels, self.system);
        one.push(self.origin_of(i), self.direction_of(i));
        one.distance[0] = self.distance[i];
        one.slot[0] = self.slot[i];
        one.after[0] = self.after[i];
        one.after_sphere[0] = self.after_sphere[i];
        one.optical[0] = self.optical[i];
        one
    }
}

#[inline(always)]
fn sixteen<S: Simd>(simd: S, rows: &[[f32; MOST_RAYS]; 3], first: usize) -> [f32x16<S>; 3] {
    let [x, y, z] = rows;
    [
        f32x16::from_slice(simd, &x[first..first + LANES]),
        f32x16::from_slice(simd, &y[first..first + LANES]),
        f32x16::from_slice(simd, &z[first..first + LANES]),
    ]
}

impl Default for Packet {
    fn default() -> Self {
        Self::new()
    }
}
