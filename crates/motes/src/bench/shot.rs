//! Pictures by the product's own way: the one place where the benches call its renderer.

use std::sync::{Mutex, MutexGuard, PoisonError};

use fearless_simd::{Level, dispatch, f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::{Lights, Primary, Rays};
use motes_spheres::{Counts, Paint, Renderer, Settings, Sink, Spheres, Tile, View};

/// What is drawn, and how.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    pub rays: &'a Rays,
    pub spheres: Spheres<'a>,
    pub paint: &'a dyn Paint,
    pub lights: &'a Lights,
    pub samples: u32,
    pub primary: Primary,
    pub packet: u32,
}

/// White.
pub(super) struct White;

impl Paint for White {
    fn color(&self, _: u16, _: u32) -> Vec3 {
        Vec3::ONE
    }

    fn uniform(&self, _: u16) -> Option<Vec3> {
        Some(Vec3::ONE)
    }
}

/// A renderer and its last picture, whose memory is kept from frame to frame.
pub(super) struct Studio {
    renderer: Renderer,
    size: (u32, u32),
    finished: Mutex<Vec<Part>>,
    spare: Mutex<Vec<Part>>,
}

/// A tile of the picture: packed RGBA before a dark background.
#[derive(Default)]
struct Part {
    corner: (u32, u32),
    width: u32,
    pixels: Vec<u32>,
}

/// Parts are pushed and popped whole: what a panic elsewhere left is as good.
fn lock(parts: &Mutex<Vec<Part>>) -> MutexGuard<'_, Vec<Part>> {
    parts.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Studio {
    pub fn new(size: (u32, u32)) -> Self {
        let (finished, spare) = (Mutex::default(), Mutex::default());
        Self { renderer: Renderer::new(), size, finished, spare }
    }

    /// Draws a picture in place of the last; gives counts of work.
    pub fn draw(&self, shot: Shot<'_>) -> Counts {
        let Shot { rays, paint, lights, .. } = shot;
        let systems = [shot.spheres];
        let view = View { rays, systems: &systems, paint, lights, casters: &[] };
        let settings = Settings {
            size: self.size,
            samples: shot.samples,
            primary: match shot.primary {
                Primary::Project => motes_spheres::Primary::Project,
                Primary::Trace => motes_spheres::Primary::Trace,
            },
            packet: shot.packet,
            layers: false,
            finer: motes_spheres::Finer::default(),
            level: Level::new(),
        };
        lock(&self.spare).append(&mut lock(&self.finished));
        self.renderer.render(view, settings, self).unwrap_or_default()
    }

    /// The hash of the last picture.
    pub fn hash(&self) -> String {
        let width = self.size.0 as usize;
        let mut pixels = vec![0; width * self.size.1 as usize];
        for part in lock(&self.finished).iter() {
            let across = part.width as usize;
            for (row, from) in part.pixels.chunks_exact(across.max(1)).enumerate() {
                let at = (part.corner.1 as usize + row) * width + part.corner.0 as usize;
                pixels[at..at + across].copy_from_slice(from);
            }
        }
        super::hash(self.size, &pixels)
    }
}

impl Sink for Studio {
    fn tile(&self, tile: &Tile<'_>) -> bool {
        let mut part = lock(&self.spare).pop().unwrap_or_default();
        (part.corner, part.width) = (tile.corner, tile.size.0);
        part.pixels.resize(tile.color.len(), 0);
        dispatch!(Level::new(), simd => pack_all(simd, tile.color, &mut part.pixels));
        lock(&self.finished).push(part);
        true
    }
}

/// What is behind.
const BEHIND: f32 = 32.0 / 255.0;
/// In f32 beside this number, the last eight bits count ones.
const WHOLE: f32 = 8_388_608.0;

/// [`pack`] for as many colours, sixteen at a time.
#[simd]
fn pack_all<S: Simd>(simd: S, colors: &[[f32; 4]], packed: &mut [u32]) {
    let (sixteens, rest) = colors.as_chunks::<16>();
    let (packed, left) = packed.as_chunks_mut::<16>();
    for (colors, packed) in sixteens.iter().zip(packed) {
        let numbers = colors.as_flattened();
        let first = f32x16::from_slice(simd, &numbers[..16]);
        let third = f32x16::from_slice(simd, &numbers[32..48]);
        let (rb0, ga0) = first.deinterleave(f32x16::from_slice(simd, &numbers[16..32]));
        let (rb1, ga1) = third.deinterleave(f32x16::from_slice(simd, &numbers[48..]));
        let (r, b) = rb0.deinterleave(rb1);
        let (g, a) = ga0.deinterleave(ga1);
        let behind = (f32x16::splat(simd, 1.0) - a) * BEHIND;
        let (r, g, b) = (bytes(simd, r + behind), bytes(simd, g + behind), bytes(simd, b + behind));
        let opaque = u32x16::splat(simd, 0xff00_0000);
        (opaque | b << 16 | g << 8 | r).store_slice(packed);
    }
    for (color, packed) in rest.iter().zip(left) {
        *packed = pack(color);
    }
}

#[inline(always)]
fn bytes<S: Simd>(simd: S, light: f32x16<S>) -> u32x16<S> {
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    let byte = light.max(zero).min(one) * 255.0 + WHOLE;
    byte.bitcast::<u32x16<S>>() & u32x16::splat(simd, 0xff)
}

/// Linear, premultiplied RGBA before a dark background, as bytes: R in the lowest.
pub(super) fn pack(color: &[f32; 4]) -> u32 {
    let behind = (1.0 - color[3]) * BEHIND;
    let [r, g, b, _] = color.map(|v| {
        let byte = 255.0 * (v + behind).clamp(0.0, 1.0);
        (byte + WHOLE).to_bits() & 0xff
    });
    0xff00_0000 | b << 16 | g << 8 | r
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_are_packed_before_the_background() {
        assert_eq!(pack(&[1.0, 0.5, 0.0, 1.0]), 0xff00_80ff);
        assert_eq!(pack(&[0.0; 4]), 0xff20_2020);
        assert_eq!(pack(&[9.0, -1.0, 0.25, 1.0]), 0xff40_00ff);
    }

    #[test]
    fn many_colors_are_packed_as_one_is() {
        let colors: Vec<[f32; 4]> = (0..37)
            .map(|i| [0, 1, 2, 3].map(|c| (i * 4 + c) as f32 / 100.0 - 0.2))
            .map(|[r, g, b, a]| [r, g, b, a.clamp(0.0, 1.0)])
            .collect();
        let mut packed = vec![0; colors.len()];
        dispatch!(Level::new(), simd => pack_all(simd, &colors, &mut packed));
        assert_eq!(packed, colors.iter().map(pack).collect::<Vec<_>>());
    }
}
