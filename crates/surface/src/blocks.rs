//! Blocks: what columns that lie together have in common, so that rays skip them.
//!
//! Zirr & Dachsbacher 2015, §6: "ray casting can be accelerated using a hierarchical representation of the
//! spans akin to mipmapping". A block is a square of [`EDGE`]² columns. Where, at one depth, all its columns
//! are inside the liquid, or all outside, so is every ray that passes there; the depths between are its
//! *bands*. A ray that passes no band meets nothing in the block. Squares of [`EDGE`]² blocks have bands, too, of
//! theirs.

use rayon::prelude::*;

use crate::Surfaces;

/// Columns along a block's edge.
pub const EDGE: usize = 8;
/// Most bands of a block: of more, those with the least between them become one.
const BANDS: usize = 6;

/// Depths, as nearness, at which the columns of a block differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Band {
    near: f32,
    far: f32,
    /// Whether behind it all columns are inside.
    inside: bool,
}

/// The bands of one block, near ones first.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    bands: [Band; BANDS],
    count: usize,
}

/// The blocks of one size.
#[derive(Clone, Debug, Default)]
struct Level {
    blocks: Vec<Block>,
    across: usize,
}

/// The blocks of a picture, with their surfaces: those of a block lie together, for rays that go up and down.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Blocks of columns, and blocks of these.
    levels: [Level; 2],
    /// Nearness of each surface, block after block, column after column.
    nearness: Vec<f32>,
    /// Where each block begins in it, and the columns of it from there.
    columns: Vec<(u32, [u16; EDGE * EDGE + 1])>,
}

impl Blocks {
    /// The blocks of all columns.
    pub fn new(surfaces: &Surfaces) -> Self {
        let [width, height] = [surfaces.view.size.0 as usize, surfaces.view.size.1 as usize];
        let across = width.div_ceil(EDGE);
        let down = height.div_ceil(EDGE);
        // The blocks side by side hold what the rows of the picture that they cover do.
        let mut nearness = vec![0.0; surfaces.nearness.len()];
        let first = |row: usize| 2 * surfaces.starts[(row * EDGE).min(height) * width] as usize;
        let mut parts = Vec::with_capacity(down);
        let mut rest = &mut nearness[..];
        for row in 0..down {
            let (part, behind) = rest.split_at_mut(first(row + 1) - first(row));
            parts.push(part);
            rest = behind;
        }
        let row = |(row, part): (usize, &mut [f32])| {
            let (mut events, mut at) = (Vec::new(), 0);
            let mut blocks = Vec::with_capacity(across);
            for x in (0..width).step_by(EDGE) {
                let mut columns = [0_u16; EDGE * EDGE + 1];
                let (begin, mut count) = (at, 0);
                for i in 0..EDGE * EDGE {
                    let [x, y] = [x + i % EDGE, row * EDGE + i / EDGE];
                    if x < width && y < height {
                        let of = &surfaces.nearness[surfaces.of(y * width + x)];
                        part[at..at + of.len()].copy_from_slice(of);
                        at += of.len();
                        count += 1;
                    }
                    columns[i + 1] = (at - begin) as u16;
                }
                ends_of_spans((&part[begin..at], &columns), &mut events);
                let block = Block::new(&mut events, count);
                blocks.push((block, ((first(row) + begin) as u32, columns)));
            }
            blocks
        };
        let made: Vec<_> = parts.into_par_iter().enumerate().map(row).collect();
        let (blocks, columns) = made.into_iter().flatten().unzip();
        let small = Level { blocks, across };
        let large = small.grouped(down);
        Self { levels: [small, large], nearness, columns }
    }

    /// The nearness of the surfaces of the column (x, y).
    #[inline]
    pub(crate) fn column(&self, [x, y]: [usize; 2]) -> &[f32] {
        let (first, columns) = &self.columns[y / EDGE * self.levels[0].across + x / EDGE];
        let i = y % EDGE * EDGE + x % EDGE;
        &self.nearness
            [*first as usize + columns[i] as usize..*first as usize + columns[i + 1] as usize]
    }

    /// Whether a ray that is `inside` or not meets nothing in the block at (x, y), in blocks of the level,
    /// between two values of nearness.
    #[inline]
    pub(crate) fn skips(
        &self,
        level: usize,
        [x, y]: [usize; 2],
        ([from, to], inside): ([f32; 2], bool),
    ) -> bool {
        let level = &self.levels[level];
        let block = &level.blocks[y * level.across + x];
        let (near, far) = (from.max(to), from.min(to));
        let bands = &block.bands[..block.count];
        // Bands before the ray, and none within it.
        let before = bands.iter().take_while(|b| b.far > near).count();
        let meets = bands.get(before).is_some_and(|b| b.near >= far);
        let state = before > 0 && bands[before - 1].inside;
        !meets && state == inside
    }
}

impl Level {
    /// The blocks of [`EDGE`]² of these, which are `down` from top to bottom.
    fn grouped(&self, down: usize) -> Self {
        let across = self.across.div_ceil(EDGE);
        let group = |(events, i): (&mut Vec<Event>, usize)| {
            let [x, y] = [i % across * EDGE, i / across * EDGE];
            events.clear();
            let mut all = 0;
            for (x, y) in (y..(y + EDGE).min(down))
                .flat_map(|y| (x..(x + EDGE).min(self.across)).map(move |x| (x, y)))
            {
                all += 1;
                let block = &self.blocks[y * self.across + x];
                let mut inside = false;
                for band in &block.bands[..block.count] {
                    let out = if inside { -1 } else { 0 };
                    events.push(Event { nearness: band.near, inside: out, mixed: 1 });
                    inside = band.inside;
                    let into = if inside { 1 } else { 0 };
                    events.push(Event { nearness: band.far, inside: into, mixed: -1 });
                }
            }
            Block::new(events, all)
        };
        let blocks = (0..across * down.div_ceil(EDGE))
            .into_par_iter()
            .with_min_len(across)
            .map_init(Vec::new, |events, i| group((events, i)))
            .collect();
        Self { blocks, across }
    }
}

/// Where parts of a block change: how many more of them are inside behind it, and how many more are neither
/// inside nor outside throughout.
#[derive(Clone, Copy)]
struct Event {
    nearness: f32,
    inside: i32,
    mixed: i32,
}

/// The ends of all spans of some columns.
fn ends_of_spans((nearness, columns): (&[f32], &[u16]), events: &mut Vec<Event>) {
    events.clear();
    for column in columns.windows(2) {
        let of = &nearness[column[0] as usize..column[1] as usize];
        events.extend(of.iter().enumerate().map(|(i, n)| Event {
            nearness: *n,
            inside: if i % 2 == 0 { 1 } else { -1 },
            mixed: 0,
        }));
    }
}

impl Block {
    /// The bands of a block of `all` parts that change like this.
    fn new(events: &mut [Event], all: i32) -> Self {
        events.sort_unstable_by(|a, b| b.nearness.total_cmp(&a.nearness));
        let mut block = Self::default();
        let mut open: Option<f32> = None;
        let (mut inside, mut mixed) = (0, 0);
        for (i, event) in events.iter().enumerate() {
            let near = *open.get_or_insert(event.nearness);
            inside += event.inside;
            mixed += event.mixed;
            let alike = mixed == 0 && (inside == 0 || inside == all);
            let last = events.get(i + 1).is_none_or(|next| next.nearness < event.nearness);
            if alike && last {
                block.push(Band { near, far: event.nearness, inside: inside == all });
                open = None;
            }
        }
        block
    }

    fn push(&mut self, band: Band) {
        if self.count < BANDS {
            self.bands[self.count] = band;
            self.count += 1;
            return;
        }
        let gap = |i: usize| {
            let next = if i + 1 < BANDS { self.bands[i + 1] } else { band };
            self.bands[i].far - next.near
        };
        let mut least = 0;
        for i in 1..BANDS {
            if gap(i) < gap(least) {
                least = i;
            }
        }
        if least + 1 < BANDS {
            let next = self.bands[least + 1];
            self.bands[least] = Band { near: self.bands[least].near, ..next };
            self.bands.copy_within(least + 2.., least + 1);
            self.bands[BANDS - 1] = band;
        } else {
            self.bands[least] = Band { near: self.bands[least].near, ..band };
        }
    }
}
