//! The visible particle nearest to a point of a liquid.

use glam::Vec3;
use motes_grid::{Grid, Seen};

use crate::system::Loaded;

/// How often the reach is doubled: a liquid is never far from what makes it.
const DOUBLED: u32 = 8;

/// Finds the visible particle of a system that is nearest to a point.
pub(crate) struct Nearest<'a> {
    /// Each grid, and which of its slots are visible; none: all are.
    grids: Vec<(&'a Grid, Option<Vec<bool>>)>,
    /// Where it looks first.
    reach: f32,
}

impl<'a> Nearest<'a> {
    /// Among the visible particles of `system`.
    pub fn new(system: &'a Loaded) -> Self {
        let grids = &system.classes.grids;
        let reach = grids.iter().map(|grid| grid.greatest_radius).fold(0.0, f32::max);
        let with_seen = grids.iter().zip(system.visible()).map(|(grid, visible)| {
            let all = visible.visible() == grid.len();
            let seen = || {
                let mut seen = vec![false; grid.len()];
                for block in 0..grid.blocks.len() - 1 {
                    let of = visible.block(grid, block);
                    if of != Seen::Hidden {
                        let slots = grid.particles_of(block).enumerate();
                        slots.for_each(|(i, slot)| seen[slot] = of.shows(i));
                    }
                }
                seen
            };
            (grid, (!all).then(seen))
        });
        Self { grids: with_seen.collect(), reach: 2.0 * reach }
    }

    /// Its index in the file's order; of several as near the lowest. `None` where none is near.
    pub fn particle(&self, point: Vec3) -> Option<u32> {
        let mut reach = self.reach;
        for _ in 0..DOUBLED {
            let mut nearest: Option<(f32, u32)> = None;
            for (grid, seen) in &self.grids {
                grid.visit_near(point, reach, |slot| {
                    let distance = grid.center(slot).distance(point);
                    let found = (distance, grid.index(slot));
                    let nearer = distance <= reach && nearest.is_none_or(|before| found < before);
                    if nearer && seen.as_ref().is_none_or(|seen| seen[slot]) {
                        nearest = Some(found);
                    }
                });
            }
            if let Some((_, index)) = nearest {
                return Some(index);
            }
            reach *= 2.0;
        }
        None
    }
}
