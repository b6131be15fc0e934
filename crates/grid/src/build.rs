//! Construction: two counting sorts, parallel, with the same result for any number of threads.
//!
//! Gribble et al. 2007, §4.2, build by *sort-middle* (Ize et al. 2006): a coarse bucket sort, then
//! each thread inserts the particles of its own buckets. Here a bucket is a run of blocks. The first
//! sort scatters particles into buckets that fit the cache; the second, within the bucket, orders
//! them by block and cell. Both are stable, so that the order within a cell is the file's.

use glam::Vec3;
use rayon::prelude::*;

use crate::groups::groups_of;
use crate::lattice::edge_for_count;
use crate::{Block, Grid, Lattice, Particle, Radii};

/// How fine a grid is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// λ, cells per particle (Gribble et al. 2007, §4.2), for tracing.
    CellsPerParticle(f32),
    /// Edge length of a cell, for neighbours and fullness.
    CellEdge(f32),
}

/// How to build a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// How fine.
    pub resolution: Resolution,
    /// M, cells along a block's edge where particles are evenly spread.
    pub block_cells: u32,
}

impl Default for Params {
    /// λ = 1 and M = 6, Gribble's choice (§5).
    fn default() -> Self {
        Self { resolution: Resolution::CellsPerParticle(1.0), block_cells: 6 }
    }
}

/// A cell is at least this many greatest radii wide: finer cells would only be visited, not culled by.
const LEAST_CELL_EDGE_RADII: f32 = 1.0;
/// Cells with more particles than this are searched for coinciding ones.
const CROWDED_CELL: usize = 64;
/// Particles per bucket of the first sort, so that the second runs in cache.
const BUCKET_PARTICLES: usize = 16 * 1024;
/// Most buckets of the first sort: more streams than this defeat the address translation cache.
const MOST_BUCKETS: usize = 1024;
/// Pieces the first sort is cut into. Fixed, though the result does not depend on it.
const CHUNKS: usize = 16;

impl Grid {
    /// Builds a grid over those of `positions` that `chosen` lists (all, if `None`).
    ///
    /// `radii` is in the order of `positions`. Particles whose position is not finite are left out.
    ///
    /// # Panics
    /// If there are more than 2³² − 2 positions, or radii and positions differ in number.
    pub fn build(
        positions: &[[f32; 3]],
        radii: Radii<&[f32]>,
        chosen: Option<&[u32]>,
        params: Params,
    ) -> Self {
        assert!(positions.len() < u32::MAX as usize, "too many particles for 32-bit indices");
        if let Radii::Each(each) = radii {
            assert_eq!(each.len(), positions.len(), "one radius per position");
        }
        let source = Source { positions, chosen };
        let (low, high, count) = source.bounds();
        if count == 0 {
            return Self::empty();
        }
        let lattice = lattice_for(low, high, count, params);
        let (items, bucket_starts) = sort_into_buckets(&source, &lattice, count);
        Self::from_buckets(&items, &bucket_starts, lattice, (radii, params))
    }

    /// A grid without particles.
    pub fn empty() -> Self {
        Self {
            lattice: Lattice { low: Vec3::ZERO, edge: 1.0, dims: [1, 1, 1] },
            blocks: vec![Block::default(); 2],
            cell_starts: vec![0],
            groups: Vec::new(),
            particles: Vec::new(),
            radius: Radii::Uniform(0.0),
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            least_radius: 0.0,
            greatest_radius: 0.0,
            crowded: Vec::new(),
        }
    }

    /// The second sort: every bucket by itself.
    fn from_buckets(
        items: &[Particle],
        bucket_starts: &[usize],
        lattice: Lattice,
        (radii, params): (Radii<&[f32]>, Params),
    ) -> Self {
        let buckets = bucket_starts.len() - 1;
        let block_starts: Vec<usize> =
            (0..=buckets).map(|b| first_block(b, buckets, lattice.count())).collect();
        let mut blocks = vec![Block::default(); lattice.count() + 1];

        // Count, then choose each block's cells, then know where everything goes.
        split(&mut blocks, &block_starts).into_par_iter().enumerate().for_each(|(b, blocks)| {
            let bucket = &items[bucket_starts[b]..bucket_starts[b + 1]];
            measure_blocks(bucket, &lattice, block_starts[b], blocks, radii);
        });
        let mut particles = 0;
        let mut cells = 0;
        for (b, block) in blocks.iter_mut().enumerate() {
            block.cell_low = lattice.corner(lattice.block_at(b));
            block.cell_edge = lattice.edge / params.block_cells.max(1) as f32;
            // `first` holds the count until here.
            let count = std::mem::replace(&mut block.first, particles);
            block.first_cell = cells;
            divide(block, count, params, f64::from(lattice.edge));
            particles += count;
            cells += block.cells.iter().product::<u32>();
        }
        let n = particles as usize;
        let mut cell_starts = vec![0; cells as usize + 1];
        cell_starts[cells as usize] = particles;
        let mut sorted = vec![Particle::default(); n];
        let mut radius = match radii {
            Radii::Uniform(_) => Vec::new(),
            Radii::Each(_) => vec![0.0; n],
        };

        let cell_bounds: Vec<usize> =
            block_starts.iter().map(|b| blocks[*b].first_cell as usize).collect();
        let no_radii = vec![0; buckets + 1];
        let radius_bounds = if radius.is_empty() { &no_radii[..] } else { bucket_starts };
        let out = split(&mut sorted, bucket_starts)
            .into_iter()
            .zip(split(&mut radius, radius_bounds))
            .zip(split(&mut cell_starts, &cell_bounds))
            .map(|((particles, radius), cells)| Slots { particles, radius, cells })
            .collect::<Vec<_>>();
        let crowded = out
            .into_par_iter()
            .enumerate()
            .map(|(b, mut slots)| {
                let bucket = &items[bucket_starts[b]..bucket_starts[b + 1]];
                let blocks = &blocks[block_starts[b]..=block_starts[b + 1]];
                slots.fill(bucket, blocks, &lattice, (block_starts[b], radii))
            })
            .collect::<Vec<_>>()
            .concat();

        let occupied = || blocks.iter().filter(|b| b.cells[0] > 0);
        Self {
            low: occupied().map(|b| b.low).fold(Vec3::INFINITY, Vec3::min),
            high: occupied().map(|b| b.high).fold(Vec3::NEG_INFINITY, Vec3::max),
            least_radius: occupied().map(|b| b.least_radius).fold(f32::INFINITY, f32::min),
            greatest_radius: occupied().map(|b| b.greatest_radius).fold(0.0, f32::max),
            radius: match radii {
                Radii::Uniform(r) => Radii::Uniform(r),
                Radii::Each(_) => Radii::Each(radius),
            },
            groups: groups_of(&lattice, &blocks),
            lattice,
            blocks,
            cell_starts,
            particles: sorted,
            crowded,
        }
    }
}

/// The positions to be sorted.
struct Source<'a> {
    positions: &'a [[f32; 3]],
    chosen: Option<&'a [u32]>,
}

impl Source<'_> {
    fn len(&self) -> usize {
        self.chosen.map_or(self.positions.len(), <[u32]>::len)
    }

    /// The finite ones among items `range`.
    fn items(&self, range: std::ops::Range<usize>) -> impl Iterator<Item = Particle> {
        range.filter_map(|i| {
            let index = self.chosen.map_or(i as u32, |chosen| chosen[i]);
            let center = self.positions[index as usize];
            center.iter().all(|v| v.is_finite()).then_some(Particle { center, index })
        })
    }

    fn chunk(&self, chunk: usize) -> std::ops::Range<usize> {
        let n = self.len();
        n * chunk / CHUNKS..n * (chunk + 1) / CHUNKS
    }

    /// Least and greatest coordinates, and how many positions are finite.
    fn bounds(&self) -> (Vec3, Vec3, usize) {
        let none = || (Vec3::INFINITY, Vec3::NEG_INFINITY, 0);
        (0..CHUNKS)
            .into_par_iter()
            .map(|chunk| {
                self.items(self.chunk(chunk)).fold(none(), |(low, high, n), item| {
                    let p = Vec3::from_array(item.center);
                    (low.min(p), high.max(p), n + 1)
                })
            })
            .reduce(none, |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2))
    }
}

fn lattice_for(low: Vec3, high: Vec3, count: usize, params: Params) -> Lattice {
    let m = f64::from(params.block_cells.max(1));
    match params.resolution {
        Resolution::CellsPerParticle(lambda) => {
            // A lattice may not be larger than a few times its particles.
            let most = 4.0 * count as f64 + 64.0;
            let blocks = (f64::from(lambda) * count as f64 / (m * m * m)).clamp(1.0, most);
            Lattice::with_blocks(low, high, blocks)
        }
        Resolution::CellEdge(edge) => {
            // A lattice may not be larger than a few times its particles.
            let least = Lattice::with_blocks(low, high, 4.0 * count as f64 + 64.0).edge.into();
            Lattice::with_edge(low, high, (f64::from(edge) * m).max(least))
        }
    }
}

/// The first block of bucket `bucket` out of `buckets`.
fn first_block(bucket: usize, buckets: usize, blocks: usize) -> usize {
    (bucket as u64 * blocks as u64).div_ceil(buckets as u64) as usize
}

/// The first sort. Gives the items bucket by bucket, and where each bucket begins.
fn sort_into_buckets(
    source: &Source<'_>,
    lattice: &Lattice,
    count: usize,
) -> (Vec<Particle>, Vec<usize>) {
    let blocks = lattice.count();
    let buckets = (count / BUCKET_PARTICLES).clamp(1, MOST_BUCKETS).min(blocks);
    let bucket_of = |p: [f32; 3]| {
        let block = lattice.index(lattice.block_of(Vec3::from_array(p)));
        (block as u64 * buckets as u64 / blocks as u64) as usize
    };
    let counts: Vec<Vec<usize>> = (0..CHUNKS)
        .into_par_iter()
        .map(|chunk| {
            let mut counts = vec![0; buckets];
            for item in source.items(source.chunk(chunk)) {
                counts[bucket_of(item.center)] += 1;
            }
            counts
        })
        .collect();

    // Cut the output into one piece per bucket and chunk, in that order, and hand each chunk its own.
    let mut items = vec![Particle::default(); count];
    let mut pieces: Vec<Vec<std::slice::IterMut<'_, Particle>>> =
        (0..CHUNKS).map(|_| Vec::with_capacity(buckets)).collect();
    let mut bucket_starts = Vec::with_capacity(buckets + 1);
    let mut start = 0;
    let mut rest = &mut items[..];
    for bucket in 0..buckets {
        bucket_starts.push(start);
        for (counts, pieces) in counts.iter().zip(&mut pieces) {
            let (piece, after) = rest.split_at_mut(counts[bucket]);
            start += piece.len();
            pieces.push(piece.iter_mut());
            rest = after;
        }
    }
    bucket_starts.push(start);
    pieces.into_par_iter().enumerate().for_each(|(chunk, mut pieces)| {
        for item in source.items(source.chunk(chunk)) {
            if let Some(place) = pieces[bucket_of(item.center)].next() {
                *place = item;
            }
        }
    });
    (items, bucket_starts)
}

/// Counts the particles of each block (into `first`) and finds their bounds and radii.
fn measure_blocks(
    bucket: &[Particle],
    lattice: &Lattice,
    first_block: usize,
    blocks: &mut [Block],
    radii: Radii<&[f32]>,
) {
    for block in blocks.iter_mut() {
        (block.low, block.high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        block.least_radius = f32::INFINITY;
    }
    for item in bucket {
        let p = Vec3::from_array(item.center);
        let block = &mut blocks[lattice.index(lattice.block_of(p)) - first_block];
        block.first += 1;
        block.low = block.low.min(p);
        block.high = block.high.max(p);
        let radius = match radii {
            Radii::Uniform(r) => r,
            Radii::Each(each) => each[item.index as usize],
        };
        block.least_radius = block.least_radius.min(radius);
        block.greatest_radius = block.greatest_radius.max(radius);
    }
}

/// Chooses the cells of a block with `count` particles.
fn divide(block: &mut Block, count: u32, params: Params, block_edge: f64) {
    block.cells = match params.resolution {
        _ if count == 0 => [0; 3],
        Resolution::CellEdge(_) => [params.block_cells.max(1); 3],
        Resolution::CellsPerParticle(lambda) => {
            let extent = (block.high - block.low).to_array().map(f64::from);
            let wanted = (f64::from(lambda) * f64::from(count)).max(1.0);
            let even = edge_for_count(extent, wanted);
            // Whole numbers of cells near the even edge, and an edge with which they cover the box.
            let dims = extent.map(|e| (e / even).round().max(1.0));
            let cover = (0..3).map(|i| extent[i] / dims[i]).fold(0.0, f64::max);
            let least = f64::from(LEAST_CELL_EDGE_RADII * block.greatest_radius);
            // Particles at one point need no cells finer than their block.
            let mut edge = if cover > 0.0 { cover.max(least) } else { block_edge };
            let cells = |edge: f64| extent.map(|e| ((e / edge * (1.0 - 1e-6)).ceil()).max(1.0));
            while cells(edge).iter().product::<f64>() > 1.5 * wanted {
                edge *= 1.1;
            }
            block.cell_low = block.low;
            block.cell_edge = edge as f32;
            cells(edge).map(|c| c as u32)
        }
    };
}

/// The places of one bucket in the grid's arrays.
struct Slots<'a> {
    particles: &'a mut [Particle],
    /// Empty where all radii are equal.
    radius: &'a mut [f32],
    cells: &'a mut [u32],
}

impl Slots<'_> {
    /// The second sort, of one bucket. `blocks` are the bucket's and one more. Gives the crowded ones.
    fn fill(
        &mut self,
        bucket: &[Particle],
        blocks: &[Block],
        lattice: &Lattice,
        (first_block, radii): (usize, Radii<&[f32]>),
    ) -> Vec<u32> {
        let (first, first_cell) = (blocks[0].first, blocks[0].first_cell);
        let mut crowded = Vec::new();
        let mut next: Vec<u32> = blocks.iter().map(|b| b.first - first).collect();
        let mut by_block = vec![Particle::default(); bucket.len()];
        for item in bucket {
            let block = lattice.index(lattice.block_of(Vec3::from_array(item.center)));
            let place = &mut next[block - first_block];
            by_block[*place as usize] = *item;
            *place += 1;
        }
        let mut by_cell: Vec<Particle> = Vec::new();
        for (b, pair) in blocks.windows(2).enumerate().filter(|(_, pair)| pair[0].cells[0] > 0) {
            let block = &pair[0];
            let range = (block.first - first) as usize..(pair[1].first - first) as usize;
            let cells = (block.first_cell - first_cell) as usize
                ..(pair[1].first_cell - first_cell) as usize;
            let items = &by_block[range.clone()];
            by_cell.resize(items.len(), Particle::default());
            let starts = &mut self.cells[cells];
            sort_block(items, &mut by_cell, starts, block);
            if items.len() > CROWDED_CELL && sort_crowded(&mut by_cell, starts, radii) {
                crowded.push((first_block + b) as u32);
            }
            for start in starts {
                *start += block.first;
            }
            for (item, slot) in by_cell.iter().zip(range) {
                self.particles[slot] = *item;
                if let Radii::Each(each) = radii {
                    self.radius[slot] = each[item.index as usize];
                }
            }
        }
        crowded
    }
}

/// Sorts the items of a block by cell; fills `starts`, counted from zero.
fn sort_block(items: &[Particle], sorted: &mut [Particle], starts: &mut [u32], block: &Block) {
    let [nx, ny, nz] = block.cells;
    let scale = 1.0 / block.cell_edge;
    let cell_of = |item: &Particle| {
        let at = (Vec3::from_array(item.center) - block.cell_low) * scale;
        let x = (at.x as u32).min(nx - 1);
        let y = (at.y as u32).min(ny - 1);
        let z = (at.z as u32).min(nz - 1);
        ((z * ny + y) * nx + x) as usize
    };
    starts.fill(0);
    for item in items {
        starts[cell_of(item)] += 1;
    }
    let mut sum = 0;
    for start in starts.iter_mut() {
        sum += std::mem::replace(start, sum);
    }
    for item in items {
        let start = &mut starts[cell_of(item)];
        sorted[*start as usize] = *item;
        *start += 1;
    }
    // Each start has moved to its cell's end, which is the next cell's start.
    starts.rotate_right(1);
    starts[0] = 0;
}

/// Brings equal spheres of crowded cells side by side, the lower index first. Gives whether some
/// coincide.
fn sort_crowded(sorted: &mut [Particle], starts: &[u32], radii: Radii<&[f32]>) -> bool {
    let radius = |item: &Particle| match radii {
        Radii::Uniform(_) => 0,
        Radii::Each(each) => each[item.index as usize].to_bits(),
    };
    let mut coincide = false;
    for c in 0..starts.len() {
        let end = starts.get(c + 1).map_or(sorted.len(), |s| *s as usize);
        let cell = &mut sorted[starts[c] as usize..end];
        if cell.len() > CROWDED_CELL {
            cell.sort_unstable_by_key(|i| (i.center.map(f32::to_bits), radius(i), i.index));
            coincide |= cell.windows(2).any(|w| w[0].center == w[1].center);
        }
    }
    coincide
}

/// Cuts a slice at `bounds` (ascending, the first is 0; what lies after the last is left out).
fn split<'a, T>(slice: &'a mut [T], bounds: &[usize]) -> Vec<&'a mut [T]> {
    let mut rest = slice;
    let mut parts = Vec::with_capacity(bounds.len() - 1);
    for pair in bounds.windows(2) {
        let (part, after) = std::mem::take(&mut rest).split_at_mut(pair[1] - pair[0]);
        parts.push(part);
        rest = after;
    }
    parts
}
