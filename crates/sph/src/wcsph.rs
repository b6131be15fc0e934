//! The weakly compressible solver: pressure from density, by an equation of state.
//!
//! ρ_i = Σ_j m W_ij,  p = c² ρ₀ / 7 · ((ρ/ρ₀)⁷ − 1), 0 at the least (Becker & Teschner 2007, Eq. 9),
//! dv_i/dt = −Σ_j m (p_i/ρ_i² + p_j/ρ_j²) ∇W_ij + viscosity + gravity,
//! and walls by Akinci et al. 2012, Eq. 9. Surface tension, of both solvers, is cohesion κ Σ_j W d (Becker &
//! Teschner 2007, Eq. 14): to part two halves of liquid takes, by pairs of forces F = m κ r W at ρ/m per volume, a work
//! of γ = π/8 (ρ/m)² ∫ r⁴ F dr per surface (Fowler 1937), which tells κ. The step is the symplectic one: velocities, then positions.

use rayon::prelude::*;

use crate::Simulation;
use crate::fluid::{CHUNK, Fluid};
use crate::kernel::Smooth;
use crate::passes::{Density, Force};
use crate::simulation::{Greatest, Physics};

impl Physics {
    /// The pressure of the equation of state, pascals.
    pub(crate) fn pressure(&self, density: f32) -> f32 {
        let ratio = density / self.density;
        let square = ratio * ratio;
        let seventh = square * square * square * ratio;
        (self.sound * self.sound * self.density / 7.0 * (seventh - 1.0)).max(0.0)
    }

    /// p/ρ² by the equation of state.
    pub(crate) fn pressure_over_square(&self, density: f32) -> f32 {
        self.pressure(density) / (density * density)
    }

    /// The pass of forces, and the factor on its sums.
    pub(crate) fn force<K>(&self, kernel: K) -> (Force<K>, f32) {
        let support = self.kernel.support;
        let viscosity = 2.0 * self.viscosity / (self.density * support);
        let gravity = self.gravity.map(|g| g * support / self.density);
        let tension = self.sph.surface_tension as f32;
        let cohesion = tension / (self.kernel.tension * self.density * self.density);
        (Force { kernel, viscosity, cohesion, gravity }, self.mass * self.kernel.slope)
    }
}

impl Simulation {
    /// A step of the weakly compressible solver.
    pub(crate) fn weakly_compressible(&mut self, secs: f32) -> Greatest {
        let (around, fluid, physics, stats) = self.parts();
        let n = fluid.count;
        let mut sums = std::mem::take(&mut fluid.sums);
        let [a, b, c, ..] = &mut sums;

        around.of(fluid, physics).sum(Density(Smooth), [], [&mut a[..n]]);
        let scale = physics.mass * physics.kernel.value;
        let parts: Vec<f64> = (
            fluid.density[..n].par_chunks_mut(CHUNK),
            fluid.pressure[..n].par_chunks_mut(CHUNK),
            a[..n].par_chunks(CHUNK),
        )
            .into_par_iter()
            .map(|(densities, pressures, sums)| {
                let mut excess = 0.0;
                for ((density, pressure), sum) in densities.iter_mut().zip(pressures).zip(sums) {
                    *density = scale * (1.0 + sum);
                    *pressure = physics.pressure_over_square(*density);
                    excess += f64::from((*density / physics.density - 1.0).max(0.0));
                }
                excess
            })
            .collect();
        stats.compression = parts.iter().sum::<f64>() / n.max(1) as f64;

        let [u, v, w] = &fluid.velocity;
        let (force, scale) = physics.force(Smooth);
        let inputs: [&[f32]; 4] = [&fluid.pressure, u, v, w];
        let outputs = [&mut a[..n], &mut b[..n], &mut c[..n]];
        around.of(fluid, physics).sum(force, inputs, outputs);
        let greatest = leap(fluid, physics, ([a, b, c], scale), secs);
        fluid.sums = sums;
        greatest
    }
}

/// [`accelerate`] and [`Simulation::move_on`] at once: a third less to read and write.
fn leap(
    fluid: &mut Fluid,
    physics: &Physics,
    (sums, scale): ([&Vec<f32>; 3], f32),
    secs: f32,
) -> Greatest {
    let n = fluid.count;
    let [x, y, z] = fluid.position.each_mut().map(|row| row[..n].par_chunks_mut(CHUNK));
    let [u, v, w] = fluid.velocity.each_mut().map(|row| row[..n].par_chunks_mut(CHUNK));
    let [a, b, c] = sums.map(|row| row[..n].par_chunks(CHUNK));
    ((x, y, z), (u, v, w), (a, b, c))
        .into_par_iter()
        .map(|((x, y, z), (u, v, w), (a, b, c))| {
            part_of_leap(physics, ([x, y, z], [u, v, w]), ([a, b, c], scale), secs)
        })
        .reduce(Greatest::default, Greatest::with)
}

fn part_of_leap(
    physics: &Physics,
    (places, speeds): ([&mut [f32]; 3], [&mut [f32]; 3]),
    (sums, scale): ([&[f32]; 3], f32),
    secs: f32,
) -> Greatest {
    let mut greatest = Greatest::default();
    let bounds = physics.bounds();
    // All of one length, so that no index needs a test.
    let n = places[0].len();
    let places = places.map(|row| &mut row[..n]);
    let speeds = speeds.map(|row| &mut row[..n]);
    let sums = sums.map(|row| &row[..n]);
    for i in 0..n {
        let (mut speed, mut acceleration) = (0.0f32, 0.0f32);
        for axis in 0..3 {
            let push = scale * sums[axis][i] + physics.gravity[axis];
            let fast = speeds[axis][i] + secs * push;
            let next = places[axis][i] + secs * fast;
            let kept = next.clamp(bounds[0][axis], bounds[1][axis]);
            let left = kept != next;
            greatest.put_back += u64::from(left);
            greatest.lost |= !next.is_finite();
            let fast = if left { 0.0 } else { fast };
            (places[axis][i], speeds[axis][i]) = (kept, fast);
            speed += fast * fast;
            acceleration += push * push;
        }
        greatest.speed = greatest.speed.max(speed);
        greatest.acceleration = greatest.acceleration.max(acceleration);
    }
    greatest
}

/// Adds gravity and `scale` times the sums to the velocities. The square of the greatest acceleration.
pub(crate) fn accelerate(
    fluid: &mut Fluid,
    physics: &Physics,
    (sums, scale): ([&Vec<f32>; 3], f32),
    secs: f32,
) -> f32 {
    let n = fluid.count;
    let [u, v, w] = &mut fluid.velocity;
    let [a, b, c] = sums.map(|row| row[..n].par_chunks(CHUNK));
    let [g, h, k] = physics.gravity;
    (
        (u[..n].par_chunks_mut(CHUNK), v[..n].par_chunks_mut(CHUNK), w[..n].par_chunks_mut(CHUNK)),
        (a, b, c),
    )
        .into_par_iter()
        .map(|((u, v, w), (a, b, c))| {
            let mut greatest = 0.0f32;
            for i in 0..u.len() {
                let (a, b, c) = (scale * a[i] + g, scale * b[i] + h, scale * c[i] + k);
                u[i] += secs * a;
                v[i] += secs * b;
                w[i] += secs * c;
                greatest = greatest.max(a * a + b * b + c * c);
            }
            greatest
        })
        .reduce(|| 0.0, f32::max)
}
