//! Particles and where they come from.
//!
//! [`Particles`] is one frame: positions, radii, any number of named [`Column`]s, and the simulation
//! box. [`Series`] gives frames on demand from a *source*: a file, a quoted pattern of files, or a
//! deterministic `demo:` set. Files are read by the formats of [`read`] and written by those of [`mod@write`]. [`select`] finds the particles
//! for which an expression holds.
//!
//! Invariant: nothing here knows a camera, a scene or a picture.

mod age;
mod column;
mod demo;
mod error;
pub mod expression;
mod particles;
pub mod read;
mod series;
mod sim_box;
mod source;
pub mod write;

pub use column::{Column, Values};
pub use error::{Place, ReadError, Result};
pub use expression::{ExpressionError, Selection, properties, select};
pub use particles::{Particles, PositionBuilder, Radius};
pub use series::Series;
pub use sim_box::SimulationBox;
