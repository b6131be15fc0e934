//! Exact cuts: rays against spheres that planes have sliced, sixteen at a time.
//!
//! [`Clip::stretches`] tells which parts of a ray are kept; here they are found for sixteen rays at once, by
//! the same arithmetic. With t₀ and t₁ where a stretch begins and ends, a sphere that the ray enters at e and
//! leaves at x is met, if x > t₀,
//!
//! > at e, if t₀ < e < t₁: its front;
//! > else, if e ≤ t₀ and a face with caps is at t₀: there, on the cap;
//! > else, if e ≤ t₀ and x < t₁: at x, on the inner wall, seen through an open face or by an eye inside;
//! > else, if e ≤ t₀ and a face with caps is at t₁: there, on the cap from within.
//!
//! Without faces t₀ is 0 and t₁ infinite, and these are the rules for whole spheres. All spheres of a ray
//! have the same t₀, so that caps that meet do so without a seam.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Clause, Clip, Cut, Face};

use crate::intersect::chord;
use crate::lanes::Lanes;
use crate::packet::LANES;

/// Numbers of a stretch for each of its rays.
const ROWS: usize = 4;

/// The parts of rays that are kept, in vectors of sixteen rays.
#[derive(Clone, Debug)]
pub(crate) struct Stretches {
    /// Stretches of each ray, nearest first; those it lacks are empty.
    each: usize,
    /// Whether all faces have caps: what is left of a sphere is solid, else a shell.
    solid: bool,
    /// Begin, cap, end and back of each stretch of each vector.
    rows: Lanes<f32>,
    /// The gaps of the clauses of several faces: low and high, and the back and the cap there.
    gaps: Lanes<f32>,
}

/// A part of sixteen rays.
struct Stretch<S: Simd> {
    /// Where it begins, at least 0.
    begin: f32x16<S>,
    /// The same if a face with caps is there, else +∞.
    cap: f32x16<S>,
    /// Where it ends; −∞ if it is empty.
    end: f32x16<S>,
    /// The same if a face with caps is there, else +∞.
    back: f32x16<S>,
}

impl<S: Simd> Stretch<S> {
    /// The whole ray.
    #[inline(always)]
    fn whole(simd: S) -> Self {
        let infinity = f32x16::splat(simd, f32::INFINITY);
        Self { begin: f32x16::splat(simd, 0.0), cap: infinity, end: infinity, back: infinity }
    }

    /// Cuts off what a face leaves out.
    #[inline(always)]
    fn cut(&mut self, simd: S, face: &Face, rays: [[f32x16<S>; 3]; 2]) {
        let zero = f32x16::splat(simd, 0.0);
        let infinity = f32x16::splat(simd, f32::INFINITY);
        let (at, slope, height) = crossing(simd, face, rays);
        let cap = if face.cut == Cut::Caps { at } else { infinity };
        let enters = slope.simd_gt(zero) & at.simd_gt(self.begin);
        self.begin = enters.select(at, self.begin);
        self.cap = enters.select(cap, self.cap);
        let leaves = slope.simd_lt(zero) & at.simd_lt(self.end);
        self.end = leaves.select(at, self.end);
        self.back = leaves.select(cap, self.back);
        let beside = slope.simd_eq(zero) & height.simd_lt(zero);
        self.end = beside.select(-infinity, self.end);
    }
}

/// Where rays cross a face, how fast they rise over it, and how high they start.
#[inline(always)]
fn crossing<S: Simd>(
    simd: S,
    face: &Face,
    [origin, direction]: [[f32x16<S>; 3]; 2],
) -> (f32x16<S>, f32x16<S>, f32x16<S>) {
    let height = rise(simd, face.plane.normal, origin) - face.plane.offset;
    let slope = rise(simd, face.plane.normal, direction);
    ((-height) / slope, slope, height)
}

/// As [`motes_grid::Plane::rise`].
#[inline(always)]
fn rise<S: Simd>(simd: S, normal: Vec3, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
    let y = y.mul_add_precise(f32x16::splat(simd, normal.y), x * normal.x);
    z.mul_add_precise(f32x16::splat(simd, normal.z), y)
}

impl Stretches {
    pub fn new() -> Self {
        Self { each: 0, solid: true, rows: Lanes::new(0.0, 0), gaps: Lanes::new(0.0, 0) }
    }

    /// Makes room for those that `clip` leaves of so many vectors of rays.
    pub fn begin(&mut self, clip: &Clip, vectors: usize) {
        let unions = clip.clauses.iter().filter(|c| c.faces.len() > 1).count();
        self.each = 1 + unions;
        self.solid = clip.faces().all(|face| face.cut == Cut::Caps);
        grow(&mut self.rows, vectors * self.each * ROWS * LANES);
        grow(&mut self.gaps, unions * ROWS * LANES);
    }

    /// Finds the stretches of a vector of rays.
    #[inline(always)]
    pub fn find<S: Simd>(
        &mut self,
        simd: S,
        clip: &Clip,
        vector: usize,
        rays: [[f32x16<S>; 3]; 2],
    ) {
        let mut whole = Stretch::whole(simd);
        let mut unions = 0;
        for clause in &clip.clauses {
            if let [face] = &clause.faces[..] {
                whole.cut(simd, face, rays);
            } else {
                self.gap(simd, clause, unions, rays);
                unions += 1;
            }
        }
        for i in 0..=unions {
            // Out of all gaps, one after another.
            for _ in 0..unions {
                for gap in 0..unions {
                    let Stretch { begin: low, end: high, cap, .. } = self.gap_at(simd, gap);
                    let inside = low.simd_le(whole.begin) & whole.begin.simd_lt(high);
                    whole.begin = inside.select(high, whole.begin);
                    whole.cap = inside.select(cap, whole.cap);
                }
            }
            let (mut end, mut back) = (whole.end, whole.back);
            for gap in 0..unions {
                let Stretch { begin: low, back: behind, .. } = self.gap_at(simd, gap);
                let ends = low.simd_gt(whole.begin) & low.simd_lt(end);
                end = ends.select(low, end);
                back = ends.select(behind, back);
            }
            self.put(simd, vector * self.each + i, Stretch { end, back, ..whole });
            whole.begin = whole.begin.max(end);
        }
    }

    /// Finds the gap of a clause of several faces; one that is none lies nowhere.
    #[inline(always)]
    fn gap<S: Simd>(&mut self, simd: S, clause: &Clause, union: usize, rays: [[f32x16<S>; 3]; 2]) {
        let zero = f32x16::splat(simd, 0.0);
        let infinity = f32x16::splat(simd, f32::INFINITY);
        let (mut low, mut high, mut back, mut cap) = (-infinity, infinity, infinity, infinity);
        for face in &clause.faces {
            let (at, slope, height) = crossing(simd, face, rays);
            let capped = if face.cut == Cut::Caps { at } else { infinity };
            let enters = slope.simd_gt(zero) & at.simd_lt(high);
            high = enters.select(at, high);
            cap = enters.select(capped, cap);
            let leaves = slope.simd_lt(zero) & at.simd_gt(low);
            low = leaves.select(at, low);
            back = leaves.select(capped, back);
            let within = slope.simd_eq(zero) & height.simd_ge(zero);
            high = within.select(-infinity, high);
        }
        let some = low.simd_lt(high);
        let (low, high) = (some.select(low, infinity), some.select(high, -infinity));
        let rows = &mut self.gaps[union * ROWS * LANES..(union + 1) * ROWS * LANES];
        store(rows, [low, cap, high, back]);
    }

    /// A gap, as if it were a stretch.
    #[inline(always)]
    fn gap_at<S: Simd>(&self, simd: S, union: usize) -> Stretch<S> {
        load(simd, &self.gaps[union * ROWS * LANES..(union + 1) * ROWS * LANES])
    }

    #[inline(always)]
    fn put<S: Simd>(&mut self, simd: S, at: usize, stretch: Stretch<S>) {
        let Stretch { begin, cap, end, back } = stretch;
        let infinity = f32x16::splat(simd, f32::INFINITY);
        let some = begin.simd_lt(end);
        let rows = &mut self.rows[at * ROWS * LANES..(at + 1) * ROWS * LANES];
        let (cap, back) = (some.select(cap, infinity), some.select(back, infinity));
        store(rows, [begin, cap, some.select(end, -infinity), back]);
    }

    #[inline(always)]
    fn get<S: Simd>(&self, simd: S, vector: usize, i: usize) -> Stretch<S> {
        let at = vector * self.each + i;
        load(simd, &self.rows[at * ROWS * LANES..(at + 1) * ROWS * LANES])
    }

    /// As [`crate::intersect::meet`], on the stretches of a vector of rays.
    #[inline(always)]
    pub fn meet<S: Simd>(
        &self,
        simd: S,
        vector: usize,
        (oc, direction): ([f32x16<S>; 3], [f32x16<S>; 3]),
        r2: f32x16<S>,
    ) -> (f32x16<S>, mask32x16<S>) {
        let (b, half, meets) = chord(simd, oc, direction, r2);
        let (entry, exit) = (b - half, b + half);
        let infinity = f32x16::splat(simd, f32::INFINITY);
        let mut nearest = infinity;
        for i in 0..self.each {
            let Stretch { begin, cap, end, back } = self.get(simd, vector, i);
            let front = entry.simd_gt(begin);
            let distance = front.select(entry, exit.min(cap.min(back)));
            let behind = !front & distance.simd_eq(back);
            let hit = exit.simd_gt(begin) & (distance.simd_lt(end) | behind);
            nearest = nearest.min(hit.select(distance, infinity));
        }
        (nearest, meets & nearest.simd_lt(infinity))
    }

    /// Which of a vector of rays, up to their reaches, what is left of a sphere is in the way of.
    #[inline(always)]
    pub fn blocks<S: Simd>(
        &self,
        simd: S,
        vector: usize,
        (oc, direction): ([f32x16<S>; 3], [f32x16<S>; 3]),
        (radius, reach): (f32, f32x16<S>),
    ) -> mask32x16<S> {
        let r2 = f32x16::splat(simd, radius * radius);
        let (b, half, meets) = chord(simd, oc, direction, r2);
        let (entry, exit) = (b - half, b + half);
        let mut blocked = mask32x16::from_bitmask(simd, 0);
        for i in 0..self.each {
            let Stretch { begin, cap, end, back } = self.get(simd, vector, i);
            let limit = end.min(reach);
            if self.solid {
                blocked |= entry.max(begin).simd_lt(exit.min(limit));
                continue;
            }
            for surface in [entry, exit] {
                blocked |= surface.simd_gt(begin) & surface.simd_lt(limit);
            }
            for surface in [cap, back] {
                let inside = surface.simd_gt(entry) & surface.simd_lt(exit);
                blocked |= inside & surface.simd_lt(reach);
            }
        }
        blocked & meets
    }

    /// Which of a vector of rays are on a cap at `distance`.
    #[inline(always)]
    pub fn on_cap<S: Simd>(&self, simd: S, vector: usize, distance: f32x16<S>) -> mask32x16<S> {
        let mut on = mask32x16::from_bitmask(simd, 0);
        for i in 0..self.each {
            let Stretch { cap, back, .. } = self.get(simd, vector, i);
            on |= distance.simd_eq(cap) | distance.simd_eq(back);
        }
        on
    }
}

/// The normals of caps that rays meet at `distance`, towards where the rays come from, and the owners of
/// their faces plus one; of rays that are not `on` one, 0.
#[simd]
pub(crate) fn cap_normals<S: Simd>(
    simd: S,
    clip: &Clip,
    rays: [[f32x16<S>; 3]; 2],
    (distance, on): (f32x16<S>, mask32x16<S>),
) -> ([f32x16<S>; 3], [u32; LANES]) {
    let zero = f32x16::splat(simd, 0.0);
    let mut normal = [zero; 3];
    let mut owners = [0; LANES];
    let mut left = on;
    for face in clip.faces().filter(|face| face.cut == Cut::Caps) {
        let (at, slope, _) = crossing(simd, face, rays);
        let own = left & at.simd_eq(distance);
        let sign = slope.simd_gt(zero).select(f32x16::splat(simd, -1.0), f32x16::splat(simd, 1.0));
        for axis in 0..3 {
            normal[axis] = own.select(sign * face.plane.normal[axis], normal[axis]);
        }
        let mut lanes = own.to_bitmask();
        while lanes != 0 {
            owners[lanes.trailing_zeros() as usize] = u32::from(face.owner) + 1;
            lanes &= lanes - 1;
        }
        left &= !own;
    }
    (normal, owners)
}

/// The face whose cap a ray meets at `distance`.
pub(crate) fn cap_at(clip: &Clip, ray: (Vec3, Vec3), distance: f32) -> Option<Face> {
    let mut stretches = Vec::new();
    clip.stretches(ray, (0.0, f32::INFINITY), &mut stretches);
    let at = |s: &motes_grid::Stretch| match distance {
        d if d == s.begin => s.enters,
        d if d == s.end => s.leaves,
        _ => None,
    };
    stretches.iter().find_map(at).filter(|face| face.cut == Cut::Caps)
}

fn grow(rows: &mut Lanes<f32>, to: usize) {
    if rows.len() < to {
        rows.resize(to, 0.0);
    }
}

#[inline(always)]
fn store<S: Simd>(rows: &mut [f32], [begin, cap, end, back]: [f32x16<S>; ROWS]) {
    begin.store_slice(&mut rows[..LANES]);
    cap.store_slice(&mut rows[LANES..2 * LANES]);
    end.store_slice(&mut rows[2 * LANES..3 * LANES]);
    back.store_slice(&mut rows[3 * LANES..4 * LANES]);
}

#[inline(always)]
fn load<S: Simd>(simd: S, rows: &[f32]) -> Stretch<S> {
    Stretch {
        begin: f32x16::from_slice(simd, &rows[..LANES]),
        cap: f32x16::from_slice(simd, &rows[LANES..2 * LANES]),
        end: f32x16::from_slice(simd, &rows[2 * LANES..3 * LANES]),
        back: f32x16::from_slice(simd, &rows[3 * LANES..4 * LANES]),
    }
}
