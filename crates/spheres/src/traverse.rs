//! Coherent grid traversal: a packet through the slices of a grid, blocks first, then cells.
//!
//! Gribble et al. 2007, §2 and §4: the packet goes slice by slice along its major axis; in each slice
//! the frustum, enlarged by the greatest radius, overlaps a rectangle of blocks, in a block each slice
//! of cells a rectangle of cells. The spheres of these are culled sixteen at a time and what remains
//! is tested against all rays. It ends where every ray has hit something nearer than the next slice.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Block, Clip, Grid, RadiusClasses, Seen, Visibility};

use crate::clip::cap_at;
use crate::frustum::{Bounds, Frustum};
use crate::intersect::{Cull, Sphere, bits, cull, dim, farthest, intersect, optical_depth};
use crate::packet::{LANES, Packet};
use crate::render::Cap;
use crate::shade::Paint;

/// One particle system as the tracer sees it: its grids, and what is visible of each.
#[derive(Clone, Copy, Debug)]
pub struct Spheres<'a> {
    /// The grids, greatest radii first.
    pub classes: &'a RadiusClasses,
    /// One per grid.
    pub visible: &'a [Visibility],
    /// The part of a ray on which these spheres are met; `None`: all of it. What is cut by centre is not
    /// among the visible ones, and not asked here.
    pub clip: Option<&'a Clip>,
    /// Whether these are more particles of the grids of the system before: those that another clip cuts. They are
    /// one system then, in which the lower index wins at equal depth.
    pub continues: bool,
}

impl<'a> Spheres<'a> {
    /// What is visible of the particles of `classes`, uncut.
    pub fn new(classes: &'a RadiusClasses, visible: &'a [Visibility]) -> Self {
        Self { classes, visible, clip: None, continues: false }
    }
    /// The grid that holds `slot`, and the place in it. Slots count through all grids of the system.
    #[inline]
    pub fn locate(&self, slot: u32) -> (&Grid, usize) {
        // Most systems have one.
        if let [grid] = &self.classes.grids[..] {
            return (grid, slot as usize);
        }
        let mut place = slot as usize;
        let mut grids = self.classes.grids.iter();
        let mut grid = grids.next();
        while let Some(g) = grid {
            if place < g.len() {
                return (g, place);
            }
            place -= g.len();
            grid = grids.next();
        }
        unreachable!("slots come from these grids")
    }

    /// The surface that a ray has met at `distance` on the sphere at `slot`.
    pub fn surface(&self, slot: u32, (origin, direction): (Vec3, Vec3), distance: f32) -> Met {
        let (grid, place) = self.locate(slot);
        let point = origin + direction * distance;
        let cap = self.clip.and_then(|clip| cap_at(clip, (origin, direction), distance));
        let outward = match cap {
            Some(face) => face.plane.normal,
            None => (point - grid.center(place)).normalize_or(-direction),
        };
        Met {
            point,
            normal: if outward.dot(direction) < 0.0 { outward } else { -outward },
            radius: grid.radius_at(place),
            index: grid.index(place),
            cap: cap.map(|face| Cap { owner: face.owner, point }),
        }
    }

    /// A sphere's index in the file's own order.
    #[inline]
    pub fn index(&self, slot: u32) -> u32 {
        let (grid, place) = self.locate(slot);
        grid.index(place)
    }
}

/// A surface that a ray has met.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// Where.
    pub point: Vec3,
    /// Unit normal, towards where the ray came from.
    pub normal: Vec3,
    /// Radius of the sphere.
    pub radius: f32,
    /// Its index in the file's own order.
    pub index: u32,
    /// Whether a cut has laid the surface open.
    pub cap: Option<Cap>,
}

/// The first part of the system that `part` belongs to.
pub(crate) fn first_part(systems: &[Spheres<'_>], part: u16) -> u16 {
    let mut first = part;
    while systems.get(first as usize).is_some_and(|s| s.continues) && first > 0 {
        first -= 1;
    }
    first
}

/// Counts of work, for the statistics and the paper's tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Spheres in the cells that packets overlap: culled or tested ("potential tests", Gribble et al.
    /// 2007, Table 5).
    pub spheres: u64,
    /// Those of them that were tested.
    pub tested: u64,
    /// Ray–sphere tests.
    pub tests: u64,
}

impl Counts {
    /// Adds another count.
    pub fn add(&mut self, other: Self) {
        self.spheres += other.spheres;
        self.tested += other.tested;
        self.tests += other.tests;
    }
}

/// Traces the packet through the systems; afterwards each ray holds its nearest hit.
#[simd]
pub fn trace<S: Simd>(simd: S, packet: &mut Packet, systems: &[Spheres<'_>], counts: &mut Counts) {
    let mut whole = 0;
    for (system, spheres) in systems.iter().enumerate() {
        if spheres.continues {
            packet.continue_system(whole);
        } else {
            whole = system as u16;
            packet.begin_system();
        }
        packet.system = whole;
        packet.clip_to(simd, spheres.clip);
        let mut first_slot = 0;
        for (grid, visible) in spheres.classes.grids.iter().zip(spheres.visible) {
            let room = Room { spheres, grid, visible, first_slot, dims: None };
            trace_grid(simd, packet, room, counts);
            first_slot += grid.len() as u32;
        }
        packet.end_part((whole, system as u16));
    }
}

/// Traces the packet through the systems, past whatever is translucent; afterwards each ray holds the
/// optical depth of all it meets within its reach, each sphere counted once.
#[simd]
pub(crate) fn trace_through<S: Simd>(
    simd: S,
    packet: &mut Packet,
    systems: &[Spheres<'_>],
    paint: &dyn Paint,
    counts: &mut Counts,
) {
    for (system, spheres) in systems.iter().enumerate() {
        packet.begin_system();
        packet.clip_to(simd, spheres.clip);
        let dims = Some((paint, system as u16));
        let mut first_slot = 0;
        for (grid, visible) in spheres.classes.grids.iter().zip(spheres.visible) {
            trace_grid(simd, packet, Room { spheres, grid, visible, first_slot, dims }, counts);
            first_slot += grid.len() as u32;
        }
    }
}

/// A grid, where its slots begin in its system, and what is visible of it.
#[derive(Clone, Copy)]
struct Room<'a> {
    spheres: &'a Spheres<'a>,
    grid: &'a Grid,
    visible: &'a Visibility,
    first_slot: u32,
    /// For rays that go through what is translucent: opacities, and the system.
    dims: Option<(&'a dyn Paint, u16)>,
}

/// Cells along K of one step inside a block where K is x: rows along x are runs of particles.
const X_STEP: u32 = 4;

#[simd]
fn trace_grid<S: Simd>(simd: S, packet: &mut Packet, room: Room<'_>, counts: &mut Counts) {
    let grid = room.grid;
    match Frustum::around(packet, grid.low, grid.high, grid.greatest_radius) {
        Bounds::Nothing => {}
        Bounds::Incoherent => {
            for i in 0..packet.rays {
                let mut one = packet.single(i);
                one.pad();
                one.clip_to(simd, room.spheres.clip);
                trace_grid(simd, &mut one, room, counts);
                packet.distance[i] = one.distance[0];
                packet.slot[i] = one.slot[0];
                packet.optical[i] = one.optical[0];
            }
            packet.pad();
        }
        Bounds::Frustum(frustum) => {
            let cull = Cull::new(simd, &frustum);
            let reach = farthest(simd, packet, &frustum);
            Walk { packet, room, frustum, cull, reach, counts }.blocks(simd);
        }
    }
}

/// A packet on its way through a grid.
struct Walk<'a, S: Simd> {
    packet: &'a mut Packet,
    room: Room<'a>,
    frustum: Frustum,
    cull: Cull<S>,
    /// How far along K the rays still look, times the sign of K.
    reach: f32,
    counts: &'a mut Counts,
}

impl<S: Simd> Walk<'_, S> {
    /// Walks the slices of blocks.
    #[inline(always)]
    fn blocks(&mut self, simd: S) {
        let grid = self.room.grid;
        let lattice = &grid.lattice;
        let radius = grid.greatest_radius;
        let [k, u, v] = self.frustum.axes;
        let edge = lattice.edge;
        let at = |axis: usize, value: f32| (value - lattice.low[axis]) / edge;
        let slices =
            Steps::new(at(k, self.frustum.k_start), at(k, self.frustum.k_end), lattice.dims[k]);
        for slice in slices {
            let k0 = lattice.low[k] + slice as f32 * edge;
            let ks = (k0 - self.frustum.pad, k0 + edge + self.frustum.pad);
            if self.beyond(ks, radius) {
                break;
            }
            let (u0, u1) = self.frustum.span(0, ks, radius);
            let (v0, v1) = self.frustum.span(1, ks, radius);
            let Some((u0, u1)) = clip(at(u, u0), at(u, u1), lattice.dims[u]) else { continue };
            let Some((v0, v1)) = clip(at(v, v0), at(v, v1), lattice.dims[v]) else { continue };
            for bv in v0..=v1 {
                for bu in u0..=u1 {
                    let mut block = [0; 3];
                    (block[k], block[u], block[v]) = (slice, bu, bv);
                    self.block(simd, lattice.index(block));
                }
            }
        }
    }

    /// Whether no ray looks as far as spheres with centres in `ks`.
    #[inline(always)]
    fn beyond(&self, ks: (f32, f32), radius: f32) -> bool {
        let nearest = (ks.0 * self.frustum.sign).min(ks.1 * self.frustum.sign);
        nearest - radius - self.frustum.pad > self.reach
    }

    /// Walks the slices of cells of one block.
    #[inline(always)]
    fn block(&mut self, simd: S, index: usize) {
        let grid = self.room.grid;
        let block = &grid.blocks[index];
        let seen = self.room.visible.block(grid, index);
        let [k, u, v] = self.frustum.axes;
        let radius = block.greatest_radius;
        if seen == Seen::Hidden
            || self.beyond((block.low[k], block.high[k]), radius)
            || !self.frustum.meets_box(block.low, block.high, radius)
        {
            return;
        }
        let edge = block.cell_edge;
        let at = |axis: usize, value: f32| (value - block.cell_low[axis]) / edge;
        if self.packet.any_hit && self.covers(block) {
            let particles = grid.particles_of(index);
            return self.run(simd, (particles.start, particles.end), seen, particles.start);
        }
        let step = if k == 0 { X_STEP } else { 1 };
        let slices = block.cells[k].div_ceil(step);
        for slice in Steps::new(
            at(k, self.frustum.k_start) / step as f32,
            at(k, self.frustum.k_end) / step as f32,
            slices,
        ) {
            let first = slice * step;
            let last = (first + step).min(block.cells[k]) - 1;
            let k0 = block.cell_low[k] + first as f32 * edge;
            let k1 = block.cell_low[k] + (last + 1) as f32 * edge;
            let ks = (k0 - self.frustum.pad, k1 + self.frustum.pad);
            if self.beyond(ks, radius) {
                return;
            }
            let (u0, u1) = self.frustum.span(0, ks, radius);
            let (v0, v1) = self.frustum.span(1, ks, radius);
            let Some(us) = clip(at(u, u0), at(u, u1), block.cells[u]) else { continue };
            let Some(vs) = clip(at(v, v0), at(v, v1), block.cells[v]) else { continue };
            let mut ranges = [(0, 0); 3];
            (ranges[k], ranges[u], ranges[v]) = ((first, last), us, vs);
            let [(x0, x1), ys, zs] = ranges;
            for z in zs.0..=zs.1 {
                for y in ys.0..=ys.1 {
                    let row = block.first_cell + (z * block.cells[1] + y) * block.cells[0];
                    let from = grid.cell_starts[(row + x0) as usize] as usize;
                    let to = grid.cell_starts[(row + x1) as usize + 1] as usize;
                    self.run(simd, (from, to), seen, block.first as usize);
                }
            }
        }
    }

    /// Whether the packet is so wide here that its rows of cells are more than what sixteen-wide culling
    /// of the whole block takes. Only for rays that do not look for the nearest hit: walking the cells
    /// finds that one earlier.
    #[inline(always)]
    fn covers(&self, block: &Block) -> bool {
        let [k, u, v] = self.frustum.axes;
        let ks = (block.low[k], block.high[k]);
        let radius = block.greatest_radius;
        let cells = |axis: usize, (low, high): (f32, f32)| {
            let inside = high.min(block.high[axis]) - low.max(block.low[axis]);
            (inside / block.cell_edge).max(0.0) + 1.0
        };
        let across = cells(u, self.frustum.span(0, ks, radius))
            * cells(v, self.frustum.span(1, ks, radius))
            * cells(k, ks);
        // A row is a run of several cells along x.
        let rows = across / if k == 0 { X_STEP as f32 } else { 2.0 };
        // By λ, a block has about as many cells as particles.
        let cells: u32 = block.cells.iter().product();
        rows * LANES as f32 >= cells as f32
    }

    /// Culls and tests the particles of a run of cells.
    #[inline(always)]
    fn run(&mut self, simd: S, (from, to): (usize, usize), seen: Seen<'_>, block_first: usize) {
        let mut slot = from;
        while slot < to {
            let count = (to - slot).min(LANES);
            let mut may = u64::MAX >> (64 - count);
            if let Seen::Mixed(words) = seen {
                may &= bits(words, slot - block_first);
                if may == 0 {
                    // On to the next word that has a bit.
                    let word = (slot + count - block_first) / 64;
                    let empty = words[word..].iter().take_while(|w| **w == 0).count();
                    slot = (slot + count).max(block_first + (word + empty) * 64);
                    continue;
                }
            }
            self.counts.spheres += count as u64;
            if self.packet.culls {
                may &= cull(simd, &self.cull, &self.frustum, (self.room.grid, slot), self.reach);
            }
            self.counts.tested += u64::from(may.count_ones());
            let mut nearer = false;
            while may != 0 {
                let place = slot + may.trailing_zeros() as usize;
                may &= may - 1;
                nearer |= self.test(simd, place);
            }
            if nearer {
                self.reach = farthest(simd, self.packet, &self.frustum);
            }
            slot += count;
        }
    }

    #[inline(always)]
    fn test(&mut self, simd: S, place: usize) -> bool {
        let grid = self.room.grid;
        let sphere = Sphere {
            center: grid.center(place),
            radius: grid.radius_at(place),
            slot: self.room.first_slot + place as u32,
        };
        self.counts.tests += self.packet.rays as u64;
        let spheres = self.room.spheres;
        match self.room.dims {
            None => intersect(simd, self.packet, sphere, &|slot| spheres.index(slot)),
            Some((paint, system)) => dim(simd, self.packet, sphere, &|slot| {
                optical_depth(paint.opacity(system, spheres.index(slot)))
            }),
        }
    }
}

/// Whole numbers from `low` to `high`, both in units of cells, within 0..`cells`; `None` if there are
/// none.
#[inline(always)]
pub(crate) fn clip(low: f32, high: f32, cells: u32) -> Option<(u32, u32)> {
    // A particle on the far face may lie a rounding outside.
    if high < 0.0 || low > cells as f32 * (1.0 + 1e-5) {
        return None;
    }
    // `as` truncates and saturates: below zero is zero.
    Some(((low as u32).min(cells - 1), (high as u32).min(cells - 1)))
}

/// The slices from `start` to `end` (in units of slices, in either direction) within 0..`slices`.
pub(crate) struct Steps {
    next: i64,
    step: i64,
    left: i64,
}

impl Steps {
    #[inline(always)]
    pub fn new(start: f32, end: f32, slices: u32) -> Self {
        let last = i64::from(slices) - 1;
        // Rounding may put either end one slice aside; one more slice on each costs little.
        let forward = end >= start;
        let whole =
            |value: f32, aside: i64| (value.floor() as i64).saturating_add(aside).clamp(0, last);
        if forward {
            let (first, end) = (whole(start, -1), whole(end, 1));
            Self { next: first, step: 1, left: end - first + 1 }
        } else {
            let (first, end) = (whole(start, 1), whole(end, -1));
            Self { next: first, step: -1, left: first - end + 1 }
        }
    }
}

impl Iterator for Steps {
    type Item = u32;

    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        if self.left == 0 {
            return None;
        }
        let slice = self.next as u32;
        self.next += self.step;
        self.left -= 1;
        Some(slice)
    }
}
