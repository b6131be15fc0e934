//! The definition of the field and of what a ray meets, in f64, one particle and one voxel at a time; for
//! tests.

use glam::DVec3;

use crate::field::Field;
use crate::kernel::shape;
use crate::lattice::{Lattice, reach};
use crate::params::{Params, Particles};

/// The plain field: every particle into every voxel in its reach; x fastest, without padding.
pub fn field(particles: &Particles<'_>, lattice: &Lattice, params: &Params) -> Vec<f64> {
    let [nx, ny, nz] = lattice.dims;
    let voxel = f64::from(lattice.voxel);
    let low = lattice.low.as_dvec3();
    let mut values = vec![0.0; nx * ny * nz];
    for (i, position) in particles.positions.iter().enumerate() {
        let center = (glam::Vec3::from_array(*position).as_dvec3() - low) / voxel;
        let radius = particles.radius(i);
        let far = f64::from(reach(radius, lattice.voxel, params)) / voxel;
        let amplitude =
            8.0 * 315.0 / (64.0 * std::f64::consts::PI) * (f64::from(radius) / voxel / far).powi(3);
        let range = |a: usize, n: usize| {
            let first = (center[a] - far).max(0.0) as usize;
            first..((center[a] + far).max(0.0) as usize + 1).min(n)
        };
        for z in range(2, nz) {
            for y in range(1, ny) {
                for x in range(0, nx) {
                    let d = DVec3::new(x as f64, y as f64, z as f64) - center;
                    values[(z * ny + y) * nx + x] +=
                        amplitude * shape(d.length_squared() / (far * far));
                }
            }
        }
    }
    values
}

/// The density at a place in voxels, trilinear between nodes.
pub fn density(field: &Field, place: DVec3) -> f64 {
    let cells = field.lattice.cells();
    let cell = place.floor();
    if (0..3).any(|a| cell[a] < 0.0 || cell[a] >= cells[a] as f64) {
        return 0.0;
    }
    let u = place - cell;
    let [x, y, z] = cell.to_array().map(|v| v as usize);
    let mut sum = 0.0;
    for corner in 0..8 {
        let [i, j, k] = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight = |u: f64, side: usize| if side == 1 { u } else { 1.0 - u };
        let value = field.values[field.index([x + i, y + j, z + k])];
        sum += f64::from(value) * weight(u.x, i) * weight(u.y, j) * weight(u.z, k);
    }
    sum
}

/// Where the density along a ray first goes to the other side of the threshold, in voxels, by small steps and
/// bisection; none up to `reach`.
pub fn crossing(
    field: &Field,
    (origin, direction): (DVec3, DVec3),
    (inside, threshold): (bool, f64),
    reach: f64,
) -> Option<f64> {
    const STEP: f64 = 1.0 / 64.0;
    let crossed = |t: f64| (density(field, origin + direction * t) < threshold) == inside;
    let mut before = 0.0;
    while before < reach {
        let after = before + STEP;
        if crossed(after) {
            let (mut low, mut high) = (before, after);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if crossed(middle) { high = middle } else { low = middle }
            }
            return Some(high);
        }
        before = after;
    }
    None
}
