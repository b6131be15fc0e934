//! The picture as something to draw on.

use super::coverage::{Bounds, Coverage, Point};
use super::text::Text;
use crate::{Frame, linear_from_srgb, srgb_from_linear};

/// Colour of text and strokes; around them lies a faint halo of the opposite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ink {
    /// What stands out from the rim of the picture; a transparent one counts as paper.
    #[default]
    Auto,
    /// Nearly black.
    Dark,
    /// Nearly white.
    Light,
}

/// Where a text's anchor lies in it.
#[derive(Clone, Copy)]
pub(crate) enum Align {
    Left,
    Center,
}

/// A frame's colours with all that drawing needs to know.
pub(crate) struct Canvas<'a> {
    pub(crate) frame: &'a mut Frame,
    /// Colour of text and strokes, linear.
    pub(crate) ink: [f32; 3],
    /// Its opposite.
    pub(crate) paper: [f32; 3],
    /// Size of text in pixels per em; all else is measured in it.
    pub(crate) em: f32,
}

/// Opacity of the halo: enough to part text from particles, too little to be seen as a box. Dark needs more, because
/// light shines through it.
const LIGHT_HALO: f32 = 0.7;
const DARK_HALO: f32 = 0.85;

impl<'a> Canvas<'a> {
    /// Text is no smaller than `least` pixels, as far as the picture has room.
    pub(crate) fn new(frame: &'a mut Frame, ink: Ink, least: f32) -> Canvas<'a> {
        let dark = match ink {
            Ink::Auto => rim_brightness(frame) > 0.5,
            Ink::Dark => true,
            Ink::Light => false,
        };
        let grey = |level: f32| [linear_from_srgb(level); 3];
        // White paper is the page's own white, or the halo would show on it.
        let (ink, paper) = if dark { (grey(0.09), grey(1.0)) } else { (grey(0.97), grey(0.06)) };
        // 480 rows get 13 pixels, 1080 get 27, 2160 get 54; a tall narrow picture counts as wide as 4:5.
        let side = (frame.height() as f32).min(frame.width() as f32 * 0.8);
        let em = (0.025 * side).max((0.1 * side).min(least));
        Canvas { frame, ink, paper, em }
    }

    pub(crate) fn width(&self) -> f32 {
        self.frame.width() as f32
    }

    pub(crate) fn height(&self) -> f32 {
        self.frame.height() as f32
    }

    pub(crate) fn size(&self) -> [usize; 2] {
        [self.frame.width(), self.frame.height()]
    }

    /// Distance of everything from the picture's edge.
    pub(crate) fn margin(&self) -> f32 {
        1.2 * self.em
    }

    /// Width of a thin stroke: a whole number of pixels.
    pub(crate) fn stroke(&self) -> f32 {
        (self.em / 16.0).round().max(1.0)
    }

    /// Reach of a halo.
    pub(crate) fn halo(&self) -> f32 {
        0.22 * self.em
    }

    /// An empty shape over `bounds` with room for a halo.
    pub(crate) fn shape(&self, bounds: Bounds) -> Coverage {
        Coverage::new(bounds, self.halo(), self.size())
    }

    /// Writes text in ink with its halo; `at` is on the baseline.
    pub(crate) fn text(&mut self, text: &Text, at: Point, align: Align) {
        self.text_in(text, at, align, self.ink);
    }

    /// Writes text in a colour with its halo; `at` is on the baseline.
    pub(crate) fn text_in(&mut self, text: &Text, at: Point, align: Align, color: [f32; 3]) {
        let left = match align {
            Align::Left => at[0],
            Align::Center => at[0] - text.width / 2.0,
        };
        let mut shape = text.coverage([left, at[1]], self.halo(), self.size());
        self.halo_of(&shape);
        // In linear light thin dark strokes pale; this gives them their weight back.
        if color.iter().sum::<f32>() < self.paper.iter().sum() {
            shape.values.iter_mut().for_each(|v| *v = v.powf(0.7));
        }
        self.fill(&shape, color, 1.0);
    }

    /// The faint surround that parts a shape from what is behind it.
    pub(crate) fn halo_of(&mut self, shape: &Coverage) {
        let opacity = if self.paper[0] > self.ink[0] { LIGHT_HALO } else { DARK_HALO };
        self.fill(&shape.grown(self.halo()), self.paper, opacity);
    }

    /// Paints a shape.
    pub(crate) fn fill(&mut self, shape: &Coverage, color: [f32; 3], opacity: f32) {
        let ([left, top], [columns, _]) = (shape.origin, shape.size);
        for (i, coverage) in shape.values.iter().enumerate().filter(|(_, c)| **c > 0.0) {
            let at = [left + i % columns, top + i / columns];
            self.blend(at, color, coverage * opacity);
        }
    }

    /// Paints each pixel of a shape in the colour of its row.
    pub(crate) fn fill_rows(&mut self, shape: &Coverage, color: impl Fn(usize) -> [f32; 3]) {
        let ([left, top], [columns, rows]) = (shape.origin, shape.size);
        for row in 0..rows {
            let color = color(top + row);
            for column in 0..columns {
                let coverage = shape.values[row * columns + column];
                self.blend([left + column, top + row], color, coverage);
            }
        }
    }

    /// Premultiplied "over" of one pixel, which lies in the picture.
    fn blend(&mut self, [x, y]: [usize; 2], color: [f32; 3], opacity: f32) {
        if opacity <= 0.0 {
            return;
        }
        let index = y * self.frame.width() + x;
        let Some(pixel) = self.frame.color_mut().get_mut(index) else { return };
        let alpha = clipped(pixel[3], 1.0);
        for (under, over) in pixel.iter_mut().zip(color) {
            *under = over * opacity + clipped(*under, alpha) * (1.0 - opacity);
        }
        pixel[3] = opacity + alpha * (1.0 - opacity);
    }
}

/// `value` between 0 and `most`; NaN becomes 0, because `max` takes the number.
fn clipped(value: f32, most: f32) -> f32 {
    value.max(0.0).min(most)
}

/// Mean brightness to the eye (sRGB luma, 0 … 1) of the picture's outer eighth, over white paper.
fn rim_brightness(frame: &Frame) -> f32 {
    let (width, height) = (frame.width(), frame.height());
    // Some thousand pixels tell as much as all.
    let step = (width.max(height) / 64).max(1);
    let inner = |i: usize, size: usize| i >= size / 8 && i < size - size / 8;
    let (mut sum, mut count) = (0.0, 0.0);
    for y in (0..height).step_by(step) {
        for x in (0..width).step_by(step).filter(|x| !(inner(*x, width) && inner(y, height))) {
            let Some([r, g, b, a]) = frame.color().get(y * width + x) else { continue };
            let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            sum += srgb_from_linear(luminance + 1.0 - a.clamp(0.0, 1.0));
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 1.0 }
}
