//! The definition, by brute force in f64: every ray against every sphere. For tests only.

use glam::DVec3;

/// A sphere of the definition.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray.
    pub distance: f64,
    /// Which sphere.
    pub index: usize,
    /// How far the distance may be off in f32 arithmetic: see [`depth_tolerance`].
    pub tolerance: f64,
}

/// Where the ray enters the sphere; where it leaves it if it starts inside.
pub fn distance(origin: DVec3, direction: DVec3, sphere: Sphere) -> Option<f64> {
    let oc = sphere.center - origin;
    let b = oc.dot(direction) / direction.length();
    let perpendicular = (oc - direction.normalize() * b).length_squared();
    let inside = sphere.radius * sphere.radius - perpendicular;
    if sphere.radius.is_nan() || sphere.radius <= 0.0 || inside < 0.0 {
        return None;
    }
    let half = inside.sqrt();
    [b - half, b + half].into_iter().find(|t| *t > 0.0)
}

/// The nearest hit of all spheres; at equal distance the lower index.
pub fn trace(origin: DVec3, direction: DVec3, spheres: &[Sphere]) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    for (index, sphere) in spheres.iter().enumerate() {
        if let Some(distance) = distance(origin, direction, *sphere)
            && nearest.is_none_or(|n| distance < n.distance)
        {
            let tolerance = depth_tolerance(origin, direction, *sphere);
            nearest = Some(Hit { distance, index, tolerance });
        }
    }
    nearest
}

/// How far f32 arithmetic may put a hit from the truth.
///
/// The perpendicular p from ray to centre, of length below r, comes from coordinates of size D =
/// |c − o| that are rounded to ε = 2⁻²⁴ each, and the direction is a unit vector to ε: p is off by
/// δ = 8εD. Then s = √(r² − p²) is off by |p|δ/s, but never by more than √(2rδ), which it reaches where
/// the ray grazes the sphere; b itself is off by δ.
pub fn depth_tolerance(origin: DVec3, direction: DVec3, sphere: Sphere) -> f64 {
    let oc = sphere.center - origin;
    let direction = direction.normalize();
    let p = (oc - direction * oc.dot(direction)).length();
    let delta = perpendicular_tolerance(origin, sphere);
    let s = (sphere.radius * sphere.radius - p * p).max(0.0).sqrt();
    let grazing = (2.0 * sphere.radius * delta).sqrt() + delta;
    delta + grazing.min(2.0 * (p + delta) * delta / s.max(f64::MIN_POSITIVE))
}

/// How far f32 arithmetic may put the perpendicular from a ray to a sphere's centre from the truth.
pub fn perpendicular_tolerance(origin: DVec3, sphere: Sphere) -> f64 {
    let epsilon = f64::from(f32::EPSILON) / 2.0;
    8.0 * epsilon * (sphere.center - origin).length().max(sphere.radius)
        + epsilon * (sphere.center.abs().max_element() + origin.abs().max_element())
}

/// Whether f32 arithmetic may see the ray hit the sphere or miss it: it grazes it.
pub fn grazes(origin: DVec3, direction: DVec3, sphere: Sphere) -> bool {
    let oc = sphere.center - origin;
    let direction = direction.normalize();
    let p = (oc - direction * oc.dot(direction)).length();
    (p - sphere.radius).abs() <= perpendicular_tolerance(origin, sphere)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_sphere_at_distance_three_is_met_at_two() {
        let sphere = Sphere { center: DVec3::new(0.0, 0.0, 3.0), radius: 1.0 };
        assert_eq!(distance(DVec3::ZERO, DVec3::Z, sphere), Some(2.0));
        assert_eq!(distance(DVec3::ZERO, -DVec3::Z, sphere), None);
        assert_eq!(distance(DVec3::new(0.0, 0.0, 3.0), DVec3::Z, sphere), Some(1.0));
        assert_eq!(distance(DVec3::new(1.5, 0.0, 0.0), DVec3::Z, sphere), None);
    }
}
