//! The smoothing kernels: one for each solver. With d the vector to the particle from its neighbour, in supports:
//!
//! W(r) = A t u,  ∇W = −C t d
//!
//! | kernel | t | u | A | C |
//! |---|---|---|---|---|
//! | [`Wendland`] | (1 − d)³ | (1 − d)(1 + 4d) | 21 / (2π h³) | 20 A / h |
//! | [`Smooth`] | w⁴ | w = 1 − d² | 9009 / (1024 π h³) | 10 A / h |
//!
//! Wendland's C² function never makes pairs clump (Wendland 1995; for SPH: Dehnen & Aly 2012), and pushes the
//! harder the nearer they are: dfsph needs that, whose long steps bring particles near to each other. The
//! other is as wide (standard deviations 0.264 h and 0.258 h), and needs neither root nor division; its transform is
//! positive up to a wave number of 10.4 / h, past the shortest waves along the rows of a lattice of h/2, which is
//! enough for the short steps of wcsph.

use std::f64::consts::PI;

use fearless_simd::{f32x16, prelude::*};

/// A kernel, sixteen neighbours at a time.
pub(crate) trait Shape: Copy + Send + Sync {
    /// t and u, of w = max(1 − d², 0).
    fn at<S: Simd>(self, w: f32x16<S>) -> [f32x16<S>; 2];
}

/// Wendland's C² function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wendland;

/// A polynomial in the square of the distance, near to a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Smooth;

impl Shape for Wendland {
    #[inline(always)]
    fn at<S: Simd>(self, w: f32x16<S>) -> [f32x16<S>; 2] {
        let one = f32x16::splat(w.token(), 1.0);
        let v = one - (one - w).sqrt();
        [v * v * v, v * (v * -4.0 + 5.0)]
    }
}

impl Shape for Smooth {
    #[inline(always)]
    fn at<S: Simd>(self, w: f32x16<S>) -> [f32x16<S>; 2] {
        let square = w * w;
        [square * square, w]
    }
}

/// Which of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Wendland,
    Smooth,
}

/// The kernel of one support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kernel {
    pub kind: Kind,
    /// h, beyond which it is zero, metres.
    pub support: f32,
    /// A, per cubic metre.
    pub value: f32,
    /// C, for d in supports.
    pub slope: f32,
    /// π/8 C h⁵ ∫ d⁵ W/A dd, see [`crate::wcsph`].
    pub tension: f32,
}

impl Kernel {
    pub fn new(kind: Kind, support: f32) -> Self {
        let h = f64::from(support);
        let (value, slope, moment) = match kind {
            Kind::Wendland => (21.0 / (2.0 * PI), 20.0, 1.0 / 396.0),
            Kind::Smooth => (9009.0 / (1024.0 * PI), 10.0, 1.0 / 336.0),
        };
        Self {
            kind,
            support,
            value: (value / h.powi(3)) as f32,
            slope: (slope * value / h.powi(4)) as f32,
            tension: (PI / 8.0 * slope * value * moment * h) as f32,
        }
    }

    /// W / A at distance `r`.
    pub fn shape(&self, r: f64) -> f64 {
        let d = (r / f64::from(self.support)).min(1.0);
        match self.kind {
            Kind::Wendland => (1.0 - d).powi(4) * (1.0 + 4.0 * d),
            Kind::Smooth => (1.0 - d * d).powi(5),
        }
    }

    /// Σ W / A over a square lattice of `spacing`, seen from `away` above one of its points.
    pub fn plane_sum(&self, spacing: f64, away: f64) -> f64 {
        let reach = (f64::from(self.support) / spacing).ceil() as i32;
        let line = || (-reach..=reach).map(|i| (f64::from(i) * spacing).powi(2));
        let squares = line().flat_map(|y| line().map(move |x| x + y));
        squares.map(|square| self.shape((square + away * away).sqrt())).sum()
    }

    /// Σ W / A over a cubic lattice of `spacing`, seen from one of its points.
    pub fn lattice_sum(&self, spacing: f64) -> f64 {
        let reach = (f64::from(self.support) / spacing).ceil() as i32;
        (-reach..=reach).map(|z| self.plane_sum(spacing, f64::from(z) * spacing)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [Kind; 2] = [Kind::Wendland, Kind::Smooth];

    #[test]
    fn integrates_to_one() {
        for kind in KINDS {
            let kernel = Kernel::new(kind, 0.3);
            let step = 0.3 / 3000.0;
            let shell = |i| {
                let r = (f64::from(i) + 0.5) * step;
                4.0 * PI * r * r * kernel.shape(r) * f64::from(kernel.value) * step
            };
            let integral: f64 = (0..3000).map(shell).sum();
            assert!((integral - 1.0).abs() < 1e-5, "{kind:?}: {integral}");
            let fifth = |i| {
                let r = (f64::from(i) + 0.5) * step;
                (r / 0.3).powi(5) * kernel.shape(r) * step / 0.3
            };
            let tension = PI / 8.0 * f64::from(kernel.slope) * 0.3f64.powi(5);
            let tension = tension * (0..3000).map(fifth).sum::<f64>();
            assert!((tension / f64::from(kernel.tension) - 1.0).abs() < 1e-5, "{kind:?}");
        }
    }

    #[test]
    fn the_slope_is_the_derivative() {
        for kind in KINDS {
            let kernel = Kernel::new(kind, 2.0);
            for r in [0.1, 0.5, 1.0, 1.7, 1.99] {
                let e = 1e-5;
                let difference = (kernel.shape(r + e) - kernel.shape(r - e)) / (2.0 * e);
                let d: f64 = r / 2.0;
                let t =
                    if kind == Kind::Smooth { (1.0 - d * d).powi(4) } else { (1.0 - d).powi(3) };
                let slope = -f64::from(kernel.slope / kernel.value) * t * d;
                assert!((difference - slope).abs() < 1e-6, "{kind:?} {r}: {difference} {slope}");
            }
            assert_eq!(kernel.shape(2.0), 0.0);
            assert_eq!(kernel.shape(3.0), 0.0);
        }
    }
}
