//! Columns as stretches of their rays, merged as they come: exact, for any order.
//!
//! Each column has one open span. A stretch that meets it, or comes within the gap g of it, becomes part
//! of it; else whichever of the two lies nearer is written to a log, and the other one is open. Near to
//! far, as the stretches mostly come, the log of a column is its list of spans. Where they did not, some
//! entries of the log are out of order or within the gap: such a column is sorted and merged in the end.
//!
//! The result does not depend on the order. Stretches within the gap of each other are in one span
//! whatever comes later, since more stretches make what is empty only shorter; and spans that are not
//! within the gap in the end never were.

use fearless_simd::{Simd, f32x16, prelude::*, u32x16};

use crate::Spans;
use crate::compress::{Span, TileSpans};
use crate::items::{BLOCK, LANES};
use crate::tile::{Lanes, Stretch, TileRays};

/// Sixteen columns.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
struct Open {
    entry: Lanes,
    exit: Lanes,
    /// (g / |direction|)²: the square of the gap in depth.
    gap2: Lanes,
}

/// The particles of the ends of sixteen open spans.
#[derive(Clone, Copy, Debug)]
struct Ends {
    entry: [u32; LANES],
    exit: [u32; LANES],
}

/// The columns of a tile. With `IDS` each end of a span knows its particle.
#[derive(Debug, Default)]
pub(crate) struct Intervals<const IDS: bool> {
    open: Vec<Open>,
    ends: Vec<Ends>,
    log: Log,
    lists: Lists,
}

/// Spans that are no longer open, in the order they were closed.
#[derive(Debug, Default)]
struct Log {
    len: usize,
    /// Column: its block and its lane.
    column: Vec<u32>,
    entry: Vec<f32>,
    exit: Vec<f32>,
    entry_of: Vec<u32>,
    exit_of: Vec<u32>,
}

/// The spans of all columns, column after column.
#[derive(Debug, Default)]
struct Lists {
    starts: Vec<u32>,
    spans: Vec<Span>,
    ends: Vec<[u32; 2]>,
}

/// Whether a stretch that is empty from `from` to `to` is no gap; negative ones are not empty at all.
#[inline(always)]
fn bridged(from: f32, to: f32, gap2: f32) -> bool {
    let empty = (to - from).max(0.0);
    empty * empty <= gap2
}

impl<const IDS: bool> Intervals<IDS> {
    /// Begins a tile. `gap` is in world units.
    #[inline(always)]
    pub fn begin<S: Simd>(&mut self, simd: S, rays: &TileRays, gap: f32) {
        self.open.clear();
        self.ends.clear();
        self.log.len = 0;
        let gap2 = f32x16::splat(simd, gap * gap);
        for inverse_q in &rays.inverse_q {
            let mut open = Open {
                entry: Lanes([f32::INFINITY; LANES]),
                exit: Lanes([f32::NEG_INFINITY; LANES]),
                gap2: Lanes([0.0; LANES]),
            };
            (inverse_q.load(simd) * gap2).store_slice(&mut open.gap2.0);
            self.open.push(open);
            if IDS {
                self.ends.push(Ends { entry: [0; LANES], exit: [0; LANES] });
            }
        }
    }

    /// Whether depths `front` to `back` lie in the open spans of all columns of a block.
    #[inline(always)]
    pub fn holds<S: Simd>(&self, simd: S, block: usize, front: f32, back: f32) -> bool {
        let open = &self.open[block];
        let within = open.entry.load(simd).simd_lt(f32x16::splat(simd, front))
            & open.exit.load(simd).simd_gt(f32x16::splat(simd, back));
        within.all_true()
    }

    /// Adds a stretch of each ray of a block that is hit, all of one particle.
    #[inline(always)]
    pub fn put<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>, index: u32) {
        let open = &mut self.open[block];
        let (entry, exit) = (open.entry.load(simd), open.exit.load(simd));
        let zero = f32x16::splat(simd, 0.0);
        let empty = (new.entry - exit).max(entry - new.exit).max(zero);
        let meets = (empty * empty).simd_le(open.gap2.load(simd));
        let joins = new.hit & meets;
        joins.select(entry.min(new.entry), entry).store_slice(&mut open.entry.0);
        joins.select(exit.max(new.exit), exit).store_slice(&mut open.exit.0);
        if IDS {
            self.join_ends(simd, (block, index), &Stretch { hit: joins, entry, exit }, new);
        }
        let apart = new.hit & !meets;
        if apart.any_true() {
            self.part(simd, (block, index), &Stretch { hit: apart, entry, exit }, new);
        }
    }

    /// Tells the ends of open spans that `before` chooses their particle; at equal depth the lower index.
    #[inline(always)]
    fn join_ends<S: Simd>(
        &mut self,
        simd: S,
        (block, index): (usize, u32),
        before: &Stretch<S>,
        new: &Stretch<S>,
    ) {
        let (joins, entry, exit) = (before.hit, before.entry, before.exit);
        let index = u32x16::splat(simd, index);
        let ends = &mut self.ends[block];
        let entry_of = u32x16::from_slice(simd, &ends.entry);
        let tie = new.entry.simd_eq(entry) & index.simd_lt(entry_of);
        let first = joins & (new.entry.simd_lt(entry) | tie);
        first.select(index, entry_of).store_slice(&mut ends.entry);
        let exit_of = u32x16::from_slice(simd, &ends.exit);
        let tie = new.exit.simd_eq(exit) & index.simd_lt(exit_of);
        let last = joins & (new.exit.simd_gt(exit) | tie);
        last.select(index, exit_of).store_slice(&mut ends.exit);
    }

    /// Takes stretches that do not meet the open span of their column, which `before` chooses: the
    /// nearer one is logged.
    #[inline(always)]
    fn part<S: Simd>(
        &mut self,
        simd: S,
        (block, index): (usize, u32),
        before: &Stretch<S>,
        new: &Stretch<S>,
    ) {
        let (apart, entry, exit) = (before.hit, before.entry, before.exit);
        let open = &mut self.open[block];
        let later = apart & new.entry.simd_gt(exit);
        let none = exit.simd_eq(f32x16::splat(simd, f32::NEG_INFINITY));
        let entry_now = open.entry.load(simd);
        let exit_now = open.exit.load(simd);
        later.select(new.entry, entry_now).store_slice(&mut open.entry.0);
        later.select(new.exit, exit_now).store_slice(&mut open.exit.0);
        let closed = apart & !none;
        if IDS {
            let ends = &mut self.ends[block];
            let index = u32x16::splat(simd, index);
            let entry_of = u32x16::from_slice(simd, &ends.entry);
            let exit_of = u32x16::from_slice(simd, &ends.exit);
            later.select(index, entry_of).store_slice(&mut ends.entry);
            later.select(index, exit_of).store_slice(&mut ends.exit);
            let of = (later.select(entry_of, index), later.select(exit_of, index));
            self.log.reserve::<true>();
            self.log.add_ends(of, closed);
        } else {
            self.log.reserve::<false>();
        }
        let span = (later.select(entry, new.entry), later.select(exit, new.exit));
        self.log.add(simd, block, span, closed);
    }

    /// Ends the tile: its spans, at most `most` of each pixel.
    pub fn finish(&mut self, rays: &TileRays, width: u32, most: usize) -> TileSpans {
        let (log, lists) = (&self.log, &mut self.lists);
        lists.sort::<IDS>(log, &self.open, &self.ends);
        let mut spans = TileSpans::default();
        let pixels = rays.pixels.0 * rays.pixels.1;
        spans.counts.reserve_exact(pixels as usize);
        spans.depths.reserve_exact(2 * lists.spans.len());
        for y in 0..rays.pixels.1 {
            for x in 0..rays.pixels.0 {
                let block = (y / BLOCK) as usize * rays.side + (x / BLOCK) as usize;
                let lane = (y % BLOCK * BLOCK + x % BLOCK) as usize;
                let column = block * LANES + lane;
                let range = lists.starts[column] as usize..lists.starts[column + 1] as usize;
                let list = &mut lists.spans[range.clone()];
                let ends = if IDS { &mut lists.ends[range] } else { &mut [][..] };
                let gap2 = self.open[block].gap2.0[lane];
                let whole = list.windows(2).all(|w| !bridged(w[0][1], w[1][0], gap2));
                let count = if whole { list.len() } else { merge(list, ends, gap2) };
                let pixel = (rays.corner.1 + y) * width + rays.corner.0 + x;
                let ends = &ends[..count.min(ends.len())];
                spans.add((pixel, most), &list[..count], ends);
            }
        }
        spans
    }
}

impl Log {
    /// Makes room for sixteen more.
    #[inline(always)]
    fn reserve<const IDS: bool>(&mut self) {
        if self.len + LANES > self.column.len() {
            self.grow::<IDS>();
        }
    }

    #[cold]
    fn grow<const IDS: bool>(&mut self) {
        let len = (2 * self.column.len()).max(1 << 12);
        self.column.resize(len, 0);
        self.entry.resize(len, 0.0);
        self.exit.resize(len, 0.0);
        self.entry_of.resize(if IDS { len } else { 0 }, 0);
        self.exit_of.resize(if IDS { len } else { 0 }, 0);
    }

    /// Adds the chosen ones of sixteen spans.
    #[inline(always)]
    fn add<S: Simd>(
        &mut self,
        simd: S,
        block: usize,
        (entry, exit): (f32x16<S>, f32x16<S>),
        chosen: <f32x16<S> as SimdBase<S>>::Mask,
    ) {
        let column = u32x16::from_slice(simd, &LANE) + (block * LANES) as u32;
        let to = self.len..self.len + LANES;
        column.compress(chosen).store_slice(&mut self.column[to.clone()]);
        entry.compress(chosen).store_slice(&mut self.entry[to.clone()]);
        exit.compress(chosen).store_slice(&mut self.exit[to]);
        self.len += chosen.to_bitmask().count_ones() as usize;
    }

    /// Adds the particles of the chosen ones; called before [`Self::add`].
    #[inline(always)]
    fn add_ends<S: Simd>(
        &mut self,
        (entry_of, exit_of): (u32x16<S>, u32x16<S>),
        chosen: <f32x16<S> as SimdBase<S>>::Mask,
    ) {
        let to = self.len..self.len + LANES;
        entry_of.compress(chosen).store_slice(&mut self.entry_of[to.clone()]);
        exit_of.compress(chosen).store_slice(&mut self.exit_of[to]);
    }
}

const LANE: [u32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

impl Lists {
    /// Sorts the log by column, and adds the open span of each to its end.
    fn sort<const IDS: bool>(&mut self, log: &Log, open: &[Open], ends: &[Ends]) {
        let columns = open.len() * LANES;
        let starts = &mut self.starts;
        starts.clear();
        starts.resize(columns + 1, 0);
        for column in &log.column[..log.len] {
            starts[*column as usize] += 1;
        }
        let mut sum = 0;
        for (block, open) in open.iter().enumerate() {
            for lane in 0..LANES {
                let start = &mut starts[block * LANES + lane];
                let count = *start + u32::from(open.exit.0[lane] > f32::NEG_INFINITY);
                *start = sum;
                sum += count;
            }
        }
        self.spans.clear();
        self.spans.resize(sum as usize, [0.0; 2]);
        self.ends.clear();
        self.ends.resize(if IDS { sum as usize } else { 0 }, [Spans::NO_PARTICLE; 2]);
        for i in 0..log.len {
            let next = &mut starts[log.column[i] as usize];
            self.spans[*next as usize] = [log.entry[i], log.exit[i]];
            if IDS {
                self.ends[*next as usize] = [log.entry_of[i], log.exit_of[i]];
            }
            *next += 1;
        }
        for (block, open) in open.iter().enumerate() {
            for lane in 0..LANES {
                if open.exit.0[lane] > f32::NEG_INFINITY {
                    let next = &mut starts[block * LANES + lane];
                    self.spans[*next as usize] = [open.entry.0[lane], open.exit.0[lane]];
                    if IDS {
                        let ends = &ends[block];
                        self.ends[*next as usize] = [ends.entry[lane], ends.exit[lane]];
                    }
                    *next += 1;
                }
            }
        }
        // Each start has become the next one's.
        starts.copy_within(..columns, 1);
        starts[0] = 0;
    }
}

/// Sorts the spans of a column and merges those within the gap. Gives how many there are.
#[cold]
fn merge(list: &mut [Span], ends: &mut [[u32; 2]], gap2: f32) -> usize {
    let of = |i: usize| ends.get(i).copied().unwrap_or_default();
    let mut all: Vec<(Span, [u32; 2])> =
        list.iter().enumerate().map(|(i, span)| (*span, of(i))).collect();
    all.sort_unstable_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.1[0].cmp(&b.1[0])));
    let mut last = 0;
    for i in 1..all.len() {
        let (span, of) = all[i];
        let into = &mut all[last];
        if !bridged(into.0[1], span[0], gap2) {
            last += 1;
            all[last] = (span, of);
        } else if span[1] > into.0[1] || (span[1] == into.0[1] && of[1] < into.1[1]) {
            (into.0[1], into.1[1]) = (span[1], of[1]);
        }
    }
    for (i, (span, of)) in all[..=last].iter().enumerate() {
        list[i] = *span;
        if let Some(ends) = ends.get_mut(i) {
            *ends = *of;
        }
    }
    last + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merging_is_the_union_with_gaps_bridged() {
        let mut list = [[5.0, 6.0], [1.0, 2.0], [2.5, 3.0], [0.0, 0.4], [1.5, 4.0]];
        assert_eq!(merge(&mut list, &mut [], 0.25), 3);
        assert_eq!(list[..3], [[0.0, 0.4], [1.0, 4.0], [5.0, 6.0]]);
        assert_eq!(merge(&mut list[..3], &mut [], 1.0), 1);
        assert_eq!(list[0], [0.0, 6.0]);
    }
}
