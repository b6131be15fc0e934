//! The first sort: particles into buckets, each a run of blocks that fits the cache.
//!
//! Gribble et al. 2007, §4.2, build by *sort-middle* (Ize et al. 2006): a coarse bucket sort, then each
//! thread inserts the particles of its own buckets. The input is cut into chunks; each chunk counts
//! what it has for each bucket, and so knows its own piece of every bucket. The sort is stable.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use crate::places::{BATCH, Places, bounds_of_points, of_points};
use crate::{Particle, Radii};

/// Pieces the input is cut into. Fixed, though the result does not depend on it.
const CHUNKS: usize = 16;

/// The particles to be sorted, in the file's order.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub positions: &'a [[f32; 3]],
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

/// Where the buckets are: 2^shift blocks each.
#[derive(Clone, Copy)]
pub(crate) struct Buckets {
    pub places: Places,
    pub shift: u32,
    pub count: usize,
}

/// How many particles each chunk has for each bucket: `[chunk][bucket]`.
pub(crate) struct Counts(Vec<Vec<u32>>);

impl Counts {
    pub fn of(source: &Source<'_>, survey: &Survey, buckets: &Buckets, level: Level) -> Self {
        let count = |chunk: &Chunk| match source.whole(chunk) {
            Some(points) => dispatch!(level, simd => count_points(simd, buckets, points)),
            None => {
                let mut counts = vec![0; buckets.count];
                for item in source.items(chunk.range.clone()) {
                    counts[(buckets.places.of(item.center) >> buckets.shift) as usize] += 1;
                }
                counts
            }
        };
        Self(survey.chunks.par_iter().with_max_len(1).map(count).collect())
    }

    /// Where each bucket begins, and the end of the last.
    pub fn starts(&self) -> Vec<usize> {
        let buckets = self.0.first().map_or(0, Vec::len);
        let mut starts = Vec::with_capacity(buckets + 1);
        let mut sum = 0;
        starts.push(0);
        for bucket in 0..buckets {
            sum += self.0.iter().map(|counts| counts[bucket] as usize).sum::<usize>();
            starts.push(sum);
        }
        starts
    }

    /// Cuts `array` into one piece for each chunk and bucket: bucket by bucket, in it chunk by chunk.
    fn streams<'a, T: Copy + Default>(&self, array: &'a mut [T]) -> Vec<Vec<Stream<'a, T>>> {
        let buckets = self.0.first().map_or(0, Vec::len);
        let mut streams: Vec<Vec<_>> = self.0.iter().map(|_| Vec::with_capacity(buckets)).collect();
        let mut rest = array;
        let mut at = 0;
        for bucket in 0..buckets {
            for (counts, streams) in self.0.iter().zip(&mut streams) {
                let (piece, after) = rest.split_at_mut(counts[bucket] as usize);
                streams.push(Stream::new(piece, at));
                at += counts[bucket] as usize;
                rest = after;
            }
        }
        streams
    }
}

/// How many elements are written at once.
const LINE: usize = 8;

/// Elements on their way to a piece of an array, a few at a time: so many pieces are open at once that
/// writing each element by itself would wait for memory every time.
struct Stream<'a, T> {
    line: [T; LINE],
    /// Which elements of the line wait.
    from: u32,
    to: u32,
    rest: &'a mut [T],
}

impl<'a, T: Copy + Default> Stream<'a, T> {
    /// A stream to `piece`, which begins at `at` of the array. Lines begin at multiples of their length.
    fn new(piece: &'a mut [T], at: usize) -> Self {
        let from = (at % LINE) as u32;
        Self { line: [T::default(); LINE], from, to: from, rest: piece }
    }

    #[inline(always)]
    fn put(&mut self, value: T) {
        // Not when its last element comes: reading the line would then wait for that to arrive.
        if self.to as usize == LINE {
            self.flush();
        }
        self.line[self.to as usize % LINE] = value;
        self.to += 1;
    }

    #[inline(always)]
    fn flush(&mut self) {
        if self.to - self.from != LINE as u32 {
            return self.flush_part();
        }
        if let Some((place, rest)) = std::mem::take(&mut self.rest).split_first_chunk_mut() {
            *place = self.line;
            self.rest = rest;
        }
        self.to = 0;
    }

    /// Writes a line that is not full: the first or the last of the piece.
    #[cold]
    fn flush_part(&mut self) {
        let waiting = &self.line[self.from as usize..self.to as usize];
        let (place, rest) = std::mem::take(&mut self.rest).split_at_mut(waiting.len());
        place.copy_from_slice(waiting);
        self.rest = rest;
        (self.from, self.to) = (0, 0);
    }
}

#[simd]
fn count_points<S: Simd>(simd: S, buckets: &Buckets, points: &[[f32; 3]]) -> Vec<u32> {
    // Four counts for each bucket: neighbours in the file often share one, and would wait for it.
    let mut counts = vec![[0u32; 4]; buckets.count];
    let rows = buckets.places.in_rows();
    let batches = points.chunks_exact(BATCH);
    let rest = batches.remainder();
    for batch in batches {
        let places = of_points(simd, &rows, batch);
        for i in 0..BATCH {
            counts[(places[i] >> buckets.shift) as usize][i % 4] += 1;
        }
    }
    for point in rest {
        counts[(buckets.places.of(*point) >> buckets.shift) as usize][0] += 1;
    }
    counts.iter().map(|c| c[0] + c[1] + c[2] + c[3]).collect()
}

/// Scatters the particles of `source` to `particles`, bucket by bucket, and their radii to `radii`
/// where they differ.
pub(crate) fn scatter(
    source: &Source<'_>,
    (survey, buckets, counts): (&Survey, &Buckets, &Counts),
    particles: &mut [Particle],
    radii: &mut [f32],
    level: Level,
) {
    let places = counts.streams(particles);
    match source.radii {
        Radii::Uniform(_) => {
            survey.chunks.par_iter().zip(places).with_max_len(1).for_each(|(chunk, places)| {
                scatter_chunk(source, (chunk, buckets), places, level);
            });
        }
        Radii::Each(each) => {
            let radii = counts.streams(radii);
            let work = survey.chunks.par_iter().zip(places.into_par_iter().zip(radii));
            work.with_max_len(1).for_each(|(chunk, (places, radii))| {
                let places: Vec<_> =
                    places.into_iter().zip(radii).map(|(p, r)| WithRadius(p, r, each)).collect();
                scatter_chunk(source, (chunk, buckets), places, level);
            });
        }
    }
}

fn scatter_chunk(
    source: &Source<'_>,
    (chunk, buckets): (&Chunk, &Buckets),
    mut places: Vec<impl Put>,
    level: Level,
) {
    match source.whole(chunk) {
        Some(points) => {
            let first = chunk.range.start as u32;
            dispatch!(level, simd => scatter_points(simd, buckets, (points, first), &mut places));
        }
        None => {
            for item in source.items(chunk.range.clone()) {
                places[(buckets.places.of(item.center) >> buckets.shift) as usize].put(item);
            }
        }
    }
    places.iter_mut().for_each(Put::end);
}

#[simd]
fn scatter_points<S: Simd, P: Put>(
    simd: S,
    buckets: &Buckets,
    (points, first): (&[[f32; 3]], u32),
    places: &mut [P],
) {
    let rows = buckets.places.in_rows();
    let batches = points.chunks_exact(BATCH);
    let rest = batches.remainder();
    let mut index = first;
    for batch in batches {
        let numbers = of_points(simd, &rows, batch);
        for i in 0..BATCH {
            let particle = Particle { center: batch[i], index };
            places[(numbers[i] >> buckets.shift) as usize].put(particle);
            index += 1;
        }
    }
    for point in rest {
        let place = &mut places[(buckets.places.of(*point) >> buckets.shift) as usize];
        place.put(Particle { center: *point, index });
        index += 1;
    }
}

/// Where the next particle of a bucket goes.
trait Put: Send {
    fn put(&mut self, particle: Particle);

    /// Writes what waits.
    fn end(&mut self);
}

impl Put for Stream<'_, Particle> {
    #[inline(always)]
    fn put(&mut self, particle: Particle) {
        self.put(particle);
    }

    fn end(&mut self) {
        self.flush();
    }
}

/// A stream of particles, the same of their radii, and all radii in the file's order.
struct WithRadius<'a>(Stream<'a, Particle>, Stream<'a, f32>, &'a [f32]);

impl Put for WithRadius<'_> {
    #[inline(always)]
    fn put(&mut self, particle: Particle) {
        self.0.put(particle);
        self.1.put(self.2[particle.index as usize]);
    }

    fn end(&mut self) {
        self.0.flush();
        self.1.flush();
    }
}
