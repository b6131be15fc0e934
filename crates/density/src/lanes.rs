//! Sixteen numbers, sixteen vectors, and what is asked of them.

use std::ops::{Add, Mul, Neg, Sub};

use fearless_simd::{f32x16, i32x16, mask32x16, prelude::*};
use glam::Vec3;

/// Numbers in a vector.
pub(crate) const LANES: usize = 16;

/// Numbers of all lanes on their own lines of cache.
#[repr(align(64))]
#[derive(Clone, Copy)]
pub(crate) struct Lanes<T>(pub [T; LANES]);

/// Sixteen vectors of space.
#[derive(Clone, Copy)]
pub(crate) struct V3<S: Simd>(pub [f32x16<S>; 3]);

impl<S: Simd> V3<S> {
    #[inline(always)]
    pub fn splat(simd: S, v: Vec3) -> Self {
        Self([f32x16::splat(simd, v.x), f32x16::splat(simd, v.y), f32x16::splat(simd, v.z)])
    }

    /// Sixteen of rows, from `at` on.
    #[inline(always)]
    pub fn load(simd: S, rows: &[Vec<f32>; 3], at: usize) -> Self {
        let of = |row: &Vec<f32>| f32x16::from_slice(simd, &row[at..at + LANES]);
        Self([of(&rows[0]), of(&rows[1]), of(&rows[2])])
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> f32x16<S> {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        c.mul_add(z, b.mul_add(y, a * x))
    }

    /// self + v·t.
    #[inline(always)]
    pub fn along(self, v: Self, t: f32x16<S>) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, v.0);
        Self([x.mul_add(t, a), y.mul_add(t, b), z.mul_add(t, c)])
    }

    /// Of unit length; `or` where there is none.
    #[inline(always)]
    pub fn normalize_or(self, or: Self) -> Self {
        let square = self.dot(self);
        let some = square.simd_gt(f32x16::splat(square.token(), 1e-30));
        Self::select(some, self * (1.0 / square.sqrt()), or)
    }

    #[inline(always)]
    pub fn select(mask: mask32x16<S>, yes: Self, no: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (yes.0, no.0);
        Self([mask.select(a, x), mask.select(b, y), mask.select(c, z)])
    }

    /// Component by component.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a * x, b * y, c * z])
    }

    /// self + (other − self)·t.
    #[inline(always)]
    pub fn mix(self, other: Self, t: f32x16<S>) -> Self {
        self.along(other - self, t)
    }
}

impl<S: Simd> Add for V3<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a + x, b + y, c + z])
    }
}

impl<S: Simd> Sub for V3<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, other.0);
        Self([a - x, b - y, c - z])
    }
}

impl<S: Simd> Mul<f32x16<S>> for V3<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, t: f32x16<S>) -> Self {
        let [a, b, c] = self.0;
        Self([a * t, b * t, c * t])
    }
}

impl<S: Simd> Neg for V3<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        let [a, b, c] = self.0;
        Self([-a, -b, -c])
    }
}

/// exp(x) for x up to 80, to some 1e-7 of it: 2ⁿ·exp(r), r at most half of ln 2, by its series.
#[inline(always)]
pub(crate) fn exp<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    let simd = x.token();
    let splat = |v: f32| f32x16::splat(simd, v);
    let x = x.max(splat(-80.0)).min(splat(80.0));
    let n = (x * std::f32::consts::LOG2_E).round_ties_even();
    let r = n.mul_add(splat(-0.693_359_4), x);
    let r = n.mul_add(splat(2.121_944_4e-4), r);
    let mut sum = splat(1.0 / 720.0);
    for c in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        sum = sum.mul_add(r, splat(c));
    }
    let exponent = (n.to_int::<i32x16<S>>() + i32x16::splat(simd, 127)) << 23;
    sum * exponent.bitcast::<f32x16<S>>()
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};
    use fearless_simd_macros::simd;

    use super::*;

    #[simd]
    fn of<S: Simd>(simd: S, x: f32) -> f32 {
        exp(f32x16::splat(simd, x)).as_slice()[0]
    }

    #[test]
    fn exp_is_exp() {
        for i in 0..2000 {
            let x = 0.05 * (i as f32 - 1600.0);
            let expected = f64::from(x).exp();
            let found = f64::from(dispatch!(Level::new(), simd => of(simd, x)));
            assert!((found - expected).abs() <= 1e-6 * expected, "{x}: {found} {expected}");
        }
    }
}
