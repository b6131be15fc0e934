//! A finished picture and its ways into files.

use std::path::Path;

use motes_frame::{Frame, PngOptions, Rgba8, Transparency, save, write_exr, write_npz, write_png};

use motes_scene::{CameraView, Section};

use crate::stats::Stats;
use crate::{Error, Result};

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
    /// From where it is seen.
    pub view: CameraView,
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

    /// The section that a line on the picture means, drawn from one point to another (column, row, in
    /// pixels): through what is seen at the first, keeping what lies towards the second.
    ///
    /// # Errors
    /// The picture has no layers, the points lie outside it or at the same place, or nothing is seen between.
    pub fn section_of_drag(&self, from: [f64; 2], to: [f64; 2]) -> Result<Section> {
        let depth = self.raw.depth();
        let depth = depth.ok_or_else(|| Error::Usage("drag: the picture has no depth".into()))?;
        let seen = |x: u32, y: u32| {
            let at = y as usize * self.raw.width() + x as usize;
            depth.get(at).map(|distance| f64::from(*distance))
        };
        Ok(self.view.section_of_drag((from.into(), to.into()), &seen)?)
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
