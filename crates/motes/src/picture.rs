//! A finished picture and its ways into files.

use std::path::Path;

use motes_frame::{Frame, PngOptions, Rgba8, Transparency, save, write_exr, write_npz, write_png};

use crate::Result;
use crate::stats::Stats;

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// As rendered: linear colour without background, and the layers.
    pub raw: Frame,
    /// As shown: with tone, background and annotations.
    pub shown: Frame,
    /// What it cost.
    pub stats: Stats,
    /// The scene it shows, as TOML.
    pub scene: String,
    /// Whether the background is left out.
    pub transparent: bool,
}

impl Picture {
    /// Saves by the path's extension: `.exr` as rendered with all layers, `.npz` likewise, anything
    /// else as PNG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "exr" => Ok(save(path, |out| write_exr(&self.raw, out))?),
            "npz" => self.save_layers(path),
            _ => self.save_png(path),
        }
    }

    /// What is shown, eight bits a channel, as a [`crate::Film`] takes it.
    pub fn shown_8bit(&self) -> Rgba8 {
        Rgba8::from(&self.shown)
    }

    /// Saves what is shown as PNG, with the scene in it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_png(&self, path: &Path) -> Result<()> {
        let transparency = if self.transparent { Transparency::Keep } else { Transparency::Drop };
        let options = PngOptions { transparency, scene: Some(&self.scene) };
        Ok(save(path, |out| write_png(&self.shown, options, out))?)
    }

    /// Saves colour as rendered and all layers as NPZ.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_layers(&self, path: &Path) -> Result<()> {
        Ok(save(path, |out| write_npz(&self.raw, out))?)
    }
}
