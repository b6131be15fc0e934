//! One bounce of diffuse light (Gribble et al. 2007, §6, name it as future work).
//!
//! A surface of albedo ρ adds ρ·(1/π)∫ L cos θ dω to what it sends to the eye. With directions spread by
//! the cosine this is ρ times the mean of the light L that they meet: ρ'·(key·cosine·open + fill + ambient)
//! of the first surface along each, with one shadow ray to the key light and nothing that keeps the fill
//! away; black where they meet nothing, as the fill is counted where it comes from. A translucent
//! surface ends a ray too, and counts with its opacity.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::aims::{GOLDEN_TURN, TURNS};
use crate::intersect::transmittance;
use crate::lanes::Lanes;
use crate::occlude::{Work, lift};
use crate::packet::Packet;
use crate::shade::color_of;
use crate::tile::TILE_RAYS;
use crate::traverse::{Counts, Met, trace, trace_through};

/// Rays of a packet: 8 × 8.
const PACKET: usize = 64;

/// Finds the light that comes by way of other surfaces.
#[derive(Debug)]
pub(crate) struct Bounce {
    /// Mean light over the directions of each ray's hit: red, green, blue.
    pub light: [Lanes<f32>; 3],
    /// Rays on their way, by the axis that they mostly follow and its sign, and whose they are.
    bins: Vec<(Packet, Vec<u32>)>,
    shadow: Box<Packet>,
}

/// Light that waits for its shadow ray.
struct Waiting {
    ray: u32,
    key: Vec3,
}

impl Bounce {
    pub fn new() -> Self {
        Self {
            light: [(); 3].map(|()| Lanes::new(0.0, TILE_RAYS)),
            bins: (0..6).map(|_| (Packet::new(), Vec::new())).collect(),
            shadow: Box::new(Packet::new()),
        }
    }

    /// Finds the light that reaches the hits by one bounce.
    #[simd]
    pub fn gather<S: Simd>(&mut self, simd: S, work: Work<'_>, counts: &mut Counts) {
        for channel in &mut self.light {
            channel.fill(0.0);
        }
        let rays = work.view.lights.bounce_rays;
        for ray in work.hits.rays() {
            let normal = work.hits.normal_of(ray);
            let across = normal.any_orthonormal_pair();
            let origin = work.hits.position_of(ray) + normal * lift(work, ray);
            let sample = work.first_sample + work.rays.pattern.sample(ray);
            let turn = work.key_turn(work.rays.pattern.pixel_of(ray));
            for place in 0..rays {
                let place = (place * work.aims.samples + sample, rays * work.aims.samples);
                let d = by_cosine(place, turn);
                let direction = across.0 * d.x + across.1 * d.y + normal * d.z;
                let k = direction.abs().max_position();
                let bin = 2 * k + usize::from(direction[k] > 0.0);
                let (packet, own) = &mut self.bins[bin];
                packet.push(origin, direction);
                own.push(ray as u32);
                if own.len() == PACKET {
                    self.send(simd, work, bin, counts);
                }
            }
        }
        for bin in 0..self.bins.len() {
            self.send(simd, work, bin, counts);
        }
        for channel in &mut self.light {
            channel.iter_mut().for_each(|light| *light /= rays as f32);
        }
    }

    /// Sends the rays of a bin and adds the light of what they meet.
    #[inline(always)]
    fn send<S: Simd>(&mut self, simd: S, work: Work<'_>, bin: usize, counts: &mut Counts) {
        let Self { light, bins, shadow, .. } = self;
        let (packet, own) = &mut bins[bin];
        if own.is_empty() {
            return;
        }
        trace(simd, packet, work.view.systems, counts);
        shadow.clear_for_any_hit();
        let (lights, paint) = (work.view.lights, work.view.paint);
        let translucent = paint.translucent();
        let mut waiting = Vec::with_capacity(PACKET);
        for (i, ray) in own.iter().enumerate() {
            let Some((distance, system, slot)) = packet.hit(i) else { continue };
            let ray_of = (packet.origin_of(i), packet.direction_of(i));
            let met = work.view.systems[system as usize].surface(slot, ray_of, distance);
            let Met { point: position, normal, radius, index, .. } = met;
            let opacity = if translucent { paint.opacity(system, index) } else { 1.0 };
            let albedo = color_of(paint, system, (index, met.cap)) * opacity;
            add(light, *ray, albedo * (lights.fill(normal) + lights.ambient));
            let key = lights.key;
            let toward = key.seen_from(position);
            let cosine = normal.dot(toward.direction);
            if cosine > 0.0 {
                let key_light = albedo * key.color * cosine;
                if key.shadow_rays == 0 {
                    add(light, *ray, key_light);
                    continue;
                }
                let off = 1e-3 * radius + 1e-6 * (position.abs().max_element() + distance);
                let origin = position + normal * off;
                shadow.push_within(origin, toward.direction, toward.reach(1.0));
                waiting.push(Waiting { ray: *ray, key: key_light });
            }
        }
        if !shadow.is_empty() && translucent {
            trace_through(simd, shadow, work.view.casting(), paint, counts);
        } else if !shadow.is_empty() {
            trace(simd, shadow, work.view.casting(), counts);
        }
        for (i, Waiting { ray, key }) in waiting.into_iter().enumerate() {
            let open = match (translucent, shadow.is_blocked(i)) {
                (_, true) => 0.0,
                (true, false) => transmittance(shadow.optical[i]),
                (false, false) => 1.0,
            };
            add(light, ray, key * open);
        }
        packet.clear();
        own.clear();
    }
}

fn add(light: &mut [Lanes<f32>; 3], ray: u32, more: Vec3) {
    for (channel, more) in light.iter_mut().zip(more.to_array()) {
        channel[ray as usize] += more;
    }
}

/// Direction `place` of `places` about z, spread by the cosine: parts of equal area of the disc below,
/// along a Fibonacci spiral, turned as a whole.
fn by_cosine((place, places): (u32, u32), turn: u32) -> Vec3 {
    let within = (turn.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
    let area = (place as f32 + within) / places as f32;
    let turns = place as f32 * GOLDEN_TURN + turn as f32 / TURNS as f32;
    let (sin, cos) = (turns.fract() * std::f32::consts::TAU).sin_cos();
    Vec3::new(cos, sin, 0.0) * area.sqrt() + Vec3::Z * (1.0 - area).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_spread_by_the_cosine() {
        // The mean of cos θ, weighted by it, is 2/3.
        for turn in 0..TURNS {
            let all: Vec<Vec3> = (0..256).map(|place| by_cosine((place, 256), turn)).collect();
            let mean = all.iter().sum::<Vec3>() / 256.0;
            assert!(mean.abs_diff_eq(Vec3::new(0.0, 0.0, 2.0 / 3.0), 0.01), "{mean}");
        }
    }
}
