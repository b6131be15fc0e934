//! Particles by tile: a tile is a bundle of rows of cells along x, and has the particles in it.
//!
//! Each chunk of the input sorts its own particles, stably; a tile goes through the chunks in their order.
//! So what a tile adds up does not depend on the number of threads.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use motes_grid::Radii;
use rayon::prelude::*;

use crate::lattice::Lattice;
use crate::params::Particles;

/// Particles in a chunk, at the least, and chunks at the most: each knows where all tiles begin.
const LEAST_CHUNK: usize = 1 << 11;
const MOST_CHUNKS: usize = 64;
/// Greater radii are left out: what they reach would be no number of single precision.
const MOST_RADIUS: f32 = 1e36;
/// Particles that are worth a look of their own.
const SURVEYED: usize = 1 << 12;

/// A particle in a tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Entry {
    /// Its place in voxels.
    pub at: [f32; 3],
    /// Its place in the input.
    pub index: u32,
}

/// Where tiles lie: along y and z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tiles {
    /// Rows of cells along an edge: a power of two.
    pub edge: usize,
    /// Tiles along y and z.
    pub dims: [usize; 2],
}

impl Tiles {
    pub fn new(lattice: &Lattice, edge: usize) -> Self {
        Self { edge, dims: [1, 2].map(|a| lattice.dims[a].div_ceil(edge)) }
    }

    pub fn count(&self) -> usize {
        self.dims[0] * self.dims[1]
    }

    /// Its first rows of cells, along y and z.
    pub fn first(&self, tile: usize) -> [usize; 2] {
        [tile % self.dims[0], tile / self.dims[0]].map(|t| t * self.edge)
    }
}

/// Particles by tile.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bins {
    pub tiles: Tiles,
    chunks: Vec<Chunk>,
}

#[derive(Clone, Debug, Default)]
struct Chunk {
    /// Its particles, and the cells of their tiles that they are in.
    entries: Vec<Entry>,
    cells: Vec<u32>,
    /// Those that follow each other in a tile, by tile.
    runs: Vec<Run>,
    /// The first run of each tile, and their number.
    starts: Vec<u32>,
    /// The runs before they are sorted.
    found: Vec<Run>,
}

/// Particles of a chunk, one after the other, that are in the same tile.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    tile: u32,
    begin: u32,
    end: u32,
}

/// What is known of particles before there is a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Survey {
    pub low: Vec3,
    pub high: Vec3,
    pub greatest_radius: f32,
    /// Sum of the radii.
    pub radii: f64,
    pub count: usize,
}

impl Survey {
    const NONE: Self = Self {
        low: Vec3::INFINITY,
        high: Vec3::NEG_INFINITY,
        greatest_radius: 0.0,
        radii: 0.0,
        count: 0,
    };

    /// Of all particles that can be drawn.
    pub fn new(particles: &Particles<'_>) -> Self {
        let chunks = particles.positions.par_chunks(SURVEYED).enumerate();
        let parts: Vec<Self> = chunks
            .map(|(chunk, positions)| {
                let mut part = Self::NONE;
                if let Radii::Uniform(radius) = particles.radii {
                    positions.iter().for_each(|p| part.add((*p).into(), radius));
                    return Self { radii: part.count as f64 * f64::from(radius), ..part };
                }
                for (i, position) in positions.iter().enumerate() {
                    let radius = particles.radius(chunk * SURVEYED + i);
                    let before = part.count;
                    part.add((*position).into(), radius);
                    part.radii += (part.count - before) as f64 * f64::from(radius);
                }
                part
            })
            .collect();
        parts.into_iter().fold(Self::NONE, |a, b| Self {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
            greatest_radius: a.greatest_radius.max(b.greatest_radius),
            radii: a.radii + b.radii,
            count: a.count + b.count,
        })
    }

    /// Takes one more, but for the sum of radii.
    #[inline(always)]
    fn add(&mut self, point: Vec3, radius: f32) {
        if drawable(point, radius) {
            self.low = self.low.min(point);
            self.high = self.high.max(point);
            self.greatest_radius = self.greatest_radius.max(radius);
            self.count += 1;
        }
    }
}

fn drawable(point: Vec3, radius: f32) -> bool {
    point.is_finite() && radius > 0.0 && radius <= MOST_RADIUS
}

impl Bins {
    /// Sorts particles into tiles of `edge` rows.
    pub fn fill(&mut self, particles: &Particles<'_>, lattice: &Lattice, edge: usize) {
        self.tiles = Tiles::new(lattice, edge);
        let (tiles, count) = (self.tiles, particles.positions.len());
        let size = count.div_ceil(MOST_CHUNKS).max(LEAST_CHUNK);
        self.chunks.resize_with(count.div_ceil(size), Chunk::default);
        self.chunks.par_iter_mut().enumerate().with_max_len(1).for_each(|(number, chunk)| {
            chunk.find(particles, number * size..((number + 1) * size).min(count), lattice, tiles);
            chunk.sort(tiles);
        });
    }

    /// The particles of a tile, and their cells, in the order of the input.
    pub fn of(&self, tile: usize) -> impl Iterator<Item = (&[Entry], &[u32])> + Clone {
        self.chunks.iter().flat_map(move |chunk| chunk.of(tile))
    }
}

impl Chunk {
    fn of(&self, tile: usize) -> impl Iterator<Item = (&[Entry], &[u32])> + Clone {
        let runs = &self.runs[self.starts[tile] as usize..self.starts[tile + 1] as usize];
        runs.iter().map(|run| {
            let run = run.begin as usize..run.end as usize;
            (&self.entries[run.clone()], &self.cells[run])
        })
    }

    /// Finds where the particles of a range are.
    fn find(
        &mut self,
        particles: &Particles<'_>,
        range: Range<usize>,
        lattice: &Lattice,
        tiles: Tiles,
    ) {
        let Self { entries, cells, found, .. } = self;
        entries.clear();
        cells.clear();
        found.clear();
        let (shift, row) = (tiles.edge.trailing_zeros(), tiles.dims[0] as u32);
        let [across, rows, _] = lattice.dims.map(|n| n as u32);
        let (edge, within) = (tiles.edge as u32, tiles.edge as u32 - 1);
        // They are inside, but for what coordinates far from 0 are rounded by.
        let last = Vec3::from_array(lattice.cells().map(|n| (n - 1) as f32));
        let mut run = Run::default();
        for index in range {
            let point = Vec3::from_array(particles.positions[index]);
            if !drawable(point, particles.radius(index)) {
                continue;
            }
            let at = lattice.place(point).max(Vec3::ZERO).min(last).to_array();
            let [x, y, z] = at.map(|v| v as i32 as u32);
            let tile = (z >> shift) * row + (y >> shift);
            if tile != run.tile {
                found.push(run);
                run = Run { tile, begin: run.end, end: run.end };
            }
            run.end += 1;
            entries.push(Entry { at, index: index as u32 });
            // The last tiles have fewer rows.
            let wide = edge.min(rows - (y & !within));
            cells.push(((z & within) * wide + (y & within)) * across + x);
        }
        found.push(run);
    }

    /// Sorts them by tile.
    fn sort(&mut self, tiles: Tiles) {
        let Self { starts, runs, found, .. } = self;
        runs.resize(found.len(), Run::default());
        let of = found.iter().map(|run| run.tile);
        sort(starts, tiles.count(), of.zip(found.iter().copied()), runs);
    }
}

/// Sorts what has a key each by it, stably; leaves where each key's begin, and their number.
#[inline(always)]
pub(crate) fn sort<T: Copy>(
    starts: &mut Vec<u32>,
    keys: usize,
    from: impl Iterator<Item = (u32, T)> + Clone,
    to: &mut [T],
) {
    starts.clear();
    starts.resize(keys + 2, 0);
    for (key, _) in from.clone() {
        starts[key as usize + 2] += 1;
    }
    for key in 0..keys {
        starts[key + 2] += starts[key + 1];
    }
    // Each start moves on to the next key's as its own come.
    for (key, one) in from {
        let next = &mut starts[key as usize + 1];
        to[*next as usize] = one;
        *next += 1;
    }
}
