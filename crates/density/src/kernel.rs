//! What a particle adds to the field around it.
//!
//! W(r) = A (1 − r²/R²)³ for r < R, A = 315 / (64 π R³), so that its integral is one (Müller et al. 2003,
//! "poly6"; Yasuda et al. 2009 leave the shape open). A particle of radius ρ stands for a cube of edge 2ρ:
//! V = (2ρ)³ W is what it adds, and a liquid at rest has a density of about 1, whatever the unit of length.

/// The cube root of 8·315 / (64 π).
const HEIGHT: f32 = 2.322_862_8;

/// The cube root of V·A for a particle of radius `radius` whose density reaches `reach`, in one unit.
#[inline(always)]
pub(crate) fn height(radius: f32, reach: f32) -> f32 {
    HEIGHT * (radius / reach)
}

/// (1 − q)³ for q = r²/R² in 0 to 1, else 0.
pub(crate) fn shape(q: f64) -> f64 {
    (1.0 - q).max(0.0).powi(3)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn integrates_to_the_particles_volume() {
        let (radius, reach) = (0.25, 1.1);
        let step = reach / 4000.0;
        let shell = |i| {
            let r = (f64::from(i) + 0.5) * step;
            4.0 * PI * r * r * shape(r * r / (reach * reach)) * step
        };
        let integral: f64 = (0..4000).map(shell).sum();
        let volume = integral * f64::from(height(radius, reach as f32)).powi(3);
        assert!((volume - 0.5_f64.powi(3)).abs() < 1e-5, "{volume}");
    }
}
