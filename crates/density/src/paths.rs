//! Paths of light through the liquid, all of a tile at once, boundary by boundary.
//!
//! Yasuda et al. 2009, §4.3: rays are cast, refracted and reflected up to a depth. What is reflected and what
//! is refracted at the first surface are followed both; from then on each path goes on the way most of the
//! light goes (Snell, Fresnel, total internal reflection), and what goes the other way is seen without
//! further boundaries if it leaves the liquid, and else goes with the rest.

use fearless_simd::{Level, dispatch};
use glam::{Vec3, Vec4};
use motes_scene::{Sight, optics};

use crate::field::Field;
use crate::march::{self, Hits, LANES, LIQUID, OUTSIDE, Rays};
use crate::normals::gradients;
use crate::shade::{Around, Optics};
use crate::space::Space;

/// How much wider cones of neighbouring paths become at a boundary, per unit of length.
const PART: f32 = 0.02;
/// Paths that are less than this part of a pixel's light meet nothing but the surroundings.
const FAINT: f32 = 0.03;

/// What paths go through.
#[derive(Clone, Copy)]
pub(crate) struct Caster<'a> {
    pub field: &'a Field,
    pub space: &'a Space,
    pub optics: &'a Optics,
    pub around: &'a Around<'a>,
    pub level: Level,
}

/// A path of light: what its ray is for.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Which sample.
    sample: u32,
    /// The part of its light.
    weight: Vec3,
    /// Width and growth of the cone of its neighbours, see [`Sight`].
    width: f32,
    spread: f32,
    /// What the liquid it is in takes, per unit of length.
    absorption: Vec3,
}

/// Paths and their rays.
#[derive(Default)]
struct Wave {
    rays: Rays,
    paths: Vec<Path>,
}

/// Memory of one thread.
#[derive(Default)]
pub(crate) struct Desk {
    now: Wave,
    next: Wave,
    hits: Hits,
    normals: [Vec<f32>; 3],
}

/// A boundary that a path meets.
struct Boundary {
    place: Vec3,
    normal: Vec3,
    surface: u32,
    inside: bool,
}

impl Wave {
    fn clear(&mut self) {
        self.rays.clear();
        self.paths.clear();
    }

    fn push(&mut self, path: Path, (origin, direction): (Vec3, Vec3), medium: u32) {
        self.rays.push(origin, direction, medium);
        self.paths.push(path);
    }
}

impl Caster<'_> {
    /// The light of rays from points of the world; `spread` is how much a pixel widens with distance.
    pub fn trace(
        &self,
        rays: impl Iterator<Item = (Vec3, Vec3)>,
        spread: f32,
        (light, desk): (&mut [Vec4], &mut Desk),
    ) {
        desk.now.clear();
        for (sample, (origin, direction)) in rays.enumerate() {
            let place = self.field.lattice.place(origin);
            let path = Path {
                sample: sample as u32,
                weight: Vec3::ONE,
                width: 0.0,
                spread,
                absorption: self.optics.absorption,
            };

            let wet = self.field.at(place) >= self.space.threshold;
            desk.now.push(path, (place, direction), if wet { LIQUID } else { OUTSIDE });
        }
        for boundary in 1..=self.optics.depth {
            if desk.now.paths.is_empty() {
                break;
            }
            let Desk { now, next, hits, normals } = &mut *desk;
            next.clear();
            dispatch!(self.level, simd => march::march(simd, (self.field, self.space), &mut now.rays, hits));
            self.find_normals(&now.rays, hits, normals);
            for ray in 0..now.paths.len() {
                self.go_on((now, ray), (hits, normals), boundary, (next, light));
            }
            std::mem::swap(&mut desk.now, &mut desk.next);
        }
    }

    /// Gradients where rays meet the field, of all rays.
    fn find_normals(&self, rays: &Rays, hits: &Hits, normals: &mut [Vec<f32>; 3]) {
        let count = rays.len();
        for a in 0..3 {
            normals[a].clear();
            let along = |ray: usize| {
                let t = hits.distance[ray];
                if t.is_finite() { rays.origin[a][ray] + rays.direction[a][ray] * t } else { 0.0 }
            };
            normals[a].extend((0..count).map(along));
            normals[a].resize(count.next_multiple_of(LANES), 0.0);
        }
        dispatch!(self.level, simd => gradients(simd, self.field, normals));
    }

    /// What becomes of a path.
    fn go_on(
        &self,
        (wave, ray): (&Wave, usize),
        (hits, normals): (&Hits, &[Vec<f32>; 3]),
        number: u32,
        (next, light): (&mut Wave, &mut [Vec4]),
    ) {
        let mut path = wave.paths[ray];
        let (origin, direction) = (wave.rays.origin(ray), wave.rays.direction(ray));
        let (medium, distance) = (wave.rays.medium[ray], hits.distance[ray]);
        let inside = medium != OUTSIDE;
        let length = distance * self.field.lattice.voxel;
        let to = &mut light[path.sample as usize];
        if number == 1 {
            to.w += 1.0;
        }
        let reach = if distance.is_finite() { length } else { f32::INFINITY };
        if let Some((seen, to_it)) =
            self.around.meet(&self.sight(&path, (origin, direction), reach))
        {
            let wet = if inside && to_it.is_finite() { to_it } else { 0.0 };
            let left = path.weight * optics::transmitted(path.absorption, wet);
            if number == 1 && distance == f32::INFINITY && !self.around.shown {
                to.w -= 1.0;
            } else {
                *to += (left * seen).extend(0.0);
            }
            return;
        }
        if distance == f32::INFINITY {
            return;
        }
        let place = origin + direction * distance;
        let surface = hits.surface[ray];
        let gradient = Vec3::new(normals[0][ray], normals[1][ray], normals[2][ray]);
        let out = match surface {
            LIQUID => -gradient,
            drop => place - self.space.drops.drops[drop as usize].center,
        };
        let normal = out.normalize_or(if inside { direction } else { -direction });
        if inside {
            path.weight *= optics::transmitted(path.absorption, length);
        }
        path.width += path.spread * length;
        path.spread += PART;
        let met = Boundary { place, normal, surface, inside };
        match number {
            1 if !inside && self.optics.depth > 1 => self.first(path, direction, &met, (next, to)),
            _ => self.split(path, direction, (&met, number), (next, to)),
        }
    }

    /// At the first surface both ways are followed.
    fn first(
        &self,
        path: Path,
        direction: Vec3,
        met: &Boundary,
        (next, to): (&mut Wave, &mut Vec4),
    ) {
        let split = optics::split(direction, met.normal, 1.0 / self.optics.ior);
        let tint = self.tint(met.place);
        if split.reflectance > 0.0 {
            let part = Path { weight: path.weight * split.reflectance, ..path };
            if split.reflectance < FAINT {
                *to += (part.weight * self.background(&part, (met.place, split.reflected)))
                    .extend(0.0);
            } else {
                next.push(part, (met.place, split.reflected), OUTSIDE);
            }
        }
        if let Some(through) = split.refracted {
            let weight = path.weight * (1.0 - split.reflectance);
            let part = Path { weight, absorption: tint, ..path };
            next.push(part, (met.place, through), met.surface);
        }
    }

    /// At any other, the way most of the light goes.
    fn split(
        &self,
        mut path: Path,
        direction: Vec3,
        (met, number): (&Boundary, u32),
        (next, to): (&mut Wave, &mut Vec4),
    ) {
        let ior = self.optics.ior;
        let (normal, eta) = if met.inside { (-met.normal, ior) } else { (met.normal, 1.0 / ior) };
        let split = optics::split(direction, normal, eta);
        if number == self.optics.depth {
            let on = split.refracted.unwrap_or(direction);
            *to += (path.weight * self.background(&path, (met.place, on))).extend(0.0);
            return;
        }
        let goes_on = split.refracted.filter(|_| split.reflectance < 0.5);
        let (onward, inside) = match goes_on {
            Some(through) => (through, !met.inside),
            None => (split.reflected, met.inside),
        };
        let other = if goes_on.is_some() { Some(split.reflected) } else { split.refracted };
        if let Some(other) = other.filter(|_| inside) {
            let part = if goes_on.is_some() { split.reflectance } else { 1.0 - split.reflectance };
            *to += (path.weight * part * self.background(&path, (met.place, other))).extend(0.0);
            path.weight *= 1.0 - part;
        }
        if inside && !met.inside {
            path.absorption = self.tint(met.place);
        }
        next.push(path, (met.place, onward), if inside { met.surface } else { OUTSIDE });
    }

    /// What a path sees up to a distance in world units.
    fn sight(&self, path: &Path, (place, direction): (Vec3, Vec3), reach: f32) -> Sight {
        let origin = self.field.lattice.point(place);
        Sight { origin, direction, reach, width: path.width, spread: path.spread }
    }

    /// The light from the surroundings, wherever they are.
    fn background(&self, path: &Path, ray: (Vec3, Vec3)) -> Vec3 {
        let seen = self.around.meet(&self.sight(path, ray, f32::INFINITY));
        seen.map_or(Vec3::ZERO, |(light, _)| light)
    }

    /// What the liquid takes per unit of length behind a place of its surface: of coloured liquid, more of
    /// other colours.
    fn tint(&self, place: Vec3) -> Vec3 {
        let Some(paint) = self.around.paint else { return self.optics.absorption };
        let color = paint.color(self.field.lattice.point(place));
        let mean = self.optics.absorption.element_sum() / 3.0;
        -color.clamp(Vec3::splat(0.02), Vec3::ONE).map(f32::ln) * mean
    }
}
