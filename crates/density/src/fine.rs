//! The fine field: each particle adds its density to the voxels in its reach.
//!
//! Yasuda et al. 2009, §4.2.2–4.2.4. The density of a particle is W(r/R) ([`crate::kernel`]). Where a mask says
//! that a side is filled, R shrinks towards it,
//!
//! > R₊ₓ = R + (R_min − R)·min(P₊ₓ / P_filled, P±y / P_filled, P±z / P_filled, 1),
//!
//! as far as the sides around it are filled, too: else the density beside an edge would shrink along it, and the
//! surface sink; q = Σ (x / R±ₓ)² takes the place of (r/R)²: an eighth of an ellipsoid in each octant. Saturated
//! voxels are not changed. Without both this is the plain field, every particle into every voxel in its reach, by
//! the same code.
//!
//! All particles of a cell reach the same few nodes: these are added up in registers, a block of them at a time,
//! and then to the field. With c the cube root of the amplitude, a particle adds max(c − c·q, 0)³.

use fearless_simd::{f32x4, f32x8, f32x16, prelude::*};
use fearless_simd_macros::simd;
use motes_grid::Radii;

use crate::bins::{Entry, Tiles, sort};
use crate::kernel::height;
use crate::lanes::LANES;
use crate::lattice::{Lattice, reach};
use crate::params::{Params, Particles};
use crate::rough::Rough;

/// The mask of a side that is filled at rest.
const FILLED: f32 = 0.63;
/// Reach towards a filled side, in voxels: with less, holes open between the voxels of particles.
const LEAST_REACH: f32 = 1.7;
/// Nodes of a block along x at the most: rows are so much longer.
pub(crate) const WIDE: usize = 8;
/// Nodes of a block along z at the most.
const HIGH: usize = 8;
/// Particles of a cell that are added up together at the most: there is room for so many.
const MOST_TOGETHER: usize = 1 << 10;

/// What densities are made from.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub particles: Particles<'a>,
    pub lattice: &'a Lattice,
    pub params: &'a Params,
    pub rough: Option<&'a Rough>,
    /// Where all have the same.
    uniform: Option<Spread>,
}

/// How the density of a particle spreads, in voxels.
#[derive(Clone, Copy)]
struct Spread {
    reach: f32,
    /// The cube root of the amplitude.
    height: f32,
    /// That over the square of the reach.
    steep: f32,
}

/// A tile's particles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Desk {
    /// By cell, x fastest, then y.
    entries: Vec<Entry>,
    /// First entry of each cell, and their number.
    starts: Vec<u32>,
    /// Entries and their cells, before they are sorted.
    unsorted: Vec<Entry>,
    keys: Vec<u32>,
    /// First cell, along y and z, cells along x, and along y and z.
    first: [usize; 2],
    across: usize,
    wide: [usize; 2],
    /// Those of one cell.
    bumps: Vec<Bump>,
    /// Voxels written.
    pub updates: u64,
    /// Particles that were not skipped.
    pub visits: u64,
}

/// The rows that particles of a tile reach, y fastest, and where they are.
pub(crate) struct Rows<'a> {
    pub rows: Vec<&'a mut [f32]>,
    /// The first along y and z, and how many there are along y.
    pub first: [usize; 2],
    pub along: usize,
}

/// The density of one particle, in voxels.
#[derive(Clone, Copy, Debug, Default)]
struct Bump {
    /// Its place in the cell.
    at: [f32; 3],
    /// The cube root of its amplitude.
    height: f32,
    /// That over the square of its reach to the lower and to the higher side.
    steep: [[f32; 2]; 3],
    /// What is taken from the height at the nodes along z of a block.
    down: [f32; HIGH],
    /// It reaches nodes less than so many from its cell.
    half: u32,
}

impl Bump {
    /// Those of one class are added up together: of others, small ones would go through all that large ones reach.
    #[inline(always)]
    fn class(&self) -> u32 {
        self.half.max(4).ilog2()
    }

    /// Looks at the nodes from `first` on, counted from that of the cell.
    #[inline(always)]
    fn look_down<S: Simd, const MASKED: bool>(&mut self, simd: S, first: f32) {
        let z = f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) + first;
        let [low, high] = self.steep[2];
        let (low, high) = (f32x8::splat(simd, low), f32x8::splat(simd, high));
        let steep = match MASKED {
            true => z.simd_le(f32x8::splat(simd, 0.0)).select(low, high),
            false => low,
        };
        let d = z - self.at[2];
        (d * d * steep).store_slice(&mut self.down);
    }
}

impl<'a> Source<'a> {
    pub fn new(
        particles: Particles<'a>,
        (lattice, params): (&'a Lattice, &'a Params),
        rough: Option<&'a Rough>,
    ) -> Self {
        let mut source = Self { particles, lattice, params, rough, uniform: None };
        if let Radii::Uniform(radius) = particles.radii {
            source.uniform = Some(source.spread(radius));
        }
        source
    }

    /// That of a particle of some radius.
    #[inline(always)]
    fn spread(&self, radius: f32) -> Spread {
        let voxel = self.lattice.voxel;
        let reach = reach(radius, voxel, self.params) / voxel;
        let height = height(radius / voxel, reach);
        Spread { reach, height, steep: height / (reach * reach) }
    }

    /// The density of a particle in a cell.
    #[inline(always)]
    fn bump<const MASKED: bool>(&self, entry: &Entry, cell: [f32; 3]) -> Bump {
        let index = entry.index as usize;
        let spread = match self.uniform {
            Some(same) => same,
            None => self.spread(self.particles.radius(index)),
        };
        let Spread { reach: far, height, steep } = spread;
        let [x, y, z] = entry.at;
        let at = [x - cell[0], y - cell[1], z - cell[2]];
        let mut bump = Bump { at, height, steep: [[steep; 2]; 3], ..Bump::default() };
        let mut greatest = far;
        if MASKED && let Some(masks) = self.particles.masks {
            let (mask, least) = (&masks[index], LEAST_REACH.min(far));
            let both = |axis: usize| mask[2 * axis].min(mask[2 * axis + 1]);
            let [x, y, z] = [both(0), both(1), both(2)];
            let side = |side: usize, around: f32| {
                let filled = (mask[side].min(around) * (1.0 / FILLED)).clamp(0.0, 1.0);
                far + (least - far) * filled
            };
            let sides = [
                [side(1, y.min(z)), side(0, y.min(z))],
                [side(3, z.min(x)), side(2, z.min(x))],
                [side(5, x.min(y)), side(4, x.min(y))],
            ];
            greatest = 0.0;
            for axis in 0..3 {
                for side in 0..2 {
                    let r = sides[axis][side];
                    bump.steep[axis][side] = height / (r * r);
                    greatest = r.max(greatest);
                }
            }
        }
        bump.half = greatest.ceil() as u32;
        bump
    }
}

impl Desk {
    /// Takes the particles of a tile, and the cells that they are in, whose first rows are `first`, and sorts
    /// them.
    pub fn sort<'a>(
        &mut self,
        parts: impl Iterator<Item = (&'a [Entry], &'a [u32])> + Clone,
        (lattice, tiles): (&Lattice, Tiles),
        first: [usize; 2],
    ) {
        (self.first, self.across) = (first, lattice.dims[0]);
        self.wide = [0, 1].map(|a| tiles.edge.min(lattice.dims[a + 1] - first[a]));
        let (entries, unsorted, cells) = (&mut self.entries, &mut self.unsorted, &mut self.keys);
        unsorted.clear();
        cells.clear();
        for (some, own) in parts {
            unsorted.extend_from_slice(some);
            cells.extend_from_slice(own);
        }
        entries.resize(cells.len(), Entry::default());
        let all = self.across * self.wide[0] * self.wide[1];
        let count = if cells.is_empty() { 0 } else { all };
        let from = cells.iter().copied().zip(unsorted.iter().copied());
        sort(&mut self.starts, count, from, entries);
    }

    /// The rows of cells that have particles.
    #[inline(always)]
    pub fn rows(&self) -> impl Iterator<Item = Cells<'_>> {
        let starts = self.starts.windows(self.across + 1).step_by(self.across.max(1));
        let [along, beside] = self.wide;
        let place = move |row: usize| [self.first[0] + row % along, self.first[1] + row / along];
        let rows = starts.take(along * beside).enumerate();
        rows.filter(|(_, starts)| starts[0] < starts[starts.len() - 1])
            .map(move |(row, starts)| Cells { at: place(row), starts, entries: &self.entries })
    }
}

/// A row of cells, and the particles in them.
pub(crate) struct Cells<'a> {
    /// Along y and z.
    pub at: [usize; 2],
    starts: &'a [u32],
    entries: &'a [Entry],
}

impl<'a> Cells<'a> {
    /// How many there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The particles in one.
    #[inline(always)]
    pub fn of(&self, x: usize) -> &'a [Entry] {
        &self.entries[self.starts[x] as usize..self.starts[x + 1] as usize]
    }
}

/// Adds the densities of a tile's particles to the rows that they reach.
#[simd]
pub(crate) fn add<S: Simd, const MASKED: bool, const SATURATES: bool, const COUNTED: bool>(
    simd: S,
    source: &Source<'_>,
    desk: &mut Desk,
    rows: &mut Rows<'_>,
) {
    let mut bumps = std::mem::take(&mut desk.bumps);
    let (mut visits, mut updates) = (0, 0);
    for row in desk.rows() {
        for x in 0..row.len() {
            let (cell, own) = ([x, row.at[0], row.at[1]], row.of(x));
            if own.is_empty() || source.rough.is_some_and(|rough| rough.is_core(cell)) {
                continue;
            }
            visits += own.len() as u64;
            let corner = [cell[0] as f32, cell[1] as f32, cell[2] as f32];
            for own in own.chunks(MOST_TOGETHER) {
                bumps.clear();
                for entry in own {
                    bumps.push(source.bump::<MASKED>(entry, corner));
                }
                if source.uniform.is_none() {
                    bumps.sort_by_key(Bump::class);
                }
                for some in bumps.chunk_by_mut(|a, b| a.class() == b.class()) {
                    let made = (some, cell);
                    let limit = source.params.saturation;
                    updates += of_cell::<S, MASKED, SATURATES, COUNTED>(simd, made, limit, rows);
                }
            }
        }
    }
    (desk.bumps, desk.visits, desk.updates) = (bumps, visits, updates);
}

/// Adds the densities of particles of a cell to the nodes that they reach; how many are written, if counted.
#[inline(always)]
fn of_cell<S: Simd, const MASKED: bool, const SATURATES: bool, const COUNTED: bool>(
    simd: S,
    made: (&mut [Bump], [usize; 3]),
    limit: f32,
    rows: &mut Rows<'_>,
) -> u64 {
    let mut half = 0;
    for bump in &*made.0 {
        half = bump.half.max(half);
    }
    let near = (half as usize, limit);
    match half {
        ..=2 => in_blocks::<S, 4, 4, MASKED, SATURATES, COUNTED>(simd, made, near, rows),
        3 => in_blocks::<S, 8, 6, MASKED, SATURATES, COUNTED>(simd, made, near, rows),
        _ => in_blocks::<S, 8, 8, MASKED, SATURATES, COUNTED>(simd, made, near, rows),
    }
}

/// Adds the densities of a cell's particles, block by block, to all nodes less than `half` from it; how many are
/// written, if counted.
#[inline(always)]
fn in_blocks<
    S: Simd,
    const X: usize,
    const Z: usize,
    const MASKED: bool,
    const SATURATES: bool,
    const COUNTED: bool,
>(
    simd: S,
    (bumps, cell): (&mut [Bump], [usize; 3]),
    (half, limit): (usize, f32),
    rows: &mut Rows<'_>,
) -> u64 {
    let (first, nodes, mut written) = (1 - half as i32, 2 * half, 0);
    // The density of a particle ends within the lattice.
    let from = |at: usize| at.saturating_sub(half - 1);
    let begin = [from(cell[0]), from(cell[1] - rows.first[0]), from(cell[2] - rows.first[1])];
    for z in (0..nodes).step_by(Z) {
        for bump in &mut *bumps {
            bump.look_down::<S, MASKED>(simd, (first + z as i32) as f32);
        }
        for y in (0..nodes).step_by(LANES / X) {
            for x in (0..nodes).step_by(X) {
                let at = [begin[0] + x, begin[1] + y, begin[2] + z];
                let from = [first + x as i32, first + y as i32, first + z as i32];
                let mut open = [0xffff; Z];
                if COUNTED && SATURATES {
                    open = rows.below::<X, Z>(at, limit);
                }
                let (sums, some) = sum::<S, X, Z, MASKED, COUNTED>(simd, bumps, (from, open));
                written += some;
                for k in 0..Z.min(nodes - z) {
                    let at = [at[0], at[1], at[2] + k];
                    rows.add::<S, X, SATURATES>(simd, at, (sums[k], limit));
                }
            }
        }
    }
    written
}

/// What particles add to the nodes of a block: X along x, so many along y that they are a vector, Z along z;
/// and how many of those in `open` are written, one after the other, if counted.
#[inline(always)]
fn sum<S: Simd, const X: usize, const Z: usize, const MASKED: bool, const COUNTED: bool>(
    simd: S,
    bumps: &[Bump],
    (from, open): ([i32; 3], [u64; Z]),
) -> ([f32x16<S>; Z], u64) {
    let mut places = [[0.0; LANES]; 2];
    for i in 0..LANES {
        places[0][i] = (from[0] + (i % X) as i32) as f32;
        places[1][i] = (from[1] + (i / X) as i32) as f32;
    }
    let zero = f32x16::splat(simd, 0.0);
    let x = f32x16::from_slice(simd, &places[0]);
    let y = f32x16::from_slice(simd, &places[1]);
    let (mut sums, mut written) = ([zero; Z], 0);
    for bump in bumps {
        let (dx, dy) = (x - bump.at[0], y - bump.at[1]);
        let across = match MASKED {
            true => {
                let [along, beside, _] = bump.steep;
                dx * dx * side(simd, along, x) + dy * dy * side(simd, beside, y)
            }
            false => (dx * dx + dy * dy) * bump.steep[0][0],
        };
        let left = f32x16::splat(simd, bump.height) - across;
        for k in 0..Z {
            let w = (left - bump.down[k]).max(zero);
            sums[k] += w * w * w;
            if COUNTED {
                written += u64::from((w.simd_gt(zero).to_bitmask() & open[k]).count_ones());
            }
        }
    }
    (sums, written)
}

/// Of two numbers the one of the side that each node is on.
#[inline(always)]
fn side<S: Simd>(simd: S, [low, high]: [f32; 2], node: f32x16<S>) -> f32x16<S> {
    let below = node.simd_le(f32x16::splat(simd, 0.0));
    below.select(f32x16::splat(simd, low), f32x16::splat(simd, high))
}

impl Rows<'_> {
    /// The numbers of a row from a node on; none if it has not so many.
    #[inline(always)]
    fn part<const X: usize>(&mut self, [x, y, z]: [usize; 3]) -> Option<&mut [f32; X]> {
        let row = self.rows.get_mut(z * self.along + y)?;
        row.get_mut(x..x + X)?.first_chunk_mut()
    }

    /// Adds to the nodes of a layer of a block, up to a limit if it `SATURATES`.
    #[inline(always)]
    fn add<S: Simd, const X: usize, const SATURATES: bool>(
        &mut self,
        simd: S,
        [x, y, z]: [usize; 3],
        (more, limit): (f32x16<S>, f32),
    ) {
        let most = f32x8::splat(simd, limit);
        let (one, other) = more.split();
        for (half, more) in [one, other].into_iter().enumerate() {
            if X == WIDE {
                let Some(part) = self.part::<WIDE>([x, y + half, z]) else { continue };
                let before = f32x8::from_slice(simd, part);
                let after = before + more;
                let after = if SATURATES { after.min(most).max(before) } else { after };
                after.store_slice(part);
            } else {
                let (one, other) = more.split();
                let (most, _) = most.split();
                for (quarter, more) in [one, other].into_iter().enumerate() {
                    let at = [x, y + 2 * half + quarter, z];
                    let Some(part) = self.part::<4>(at) else { continue };
                    let before = f32x4::from_slice(simd, part);
                    let after = before + more;
                    let after = if SATURATES { after.min(most).max(before) } else { after };
                    after.store_slice(part);
                }
            }
        }
    }

    /// Which nodes of a block are below a limit.
    fn below<const X: usize, const Z: usize>(
        &mut self,
        [x, y, z]: [usize; 3],
        limit: f32,
    ) -> [u64; Z] {
        let mut open = [0; Z];
        for k in 0..Z {
            for i in 0..LANES {
                let part = self.part::<1>([x + i % X, y + i / X, z + k]);
                open[k] |= u64::from(part.is_some_and(|v| v[0] < limit)) << i;
            }
        }
        open
    }
}
