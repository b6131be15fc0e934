//! How much of the key light and of the fill reaches a surface: shadow and occlusion rays.
//!
//! Gribble et al. 2007, §4.3, "Soft Shadows": rays from the hits of a packet to samples of an area
//! light, in packets of their own. The rays of one packet aim at the same part of the light, each at
//! its own point of it; all are any-hit. Ambient occlusion goes along directions that cut the sphere
//! into parts of equal area, of which those above the surface count with the cosine. All rays of a
//! packet share one direction, so that the packet stays as narrow as its points lie together however
//! far it goes; neighbouring pixels, two by two, have directions of their own.

use fearless_simd::Simd;
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::KeyLight;

use crate::packet::Packet;
use crate::render::View;
use crate::traverse::{Counts, trace};

/// A point of a surface and the random numbers that are its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub position: Vec3,
    /// Unit normal, towards the viewer.
    pub normal: Vec3,
    /// Distance from the eye.
    pub depth: f32,
    /// How far from the surface rays start, so as not to meet it again by rounding.
    pub lift: f32,
    /// Which of the `of` samples of its pixel it belongs to.
    pub sample: u32,
    pub of: u32,
    /// Place of its pixel in a square of two by two.
    pub quarter: u32,
    /// That square.
    pub square: (u32, u32),
    /// The sphere it lies on: system and index.
    pub sphere: (u16, u32),
    /// A hash of its pixel.
    pub seed: u32,
}

impl Point {
    /// What points have in common that share what they see.
    fn near(&self) -> impl Ord {
        (self.square, self.sample, self.sphere)
    }
}

/// What reaches a point, as parts of what would reach it in the open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reaching {
    /// Mean of visible · max(0, cosine) over the key light.
    pub key: f32,
    /// Part of the cosine-weighted sky that is open.
    pub fill: f32,
}

/// Traces the shadow and occlusion rays of the points of a tile.
///
/// Points that lie together in space and belong to the same sample make a packet: their rays go the
/// same way. Packets by pixels alone would tear at every depth discontinuity.
#[simd]
pub(crate) fn reaching<S: Simd>(
    simd: S,
    points: &[Point],
    view: View<'_>,
    counts: &mut Counts,
) -> Vec<Reaching> {
    let lights = view.lights;
    let (key_rays, fill_rays) = (lights.key.shadow_rays, lights.occlusion_rays);
    let open = |p: &Point| Reaching { key: open_key(&lights.key, p), fill: 1.0 };
    let mut all: Vec<Reaching> = points.iter().map(open).collect();
    if key_rays == 0 && fill_rays == 0 {
        return all;
    }
    let mut rays = Rays::new();
    // Sums of visible cosines and of all cosines, per point.
    let mut keys = vec![(0.0, 0.0); points.len()];
    let mut fills = vec![(0.0, 0.0); points.len()];
    let light = Cap::new(lights.key.direction, lights.key.cos_half_angle);
    for group in groups(points, view.rays) {
        // All points of a group belong to the same sample, in the same quarter.
        let Some(Point { sample, of, quarter, .. }) = group.first().map(|i| points[*i as usize])
        else {
            continue;
        };
        for ray in 0..key_rays {
            let place = (ray * of + sample, key_rays * of);
            rays.gather(points, &group, |p| key_direction(&light, p, place), f32::INFINITY);
            trace(simd, &mut rays.packet, view.systems, counts);
            rays.scatter(&group, &mut keys);
        }
        for ray in 0..fill_rays {
            let direction = fill_direction((ray * of + sample, fill_rays * of), quarter);
            rays.gather(points, &group, |_| direction, lights.occlusion_radius);
            trace(simd, &mut rays.packet, view.systems, counts);
            rays.scatter(&group, &mut fills);
        }
    }
    let together = together(points);
    if key_rays > 0 {
        for (i, visible) in shared(&together, points, &keys).into_iter().enumerate() {
            all[i].key = visible * keys[i].1 / key_rays as f32;
        }
    }
    if fill_rays > 0 {
        for (reaching, visible) in all.iter_mut().zip(shared(&together, points, &fills)) {
            reaching.fill = visible;
        }
    }
    all
}

/// The points in an order that puts those together whose light is alike: one sample of a square of two
/// by two pixels, on the same sphere. It depends on nothing but the points.
fn together(points: &[Point]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by_key(|i| {
        let p = &points[*i as usize];
        (p.near(), p.quarter)
    });
    order
}

/// The visible part, from sums of all points together: neighbours look in directions between each
/// other's, so that each point has those of four (interleaved sampling, Keller and Heidrich 2001).
fn shared(together: &[u32], points: &[Point], sums: &[(f32, f32)]) -> Vec<f32> {
    let mut visible = vec![1.0; points.len()];
    for near in together.chunk_by(|a, b| points[*a as usize].near() == points[*b as usize].near()) {
        let total = near.iter().map(|i| sums[*i as usize]);
        let total = total.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        // No direction above the surface says nothing: open.
        if total.1 > 0.0 {
            near.iter().for_each(|i| visible[*i as usize] = total.0 / total.1);
        }
    }
    visible
}

/// Points of a packet of secondary rays.
const PACKET_POINTS: usize = 64;
/// Edge of the cells that points are sorted by, in pixels at their distance: as many points of one
/// sample and quarter as a packet takes lie in one cell of a surface seen face on.
const CELL_PIXELS: f32 = 16.0;

/// The points in groups that belong to the same sample and quarter and lie together.
fn groups(points: &[Point], rays: &motes_scene::Rays) -> Vec<Vec<u32>> {
    let low = points.iter().map(|p| p.position).fold(Vec3::INFINITY, Vec3::min);
    let depth = points.iter().map(|p| p.depth).fold(f32::INFINITY, f32::min);
    let cell = match rays.projection {
        motes_scene::Projection::Perspective => rays.pixel * depth,
        motes_scene::Projection::Orthographic => rays.pixel,
    } * CELL_PIXELS;
    let key = |p: &Point| {
        // 10 bits an axis; farther cells share the last.
        let at = ((p.position - low) / cell).to_array().map(|v| (v as u32).min(1023));
        u64::from(p.sample * 4 + p.quarter) << 32
            | u64::from(spread(at[0]) | spread(at[1]) << 1 | spread(at[2]) << 2)
    };
    let mut order: Vec<(u64, u32)> =
        points.iter().enumerate().map(|(i, p)| (key(p), i as u32)).collect();
    order.sort_unstable();
    let mut groups: Vec<Vec<u32>> = Vec::new();
    let mut before = u64::MAX;
    for (key, i) in order {
        // Neighbours within a block of 2³ cells may share a packet.
        match groups.last_mut() {
            Some(group) if key >> 3 == before && group.len() < PACKET_POINTS => group.push(i),
            _ => groups.push(vec![i]),
        }
        before = key >> 3;
    }
    groups
}

/// The ten bits of `v`, two zeros between each.
fn spread(v: u32) -> u32 {
    let v = (v | v << 16) & 0x0300_00ff;
    let v = (v | v << 8) & 0x0300_f00f;
    let v = (v | v << 4) & 0x030c_30c3;
    (v | v << 2) & 0x0924_9249
}

/// A packet of secondary rays, and whose they are.
struct Rays {
    packet: Box<Packet>,
    owner: [u16; PACKET_POINTS],
    cosine: [f32; PACKET_POINTS],
}

impl Rays {
    fn new() -> Self {
        let packet = Box::new(Packet::new());
        Self { packet, owner: [0; PACKET_POINTS], cosine: [0.0; PACKET_POINTS] }
    }

    /// Starts a ray at every point of the group whose direction lies above its surface.
    fn gather(
        &mut self,
        points: &[Point],
        group: &[u32],
        aim: impl Fn(&Point) -> Vec3,
        reach: f32,
    ) {
        self.packet.clear_for_any_hit();
        for (owner, point) in group.iter().map(|i| &points[*i as usize]).enumerate() {
            let direction = aim(point);
            let cosine = direction.dot(point.normal);
            if cosine > 0.0 {
                let ray = self.packet.len();
                self.owner[ray] = owner as u16;
                self.cosine[ray] = cosine;
                let origin = point.position + point.normal * point.lift;
                self.packet.push_within(origin, direction, reach);
            }
        }
    }

    /// Adds (visible · cosine, cosine) to the sums of the rays' points.
    fn scatter(&self, group: &[u32], sums: &mut [(f32, f32)]) {
        for ray in 0..self.packet.len() {
            let cosine = self.cosine[ray];
            let sum = &mut sums[group[self.owner[ray] as usize] as usize];
            sum.0 += if self.packet.is_blocked(ray) { 0.0 } else { cosine };
            sum.1 += cosine;
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

/// A cap of directions around an axis.
#[derive(Clone, Copy)]
struct Cap {
    axis: Vec3,
    across: (Vec3, Vec3),
    /// One minus the cosine of the half angle at the rim.
    depth: f32,
}

impl Cap {
    fn new(axis: Vec3, cos_half_angle: f32) -> Self {
        Self { axis, across: axis.any_orthonormal_pair(), depth: 1.0 - cos_half_angle }
    }

    /// The direction that `area` (0..1, from the middle to the rim) and `turn` (in turns) lead to.
    fn direction(&self, area: f32, turn: f32) -> Vec3 {
        let cosine = 1.0 - area * self.depth;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (sin, cos) = (turn.fract() * std::f32::consts::TAU).sin_cos();
        self.axis * cosine + (self.across.0 * cos + self.across.1 * sin) * sine
    }
}

/// The golden angle, in turns.
const GOLDEN_TURN: f32 = 0.381_966;

/// The direction to part `place` of `places` of a round light: parts of equal area along a Fibonacci
/// spiral, which each pixel turns its own way.
fn key_direction(light: &Cap, point: &Point, (place, places): (u32, u32)) -> Vec3 {
    let area = (place as f32 + unit(hash(point.seed ^ place))) / places as f32;
    light.direction(area, place as f32 * GOLDEN_TURN + unit(hash(point.seed)))
}

/// Direction `place` of `places` over the sphere, for pixels of one quarter: the middles of parts of
/// equal area along a Fibonacci spiral. The directions of the four quarters lie between each other.
fn fill_direction((place, places): (u32, u32), quarter: u32) -> Vec3 {
    let between = (quarter as f32 + 0.5) / 4.0;
    let area = (place as f32 + between) / places as f32;
    Cap::new(Vec3::Z, -1.0).direction(area, (place as f32 + between) * GOLDEN_TURN)
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
        Point {
            position: Vec3::ZERO,
            normal: Vec3::Z,
            depth: 1.0,
            lift: 0.0,
            sample,
            of: 4,
            quarter: 0,
            square: (0, 0),
            sphere: (0, 0),
            seed,
        }
    }

    #[test]
    fn fill_directions_cover_the_sphere_evenly() {
        // The mean of max(0, n·d) over the sphere is 1/4, of d itself zero.
        let all: Vec<Vec3> = (0..4)
            .flat_map(|quarter| (0..64).map(move |place| fill_direction((place, 64), quarter)))
            .collect();
        let mean = all.iter().sum::<Vec3>() / 256.0;
        assert!(mean.length() < 0.02, "{mean}");
        for normal in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize()] {
            let cosine = all.iter().map(|d| d.dot(normal).max(0.0)).sum::<f32>() / 256.0;
            assert!((cosine - 0.25).abs() < 0.02, "{normal}: {cosine}");
        }
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn key_directions_stay_within_the_light_and_fill_it() {
        let light = Cap::new(Vec3::new(0.6, 0.0, 0.8), 0.9);
        let all: Vec<Vec3> =
            (0..64).map(|place| key_direction(&light, &point(place % 4, 9), (place, 64))).collect();
        assert!(all.iter().all(|d| d.dot(light.axis) > 0.9 - 1e-5));
        let mean = all.iter().map(|d| d.dot(light.axis)).sum::<f32>() / 64.0;
        assert!((mean - 0.95).abs() < 0.005, "{mean}");
    }
}
