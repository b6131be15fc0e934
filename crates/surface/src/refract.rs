//! Refractive: light followed through the liquid.
//!
//! Zirr & Dachsbacher 2015, §3.5: two full paths per pixel, one that is reflected at the first surface and one
//! that is refracted. Each goes on from every boundary the way most of the light goes (Snell, Fresnel, total
//! internal reflection), up to a number of boundaries. What goes the other way is seen without further
//! boundaries if it leaves the liquid, and else goes with the rest.

use std::cell::Cell;

use glam::{Vec3, Vec4};
use motes_scene::{Sight, optics};

use crate::Surfaces;
use crate::blocks::Blocks;
use crate::march::{Hit, Ray, march, march_blocks};
use crate::shade::{Around, Optics, Pixel, Work};

/// How much wider cones of neighbouring paths become at a boundary, per unit of length.
const PART: f32 = 0.02;

/// Paths that are less than this part of a pixel's light meet nothing but the surroundings.
const FAINT: f32 = 0.03;

/// What paths go through, for one thread.
pub(crate) struct Paths<'a> {
    pub surfaces: &'a Surfaces,
    pub optics: &'a Optics,
    pub around: &'a Around<'a>,
    pub blocks: Option<&'a Blocks>,
    /// What was done so far.
    pub work: Cell<Work>,
}

impl<'a> Paths<'a> {
    pub fn new(
        surfaces: &'a Surfaces,
        (optics, around): (&'a Optics, &'a Around<'a>),
        blocks: Option<&'a Blocks>,
    ) -> Self {
        Self { surfaces, optics, around, blocks, work: Cell::default() }
    }

    /// The light of a pixel whose column holds a surface.
    pub fn pixel(&self, pixel: &Pixel) -> Vec4 {
        let first = self.surfaces.of(pixel.index).start;
        let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
        let point = self.surfaces.view.point([x, y], self.surfaces.nearness[first]);
        let to_eye = point.distance(pixel.origin);
        // What stands before the liquid.
        if let Some((light, _)) = self.around.meet(&Sight { reach: to_eye, ..pixel.sight() }) {
            return light.extend(1.0);
        }
        let ray =
            Ray { origin: point, direction: pixel.direction, inside: true, from: Some(first) };
        if self.surfaces.depth(first) <= self.surfaces.view.near {
            // The eye is in the liquid.
            return self.follow(ray, self.color(first)).extend(1.0);
        }
        let normal = self.surfaces.normal(first);
        let split = optics::split(pixel.direction, normal, 1.0 / self.optics.ior);
        let tint = self.color(first);
        let mut light = Vec3::ZERO;
        if split.reflectance > 0.0 {
            let reflected = Ray { direction: split.reflected, inside: false, ..ray };
            light += split.reflectance * self.follow_part(reflected, (tint, split.reflectance));
        }
        if let Some(direction) = split.refracted {
            let part = 1.0 - split.reflectance;
            light += part * self.follow_part(Ray { direction, ..ray }, (tint, part));
        }
        light.extend(1.0)
    }

    /// What the liquid takes per unit of length behind a surface: of coloured liquid, more of other colours.
    fn color(&self, surface: usize) -> Vec3 {
        match self.around.paint {
            None => self.optics.absorption,
            Some(_) => {
                let color = self.around.color_of(self.surfaces, surface);
                let mean = self.optics.absorption.element_sum() / 3.0;
                -color.clamp(Vec3::splat(0.02), Vec3::ONE).map(f32::ln) * mean
            }
        }
    }

    fn march(&self, ray: &Ray) -> Option<Hit> {
        let (hit, columns) = match self.blocks {
            Some(blocks) => march_blocks((self.surfaces, blocks), ray),
            None => march(self.surfaces, ray),
        };
        self.work.set(self.work.get() + Work { rays: 1, columns: columns.into() });
        hit
    }

    /// The light along a path that is a `part` of a pixel's: of a faint one, that of the surroundings.
    fn follow_part(&self, ray: Ray, (absorption, part): (Vec3, f32)) -> Vec3 {
        if part < FAINT && !ray.inside {
            let reach = f32::INFINITY;
            let Ray { origin, direction, .. } = ray;
            return self.around.background(&Sight {
                origin,
                direction,
                reach,
                width: 0.0,
                spread: PART,
            });
        }
        self.follow(ray, absorption)
    }

    /// The light along a path.
    fn follow(&self, mut ray: Ray, mut absorption: Vec3) -> Vec3 {
        let (mut light, mut weight) = (Vec3::ZERO, Vec3::ONE);
        // Neighbouring paths part at every boundary.
        let (mut width, mut spread) = (0.0, PART);
        let sight = |origin, direction, width, spread| Sight {
            origin,
            direction,
            reach: f32::INFINITY,
            width,
            spread,
        };
        for boundary in 0..=self.optics.depth {
            let hit = self.march(&ray);
            let reach = hit.map_or(f32::INFINITY, |h| h.distance);
            let met = self
                .around
                .meet(&Sight { reach, ..sight(ray.origin, ray.direction, width, spread) });
            let Some(hit) = hit.filter(|_| met.is_none()) else {
                let (seen, distance) = met.unwrap_or((Vec3::ZERO, 0.0));
                // Where the picture ends, the liquid does.
                let length = if ray.inside && distance.is_finite() { distance } else { 0.0 };
                return light + weight * optics::transmitted(absorption, length) * seen;
            };
            if ray.inside {
                weight *= optics::transmitted(absorption, hit.distance);
            }
            width += spread * hit.distance;
            spread += PART;
            let ior = self.optics.ior;
            let eta = if ray.inside { ior } else { 1.0 / ior };
            let split = optics::split(ray.direction, hit.normal, eta);
            if boundary == self.optics.depth {
                let on = split.refracted.unwrap_or(ray.direction);
                return light
                    + weight * self.around.background(&sight(hit.point, on, width, spread));
            }
            let (through, thrown) = (split.refracted, split.reflectance);
            let goes_on = through.filter(|_| thrown < 0.5);
            let (direction, inside) = match goes_on {
                Some(direction) => (direction, !ray.inside),
                None => (split.reflected, ray.inside),
            };
            // The other way, if it is outside.
            let other = if goes_on.is_some() { Some(split.reflected) } else { through };
            if let Some(other) = other.filter(|_| inside) {
                let part = if goes_on.is_some() { thrown } else { 1.0 - thrown };
                let seen = self.around.background(&sight(hit.point, other, width, spread));
                light += weight * part * seen;
                weight *= 1.0 - part;
            }
            if inside && !ray.inside {
                absorption = self.color(hit.surface);
            }
            ray = Ray { origin: hit.point, direction, inside, from: Some(hit.surface) };
        }
        light
    }
}
