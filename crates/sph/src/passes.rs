//! What each pass adds up over pairs; the constants of the kernel are left to the caller.
//!
//! With t and u of the kernel, lengths in supports and equal masses m (see [`crate::kernel`]):
//! W = A t u, ∇W = −C t d.

use fearless_simd::{f32x16, prelude::*};

use crate::kernel::Shape;
use crate::pairs::{Apart, Found, Pair};

/// r², where w is not 0.
#[inline(always)]
fn square<S: Simd>(at: Apart<S>) -> f32x16<S> {
    f32x16::splat(at.w.token(), 1.0) - at.w
}

/// Σ W / A.
#[derive(Clone, Copy)]
pub(crate) struct Density<K>(pub K);

impl<K: Shape> Pair<0, 1> for Density<K> {
    const SIGN: [f32; 1] = [1.0];
    const FOUR: bool = true;

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], _: [f32x16<S>; 0]) -> Found<S, 1> {
        let [t, u] = self.0.at(at.w);
        (t, [u])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], weight: f32x16<S>) -> Found<S, 1> {
        let [t, u] = self.0.at(at.w);
        (t, [u * weight])
    }
}

/// Σ W / A, and of the particle mask (see [`crate::mask`]) S and D along x, y and z. Walls count among
/// the neighbours of the density only: towards a wall there is no liquid.
#[derive(Clone, Copy)]
pub(crate) struct DensityAndMask<K>(pub K);

impl<K: Shape> Pair<0, 7> for DensityAndMask<K> {
    const SIGN: [f32; 7] = [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], _: [f32x16<S>; 0]) -> Found<S, 7> {
        let [x, y, z] = at.d;
        let near = at.w * at.w;
        let [a, b, c] = [near * x, near * y, near * z];
        let [t, u] = self.0.at(at.w);
        let one = f32x16::splat(at.w.token(), 1.0);
        (one, [t * u, a * x, b * y, c * z, a * x.abs(), b * y.abs(), c * z.abs()])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], weight: f32x16<S>) -> Found<S, 7> {
        let zero = f32x16::splat(at.w.token(), 0.0);
        let [t, u] = self.0.at(at.w);
        (t, [u * weight, zero, zero, zero, zero, zero, zero])
    }
}

/// Σ W / A, the vector Σ t d over all, the same over walls, and Σ (t r)² over the liquid: what DFSPH's
/// factor is made of.
#[derive(Clone, Copy)]
pub(crate) struct Factors<K>(pub K);

impl<K: Shape> Pair<0, 8> for Factors<K> {
    const SIGN: [f32; 8] = [1.0, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], _: [f32x16<S>; 0]) -> Found<S, 8> {
        let [t, u] = self.0.at(at.w);
        let zero = f32x16::splat(at.w.token(), 0.0);
        let [x, y, z] = at.d;
        (t, [u, x, y, z, zero, zero, zero, t * square(at)])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, _: [f32x16<S>; 0], weight: f32x16<S>) -> Found<S, 8> {
        let [x, y, z] = at.d;
        let [t, u] = self.0.at(at.w);
        (t * weight, [u, x, y, z, x, y, z, f32x16::splat(at.w.token(), 0.0)])
    }
}

/// The force of pressure, viscosity and cohesion on a particle, over m C:
/// Σ t [(P_i + P_j − k u) d − ν (v_i − v_j)].
///
/// Numbers: P = p/ρ², and the velocity. Viscosity is the Laplacian of Brookshaw 1985, for this kernel
/// without a division: 2ν m/ρ Σ (v_i − v_j) (d·∇W)/r² = −2ν m/(ρ h) C Σ t (v_i − v_j).
///
/// Cohesion is that of Becker & Teschner 2007, Eq. 14: −κ Σ W d; it keeps momentum, and is none between liquid and wall.
///
/// The pressure in a wall is that of liquid at rest which goes on behind it, P_b = P_i − g·d/ρ₀ (as in Adami et
/// al. 2012), though no further from P_i than P_i itself: none where liquid falls freely along it.
/// Without, liquid beside a wall lacks the neighbours that would bear it, and the rest bears more.
#[derive(Clone, Copy)]
pub(crate) struct Force<K> {
    pub kernel: K,
    /// 2ν/(ρ h).
    pub viscosity: f32,
    /// k.
    pub cohesion: f32,
    /// g h/ρ₀.
    pub gravity: [f32; 3],
}

impl<K: Shape> Force<K> {
    /// P_b − P_i.
    #[inline(always)]
    fn rise<S: Simd>(self, at: Apart<S>, pressure: f32x16<S>) -> f32x16<S> {
        let [x, y, z] = self.gravity;
        let rise = at.d[0] * -x + at.d[1] * -y + at.d[2] * -z;
        rise.min(pressure.abs()).max(-pressure.abs())
    }
}

impl<K: Shape> Pair<4, 3> for Force<K> {
    const SIGN: [f32; 3] = [-1.0; 3];

    fn units(self) -> [f32; 4] {
        [1.0, self.viscosity, self.viscosity, self.viscosity]
    }

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 4], j: [f32x16<S>; 4]) -> Found<S, 3> {
        let [t, u] = self.kernel.at(at.w);
        let push = u.mul_add(f32x16::splat(at.w.token(), -self.cohesion), i[0] + j[0]);
        let [x, y, z] = at.d;
        let [u, v, w] = [i[1] - j[1], i[2] - j[2], i[3] - j[3]];
        (t, [push.mul_sub(x, u), push.mul_sub(y, v), push.mul_sub(z, w)])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 4], weight: f32x16<S>) -> Found<S, 3> {
        let [t, _] = self.kernel.at(at.w);
        (t * weight * (i[0] + self.rise(at, i[0])), at.d)
    }
}

/// [`Force`] but for pressures P_i and P_j: viscosity, cohesion, and P_b − P_i of walls ([`crate::dfsph`]).
#[derive(Clone, Copy)]
pub(crate) struct Drag<K>(pub Force<K>);

impl<K: Shape> Pair<4, 3> for Drag<K> {
    const SIGN: [f32; 3] = [-1.0; 3];

    fn units(self) -> [f32; 4] {
        self.0.units()
    }

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 4], j: [f32x16<S>; 4]) -> Found<S, 3> {
        let [t, u] = self.0.kernel.at(at.w);
        let pull = u * -self.0.cohesion;
        let [x, y, z] = at.d;
        let [u, v, w] = [i[1] - j[1], i[2] - j[2], i[3] - j[3]];
        (t, [pull.mul_sub(x, u), pull.mul_sub(y, v), pull.mul_sub(z, w)])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 4], weight: f32x16<S>) -> Found<S, 3> {
        let [t, _] = self.0.kernel.at(at.w);
        (t * weight * self.0.rise(at, i[0]), at.d)
    }
}

/// Σ t (P_i + P_j) r²: what pressures P = p/ρ² pass on between neighbours (the trace of the virial),
/// over m C h.
#[derive(Clone, Copy)]
pub(crate) struct Virial<K> {
    pub kernel: K,
    /// How much of the particle's own pressure a wall answers with.
    pub wall: f32,
}

impl<K: Shape> Pair<1, 1> for Virial<K> {
    const SIGN: [f32; 1] = [1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], j: [f32x16<S>; 1]) -> Found<S, 1> {
        let [t, _] = self.kernel.at(at.w);
        (t, [(i[0] + j[0]) * square(at)])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], weight: f32x16<S>) -> Found<S, 1> {
        let [t, _] = self.kernel.at(at.w);
        (t * weight, [i[0] * self.wall * square(at)])
    }
}

/// Σ t (v_i − v_j)·d, which is −(dρ/dt) / (m C).
#[derive(Clone, Copy)]
pub(crate) struct Divergence<K>(pub K);

impl<K: Shape> Pair<3, 1> for Divergence<K> {
    const SIGN: [f32; 1] = [1.0];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 3], j: [f32x16<S>; 3]) -> Found<S, 1> {
        let along = (i[0] - j[0]) * at.d[0];
        let along = (i[1] - j[1]).mul_add(at.d[1], along);
        let [t, _] = self.0.at(at.w);
        (t, [(i[2] - j[2]).mul_add(at.d[2], along)])
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 3], weight: f32x16<S>) -> Found<S, 1> {
        let along = i[2].mul_add(at.d[2], i[1].mul_add(at.d[1], i[0] * at.d[0]));
        let [t, _] = self.0.at(at.w);
        (t * weight, [along])
    }
}

/// Σ t (s_i + s_j) d: what pressures s do to velocities, over m C. A wall answers with the particle's own
/// pressure.
#[derive(Clone, Copy)]
pub(crate) struct Push<K>(pub K);

impl<K: Shape> Pair<1, 3> for Push<K> {
    const SIGN: [f32; 3] = [-1.0; 3];

    #[inline(always)]
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], j: [f32x16<S>; 1]) -> Found<S, 3> {
        let [t, _] = self.0.at(at.w);
        (t * (i[0] + j[0]), at.d)
    }

    #[inline(always)]
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; 1], weight: f32x16<S>) -> Found<S, 3> {
        let [t, _] = self.0.at(at.w);
        (t * weight * (i[0] + i[0]), at.d)
    }
}
