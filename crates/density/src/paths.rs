//! Paths of light through the liquid: all of a tile at once, boundary by boundary, sixteen at a time.
//!
//! Yasuda et al. 2009, §4.3: rays are cast, refracted and reflected up to a depth. What is reflected and what
//! is refracted at the first surface are followed both; from then on each path goes on the way most of the
//! light goes (Snell, Fresnel, total internal reflection: [`motes_scene::optics`]), and what goes the other way
//! is seen without further boundaries if it leaves the liquid, and else goes with the rest.

use fearless_simd::{dispatch, f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::{Vec3, Vec4};
use motes_scene::exp;

use crate::cut::{Body, Cuts};
use crate::lanes::{LANES, Lanes, V3};
use crate::normals::sixteen;
use crate::rays::{Hits, LIQUID, OUTSIDE, Rays, within};
use crate::shade::{Around, Optics};
use crate::surroundings::{self, Sights, lane_of, store};

/// How much wider cones of neighbouring paths become at a boundary, per unit of length.
const PART: f32 = 0.02;
/// Paths that are less than this part of a pixel's light meet nothing but the surroundings.
const FAINT: f32 = 0.03;

/// What paths go through.
#[derive(Clone, Copy)]
pub(crate) struct Caster<'a> {
    pub body: Body<'a>,
    pub optics: &'a Optics,
    pub around: &'a Around<'a>,
}

/// Paths and their rays. Rows are longer than they are many.
#[derive(Default)]
struct Wave {
    rays: Rays,
    /// Which sample each is of.
    sample: Vec<u32>,
    /// The part of its light.
    weight: [Vec<f32>; 3],
    /// What the liquid it is in takes, per unit of length.
    absorption: [Vec<f32>; 3],
    /// Width and growth of the cone of its neighbours, see [`motes_scene::Sight`].
    width: Vec<f32>,
    spread: Vec<f32>,
}

/// Sixteen paths.
#[derive(Clone, Copy)]
struct Paths<S: Simd> {
    sample: u32x16<S>,
    weight: V3<S>,
    absorption: V3<S>,
    width: f32x16<S>,
    spread: f32x16<S>,
}

/// Memory of one thread.
#[derive(Default)]
pub(crate) struct Desk {
    /// Where samples are: x in one row, y in the other, in whole vectors.
    pub places: [Vec<f32>; 2],
    now: Wave,
    next: Wave,
    hits: Hits,
}

/// Boundaries that sixteen paths meet.
#[derive(Clone, Copy)]
struct Boundary<S: Simd> {
    place: V3<S>,
    direction: V3<S>,
    /// Towards where the ray comes from.
    normal: V3<S>,
    /// The medium behind it, of one that comes from outside.
    surface: u32x16<S>,
    inside: mask32x16<S>,
    /// Which are none: where a cut is open.
    open: mask32x16<S>,
}

/// What becomes of light at sixteen boundaries, see [`motes_scene::optics::Split`].
#[derive(Clone, Copy)]
struct Split<S: Simd> {
    reflected: V3<S>,
    refracted: V3<S>,
    /// Whether any is refracted.
    through: mask32x16<S>,
    reflectance: f32x16<S>,
}

impl Wave {
    fn clear(&mut self) {
        self.rays.clear();
    }

    /// Makes room for sixteen more.
    fn reserve(&mut self) {
        self.rays.reserve();
        let room = self.rays.medium.len();
        if self.sample.len() < room {
            self.sample.resize(room, 0);
            let rows = self.weight.iter_mut().chain(&mut self.absorption);
            rows.chain([&mut self.width, &mut self.spread]).for_each(|row| row.resize(room, 0.0));
        }
    }

    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, at: usize) -> Paths<S> {
        Paths {
            sample: u32x16::from_slice(simd, &self.sample[at..at + LANES]),
            weight: V3::load(simd, &self.weight, at),
            absorption: V3::load(simd, &self.absorption, at),
            width: f32x16::from_slice(simd, &self.width[at..at + LANES]),
            spread: f32x16::from_slice(simd, &self.spread[at..at + LANES]),
        }
    }

    /// Adds those of sixteen paths whose lane is set.
    #[inline(always)]
    fn push<S: Simd>(
        &mut self,
        mask: mask32x16<S>,
        paths: &Paths<S>,
        ray: (V3<S>, V3<S>),
        medium: u32x16<S>,
    ) {
        if mask.to_bitmask() == 0 {
            return;
        }
        self.reserve();
        let at = self.rays.len()..self.rays.len() + LANES;
        paths.sample.compress(mask).store_slice(&mut self.sample[at.clone()]);
        for c in 0..3 {
            paths.weight.0[c].compress(mask).store_slice(&mut self.weight[c][at.clone()]);
            paths.absorption.0[c].compress(mask).store_slice(&mut self.absorption[c][at.clone()]);
        }
        paths.width.compress(mask).store_slice(&mut self.width[at.clone()]);
        paths.spread.compress(mask).store_slice(&mut self.spread[at]);
        self.rays.push_where(mask, ray, medium);
    }
}

impl Caster<'_> {
    /// Adds the light at the desk's places of a picture, whose pixels are `finer` times as small as its rays say.
    pub fn trace(
        &self,
        (rays, finer): (&motes_scene::Rays, usize),
        (light, desk): (&mut [Vec4], &mut Desk),
    ) {
        let Desk { places, now, .. } = &mut *desk;
        now.clear();
        let spread = rays.pixel / finer as f32;
        dispatch!(self.body.level, simd => {
            set_out(simd, (self, rays, spread), places, (now, light));
        });
        for number in 1..=self.optics.depth {
            if desk.now.rays.len() == 0 {
                break;
            }
            let Desk { now, next, hits, .. } = &mut *desk;
            next.clear();
            self.body.march(&mut now.rays, hits);
            dispatch!(self.body.level, simd => {
                follow(simd, (self, number), (now, hits), next, light);
            });
            std::mem::swap(&mut desk.now, &mut desk.next);
        }
    }
}

/// Begins the paths of all samples; those that miss the liquid end here.
#[simd]
fn set_out<S: Simd>(
    simd: S,
    (caster, rays, spread): (&Caster<'_>, &motes_scene::Rays, f32),
    places: &[Vec<f32>; 2],
    (wave, light): (&mut Wave, &mut [Vec4]),
) {
    let count = light.len();
    let lattice = &caster.body.field.lattice;
    let medium = |point: Vec3| caster.body.medium(lattice.place(point));
    let perspective = rays.projection == motes_scene::Projection::Perspective;
    let of_eye = medium(rays.origin);
    let splat = |v: f32| f32x16::splat(simd, v);
    let [forward, right, up] = [rays.forward, rays.right, rays.up].map(|v| V3::splat(simd, v));
    let whole = V3([splat(1.0); 3]);
    let first = u32x16::from_slice(simd, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]);
    for at in (0..count).step_by(LANES) {
        let of = |row: &Vec<f32>| f32x16::from_slice(simd, &row[at..at + LANES]);
        let a = (of(&places[0]) - rays.center[0]) * rays.pixel;
        let b = (rays.center[1] - of(&places[1])) * rays.pixel;
        let across = (right * a).along(up, b);
        let eye = V3::splat(simd, rays.origin);
        let (origin, direction) = match perspective {
            true => (eye, (forward + across).normalize_or(forward)),
            false => (eye + across, forward),
        };
        let mut media = Lanes([of_eye; LANES]);
        if !perspective {
            let origins = store(origin);
            for lane in 0..LANES {
                media.0[lane] = medium(lane_of(&origins, lane));
            }
        }
        let origin = (origin - V3::splat(simd, lattice.low)) * splat(1.0 / lattice.voxel);
        let left = count - at;
        let mask = if left >= LANES { 0xffff } else { (1 << left) - 1 };
        let paths = Paths {
            sample: first + u32x16::splat(simd, at as u32),
            weight: whole,
            absorption: V3::splat(simd, caster.optics.absorption),
            width: splat(0.0),
            spread: splat(spread),
        };
        let mask = mask32x16::from_bitmask(simd, mask);
        let (_, [from, to]) = within(origin, direction, caster.body.space.bounds);
        let near = mask & from.simd_lt(to);
        wave.push(near, &paths, (origin, direction), u32x16::from_slice(simd, &media.0));
        caster.miss(simd, (mask & !near, &paths), (origin, direction), light);
    }
}

/// What becomes of all paths at their boundaries, the `number`-th of each.
#[simd]
fn follow<S: Simd>(
    simd: S,
    (caster, number): (&Caster<'_>, u32),
    (wave, hits): (&Wave, &Hits),
    next: &mut Wave,
    light: &mut [Vec4],
) {
    for at in (0..wave.rays.len()).step_by(LANES) {
        let left = wave.rays.len() - at;
        let there = if left >= LANES { 0xffff } else { (1 << left) - 1 };
        let there = mask32x16::from_bitmask(simd, there);
        some(simd, (caster, number), (wave, hits), (at, there), (next, light));
    }
}

/// The same of sixteen.
#[inline(always)]
fn some<S: Simd>(
    simd: S,
    (caster, number): (&Caster<'_>, u32),
    (wave, hits): (&Wave, &Hits),
    (at, there): (usize, mask32x16<S>),
    (next, light): (&mut Wave, &mut [Vec4]),
) {
    let (lattice, zero) = (&caster.body.field.lattice, f32x16::splat(simd, 0.0));
    let far = f32x16::splat(simd, f32::INFINITY);
    let mut paths = wave.load(simd, at);
    let origin = V3::load(simd, &wave.rays.origin, at);
    let direction = V3::load(simd, &wave.rays.direction, at);
    let medium = u32x16::from_slice(simd, &wave.rays.medium[at..at + LANES]);
    let inside = !medium.simd_eq(u32x16::splat(simd, OUTSIDE));
    let distance = f32x16::from_slice(simd, &hits.distance[at..at + LANES]);
    let length = distance * lattice.voxel;
    if number == 1 {
        count(there, paths.sample, (light, 1.0));
    }

    // What is met on the way.
    let sights = caster.sights(simd, &paths, (origin, direction), length);
    let met = surroundings::meet(simd, caster.around, &sights, there);
    let stopped = met.any & there;
    if stopped.any_true() {
        let far_away = met.distance.simd_ge(far);
        let wet = (inside & !far_away).select(met.distance, zero);
        let shown = match number == 1 && !caster.around.shown {
            true => {
                let nothing = stopped & distance.simd_ge(far);
                count(nothing, paths.sample, (light, -1.0));
                stopped & !nothing
            }
            false => stopped,
        };
        let left = paths.weight.times(transmitted(paths.absorption, wet));
        add(shown, paths.sample, left.times(met.light), light);
    }
    let on = there & !stopped & distance.simd_lt(far);
    if !on.any_true() {
        return;
    }

    // The boundary.
    let t = on.select(distance, zero);
    let place = origin.along(direction, t);
    let surface = u32x16::from_slice(simd, &hits.surface[at..at + LANES]);
    let mut out = -sixteen(simd, caster.body.field, place);
    let in_drops = !surface.simd_eq(u32x16::splat(simd, LIQUID)) & on;
    if in_drops.any_true() {
        out = caster.ways_out(simd, (out, place), (surface, in_drops));
    }
    let mut open = mask32x16::splat(simd, false);
    if let Some(cuts) = caster.body.cuts {
        (out, open) = of_caps(simd, cuts, (out, on), &hits.cap[at..at + LANES]);
    }
    let back = V3::select(inside, direction, -direction);
    let out = out.normalize_or(back);
    let through = transmitted(paths.absorption, inside.select(t * lattice.voxel, zero));
    paths.weight = paths.weight.times(through);
    paths.width = paths.spread.mul_add(t * lattice.voxel, paths.width);
    paths.spread += PART;
    let normal = V3::select(inside, -out, out);
    let met = Boundary { place, direction, normal, surface, inside, open };
    // Of what is faint, or has met enough, what lies behind is seen.
    let [r, g, b] = paths.weight.0;
    let faint = r.max(g).max(b).simd_lt(f32x16::splat(simd, FAINT));
    let ends = if number == caster.optics.depth { on } else { on & faint };
    caster.end(simd, (ends, &paths), &met, light);
    let on = on & !ends;
    // An eye in the liquid goes on as others do from their second boundary on.
    let first = if number == 1 { on & !inside } else { mask32x16::splat(simd, false) };
    caster.begin(simd, (first, &paths), &met, (next, light));
    caster.go_on(simd, (on & !first, &paths), &met, (next, light));
}

/// The ways out of those of sixteen boundaries that are caps, and which of these are open; `out` elsewhere.
#[inline(always)]
fn of_caps<S: Simd>(
    simd: S,
    cuts: &Cuts,
    (out, mask): (V3<S>, mask32x16<S>),
    caps: &[u32],
) -> (V3<S>, mask32x16<S>) {
    let (mut ways, mut open) = (store(out), 0);
    let mut left = mask.to_bitmask();
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        if caps[lane] > 0 {
            let way = -cuts.normal(caps[lane]);
            (0..3).for_each(|a| ways[a].0[lane] = way[a]);
            open |= u64::from(cuts.is_open(caps[lane])) << lane;
        }
    }
    let of = |row: &Lanes<f32>| f32x16::from_slice(simd, &row.0);
    (V3([of(&ways[0]), of(&ways[1]), of(&ways[2])]), mask32x16::from_bitmask(simd, open))
}

impl Caster<'_> {
    #[inline(always)]
    fn sights<S: Simd>(
        &self,
        simd: S,
        paths: &Paths<S>,
        (place, direction): (V3<S>, V3<S>),
        reach: f32x16<S>,
    ) -> Sights<S> {
        let lattice = &self.body.field.lattice;
        let voxel = f32x16::splat(simd, lattice.voxel);
        let origin = V3::splat(simd, lattice.low).along(place, voxel);
        Sights { origin, direction, reach, width: paths.width, spread: paths.spread }
    }

    /// Ends paths at once that never come near the liquid.
    #[inline(always)]
    fn miss<S: Simd>(
        &self,
        simd: S,
        (mask, paths): (mask32x16<S>, &Paths<S>),
        ray: (V3<S>, V3<S>),
        light: &mut [Vec4],
    ) {
        if !mask.any_true() {
            return;
        }
        let sights = self.sights(simd, paths, ray, f32x16::splat(simd, f32::INFINITY));
        let met = surroundings::meet(simd, self.around, &sights, mask);
        let shown = mask & (!met.any | mask32x16::splat(simd, self.around.shown));
        let nothing = V3::splat(simd, Vec3::ZERO);
        let seen = V3::select(met.any, met.light, nothing);
        add_covered(shown, paths.sample, seen, (light, 1.0));
    }

    /// Adds what some paths see of the surroundings, wherever these are.
    #[inline(always)]
    fn see<S: Simd>(
        &self,
        simd: S,
        (mask, paths): (mask32x16<S>, &Paths<S>),
        ray: (V3<S>, V3<S>),
        light: &mut [Vec4],
    ) {
        if mask.any_true() {
            let far = f32x16::splat(simd, f32::INFINITY);
            let sights = self.sights(simd, paths, ray, far);
            let met = surroundings::meet(simd, self.around, &sights, mask);
            add(mask & met.any, paths.sample, paths.weight.times(met.light), light);
        }
    }

    /// At their last boundary paths see what lies behind it.
    #[inline(always)]
    fn end<S: Simd>(
        &self,
        simd: S,
        (mask, paths): (mask32x16<S>, &Paths<S>),
        met: &Boundary<S>,
        light: &mut [Vec4],
    ) {
        if !mask.any_true() {
            return;
        }
        let split = met.split(simd, self.optics.ior);
        let on = V3::select(split.through, split.refracted, met.direction);
        self.see(simd, (mask, paths), (met.place, on), light);
    }

    /// At the first surface both ways are followed.
    #[inline(always)]
    fn begin<S: Simd>(
        &self,
        simd: S,
        (mask, paths): (mask32x16<S>, &Paths<S>),
        met: &Boundary<S>,
        (next, light): (&mut Wave, &mut [Vec4]),
    ) {
        if !mask.any_true() {
            return;
        }
        let split = met.split(simd, self.optics.ior);
        let thrown = Paths { weight: paths.weight * split.reflectance, ..*paths };
        let ray = (met.place, split.reflected);
        let faint = split.reflectance.simd_lt(f32x16::splat(simd, FAINT));
        self.see(simd, (mask & faint, &thrown), ray, light);
        next.push(mask & !faint, &thrown, ray, u32x16::splat(simd, OUTSIDE));
        let rest = 1.0 - split.reflectance;
        let on = mask & split.through;
        let absorption = self.tints(simd, paths.absorption, (met.place, on));
        let through = Paths { weight: paths.weight * rest, absorption, ..*paths };
        next.push(on, &through, (met.place, split.refracted), met.surface);
    }

    /// At any other, paths go on the way most of the light goes.
    #[inline(always)]
    fn go_on<S: Simd>(
        &self,
        simd: S,
        (mask, paths): (mask32x16<S>, &Paths<S>),
        met: &Boundary<S>,
        (next, light): (&mut Wave, &mut [Vec4]),
    ) {
        if !mask.any_true() {
            return;
        }
        let split = met.split(simd, self.optics.ior);
        let goes_on = split.through & split.reflectance.simd_lt(f32x16::splat(simd, 0.5));
        let onward = V3::select(goes_on, split.refracted, split.reflected);
        let inside = (goes_on & !met.inside) | (!goes_on & met.inside);
        // The other way, if it is outside.
        let other = V3::select(goes_on, split.reflected, split.refracted);
        let seen = mask & inside & (goes_on | split.through);
        let part = goes_on.select(split.reflectance, 1.0 - split.reflectance);
        let aside = Paths { weight: paths.weight * part, ..*paths };
        self.see(simd, (seen, &aside), (met.place, other), light);
        let weight = V3::select(seen, paths.weight * (1.0 - part), paths.weight);
        let enters = mask & inside & !met.inside;
        let absorption = self.tints(simd, paths.absorption, (met.place, enters));
        let medium = inside.select(met.surface, u32x16::splat(simd, OUTSIDE));
        next.push(mask, &Paths { weight, absorption, ..*paths }, (met.place, onward), medium);
    }

    /// The ways out of drops at their surfaces; `out` elsewhere.
    #[inline(always)]
    fn ways_out<S: Simd>(
        &self,
        simd: S,
        (out, place): (V3<S>, V3<S>),
        (surface, mask): (u32x16<S>, mask32x16<S>),
    ) -> V3<S> {
        let (mut ways, places) = (store(out), store(place));
        let mut drops = Lanes([0_u32; LANES]);
        surface.store_slice(&mut drops.0);
        let mut left = mask.to_bitmask();
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let center = self.body.space.drops.drops[drops.0[lane] as usize].center;
            let way = lane_of(&places, lane) - center;
            (0..3).for_each(|a| ways[a].0[lane] = way[a]);
        }
        let of = |row: &Lanes<f32>| f32x16::from_slice(simd, &row.0);
        V3([of(&ways[0]), of(&ways[1]), of(&ways[2])])
    }

    /// What the liquid takes per unit of length behind places of its surface; `same` elsewhere. Of coloured
    /// liquid, more of other colours.
    #[inline(always)]
    fn tints<S: Simd>(&self, simd: S, same: V3<S>, (place, mask): (V3<S>, mask32x16<S>)) -> V3<S> {
        let Some(paint) = self.around.paint else { return same };
        let (mut tints, places) = (store(same), store(place));
        let mean = self.optics.absorption.element_sum() / 3.0;
        let mut left = mask.to_bitmask();
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let color = paint.color(self.body.field.lattice.point(lane_of(&places, lane)));
            let tint = -color.clamp(Vec3::splat(0.02), Vec3::ONE).map(f32::ln) * mean;
            (0..3).for_each(|c| tints[c].0[lane] = tint[c]);
        }
        let of = |row: &Lanes<f32>| f32x16::from_slice(simd, &row.0);
        V3([of(&tints[0]), of(&tints[1]), of(&tints[2])])
    }
}

impl<S: Simd> Boundary<S> {
    /// [`motes_scene::optics::split`].
    #[inline(always)]
    fn split(&self, simd: S, ior: f32) -> Split<S> {
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let (direction, normal) = (self.direction, self.normal);
        let eta = self.inside.select(f32x16::splat(simd, ior), f32x16::splat(simd, 1.0 / ior));
        let eta = self.open.select(one, eta);
        let cos1 = (-direction.dot(normal)).max(zero).min(one);
        let reflected = direction.along(normal, cos1 * 2.0).normalize_or(normal);
        let sin2 = eta * eta * (1.0 - cos1 * cos1);
        let through = sin2.simd_lt(one);
        let cos2 = (1.0 - sin2).max(zero).sqrt();
        let refracted = (direction * eta).along(normal, eta * cos1 - cos2).normalize_or(-normal);
        let s = (eta * cos1 - cos2) / (eta * cos1 + cos2);
        let p = (cos1 - eta * cos2) / (cos1 + eta * cos2);
        let reflectance = through.select((s * s + p * p) * 0.5, one);
        Split { reflected, refracted, through, reflectance }
    }
}

/// [`motes_scene::optics::transmitted`].
#[inline(always)]
fn transmitted<S: Simd>(absorption: V3<S>, length: f32x16<S>) -> V3<S> {
    let [r, g, b] = absorption.0;
    let simd = length.token();
    V3([exp(simd, -(r * length)), exp(simd, -(g * length)), exp(simd, -(b * length))])
}

/// Adds light to the samples of some paths.
#[inline(always)]
fn add<S: Simd>(mask: mask32x16<S>, sample: u32x16<S>, more: V3<S>, light: &mut [Vec4]) {
    add_covered(mask, sample, more, (light, 0.0));
}

/// Adds light to the samples of some paths, one after the other, and to how much of these is covered.
#[inline(always)]
fn add_covered<S: Simd>(
    mask: mask32x16<S>,
    sample: u32x16<S>,
    more: V3<S>,
    (light, cover): (&mut [Vec4], f32),
) {
    let rows = store(more);
    let mut samples = Lanes([0_u32; LANES]);
    sample.store_slice(&mut samples.0);
    let mut left = mask.to_bitmask();
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        light[samples.0[lane] as usize] += lane_of(&rows, lane).extend(cover);
    }
}

/// Adds to how much of the samples of some paths is covered.
#[inline(always)]
fn count<S: Simd>(mask: mask32x16<S>, sample: u32x16<S>, (light, more): (&mut [Vec4], f32)) {
    let mut samples = Lanes([0_u32; LANES]);
    sample.store_slice(&mut samples.0);
    let mut left = mask.to_bitmask();
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        light[samples.0[lane] as usize].w += more;
    }
}
