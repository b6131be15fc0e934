//! Light that reaches surfaces among translucent spheres: shadow and occlusion rays that go on.
//!
//! A ray keeps the product of 1 − opacity over all spheres it meets within its reach, each counted once,
//! as a sum of optical depths in whole numbers: exact in any order. The directions are those of
//! [`crate::occlude`]; the rays go in packets through the grid, by [`trace_through`].

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::intersect::transmittance;
use crate::occlude::{Occluder, Sums, Work, lift, share};
use crate::packet::{LANES, Packet};
use crate::tile::{SIDE_BLOCKS, TILE_RAYS};
use crate::traverse::{Counts, trace_through};

/// Rays of a packet: 8 × 8.
const PACKET: usize = 64;
/// Blocks along the side of a square of hits whose occlusion rays go together.
const SQUARE: usize = 8;

/// Rays on their way into a packet, and whose they are.
struct Sent<'a> {
    packet: &'a mut Packet,
    sums: &'a mut Sums,
    own: [(u32, f32); PACKET],
}

impl Sent<'_> {
    /// Adds a ray from `origin`, of hit `ray`, that counts with `cosine`.
    #[inline(always)]
    fn push(&mut self, (origin, direction, reach): (Vec3, Vec3, f32), ray: usize, cosine: f32) {
        self.own[self.packet.len()] = (ray as u32, cosine);
        self.packet.push_within(origin, direction, reach);
    }

    /// Sends the rays, and adds what gets through to the sums of their hits.
    #[inline(always)]
    fn send<S: Simd>(&mut self, simd: S, work: Work<'_>, counts: &mut Counts) {
        if !self.packet.is_empty() {
            trace_through(simd, self.packet, work.view.casting(), work.view.paint, counts);
        }
        for (i, (ray, cosine)) in self.own[..self.packet.len()].iter().enumerate() {
            self.sums.all[*ray as usize] += cosine;
            self.sums.visible[*ray as usize] += cosine * transmittance(self.packet.optical[i]);
        }
        self.packet.clear_for_any_hit();
    }
}

impl Occluder {
    /// Finds what reaches the hits where spheres may be translucent.
    #[simd]
    pub fn reach_through<S: Simd>(&mut self, simd: S, work: Work<'_>, counts: &mut Counts) {
        self.open(simd, work.hits, &work.view.lights.key);
        self.packet.clear_for_any_hit();
        if work.aims.key_rays > 0 {
            self.shadow_through(simd, work, counts);
            share(work, &self.key, &mut self.reaching.key, true);
        }
        if work.aims.fill_rays > 0 {
            self.occlude_through(simd, work, counts);
            share(work, &self.fill, &mut self.reaching.fill, false);
        }
    }

    #[inline(always)]
    fn shadow_through<S: Simd>(&mut self, simd: S, work: Work<'_>, counts: &mut Counts) {
        let Self { packet, key, .. } = self;
        key.visible.fill(0.0);
        key.all.fill(0.0);
        let mut sent = Sent { packet, sums: key, own: [(0, 0.0); PACKET] };
        for ray in work.hits.rays() {
            let normal = work.hits.normal_of(ray);
            let origin = work.hits.position_of(ray) + normal * lift(work, ray);
            let first = work.key_set(ray);
            let toward = work.view.lights.key.seen_from(origin);
            for place in first..first + work.aims.key_rays {
                let (direction, reach) = work.shadow_ray(place, toward);
                let cosine = direction.dot(normal);
                if cosine > 0.0 {
                    sent.push((origin, direction, reach), ray, cosine);
                    if sent.packet.len() == PACKET {
                        sent.send(simd, work, counts);
                    }
                }
            }
        }
        sent.send(simd, work, counts);
    }

    #[inline(always)]
    fn occlude_through<S: Simd>(&mut self, simd: S, work: Work<'_>, counts: &mut Counts) {
        let Self { packet, fill, .. } = self;
        fill.visible.fill(0.0);
        fill.all.fill(0.0);
        let mut sent = Sent { packet, sums: fill, own: [(0, 0.0); PACKET] };
        let pattern = &work.rays.pattern;
        // Those of one direction and of one part of the tile go together.
        let mut classes = vec![Vec::new(); 4 * pattern.samples as usize];
        for square in 0..TILE_RAYS / LANES / (SQUARE * SQUARE) {
            let across = SIDE_BLOCKS / SQUARE;
            let corner = (square / across * SIDE_BLOCKS + square % across) * SQUARE;
            classes.iter_mut().for_each(Vec::clear);
            for block in 0..SQUARE * SQUARE {
                let block = corner + block / SQUARE * SIDE_BLOCKS + block % SQUARE;
                for ray in (block * LANES..(block + 1) * LANES).filter(|r| work.hits.has(*r)) {
                    let quarter = work.quarter(ray);
                    classes[(quarter * pattern.samples + pattern.sample(ray)) as usize].push(ray);
                }
            }
            for (class, rays) in classes.iter().enumerate().filter(|(_, rays)| !rays.is_empty()) {
                let (quarter, sample) =
                    (class as u32 / pattern.samples, class as u32 % pattern.samples);
                for direction in work.aims.fill_set(quarter, work.first_sample + sample) {
                    for ray in rays {
                        let normal = work.hits.normal_of(*ray);
                        let cosine = direction.dot(normal);
                        if cosine > 0.0 {
                            let origin = work.hits.position_of(*ray) + normal * lift(work, *ray);
                            sent.push((origin, *direction, work.aims.reach), *ray, cosine);
                            if sent.packet.len() == PACKET {
                                sent.send(simd, work, counts);
                            }
                        }
                    }
                    sent.send(simd, work, counts);
                }
            }
        }
    }
}
