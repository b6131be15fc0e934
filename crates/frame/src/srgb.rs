//! The sRGB transfer function (IEC 61966-2-1) and eight-bit pictures.
//!
//! encoded = 12.92 x                      for x ≤ 0.003 130 8
//! encoded = 1.055 x^(1/2.4) − 0.055      otherwise
//!
//! Eight bits are `round(255 · encoded)`. Instead of a power for each value, the float's own bits look up
//! the result at the start of a narrow bin, and one comparison with the next threshold settles it; the
//! thresholds come from the formula in f64, so the rounding is exact.

use std::sync::LazyLock;

use rayon::prelude::*;

use crate::Frame;

/// Encodes linear light in 0 … 1 by the sRGB curve; out of range is clamped, NaN gives 0.
pub fn srgb_from_linear(linear: f32) -> f32 {
    encoded(f64::from(linear).clamp(0.0, 1.0).max(0.0)) as f32
}

/// The linear light of an sRGB value in 0 … 1; out of range is clamped, NaN gives 0.
pub fn linear_from_srgb(encoded: f32) -> f32 {
    let e = f64::from(encoded).clamp(0.0, 1.0).max(0.0);
    (if e <= 0.040_45 { e / 12.92 } else { ((e + 0.055) / 1.055).powf(2.4) }) as f32
}

fn encoded(x: f64) -> f64 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn level_by_formula(x: f32) -> u8 {
    (255.0 * encoded(f64::from(x).clamp(0.0, 1.0))).round() as u8
}

/// Values below this encode to 0 whatever they are: 2⁻¹³ · 12.92 · 255 < ½.
const SMALLEST: f32 = 1.0 / 8192.0;
/// A bin is one 128th of an octave; no bin holds two thresholds.
const BIN_SHIFT: u32 = 23 - 7;

struct Levels {
    /// `above[k]`: the smallest float that encodes to k + 1.
    above: [f32; 256],
    /// Level of the first float of each bin from `SMALLEST` up to 1.
    start: [u8; 13 * 128],
}

static LEVELS: LazyLock<Levels> = LazyLock::new(|| {
    let mut above = [f32::INFINITY; 256];
    for (level, threshold) in above.iter_mut().take(255).enumerate() {
        // Positive floats are ordered like their bits.
        let (mut low, mut high) = (0.0_f32.to_bits(), 1.0_f32.to_bits());
        while high - low > 1 {
            let middle = low.midpoint(high);
            let reached = usize::from(level_by_formula(f32::from_bits(middle))) > level;
            *(if reached { &mut high } else { &mut low }) = middle;
        }
        *threshold = f32::from_bits(high);
    }
    let first = SMALLEST.to_bits() >> BIN_SHIFT;
    let start = std::array::from_fn(|bin| {
        level_by_formula(f32::from_bits((first + bin as u32) << BIN_SHIFT))
    });
    Levels { above, start }
});

impl Levels {
    fn of(&self, linear: f32) -> u8 {
        // `max` turns NaN into 0.
        let bin = linear.max(0.0).to_bits() >> BIN_SHIFT;
        let Some(bin) = bin.checked_sub(SMALLEST.to_bits() >> BIN_SHIFT) else { return 0 };
        let Some(&level) = self.start.get(bin as usize) else { return 255 };
        level + u8::from(linear >= self.above[usize::from(level)])
    }
}

/// A picture of eight-bit sRGB values with straight (not premultiplied) alpha, row 0 on top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgba8 {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Red, green, blue and alpha of each of the `width · height` pixels.
    pub pixels: Vec<[u8; 4]>,
}

impl From<&Frame> for Rgba8 {
    /// Encodes the frame's colours; alpha is linear, a pixel of no opacity becomes transparent black.
    fn from(frame: &Frame) -> Rgba8 {
        let levels = &*LEVELS;
        let pixels = frame.color().par_iter().with_min_len(1 << 14).map(|c| encode(levels, *c));
        Rgba8 { width: frame.width(), height: frame.height(), pixels: pixels.collect() }
    }
}

fn encode(levels: &Levels, [r, g, b, a]: [f32; 4]) -> [u8; 4] {
    if a >= 1.0 {
        return [levels.of(r), levels.of(g), levels.of(b), 255];
    }
    let alpha = (a.max(0.0) * 255.0 + 0.5) as u8;
    if alpha == 0 {
        return [0; 4];
    }
    [levels.of(r / a), levels.of(g / a), levels.of(b / a), alpha]
}

/// Encodes without alpha: the premultiplied colour as it is, which is the picture over black. Three bytes a
/// pixel.
pub fn rgb8(frame: &Frame) -> Vec<u8> {
    let levels = &*LEVELS;
    let mut bytes = vec![0; frame.color().len() * 3];
    let pixels = bytes.par_chunks_exact_mut(3).with_min_len(1 << 14);
    pixels.zip(frame.color()).for_each(|(out, [r, g, b, _])| {
        out.copy_from_slice(&[levels.of(*r), levels.of(*g), levels.of(*b)]);
    });
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_equals_the_formula_beside_every_threshold() {
        let levels = &*LEVELS;
        for threshold in &levels.above[..255] {
            for step in -2_i32..=2 {
                let x = f32::from_bits(threshold.to_bits().wrapping_add_signed(step));
                assert_eq!(levels.of(x), level_by_formula(x), "{x:e}");
            }
        }
    }

    #[test]
    fn the_table_equals_the_formula_all_the_way() {
        let levels = &*LEVELS;
        for bits in (0..0x3f80_0000_u32).step_by(997) {
            let x = f32::from_bits(bits);
            assert_eq!(levels.of(x), level_by_formula(x), "{x:e}");
        }
    }

    #[test]
    fn known_values_and_nonsense() {
        let levels = &*LEVELS;
        for (x, level) in [(0.0, 0), (1.0, 255), (0.5, 188), (0.214_041_14, 128), (0.002, 7)] {
            assert_eq!(levels.of(x), level, "{x}");
        }
        for (x, level) in [(f32::NAN, 0), (-1.0, 0), (f32::INFINITY, 255), (1e30, 255), (-0.0, 0)] {
            assert_eq!(levels.of(x), level, "{x}");
        }
    }

    #[test]
    fn each_level_comes_back() {
        for level in 0..=255_u8 {
            assert_eq!(LEVELS.of(linear_from_srgb(f32::from(level) / 255.0)), level);
            let back = srgb_from_linear(linear_from_srgb(f32::from(level) / 255.0));
            assert!((back - f32::from(level) / 255.0).abs() < 1e-6);
        }
    }

    #[test]
    fn premultiplied_colours_are_divided_by_alpha() {
        let half_red = [0.5, 0.0, 0.0, 0.5];
        assert_eq!(encode(&LEVELS, half_red), [255, 0, 0, 128]);
        assert_eq!(encode(&LEVELS, [0.3, 0.3, 0.3, 0.0]), [0; 4]);
        assert_eq!(encode(&LEVELS, [f32::NAN; 4]), [0; 4]);
    }
}
