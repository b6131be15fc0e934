//! A whole picture: areas on all cores, tiles of rays within areas.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::{Lens, Lights, Rays};

use crate::aims::Aims;
use crate::bounce::Bounce;
use crate::hits::Hits;
use crate::lens::bend;
use crate::near::Shelves;
use crate::occlude::{Occluder, Work};
use crate::overview::{GroupView, overview};
use crate::packet::{MOST_RAYS, NO_SLOT, Packet, Surface};
use crate::peel::Peel;
use crate::picture::Layers;
use crate::project::project;
use crate::refine::{Adaptive, Refine};
use crate::shade::{Canvas, Paint, shade};
use crate::tile::{Pattern, Place, RayTile};
use crate::traverse::{Counts, Spheres, first_part, trace};

/// How the first hits are found. Changes the speed, never the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Primary {
    /// Blocks of the grid front to back onto tiles.
    #[default]
    Project,
    /// Packets through the grid: the paper's method.
    Trace,
}

/// What to make of the rays.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Rays per pixel for the colour.
    pub samples: u32,
    /// How the first hits are found.
    pub primary: Primary,
    /// Side of a packet, rays: 2, 4, 8 or 16.
    pub packet: u32,
    /// Whether depth, normal, id and system are wanted.
    pub layers: bool,
    /// What makes the picture finer.
    pub finer: Finer,
    /// The instruction set.
    pub level: Level,
}

/// What makes a picture finer than its samples through a pinhole. By default, nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Finer {
    /// More samples where they differ.
    pub adaptive: Option<Adaptive>,
    /// The lens of a perspective camera, by which the colour is seen; all else is seen by a pinhole.
    pub lens: Option<Lens>,
}

/// What is seen, in what light.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The camera's rays, about the same origin as the particles.
    pub rays: &'a Rays,
    /// The particle systems.
    pub systems: &'a [Spheres<'a>],
    /// Their colours.
    pub paint: &'a dyn Paint,
    /// The lights.
    pub lights: &'a Lights,
    /// What keeps light away, in place of the systems; empty: the systems.
    pub casters: &'a [Spheres<'a>],
}

impl<'a> View<'a> {
    /// What keeps light away.
    pub(crate) fn casting(&self) -> &'a [Spheres<'a>] {
        if self.casters.is_empty() { self.systems } else { self.casters }
    }
}

/// Where a cut has laid the inside of a particle open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cap {
    /// The owner of the face.
    pub owner: u16,
    /// The point at hand, about the particles' origin.
    pub point: Vec3,
}

/// What the ray through a pixel's centre hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Center {
    /// Distance along the ray; +∞ where nothing.
    pub depth: f32,
    /// Unit normal towards the viewer; zero where nothing.
    pub normal: [f32; 3],
    /// Index in the file's own order; −1 where nothing.
    pub id: i64,
    /// System.
    pub system: u16,
}

impl Center {
    pub(crate) const NOTHING: Self =
        Self { depth: f32::INFINITY, normal: [0.0; 3], id: -1, system: 0 };
}

/// A finished part of the picture.
#[derive(Clone, Copy, Debug)]
pub struct Tile<'a> {
    /// Its first pixel.
    pub corner: (u32, u32),
    /// Its width and height, pixels.
    pub size: (u32, u32),
    /// Linear, premultiplied RGBA, row by row.
    pub color: &'a [[f32; 4]],
    /// What the rays through the pixels' centres hit; empty if layers were not wanted.
    pub layers: &'a Layers,
}

/// Takes the parts of a picture as they are finished, in any order and on any thread.
pub trait Sink: Sync {
    /// Takes a tile. Where it gives `false` the rest of the picture is left out.
    fn tile(&self, tile: &Tile<'_>) -> bool;
}

/// Pixels along the side of an area: what one thread does at a time.
pub(crate) const AREA: u32 = 64;

/// Renders pictures, and keeps its buffers from one to the next.
#[derive(Debug, Default)]
pub struct Renderer {
    desks: Mutex<Vec<Desk>>,
}

impl Renderer {
    /// A renderer without buffers.
    pub fn new() -> Self {
        Self::default()
    }

    /// How many tiles a picture of `size` comes in.
    pub fn tiles((width, height): (u32, u32)) -> usize {
        width.div_ceil(AREA) as usize * height.div_ceil(AREA) as usize
    }

    /// Renders a picture, tile by tile into `sink`, on the threads of the current pool. Gives counts of
    /// work, or `None` if the sink stopped it.
    pub fn render(&self, view: View<'_>, settings: Settings, sink: &dyn Sink) -> Option<Counts> {
        let plan = Plan::new(view, settings);
        let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
        let total = Mutex::new(Counts::default());
        let areas = Self::tiles(settings.size);
        rayon::scope(|scope| {
            for _ in 0..rayon::current_num_threads().min(areas) {
                scope.spawn(|_| {
                    let mut desk = self.take();
                    let mut counts = Counts::default();
                    let mut area = next.fetch_add(1, Ordering::Relaxed);
                    while area < areas && !stopped.load(Ordering::Relaxed) {
                        dispatch!(settings.level, simd => plan.area(simd, area, &mut desk, &mut counts));
                        if !sink.tile(&desk.tile(plan.place(area))) {
                            stopped.store(true, Ordering::Relaxed);
                        }
                        area = next.fetch_add(1, Ordering::Relaxed);
                    }
                    self.put_back(desk);
                    if let Ok(mut total) = total.lock() {
                        total.add(counts);
                    }
                });
            }
        });
        let total = total.into_inner().unwrap_or_default();
        (!stopped.into_inner()).then_some(total)
    }

    fn take(&self) -> Desk {
        let kept = self.desks.lock().ok().and_then(|mut desks| desks.pop());
        kept.unwrap_or_else(Desk::new)
    }

    fn put_back(&self, desk: Desk) {
        if let Ok(mut desks) = self.desks.lock() {
            desks.push(desk);
        }
    }
}

/// What one thread works with.
#[derive(Debug)]
struct Desk {
    rays: RayTile,
    packet: Box<Packet>,
    hits: Hits,
    occluder: Occluder,
    peel: Peel,
    bounce: Bounce,
    refine: Refine,
    color: Vec<[f32; 4]>,
    /// Whether there is no light in `color`.
    blank: bool,
    layers: Layers,
}

impl Desk {
    fn new() -> Self {
        Self {
            rays: RayTile::new(),
            packet: Box::new(Packet::new()),
            hits: Hits::new(),
            occluder: Occluder::new(),
            peel: Peel::new(),
            bounce: Bounce::new(),
            refine: Refine::new(),
            color: Vec::new(),
            blank: true,
            layers: Layers::default(),
        }
    }

    fn tile(&self, place: Place) -> Tile<'_> {
        let Self { color, layers, .. } = self;
        Tile { corner: place.corner, size: place.size, color, layers }
    }
}

/// Samples that are taken together: those of a pattern, in a part of an area.
struct Round {
    area: usize,
    place: Place,
    part: Place,
    pattern: Pattern,
    /// The pattern's first among the samples of a pixel.
    first_sample: u32,
    /// Which of the plan's courses it belongs to.
    course: usize,
    lens: Option<Lens>,
}

/// One picture: what is the same for all of its areas.
struct Plan<'a> {
    view: View<'a>,
    settings: Settings,
    /// What every pixel gets; and what those get instead whose samples differ.
    courses: Vec<Course>,
    /// Where the blocks of the grids lie, if there are occlusion rays.
    shelves: Shelves,
    /// Per system, the groups of blocks that may be seen; and per area, which of them may show in it,
    /// nearest first.
    groups: Vec<Vec<GroupView>>,
    shown: Vec<Vec<Vec<u32>>>,
}

/// The samples of a pixel.
struct Course {
    samples: u32,
    /// Where they lie, in rounds of 16, 4 or 1.
    rounds: Vec<Pattern>,
    /// Where their secondary rays go.
    aims: Aims,
}

impl Course {
    /// A pixel's secondary rays are those of `base` samples, however many samples share them; but every
    /// sample has one of each kind.
    fn new(samples: u32, base: u32, lights: &Lights) -> Self {
        let share = |rays: u32| (u64::from(rays) * u64::from(base)).div_ceil(u64::from(samples));
        let mut lights = *lights;
        lights.occlusion_rays = share(lights.occlusion_rays) as u32;
        lights.key.shadow_rays = share(lights.key.shadow_rays) as u32;
        let offsets = sample_offsets(samples);
        Self { samples, rounds: rounds(&offsets), aims: Aims::new(&lights, samples) }
    }
}

impl<'a> Plan<'a> {
    fn new(view: View<'a>, settings: Settings) -> Self {
        // One sample alone does not tell how sure it is.
        let adaptive = settings.finer.adaptive.filter(|a| a.noise > 0.0 && settings.samples > 1);
        let more = adaptive.map(|a| a.most).filter(|most| *most > settings.samples);
        let samples = std::iter::once(settings.samples).chain(more);
        let occluded = view.lights.occlusion_rays > 0;
        let mut plan = Self {
            view,
            settings,
            courses: samples.map(|n| Course::new(n, settings.samples, view.lights)).collect(),
            shelves: Shelves::new(if occluded { view.casting() } else { &[] }),
            groups: Vec::new(),
            shown: Vec::new(),
        };
        if settings.primary == Primary::Project {
            for spheres in view.systems {
                let groups = dispatch!(settings.level, simd => overview(simd, view.rays, spheres));
                plan.shown.push(plan.shown_in(&groups));
                plan.groups.push(groups);
            }
        }
        plan
    }

    /// Which groups may show in each area, nearest first.
    fn shown_in(&self, groups: &[GroupView]) -> Vec<Vec<u32>> {
        let (width, height) = self.settings.size;
        let (across, down) = (width.div_ceil(AREA), height.div_ceil(AREA));
        let mut shown = vec![Vec::new(); (across * down) as usize];
        let mut order: Vec<u32> = (0..groups.len() as u32).collect();
        let near = |g: &u32| groups[*g as usize].whole.near;
        order.sort_unstable_by(|a, b| near(a).total_cmp(&near(b)).then(a.cmp(b)));
        for group in order {
            let whole = groups[group as usize].whole;
            let areas = |(low, high): (f32, f32), count: u32| {
                // `as` truncates and saturates: below zero is zero.
                let last = (high / AREA as f32) as u32;
                (low / AREA as f32) as u32..if high < 0.0 { 0 } else { last.min(count - 1) + 1 }
            };
            for y in areas(whole.y, down) {
                for x in areas(whole.x, across) {
                    shown[(y * across + x) as usize].push(group);
                }
            }
        }
        shown
    }

    fn place(&self, area: usize) -> Place {
        let (width, height) = self.settings.size;
        let across = width.div_ceil(AREA) as usize;
        let corner = ((area % across) as u32 * AREA, (area / across) as u32 * AREA);
        Place { corner, size: (AREA.min(width - corner.0), AREA.min(height - corner.1)) }
    }

    /// Renders one area onto the desk.
    #[simd]
    fn area<S: Simd>(&self, simd: S, area: usize, desk: &mut Desk, counts: &mut Counts) {
        let place = self.place(area);
        let pixels = (place.size.0 * place.size.1) as usize;
        if !desk.blank || desk.color.len() != pixels {
            desk.color.clear();
            desk.color.resize(pixels, [0.0; 4]);
            desk.blank = true;
        }
        desk.layers.clear(if self.settings.layers { pixels } else { 0 });
        let projected = self.settings.primary == Primary::Project;
        // What is out of focus shows where it would not be.
        let projected = projected && self.settings.finer.lens.is_none();
        if projected && self.shown.iter().all(|shown| shown[area].is_empty()) {
            return;
        }
        let adaptive = self.adaptive();
        desk.refine.begin(if adaptive.is_some() { pixels } else { 0 });
        for (course, Course { rounds, .. }) in self.courses.iter().enumerate() {
            let mut first_sample = 0;
            for pattern in rounds {
                for part in parts(place, pattern.tile_side()) {
                    let (pattern, lens) = (*pattern, self.settings.finer.lens);
                    let round = Round { area, place, part, pattern, first_sample, course, lens };
                    self.round(simd, &round, desk, counts);
                }
                first_sample += pattern.samples;
            }
            let again = course + 1 < self.courses.len();
            if again && !desk.refine.judge(adaptive.map_or(0.0, |a| a.noise), &mut desk.color) {
                break;
            }
        }
        if self.settings.layers {
            let middle = Pattern::of(&[[0.5; 2]]);
            if !self.is_plain(&middle) {
                let (pattern, lens) = (middle, None);
                let round =
                    Round { area, place, part: place, pattern, first_sample: 0, course: 0, lens };
                self.first_hits(simd, &round, desk, counts);
                desk.hits.gather(simd, &desk.rays, self.view.systems);
            }
            for y in 0..place.size.1 {
                for x in 0..place.size.0 {
                    let ray = middle.ray((x, y), 0);
                    let at = (y * place.size.0 + x) as usize;
                    if desk.hits.has(ray) {
                        desk.layers.put(at, desk.hits.center(&desk.rays, ray));
                    }
                }
            }
        }
    }

    /// Takes the samples of a round.
    #[simd]
    fn round<S: Simd>(&self, simd: S, round: &Round, desk: &mut Desk, counts: &mut Counts) {
        let adaptive = self.adaptive();
        if adaptive.is_some() && !desk.refine.begin_part(round.place, round.part) {
            return;
        }
        self.first_hits(simd, round, desk, counts);
        if desk.hits.gather(simd, &desk.rays, self.view.systems) > 0 {
            if self.view.paint.translucent() {
                self.peel(simd, round, desk, counts);
            } else {
                self.light(simd, round, desk, counts);
            }
        }
        if let Some(adaptive) = adaptive {
            let how = (&round.pattern, self.weight(round), adaptive.exposure);
            desk.refine.end_part((round.place, round.part), how, &mut desk.color);
        }
    }

    /// Whether the last rays that were sent are those of pattern `middle` alone, and what they hit is known.
    fn is_plain(&self, middle: &Pattern) -> bool {
        let courses = &self.courses[..];
        let one = matches!(courses, [Course { rounds, .. }] if matches!(&rounds[..], [of] if of == middle));
        one && self.settings.finer.lens.is_none() && !self.view.paint.translucent()
    }

    /// How pixels are judged, if any may get more samples.
    fn adaptive(&self) -> Option<Adaptive> {
        self.settings.finer.adaptive.filter(|_| self.courses.len() > 1)
    }

    /// What each sample of a round counts.
    fn weight(&self, round: &Round) -> f32 {
        1.0 / self.courses[round.course].samples as f32
    }

    /// Finds what the rays of a part of an area hit first.
    #[simd]
    fn first_hits<S: Simd>(&self, simd: S, round: &Round, desk: &mut Desk, counts: &mut Counts) {
        let Self { view, settings, .. } = self;
        let Round { area, part, pattern, course, first_sample, .. } = *round;
        let rays = &mut desk.rays;
        let finished = (course > 0).then_some(&desk.refine.finished_here[..]);
        rays.aim(simd, view.rays, (part, pattern), finished);
        if let Some(lens) = round.lens {
            bend(rays, (view.rays, lens), (part.corner, first_sample));
            let how = (view.systems, settings.packet, None);
            return trace_tile(simd, (rays, &mut desk.packet), how, counts);
        }
        match settings.primary {
            Primary::Trace => {
                let how = (view.systems, settings.packet, None);
                trace_tile(simd, (rays, &mut desk.packet), how, counts);
            }
            Primary::Project => {
                let mut whole = 0;
                for (system, spheres) in view.systems.iter().enumerate() {
                    let shown = (&self.groups[system][..], &self.shown[system][area][..]);
                    whole = if spheres.continues { whole } else { system as u16 };
                    if shown.1.is_empty() {
                        continue;
                    }
                    if spheres.continues {
                        rays.continue_system(whole);
                    } else {
                        rays.begin_system();
                    }
                    project(simd, (rays, part), spheres, shown, (view.rays, counts));
                    if spheres.continues {
                        rays.end_part((whole, system as u16));
                    } else {
                        rays.end_system(system as u16);
                    }
                }
            }
        }
    }

    /// Adds the light of the hits of a part and of what lies behind them, front to back.
    #[simd]
    fn peel<S: Simd>(&self, simd: S, round: &Round, desk: &mut Desk, counts: &mut Counts) {
        desk.peel.begin();
        loop {
            desk.peel.weigh(&desk.rays, &desk.hits, self.view.paint);
            self.light(simd, round, desk, counts);
            let Desk { rays, hits, peel, packet, .. } = &mut *desk;
            if !peel.goes_on(rays, hits) {
                return;
            }
            let how = (self.view.systems, self.settings.packet, Some(&*hits));
            trace_tile(simd, (rays, packet), how, counts);
            if hits.gather(simd, rays, self.view.systems) == 0 {
                return;
            }
        }
    }

    /// Adds the light of the hits of a part to the colours of its area.
    #[simd]
    fn light<S: Simd>(&self, simd: S, round: &Round, desk: &mut Desk, counts: &mut Counts) {
        desk.blank = false;
        let Desk { rays, hits, occluder, peel, bounce, refine, color, .. } = desk;
        let translucent = self.view.paint.translucent();
        let Round { place, part, first_sample, course, .. } = *round;
        let bounces = self.view.lights.bounce_rays > 0;
        let work = Work {
            rays,
            hits,
            view: self.view,
            aims: &self.courses[course].aims,
            shelves: &self.shelves,
            corner: part.corner,
            first_sample,
        };
        if translucent {
            occluder.reach_through(simd, work, counts);
        } else {
            occluder.reach(simd, work, counts);
        }
        if bounces {
            bounce.gather(simd, work, counts);
        }
        let canvas = Canvas {
            color,
            width: place.size.0,
            at: (part.corner.0 - place.corner.0, part.corner.1 - place.corner.1),
            weight: self.weight(round),
            parts: translucent.then_some(&peel.part),
            bounced: bounces.then_some(&bounce.light),
            rays: (self.courses.len() > 1).then_some(&mut refine.rays[..]),
        };
        shade(simd, (rays, hits, &occluder.reaching), self.view, canvas);
    }
}

/// The parts of at most `side` pixels that an area consists of.
fn parts(place: Place, side: u32) -> impl Iterator<Item = Place> {
    let ((x, y), (w, h)) = (place.corner, place.size);
    (0..h).step_by(side as usize).flat_map(move |dy| {
        (0..w).step_by(side as usize).map(move |dx| Place {
            corner: (x + dx, y + dy),
            size: (side.min(w - dx), side.min(h - dy)),
        })
    })
}

/// Traces the rays of a tile in packets of `side`² (Gribble et al. 2007, §4); where they have `met`
/// something, to what comes after that.
#[simd]
fn trace_tile<S: Simd>(
    simd: S,
    (rays, packet): (&mut RayTile, &mut Packet),
    (systems, side, met): (&[Spheres<'_>], u32, Option<&Hits>),
    counts: &mut Counts,
) {
    let samples = rays.pattern.samples;
    // A packet takes a square of pixels with all their samples.
    let side = (side / rays.pattern.samples_along()).max(1);
    debug_assert!((side * side * samples) as usize <= MOST_RAYS);
    let mut own = [0usize; MOST_RAYS];
    for y in (0..rays.pattern.tile_side()).step_by(side as usize) {
        for x in (0..rays.pattern.tile_side()).step_by(side as usize) {
            if met.is_some() {
                packet.clear_for_next();
            } else {
                packet.clear();
            }
            for i in 0..side * side {
                for sample in 0..samples {
                    let ray = rays.pattern.ray((x + i % side, y + i / side), sample);
                    if rays.distance[ray] > 0.0 {
                        own[packet.len()] = ray;
                        let (origin, direction) = (rays.origin_of(ray), rays.direction_of(ray));
                        match met {
                            None => packet.push(origin, direction),
                            Some(hits) => {
                                let met = hits.surface(rays, ray);
                                let system = first_part(systems, met.system);
                                packet.push_after(origin, direction, Surface { system, ..met });
                            }
                        }
                    }
                }
            }
            if packet.is_empty() {
                continue;
            }
            trace(simd, packet, systems, counts);
            for (i, ray) in own[..packet.len()].iter().enumerate() {
                let nothing = (f32::INFINITY, 0, NO_SLOT);
                let (distance, system, slot) = packet.hit(i).unwrap_or(nothing);
                rays.distance[*ray] = distance;
                rays.hit_system[*ray] = system;
                rays.hit_slot[*ray] = slot;
            }
        }
    }
}

/// The samples in rounds of 16, 4 or 1.
fn rounds(mut left: &[[f32; 2]]) -> Vec<Pattern> {
    let mut rounds = Vec::new();
    while !left.is_empty() {
        let pattern = Pattern::of(left);
        rounds.push(pattern);
        left = &left[pattern.samples as usize..];
    }
    rounds
}

/// Where in the pixel its samples lie, each in 0..1: the centre; a rotated square; else a Fibonacci
/// lattice, which leaves no two samples in one row or column.
fn sample_offsets(samples: u32) -> Vec<[f32; 2]> {
    match samples {
        1 => vec![[0.5, 0.5]],
        4 => vec![[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]],
        n => (0..n)
            .map(|i| {
                let golden = 0.618_034 * (i as f32 + 0.5);
                [(i as f32 + 0.5) / n as f32, golden.fract()]
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_spread_about_the_centre() {
        for n in [1, 2, 3, 4, 9, 16, 64, 1024] {
            let offsets = sample_offsets(n);
            assert_eq!(offsets.len(), n as usize);
            assert!(offsets.iter().flatten().all(|v| (0.0..1.0).contains(v)));
            for axis in 0..2 {
                let mean = offsets.iter().map(|o| o[axis]).sum::<f32>() / n as f32;
                assert!((mean - 0.5).abs() < 0.2 / (n as f32).sqrt(), "{n}: {mean}");
            }
        }
    }

    #[test]
    fn parts_cover_an_area_once() {
        let area = Place { corner: (3, 5), size: (13, 7) };
        let mut seen = [false; 13 * 7];
        for part in parts(area, 4) {
            for y in part.corner.1..part.corner.1 + part.size.1 {
                for x in part.corner.0..part.corner.0 + part.size.0 {
                    let at = ((y - 5) * 13 + x - 3) as usize;
                    assert!(!std::mem::replace(&mut seen[at], true));
                }
            }
        }
        assert!(seen.iter().all(|s| *s));
    }
}
