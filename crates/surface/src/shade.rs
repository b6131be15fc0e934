//! Shade: pictures from surfaces.
//!
//! Zirr & Dachsbacher 2015, §3.5: *front* reads the first surface of each column; *translucent* goes over
//! all spans of it and lets them absorb and scatter (their extended last ones, too, without what is empty in them);
//! *refractive* follows the light, see `refract.rs`.

use std::ops::Add;

use glam::{Vec3, Vec4};
use motes_scene::{Beyond, Lights, Sight, optics};
use rayon::prelude::*;

use crate::occlusion::Occlusion;
use crate::refract::Paths;
use crate::shadow::Shadow;
use crate::{Blocks, Spans, Surfaces};

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
    /// Index of refraction over that of what is around.
    pub ior: f32,
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
    /// Linear colour of the particle, by its place in the input.
    fn color(&self, particle: u32) -> Vec3;
}

/// What is around the liquid.
#[derive(Clone, Copy)]
pub struct Around<'a> {
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
        let particle = surfaces.particles.get(surface).filter(|p| **p != Spans::NO_PARTICLE);
        match (self.paint, particle) {
            (Some(paint), Some(particle)) => paint.color(*particle),
            _ => self.color,
        }
    }

    /// What comes from outside along a ray, in shadow where the liquid casts one.
    pub(crate) fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)> {
        let (light, distance) = self.beyond.meet(sight)?;
        let lit = match self.shadow.filter(|_| distance.is_finite()) {
            Some(shadow) => shadow.fill_and_key(sight.origin + sight.direction * distance),
            None => Vec3::ONE,
        };
        Some((light * lit, distance))
    }

    /// The light from the surroundings, wherever they are.
    pub(crate) fn background(&self, sight: &Sight) -> Vec3 {
        let whole = Sight { reach: f32::INFINITY, ..*sight };
        self.meet(&whole).map_or(Vec3::ZERO, |(light, _)| light)
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
pub fn shade(surfaces: &Surfaces, optics: &Optics, around: &Around<'_>) -> Vec<[f32; 4]> {
    shade_finer(surfaces, optics, around, 1).0
}

/// A picture of fewer pixels, and what was done for it: each is the mean of `finer`² of the surfaces', or, where
/// it differs little from all eight around it, the first of them.
pub fn shade_finer(
    surfaces: &Surfaces,
    optics: &Optics,
    around: &Around<'_>,
    finer: u32,
) -> (Vec<[f32; 4]>, Work) {
    let finer = finer.max(1) as usize;
    let [width, height] =
        [surfaces.view.size.0 as usize / finer, surfaces.view.size.1 as usize / finer];
    let blocks = (optics.mode == Mode::Refractive && optics.skip).then(|| Blocks::new(surfaces));
    let paths = || Paths::new(surfaces, (optics, around), blocks.as_ref());
    let mut first = vec![[0.0; 4]; width * height];
    let rows = first.par_chunks_mut(width.max(1)).enumerate().map(|(y, row)| {
        let paths = paths();
        for (x, color) in row.iter_mut().enumerate() {
            *color = color_of([x * finer, y * finer], &paths);
        }
        paths.work.get()
    });
    let work = rows.reduce(Work::default, Work::add);
    if finer == 1 {
        return (first, work);
    }
    let mut color = first.clone();
    let rows = color.par_chunks_mut(width.max(1)).enumerate().map(|(y, row)| {
        let paths = paths();
        for (x, color) in row.iter_mut().enumerate() {
            let xs = x.saturating_sub(1)..(x + 2).min(width);
            let mut near = (y.saturating_sub(1)..(y + 2).min(height))
                .flat_map(|y| xs.clone().map(move |x| y * width + x));
            if near.any(|i| differ(first[i], *color)) {
                *color = mean([x, y], (*color, finer), &paths);
            }
        }
        paths.work.get()
    });
    let finer_work = rows.reduce(Work::default, Work::add);
    (color, work + finer_work)
}

/// The mean of `finer`² pixels, of which the first has the colour `first`.
fn mean([x, y]: [usize; 2], (first, finer): ([f32; 4], usize), paths: &Paths<'_>) -> [f32; 4] {
    let mut sum = Vec4::from_array(first);
    for i in 1..finer * finer {
        let place = [x * finer + i % finer, y * finer + i / finer];
        sum += Vec4::from_array(color_of(place, paths));
    }
    (sum / (finer * finer) as f32).to_array()
}

/// Whether two colours differ to the eye, whose scale is nearly that of square roots.
fn differ(a: [f32; 4], b: [f32; 4]) -> bool {
    const SEEN: f32 = 0.03;
    (0..4).any(|i| (a[i].clamp(0.0, 1.0).sqrt() - b[i].clamp(0.0, 1.0).sqrt()).abs() > SEEN)
}

/// The colour of the pixel (x, y) of the surfaces' view.
fn color_of(place: [usize; 2], paths: &Paths<'_>) -> [f32; 4] {
    let Paths { surfaces, optics, around, .. } = *paths;
    let [x, y] = place;
    let (origin, direction) = surfaces.view.rays.ray(x as f32 + 0.5, y as f32 + 0.5);
    let spread = surfaces.view.rays.pixel;
    let index = y * surfaces.view.size.0 as usize + x;
    let pixel = Pixel { index, place, origin, direction, spread };
    match (surfaces.of(index).is_empty(), optics.mode) {
        (true, _) => nothing(&pixel, around),
        (_, Mode::Front) => front(surfaces, &pixel, around),
        (_, Mode::Translucent) => translucent(surfaces, &pixel, (optics, around)),
        (_, Mode::Refractive) => paths.pixel(&pixel),
    }
    .to_array()
}

/// A pixel and its ray.
pub(crate) struct Pixel {
    pub index: usize,
    pub place: [usize; 2],
    pub origin: Vec3,
    pub direction: Vec3,
    /// Size of a pixel: at distance 1 in perspective, which serves for orthographic projection, too.
    pub spread: f32,
}

impl Pixel {
    /// The ray through the pixel's centre.
    pub fn sight(&self) -> Sight {
        let Self { origin, direction, spread, .. } = *self;
        Sight { origin, direction, reach: f32::INFINITY, width: 0.0, spread }
    }
}

fn nothing(pixel: &Pixel, around: &Around<'_>) -> Vec4 {
    match around.shown {
        true => around.background(&pixel.sight()).extend(1.0),
        // The floor and other things are not the background.
        false => Vec4::ZERO,
    }
}

/// The light of a surface of colour `color`, as if it were opaque.
fn lit(surfaces: &Surfaces, (pixel, surface): (&Pixel, usize), around: &Around<'_>) -> Vec3 {
    let (normal, lights) = (surfaces.normal(surface), around.lights);
    let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
    let point = surfaces.view.point([x, y], surfaces.nearness[surface]);
    let key = lights.key.seen_from(point);
    let cos = normal.dot(key.direction).max(0.0);
    let reached = match around.shadow {
        Some(shadow) if cos > 0.0 => shadow.reached(point, normal),
        _ => 1.0,
    };
    let open = around.occlusion.map_or(1.0, |o| o.open(surfaces, (pixel.place, surface)));
    lights.key.color * (cos * reached) + lights.fill(normal) * open + lights.ambient
}

/// What the first surface mirrors, and how much of it.
fn mirrored(
    surfaces: &Surfaces,
    pixel: &Pixel,
    (optics, around): (&Optics, &Around<'_>),
) -> (Vec3, f32) {
    let first = surfaces.of(pixel.index).start;
    let normal = surfaces.normal(first);
    let split = optics::split(pixel.direction, normal, 1.0 / optics.ior);
    let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
    let point = surfaces.view.point([x, y], surfaces.nearness[first]);
    let sight = Sight { origin: point, direction: split.reflected, ..pixel.sight() };
    (around.background(&sight), split.reflectance)
}

fn front(surfaces: &Surfaces, pixel: &Pixel, around: &Around<'_>) -> Vec4 {
    let first = surfaces.of(pixel.index).start;
    let color = around.color_of(surfaces, first);
    (color * lit(surfaces, (pixel, first), around)).extend(1.0)
}

fn translucent(
    surfaces: &Surfaces,
    pixel: &Pixel,
    (optics, around): (&Optics, &Around<'_>),
) -> Vec4 {
    let of = surfaces.of(pixel.index);
    let per_depth = 1.0 / pixel.direction.dot(surfaces.view.rays.forward);
    let (mut light, mut left) = (Vec3::ZERO, Vec3::ONE);
    let first = of.start;
    let extinction = optics.absorption + optics.scattering;
    for entry in of.clone().step_by(2) {
        let mut length = surfaces.depth(entry + 1) - surfaces.depth(entry);
        if entry + 2 == of.end {
            length -= surfaces.empty(pixel.index);
        }
        let through = optics::transmitted(extinction, length.max(0.0) * per_depth);
        let albedo = optics.scattering / extinction.max(Vec3::splat(f32::MIN_POSITIVE));
        let color = around.color_of(surfaces, entry);
        let scattered = albedo * color * lit(surfaces, (pixel, entry), around);
        light += left * (Vec3::ONE - through) * scattered;
        left *= through;
    }
    let (mirror, reflectance) = mirrored(surfaces, pixel, (optics, around));
    // An eye inside sees no mirror.
    let reflectance = if surfaces.depth(first) > surfaces.view.near { reflectance } else { 0.0 };
    let mut color = light * (1.0 - reflectance) + mirror * reflectance;
    let mut alpha = 1.0;
    match around.shown {
        true => {
            let beyond = around.background(&pixel.sight());
            color += left * (1.0 - reflectance) * beyond;
        }
        false => alpha = 1.0 - left.element_sum() / 3.0 * (1.0 - reflectance),
    }
    color.extend(alpha)
}
