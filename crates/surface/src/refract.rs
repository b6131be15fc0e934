//! Refractive: light followed through the liquid.
//!
//! Zirr & Dachsbacher 2015, §3.5: two full paths per pixel, one that is reflected at the first surface and one
//! that is refracted. Each goes on from every boundary the way most of the light goes (Snell, Fresnel, total
//! internal reflection), up to a number of boundaries. What goes the other way is seen without further
//! boundaries if it leaves the liquid, and else goes with the rest.

use std::mem::take;

use glam::{Vec3, Vec4};
use motes_scene::{Sight, optics};

use crate::Surfaces;
use crate::march::{Hit, Ray, march};
use crate::media::{Medium, Passage};
use crate::packet::march_together;
use crate::shade::{Around, Later, Optics, Pixel, Work};

/// How much wider cones of neighbouring paths become at a boundary, per unit of length.
pub(crate) const PART: f32 = 0.02;

/// Paths that are less than this part of a pixel's light meet nothing but the surroundings.
pub(crate) const FAINT: f32 = 0.03;

/// Paths that are followed together.
pub(crate) const MANY: usize = 1 << 12;

/// What paths go through, for one thread.
pub(crate) struct Paths<'a> {
    /// All media; there is one at least.
    pub media: &'a [Passage<'a>],
    /// Those of the first of them.
    pub surfaces: &'a Surfaces,
    pub ior: f32,
    pub optics: &'a Optics,
    pub around: &'a Around<'a>,
    /// What was done so far.
    pub work: Work,
    /// What is looked up together.
    pub later: Later,
    /// Pixels of translucent liquid that are worked out together.
    pub waiting: Vec<Pixel>,
    /// Paths through refractive liquid that are followed together, the ray and what it meets of each.
    pub paths: Vec<Path>,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
}

/// A path of light.
#[derive(Clone, Copy)]
pub(crate) struct Path {
    /// Where in its row its light goes.
    to: u32,
    /// What part of it.
    weight: Vec3,
    /// What the liquid that it is in takes of it.
    absorption: Vec3,
    /// Of its cone.
    width: f32,
    spread: f32,
}

impl<'a> Paths<'a> {
    pub fn new(media: &'a [Passage<'a>], (optics, around): (&'a Optics, &'a Around<'a>)) -> Self {
        let Medium { surfaces, ior } = media[0].medium;
        Self {
            media,
            surfaces,
            ior,
            optics,
            around,
            work: Work::default(),
            later: Later::default(),
            waiting: Vec::new(),
            paths: Vec::new(),
            rays: Vec::new(),
            hits: Vec::new(),
        }
    }

    /// Follows the light of a pixel whose column holds a surface; gives what is not looked up later.
    pub fn pixel(&mut self, pixel: &Pixel) -> Vec4 {
        let surfaces = self.surfaces;
        let first = surfaces.of(pixel.index).start;
        let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
        let point = surfaces.view.point([x, y], surfaces.nearness[first]);
        let before = Sight { reach: point.distance(pixel.origin), ..pixel.sight() };
        if !self.around.beyond.is_amid() && self.around.beyond.distance(&before).is_some() {
            // The floor.
            self.look(pixel, before, Vec3::ONE);
            return Vec4::W;
        }
        let ray =
            Ray { origin: point, direction: pixel.direction, inside: true, from: Some(first) };
        let tint = self.color(first);
        if surfaces.depth(first) <= surfaces.view.near {
            // The eye is in the liquid.
            self.follow(ray, (tint, 1.0), pixel);
            return Vec4::W;
        }
        let split = optics::split(pixel.direction, surfaces.normal(first), 1.0 / self.ior);
        if split.reflectance > 0.0 {
            let reflected = Ray { direction: split.reflected, inside: false, ..ray };
            self.follow_part(reflected, (tint, split.reflectance), pixel);
        }
        if let Some(direction) = split.refracted {
            let part = 1.0 - split.reflectance;
            self.follow_part(Ray { direction, ..ray }, (tint, part), pixel);
        }
        Vec4::W
    }

    /// What the liquid takes per unit of length behind a surface: of coloured liquid, more of other colours.
    fn color(&self, surface: usize) -> Vec3 {
        self.color_in(0, surface)
    }

    /// The same of a medium.
    pub fn color_in(&self, medium: usize, surface: usize) -> Vec3 {
        match self.around.own_color(self.media[medium].medium.surfaces, surface) {
            None => self.optics.absorption,
            Some(color) => {
                let mean = self.optics.absorption.element_sum() / 3.0;
                -color.clamp(Vec3::splat(0.02), Vec3::ONE).map(f32::ln) * mean
            }
        }
    }

    /// The light along a path that is a `part` of a pixel's: of a faint one, that of the surroundings.
    fn follow_part(&mut self, ray: Ray, (absorption, part): (Vec3, f32), pixel: &Pixel) {
        if part < FAINT && !ray.inside {
            self.glance(pixel, (ray.origin, ray.direction), part);
        } else {
            self.follow(ray, (absorption, part), pixel);
        }
    }

    /// The surroundings along a faint path, which is a `part` of a pixel's.
    pub fn glance(&mut self, pixel: &Pixel, (origin, direction): (Vec3, Vec3), part: f32) {
        let reach = f32::INFINITY;
        let sight = Sight { origin, direction, reach, width: 0.0, spread: PART };
        self.look(pixel, sight, Vec3::splat(part));
    }

    /// The light along a path, which is a `part` of a pixel's, is to be followed.
    fn follow(&mut self, ray: Ray, (absorption, part): (Vec3, f32), pixel: &Pixel) {
        let weight = Vec3::splat(part * pixel.share);
        // Neighbouring paths part at every boundary.
        self.rays.push(ray);
        self.paths.push(Path { to: pixel.to, weight, absorption, width: 0.0, spread: PART });
    }

    /// Follows all paths that wait, from boundary to boundary.
    pub fn follow_all(&mut self) {
        let (mut rays, mut paths) = (take(&mut self.rays), take(&mut self.paths));
        let mut hits = take(&mut self.hits);
        for boundary in 0..=self.optics.depth {
            self.march_all(&rays, &mut hits);
            let mut kept = 0;
            for i in 0..paths.len() {
                if let Some((path, ray)) = self.beyond((&paths[i], &rays[i]), hits[i], boundary) {
                    (paths[kept], rays[kept]) = (path, ray);
                    kept += 1;
                }
            }
            paths.truncate(kept);
            rays.truncate(kept);
        }
        (self.rays, self.paths, self.hits) = (rays, paths, hits);
    }

    /// How a path goes on at the boundary that it comes to, if it does.
    #[inline(always)]
    fn beyond(
        &mut self,
        (path, ray): (&Path, &Ray),
        hit: Option<Hit>,
        boundary: u32,
    ) -> Option<(Path, Ray)> {
        let Path { to, mut weight, mut absorption, mut width, mut spread } = *path;
        let reach = hit.map_or(f32::INFINITY, |h| h.distance);
        let Ray { origin, direction, .. } = *ray;
        let sight = Sight { origin, direction, reach, width, spread };
        let met = self.around.beyond.distance(&sight);
        let Some(hit) = hit.filter(|_| met.is_none()) else {
            // Where the picture ends, the liquid does.
            let length = met.filter(|_| ray.inside).unwrap_or(0.0);
            self.later.add(sight, (to, weight * optics::transmitted(absorption, length)));
            return None;
        };
        if ray.inside {
            weight *= optics::transmitted(absorption, hit.distance);
        }
        width += spread * hit.distance;
        spread += PART;
        let ior = self.ior;
        let eta = if ray.inside { ior } else { 1.0 / ior };
        let split = optics::split(ray.direction, hit.normal, eta);
        let leaving = Sight { origin: hit.point, width, spread, ..sight };
        if boundary == self.optics.depth {
            let direction = split.refracted.unwrap_or(ray.direction);
            self.later.add(Sight { direction, ..leaving }, (to, weight));
            return None;
        }
        let (through, thrown) = (split.refracted, split.reflectance);
        let goes_on = through.filter(|_| thrown < 0.5);
        let (direction, inside) = match goes_on {
            Some(direction) => (direction, !ray.inside),
            None => (split.reflected, ray.inside),
        };
        // The other way, if it is outside.
        let other = if goes_on.is_some() { Some(split.reflected) } else { through };
        if let Some(direction) = other.filter(|_| inside) {
            let part = if goes_on.is_some() { thrown } else { 1.0 - thrown };
            self.later.add(Sight { direction, ..leaving }, (to, weight * part));
            weight *= 1.0 - part;
        }
        if inside && !ray.inside {
            absorption = self.color(hit.surface);
        }
        let ray = Ray { origin: hit.point, direction, inside, from: Some(hit.surface) };
        Some((Path { to, weight, absorption, width, spread }, ray))
    }

    fn march_all(&mut self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        let Passage { medium, blocks } = &self.media[0];
        let columns = match blocks {
            Some(blocks) => march_together((medium.surfaces, blocks), rays, hits),
            None => {
                hits.clear();
                let mut columns = 0;
                for ray in rays {
                    let (hit, count) = march(medium.surfaces, ray);
                    hits.push(hit);
                    columns += u64::from(count);
                }
                columns
            }
        };
        self.work = self.work + Work { rays: rays.len() as u64, columns };
    }
}
