//! More samples where they differ: adaptive antialiasing.
//!
//! Every pixel gets its samples. Where the standard error of their mean, s/√n with s² the variance of the n
//! samples, is more than the tolerance once it is shown, the pixel gets the greatest number of samples
//! instead, as if all pixels had it. What shows light x goes about as √x, so that an error e of a mean m is
//! seen as e/(2√m). Each pixel is judged by its own samples alone, so that tiles and threads do not
//! matter.

use crate::packet::LANES;
use crate::tile::{Pattern, Place, TILE_RAYS};

/// How far a pixel's samples may be from certain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive {
    /// Most samples of a pixel.
    pub most: u32,
    /// Greatest standard error of what is shown, white being 1.
    pub noise: f32,
    /// What light is multiplied by before it is shown.
    pub exposure: f32,
}

/// Means darker than this are judged as if they were this bright.
const DARK: f32 = 0.01;

/// The samples of the pixels of an area so far.
#[derive(Debug)]
pub(crate) struct Refine {
    /// Light of each ray of the part at hand, as it counts in its pixel.
    pub rays: Vec<[f32; 4]>,
    /// Which pixels of the part at hand are finished, row by row.
    pub finished_here: Vec<bool>,
    finished: Vec<bool>,
    pixels: Vec<Moments>,
}

/// What the samples of a pixel add up to, each cut at white.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u32,
    sum: [f32; 4],
    squares: [f32; 4],
}

impl Moments {
    #[inline(always)]
    fn add(&mut self, sample: [f32; 4], exposure: f32) {
        self.count += 1;
        for (channel, light) in sample.into_iter().enumerate() {
            // The fourth is how much of the pixel is covered, whatever the exposure.
            let scale = if channel == 3 { 1.0 } else { exposure };
            let value = (light * scale).min(1.0);
            self.sum[channel] += value;
            self.squares[channel] += value * value;
        }
    }

    fn is_certain(&self, noise: f32) -> bool {
        let n = self.count as f32;
        (0..4).all(|channel| {
            let mean = self.sum[channel] / n;
            let variance = (self.squares[channel] / n - mean * mean).max(0.0) * n / (n - 1.0);
            variance / n <= noise * noise * 4.0 * mean.max(DARK)
        })
    }
}

impl Refine {
    pub fn new() -> Self {
        Self {
            rays: vec![[0.0; 4]; TILE_RAYS],
            finished_here: Vec::new(),
            finished: Vec::new(),
            pixels: Vec::new(),
        }
    }

    /// Begins an area of so many pixels.
    pub fn begin(&mut self, pixels: usize) {
        self.finished.clear();
        self.finished.resize(pixels, false);
        self.pixels.clear();
        self.pixels.resize(pixels, Moments::default());
    }

    /// Begins a part of the area. Gives whether any of its pixels needs more.
    pub fn begin_part(&mut self, place: Place, part: Place) -> bool {
        self.rays.fill([0.0; 4]);
        self.finished_here.clear();
        for y in 0..part.size.1 {
            let from = at(place, part, (0, y));
            self.finished_here.extend(&self.finished[from..from + part.size.0 as usize]);
        }
        self.finished_here.iter().any(|finished| !finished)
    }

    /// Adds the samples of the part's rays, of which each counts `weight` in `color`.
    pub fn end_part(
        &mut self,
        (place, part): (Place, Place),
        (pattern, weight, exposure): (&Pattern, f32, f32),
        color: &mut [[f32; 4]],
    ) {
        for y in 0..part.size.1 {
            for x in 0..part.size.0 {
                let at = at(place, part, (x, y));
                if self.finished[at] {
                    continue;
                }
                let first = pattern.ray((x, y), 0);
                for light in &self.rays[first..first + pattern.samples as usize] {
                    for (sum, light) in color[at].iter_mut().zip(light) {
                        *sum += light;
                    }
                    self.pixels[at].add(light.map(|l| l / weight), exposure);
                }
            }
        }
    }

    /// Judges all pixels, and clears the colours of those that need more. Gives whether there are any.
    pub fn judge(&mut self, noise: f32, color: &mut [[f32; 4]]) -> bool {
        let mut any = false;
        for ((finished, pixel), color) in self.finished.iter_mut().zip(&self.pixels).zip(color) {
            *finished = pixel.is_certain(noise);
            if !*finished {
                *color = [0.0; 4];
                any = true;
            }
        }
        any
    }

    /// Adds the light of a block's rays.
    #[inline(always)]
    pub fn add(rays: &mut [[f32; 4]], block: usize, by_ray: &[[f32; 4]; LANES]) {
        for (sum, light) in rays[block * LANES..].iter_mut().zip(by_ray) {
            for (sum, light) in sum.iter_mut().zip(light) {
                *sum += light;
            }
        }
    }
}

/// Where a pixel of a part lies in its area.
fn at(place: Place, part: Place, (x, y): (u32, u32)) -> usize {
    let (dx, dy) = (part.corner.0 - place.corner.0, part.corner.1 - place.corner.1);
    ((dy + y) * place.size.0 + dx + x) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_samples_are_certain_and_an_edge_is_not() {
        let of = |samples: &[f32]| {
            let mut moments = Moments::default();
            samples.iter().for_each(|s| moments.add([*s; 4], 1.0));
            moments
        };
        assert!(of(&[0.3; 4]).is_certain(1e-4));
        // Half covered: s² = 1/3, an error of √(1/12) of a mean of 1/2 is seen as 0.204.
        assert!(!of(&[0.0, 1.0, 0.0, 1.0]).is_certain(0.203));
        assert!(of(&[0.0, 1.0, 0.0, 1.0]).is_certain(0.205));
        // Beyond white nothing differs.
        assert!(of(&[2.0, 5.0, 3.0, 9.0]).is_certain(1e-4));
    }
}
