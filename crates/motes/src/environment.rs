//! What is around a liquid, by name.

use std::path::Path;

use glam::{DVec3, Vec3};
use motes_scene::{Bounds, Environment, Equirectangular, Floor, Resolved, Scene, Sky};

use crate::Result;

/// How much of the light on the floor is the sky's.
pub(crate) const FLOOR_FILL: f32 = 0.45;
/// What clear water takes of red, green and blue over the width of what is visible.
pub(crate) const WATER: DVec3 = DVec3::new(2.6, 0.75, 0.45);
/// Tiles of the floor over the width of what is visible.
const TILES: f64 = 8.0;

/// `sky`, `none`, or the path of an image of all directions; about the origin of the particles. `bounds` has all
/// that is visible, in world coordinates.
///
/// # Errors
/// The image cannot be read.
pub(crate) fn environment(
    name: &str,
    (scene, resolved): (&Scene, &Resolved),
    (bounds, origin): (Bounds, DVec3),
) -> Result<Environment> {
    let up = scene.camera.up_axis.vector();
    let sun = resolved.lights.key.direction;
    let background = &resolved.background;
    Ok(match name {
        "none" => {
            let (top, bottom) = (background.top, background.bottom);
            let sky = Sky::Gradient { up: up.as_vec3(), top, bottom };
            Environment { sky, floor: None }
        }
        "sky" => {
            let sky = Sky::Day { up: up.as_vec3(), sun };
            let across = bounds.diagonal();
            let lowest = bounds.corners().iter().map(|c| c.dot(up)).fold(f64::INFINITY, f64::min);
            let center = bounds.center();
            // Balls are larger than particles: what lies on the floor wets it.
            let point = center + up * (lowest - center.dot(up)) - origin;
            let floor = Floor {
                point: point.as_vec3(),
                up: up.as_vec3(),
                tile: (across / TILES) as f32,
                colors: [Vec3::new(0.80, 0.79, 0.76), Vec3::new(0.62, 0.64, 0.66)],
                fade: (3.0 * across) as f32,
            };
            Environment { sky, floor: Some(floor) }
        }
        path => Environment { sky: sky_of(path, up.as_vec3())?, floor: None },
    })
}

/// Reads an equirectangular image: `.exr` and `.hdr` in linear light, `.png` in sRGB.
///
/// # Errors
/// The file cannot be read, or is none of these.
fn sky_of(path: &str, up: Vec3) -> Result<Sky> {
    let image = motes_frame::read_panorama(Path::new(path))?;
    let ahead = up.any_orthonormal_vector();
    let (width, height) = (image.width, image.height);
    Ok(Sky::Image(Equirectangular { width, height, pixels: image.pixels, up, ahead }))
}
