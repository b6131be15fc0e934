//! The liquid's surface from unsorted particles, without a mesh.
//!
//! Zirr & Dachsbacher 2015, *Memory-Efficient On-The-Fly Voxelization of Particle Data*: what each
//! pixel's ray passes of the liquid, as a short list of [`Spans`].
//!
//! - [`mod@reference`]: brute force in f64, the definition; for tests
//!
//! Invariants: no file, clock or environment is read here, and no result depends on the number of
//! threads or the size of tiles.

mod blocks;
pub mod connect;
pub mod filter;
pub mod flow;
pub mod march;
pub mod normals;
mod occlusion;
mod params;
pub mod reference;
mod refract;
mod shade;
mod shadow;
mod spans;
mod surfaces;
mod view;

pub use blocks::Blocks;
pub use occlusion::Occlusion;
pub use params::{Bits, Cull, Input, Marks, Params, Particles, Representation};
pub use shade::{Around, Mode, Optics, Paint, shade};
pub use shadow::Shadow;
pub use spans::{Extended, Spans};
pub use surfaces::{Smoothing, Surfaces};
pub use view::View;
