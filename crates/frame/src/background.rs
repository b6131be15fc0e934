//! What stands behind the picture.

use rayon::prelude::*;

use crate::{Frame, linear_from_srgb, srgb_from_linear};

/// What stands behind the picture. Colours are linear, 0 … 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Background {
    /// Nothing: alpha stays.
    #[default]
    Transparent,
    /// One colour.
    Solid([f32; 3]),
    /// From one colour in the first row to another in the last, even to the eye (in sRGB values).
    Gradient {
        /// Colour of the first row.
        top: [f32; 3],
        /// Colour of the last row.
        bottom: [f32; 3],
    },
}

impl Background {
    /// Composites the premultiplied picture over this background.
    pub fn put_behind(self, frame: &mut Frame) {
        if self == Background::Transparent || frame.width() == 0 {
            return;
        }
        let (width, rows) = (frame.width(), frame.height());
        let all = frame.color_mut().par_chunks_mut(width).enumerate();
        all.for_each(|(row, pixels)| self.put_behind_row(pixels, (row, rows)));
    }

    /// Composites row `row` of `rows` over this background.
    pub(crate) fn put_behind_row(self, pixels: &mut [[f32; 4]], (row, rows): (usize, usize)) {
        if self == Background::Transparent {
            return;
        }
        let behind = self.in_row(row, rows);
        for pixel in pixels {
            let through = 1.0 - pixel[3].clamp(0.0, 1.0);
            for (over, under) in pixel.iter_mut().zip(behind) {
                *over += under * through;
            }
            pixel[3] = 1.0;
        }
    }

    fn in_row(self, row: usize, rows: usize) -> [f32; 3] {
        match self {
            Background::Transparent => [0.0; 3],
            Background::Solid(color) => color,
            Background::Gradient { top, bottom } => {
                let t = (row as f32 + 0.5) / rows.max(1) as f32;
                std::array::from_fn(|i| {
                    let (from, to) = (srgb_from_linear(top[i]), srgb_from_linear(bottom[i]));
                    linear_from_srgb(from + (to - from) * t)
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_covered_shows_half_of_the_background() {
        let mut frame = Frame::new(2, 1, vec![[0.5, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 1.0]]).unwrap();
        Background::Solid([0.0, 0.0, 1.0]).put_behind(&mut frame);
        assert_eq!(frame.color(), [[0.5, 0.0, 0.5, 1.0], [0.0, 1.0, 0.0, 1.0]]);
    }

    #[test]
    fn a_gradient_runs_from_top_to_bottom() {
        let mut frame = Frame::new(1, 256, vec![[0.0; 4]; 256]).unwrap();
        let gradient = Background::Gradient { top: [0.0; 3], bottom: [1.0; 3] };
        gradient.put_behind(&mut frame);
        let levels = crate::Rgba8::from(&frame).pixels;
        assert_eq!((levels[0], levels[255]), ([0, 0, 0, 255], [255; 4]));
        assert!(levels.is_sorted());
    }

    #[test]
    fn transparent_changes_nothing() {
        let mut frame = Frame::new(1, 1, vec![[0.1, 0.2, 0.3, 0.4]]).unwrap();
        Background::Transparent.put_behind(&mut frame);
        assert_eq!(frame.color(), [[0.1, 0.2, 0.3, 0.4]]);
    }
}
