//! One picture loop for every way of finding what a ray hits first: packets, Lambert, no secondary ray
//! (Gribble et al. 2007, Table 1: "simple Lambertian shading").

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use motes_scene::Rays;
use motes_spheres::{Counts, Packet, Spheres, trace};
use rayon::prelude::*;

use super::standard_grid::Mailbox;

/// What a ray hits first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub distance: f32,
    pub center: Vec3,
    pub radius: f32,
}

/// A way of finding what rays hit first.
pub(super) trait Way: Sync {
    /// Gives ray after ray's first hit to `hits`, which are empty.
    fn trace(&self, rays: &[(Vec3, Vec3)], worker: &mut Worker);
}

/// What one thread needs.
pub(super) struct Worker {
    pub packet: Packet,
    pub mailbox: Mailbox,
    pub hits: Vec<Option<Hit>>,
    pub counts: Counts,
}

impl Worker {
    pub fn new() -> Self {
        Self {
            packet: Packet::new(),
            mailbox: Mailbox::new(),
            hits: Vec::new(),
            counts: Counts::default(),
        }
    }
}

/// The sphere-center method: Motes' own grid and coherent traversal.
pub(super) struct SphereCenter<'a> {
    pub spheres: Spheres<'a>,
    pub level: Level,
    pub culling: Culling,
}

/// Whether spheres outside the frustum are left out before they are tested.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Culling {
    On,
    Off,
}

impl Way for SphereCenter<'_> {
    fn trace(&self, rays: &[(Vec3, Vec3)], worker: &mut Worker) {
        let Worker { packet, hits, counts, .. } = worker;
        if self.culling == Culling::Off {
            packet.test_all();
        }
        packet.clear();
        rays.iter().for_each(|(origin, direction)| packet.push(*origin, *direction));
        dispatch!(self.level, simd => trace(simd, packet, &[self.spheres], counts));
        hits.extend((0..rays.len()).map(|i| {
            let (distance, _, slot) = packet.hit(i)?;
            let (grid, place) = self.spheres.locate(slot);
            Some(Hit { distance, center: grid.center(place), radius: grid.radius_at(place) })
        }));
    }
}

/// What is drawn.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    pub rays: &'a Rays,
    pub size: (u32, u32),
    /// Side of a packet, pixels.
    pub packet: u32,
}

/// A picture: packed pixels, and what it took.
pub(super) struct Drawn {
    pub pixels: Vec<u32>,
    pub counts: Counts,
}

impl Shot<'_> {
    pub fn hash(&self, drawn: &Drawn) -> String {
        super::hash(self.size, &drawn.pixels)
    }
}

/// Rows of pixels that one thread draws at a time: the largest packet's.
const BAND: u32 = 16;

/// Draws a picture.
pub(super) fn draw(shot: Shot<'_>, way: &dyn Way) -> Drawn {
    let (width, height) = shot.size;
    let mut pixels = vec![0; width as usize * height as usize];
    let bands = pixels.par_chunks_mut((width * BAND) as usize).enumerate();
    let counts = bands.map(|(band, pixels)| {
        let rows = band as u32 * BAND..(band as u32 * BAND + BAND).min(height);
        draw_band(shot, way, rows, pixels)
    });
    let counts = counts.reduce(Counts::default, |mut sum, other| {
        sum.add(other);
        sum
    });
    Drawn { pixels, counts }
}

fn draw_band(
    shot: Shot<'_>,
    way: &dyn Way,
    rows: std::ops::Range<u32>,
    pixels: &mut [u32],
) -> Counts {
    let width = shot.size.0;
    let side = shot.packet.clamp(1, BAND);
    let mut worker = Worker::new();
    let mut rays = Vec::new();
    // Squares of a band's height, and packets in them, so that neighbours follow each other.
    for square in (0..width).step_by(BAND as usize) {
        for y in rows.clone().step_by(side as usize) {
            for x in (square..(square + BAND).min(width)).step_by(side as usize) {
                let xs = x..(x + side).min(width).min(square + BAND);
                let ys = y..(y + side).min(rows.end);
                let places = || ys.clone().flat_map(|y| xs.clone().map(move |x| (x, y)));
                rays.clear();
                rays.extend(places().map(|(x, y)| shot.rays.ray(x as f32 + 0.5, y as f32 + 0.5)));
                worker.hits.clear();
                way.trace(&rays, &mut worker);
                for (((x, y), ray), hit) in places().zip(&rays).zip(&worker.hits) {
                    pixels[((y - rows.start) * width + x) as usize] = shade(shot.rays, *ray, *hit);
                }
            }
        }
    }
    worker.counts
}

/// Lambert under a light at the viewer's shoulder, as packed RGBA.
fn shade(rays: &Rays, (origin, direction): (Vec3, Vec3), hit: Option<Hit>) -> u32 {
    let Some(hit) = hit else { return 0xff20_2020 };
    let outward = origin + direction * hit.distance - hit.center;
    let inside = (hit.center - origin).length() < hit.radius;
    let normal = outward.normalize_or(-direction) * if inside { -1.0 } else { 1.0 };
    let light = (rays.up * 0.8 - rays.right * 0.5 - rays.forward * 0.6).normalize();
    let light = 0.25 + 0.75 * normal.dot(light).max(0.0);
    let value = (255.0 * light.min(1.0)) as u32;
    0xff00_0000 | value << 16 | value << 8 | value
}
