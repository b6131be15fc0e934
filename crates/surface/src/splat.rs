//! Splatting a tile (Zirr & Dachsbacher 2015, §4.1): its inner cells, then its spheres, near to far, each
//! onto the blocks of rays that it may touch.
//!
//! The order decides only how much work there is: what comes near to far mostly extends a column's open
//! span.

use fearless_simd::{Simd, prelude::*};
use fearless_simd_macros::simd;
use motes_scene::Projection;

use crate::View;
use crate::boundary::Cubes;
use crate::items::{Binned, Binning, Item, Tiles};
use crate::tile::{Stretch, TileRays};

/// Steps of depth that items are sorted by.
const STEPS: usize = 512;

/// Columns of a tile, onto which stretches are put: first those of inner cells, then those of spheres,
/// each in any order.
pub(crate) trait Columns {
    /// Begins a tile.
    fn begin<S: Simd>(&mut self, simd: S, rays: &TileRays);
    /// Adds a stretch of each ray of a block that is in an inner cell.
    fn put_core<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>);
    /// No more of them come.
    fn settle(&mut self);
    /// From now on, what comes to a block lies mostly behind depth `front`.
    fn reach<S: Simd>(&mut self, simd: S, block: usize, front: f32);
    /// Adds a stretch of each ray of a block that is in a sphere.
    fn put<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>, index: u32);
    /// Nothing more comes.
    fn end<S: Simd>(&mut self, simd: S);
}

/// What a tile is drawn with.
#[derive(Clone, Copy)]
pub(crate) struct Painter<'a> {
    pub view: &'a View,
    pub tiles: &'a Tiles,
    pub cubes: &'a Cubes,
    pub binning: &'a Binning,
}

/// Memory for one tile, for one after the other.
#[derive(Debug, Default)]
pub(crate) struct Easel {
    pub rays: TileRays,
    spheres: Sorted,
}

/// Items of a tile by their least depth.
#[derive(Debug, Default)]
struct Sorted {
    items: Vec<Item>,
    /// Where the next item of each step goes.
    next: Vec<u32>,
}

/// Depths as steps.
#[derive(Clone, Copy)]
struct Steps {
    low: f32,
    per_depth: f32,
}

impl Steps {
    #[inline(always)]
    fn of(self, depth: f32) -> usize {
        (((depth - self.low) * self.per_depth) as usize).min(STEPS - 1)
    }
}

impl Sorted {
    fn sort(&mut self, (parts, tile): (&[Binned], usize), steps: Steps) {
        self.next.clear();
        self.next.resize(STEPS, 0);
        let mut count = 0;
        for part in parts {
            for item in part.of(tile) {
                self.next[steps.of(item.front())] += 1;
            }
            count += part.of(tile).len();
        }
        let mut sum = 0;
        for next in &mut self.next {
            sum += std::mem::replace(next, sum);
        }
        self.items.resize(count, Item::default());
        for part in parts {
            for item in part.of(tile) {
                let next = &mut self.next[steps.of(item.front())];
                self.items[*next as usize] = *item;
                *next += 1;
            }
        }
    }
}

impl Painter<'_> {
    /// Whether a tile has anything on it.
    pub fn any(&self, tile: usize) -> bool {
        let Binning { spheres, cubes } = self.binning;
        spheres.iter().chain(cubes).any(|part| !part.of(tile).is_empty())
    }

    /// Sorts the spheres of a tile.
    fn sort(&self, tile: usize, easel: &mut Easel) {
        let spheres = &self.binning.spheres[..];
        let (mut low, mut high) = (self.view.far, self.view.near);
        for item in spheres.iter().flat_map(|part| part.of(tile)) {
            let front = item.front();
            (low, high) = (low.min(front), high.max(front));
        }
        let low = low.max(self.view.near);
        let steps = Steps { low, per_depth: STEPS as f32 / (high - low).max(f32::MIN_POSITIVE) };
        easel.spheres.sort((spheres, tile), steps);
    }

    /// Draws a tile onto `columns`.
    #[inline(always)]
    pub fn draw<S: Simd, C: Columns>(
        &self,
        simd: S,
        tile: usize,
        easel: &mut Easel,
        columns: &mut C,
    ) {
        self.sort(tile, easel);
        easel.rays.turn(self.view, self.tiles, tile);
        easel.rays.square(simd, self.view.rays.projection);
        columns.begin(simd, &easel.rays);
        match self.view.rays.projection {
            Projection::Perspective => self.items::<S, C, true>(simd, tile, easel, columns),
            Projection::Orthographic => self.items::<S, C, false>(simd, tile, easel, columns),
        }
        columns.end(simd);
    }

    #[inline(always)]
    fn items<S: Simd, C: Columns, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        tile: usize,
        easel: &mut Easel,
        columns: &mut C,
    ) {
        if self.binning.cubes.iter().any(|part| !part.of(tile).is_empty()) {
            easel.rays.invert(simd, self.view);
            for item in self.binning.cubes.iter().flat_map(|part| part.of(tile)) {
                self.cube::<S, C, PERSPECTIVE>(simd, &easel.rays, item, columns);
            }
            columns.settle();
        }
        for item in &easel.spheres.items {
            sphere::<S, C, PERSPECTIVE>(simd, &easel.rays, item, columns);
        }
    }

    #[inline(always)]
    fn cube<S: Simd, C: Columns, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        rays: &TileRays,
        item: &Item,
        columns: &mut C,
    ) {
        let faces = TileRays::faces(self.view, self.cubes, item);
        let [x0, x1, y0, y1] = item.blocks.map(usize::from);
        for y in y0..=y1 {
            for x in x0..=x1 {
                let with = (&faces, &self.view.rays);
                let new = rays.meet_cube::<S, PERSPECTIVE>(simd, (x, y), with);
                if new.hit.any_true() {
                    columns.put_core(simd, y * rays.side + x, &new);
                }
            }
        }
    }
}

#[inline(always)]
fn sphere<S: Simd, C: Columns, const PERSPECTIVE: bool>(
    simd: S,
    rays: &TileRays,
    item: &Item,
    columns: &mut C,
) {
    let ball = TileRays::ball(simd, item);
    let front = item.front();
    let [x0, x1, y0, y1] = item.blocks.map(usize::from);
    // One loop: where two end is harder to foresee.
    let (mut x, mut y) = (x0, y0);
    for _ in 0..(x1 + 1 - x0) * (y1 + 1 - y0) {
        let block = y * rays.side + x;
        columns.reach(simd, block, front);
        let new = rays.meet_ball::<S, PERSPECTIVE>(simd, (x, y), &ball);
        columns.put(simd, block, &new, item.index);
        let last = x == x1;
        x = if last { x0 } else { x + 1 };
        y += usize::from(last);
    }
}

/// Draws a tile onto `columns`, with the instructions of `simd`.
#[simd]
pub(crate) fn draw<S: Simd, C: Columns>(
    simd: S,
    painter: &Painter<'_>,
    tile: usize,
    easel: &mut Easel,
    columns: &mut C,
) {
    painter.draw(simd, tile, easel, columns);
}
