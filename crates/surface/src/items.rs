//! Spheres and cubes on the screen: which tiles they touch (Zirr & Dachsbacher 2015, §4.1).
//!
//! In view axes x, y, z (right, up, forward) a sphere of radius r at c spans the slopes
//!
//! > a = (cx·cz ± r·√(cx² + cz² − r²)) / (cz² − r²)
//!
//! where it lies well before the eye's plane; else those of its box from the near plane on, which is also
//! what is taken of cubes: from (cx − h)/z to (cx + h)/z, for z from the near plane or the box's front to
//! its back. Rectangles are only a bound: which pixels are met is decided ray by ray.

use bytemuck::{Pod, Zeroable};
use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::Projection;
use rayon::prelude::*;

use crate::View;
use crate::boundary::{Boundary, Cubes, Part};
use crate::cull::Cube;

/// Pixels along the edge of a block.
pub(crate) const BLOCK: u32 = 4;
/// Lanes of a vector.
pub(crate) const LANES: usize = 16;
/// How many cubes are taken as a part.
const CUBES: usize = 1 << 14;

/// The tiles of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tiles {
    /// Blocks along a tile's edge; at most 256.
    pub side: u32,
    /// Tiles along the width and the height.
    pub across: u32,
    pub down: u32,
}

/// A sphere or a cube on a tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Item {
    /// A sphere's centre in view axes; a cube's place in cells.
    pub at: [f32; 3],
    /// A sphere's radius; a cube's size in cells.
    pub size: f32,
    /// The blocks of the tile it may touch: first and last column, first and last row, a byte each.
    pub blocks: [u8; 4],
    /// A sphere's particle.
    pub index: u32,
}

/// Items of a part of the boundary, tile by tile.
#[derive(Debug, Default)]
pub(crate) struct Binned {
    pub items: Vec<Item>,
    /// First item of each tile, and the end of the last.
    starts: Vec<u32>,
}

/// All items of a view.
#[derive(Debug)]
pub(crate) struct Binning {
    pub spheres: Vec<Binned>,
    pub cubes: Vec<Binned>,
}

impl Tiles {
    /// Tiles of `pixels` along their edge.
    pub fn new(size: (u32, u32), pixels: u32) -> Self {
        let side = (pixels / BLOCK).clamp(1, 256);
        let tiles = |pixels: u32| pixels.div_ceil(side * BLOCK);
        Self { side, across: tiles(size.0), down: tiles(size.1) }
    }

    pub fn count(&self) -> usize {
        self.across as usize * self.down as usize
    }
}

impl Item {
    /// The least depth of a sphere.
    #[inline(always)]
    pub fn front(&self) -> f32 {
        self.at[2] - self.size
    }
}

impl Binned {
    /// The items of a tile.
    pub fn of(&self, tile: usize) -> &[Item] {
        &self.items[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

impl Binning {
    /// Bins all of `boundary`.
    pub fn new(boundary: &Boundary, view: &View, tiles: &Tiles, level: Level) -> Self {
        let lens = Lens::new(view, tiles, &boundary.cubes);
        let spheres = boundary.parts.par_iter().map_init(Placed::default, |placed, part| {
            placed.items.clear();
            dispatch!(level, simd => place_spheres(simd, &lens, part, placed));
            placed.by_tile(tiles)
        });
        let ordered = boundary.cubes.front_to_back(view.rays.forward);
        let cubes = ordered.par_chunks(CUBES).map_init(Placed::default, |placed, part| {
            placed.items.clear();
            dispatch!(level, simd => place_cubes(simd, &lens, part, placed));
            placed.by_tile(tiles)
        });
        Self { spheres: spheres.collect(), cubes: cubes.collect() }
    }

    /// How many items there are.
    pub fn len(&self) -> usize {
        self.spheres.iter().chain(&self.cubes).map(|b| b.items.len()).sum()
    }

    /// Bytes it holds.
    pub fn bytes(&self) -> usize {
        let bytes = |b: &Binned| b.items.len() * size_of::<Item>() + b.starts.len() * 4;
        self.spheres.iter().chain(&self.cubes).map(bytes).sum()
    }
}

/// Items in the order they came, each with its tile.
#[derive(Default)]
struct Placed {
    items: Vec<(u32, Item)>,
}

impl Placed {
    /// Sorts by tile.
    fn by_tile(&self, tiles: &Tiles) -> Binned {
        let mut starts = vec![0u32; tiles.count() + 1];
        for (tile, _) in &self.items {
            starts[*tile as usize + 1] += 1;
        }
        for tile in 0..tiles.count() {
            starts[tile + 1] += starts[tile];
        }
        let mut next = starts.clone();
        let mut items: Vec<Item> = bytemuck::zeroed_vec(self.items.len());
        for (tile, item) in &self.items {
            let place = &mut next[*tile as usize];
            items[*place as usize] = *item;
            *place += 1;
        }
        Binned { items, starts }
    }
}

/// What all items are seen through.
struct Lens<'a> {
    view: &'a View,
    tiles: &'a Tiles,
    /// The corner of the lattice of cells, from the rays' origin.
    low: Vec3,
    edge: f32,
    /// Half extents of a cell along right, up and forward.
    half: Vec3,
    /// Pixels that rounding may add to a rectangle.
    slack: f32,
}

impl<'a> Lens<'a> {
    fn new(view: &'a View, tiles: &'a Tiles, cubes: &Cubes) -> Self {
        let rays = &view.rays;
        let reach = |axis: Vec3| 0.5 * cubes.edge * axis.abs().element_sum();
        Self {
            view,
            tiles,
            low: cubes.low - rays.origin,
            edge: cubes.edge,
            half: Vec3::new(reach(rays.right), reach(rays.up), reach(rays.forward)),
            slack: 0.01 + 1e-5 * (view.size.0 + view.size.1) as f32,
        }
    }

    /// Blocks that slopes from `low` to `high` touch along the width: first and last, and whether any.
    #[inline(always)]
    fn columns<S: Simd>(&self, simd: S, (low, high): (f32x16<S>, f32x16<S>)) -> Touched<S> {
        let rays = &self.view.rays;
        let scale = f32x16::splat(simd, 1.0 / rays.pixel);
        let center = f32x16::splat(simd, rays.center[0] - 0.5);
        let (low, high) = (low * scale + center, high * scale + center);
        self.blocks(simd, (low, high), self.view.size.0)
    }

    /// The same along the height, where rows run downward.
    #[inline(always)]
    fn rows<S: Simd>(&self, simd: S, (low, high): (f32x16<S>, f32x16<S>)) -> Touched<S> {
        let rays = &self.view.rays;
        let scale = f32x16::splat(simd, 1.0 / rays.pixel);
        let center = f32x16::splat(simd, rays.center[1] - 0.5);
        let (low, high) = (center - high * scale, center - low * scale);
        self.blocks(simd, (low, high), self.view.size.1)
    }

    /// Blocks that hold pixels from `low` to `high`.
    #[inline(always)]
    fn blocks<S: Simd>(
        &self,
        simd: S,
        (low, high): (f32x16<S>, f32x16<S>),
        pixels: u32,
    ) -> Touched<S> {
        let last = f32x16::splat(simd, pixels as f32 - 1.0);
        let zero = f32x16::splat(simd, 0.0);
        let low = (low - self.slack).ceil().max(zero);
        let high = (high + self.slack).floor().min(last);
        let per_block = f32x16::splat(simd, 1.0 / BLOCK as f32);
        Touched {
            any: low.simd_le(high),
            first: (low.min(last) * per_block).to_int::<u32x16<S>>(),
            last: (high.max(zero) * per_block).to_int::<u32x16<S>>(),
        }
    }

    /// Slopes of a box from the near plane on: middle and half extent across, and depths.
    #[inline(always)]
    fn slopes<S: Simd>(
        &self,
        simd: S,
        (x, half): (f32x16<S>, f32x16<S>),
        (front, back): (f32x16<S>, f32x16<S>),
    ) -> (f32x16<S>, f32x16<S>) {
        let (low, high) = (x - half, x + half);
        if self.view.rays.projection == Projection::Orthographic {
            return (low, high);
        }
        let one = f32x16::splat(simd, 1.0);
        let (front, back) = (one / front, one / back);
        ((low * front).min(low * back), (high * front).max(high * back))
    }

    /// A depth that is not before the near plane.
    #[inline(always)]
    fn ahead<S: Simd>(&self, simd: S, depth: f32x16<S>) -> f32x16<S> {
        depth.max(f32x16::splat(simd, self.view.near))
    }

    /// Which of depths `front` to `back` lie between near and far.
    #[inline(always)]
    fn between<S: Simd>(
        &self,
        simd: S,
        (front, back): (f32x16<S>, f32x16<S>),
    ) -> <f32x16<S> as SimdBase<S>>::Mask {
        let (near, far) = (self.view.near, self.view.far);
        back.simd_gt(f32x16::splat(simd, near)) & front.simd_lt(f32x16::splat(simd, far))
    }
}

/// Blocks that sixteen things touch along one axis.
struct Touched<S: Simd> {
    any: <f32x16<S> as SimdBase<S>>::Mask,
    first: u32x16<S>,
    last: u32x16<S>,
}

/// Blocks that sixteen things touch: first and last column, first and last row.
type Rectangles = [[u32; LANES]; 4];

impl Placed {
    /// Adds the chosen ones of sixteen things, to each tile they touch.
    #[inline(always)]
    fn add(
        &mut self,
        tiles: &Tiles,
        (mut chosen, blocks): (u64, &Rectangles),
        item: impl Fn(usize) -> Item,
    ) {
        let side = tiles.side;
        while chosen != 0 {
            let lane = chosen.trailing_zeros() as usize % LANES;
            chosen &= chosen - 1;
            let [x0, x1, y0, y1] =
                [blocks[0][lane], blocks[1][lane], blocks[2][lane], blocks[3][lane]];
            let item = item(lane);
            for ty in y0 / side..=y1 / side {
                for tx in x0 / side..=x1 / side {
                    let within = |block: u32, tile: u32| {
                        (block.max(tile * side) - tile * side).min(side - 1) as u8
                    };
                    let blocks = [within(x0, tx), within(x1, tx), within(y0, ty), within(y1, ty)];
                    self.items.push((ty * tiles.across + tx, Item { blocks, ..item }));
                }
            }
        }
    }
}

/// `a`·`v`, for a constant vector.
#[inline(always)]
fn along<S: Simd>(simd: S, a: Vec3, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
    let yz = y.mul_add_precise(f32x16::splat(simd, a.y), z * a.z);
    x.mul_add_precise(f32x16::splat(simd, a.x), yz)
}

/// Four numbers of each of sixteen things, number by number; those beyond the end are those of the first.
#[inline(always)]
fn columns_of<S: Simd>(simd: S, things: &[[f32; 4]]) -> [f32x16<S>; 4] {
    let mut padded = [[0.0; 4]; LANES];
    let things = if things.len() == LANES {
        things
    } else {
        padded[..things.len()].copy_from_slice(things);
        &padded
    };
    let numbers: &[f32] = bytemuck::cast_slice(things);
    let a = f32x16::from_slice(simd, &numbers[..LANES]);
    let b = f32x16::from_slice(simd, &numbers[LANES..2 * LANES]);
    let c = f32x16::from_slice(simd, &numbers[2 * LANES..3 * LANES]);
    let d = f32x16::from_slice(simd, &numbers[3 * LANES..4 * LANES]);
    let (xz0, yw0) = a.deinterleave(b);
    let (xz1, yw1) = c.deinterleave(d);
    let (x, z) = xz0.deinterleave(xz1);
    let (y, w) = yw0.deinterleave(yw1);
    [x, y, z, w]
}

#[simd]
fn place_spheres<S: Simd>(simd: S, lens: &Lens<'_>, part: &Part, placed: &mut Placed) {
    let rays = &lens.view.rays;
    let (mut at, mut rectangles) = ([[0f32; LANES]; 3], [[0; LANES]; 4]);
    for (batch, spheres) in part.spheres.chunks(LANES).enumerate() {
        let [x, y, z, radius] = columns_of(simd, spheres);
        let from = [x - rays.origin.x, y - rays.origin.y, z - rays.origin.z];
        let x = along(simd, rays.right, from);
        let y = along(simd, rays.up, from);
        let z = along(simd, rays.forward, from);
        let (front, back) = (z - radius, z + radius);
        let mut chosen = lens.between(simd, (front, back)).to_bitmask();
        chosen &= u64::MAX >> (64 - spheres.len());
        if chosen == 0 {
            continue;
        }
        let depths = (lens.ahead(simd, front), back);
        let (mut across, mut down) =
            (lens.slopes(simd, (x, radius), depths), lens.slopes(simd, (y, radius), depths));
        if rays.projection == Projection::Perspective {
            let r2 = radius * radius;
            let square = z * z - r2;
            let scale = f32x16::splat(simd, 1.0) / square;
            let whole = z.simd_gt(radius * 1.5);
            let (middle, half) = (x * z, radius * (x * x + square).sqrt());
            across.0 = whole.select((middle - half) * scale, across.0);
            across.1 = whole.select((middle + half) * scale, across.1);
            let (middle, half) = (y * z, radius * (y * y + square).sqrt());
            down.0 = whole.select((middle - half) * scale, down.0);
            down.1 = whole.select((middle + half) * scale, down.1);
        }
        let (columns, rows) = (lens.columns(simd, across), lens.rows(simd, down));
        chosen &= (columns.any & rows.any).to_bitmask();
        for (to, v) in at.iter_mut().zip([x, y, z]) {
            v.store_slice(to);
        }
        let touched = [columns.first, columns.last, rows.first, rows.last];
        for (to, v) in rectangles.iter_mut().zip(touched) {
            v.store_slice(to);
        }
        placed.add(lens.tiles, (chosen, &rectangles), |lane| Item {
            at: [at[0][lane], at[1][lane], at[2][lane]],
            size: spheres[lane % spheres.len()][3],
            blocks: [0; 4],
            index: part.indices.get(batch * LANES + lane).copied().unwrap_or(0),
        });
    }
}

#[simd]
fn place_cubes<S: Simd>(simd: S, lens: &Lens<'_>, cubes: &[Cube], placed: &mut Placed) {
    let rays = &lens.view.rays;
    let mut rectangles = [[0; LANES]; 4];
    for cubes in cubes.chunks(LANES) {
        let [x, y, z, size] = columns_of(simd, cubes);
        let half = size * 0.5;
        let middle = [
            (x + half) * lens.edge + lens.low.x,
            (y + half) * lens.edge + lens.low.y,
            (z + half) * lens.edge + lens.low.z,
        ];
        let x = along(simd, rays.right, middle);
        let y = along(simd, rays.up, middle);
        let z = along(simd, rays.forward, middle);
        // A little more than the cube, for rounding.
        let size = size * 1.001;
        let (front, back) = (z - size * lens.half.z, z + size * lens.half.z);
        let depths = (lens.ahead(simd, front), back);
        let columns = lens.columns(simd, lens.slopes(simd, (x, size * lens.half.x), depths));
        let rows = lens.rows(simd, lens.slopes(simd, (y, size * lens.half.y), depths));
        let mut chosen = (lens.between(simd, (front, back)) & columns.any & rows.any).to_bitmask();
        chosen &= u64::MAX >> (64 - cubes.len());
        let touched = [columns.first, columns.last, rows.first, rows.last];
        for (to, v) in rectangles.iter_mut().zip(touched) {
            v.store_slice(to);
        }
        placed.add(lens.tiles, (chosen, &rectangles), |lane| {
            let [x, y, z, size] = cubes[lane % cubes.len()];
            Item { at: [x, y, z], size, ..Item::default() }
        });
    }
}
