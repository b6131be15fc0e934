//! A whole picture: tiles on all cores, packets within tiles.

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::{Lights, Rays};
use rayon::prelude::*;

use crate::occlude::{Point, hash, reaching};
use crate::packet::{MOST_RAYS, Packet};
use crate::shade::{Paint, shade};
use crate::traverse::{Counts, Spheres, trace};

/// What to make of the rays.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Rays per pixel for the colour.
    pub samples: u32,
    /// Side of a packet, rays: 2, 4, 8 or 16.
    pub packet: u32,
    /// Whether depth, normal, id and system are wanted.
    pub layers: bool,
    /// The instruction set.
    pub level: Level,
}

/// What is seen, in what light.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The camera's rays, about the same origin as the particles.
    pub rays: &'a Rays,
    /// The particle systems.
    pub systems: &'a [Spheres<'a>],
    /// Their colours.
    pub paint: &'a dyn Paint,
    /// The lights.
    pub lights: &'a Lights,
}

/// A picture, row by row from the top.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Linear, premultiplied RGBA.
    pub color: Vec<[f32; 4]>,
    /// What the ray through each pixel's centre hit; empty if layers were not wanted.
    pub center: Vec<Center>,
    /// Counts of work.
    pub counts: Counts,
}

/// What the ray through a pixel's centre hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Center {
    /// Distance along the ray; +∞ where nothing.
    pub depth: f32,
    /// Unit normal towards the viewer; zero where nothing.
    pub normal: [f32; 3],
    /// Index in the file's own order; −1 where nothing.
    pub id: i64,
    /// System.
    pub system: u16,
}

impl Center {
    const NOTHING: Self = Self { depth: f32::INFINITY, normal: [0.0; 3], id: -1, system: 0 };
}

/// Pixels along a tile's side.
const TILE: u32 = 64;

/// Renders the picture. `progress` is told of tiles done and tiles in all, from any thread; where it
/// gives `false` the rest is left out and there is no picture.
pub fn render(
    view: View<'_>,
    settings: Settings,
    progress: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Option<Picture> {
    let (width, height) = settings.size;
    let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let total = u64::from(across) * u64::from(down);
    let done = std::sync::atomic::AtomicU64::new(0);
    let tiles: Vec<(Area, Tile)> = (0..across * down)
        .into_par_iter()
        .with_max_len(1)
        .map(|i| {
            let (x, y) = (i % across * TILE, i / across * TILE);
            let area = Area { x, y, w: TILE.min(width - x), h: TILE.min(height - y) };
            let tile = dispatch!(settings.level, simd => render_tile(simd, view, settings, area));
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            progress(done, total).then_some((area, tile))
        })
        .collect::<Option<_>>()?;

    let pixels = width as usize * height as usize;
    let mut picture = Picture { color: vec![[0.0; 4]; pixels], ..Picture::default() };
    if settings.layers {
        picture.center = vec![Center::NOTHING; pixels];
    }
    for (area, tile) in tiles {
        picture.counts.add(tile.counts);
        for row in 0..area.h as usize {
            let from = row * area.w as usize..(row + 1) * area.w as usize;
            let to = (area.y as usize + row) * width as usize + area.x as usize;
            let to = to..to + area.w as usize;
            picture.color[to.clone()].copy_from_slice(&tile.color[from.clone()]);
            if settings.layers {
                picture.center[to].copy_from_slice(&tile.center[from]);
            }
        }
    }
    Some(picture)
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug)]
struct Area {
    x: u32,
    y: u32,
    w: u32,
    h: u32,
}

impl Area {
    /// The rectangles of at most `side` pixels that it consists of.
    fn parts(self, side: u32) -> impl Iterator<Item = Area> {
        (0..self.h).step_by(side as usize).flat_map(move |y| {
            (0..self.w).step_by(side as usize).map(move |x| Area {
                x: self.x + x,
                y: self.y + y,
                w: side.min(self.w - x),
                h: side.min(self.h - y),
            })
        })
    }

    /// Its pixels, row by row.
    fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        (0..self.h).flat_map(move |y| (0..self.w).map(move |x| (self.x + x, self.y + y)))
    }
}

struct Tile {
    color: Vec<[f32; 4]>,
    center: Vec<Center>,
    counts: Counts,
}

#[simd]
fn render_tile<S: Simd>(simd: S, view: View<'_>, settings: Settings, area: Area) -> Tile {
    let pixels = (area.w * area.h) as usize;
    let mut tile =
        Tile { color: vec![[0.0; 4]; pixels], center: Vec::new(), counts: Counts::default() };
    let place = |(x, y): (u32, u32)| ((y - area.y) * area.w + x - area.x) as usize;
    let mut packet = Packet::new();

    // A packet takes a square of pixels with all their samples, or, of a pixel with more samples than
    // it holds, as many as it holds.
    let offsets = sample_offsets(settings.samples);
    let side = (settings.packet / (settings.samples as f32).sqrt().ceil() as u32).max(1);
    let weight = 1.0 / settings.samples as f32;
    let mut hits: Vec<(usize, Surface)> = Vec::new();
    let mut points = Vec::new();
    for part in area.parts(side) {
        for (chunk, some) in offsets.chunks(MOST_RAYS / (side * side) as usize).enumerate() {
            packet.clear();
            for (x, y) in part.pixels() {
                for [dx, dy] in some {
                    let (origin, direction) = view.rays.ray(x as f32 + dx, y as f32 + dy);
                    packet.push(origin, direction);
                }
            }
            trace(simd, &mut packet, view.systems, &mut tile.counts);
            for (i, pixel) in part.pixels().enumerate() {
                for j in 0..some.len() {
                    let ray = i * some.len() + j;
                    if let Some(surface) = Surface::of(&packet, ray, view.systems) {
                        let sample = (chunk * MOST_RAYS + j) as u32;
                        points.push(surface.point(pixel, (sample, settings.samples)));
                        hits.push((place(pixel), surface));
                    }
                }
            }
        }
    }
    let reaching = reaching(simd, &points, view, &mut tile.counts);
    for ((place, surface), reaching) in hits.iter().zip(reaching) {
        let albedo = view.paint.color(surface.system, surface.index);
        let light = shade(view.lights, albedo, surface.normal, reaching) * weight;
        let sum = &mut tile.color[*place];
        for (sum, light) in sum.iter_mut().zip([light.x, light.y, light.z, weight]) {
            *sum += light;
        }
    }

    if settings.layers {
        tile.center = vec![Center::NOTHING; pixels];
        for part in area.parts(settings.packet) {
            packet.clear();
            for (x, y) in part.pixels() {
                let (origin, direction) = view.rays.ray(x as f32 + 0.5, y as f32 + 0.5);
                packet.push(origin, direction);
            }
            trace(simd, &mut packet, view.systems, &mut tile.counts);
            for (i, pixel) in part.pixels().enumerate() {
                if let Some(hit) = Surface::of(&packet, i, view.systems) {
                    tile.center[place(pixel)] = Center {
                        depth: hit.distance,
                        normal: hit.normal.to_array(),
                        id: i64::from(hit.index),
                        system: hit.system,
                    };
                }
            }
        }
    }
    tile
}

/// The surface a ray has hit.
struct Surface {
    distance: f32,
    position: Vec3,
    radius: f32,
    /// Unit normal, towards where the ray came from.
    normal: Vec3,
    index: u32,
    system: u16,
}

impl Surface {
    fn of(packet: &Packet, ray: usize, systems: &[Spheres<'_>]) -> Option<Self> {
        let (distance, system, slot) = packet.hit(ray)?;
        let (grid, place) = systems[system as usize].locate(slot);
        let direction = packet.direction_of(ray);
        let position = packet.origin_of(ray) + direction * distance;
        let (outward, radius) = (position - grid.center(place), grid.radius_at(place));
        // Rounding cannot flip it: a grazing ray's normal is at a right angle to the ray at most.
        let inside = (grid.center(place) - packet.origin_of(ray)).length() < radius;
        let normal = outward.normalize_or(-direction) * if inside { -1.0 } else { 1.0 };
        Some(Self { distance, position, radius, normal, index: grid.index(place), system })
    }

    /// The point where secondary rays start.
    fn point(&self, (x, y): (u32, u32), (sample, of): (u32, u32)) -> Point {
        // A thousandth of the radius, and what rounding of the coordinates may add to it.
        let lift = 1e-3 * self.radius + 1e-6 * (self.position.abs().max_element() + self.distance);
        let seed = hash(x ^ hash(y));
        let (position, normal, depth) = (self.position, self.normal, self.distance);
        let quarter = x % 2 + y % 2 * 2;
        let (square, sphere) = ((x / 2, y / 2), (self.system, self.index));
        Point { position, normal, depth, lift, sample, of, quarter, square, sphere, seed }
    }
}

/// Where in the pixel its samples lie, each in 0..1: the centre; a rotated square; else a Fibonacci
/// lattice, which leaves no two samples in one row or column.
fn sample_offsets(samples: u32) -> Vec<[f32; 2]> {
    match samples {
        1 => vec![[0.5, 0.5]],
        4 => vec![[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]],
        n => (0..n)
            .map(|i| {
                let golden = 0.618_034 * (i as f32 + 0.5);
                [(i as f32 + 0.5) / n as f32, golden.fract()]
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_spread_about_the_centre() {
        for n in [1, 2, 3, 4, 9, 16, 64, 1024] {
            let offsets = sample_offsets(n);
            assert_eq!(offsets.len(), n as usize);
            assert!(offsets.iter().flatten().all(|v| (0.0..1.0).contains(v)));
            for axis in 0..2 {
                let mean = offsets.iter().map(|o| o[axis]).sum::<f32>() / n as f32;
                assert!((mean - 0.5).abs() < 0.2 / (n as f32).sqrt(), "{n}: {mean}");
            }
        }
    }

    #[test]
    fn parts_cover_an_area_once() {
        let area = Area { x: 3, y: 5, w: 13, h: 7 };
        let mut pixels: Vec<_> = area.parts(4).flat_map(Area::pixels).collect();
        pixels.sort_unstable();
        let mut expected: Vec<_> = area.pixels().collect();
        expected.sort_unstable();
        assert_eq!(pixels, expected);
    }
}
