//! Parallel rays that start close together: is anything in the way of them within their reach?
//!
//! Along the axis K that the direction mostly follows, a ray is the line u = u₀ + k·dU, v = v₀ + k·dV
//! (Gribble et al. 2007, §2). In the sheared coordinates u′ = u − k·dU and v′ = v − k·dV all rays of a
//! beam stand still, so that the frustum is a box, and a sphere of radius r meets none of them unless its
//! centre lies within r·√(1 + dU²) and r·√(1 + dV²) of it (§4.1).

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Clip, Grid, Seen};

use crate::clip::Stretches;
use crate::intersect::{bits, radii_at, sixteen_centers};
use crate::lanes::Lanes;
use crate::near::{Boxes, Near, Shelves};
use crate::overview::GROUP;
use crate::packet::LANES;
use crate::shaft::{LOST, blocks};
use crate::traverse::{Counts, Spheres};

/// Most rays of a beam.
pub(crate) const MOST: usize = 1024;
/// Beams of more vectors than this look at the bounds of each vector before they test its rays.
const FEW: usize = 2;

/// Parallel rays, all of the same reach.
#[derive(Debug)]
pub(crate) struct Beam {
    /// How many rays there are; the rest of the last vector is none.
    pub rays: usize,
    pub origin: [Lanes<f32>; 3],
    /// How far each ray looks; [`LOST`] once it is blocked.
    reach: Lanes<f32>,
    /// Least and greatest u′ and v′ of each vector of sixteen rays; of what is no vector, bounds that
    /// nothing lies in.
    low: [Lanes<f32>; 2],
    high: [Lanes<f32>; 2],
    /// What of the rays is left, where the spheres at hand are cut; and whose cuts these are, plus one.
    stretches: Stretches,
    cut: usize,
}

/// The shape of a beam: constants for sixteen boxes or spheres at a time.
#[derive(Clone, Copy)]
struct Shape {
    /// The axes K, U, V.
    axes: [usize; 3],
    /// +1 where the rays run towards greater k, else −1.
    sign: f32,
    /// dU and dV, and √(1 + dU²) and √(1 + dV²).
    slope: [f32; 2],
    widen: [f32; 2],
    /// Where k is counted from.
    k: f32,
    /// The rays' box in u′ and v′.
    low: [f32; 2],
    high: [f32; 2],
    /// Where along K they begin and end, times the sign.
    start: f32,
    end: f32,
    /// What rounding may add.
    pad: f32,
}

impl Beam {
    pub fn new() -> Self {
        let zeros = || [(); 3].map(|()| Lanes::new(0.0, MOST + LANES));
        let bounds = |value| [(); 2].map(|()| Lanes::new(value, MOST / LANES + LANES));
        Self {
            rays: 0,
            origin: zeros(),
            reach: Lanes::new(LOST, MOST + LANES),
            low: bounds(f32::INFINITY),
            high: bounds(f32::NEG_INFINITY),
            stretches: Stretches::new(),
            cut: 0,
        }
    }

    /// Which of the sixteen rays from `first` on are open.
    #[inline(always)]
    pub fn open<S: Simd>(&self, simd: S, first: usize) -> mask32x16<S> {
        let reach = f32x16::from_slice(simd, &self.reach[first..first + LANES]);
        reach.simd_gt(f32x16::splat(simd, LOST))
    }

    /// Blocks the rays that a sphere is in the way of; `near` has all blocks within `reach` of the rays'
    /// origins.
    #[simd]
    pub fn block<S: Simd>(
        &mut self,
        simd: S,
        (direction, reach): (Vec3, f32),
        (near, shelves): (&Near, &Shelves),
        (systems, counts): (&[Spheres<'_>], &mut Counts),
    ) {
        let lanes = self.rays.next_multiple_of(LANES);
        self.reach[..self.rays].fill(reach);
        self.reach[self.rays..lanes].fill(LOST);
        for axis in 0..3 {
            // The last vector's rest starts where the first ray does.
            let first = self.origin[axis][0];
            self.origin[axis][self.rays..lanes].fill(first);
        }
        let shape = self.shape(simd, direction, reach);
        self.cut = 0;
        let mut live = lanes / LANES;
        for (_, place, wanted) in &near.groups {
            let boxes = &shelves.boxes[*place as usize];
            let spheres = &systems[boxes.of.0 as usize];
            let grid = &spheres.classes.grids[boxes.of.1 as usize];
            let cut = if spheres.clip.is_some() { usize::from(boxes.of.0) + 1 } else { 0 };
            if let Some(clip) = spheres.clip.filter(|_| cut != self.cut) {
                self.clip_to(simd, clip, direction);
            }
            self.cut = cut;
            let visible = &spheres.visible[boxes.of.1 as usize];
            let mut meets = 0;
            for part in (0..GROUP).step_by(LANES) {
                if *wanted >> part & 0xffff != 0 {
                    meets |= shape.boxes(simd, boxes, part) << part;
                }
            }
            meets &= *wanted;
            while meets != 0 {
                let block = boxes.block[meets.trailing_zeros() as usize] as usize;
                meets &= meets - 1;
                let seen = visible.block(grid, block);
                let run = (grid, seen, grid.particles_of(block));
                // What is not cut pays nothing for what is.
                match self.cut {
                    0 => self.run::<S, false>(simd, (&shape, direction), run, (&mut live, counts)),
                    _ => self.run::<S, true>(simd, (&shape, direction), run, (&mut live, counts)),
                }
                if live == 0 {
                    return;
                }
            }
        }
    }

    /// Finds what a clip leaves of the rays.
    #[inline(always)]
    fn clip_to<S: Simd>(&mut self, simd: S, clip: &Clip, direction: Vec3) {
        let vectors = self.rays.div_ceil(LANES);
        self.stretches.begin(clip, vectors);
        let direction = [
            f32x16::splat(simd, direction.x),
            f32x16::splat(simd, direction.y),
            f32x16::splat(simd, direction.z),
        ];
        for vector in 0..vectors {
            let [x, y, z] = &self.origin;
            let at = vector * LANES;
            let origin = [load(simd, x, at), load(simd, y, at), load(simd, z, at)];
            self.stretches.find(simd, clip, vector, [origin, direction]);
        }
    }

    #[inline(always)]
    fn shape<S: Simd>(&mut self, simd: S, direction: Vec3, reach: f32) -> Shape {
        let k = direction.abs().max_position();
        let axes = [k, (k + 1) % 3, (k + 2) % 3];
        let sign = direction[k].signum();
        let slope = [direction[axes[1]] / direction[k], direction[axes[2]] / direction[k]];
        let from = self.origin[k][0];
        let (mut k0, mut k1) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let mut size = 0f32;
        for first in (0..self.rays).step_by(LANES) {
            let along = load(simd, &self.origin[k], first);
            (k0, k1) = (k0.min(along.reduce_min()), k1.max(along.reduce_max()));
            for side in 0..2 {
                let across = load(simd, &self.origin[axes[side + 1]], first);
                let sheared = across - (along - from) * slope[side];
                let vector = first / LANES;
                self.low[side][vector] = sheared.reduce_min();
                self.high[side][vector] = sheared.reduce_max();
                low[side] = low[side].min(self.low[side][vector]);
                high[side] = high[side].max(self.high[side][vector]);
                size = size.max(across.abs().reduce_max());
            }
        }
        let vectors = self.rays.div_ceil(LANES);
        for side in 0..2 {
            let rest = vectors..vectors.next_multiple_of(LANES);
            self.low[side][rest.clone()].fill(f32::INFINITY);
            self.high[side][rest].fill(f32::NEG_INFINITY);
        }
        let (start, last) = if sign > 0.0 { (k0, k1) } else { (-k1, -k0) };
        let pad = (size + k0.abs().max(k1.abs()) + reach) * 4e-6;
        Shape {
            axes,
            sign,
            slope,
            widen: slope.map(|s| (1.0 + s * s).sqrt()),
            k: from,
            low,
            high,
            start,
            end: last + reach * direction[k].abs(),
            pad,
        }
    }

    /// Culls and tests the particles of a block.
    #[inline(always)]
    fn run<S: Simd, const CUT: bool>(
        &mut self,
        simd: S,
        (shape, direction): (&Shape, Vec3),
        (grid, seen, particles): (&Grid, Seen<'_>, std::ops::Range<usize>),
        (live, counts): (&mut usize, &mut Counts),
    ) {
        let mut slot = particles.start;
        while slot < particles.end {
            let count = (particles.end - slot).min(LANES);
            let mut may = u64::MAX >> (64 - count);
            if let Seen::Mixed(words) = seen {
                may &= bits(words, slot - particles.start);
            }
            counts.spheres += count as u64;
            if may != 0 {
                may &= shape.spheres(simd, grid, slot);
            }
            while may != 0 {
                let place = slot + may.trailing_zeros() as usize;
                may &= may - 1;
                let (center, radius) = (grid.center(place), grid.radius_at(place));
                let sphere = (center, radius);
                self.test::<S, CUT>(simd, sphere, (shape, direction), (live, counts));
                if *live == 0 {
                    return;
                }
            }
            slot += count;
        }
    }

    /// Blocks the rays that one sphere is in the way of.
    #[inline(always)]
    fn test<S: Simd, const CUT: bool>(
        &mut self,
        simd: S,
        (center, radius): (Vec3, f32),
        (shape, direction): (&Shape, Vec3),
        (live, counts): (&mut usize, &mut Counts),
    ) {
        let vectors = self.rays.div_ceil(LANES);
        if vectors <= FEW {
            for vector in 0..vectors {
                counts.tests += LANES as u64;
                *live -= self.test_vector::<S, CUT>(simd, (center, radius), direction, vector);
            }
            return;
        }
        let along = center[shape.axes[0]] - shape.k;
        let u = center[shape.axes[1]] - along * shape.slope[0];
        let v = center[shape.axes[2]] - along * shape.slope[1];
        let shift_u = (radius + shape.pad) * shape.widen[0];
        let shift_v = (radius + shape.pad) * shape.widen[1];
        for first in (0..vectors).step_by(LANES) {
            let meets = load(simd, &self.low[0], first).simd_le(f32x16::splat(simd, u + shift_u))
                & load(simd, &self.high[0], first).simd_ge(f32x16::splat(simd, u - shift_u))
                & load(simd, &self.low[1], first).simd_le(f32x16::splat(simd, v + shift_v))
                & load(simd, &self.high[1], first).simd_ge(f32x16::splat(simd, v - shift_v));
            let mut meets = meets.to_bitmask();
            while meets != 0 {
                let vector = first + meets.trailing_zeros() as usize;
                meets &= meets - 1;
                counts.tests += LANES as u64;
                *live -= self.test_vector::<S, CUT>(simd, (center, radius), direction, vector);
            }
        }
    }

    /// Tests a vector of rays against a sphere. Gives 1 if that blocked the last of them, else 0.
    #[inline(always)]
    fn test_vector<S: Simd, const CUT: bool>(
        &mut self,
        simd: S,
        (center, radius): (Vec3, f32),
        direction: Vec3,
        vector: usize,
    ) -> usize {
        let first = vector * LANES;
        let lost = f32x16::splat(simd, LOST);
        let reach = load(simd, &self.reach, first);
        let oc = [
            f32x16::splat(simd, center.x) - load(simd, &self.origin[0], first),
            f32x16::splat(simd, center.y) - load(simd, &self.origin[1], first),
            f32x16::splat(simd, center.z) - load(simd, &self.origin[2], first),
        ];
        let d = [
            f32x16::splat(simd, direction.x),
            f32x16::splat(simd, direction.y),
            f32x16::splat(simd, direction.z),
        ];
        let blocked = match CUT {
            false => blocks(simd, oc, d, (radius, reach)),
            true => self.stretches.blocks(simd, vector, (oc, d), (radius, reach)),
        };
        if !blocked.any_true() {
            return 0;
        }
        let left = blocked.select(lost, reach);
        left.store_slice(&mut self.reach[first..first + LANES]);
        if left.simd_gt(lost).any_true() {
            return 0;
        }
        // Nothing lies in the bounds of what is lost.
        self.low[0][vector] = f32::INFINITY;
        1
    }
}

impl Shape {
    /// Which of the sixteen boxes from `first` on have spheres that the beam may meet.
    #[inline(always)]
    fn boxes<S: Simd>(&self, simd: S, boxes: &Boxes, first: usize) -> u64 {
        let rows = boxes.rows();
        let [k, u, v] = self.axes;
        let radius = load(simd, rows.radius, first) + self.pad;
        let k0 = load(simd, rows.low[k], first) - self.k;
        let k1 = load(simd, rows.high[k], first) - self.k;
        let (begins, ends) = if self.sign > 0.0 { (k0, k1) } else { (-k1, -k0) };
        let from = self.k * self.sign;
        let mut meets = (ends + radius).simd_ge(f32x16::splat(simd, self.start - from))
            & (begins - radius).simd_le(f32x16::splat(simd, self.end - from));
        for (side, axis) in [u, v].into_iter().enumerate() {
            let slope = self.slope[side];
            let shift = radius * self.widen[side];
            let (least, most) = if slope > 0.0 { (k0, k1) } else { (k1, k0) };
            let low = load(simd, rows.low[axis], first) - most * slope - shift;
            let high = load(simd, rows.high[axis], first) - least * slope + shift;
            meets = meets
                & low.simd_le(f32x16::splat(simd, self.high[side]))
                & high.simd_ge(f32x16::splat(simd, self.low[side]));
        }
        meets.to_bitmask()
    }

    /// Which of the sixteen spheres from `slot` on the beam may meet.
    #[inline(always)]
    fn spheres<S: Simd>(&self, simd: S, grid: &Grid, slot: usize) -> u64 {
        let centers = sixteen_centers(simd, grid, slot);
        let radius = radii_at(simd, grid, slot) + self.pad;
        let [k, u, v] = self.axes;
        let along = centers[k] - self.k;
        let travel = along * self.sign;
        let from = self.k * self.sign;
        let u = centers[u] - along * self.slope[0];
        let v = centers[v] - along * self.slope[1];
        let (shift_u, shift_v) = (radius * self.widen[0], radius * self.widen[1]);
        let meets = (travel + radius).simd_ge(f32x16::splat(simd, self.start - from))
            & (travel - radius).simd_le(f32x16::splat(simd, self.end - from))
            & (u - shift_u).simd_le(f32x16::splat(simd, self.high[0]))
            & (u + shift_u).simd_ge(f32x16::splat(simd, self.low[0]))
            & (v - shift_v).simd_le(f32x16::splat(simd, self.high[1]))
            & (v + shift_v).simd_ge(f32x16::splat(simd, self.low[1]));
        meets.to_bitmask()
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, from: &[f32], first: usize) -> f32x16<S> {
    f32x16::from_slice(simd, &from[first..first + LANES])
}
