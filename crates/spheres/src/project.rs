//! What the eye sees first, by projection: the blocks of a grid front to back onto a tile of the picture.
//!
//! Finds the same hits as tracing the tile's rays, with the same arithmetic for each ray and sphere, but
//! tests only the rays in a rectangle around each sphere ([`crate::frames`]).
//!
//! Nothing is drawn that lies behind what is already there: a tile keeps the greatest distance in each
//! of its 8 × 8 parts (64 rays each), so that a rectangle is a 64-bit mask, and whether anything shows in
//! it takes four comparisons. All bounds are conservative; the order decides only how much work there is.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use motes_grid::{Grid, Seen};

use crate::clip::Stretches;
use crate::frames::{Area, BATCH, Drawn, FRAMES, Frames, Window};
use crate::intersect::{bits, meet};
use crate::overview::{Extent, GROUP, GroupView, Lens};
use crate::packet::{LANES, NO_SLOT};
use crate::tile::{Place, RayTile, SIDE_BLOCKS};
use crate::traverse::{Counts, Spheres};

/// Parts along a tile's side whose greatest distance is kept: two blocks each.
const PARTS: usize = 8;
/// Blocks of a tile.
const TILE_BLOCKS: usize = SIDE_BLOCKS * SIDE_BLOCKS;
/// Blocks of a tile, and places beyond.
const LIMITS: usize = 2 * TILE_BLOCKS;
/// Small spheres show in at most four blocks each; and places beyond.
const MOST_DUE: usize = 8 * FRAMES;

/// Draws a system's spheres onto a tile: afterwards `slot` is set where one of them is nearest.
/// `order` lists the groups that may show in the tile, nearest first.
#[simd]
pub(crate) fn project<S: Simd>(
    simd: S,
    (tile, place): (&mut RayTile, Place),
    spheres: &Spheres<'_>,
    (groups, order): (&[GroupView], &[u32]),
    (rays, counts): (&motes_scene::Rays, &mut Counts),
) {
    let (pattern, perspective) = (tile.pattern, tile.eye.is_some());
    let clipped = spheres.clip.is_some();
    if let Some(clip) = spheres.clip {
        tile.clip_to(simd, clip);
    }
    let lenses: Vec<Lens> = spheres.classes.grids.iter().map(|g| Lens::new(rays, g)).collect();
    let Some(sheet) = Sheet::of(simd, tile) else { return };
    let mut easel = Easel {
        sheet,
        window: Window {
            lens: lenses[0],
            pattern,
            corner: (place.corner.0 as f32, place.corner.1 as f32),
        },
        perspective,
        clipped,
        spheres,
        farthest: [f32::INFINITY; PARTS * PARTS],
        farthest_of_all: f32::INFINITY,
        stale: u64::MAX,
        frames: Frames::new(),
        due: [0; MOST_DUE],
        counts,
    };
    for group in order {
        let group = &groups[*group as usize];
        easel.refresh(simd);
        // The nearest come first: all that follow are hidden too.
        if group.whole.near >= easel.farthest_of_all {
            break;
        }
        if let Some(area) = easel.window.area_of(group.whole)
            && easel.shows(simd, area, group.whole.near)
        {
            easel.window.lens = lenses[group.class];
            easel.group(simd, group);
        }
    }
}

/// The rays of a tile, block by block.
struct Sheet<'a> {
    direction: [&'a Blocks<f32>; 3],
    origin: [&'a Blocks<f32>; 3],
    distance: &'a mut Blocks<f32>,
    slot: &'a mut Blocks<u32>,
    /// Greatest distance of the rays of each block; −∞ beyond the blocks of a tile.
    limit: [f32; LIMITS],
    /// What of the rays is left, where the spheres are cut.
    stretches: &'a Stretches,
}

/// A number of each ray of a tile.
type Blocks<T> = [[T; LANES]; TILE_BLOCKS];

impl<'a> Sheet<'a> {
    /// `None` if the tile does not have as many rays as tiles have.
    fn of<S: Simd>(simd: S, tile: &'a mut RayTile) -> Option<Self> {
        let [dx, dy, dz] = &tile.direction;
        let [ox, oy, oz] = &tile.origin;
        let distance: &mut Blocks<f32> = tile.distance.as_chunks_mut().0.first_chunk_mut()?;
        let mut limit = [f32::NEG_INFINITY; LIMITS];
        for (limit, rays) in limit.iter_mut().zip(&*distance) {
            *limit = f32x16::from_slice(simd, rays).reduce_max();
        }
        Some(Self {
            direction: [blocks(dx)?, blocks(dy)?, blocks(dz)?],
            origin: [blocks(ox)?, blocks(oy)?, blocks(oz)?],
            distance,
            slot: tile.slot.as_chunks_mut().0.first_chunk_mut()?,
            limit,
            stretches: &tile.stretches,
        })
    }

    /// Tests the rays of a block against one sphere and keeps nearer hits. At equal distance the lower
    /// index in the file wins, and an earlier system before a later. Gives the part whose greatest distance
    /// may have become less.
    #[inline(always)]
    fn test<S: Simd, const PERSPECTIVE: bool, const CLIPPED: bool>(
        &mut self,
        simd: S,
        spheres: &Spheres<'_>,
        (sphere, slot): (&Drawn<S>, u32),
        block: usize,
    ) -> u64 {
        let block = block % TILE_BLOCKS;
        let [mut ox, mut oy, mut oz] = sphere.center;
        if !PERSPECTIVE {
            let [px, py, pz] = &self.origin;
            ox -= f32x16::from_slice(simd, &px[block]);
            oy -= f32x16::from_slice(simd, &py[block]);
            oz -= f32x16::from_slice(simd, &pz[block]);
        }
        let [dx, dy, dz] = &self.direction;
        let dx = f32x16::from_slice(simd, &dx[block]);
        let dy = f32x16::from_slice(simd, &dy[block]);
        let dz = f32x16::from_slice(simd, &dz[block]);
        let (oc, direction) = ([ox, oy, oz], [dx, dy, dz]);
        let (distance, hit) = match CLIPPED {
            false => meet(simd, oc, direction, sphere.r2),
            true => self.stretches.meet(simd, block, (oc, direction), sphere.r2),
        };
        let distance = hit.select(distance, f32x16::splat(simd, f32::INFINITY));
        let before = f32x16::from_slice(simd, &self.distance[block]);
        let nearer = distance.simd_lt(before);
        let ties = hit & distance.simd_eq(before);
        // Kept without asking whether there are any: the answer comes late, and cannot be foreseen.
        let nearest = before.min(distance);
        nearest.store_slice(&mut self.distance[block]);
        let slots = u32x16::from_slice(simd, &self.slot[block]);
        let slots = nearer.select(u32x16::splat(simd, slot), slots);
        slots.store_slice(&mut self.slot[block]);
        let limit = nearest.reduce_max();
        let part = block / SIDE_BLOCKS / 2 * PARTS + block % SIDE_BLOCKS / 2;
        let less = u64::from(limit < self.limit[block]);
        self.limit[block] = limit;
        if ties.any_true() {
            break_ties(spheres, &mut self.slot[block], (slot, ties.to_bitmask()));
        }
        less << part
    }
}

fn blocks(numbers: &[f32]) -> Option<&Blocks<f32>> {
    numbers.as_chunks().0.first_chunk()
}

/// A tile on which a system is drawn.
#[repr(align(64))]
struct Easel<'a> {
    sheet: Sheet<'a>,
    window: Window,
    perspective: bool,
    clipped: bool,
    spheres: &'a Spheres<'a>,
    /// Greatest distance of the rays of each part; never less than the truth.
    farthest: [f32; PARTS * PARTS],
    farthest_of_all: f32,
    /// The parts whose greatest distance may have become less.
    stale: u64,
    frames: Frames,
    /// Small spheres of a batch that are to be tested: lane · 256 + block of the tile.
    due: [u16; MOST_DUE],
    counts: &'a mut Counts,
}

impl Easel<'_> {
    /// The parts that lie in an area.
    #[inline(always)]
    fn parts([x0, x1, y0, y1]: Area) -> u64 {
        let row = (0xff_u64 >> (7 - x1 / 2)) & (0xff << (x0 / 2)) & 0xff;
        let rows = (u64::MAX >> (8 * (7 - y1 / 2))) & (u64::MAX << (8 * (y0 / 2)));
        (row * 0x0101_0101_0101_0101) & rows
    }

    /// The parts of the tile in which something at distance `near` would show.
    #[inline(always)]
    fn open<S: Simd>(&self, simd: S, near: f32) -> u64 {
        let near = f32x16::splat(simd, near);
        let mut open = 0;
        for quarter in 0..4 {
            let at = quarter * LANES;
            let farthest = f32x16::from_slice(simd, &self.farthest[at..at + LANES]);
            open |= farthest.simd_gt(near).to_bitmask() << at;
        }
        open
    }

    /// Whether something at distance `near` or more may show in an area.
    #[inline(always)]
    fn shows<S: Simd>(&self, simd: S, area: Area, near: f32) -> bool {
        Self::parts(area) & self.open(simd, near) != 0
    }

    /// Brings the greatest distances of the parts up to date.
    #[inline(always)]
    fn refresh<S: Simd>(&mut self, simd: S) {
        if self.stale == 0 {
            return;
        }
        while self.stale != 0 {
            let part = self.stale.trailing_zeros() as usize;
            self.stale &= self.stale - 1;
            let first = part / PARTS * 2 * SIDE_BLOCKS + part % PARTS * 2;
            let limit = &self.sheet.limit[first..first + SIDE_BLOCKS + 2];
            let below = limit[SIDE_BLOCKS].max(limit[SIDE_BLOCKS + 1]);
            self.farthest[part] = limit[0].max(limit[1]).max(below);
        }
        let mut all = f32x16::from_slice(simd, &self.farthest[..LANES]);
        for quarter in 1..4 {
            let at = quarter * LANES;
            all = all.max(f32x16::from_slice(simd, &self.farthest[at..at + LANES]));
        }
        self.farthest_of_all = all.reduce_max();
    }

    /// Draws the blocks of a group, nearest first.
    #[inline(always)]
    fn group<S: Simd>(&mut self, simd: S, group: &GroupView) {
        let mut order = [(0.0, 0u8); GROUP];
        let mut count = 0;
        let side = self.window.pattern.tile_side() as f32;
        for first in (0..GROUP).step_by(LANES) {
            let lanes = first..first + LANES;
            let near = f32x16::from_slice(simd, &group.near[lanes.clone()]);
            let x0 = f32x16::from_slice(simd, &group.rect[0][lanes.clone()]);
            let x1 = f32x16::from_slice(simd, &group.rect[1][lanes.clone()]);
            let y0 = f32x16::from_slice(simd, &group.rect[2][lanes.clone()]);
            let y1 = f32x16::from_slice(simd, &group.rect[3][lanes]);
            let meets = near.simd_lt(f32x16::splat(simd, self.farthest_of_all))
                & x1.simd_ge(f32x16::splat(simd, self.window.corner.0))
                & x0.simd_le(f32x16::splat(simd, self.window.corner.0 + side))
                & y1.simd_ge(f32x16::splat(simd, self.window.corner.1))
                & y0.simd_le(f32x16::splat(simd, self.window.corner.1 + side));
            let mut meets = meets.to_bitmask();
            while meets != 0 {
                let block = first + meets.trailing_zeros() as usize;
                meets &= meets - 1;
                let mut at = count;
                while at > 0 && order[at - 1].0 > group.near[block] {
                    order[at] = order[at - 1];
                    at -= 1;
                }
                order[at] = (group.near[block], block as u8);
                count += 1;
            }
        }
        for (near, block) in &order[..count] {
            let block = *block as usize;
            self.refresh(simd);
            let extent = Extent {
                near: *near,
                x: (group.rect[0][block], group.rect[1][block]),
                y: (group.rect[2][block], group.rect[3][block]),
            };
            let Some(area) = self.window.area_of(extent) else { continue };
            if self.shows(simd, area, *near) {
                self.block(simd, (group, block), Self::parts(area));
            }
        }
    }

    /// Draws a block of a group that shows in some of `parts`.
    #[inline(always)]
    fn block<S: Simd>(&mut self, simd: S, (group, block): (&GroupView, usize), parts: u64) {
        let spheres = self.spheres;
        let grid = &spheres.classes.grids[group.class];
        let (start, end) = (group.first[block] as usize, group.end[block] as usize);
        let seen = match group.mixed >> block & 1 {
            0 => Seen::Shown,
            _ => spheres.visible[group.class].block(grid, group.block[block] as usize),
        };
        // Nothing of it shows behind the farthest ray of its parts.
        let mut reach = f32x16::splat(simd, 0.0);
        for quarter in 0..4 {
            let at = quarter * LANES;
            let farthest = f32x16::from_slice(simd, &self.farthest[at..at + LANES]);
            let own = mask32x16::from_bitmask(simd, parts >> at & 0xffff);
            reach = own.select(reach.max(farthest), reach);
        }
        let reach = reach.reduce_max();
        let run = Run { grid, seen, block_first: start, first_slot: group.first_slot };
        match (self.perspective, self.clipped) {
            (true, false) => self.run::<S, true, false>(simd, run, (start, end), reach),
            (true, true) => self.run::<S, true, true>(simd, run, (start, end), reach),
            (false, false) => self.run::<S, false, false>(simd, run, (start, end), reach),
            (false, true) => self.run::<S, false, true>(simd, run, (start, end), reach),
        }
    }

    /// Draws the particles `from..to` that lie nearer than `reach`.
    #[inline(always)]
    fn run<S: Simd, const PERSPECTIVE: bool, const CLIPPED: bool>(
        &mut self,
        simd: S,
        run: Run<'_>,
        (from, to): (usize, usize),
        reach: f32,
    ) {
        let chunks = (to - from).div_ceil(LANES);
        // Cells run upward in z: a look downward meets the last ones first.
        let downward = self.window.lens.rays.forward.z < 0.0;
        for batch in (0..chunks).step_by(BATCH) {
            let mut may = 0;
            for (row, chunk) in (batch..chunks.min(batch + BATCH)).enumerate() {
                let chunk = if downward { chunks - 1 - chunk } else { chunk };
                let slot = from + chunk * LANES;
                let mut seen = u64::MAX >> (64 - (to - slot).min(LANES));
                if let Seen::Mixed(words) = run.seen {
                    seen &= bits(words, slot - run.block_first);
                }
                self.counts.spheres += u64::from(seen.count_ones());
                let (window, frames) = (&self.window, &mut self.frames);
                frames.first_slot[row] = run.first_slot + slot as u32;
                let all = (run.grid, slot);
                may |= (seen & window.frame::<S, PERSPECTIVE>(simd, all, reach, (frames, row)))
                    << (row * LANES);
            }
            self.batch::<S, PERSPECTIVE, CLIPPED>(simd, may);
        }
    }

    /// Draws those of a batch of framed spheres that may show.
    #[inline(always)]
    fn batch<S: Simd, const PERSPECTIVE: bool, const CLIPPED: bool>(
        &mut self,
        simd: S,
        mut may: u64,
    ) {
        let mut due = 0;
        while may != 0 {
            let lane = may.trailing_zeros() as usize;
            may &= may - 1;
            match self.frames.large(lane) {
                Some(area) => self.draw::<S, PERSPECTIVE, CLIPPED>(simd, lane, area),
                None => due = self.enlist(lane, due),
            }
        }
        self.counts.tests += (due * LANES) as u64;
        let mut stale = 0;
        for due in &self.due[..due.min(MOST_DUE)] {
            let (lane, block) = (usize::from(due >> 8) % FRAMES, usize::from(due & 255));
            let sphere = (&self.frames.sphere(simd, lane), self.frames.slot(lane));
            let sheet = &mut self.sheet;
            stale |= sheet.test::<S, PERSPECTIVE, CLIPPED>(simd, self.spheres, sphere, block);
        }
        self.stale |= stale;
    }

    /// Notes the blocks in which a small sphere may show, after the `due` pairs of lane and block that are
    /// noted; gives how many there are then. No branches: what would be taken cannot be foreseen.
    #[inline(always)]
    fn enlist(&mut self, lane: usize, due: usize) -> usize {
        let near = self.frames.near[lane];
        let mut due = due;
        for corner in &self.frames.corner {
            let block = corner[lane];
            self.due[due % MOST_DUE] = (lane << 8) as u16 | (block & 255) as u16;
            due += usize::from(near < self.sheet.limit[block as usize % LIMITS]);
        }
        due
    }

    /// Draws a large sphere.
    #[inline(always)]
    fn draw<S: Simd, const PERSPECTIVE: bool, const CLIPPED: bool>(
        &mut self,
        simd: S,
        lane: usize,
        area: Area,
    ) {
        let near = self.frames.near[lane];
        if !self.shows(simd, area, near) {
            return;
        }
        let sphere = (&self.frames.sphere(simd, lane), self.frames.slot(lane));
        let [x0, x1, y0, y1] = area;
        for y in y0..=y1 {
            for x in x0..=x1 {
                let block = y * SIDE_BLOCKS + x;
                if near < self.sheet.limit[block] {
                    self.counts.tests += LANES as u64;
                    let sheet = &mut self.sheet;
                    self.stale |=
                        sheet.test::<S, PERSPECTIVE, CLIPPED>(simd, self.spheres, sphere, block);
                }
            }
        }
    }
}

/// Particles of a block, and how their slots count.
#[derive(Clone, Copy)]
struct Run<'a> {
    grid: &'a Grid,
    seen: Seen<'a>,
    block_first: usize,
    first_slot: u32,
}

/// Gives rays that a sphere meets as far away as the one they hold to the lower index.
#[cold]
fn break_ties(spheres: &Spheres<'_>, held: &mut [u32], (slot, ties): (u32, u64)) {
    for (lane, held) in held.iter_mut().enumerate().filter(|(lane, _)| ties >> lane & 1 == 1) {
        let _ = lane;
        if *held != NO_SLOT && *held != slot && spheres.index(slot) < spheres.index(*held) {
            *held = slot;
        }
    }
}
