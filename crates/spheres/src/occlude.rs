//! How much of the key light and of the fill reaches a surface: shadow and occlusion rays.
//!
//! Gribble et al. 2007, §4.3, "Soft Shadows": rays from the hits of a packet to samples of an area
//! light, in packets of their own. The rays of one packet aim at the same part of the light, each at
//! its own point of it; all are any-hit. Ambient occlusion does the same with the whole sphere of
//! directions cut into as many parts of equal area as there are rays, of which those above the surface
//! count with the cosine.

use fearless_simd::Simd;
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::{KeyLight, Lights};

use crate::packet::{MOST_RAYS, Packet};
use crate::traverse::{Counts, Spheres, trace};

/// A point of a surface and the random numbers that are its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub position: Vec3,
    /// Unit normal, towards the viewer.
    pub normal: Vec3,
    /// How far from the surface rays start, so as not to meet it again by rounding.
    pub lift: f32,
    /// Which of the `of` samples of its pixel it belongs to, and a hash of the pixel.
    pub sample: u32,
    pub of: u32,
    pub seed: u32,
}

/// What reaches a point, as parts of what would reach it in the open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reaching {
    /// Mean of visible · max(0, cosine) over the key light.
    pub key: f32,
    /// Part of the cosine-weighted sky that is open.
    pub fill: f32,
}

/// Traces the shadow and occlusion rays of up to [`MOST_RAYS`] points.
#[simd]
pub(crate) fn reaching<S: Simd>(
    simd: S,
    points: &[Point],
    lights: &Lights,
    systems: &[Spheres<'_>],
    counts: &mut Counts,
) -> Vec<Reaching> {
    let mut all: Vec<Reaching> =
        points.iter().map(|p| Reaching { key: open_key(&lights.key, p), fill: 1.0 }).collect();
    let mut sums = vec![(0.0f32, 0.0f32); points.len()];
    let mut rays = Rays::new();

    let count = lights.key.shadow_rays;
    for ray in 0..count {
        let aim = |p: &Point| Some(key_direction(&lights.key, p, (ray, count)));
        rays.gather(points, aim, f32::INFINITY);
        trace(simd, &mut rays.packet, systems, counts);
        rays.scatter(&mut sums);
    }
    if count > 0 {
        for (reaching, sum) in all.iter_mut().zip(&mut sums) {
            reaching.key = sum.0 / count as f32;
            *sum = (0.0, 0.0);
        }
    }

    for ray in 0..lights.occlusion_rays {
        let aim = |p: &Point| Some(fill_direction(p, (ray, lights.occlusion_rays)));
        rays.gather(points, aim, lights.occlusion_radius);
        trace(simd, &mut rays.packet, systems, counts);
        rays.scatter(&mut sums);
    }
    if lights.occlusion_rays > 0 {
        for (reaching, sum) in all.iter_mut().zip(&sums) {
            // No direction above the surface says nothing: open.
            reaching.fill = if sum.1 > 0.0 { sum.0 / sum.1 } else { 1.0 };
        }
    }
    all
}

/// A packet of secondary rays, and whose they are.
struct Rays {
    packet: Box<Packet>,
    owner: [u16; MOST_RAYS],
    cosine: [f32; MOST_RAYS],
}

impl Rays {
    fn new() -> Self {
        let packet = Box::new(Packet::new());
        Self { packet, owner: [0; MOST_RAYS], cosine: [0.0; MOST_RAYS] }
    }

    /// Starts a ray at every point whose direction lies above its surface.
    fn gather(&mut self, points: &[Point], aim: impl Fn(&Point) -> Option<Vec3>, reach: f32) {
        self.packet.clear_for_any_hit();
        for (i, point) in points.iter().enumerate() {
            let Some(direction) = aim(point) else { continue };
            let cosine = direction.dot(point.normal);
            if cosine > 0.0 {
                let ray = self.packet.len();
                self.owner[ray] = i as u16;
                self.cosine[ray] = cosine;
                let origin = point.position + point.normal * point.lift;
                self.packet.push_within(origin, direction, reach);
            }
        }
    }

    /// Adds (visible · cosine, cosine) to the sums of the rays' owners.
    fn scatter(&self, sums: &mut [(f32, f32)]) {
        for ray in 0..self.packet.len() {
            let (owner, cosine) = (self.owner[ray] as usize, self.cosine[ray]);
            sums[owner].0 += if self.packet.is_blocked(ray) { 0.0 } else { cosine };
            sums[owner].1 += cosine;
        }
    }
}

/// The key light on a point in the open.
fn open_key(key: &KeyLight, point: &Point) -> f32 {
    let sin_half_angle = (1.0 - key.cos_half_angle * key.cos_half_angle).max(0.0).sqrt();
    lit(point.normal.dot(key.direction), sin_half_angle)
}

/// The part of a round light's strength that falls on a surface at cosine `cosine` from its middle.
///
/// While the whole light is above the horizon this is the cosine; while it sets, over ±sin α of the
/// cosine, the quadratic that meets the cosine above and zero below with equal slopes.
fn lit(cosine: f32, sin_half_angle: f32) -> f32 {
    if cosine >= sin_half_angle {
        cosine
    } else if cosine <= -sin_half_angle {
        0.0
    } else {
        (cosine + sin_half_angle).powi(2) / (4.0 * sin_half_angle)
    }
}

/// Ray `ray` of `rays` towards the key light: all rays of a pixel together cut its disc into parts of
/// equal area along a Fibonacci spiral, which each pixel turns its own way.
fn key_direction(key: &KeyLight, point: &Point, (ray, rays): (u32, u32)) -> Vec3 {
    let (place, places) = (ray * point.of + point.sample, rays * point.of);
    let u = (place as f32 + unit(hash(point.seed ^ place))) / places as f32;
    let turn = place as f32 * GOLDEN_TURN + unit(hash(point.seed));
    around(key.direction, 1.0 - u * (1.0 - key.cos_half_angle), turn)
}

/// Ray `ray` of `rays` of the fill: all rays of a pixel together cut the sphere into parts of equal
/// area along a Fibonacci spiral, the same for every pixel; within the part each has its own place.
fn fill_direction(point: &Point, (ray, rays): (u32, u32)) -> Vec3 {
    let (place, places) = (ray * point.of + point.sample, rays * point.of);
    let random = hash(point.seed ^ place.wrapping_mul(0x9e37_79b9));
    let z = 1.0 - 2.0 * (place as f32 + 0.5) / places as f32;
    let middle = around(Vec3::Z, z, place as f32 * GOLDEN_TURN);
    // A cap as large as the part.
    let cos_cap = 1.0 - 2.0 / places as f32;
    around(middle, 1.0 - unit(random) * (1.0 - cos_cap), unit(hash(random)))
}

/// The golden angle, in turns.
const GOLDEN_TURN: f32 = 0.381_966;

/// The unit vector at cosine `cosine` from `axis`, `turn` turns around it.
fn around(axis: Vec3, cosine: f32, turn: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (a, b) = axis.any_orthonormal_pair();
    let (sin, cos) = (turn.fract() * std::f32::consts::TAU).sin_cos();
    axis * cosine + (a * cos + b * sin) * sine
}

/// A hash whose every bit depends on every bit of `x` (C. Wellons, "lowbias32").
pub(crate) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A number in 0..1 from the upper bits of a hash.
fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 / (1 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_sets_smoothly() {
        let s = 0.2;
        assert_eq!(lit(1.0, s), 1.0);
        assert_eq!(lit(-0.3, s), 0.0);
        assert!((lit(0.2 - 1e-6, s) - 0.2).abs() < 1e-5);
        assert!((lit(0.0, s) - 0.05).abs() < 1e-7);
        assert_eq!(lit(0.3, 0.0), 0.3);
        assert_eq!(lit(-0.3, 0.0), 0.0);
    }

    fn point(sample: u32, seed: u32) -> Point {
        Point { position: Vec3::ZERO, normal: Vec3::Z, lift: 0.0, sample, of: 4, seed }
    }

    #[test]
    fn fill_directions_cover_the_sphere_evenly() {
        // The mean of max(0, n·d) over the sphere is 1/4, of d itself zero.
        let all: Vec<Vec3> = (0..4)
            .flat_map(|sample| (0..16).map(move |ray| fill_direction(&point(sample, 7), (ray, 16))))
            .collect();
        let mean = all.iter().sum::<Vec3>() / 64.0;
        assert!(mean.length() < 0.05, "{mean}");
        for normal in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize()] {
            let cosine = all.iter().map(|d| d.dot(normal).max(0.0)).sum::<f32>() / 64.0;
            assert!((cosine - 0.25).abs() < 0.02, "{normal}: {cosine}");
        }
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn key_directions_stay_within_the_light_and_fill_it() {
        let key = KeyLight {
            direction: Vec3::new(0.6, 0.0, 0.8),
            color: Vec3::ONE,
            cos_half_angle: 0.9,
            shadow_rays: 16,
        };
        let all: Vec<Vec3> = (0..4)
            .flat_map(|s| (0..16).map(move |ray| key_direction(&key, &point(s, 9), (ray, 16))))
            .collect();
        assert!(all.iter().all(|d| d.dot(key.direction) > 0.9 - 1e-5));
        let mean = all.iter().map(|d| d.dot(key.direction)).sum::<f32>() / 64.0;
        assert!((mean - 0.95).abs() < 0.005, "{mean}");
    }
}
