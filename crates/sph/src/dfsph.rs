//! The divergence-free solver (Bender & Koschier 2015, *Divergence-Free Smoothed Particle
//! Hydrodynamics*): two solvers for pressure, one so that velocities make nothing too dense, one so that
//! nothing is too dense at the end of the step.
//!
//! With ∇W = −C t d (see [`crate::kernel`]; lengths in supports) and s = Δt p/ρ², the pressures' work on the velocities is
//! v_i += m C Σ_j t (s_i + s_j) d, which changes the rate of density of i itself, per s_i, by
//! −(m C)² (G·(G + G_w) + Σ t² r²), G = Σ t d and G_w its part by walls: their factor α (Eq. 8–11). Each iteration (Alg. 3, 4)
//! is s_i = max(s_i + ω R_i / (m C)² (…), 0), where R is the rate to be got rid of:
//!
//! | solver | R | what it changes |
//! |---|---|---|
//! | velocity | dρ/dt + min(ρ − ρ₀, 0)/Δt | velocities |
//! | place | dρ/dt + (ρ − ρ₀)/Δt | how particles move in this step |
//!
//! In the paper both change the velocities. What is done against a density that is already too great would
//! then stay as speed, and energy come from nothing; were it all forgotten, particles that approach would do
//! so step after step, and long steps end in pairs. [`KEPT`] of it stays. And what is still too thin may become denser, as
//! far as ρ₀: spray falls together again.
//!
//! The paper's ω is ½. To find the s is to find the least of ½ s·A s − s·R over s ≥ 0, A being what pressures
//! do to rates: projected gradients, for which [`Stride`] tells ω from how the last iteration turned out. A start with
//! the last step's pressures is taken as far as it brings that sum down, so that it cannot add energy.

use rayon::prelude::*;

use crate::Simulation;
use crate::fluid::{CHUNK, Fluid, total};
use crate::kernel::Wendland;
use crate::passes::{Divergence, Drag, Factors, Push};
use crate::simulation::{Around, Greatest, Physics};
use crate::wcsph::accelerate;

/// ω to begin with, and at which errors are told.
const FIRST: f32 = 0.5;
/// What it may become.
const STRIDES: (f64, f64) = (0.1, 3.0);
/// The part of the last step's pressure that the next begins with.
const WARM: f32 = 0.9;
/// The part of what moves particles to their places that stays as velocity.
const KEPT: f32 = 0.4;

/// The part of the tolerance at which velocities are right: what is wrong with them stays.
const VELOCITY: f64 = 0.3;
/// The part of the tolerance at which places are right, as densities are not quite linear in them.
const PLACE: f64 = 0.5;
/// Iterations at the least.
const LEAST: u64 = 1;

/// Which of the two solvers, and its place in [`Fluid::warm`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    Velocity = 0,
    Place = 1,
}

impl Simulation {
    /// A step of the divergence-free solver.
    pub(crate) fn divergence_free(&mut self, secs: f32) -> Greatest {
        // By rate, not by step: what is left over in each of many short steps would add up.
        let share = f64::from(secs) / self.longest_step();
        let tolerance = VELOCITY * share.min(1.0) * self.physics.sph.tolerance;
        let (around, fluid, physics, stats) = self.parts();
        factors(around, fluid, physics);
        let acceleration = forces(around, fluid, physics, secs);
        let first = solve(Aim::Velocity, around, fluid, physics, (secs, tolerance));
        for (row, velocity) in fluid.motion.iter_mut().zip(&fluid.velocity) {
            row.clone_from(velocity);
        }
        let second =
            solve(Aim::Place, around, fluid, physics, (secs, PLACE * physics.sph.tolerance));
        stats.iterations = [stats.iterations[0] + first.0, stats.iterations[1] + second.0];
        stats.compression = second.1;
        for (velocity, motion) in fluid.velocity.iter_mut().zip(&fluid.motion) {
            let rows = velocity.par_chunks_mut(CHUNK).zip(motion.par_chunks(CHUNK));
            rows.for_each(|(velocity, motion)| {
                velocity.iter_mut().zip(motion).for_each(|(v, m)| *v += KEPT * (m - *v));
            });
        }
        let greatest = Self::move_on(fluid, physics, secs);
        Greatest { acceleration, ..greatest }
    }
}

impl Fluid {
    /// What a solver changes.
    fn aim(&mut self, aim: Aim) -> &mut [Vec<f32>; 3] {
        match aim {
            Aim::Velocity => &mut self.velocity,
            Aim::Place => &mut self.motion,
        }
    }

    /// The pressure that changed the velocity of a particle in the last step, pascals.
    pub fn pressure_felt(&self, at: usize) -> f32 {
        self.warm[0][at] + KEPT * self.warm[1][at]
    }
}

/// Density, and 1/((m C)² (…)).
fn factors(around: Around<'_>, fluid: &mut Fluid, physics: &Physics) {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    around.of(fluid, physics).sum(Factors(Wendland), [], sums.each_mut().map(|row| &mut row[..n]));
    let scale = physics.mass * physics.kernel.value;
    let slope = physics.mass * physics.kernel.slope;
    // Where there is hardly a neighbour, as much is due to it as to one two thirds of the support away.
    let least = (2.0f32 / 3.0 / 27.0).powi(2);
    let rows =
        fluid.density[..n].par_chunks_mut(CHUNK).zip(fluid.factor[..n].par_chunks_mut(CHUNK));
    rows.enumerate().for_each(|(chunk, (density, factor))| {
        let part = chunk * CHUNK..chunk * CHUNK + density.len();
        let [a, all @ .., e] = sums.each_ref().map(|row| &row[part.clone()]);
        for i in 0..density.len() {
            density[i] = scale * (1.0 + a[i]);
            // What a wall does counts twice in what it does to the particle.
            let own: f32 = (0..3).map(|k| all[k][i] * (all[k][i] + all[k + 3][i])).sum();
            factor[i] = 1.0 / (slope * slope * (own + e[i]).max(least));
        }
    });
    fluid.sums = sums;
}

/// Viscosity and gravity. The square of the greatest acceleration.
fn forces(around: Around<'_>, fluid: &mut Fluid, physics: &Physics, secs: f32) -> f32 {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let [a, b, c, ..] = &mut sums;
    let unit = 1.0 / (physics.density * physics.density);
    let rows = fluid.pressure.iter_mut().zip(&fluid.warm[0]);
    rows.for_each(|(pressure, warm)| *pressure = unit * warm);
    let [u, v, w] = &fluid.velocity;
    let (force, scale) = physics.force(Wendland);
    let inputs: [&[f32]; 4] = [&fluid.pressure, u, v, w];
    around.of(fluid, physics).sum(Drag(force), inputs, [&mut a[..n], &mut b[..n], &mut c[..n]]);
    let greatest = accelerate(fluid, physics, ([a, b, c], scale), secs);
    fluid.sums = sums;
    greatest
}

/// ω by the step of Barzilai & Borwein 1988 (for bounds: Birgin, Martínez & Raydan 2000): with Δs and ΔR of
/// the last iteration, and D = 1/((m C)² (…)), ω = Δs·D⁻¹Δs / −Δs·ΔR. That is by which it would have got rid of
/// most, in those s that it changed.
struct Stride {
    /// ω.
    omega: f32,
    /// Whether an iteration has been.
    seen: bool,
}

/// One of the two solvers: how many iterations, and the mean error that is left.
fn solve(
    aim: Aim,
    around: Around<'_>,
    fluid: &mut Fluid,
    physics: &Physics,
    (secs, tolerance): (f32, f64),
) -> (u64, f64) {
    let n = fluid.count;
    let unit = secs / (physics.density * physics.density);
    begin(aim, around, fluid, physics, secs);
    let mut iterations = 0;
    let mut error;
    let mut stride = Stride { omega: FIRST, seen: false };
    loop {
        error = correct(aim, around, fluid, physics, (secs, &mut stride));
        let enough = iterations >= LEAST && error <= tolerance;
        if enough || iterations >= u64::from(physics.sph.iterations) {
            break;
        }
        push(around, fluid, physics);
        pushed(aim, fluid, physics, 1.0);
        iterations += 1;
    }
    // What was found last has not been tried.
    let (total, s) = (&mut fluid.warm[aim as usize], &fluid.pressure);
    total[..n].par_chunks_mut(CHUNK).zip(s[..n].par_chunks(CHUNK)).for_each(|(total, s)| {
        total.iter_mut().zip(s).for_each(|(total, s)| *total = (*total - s) / unit);
    });
    (iterations, error)
}

/// Begins with the last step's pressures, as far as they are of use: to α = s·R / s·A s, no more than 1. That is told
/// from what they do to velocities v: s·A s = Σ Δv², and s·dρ/dt = −Σ v·Δv.
fn begin(aim: Aim, around: Around<'_>, fluid: &mut Fluid, physics: &Physics, secs: f32) {
    let n = fluid.count;
    // Pascals become s.
    let unit = secs / (physics.density * physics.density);
    let (warm, s) = (&fluid.warm[aim as usize], &mut fluid.pressure);
    let rows = warm[..n].par_chunks(CHUNK).zip(s[..n].par_chunks_mut(CHUNK));
    rows.for_each(|(warm, s)| {
        s.iter_mut().zip(warm).for_each(|(s, warm)| *s = WARM * unit * warm);
    });
    push(around, fluid, physics);
    let scale = f64::from(physics.mass * physics.kernel.slope);
    let rows = if aim == Aim::Velocity { &fluid.velocity } else { &fluid.motion };
    let change = |i: usize, k: usize| scale * f64::from(fluid.sums[k][i]);
    let needed = total(n, |i| {
        let counted = counted(aim, fluid.density[i] - physics.density) / secs;
        let along: f64 = (0..3).map(|k| f64::from(rows[k][i]) * change(i, k)).sum();
        f64::from(fluid.pressure[i] * counted) - along
    });
    let done = total(n, |i| (0..3).map(|k| change(i, k).powi(2)).sum());
    let part = if done > 0.0 { (needed / done).clamp(0.0, 1.0) as f32 } else { 0.0 };
    pushed(aim, fluid, physics, part);
    let (warm, s) = (&mut fluid.warm[aim as usize], &fluid.pressure);
    let rows = warm[..n].par_chunks_mut(CHUNK).zip(s[..n].par_chunks(CHUNK));
    rows.for_each(|(warm, s)| warm.iter_mut().zip(s).for_each(|(warm, s)| *warm = part * s));
}

/// What of ρ − ρ₀ is to be got rid of.
fn counted(aim: Aim, excess: f32) -> f32 {
    if aim == Aim::Place { excess } else { excess.min(0.0) }
}

/// Finds what is still to be pushed, and the mean error of the densities without it: too dense, or too
/// thin where there is pressure. (A start with too much pressure would else not be seen, and add energy.)
fn correct(
    aim: Aim,
    around: Around<'_>,
    fluid: &mut Fluid,
    physics: &Physics,
    (secs, stride): (f32, &mut Stride),
) -> f64 {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let sum = &mut sums[0];
    let rows = if aim == Aim::Velocity { &fluid.velocity } else { &fluid.motion };
    let inputs = rows.each_ref().map(|row| &row[..]);
    around.of(fluid, physics).sum(Divergence(Wendland), inputs, [&mut sum[..n]]);
    let slope = physics.mass * physics.kernel.slope;
    let rest = physics.density;
    fluid.rate.resize(n, 0.0);
    let parts: Vec<[f64; 2]> = (
        fluid.rate.par_chunks_mut(CHUNK),
        (fluid.pressure[..n].par_chunks(CHUNK), fluid.factor[..n].par_chunks(CHUNK)),
        (sum[..n].par_chunks(CHUNK), fluid.density[..n].par_chunks(CHUNK)),
    )
        .into_par_iter()
        .map(|(rates, (s, factor), (sum, density))| {
            let [mut way, mut gone] = [0.0; 2];
            for i in 0..rates.len() {
                let rate = counted(aim, density[i] - rest) / secs - slope * sum[i];
                way += f64::from(s[i] * s[i] / factor[i]);
                gone += f64::from(s[i] * (rates[i] - rate));
                rates[i] = rate;
            }
            [way, gone]
        })
        .collect();
    fluid.sums = sums;
    let [way, gone] = parts.iter().fold([0.0; 2], |sum, part| [0, 1].map(|k| sum[k] + part[k]));
    if stride.seen && gone > 0.0 {
        stride.omega = (way / gone).clamp(STRIDES.0, STRIDES.1) as f32;
    }
    stride.seen = true;
    let omega = stride.omega;
    let parts: Vec<f64> = (
        fluid.warm[aim as usize][..n].par_chunks_mut(CHUNK),
        fluid.pressure[..n].par_chunks_mut(CHUNK),
        fluid.rate.par_chunks(CHUNK),
        fluid.factor[..n].par_chunks(CHUNK),
    )
        .into_par_iter()
        .map(|(total, s, rate, factor)| {
            let mut error = 0.0;
            for i in 0..total.len() {
                let by = rate[i] * factor[i];
                let next = (total[i] + omega * by).max(0.0);
                let tried = (total[i] + FIRST * by).max(0.0) - total[i];
                error += f64::from((tried / (FIRST * factor[i]) * secs / rest).abs());
                (s[i], total[i]) = (next - total[i], next);
            }
            error
        })
        .collect();
    parts.iter().sum::<f64>() / n.max(1) as f64
}

/// Leaves in the sums what would come of [`Fluid::pressure`].
fn push(around: Around<'_>, fluid: &mut Fluid, physics: &Physics) {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let [a, b, c, ..] = &mut sums;
    let outputs = [&mut a[..n], &mut b[..n], &mut c[..n]];
    around.of(fluid, physics).sum(Push(Wendland), [&fluid.pressure], outputs);
    fluid.sums = sums;
}

/// Lets a part of what [`push`] found be.
fn pushed(aim: Aim, fluid: &mut Fluid, physics: &Physics, part: f32) {
    let n = fluid.count;
    let scale = part * physics.mass * physics.kernel.slope;
    let sums = std::mem::take(&mut fluid.sums);
    for (row, sum) in fluid.aim(aim).iter_mut().zip(&sums) {
        row[..n].par_chunks_mut(CHUNK).zip(sum[..n].par_chunks(CHUNK)).for_each(|(row, sum)| {
            row.iter_mut().zip(sum).for_each(|(v, sum)| *v += scale * sum);
        });
    }
    fluid.sums = sums;
}
