//! Blocks: what columns that lie together have in common, so that rays skip them.
//!
//! Zirr & Dachsbacher 2015, §6: "ray casting can be accelerated using a hierarchical representation of the
//! spans akin to mipmapping". A block of level l is a square of 4ˡ × 4ˡ columns. Of the stretches of depth in
//! which all its columns are outside the liquid, or all inside, it knows four: before all surfaces, behind all,
//! the longest one inside, and the longest one outside between. A ray that stays in one of them meets nothing
//! in the block; and what four by four blocks have in common is had from what each has.

use fearless_simd::Level;
use rayon::prelude::*;

use crate::Surfaces;

/// Sizes of blocks: level 1 is the least, this the greatest.
pub const LEVELS: u32 = 4;

/// Columns, or blocks of the level below, along a block's edge.
const EDGE: usize = 4;

/// Columns along the edge of a block of the level.
#[inline]
pub const fn edge(level: u32) -> i32 {
    1 << (2 * level)
}

/// A stretch of nearness without its ends; none if `low` is not less than `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    low: f32,
    high: f32,
}

impl Stretch {
    const NONE: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY };

    #[inline]
    fn both(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    #[inline]
    fn length(self) -> f32 {
        self.high - self.low
    }

    #[inline]
    fn longer(self, other: Self) -> Self {
        if other.length() > self.length() { other } else { self }
    }

    fn is_some(self) -> bool {
        self.low < self.high
    }
}

/// What the columns of one block have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    /// Nearer than this all are outside.
    before: f32,
    /// Farther than this all are outside.
    behind: f32,
    inside: Stretch,
    between: Stretch,
}

impl Block {
    /// Of no columns.
    const NOTHING: Self = Self {
        before: f32::NEG_INFINITY,
        behind: f32::INFINITY,
        inside: Stretch { low: f32::NEG_INFINITY, high: f32::INFINITY },
        between: Stretch::NONE,
    };

    fn outside(&self) -> [Stretch; 3] {
        let before = Stretch { low: self.before, high: f32::INFINITY };
        let behind = Stretch { low: f32::NEG_INFINITY, high: self.behind };
        [before, self.between, behind]
    }

    /// For rays outside.
    fn outside_record(&self, scale: [f32; 2]) -> [u32; 2] {
        let Self { before, behind, between, .. } = self;
        record([*before, between.high, between.low, *behind].map(|n| whole(n, scale)))
    }

    /// For rays inside.
    fn inside_record(&self, scale: [f32; 2]) -> [u32; 2] {
        let Stretch { low, high } = self.inside;
        let [low, high] = [low, high].map(|n| whole(n, scale));
        record([high, low, 0, 0])
    }
}

/// The blocks of one size.
#[derive(Clone, Debug, Default)]
struct Size {
    blocks: Vec<Block>,
    across: usize,
    down: usize,
}

/// Numbers of the levels, the columns' first.
type PerLevel = [i32; LEVELS as usize + 1];

/// Where the records of columns and blocks stand: sixteen after sixteen, those of a block of the next level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    /// The first of each level.
    pub first: PerLevel,
    /// Blocks of the next level side by side.
    pub across: PerLevel,
}

/// The blocks of a picture.
///
/// Of columns and blocks alike rays see records, which say less than is known, but are small: four whole numbers of 16
/// bits, a, d, b and c, that nearness becomes by a function that never falls. Outside the liquid are
/// what is more than a, and what is less than d. If d is even, what is between c and b is outside, too, and what is
/// between b and a and between d + 1 and c inside. If it is odd, b and c are the place of all surfaces of the column.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Of all columns, and of all blocks once for rays inside and once for rays outside; a in the lower half of the first
    /// word, b in that of the second.
    pub(crate) records: Vec<[u32; 2]>,
    /// The surfaces of columns that have many, front to back, then 0, for each row of blocks.
    pub(crate) many: Vec<Vec<Many>>,
    /// For rays outside, for rays inside.
    pub(crate) places: [Places; 2],
    /// Of nearness: what 1 stands for, and how many whole numbers there are to a unit.
    pub(crate) scale: [f32; 2],
    /// What rays go through them with.
    pub(crate) level: Level,
}

/// Surfaces of a column.
pub(crate) type Many = [u16; 16];

/// The least and the greatest of what finite nearness becomes.
pub(crate) const ENDS: [i32; 2] = [1, 0xfffe];

/// Records of a block's parts.
const PARTS: usize = EDGE * EDGE;

impl Blocks {
    /// The blocks of all columns.
    pub fn new(level: Level, surfaces: &Surfaces) -> Self {
        let view = &surfaces.view;
        let [width, height] = [view.size.0 as usize, view.size.1 as usize];
        let [across, down] = [width.div_ceil(EDGE), height.div_ceil(EDGE)];
        let [far, near] = [view.nearness(view.far), view.nearness(view.near)];
        let per_unit = (ENDS[1] - ENDS[0]) as f32 / (near - far);
        let scale = [far, if per_unit.is_finite() { per_unit } else { 0.0 }];
        let mut blocks = vec![Block::NOTHING; across * down];
        let mut records = vec![[0; 2]; across * down * PARTS];
        let rows = blocks.par_chunks_mut(across.max(1));
        let mut many = vec![Vec::new(); down];
        let rows =
            rows.zip(records.par_chunks_mut((across * PARTS).max(1))).zip(&mut many).enumerate();
        rows.for_each_init(Vec::new, |common, (row, ((blocks, records), many))| {
            let ys = row * EDGE..(row * EDGE + EDGE).min(height);
            for (x, block) in blocks.iter_mut().enumerate() {
                let xs = x * EDGE..(x * EDGE + EDGE).min(width);
                for y in ys.clone() {
                    let first = x * PARTS + y % EDGE * EDGE;
                    for (record, x) in records[first..].iter_mut().zip(xs.clone()) {
                        let ends = &surfaces.nearness[surfaces.of(y * width + x)];
                        *record = of_column(ends, scale, many);
                    }
                }
                let rows = ys.clone().map(|y| y * width + xs.start..y * width + xs.end);
                *block = of_columns(surfaces, rows, common);
            }
        });
        let columns = Places { first: [0; _], across: [across as i32; _] };
        let mut all = Self { records, many, places: [columns; 2], scale, level };
        let mut size = Size { blocks, across, down };
        for level in 1..=LEVELS as usize {
            let above = size.grouped();
            for (places, record) in [Block::outside_record, Block::inside_record].iter().enumerate()
            {
                let places = &mut all.places[places];
                places.first[level] = all.records.len() as i32;
                places.across[level] = above.across as i32;
                let end = all.records.len() + above.blocks.len() * PARTS;
                all.records.resize(end, [0; 2]);
                for (i, block) in size.blocks.iter().enumerate() {
                    let [x, y] = [i % size.across, i / size.across];
                    let place = (y / EDGE * above.across + x / EDGE) * PARTS;
                    let place = place + y % EDGE * EDGE + x % EDGE;
                    all.records[places.first[level] as usize + place] = record(block, scale);
                }
            }
            size = above;
        }
        all
    }
}

impl Blocks {
    /// Whether a ray inside the liquid or not meets nothing in the block of the level that a pixel is in,
    /// between two values of nearness, the lower one first.
    #[inline(always)]
    pub(crate) fn skips<const INSIDE: bool>(
        &self,
        level: u32,
        [x, y]: [i32; 2],
        range: [f32; 2],
    ) -> bool {
        let Places { first, across } = &self.places[usize::from(INSIDE)];
        let (x, y) = (x >> (2 * level), y >> (2 * level));
        let block = (y >> 2) * across[level as usize] + (x >> 2);
        let part = first[level as usize] + block * PARTS as i32 + (y & 3) * EDGE as i32 + (x & 3);
        let words = self.records[part as usize];
        let [a, b] = words.map(|word| word & 0xffff);
        let [d, c] = words.map(|word| word >> 16);
        let [low, high] = range.map(|nearness| whole(nearness, self.scale));
        match INSIDE {
            true => b < low && high < a,
            false => a < low || high < d || c < low && high < b,
        }
    }
}

/// Nearness as a whole number; infinite nearness is less or more than all other.
#[inline(always)]
fn whole(nearness: f32, [zero, per_unit]: [f32; 2]) -> u32 {
    match nearness {
        f32::INFINITY => ENDS[1] as u32 + 1,
        f32::NEG_INFINITY => ENDS[0] as u32 - 1,
        _ => {
            let scaled = ((nearness - zero) * per_unit) as i32;
            scaled.saturating_add(ENDS[0]).clamp(ENDS[0], ENDS[1]) as u32
        }
    }
}

/// The record of a column.
#[inline(always)]
fn of_column(ends: &[f32], scale: [f32; 2], many: &mut Vec<Many>) -> [u32; 2] {
    let (&[a, b, ..], &[.., d]) = (ends, ends) else {
        return [0; 2];
    };
    if !ends.is_sorted_by(|near, far| near >= far) {
        // Where smoothing has turned a span inside out, nothing is known.
        return [(ENDS[1] as u32 + 1) | (1 << 16), u32::MAX];
    }
    let [a, b, d] = [a, b, d].map(|nearness| whole(nearness, scale));
    if ends.len() > 4 {
        let mut all = [0; 16];
        for (to, nearness) in all.iter_mut().zip(ends) {
            *to = whole(*nearness, scale) as u16;
        }
        // Of more than there is room for, nothing is known.
        let place = if ends.len() <= all.len() { many.len() as u32 } else { u32::MAX };
        many.extend((place != u32::MAX).then_some(all));
        return [a | (d.saturating_sub(1) | 1) << 16, place];
    }
    let c = ends.get(2).map_or(b, |nearness| whole(*nearness, scale));
    record([a, b, c, d])
}

/// A record without a place.
#[inline(always)]
fn record([a, b, c, d]: [u32; 4]) -> [u32; 2] {
    [a | (d & !1) << 16, b | c << 16]
}

/// What some columns, given row by row, have in common.
fn of_columns(
    surfaces: &Surfaces,
    rows: impl Iterator<Item = std::ops::Range<usize>> + Clone,
    common: &mut Vec<Stretch>,
) -> Block {
    let mut block = Block::NOTHING;
    let mut most = 0;
    for row in rows.clone() {
        let starts = &surfaces.starts[row.start..=row.end];
        for pair in starts.windows(2) {
            let [from, to] = [pair[0] as usize, pair[1] as usize];
            most = most.max(to - from);
            if from == to {
                block.inside = Stretch::NONE;
                continue;
            }
            let [first, last] = [surfaces.nearness[2 * from], surfaces.nearness[2 * to - 1]];
            block.before = block.before.max(first);
            block.behind = block.behind.min(last);
            // Of one span; for more, see below.
            block.inside = block.inside.both(Stretch { low: last, high: first });
        }
    }
    if most < 2 {
        return block;
    }
    let columns = rows.flatten().map(|column| &surfaces.nearness[surfaces.of(column)]);
    if block.inside.is_some() {
        common.clear();
        common.push(Stretch { low: f32::NEG_INFINITY, high: f32::INFINITY });
        for column in columns.clone() {
            keep(common, column.chunks_exact(2).map(|s| Stretch { low: s[1], high: s[0] }));
        }
        block.inside = common.iter().fold(Stretch::NONE, |all, s| all.longer(*s));
    }
    common.clear();
    common.push(Stretch { low: f32::NEG_INFINITY, high: f32::INFINITY });
    for column in columns {
        let ends = |i: usize| column.get(i).copied().unwrap_or(f32::NEG_INFINITY);
        let gaps =
            (1..column.len()).step_by(2).map(|i| Stretch { low: ends(i + 1), high: ends(i) });
        let first = Stretch { low: ends(0), high: f32::INFINITY };
        keep(common, std::iter::once(first).chain(gaps));
    }
    let between = common.iter().filter(|s| s.low > f32::NEG_INFINITY && s.high < f32::INFINITY);
    block.between = between.fold(Stretch::NONE, |all, s| all.longer(*s));
    block
}

/// Leaves of `common` what lies in one of `stretches`, too.
fn keep(common: &mut Vec<Stretch>, stretches: impl Iterator<Item = Stretch> + Clone) {
    let before = common.len();
    for i in 0..before {
        let one = common[i];
        common.extend(stretches.clone().map(|s| one.both(s)).filter(|s| s.is_some()));
    }
    common.drain(..before);
}

impl Size {
    /// The blocks of [`EDGE`]² of these.
    fn grouped(&self) -> Self {
        let [across, down] = [self.across.div_ceil(EDGE), self.down.div_ceil(EDGE)];
        let group = |i: usize| {
            let [x, y] = [i % across.max(1) * EDGE, i / across.max(1) * EDGE];
            let rows = (y..(y + EDGE).min(self.down)).map(|y| y * self.across);
            let xs = x..(x + EDGE).min(self.across);
            let parts = rows.flat_map(|row| &self.blocks[row + xs.start..row + xs.end]);
            in_common(parts)
        };
        let blocks = (0..across * down).into_par_iter().with_min_len(256).map(group).collect();
        Self { blocks, across, down }
    }
}

/// What some blocks have in common.
fn in_common<'a>(parts: impl Iterator<Item = &'a Block> + Clone) -> Block {
    let mut block = Block::NOTHING;
    for part in parts.clone() {
        block.before = block.before.max(part.before);
        block.behind = block.behind.min(part.behind);
        block.inside = block.inside.both(part.inside);
        block.between = block.between.longer(part.between);
    }
    if block.between.is_some() {
        for part in parts {
            let one = block.between;
            block.between =
                part.outside().iter().fold(Stretch::NONE, |s, o| s.longer(one.both(*o)));
        }
    }
    block
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_never_fall() {
        let all = [f32::NEG_INFINITY, f32::MIN, -1.0, 0.25, 0.3, 0.5, 1e6, f32::MAX, f32::INFINITY];
        for per_unit in [0.0, 1e5, f32::MAX] {
            let found = all.map(|nearness| whole(nearness, [0.25, per_unit]));
            assert!(found.is_sorted(), "{per_unit}: {found:?}");
            assert_eq!([found[0], found[all.len() - 1]], [0, 0xffff]);
            let finite = &found[1..all.len() - 1];
            assert!(finite.iter().all(|n| (1..=0xfffe).contains(n)), "{per_unit}: {finite:?}");
        }
    }
}
