//! Rays, row by row, in voxels.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use glam::Vec3;

use crate::lanes::{LANES, V3};

/// The medium of a ray outside.
pub(crate) const OUTSIDE: u32 = u32::MAX;
/// The medium of a ray in the field; what is less is in the drop of that number.
pub(crate) const LIQUID: u32 = u32::MAX - 1;

/// Rays that there is room for at the least.
const LEAST_ROOM: usize = 1024;

/// Rays. Rows are longer than they are many: a vector may begin at any.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rays {
    count: usize,
    pub origin: [Vec<f32>; 3],
    /// Unit vectors.
    pub direction: [Vec<f32>; 3],
    /// [`OUTSIDE`], [`LIQUID`], or a drop.
    pub medium: Vec<u32>,
    /// Where each enters and leaves the box of all surfaces.
    pub from: Vec<f32>,
    pub to: Vec<f32>,
    pub inverse: [Vec<f32>; 3],
}

/// What rays meet.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hits {
    /// Voxels to the next surface; +∞ without one.
    pub distance: Vec<f32>,
    /// [`LIQUID`] or the drop whose surface it is.
    pub surface: Vec<u32>,
    /// The face of a cut that it is a cap of, counted from 1; 0: of none.
    pub cap: Vec<u32>,
}

impl Rays {
    pub fn clear(&mut self) {
        self.count = 0;
    }

    pub fn len(&self) -> usize {
        self.count
    }

    /// Makes room for sixteen more.
    pub fn reserve(&mut self) {
        let need = self.count + 2 * LANES;
        if self.medium.len() < need {
            let room = (2 * self.count).max(LEAST_ROOM) + 2 * LANES;
            let rows = self.origin.iter_mut().chain(&mut self.direction).chain(&mut self.inverse);
            rows.chain([&mut self.from, &mut self.to]).for_each(|row| row.resize(room, 1.0));
            self.medium.resize(room, OUTSIDE);
        }
    }

    pub fn push(&mut self, origin: Vec3, direction: Vec3, medium: u32) {
        self.reserve();
        for a in 0..3 {
            self.origin[a][self.count] = origin[a];
            self.direction[a][self.count] = direction[a];
        }
        self.medium[self.count] = medium;
        self.count += 1;
    }

    /// Adds those of sixteen rays whose lane is set. There must be room.
    #[inline(always)]
    pub fn push_where<S: Simd>(
        &mut self,
        mask: mask32x16<S>,
        (origin, direction): (V3<S>, V3<S>),
        medium: u32x16<S>,
    ) {
        let at = self.count..self.count + LANES;
        for a in 0..3 {
            origin.0[a].compress(mask).store_slice(&mut self.origin[a][at.clone()]);
            direction.0[a].compress(mask).store_slice(&mut self.direction[a][at.clone()]);
        }
        medium.compress(mask).store_slice(&mut self.medium[at]);
        self.count += mask.to_bitmask().count_ones() as usize;
    }

    pub fn origin(&self, ray: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|a| self.origin[a][ray]))
    }

    pub fn direction(&self, ray: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|a| self.direction[a][ray]))
    }

    /// Finds where all are in a box.
    #[inline(always)]
    pub fn clip<S: Simd>(&mut self, simd: S, bounds: [Vec3; 2]) {
        self.reserve();
        for at in (0..self.count).step_by(LANES) {
            let origin = V3::load(simd, &self.origin, at);
            let (inverse, [from, to]) = within(origin, V3::load(simd, &self.direction, at), bounds);
            for a in 0..3 {
                inverse.0[a].store_slice(&mut self.inverse[a][at..at + LANES]);
            }
            from.store_slice(&mut self.from[at..at + LANES]);
            to.store_slice(&mut self.to[at..at + LANES]);
        }
    }
}

/// One over the directions of sixteen rays, and where these enter and leave a box: not before they begin.
#[inline(always)]
pub(crate) fn within<S: Simd>(
    origin: V3<S>,
    direction: V3<S>,
    [low, high]: [Vec3; 2],
) -> (V3<S>, [f32x16<S>; 2]) {
    let simd = origin.0[0].token();
    let (least, one) = (f32x16::splat(simd, 1e-12), f32x16::splat(simd, 1.0));
    let mut from = f32x16::splat(simd, 0.0);
    let mut to = f32x16::splat(simd, f32::INFINITY);
    let mut inverse = direction;
    for a in 0..3 {
        let (o, d) = (origin.0[a], direction.0[a]);
        inverse.0[a] = one / d.abs().max(least).copysign(d);
        let (near, far) = ((low[a] - o) * inverse.0[a], (high[a] - o) * inverse.0[a]);
        from = from.max(near.min(far));
        to = to.min(near.max(far));
    }
    (inverse, [from, to])
}

impl Hits {
    /// None yet for so many rays, in whole vectors.
    pub fn clear(&mut self, count: usize) {
        let room = count.next_multiple_of(LANES);
        self.distance.clear();
        self.distance.resize(room, f32::INFINITY);
        self.surface.clear();
        self.surface.resize(room, LIQUID);
        self.cap.clear();
        self.cap.resize(room, 0);
    }
}
