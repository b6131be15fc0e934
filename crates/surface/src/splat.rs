//! Splatting a tile (Zirr & Dachsbacher 2015, §4.1): its items near to far, each onto the blocks of rays
//! that it may touch.
//!
//! The order decides only how much work there is: what comes near to far mostly extends a column's open
//! span, and what lies within the open spans of all columns of a block changes nothing there.

use fearless_simd::{Simd, prelude::*};
use fearless_simd_macros::simd;
use motes_scene::Projection;

use crate::View;
use crate::boundary::Cubes;
use crate::items::{Binned, Binning, Item, Tiles};
use crate::tile::{Stretch, TileRays};

/// Steps of depth that items are sorted by.
const STEPS: usize = 512;

/// Columns of a tile, onto which stretches are put in any order.
pub(crate) trait Columns {
    /// Begins a tile.
    fn begin<S: Simd>(&mut self, simd: S, rays: &TileRays);
    /// Whether what lies at depths `front` to `back` would change nothing in a block.
    fn holds<S: Simd>(&self, simd: S, block: usize, front: f32, back: f32) -> bool;
    /// Adds a stretch of each ray of a block that is hit.
    fn put<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>, index: u32);
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
    cubes: Sorted,
}

/// Items of a tile by their least depth.
#[derive(Debug, Default)]
struct Sorted {
    items: Vec<Item>,
    /// First item of each step, and the end of the last.
    starts: Vec<u32>,
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
    fn sort(
        &mut self,
        (parts, tile): (&[Binned], usize),
        steps: Steps,
        front: impl Fn(&Item) -> f32,
    ) {
        self.starts.clear();
        self.starts.resize(STEPS + 1, 0);
        let mut count = 0;
        for part in parts {
            for item in part.of(tile) {
                self.starts[steps.of(front(item))] += 1;
            }
            count += part.of(tile).len();
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += std::mem::replace(start, sum);
        }
        self.items.resize(count, Item::default());
        for part in parts {
            for item in part.of(tile) {
                let next = &mut self.starts[steps.of(front(item))];
                self.items[*next as usize] = *item;
                *next += 1;
            }
        }
        // Each start has become the next one's.
        self.starts.copy_within(..STEPS, 1);
        self.starts[0] = 0;
    }

    fn step(&self, step: usize) -> &[Item] {
        &self.items[self.starts[step] as usize..self.starts[step + 1] as usize]
    }
}

impl Painter<'_> {
    /// Whether a tile has anything on it.
    pub fn any(&self, tile: usize) -> bool {
        let Binning { spheres, cubes } = self.binning;
        spheres.iter().chain(cubes).any(|part| !part.of(tile).is_empty())
    }

    /// Sorts the items of a tile.
    fn sort(&self, tile: usize, easel: &mut Easel) {
        let sphere_front = |item: &Item| item.at[2] - item.size;
        let rays = &self.view.rays;
        let half = 0.5 * rays.forward.abs().element_sum();
        let cube_front = |item: &Item| {
            let middle = glam::Vec3::from_array(item.at) + 0.5 * item.size;
            let middle = middle * self.cubes.edge + self.cubes.low - rays.origin;
            middle.dot(rays.forward) - half * item.size * self.cubes.edge
        };
        let (mut low, mut high) = (self.view.far, self.view.near);
        let mut take = |front: f32| (low, high) = (low.min(front), high.max(front));
        let Binning { spheres, cubes } = self.binning;
        spheres.iter().flat_map(|p| p.of(tile)).for_each(|item| take(sphere_front(item)));
        cubes.iter().flat_map(|p| p.of(tile)).for_each(|item| take(cube_front(item)));
        let low = low.max(self.view.near);
        let steps = Steps { low, per_depth: STEPS as f32 / (high - low).max(f32::MIN_POSITIVE) };
        easel.spheres.sort((spheres, tile), steps, sphere_front);
        easel.cubes.sort((cubes, tile), steps, cube_front);
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
        if !easel.cubes.items.is_empty() {
            easel.rays.invert(simd, self.view);
        }
        columns.begin(simd, &easel.rays);
        match self.view.rays.projection {
            Projection::Perspective => self.steps::<S, C, true>(simd, easel, columns),
            Projection::Orthographic => self.steps::<S, C, false>(simd, easel, columns),
        }
    }

    #[inline(always)]
    fn steps<S: Simd, C: Columns, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        easel: &Easel,
        columns: &mut C,
    ) {
        for step in 0..STEPS {
            for item in easel.cubes.step(step) {
                self.cube::<S, C, PERSPECTIVE>(simd, &easel.rays, item, columns);
            }
            for item in easel.spheres.step(step) {
                sphere::<S, C, PERSPECTIVE>(simd, &easel.rays, item, columns);
            }
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
                    columns.put(simd, y * rays.side + x, &new, crate::Spans::NO_PARTICLE);
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
    let (front, back) = (item.at[2] - item.size, item.at[2] + item.size);
    let [x0, x1, y0, y1] = item.blocks.map(usize::from);
    for y in y0..=y1 {
        for x in x0..=x1 {
            let block = y * rays.side + x;
            if columns.holds(simd, block, front, back) {
                continue;
            }
            let new = rays.meet_ball::<S, PERSPECTIVE>(simd, (x, y), &ball);
            columns.put(simd, block, &new, item.index);
        }
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
