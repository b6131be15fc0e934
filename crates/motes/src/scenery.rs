//! What stands in and around a liquid besides its surroundings: the spheres of other systems.

use std::sync::{Mutex, PoisonError};

use fearless_simd::{Level, Simd, dispatch};
use glam::Vec3;
use motes_scene::{Beyond, Environment, Lights, Sight};
use motes_spheres::{Counts, Met, Packet, Paint, Spheres, trace};

/// Rays that are traced together.
const TOGETHER: usize = 64;

/// Spheres of some systems.
#[derive(Clone, Copy)]
pub(crate) struct Others<'a> {
    pub systems: &'a [Spheres<'a>],
    /// Their colours.
    pub paint: &'a dyn Paint,
    /// The corners of a box around all that is visible of them.
    pub bounds: [Vec3; 2],
}

/// Surroundings with spheres in them, which the lights shine on; what keeps the light away from them is the
/// liquid alone.
pub(crate) struct Scenery<'a> {
    environment: &'a Environment,
    others: Others<'a>,
    lights: &'a Lights,
    level: Level,
    /// Packets that no thread is using.
    packets: Mutex<Vec<Packet>>,
}

impl<'a> Scenery<'a> {
    pub fn new(
        environment: &'a Environment,
        others: Others<'a>,
        (lights, level): (&'a Lights, Level),
    ) -> Self {
        Self { environment, others, lights, level, packets: Mutex::default() }
    }

    fn with_packet<T>(&self, work: impl FnOnce(&mut Packet) -> T) -> T {
        let spare = |p: &Mutex<Vec<Packet>>| p.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut packet = spare(&self.packets).unwrap_or_else(Packet::new);
        packet.clear();
        let result = work(&mut packet);
        self.packets.lock().unwrap_or_else(PoisonError::into_inner).push(packet);
        result
    }

    /// Whether a ray comes near the spheres.
    fn is_near(&self, sight: &Sight) -> bool {
        let inverse = sight.direction.recip();
        let [a, b] = self.others.bounds.map(|corner| (corner - sight.origin) * inverse);
        // What is no number, of a ray along a face, counts as met.
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        !(near > far || far < 0.0 || near > sight.reach)
    }

    fn trace(&self, packet: &mut Packet) {
        dispatch!(self.level, simd => trace_all(simd, packet, self.others.systems));
    }

    /// The light of the sphere that ray `i` of a packet meets first, and its distance.
    fn light(&self, packet: &Packet, i: usize) -> Option<(Vec3, f32)> {
        let (distance, system, slot) = packet.hit(i)?;
        let ray = (packet.origin_of(i), packet.direction_of(i));
        let met = self.others.systems[system as usize].surface(slot, ray, distance);
        let Met { point, normal, index, .. } = met;
        let Lights { key, ambient, .. } = *self.lights;
        let cosine = normal.dot(key.seen_from(point).direction).max(0.0);
        let light = key.color * cosine + self.lights.fill(normal) + ambient;
        let inside = met.cap.and_then(|cap| self.others.paint.cap(system, index, cap));
        let color = inside.unwrap_or_else(|| self.others.paint.color(system, index));
        Some((color * light, distance))
    }
}

fn trace_all<S: Simd>(simd: S, packet: &mut Packet, systems: &[Spheres<'_>]) {
    trace(simd, packet, systems, &mut Counts::default());
}

impl Beyond for Scenery<'_> {
    fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)> {
        let mut seen = Vec::with_capacity(1);
        self.look(self.level, std::slice::from_ref(sight), &mut seen);
        seen.pop().filter(|(_, distance)| *distance <= sight.reach)
    }

    fn distance(&self, sight: &Sight) -> Option<f32> {
        let floor = self.environment.distance(sight);
        let reach = floor.unwrap_or(sight.reach);
        if !self.is_near(&Sight { reach, ..*sight }) {
            return floor;
        }
        let met = self.with_packet(|packet| {
            packet.push_within(sight.origin, sight.direction, reach);
            self.trace(packet);
            packet.hit(0).map(|(distance, ..)| distance)
        });
        met.or(floor)
    }

    fn look(&self, level: Level, sights: &[Sight], seen: &mut Vec<(Vec3, f32)>) {
        let first = seen.len();
        self.environment.look(level, sights, seen);
        let seen = &mut seen[first..];
        // By the axis that they mostly follow and its sign.
        let mut bins: [Vec<u32>; 6] = Default::default();
        for (i, sight) in sights.iter().enumerate() {
            if self.is_near(&Sight { reach: seen[i].1, ..*sight }) {
                let k = sight.direction.abs().max_position();
                bins[2 * k + usize::from(sight.direction[k] > 0.0)].push(i as u32);
            }
        }
        self.with_packet(|packet| {
            for some in bins.iter().flat_map(|bin| bin.chunks(TOGETHER)) {
                packet.clear();
                for i in some {
                    let Sight { origin, direction, .. } = sights[*i as usize];
                    packet.push_within(origin, direction, seen[*i as usize].1);
                }
                self.trace(packet);
                for (ray, i) in some.iter().enumerate() {
                    if let Some(met) = self.light(packet, ray) {
                        seen[*i as usize] = met;
                    }
                }
            }
        });
    }

    fn is_amid(&self) -> bool {
        true
    }
}
