//! Particles by tile: a tile is a bundle of rows of cells along x, and has the particles in it.
//!
//! Each chunk of the input sorts its own particles, stably; a tile goes through the chunks in their order.
//! So what a tile adds up does not depend on the number of threads.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use crate::lattice::Lattice;
use crate::params::Particles;

/// Particles in a chunk, at the least, and chunks at the most: each knows where all tiles begin.
const LEAST_CHUNK: usize = 1 << 11;
const MOST_CHUNKS: usize = 64;
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

impl Entry {
    /// The cell that it is in.
    #[inline(always)]
    pub fn cell(&self) -> [usize; 3] {
        self.at.map(|v| v as u32 as usize)
    }
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
    /// First entry of each tile, and their number.
    starts: Vec<u32>,
    entries: Vec<Entry>,
    /// Its particles, and their tiles, before they are sorted.
    found: Vec<Entry>,
    tiles: Vec<u32>,
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
                for (i, position) in positions.iter().enumerate() {
                    let radius = particles.radius(chunk * SURVEYED + i);
                    let point = Vec3::from_array(*position);
                    if drawable(point, radius) {
                        part.low = part.low.min(point);
                        part.high = part.high.max(point);
                        part.greatest_radius = part.greatest_radius.max(radius);
                        part.radii += f64::from(radius);
                        part.count += 1;
                    }
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
}

fn drawable(point: Vec3, radius: f32) -> bool {
    point.is_finite() && radius > 0.0 && radius.is_finite()
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

    /// The particles of a tile, chunk by chunk.
    pub fn of(&self, tile: usize) -> impl Iterator<Item = &[Entry]> + Clone {
        self.chunks.iter().map(move |chunk| chunk.of(tile)).filter(|entries| !entries.is_empty())
    }
}

impl Chunk {
    fn of(&self, tile: usize) -> &[Entry] {
        &self.entries[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }

    /// Finds where the particles of a range are.
    fn find(
        &mut self,
        particles: &Particles<'_>,
        range: Range<usize>,
        lattice: &Lattice,
        tiles: Tiles,
    ) {
        self.found.clear();
        self.tiles.clear();
        let (shift, row) = (tiles.edge.trailing_zeros(), tiles.dims[0] as u32);
        // They are inside, but for what coordinates far from 0 are rounded by.
        let last = Vec3::from_array(lattice.cells().map(|n| (n - 1) as f32));
        for index in range {
            let point = Vec3::from_array(particles.positions[index]);
            if drawable(point, particles.radius(index)) {
                let at = lattice.place(point).max(Vec3::ZERO).min(last);
                self.found.push(Entry { at: at.to_array(), index: index as u32 });
                self.tiles.push((at.z as u32 >> shift) * row + (at.y as u32 >> shift));
            }
        }
    }

    /// Sorts them by tile.
    fn sort(&mut self, tiles: Tiles) {
        self.entries.resize(self.found.len(), Entry::default());
        let Self { starts, entries, found, tiles: of, .. } = self;
        sort(starts, tiles.count(), (of, found.iter()), entries);
    }
}

/// Sorts entries by key, stably; leaves where each key's begin, and their number.
#[inline(always)]
pub(crate) fn sort<'a>(
    starts: &mut Vec<u32>,
    keys: usize,
    (of, from): (&[u32], impl Iterator<Item = &'a Entry>),
    to: &mut [Entry],
) {
    starts.clear();
    starts.resize(keys + 2, 0);
    for key in of {
        starts[*key as usize + 2] += 1;
    }
    for key in 0..keys {
        starts[key + 2] += starts[key + 1];
    }
    // Each start moves on to the next key's as its entries come.
    for (entry, key) in from.zip(of) {
        let next = &mut starts[*key as usize + 1];
        to[*next as usize] = *entry;
        *next += 1;
    }
}
