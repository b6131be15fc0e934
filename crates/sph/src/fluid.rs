//! The liquid: its particles in cell order, row by row.

use motes_scene::Solver;
use rayon::prelude::*;

use crate::cells::{Lattice, Order};
use crate::pairs::padded;
use crate::simulation::Physics;

/// How many particles a task works at.
pub(crate) const CHUNK: usize = 1 << 12;

/// Rows that go with the particles when they are sorted: positions and velocities, and what dfsph begins with.
const ROWS: usize = 8;

/// The particles. All rows are [`padded`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Fluid {
    pub count: usize,
    /// Metres.
    pub position: [Vec<f32>; 3],
    /// Metres per second.
    pub velocity: [Vec<f32>; 3],
    /// How fast it moves in this step ([`crate::dfsph`]; else by its velocity, and this is empty).
    pub motion: [Vec<f32>; 3],
    /// What the last step's pressures were, to begin the next with, pascals: of velocities and of places
    /// ([`crate::dfsph`]).
    pub warm: [Vec<f32>; 2],
    /// The rates of density that the last iteration met ([`crate::dfsph`]).
    pub rate: Vec<f32>,
    /// The particle's number, in the order in which they came.
    pub id: Vec<u32>,
    /// Kilograms per cubic metre.
    pub density: Vec<f32>,
    /// p/ρ²; in [`crate::dfsph`] that times Δt, of what is to be pushed next.
    pub pressure: Vec<f32>,
    /// What a pressure of 1 does to a particle's own rate of density, inverse ([`crate::dfsph`]).
    pub factor: Vec<f32>,
    /// Sums of the pass at work.
    pub sums: [Vec<f32>; 8],
    order: Order,
    spare: [Vec<f32>; ROWS],
    spare_id: Vec<u32>,
}

impl Fluid {
    /// Adds particles.
    pub fn add(&mut self, positions: &[[f32; 3]], velocities: &[[f32; 3]]) {
        let (before, count) = (self.count, self.count + positions.len());
        let (room, [own, speeds]) = (padded(count), [positions, velocities]);
        for (rows, values) in [(&mut self.position, own), (&mut self.velocity, speeds)] {
            for (axis, row) in rows.iter_mut().enumerate() {
                row.resize(room, 0.0);
                let put = row[before..count].iter_mut().zip(values);
                put.for_each(|(to, from)| *to = from[axis]);
            }
        }
        let others = self.warm.iter_mut().chain(&mut self.sums);
        for row in others.chain([&mut self.density, &mut self.pressure, &mut self.factor]) {
            row.resize(room, 0.0);
            row[before..].fill(0.0);
        }
        self.id.extend(before as u32..count as u32);
        self.count = count;
    }

    /// Brings the particles into cell order.
    pub fn sort(&mut self, lattice: &Lattice, physics: &Physics) {
        let [x, y, z] = &self.position;
        self.order.sort(physics.level, lattice, [x, y, z], self.count);
        let from = &self.order.from;
        let rows = self.position.iter_mut().chain(&mut self.velocity).chain(&mut self.warm);
        let most = if physics.sph.solver == Solver::Dfsph { ROWS } else { 6 };
        let rows: Vec<_> = rows.zip(&mut self.spare).take(most).collect();
        rows.into_par_iter().for_each(|(row, spare)| {
            spare.resize(row.len(), 0.0);
            gather(from, row, spare);
            std::mem::swap(row, spare);
        });
        self.spare_id.resize(self.count, 0);
        gather(from, &self.id, &mut self.spare_id);
        std::mem::swap(&mut self.id, &mut self.spare_id);
    }

    /// First particle of each cell.
    pub fn starts(&self) -> &[u32] {
        &self.order.starts
    }
}

fn gather<T: Copy + Send + Sync>(from: &[u32], row: &[T], to: &mut [T]) {
    to.par_chunks_mut(CHUNK).zip(from.par_chunks(CHUNK)).for_each(|(to, from)| {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = row[*from as usize]);
    });
}

/// The sum of `value` over `0..count`, in the same order for any number of threads.
pub(crate) fn total(count: usize, value: impl Fn(usize) -> f64 + Sync) -> f64 {
    let part =
        |chunk: usize| (chunk * CHUNK..((chunk + 1) * CHUNK).min(count)).map(&value).sum::<f64>();
    let parts: Vec<f64> = (0..count.div_ceil(CHUNK)).into_par_iter().map(part).collect();
    parts.iter().sum()
}
