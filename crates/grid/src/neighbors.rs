//! What lies near a point.

use glam::Vec3;
use rayon::prelude::*;

use crate::places::Places;
use crate::{Block, Grid, Radii};

/// How many particles the median spacing is taken over.
const SPACING_SAMPLE: usize = 4096;

impl Grid {
    /// Calls `visit` with the slot of every particle whose cell meets the cube of half edge `reach`
    /// around `point`: all particles within `reach`, and some farther ones.
    pub fn visit_near(&self, point: Vec3, reach: f32, mut visit: impl FnMut(usize)) {
        let pad = reach + 1e-6 * (point.abs().max_element() + reach);
        let (low, high) = (point - pad, point + pad);
        let from = self.lattice.block_of(low);
        let to = self.lattice.block_of(high);
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    let block = &self.blocks[self.lattice.index([x, y, z])];
                    let apart = block.low.cmpgt(high).any() || block.high.cmplt(low).any();
                    if block.cells[0] > 0 && !apart {
                        self.visit_cells(block, low, high, &mut visit);
                    }
                }
            }
        }
    }

    fn visit_cells(&self, block: &Block, low: Vec3, high: Vec3, visit: &mut impl FnMut(usize)) {
        let places = Places::of_cells(block);
        let (low, high) = (places.along(low.to_array()), places.along(high.to_array()));
        let [nx, ny, _] = block.cells;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let row = (block.first_cell + (z * ny + y) * nx) as usize;
                let from = self.cell_starts[row + low[0] as usize];
                let to = self.cell_starts[row + high[0] as usize + 1];
                (from as usize..to as usize).for_each(&mut *visit);
            }
        }
    }

    /// Distance from the particle at `slot` to the nearest one at another place; `None` if there is
    /// none.
    pub fn nearest_distance(&self, slot: usize) -> Option<f32> {
        let point = self.center(slot);
        let size = self.lattice.dims.map(|d| d as f32 * self.lattice.edge);
        let whole = Vec3::from_array(size).length();
        let block = self.lattice.index(self.lattice.block_of(point));
        let mut reach = self.blocks[block].cell_edge.max(f32::MIN_POSITIVE);
        loop {
            let mut nearest = f32::INFINITY;
            self.visit_near(point, reach, |other| {
                let distance = self.center(other).distance(point);
                if distance > 0.0 {
                    nearest = nearest.min(distance);
                }
            });
            if nearest <= reach {
                return Some(nearest);
            }
            if reach > whole {
                return None;
            }
            reach *= 2.0;
        }
    }

    /// The median distance of a particle to its nearest neighbour, over a few thousand particles
    /// spread through the grid; `None` if all lie at one point.
    pub fn median_spacing(&self) -> Option<f32> {
        if self.low == self.high {
            return None;
        }
        let step = self.len().div_ceil(SPACING_SAMPLE).max(1);
        let mut distances: Vec<f32> = (0..self.len())
            .into_par_iter()
            .step_by(step)
            .filter_map(|slot| self.nearest_distance(slot))
            .collect();
        distances.sort_by(f32::total_cmp);
        distances.get(distances.len() / 2).copied()
    }

    /// The edge of the cube that a particle deep inside has for itself: what the spacing of a liquid's particles
    /// would be on a lattice. [`Self::median_spacing`] is smaller the more unevenly particles lie.
    ///
    /// Of a few thousand particles, with H two median spacings and r the distances of others,
    /// Σ (1 − r²/H²) is 8π/15 · (H/edge)³ where there are particles all around. That of a particle that has more than nine in ten
    /// others is taken, as these are not at the surface. `None` if all lie at one point.
    pub fn share_edge(&self) -> Option<f32> {
        let spacing = self.median_spacing()?;
        let (reach, step) = (2.0 * spacing, self.len().div_ceil(SPACING_SAMPLE).max(1));
        let crowd = |slot: usize| {
            let (point, mut crowd) = (self.center(slot), 0.0_f32);
            self.visit_near(point, reach, |other| {
                let part = self.center(other).distance_squared(point) / (reach * reach);
                crowd += (1.0 - part).max(0.0);
            });
            crowd
        };
        let mut crowds: Vec<f32> =
            (0..self.len()).into_par_iter().step_by(step).map(crowd).collect();
        crowds.sort_unstable_by(f32::total_cmp);
        let inside = *crowds.get(crowds.len() * 9 / 10)?;
        Some(reach * (8.0 / 15.0 * std::f32::consts::PI / inside.max(1.0)).cbrt())
    }

    /// Gives all particles the same radius, where it became known only from the grid itself.
    pub fn set_radius(&mut self, radius: f32) {
        self.radius = Radii::Uniform(radius);
        (self.least_radius, self.greatest_radius) = (radius, radius);
        for block in self.blocks.iter_mut().filter(|b| b.cells[0] > 0) {
            (block.least_radius, block.greatest_radius) = (radius, radius);
        }
        self.groups.iter_mut().for_each(|g| g.greatest_radius = radius);
    }
}
