//! The grid over the particles: the one structure every way of seeing reads.
//!
//! Gribble et al. 2007, §4.1–4.2: each particle lies in exactly one cell, that of its centre
//! (*sphere-center method*); particles are stored in cell order; blocks of M³ cells (*macrocells*)
//! carry counts and least and greatest values, and so do groups of 4³ blocks. [`Visibility`] says which particles are to be seen;
//! changing it rebuilds nothing.
//! [`Sections`] adds cuts by planes to it (Chaudhari), and a [`Clip`] says which part of a ray they leave.
//!
//! # Invariants
//! - A [`Grid`] owns the positions and radii in cell order; columns stay in file order behind
//!   [`Particle::index`].
//! - The same particles give the same grid, bit for bit, for any number of threads.

mod build;
mod cells;
mod classes;
mod clip;
mod counters;
mod grid;
mod groups;
mod lattice;
mod neighbors;
mod pages;
mod places;
mod scatter;
mod section;
mod sort;
mod streams;
mod values;
mod visibility;

pub use build::{Params, Resolution};
pub use classes::RadiusClasses;
pub use clip::{Clause, Clip, Cut, Face, Fate, Plane, Stretch};
pub use counters::Width;
pub use grid::{Block, Grid, Particle, Radii};
pub use groups::{GROUP_EDGE, Group};
pub use lattice::Lattice;
pub use pages::Pages;
pub use places::{BATCH, Places, Rows, bounds_of_points, of_points};
pub use section::Sections;
pub use values::{BlockRange, BlockValues};
pub use visibility::{Filter, Seen, Visibility};
