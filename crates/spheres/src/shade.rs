//! What a hit looks like: Lambert under a soft key light and a fill from sky and ground.

use glam::Vec3;
use motes_scene::Lights;

use crate::occlude::Reaching;

/// The colour of each particle.
pub trait Paint: Sync {
    /// Linear RGB, each in 0..=1, of a particle of a system by its index in the file's order.
    fn color(&self, system: u16, index: u32) -> Vec3;
}

/// Light that a surface of albedo ρ and unit normal n sends to the eye:
/// ρ·(key · reaching key + fill(n) · reaching fill + ambient).
pub(crate) fn shade(lights: &Lights, albedo: Vec3, normal: Vec3, reaching: Reaching) -> Vec3 {
    let key = lights.key.color * reaching.key;
    albedo * (key + lights.fill(normal) * reaching.fill + lights.ambient)
}
