//! Where the liquid is seen from.

use motes_scene::Rays;

/// A picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The rays, about the origin of the particles.
    pub rays: Rays,
    /// Width and height, pixels.
    pub size: (u32, u32),
}

impl View {
    /// How many pixels there are.
    pub fn pixels(&self) -> usize {
        self.size.0 as usize * self.size.1 as usize
    }
}
