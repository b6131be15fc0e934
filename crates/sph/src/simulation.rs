//! A simulation: from frame to frame, in steps as large as the solver allows.
//!
//! Time steps (Monaghan 1992, §10.3; lengths in spacings Δ, λ the `cfl`): Δt ≤ λ Δ / v_max, v_max + c for
//! wcsph; Δt ≤ λ/4 √(Δ / a_max) for the greatest acceleration (dfsph: but by pressure); Δt ≤ Δ² / (4 ν);
//! Δt ≤ λ √(ρ Δ³ / (4π γ)), so that the shortest waves of the surface are seen (Brackbill et al. 1992). What is left of a
//! frame is divided evenly.

use std::f64::consts::PI;

use fearless_simd::Level;
use motes_scene::{Solver, Sph};
use rayon::prelude::*;

use crate::cells::Lattice;
use crate::fluid::{CHUNK, Fluid, total};
use crate::kernel::{Kernel, Kind, Smooth, Wendland};
use crate::mask::{Mask, from_sums};
use crate::pairs::Neighbors;
use crate::passes::{Density, DensityAndMask};
use crate::scenario::Setup;
use crate::virial::transmitted;
use crate::walls::Walls;

/// A step is never longer, seconds.
const LONGEST_STEP: f64 = 0.02;
/// The first step is this part of what it may be, and each next at most [`GROWTH`] times the last: there
/// is no last step's pressure to begin with.
const FIRST_STEP: f64 = 0.1;
const GROWTH: f64 = 1.25;
/// Nor shorter: then something has gone wrong.
const SHORTEST_STEP: f64 = 1e-9;

/// One frame, particle by particle in the order in which they came.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Seconds.
    pub time: f64,
    /// Steps since the start.
    pub step: u64,
    /// Metres.
    pub positions: Vec<[f32; 3]>,
    /// Metres per second.
    pub velocities: Vec<[f32; 3]>,
    /// Kilograms per cubic metre.
    pub density: Vec<f32>,
    /// Pascals.
    pub pressure: Vec<f32>,
    /// Particle masks.
    pub masks: Vec<Mask>,
}

/// What has happened so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Seconds simulated.
    pub time: f64,
    /// Steps done.
    pub steps: u64,
    /// The last step, seconds.
    pub step_secs: f64,
    /// Particles there are.
    pub particles: usize,
    /// Iterations of the dfsph solvers in all: of velocities, and of places.
    pub iterations: [u64; 2],
    /// Mean error of the densities that the last step foresaw (wcsph: compression), as a part of the
    /// density.
    pub compression: f64,
    /// How often a particle had to be put back into the tank: 0 unless steps are too long.
    pub put_back: u64,
}

/// What does not change while a simulation runs.
#[derive(Clone, Debug)]
pub(crate) struct Physics {
    pub kernel: Kernel,
    /// Of a particle, kilograms.
    pub mass: f32,
    /// ρ₀.
    pub density: f32,
    pub spacing: f32,
    pub gravity: [f32; 3],
    /// ν in all, m²/s.
    pub viscosity: f32,
    /// c of wcsph.
    pub sound: f32,
    pub sph: Sph,
    pub tank: [[f32; 3]; 2],
    pub level: Level,
}

/// A running simulation.
#[derive(Clone, Debug)]
pub struct Simulation {
    pub(crate) physics: Physics,
    pub(crate) fluid: Fluid,
    pub(crate) stats: Stats,
    lattice: Lattice,
    walls: Walls,
    /// The most of v² and a² over the particles in the last step.
    pub(crate) greatest: Greatest,
    jets: Vec<Spout>,
    most: usize,
    frames: u64,
}

/// A jet, and how far its last layer has come.
#[derive(Clone, Debug)]
struct Spout {
    jet: crate::Jet,
    way: f64,
}

/// The squares of the greatest speed and acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Greatest {
    pub speed: f32,
    pub acceleration: f32,
    /// Particles put back.
    pub put_back: u64,
    /// Whether a number is no longer finite.
    pub lost: bool,
}

impl Greatest {
    pub fn with(self, other: Self) -> Self {
        Self {
            speed: self.speed.max(other.speed),
            acceleration: self.acceleration.max(other.acceleration),
            put_back: self.put_back + other.put_back,
            lost: self.lost | other.lost,
        }
    }
}

impl Physics {
    /// The least and the greatest corner of where particles can be: the samples of the walls of dfsph.
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let behind = 0.5 * self.spacing;
        [self.tank[0].map(|v| v - behind), self.tank[1].map(|v| v + behind)]
    }

    fn new(setup: &Setup, sph: &Sph) -> Self {
        let spacing = f64::from(setup.spacing);
        let kind = if sph.solver == Solver::Wcsph { Kind::Smooth } else { Kind::Wendland };
        let kernel = Kernel::new(kind, 2.0 * setup.spacing);
        // A lattice at rest has the density at rest.
        let sum = kernel.lattice_sum(spacing) * f64::from(kernel.value);
        let mass = sph.density / sum;
        let fall = (2.0 * sph.gravity.length() * f64::from(setup.fall)).sqrt().max(0.1);
        let sound = sph.sound_speed.unwrap_or(10.0 * fall);
        let support = f64::from(kernel.support);
        Self {
            kernel,
            mass: mass as f32,
            density: sph.density as f32,
            spacing: setup.spacing,
            gravity: sph.gravity.to_array().map(|g| g as f32),
            // Monaghan's α c h/10, h being half the support.
            viscosity: (sph.viscosity + sph.smoothing * sound * support / 20.0) as f32,
            sound: sound as f32,
            sph: sph.clone(),
            tank: setup.tank,
            level: Level::new(),
        }
    }
}

impl Simulation {
    /// The simulation at its start. `sph` is as [`Sph::check`] lets it through.
    pub fn new(setup: Setup, sph: &Sph) -> Self {
        let physics = Physics::new(&setup, sph);
        let [low, high] = setup.tank;
        let margin = 0.5 * setup.spacing;
        let lattice =
            Lattice::new(low.map(|v| v - margin), high.map(|v| v + margin), physics.kernel.support);
        // wcsph: the wall's part of the density, and pressure with it, grows the faster the nearer the end
        // of the kernel. That is enough for a wall to answer with no pressure of its own, so that energy
        // is kept, and nothing comes through. dfsph: walls have a pressure, and are spaced as the liquid.
        let behind = if sph.solver == Solver::Wcsph { 0.75 } else { 0.5 };
        let walls = Walls::new((&setup.solids, behind), setup.spacing, &physics.kernel, &lattice);
        let mut fluid = Fluid::default();
        fluid.add(&setup.positions, &setup.velocities);
        let square = |v: &[f32; 3]| v.iter().map(|v| v * v).sum::<f32>();
        let jets = setup.jets.iter().map(|j| square(&j.velocity));
        let speed = setup.velocities.iter().map(square).chain(jets).fold(0.0, f32::max);
        let spouts = setup.jets.into_iter().map(|jet| Spout { jet, way: f64::from(setup.spacing) });
        Self {
            stats: Stats { particles: fluid.count, ..Stats::default() },
            greatest: Greatest { speed, ..Greatest::default() },
            jets: spouts.collect(),
            most: setup.most,
            frames: 0,
            physics,
            fluid,
            lattice,
            walls,
        }
    }

    /// What has happened so far.
    pub fn stats(&self) -> Stats {
        self.stats
    }

    /// How many frames there have been since the start.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Distance of particles at rest, metres.
    pub fn spacing(&self) -> f32 {
        self.physics.spacing
    }

    /// The least and the greatest corner of the tank, metres.
    pub fn tank(&self) -> [[f32; 3]; 2] {
        self.physics.tank
    }

    /// Goes to the next frame; `watch` is told after each step, and ends it by `false`.
    ///
    /// # Errors
    /// The simulation has blown up, in words; or `watch` has had enough.
    pub fn advance(&mut self, watch: &mut dyn FnMut(&Stats) -> bool) -> Result<(), String> {
        let end = (self.frames + 1) as f64 / self.physics.sph.fps;
        let longest = 1.0 / (self.physics.sph.fps * f64::from(self.physics.sph.substeps));
        while self.stats.time < end {
            let left = end - self.stats.time;
            let allowed = self.next_step().min(longest);
            if allowed < SHORTEST_STEP {
                return Err(self.blown_up());
            }
            let steps = (left / allowed - 1e-6).ceil().max(1.0);
            let secs = left / steps;
            self.step(secs)?;
            if steps == 1.0 {
                self.stats.time = end;
            }
            if !watch(&self.stats) {
                return Err("cancelled".into());
            }
        }
        self.frames += 1;
        Ok(())
    }

    /// One step of `secs` seconds, which should not be more than [`Simulation::longest_step`].
    ///
    /// # Errors
    /// The simulation has blown up, in words.
    pub fn step(&mut self, secs: f64) -> Result<(), String> {
        self.pour(secs);
        // In one visit to the threads, not one for each loop.
        rayon::scope(|_| {
            self.fluid.sort(&self.lattice, &self.physics);
            self.greatest = match self.physics.sph.solver {
                Solver::Wcsph => self.weakly_compressible(secs as f32),
                Solver::Dfsph => self.divergence_free(secs as f32),
            };
        });
        self.stats.time += secs;
        self.stats.steps += 1;
        self.stats.step_secs = secs;
        self.stats.particles = self.fluid.count;
        self.stats.put_back += self.greatest.put_back;
        if self.greatest.lost { Err(self.blown_up()) } else { Ok(()) }
    }

    fn blown_up(&self) -> String {
        let Stats { time, steps, .. } = self.stats;
        format!(
            "the simulation blew up after {time:.3} s and {steps} steps; a smaller cfl may help"
        )
    }

    /// The longest step allowed now, seconds.
    pub fn longest_step(&self) -> f64 {
        let Physics { spacing, viscosity, sph, sound, gravity, .. } = &self.physics;
        let spacing = f64::from(*spacing);
        let mut speed = f64::from(self.greatest.speed).sqrt();
        let weight = gravity.iter().map(|g| f64::from(g * g)).sum::<f64>().sqrt();
        // Until the first step, particles are only about to fall.
        let acceleration = weight.max(f64::from(self.greatest.acceleration).sqrt());
        if sph.solver == Solver::Wcsph {
            speed += f64::from(*sound);
        }
        (sph.cfl * spacing / speed)
            .min(0.25 * sph.cfl * (spacing / acceleration).sqrt())
            .min(spacing * spacing / (4.0 * f64::from(*viscosity)))
            .min(
                sph.cfl * (sph.density * spacing.powi(3) / (4.0 * PI * sph.surface_tension)).sqrt(),
            )
            .min(LONGEST_STEP)
    }

    /// [`Simulation::longest_step`], but not much longer than the last.
    fn next_step(&self) -> f64 {
        let allowed = self.longest_step();
        match (self.physics.sph.solver, self.stats.step_secs) {
            (Solver::Wcsph, _) => allowed,
            (Solver::Dfsph, 0.0) => allowed * FIRST_STEP,
            (Solver::Dfsph, last) => allowed.min(last * GROWTH),
        }
    }

    /// Lets the jets flow for a step.
    fn pour(&mut self, secs: f64) {
        let spacing = f64::from(self.physics.spacing);
        for spout in &mut self.jets {
            let velocity = spout.jet.velocity;
            let speed = velocity.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt();
            while spout.way >= spacing && self.fluid.count < self.most && speed > 0.0 {
                spout.way -= spacing;
                let on = velocity.map(|v| v * (spout.way / speed) as f32);
                let left = self.most - self.fluid.count;
                let places: Vec<[f32; 3]> = spout
                    .jet
                    .layer
                    .iter()
                    .take(left)
                    .map(|p| std::array::from_fn(|a| p[a] + on[a]))
                    .collect();
                self.fluid.add(&places, &vec![velocity; places.len()]);
            }
            spout.way += speed * secs;
        }
    }

    /// The pairs at hand, and the particles they are of.
    pub(crate) fn parts(&mut self) -> (Around<'_>, &mut Fluid, &Physics, &mut Stats) {
        let around = Around { lattice: &self.lattice, walls: &self.walls };
        (around, &mut self.fluid, &self.physics, &mut self.stats)
    }

    /// Moves each particle, and keeps all in the tank.
    pub(crate) fn move_on(fluid: &mut Fluid, physics: &Physics, secs: f32) -> Greatest {
        let n = fluid.count;
        let mut greatest = Greatest::default();
        for axis in 0..3 {
            let [low, high] = physics.bounds().map(|corner| corner[axis]);
            let place = fluid.position[axis][..n].par_chunks_mut(CHUNK);
            let speed = fluid.velocity[axis][..n].par_chunks_mut(CHUNK);
            let motion = &fluid.motion[axis];
            let moved = place.zip(speed).enumerate().map(|(chunk, (place, speed))| {
                let mut found = Greatest::default();
                for (i, (x, v)) in place.iter_mut().zip(speed).enumerate() {
                    let next = *x + secs * motion.get(chunk * CHUNK + i).copied().unwrap_or(*v);
                    *x = next.clamp(low, high);
                    if *x != next {
                        found.put_back += 1;
                        found.lost |= !next.is_finite();
                        *v = 0.0;
                    }
                }
                found
            });
            greatest = greatest.with(moved.reduce(Greatest::default, Greatest::with));
        }
        let [u, v, w] = fluid.velocity.each_ref().map(|row| row[..n].par_chunks(CHUNK));
        let square = |((u, v), w): ((&[f32], &[f32]), &[f32])| {
            let squares = u.iter().zip(v).zip(w).map(|((u, v), w)| u * u + v * v + w * w);
            squares.fold(0.0, f32::max)
        };
        greatest.speed = u.zip(v).zip(w).map(square).reduce(|| 0.0, f32::max);
        greatest
    }

    /// Finds neighbours and densities, without masks.
    pub fn find_densities(&mut self) {
        self.fluid.sort(&self.lattice, &self.physics);
        let (around, fluid, physics, _) = self.parts();
        let n = fluid.count;
        let mut sums = std::mem::take(&mut fluid.sums);
        let (pairs, out) = (around.of(fluid, physics), [&mut sums[0][..n]]);
        match physics.kernel.kind {
            Kind::Wendland => pairs.sum(Density(Wendland), [], out),
            Kind::Smooth => pairs.sum(Density(Smooth), [], out),
        }
        fluid.sums = sums;
    }

    /// Finds neighbours, densities and masks, as [`Simulation::frame`] does.
    pub fn find_masks(&mut self) {
        self.fluid.sort(&self.lattice, &self.physics);
        let (around, fluid, physics, _) = self.parts();
        let n = fluid.count;
        let mut sums = std::mem::take(&mut fluid.sums);
        let [a, b, c, d, e, f, g, _] = sums.each_mut().map(|row| &mut row[..n]);
        let (pairs, out) = (around.of(fluid, physics), [a, b, c, d, e, f, g]);
        match physics.kernel.kind {
            Kind::Wendland => pairs.sum(DensityAndMask(Wendland), [], out),
            Kind::Smooth => pairs.sum(DensityAndMask(Smooth), [], out),
        }
        fluid.sums = sums;
    }

    /// The frame as it stands.
    pub fn frame(&mut self) -> Frame {
        self.find_masks();
        let (around, fluid, physics, stats) = self.parts();
        let n = fluid.count;
        let mut sums = std::mem::take(&mut fluid.sums);
        let scale = physics.mass * physics.kernel.value;
        for (at, density) in sums[0][..n].iter().enumerate() {
            fluid.pressure[at] = match physics.sph.solver {
                Solver::Wcsph => physics.pressure_over_square(scale * (1.0 + density)),
                Solver::Dfsph => fluid.pressure_felt(at) / (physics.density * physics.density),
            };
        }
        transmitted(around, fluid, physics, &mut sums[7][..n]);
        let mut frame = Frame {
            time: stats.time,
            step: stats.steps,
            positions: vec![[0.0; 3]; n],
            velocities: vec![[0.0; 3]; n],
            density: vec![0.0; n],
            pressure: vec![0.0; n],
            masks: vec![[0.0; 6]; n],
        };
        for (at, id) in fluid.id.iter().map(|id| *id as usize).enumerate() {
            frame.positions[id] = std::array::from_fn(|a| fluid.position[a][at]);
            frame.velocities[id] = std::array::from_fn(|a| fluid.velocity[a][at]);
            frame.density[id] = scale * (1.0 + sums[0][at]);
            frame.pressure[id] = sums[7][at];
            let side = |first: usize| [sums[first][at], sums[first + 1][at], sums[first + 2][at]];
            frame.masks[id] = from_sums(side(1), side(4));
        }
        fluid.sums = sums;
        frame
    }

    /// Where the particles are now, metres, in the order in which they came.
    pub fn positions(&self, positions: &mut Vec<[f32; 3]>) {
        let fluid = &self.fluid;
        positions.resize(fluid.count, [0.0; 3]);
        let [x, y, z] = &fluid.position;
        for (at, id) in fluid.id.iter().enumerate() {
            positions[*id as usize] = [x[at], y[at], z[at]];
        }
    }

    /// Goes on from particles of a file, which take the place of all there are.
    ///
    /// # Errors
    /// There are none, too many, or one is outside the tank; in words.
    pub fn restart(
        &mut self,
        (time, step): (f64, u64),
        positions: &[[f32; 3]],
        velocities: &[[f32; 3]],
    ) -> Result<(), String> {
        let [low, high] = self.physics.tank;
        let inside = |p: &[f32; 3]| (0..3).all(|a| p[a] >= low[a] && p[a] <= high[a]);
        if let Some(at) = positions.iter().position(|p| !inside(p)) {
            let p = positions[at];
            return Err(format!("particle {at} at {p:?} is outside the tank, {low:?} to {high:?}"));
        }
        if positions.is_empty() || positions.len() > self.most {
            let (most, found) = (self.most, positions.len());
            return Err(format!("expected 1 to {most} particles, found {found}"));
        }
        if velocities.iter().flatten().any(|v| !v.is_finite()) {
            return Err("a velocity is not finite".into());
        }
        self.fluid = Fluid::default();
        self.fluid.add(positions, velocities);
        let square = |v: &[f32; 3]| v.iter().map(|v| v * v).sum::<f32>();
        let speed = velocities.iter().map(square).fold(self.greatest.speed, f32::max);
        self.greatest = Greatest { speed, ..Greatest::default() };
        self.frames = (time * self.physics.sph.fps).round().max(0.0) as u64;
        self.stats = Stats { time, steps: step, particles: positions.len(), ..Stats::default() };
        Ok(())
    }

    /// Kinetic and potential energy, joules; the floor of the tank is 0.
    pub fn energy(&self) -> f64 {
        let (fluid, physics) = (&self.fluid, &self.physics);
        let mass = f64::from(physics.mass);
        total(fluid.count, |i| {
            (0..3)
                .map(|a| {
                    let (x, v) = (f64::from(fluid.position[a][i]), f64::from(fluid.velocity[a][i]));
                    let height = x - f64::from(physics.tank[0][a]);
                    mass * (0.5 * v * v - height * f64::from(physics.gravity[a]))
                })
                .sum()
        })
    }

    /// The sum of momenta, kilogram metres per second.
    pub fn momentum(&self) -> [f64; 3] {
        let fluid = &self.fluid;
        let along = |a: usize| total(fluid.count, |i| f64::from(fluid.velocity[a][i]));
        [0, 1, 2].map(|a| f64::from(self.physics.mass) * along(a))
    }
}

/// What particles are among.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    lattice: &'a Lattice,
    walls: &'a Walls,
}

impl<'a> Around<'a> {
    /// The pairs of the particles, which are in cell order.
    pub fn of(&self, fluid: &'a Fluid, physics: &Physics) -> Neighbors<'a> {
        Neighbors {
            level: physics.level,
            lattice: self.lattice,
            starts: fluid.starts(),
            positions: [&fluid.position[0], &fluid.position[1], &fluid.position[2]],
            support: physics.kernel.support,
            walls: self.walls,
        }
    }
}
