//! The smoothing kernel: Wendland's C² function in three dimensions.
//!
//! W(r) = A w⁴ (1 + 4q),  ∇W = −C w³ d,  q = r/h,  w = max(1 − q, 0),  A = 21 / (2π h³),  C = 20 A / h²
//!
//! where d is the vector to the particle from its neighbour and h the support (Wendland 1995; for SPH:
//! Dehnen & Aly 2012). The gradient needs no division, and W never makes pairs clump.

use std::f64::consts::PI;

/// The kernel of one support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kernel {
    /// h, beyond which it is zero, metres.
    pub support: f32,
    /// A, per cubic metre.
    pub value: f32,
    /// C.
    pub slope: f32,
}

impl Kernel {
    pub fn new(support: f32) -> Self {
        let h = f64::from(support);
        let value = 21.0 / (2.0 * PI * h.powi(3));
        Self { support, value: value as f32, slope: (20.0 * value / (h * h)) as f32 }
    }

    /// W / A at distance `r`.
    pub fn shape(&self, r: f64) -> f64 {
        let w = (1.0 - r / f64::from(self.support)).max(0.0);
        w.powi(4) * (5.0 - 4.0 * w)
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

    #[test]
    fn integrates_to_one() {
        let kernel = Kernel::new(0.3);
        let step = 0.3 / 3000.0;
        let shell = |i| {
            let r = (f64::from(i) + 0.5) * step;
            4.0 * PI * r * r * kernel.shape(r) * f64::from(kernel.value) * step
        };
        let integral: f64 = (0..3000).map(shell).sum();
        assert!((integral - 1.0).abs() < 1e-5, "{integral}");
    }

    #[test]
    fn the_slope_is_the_derivative() {
        let kernel = Kernel::new(2.0);
        for r in [0.1, 0.5, 1.0, 1.7, 1.99] {
            let e = 1e-5;
            let difference = (kernel.shape(r + e) - kernel.shape(r - e)) / (2.0 * e);
            let w = 1.0 - r / 2.0;
            let slope = -f64::from(kernel.slope / kernel.value) * w.powi(3) * r;
            assert!((difference - slope).abs() < 1e-6, "{r}: {difference} {slope}");
        }
        assert_eq!(kernel.shape(2.0), 0.0);
        assert_eq!(kernel.shape(3.0), 0.0);
    }
}
