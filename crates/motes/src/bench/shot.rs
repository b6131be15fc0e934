//! Pictures by the product's own way: the one place where the benches call its renderer.

use std::sync::atomic::{AtomicU32, Ordering};

use fearless_simd::Level;
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

/// A renderer and its picture, kept from frame to frame: packed RGBA before a dark background.
pub(super) struct Studio {
    renderer: Renderer,
    size: (u32, u32),
    pixels: Vec<AtomicU32>,
}

impl Studio {
    pub fn new(size: (u32, u32)) -> Self {
        let pixels = size.0 as usize * size.1 as usize;
        let pixels = std::iter::repeat_with(AtomicU32::default).take(pixels).collect();
        Self { renderer: Renderer::new(), size, pixels }
    }

    /// Draws a picture in place of the last; gives counts of work.
    pub fn draw(&self, shot: Shot<'_>) -> Counts {
        let Shot { rays, paint, lights, .. } = shot;
        let systems = [shot.spheres];
        let view = View { rays, systems: &systems, paint, lights };
        let settings = Settings {
            size: self.size,
            samples: shot.samples,
            primary: match shot.primary {
                Primary::Project => motes_spheres::Primary::Project,
                Primary::Trace => motes_spheres::Primary::Trace,
            },
            packet: shot.packet,
            layers: false,
            level: Level::new(),
        };
        self.renderer.render(view, settings, self).unwrap_or_default()
    }

    /// The hash of the last picture.
    pub fn hash(&self) -> String {
        let pixels: Vec<u32> = self.pixels.iter().map(|p| p.load(Ordering::Relaxed)).collect();
        super::hash(self.size, &pixels)
    }
}

impl Sink for Studio {
    fn tile(&self, tile: &Tile<'_>) -> bool {
        let (x, y) = (tile.corner.0 as usize, tile.corner.1 as usize);
        let (width, across) = (self.size.0 as usize, tile.size.0 as usize);
        for (row, colors) in tile.color.chunks_exact(across).enumerate() {
            let at = (y + row) * width + x;
            for (pixel, color) in self.pixels[at..at + across].iter().zip(colors) {
                pixel.store(pack(color), Ordering::Relaxed);
            }
        }
        true
    }
}

/// Linear, premultiplied RGBA before a dark background, as bytes: R in the lowest.
fn pack([r, g, b, a]: &[f32; 4]) -> u32 {
    const BEHIND: f32 = 32.0 / 255.0;
    let byte = |v: &f32| (255.0 * (v + (1.0 - a) * BEHIND).clamp(0.0, 1.0)) as u32;
    0xff00_0000 | byte(b) << 16 | byte(g) << 8 | byte(r)
}
