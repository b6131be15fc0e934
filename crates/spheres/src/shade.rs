//! What a hit looks like: Lambert under a soft key light and a fill from sky and ground.
//!
//! A surface of albedo ρ and unit normal n sends ρ·(key · reaching key + fill(n) · reaching fill +
//! ambient) to the eye.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::hits::Hits;
use crate::lanes::Lanes;
use crate::packet::LANES;
use crate::refine::Refine;
use crate::render::{Cap, View};
use crate::tile::{Pattern, RayTile, SIDE_BLOCKS, TILE_RAYS};

/// The colour of each particle.
pub trait Paint: Sync {
    /// Linear RGB, each in 0..=1, of a particle of a system by its index in the file's order.
    fn color(&self, system: u16, index: u32) -> Vec3;

    /// The one colour of all particles of a system, if they have one: then `color` is not asked.
    fn uniform(&self, _system: u16) -> Option<Vec3> {
        None
    }

    /// Linear RGB of the inside of a particle, where a cut has laid it open; `None`: as its outside.
    fn cap(&self, _system: u16, _index: u32, _cap: Cap) -> Option<Vec3> {
        None
    }

    /// How much of what lies behind it a particle hides: 0 nothing, 1 all.
    fn opacity(&self, _system: u16, _index: u32) -> f32 {
        1.0
    }

    /// Whether any particle's opacity is below 1; else `opacity` is not asked.
    fn translucent(&self) -> bool {
        false
    }
}

/// The colour of a particle, or of its inside.
#[inline(always)]
pub(crate) fn color_of(paint: &dyn Paint, system: u16, (index, cap): (u32, Option<Cap>)) -> Vec3 {
    let inside = cap.and_then(|cap| paint.cap(system, index, cap));
    inside.unwrap_or_else(|| paint.color(system, index))
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
    /// Of each ray, the part of its sample that this surface makes; none: the whole.
    pub parts: Option<&'a [f32]>,
    /// Light that comes by way of other surfaces, if it is looked for.
    pub bounced: Option<&'a [Lanes<f32>; 3]>,
    /// Where the light of single rays is added up instead, if their pixels' samples are compared.
    pub rays: Option<&'a mut [[f32; 4]]>,
}

/// Adds the light of a tile's hits to the canvas.
#[simd]
pub(crate) fn shade<S: Simd>(
    simd: S,
    (rays, hits, reaching): (&RayTile, &Hits, &Reaching),
    view: View<'_>,
    mut canvas: Canvas<'_>,
) {
    let lights = view.lights;
    let one_system = view.systems.len() == 1;
    let uniform = if one_system { view.paint.uniform(0) } else { None };
    let half = f32x16::splat(simd, 0.5);
    let sky = lights.sky - lights.ground;
    for block in (0..TILE_RAYS / LANES).filter(|block| hits.mask[*block] != 0) {
        let lanes = block * LANES..(block + 1) * LANES;
        let mut albedo = [[0.0; LANES]; 3];
        let capped = hits.capped && hits.cap[lanes.clone()].iter().any(|cap| *cap > 0);
        match uniform {
            Some(color) if !capped => {
                albedo = [[color.x; LANES], [color.y; LANES], [color.z; LANES]];
            }
            _ => {
                let mut left = hits.mask[block];
                while left != 0 {
                    let lane = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let ray = block * LANES + lane;
                    let of = (hits.index[ray], hits.cap_of(ray));
                    let color = color_of(view.paint, rays.hit_system[ray], of);
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
        let fill = f32x16::from_slice(simd, &reaching.fill[lanes.clone()]);
        let weight = match canvas.parts {
            None => f32x16::splat(simd, canvas.weight),
            Some(parts) => f32x16::from_slice(simd, &parts[lanes.clone()]) * canvas.weight,
        };
        let up = nz * lights.up.z + ny * lights.up.y + nx * lights.up.x;
        let above = half * up + half;
        let hit = mask32x16::from_bitmask(simd, u64::from(hits.mask[block]));
        let zero = f32x16::splat(simd, 0.0);
        let mut light = [zero; 4];
        for channel in 0..3 {
            let of_fill = above * sky[channel] + lights.ground[channel];
            let mut sum =
                key * lights.key.color[channel] + of_fill * fill + lights.ambient[channel];
            if let Some(bounced) = canvas.bounced {
                sum += f32x16::from_slice(simd, &bounced[channel][lanes.clone()]);
            }
            let albedo = f32x16::from_slice(simd, &albedo[channel]);
            light[channel] = hit.select(sum * albedo * weight, zero);
        }
        light[3] = hit.select(weight, zero);
        canvas.add(&rays.pattern, block, light);
    }
}

impl Canvas<'_> {
    /// Adds a block of one sample to a pixel, row by row, if all of it is on the canvas; else gives `false`.
    #[inline(always)]
    fn add_whole<S: Simd>(
        &mut self,
        pattern: &Pattern,
        block: usize,
        rows: [f32x16<S>; EDGE],
    ) -> bool {
        let width = self.width as usize;
        let x = self.at.0 as usize + block % SIDE_BLOCKS * EDGE;
        let y = self.at.1 as usize + block / SIDE_BLOCKS * EDGE;
        if pattern.samples > 1 || x + EDGE > width || (y + EDGE) * width > self.color.len() {
            return false;
        }
        for (row, light) in rows.into_iter().enumerate() {
            let from = (y + row) * width + x;
            let sum = self.color[from..from + EDGE].as_flattened_mut();
            (f32x16::from_slice(light.simd, sum) + light).store_slice(sum);
        }
        true
    }

    /// Adds the light of a block's rays to their pixels, always in the same order.
    #[inline(always)]
    fn add<S: Simd>(&mut self, pattern: &Pattern, block: usize, light: [f32x16<S>; 4]) {
        let [red, green, blue, cover] = light;
        let (rb_low, rb_high) = red.interleave(blue);
        let (gc_low, gc_high) = green.interleave(cover);
        // Red, green, blue and cover of one ray after another.
        let (first, second) = rb_low.interleave(gc_low);
        let (third, fourth) = rb_high.interleave(gc_high);
        if self.rays.is_none() && self.add_whole(pattern, block, [first, second, third, fourth]) {
            return;
        }
        let mut by_ray = [[0.0; 4]; LANES];
        let numbers: &mut [f32] = by_ray.as_flattened_mut();
        first.store_slice(&mut numbers[..LANES]);
        second.store_slice(&mut numbers[LANES..2 * LANES]);
        third.store_slice(&mut numbers[2 * LANES..3 * LANES]);
        fourth.store_slice(&mut numbers[3 * LANES..]);
        if let Some(rays) = &mut self.rays {
            return Refine::add(rays, block, &by_ray);
        }
        let side = pattern.side as usize;
        let samples = pattern.samples as usize;
        let (x, y) = (block % SIDE_BLOCKS * side, block / SIDE_BLOCKS * side);
        let (x, y) = (self.at.0 as usize + x, self.at.1 as usize + y);
        let width = self.width as usize;
        let height = self.color.len() / width;
        for row in 0..side.min(height.saturating_sub(y)) {
            let from = (y + row) * width + x;
            let pixels = side.min(width.saturating_sub(x));
            for (pixel, sum) in self.color[from..from + pixels].iter_mut().enumerate() {
                let first = (row * side + pixel) * samples;
                for ray in &by_ray[first..first + samples] {
                    for (sum, light) in sum.iter_mut().zip(ray) {
                        *sum += light;
                    }
                }
            }
        }
    }
}

/// Edge of a block of one sample to a pixel.
const EDGE: usize = 4;

/// What reaches the hits of a tile, as parts of what would reach them in the open.
#[derive(Debug)]
pub(crate) struct Reaching {
    /// Mean of visible · max(0, cosine) over the key light.
    pub key: Lanes<f32>,
    /// Part of the cosine-weighted sky that is open.
    pub fill: Lanes<f32>,
}

impl Reaching {
    pub fn new() -> Self {
        Self { key: Lanes::new(0.0, TILE_RAYS), fill: Lanes::new(1.0, TILE_RAYS) }
    }
}
