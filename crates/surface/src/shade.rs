//! Shade: pictures from surfaces.
//!
//! Zirr & Dachsbacher 2015, §3.5: *front* reads the first surface of each column; *translucent* goes over
//! all spans of it and lets them absorb and scatter (their extended last ones, too, without what is empty in them);
//! *refractive* follows the light, see `refract.rs`.

use std::ops::Add;

use fearless_simd::Level;
use glam::{Vec3, Vec4};
use motes_scene::{Beyond, Lights, Sight};
use rayon::prelude::*;

use crate::media::{MOST_MEDIA, Medium, Passage};
use crate::occlusion::Occlusion;
use crate::refract::{MANY, Paths};
use crate::shadow::Shadow;
use crate::{Blocks, NO_CAP, Spans, Surfaces};

/// How the liquid is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Its first surface, opaque.
    Front,
    /// Light goes straight through and is absorbed and scattered on the way.
    Translucent,
    /// Light is refracted and reflected.
    Refractive,
}

/// What the liquid does to light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// How it is shown.
    pub mode: Mode,
    /// What is taken from each colour per unit of length.
    pub absorption: Vec3,
    /// The part of light that is not absorbed but scattered, for each colour, per unit of length; in refractive
    /// mode none is.
    pub scattering: Vec3,
    /// Boundaries that a path goes on from after the first.
    pub depth: u32,
    /// Whether rays skip what blocks of columns have in common.
    pub skip: bool,
}

/// The colours of the liquid, from particles.
pub trait Paint: Sync {
    /// Linear colour of the particle, by its place in the input; `None`: the liquid's.
    fn color(&self, particle: u32) -> Option<Vec3>;

    /// Linear colour of the inside of the liquid at a point, where the cut of `owner` has laid it open, in a particle; `None`: as elsewhere.
    fn cap(&self, _owner: u16, _point: Vec3, _particle: Option<u32>) -> Option<Vec3> {
        None
    }
}

/// What is around the liquid.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    /// What works out the surroundings.
    pub level: Level,
    /// The lights.
    pub lights: &'a Lights,
    /// What rays meet outside.
    pub beyond: &'a dyn Beyond,
    /// Whether rays that meet nothing show what is beyond; else the picture is transparent there.
    pub shown: bool,
    /// What keeps the key light away, if it casts shadows.
    pub shadow: Option<&'a Shadow>,
    /// What keeps fill light away.
    pub occlusion: Option<&'a Occlusion>,
    /// Colours of the liquid, if not one throughout.
    pub paint: Option<&'a dyn Paint>,
    /// The liquid's colour where it is shown opaque or scatters.
    pub color: Vec3,
}

impl Around<'_> {
    /// The colour of the liquid at a surface.
    pub(crate) fn color_of(&self, surfaces: &Surfaces, surface: usize) -> Vec3 {
        self.own_color(surfaces, surface).unwrap_or(self.color)
    }

    /// The colour of a surface's particle, if it has one of its own.
    pub(crate) fn own_color(&self, surfaces: &Surfaces, surface: usize) -> Option<Vec3> {
        self.paint?.color(particle_of(surfaces, surface)?)
    }

    /// The same for a surface of the column at `place`, which may be a cap.
    pub(crate) fn color_at(
        &self,
        surfaces: &Surfaces,
        (place, surface): ([usize; 2], usize),
    ) -> Vec3 {
        let owner = surfaces.caps.get(surface).filter(|owner| **owner != NO_CAP);
        let cap = self.paint.zip(owner).and_then(|(paint, owner)| {
            let place = place.map(|i| i as f32 + 0.5);
            let point = surfaces.view.point(place, surfaces.nearness[surface]);
            paint.cap(*owner, point, particle_of(surfaces, surface))
        });
        cap.unwrap_or_else(|| self.color_of(surfaces, surface))
    }
}

/// The particle of a surface.
fn particle_of(surfaces: &Surfaces, surface: usize) -> Option<u32> {
    surfaces.particles.get(surface).copied().filter(|p| *p != Spans::NO_PARTICLE)
}

/// Rays that leave the liquid and what they are of which pixel: what they meet is looked up for many at once.
#[derive(Debug, Default)]
pub(crate) struct Later {
    sights: Vec<Sight>,
    parts: Vec<(u32, Vec3)>,
    seen: Vec<(Vec3, f32)>,
}

/// Rays that are looked up at once.
const TOGETHER: usize = 1 << 8;

impl Later {
    /// The light that a ray meets outside, `part` of it, goes to pixel number `to` of the row.
    pub fn add(&mut self, sight: Sight, (to, part): (u32, Vec3)) {
        self.sights.push(sight);
        self.parts.push((to, part));
    }

    /// Adds what is met to a row of pixels, in shadow where the liquid casts one.
    fn settle(&mut self, around: &Around<'_>, row: &mut [[f32; 4]]) {
        self.seen.clear();
        around.beyond.look(around.level, &self.sights, &mut self.seen);
        for ((sight, (to, part)), (light, distance)) in
            self.sights.drain(..).zip(self.parts.drain(..)).zip(&self.seen)
        {
            let lit = match around.shadow.filter(|_| distance.is_finite()) {
                Some(shadow) => shadow.fill_and_key(sight.origin + sight.direction * *distance),
                None => Vec3::ONE,
            };
            let light = part * *light * lit;
            let pixel = &mut row[to as usize];
            (pixel[0], pixel[1], pixel[2]) =
                (pixel[0] + light.x, pixel[1] + light.y, pixel[2] + light.z);
        }
    }
}

/// What the rays of a picture did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Rays that went from column to column.
    pub rays: u64,
    /// Columns that they looked into.
    pub columns: u64,
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { rays: self.rays + other.rays, columns: self.columns + other.columns }
    }
}

/// The picture: linear, premultiplied colours, row by row.
///
/// # Panics
/// Without media, or with more than [`MOST_MEDIA`].
pub fn shade(media: &[Medium<'_>], optics: &Optics, around: &Around<'_>) -> Vec<[f32; 4]> {
    shade_finer(media, optics, around, 1).0
}

/// A picture of fewer pixels, and what was done for it: each is the mean of `finer`² of the surfaces', or, where
/// it differs little from all eight around it, the first of them.
///
/// # Panics
/// As [`shade`].
pub fn shade_finer(
    media: &[Medium<'_>],
    optics: &Optics,
    around: &Around<'_>,
    finer: u32,
) -> (Vec<[f32; 4]>, Work) {
    assert!((1..=MOST_MEDIA).contains(&media.len()), "{} media", media.len());
    let finer = finer.max(1) as usize;
    let size = media[0].surfaces.view.size;
    let [width, height] = [size.0 as usize / finer, size.1 as usize / finer];
    let skips = optics.mode == Mode::Refractive && optics.skip;
    let passages = media.iter().map(|medium| Passage {
        medium: *medium,
        blocks: skips.then(|| Blocks::new(around.level, medium.surfaces)),
    });
    let media: Vec<_> = passages.collect();
    let paths = || Paths::new(&media, (optics, around));
    let all = |color: &mut [[f32; 4]], each: &Each<'_>| {
        let bands = color.par_chunks_mut((SQUARE * width).max(1)).enumerate().map(|(y, band)| {
            let mut paths = paths();
            for (x, y) in in_squares([width, height], y * SQUARE) {
                each([x, y], &mut paths, band);
            }
            paths.finish(band)
        });
        bands.reduce(Work::default, Work::add)
    };
    let mut first = vec![[0.0; 4]; width * height];
    let work = all(&mut first, &|[x, y], paths, band| {
        paths.add([x * finer, y * finer], (y % SQUARE * width + x, 1.0), band);
    });
    if finer == 1 {
        return (first, work);
    }
    let mut color = first.clone();
    let share = 1.0 / (finer * finer) as f32;
    let finer_work = all(&mut color, &|[x, y], paths, band| {
        let xs = x.saturating_sub(1)..(x + 2).min(width);
        let mut near = (y.saturating_sub(1)..(y + 2).min(height))
            .flat_map(|y| xs.clone().map(move |x| y * width + x));
        let own = first[y * width + x];
        if near.any(|i| differ(first[i], own)) {
            let to = y % SQUARE * width + x;
            band[to] = own.map(|c| c * share);
            for i in 1..finer * finer {
                let place = [x * finer + i % finer, y * finer + i / finer];
                paths.add(place, (to, share), band);
            }
        }
    });
    (color, work + finer_work)
}

/// What is done for a pixel: with its place in the picture, and the band of rows that it is in.
type Each<'a> = dyn Fn([usize; 2], &mut Paths<'_>, &mut [[f32; 4]]) + Sync + 'a;

/// Pixels along the edge of the squares that are gone through one after the other, so that what rays come by
/// stays in cache.
const SQUARE: usize = 32;

/// The pixels of a picture from row `first` on, in squares side by side.
fn in_squares([width, height]: [usize; 2], first: usize) -> impl Iterator<Item = (usize, usize)> {
    let rows = first..(first + SQUARE).min(height);
    (0..width).step_by(SQUARE).flat_map(move |left| {
        let columns = left..(left + SQUARE).min(width);
        rows.clone().flat_map(move |y| columns.clone().map(move |x| (x, y)))
    })
}

impl Paths<'_> {
    /// Adds the light of the pixel (x, y) of the surfaces' view, `share` of it, to pixel number `to` of a row.
    fn add(&mut self, place: [usize; 2], (to, share): (usize, f32), row: &mut [[f32; 4]]) {
        let surfaces = self.surfaces;
        let [x, y] = place;
        let (origin, direction) = surfaces.view.rays.ray(x as f32 + 0.5, y as f32 + 0.5);
        let spread = surfaces.view.rays.pixel;
        let index = y * surfaces.view.size.0 as usize + x;
        let stop = f32::INFINITY;
        let mut pixel =
            Pixel { index, place, origin, direction, spread, stop, to: to as u32, share };
        if self.around.beyond.is_amid() {
            let met = self.around.beyond.distance(&pixel.sight());
            pixel.stop = met.unwrap_or(stop) * direction.dot(surfaces.view.rays.forward);
        }
        let first = match self.media {
            [_] => surfaces.of(index).next().map(|first| (0, first)),
            _ => self.first(index),
        };
        let depth = first.map_or(stop, |(m, first)| self.media[m].medium.surfaces.depth(first));
        let light = match (first, self.optics.mode) {
            (None, _) => self.nothing(&pixel),
            // What stands before the liquid.
            _ if pixel.stop <= depth => {
                self.look(&pixel, pixel.sight(), Vec3::ONE);
                Vec4::W
            }
            (Some(first), Mode::Front) => self.front(&pixel, first),
            (_, Mode::Translucent) if self.media.len() > 1 => self.translucent_media(&pixel),
            (_, Mode::Translucent) => {
                self.waiting.push(pixel);
                Vec4::ZERO
            }
            (Some(first), Mode::Refractive) if self.media.len() > 1 => {
                self.refractive_media(&pixel, first)
            }
            (_, Mode::Refractive) => self.pixel(&pixel),
        };
        row[to] = (Vec4::from_array(row[to]) + light * share).to_array();
        if self.paths.len() >= MANY {
            self.follow_all();
        }
        if self.waiting.len() + self.later.sights.len() >= TOGETHER {
            self.settle(row);
        }
    }

    fn settle(&mut self, row: &mut [[f32; 4]]) {
        self.translucent(row);
        self.later.settle(self.around, row);
    }

    /// Adds to a row what is still to be looked up.
    fn finish(&mut self, row: &mut [[f32; 4]]) -> Work {
        self.follow_all();
        self.settle(row);
        self.work
    }
}

/// Whether two colours differ to the eye, whose scale is nearly that of square roots.
fn differ(a: [f32; 4], b: [f32; 4]) -> bool {
    const SEEN: f32 = 0.03;
    (0..4).any(|i| (a[i].clamp(0.0, 1.0).sqrt() - b[i].clamp(0.0, 1.0).sqrt()).abs() > SEEN)
}

/// A pixel and its ray.
pub(crate) struct Pixel {
    pub index: usize,
    pub place: [usize; 2],
    pub origin: Vec3,
    pub direction: Vec3,
    /// Size of a pixel: at distance 1 in perspective, which serves for orthographic projection, too.
    pub spread: f32,
    /// Depth of what stands before the liquid or in it.
    pub stop: f32,
    /// Where in its row its light goes, and what share of it.
    pub to: u32,
    pub share: f32,
}

impl Pixel {
    /// The ray through the pixel's centre.
    pub fn sight(&self) -> Sight {
        let Self { origin, direction, spread, .. } = *self;
        Sight { origin, direction, reach: f32::INFINITY, width: 0.0, spread }
    }
}

impl Paths<'_> {
    /// Of what a ray meets outside, `part` goes to a pixel.
    pub(crate) fn look(&mut self, pixel: &Pixel, sight: Sight, part: Vec3) {
        self.later.add(sight, (pixel.to, part * pixel.share));
    }

    fn nothing(&mut self, pixel: &Pixel) -> Vec4 {
        if !self.around.shown && pixel.stop == f32::INFINITY {
            // The floor is not the background.
            return Vec4::ZERO;
        }
        self.look(pixel, pixel.sight(), Vec3::ONE);
        Vec4::W
    }

    fn front(&self, pixel: &Pixel, (m, first): (usize, usize)) -> Vec4 {
        let color = self.around.color_at(self.media[m].medium.surfaces, (pixel.place, first));
        (color * self.falling((m, first), pixel)).extend(1.0)
    }
}

/// The part of the key light that falls onto a surface.
pub(crate) fn key_on(
    surfaces: &Surfaces,
    (pixel, surface): (&Pixel, usize),
    around: &Around<'_>,
) -> f32 {
    let normal = surfaces.normal(surface);
    let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
    let point = surfaces.view.point([x, y], surfaces.nearness[surface]);
    let cos = normal.dot(around.lights.key.seen_from(point).direction).max(0.0);
    match around.shadow {
        Some(shadow) if cos > 0.0 => cos * shadow.reached(point, normal),
        _ => cos,
    }
}
