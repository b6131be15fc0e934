//! What a hit looks like: Lambert under a soft key light and a fill from sky and ground.
//!
//! A surface of albedo ρ and unit normal n sends ρ·(key · reaching key + fill(n) · reaching fill +
//! ambient) to the eye.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::hits::Hits;
use crate::packet::LANES;
use crate::render::View;
use crate::tile::{RayTile, TILE_RAYS};

/// The colour of each particle.
pub trait Paint: Sync {
    /// Linear RGB, each in 0..=1, of a particle of a system by its index in the file's order.
    fn color(&self, system: u16, index: u32) -> Vec3;

    /// The one colour of all particles of a system, if they have one: then `color` is not asked.
    fn uniform(&self, _system: u16) -> Option<Vec3> {
        None
    }
}

/// Where the light of a tile's hits goes.
pub(crate) struct Canvas<'a> {
    /// Linear, premultiplied RGBA, row by row.
    pub color: &'a mut [[f32; 4]],
    /// Pixels in a row.
    pub width: u32,
    /// Where the tile begins.
    pub at: (u32, u32),
    /// What each sample counts.
    pub weight: f32,
}

/// Adds the light of a tile's hits to the canvas.
#[simd]
pub(crate) fn shade<S: Simd>(
    simd: S,
    (rays, hits, reaching): (&RayTile, &Hits, &Reaching),
    view: View<'_>,
    canvas: Canvas<'_>,
) {
    let lights = view.lights;
    let one_system = view.systems.len() == 1;
    let uniform = if one_system { view.paint.uniform(0) } else { None };
    let half = f32x16::splat(simd, 0.5);
    let sky = lights.sky - lights.ground;
    for block in (0..TILE_RAYS / LANES).filter(|block| hits.mask[*block] != 0) {
        let lanes = block * LANES..(block + 1) * LANES;
        let mut albedo = [[0.0; LANES]; 3];
        match uniform {
            Some(color) => {
                albedo = [[color.x; LANES], [color.y; LANES], [color.z; LANES]];
            }
            None => {
                let mut left = hits.mask[block];
                while left != 0 {
                    let lane = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let ray = block * LANES + lane;
                    let color = view.paint.color(rays.hit_system[ray], hits.index[ray]);
                    albedo[0][lane] = color.x;
                    albedo[1][lane] = color.y;
                    albedo[2][lane] = color.z;
                }
            }
        }
        let nx = f32x16::from_slice(simd, &hits.normal[0][lanes.clone()]);
        let ny = f32x16::from_slice(simd, &hits.normal[1][lanes.clone()]);
        let nz = f32x16::from_slice(simd, &hits.normal[2][lanes.clone()]);
        let key = f32x16::from_slice(simd, &reaching.key[lanes.clone()]);
        let fill = f32x16::from_slice(simd, &reaching.fill[lanes]);
        let up = nz * lights.up.z + ny * lights.up.y + nx * lights.up.x;
        let above = half * up + half;
        let mut light = [[0.0; LANES]; 3];
        for channel in 0..3 {
            let of_fill = above * sky[channel] + lights.ground[channel];
            let sum = key * lights.key.color[channel] + of_fill * fill + lights.ambient[channel];
            let sum = sum * f32x16::from_slice(simd, &albedo[channel]) * canvas.weight;
            sum.store_slice(&mut light[channel]);
        }
        let mut left = hits.mask[block];
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let (x, y) = rays.pattern.pixel(block * LANES + lane);
            let at = (canvas.at.1 + y) * canvas.width + canvas.at.0 + x;
            let sum = &mut canvas.color[at as usize];
            sum[0] += light[0][lane];
            sum[1] += light[1][lane];
            sum[2] += light[2][lane];
            sum[3] += canvas.weight;
        }
    }
}

/// What reaches the hits of a tile, as parts of what would reach them in the open.
#[derive(Debug)]
pub(crate) struct Reaching {
    /// Mean of visible · max(0, cosine) over the key light.
    pub key: Vec<f32>,
    /// Part of the cosine-weighted sky that is open.
    pub fill: Vec<f32>,
}

impl Reaching {
    pub fn new() -> Self {
        Self { key: vec![0.0; TILE_RAYS], fill: vec![1.0; TILE_RAYS] }
    }
}
