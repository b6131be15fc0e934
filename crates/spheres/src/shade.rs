//! What a hit looks like: Lambert under a soft key light and a fill from sky and ground.

use glam::Vec3;
use motes_scene::Lights;

/// The colour of each particle.
pub trait Paint: Sync {
    /// Linear RGB, each in 0..=1, of a particle of a system by its index in the file's order.
    fn color(&self, system: u16, index: u32) -> Vec3;
}

/// Light that a surface of albedo `albedo` and unit normal `normal` sends to the eye.
///
/// ρ·(key·lit(n·l) + fill(n)), see [`lit`] and [`Lights::fill`].
pub fn shade(lights: &Lights, albedo: Vec3, normal: Vec3) -> Vec3 {
    let key = &lights.key;
    let sin_half_angle = (1.0 - key.cos_half_angle * key.cos_half_angle).max(0.0).sqrt();
    let lit = lit(normal.dot(key.direction), sin_half_angle);
    albedo * (key.color * lit + lights.fill(normal))
}

/// The part of a round light's strength that falls on a surface at cosine `cosine` from its middle.
///
/// While the whole light is above the horizon this is the cosine; while it sets, over ±sin α of the
/// cosine, the quadratic that meets the cosine above and zero below with equal slopes.
pub fn lit(cosine: f32, sin_half_angle: f32) -> f32 {
    if cosine >= sin_half_angle {
        cosine
    } else if cosine <= -sin_half_angle {
        0.0
    } else {
        (cosine + sin_half_angle).powi(2) / (4.0 * sin_half_angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_sets_smoothly() {
        let s = 0.2;
        assert_eq!(lit(1.0, s), 1.0);
        assert_eq!(lit(-0.3, s), 0.0);
        assert!((lit(0.2 - 1e-6, s) - 0.2).abs() < 1e-5);
        assert!((lit(0.0, s) - 0.05).abs() < 1e-7);
        assert_eq!(lit(0.3, 0.0), 0.3);
        assert_eq!(lit(-0.3, 0.0), 0.0);
    }
}
