//! Depth of field: rays through a thin lens.
//!
//! All rays of a place of the picture meet where the pinhole's ray through it crosses the plane at the
//! distance of focus: a ray from the point o + l of the lens goes to o + d·focus/(d·f), with o the eye,
//! d the pinhole's direction and f the axis. (Cook, Porter, Carpenter 1984, *Distributed Ray Tracing*.)

use glam::Vec3;
use motes_scene::{Lens, Rays};

use crate::occlude::turn;
use crate::packet::BLOCKED;
use crate::tile::{RayTile, TILE_RAYS};

/// Steps of the additive sequence that covers a square evenly (Roberts' R₂).
const STEPS: [f32; 2] = [0.754_877_7, 0.569_840_3];

/// Lets the rays of a tile, aimed from the pinhole, start on the lens. `corner` is the tile's first
/// pixel, `first_sample` the number of its first sample among those of the pixel.
pub(crate) fn bend(
    tile: &mut RayTile,
    (rays, lens): (&Rays, Lens),
    (corner, first_sample): ((u32, u32), u32),
) {
    for ray in (0..TILE_RAYS).filter(|ray| tile.distance[*ray] != BLOCKED || *ray == 0) {
        let (x, y) = tile.pattern.pixel_of(ray);
        let sample = first_sample + tile.pattern.sample(ray);
        let turned = turn(corner.0 + x, corner.1 + y);
        let on_lens = on_disc(sample, turned) * lens.radius;
        let origin = rays.origin + rays.right * on_lens.x + rays.up * on_lens.y;
        let direction = tile.direction_of(ray);
        let sharp = rays.origin + direction * (lens.focus / direction.dot(rays.forward));
        let direction = (sharp - origin).normalize();
        for axis in 0..3 {
            tile.origin[axis][ray] = origin[axis];
            tile.direction[axis][ray] = direction[axis];
        }
    }
    tile.eye = None;
}

/// Point number `sample` of a unit disc: evenly spread for any number of samples, and in each pixel
/// shifted and turned by its own `turn`.
fn on_disc(sample: u32, turn: u32) -> Vec3 {
    let shift = |step: f32| (turn as f32 + 0.5) * step;
    let [a, b] = STEPS.map(|step| (sample as f32 * step + shift(step * step)).fract());
    let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
    Vec3::new(cos, sin, 0.0) * a.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_cover_the_lens_evenly() {
        for turn in 0..64 {
            let all: Vec<Vec3> = (0..256).map(|sample| on_disc(sample, turn)).collect();
            assert!(all.iter().all(|p| p.length() <= 1.0));
            // The mean of a disc is its middle, that of the squared distance from it one half.
            assert!((all.iter().sum::<Vec3>() / 256.0).length() < 0.03);
            let square = all.iter().map(|p| p.length_squared()).sum::<f32>() / 256.0;
            assert!((square - 0.5).abs() < 0.02, "{square}");
        }
    }
}
