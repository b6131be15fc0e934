//! The liquid's surface from unsorted particles, without a mesh.
//!
//! Zirr & Dachsbacher 2015, *Memory-Efficient On-The-Fly Voxelization of Particle Data*: what each
//! pixel's ray passes of the liquid, as a short list of [`Spans`].
//!
//! - [`Boundary`]: what has to be drawn of a liquid, whatever the view
//! - [`voxelize()`]: the [`Spans`] of all pixels of a [`View`]
//! - [`mod@reference`]: brute force in f64, the definition; for tests
//!
//! Invariants: no file, clock or environment is read here, and no result depends on the number of
//! threads or the size of tiles.

mod bits;
mod boundary;
mod compress;
mod cull;
mod intervals;
mod items;
mod layers;
mod params;
pub mod reference;
mod source;
mod spans;
mod splat;
mod tile;
mod view;
mod voxelize;

pub use boundary::{Boundary, BoundaryCounts};
pub use params::{Bits, Cull, Input, Marks, Params, Particles, Representation};
pub use spans::{Extended, Spans};
pub use view::View;
pub use voxelize::{Stats, voxelize};

#[cfg(test)]
mod truth_tests;
