//! The scene: every parameter of Motes, and the pure functions that give it meaning.
//!
//! [`Scene`] is the scene as typed, in TOML or by [`Scene::set`]; each parameter's name, default, unit
//! and line of meaning stand once, in `scene.rs`. [`Scene::resolve`] refuses nonsense and makes what is
//! relative absolute: [`Resolved`], with the camera as a [`CameraView`] that gives rays.
//!
//! ```
//! use motes_scene::{Bounds, Scene};
//!
//! let mut scene = Scene::from_toml("[camera]\nfov = 40.0")?;
//! scene.set("image.width", "640")?;
//! let visible = Bounds::new([0.0; 3].into(), [1.0; 3].into());
//! let rays = scene.resolve(Some(visible))?.view.rays(visible.center());
//! let (origin, direction) = rays.ray(320.5, 240.5);
//! assert!(origin.dot(direction) < 0.0); // towards what is visible
//! # Ok::<(), motes_scene::SceneError>(())
//! ```
//!
//! Invariants: plain data and pure functions; no file, clock or environment is read, and no other crate
//! of Motes is known here.

mod bounds;
mod camera;
mod color;
mod color_points;
mod colormap;
mod cue;
pub mod density;
mod drag;
mod elements;
mod environment;
mod error;
mod light;
mod look;
mod motion;
pub mod optics;
mod residues;
mod resolve;
mod scene;
mod section;
mod set;
mod settings;
pub mod surface;
mod text;

pub use bounds::Bounds;
pub use camera::{CameraView, Framing, Lens, Projected, Rays};
pub use color::{Color, linear_from_srgb, srgb_from_linear};
pub use colormap::ColorMap;
pub use cue::Cue;
pub use elements::Element;
pub use environment::{Beyond, Environment, Equirectangular, Floor, Sight, Sky};
pub use error::{Result, SceneError, nearest};
pub use light::{KeyLight, Lamp, Lights, Toward};
pub use look::{exp, look_sixteen};
pub use motion::Moment;
pub use residues::residue_color;
pub use resolve::{Background, Resolved};
pub use scene::{
    Axis, Camera, ColorBy, Coloring, Component, Film, Filter, Image, Keyframe, Light, Overlay,
    Palette, Preset, Primary, Projection, RangeOver, RelativeTo, Renderer, Scene, Show, Solver,
    Sph, Spheres, System, Tone,
};
pub use section::{CapColor, Cut, Names, Section};
pub use settings::{Field, Setting, Shape};
