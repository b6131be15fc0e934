//! Sections: what cuts leave of grids, kept up to date as cuts come, move and go.
//!
//! Chaudhari, §3.1–3.4: each block counts the cuts that have taken it ([`crate::Width`]); a cut raises
//! the counters of its blocks, its undoing lowers them, in any order. Here a cut is a [`Clause`], and there
//! is a third fate between gone and kept: in a block that a face goes through, particles are asked one by
//! one. Going over to another clip asks only the clauses that differ, groups of 4³ blocks first, and works
//! on the blocks that these change alone.
//!
//! What is seen is what passes the filters *and* is left by the cuts. Nothing of the grid is rebuilt, and
//! back at an earlier clip everything is as it was, bit for bit.

use rayon::prelude::*;

use crate::counters::Counters;
use crate::visibility::State;
use crate::{Clause, Clip, Fate, Grid, Group, Seen, Visibility, Width};

/// What filters and cuts leave of the grids of one system.
#[derive(Clone, Debug)]
pub struct Sections {
    clip: Clip,
    /// Per grid, what passes the filters.
    base: Vec<Visibility>,
    /// What is left of that; empty without cuts: all.
    shown: Vec<Visibility>,
    /// How many clauses have taken each block.
    gone: Vec<Counters>,
}

/// What one block becomes.
struct Change {
    block: usize,
    gone: u32,
    /// `None`: its number changes, not what is seen of it.
    state: Option<State>,
}

impl Sections {
    /// No cuts yet: all that `base` shows, one for each of `grids`.
    pub fn new(grids: &[Grid], base: Vec<Visibility>, width: Width) -> Self {
        let gone = grids.iter().map(|grid| Counters::new(width, grid.blocks.len() - 1)).collect();
        Self { clip: Clip::default(), base, shown: Vec::new(), gone }
    }

    /// The cuts.
    pub fn clip(&self) -> &Clip {
        &self.clip
    }

    /// What is seen, grid by grid.
    pub fn visible(&self) -> &[Visibility] {
        if self.shown.is_empty() { &self.base } else { &self.shown }
    }

    /// What would be seen without cuts.
    pub fn uncut(&self) -> &[Visibility] {
        &self.base
    }

    /// Bytes it holds.
    pub fn bytes(&self) -> usize {
        let visible = self.base.iter().chain(&self.shown).map(Visibility::bytes).sum::<usize>();
        visible + self.counter_bytes()
    }

    /// Bytes of the blocks' counters.
    pub fn counter_bytes(&self) -> usize {
        self.gone.iter().map(Counters::bytes).sum()
    }

    /// Goes over to the cuts of `clip`: adds, moves, takes back any of them. `grids` are those that this was
    /// made for. Gives how many blocks were worked on.
    pub fn set(&mut self, grids: &[Grid], clip: Clip) -> usize {
        let before = std::mem::replace(&mut self.clip, clip);
        let (old, new) = (missing(&before, &self.clip), missing(&self.clip, &before));
        if old.is_empty() && new.is_empty() {
            return 0;
        }
        if self.shown.is_empty() {
            let with_room = grids.iter().zip(&self.base).map(|(grid, base)| base.with_room(grid));
            self.shown = with_room.collect();
        }
        let mut worked = 0;
        for (i, grid) in grids.iter().enumerate() {
            let (clip, gone) = (&self.clip, &self.gone[i]);
            let step = Step { grid, base: &self.base[i], old: &old, new: &new, clip, gone };
            let of_group = |group: &Group| step.group(group);
            let changes: Vec<Change> =
                grid.groups.par_iter().with_min_len(4).flat_map_iter(of_group).collect();
            for change in &changes {
                self.gone[i].set(change.block, change.gone);
                if let Some(state) = &change.state {
                    self.shown[i].put(grid, change.block, state);
                }
            }
            worked += changes.len();
        }
        if self.clip.is_empty() {
            self.shown.clear();
        }
        worked
    }
}

/// The clauses of `of` that `than` lacks; of equal ones as many as it lacks.
fn missing<'a>(of: &'a Clip, than: &Clip) -> Vec<&'a Clause> {
    let mut there: Vec<&Clause> = than.clauses.iter().collect();
    let mut lacks = |clause: &&'a Clause| match there.iter().position(|other| other == clause) {
        Some(at) => {
            there.swap_remove(at);
            false
        }
        None => true,
    };
    of.clauses.iter().filter(|clause| lacks(clause)).collect()
}

/// From one clip to another.
struct Step<'a> {
    grid: &'a Grid,
    base: &'a Visibility,
    /// The clauses that go, and those that come.
    old: &'a [&'a Clause],
    new: &'a [&'a Clause],
    /// The cuts arrived at.
    clip: &'a Clip,
    gone: &'a Counters,
}

impl Step<'_> {
    /// What becomes of the blocks of a group.
    fn group(&self, group: &Group) -> Vec<Change> {
        let bounds = (group.low, group.high);
        // Radii of a group are not known to be more than nothing.
        let radii = (0.0, group.greatest_radius);
        let kept = |clause: &&Clause| clause.fate(bounds, radii) == Fate::Kept;
        if self.old.iter().all(kept) && self.new.iter().all(kept) {
            return Vec::new();
        }
        group.blocks(&self.grid.lattice).filter_map(|block| self.block(block)).collect()
    }

    /// What becomes of a block; `None` where nothing does.
    fn block(&self, index: usize) -> Option<Change> {
        let (mut went, mut mixed) = ([0, 0], false);
        for (clauses, went) in [self.old, self.new].into_iter().zip(&mut went) {
            for clause in clauses {
                match self.fate(clause, index) {
                    Fate::Gone => *went += 1,
                    Fate::Mixed => mixed = true,
                    Fate::Kept => {}
                }
            }
        }
        if went == [0, 0] && !mixed {
            return None;
        }
        let gone = self.gone.after(index, went[1], went[0]);
        let gone = gone.unwrap_or_else(|| self.count(index));
        let was_gone = self.gone.get(index) > 0;
        let state = match (was_gone, gone > 0) {
            (true, true) => None,
            (false, true) => Some(State::Hidden),
            (_, false) => Some(self.state(index)),
        };
        Some(Change { block: index, gone, state })
    }

    fn fate(&self, clause: &Clause, index: usize) -> Fate {
        let block = &self.grid.blocks[index];
        clause.fate((block.low, block.high), (block.least_radius, block.greatest_radius))
    }

    /// How many clauses take a block, counted anew.
    fn count(&self, index: usize) -> u32 {
        let gone = |clause: &&Clause| self.fate(clause, index) == Fate::Gone;
        self.clip.clauses.iter().filter(gone).count() as u32
    }

    /// What is seen of a block that no clause takes whole.
    fn state(&self, index: usize) -> State {
        let (grid, clip) = (self.grid, self.clip);
        let mixed = |clause: &&Clause| self.fate(clause, index) == Fate::Mixed;
        let mixed: Vec<&Clause> = clip.clauses.iter().filter(mixed).collect();
        let base = self.base.block(grid, index);
        let slots = grid.particles_of(index);
        if mixed.is_empty() {
            return State::of(base, slots.len());
        }
        let mut words = vec![0; slots.len().div_ceil(64)];
        for (i, slot) in slots.clone().enumerate().filter(|(i, _)| base.shows(*i)) {
            let (center, radius) = (grid.center(slot), grid.radius_at(slot));
            let kept = mixed.iter().all(|clause| clause.keeps(center, radius));
            words[i / 64] |= u64::from(kept) << (i % 64);
        }
        State::of(Seen::Mixed(&words), slots.len())
    }
}
