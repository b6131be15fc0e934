//! Where a ray in a cell crosses the threshold.
//!
//! In a cell the density is trilinear between the corners; along a ray, with s from 0 where it enters to 1
//! where it leaves, that is a cubic. Its signs at quarters of the way tell the quarter of the first crossing,
//! and cuts at the false position where in it: "more precise surface position can be
//! obtained by using internal divisions" (Yasuda et al. 2009, §3).

use fearless_simd::{f32x16, mask32x16, prelude::*};

/// Times that the stretch with the crossing is cut.
const STEPS: usize = 2;
/// Parts of the way.
const PARTS: usize = 4;

/// Sixteen rays in their cells.
pub(crate) struct Corners<S: Simd> {
    /// Density less the threshold at the corners: x fastest, then y, then z.
    pub values: [f32x16<S>; 8],
    /// Where each ray enters, from the first corner.
    pub place: [f32x16<S>; 3],
    /// From there to where it leaves.
    pub way: [f32x16<S>; 3],
}

/// c₀ + c₁s + c₂s² + c₃s³.
#[derive(Clone, Copy)]
struct Cubic<S: Simd>([f32x16<S>; 4]);

impl<S: Simd> Cubic<S> {
    #[inline(always)]
    fn at(&self, s: f32x16<S>) -> f32x16<S> {
        let [c0, c1, c2, c3] = self.0;
        c3.mul_add(s, c2).mul_add(s, c1).mul_add(s, c0)
    }

    /// The density along rays.
    #[inline(always)]
    fn new(corners: &Corners<S>) -> Self {
        let v = &corners.values;
        let [x, y, z] = corners.place;
        let [a, b, c] = corners.way;
        // k + kx·x + ky·y + kz·z + kxy·xy + kyz·yz + kzx·zx + kxyz·xyz
        let (kx, ky, kz) = (v[1] - v[0], v[2] - v[0], v[4] - v[0]);
        let (kxy, kyz, kzx) = (v[3] - v[2] - kx, v[6] - v[4] - ky, v[5] - v[1] - kz);
        let kxyz = v[7] - v[6] - (v[5] - v[4]) - kxy;
        // Slopes along each axis where the ray enters.
        let sx = kxyz.mul_add(y * z, kxy.mul_add(y, kzx.mul_add(z, kx)));
        let sy = kxyz.mul_add(z, kxy).mul_add(x, kyz.mul_add(z, ky));
        let sz = kz;
        let flat = kyz.mul_add(y, kzx.mul_add(x, kxyz * (x * y))) + sz;
        let c0 = kx.mul_add(x, ky.mul_add(y, v[0])) + kxy * (x * y) + z * flat;
        let c1 = sx.mul_add(a, sy.mul_add(b, flat * c));
        let (ab, bc, ca) = (a * b, b * c, c * a);
        let c2 = kxyz.mul_add(z, kxy) * ab + kxyz.mul_add(x, kyz) * bc + kxyz.mul_add(y, kzx) * ca;
        Self([c0, c1, c2, kxyz * (ab * c)])
    }

    #[inline(always)]
    fn negated_where(self, mask: mask32x16<S>) -> Self {
        let mut c = self.0;
        for k in 0..4 {
            c[k] = mask.select(-c[k], c[k]);
        }
        Self(c)
    }
}

/// The part of the way at which rays first go to the other side: from below the threshold to above, of those
/// `inside` from above to below; above 1 where they do not. One that has not just set out from a surface
/// (`fresh`) and is on the other side already crosses at once.
#[inline(always)]
pub(crate) fn crossing<S: Simd>(
    simd: S,
    corners: Corners<S>,
    (inside, fresh): (mask32x16<S>, mask32x16<S>),
) -> f32x16<S> {
    let cubic = Cubic::new(&corners).negated_where(inside);
    let (zero, none) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 2.0));
    let start = cubic.0[0];
    let at_once = !fresh & start.simd_ge(zero);
    let mut values = [start; PARTS + 1];
    for part in 1..=PARTS {
        values[part] = cubic.at(f32x16::splat(simd, part as f32 / PARTS as f32));
    }
    // The first part at whose end the sign has changed: the last that is found from the end on.
    let (mut low, mut low_value, mut high_value) = (none, zero, zero);
    let mut found = mask32x16::splat(simd, false);
    for part in (0..PARTS).rev() {
        let here = values[part].simd_lt(zero) & values[part + 1].simd_ge(zero);
        low = here.select(f32x16::splat(simd, part as f32 / PARTS as f32), low);
        low_value = here.select(values[part], low_value);
        high_value = here.select(values[part + 1], high_value);
        found |= here;
    }
    let mut high = low + 1.0 / PARTS as f32;
    // The false position, again and again: the crossing stays between.
    let tiny = f32x16::splat(simd, f32::MIN_POSITIVE);
    let mut s = low;
    for step in 0..=STEPS {
        s = low - (high - low) * low_value / (high_value - low_value).max(tiny);
        if step < STEPS {
            let value = cubic.at(s);
            let before = value.simd_lt(zero);
            low = before.select(s, low);
            low_value = before.select(value, low_value);
            high = before.select(high, s);
            high_value = before.select(high_value, value);
        }
    }
    at_once.select(zero, found.select(s, none))
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};
    use fearless_simd_macros::simd;

    use super::*;

    #[simd]
    fn first<S: Simd>(simd: S, values: &[f32; 8], ray: &[f32; 6], inside: bool) -> f32 {
        let mut numbers = [f32x16::splat(simd, 0.0); 8];
        for k in 0..8 {
            numbers[k] = f32x16::splat(simd, values[k]);
        }
        let v = |k: usize| f32x16::splat(simd, ray[k]);
        let corners =
            Corners { values: numbers, place: [v(0), v(1), v(2)], way: [v(3), v(4), v(5)] };
        let of = |b: bool| mask32x16::splat(simd, b);
        crossing(simd, corners, (of(inside), of(true))).as_slice()[0]
    }

    #[test]
    fn finds_where_the_trilinear_density_is_the_threshold() {
        let mut seed = 5_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
            (seed >> 40) as f32 / (1 << 24) as f32
        };
        let mut found = 0;
        for _ in 0..2000 {
            let values: [f32; 8] = std::array::from_fn(|_| next() - 0.5);
            let place = [next(), next(), next()];
            let end = [next(), next(), next()];
            let at = |s: f64| {
                let u = [0, 1, 2].map(|a| f64::from(place[a]) * (1.0 - s) + f64::from(end[a]) * s);
                (0..8)
                    .map(|k| {
                        let part = |a: usize| if k >> a & 1 == 1 { u[a] } else { 1.0 - u[a] };
                        f64::from(values[k]) * part(0) * part(1) * part(2)
                    })
                    .sum::<f64>()
            };
            let way = [0, 1, 2].map(|a| end[a] - place[a]);
            let ray = [place[0], place[1], place[2], way[0], way[1], way[2]];
            for inside in [false, true] {
                let s = dispatch!(Level::new(), simd => first(simd, &values, &ray, inside));
                let sign = if inside { -1.0 } else { 1.0 };
                if s <= 1.0 {
                    let s = f64::from(s);
                    assert!(at(s).abs() < 2e-3, "{values:?} {ray:?} {inside}: {s} {}", at(s));
                    found += 1;
                } else if at(0.0) * sign < -1e-6 {
                    assert!(at(1.0) * sign < 1e-6, "{values:?} {ray:?} {inside}");
                }
            }
        }
        assert!(found > 500, "{found}");
    }
}
