//! A density field of particles, and rays cast through it.
//!
//! Yasuda, Harada & Kawaguchi 2009, *Fast Rendering of Particle-Based Fluid by Utilizing Simulation Data*.
//!
//! - [`Field`]: the density of particles at the nodes of a [`Lattice`] (§4.2)
//! - [`Space`]: what rays can skip in it, and the particles that are drops (§5)
//! - [`shade()`]: pictures, by rays with several refractions (§4.3); [`Shadow`]; [`layers()`]
//! - [`mod@reference`] is the definition, by brute force in f64; for tests.
//!
//! Invariants: no file, clock or environment is read here, and no result depends on the number of threads.

#![allow(clippy::needless_range_loop)] // closures and iterators leave the instruction set of a kernel

mod bins;
mod bits;
mod crossing;
mod cut;
mod drops;
mod field;
mod fine;
mod kernel;
mod lanes;
mod lattice;
mod layers;
mod march;
mod normals;
mod params;
mod paths;
mod rays;
pub mod reference;
mod rough;
mod shade;
mod shadow;
mod space;
mod surroundings;
mod view;

pub use field::{Counts, Field};
pub use lattice::Lattice;
pub use layers::{Seen, layers};
pub use params::{Mask, Params, Particles};
pub use shade::{Around, Liquid, Optics, Paint, shade};
pub use shadow::Shadow;
pub use space::Space;
pub use view::View;
