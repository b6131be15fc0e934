//! Liquids by smoothed particle hydrodynamics, for the particles and the grid that pictures are made of.
//!
//! [`Simulation`] goes from frame to frame of a [`Scenario`] or of any [`Setup`], with one of two
//! solvers: `dfsph` (Bender & Koschier 2015) or `wcsph` (weakly compressible, as in Yasuda, Harada &
//! Kawaguchi 2009). [`Frame`] has what pictures need, [`Mask`]s among it; [`masks`] makes them for
//! particles from elsewhere.
//!
//! ```
//! let setup = motes_sph::Scenario::named("dam-break")?.setup(&[("particles", "500")])?;
//! let mut simulation = motes_sph::Simulation::new(setup, &motes_scene::Sph::default());
//! simulation.advance(&mut |_| true)?;
//! assert_eq!(simulation.frame().positions.len(), 500);
//! # Ok::<(), String>(())
//! ```
//!
//! # Invariants
//! - The same setup and settings give the same bits for any number of threads.
//! - SI units throughout.

mod cells;
#[allow(clippy::needless_range_loop)]
// iterators and closures leave the instruction set of a kernel
mod desk;
mod dfsph;
mod fluid;
mod kernel;
mod long;
mod mask;
#[allow(clippy::needless_range_loop)]
// iterators and closures leave the instruction set of a kernel
mod pairs;
mod passes;
#[cfg(test)]
mod random;
#[cfg(test)]
mod reference;
mod scenario;
mod simulation;
#[cfg(test)]
mod truths;
mod virial;
mod walls;
mod wcsph;

pub use long::Extremes;
pub use mask::{Mask, masks};
pub use scenario::{Jet, Parameter, SCENARIOS, Scenario, Setup};
pub use simulation::{Frame, Simulation, Stats};
pub use walls::Solid;
