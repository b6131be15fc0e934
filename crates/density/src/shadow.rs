//! Shadow: what the liquid keeps of the key light.
//!
//! A map across the light's way: for each of its pixels, how much liquid light passes on its way through. All
//! that is lit through it lies below the liquid, as the floor does.

use glam::Vec3;
use rayon::prelude::*;

use crate::layers::passed;
use crate::rays::{OUTSIDE, Rays};
use crate::shade::Liquid;

/// Pixels along the edge of the map.
const SIZE: usize = 192;

/// The liquid as a far light sees it.
#[derive(Clone, Debug)]
pub struct Shadow {
    /// The map's middle, and its unit vectors across.
    center: Vec3,
    across: [Vec3; 2],
    /// Pixels per unit of length.
    per_length: f32,
    /// What is left of the key light.
    left: Vec<f32>,
    /// The part of the light that is not the key light's.
    fill: f32,
}

impl Shadow {
    /// The shadow of a liquid that takes `extinction` per unit of length, away from the unit vector `toward`;
    /// `fill` is the part of the light that comes from elsewhere.
    pub fn new(liquid: &Liquid<'_>, toward: Vec3, (extinction, fill): (f32, f32)) -> Self {
        let Liquid { field, space, .. } = *liquid;
        let cuts = liquid.cuts();
        let body = liquid.body(cuts.as_ref());
        let lattice = &field.lattice;
        let [low, high] = space.bounds.map(|corner| lattice.point(corner));
        let center = low.midpoint(high);
        let size = low.distance(high).max(lattice.voxel);
        let across = toward.any_orthonormal_pair();
        let across = [across.0, across.1];
        let step = size / SIZE as f32;
        let mut left = vec![1.0; SIZE * SIZE];
        left.par_chunks_mut(SIZE).enumerate().for_each(|(y, row)| {
            let mut rays = Rays::default();
            for x in 0..SIZE {
                let [a, b] = [x, y].map(|i| (i as f32 + 0.5) * step - 0.5 * size);
                let start = center + across[0] * a + across[1] * b + toward * size;
                rays.push(lattice.place(start), -toward, OUTSIDE);
            }
            for (left, passed) in row.iter_mut().zip(passed(&body, rays)) {
                *left = (-extinction * passed).exp();
            }
        });
        Self { center, across, per_length: 1.0 / step, left, fill }
    }

    /// The part of light that reaches a point.
    pub(crate) fn lit(&self, point: Vec3) -> f32 {
        let v = (point - self.center) * self.per_length;
        let middle = SIZE as f32 / 2.0 - 0.5;
        let [x, y] = self.across.map(|axis| v.dot(axis) + middle);
        let (i, j) = (x.floor(), y.floor());
        if !(i >= 0.0 && j >= 0.0 && i < (SIZE - 1) as f32 && j < (SIZE - 1) as f32) {
            return 1.0;
        }
        let at = j as usize * SIZE + i as usize;
        let along = |at: usize| self.left[at] + (self.left[at + 1] - self.left[at]) * (x - i);
        let key = along(at) + (along(at + SIZE) - along(at)) * (y - j);
        self.fill + (1.0 - self.fill) * key
    }
}
