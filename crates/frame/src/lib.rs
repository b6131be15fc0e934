//! From the finished layers of a picture to bytes.
//!
//! A renderer fills a [`Frame`]: linear, premultiplied colour and the layers beside it (depth, normal,
//! particle …). Then, in this order and each on its own:
//!
//! 1. [`Tone`] sets exposure and curve of what was rendered;
//! 2. [`Background`] puts something behind it;
//! 3. [`Annotations`] draw legend, scale bar, axes and lines over it;
//! 4. [`Rgba8`], [`write_png`], [`write_exr`] and [`write_npz`] make bytes of it, [`save`] a file.
//!
//! Invariant: nothing here knows a camera, a scene or a particle; annotations come as pixels and labels.

mod annotate;
mod background;
mod compare;
mod cues;
mod error;
mod exr;
mod file;
mod frame;
mod npz;
mod panorama;
mod png;
mod srgb;
mod ticks;
mod tone;

pub use annotate::{
    Annotations, Axes, Category, Ink, Legend, LegendKeys, Line, LineEnd, Lines, ScaleBar, Side,
};
pub use background::Background;
pub use compare::{Difference, compare};
pub use cues::{Cues, Eye, Fade, Stroke};
pub use error::{FrameError, Result};
pub use exr::write_exr;
pub use file::{Unfinished, save};
pub use frame::{Frame, Layer, Values};
pub use npz::write_npz;
pub use panorama::{Panorama, read_panorama};
pub use png::{PngOptions, Transparency, read_png, scene_in_png, write_png};
pub use srgb::{Rgba8, linear_from_srgb, rgb8, srgb_from_linear};
pub use ticks::{Ticks, ticks};
pub use tone::{Curve, Tone};
