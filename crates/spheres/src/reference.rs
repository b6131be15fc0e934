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

/// A plane that cuts: normal·x ≥ offset is kept.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Unit vector towards what is kept.
    pub normal: DVec3,
    /// normal·p for any point p of the plane.
    pub offset: f64,
    /// Whether what it slices is closed with a cap.
    pub caps: bool,
}

/// Whether a point is kept: every clause has a face that keeps it.
pub fn keeps(clauses: &[Vec<Face>], point: DVec3) -> bool {
    let face = |face: &Face| face.normal.dot(point) >= face.offset;
    clauses.iter().all(|clause| clause.iter().any(face))
}

/// The surfaces along a ray of what cuts leave of a sphere, nearest first: distances, and the normals of caps.
///
/// These are the points of the sphere that are kept, and the points inside the sphere where a face with caps
/// is what parts kept from not kept.
pub fn surfaces(
    (origin, direction): (DVec3, DVec3),
    sphere: Sphere,
    clauses: &[Vec<Face>],
) -> Vec<(f64, Option<DVec3>)> {
    let direction = direction.normalize();
    let oc = sphere.center - origin;
    let b = oc.dot(direction);
    let inside = sphere.radius * sphere.radius - (oc - direction * b).length_squared();
    if inside < 0.0 {
        return Vec::new();
    }
    let (entry, exit) = (b - inside.sqrt(), b + inside.sqrt());
    let at = |t: f64| origin + direction * t;
    let mut all: Vec<(f64, Option<DVec3>)> = Vec::new();
    all.extend([entry, exit].iter().filter(|t| keeps(clauses, at(**t))).map(|t| (*t, None)));
    for (i, clause) in clauses.iter().enumerate() {
        for (j, face) in clause.iter().enumerate().filter(|(_, face)| face.caps) {
            let t = (face.offset - face.normal.dot(origin)) / face.normal.dot(direction);
            let others = |own: &[Vec<Face>], but: usize| {
                own.iter()
                    .enumerate()
                    .filter(|(at, _)| *at != but)
                    .all(|(_, c)| c.iter().any(|face| face.normal.dot(at(t)) >= face.offset))
            };
            let beside = clause.iter().enumerate().filter(|(at, _)| *at != j);
            let mut beside = beside.map(|(_, face)| face.normal.dot(at(t)) >= face.offset);
            if t > entry && t < exit && others(clauses, i) && !beside.any(|keeps| keeps) {
                all.push((t, Some(face.normal)));
            }
        }
    }
    all.retain(|(t, _)| *t > 0.0);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
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
