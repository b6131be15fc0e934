//! A picture by the product's own way: the one place where the benches call its renderer.

use fearless_simd::Level;
use glam::Vec3;
use motes_scene::{Lights, Rays};
use motes_spheres::{Counts, Paint, Settings, Spheres, View};
use rayon::prelude::*;

/// What is drawn, and how.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    pub rays: &'a Rays,
    pub spheres: Spheres<'a>,
    pub paint: &'a dyn Paint,
    pub lights: &'a Lights,
    pub size: (u32, u32),
    pub samples: u32,
    pub packet: u32,
}

/// One colour for all.
pub(super) struct OneColor(pub Vec3);

impl Paint for OneColor {
    fn color(&self, _: u16, _: u32) -> Vec3 {
        self.0
    }
}

/// The way to what the eye sees first.
pub(super) const PRIMARY: &str = "trace";

/// Draws a picture: packed RGBA before a dark background, row by row, and counts of work.
pub(super) fn draw(shot: Shot<'_>) -> (Vec<u32>, Counts) {
    let Shot { rays, paint, lights, .. } = shot;
    let systems = [shot.spheres];
    let view = View { rays, systems: &systems, paint, lights };
    let settings = Settings {
        size: shot.size,
        samples: shot.samples,
        packet: shot.packet,
        layers: false,
        level: Level::new(),
    };
    match motes_spheres::render(view, settings, &|_, _| true) {
        Some(picture) => (picture.color.par_iter().map(pack).collect(), picture.counts),
        None => (Vec::new(), Counts::default()),
    }
}

/// Linear, premultiplied RGBA before a dark background, as bytes: R in the lowest.
fn pack([r, g, b, a]: &[f32; 4]) -> u32 {
    const BEHIND: f32 = 32.0 / 255.0;
    let byte = |v: &f32| (255.0 * (v + (1.0 - a) * BEHIND).clamp(0.0, 1.0)) as u32;
    0xff00_0000 | byte(b) << 16 | byte(g) << 8 | byte(r)
}
