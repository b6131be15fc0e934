//! Connect: which ends of spans in neighbouring columns belong to the same surface.
//!
//! Zirr & Dachsbacher 2015, §3.3 and Listing 1. A span is connected to those of a neighbouring column that
//! it overlaps in depth: its entry to the entry of the frontmost, its exit to the exit of the backmost.
//! Where that neighbour overlaps the preceding (following) span of the own column, too, both are walls of a
//! bubble, and the entry (exit) is linked to the preceding exit (following entry). Without a neighbour entry
//! and exit are linked to each other: the surface bends back there.
//!
//! A link is a byte, the four of a surface one word: the place of the linked surface in the neighbour's
//! list, [`PRECEDING`] or [`FOLLOWING`] in the own one. Beyond the edge of the picture a surface goes on as it is: it is
//! linked to itself.

use fearless_simd::{Level, dispatch, f32x16, mask32x16, prelude::*, u8x64, u16x32, u32x16};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use crate::Spans;

/// The way to a neighbouring column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// One pixel to the left.
    Left = 0,
    /// One pixel to the right.
    Right = 1,
    /// One pixel up.
    Up = 2,
    /// One pixel down.
    Down = 3,
}

/// The links of a surface, one for each [`Side`].
pub type Links = [u8; 4];

/// Link to the surface before in the own column.
pub const PRECEDING: u8 = 254;
/// Link to the surface behind in the own column.
pub const FOLLOWING: u8 = 255;
/// Most spans of a column that links can tell apart.
pub const MOST_SPANS: u32 = 126;

impl Side {
    /// All four, in the order of [`Links`].
    pub const ALL: [Self; 4] = [Self::Left, Self::Right, Self::Up, Self::Down];

    /// The neighbour of the pixel (x, y) in a picture of `size`; none beyond its edge.
    pub fn neighbor(self, [x, y]: [usize; 2], size: [usize; 2]) -> Option<[usize; 2]> {
        match self {
            Self::Left => (x > 0).then(|| [x - 1, y]),
            Self::Right => (x + 1 < size[0]).then_some([x + 1, y]),
            Self::Up => (y > 0).then(|| [x, y - 1]),
            Self::Down => (y + 1 < size[1]).then_some([x, y + 1]),
        }
    }
}

/// The links of every surface of `spans`, parallel to its depths. Columns hold at most [`MOST_SPANS`] spans.
pub fn connect(spans: &Spans, level: Level) -> Vec<Links> {
    let mut links = vec![Links::default(); spans.depths.len()];
    rows_mut(&mut links, spans).into_par_iter().enumerate().for_each(|(y, row)| {
        dispatch!(level, simd => connect_row(simd, spans, y, row));
    });
    links
}

/// Those of a row of columns.
///
/// Listing 1 by counting: of a neighbouring column's spans, `front` end before a span and `back` begin before
/// its end. Then the frontmost that overlaps it is number `front`, the backmost `back` − 1, and there is none
/// if `back` is no more than `front`. That the frontmost reaches the preceding span, too, is to say that
/// `front` is less than the preceding one's `back`.
#[simd]
fn connect_row<S: Simd>(simd: S, spans: &Spans, y: usize, row: &mut [Links]) {
    let [width, height] = [spans.size.0 as usize, spans.size.1 as usize];
    let first = spans.starts[y * width] as usize;
    let mut marks = Marks::of(row.len() / 2);
    let mut plain = Vec::new();
    for x in 0..width {
        let pixel = y * width + x;
        let own = spans.of(pixel);
        if own.is_empty() {
            continue;
        }
        let inside = x > 0 && x + 1 < width && y > 0 && y + 1 < height;
        if !inside || !marks.find(simd, spans, pixel, own.start - first) {
            plain.push(x);
        }
    }
    marks.links(simd, row);
    for x in plain {
        let own = spans.of(y * width + x);
        connect_plainly(spans, [x, y], &mut row[2 * (own.start - first)..2 * (own.end - first)]);
    }
}

/// Surfaces of a column that are looked at together.
const LANES: usize = 16;
/// Spans whose links are found together, and their numbers: one for each side.
const SPANS: usize = 16;
const SIDES: usize = 4;

/// What the spans of a row have beside them, with one more before the first and some behind the last.
struct Marks {
    /// On each side, a bit for each surface: of an entry, whether it lies before the span's exit; of an exit,
    /// whether it lies before the span's entry.
    before: Vec<[u16; SIDES]>,
    /// All bits, if the span is not the first one of its column.
    inner: Vec<[u16; SIDES]>,
}

impl Marks {
    fn of(count: usize) -> Self {
        let none = vec![[0; SIDES]; count.next_multiple_of(SPANS) + 2];
        Self { before: none.clone(), inner: none }
    }

    /// Finds those of a column whose first span is number `at`, if the columns around it are short enough.
    #[inline(always)]
    fn find<S: Simd>(&mut self, simd: S, spans: &Spans, pixel: usize, at: usize) -> bool {
        let width = spans.size.0 as usize;
        let mut near = [f32x16::splat(simd, 0.0); SIDES];
        let mut valid = [0; SIDES];
        let pixels = [pixel - 1, pixel + 1, pixel - width, pixel + width];
        for side in 0..SIDES {
            let of = spans.of(pixels[side]);
            let depths = spans.depths.get(2 * of.start..2 * of.start + LANES);
            let Some(depths) = depths.filter(|_| 2 * of.len() <= LANES) else { return false };
            near[side] = f32x16::from_slice(simd, depths);
            valid[side] = ((1_u32 << (2 * of.len())) - 1) as u16;
        }
        let exits = mask32x16::from_bitmask(simd, 0xaaaa);
        let own = column(spans, pixel);
        let own_marks = at + 1..at + 1 + own.len() / 2;
        for (before, span) in self.before[own_marks.clone()].iter_mut().zip(own.chunks_exact(2)) {
            // Before the entry is: not behind the next lower value.
            let [entry, exit] = [span[0].next_down(), span[1]];
            let bound = exits.select(f32x16::splat(simd, entry), f32x16::splat(simd, exit));
            for side in 0..SIDES {
                before[side] = near[side].simd_le(bound).to_bitmask() as u16 & valid[side];
            }
        }
        self.inner[own_marks][1..].fill([u16::MAX; SIDES]);
        true
    }

    /// The links of all spans.
    #[inline(always)]
    fn links<S: Simd>(&self, simd: S, links: &mut [Links]) {
        for (at, links) in (1..).step_by(SPANS).zip(links.chunks_mut(2 * SPANS)) {
            let [entries, exits] = self.ends(simd, at);
            let [more_entries, more_exits] = self.ends(simd, at + SPANS / 2);
            let entries = entries.narrow(more_entries).bitcast::<u32x16<S>>();
            let exits = exits.narrow(more_exits).bitcast::<u32x16<S>>();
            let mut words = [0; 2 * SPANS * SIDES];
            let (low, high) = words.split_at_mut(SPANS * SIDES);
            entries.zip_low(exits).bitcast::<u8x64<S>>().store_slice(low);
            entries.zip_high(exits).bitcast::<u8x64<S>>().store_slice(high);
            let links = bytemuck::cast_slice_mut::<Links, u8>(links);
            links.copy_from_slice(&words[..links.len()]);
        }
    }

    /// The links of the entries, and of the exits, of eight spans.
    #[inline(always)]
    fn ends<S: Simd>(&self, simd: S, at: usize) -> [u16x32<S>; 2] {
        let marks = lanes(simd, &self.before, at);
        let (front, back) = (ended(marks), begun(marks));
        let preceding = begun(lanes(simd, &self.before, at - 1) & lanes(simd, &self.inner, at));
        let following =
            ended(lanes(simd, &self.before, at + 1) | !lanes(simd, &self.inner, at + 1));
        let none = front.simd_ge(back);
        let [to_preceding, to_following] =
            [u16x32::splat(simd, u16::from(PRECEDING)), u16x32::splat(simd, u16::from(FOLLOWING))];
        let entries = front.simd_lt(preceding).select(to_preceding, front << 1);
        let exits = back.simd_gt(following).select(to_following, (back << 1) - 1);
        [none.select(to_following, entries), none.select(to_preceding, exits)]
    }
}

/// The marks of eight spans.
#[inline(always)]
fn lanes<S: Simd>(simd: S, marks: &[[u16; SIDES]], at: usize) -> u16x32<S> {
    u16x32::from_slice(simd, bytemuck::cast_slice(&marks[at..at + SPANS / 2]))
}

/// How many spans end before another one.
#[inline(always)]
fn ended<S: Simd>(marks: u16x32<S>) -> u16x32<S> {
    begun(marks >> 1)
}

/// How many begin before its end.
#[inline(always)]
fn begun<S: Simd>(marks: u16x32<S>) -> u16x32<S> {
    let pairs = (marks & 0x1111) + ((marks >> 2) & 0x1111);
    let fours = (pairs & 0x0f0f) + ((pairs >> 4) & 0x0f0f);
    (fours & 0xff) + (fours >> 8)
}

/// The links of the column of a pixel, side by side.
fn connect_plainly(spans: &Spans, pixel: [usize; 2], links: &mut [Links]) {
    let size = [spans.size.0 as usize, spans.size.1 as usize];
    let column = |[x, y]: [usize; 2]| column(spans, y * size[0] + x);
    for side in Side::ALL {
        match side.neighbor(pixel, size) {
            Some(next) => connect_columns(column(pixel), column(next), (links, side)),
            None => itself(links, side),
        }
    }
}

/// A part of a list of values, one for each surface, for each row of the picture.
pub(crate) fn rows_mut<'a, T>(mut values: &'a mut [T], spans: &Spans) -> Vec<&'a mut [T]> {
    let width = spans.size.0 as usize;
    let mut rows = Vec::with_capacity(spans.size.1 as usize);
    for y in 0..spans.size.1 as usize {
        let count = 2 * (spans.starts[(y + 1) * width] - spans.starts[y * width]) as usize;
        let (row, rest) = values.split_at_mut(count);
        rows.push(row);
        values = rest;
    }
    rows
}

fn column(spans: &Spans, pixel: usize) -> &[f32] {
    let of = spans.of(pixel);
    &spans.depths[2 * of.start..2 * of.end]
}

fn itself(links: &mut [Links], side: Side) {
    links.iter_mut().enumerate().for_each(|(place, links)| links[side as usize] = place as u8);
}

/// Listing 1 for each span of `own`, towards the column `next`.
fn connect_columns(own: &[f32], next: &[f32], (links, side): (&mut [Links], Side)) {
    let side = side as usize;
    // Both columns go front to back, so neither list is ever gone back in.
    let mut front = 0;
    for s in 0..own.len() / 2 {
        let (entry, exit) = (own[2 * s], own[2 * s + 1]);
        while front < next.len() && next[front + 1] < entry {
            front += 2;
        }
        if front >= next.len() || next[front] > exit {
            links[2 * s][side] = FOLLOWING;
            links[2 * s + 1][side] = PRECEDING;
            continue;
        }
        let preceding_reaches = s > 0 && next[front] <= own[2 * s - 1];
        links[2 * s][side] = if preceding_reaches { PRECEDING } else { front as u8 };
        let mut back = front;
        while back + 2 < next.len() && next[back + 2] <= exit {
            back += 2;
        }
        let following_reaches = 2 * s + 2 < own.len() && own[2 * s + 2] <= next[back + 1];
        links[2 * s + 1][side] = if following_reaches { FOLLOWING } else { back as u8 + 1 };
    }
}

/// Columns and their surfaces, to be followed along links.
#[derive(Clone, Copy)]
pub(crate) struct Net<'a> {
    spans: &'a Spans,
    links: &'a [Links],
    size: [usize; 2],
}

/// A surface and the pixel that it is in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub pixel: [usize; 2],
    pub surface: usize,
}

impl<'a> Net<'a> {
    pub fn new(spans: &'a Spans, links: &'a [Links]) -> Self {
        Self { spans, links, size: [spans.size.0 as usize, spans.size.1 as usize] }
    }

    /// The surface that `from` is linked to at a side.
    #[inline]
    pub fn follow(&self, from: Place, side: Side) -> Place {
        match self.links[from.surface][side as usize] {
            PRECEDING => Place { surface: from.surface - 1, ..from },
            FOLLOWING => Place { surface: from.surface + 1, ..from },
            link => {
                let Some(pixel) = side.neighbor(from.pixel, self.size) else { return from };
                let first = self.spans.starts[pixel[1] * self.size[0] + pixel[0]];
                Place { pixel, surface: 2 * first as usize + link as usize }
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The links towards `next` of the two ends of each span of `own`.
    fn links(own: &[f32], next: &[f32]) -> Vec<u8> {
        let mut links = vec![Links::default(); own.len()];
        connect_columns(own, next, (&mut links, Side::Right));
        links.iter().map(|l| l[1]).collect()
    }

    #[test]
    fn overlapping_spans_go_on() {
        assert_eq!(links(&[1.0, 2.0, 4.0, 5.0], &[1.5, 2.5, 4.5, 6.0]), [0, 1, 2, 3]);
        // Of several the frontmost and the backmost.
        assert_eq!(links(&[1.0, 9.0], &[0.0, 0.5, 2.0, 3.0, 5.0, 6.0, 11.0, 12.0]), [2, 5]);
    }

    #[test]
    fn walls_of_a_bubble_are_linked_to_each_other() {
        assert_eq!(links(&[1.0, 4.0, 5.0, 9.0], &[2.0, 8.0]), [0, FOLLOWING, PRECEDING, 1]);
    }

    #[test]
    fn without_a_neighbour_the_surface_bends_back() {
        let alone = [FOLLOWING, PRECEDING];
        assert_eq!(links(&[1.0, 2.0], &[]), alone);
        assert_eq!(links(&[1.0, 2.0], &[3.0, 4.0]), alone);
        assert_eq!(links(&[3.0, 4.0], &[1.0, 2.0]), alone);
        assert_eq!(links(&[3.0, 4.0, 6.0, 7.0], &[6.5, 9.0]), [FOLLOWING, PRECEDING, 0, 1]);
    }

    #[test]
    fn every_side_has_its_links() {
        // Three columns beside each other, one below the middle.
        let mut spans = Spans { size: (3, 2), ..Spans::default() };
        spans.starts = vec![0, 1, 3, 4, 4, 5, 5];
        spans.depths = vec![1.0, 2.0, 1.0, 2.0, 3.0, 4.0, 3.5, 5.0, 0.0, 6.0];
        let links = connect(&spans, Level::new());
        assert_eq!(links[0], [0, 0, 0, FOLLOWING]);
        assert_eq!(links[2], [0, FOLLOWING, 0, 0]);
        assert_eq!(links[3], [1, PRECEDING, 1, FOLLOWING]);
        assert_eq!(links[4], [FOLLOWING, 0, 2, PRECEDING]);
        assert_eq!(links[5], [PRECEDING, 1, 3, 1]);
        assert_eq!(links[8], [FOLLOWING, FOLLOWING, 0, 0]);
        assert_eq!(links[9], [PRECEDING, PRECEDING, 3, 1]);
    }

    /// Columns of up to `most` spans, with many ends at the same depth.
    pub(crate) fn random(size: (u32, u32), most: u64) -> Spans {
        let mut seed = 1_u64;
        let mut random = move |below: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) % below
        };
        let mut spans = Spans { size, near: 0.5, far: 1e3, starts: vec![0], ..Spans::default() };
        for _ in 0..size.0 * size.1 {
            let mut at = 10 + random(4);
            for _ in 0..random(most + 1) {
                let exit = at + random(6);
                spans.depths.extend([at as f32, exit as f32]);
                at = exit + 1 + random(4);
            }
            spans.starts.push(spans.depths.len() as u32 / 2);
        }
        spans
    }

    #[test]
    fn counting_finds_the_same_links() {
        let levels = [Level::new(), Level::baseline()];
        for (most, level) in [1, 2, 5, 8, 12].into_iter().flat_map(|m| levels.map(|l| (m, l))) {
            let spans = random((40, 30), most);
            let links = connect(&spans, level);
            for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let of = spans.of(y * 40 + x);
                let mut expected = vec![Links::default(); 2 * of.len()];
                connect_plainly(&spans, [x, y], &mut expected);
                assert_eq!(links[2 * of.start..2 * of.end], expected, "{most} ({x}, {y})");
            }
        }
    }

    #[test]
    fn links_are_mutual() {
        let spans = random((40, 30), 5);
        let links = connect(&spans, Level::new());
        let net = Net::new(&spans, &links);
        let back = [Side::Right, Side::Left, Side::Down, Side::Up];
        for (x, y) in (0..30).flat_map(|y| (0..40).map(move |x| (x, y))) {
            let of = spans.of(y * 40 + x);
            for at in (2 * of.start..2 * of.end).map(|surface| Place { pixel: [x, y], surface }) {
                for side in Side::ALL {
                    let next = net.follow(at, side);
                    let there = if next.pixel == at.pixel { side } else { back[side as usize] };
                    assert_eq!(net.follow(next, there).surface, at.surface, "{at:?} {side:?}");
                }
            }
        }
    }
}
