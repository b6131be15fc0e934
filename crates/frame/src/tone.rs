//! Exposure and tone curve: from scene light to what a screen shows.
//!
//! `Filmic` is the curve of J. Hable, "Uncharted 2: HDR Lighting" (GDC 2010), each channel by itself:
//!
//! h(x) = (x (A x + C B) + D E) / (x (A x + B) + D F) − E / F
//! y    = h(2 x) / h(11.2)
//!
//! A = 0.15, B = 0.50, C = 0.10, D = 0.20, E = 0.02, F = 0.30; 0 stays 0, light of 5.6 becomes white.

use rayon::prelude::*;

use crate::Frame;

/// How light becomes a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tone {
    /// Brightening in stops: light is multiplied by 2 to this power.
    pub exposure: f32,
    /// What then happens to it.
    pub curve: Curve,
}

/// The curve from exposed light to the screen's linear 0 … 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curve {
    /// As it is, clipped at 1: colour maps keep their colours.
    #[default]
    Standard,
    /// Hable's filmic curve: highlights roll off softly.
    Filmic,
}

impl Tone {
    /// Applies exposure and curve to the frame's colours; alpha stays.
    pub fn apply(self, frame: &mut Frame) {
        let gain = self.exposure.exp2();
        // Premultiplied colours between black and white need no work.
        if self == Tone::default() {
            return;
        }
        frame.color_mut().par_iter_mut().with_min_len(1 << 14).for_each(|pixel| {
            let [r, g, b, a] = *pixel;
            if a > 0.0 {
                let map = |c: f32| self.curve.of(c / a * gain) * a;
                *pixel = [map(r), map(g), map(b), a];
            }
        });
    }
}

impl Curve {
    fn of(self, x: f32) -> f32 {
        match self {
            Curve::Standard => x,
            Curve::Filmic => (hable(2.0 * x.clamp(0.0, 5.6)) / hable(11.2)).clamp(0.0, 1.0),
        }
    }
}

fn hable(x: f32) -> f32 {
    (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.50) + 0.06) - 0.02 / 0.30
}

#[cfg(test)]
mod tests {
    use super::*;

    fn toned(tone: Tone, color: [f32; 4]) -> [f32; 4] {
        let mut frame = Frame::new(1, 1, vec![color]).unwrap();
        tone.apply(&mut frame);
        frame.color()[0]
    }

    #[test]
    fn the_default_changes_no_bit() {
        let color = [0.1, 2.0, -0.3, 0.7];
        assert_eq!(toned(Tone::default(), color), color);
    }

    #[test]
    fn a_stop_doubles_light_but_not_alpha() {
        let tone = Tone { exposure: 1.0, curve: Curve::Standard };
        assert_eq!(toned(tone, [0.25, 0.5, 0.0, 0.5]), [0.5, 1.0, 0.0, 0.5]);
    }

    #[test]
    fn filmic_keeps_black_reaches_white_and_never_falls() {
        assert!(Curve::Filmic.of(0.0).abs() < 1e-6);
        assert_eq!(Curve::Filmic.of(5.6), 1.0);
        assert_eq!(Curve::Filmic.of(f32::INFINITY), 1.0);
        let curve: Vec<f32> = (0..1000).map(|i| Curve::Filmic.of(i as f32 * 0.006)).collect();
        assert!(curve.is_sorted());
        // By hand from the formula: h(0.36) / h(11.2).
        assert!((Curve::Filmic.of(0.18) - 0.1283).abs() < 1e-4);
    }
}
