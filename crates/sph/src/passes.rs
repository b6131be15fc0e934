//! What each pass adds up over pairs; the constants of the kernel are left to the caller.
//!
//! With t = w³ and equal masses m (see [`crate::kernel`]): ∇W = −C t d.

use fearless_simd::{f32x16, prelude::*};

use crate::pairs::{Apart, Pair};

/// w⁴ (5 − 4w), which is W / A.
#[inline(always)]
fn shape<S: Simd>(w: f32x16<S>) -> f32x16<S> {
    let square = w * w;
    (square * square) * (w * -4.0 + 5.0)
}

/// t = w³.
#[inline(always)]
fn cube<S: Simd>(w: f32x16<S>) -> f32x16<S> {
    w * w * w
}

/// Σ W / A.
#[derive(Clone, Copy)]
pub(crate) struct Density;

impl Pair<0, 1> for Density {
    const SIGN: [f32; 1] = [1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], _: [f32x16<S>; 0]) -> [f32x16<S>; 1] {
        [shape(at.w)]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], weight: f32x16<S>) -> [f32x16<S>; 1] {
        [shape(at.w) * weight]
    }
}

/// Σ W / A, and of the particle mask (see [`crate::mask`]) S and D along x, y and z. Walls count among
/// the neighbours of the density only: towards a wall there is no liquid.
#[derive(Clone, Copy)]
pub(crate) struct DensityAndMask;

impl Pair<0, 7> for DensityAndMask {
    const SIGN: [f32; 7] = [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], _: [f32x16<S>; 0]) -> [f32x16<S>; 7] {
        let share = at.w / at.square.max(f32x16::splat(at.w.token(), 1e-30));
        let [x, y, z] = [at.d[0] * share, at.d[1] * share, at.d[2] * share];
        let [p, q, r] = at.d;
        [shape(at.w), x * p, y * q, z * r, x * p.abs(), y * q.abs(), z * r.abs()]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], weight: f32x16<S>) -> [f32x16<S>; 7] {
        let zero = f32x16::splat(at.w.token(), 0.0);
        [shape(at.w) * weight, zero, zero, zero, zero, zero, zero]
    }
}

/// Σ W / A, the vector Σ t d over all, the same over walls, and Σ (t r)² over the liquid: what DFSPH's
/// factor is made of.
#[derive(Clone, Copy)]
pub(crate) struct Factors;

impl Pair<0, 8> for Factors {
    const SIGN: [f32; 8] = [1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], _: [f32x16<S>; 0]) -> [f32x16<S>; 8] {
        let t = cube(at.w);
        let zero = f32x16::splat(at.w.token(), 0.0);
        let [x, y, z] = [t * at.d[0], t * at.d[1], t * at.d[2]];
        [shape(at.w), x, y, z, zero, zero, zero, t * t * at.square]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], weight: f32x16<S>) -> [f32x16<S>; 8] {
        let t = cube(at.w) * weight;
        let zero = f32x16::splat(at.w.token(), 0.0);
        let [x, y, z] = [t * at.d[0], t * at.d[1], t * at.d[2]];
        [shape(at.w) * weight, x, y, z, x, y, z, zero]
    }
}

/// The force of pressure and viscosity on a particle, over m C: Σ t [(P_i + P_j) d − ν (v_i − v_j)].
///
/// Numbers: P = p/ρ², and the velocity. Viscosity is the Laplacian of Brookshaw 1985, for this kernel
/// without a division: 2ν m/ρ Σ (v_i − v_j) (d·∇W)/r² = −2ν m/ρ C Σ t (v_i − v_j).
///
/// The pressure in a wall is that of liquid at rest which goes on behind it, P_b = P_i − g·d/ρ₀ (Adami et
/// al. 2012, Eq. 27), though no further from P_i than P_i itself: none where liquid falls freely along it.
/// Without, liquid beside a wall lacks the neighbours that would bear it, and the rest bears more.
#[derive(Clone, Copy)]
pub(crate) struct Force {
    /// 2ν/ρ.
    pub viscosity: f32,
    /// 1, or 0 where only P_b − P_i is to act ([`crate::dfsph`]).
    pub push: f32,
    /// g/ρ₀.
    pub gravity: [f32; 3],
}

impl Pair<4, 3> for Force {
    const SIGN: [f32; 3] = [-1.0; 3];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 4], j: [f32x16<S>; 4]) -> [f32x16<S>; 3] {
        let t = cube(at.w);
        let push = t * ((i[0] + j[0]) * self.push);
        let drag = t * -self.viscosity;
        let [u, v, w] = [i[1] - j[1], i[2] - j[2], i[3] - j[3]];
        [
            push.mul_add(at.d[0], drag * u),
            push.mul_add(at.d[1], drag * v),
            push.mul_add(at.d[2], drag * w),
        ]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 4], weight: f32x16<S>) -> [f32x16<S>; 3] {
        let [x, y, z] = self.gravity;
        let rise = (at.d[0] * -x + at.d[1] * -y + at.d[2] * -z).min(i[0].abs()).max(-i[0].abs());
        let push = cube(at.w) * weight * (i[0] * self.push + rise);
        [push * at.d[0], push * at.d[1], push * at.d[2]]
    }
}

/// Σ t (P_i + P_j) r²: what pressures P = p/ρ² pass on between neighbours (the trace of the virial),
/// over m C.
#[derive(Clone, Copy)]
pub(crate) struct Virial {
    /// How much of the particle's own pressure a wall answers with.
    pub wall: f32,
}

impl Pair<1, 1> for Virial {
    const SIGN: [f32; 1] = [1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], j: [f32x16<S>; 1]) -> [f32x16<S>; 1] {
        [cube(at.w) * (i[0] + j[0]) * at.square]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], weight: f32x16<S>) -> [f32x16<S>; 1] {
        [cube(at.w) * (i[0] * self.wall) * weight * at.square]
    }
}

/// Σ t (v_i − v_j)·d, which is −(dρ/dt) / (m C).
#[derive(Clone, Copy)]
pub(crate) struct Divergence;

impl Pair<3, 1> for Divergence {
    const SIGN: [f32; 1] = [1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 3], j: [f32x16<S>; 3]) -> [f32x16<S>; 1] {
        let along = (i[0] - j[0]) * at.d[0];
        let along = (i[1] - j[1]).mul_add(at.d[1], along);
        [cube(at.w) * (i[2] - j[2]).mul_add(at.d[2], along)]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 3], weight: f32x16<S>) -> [f32x16<S>; 1] {
        let along = i[2].mul_add(at.d[2], i[1].mul_add(at.d[1], i[0] * at.d[0]));
        [cube(at.w) * weight * along]
    }
}

/// Σ t (s_i + s_j) d: what pressures s do to velocities, over m C. A wall answers with the particle's own
/// pressure.
#[derive(Clone, Copy)]
pub(crate) struct Push;

impl Pair<1, 3> for Push {
    const SIGN: [f32; 3] = [-1.0; 3];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], j: [f32x16<S>; 1]) -> [f32x16<S>; 3] {
        let push = cube(at.w) * (i[0] + j[0]);
        [push * at.d[0], push * at.d[1], push * at.d[2]]
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], weight: f32x16<S>) -> [f32x16<S>; 3] {
        let push = cube(at.w) * weight * (i[0] + i[0]);
        [push * at.d[0], push * at.d[1], push * at.d[2]]
    }
}
