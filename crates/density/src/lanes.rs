//! Sixteen numbers, sixteen vectors, and what is asked of them.

use std::ops::{Add, Mul, Neg, Sub};

use fearless_simd::{f32x16, mask32x16, prelude::*};
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
