//! Particles by tile: a tile is a bundle of rows of voxels along x, and knows all particles that reach it.
//!
//! Each chunk of the input sorts its own particles, stably; a tile goes through the chunks in their order.
//! So what a tile adds up does not depend on the number of threads.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use crate::lattice::{Lattice, reach};
use crate::params::{Params, Particles};

/// Particles in a chunk.
const CHUNK: usize = 1 << 12;

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
    /// Rows along an edge.
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

    /// The tile of a row.
    #[inline(always)]
    pub fn of_row(&self, [y, z]: [usize; 2]) -> usize {
        z / self.edge * self.dims[0] + y / self.edge
    }

    /// The rows of a tile, along y and z.
    pub fn rows(&self, tile: usize, lattice: &Lattice) -> [Range<usize>; 2] {
        let first = [tile % self.dims[0], tile / self.dims[0]].map(|t| t * self.edge);
        [0, 1].map(|a| first[a]..(first[a] + self.edge).min(lattice.dims[a + 1]))
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
    /// Where the particles go, before they are sorted.
    spans: Vec<Span>,
}

/// A particle and the tiles that it reaches: first and last along y, along z.
#[derive(Clone, Copy, Debug)]
struct Span {
    entry: Entry,
    tiles: [[u16; 2]; 2],
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
        let chunks = particles.positions.par_chunks(CHUNK).enumerate();
        let parts: Vec<Self> = chunks
            .map(|(chunk, positions)| {
                let mut part = Self::NONE;
                for (i, position) in positions.iter().enumerate() {
                    let radius = particles.radius(chunk * CHUNK + i);
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
    pub fn fill(
        &mut self,
        particles: &Particles<'_>,
        lattice: &Lattice,
        (params, edge): (&Params, usize),
    ) {
        self.tiles = Tiles::new(lattice, edge);
        let tiles = self.tiles;
        self.chunks.resize_with(particles.positions.len().div_ceil(CHUNK), Chunk::default);
        self.chunks.par_iter_mut().enumerate().for_each(|(number, chunk)| {
            let end = ((number + 1) * CHUNK).min(particles.positions.len());
            chunk.find(particles, number * CHUNK..end, (lattice, params, tiles));
            chunk.sort(tiles);
        });
    }

    /// The particles that reach a tile.
    pub fn of(&self, tile: usize) -> impl Iterator<Item = &Entry> {
        self.chunks.iter().flat_map(move |chunk| chunk.of(tile))
    }

    /// The same, chunk by chunk.
    pub fn parts(&self, tile: usize) -> impl Iterator<Item = &[Entry]> {
        self.chunks.iter().map(move |chunk| chunk.of(tile))
    }
}

impl Chunk {
    fn of(&self, tile: usize) -> &[Entry] {
        &self.entries[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }

    /// Finds where the particles of a range go.
    fn find(
        &mut self,
        particles: &Particles<'_>,
        range: Range<usize>,
        (lattice, params, tiles): (&Lattice, &Params, Tiles),
    ) {
        self.spans.clear();
        let last = tiles.dims.map(|n| (n - 1) as f32);
        let per_tile = 1.0 / tiles.edge as f32;
        for index in range {
            let point = Vec3::from_array(particles.positions[index]);
            let radius = particles.radius(index);
            if !drawable(point, radius) {
                continue;
            }
            let far = reach(radius, lattice.voxel, params) / lattice.voxel;
            let at = lattice.place(point).to_array();
            let tile = |a: usize| {
                let of = |place: f32| (place * per_tile).clamp(0.0, last[a]) as u16;
                [of(at[a + 1] - far), of(at[a + 1] + far)]
            };
            let entry = Entry { at, index: index as u32 };
            self.spans.push(Span { entry, tiles: [tile(0), tile(1)] });
        }
    }

    /// Sorts them by tile, those that reach several into each.
    fn sort(&mut self, tiles: Tiles) {
        self.starts.clear();
        self.starts.resize(tiles.count() + 2, 0);
        for span in &self.spans {
            span.visit(tiles, |tile| self.starts[tile + 2] += 1);
        }
        for tile in 0..tiles.count() {
            self.starts[tile + 2] += self.starts[tile + 1];
        }
        self.entries.resize(self.starts[tiles.count() + 1] as usize, Entry::default());
        // Each start moves on to the next tile's as its entries come.
        for span in &self.spans {
            span.visit(tiles, |tile| {
                let next = &mut self.starts[tile + 1];
                self.entries[*next as usize] = span.entry;
                *next += 1;
            });
        }
    }
}

impl Span {
    #[inline(always)]
    fn visit(&self, tiles: Tiles, mut visit: impl FnMut(usize)) {
        let [[y0, y1], [z0, z1]] = self.tiles;
        for z in z0..=z1 {
            for y in y0..=y1 {
                visit(usize::from(z) * tiles.dims[0] + usize::from(y));
            }
        }
    }
}
