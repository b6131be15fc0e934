//! The divergence-free solver (Bender & Koschier 2015, *Divergence-Free Smoothed Particle
//! Hydrodynamics*): two solvers for the pressure that is lacking, one so that nothing becomes denser in
//! this step's velocities, one so that nothing is too dense at its end.
//!
//! With ∇W = −C t d (see [`crate::kernel`]) and s = Δt p/ρ², the pressures' work on the velocities is
//! v_i += m C Σ_j t (s_i + s_j) d, which changes the rate of density of i itself, per s_i, by
//! −(m C)² (|Σ t d|² + Σ t² r²): their factor α (Eq. 8–11). Each iteration (Alg. 3, 4) is one of Jacobi's:
//! s_i += ω R_i / (m C)² (…), R the rate to be got rid of:
//!
//! | solver | R |
//! |---|---|
//! | divergence | dρ/dt |
//! | density | dρ/dt + (ρ − ρ₀)/Δt |
//!
//! It is kept from pulling (s ≥ 0) as a whole rather than iteration by iteration, so that a start with the
//! last step's pressures can be taken back where it was too much.

use rayon::prelude::*;

use crate::Simulation;
use crate::fluid::{CHUNK, Fluid};
use crate::passes::{Divergence, Factors, Push};
use crate::simulation::{Around, Greatest, Physics};
use crate::wcsph::accelerate;

/// ω: neighbours correct at the same time.
const RELAXATION: f32 = 0.5;
/// The part of the last step's pressure that the next begins with.
const WARM: f32 = 0.9;


/// Which of the two solvers, and its place in [`Fluid::warm`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    Density = 0,
    Divergence = 1,
}

impl Simulation {
    /// A step of the divergence-free solver.
    pub(crate) fn divergence_free(&mut self, secs: f32) -> Greatest {
        let (around, fluid, physics, stats) = self.parts();
        factors(around, fluid, physics);
        stats.iterations[1] += solve(Aim::Divergence, around, fluid, physics, secs).0;
        let acceleration = forces(around, fluid, physics, secs);
        let (iterations, compression) = solve(Aim::Density, around, fluid, physics, secs);
        stats.iterations[0] += iterations;
        stats.compression = compression;
        Greatest { acceleration, ..Self::move_on(fluid, physics, secs) }
    }
}

/// Density, and 1/((m C)² (|Σ t d|² + Σ t² r²)).
fn factors(around: Around<'_>, fluid: &mut Fluid, physics: &Physics) {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let [a, b, c, d, e, ..] = &mut sums;
    let outputs = [&mut a[..n], &mut b[..n], &mut c[..n], &mut d[..n], &mut e[..n]];
    around.of(fluid, physics).sum(Factors, [], outputs);
    let scale = physics.mass * physics.kernel.value;
    let slope = physics.mass * physics.kernel.slope;
    // Where there is hardly a neighbour, as much is due to it as to one two thirds of the support away.
    let least = (2.0 / 3.0 * physics.kernel.support / 27.0).powi(2);
    let [a, b, c, d, e] = [a, b, c, d, e].map(|row| row[..n].par_chunks(CHUNK));
    let rows = (fluid.density[..n].par_chunks_mut(CHUNK), fluid.factor[..n].par_chunks_mut(CHUNK));
    (rows, (a, b, c, d, e)).into_par_iter().for_each(|((density, factor), (a, b, c, d, e))| {
        for i in 0..density.len() {
            density[i] = scale * (1.0 + a[i]);
            let sum = b[i] * b[i] + c[i] * c[i] + d[i] * d[i] + e[i];
            factor[i] = 1.0 / (slope * slope * sum.max(least));
        }
    });
    fluid.sums = sums;
}

/// Viscosity, cohesion and gravity. The square of the greatest acceleration.
fn forces(around: Around<'_>, fluid: &mut Fluid, physics: &Physics, secs: f32) -> f32 {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let [a, b, c, ..] = &mut sums;
    fluid.pressure.fill(0.0);
    let [u, v, w] = &fluid.velocity;
    let (force, scale) = physics.force();
    let inputs: [&[f32]; 4] = [&fluid.pressure, u, v, w];
    around.of(fluid, physics).sum(force, inputs, [&mut a[..n], &mut b[..n], &mut c[..n]]);
    let greatest = accelerate(fluid, physics, ([a, b, c], scale), secs);
    fluid.sums = sums;
    greatest
}

/// One of the two solvers: how many iterations, and the mean error that is left.
fn solve(
    aim: Aim,
    around: Around<'_>,
    fluid: &mut Fluid,
    physics: &Physics,
    secs: f32,
) -> (u64, f64) {
    let n = fluid.count;
    let unit = secs / (physics.density * physics.density);
    // Pascals become s, and are tried.
    let (warm, s) = (&mut fluid.warm[aim as usize], &mut fluid.pressure);
    let rows = warm[..n].par_chunks_mut(CHUNK).zip(s[..n].par_chunks_mut(CHUNK));
    rows.for_each(|(total, s)| {
        for (total, s) in total.iter_mut().zip(s) {
            *total *= WARM * unit;
            *s = *total;
        }
    });
    push(around, fluid, physics);
    let mut iterations = 0;
    let mut compression;
    let least = if aim == Aim::Density { 2 } else { 1 };
    loop {
        compression = correct(aim, around, fluid, physics, secs);
        let enough = iterations >= least && compression <= physics.sph.tolerance;
        if enough || iterations >= u64::from(physics.sph.iterations) {
            break;
        }
        push(around, fluid, physics);
        iterations += 1;
    }
    // What was found last has not been tried.
    let (total, s) = (&mut fluid.warm[aim as usize], &fluid.pressure);
    total[..n].par_chunks_mut(CHUNK).zip(s[..n].par_chunks(CHUNK)).for_each(|(total, s)| {
        total.iter_mut().zip(s).for_each(|(total, s)| *total = (*total - s) / unit);
    });
    (iterations, compression)
}

/// Finds what is still to be pushed, and the mean error of the densities without it: too dense, or too
/// thin where there is pressure. (A start with too much pressure would else not be seen, and add energy.)
fn correct(
    aim: Aim,
    around: Around<'_>,
    fluid: &mut Fluid,
    physics: &Physics,
    secs: f32,
) -> f64 {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let sum = &mut sums[0];
    let inputs = fluid.velocity.each_ref().map(|row| &row[..]);
    around.of(fluid, physics).sum(Divergence, inputs, [&mut sum[..n]]);
    let slope = physics.mass * physics.kernel.slope;
    let rest = physics.density;
    let parts: Vec<f64> = (
        fluid.warm[aim as usize][..n].par_chunks_mut(CHUNK),
        fluid.pressure[..n].par_chunks_mut(CHUNK),
        (sum[..n].par_chunks(CHUNK), fluid.density[..n].par_chunks(CHUNK)),
        fluid.factor[..n].par_chunks(CHUNK),
    )
        .into_par_iter()
        .map(|(total, s, (sum, density), factor)| {
            let mut excess = 0.0;
            for i in 0..total.len() {
                let mut rate = -slope * sum[i];
                if aim == Aim::Density {
                    rate += (density[i] - rest) / secs;
                }
                let next = (total[i] + RELAXATION * rate * factor[i]).max(0.0);
                s[i] = next - total[i];
                excess += f64::from((s[i] / (RELAXATION * factor[i]) * secs / rest).abs());
                total[i] = next;
            }
            excess
        })
        .collect();
    fluid.sums = sums;
    parts.iter().sum::<f64>() / n.max(1) as f64
}

/// Lets what stands in [`Fluid::pressure`] push the velocities.
fn push(around: Around<'_>, fluid: &mut Fluid, physics: &Physics) {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let [a, b, c, ..] = &mut sums;
    let outputs = [&mut a[..n], &mut b[..n], &mut c[..n]];
    around.of(fluid, physics).sum(Push, [&fluid.pressure], outputs);
    let scale = physics.mass * physics.kernel.slope;
    for (row, sum) in fluid.velocity.iter_mut().zip([a, b, c]) {
        row[..n].par_chunks_mut(CHUNK).zip(sum[..n].par_chunks(CHUNK)).for_each(|(row, sum)| {
            row.iter_mut().zip(sum).for_each(|(v, sum)| *v += scale * sum);
        });
    }
    fluid.sums = sums;
}
