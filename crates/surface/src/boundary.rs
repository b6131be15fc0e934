//! Boundary extraction (Zirr & Dachsbacher 2015, §3.1): what has to be drawn of a liquid, whatever the
//! view. These are the spheres that do not lie within inner cells, and the inner cells as cubes.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{BATCH, of_points};
use rayon::prelude::*;

use crate::cull::{Cells, Cube};
use crate::fit::fit;
use crate::source::{Gathered, Piece, Source, drawable};
use crate::{Input, Params, Spray};

/// The boundary of a liquid: views can be made of it, one after the other.
#[derive(Debug)]
pub struct Boundary {
    pub(crate) parts: Vec<Part>,
    pub(crate) cubes: Cubes,
    /// What was found.
    pub counts: BoundaryCounts,
}

/// What was found of a liquid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoundaryCounts {
    /// Particles that can be drawn.
    pub particles: usize,
    /// Particles that are kept.
    pub kept: usize,
    /// Cells of the lattice; 0 if there was none.
    pub cells: usize,
    /// Inner cells.
    pub inner: usize,
    /// Cubes that they make.
    pub cubes: usize,
    /// Bytes of the cells' bits, given back by now.
    pub cell_bytes: usize,
    /// Bytes of what is kept.
    pub bytes: usize,
}

/// Spheres that are kept of a chunk of particles.
#[derive(Debug, Default)]
pub(crate) struct Part {
    /// Centre and scaled radius.
    pub spheres: Vec<[f32; 4]>,
    /// The particle of each; empty if they are not asked for.
    pub indices: Vec<u32>,
}

/// The inner cells.
#[derive(Debug, Default)]
pub(crate) struct Cubes {
    /// The corner of the lattice.
    pub low: Vec3,
    /// The edge of a cell.
    pub edge: f32,
    /// Place and size of each, in cells.
    pub cubes: Vec<Cube>,
}

impl Boundary {
    /// Extracts the boundary of `input`.
    pub fn extract(input: &Input<'_>, params: &Params, level: Level) -> Self {
        let source = Source::new(*input);
        let survey = source.survey(level);
        let cells = Cells::new(&source, &survey, params, level);
        let mut parts: Vec<Part> = (0..source.chunks())
            .into_par_iter()
            .map_init(<(Gathered, Part)>::default, |(gathered, part), chunk| {
                let piece = source.piece(chunk, gathered);
                let keep = Keep {
                    cells: cells.as_ref(),
                    scale: input.radius_scale,
                    spray: params.spray,
                    all_but_deep: params.fit,
                    ids: params.ids,
                };
                dispatch!(level, simd => keep_part(simd, &keep, &piece, part))
            })
            .collect();
        if let Some(cells) = cells.as_ref().filter(|_| params.fit) {
            fit(&mut parts, cells);
        }
        let mut counts = BoundaryCounts {
            particles: survey.count,
            kept: parts.iter().map(|p| p.spheres.len()).sum(),
            ..BoundaryCounts::default()
        };
        let mut cubes = Cubes::default();
        if let Some(cells) = cells {
            (counts.cells, counts.inner) = cells.counts();
            counts.cell_bytes = cells.bytes();
            cubes = Cubes { low: cells.low, edge: cells.edge, cubes: cells.cubes() };
        }
        counts.cubes = cubes.cubes.len();
        let each = size_of::<[f32; 4]>() + if params.ids { 4 } else { 0 };
        counts.bytes = counts.kept * each + counts.cubes * size_of::<Cube>();
        Self { parts, cubes, counts }
    }
}

impl Cubes {
    /// The cubes in such an order that rays whose direction has the signs of `forward` meet them one
    /// after the other: they are nodes of an octree, whose eight parts are visited from the nearest to
    /// the farthest corner. A key has the bits of the places along x, y and z in turn.
    pub fn front_to_back(&self, forward: Vec3) -> Vec<Cube> {
        let mirrored = forward.to_array().map(|v| v < 0.0);
        let key = |cube: &Cube| {
            let place = |axis: usize| {
                let place = cube[axis] as u32 & 0x1f_ffff;
                if mirrored[axis] { 0x1f_ffff - place } else { place }
            };
            thirds(place(0)) | thirds(place(1)) << 1 | thirds(place(2)) << 2
        };
        let mut keyed: Vec<(u64, Cube)> = self.cubes.iter().map(|c| (key(c), *c)).collect();
        keyed.par_sort_unstable_by_key(|(key, _)| *key);
        keyed.into_iter().map(|(_, cube)| cube).collect()
    }
}

/// Each of the lower 21 bits of a word, followed by two zeros.
fn thirds(word: u32) -> u64 {
    let mut w = u64::from(word) & 0x1f_ffff;
    w = (w | w << 32) & 0x1f_0000_0000_ffff;
    w = (w | w << 16) & 0x1f_0000_ff00_00ff;
    w = (w | w << 8) & 0x100f_00f0_0f00_f00f;
    w = (w | w << 4) & 0x10c3_0c30_c30c_30c3;
    (w | w << 2) & 0x1249_2492_4924_9249
}

impl Boundary {
    /// The corner of the lattice of cells and their edge; `None` without any.
    pub fn lattice(&self) -> Option<(Vec3, f32)> {
        (self.counts.cells > 0).then_some((self.cubes.low, self.cubes.edge))
    }
}

/// Which spheres are kept.
struct Keep<'a> {
    cells: Option<&'a Cells>,
    scale: f32,
    spray: Spray,
    /// Whether all are kept that lie in cells that are not deep.
    all_but_deep: bool,
    ids: bool,
}

impl Keep<'_> {
    /// Whether a particle is left out, since its sphere lies within inner cells; `deep` says whether those of deep cells do.
    #[inline(always)]
    fn hides(&self, cells: &Cells, (cell, deep): (u32, bool), p: [f32; 3], radius: f32) -> bool {
        match self.all_but_deep {
            true => deep && cells.is_deep(cell),
            false => cells.covers(cell, p, radius),
        }
    }

    /// Adds a particle in a cell to `memory[*kept]`, unless it cannot be drawn.
    #[inline(always)]
    fn add(&self, piece: &Piece<'_>, (i, cell): (usize, u32), memory: &mut Part, kept: &mut usize) {
        let [x, y, z] = piece.positions[i];
        let mut radius = piece.radius(i) * self.scale;
        if self.cells.is_some_and(|cells| cells.is_sparse(cell)) {
            match self.spray {
                Spray::Liquid => {}
                Spray::Drops(part) => radius *= part,
                Spray::Dropped => return,
            }
        }
        // Zero only if all are finite: ∞·0 and NaN·0 are NaN.
        let drawn = (x + y + z) * 0.0 == 0.0 && drawable(radius);
        memory.spheres[*kept] = [x, y, z, radius];
        if self.ids {
            memory.indices[*kept] = piece.indices.of(i);
        }
        *kept += usize::from(drawn);
    }
}

/// What is kept of a chunk; `memory` is made as large as needed.
#[simd]
fn keep_part<S: Simd>(simd: S, keep: &Keep<'_>, piece: &Piece<'_>, memory: &mut Part) -> Part {
    let count = piece.positions.len();
    if memory.spheres.len() < count {
        memory.spheres.resize(count, [0.0; 4]);
        memory.indices.resize(if keep.ids { count } else { 0 }, 0);
    }
    let mut kept = 0;
    if let Some(cells) = keep.cells {
        let rows = cells.rows();
        let deep_hides = cells.deep_covers(piece.greatest_radius() * keep.scale);
        let whole = count / BATCH * BATCH;
        for at in (0..whole).step_by(BATCH) {
            let numbers = of_points(simd, &rows, &piece.positions[at..at + BATCH]);
            // Most are deep: no branch that has to be guessed for each.
            let mut left = 0xffff;
            if deep_hides {
                for (i, cell) in numbers.iter().enumerate() {
                    left ^= u32::from(cells.is_deep(*cell)) << i;
                }
            }
            while left != 0 {
                let i = left.trailing_zeros() as usize % BATCH;
                left &= left - 1;
                let (p, radius) = (piece.positions[at + i], piece.radius(at + i) * keep.scale);
                if !keep.hides(cells, (numbers[i], deep_hides), p, radius) {
                    keep.add(piece, (at + i, numbers[i]), memory, &mut kept);
                }
            }
        }
        for i in whole..count {
            let (p, radius) = (piece.positions[i], piece.radius(i) * keep.scale);
            let cell = cells.cell(p);
            if !keep.hides(cells, (cell, deep_hides), p, radius) {
                keep.add(piece, (i, cell), memory, &mut kept);
            }
        }
    } else {
        (0..count).for_each(|i| keep.add(piece, (i, 0), memory, &mut kept));
    }
    Part {
        spheres: memory.spheres[..kept].to_vec(),
        indices: memory.indices[..if keep.ids { kept } else { 0 }].to_vec(),
    }
}
