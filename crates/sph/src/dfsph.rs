//! The divergence-free solver (Bender & Koschier 2015, *Divergence-Free Smoothed Particle
//! Hydrodynamics*): two solvers for pressure, one so that velocities make nothing too dense, one so that
//! nothing is too dense at the end of the step.
//!
//! With ∇W = −C t d (see [`crate::kernel`]; lengths in supports) and s = Δt p/ρ², the pressures' work on the velocities is
//! v_i += m C Σ_j t (s_i + s_j) d, which changes the rate of density of i itself, per s_i, by
//! −(m C)² (G·(G + G_w) + Σ t² r²), G = Σ t d and G_w its part by walls: their factor α (Eq. 8–11). Each iteration (Alg. 3, 4) is one of Jacobi's:
//! s_i += ω R_i / (m C)² (…), with [`Momentum`]; R is the rate to be got rid of:
//!
//! | solver | R | what it changes |
//! |---|---|---|
//! | velocity | dρ/dt + min(ρ − ρ₀, 0)/Δt | velocities |
//! | place | dρ/dt + (ρ − ρ₀)/Δt | how particles move in this step |
//!
//! In the paper both change the velocities. What is done against a density that is already too great would
//! then stay as speed, and energy come from nothing; here it moves the particles and is forgotten. And what
//! is still too thin may become denser, as far as ρ₀: spray falls together again.
//!
//! Pressure is kept from pulling (s ≥ 0) as a whole rather than iteration by iteration, so that a start with
//! the last step's can be taken back where it was too much.

use rayon::prelude::*;

use crate::Simulation;
use crate::fluid::{CHUNK, Fluid};
use crate::kernel::Wendland;
use crate::passes::{Divergence, Drag, Factors, Push};
use crate::simulation::{Around, Greatest, Physics};
use crate::wcsph::accelerate;

/// ω: neighbours correct at the same time, and with momentum (0.5 is too much for that).
const RELAXATION: f32 = 0.3;
/// The part of the last step's pressure that the next begins with.
const WARM: f32 = 0.9;
/// The part of the places' last pressure that velocities begin with as well: what had to be put right there
/// is what velocities were not stopped from, and few iterations do if it is not forgotten step after step.
/// The second where the last step's velocities were left with an error of [`FEEDBACK_FROM`] or more; as
/// large a part at all times would set liquid at rest swinging.
const FEEDBACK: [f32; 2] = [0.1, 0.5];
const FEEDBACK_FROM: f64 = 0.001;

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
        let feedback = FEEDBACK[usize::from(self.unsolved)];
        let (around, fluid, physics, stats) = self.parts();
        factors(around, fluid, physics);
        let acceleration = forces(around, fluid, physics, secs);
        let [velocity, place] = &mut fluid.warm;
        velocity.iter_mut().zip(place).for_each(|(v, p)| *v += feedback * *p);
        let first = solve(Aim::Velocity, around, fluid, physics, (secs, tolerance));
        for (row, velocity) in fluid.motion.iter_mut().zip(&fluid.velocity) {
            row.clone_from(velocity);
        }
        let second =
            solve(Aim::Place, around, fluid, physics, (secs, PLACE * physics.sph.tolerance));
        stats.iterations = [stats.iterations[0] + first.0, stats.iterations[1] + second.0];
        stats.compression = second.1;
        let greatest = Self::move_on(fluid, physics, secs);
        self.unsolved = first.1 > VELOCITY * share.min(1.0) * FEEDBACK_FROM;
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

/// Nesterov's momentum: each iteration goes on by a part of the way that the last one went, more and more,
/// and begins anew when the error has grown (Nesterov 1983; O'Donoghue & Candès 2015).
struct Momentum {
    since: u32,
    error: f64,
}

impl Momentum {
    fn momentum(&self) -> f32 {
        self.since as f32 / (self.since as f32 + 3.0)
    }

    fn seen(&mut self, error: f64) {
        self.since = if error > self.error { 0 } else { self.since + 1 };
        self.error = error;
    }
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
    // Pascals become s, and are tried.
    let (warm, s) = (&mut fluid.warm[aim as usize], &mut fluid.pressure);
    let rows = warm[..n].par_chunks_mut(CHUNK).zip(s[..n].par_chunks_mut(CHUNK));
    rows.for_each(|(total, s)| {
        for (total, s) in total.iter_mut().zip(s) {
            *total *= WARM * unit;
            *s = *total;
        }
    });
    push(aim, around, fluid, physics);
    let Fluid { before, warm, .. } = fluid;
    before.clone_from(&warm[aim as usize]);
    let mut iterations = 0;
    let mut compression;
    let mut way = Momentum { since: 0, error: f64::INFINITY };
    loop {
        compression = correct(aim, around, fluid, physics, (secs, way.momentum()));
        way.seen(compression);
        let enough = iterations >= LEAST && compression <= tolerance;
        if enough || iterations >= u64::from(physics.sph.iterations) {
            break;
        }
        push(aim, around, fluid, physics);
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
    (secs, momentum): (f32, f32),
) -> f64 {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let sum = &mut sums[0];
    let rows = if aim == Aim::Velocity { &fluid.velocity } else { &fluid.motion };
    let inputs = rows.each_ref().map(|row| &row[..]);
    around.of(fluid, physics).sum(Divergence(Wendland), inputs, [&mut sum[..n]]);
    let slope = physics.mass * physics.kernel.slope;
    let rest = physics.density;
    let parts: Vec<f64> = (
        (
            fluid.warm[aim as usize][..n].par_chunks_mut(CHUNK),
            fluid.before[..n].par_chunks_mut(CHUNK),
        ),
        fluid.pressure[..n].par_chunks_mut(CHUNK),
        (sum[..n].par_chunks(CHUNK), fluid.density[..n].par_chunks(CHUNK)),
        fluid.factor[..n].par_chunks(CHUNK),
    )
        .into_par_iter()
        .map(|((total, before), s, (sum, density), factor)| {
            let mut excess = 0.0;
            for i in 0..total.len() {
                let excess_now = density[i] - rest;
                let counted = if aim == Aim::Place { excess_now } else { excess_now.min(0.0) };
                let rate = counted / secs - slope * sum[i];
                let next = (total[i] + RELAXATION * rate * factor[i]).max(0.0);
                let error = (next - total[i]) / (RELAXATION * factor[i]) * secs / rest;
                excess += f64::from(error.abs());
                let further = (next + momentum * (next - before[i])).max(0.0);
                s[i] = further - total[i];
                (before[i], total[i]) = (next, further);
            }
            excess
        })
        .collect();
    fluid.sums = sums;
    parts.iter().sum::<f64>() / n.max(1) as f64
}

/// Lets what stands in [`Fluid::pressure`] push.
fn push(aim: Aim, around: Around<'_>, fluid: &mut Fluid, physics: &Physics) {
    let n = fluid.count;
    let mut sums = std::mem::take(&mut fluid.sums);
    let [a, b, c, ..] = &mut sums;
    let outputs = [&mut a[..n], &mut b[..n], &mut c[..n]];
    around.of(fluid, physics).sum(Push(Wendland), [&fluid.pressure], outputs);
    let scale = physics.mass * physics.kernel.slope;
    for (row, sum) in fluid.aim(aim).iter_mut().zip([a, b, c]) {
        row[..n].par_chunks_mut(CHUNK).zip(sum[..n].par_chunks(CHUNK)).for_each(|(row, sum)| {
            row.iter_mut().zip(sum).for_each(|(v, sum)| *v += scale * sum);
        });
    }
    fluid.sums = sums;
}
