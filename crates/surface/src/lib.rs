//! The liquid's surface from unsorted particles, without a mesh.
//!
//! Zirr & Dachsbacher 2015, *Memory-Efficient On-The-Fly Voxelization of Particle Data*. The paper's stages:
//!
//! - [`Boundary`]: what has to be drawn of a liquid, whatever the view
//! - [`splat()`] and [`compress()`], together [`voxelize()`]: what each pixel's ray passes of it, a short list of
//!   [`Spans`]
//! - [`mod@connect`]: which of their ends are one surface
//! - [`mod@filter`], [`mod@recursion`], [`mod@flow`]: surfaces made smooth; [`mod@normals`]
//! - [`Surfaces::cut`]: what sections leave of them
//! - [`shade()`]: pictures, with rays that [`mod@march`] through columns, in [`mod@packet`]s
//!
//! [`mod@reference`] is the definition of spans, by brute force in f64; for tests.
//!
//! Invariants: no file, clock or environment is read here, and no result depends on the number of
//! threads or the size of tiles.

mod bits;
mod blocks;
mod boundary;
mod compress;
pub mod connect;
mod cull;
mod cut;
pub mod filter;
mod fit;
pub mod flow;
mod intervals;
mod items;
mod layers;
pub mod march;
mod media;
pub mod normals;
mod occlusion;
pub mod packet;
mod params;
pub mod recursion;
pub mod reference;
mod refract;
mod shade;
mod shadow;
mod source;
mod spans;
mod splat;
mod surfaces;
mod tile;
mod translucent;
mod view;
mod voxelize;

pub use blocks::Blocks;
pub use boundary::{Boundary, BoundaryCounts};
pub use cut::{NO_CAP, Nearest};
pub use media::{MOST_MEDIA, Medium};
pub use occlusion::Occlusion;
pub use params::{Bits, Cull, Input, Marks, Params, Particles, Representation, Spray};
pub use shade::{Around, Mode, Optics, Paint, Work, shade, shade_finer};
pub use shadow::Shadow;
pub use spans::{Extended, Spans};
pub use surfaces::{Filter, Smoothing, Surfaces};
pub use view::View;
pub use voxelize::{Splatted, Stats, compress, splat, voxelize};

#[cfg(test)]
mod truth_tests;
