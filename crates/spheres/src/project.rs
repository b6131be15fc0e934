//! What the eye sees first, by projection: the blocks of a grid front to back onto a tile of the picture.
//!
//! Finds the same hits as tracing the tile's rays, with the same arithmetic for each ray and sphere, but
//! tests only the rays in a rectangle around each sphere. With the eye at the origin, view axes x, y, z
//! (z forward) and slopes a = x/z, a sphere of radius r at c spans
//!
//! > a = (cx·cz ± r·√(cx² + cz² − r²)) / (cz² − r²)
//!
//! of which √(cx² + cz² − r²) ≤ |c| gives an upper bound that needs one root for both axes.
//!
//! Nothing is drawn that lies behind what is already there: a tile keeps the greatest distance in each
//! of its 8 × 8 parts (64 rays each), so that a rectangle is a 64-bit mask, and whether anything shows in
//! it takes four comparisons. All bounds are conservative; the order decides only how much work there is.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use motes_grid::{Grid, Seen};

use crate::intersect::{bits, meet, radii_at, sixteen_centers};
use crate::overview::{Extent, GROUP, GroupView, Lens, slack};
use crate::packet::{LANES, NO_SLOT};
use crate::tile::{Pattern, Place, RayTile, SIDE_BLOCKS};
use crate::traverse::{Counts, Spheres};

/// Parts along a tile's side whose greatest distance is kept: two blocks each.
const PARTS: usize = 8;
/// Blocks of a tile.
const TILE_BLOCKS: usize = SIDE_BLOCKS * SIDE_BLOCKS;
/// Sixteen small spheres show in at most four blocks each; and one place more.
const MOST_DUE: usize = 128;

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
    let lenses: Vec<Lens> = spheres.classes.grids.iter().map(|g| Lens::new(rays, g)).collect();
    let Some(sheet) = Sheet::of(tile) else { return };
    let mut easel = Easel {
        sheet,
        pattern,
        perspective,
        spheres,
        lens: lenses[0],
        corner: (place.corner.0 as f32, place.corner.1 as f32),
        limit: [f32::INFINITY; TILE_BLOCKS],
        farthest: [f32::INFINITY; PARTS * PARTS],
        farthest_of_all: f32::INFINITY,
        stale: u64::MAX,
        due: [0; MOST_DUE],
        counts,
    };
    easel.measure(simd);
    for group in order {
        let group = &groups[*group as usize];
        easel.refresh(simd);
        // The nearest come first: all that follow are hidden too.
        if group.whole.near >= easel.farthest_of_all {
            break;
        }
        if let Some(area) = easel.area_of(group.whole)
            && easel.shows(simd, area, group.whole.near)
        {
            easel.lens = lenses[group.class];
            easel.group(simd, group);
        }
    }
}

/// A rectangle of blocks of a tile: first and last along x and y.
type Area = [usize; 4];

/// The rays of a tile, block by block.
struct Sheet<'a> {
    direction: [&'a Blocks<f32>; 3],
    origin: [&'a Blocks<f32>; 3],
    distance: &'a mut Blocks<f32>,
    slot: &'a mut Blocks<u32>,
}

/// A number of each ray of a tile.
type Blocks<T> = [[T; LANES]; TILE_BLOCKS];

impl<'a> Sheet<'a> {
    /// `None` if the tile does not have as many rays as tiles have.
    fn of(tile: &'a mut RayTile) -> Option<Self> {
        let [dx, dy, dz] = &tile.direction;
        let [ox, oy, oz] = &tile.origin;
        Some(Self {
            direction: [blocks(dx)?, blocks(dy)?, blocks(dz)?],
            origin: [blocks(ox)?, blocks(oy)?, blocks(oz)?],
            distance: tile.distance.as_chunks_mut().0.first_chunk_mut()?,
            slot: tile.slot.as_chunks_mut().0.first_chunk_mut()?,
        })
    }
}

fn blocks(numbers: &[f32]) -> Option<&Blocks<f32>> {
    numbers.as_chunks().0.first_chunk()
}

/// A tile on which a system is drawn.
#[repr(align(64))]
struct Easel<'a> {
    sheet: Sheet<'a>,
    pattern: Pattern,
    perspective: bool,
    spheres: &'a Spheres<'a>,
    lens: Lens,
    /// The tile's first pixel.
    corner: (f32, f32),
    /// Greatest distance of the rays of each block.
    limit: [f32; TILE_BLOCKS],
    /// Greatest distance of the rays of each part; never less than the truth.
    farthest: [f32; PARTS * PARTS],
    farthest_of_all: f32,
    /// The parts whose greatest distance may have become less.
    stale: u64,
    /// Small spheres of sixteen that are to be tested: lane · 256 + block of the tile.
    due: [u16; MOST_DUE],
    counts: &'a mut Counts,
}

impl Easel<'_> {
    /// The blocks of the tile that have a ray in the rectangle, if any.
    #[inline(always)]
    fn area_of(&self, extent: Extent) -> Option<Area> {
        let [x, y] = self.pattern.inset;
        let side = self.pattern.side as f32;
        let most = side * SIDE_BLOCKS as f32 - 1.0;
        let (x0, x1) = whole_pixels(extent.x, self.corner.0, x);
        let (y0, y1) = whole_pixels(extent.y, self.corner.1, y);
        if x0 > x1 || y0 > y1 || x1 < 0.0 || y1 < 0.0 || x0 > most || y0 > most {
            return None;
        }
        let block = |pixel: f32| (pixel.clamp(0.0, most) / side) as usize;
        Some([block(x0), block(x1), block(y0), block(y1)])
    }

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

    /// Takes the greatest distance of each block from its rays.
    #[inline(always)]
    fn measure<S: Simd>(&mut self, simd: S) {
        for (block, limit) in self.limit.iter_mut().enumerate() {
            let rays = &self.sheet.distance[block];
            *limit = f32x16::from_slice(simd, rays).reduce_max();
        }
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
            let limit = &self.limit[first..first + SIDE_BLOCKS + 2];
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
        let side = self.pattern.tile_side() as f32;
        for first in (0..GROUP).step_by(LANES) {
            let lanes = first..first + LANES;
            let near = f32x16::from_slice(simd, &group.near[lanes.clone()]);
            let x0 = f32x16::from_slice(simd, &group.rect[0][lanes.clone()]);
            let x1 = f32x16::from_slice(simd, &group.rect[1][lanes.clone()]);
            let y0 = f32x16::from_slice(simd, &group.rect[2][lanes.clone()]);
            let y1 = f32x16::from_slice(simd, &group.rect[3][lanes]);
            let meets = near.simd_lt(f32x16::splat(simd, self.farthest_of_all))
                & x1.simd_ge(f32x16::splat(simd, self.corner.0))
                & x0.simd_le(f32x16::splat(simd, self.corner.0 + side))
                & y1.simd_ge(f32x16::splat(simd, self.corner.1))
                & y0.simd_le(f32x16::splat(simd, self.corner.1 + side));
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
            let Some(area) = self.area_of(extent) else { continue };
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
        if self.perspective {
            self.run::<S, true>(simd, run, (start, end), reach);
        } else {
            self.run::<S, false>(simd, run, (start, end), reach);
        }
    }

    /// Draws the particles `from..to` that lie nearer than `reach`.
    #[inline(always)]
    fn run<S: Simd, const PERSPECTIVE: bool>(
        &mut self,
        simd: S,
        run: Run<'_>,
        (from, to): (usize, usize),
        reach: f32,
    ) {
        let mut frames = Frames::new();
        let chunks = (to - from).div_ceil(LANES);
        // Cells run upward in z: a look downward meets the last ones first.
        let downward = self.lens.rays.forward.z < 0.0;
        for chunk in 0..chunks {
            let chunk = if downward { chunks - 1 - chunk } else { chunk };
            let slot = from + chunk * LANES;
            let count = (to - slot).min(LANES);
            let mut may = u64::MAX >> (64 - count);
            if let Seen::Mixed(words) = run.seen {
                may &= bits(words, slot - run.block_first);
            }
            if may != 0 {
                self.counts.spheres += u64::from(may.count_ones());
                may &= self.frame::<S, PERSPECTIVE>(simd, (run.grid, slot), reach, &mut frames);
            }
            let mut due = 0;
            while may != 0 {
                let lane = may.trailing_zeros() as usize;
                may &= may - 1;
                let area = frames.area[lane];
                if area & LARGE == 0 {
                    due = self.enlist((area, frames.near[lane]), lane, due);
                } else {
                    let first_slot = run.first_slot + slot as u32;
                    self.draw::<S, PERSPECTIVE>(simd, (&frames, lane), first_slot);
                }
            }
            for at in 0..due {
                let (lane, block) = (self.due[at] >> 8, self.due[at] & 255);
                let slot = run.first_slot + slot as u32 + u32::from(lane);
                let sphere = frames.sphere(simd, (lane & 15) as usize);
                self.test::<S, PERSPECTIVE>(simd, (&sphere, slot), block as usize);
            }
        }
    }

    /// Notes the blocks of a small area in which a sphere no nearer than `near` may show, after the
    /// `due` pairs of lane and block that are noted; gives how many there are then. No branches: what
    /// would be taken cannot be foreseen.
    #[inline(always)]
    fn enlist(&mut self, (area, near): (u32, f32), lane: usize, due: usize) -> usize {
        let [x0, x1, y0, y1] = unpacked(area);
        let lane = (lane << 8) as u16;
        let mut due = due;
        for (x, y, there) in
            [(x0, y0, true), (x1, y0, x1 > x0), (x0, y1, y1 > y0), (x1, y1, x1 > x0 && y1 > y0)]
        {
            let block = y * SIDE_BLOCKS + x;
            self.due[due % MOST_DUE] = lane | block as u16;
            due += usize::from(there & (near < self.limit[block]));
        }
        due
    }

    /// Least distances and areas of the sixteen spheres from `slot` on; gives which may show at all.
    #[inline(always)]
    fn frame<S: Simd, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        (grid, slot): (&Grid, usize),
        reach: f32,
        frames: &mut Frames,
    ) -> u64 {
        let rays = &self.lens.rays;
        let [cx, cy, cz] = sixteen_centers(simd, grid, slot);
        let own_radius = radii_at(simd, grid, slot);
        let radius = own_radius + self.lens.pad;
        let ox = cx - rays.origin.x;
        let oy = cy - rays.origin.y;
        let oz = cz - rays.origin.z;
        let x = along(simd, rays.right, [ox, oy, oz]);
        let y = along(simd, rays.up, [ox, oy, oz]);
        let z = along(simd, rays.forward, [ox, oy, oz]);
        let scale = f32x16::splat(simd, self.lens.scale);
        let zero = f32x16::splat(simd, 0.0);
        let ahead = (z + radius).simd_gt(zero);
        let (near, mx, my, half, whole) = if PERSPECTIVE {
            let distance = z.mul_add(z, y.mul_add(y, x * x)).sqrt();
            let square = z.mul_add(z, -(radius * radius));
            let part = scale / square;
            let (zp, half) = (z * part, radius * distance * part);
            // The eye's plane cuts the sphere: it may be anywhere.
            let cut = z.simd_le(radius * 1.001);
            (distance - radius, x * zp, y * zp, half, cut)
        } else {
            let none = zero.simd_gt(zero);
            (z - radius, x * scale, y * scale, radius * scale, none)
        };
        let half = half + slack(rays);
        let side = self.pattern.side as f32;
        let most = side * SIDE_BLOCKS as f32 - 1.0;
        let [inset_x, inset_y] = self.pattern.inset;
        let at_x = rays.center[0] - self.corner.0;
        let at_y = rays.center[1] - self.corner.1;
        let x0 = (mx - half + (at_x - inset_x.1)).ceil();
        let x1 = (mx + half + (at_x - inset_x.0)).floor();
        // Rows run downward.
        let y0 = (-my - half + (at_y - inset_y.1)).ceil();
        let y1 = (-my + half + (at_y - inset_y.0)).floor();
        let most = f32x16::splat(simd, most);
        let meets = x0.simd_le(x1)
            & y0.simd_le(y1)
            & x1.simd_ge(zero)
            & y1.simd_ge(zero)
            & x0.simd_le(most)
            & y0.simd_le(most);
        let shows = (meets | whole) & ahead & near.simd_lt(f32x16::splat(simd, reach));
        let may = shows.to_bitmask();
        if may == 0 {
            return 0;
        }
        let per_side = f32x16::splat(simd, 1.0 / side);
        let x0 = whole.select(zero, x0.max(zero)) * per_side;
        let x1 = whole.select(most, x1.min(most)) * per_side;
        let y0 = whole.select(zero, y0.max(zero)) * per_side;
        let y1 = whole.select(most, y1.min(most)) * per_side;
        near.store_slice(&mut frames.near);
        (own_radius * own_radius).store_slice(&mut frames.r2);
        // From where the rays start, if they all start there.
        let [cx, cy, cz] = if PERSPECTIVE { [ox, oy, oz] } else { [cx, cy, cz] };
        cx.store_slice(&mut frames.center[0]);
        cy.store_slice(&mut frames.center[1]);
        cz.store_slice(&mut frames.center[2]);
        let (x0, x1) = (u32x16::truncate_from(x0), u32x16::truncate_from(x1));
        let (y0, y1) = (u32x16::truncate_from(y0), u32x16::truncate_from(y1));
        let one = u32x16::splat(simd, 1);
        let large = (x1 - x0).simd_gt(one) | (y1 - y0).simd_gt(one);
        let large = large.select(u32x16::splat(simd, LARGE), u32x16::splat(simd, 0));
        (x0 | x1 << 4 | y0 << 8 | y1 << 12 | large).store_slice(&mut frames.area);
        may
    }

    /// Draws a large sphere of sixteen, whose slots begin at `first_slot`.
    #[inline(always)]
    fn draw<S: Simd, const PERSPECTIVE: bool>(
        &mut self,
        simd: S,
        (frames, lane): (&Frames, usize),
        first_slot: u32,
    ) {
        let (area, near) = (unpacked(frames.area[lane]), frames.near[lane]);
        if !self.shows(simd, area, near) {
            return;
        }
        let sphere = frames.sphere(simd, lane);
        let [x0, x1, y0, y1] = area;
        for y in y0..=y1 {
            for x in x0..=x1 {
                let block = y * SIDE_BLOCKS + x;
                if near < self.limit[block] {
                    let slot = first_slot + lane as u32;
                    self.test::<S, PERSPECTIVE>(simd, (&sphere, slot), block);
                }
            }
        }
    }

    /// Tests the rays of a block of the tile against one sphere and keeps nearer hits. At equal distance
    /// the lower index in the file wins, and an earlier system before a later.
    #[inline(always)]
    fn test<S: Simd, const PERSPECTIVE: bool>(
        &mut self,
        simd: S,
        (sphere, slot): (&Drawn<S>, u32),
        block: usize,
    ) {
        let block = block % TILE_BLOCKS;
        let [mut ox, mut oy, mut oz] = sphere.center;
        if !PERSPECTIVE {
            let [px, py, pz] = &self.sheet.origin;
            ox -= f32x16::from_slice(simd, &px[block]);
            oy -= f32x16::from_slice(simd, &py[block]);
            oz -= f32x16::from_slice(simd, &pz[block]);
        }
        self.counts.tests += LANES as u64;
        let [dx, dy, dz] = &self.sheet.direction;
        let dx = f32x16::from_slice(simd, &dx[block]);
        let dy = f32x16::from_slice(simd, &dy[block]);
        let dz = f32x16::from_slice(simd, &dz[block]);
        let (distance, hit) = meet(simd, [ox, oy, oz], [dx, dy, dz], sphere.r2);
        let before = f32x16::from_slice(simd, &self.sheet.distance[block]);
        let nearer = hit & distance.simd_lt(before);
        let ties = hit & distance.simd_eq(before);
        // Kept without asking whether there are any: the answer comes late, and cannot be foreseen.
        let nearest = nearer.select(distance, before);
        nearest.store_slice(&mut self.sheet.distance[block]);
        let slots = u32x16::from_slice(simd, &self.sheet.slot[block]);
        let slots = nearer.select(u32x16::splat(simd, slot), slots);
        slots.store_slice(&mut self.sheet.slot[block]);
        let limit = nearest.reduce_max();
        let part = block / SIDE_BLOCKS / 2 * PARTS + block % SIDE_BLOCKS / 2;
        self.stale |= u64::from(limit < self.limit[block]) << part;
        self.limit[block] = limit;
        if ties.any_true() {
            break_ties(self.spheres, &mut self.sheet.slot[block], (slot, ties.to_bitmask()));
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

/// A sphere to be drawn: its centre, from where the rays start if they all start at one point, and the
/// square of its radius.
struct Drawn<S: Simd> {
    center: [f32x16<S>; 3],
    r2: f32x16<S>,
}

/// Sixteen spheres, their least distances and areas.
#[repr(align(64))]
struct Frames {
    center: [[f32; LANES]; 3],
    r2: [f32; LANES],
    near: [f32; LANES],
    /// First and last block along x and y, four bits each, and whether it is [`LARGE`].
    area: [u32; LANES],
}

/// Set in the area of a sphere that shows in more than two blocks along x or y.
const LARGE: u32 = 1 << 16;

#[inline(always)]
fn unpacked(area: u32) -> Area {
    let side = |shift: u32| (area >> shift & 15) as usize;
    [side(0), side(4), side(8), side(12)]
}

impl Frames {
    fn new() -> Self {
        Self {
            center: [[0.0; LANES]; 3],
            r2: [0.0; LANES],
            near: [0.0; LANES],
            area: [0; LANES],
        }
    }

    #[inline(always)]
    fn sphere<S: Simd>(&self, simd: S, lane: usize) -> Drawn<S> {
        let [x, y, z] = &self.center;
        let center = [
            f32x16::splat(simd, x[lane]),
            f32x16::splat(simd, y[lane]),
            f32x16::splat(simd, z[lane]),
        ];
        Drawn { center, r2: f32x16::splat(simd, self.r2[lane]) }
    }
}

/// The first and last pixel from `corner` on whose samples, which lie in `inset` of each pixel, can lie
/// in `span`.
#[inline(always)]
fn whole_pixels(span: (f32, f32), corner: f32, inset: (f32, f32)) -> (f32, f32) {
    ((span.0 - corner - inset.1).ceil(), (span.1 - corner - inset.0).floor())
}

#[inline(always)]
fn along<S: Simd>(simd: S, axis: glam::Vec3, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
    let y = y.mul_add(f32x16::splat(simd, axis.y), x * axis.x);
    z.mul_add(f32x16::splat(simd, axis.z), y)
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
