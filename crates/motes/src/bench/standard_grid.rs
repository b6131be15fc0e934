//! The grid that the paper compares with (Gribble et al. 2007, Table 4): references to particles in every
//! cell they overlap, mailboxes against testing one twice, and coherent traversal by the frustum as it
//! is (Wald et al. 2006).
//!
//! Cells are cubes of one size, N_x = d_x ∛(λN/V) (§4.2), under macrocells of M³ cells that say whether
//! there is anything.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_spheres::{Bounds, Counts, Frustum, LANES, Packet, Sphere, farthest, intersect};

use super::draw::{Hit, Way, Worker};
use super::single_ray;
use super::timed;

/// Which cells hold a reference to a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Insert {
    /// All that its sphere overlaps.
    Overlapped,
    /// That of its centre: only to compare what insertion costs.
    Center,
}

/// How to build a [`StandardGrid`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Params {
    pub insert: Insert,
    /// λ, cells per particle.
    pub lambda: f64,
    /// M, cells along a macrocell's edge.
    pub block: usize,
}

/// References to particles in uniform cells.
pub(super) struct StandardGrid {
    pub low: Vec3,
    pub high: Vec3,
    /// Edge of a cell.
    pub edge: f32,
    pub dims: [usize; 3],
    pub block: usize,
    pub block_dims: [usize; 3],
    /// Whether a macrocell holds any reference, x fastest.
    pub occupied: Vec<bool>,
    /// Where each cell's references begin, x fastest, and their number at the end.
    pub starts: Vec<u32>,
    pub references: Vec<u32>,
    /// x, y, z and radius in the file's order.
    pub spheres: Vec<[f32; 4]>,
}

/// Milliseconds of construction on one thread.
#[derive(Clone, Copy, Debug)]
pub(super) struct BuildMs {
    pub all: f64,
    pub insertion: f64,
}

impl StandardGrid {
    /// Builds the grid over particles of one radius, and tells how long it took.
    pub fn build(positions: &[[f32; 3]], radius: f32, params: Params) -> (Self, BuildMs) {
        let (all, (grid, insertion)) = timed(|| {
            let mut grid = Self::bounded(positions, radius, params);
            let (insertion, ()) = timed(|| grid.insert(params.insert));
            grid.occupied = grid.occupancy();
            (grid, insertion)
        });
        (grid, BuildMs { all, insertion })
    }

    /// The empty grid around the particles.
    fn bounded(positions: &[[f32; 3]], radius: f32, params: Params) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let mut spheres = Vec::with_capacity(positions.len());
        for [x, y, z] in positions {
            let p = Vec3::new(*x, *y, *z);
            (low, high) = (low.min(p), high.max(p));
            spheres.push([*x, *y, *z, radius]);
        }
        if positions.is_empty() {
            (low, high) = (Vec3::ZERO, Vec3::ZERO);
        }
        (low, high) = (low - radius, high + radius);
        let extent = (high - low).as_dvec3();
        let volume = extent.x * extent.y * extent.z;
        let edge = (volume / (params.lambda * positions.len().max(1) as f64)).cbrt() as f32;
        let dims = extent.to_array().map(|d| ((d as f32 / edge).ceil() as usize).max(1));
        let block_dims = dims.map(|d| d.div_ceil(params.block));
        Self {
            low,
            high,
            edge,
            dims,
            block: params.block,
            block_dims,
            occupied: Vec::new(),
            starts: vec![0; dims.iter().product::<usize>() + 1],
            references: Vec::new(),
            spheres,
        }
    }

    /// Counts, then places: a counting sort of all references.
    fn insert(&mut self, insert: Insert) {
        let mut starts = std::mem::take(&mut self.starts);
        for sphere in &self.spheres {
            self.cells_of(*sphere, insert, |cell| starts[cell] += 1);
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += std::mem::replace(start, sum);
        }
        let mut references = vec![0; sum as usize];
        for (id, sphere) in self.spheres.iter().enumerate() {
            self.cells_of(*sphere, insert, |cell| {
                references[starts[cell] as usize] = id as u32;
                starts[cell] += 1;
            });
        }
        // Each start has moved to its cell's end, which is the next cell's start.
        starts.rotate_right(1);
        starts[0] = 0;
        (self.starts, self.references) = (starts, references);
    }

    /// Tells `to` the cells that hold a sphere.
    #[inline(always)]
    fn cells_of(&self, [x, y, z, radius]: [f32; 4], insert: Insert, mut to: impl FnMut(usize)) {
        let center = Vec3::new(x, y, z) - self.low;
        let place = |v: f32, axis: usize| ((v / self.edge) as usize).min(self.dims[axis] - 1);
        if insert == Insert::Center {
            let [x, y, z] = [0, 1, 2].map(|axis| place(center[axis], axis));
            return to(self.index([x, y, z]));
        }
        // A hair wider, so that rounding on the way of a ray misses none.
        let radius = radius + 2e-3 * self.edge;
        let range =
            |axis: usize| (place(center[axis] - radius, axis), place(center[axis] + radius, axis));
        let (xs, ys, zs) = (range(0), range(1), range(2));
        // Squared distance from the centre to the cell along one axis.
        let off = |axis: usize, cell: usize| {
            let low = cell as f32 * self.edge - center[axis];
            let off = low.max(-(low + self.edge)).max(0.0);
            off * off
        };
        let r2 = radius * radius;
        for z in zs.0..=zs.1 {
            let off_z = off(2, z);
            for y in ys.0..=ys.1 {
                let off_yz = off_z + off(1, y);
                for x in xs.0..=xs.1 {
                    if off_yz + off(0, x) <= r2 {
                        to(self.index([x, y, z]));
                    }
                }
            }
        }
    }

    fn occupancy(&self) -> Vec<bool> {
        let mut occupied = vec![false; self.block_dims.iter().product()];
        let [nx, ny, _] = self.dims;
        let [bx, by, _] = self.block_dims;
        for (cell, _) in self.starts.windows(2).enumerate().filter(|(_, p)| p[0] < p[1]) {
            let [x, y, z] = [cell % nx, cell / nx % ny, cell / nx / ny].map(|c| c / self.block);
            occupied[(z * by + y) * bx + x] = true;
        }
        occupied
    }

    /// The place of a cell in the list of cells.
    #[inline(always)]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Whether a macrocell holds anything.
    #[inline(always)]
    pub fn is_occupied(&self, [x, y, z]: [usize; 3]) -> bool {
        self.occupied[(z * self.block_dims[1] + y) * self.block_dims[0] + x]
    }

    /// Bytes beyond the particles' own.
    pub fn structure_bytes(&self) -> usize {
        (self.starts.len() + self.references.len()) * 4 + self.occupied.len()
    }

    pub fn hit(&self, distance: f32, id: u32) -> Hit {
        let [x, y, z, radius] = self.spheres[id as usize];
        Hit { distance, center: Vec3::new(x, y, z), radius }
    }
}

/// Which particles a packet has met lately (inverse mailboxes: the packet remembers, not the particle).
pub(super) struct Mailbox([u32; Self::SIZE]);

impl Mailbox {
    const SIZE: usize = 1024;

    pub fn new() -> Self {
        Self([u32::MAX; Self::SIZE])
    }

    fn clear(&mut self) {
        self.0.fill(u32::MAX);
    }

    /// Whether `id` is new to the packet.
    #[inline(always)]
    fn admits(&mut self, id: u32) -> bool {
        // Neighbours in the file fall into different boxes.
        std::mem::replace(&mut self.0[id as usize % Self::SIZE], id) != id
    }
}

/// Coherent traversal of the standard grid.
pub(super) struct Standard<'a> {
    pub grid: &'a StandardGrid,
    pub level: Level,
}

impl Way for Standard<'_> {
    fn trace(&self, rays: &[(Vec3, Vec3)], worker: &mut Worker) {
        worker.packet.clear();
        rays.iter().for_each(|(origin, direction)| worker.packet.push(*origin, *direction));
        worker.packet.begin_system();
        let grid = self.grid;
        match Frustum::around(&worker.packet, grid.low, grid.high, 0.0) {
            Bounds::Nothing => worker.hits.extend(rays.iter().map(|_| None)),
            Bounds::Incoherent => {
                dispatch!(self.level, simd => single_ray::trace(simd, grid, rays, worker));
            }
            Bounds::Frustum(frustum) => {
                worker.mailbox.clear();
                let Worker { packet, mailbox, counts, .. } = worker;
                dispatch!(self.level, simd => walk(simd, (grid, &frustum), packet, (mailbox, counts)));
                packet.end_system(0);
                worker.hits.extend((0..rays.len()).map(|i| {
                    let (distance, _, id) = packet.hit(i)?;
                    Some(grid.hit(distance, id))
                }));
            }
        }
    }
}

#[simd]
fn walk<S: Simd>(
    simd: S,
    (grid, frustum): (&StandardGrid, &Frustum),
    packet: &mut Packet,
    (mailbox, counts): (&mut Mailbox, &mut Counts),
) {
    let reach = farthest(simd, packet, frustum);
    Walk { grid, frustum, packet, mailbox, counts, reach, batch: Batch::new() }.blocks(simd);
}

/// Up to sixteen spheres to be culled together.
struct Batch {
    /// x, y, z, radius.
    spheres: [[f32; LANES]; 4],
    ids: [u32; LANES],
    len: usize,
}

impl Batch {
    fn new() -> Self {
        Self { spheres: [[0.0; LANES]; 4], ids: [0; LANES], len: 0 }
    }
}

/// A packet on its way.
struct Walk<'a> {
    grid: &'a StandardGrid,
    frustum: &'a Frustum,
    packet: &'a mut Packet,
    mailbox: &'a mut Mailbox,
    counts: &'a mut Counts,
    /// How far along K the rays still look, times the sign of K.
    reach: f32,
    batch: Batch,
}

impl Walk<'_> {
    /// Slices of macrocells, in the order of travel.
    #[inline(always)]
    fn blocks<S: Simd>(&mut self, simd: S) {
        let grid = self.grid;
        let edge = grid.edge * grid.block as f32;
        let [k, u, v] = self.frustum.axes;
        for slice in self.slices(edge, (0, grid.block_dims[k])) {
            let Some((us, vs)) = self.rectangle(slice, edge, grid.block_dims) else { continue };
            if self.beyond(slice, edge) {
                return;
            }
            for bv in vs.0..=vs.1 {
                for bu in us.0..=us.1 {
                    let mut block = [0; 3];
                    (block[k], block[u], block[v]) = (slice, bu, bv);
                    if grid.is_occupied(block) {
                        self.cells(simd, block);
                    }
                }
            }
        }
    }

    /// Slices of the cells of one macrocell.
    #[inline(always)]
    fn cells<S: Simd>(&mut self, simd: S, block: [usize; 3]) {
        let grid = self.grid;
        let [k, u, v] = self.frustum.axes;
        let low = |axis: usize| block[axis] * grid.block;
        let high = |axis: usize| (low(axis) + grid.block).min(grid.dims[axis]);
        for slice in self.slices(grid.edge, (low(k), high(k))) {
            if self.beyond(slice, grid.edge) {
                return;
            }
            let Some((us, vs)) = self.rectangle(slice, grid.edge, grid.dims) else { continue };
            let mut ranges = [(0, 0); 3];
            ranges[k] = (slice, slice);
            ranges[u] = (us.0.max(low(u)), us.1.min(high(u) - 1));
            ranges[v] = (vs.0.max(low(v)), vs.1.min(high(v) - 1));
            let [xs, ys, zs] = ranges;
            if xs.0 > xs.1 {
                continue;
            }
            for z in zs.0..=zs.1 {
                for y in ys.0..=ys.1 {
                    let row = grid.index([0, y, z]);
                    let from = grid.starts[row + xs.0] as usize;
                    let to = grid.starts[row + xs.1 + 1] as usize;
                    self.run(simd, from, to);
                }
            }
            self.flush(simd);
        }
    }

    /// The slices of the frustum among `first..end`, in the order of travel.
    #[inline(always)]
    fn slices(
        &self,
        edge: f32,
        (first, end): (usize, usize),
    ) -> impl Iterator<Item = usize> + use<> {
        let k = self.frustum.axes[0];
        let at = |value: f32| ((value - self.grid.low[k]) / edge) as usize;
        let (a, b) = (at(self.frustum.k_start), at(self.frustum.k_end));
        // Rounding may put either end one slice aside.
        let low = a.min(b).saturating_sub(1).max(first);
        let high = (a.max(b) + 2).min(end).max(low);
        let forward = self.frustum.sign > 0.0;
        (0..high - low).map(move |i| if forward { low + i } else { high - 1 - i })
    }

    /// Where slice `slice` lies along K.
    #[inline(always)]
    fn along(&self, slice: usize, edge: f32) -> (f32, f32) {
        let low = self.grid.low[self.frustum.axes[0]] + slice as f32 * edge;
        (low - self.frustum.pad, low + edge + self.frustum.pad)
    }

    /// Whether all rays have hit something before the slice.
    #[inline(always)]
    fn beyond(&self, slice: usize, edge: f32) -> bool {
        let (low, high) = self.along(slice, edge);
        (low * self.frustum.sign).min(high * self.frustum.sign) > self.reach
    }

    /// What the frustum overlaps of a slice.
    #[inline(always)]
    fn rectangle(&self, slice: usize, edge: f32, dims: [usize; 3]) -> Option<(Span, Span)> {
        let ks = self.along(slice, edge);
        let clip = |side: usize| {
            let axis = self.frustum.axes[side + 1];
            let (low, high) = self.frustum.span(side, ks, 0.0);
            let (low, high) = (low - self.grid.low[axis], high - self.grid.low[axis]);
            let cells = dims[axis];
            if high < 0.0 || low > cells as f32 * edge {
                return None;
            }
            // `as` truncates and saturates: below zero is zero.
            Some((((low / edge) as usize).min(cells - 1), ((high / edge) as usize).min(cells - 1)))
        };
        Some((clip(0)?, clip(1)?))
    }

    /// The references of a run of cells.
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, from: usize, to: usize) {
        for i in from..to {
            let id = self.grid.references[i];
            if !self.mailbox.admits(id) {
                continue;
            }
            let sphere = self.grid.spheres[id as usize];
            let at = self.batch.len;
            for (lanes, value) in self.batch.spheres.iter_mut().zip(sphere) {
                lanes[at] = value;
            }
            self.batch.ids[at] = id;
            self.batch.len += 1;
            if self.batch.len == LANES {
                self.flush(simd);
            }
        }
    }

    /// Culls the batch and tests what remains.
    #[inline(always)]
    fn flush<S: Simd>(&mut self, simd: S) {
        let len = std::mem::take(&mut self.batch.len);
        if len == 0 {
            return;
        }
        let mut may = cull(simd, self.frustum, &self.batch, self.reach) & u64::MAX >> (64 - len);
        self.counts.spheres += len as u64;
        self.counts.tested += u64::from(may.count_ones());
        let mut nearer = false;
        while may != 0 {
            let lane = may.trailing_zeros() as usize;
            may &= may - 1;
            let [x, y, z, radius] = self.batch.spheres.map(|lanes| lanes[lane]);
            let sphere = Sphere { center: Vec3::new(x, y, z), radius, slot: self.batch.ids[lane] };
            self.counts.tests += self.packet.len() as u64;
            nearer |= intersect(simd, self.packet, sphere, &|id| id);
        }
        if nearer {
            self.reach = farthest(simd, self.packet, self.frustum);
        }
    }
}

/// First and last cell.
type Span = (usize, usize);

/// Which of the batch's spheres may be met: as Motes' own culling.
#[inline(always)]
fn cull<S: Simd>(simd: S, frustum: &Frustum, batch: &Batch, reach: f32) -> u64 {
    let splat = |value: f32| f32x16::splat(simd, value);
    let [k, u, v] = frustum.axes;
    let [k, u, v] = [&batch.spheres[k], &batch.spheres[u], &batch.spheres[v]];
    let (k, u, v) =
        (f32x16::from_slice(simd, k), f32x16::from_slice(simd, u), f32x16::from_slice(simd, v));
    let radius = f32x16::from_slice(simd, &batch.spheres[3]);
    let along = k - splat(frustum.k_start);
    let pad = splat(frustum.pad);
    let [u_low, u_high, v_low, v_high] = [0, 1, 2, 3];
    let plane = |i: usize| splat(frustum.slope[i]).mul_add(along, splat(frustum.at_start[i]));
    let u_shift = radius.mul_add(splat(frustum.widen[0]), pad);
    let v_shift = radius.mul_add(splat(frustum.widen[1]), pad);
    let in_u = (u + u_shift).simd_ge(plane(u_low)) & (u - u_shift).simd_le(plane(u_high));
    let in_v = (v + v_shift).simd_ge(plane(v_low)) & (v - v_shift).simd_le(plane(v_high));
    let near = (k * splat(frustum.sign) - radius - pad).simd_le(splat(reach));
    (in_u & in_v & near).to_bitmask()
}
