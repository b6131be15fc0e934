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
//!
//! The inner cells come first, by themselves. What they make of a column, its *cores*, waits until a
//! sphere comes that lies behind: one can be far longer than the spheres before it are apart.

use fearless_simd::{Simd, f32x16, prelude::*, u32x16};

use crate::Spans;
use crate::compress::{Span, TileSpans};
use crate::items::{BLOCK, LANES};
use crate::splat::Columns;
use crate::tile::{Lanes, Stretch, TileRays};

/// Which of sixteen lanes.
type Mask<S> = <f32x16<S> as SimdBase<S>>::Mask;

/// Sixteen columns.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
struct Open {
    entry: Lanes,
    exit: Lanes,
    /// (g / |direction|)²: the square of the gap in depth.
    gap2: Lanes,
    /// Entry of the core that waits; +∞ without one.
    core: Lanes,
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
    /// In world units.
    gap: f32,
    /// Blocks along the tile's edge.
    side: usize,
    open: Vec<Open>,
    ends: Vec<Ends>,
    log: Log,
    lists: Lists,
    /// Exits of the cores that wait.
    core_exits: Vec<Lanes>,
    /// All cores, and the next one of each pixel, where some pixel has several.
    cores: Lists,
    next_core: Vec<u32>,
}

/// Spans that are no longer open, in the order they were closed.
#[derive(Debug, Default)]
struct Log {
    len: usize,
    /// The tile's pixel, row by row.
    pixel: Vec<u32>,
    entry: Vec<f32>,
    exit: Vec<f32>,
    entry_of: Vec<u32>,
    exit_of: Vec<u32>,
}

/// The spans of all pixels of a tile, row by row.
#[derive(Debug, Default)]
struct Lists {
    starts: Vec<u32>,
    /// How many spans there are; what follows them has any value.
    count: usize,
    spans: Vec<Span>,
    ends: Vec<[u32; 2]>,
}

const INFINITE: Lanes = Lanes([f32::INFINITY; LANES]);
const MINUS_INFINITE: Lanes = Lanes([f32::NEG_INFINITY; LANES]);

/// Whether a stretch that is empty from `from` to `to` is no gap; negative ones are not empty at all.
#[inline(always)]
fn bridged(from: f32, to: f32, gap2: f32) -> bool {
    let empty = (to - from).max(0.0);
    empty * empty <= gap2
}

impl<const IDS: bool> Columns for Intervals<IDS> {
    #[inline(always)]
    fn begin<S: Simd>(&mut self, simd: S, rays: &TileRays) {
        self.side = rays.side;
        self.open.clear();
        self.ends.clear();
        self.log.len = 0;
        self.next_core.clear();
        let gap2 = f32x16::splat(simd, self.gap * self.gap);
        for inverse_q in &rays.inverse_q {
            let mut open =
                Open { entry: INFINITE, exit: MINUS_INFINITE, gap2: INFINITE, core: INFINITE };
            (inverse_q.load(simd) * gap2).store_slice(&mut open.gap2.0);
            self.open.push(open);
            if IDS {
                self.ends.push(Ends { entry: [0; LANES], exit: [0; LANES] });
            }
        }
        self.close_outside(rays);
    }

    /// Adds a stretch of inner cells.
    #[inline(always)]
    fn put_core<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>) {
        self.join(simd, block, new, Spans::NO_PARTICLE);
    }

    /// All inner cells have come: what they make waits.
    fn settle(&mut self) {
        self.core_exits.clear();
        if self.log.len > 0 {
            return self.settle_lists();
        }
        for open in &mut self.open {
            self.core_exits.push(open.exit);
            for lane in 0..LANES {
                if is_span(open.entry.0[lane], open.exit.0[lane]) {
                    open.core.0[lane] = open.entry.0[lane];
                    (open.entry.0[lane], open.exit.0[lane]) = (f32::INFINITY, f32::NEG_INFINITY);
                }
            }
        }
    }

    #[inline(always)]
    fn reach<S: Simd>(&mut self, simd: S, block: usize, front: f32) {
        let front = f32x16::splat(simd, front);
        let due = self.open[block].core.load(simd).simd_lt(front);
        if due.any_true() {
            self.wake(simd, block, due, front);
        }
    }

    #[inline(always)]
    fn put<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>, index: u32) {
        self.join(simd, block, new, index);
    }

    /// The cores that still wait.
    #[inline(always)]
    fn end<S: Simd>(&mut self, simd: S) {
        let infinity = f32x16::splat(simd, f32::INFINITY);
        for block in 0..self.open.len() {
            let due = self.open[block].core.load(simd).simd_lt(infinity);
            if due.any_true() {
                self.wake(simd, block, due, infinity);
            }
        }
    }
}

impl<const IDS: bool> Intervals<IDS> {
    /// Columns that bridge a gap, in world units.
    pub fn new(gap: f32) -> Self {
        Self { gap, ..Self::default() }
    }

    /// Columns outside the picture hold all there can be, so that nothing is ever logged of them.
    fn close_outside(&mut self, rays: &TileRays) {
        let pixels = rays.side as u32 * BLOCK;
        if rays.pixels == (pixels, pixels) {
            return;
        }
        for (block, open) in self.open.iter_mut().enumerate() {
            let (x0, y0) = ((block % rays.side) as u32 * BLOCK, (block / rays.side) as u32 * BLOCK);
            for lane in 0..LANES {
                let (x, y) = (x0 + lane as u32 % BLOCK, y0 + lane as u32 / BLOCK);
                if x >= rays.pixels.0 || y >= rays.pixels.1 {
                    open.entry.0[lane] = f32::NEG_INFINITY;
                    open.exit.0[lane] = f32::INFINITY;
                }
            }
        }
    }

    /// Settles where some columns have several cores.
    #[cold]
    fn settle_lists(&mut self) {
        self.cores.sort::<false>(&self.log, &self.open, &[]);
        self.log.len = 0;
        self.next_core.extend_from_slice(&self.cores.starts);
        for (block, open) in self.open.iter_mut().enumerate() {
            self.core_exits.push(MINUS_INFINITE);
            for lane in 0..LANES {
                let pixel = pixel_of(self.side, block, lane);
                let (from, to) = (self.cores.starts[pixel], self.cores.starts[pixel + 1]);
                if from == to {
                    continue;
                }
                (open.entry.0[lane], open.exit.0[lane]) = (f32::INFINITY, f32::NEG_INFINITY);
                // In order, so that none is woken before its time.
                let list = &mut self.cores.spans[from as usize..to as usize];
                list.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
                (open.core.0[lane], self.core_exits[block].0[lane]) = (list[0][0], list[0][1]);
                self.next_core[pixel] += 1;
            }
        }
    }

    /// Adds the cores that are due: those that begin before `until`.
    #[inline(always)]
    fn wake<S: Simd>(&mut self, simd: S, block: usize, mut due: Mask<S>, until: f32x16<S>) {
        while due.any_true() {
            let entry = self.open[block].core.load(simd);
            let exit = self.core_exits[block].load(simd);
            self.join(simd, block, &Stretch { hit: due, entry, exit }, Spans::NO_PARTICLE);
            let none = f32x16::splat(simd, f32::INFINITY);
            due.select(none, entry).store_slice(&mut self.open[block].core.0);
            if self.next_core.is_empty() {
                return;
            }
            self.next_cores(block, due.to_bitmask());
            due &= self.open[block].core.load(simd).simd_lt(until);
        }
    }

    /// Lets the next cores of some lanes wait.
    #[cold]
    fn next_cores(&mut self, block: usize, lanes: u64) {
        for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
            let pixel = pixel_of(self.side, block, lane);
            let next = self.next_core[pixel];
            if next < self.cores.starts[pixel + 1] {
                let [entry, exit] = self.cores.spans[next as usize];
                self.open[block].core.0[lane] = entry;
                self.core_exits[block].0[lane] = exit;
                self.next_core[pixel] += 1;
            }
        }
    }

    /// Adds a stretch of each ray of a block that is hit, all of one particle.
    ///
    /// Where it does not meet the open span, the nearer one of the two is logged.
    #[inline(always)]
    fn join<S: Simd>(&mut self, simd: S, block: usize, new: &Stretch<S>, index: u32) {
        let open = &mut self.open[block];
        let (entry, exit) = (open.entry.load(simd), open.exit.load(simd));
        let zero = f32x16::splat(simd, 0.0);
        let empty = (new.entry - exit).max(entry - new.exit).max(zero);
        let meets = (empty * empty).simd_le(open.gap2.load(simd));
        let joins = new.hit & meets;
        let apart = new.hit & !meets;
        let later = apart & new.entry.simd_gt(exit);
        let none = exit.simd_eq(f32x16::splat(simd, f32::NEG_INFINITY));
        let closed = apart & !none;
        let joined = joins.select(entry.min(new.entry), entry);
        later.select(new.entry, joined).store_slice(&mut open.entry.0);
        let joined = joins.select(exit.max(new.exit), exit);
        later.select(new.exit, joined).store_slice(&mut open.exit.0);
        if IDS {
            let before = Stretch { hit: joins, entry, exit };
            self.tell_ends(simd, (block, index), (&before, new), (later, closed));
        }
        if closed.any_true() {
            let span = (later.select(entry, new.entry), later.select(exit, new.exit));
            self.log.reserve::<IDS>();
            self.log.add(simd, (pixel_of(self.side, block, 0), self.side), span, closed);
        }
    }

    /// Tells the ends of open spans their particle, at equal depth the lower index, and those of spans
    /// that are logged.
    #[inline(always)]
    fn tell_ends<S: Simd>(
        &mut self,
        simd: S,
        (block, index): (usize, u32),
        (before, new): (&Stretch<S>, &Stretch<S>),
        (later, closed): (Mask<S>, Mask<S>),
    ) {
        let index = u32x16::splat(simd, index);
        let ends = &mut self.ends[block];
        let entry_of = u32x16::from_slice(simd, &ends.entry);
        let tie = new.entry.simd_eq(before.entry) & index.simd_lt(entry_of);
        let first = before.hit & (new.entry.simd_lt(before.entry) | tie);
        (first | later).select(index, entry_of).store_slice(&mut ends.entry);
        let exit_of = u32x16::from_slice(simd, &ends.exit);
        let tie = new.exit.simd_eq(before.exit) & index.simd_lt(exit_of);
        let last = before.hit & (new.exit.simd_gt(before.exit) | tie);
        (last | later).select(index, exit_of).store_slice(&mut ends.exit);
        let logged = (later.select(entry_of, index), later.select(exit_of, index));
        self.log.reserve::<IDS>();
        self.log.add_ends(logged, closed);
    }

    /// The tile's spans, at most `most` of each pixel.
    pub fn finish(&mut self, rays: &TileRays, width: u32, most: usize) -> TileSpans {
        self.lists.sort::<IDS>(&self.log, &self.open, &self.ends);
        let pixels = rays.pixels.0 * rays.pixels.1;
        let mut spans = TileSpans::with_capacity(pixels as usize, self.lists.count, IDS);
        for y in 0..rays.pixels.1 {
            let first = (rays.corner.1 + y) * width + rays.corner.0;
            self.finish_row(rays, (y as usize, first), most, &mut spans);
        }
        spans
    }

    /// Adds row `y` of the tile, whose first pixel is number `first` of the picture.
    fn finish_row(
        &mut self,
        rays: &TileRays,
        (y, first): (usize, u32),
        most: usize,
        to: &mut TileSpans,
    ) {
        let row = y * self.side * BLOCK as usize;
        // Where what has not been added yet begins.
        let mut from = self.lists.starts[row] as usize;
        for x in 0..rays.pixels.0 as usize {
            let range =
                self.lists.starts[row + x] as usize..self.lists.starts[row + x + 1] as usize;
            if range.len() > 1 {
                let lane = y % BLOCK as usize * BLOCK as usize + x % BLOCK as usize;
                let block = y / BLOCK as usize * self.side + x / BLOCK as usize;
                let gap2 = self.open[block].gap2.0[lane];
                let list = &mut self.lists.spans[range.clone()];
                let whole = list.windows(2).all(|w| !bridged(w[0][1], w[1][0], gap2));
                if !whole || list.len() > most {
                    let (before, at) = (from..range.start, range.clone());
                    from = range.end;
                    self.add_as_they_are(before, to);
                    let list = &mut self.lists.spans[at.clone()];
                    let ends = if IDS { &mut self.lists.ends[at] } else { &mut [][..] };
                    let count = if whole { list.len() } else { merge(list, ends, gap2) };
                    let ends = &ends[..count.min(ends.len())];
                    to.add((first + x as u32, most), &list[..count], ends);
                    continue;
                }
            }
            to.counts.push(range.len() as u16);
        }
        self.add_as_they_are(from..self.lists.starts[row + rays.pixels.0 as usize] as usize, to);
    }

    /// Adds spans as they are.
    fn add_as_they_are(&self, range: std::ops::Range<usize>, to: &mut TileSpans) {
        to.depths.extend_from_slice(self.lists.spans[range.clone()].as_flattened());
        if IDS {
            to.particles.extend_from_slice(self.lists.ends[range].as_flattened());
        }
    }
}

/// Whether what a column has open is a span: it has one, and is in the picture.
#[inline(always)]
fn is_span(entry: f32, exit: f32) -> bool {
    exit > f32::NEG_INFINITY && entry > f32::NEG_INFINITY
}

/// The pixel of a lane, in a tile of `side` blocks along its edge.
#[inline(always)]
fn pixel_of(side: usize, block: usize, lane: usize) -> usize {
    let (x, y) = (block % side * BLOCK as usize, block / side * BLOCK as usize);
    (y + lane / BLOCK as usize) * side * BLOCK as usize + x + lane % BLOCK as usize
}

impl Log {
    /// Makes room for sixteen more.
    #[inline(always)]
    fn reserve<const IDS: bool>(&mut self) {
        if self.len + LANES > self.pixel.len() {
            self.grow::<IDS>();
        }
    }

    #[cold]
    fn grow<const IDS: bool>(&mut self) {
        let len = (2 * self.pixel.len()).max(1 << 12);
        self.pixel.resize(len, 0);
        self.entry.resize(len, 0.0);
        self.exit.resize(len, 0.0);
        self.entry_of.resize(if IDS { len } else { 0 }, 0);
        self.exit_of.resize(if IDS { len } else { 0 }, 0);
    }

    /// Adds the chosen ones of sixteen spans, of the block whose first pixel is number `first`.
    #[inline(always)]
    fn add<S: Simd>(
        &mut self,
        simd: S,
        (first, side): (usize, usize),
        (entry, exit): (f32x16<S>, f32x16<S>),
        chosen: Mask<S>,
    ) {
        let row = u32x16::from_slice(simd, &ROW) * (side as u32 * BLOCK);
        let pixel = row + u32x16::from_slice(simd, &COLUMN) + first as u32;
        let to = self.len..self.len + LANES;
        pixel.compress(chosen).store_slice(&mut self.pixel[to.clone()]);
        entry.compress(chosen).store_slice(&mut self.entry[to.clone()]);
        exit.compress(chosen).store_slice(&mut self.exit[to]);
        self.len += chosen.to_bitmask().count_ones() as usize;
    }

    /// Adds the particles of the chosen ones; called before [`Self::add`].
    #[inline(always)]
    fn add_ends<S: Simd>(&mut self, (entry_of, exit_of): (u32x16<S>, u32x16<S>), chosen: Mask<S>) {
        let to = self.len..self.len + LANES;
        entry_of.compress(chosen).store_slice(&mut self.entry_of[to.clone()]);
        exit_of.compress(chosen).store_slice(&mut self.exit_of[to]);
    }
}

/// Row and column of each lane in its block.
const ROW: [u32; LANES] = [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3];
const COLUMN: [u32; LANES] = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3];

impl Lists {
    /// Sorts the log by pixel, and adds the open span of each to its end.
    fn sort<const IDS: bool>(&mut self, log: &Log, open: &[Open], ends: &[Ends]) {
        let pixels = open.len() * LANES;
        let side = open.len().isqrt();
        let starts = &mut self.starts;
        starts.clear();
        starts.resize(pixels + 1, 0);
        for pixel in &log.pixel[..log.len] {
            starts[*pixel as usize] += 1;
        }
        let mut sum = 0;
        for (row, starts) in starts[..pixels].chunks_exact_mut(4 * side.max(1)).enumerate() {
            let blocks = &open[row / 4 * side..][..side];
            for (open, starts) in blocks.iter().zip(starts.chunks_exact_mut(4)) {
                for (lane, start) in starts.iter_mut().enumerate() {
                    let lane = row % 4 * 4 + lane;
                    let is_open = is_span(open.entry.0[lane], open.exit.0[lane]);
                    let count = *start + u32::from(is_open);
                    *start = sum;
                    sum += count;
                }
            }
        }
        // One more, which takes what is not open.
        grow(&mut self.spans, sum as usize + 1, [0.0; 2]);
        grow(&mut self.ends, if IDS { sum as usize + 1 } else { 0 }, [Spans::NO_PARTICLE; 2]);
        for i in 0..log.len {
            let next = &mut starts[log.pixel[i] as usize];
            self.spans[*next as usize] = [log.entry[i], log.exit[i]];
            if IDS {
                self.ends[*next as usize] = [log.entry_of[i], log.exit_of[i]];
            }
            *next += 1;
        }
        for (row, starts) in starts[..pixels].chunks_exact_mut(4 * side.max(1)).enumerate() {
            let first = row / 4 * side;
            for (x, starts) in starts.chunks_exact_mut(4).enumerate() {
                let open = &open[first + x];
                for (lane, next) in starts.iter_mut().enumerate() {
                    let lane = row % 4 * 4 + lane;
                    let (entry, exit) = (open.entry.0[lane], open.exit.0[lane]);
                    let is_open = is_span(entry, exit);
                    let place = if is_open { *next } else { sum };
                    self.spans[place as usize] = [entry, exit];
                    if IDS {
                        let ends = &ends[first + x];
                        self.ends[place as usize] = [ends.entry[lane], ends.exit[lane]];
                    }
                    *next += u32::from(is_open);
                }
            }
        }
        self.count = sum as usize;
        // Each start has become the next one's.
        starts.copy_within(..pixels, 1);
        starts[0] = 0;
    }
}

/// Makes a memory at least `len` long; what comes in addition is `value`.
fn grow<T: Copy>(memory: &mut Vec<T>, len: usize, value: T) {
    if memory.len() < len {
        memory.resize(len, value);
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
