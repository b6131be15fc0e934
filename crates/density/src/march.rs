//! Rays to the next surface, sixteen at a time.
//!
//! Each lane goes on by itself: it jumps over cells without surface, or waits in one that may have one until
//! enough lanes do, which then look for a crossing together ([`crate::crossing`]). A lane whose ray is done
//! takes the next one.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::crossing::{Corners, crossing};
use crate::field::Field;
use crate::space::{DROPS, SURFACE, Space};

/// Rays in a vector.
pub(crate) const LANES: usize = 16;
/// The medium of a ray outside.
pub(crate) const OUTSIDE: u32 = u32::MAX;
/// The medium of a ray in the field; what is less is in the drop of that number.
pub(crate) const LIQUID: u32 = u32::MAX - 1;
/// How far a ray goes beyond a cell it leaves, in voxels.
const BEYOND: f32 = 5e-4;
/// Idle lanes that are worth being given rays.
const IDLE: u32 = 4;
/// Lanes that are worth looking for crossings.
const LOOKING: u32 = 6;
/// Drops that overlap, one behind the other, at the most.
const CHAIN: usize = 64;

/// Rays in voxels.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rays {
    pub origin: [Vec<f32>; 3],
    /// Unit vectors.
    pub direction: [Vec<f32>; 3],
    /// [`OUTSIDE`], [`LIQUID`], or a drop.
    pub medium: Vec<u32>,
    /// Where each enters and leaves the box of all surfaces.
    from: Vec<f32>,
    to: Vec<f32>,
    inverse: [Vec<f32>; 3],
}

/// What rays meet.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hits {
    /// Voxels to the next surface; +∞ without one.
    pub distance: Vec<f32>,
    /// [`LIQUID`] or the drop whose surface it is.
    pub surface: Vec<u32>,
}

/// Numbers of all lanes on their own lines of cache.
#[repr(align(64))]
#[derive(Clone, Copy)]
pub(crate) struct Lanes<T>(pub [T; LANES]);

/// Sixteen rays on their way.
struct Walk {
    ray: [u32; LANES],
    origin: [Lanes<f32>; 3],
    direction: [Lanes<f32>; 3],
    inverse: [Lanes<f32>; 3],
    t: Lanes<f32>,
    to: Lanes<f32>,
    /// Bits of lanes: that have a ray; that are in the liquid; that have just set out from a surface.
    alive: u32,
    inside: u32,
    fresh: u32,
}

/// What a ray does at the end of a drop.
enum Left {
    Out(f32, u32),
    Into(f32),
}

impl Rays {
    pub fn clear(&mut self) {
        let rows = self.origin.iter_mut().chain(&mut self.direction);
        rows.for_each(Vec::clear);
        self.medium.clear();
    }

    pub fn len(&self) -> usize {
        self.medium.len()
    }

    pub fn push(&mut self, origin: Vec3, direction: Vec3, medium: u32) {
        for a in 0..3 {
            self.origin[a].push(origin[a]);
            self.direction[a].push(direction[a]);
        }
        self.medium.push(medium);
    }

    pub fn origin(&self, ray: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|a| self.origin[a][ray]))
    }

    pub fn direction(&self, ray: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|a| self.direction[a][ray]))
    }
}

/// Finds what all rays meet. Their rows become whole vectors long.
#[simd]
pub(crate) fn march<S: Simd>(
    simd: S,
    (field, space): (&Field, &Space),
    rays: &mut Rays,
    hits: &mut Hits,
) {
    let count = rays.len();
    hits.distance.clear();
    hits.distance.resize(count, f32::INFINITY);
    hits.surface.clear();
    hits.surface.resize(count, LIQUID);
    clip(simd, space, rays);
    let mut walk = Walk::new();
    let mut next = 0;
    loop {
        if LANES as u32 - walk.alive.count_ones() >= IDLE {
            walk.refill((field, space), (rays, &mut next), hits);
            if walk.alive == 0 {
                break;
            }
        }
        walk.step(simd, (field, space), hits);
    }
}

/// Finds where rays are in the box of all surfaces.
#[inline(always)]
fn clip<S: Simd>(simd: S, space: &Space, rays: &mut Rays) {
    let count = rays.len();
    let room = count.next_multiple_of(LANES);
    for a in 0..3 {
        rays.origin[a].resize(room, 0.0);
        rays.direction[a].resize(room, 1.0);
        rays.inverse[a].resize(room, 0.0);
    }
    rays.from.resize(room, 0.0);
    rays.to.resize(room, 0.0);
    let [low, high] = space.bounds;
    let least = f32x16::splat(simd, 1e-12);
    for at in (0..room).step_by(LANES) {
        let mut from = f32x16::splat(simd, 0.0);
        let mut to = f32x16::splat(simd, f32::INFINITY);
        for a in 0..3 {
            let o = f32x16::from_slice(simd, &rays.origin[a][at..at + LANES]);
            let d = f32x16::from_slice(simd, &rays.direction[a][at..at + LANES]);
            let d = d.abs().max(least).copysign(d);
            let inverse = f32x16::splat(simd, 1.0) / d;
            inverse.store_slice(&mut rays.inverse[a][at..at + LANES]);
            let (one, other) = ((low[a] - o) * inverse, (high[a] - o) * inverse);
            from = from.max(one.min(other));
            to = to.min(one.max(other));
        }
        from.store_slice(&mut rays.from[at..at + LANES]);
        to.store_slice(&mut rays.to[at..at + LANES]);
    }
}

impl Walk {
    fn new() -> Self {
        let zero = Lanes([0.0; LANES]);
        let one = Lanes([1.0; LANES]);
        Self {
            ray: [0; LANES],
            origin: [zero; 3],
            direction: [one; 3],
            inverse: [one; 3],
            t: zero,
            to: zero,
            alive: 0,
            inside: 0,
            fresh: 0,
        }
    }

    /// Gives the next rays to idle lanes.
    #[inline(always)]
    fn refill(
        &mut self,
        (field, space): (&Field, &Space),
        (rays, next): (&Rays, &mut usize),
        hits: &mut Hits,
    ) {
        let mut idle = !self.alive & 0xffff;
        while idle != 0 && *next < rays.len() {
            let ray = *next;
            *next += 1;
            let (mut from, medium) = (rays.from[ray], rays.medium[ray]);
            if medium < LIQUID {
                match leave((field, space), (rays.origin(ray), rays.direction(ray)), medium) {
                    Left::Out(t, drop) => {
                        (hits.distance[ray], hits.surface[ray]) = (t, drop);
                        continue;
                    }
                    Left::Into(t) => from = t,
                }
            }
            if from >= rays.to[ray] {
                continue;
            }
            let lane = idle.trailing_zeros() as usize;
            idle &= idle - 1;
            let bit = 1 << lane;
            for a in 0..3 {
                self.origin[a].0[lane] = rays.origin[a][ray];
                self.direction[a].0[lane] = rays.direction[a][ray];
                self.inverse[a].0[lane] = rays.inverse[a][ray];
            }
            (self.t.0[lane], self.to.0[lane]) = (from, rays.to[ray]);
            self.ray[lane] = ray as u32;
            self.alive |= bit;
            self.fresh |= bit;
            self.inside = if medium == OUTSIDE { self.inside & !bit } else { self.inside | bit };
        }
    }

    /// Lets each lane jump, or look for a crossing.
    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, (field, space): (&Field, &Space), hits: &mut Hits) {
        let t = f32x16::from_slice(simd, &self.t.0);
        let (mut place, mut cell) = ([t; 3], [t; 3]);
        let zero = f32x16::splat(simd, 0.0);
        for a in 0..3 {
            let o = f32x16::from_slice(simd, &self.origin[a].0);
            let d = f32x16::from_slice(simd, &self.direction[a].0);
            place[a] = d.mul_add(t, o);
            let last = f32x16::splat(simd, (space.cells[a] - 1) as f32);
            cell[a] = place[a].floor().max(zero).min(last);
        }
        let at = [cell[0].to_int::<u32x16<S>>(), cell[1].to_int(), cell[2].to_int()];
        let row = at[2] * u32x16::splat(simd, space.cells[1] as u32) + at[1];
        let index = row * u32x16::splat(simd, space.row as u32) + at[0];
        let mut indices = Lanes([0_u32; LANES]);
        index.store_slice(&mut indices.0);
        let (mut jumps, mut look, mut drops) = (Lanes([0_u32; LANES]), 0_u32, 0_u32);
        for lane in 0..LANES {
            let jump = space.jumps[indices.0[lane] as usize];
            look |= u32::from(jump == SURFACE) << lane;
            drops |= u32::from(jump == DROPS) << lane;
            jumps.0[lane] = u32::from(jump);
        }
        look = (look | drops) & self.alive;
        drops &= look;
        let looking = mask32x16::from_bitmask(simd, u64::from(look));
        let one = f32x16::splat(simd, 1.0);
        let jump: f32x16<S> = u32x16::from_slice(simd, &jumps.0).to_float();
        let jump = looking.select(one, jump.max(one));
        let mut end = f32x16::splat(simd, f32::INFINITY);
        for a in 0..3 {
            let o = f32x16::from_slice(simd, &self.origin[a].0);
            let inverse = f32x16::from_slice(simd, &self.inverse[a].0);
            let bound = inverse.simd_ge(zero).select(cell[a] + jump, cell[a] - jump + one);
            end = end.min((bound - o) * inverse);
        }
        let end = end.max(t);
        let mut moved = self.alive & !look;
        let looks = look.count_ones() >= LOOKING || moved == 0;
        let mut met = f32x16::splat(simd, f32::INFINITY);
        if looks {
            let place = [place[0] - cell[0], place[1] - cell[1], place[2] - cell[2]];
            met = self.look(simd, (field, space.threshold), at, (place, t, end), look);
            moved |= look;
        }
        let on = mask32x16::from_bitmask(simd, u64::from(moved));
        on.select(end + BEYOND, t).store_slice(&mut self.t.0);
        self.fresh &= !moved;
        if looks {
            self.settle(simd, (field, space), (met, (t, end), drops), at, hits);
        }
        let t = f32x16::from_slice(simd, &self.t.0);
        let gone = t.simd_ge(f32x16::from_slice(simd, &self.to.0)).to_bitmask() as u32;
        self.alive &= !gone;
    }

    /// Looks for crossings in the cells of some lanes: their distances, +∞ without.
    #[inline(always)]
    fn look<S: Simd>(
        &self,
        simd: S,
        (field, threshold): (&Field, f32),
        at: [u32x16<S>; 3],
        (place, t, end): ([f32x16<S>; 3], f32x16<S>, f32x16<S>),
        look: u32,
    ) -> f32x16<S> {
        let [_, ny, _] = field.lattice.dims;
        let stride = field.stride();
        let row = at[2] * u32x16::splat(simd, ny as u32) + at[1];
        let index = row * u32x16::splat(simd, stride as u32) + at[0];
        let mut indices = Lanes([0_u32; LANES]);
        index.store_slice(&mut indices.0);
        let mut corners = [Lanes([0.0; LANES]); 8];
        let mut left = look;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let first = indices.0[lane] as usize;
            let rows = [first, first + stride, first + stride * ny, first + stride * (ny + 1)];
            for (k, row) in rows.into_iter().enumerate() {
                let pair = &field.values[row..row + 2];
                corners[2 * k].0[lane] = pair[0];
                corners[2 * k + 1].0[lane] = pair[1];
            }
        }
        let mut values = [t; 8];
        for k in 0..8 {
            values[k] = f32x16::from_slice(simd, &corners[k].0) - threshold;
        }
        let mut way = [t; 3];
        for a in 0..3 {
            way[a] = f32x16::from_slice(simd, &self.direction[a].0) * (end - t);
        }
        let inside = mask32x16::from_bitmask(simd, u64::from(self.inside));
        let fresh = mask32x16::from_bitmask(simd, u64::from(self.fresh));
        let part = crossing(simd, Corners { values, place, way }, (inside, fresh));
        let there = mask32x16::from_bitmask(simd, u64::from(look)) & part.simd_le(1.0);
        there.select(part.mul_add(end - t, t), f32x16::splat(simd, f32::INFINITY))
    }

    /// Ends the rays that met something; those in drops' cells may meet one before.
    #[inline(always)]
    fn settle<S: Simd>(
        &mut self,
        simd: S,
        (field, space): (&Field, &Space),
        (met, (t, end), drops): (f32x16<S>, (f32x16<S>, f32x16<S>), u32),
        at: [u32x16<S>; 3],
        hits: &mut Hits,
    ) {
        let crossed = met.simd_lt(f32x16::splat(simd, f32::INFINITY)).to_bitmask() as u32;
        let mut distances = Lanes([0.0; LANES]);
        met.store_slice(&mut distances.0);
        let mut left = crossed & !drops;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            self.finish(lane, (distances.0[lane], LIQUID), hits);
        }
        if drops != 0 {
            let (mut from, mut to) = (Lanes([0.0; LANES]), Lanes([0.0; LANES]));
            t.store_slice(&mut from.0);
            end.store_slice(&mut to.0);
            let mut cells = [Lanes([0_u32; LANES]); 3];
            for a in 0..3 {
                at[a].store_slice(&mut cells[a].0);
            }
            let mut left = drops;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let cell = [cells[0].0[lane], cells[1].0[lane], cells[2].0[lane]];
                let ways = [from.0[lane], to.0[lane], distances.0[lane]];
                self.meet_drops((field, space), (lane, cell.map(|c| c as usize)), ways, hits);
            }
        }
    }

    /// A lane in a cell with drops, from, to, and where it crosses the field's surface.
    fn meet_drops(
        &mut self,
        (field, space): (&Field, &Space),
        (lane, cell): (usize, [usize; 3]),
        [from, to, crossed]: [f32; 3],
        hits: &mut Hits,
    ) {
        let ray = (self.vector(&self.origin, lane), self.vector(&self.direction, lane));
        let bit = 1 << lane;
        if self.inside & bit == 0 {
            match space.drops.enter(cell, ray, [from, to.min(crossed)]) {
                Some(entered) => self.finish(lane, entered, hits),
                None if crossed.is_finite() => self.finish(lane, (crossed, LIQUID), hits),
                None => {}
            }
            return;
        }
        if !crossed.is_finite() {
            return;
        }
        let (origin, direction) = ray;
        let place = origin + direction * crossed;
        let Some(drop) = space.drops.around(cell, place, LIQUID) else {
            return self.finish(lane, (crossed, LIQUID), hits);
        };
        match leave((field, space), (origin, direction), drop) {
            Left::Out(t, drop) => self.finish(lane, (t, drop), hits),
            Left::Into(t) => {
                self.t.0[lane] = t.max(crossed + BEYOND);
                self.fresh |= bit;
            }
        }
    }

    #[inline(always)]
    fn vector(&self, rows: &[Lanes<f32>; 3], lane: usize) -> Vec3 {
        Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane])
    }

    #[inline(always)]
    fn finish(&mut self, lane: usize, (t, surface): (f32, u32), hits: &mut Hits) {
        let ray = self.ray[lane] as usize;
        (hits.distance[ray], hits.surface[ray]) = (t, surface);
        self.alive &= !(1 << lane);
    }
}

/// Follows a ray in a drop to where it leaves it and all others that overlap there.
fn leave(
    (field, space): (&Field, &Space),
    (origin, direction): (Vec3, Vec3),
    mut drop: u32,
) -> Left {
    let mut t = 0.0;
    for _ in 0..CHAIN {
        let ball = &space.drops.drops[drop as usize];
        t = ball.meet(origin, direction).map_or(t, |[_, exit]| exit.max(t));
        let place = origin + direction * t;
        if field.at(place) >= space.threshold {
            return Left::Into(t);
        }
        let cell = place.max(Vec3::ZERO).to_array();
        let cell = [0, 1, 2].map(|a| (cell[a] as usize).min(space.cells[a] - 1));
        match space.drops.around(cell, place, drop) {
            Some(next) => drop = next,
            None => break,
        }
    }
    Left::Out(t, drop)
}
