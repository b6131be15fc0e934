//! Bundles of secondary rays and the shafts around them: is anything in the way?
//!
//! The rays of a bundle start close together and run much the same way. Around them stands a
//! [`Frustum`] that is known without looking at each ray, from the box of their origins and the least
//! and greatest slopes of their directions. It goes through the blocks of a grid slice by slice, as a
//! packet does (Gribble et al. 2007, §2, §4.1), and whatever sphere it meets is tested against the rays,
//! sixteen at a time. In a large bundle each sixteen have a bound of their own: with m and ρ the middle
//! and spread of their origins, a the axis of all directions and α the greatest angle from it, no sphere
//! of radius r at c meets one of them unless
//!
//! > |c − m − s·a| ≤ (ρ + r)/cos α + s·tan α   with   s = (c − m)·a.
//!
//! A ray ends at the first sphere that reaches into it; spheres are solid.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Clip, Grid, Seen, Visibility};

use crate::clip::Stretches;
use crate::frustum::Frustum;
use crate::intersect::{Cull, Sphere, bits, cull};
use crate::lanes::Lanes;
use crate::packet::LANES;
use crate::traverse::{Counts, Spheres, Steps, clip};

/// The reach of a ray that is blocked, or that never was one.
pub(crate) const LOST: f32 = f32::NEG_INFINITY;
/// Bundles of more vectors than this have a bound for each vector.
const FEW: usize = 4;

/// Rays that start close together and run much the same way, in vectors of sixteen.
#[derive(Debug)]
pub(crate) struct Bundle {
    vectors: usize,
    origin: [Lanes<f32>; 3],
    direction: [Lanes<f32>; 3],
    /// How far each ray looks; −∞ once it is blocked.
    reach: Lanes<f32>,
    /// Middle and spread of the origins of each vector; the spread is −∞ once all of it is blocked.
    middle: [Lanes<f32>; 3],
    spread: Lanes<f32>,
    /// What of the rays is left, where the spheres at hand are cut.
    stretches: Stretches,
}

/// The directions of a bundle: what bounds them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    /// The axis K that they mostly follow, and towards which end.
    k: usize,
    sign: f32,
    /// Least and greatest change of u and of v per unit of k.
    slopes: [(f32, f32); 2],
    /// The middle direction, and the greatest angle from it.
    axis: Vec3,
    tan: f32,
    inv_cos: f32,
}

/// A direction that runs less than this along K follows another axis.
const LEAST_K: f32 = 0.05;

impl Cone {
    /// The cone around `directions`, unit vectors; `None` if they share no axis to follow.
    pub fn around(directions: &[Vec3]) -> Option<Self> {
        let axis = directions.iter().sum::<Vec3>().normalize_or_zero();
        let k = axis.abs().max_position();
        let sign = axis[k].signum();
        let mut slopes = [(f32::INFINITY, f32::NEG_INFINITY); 2];
        let mut cos = 1f32;
        for d in directions {
            if d[k] * sign < LEAST_K {
                return None;
            }
            cos = cos.min(d.dot(axis));
            for (side, slope) in slopes.iter_mut().enumerate() {
                let s = d[(k + 1 + side) % 3] / d[k];
                *slope = (slope.0.min(s), slope.1.max(s));
            }
        }
        // A hair wider, for rounding.
        let cos = cos * (1.0 - 1e-6);
        let tan = (1.0 / (cos * cos) - 1.0).max(0.0).sqrt();
        Some(Self { k, sign, slopes, axis, tan, inv_cos: 1.0 / cos })
    }

    /// The frustum of all rays that start in the box and run within the cone for at most `reach`, for
    /// spheres with centres in `low..high` of radii up to `radius`; `None` if it meets none.
    fn frustum(
        &self,
        origins: (Vec3, Vec3),
        reach: f32,
        (low, high, radius): (Vec3, Vec3, f32),
    ) -> Option<Frustum> {
        let k = self.k;
        let axes = [k, (k + 1) % 3, (k + 2) % 3];
        let size = low.abs().max(high.abs()).max(origins.0.abs()).max(origins.1.abs());
        let pad = (size.max_element() + radius) * 4e-6;
        let grow = radius + pad;
        // Nearest and farthest origin along K in the order of travel.
        let (back, front) = match self.sign > 0.0 {
            true => (origins.0[k], origins.1[k]),
            false => (origins.1[k], origins.0[k]),
        };
        let (near, far) = if self.sign > 0.0 { (low[k], high[k]) } else { (high[k], low[k]) };
        let start = (near * self.sign).max(back * self.sign) - grow;
        let end = (far * self.sign).min((front + self.sign * reach) * self.sign) + grow;
        if end <= start {
            return None;
        }
        let (start, end) = (start * self.sign, end * self.sign);
        let mut frustum = Frustum {
            axes,
            sign: self.sign,
            k_start: start,
            k_end: end,
            at_start: [0.0; 4],
            slope: [0.0; 4],
            widen: [1.0; 2],
            pad,
        };
        for side in 0..2 {
            // Change per unit of travel.
            let (least, greatest) = match (self.slopes[side], self.sign > 0.0) {
                (slopes, true) => slopes,
                ((least, greatest), false) => (-greatest, -least),
            };
            let axis = axes[side + 1];
            // From the origin where the slope leads farthest aside.
            let from = |slope: f32, outward: f32| {
                if slope * outward > 0.0 { back } else { front }
            };
            let at = |k: f32| {
                let low = origins.0[axis] + (k - from(least, -1.0)) * self.sign * least;
                let high = origins.1[axis] + (k - from(greatest, 1.0)) * self.sign * greatest;
                (low, high)
            };
            let ((low0, high0), (low1, high1)) = (at(start), at(end));
            frustum.at_start[2 * side] = low0;
            frustum.at_start[2 * side + 1] = high0;
            frustum.slope[2 * side] = (low1 - low0) / (end - start);
            frustum.slope[2 * side + 1] = (high1 - high0) / (end - start);
            let steepest = least.abs().max(greatest.abs());
            frustum.widen[side] = (1.0 + steepest * steepest).sqrt();
        }
        Some(frustum)
    }
}

impl Bundle {
    pub fn new() -> Self {
        let none = || [(); 3].map(|()| Lanes::new(0.0, 0));
        Self {
            vectors: 0,
            origin: none(),
            direction: none(),
            reach: Lanes::new(LOST, 0),
            middle: none(),
            spread: Lanes::new(LOST, 0),
            stretches: Stretches::new(),
        }
    }

    /// Removes all rays.
    pub fn clear(&mut self) {
        self.vectors = 0;
    }

    /// Adds sixteen rays that reach as far as `reach` says; those with no reach are none. `around` is
    /// the middle and the spread of their origins.
    #[inline(always)]
    pub fn push<S: Simd>(
        &mut self,
        origin: [f32x16<S>; 3],
        direction: [f32x16<S>; 3],
        reach: f32x16<S>,
        around: (Vec3, f32),
    ) {
        let at = self.vectors * LANES;
        if self.reach.len() < at + LANES {
            self.grow();
        }
        let lanes = at..at + LANES;
        for axis in 0..3 {
            origin[axis].store_slice(&mut self.origin[axis][lanes.clone()]);
            direction[axis].store_slice(&mut self.direction[axis][lanes.clone()]);
            self.middle[axis][self.vectors] = around.0[axis];
        }
        reach.store_slice(&mut self.reach[lanes]);
        self.spread[self.vectors] = around.1;
        self.vectors += 1;
    }

    /// Finds what a clip, if there is one, leaves of the rays.
    #[inline(always)]
    fn clip_to<S: Simd>(&mut self, simd: S, clip: Option<&Clip>) {
        let Some(clip) = clip else { return };
        self.stretches.begin(clip, self.vectors);
        for vector in 0..self.vectors {
            let at = vector * LANES;
            let ([ox, oy, oz], [dx, dy, dz]) = (&self.origin, &self.direction);
            let rays = [
                [load(simd, ox, at), load(simd, oy, at), load(simd, oz, at)],
                [load(simd, dx, at), load(simd, dy, at), load(simd, dz, at)],
            ];
            self.stretches.find(simd, clip, vector, rays);
        }
    }

    fn grow(&mut self) {
        let vectors = (2 * self.vectors).max(64);
        for axis in 0..3 {
            self.origin[axis].resize(vectors * LANES, 0.0);
            self.direction[axis].resize(vectors * LANES, 0.0);
            self.middle[axis].resize(vectors, 0.0);
        }
        self.reach.resize(vectors * LANES, LOST);
        self.spread.resize(vectors, LOST);
    }

    /// Which of the sixteen rays of vector `vector` are not blocked.
    #[inline(always)]
    pub fn open<S: Simd>(&self, simd: S, vector: usize) -> mask32x16<S> {
        load(simd, &self.reach, vector * LANES).simd_gt(f32x16::splat(simd, LOST))
    }

    /// Whether ray `ray`, counted through the vectors, is not blocked.
    #[inline(always)]
    pub fn is_open(&self, ray: usize) -> bool {
        self.reach[ray] > LOST
    }

    /// Blocks the rays that something of the systems is in the way of. All directions lie in `cone`, all
    /// origins in the box `origins`, and no ray reaches farther than `reach`.
    #[simd]
    pub fn block<S: Simd>(
        &mut self,
        simd: S,
        (cone, origins, reach): (&Cone, (Vec3, Vec3), f32),
        systems: &[Spheres<'_>],
        counts: &mut Counts,
    ) {
        // The unused bounds of the last sixteen meet nothing.
        let end = self.vectors.next_multiple_of(LANES).min(self.spread.len());
        self.spread[self.vectors..end].fill(LOST);
        let spread = &self.spread[..self.vectors];
        let mut live = spread.iter().filter(|spread| **spread > LOST).count();
        if live == 0 {
            return;
        }
        for spheres in systems {
            self.clip_to(simd, spheres.clip);
            for (grid, visible) in spheres.classes.grids.iter().zip(spheres.visible) {
                let bounds = (grid.low, grid.high, grid.greatest_radius);
                let Some(frustum) = cone.frustum(origins, reach, bounds) else { continue };
                let planes = Cull::new(simd, &frustum);
                let far = frustum.k_end * frustum.sign;
                let bundle = &mut *self;
                // What is not cut pays nothing for what is.
                let mut walk =
                    Walk { bundle, cone, frustum, planes, far, grid, visible, live, counts };
                match spheres.clip {
                    None => walk.blocks::<false>(simd),
                    Some(_) => walk.blocks::<true>(simd),
                }
                live = walk.live;
                if live == 0 {
                    return;
                }
            }
        }
    }
}

/// A bundle on its way through a grid.
struct Walk<'a, S: Simd> {
    bundle: &'a mut Bundle,
    cone: &'a Cone,
    frustum: Frustum,
    planes: Cull<S>,
    /// How far along K the rays look, times the sign of K.
    far: f32,
    grid: &'a Grid,
    visible: &'a Visibility,
    /// How many vectors have a ray that is not blocked.
    live: usize,
    counts: &'a mut Counts,
}

impl<S: Simd> Walk<'_, S> {
    /// Walks the slices of blocks, until all rays are blocked.
    #[inline(always)]
    fn blocks<const CUT: bool>(&mut self, simd: S) {
        let grid = self.grid;
        let lattice = &grid.lattice;
        let radius = grid.greatest_radius;
        let [k, u, v] = self.frustum.axes;
        let edge = lattice.edge;
        let at = |axis: usize, value: f32| (value - lattice.low[axis]) / edge;
        let (start, end) = (at(k, self.frustum.k_start), at(k, self.frustum.k_end));
        for slice in Steps::new(start, end, lattice.dims[k]) {
            let k0 = lattice.low[k] + slice as f32 * edge;
            let ks = (k0 - self.frustum.pad, k0 + edge + self.frustum.pad);
            let (u0, u1) = self.frustum.span(0, ks, radius);
            let (v0, v1) = self.frustum.span(1, ks, radius);
            let Some((u0, u1)) = clip(at(u, u0), at(u, u1), lattice.dims[u]) else { continue };
            let Some((v0, v1)) = clip(at(v, v0), at(v, v1), lattice.dims[v]) else { continue };
            for bv in v0..=v1 {
                for bu in u0..=u1 {
                    let mut block = [0; 3];
                    (block[k], block[u], block[v]) = (slice, bu, bv);
                    self.block::<CUT>(simd, lattice.index(block));
                    if self.live == 0 {
                        return;
                    }
                }
            }
        }
    }

    /// Tests the spheres of a block.
    #[inline(always)]
    fn block<const CUT: bool>(&mut self, simd: S, index: usize) {
        let grid = self.grid;
        let block = &grid.blocks[index];
        let [k, ..] = self.frustum.axes;
        let ahead = self.frustum.sign;
        let radius = block.greatest_radius + self.frustum.pad;
        let nearest = (block.low[k] * ahead).min(block.high[k] * ahead) - radius;
        let farthest = (block.low[k] * ahead).max(block.high[k] * ahead) + radius;
        if block.cells[0] == 0
            || nearest > self.far
            || farthest < self.frustum.k_start * ahead
            || !self.frustum.meets_box(block.low, block.high, radius)
        {
            return;
        }
        let particles = grid.particles_of(index);
        match self.visible.block(grid, index) {
            Seen::Hidden => {}
            Seen::Shown => self.run::<CUT>(simd, (particles.start, particles.end), None),
            Seen::Mixed(words) => {
                self.run::<CUT>(simd, (particles.start, particles.end), Some((words, particles.start)));
            }
        }
    }

    /// Culls and tests the particles `from..to`.
    #[inline(always)]
    fn run<const CUT: bool>(&mut self, simd: S, (from, to): (usize, usize), seen: Option<(&[u64], usize)>) {
        let mut slot = from;
        while slot < to {
            let count = (to - slot).min(LANES);
            let mut may = u64::MAX >> (64 - count);
            if let Some((words, first)) = seen {
                may &= bits(words, slot - first);
            }
            if may != 0 {
                self.counts.spheres += u64::from(may.count_ones());
                may &= cull(simd, &self.planes, &self.frustum, (self.grid, slot), self.far);
            }
            while may != 0 {
                let place = slot + may.trailing_zeros() as usize;
                may &= may - 1;
                let (center, radius) = (self.grid.center(place), self.grid.radius_at(place));
                self.test::<CUT>(simd, Sphere { center, radius, slot: 0 });
                if self.live == 0 {
                    return;
                }
            }
            slot += count;
        }
    }

    /// Blocks the rays that one sphere is in the way of.
    #[inline(always)]
    fn test<const CUT: bool>(&mut self, simd: S, sphere: Sphere) {
        let vectors = self.bundle.vectors;
        if vectors <= FEW {
            for vector in 0..vectors {
                self.test_vector::<CUT>(simd, sphere, vector);
            }
            return;
        }
        let zero = f32x16::splat(simd, 0.0);
        let radius = f32x16::splat(simd, sphere.radius + self.frustum.pad);
        for first in (0..vectors).step_by(LANES) {
            let lanes = first..first + LANES;
            let [mx, my, mz] =
                [&self.bundle.middle[0], &self.bundle.middle[1], &self.bundle.middle[2]];
            let x =
                f32x16::splat(simd, sphere.center.x) - f32x16::from_slice(simd, &mx[lanes.clone()]);
            let y =
                f32x16::splat(simd, sphere.center.y) - f32x16::from_slice(simd, &my[lanes.clone()]);
            let z =
                f32x16::splat(simd, sphere.center.z) - f32x16::from_slice(simd, &mz[lanes.clone()]);
            let size = f32x16::from_slice(simd, &self.bundle.spread[lanes]) + radius;
            let axis = self.cone.axis;
            let along = z * axis.z + y * axis.y + x * axis.x;
            // By the perpendicular itself: a difference of squares would drown a small sphere far away.
            let (x, y, z) = (x - along * axis.x, y - along * axis.y, z - along * axis.z);
            let aside2 = z.mul_add(z, y.mul_add(y, x * x));
            let limit = size * self.cone.inv_cos + along.max(zero) * self.cone.tan;
            let meets =
                (along + size).simd_ge(zero) & limit.simd_gt(zero) & aside2.simd_le(limit * limit);
            let mut meets = meets.to_bitmask();
            while meets != 0 {
                let vector = first + meets.trailing_zeros() as usize;
                meets &= meets - 1;
                self.test_vector::<CUT>(simd, sphere, vector);
            }
        }
    }

    #[inline(always)]
    fn test_vector<const CUT: bool>(&mut self, simd: S, sphere: Sphere, vector: usize) {
        let lanes = vector * LANES..(vector + 1) * LANES;
        let bundle = &mut *self.bundle;
        let center = sphere.center;
        let x = f32x16::splat(simd, center.x) - load(simd, &bundle.origin[0], lanes.start);
        let y = f32x16::splat(simd, center.y) - load(simd, &bundle.origin[1], lanes.start);
        let z = f32x16::splat(simd, center.z) - load(simd, &bundle.origin[2], lanes.start);
        let dx = load(simd, &bundle.direction[0], lanes.start);
        let dy = load(simd, &bundle.direction[1], lanes.start);
        let dz = load(simd, &bundle.direction[2], lanes.start);
        let reach = load(simd, &bundle.reach, lanes.start);
        self.counts.tests += LANES as u64;
        let (oc, direction) = ([x, y, z], [dx, dy, dz]);
        let blocks = match CUT {
            false => blocks(simd, oc, direction, (sphere.radius, reach)),
            true => bundle.stretches.blocks(simd, vector, (oc, direction), (sphere.radius, reach)),
        };
        if blocks.any_true() {
            let blocked = f32x16::splat(simd, LOST);
            let reach = blocks.select(blocked, reach);
            reach.store_slice(&mut bundle.reach[lanes]);
            if !reach.simd_gt(blocked).any_true() {
                bundle.spread[vector] = LOST;
                self.live -= 1;
            }
        }
    }
}

/// Which of sixteen rays with these directions and reaches a sphere is in the way of, whose centre lies
/// at `oc` from where they start: whose chord b ± √(r² − p²) overlaps 0..reach.
#[inline(always)]
pub(crate) fn blocks<S: Simd>(
    simd: S,
    oc: [f32x16<S>; 3],
    direction: [f32x16<S>; 3],
    (radius, reach): (f32, f32x16<S>),
) -> mask32x16<S> {
    let ([x, y, z], [dx, dy, dz]) = (oc, direction);
    let zero = f32x16::splat(simd, 0.0);
    let b = z.mul_add_precise(dz, y.mul_add_precise(dy, x * dx));
    let minus_b = -b;
    let px = minus_b.mul_add_precise(dx, x);
    let py = minus_b.mul_add_precise(dy, y);
    let pz = minus_b.mul_add_precise(dz, z);
    let r2 = f32x16::splat(simd, radius * radius);
    let inside = r2 - pz.mul_add_precise(pz, py.mul_add_precise(py, px * px));
    let beyond = b - reach;
    inside.simd_ge(zero)
        & (b.simd_gt(zero) | inside.simd_gt(b * b))
        & (beyond.simd_lt(zero) | inside.simd_gt(beyond * beyond))
}

#[inline(always)]
fn load<S: Simd>(simd: S, from: &[f32], first: usize) -> f32x16<S> {
    f32x16::from_slice(simd, &from[first..first + LANES])
}
