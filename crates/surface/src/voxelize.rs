//! From the boundary of a liquid to the spans of a picture, tile by tile on all cores: [`splat`] makes the
//! spans of each tile while its columns are in cache, [`compress`] puts those of all tiles together.

use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

use crate::bits::BitColumns;
use crate::boundary::Boundary;
use crate::compress::{TileSpans, assemble};
use crate::intervals::Intervals;
use crate::items::{Binning, Tiles};
use crate::layers::Layers;
use crate::splat::{Columns, Easel, Painter, draw};
use crate::tile::TileRays;
use crate::{Marks, Params, Representation, Spans, View};

/// Most bytes of a tile's bits, for each thread.
const BITS_BYTES: usize = 1 << 24;

/// What was done for a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Tiles of the picture.
    pub tiles: usize,
    /// Spheres and cubes, once for each tile they touch.
    pub items: usize,
    /// Bytes of the items.
    pub item_bytes: usize,
    /// Bytes of the spans before they are put together.
    pub tile_bytes: usize,
    /// Bytes of the spans.
    pub span_bytes: usize,
    /// Layers of the bit grid; 0 without one.
    pub layers: usize,
    /// Thickness of a layer, by its depth in perspective, in world units orthographic.
    pub layer_step: f32,
    /// Whether the layers are thicker than the angle asked for, which needed too many.
    pub coarsened: bool,
}

/// The spans of all tiles of a picture, each by itself: what [`compress`] puts together.
#[derive(Debug)]
pub struct Splatted {
    view: View,
    tiles: Tiles,
    parts: Vec<TileSpans>,
    stats: Stats,
}

/// The spans of all pixels of `view` of a liquid: [`splat`], then [`compress`].
pub fn voxelize(boundary: &Boundary, view: &View, params: &Params, level: Level) -> (Spans, Stats) {
    compress(&splat(boundary, view, params, level))
}

/// Puts the spans of all tiles together.
pub fn compress(splatted: &Splatted) -> (Spans, Stats) {
    let Splatted { view, tiles, parts, stats } = splatted;
    let spans = assemble(view, tiles, parts);
    let stats = Stats { span_bytes: spans.bytes(), ..*stats };
    (spans, stats)
}

/// Splats a liquid into the tiles of `view`: the spans of all pixels, tile by tile.
///
/// `params` is what the boundary was extracted with, but for `gap`, `spans`, `representation` and `tile`,
/// which may differ. Bits know no particles: with them none are told.
pub fn splat(boundary: &Boundary, view: &View, params: &Params, level: Level) -> Splatted {
    let layers = match &params.representation {
        Representation::Intervals => None,
        Representation::Bits(bits) => Some((Layers::new(view, bits), bits.marks)),
    };
    let most = layers.as_ref().map_or(u32::MAX, |(l, _)| BitColumns::largest_tile(l, BITS_BYTES));
    let tiles = Tiles::new(view.size, params.tile.min(most));
    let binning = Binning::new(boundary, view, &tiles, level);
    let painter = Painter { view, tiles: &tiles, cubes: &boundary.cubes, binning: &binning };
    let mut stats = Stats {
        tiles: tiles.count(),
        items: binning.len(),
        item_bytes: binning.bytes(),
        ..Stats::default()
    };
    let parts = match (&layers, params.ids) {
        (None, false) => exact::<false>(&painter, params, level),
        (None, true) => exact::<true>(&painter, params, level),
        (Some(layers), _) => layered(&painter, params, (&layers.0, layers.1), level),
    };
    if let Some((layers, _)) = &layers {
        stats.layers = layers.len();
        stats.layer_step = layers.step as f32;
        stats.coarsened = layers.coarsened;
    }
    drop(binning);
    stats.tile_bytes = parts.iter().map(TileSpans::bytes).sum();
    Splatted { view: *view, tiles, parts, stats }
}

/// Makes all tiles with intervals.
fn exact<const IDS: bool>(painter: &Painter<'_>, params: &Params, level: Level) -> Vec<TileSpans> {
    let columns = || Intervals::<IDS>::new(params.gap.max(0.0));
    each_tile(painter, (params, level), columns, Intervals::finish)
}

/// Makes all tiles with bits.
fn layered(
    painter: &Painter<'_>,
    params: &Params,
    (layers, marks): (&Layers, Marks),
    level: Level,
) -> Vec<TileSpans> {
    let columns = || BitColumns::new(layers, marks, params.gap.max(0.0));
    each_tile(painter, (params, level), columns, BitColumns::finish)
}

/// Makes all tiles, with columns that `finish` ends: of a tile's rays, the picture's width, and the most spans
/// of a pixel.
fn each_tile<C: Columns>(
    painter: &Painter<'_>,
    (params, level): (&Params, Level),
    columns: impl Fn() -> C + Sync + Send,
    finish: impl Fn(&mut C, &TileRays, u32, usize) -> TileSpans + Sync + Send,
) -> Vec<TileSpans> {
    let most = params.spans.clamp(1, u16::MAX.into()) as usize;
    (0..painter.tiles.count())
        .into_par_iter()
        .with_max_len(1)
        .map_init(
            || (Easel::default(), columns()),
            |(easel, columns), tile| {
                if !painter.any(tile) {
                    return empty(painter, tile);
                }
                dispatch!(level, simd => draw(simd, painter, tile, easel, columns));
                finish(columns, &easel.rays, painter.view.size.0, most)
            },
        )
        .collect()
}

/// A tile without spans.
fn empty(painter: &Painter<'_>, tile: usize) -> TileSpans {
    let mut rays = TileRays::default();
    rays.turn(painter.view, painter.tiles, tile);
    let pixels = rays.pixels.0 * rays.pixels.1;
    TileSpans { counts: vec![0; pixels as usize], ..TileSpans::default() }
}
