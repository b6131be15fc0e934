//! Ray-traced spheres.
//!
//! Gribble et al. 2007, *A Coherent Grid Traversal Approach to Visualizing Particle-based Simulation
//! Data*: packets of rays and the frusta around them through a two-level grid of sphere centres.
//!
//! - [`Packet`]: rays and their nearest hits
//! - [`trace`]: a packet through the grids of the systems
//! - [`Frustum`], [`intersect()`]: its parts, for walks through other structures (the benches compare some)
//! - [`render()`]: a whole picture, tile by tile, on all cores
//! - [`mod@reference`]: brute force in f64, the definition; for tests
//!
//! Invariants: no file, clock or environment is read here, and no result depends on the number of
//! threads, the size of packets or of tiles.

mod aims;
mod beam;
mod bounce;
mod clip;
mod frames;
mod frustum;
mod hits;
mod intersect;
mod lanes;
mod lens;
mod near;
mod occlude;
mod overview;
mod packet;
mod peel;
mod picture;
mod project;
pub mod reference;
mod refine;
mod render;
#[cfg(test)]
mod secondary_tests;
mod shade;
mod shaft;
mod through;
mod tile;
mod traverse;

pub use frustum::{Bounds, Frustum};
pub use intersect::{Sphere, farthest, intersect};
pub use packet::{LANES, MOST_RAYS, Packet, Surface};
pub use picture::{Layers, Picture, render};
pub use refine::Adaptive;
pub use render::{Cap, Center, Finer, Primary, Renderer, Settings, Sink, Tile, View};
pub use shade::Paint;
pub use traverse::{Counts, Met, Spheres, trace};
