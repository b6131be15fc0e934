//! Media: several liquids, such as oil on water, with boundaries between them.
//!
//! Zirr & Dachsbacher 2015, §6, name particles of different types as future work. Here each liquid has surfaces of
//! its own. As the balls of neighbours overlap, so do liquids: there the first of them counts, and a boundary is where
//! the first liquid that a ray is in changes (nested dielectrics with priorities, Schmidt & Budge 2002). Other
//! surfaces are passed straight on.

use glam::{Vec3, Vec4};
use motes_scene::{Sight, optics};

use crate::Surfaces;
use crate::blocks::Blocks;
use crate::march::{Hit, Ray, march, march_blocks};
use crate::refract::{FAINT, PART, Paths};
use crate::shade::{Pixel, Work, key_on};

/// Most media of a picture.
pub const MOST_MEDIA: usize = 8;
/// Most surfaces that a path comes by.
const MOST_SURFACES: u32 = 64;

/// A liquid, alone or among others.
#[derive(Clone, Copy, Debug)]
pub struct Medium<'a> {
    /// Its surfaces; the views of all are the same.
    pub surfaces: &'a Surfaces,
    /// Index of refraction over that of what is around.
    pub ior: f32,
}

/// A medium and what its rays skip.
pub(crate) struct Passage<'a> {
    pub medium: Medium<'a>,
    pub blocks: Option<Blocks>,
}

impl Passage<'_> {
    /// What a ray meets first, and the number of columns it went through.
    fn march(&self, ray: &Ray) -> (Option<Hit>, u32) {
        match &self.blocks {
            Some(blocks) => march_blocks((self.medium.surfaces, blocks), ray),
            None => march(self.medium.surfaces, ray),
        }
    }
}

/// The media that something is in: bit m for medium m.
#[derive(Clone, Copy, Default, PartialEq)]
struct Within(u32);

impl Within {
    /// The one that counts.
    fn first(self) -> Option<usize> {
        (self.0 != 0).then(|| self.0.trailing_zeros() as usize)
    }

    fn holds(self, medium: usize) -> bool {
        self.0 >> medium & 1 == 1
    }

    /// On the other side of a surface of a medium.
    fn across(self, medium: usize) -> Self {
        Self(self.0 ^ 1 << medium)
    }
}

/// A path of light.
#[derive(Clone, Copy)]
struct Path {
    origin: Vec3,
    direction: Vec3,
    within: Within,
    /// The medium and surface that it starts from.
    from: Option<(usize, usize)>,
    /// What each medium takes of it per unit of length.
    absorption: [Vec3; MOST_MEDIA],
}

impl Paths<'_> {
    /// The surface of all media that a pixel sees first.
    pub(crate) fn first(&self, pixel: usize) -> Option<(usize, usize)> {
        let of = |(m, p): (usize, &Passage<'_>)| {
            let first = p.medium.surfaces.of(pixel).next()?;
            Some((m, first, p.medium.surfaces.nearness[first]))
        };
        let all = self.media.iter().enumerate().filter_map(of);
        let nearest = all.reduce(|a, b| if b.2 > a.2 { b } else { a });
        nearest.map(|(m, surface, _)| (m, surface))
    }

    /// A pixel of several translucent liquids.
    pub(crate) fn translucent_media(&mut self, pixel: &Pixel) -> Vec4 {
        let Self { media, optics, around, .. } = *self;
        let view = &media[0].medium.surfaces.view;
        let per_depth = 1.0 / pixel.direction.dot(view.rays.forward);
        let extinction = optics.absorption + optics.scattering;
        let albedo = optics.scattering / extinction.max(Vec3::splat(f32::MIN_POSITIVE));
        let mut ends: Vec<(f32, usize, usize)> = Vec::new();
        for (m, passage) in media.iter().enumerate() {
            let surfaces = passage.medium.surfaces;
            ends.extend(surfaces.of(pixel.index).map(|i| (surfaces.depth(i), m, i)));
        }
        ends.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let (mut within, mut light, mut left) = (Within::default(), Vec3::ZERO, Vec3::ONE);
        let mut scattered = [Vec3::ZERO; MOST_MEDIA];
        let mut before = view.near;
        for (depth, m, surface) in ends {
            let surfaces = media[m].medium.surfaces;
            let depth = depth.min(pixel.stop);
            if let Some(first) = within.first() {
                let last = first == m && surface + 1 == surfaces.of(pixel.index).end;
                let empty = if last { surfaces.empty(pixel.index) } else { 0.0 };
                let length = (depth - before - empty).max(0.0) * per_depth;
                let through = optics::transmitted(extinction, length);
                light += left * (Vec3::ONE - through) * scattered[first];
                left *= through;
            }
            before = depth;
            within = within.across(m);
            if within.holds(m) {
                let color = around.color_of(surfaces, surface);
                scattered[m] = albedo * color * self.falling((m, surface), pixel);
            }
        }
        let mut thrown = 0.0;
        if let Some((m, first)) =
            self.first(pixel.index).filter(|(m, i)| media[*m].medium.surfaces.depth(*i) > view.near)
        {
            let Medium { surfaces, ior } = media[m].medium;
            let split = optics::split(pixel.direction, surfaces.normal(first), 1.0 / ior);
            thrown = split.reflectance;
            let origin = self.point((m, first), pixel);
            let sight = Sight { origin, direction: split.reflected, ..pixel.sight() };
            self.look(pixel, sight, Vec3::splat(thrown));
        }
        let through = left * (1.0 - thrown);
        let mut alpha = 1.0;
        if around.shown || pixel.stop < f32::INFINITY {
            self.look(pixel, pixel.sight(), through);
        } else {
            alpha = 1.0 - through.element_sum() / 3.0;
        }
        (light * (1.0 - thrown)).extend(alpha)
    }

    /// The light that falls onto a surface.
    pub(crate) fn falling(&self, (m, surface): (usize, usize), pixel: &Pixel) -> Vec3 {
        let (around, surfaces) = (self.around, self.media[m].medium.surfaces);
        let key = key_on(surfaces, (pixel, surface), around);
        let open = around.occlusion.map_or(1.0, |o| o.open(surfaces, (pixel.place, surface)));
        let lights = around.lights;
        lights.key.color * key + lights.fill(surfaces.normal(surface)) * open + lights.ambient
    }

    fn point(&self, (m, surface): (usize, usize), pixel: &Pixel) -> Vec3 {
        let surfaces = self.media[m].medium.surfaces;
        let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
        surfaces.view.point([x, y], surfaces.nearness[surface])
    }

    /// A pixel of several refractive liquids, of which it sees a surface `first`.
    pub(crate) fn refractive_media(&mut self, pixel: &Pixel, first: (usize, usize)) -> Vec4 {
        let media = self.media;
        let (m, surface) = first;
        let Medium { surfaces, ior } = media[m].medium;
        let near = surfaces.view.near;
        let eye_in = |(m, p): (usize, &Passage<'_>)| {
            let surfaces = p.medium.surfaces;
            let starts = surfaces.of(pixel.index).next().map(|first| surfaces.depth(first));
            u32::from(starts.is_some_and(|depth| depth <= near)) << m
        };
        let within = Within(media.iter().enumerate().map(eye_in).sum());
        let absorption = std::array::from_fn(|m| {
            let first = media.get(m).and_then(|p| p.medium.surfaces.of(pixel.index).next());
            first.map_or(Vec3::ZERO, |first| self.color_in(m, first))
        });
        let origin = self.point(first, pixel);
        let path =
            Path { origin, direction: pixel.direction, within, from: Some(first), absorption };
        if within.first().is_some() {
            // The eye is in the liquid.
            self.follow_media(path, 1.0, pixel);
            return Vec4::W;
        }
        let split = optics::split(pixel.direction, surfaces.normal(surface), 1.0 / ior);
        let reflected = Path { direction: split.reflected, ..path };
        if split.reflectance < FAINT {
            self.glance(pixel, (origin, split.reflected), split.reflectance);
        } else {
            self.follow_media(reflected, split.reflectance, pixel);
        }
        if let Some(direction) = split.refracted {
            let path = Path { direction, within: within.across(m), ..path };
            self.follow_media(path, 1.0 - split.reflectance, pixel);
        }
        Vec4::W
    }

    /// What a ray meets first of a medium.
    pub(crate) fn march(&mut self, medium: usize, ray: &Ray) -> Option<Hit> {
        let (hit, columns) = self.media[medium].march(ray);
        self.work = self.work + Work { rays: 1, columns: columns.into() };
        hit
    }

    /// What a path meets first: the medium and the surface.
    fn march_media(&mut self, path: &Path) -> Option<(usize, Hit)> {
        let mut nearest: Option<(usize, Hit)> = None;
        for m in 0..self.media.len() {
            let ray = Ray {
                origin: path.origin,
                direction: path.direction,
                inside: path.within.holds(m),
                from: path.from.filter(|from| from.0 == m).map(|from| from.1),
            };
            let hit = self.march(m, &ray);
            let nearer = |h: &Hit| nearest.is_none_or(|(_, n)| h.distance < n.distance);
            if let Some(hit) = hit.filter(nearer) {
                nearest = Some((m, hit));
            }
        }
        nearest
    }

    /// The light along a path, which is a `part` of a pixel's.
    fn follow_media(&mut self, mut path: Path, part: f32, pixel: &Pixel) {
        let media = self.media;
        let ior = |within: Within| within.first().map_or(1.0, |m| media[m].medium.ior);
        let mut weight = Vec3::splat(part);
        let (mut width, mut spread, mut boundary) = (0.0, PART, 0);
        for passed in 0..=MOST_SURFACES {
            let hit = self.march_media(&path);
            let reach = hit.map_or(f32::INFINITY, |(_, h)| h.distance);
            let Path { origin, direction, within, .. } = path;
            let sight = Sight { origin, direction, reach, width, spread };
            let met = self.around.beyond.distance(&sight);
            let absorption = within.first().map_or(Vec3::ZERO, |m| path.absorption[m]);
            let Some((m, hit)) = hit.filter(|_| met.is_none() && passed < MOST_SURFACES) else {
                // Where the picture ends, the liquid does.
                let length = met.unwrap_or(0.0);
                self.look(pixel, sight, weight * optics::transmitted(absorption, length));
                return;
            };
            weight *= optics::transmitted(absorption, hit.distance);
            width += spread * hit.distance;
            let behind = within.across(m);
            if behind.holds(m) {
                path.absorption[m] = self.color_in(m, hit.surface);
            }
            (path.origin, path.from) = (hit.point, Some((m, hit.surface)));
            if behind.first() == within.first() {
                path.within = behind;
                continue;
            }
            spread += PART;
            let split = optics::split(direction, hit.normal, ior(within) / ior(behind));
            let leaving = Sight { origin: hit.point, width, spread, ..sight };
            if boundary == self.optics.depth {
                let direction = split.refracted.unwrap_or(direction);
                self.look(pixel, Sight { direction, ..leaving }, weight);
                return;
            }
            boundary += 1;
            let (through, thrown) = (split.refracted, split.reflectance);
            let other = match through.filter(|_| thrown < 0.5) {
                Some(direction) => {
                    (path.direction, path.within) = (direction, behind);
                    (Some(split.reflected), within, thrown)
                }
                None => {
                    path.direction = split.reflected;
                    (through, behind, 1.0 - thrown)
                }
            };
            // The other way, if it is outside and this one is not.
            if let (Some(direction), Within(0), part) = other
                && path.within != Within(0)
            {
                self.look(pixel, Sight { direction, ..leaving }, weight * part);
                weight *= 1.0 - part;
            }
        }
    }
}
