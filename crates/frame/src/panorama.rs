//! Images of all directions, read: Radiance HDR, OpenEXR and PNG.

use std::path::Path;

use image::{DynamicImage, ImageReader, Limits};

use crate::{FrameError, Result, linear_from_srgb};

/// Most bytes that an image may take while it is read.
const MOST_BYTES: u64 = 4 << 30;

/// An image in linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Panorama {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue, row after row from the top.
    pub pixels: Vec<[f32; 3]>,
}

/// Reads an image: what it is, its first bytes say. Whole numbers are taken as sRGB, others as linear light.
///
/// # Errors
///
/// The file cannot be opened, is no such image, holds no pixel or is too large.
pub fn read_panorama(path: &Path) -> Result<Panorama> {
    let wrong = |reason: String| FrameError::NotAnImage { path: path.to_owned(), reason };
    let failed = |source| FrameError::File { path: path.to_owned(), source };
    let reader = ImageReader::open(path).map_err(failed)?.with_guessed_format().map_err(failed)?;
    let mut reader = reader;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| wrong(e.to_string()))?;
    let linear = matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let rgb = image.into_rgb32f();
    let (width, height) = (rgb.width() as usize, rgb.height() as usize);
    if width == 0 || height == 0 {
        return Err(wrong("no pixels".into()));
    }
    // Missing or endless light would spread over the picture.
    let light = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
    let of = |v: f32| light(if linear { v } else { linear_from_srgb(v) });
    let pixels = rgb.pixels().map(|p| p.0.map(of)).collect();
    Ok(Panorama { width, height, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, PngOptions, save, write_exr, write_png};

    fn frame() -> Frame {
        let color = (0..8).map(|i| [i as f32 / 7.0, 0.5, 0.25, 1.0]).collect();
        Frame::new(4, 2, color).unwrap()
    }

    #[test]
    fn what_was_written_is_read() {
        let folder = std::env::temp_dir().join(format!("motes-panorama-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (png, exr) = (folder.join("a.png"), folder.join("a.exr"));
        save(&png, |out| write_png(&frame(), PngOptions::default(), out)).unwrap();
        save(&exr, |out| write_exr(&frame(), out)).unwrap();
        for (path, tolerance) in [(&png, 5e-3), (&exr, 1e-6)] {
            let found = read_panorama(path).unwrap();
            assert_eq!((found.width, found.height), (4, 2));
            for (a, b) in found.pixels.iter().zip(frame().color()) {
                assert!((0..3).all(|i| (a[i] - b[i]).abs() < tolerance), "{a:?} {b:?}");
            }
        }
        let text = folder.join("a.txt");
        std::fs::write(&text, "no image").unwrap();
        let error = read_panorama(&text).unwrap_err().to_string();
        assert!(error.contains("a.txt"), "{error}");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn radiance_is_read() {
        let path = std::env::temp_dir().join(format!("motes-{}.hdr", std::process::id()));
        // Two pixels of mantissas and a common exponent: 128 with 129 is 1.
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
        bytes.extend([128, 64, 0, 129, 128, 128, 128, 131]);
        std::fs::write(&path, bytes).unwrap();
        let found = read_panorama(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(found.pixels, [[1.0, 0.5, 0.0], [4.0; 3]]);
    }
}
