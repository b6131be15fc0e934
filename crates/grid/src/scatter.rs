//! The first sort: particles into buckets, each a run of blocks that fits the cache.
//!
//! Gribble et al. 2007, §4.2, build by *sort-middle* (Ize et al. 2006): a coarse bucket sort, then each
//! thread inserts the particles of its own buckets. The input is cut into chunks; each chunk counts
//! what it has for each bucket, and so knows its own piece of every bucket. The sort is stable.

use std::borrow::Cow;

use fearless_simd::{Level, dispatch, f32x4, mask32x4, prelude::*, u32x4};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use crate::places::{BATCH, Places, bounds_of_points, of_points};
use crate::streams::{Piece, Streams};
use crate::{Lattice, Particle, Radii};

/// Pieces the input is cut into. Fixed, though the result does not depend on it.
const CHUNKS: usize = 32;
/// Chunks after which positions that were handed over are let go, the last first.
const CHUNKS_OF_ROUND: usize = 8;

/// The particles to be sorted, in the file's order.
pub(crate) struct Source<'a> {
    pub positions: Cow<'a, [[f32; 3]]>,
    /// In the order of `positions`.
    pub radii: Radii<&'a [f32]>,
    /// Which of them; all, if `None`.
    pub chosen: Option<&'a [u32]>,
}

/// A part of the source, and how many of its positions are finite.
struct Chunk {
    range: std::ops::Range<usize>,
    low: Vec3,
    high: Vec3,
    finite: usize,
}

/// What is known of a source before it is sorted.
pub(crate) struct Survey {
    chunks: Vec<Chunk>,
    pub low: Vec3,
    pub high: Vec3,
    /// How many positions are finite.
    pub count: usize,
}

impl Source<'_> {
    fn len(&self) -> usize {
        self.chosen.map_or(self.positions.len(), <[u32]>::len)
    }

    /// Whether the positions were handed over, to be let go one after the other.
    pub fn owns(&self) -> bool {
        self.chosen.is_none() && matches!(self.positions, Cow::Owned(_))
    }

    /// Lets go of all positions but the first `count`.
    fn keep(&mut self, count: usize) {
        if self.owns() {
            let positions = self.positions.to_mut();
            positions.truncate(count);
            positions.shrink_to_fit();
        }
    }

    /// The finite ones among items `range`.
    fn items(&self, range: std::ops::Range<usize>) -> impl Iterator<Item = Particle> {
        range.filter_map(|i| {
            let index = self.chosen.map_or(i as u32, |chosen| chosen[i]);
            let center = self.positions[index as usize];
            center.iter().all(|v| v.is_finite()).then_some(Particle { center, index })
        })
    }

    /// Finds bounds and counts.
    pub fn survey(&self, level: Level) -> Survey {
        let n = self.len();
        let chunks: Vec<Chunk> = (0..CHUNKS)
            .into_par_iter()
            .with_max_len(1)
            .map(|c| self.chunk(n * c / CHUNKS..n * (c + 1) / CHUNKS, level))
            .collect();
        Survey {
            low: chunks.iter().fold(Vec3::INFINITY, |a, c| a.min(c.low)),
            high: chunks.iter().fold(Vec3::NEG_INFINITY, |a, c| a.max(c.high)),
            count: chunks.iter().map(|c| c.finite).sum(),
            chunks,
        }
    }

    fn chunk(&self, range: std::ops::Range<usize>, level: Level) -> Chunk {
        if self.chosen.is_none() {
            let points = &self.positions[range.clone()];
            if let Some((low, high)) = dispatch!(level, simd => bounds_of_points(simd, points)) {
                return Chunk { finite: range.len(), range, low, high };
            }
        }
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0);
        let (low, high, finite) = self.items(range.clone()).fold(none, |(low, high, n), item| {
            let p = Vec3::from_array(item.center);
            (low.min(p), high.max(p), n + 1)
        });
        Chunk { range, low, high, finite }
    }

    /// The positions of a chunk where they can be taken as they stand.
    fn whole(&self, chunk: &Chunk) -> Option<&[[f32; 3]]> {
        let whole = self.chosen.is_none() && chunk.finite == chunk.range.len();
        whole.then(|| &self.positions[chunk.range.clone()])
    }
}

/// Runs of blocks with about equally many particles.
///
/// Blocks are first counted in bins, 2^shift blocks each; a bucket is a run of bins.
pub(crate) struct Buckets {
    places: Places,
    shift: u32,
    /// The bucket of each bin.
    bucket_of: Vec<u16>,
    /// How many particles each chunk has for each bucket: `[chunk][bucket]`.
    counts: Vec<Vec<u32>>,
    /// Where each bucket begins among the blocks, and the end of the last.
    pub blocks: Vec<usize>,
}

/// Most bins: their counts stay in the nearest cache.
const MOST_BINS: usize = 1 << 13;
/// Particles per bucket, so that the second sort runs in cache.
const BUCKET_PARTICLES: usize = 16 * 1024;
/// Most buckets: the lines of more do not stay in cache.
const MOST_BUCKETS: usize = 512;

impl Buckets {
    /// Counts the particles of `source` and chooses the buckets.
    pub fn new(source: &Source<'_>, survey: &Survey, lattice: &Lattice, level: Level) -> Self {
        let places = Places::of_blocks(lattice);
        let blocks = lattice.count();
        let shift = blocks.div_ceil(MOST_BINS).next_power_of_two().trailing_zeros();
        let bins = Bins { places, shift, count: blocks.div_ceil(1 << shift) };
        let count = |chunk: &Chunk| match source.whole(chunk) {
            Some(points) => dispatch!(level, simd => count_points(simd, &bins, points)),
            None => {
                let mut counts = vec![0; bins.count];
                source.items(chunk.range.clone()).for_each(|p| counts[bins.of(p.center)] += 1);
                counts
            }
        };
        let bin_counts: Vec<Vec<u32>> =
            survey.chunks.par_iter().with_max_len(1).map(count).collect();

        let most = BUCKET_PARTICLES.max(survey.count.div_ceil(MOST_BUCKETS - 1));
        let mut buckets = Self {
            places,
            shift,
            bucket_of: Vec::with_capacity(bins.count),
            counts: vec![vec![0]; bin_counts.len()],
            blocks: vec![0],
        };
        let mut held = 0;
        for bin in 0..bins.count {
            let count: usize = bin_counts.iter().map(|counts| counts[bin] as usize).sum();
            // No more buckets than asked for: two of them in a row hold more than `most`.
            if held > 0 && held + count > most {
                buckets.blocks.push(bin << shift);
                buckets.counts.iter_mut().for_each(|counts| counts.push(0));
                held = 0;
            }
            held += count;
            let bucket = buckets.blocks.len() - 1;
            buckets.bucket_of.push(bucket as u16);
            for (counts, bins) in buckets.counts.iter_mut().zip(&bin_counts) {
                counts[bucket] += bins[bin];
            }
        }
        buckets.blocks.push(blocks);
        buckets
    }

    /// The bucket of a block.
    #[inline(always)]
    fn of(&self, block: u32) -> usize {
        usize::from(self.bucket_of[(block >> self.shift) as usize])
    }

    /// Where each bucket begins among the particles, and the end of the last.
    pub fn starts(&self) -> Vec<usize> {
        let buckets = self.blocks.len() - 1;
        let mut starts = Vec::with_capacity(buckets + 1);
        let mut sum = 0;
        starts.push(0);
        for bucket in 0..buckets {
            sum += self.counts.iter().map(|counts| counts[bucket] as usize).sum::<usize>();
            starts.push(sum);
        }
        starts
    }

    /// Cuts `array` into one piece for each chunk and bucket: bucket by bucket, in it chunk by chunk.
    fn pieces<'a, T>(&self, array: &'a mut [T]) -> Vec<Vec<Piece<'a, T>>> {
        let buckets = self.blocks.len() - 1;
        let mut pieces: Vec<Vec<_>> =
            self.counts.iter().map(|_| Vec::with_capacity(buckets)).collect();
        let (mut at, mut rest) = (0, array);
        for bucket in 0..buckets {
            for (counts, pieces) in self.counts.iter().zip(&mut pieces) {
                let (piece, after) = rest.split_at_mut(counts[bucket] as usize);
                pieces.push((at, piece));
                at += counts[bucket] as usize;
                rest = after;
            }
        }
        pieces
    }
}

/// Runs of 2^shift blocks.
struct Bins {
    places: Places,
    shift: u32,
    count: usize,
}

impl Bins {
    fn of(&self, p: [f32; 3]) -> usize {
        (self.places.of(p) >> self.shift) as usize
    }
}

#[simd]
fn count_points<S: Simd>(simd: S, bins: &Bins, points: &[[f32; 3]]) -> Vec<u32> {
    // Four counts for each bucket: neighbours in the file often share one, and would wait for it.
    let mut counts = vec![[0u32; 4]; bins.count];
    let rows = bins.places.in_rows();
    let batches = points.chunks_exact(BATCH);
    let rest = batches.remainder();
    for batch in batches {
        let places = of_points(simd, &rows, batch);
        for i in 0..BATCH {
            counts[(places[i] >> bins.shift) as usize][i % 4] += 1;
        }
    }
    for point in rest {
        counts[bins.of(*point)][0] += 1;
    }
    counts.iter().map(|c| c[0] + c[1] + c[2] + c[3]).collect()
}

/// Scatters the particles of `source` to `particles`, bucket by bucket, and their radii to `radii`
/// where they differ. Positions that were handed over are gone afterwards.
pub(crate) fn scatter(
    mut source: Source<'_>,
    (survey, buckets): (&Survey, &Buckets),
    particles: &mut [Particle],
    radii: &mut [f32],
    level: Level,
) {
    let mut pieces = buckets.pieces(particles);
    let mut pieces_of_radii = match source.radii {
        Radii::Each(_) => buckets.pieces(radii),
        Radii::Uniform(_) => Vec::new(),
    };
    let step = if source.owns() { CHUNKS_OF_ROUND } else { CHUNKS };
    for first in (0..CHUNKS).step_by(step).rev() {
        let chunks = &survey.chunks[first..];
        let pieces = pieces.split_off(first);
        match source.radii {
            Radii::Uniform(_) => {
                let work = chunks[..step].par_iter().zip(pieces).with_max_len(1);
                work.for_each(|(chunk, pieces)| {
                    let mut to = Streams::new(pieces);
                    scatter_chunk(&source, (chunk, buckets), &mut to, level);
                    to.finish();
                });
            }
            Radii::Each(radii_of) => {
                let pieces = pieces.into_par_iter().zip(pieces_of_radii.split_off(first));
                let work = chunks[..step].par_iter().zip(pieces).with_max_len(1);
                work.for_each(|(chunk, (particles, radii))| {
                    let (particles, radii) = (Streams::new(particles), Streams::new(radii));
                    let mut to = WithRadii { particles, radii, radii_of };
                    scatter_chunk(&source, (chunk, buckets), &mut to, level);
                    to.particles.finish();
                    to.radii.finish();
                });
            }
        }
        source.keep(chunks[0].range.start);
    }
}

/// Where particles go, by bucket.
trait Put {
    fn put(&mut self, bucket: usize, particle: Particle);
}

impl Put for Streams<'_, Particle> {
    #[inline(always)]
    fn put(&mut self, bucket: usize, particle: Particle) {
        self.put(bucket, particle);
    }
}

/// Streams of particles and of their radii.
struct WithRadii<'a> {
    particles: Streams<'a, Particle>,
    radii: Streams<'a, f32>,
    /// In the file's order.
    radii_of: &'a [f32],
}

impl Put for WithRadii<'_> {
    #[inline(always)]
    fn put(&mut self, bucket: usize, particle: Particle) {
        self.particles.put(bucket, particle);
        self.radii.put(bucket, self.radii_of[particle.index as usize]);
    }
}

fn scatter_chunk(
    source: &Source<'_>,
    (chunk, buckets): (&Chunk, &Buckets),
    to: &mut impl Put,
    level: Level,
) {
    match source.whole(chunk) {
        Some(points) => {
            let first = chunk.range.start as u32;
            dispatch!(level, simd => scatter_points(simd, buckets, (points, first), to));
        }
        None => source.items(chunk.range.clone()).for_each(|particle| {
            to.put(buckets.of(buckets.places.of(particle.center)), particle);
        }),
    }
}

#[simd]
fn scatter_points<S: Simd, P: Put>(
    simd: S,
    buckets: &Buckets,
    (points, first): (&[[f32; 3]], u32),
    to: &mut P,
) {
    let rows = buckets.places.in_rows();
    let numbers: &[f32] = bytemuck::cast_slice(points);
    let index_lane = mask32x4::from_bitmask(simd, 0b1000);
    // Particles are read four numbers at a time, so that the last one is not read by sixteens.
    let whole = points.len().saturating_sub(1) / BATCH * BATCH;
    for at in (0..whole).step_by(BATCH) {
        let places = of_points(simd, &rows, &points[at..at + BATCH]);
        let batch = &numbers[3 * at..3 * (at + BATCH) + 1];
        for i in 0..BATCH {
            let center = f32x4::from_slice(simd, &batch[3 * i..3 * i + 4]);
            let index = u32x4::splat(simd, first + (at + i) as u32).bitcast::<f32x4<S>>();
            let particle: [f32; 4] = index_lane.select(index, center).into();
            to.put(buckets.of(places[i]), bytemuck::cast(particle));
        }
    }
    for (i, point) in points.iter().enumerate().skip(whole) {
        let particle = Particle { center: *point, index: first + i as u32 };
        to.put(buckets.of(buckets.places.of(*point)), particle);
    }
}
