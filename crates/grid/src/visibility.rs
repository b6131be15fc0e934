//! Which particles are to be seen.
//!
//! Each block is hidden, shown or mixed, and only mixed blocks have a bit per particle. Renderers ask
//! [`Visibility::block`] and know no filter. Spheres that coincide exactly with a visible one of the
//! same radius can never be seen (at equal depth the lower index wins) and are hidden here too, so
//! that a million particles at one point cost no more than one.

use rayon::prelude::*;

use crate::{BlockValues, Grid};

/// A range a particle's property must lie in to be seen, both ends included.
#[derive(Clone, Copy, Debug)]
pub struct Filter<'a> {
    /// The property, as the grid has it.
    pub values: &'a BlockValues,
    /// Least value that is seen.
    pub min: f32,
    /// Greatest value that is seen.
    pub max: f32,
}

impl Filter<'_> {
    /// Whether the range decides for a whole block: all seen, none seen, or `None` where it does not.
    fn decides(&self, block: usize) -> Option<bool> {
        let range = self.values.ranges[block];
        if range.high < self.min || range.low > self.max {
            return Some(false);
        }
        let all = range.low >= self.min && range.high <= self.max && !range.gaps;
        all.then_some(true)
    }

    /// Clears the bits of those of `slots` that do not pass.
    fn clear(&self, slots: std::ops::Range<usize>, words: &mut [u64]) {
        for (values, word) in self.values.values[slots].chunks(64).zip(words) {
            let passes = |v: &f32| u64::from(*v >= self.min && *v <= self.max);
            *word &= values.iter().enumerate().fold(0, |bits, (i, v)| bits | passes(v) << i);
        }
    }
}

/// What is seen of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen<'a> {
    /// None of its particles, or it has none.
    Hidden,
    /// All of them.
    Shown,
    /// Those whose bit is set: bit `i % 64` of word `i / 64` for the block's `i`-th particle.
    Mixed(&'a [u64]),
}

impl Seen<'_> {
    /// Whether the block's `i`-th particle is seen.
    pub fn shows(self, i: usize) -> bool {
        match self {
            Self::Hidden => false,
            Self::Shown => true,
            Self::Mixed(words) => words[i / 64] >> (i % 64) & 1 == 1,
        }
    }
}

/// What is seen of one grid.
#[derive(Clone, Debug)]
pub struct Visibility {
    /// Per block: [`HIDDEN`], [`SHOWN`], or where its words begin.
    states: Vec<u32>,
    /// The words of mixed blocks.
    words: Vec<u64>,
    /// How many particles pass the filters.
    visible: usize,
}

const HIDDEN: u32 = u32::MAX;
const SHOWN: u32 = u32::MAX - 1;

/// A block's state before the words are laid out.
pub(crate) enum State {
    Hidden,
    Shown(usize),
    Mixed { words: Vec<u64>, visible: usize },
}

impl State {
    /// The state of a block of `particles` particles of which `seen` is seen.
    pub fn of(seen: Seen<'_>, particles: usize) -> Self {
        match seen {
            Seen::Hidden => Self::Hidden,
            Seen::Shown => Self::Shown(particles),
            Seen::Mixed(words) => match words.iter().map(|w| w.count_ones() as usize).sum() {
                0 => Self::Hidden,
                n if n == particles => Self::Shown(n),
                visible => Self::Mixed { words: words.to_vec(), visible },
            },
        }
    }
}

impl Visibility {
    /// Everything is seen.
    pub fn all(grid: &Grid) -> Self {
        Self::where_all(grid, &[], None)
    }

    /// What passes all `filters` and, if given, `keep` (by index in the file's order).
    pub fn where_all(
        grid: &Grid,
        filters: &[Filter<'_>],
        keep: Option<&(dyn Fn(u32) -> bool + Sync)>,
    ) -> Self {
        let states: Vec<State> = (0..grid.blocks.len() - 1)
            .into_par_iter()
            .with_min_len(64)
            .map(|block| state_of(grid, block, filters, keep))
            .collect();
        let mut visibility = Self { states: Vec::new(), words: Vec::new(), visible: 0 };
        for state in states {
            visibility.states.push(match state {
                State::Hidden => HIDDEN,
                State::Shown(count) => {
                    visibility.visible += count;
                    SHOWN
                }
                State::Mixed { words, visible } => {
                    let start = visibility.words.len() as u32;
                    visibility.words.extend(words);
                    visibility.visible += visible;
                    start
                }
            });
        }
        visibility
    }

    /// What is seen of block `block` of `grid`, the grid it was made for.
    #[inline]
    pub fn block<'a>(&'a self, grid: &Grid, block: usize) -> Seen<'a> {
        match self.states[block] {
            HIDDEN => Seen::Hidden,
            SHOWN => Seen::Shown,
            start => {
                let words = grid.particles_of(block).len().div_ceil(64);
                Seen::Mixed(&self.words[start as usize..start as usize + words])
            }
        }
    }

    /// The same, but with a bit per particle in every block that has any: culling particle by particle
    /// without macrocells, which Gribble et al. 2007 compare with in Table 7.
    pub fn without_blocks(&self, grid: &Grid) -> Self {
        let mut all = Self { states: Vec::new(), words: Vec::new(), visible: self.visible };
        for block in 0..self.states.len() {
            let particles = grid.particles_of(block).len();
            if particles == 0 {
                all.states.push(HIDDEN);
                continue;
            }
            all.states.push(all.words.len() as u32);
            match self.block(grid, block) {
                Seen::Mixed(words) => all.words.extend(words),
                Seen::Hidden => all.words.resize(all.words.len() + particles.div_ceil(64), 0),
                Seen::Shown => {
                    let whole = std::iter::repeat_n(u64::MAX, particles / 64);
                    all.words.extend(whole);
                    if !particles.is_multiple_of(64) {
                        all.words.push((1 << (particles % 64)) - 1);
                    }
                }
            }
        }
        all
    }

    /// The same, with a place for words for every block, which [`Visibility::put`] asks for.
    pub(crate) fn with_room(&self, grid: &Grid) -> Self {
        let blocks = self.states.len();
        let words = room(grid, blocks);
        let mut all = Self { states: vec![HIDDEN; blocks], words: vec![0; words], visible: 0 };
        for block in 0..blocks {
            let state = State::of(self.block(grid, block), grid.particles_of(block).len());
            all.put(grid, block, &state);
        }
        all
    }

    /// Changes what is seen of a block.
    pub(crate) fn put(&mut self, grid: &Grid, block: usize, state: &State) {
        let particles = grid.particles_of(block).len();
        let count = |seen: Seen<'_>| match seen {
            Seen::Hidden => 0,
            Seen::Shown => particles,
            Seen::Mixed(words) => words.iter().map(|w| w.count_ones() as usize).sum(),
        };
        self.visible -= count(self.block(grid, block));
        self.states[block] = match state {
            State::Hidden => HIDDEN,
            State::Shown(_) => SHOWN,
            State::Mixed { words, .. } => {
                let start = room(grid, block);
                self.words[start..start + words.len()].copy_from_slice(words);
                start as u32
            }
        };
        self.visible += count(self.block(grid, block));
    }

    /// How many particles pass the filters, coinciding ones included; where there are cuts, one of these counts.
    pub fn visible(&self) -> usize {
        self.visible
    }

    /// Bytes it holds.
    pub fn bytes(&self) -> usize {
        self.states.len() * 4 + self.words.len() * 8
    }
}

/// Where the words of a block begin if every block has a place for them: no two places overlap, as each
/// block has up to one word more than its whole 64s.
fn room(grid: &Grid, block: usize) -> usize {
    grid.blocks[block].first as usize / 64 + block
}

fn state_of(
    grid: &Grid,
    block: usize,
    filters: &[Filter<'_>],
    keep: Option<&(dyn Fn(u32) -> bool + Sync)>,
) -> State {
    let slots = grid.particles_of(block);
    if slots.is_empty() || filters.iter().any(|f| f.decides(block) == Some(false)) {
        return State::Hidden;
    }
    let crowded = grid.crowded.binary_search(&(block as u32)).is_ok();
    let mut open = filters.iter().filter(|f| f.decides(block).is_none()).peekable();
    if open.peek().is_none() && keep.is_none() && !crowded {
        return State::Shown(slots.len());
    }
    let mut words = vec![u64::MAX; slots.len().div_ceil(64)];
    if !slots.len().is_multiple_of(64) {
        words[slots.len() / 64] = (1 << (slots.len() % 64)) - 1;
    }
    open.for_each(|filter| filter.clear(slots.clone(), &mut words));
    let passing = |words: &[u64]| words.iter().map(|w| w.count_ones() as usize).sum::<usize>();
    let (mut visible, mut drawn) = (passing(&words), passing(&words));
    if keep.is_some() || crowded {
        (visible, drawn) = (0, 0);
        let mut last_drawn: Option<usize> = None;
        for (i, slot) in slots.clone().enumerate() {
            let bit = 1 << (i % 64);
            if words[i / 64] & bit == 0 {
                continue;
            }
            words[i / 64] &= !bit;
            if !keep.is_none_or(|keep| keep(grid.index(slot))) {
                continue;
            }
            visible += 1;
            // Equal spheres of crowded cells lie side by side, the lower index first.
            let same = |a: usize| {
                grid.center(a) == grid.center(slot) && grid.radius_at(a) == grid.radius_at(slot)
            };
            if crowded && last_drawn.is_some_and(same) {
                continue;
            }
            last_drawn = Some(slot);
            drawn += 1;
            words[i / 64] |= bit;
        }
    }
    match drawn {
        0 => State::Hidden,
        n if n == slots.len() => State::Shown(n),
        _ => State::Mixed { words, visible },
    }
}
