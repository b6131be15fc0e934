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
    pub layers: Layers,
    /// Counts of work.
    pub counts: Counts,
}

/// What the rays through the centres of pixels hit, as [`Center`] has it, one number after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    /// Distance along the ray; +∞ where nothing.
    pub depth: Vec<f32>,
    /// Unit normal towards the viewer; zero where nothing.
    pub normal: Vec<[f32; 3]>,
    /// Index in the file's own order; −1 where nothing.
    pub id: Vec<i64>,
    /// System.
    pub system: Vec<u16>,
}

impl Layers {
    /// What the ray through the centre of a pixel hit.
    pub fn get(&self, pixel: usize) -> Center {
        let (depth, normal) = (self.depth[pixel], self.normal[pixel]);
        Center { depth, normal, id: self.id[pixel], system: self.system[pixel] }
    }

    /// All of them, row by row.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Center> {
        (0..self.depth.len()).map(|pixel| self.get(pixel))
    }

    /// Nothing, in so many pixels.
    pub(crate) fn clear(&mut self, pixels: usize) {
        let Center { depth, normal, id, system } = Center::NOTHING;
        let Self { depth: depths, normal: normals, id: ids, system: systems } = self;
        depths.clear();
        depths.resize(pixels, depth);
        normals.clear();
        normals.resize(pixels, normal);
        ids.clear();
        ids.resize(pixels, id);
        systems.clear();
        systems.resize(pixels, system);
    }

    pub(crate) fn put(&mut self, pixel: usize, center: Center) {
        self.depth[pixel] = center.depth;
        self.normal[pixel] = center.normal;
        self.id[pixel] = center.id;
        self.system[pixel] = center.system;
    }

    /// Memory for so many pixels; what was there stays until something is drawn.
    fn resize(&mut self, pixels: usize) {
        room(&mut self.depth, pixels, 0.0);
        room(&mut self.normal, pixels, [0.0; 3]);
        room(&mut self.id, pixels, 0);
        room(&mut self.system, pixels, 0);
    }
}

/// Makes room for so many values; what was there stays. Memory that comes anew is not written here, but where the
/// values are.
fn room<T: Clone>(values: &mut Vec<T>, count: usize, zero: T) {
    if values.capacity() < count {
        *values = vec![zero; count];
    } else {
        values.resize(count, zero);
    }
}

/// Renders a whole picture, as [`Renderer::picture`] does, in memory of its own.
pub fn render(
    view: View<'_>,
    settings: Settings,
    progress: &(dyn Fn(u64, u64) -> bool + Sync),
) -> Option<Picture> {
    let mut picture = Picture::default();
    Renderer::new().picture(view, settings, &mut picture, progress).then_some(picture)
}

impl Renderer {
    /// Renders a whole picture in place, and in the memory, of another one. `progress` is told of tiles done and
    /// tiles in all, from any thread; where it gives `false` the rest is left out, and there is no picture: this
    /// gives `false`.
    pub fn picture(
        &self,
        view: View<'_>,
        settings: Settings,
        picture: &mut Picture,
        progress: &(dyn Fn(u64, u64) -> bool + Sync),
    ) -> bool {
        let (width, height) = settings.size;
        let pixels = width as usize * height as usize;
        let Picture { color, layers, .. } = picture;
        // Tiles write every pixel.
        room(color, pixels, [0.0; 4]);
        layers.resize(if settings.layers { pixels } else { 0 });
        // Tiles of one row write to one band.
        let band = (width as usize * AREA as usize).max(1);
        let mut bands: Vec<Band<'_>> = color.chunks_mut(band).map(Band::new).collect();
        let depths = layers.depth.chunks_mut(band).zip(layers.normal.chunks_mut(band));
        let ids = layers.id.chunks_mut(band).zip(layers.system.chunks_mut(band));
        for (band, ((depth, normal), (id, system))) in bands.iter_mut().zip(depths.zip(ids)) {
            (band.depth, band.normal, band.id, band.system) = (depth, normal, id, system);
        }
        let bands = Bands {
            width: width as usize,
            bands: bands.into_iter().map(Mutex::new).collect(),
            done: AtomicU64::new(0),
            total: Self::tiles(settings.size) as u64,
            progress,
        };
        let counts = self.render(view, settings, &bands);
        picture.counts = counts.unwrap_or_default();
        counts.is_some()
    }
}

struct Bands<'a> {
    width: usize,
    bands: Vec<Mutex<Band<'a>>>,
    done: AtomicU64,
    total: u64,
    progress: &'a (dyn Fn(u64, u64) -> bool + Sync),
}

/// Some rows of a picture; of layers that are not wanted, nothing.
struct Band<'a> {
    color: &'a mut [[f32; 4]],
    depth: &'a mut [f32],
    normal: &'a mut [[f32; 3]],
    id: &'a mut [i64],
    system: &'a mut [u16],
}

impl<'a> Band<'a> {
    fn new(color: &'a mut [[f32; 4]]) -> Self {
        Self { color, depth: &mut [], normal: &mut [], id: &mut [], system: &mut [] }
    }
}

impl Sink for Bands<'_> {
    fn tile(&self, tile: &Tile<'_>) -> bool {
        let band = &self.bands[(tile.corner.1 / AREA) as usize];
        // A band is only ever copied into: one left by a panic elsewhere is as good.
        let mut band = band.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let place = (self.width, tile.corner.0 as usize, tile.size.0 as usize);
        put(band.color, place, tile.color);
        put(band.depth, place, &tile.layers.depth);
        put(band.normal, place, &tile.layers.normal);
        put(band.id, place, &tile.layers.id);
        put(band.system, place, &tile.layers.system);
        drop(band);
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(done, self.total)
    }
}

/// Copies rows of `w` pixels into rows of a band of a picture, from column `x` on.
fn put<T: Copy>(band: &mut [T], (width, x, w): (usize, usize, usize), from: &[T]) {
    for (row, from) in from.chunks_exact(w).enumerate() {
        let at = row * width + x;
        band[at..at + w].copy_from_slice(from);
    }
}
