//! Translucent: light that goes straight through is absorbed and scattered on the way.
//!
//! Zirr & Dachsbacher 2015, §3.5. With extinction e = absorption + scattering, what is left of the light behind
//! a span of length s is exp(−e·s); the rest of it, scattering/e of it, is replaced by the light that falls onto the
//! span's entry. The first surface mirrors the surroundings, by Fresnel. Sixteen pixels at a time.

use fearless_simd::{Simd, dispatch, f32x16, i32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::{Projection, Sight, exp};

use crate::refract::Paths;
use crate::shade::{Around, Pixel, key_on};

const LANES: usize = 16;

/// A number for each pixel.
type Lanes = [f32; LANES];
type Vec3x16<S> = [f32x16<S>; 3];

/// What is worked out for sixteen pixels.
struct Seen {
    /// What their spans scatter to the eye.
    light: [Lanes; 3],
    /// What is left of the light from behind.
    left: [Lanes; 3],
    /// Where the first surface mirrors to.
    mirrored: [Lanes; 3],
    /// How much.
    reflectance: Lanes,
}

/// A span of each of sixteen pixels: nearness of its ends, what is empty in it, normal, colour and light at its
/// entry. Where there is none, its ends are one.
struct Slot {
    ends: [Lanes; 2],
    empty: Lanes,
    normal: [u32; LANES],
    color: [Lanes; 3],
    key: Lanes,
    open: Lanes,
}

impl Paths<'_> {
    /// Adds the light of the pixels that wait to a row.
    pub(crate) fn translucent(&mut self, row: &mut [[f32; 4]]) {
        let pixels = std::mem::take(&mut self.waiting);
        for pixels in pixels.chunks(LANES) {
            let seen = dispatch!(self.around.level, simd => see(simd, self, pixels));
            for (lane, pixel) in pixels.iter().enumerate() {
                self.add_seen((pixel, &seen, lane), row);
            }
        }
        self.waiting = pixels;
        self.waiting.clear();
    }

    fn add_seen(&mut self, (pixel, seen, lane): (&Pixel, &Seen, usize), row: &mut [[f32; 4]]) {
        let of = |lanes: &[Lanes; 3]| Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane]);
        let surfaces = self.surfaces;
        let mut thrown = 0.0;
        // An eye inside sees no mirror.
        let first = surfaces.of(pixel.index).next();
        if let Some(first) = first.filter(|first| surfaces.depth(*first) > surfaces.view.near) {
            thrown = seen.reflectance[lane];
            let [x, y] = pixel.place.map(|i| i as f32 + 0.5);
            let origin = surfaces.view.point([x, y], surfaces.nearness[first]);
            let sight = Sight { origin, direction: of(&seen.mirrored), ..pixel.sight() };
            self.look(pixel, sight, Vec3::splat(thrown));
        }
        let through = of(&seen.left) * (1.0 - thrown);
        let alpha = match self.around.shown || pixel.stop < f32::INFINITY {
            true => {
                self.look(pixel, pixel.sight(), through);
                1.0
            }
            // The floor is not the background.
            false => 1.0 - through.element_sum() / 3.0,
        };
        let light = (of(&seen.light) * (1.0 - thrown)).extend(alpha) * pixel.share;
        let to = &mut row[pixel.to as usize];
        for (to, light) in to.iter_mut().zip(light.to_array()) {
            *to += light;
        }
    }

    /// Span number `s` of each pixel.
    fn slot(&self, pixels: &[Pixel], s: usize) -> Slot {
        let Self { surfaces, around, .. } = self;
        let mut slot = Slot {
            ends: [[1.0; LANES]; 2],
            empty: [0.0; LANES],
            normal: [0; LANES],
            color: around.color.to_array().map(|c| [c; LANES]),
            key: [1.0; LANES],
            open: [1.0; LANES],
        };
        for (lane, pixel) in pixels.iter().enumerate() {
            let of = surfaces.of(pixel.index);
            let entry = of.start + 2 * s;
            if entry >= of.end {
                continue;
            }
            let stop = surfaces.view.nearness(pixel.stop);
            let ends = [0, 1].map(|i| surfaces.nearness[entry + i].max(stop));
            (slot.ends[0][lane], slot.ends[1][lane]) = (ends[0], ends[1]);
            slot.normal[lane] = surfaces.normals[entry];
            if entry + 2 == of.end {
                slot.empty[lane] = surfaces.empty(pixel.index);
            }
            if around.paint.is_some() {
                let color = around.color_at(surfaces, (pixel.place, entry)).to_array();
                for (lanes, color) in slot.color.iter_mut().zip(color) {
                    lanes[lane] = color;
                }
            }
            if is_own(around) {
                slot.key[lane] = key_on(surfaces, (pixel, entry), around);
            }
            if let Some(occlusion) = around.occlusion {
                slot.open[lane] = occlusion.open(surfaces, (pixel.place, entry));
            }
        }
        slot
    }
}

/// Whether the key light on each point is its own, not the same for all points with one normal.
fn is_own(around: &Around<'_>) -> bool {
    around.shadow.is_some() || around.lights.key.lamp.is_some()
}

#[simd]
fn see<S: Simd>(simd: S, paths: &Paths<'_>, pixels: &[Pixel]) -> Seen {
    let Paths { surfaces, optics, around, ior, .. } = paths;
    let lights = around.lights;
    let [zero, one] = [f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0)];
    let mut way = [[0.0; LANES]; 3];
    let mut most = 0;
    for (lane, pixel) in pixels.iter().enumerate() {
        way[0][lane] = pixel.direction.x;
        way[1][lane] = pixel.direction.y;
        way[2][lane] = pixel.direction.z;
        most = most.max(surfaces.of(pixel.index).len() / 2);
    }
    let way = [load(simd, &way[0]), load(simd, &way[1]), load(simd, &way[2])];
    let per_depth = one / dot(simd, way, surfaces.view.rays.forward);
    let extinction = optics.absorption + optics.scattering;
    let albedo = optics.scattering / extinction.max(Vec3::splat(f32::MIN_POSITIVE));
    let mut light = [zero; 3];
    let mut left = [one; 3];
    let mut first = [zero; 3];
    for s in 0..most {
        let slot = paths.slot(pixels, s);
        let [near, back] = [load(simd, &slot.ends[0]), load(simd, &slot.ends[1])];
        let depth = match surfaces.view.rays.projection {
            Projection::Perspective => one / back - one / near,
            Projection::Orthographic => near - back,
        };
        let length = (depth - load(simd, &slot.empty)).max(zero) * per_depth;
        let normal = unpack(simd, &slot.normal);
        if s == 0 {
            first = normal;
        }
        let key = match is_own(around) {
            true => load(simd, &slot.key),
            false => dot(simd, normal, lights.key.direction).max(zero),
        };
        let open = load(simd, &slot.open);
        let half = f32x16::splat(simd, 0.5);
        let upward = half.mul_add_precise(dot(simd, normal, lights.up), half);
        for c in 0..3 {
            let through = exp(simd, length * f32x16::splat(simd, -extinction[c]));
            let sky = f32x16::splat(simd, lights.sky[c] - lights.ground[c]);
            let fill = upward.mul_add_precise(sky, f32x16::splat(simd, lights.ground[c]));
            let lit = key.mul_add_precise(
                f32x16::splat(simd, lights.key.color[c]),
                fill.mul_add_precise(open, f32x16::splat(simd, lights.ambient[c])),
            );
            let scattered = f32x16::splat(simd, albedo[c]) * load(simd, &slot.color[c]) * lit;
            light[c] = (left[c] * (one - through)).mul_add_precise(scattered, light[c]);
            left[c] *= through;
        }
    }
    let (mirrored, reflectance) = mirror(simd, (way, first), 1.0 / ior);
    let mut seen = Seen {
        light: [[0.0; LANES]; 3],
        left: [[0.0; LANES]; 3],
        mirrored: [[0.0; LANES]; 3],
        reflectance: [0.0; LANES],
    };
    for c in 0..3 {
        light[c].store_slice(&mut seen.light[c]);
        left[c].store_slice(&mut seen.left[c]);
        mirrored[c].store_slice(&mut seen.mirrored[c]);
    }
    reflectance.store_slice(&mut seen.reflectance);
    seen
}

#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &Lanes) -> f32x16<S> {
    f32x16::from_slice(simd, lanes)
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: Vec3x16<S>, b: Vec3) -> f32x16<S> {
    let [x, y, z] = [b.x, b.y, b.z];
    a[0] * f32x16::splat(simd, x) + a[1] * f32x16::splat(simd, y) + a[2] * f32x16::splat(simd, z)
}

/// The unit vectors of words as in `normals.rs`.
#[inline(always)]
fn unpack<S: Simd>(simd: S, words: &[u32; LANES]) -> Vec3x16<S> {
    let words: i32x16<S> = u32x16::from_slice(simd, words).bitcast();
    let scale = f32x16::splat(simd, 1.0 / 32767.0);
    let [zero, one] = [f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0)];
    let x: f32x16<S> = ((words << 16_u32) >> 16_u32).to_float();
    let y: f32x16<S> = (words >> 16_u32).to_float();
    let (x, y) = (x * scale, y * scale);
    let z = one - x.abs() - y.abs();
    // The lower half is folded out.
    let fold = (zero - z).max(zero);
    let x = x - fold.copysign(x);
    let y = y - fold.copysign(y);
    let scale = one / (x * x + y * y + z * z).sqrt();
    [x * scale, y * scale, z * scale]
}

/// Where light that goes a `way` is mirrored to by surfaces with a `normal`, and how much of it, as by
/// [`motes_scene::optics::split`].
#[inline(always)]
fn mirror<S: Simd>(
    simd: S,
    (way, normal): (Vec3x16<S>, Vec3x16<S>),
    eta: f32,
) -> (Vec3x16<S>, f32x16<S>) {
    let [zero, one] = [f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0)];
    let eta = f32x16::splat(simd, eta);
    let cos = zero - (way[0] * normal[0] + way[1] * normal[1] + way[2] * normal[2]);
    let cos1 = cos.max(zero).min(one);
    let mut out = way;
    for (out, normal) in out.iter_mut().zip(normal) {
        *out = normal.mul_add_precise(cos1 + cos1, *out);
    }
    let square = out[0] * out[0] + out[1] * out[1] + out[2] * out[2];
    let some = square.simd_gt(f32x16::splat(simd, 1e-20));
    let scale = one / some.select(square, one).sqrt();
    for (out, normal) in out.iter_mut().zip(normal) {
        *out = some.select(*out * scale, normal);
    }
    let sin2 = eta * eta * (one - cos1 * cos1);
    let whole = sin2.simd_ge(one);
    let cos2 = (one - sin2).max(zero).sqrt();
    let s = (eta * cos1 - cos2) / (eta * cos1 + cos2);
    let p = (cos1 - eta * cos2) / (cos1 + eta * cos2);
    let part = f32x16::splat(simd, 0.5) * (s * s + p * p);
    (out, whole.select(one, part))
}
