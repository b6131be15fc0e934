//! Spans: the stretches of each pixel's ray that lie in the liquid.

use std::ops::Range;

/// Spans of all pixels (Zirr & Dachsbacher 2015, §3.1–3.2), compressed: front to back in each pixel,
/// pixels row by row.
///
/// A surface is an end of a span. Surface 2·s is the entry and 2·s + 1 the exit of span s: the lowest
/// bit says exit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spans {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Depth of the near plane. The entry of a span that begins before it is `near`: the eye is inside.
    pub near: f32,
    /// Depth of the far plane.
    pub far: f32,
    /// First span of each pixel, and the number of all at the end: width·height + 1 numbers.
    pub starts: Vec<u32>,
    /// Depth of each surface, along the view's `forward`.
    pub depths: Vec<f32>,
    /// Pixels that had more spans than are stored, in order.
    pub extended: Vec<Extended>,
    /// The particle (in the order of the input) of each surface, [`Spans::NO_PARTICLE`] where it is
    /// none's; empty when not asked for.
    pub particles: Vec<u32>,
}

/// A pixel that had more spans than are stored: its last one reaches to the end of them all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extended {
    /// Which pixel, row by row.
    pub pixel: u32,
    /// How many spans it had.
    pub count: u32,
    /// Length of what is empty inside the last stored span, in depth.
    pub empty: f32,
}

impl Extended {
    /// That of a pixel, in a list in the order of pixels.
    pub(crate) fn of(list: &[Self], pixel: usize) -> Option<&Self> {
        let place = list.binary_search_by_key(&(pixel as u32), |e| e.pixel).ok()?;
        list.get(place)
    }
}

impl Spans {
    /// A surface that belongs to no particle: the end of a full cell, or the near or far plane in one.
    pub const NO_PARTICLE: u32 = u32::MAX;

    /// The stored spans of a pixel.
    #[inline]
    pub fn of(&self, pixel: usize) -> Range<usize> {
        self.starts[pixel] as usize..self.starts[pixel + 1] as usize
    }

    /// How many spans are stored.
    pub fn len(&self) -> usize {
        self.depths.len() / 2
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.depths.is_empty()
    }

    /// What a pixel had beyond what is stored, if it had.
    pub fn extended(&self, pixel: usize) -> Option<&Extended> {
        Extended::of(&self.extended, pixel)
    }

    /// How many spans a pixel truly has.
    pub fn count(&self, pixel: usize) -> u32 {
        self.extended(pixel).map_or(self.starts[pixel + 1] - self.starts[pixel], |e| e.count)
    }

    /// Bytes of all parts.
    pub fn bytes(&self) -> usize {
        (self.starts.len() + self.depths.len() + self.particles.len()) * 4
            + self.extended.len() * size_of::<Extended>()
    }
}
