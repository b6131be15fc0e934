//! What light does at a smooth boundary and inside a clear liquid: pure functions.
//!
//! With η = n₁/n₂ the ratio of the indices of refraction before and behind the boundary, d the way of the
//! light, n the normal towards where it comes from and cos θ₁ = −d·n:
//!
//! > Snell: sin²θ₂ = η²·(1 − cos²θ₁); above 1 all light is reflected (total internal reflection)
//! > transmitted direction: η·d + (η·cos θ₁ − cos θ₂)·n
//! > Fresnel, unpolarised: R = ½·(rₛ² + rₚ²),
//! >   rₛ = (η·cos θ₁ − cos θ₂) / (η·cos θ₁ + cos θ₂),  rₚ = (cos θ₁ − η·cos θ₂) / (cos θ₁ + η·cos θ₂)
//! > Beer–Lambert: what is left after a length s is exp(−a·s)

use glam::Vec3;

/// What becomes of a ray at a boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split {
    /// Unit direction of what is thrown back.
    pub reflected: Vec3,
    /// Unit direction of what goes through; `None` where all is thrown back.
    pub refracted: Option<Vec3>,
    /// The part that is thrown back, 0 to 1.
    pub reflectance: f32,
}

/// A ray along the unit vector `direction` meets a boundary with the unit normal `normal`, which points
/// to where the ray comes from; `eta` is the index of refraction before the boundary over that behind it.
#[inline]
pub fn split(direction: Vec3, normal: Vec3, eta: f32) -> Split {
    // A ray along the boundary, or from behind it by rounding, grazes it.
    let cos1 = (-direction.dot(normal)).clamp(0.0, 1.0);
    let reflected = (direction + normal * (2.0 * cos1)).normalize_or(normal);
    let sin2 = eta * eta * (1.0 - cos1 * cos1);
    if sin2 >= 1.0 {
        return Split { reflected, refracted: None, reflectance: 1.0 };
    }
    let cos2 = (1.0 - sin2).sqrt();
    let through = direction * eta + normal * (eta * cos1 - cos2);
    let s = (eta * cos1 - cos2) / (eta * cos1 + cos2);
    let p = (cos1 - eta * cos2) / (cos1 + eta * cos2);
    Split {
        reflected,
        refracted: Some(through.normalize_or(-normal)),
        reflectance: 0.5 * (s * s + p * p),
    }
}

/// What is left of light after `length` in a medium that takes `absorption` per unit of length.
#[inline]
pub fn transmitted(absorption: Vec3, length: f32) -> Vec3 {
    (-absorption * length).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WATER: f32 = 1.33;

    fn at_angle(degrees: f32, eta: f32) -> Split {
        let (sin, cos) = degrees.to_radians().sin_cos();
        split(Vec3::new(sin, 0.0, -cos), Vec3::Z, eta)
    }

    #[test]
    fn straight_on_little_is_thrown_back() {
        let split = at_angle(0.0, 1.0 / WATER);
        let expected = ((WATER - 1.0) / (WATER + 1.0)).powi(2);
        assert!((split.reflectance - expected).abs() < 1e-6);
        assert!(split.refracted.is_some_and(|d| d.distance(-Vec3::Z) < 1e-6));
        assert!(split.reflected.distance(Vec3::Z) < 1e-6);
    }

    #[test]
    fn snell() {
        for degrees in [1.0_f32, 20.0, 45.0, 70.0, 89.0] {
            let split = at_angle(degrees, 1.0 / WATER);
            let sin = split.refracted.map(|d| d.x);
            let expected = degrees.to_radians().sin() / WATER;
            assert!(sin.is_some_and(|s| (s - expected).abs() < 1e-6), "{degrees}: {sin:?}");
        }
    }

    #[test]
    fn beyond_the_critical_angle_all_is_thrown_back() {
        let critical = (1.0 / WATER).asin().to_degrees();
        assert!(at_angle(critical - 0.1, WATER).refracted.is_some());
        let beyond = at_angle(critical + 0.1, WATER);
        assert_eq!((beyond.refracted, beyond.reflectance), (None, 1.0));
    }

    #[test]
    fn at_brewsters_angle_half_of_the_light_is_not_thrown_back() {
        // tan θ = n₂/n₁: the part polarised in the plane goes through whole.
        let brewster = WATER.atan();
        let split = at_angle(brewster.to_degrees(), 1.0 / WATER);
        let (cos1, cos2) = (brewster.cos(), brewster.sin());
        let s = ((cos1 / WATER - cos2) / (cos1 / WATER + cos2)).powi(2);
        assert!((split.reflectance - 0.5 * s).abs() < 1e-6);
    }

    #[test]
    fn the_way_back_is_the_same() {
        let there = at_angle(50.0, 1.0 / WATER);
        let Some(through) = there.refracted else { panic!("goes through") };
        let back = split(-through, -Vec3::Z, WATER);
        let expected = -Vec3::new(50_f32.to_radians().sin(), 0.0, -50_f32.to_radians().cos());
        assert!(back.refracted.is_some_and(|d| d.distance(expected) < 1e-5));
        assert!((back.reflectance - there.reflectance).abs() < 1e-6);
    }

    #[test]
    fn absorption_adds_up() {
        let a = Vec3::new(0.1, 0.5, 2.0);
        let twice = transmitted(a, 1.5) * transmitted(a, 0.5);
        assert!(twice.distance(transmitted(a, 2.0)) < 1e-6);
        assert_eq!(transmitted(a, 0.0), Vec3::ONE);
    }
}
