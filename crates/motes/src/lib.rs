//! The front door of Motes: a particle file in, a ray-traced picture out.
//!
//! ```no_run
//! let mut scene = motes::Scene::default();
//! scene.set_sources(&["dump.lammpstrj".into()]);
//! let mut session = motes::Session::open(scene, None)?;
//! let picture = session.render(0, motes::Layers::No, &motes::Quiet)?;
//! picture.save_png("out.png".as_ref())?;
//! # Ok::<(), motes::Error>(())
//! ```
//!
//! The command line (`main.rs`) is a user of this library like any other.

mod ahead;
mod annotate;
pub mod bench;
mod caps;
mod cues;
mod cut;
mod density;
mod drawing;
mod entries;
mod environment;
mod error;
mod grids;
mod info;
mod liquid;
mod memo;
mod nearest;
mod opacity;
mod open;
mod paint;
mod picture;
mod radius;
mod reading;
mod scenery;
mod session;
mod shot;
mod simulate;
mod stages;
mod stats;
mod system;
mod view;

pub use error::{Error, Result};
pub use info::{BoundsInfo, BoxInfo, Info, PropertyInfo, Range, info};
pub use motes_film::{Film, FilmError, Settings as FilmSettings};
pub use motes_frame::{Frame, Rgba8};
pub use motes_scene::{Moment, Scene, SceneError, Section};
pub use motes_sph::Stats as SimulationStats;
pub use open::{BUILT_IN, built_in_scene, is_picture, open, open_with, read_scene};
pub use picture::Picture;
pub use session::{Layers, Quiet, Session, Watch};
pub use shot::Shot;
pub use simulate::{Simulated, scenarios};
pub use stats::{Stats, peak_memory_bytes};
pub use view::{Gallery, set_threads};
