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

    #[inline]
    fn holds(self, [low, high]: [f32; 2]) -> bool {
        self.low < low && high < self.high
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
}

/// The blocks of one size.
#[derive(Clone, Debug, Default)]
struct Size {
    blocks: Vec<Block>,
    across: usize,
    down: usize,
}

/// The blocks of a picture.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Those of level 1 first.
    levels: Vec<Size>,
    /// What rays go through them with.
    pub(crate) level: Level,
}

impl Blocks {
    /// The blocks of all columns.
    pub fn new(level: Level, surfaces: &Surfaces) -> Self {
        let [width, height] = [surfaces.view.size.0 as usize, surfaces.view.size.1 as usize];
        let [across, down] = [width.div_ceil(EDGE), height.div_ceil(EDGE)];
        let mut blocks = vec![Block::NOTHING; across * down];
        let rows = blocks.par_chunks_mut(across.max(1)).enumerate();
        rows.for_each_init(Vec::new, |common, (row, blocks)| {
            let ys = row * EDGE..(row * EDGE + EDGE).min(height);
            for (x, block) in blocks.iter_mut().enumerate() {
                let xs = x * EDGE..(x * EDGE + EDGE).min(width);
                let rows = ys.clone().map(|y| y * width + xs.start..y * width + xs.end);
                *block = of_columns(surfaces, rows, common);
            }
        });
        let mut levels = vec![Size { blocks, across, down }];
        while levels.len() < LEVELS as usize {
            let above = levels[levels.len() - 1].grouped();
            levels.push(above);
        }
        Self { levels, level }
    }

    /// Whether a ray inside the liquid or not meets nothing in the block of the level that a pixel is in,
    /// between two values of nearness, the lower one first.
    #[inline(always)]
    pub(crate) fn skips<const INSIDE: bool>(
        &self,
        level: u32,
        [x, y]: [i32; 2],
        range: [f32; 2],
    ) -> bool {
        let (of, shift) = (&self.levels[level as usize - 1], 2 * level);
        let block = &of.blocks[(y >> shift) as usize * of.across + (x >> shift) as usize];
        match INSIDE {
            true => block.inside.holds(range),
            false => {
                let [low, high] = range;
                block.before < low || block.behind > high || block.between.holds(range)
            }
        }
    }
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
