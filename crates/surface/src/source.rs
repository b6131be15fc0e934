//! The particles of an input, chunk by chunk, wherever they are.

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use motes_grid::{Grid, Radii, Seen, Visibility, bounds_of_points};
use rayon::prelude::*;

use crate::{Input, Particles};

/// Particles in a chunk, about; what results does not depend on it.
const CHUNK: usize = 1 << 16;

/// An input, cut into chunks.
pub(crate) struct Source<'a> {
    input: Input<'a>,
    chunks: Vec<Chunk>,
}

/// A part of an input.
#[derive(Clone)]
enum Chunk {
    /// Places of the arrays.
    Places(std::ops::Range<usize>),
    /// Blocks of a grid.
    Blocks(usize, std::ops::Range<usize>),
}

/// The particles of a chunk.
pub(crate) struct Piece<'a> {
    pub positions: &'a [[f32; 3]],
    /// Unscaled.
    pub radii: Radii<&'a [f32]>,
    pub indices: Indices<'a>,
}

/// Which particles those of a chunk are.
#[derive(Clone, Copy)]
pub(crate) enum Indices<'a> {
    From(u32),
    Each(&'a [u32]),
}

/// Memory for the particles of one chunk, for one after the other.
#[derive(Default)]
pub(crate) struct Gathered {
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
    indices: Vec<u32>,
}

/// What is known of the particles that can be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Survey {
    pub low: Vec3,
    pub high: Vec3,
    pub count: usize,
    /// The mean of their scaled radii.
    pub mean_radius: f32,
}

impl<'a> Source<'a> {
    pub fn new(input: Input<'a>) -> Self {
        let mut chunks = Vec::new();
        match input.particles {
            Particles::Unsorted(positions, _) => {
                let n = positions.len();
                chunks
                    .extend((0..n).step_by(CHUNK).map(|at| Chunk::Places(at..(at + CHUNK).min(n))));
            }
            Particles::Grids(grids, _) => {
                for (g, grid) in grids.iter().enumerate() {
                    chunks.extend(runs_of_blocks(grid).map(|blocks| Chunk::Blocks(g, blocks)));
                }
            }
        }
        Self { input, chunks }
    }

    /// How many chunks there are.
    pub fn chunks(&self) -> usize {
        self.chunks.len()
    }

    /// The radius scale.
    pub fn radius_scale(&self) -> f32 {
        self.input.radius_scale
    }

    /// The particles of a chunk.
    pub fn piece<'b>(&'b self, chunk: usize, memory: &'b mut Gathered) -> Piece<'b> {
        match (self.chunks[chunk].clone(), self.input.particles) {
            (Chunk::Places(range), Particles::Unsorted(positions, radii)) => Piece {
                positions: &positions[range.clone()],
                radii: match radii {
                    Radii::Uniform(r) => Radii::Uniform(r),
                    Radii::Each(radii) => Radii::Each(&radii[range.clone()]),
                },
                indices: Indices::From(range.start as u32),
            },
            (Chunk::Blocks(g, blocks), Particles::Grids(grids, seen)) => {
                memory.gather((&grids[g], &seen[g]), blocks);
                memory.piece(&grids[g].radius)
            }
            _ => memory.piece(&Radii::<Vec<f32>>::Uniform(0.0)),
        }
    }

    /// Finds bounds, count and mean radius.
    pub fn survey(&self, level: Level) -> Survey {
        let parts: Vec<(Vec3, Vec3, usize, f64)> = (0..self.chunks())
            .into_par_iter()
            .map_init(Gathered::default, |memory, chunk| self.survey_chunk((chunk, memory), level))
            .collect();
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0, 0.0);
        let (low, high, count, sum) =
            parts.iter().fold(none, |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2, a.3 + b.3));
        let mean_radius = (sum / (count as f64).max(1.0)) as f32;
        Survey { low, high, count, mean_radius }
    }

    fn survey_chunk(
        &self,
        (chunk, memory): (usize, &mut Gathered),
        level: Level,
    ) -> (Vec3, Vec3, usize, f64) {
        let piece = self.piece(chunk, memory);
        let scale = self.radius_scale();
        if let Radii::Uniform(r) = piece.radii
            && drawable(r * scale)
            && let Some((low, high)) =
                dispatch!(level, simd => bounds_of_points(simd, piece.positions))
        {
            let count = piece.positions.len();
            return (low, high, count, f64::from(r * scale) * count as f64);
        }
        let mut all = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0, 0.0);
        for (i, position) in piece.positions.iter().enumerate() {
            let (p, r) = (Vec3::from_array(*position), piece.radius(i) * scale);
            if p.is_finite() && drawable(r) {
                all = (all.0.min(p), all.1.max(p), all.2 + 1, all.3 + f64::from(r));
            }
        }
        all
    }
}

impl Piece<'_> {
    /// The greatest unscaled radius; 0 without particles.
    pub fn greatest_radius(&self) -> f32 {
        match self.radii {
            Radii::Uniform(r) => r,
            Radii::Each(radii) => radii.iter().copied().fold(0.0, f32::max),
        }
    }

    /// The unscaled radius of the chunk's `i`-th particle.
    #[inline(always)]
    pub fn radius(&self, i: usize) -> f32 {
        match self.radii {
            Radii::Uniform(r) => r,
            Radii::Each(radii) => radii[i],
        }
    }
}

impl Indices<'_> {
    /// The index of the chunk's `i`-th particle.
    #[inline(always)]
    pub fn of(self, i: usize) -> u32 {
        match self {
            Self::From(first) => first + i as u32,
            Self::Each(indices) => indices[i],
        }
    }
}

impl Gathered {
    /// Copies what is seen of `blocks` of a grid.
    fn gather(&mut self, (grid, seen): (&Grid, &Visibility), blocks: std::ops::Range<usize>) {
        self.positions.clear();
        self.radii.clear();
        self.indices.clear();
        for block in blocks {
            let slots = grid.particles_of(block);
            let bits = match seen.block(grid, block) {
                Seen::Hidden => continue,
                Seen::Shown => None,
                Seen::Mixed(words) => Some(words),
            };
            for (i, slot) in slots.enumerate() {
                if bits.is_none_or(|words| words[i / 64] >> (i % 64) & 1 == 1) {
                    let particle = &grid.particles[slot];
                    self.positions.push(particle.center);
                    self.indices.push(particle.index);
                    if let Radii::Each(radii) = &grid.radius {
                        self.radii.push(radii[slot]);
                    }
                }
            }
        }
    }

    fn piece<T>(&self, radii: &Radii<T>) -> Piece<'_> {
        Piece {
            positions: &self.positions,
            radii: match radii {
                Radii::Uniform(r) => Radii::Uniform(*r),
                Radii::Each(_) => Radii::Each(&self.radii),
            },
            indices: Indices::Each(&self.indices),
        }
    }
}

/// Whether a sphere of this radius can be drawn.
pub(crate) fn drawable(radius: f32) -> bool {
    radius.is_finite() && radius > 0.0
}

/// Runs of blocks that hold about a chunk of particles each.
fn runs_of_blocks(grid: &Grid) -> impl Iterator<Item = std::ops::Range<usize>> {
    let blocks = grid.blocks.len().saturating_sub(1);
    let mut at = 0;
    std::iter::from_fn(move || {
        let first = at;
        while at < blocks && (grid.blocks[at].first - grid.blocks[first].first) < CHUNK as u32 {
            at += 1;
        }
        (first < at).then_some(first..at)
    })
}
