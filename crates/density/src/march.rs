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
use crate::lanes::{LANES, Lanes};
use crate::rays::{Hits, LIQUID, OUTSIDE, Rays};
use crate::space::{DROPS, SURFACE, Space};

/// How far a ray goes beyond a cell it leaves, in voxels.
const BEYOND: f32 = 5e-4;
/// Idle lanes that are worth being given rays.
const IDLE: u32 = 2;
/// Lanes that are worth looking for crossings.
const LOOKING: u32 = 8;
/// Drops that overlap, one behind the other, at the most.
const CHAIN: usize = 64;

const COUNT: [u32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Sixteen rays on their way.
struct Walk {
    ray: Lanes<u32>,
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

/// Where lanes are.
#[derive(Clone, Copy)]
struct Here<S: Simd> {
    /// The cell.
    at: [u32x16<S>; 3],
    /// The place in it.
    place: [f32x16<S>; 3],
    /// How far along the ray that is, and where it leaves the cell, or what it jumps over.
    t: f32x16<S>,
    end: f32x16<S>,
}

/// What a ray does at the end of a drop.
enum Left {
    Out(f32, u32),
    Into(f32),
}

/// Finds what all rays meet.
#[simd]
pub(crate) fn march<S: Simd>(
    simd: S,
    (field, space): (&Field, &Space),
    rays: &mut Rays,
    hits: &mut Hits,
) {
    hits.clear(rays.len());
    rays.clip(simd, space.bounds);
    leave_drops((field, space), rays, hits);
    // Two in turns: one goes on while the other waits for memory.
    let (mut one, mut other) = (Walk::new(), Walk::new());
    let mut next = 0;
    while one.advance(simd, (field, space), (rays, &mut next), hits)
        | other.advance(simd, (field, space), (rays, &mut next), hits)
    {}
}

#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &Lanes<f32>) -> f32x16<S> {
    f32x16::from_slice(simd, &lanes.0)
}

impl Walk {
    fn new() -> Self {
        let zero = Lanes([0.0; LANES]);
        let one = Lanes([1.0; LANES]);
        Self {
            ray: Lanes([0; LANES]),
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

    /// Takes a step, with more rays where many lanes are idle; false if there are none left.
    #[inline(always)]
    fn advance<S: Simd>(
        &mut self,
        simd: S,
        within: (&Field, &Space),
        (rays, next): (&Rays, &mut usize),
        hits: &mut Hits,
    ) -> bool {
        // Some of them may have nowhere to go.
        while LANES as u32 - self.alive.count_ones() >= IDLE && *next < rays.len() {
            self.refill(simd, rays, next);
        }
        if self.alive == 0 {
            return false;
        }
        self.step(simd, within, hits);
        true
    }

    /// Gives the next rays to idle lanes.
    #[inline(always)]
    fn refill<S: Simd>(&mut self, simd: S, rays: &Rays, next: &mut usize) {
        let (mut idle, first) = (!self.alive & 0xffff, *next);
        let left = rays.len() - first;
        while idle.count_ones() as usize > left {
            idle &= idle - 1;
        }
        if idle == 0 {
            return;
        }
        *next += idle.count_ones() as usize;
        let mask = mask32x16::from_bitmask(simd, u64::from(idle));
        let give = |row: &[f32], lanes: &mut Lanes<f32>| {
            let more = f32x16::from_slice(simd, &row[first..first + LANES]);
            let own = f32x16::from_slice(simd, &lanes.0);
            more.expand_merge(mask, own).store_slice(&mut lanes.0);
        };
        for a in 0..3 {
            give(&rays.origin[a], &mut self.origin[a]);
            give(&rays.direction[a], &mut self.direction[a]);
            give(&rays.inverse[a], &mut self.inverse[a]);
        }
        give(&rays.from, &mut self.t);
        give(&rays.to, &mut self.to);
        let numbers = u32x16::from_slice(simd, &COUNT) + first as u32;
        let own = u32x16::from_slice(simd, &self.ray.0);
        numbers.expand_merge(mask, own).store_slice(&mut self.ray.0);
        let media = u32x16::from_slice(simd, &rays.medium[first..first + LANES]).expand(mask);
        let outside = media.simd_eq(u32x16::splat(simd, OUTSIDE)).to_bitmask() as u32;
        let (t, to) = (load(simd, &self.t), load(simd, &self.to));
        let some = t.simd_lt(to).to_bitmask() as u32;
        self.inside = (self.inside & !idle) | (idle & !outside);
        self.alive |= idle & some;
        self.fresh |= idle;
    }

    /// Lets each lane jump, or look for a crossing.
    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, (field, space): (&Field, &Space), hits: &mut Hits) {
        let t = load(simd, &self.t);
        let (mut place, mut cell) = ([t; 3], [t; 3]);
        let zero = f32x16::splat(simd, 0.0);
        for a in 0..3 {
            let o = load(simd, &self.origin[a]);
            let d = load(simd, &self.direction[a]);
            place[a] = d.mul_add(t, o);
            // The box of all surfaces lies within the cells.
            cell[a] = place[a].floor().max(zero);
        }
        let at = [cell[0].to_int::<u32x16<S>>(), cell[1].to_int(), cell[2].to_int()];
        let row = at[2] * u32x16::splat(simd, space.cells[1] as u32) + at[1];
        let last = u32x16::splat(simd, space.jumps.len() as u32 - 1);
        let index = (row * u32x16::splat(simd, space.row as u32) + at[0]).min(last);
        let mut indices = Lanes([0_u32; LANES]);
        index.store_slice(&mut indices.0);
        let mut jumps = Lanes([0_u32; LANES]);
        for lane in 0..LANES {
            jumps.0[lane] = u32::from(space.jumps[indices.0[lane] as usize]);
        }
        let jumps = u32x16::from_slice(simd, &jumps.0);
        let in_drops = jumps.simd_eq(u32x16::splat(simd, u32::from(DROPS)));
        let looking = in_drops | jumps.simd_eq(u32x16::splat(simd, u32::from(SURFACE)));
        let look = looking.to_bitmask() as u32 & self.alive;
        let drops = in_drops.to_bitmask() as u32 & look;
        let one = f32x16::splat(simd, 1.0);
        let jump: f32x16<S> = looking.select(one, jumps.to_float());
        let mut end = f32x16::splat(simd, f32::INFINITY);
        for a in 0..3 {
            let o = load(simd, &self.origin[a]);
            let inverse = load(simd, &self.inverse[a]);
            let bound = inverse.simd_ge(zero).select(cell[a] + jump, cell[a] - jump + one);
            end = end.min((bound - o) * inverse);
        }
        let end = end.max(t);
        let mut here = Here { at, place, t, end };
        let mut moved = self.alive & !look;
        let looks = look.count_ones() >= LOOKING || moved == 0;
        let mut met = f32x16::splat(simd, f32::INFINITY);
        if looks {
            let place = [place[0] - cell[0], place[1] - cell[1], place[2] - cell[2]];
            here.place = place;
            met = self.look(simd, (field, space.threshold), &here, look);
            moved |= look;
        }
        let on = mask32x16::from_bitmask(simd, u64::from(moved));
        let to = load(simd, &self.to);
        on.select((end + BEYOND).min(to), t).store_slice(&mut self.t.0);
        self.fresh &= !moved;
        if looks {
            self.settle((field, space), &here, (met, drops), hits);
        }
        let t = load(simd, &self.t);
        let gone = t.simd_ge(load(simd, &self.to)).to_bitmask() as u32;
        self.alive &= !gone;
    }

    /// Looks for crossings in the cells of some lanes: their distances, +∞ without.
    #[inline(always)]
    fn look<S: Simd>(
        &self,
        simd: S,
        (field, threshold): (&Field, f32),
        here: &Here<S>,
        look: u32,
    ) -> f32x16<S> {
        let Here { at, place, t, end } = *here;
        let [_, ny, _] = field.lattice.dims;
        let stride = field.stride();
        let row = at[2] * u32x16::splat(simd, ny as u32) + at[1];
        let index = row * u32x16::splat(simd, stride as u32) + at[0];
        let offsets = [0, stride, stride * ny, stride * (ny + 1)];
        let span = offsets[3] + 2;
        // Of lanes that do not look, too: it is quicker not to ask.
        let last = u32x16::splat(simd, field.values.len().saturating_sub(span) as u32);
        let mut indices = Lanes([0_u32; LANES]);
        index.min(last).store_slice(&mut indices.0);
        // Pairs along x.
        let mut pairs = [Lanes([[0.0; 2]; LANES]); 4];
        for lane in 0..LANES {
            let near = &field.values[indices.0[lane] as usize..][..span];
            for k in 0..4 {
                pairs[k].0[lane] = [near[offsets[k]], near[offsets[k] + 1]];
            }
        }
        let mut values = [t; 8];
        for k in 0..4 {
            let (low, high) = pairs[k].0.as_flattened().split_at(LANES);
            let low = f32x16::from_slice(simd, low) - threshold;
            let high = f32x16::from_slice(simd, high) - threshold;
            (values[2 * k], values[2 * k + 1]) = low.deinterleave(high);
        }
        let mut way = [t; 3];
        for a in 0..3 {
            way[a] = load(simd, &self.direction[a]) * (end - t);
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
        (field, space): (&Field, &Space),
        here: &Here<S>,
        (met, drops): (f32x16<S>, u32),
        hits: &mut Hits,
    ) {
        let simd = met.token();
        let Here { at, t, end, .. } = *here;
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
        let ray = self.ray.0[lane] as usize;
        (hits.distance[ray], hits.surface[ray]) = (t, surface);
        self.alive &= !(1 << lane);
    }
}

/// Takes rays in drops to where they leave these.
fn leave_drops(within: (&Field, &Space), rays: &mut Rays, hits: &mut Hits) {
    for ray in 0..rays.len() {
        let medium = rays.medium[ray];
        if medium < LIQUID {
            match leave(within, (rays.origin(ray), rays.direction(ray)), medium) {
                Left::Out(t, drop) => {
                    (hits.distance[ray], hits.surface[ray]) = (t, drop);
                    // There is no way to go on.
                    rays.to[ray] = 0.0;
                }
                Left::Into(t) => rays.from[ray] = t,
            }
        }
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
