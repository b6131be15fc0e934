//! Deterministic sets of particles in the unit cube: the same bits for every build, machine and
//! number of threads.
//!
//! | set | particles |
//! |---|---|
//! | `random` | uniform in the cube |
//! | `packed` | a ball of touching spheres on a face-centred cubic (FCC) lattice, jitter 5 % of the radius |
//! | `dam` | 95 % a slab with a wavy surface, FCC, jitter 10 %; 5 % spray above it; in shuffled order |
//! | `layers` | 24 sheets across x (Zirr & Dachsbacher 2015, Fig. 8 left) |
//! | `checker` | a 3-D checkerboard of full and empty blocks (Fig. 8 right) |
//! | `cylinder`, `jp8`, `bullet`, `thunder`, `foam`, `torso` | built like Gribble et al. 2007, Table 1, with a `Value` each: see `simulations.rs` |
//!
//! Random numbers come from a hash of the set's seed and the particle's number, so that particles
//! can be made in any order; sine, logarithm and cube root are series here, as the platforms'
//! differ in the last bit.

mod lattice;
mod maths;
mod sheets;
mod simulations;

use rayon::prelude::*;

use crate::read::{Progress, Reader, Wanted};
use crate::{Column, Particles, Place, Radius, ReadError, Result, Values};
use maths::{cube_root, uniform};

/// Seed of the random set.
const RANDOM_SEED: u64 = 0x7261_6e64;
/// The most particles of a set: their numbers are 32 bits.
const MOST: f64 = 4e9;

/// The kinds of sets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Random,
    Packed,
    Dam,
    Layers,
    Checker,
    Cylinder,
    Jp8,
    Bullet,
    Thunder,
    Foam,
    Torso,
}

const KINDS: [(&str, Kind); 11] = [
    ("random", Kind::Random),
    ("packed", Kind::Packed),
    ("dam", Kind::Dam),
    ("layers", Kind::Layers),
    ("checker", Kind::Checker),
    ("cylinder", Kind::Cylinder),
    ("jp8", Kind::Jp8),
    ("bullet", Kind::Bullet),
    ("thunder", Kind::Thunder),
    ("foam", Kind::Foam),
    ("torso", Kind::Torso),
];

/// A set and its number of particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Demo {
    kind: Kind,
    count: usize,
}

impl Demo {
    /// Understands `KIND:N`, N as `1e7` or `250000`.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(crate) fn parse(text: &str) -> std::result::Result<Self, String> {
        let kinds = KINDS.map(|(name, _)| name).join(", ");
        let Some((name, number)) = text.split_once(':') else {
            return Err(format!(
                "expected demo:KIND:N, such as demo:dam:1e6; KIND is one of {kinds}"
            ));
        };
        let Some((_, kind)) = KINDS.into_iter().find(|(known, _)| *known == name) else {
            return Err(format!("there is no set '{name}'; there are {kinds}"));
        };
        let count: f64 = number.trim().parse().unwrap_or(f64::NAN);
        if !(count >= 0.0 && count.fract() == 0.0) {
            return Err(format!(
                "expected a whole number of particles such as 1e6, found '{number}'"
            ));
        }
        if count > MOST {
            return Err(format!("{number} particles are too many; the most is {MOST:e}"));
        }
        Ok(Self { kind, count: count as usize })
    }

    /// Makes the particles.
    pub(crate) fn particles(self) -> Particles {
        match (self.kind, self.count) {
            (_, 0) => plain((vec![], 0.0)),
            (Kind::Random, n) => plain(random(n)),
            (Kind::Packed, n) => plain(lattice::packed(n)),
            (Kind::Dam, n) => plain(lattice::dam(n)),
            (Kind::Layers, n) => plain(sheets::layers(n)),
            (Kind::Checker, n) => plain(sheets::checker(n)),
            (Kind::Cylinder, n) => valued(simulations::cylinder(n)),
            (Kind::Jp8, n) => valued(simulations::jp8(n)),
            (Kind::Bullet, n) => valued(simulations::bullet(n)),
            (Kind::Thunder, n) => valued(simulations::thunder(n)),
            (Kind::Foam, n) => valued(simulations::foam(n)),
            (Kind::Torso, n) => valued(simulations::torso(n)),
        }
    }
}

/// Positions and a radius.
fn plain((positions, radius): (Vec<[f32; 3]>, f32)) -> Particles {
    Particles { positions, radius: Radius::Uniform(radius), ..Particles::default() }
}

/// Positions, a radius, and the column `Value`.
fn valued(made: simulations::Simulation) -> Particles {
    let columns = vec![Column::new("Value", 1, Values::F32(made.values))];
    Particles { columns, ..plain((made.positions, made.radius)) }
}

/// Uniform in the unit cube, radius 0.3 N^(−1/3).
fn random(count: usize) -> (Vec<[f32; 3]>, f32) {
    let position =
        |i| std::array::from_fn(|axis| uniform(RANDOM_SEED, 3 * i as u64 + axis as u64) as f32);
    let positions = (0..count).into_par_iter().map(position).collect();
    (positions, (0.3 / cube_root(count as f64)) as f32)
}

/// A set as a series of one frame.
#[derive(Debug)]
pub(crate) struct DemoReader {
    demo: Demo,
}

impl DemoReader {
    pub(crate) fn new(demo: Demo) -> Self {
        Self { demo }
    }
}

impl Reader for DemoReader {
    fn count(&mut self, _progress: Progress<'_>) -> Result<usize> {
        Ok(1)
    }

    fn read(&mut self, frame: usize, _: &Wanted, _: Progress<'_>) -> Result<Particles> {
        let error = |message: String| Err(ReadError::new("demo", Place::Whole, message));
        if frame > 0 {
            return error(format!("there is no frame {frame}; a demo set has only frame 0"));
        }
        // The largest set holds its positions twice and their order once while it is made.
        let bytes = self.demo.count.saturating_mul(32);
        if Vec::<u8>::new().try_reserve_exact(bytes).is_err() {
            return error(format!("{} particles do not fit into memory", self.demo.count));
        }
        Ok(self.demo.particles())
    }
}

#[cfg(test)]
mod tests;
