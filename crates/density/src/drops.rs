//! Drops: particles by themselves, seen as balls.
//!
//! Yasuda et al. 2009, §5, leave this to future work: with voxels alone nothing can be smaller than one,
//! "separating particles in sparse areas from other dense particles and calculating isosurface directly from
//! their positions". A particle is a drop where the density at its centre stays below the threshold; so each
//! is seen, in the liquid or as a drop.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::bins::Entry;
use crate::bits::Bits;
use crate::field::Field;
use crate::params::{Params, Particles};

/// A ball, in voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drop {
    pub center: Vec3,
    pub radius: f32,
    /// Its place in the input.
    pub index: u32,
}

/// All drops, and which are in a cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drops {
    pub drops: Vec<Drop>,
    /// Cells and drops that touch them, in the order of cells.
    touched: Vec<([u16; 3], u32)>,
}

impl Drops {
    /// Finds the drops among particles; `inside` are cells that are liquid throughout.
    pub fn find(
        &mut self,
        field: &Field,
        (particles, params): (&Particles<'_>, &Params),
        inside: &Bits,
    ) {
        let found: Vec<Vec<Drop>> = field
            .desks()
            .par_iter()
            .map(|desk| {
                let mut found = Vec::new();
                for row in desk.rows() {
                    let [y, z] = row.at;
                    for x in 0..row.len() {
                        let own = row.of(x);
                        if !own.is_empty() && !inside.get([x, y, z]) {
                            let drop = |e: &Entry| drop_of(field, e, (particles, params));
                            found.extend(own.iter().filter_map(drop));
                        }
                    }
                }
                found
            })
            .collect();
        self.drops.clear();
        self.drops.extend(found.into_iter().flatten());
        self.touched.clear();
        let cells = field.lattice.cells();
        for (number, drop) in self.drops.iter().enumerate() {
            let [xs, ys, zs] = [0, 1, 2].map(|a| cells_along(drop, a, cells[a]));
            for z in zs {
                for y in ys.clone() {
                    for x in xs.clone() {
                        if drop.touches([x, y, z]) {
                            self.touched.push(([z, y, x].map(|v| v as u16), number as u32));
                        }
                    }
                }
            }
        }
        self.touched.par_sort_unstable();
    }

    /// The cells that drops touch, some of them several times.
    pub fn cells(&self) -> impl Iterator<Item = [usize; 3]> {
        self.touched.iter().map(|([z, y, x], _)| [*x, *y, *z].map(usize::from))
    }

    /// How many drops there are.
    pub fn len(&self) -> usize {
        self.drops.len()
    }

    /// The drops that touch a cell.
    fn of(&self, [x, y, z]: [usize; 3]) -> impl Iterator<Item = (u32, &Drop)> {
        let key = [z, y, x].map(|v| v as u16);
        let first = self.touched.partition_point(|(cell, _)| *cell < key);
        let own = self.touched[first..].iter().take_while(move |(cell, _)| *cell == key);
        own.map(|(_, drop)| (*drop, &self.drops[*drop as usize]))
    }

    /// The first drop of a cell that a ray enters between two distances, and where.
    pub fn enter(
        &self,
        cell: [usize; 3],
        (origin, direction): (Vec3, Vec3),
        [from, to]: [f32; 2],
    ) -> Option<(f32, u32)> {
        let mut nearest: Option<(f32, u32)> = None;
        for (number, drop) in self.of(cell) {
            if let Some([entry, _]) = drop.meet(origin, direction)
                && entry >= from
                && entry <= nearest.map_or(to, |(t, _)| t)
            {
                nearest = Some((entry, number));
            }
        }
        nearest
    }

    /// A drop of the cell that holds a place, other than `but`, in which the place lies.
    pub fn around(&self, cell: [usize; 3], place: Vec3, but: u32) -> Option<u32> {
        let holds = |drop: &Drop| place.distance_squared(drop.center) < drop.radius * drop.radius;
        self.of(cell).find(|(number, drop)| *number != but && holds(drop)).map(|(number, _)| number)
    }
}

impl Drop {
    /// Where the line of a ray is in the ball; none if it misses it.
    #[inline]
    pub fn meet(&self, origin: Vec3, direction: Vec3) -> Option<[f32; 2]> {
        let to = self.center - origin;
        let middle = to.dot(direction);
        let aside = to - direction * middle;
        let left = self.radius * self.radius - aside.length_squared();
        (left > 0.0).then(|| [middle - left.sqrt(), middle + left.sqrt()])
    }

    fn touches(&self, cell: [usize; 3]) -> bool {
        let low = Vec3::from_array(cell.map(|c| c as f32));
        let nearest = self.center.clamp(low, low + 1.0);
        // A hair more, as rays round.
        nearest.distance_squared(self.center) <= self.radius * self.radius * 1.001
    }
}

/// Cells along an axis that a drop may touch.
fn cells_along(drop: &Drop, axis: usize, cells: usize) -> Range<usize> {
    let (at, radius) = (drop.center[axis], drop.radius * 1.001);
    let first = (at - radius).max(0.0) as usize;
    first..((at + radius).max(0.0) as usize + 1).min(cells)
}

/// A particle, if it is a drop.
fn drop_of(
    field: &Field,
    entry: &Entry,
    (particles, params): (&Particles<'_>, &Params),
) -> Option<Drop> {
    let (center, index) = (Vec3::from_array(entry.at), entry.index);
    let radius = params.drop * particles.radius(index as usize) / field.lattice.voxel;
    (field.at(center) < params.threshold).then_some(Drop { center, radius, index })
}
