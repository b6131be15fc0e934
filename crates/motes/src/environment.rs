//! Images of all directions, from files.

use std::path::Path;

use glam::Vec3;
use motes_scene::{Equirectangular, Sky};

use crate::Result;

/// Reads an equirectangular image: `.exr` and `.hdr` in linear light, `.png` in sRGB.
///
/// # Errors
/// The file cannot be read, or is none of these.
pub(crate) fn sky_of(path: &str, up: Vec3) -> Result<Sky> {
    let image = motes_frame::read_panorama(Path::new(path))?;
    let ahead = up.any_orthonormal_vector();
    let (width, height) = (image.width, image.height);
    Ok(Sky::Image(Equirectangular { width, height, pixels: image.pixels, up, ahead }))
}
