//! Cues of depth and structure, drawn into a finished picture in one pass over its layers.
//!
//! Chaudhari, *Real-Time Cross-Sectioning of Dynamic Particle Systems*, §4, makes spheres dark at their
//! rims and gives them depth, so that ends of structures and intersections show; its model is Tarini,
//! Cignoni & Montani 2006, *Ambient Occlusion and Edge Cueing for Enhancing Real Time Molecular
//! Visualization*. Here, for each pixel:
//!
//! - **rim**: ρ(sin θ), θ being the angle between ray and normal: sphere by sphere, as the paper's sprites;
//! - **halo**: how much of the surroundings is nearer by more than a structure: dark behind what is before;
//! - **depth**: what is far fades into the background or towards a colour;
//! - **edges**: lines where what is behind is farther by more than a structure: where structures end;
//! - **seam**: lines where one surface goes through another.
//!
//! Layers know only the middle of each pixel. Lines lie between, where the surfaces say that they end or
//! meet (`lines.rs`), and what differs on their two sides is mixed by the parts of the pixel that they
//! have, so that nothing has stairs.

mod halo;
mod lines;
mod patch;

use fearless_simd::{Level, dispatch, f32x4, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use crate::{Background, Frame, FrameError, Result};
use halo::{Counts, Shade};
use lines::Lines;
use patch::{Layers, Patch};

/// Which cues a picture gets, and how. Colours are linear; widths are parts of the picture's height.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cues {
    /// The camera that the layers were seen by.
    pub eye: Eye,
    /// Distances between which what is seen lies, world units.
    pub range: [f32; 2],
    /// What is farther behind something than this is another structure, world units.
    pub structure: f32,
    /// Lines where structures end.
    pub edges: Option<Stroke>,
    /// Lines where surfaces intersect.
    pub seam: Option<Stroke>,
    /// Shade behind what is before; its width is how far it reaches.
    pub halo: Option<Stroke>,
    /// Rims of spheres; its width is a part of the sphere's radius.
    pub rim: Option<Stroke>,
    /// Fading with distance.
    pub depth: Option<Fade>,
}

/// A camera: unit vectors in world coordinates, and the size of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Eye {
    /// To the right in the picture.
    pub right: [f32; 3],
    /// Upward in the picture.
    pub up: [f32; 3],
    /// Into the picture.
    pub forward: [f32; 3],
    /// Edge of a pixel: at distance 1 in a perspective, in world units in a parallel projection.
    pub pixel: f32,
    /// Whether farther is smaller.
    pub perspective: bool,
}

/// Something dark or bright that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// 0 (nothing) … 1 (all of the colour).
    pub strength: f32,
    /// How wide it is.
    pub width: f32,
    /// What the picture's colours become.
    pub color: [f32; 3],
}

/// What becomes of colours with distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade {
    /// How much of the colour is gone at the far end of the range, 0 … 1.
    pub strength: f32,
    /// What it becomes; none: transparent, and so the background.
    pub color: Option<[f32; 3]>,
}

/// Rows of a picture that are painted by one thread, and columns of them at a time.
const ROWS: usize = 32;
const COLUMNS: usize = 128;

/// What the cues make of the surfaces in pixels, each 0 … 1.
#[derive(Debug, Default)]
struct Amounts {
    rim: Vec<f32>,
    halo: Vec<f32>,
    fade: Vec<f32>,
    /// Memory for halos.
    line: Vec<Counts>,
}

impl Cues {
    /// Draws the cues into the colours of `frame`, which are linear and premultiplied and have their tone, and puts
    /// `background` behind, while the rows are at hand. The layers stay as they are. The same bits for any number of
    /// threads.
    ///
    /// # Errors
    /// The frame has no layer of depth, or none of normals.
    pub fn draw(&self, frame: &mut Frame, background: Background, level: Level) -> Result<()> {
        let size = [frame.width(), frame.height()];
        if size[0] * size[1] == 0 || !self.any() {
            background.put_behind(frame);
            return Ok(());
        }
        let (color, layers) = frame.color_and_layers();
        let layers = Layers::of(layers, size)?;
        let shade = self.halo.map(|halo| Shade::new(self, halo, &layers, level));
        let rows = color.par_chunks_mut(ROWS * size[0]).enumerate();
        rows.for_each_init(Work::default, |work, (number, rows)| {
            let of = (&layers, shade.as_ref());
            dispatch!(level, simd => work.draw(simd, self, of, (number * ROWS, &mut *rows)));
            for (row, pixels) in rows.chunks_mut(size[0]).enumerate() {
                background.put_behind_row(pixels, (number * ROWS + row, size[1]));
            }
        });
        Ok(())
    }

    fn any(&self) -> bool {
        let strokes = [self.edges, self.seam, self.halo, self.rim];
        strokes.iter().flatten().any(|s| s.strength > 0.0)
            || self.depth.is_some_and(|depth| depth.strength > 0.0)
    }

    /// Whether it matters where one particle ends and another begins; else only what is far behind something does.
    fn any_particle(&self) -> bool {
        self.rim.is_some() || self.seam.is_some()
    }

    /// How much is gone of what is at `distance`.
    #[inline(always)]
    fn fade(&self, distance: f32) -> f32 {
        let [near, far] = self.range;
        let Some(depth) = self.depth else { return 0.0 };
        let t = ((distance - near) / (far - near).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        // A little of a bright background shows at once, a little of the dark hardly.
        depth.strength * if depth.color.is_none() { t * t } else { t }
    }
}

/// A patch of the picture while it is painted, with a margin around.
#[derive(Default)]
struct Work {
    patch: Patch,
    lines: Lines,
    amounts: Amounts,
    /// Memory for amounts that are mixed: rim, halo and fade by place.
    mixed: Vec<(usize, [f32; 3])>,
}

impl Work {
    /// Draws into `rows` of the picture, from `top` on, patch by patch.
    #[simd]
    fn draw<S: Simd>(
        &mut self,
        simd: S,
        cues: &Cues,
        (layers, shade): (&Layers<'_>, Option<&Shade>),
        (top, rows): (usize, &mut [[f32; 4]]),
    ) {
        let [width, height] = layers.size;
        let count = rows.len() / width;
        let width_px = |stroke: Option<Stroke>| stroke.map_or(0.0, |s| s.width * height as f32);
        let widths = [width_px(cues.edges), width_px(cues.seam)];
        // As far as the lines of a pixel reach.
        let margin = (0.5 * widths[0].max(widths[1])).ceil() as usize + 3;
        let around = top.saturating_sub(margin)..(top + count + margin).min(height);
        for left in (0..width).step_by(COLUMNS) {
            let right = (left + COLUMNS).min(width);
            let columns = left.saturating_sub(margin)..(right + margin).min(width);
            self.patch.load(layers, columns, around.clone());
            if self.patch.is_empty() {
                continue;
            }
            if cues.any_particle() {
                self.patch.tell_apart(layers);
            }
            let flagged = self.lines.flag(simd, cues, &self.patch);
            flagged.iter_mut().for_each(|flagged| *flagged |= cues.rim.is_some());
            self.patch.look(simd, (layers, &cues.eye), flagged);
            self.lines.find(simd, cues, &self.patch, widths);
            self.amounts.find(simd, cues, &self.patch, shade);
            self.mix([left, top], (&*rows, width));
            for row in 0..count {
                let pixels = &mut rows[row * width..][left..right];
                self.paint(simd, cues, [left, top + row], pixels);
            }
        }
    }

    /// Paints a row of `pixels` from (left, y) on.
    #[inline(always)]
    fn paint<S: Simd>(&self, simd: S, cues: &Cues, [left, y]: [usize; 2], row: &mut [[f32; 4]]) {
        let patch = &self.patch;
        let at = (y - patch.rows.start) * patch.columns.len() + left - patch.columns.start;
        let pixels = at..at + row.len();
        let amounts = &self.amounts;
        if let Some(rim) = cues.rim {
            tint(simd, row, rim.color, &amounts.rim[pixels.clone()]);
        }
        if let Some(halo) = cues.halo {
            tint(simd, row, halo.color, &amounts.halo[pixels.clone()]);
        }
        if let Some(seam) = cues.seam.filter(|_| !self.lines.seams.is_empty()) {
            tint(simd, row, seam.color, &self.lines.seams[pixels.clone()]);
        }
        match cues.depth {
            Some(Fade { color: Some(end), .. }) => {
                tint(simd, row, end, &amounts.fade[pixels.clone()]);
            }
            Some(_) => {
                for (pixel, fade) in row.iter_mut().zip(&amounts.fade[pixels.clone()]) {
                    (f32x4::from_slice(simd, &pixel[..]) * (1.0 - fade)).store_slice(pixel);
                }
            }
            None => {}
        }
        if let Some(Stroke { color: [r, g, b], .. }) = cues.edges
            && !self.lines.edges.is_empty()
        {
            let line = f32x4::from_slice(simd, &[r, g, b, 1.0]);
            for (pixel, part) in row.iter_mut().zip(&self.lines.edges[pixels]) {
                let color = f32x4::from_slice(simd, &pixel[..]);
                (color + (line - color) * *part).store_slice(pixel);
            }
        }
    }
}

/// Brings premultiplied colours by parts `amounts` of the way to another one that covers as much.
#[inline(always)]
fn tint<S: Simd>(simd: S, pixels: &mut [[f32; 4]], [r, g, b]: [f32; 3], amounts: &[f32]) {
    let end = f32x4::from_slice(simd, &[r, g, b, 1.0]);
    for (pixel, amount) in pixels.iter_mut().zip(amounts) {
        let color = f32x4::from_slice(simd, &pixel[..]);
        (color + (end * pixel[3] - color) * *amount).store_slice(pixel);
    }
}

impl Amounts {
    #[inline(always)]
    fn find<S: Simd>(&mut self, simd: S, cues: &Cues, patch: &Patch, shade: Option<&Shade>) {
        for values in [&mut self.rim, &mut self.halo, &mut self.fade] {
            values.resize(patch.distance.len(), 0.0);
        }
        if let Some(rim) = cues.rim {
            patch.rims(simd, (rim.width, rim.strength), &mut self.rim);
        }
        if let Some(shade) = shade {
            let width = patch.columns.len();
            for (row, y) in patch.rows.clone().enumerate() {
                let pixels = row * width..(row + 1) * width;
                let (distances, halo) = (&patch.distance[pixels.clone()], &mut self.halo[pixels]);
                let first = [patch.columns.start, y];
                shade.behind(simd, (first, &mut self.line), distances, halo);
            }
        }
        if cues.depth.is_some() {
            for (fade, distance) in self.fade.iter_mut().zip(&patch.distance) {
                // Surroundings, which are nowhere, do not fade.
                *fade = if *distance < f32::INFINITY { cues.fade(*distance) } else { 0.0 };
            }
        }
    }
}

impl Work {
    /// Gives neighbours their parts of the pixels in `rows` from (`left`, `top`) on.
    fn mix(&mut self, [left, top]: [usize; 2], (rows, width): (&[[f32; 4]], usize)) {
        let Self { patch, lines, amounts, mixed } = self;
        mixed.clear();
        for (at, other, part) in lines.shares() {
            let x = patch.columns.start + at % patch.columns.len();
            let y = patch.rows.start + at / patch.columns.len();
            if x < left || y < top {
                continue;
            }
            let Some(color) = rows.get((y - top) * width + x) else { continue };
            // Where nothing is, all that is seen is the neighbour; but surroundings are no thing.
            let nothing = patch.distance[at] == f32::INFINITY;
            let part = match (nothing, color[3] < 1.0) {
                (false, _) => part,
                (true, true) => 1.0,
                (true, false) => continue,
            };
            let mix = |of: &[f32]| of[at] + (of[other] - of[at]) * part;
            mixed.push((at, [mix(&amounts.rim), mix(&amounts.halo), mix(&amounts.fade)]));
        }
        for (at, [rim, halo, fade]) in mixed.drain(..) {
            (amounts.rim[at], amounts.halo[at], amounts.fade[at]) = (rim, halo, fade);
        }
    }
}

fn missing(layer: &'static str) -> FrameError {
    FrameError::NoLayer { layer }
}

/// 0 below `low`, 1 above `high`, smooth between.
fn smooth(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests;
