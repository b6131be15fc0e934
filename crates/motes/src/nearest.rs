//! The visible particle nearest to a point of a liquid.

use glam::Vec3;
use motes_grid::Grid;

use crate::system::{Loaded, mark};

/// How often the reach is doubled: a liquid is never far from what makes it.
const DOUBLED: u32 = 8;

/// Finds the visible particle of a system that is nearest to a point.
pub(crate) struct Nearest<'a> {
    grids: &'a [Grid],
    /// Which particles are visible, by index; none: all are.
    seen: Option<Vec<bool>>,
    /// Where it looks first.
    reach: f32,
}

impl<'a> Nearest<'a> {
    /// Among the visible particles of `system`.
    pub fn new(system: &'a Loaded) -> Self {
        let grids = &system.classes.grids;
        let reach = grids.iter().map(|grid| grid.greatest_radius).fold(0.0, f32::max);
        let all = system.count_visible() == system.classes.len();
        let seen = (!all).then(|| {
            let mut seen = vec![false; system.particles.len()];
            mark(&system.classes, system.visible(), &mut seen);
            seen
        });
        Self { grids, seen, reach: 2.0 * reach }
    }

    /// Its index in the file's order; of several as near the lowest. `None` where none is near.
    pub fn particle(&self, point: Vec3) -> Option<u32> {
        let mut reach = self.reach;
        for _ in 0..DOUBLED {
            let mut nearest: Option<(f32, u32)> = None;
            for grid in self.grids {
                grid.visit_near(point, reach, |slot| {
                    let distance = grid.center(slot).distance(point);
                    let found = (distance, grid.index(slot));
                    let nearer = distance <= reach && nearest.is_none_or(|before| found < before);
                    if nearer && self.seen.as_ref().is_none_or(|seen| seen[found.1 as usize]) {
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
