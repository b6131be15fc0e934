//! How much two pictures differ, for tests.

use crate::{FrameError, Result, Rgba8};

/// How much two pictures of one size differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Largest difference of any channel, 0 … 255.
    pub max: u8,
    /// Number of pixels that differ in any channel.
    pub pixels: usize,
    /// Peak signal-to-noise ratio over all channels in dB; +∞ for equal pictures.
    pub psnr: f64,
}

/// Compares two pictures channel by channel, alpha included.
///
/// # Errors
///
/// If their sizes differ.
pub fn compare(a: &Rgba8, b: &Rgba8) -> Result<Difference> {
    let (expected, found) = ((a.width, a.height), (b.width, b.height));
    if expected != found || a.pixels.len() != b.pixels.len() {
        return Err(FrameError::PictureSize { expected, found });
    }
    let (mut max, mut pixels, mut squares) = (0, 0, 0_u64);
    for (p, q) in a.pixels.iter().zip(&b.pixels).filter(|(p, q)| p != q) {
        pixels += 1;
        for (x, y) in p.iter().zip(q) {
            let difference = x.abs_diff(*y);
            max = max.max(difference);
            squares += u64::from(difference).pow(2);
        }
    }
    let mean_square = squares as f64 / (4 * a.pixels.len().max(1)) as f64;
    Ok(Difference { max, pixels, psnr: 10.0 * (255.0_f64.powi(2) / mean_square).log10() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey() -> Rgba8 {
        Rgba8 { width: 8, height: 4, pixels: vec![[100, 100, 100, 255]; 32] }
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let same = Difference { max: 0, pixels: 0, psnr: f64::INFINITY };
        assert_eq!(compare(&grey(), &grey()).unwrap(), same);
    }

    #[test]
    fn one_changed_channel_of_one_pixel_is_found() {
        let mut changed = grey();
        changed.pixels[17][2] = 101;
        let difference = compare(&grey(), &changed).unwrap();
        assert_eq!((difference.max, difference.pixels), (1, 1));
        // 10 log₁₀(255² · 128 / 1²)
        assert!((difference.psnr - 69.2029).abs() < 1e-3);
    }

    #[test]
    fn other_sizes_are_refused() {
        let turned = Rgba8 { width: 4, height: 8, ..grey() };
        let message = compare(&grey(), &turned).unwrap_err().to_string();
        assert_eq!(message, "expected a picture of 8×4 pixels, found 4×8");
    }
}
