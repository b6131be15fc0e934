//! Tiles put together.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::render::{AREA, Center, Renderer, Settings, Sink, Tile, View};
use crate::traverse::Counts;

/// A picture, row by row from the top.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Linear, premultiplied RGBA.
    pub color: Vec<[f32; 4]>,
    /// What the ray through each pixel's centre hit; empty if layers were not wanted.
    pub center: Vec<Center>,
    /// Counts of work.
    pub counts: Counts,
}

/// Renders a whole picture, as [`Renderer::picture`] does, in memory of its own.
pub fn render(
    view: View<'_>,
    settings: Settings,
    progress: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Option<Picture> {
    Renderer::new().picture(view, settings, progress)
}

impl Renderer {
    /// Renders a whole picture. `progress` is told of tiles done and tiles in all, from any thread; where
    /// it gives `false` the rest is left out and there is no picture.
    pub fn picture(
        &self,
        view: View<'_>,
        settings: Settings,
        progress: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> Option<Picture> {
        let (width, height) = settings.size;
        let pixels = width as usize * height as usize;
        let mut color = vec![[0.0; 4]; pixels];
        let mut center = vec![Center::NOTHING; if settings.layers { pixels } else { 0 }];
        // Tiles of one row write to one band.
        let band = width as usize * AREA as usize;
        let bands = Bands {
            width: width as usize,
            color: color.chunks_mut(band.max(1)).map(Mutex::new).collect(),
            center: center.chunks_mut(band.max(1)).map(Mutex::new).collect(),
            done: AtomicU64::new(0),
            total: Self::tiles(settings.size) as u64,
            progress,
        };
        let counts = self.render(view, settings, &bands)?;
        Some(Picture { color, center, counts })
    }
}

struct Bands<'a> {
    width: usize,
    color: Vec<Mutex<&'a mut [[f32; 4]]>>,
    center: Vec<Mutex<&'a mut [Center]>>,
    done: AtomicU64,
    total: u64,
    progress: &'a (dyn Fn(u64, u64) -> bool + Sync),
}

impl Sink for Bands<'_> {
    fn tile(&self, tile: &Tile<'_>) -> bool {
        let band = (tile.corner.1 / AREA) as usize;
        put(&self.color[band], self.width, (tile, tile.color));
        if !tile.center.is_empty() {
            put(&self.center[band], self.width, (tile, tile.center));
        }
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done, self.total)
    }
}

/// Copies what a tile has into its band.
fn put<T: Copy>(band: &Mutex<&mut [T]>, width: usize, (tile, from): (&Tile<'_>, &[T])) {
    // A band is only ever copied into: one left by a panic elsewhere is as good.
    let mut band = band.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let (x, w) = (tile.corner.0 as usize, tile.size.0 as usize);
    for (row, from) in from.chunks_exact(w).enumerate() {
        let at = row * width + x;
        band[at..at + w].copy_from_slice(from);
    }
}
