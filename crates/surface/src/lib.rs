//! The liquid's surface from unsorted particles, without a mesh.
//!
//! Zirr & Dachsbacher 2015, *Memory-Efficient On-The-Fly Voxelization of Particle Data*: what each
//! pixel's ray passes of the liquid, as a short list of [`Spans`].
//!
//! - [`mod@reference`]: brute force in f64, the definition; for tests
//!
//! Invariants: no file, clock or environment is read here, and no result depends on the number of
//! threads or the size of tiles.

mod params;
pub mod reference;
mod spans;
mod view;

pub use params::{Bits, Cull, Input, Marks, Params, Particles, Representation};
pub use spans::{Extended, Spans};
pub use view::View;
