//! The boxes of blocks, group by group, as rows of sixteen; and which of them lie near a place.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Grid, Seen, Visibility};
use rayon::prelude::*;

use crate::lanes::Lanes;
use crate::overview::GROUP;
use crate::packet::LANES;
use crate::traverse::Spheres;

/// The visible blocks of a group: boxes around their centres, and radii. What is not visible is a box
/// that nothing meets.
#[repr(align(64))]
#[derive(Debug)]
pub(crate) struct Boxes {
    /// System and grid.
    pub of: (u16, u16),
    /// Place of each block in the lattice.
    pub block: [u32; GROUP],
    pub low: [[f32; GROUP]; 3],
    pub high: [[f32; GROUP]; 3],
    pub radius: [f32; GROUP],
}

/// The boxes of all groups of all systems, and the box around each group.
#[derive(Debug)]
pub(crate) struct Shelves {
    pub boxes: Vec<Boxes>,
    low: [Lanes<f32>; 3],
    high: [Lanes<f32>; 3],
    radius: Lanes<f32>,
}

impl Shelves {
    pub fn new(systems: &[Spheres<'_>]) -> Self {
        let mut boxes: Vec<Boxes> = Vec::new();
        for (system, spheres) in systems.iter().enumerate() {
            for (class, (grid, visible)) in
                spheres.classes.grids.iter().zip(spheres.visible).enumerate()
            {
                let of = (system as u16, class as u16);
                boxes.par_extend(
                    grid.groups
                        .par_iter()
                        .with_min_len(8)
                        .filter_map(|group| Boxes::of(of, (grid, visible), group)),
                );
            }
        }
        let count = boxes.len().next_multiple_of(LANES);
        let all = |value| [(); 3].map(|()| Lanes::new(value, count));
        let mut shelves = Self {
            boxes: Vec::new(),
            low: all(f32::INFINITY),
            high: all(f32::NEG_INFINITY),
            radius: Lanes::new(0.0, count),
        };
        for (i, group) in boxes.iter().enumerate() {
            for axis in 0..3 {
                shelves.low[axis][i] =
                    group.low[axis].iter().copied().fold(f32::INFINITY, f32::min);
                shelves.high[axis][i] =
                    group.high[axis].iter().copied().fold(f32::NEG_INFINITY, f32::max);
            }
            shelves.radius[i] = group.radius.iter().copied().fold(0.0, f32::max);
        }
        shelves.boxes = boxes;
        shelves
    }
}

impl Boxes {
    fn of(
        of: (u16, u16),
        (grid, visible): (&Grid, &Visibility),
        group: &motes_grid::Group,
    ) -> Option<Self> {
        let mut boxes = Self {
            of,
            block: [0; GROUP],
            low: [[f32::INFINITY; GROUP]; 3],
            high: [[f32::NEG_INFINITY; GROUP]; 3],
            radius: [0.0; GROUP],
        };
        let mut count = 0;
        let seen = |index: &usize| visible.block(grid, *index) != Seen::Hidden;
        for index in group.blocks(&grid.lattice).filter(seen) {
            let block = &grid.blocks[index];
            boxes.block[count] = index as u32;
            for axis in 0..3 {
                boxes.low[axis][count] = block.low[axis];
                boxes.high[axis][count] = block.high[axis];
            }
            boxes.radius[count] = block.greatest_radius;
            count += 1;
        }
        (count > 0).then_some(boxes)
    }
}

/// The groups that come near a place, nearest first, and which of their blocks do.
#[derive(Debug, Default)]
pub(crate) struct Near {
    /// Distance, place among the shelves, and a bit for each block.
    pub groups: Vec<(f32, u32, u64)>,
}

impl Near {
    /// Finds the blocks whose spheres come within `reach` of the box `low..high`.
    #[simd]
    pub fn find<S: Simd>(
        &mut self,
        simd: S,
        shelves: &Shelves,
        (low, high): (Vec3, Vec3),
        reach: f32,
    ) {
        self.groups.clear();
        // What rounding of coordinates and distances may hide.
        let reach = reach + 1e-5 * (reach + low.abs().max(high.abs()).max_element());
        for first in (0..shelves.boxes.len()).step_by(LANES) {
            let (within, distance2) = apart(simd, shelves.rows(), first, (low, high, reach));
            let mut left = within;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let group = &shelves.boxes[first + lane];
                let mut blocks = 0;
                for part in (0..GROUP).step_by(LANES) {
                    let (within, _) = apart(simd, group.rows(), part, (low, high, reach));
                    blocks |= within << part;
                }
                if blocks != 0 {
                    self.groups.push((distance2[lane], (first + lane) as u32, blocks));
                }
            }
        }
        self.groups.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
}

/// Boxes and radii, coordinate by coordinate.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub low: [&'a [f32]; 3],
    pub high: [&'a [f32]; 3],
    pub radius: &'a [f32],
}

impl Boxes {
    /// The boxes as rows.
    #[inline(always)]
    pub fn rows(&self) -> Rows<'_> {
        let ([lx, ly, lz], [hx, hy, hz]) = (&self.low, &self.high);
        Rows { low: [lx, ly, lz], high: [hx, hy, hz], radius: &self.radius }
    }
}

impl Shelves {
    #[inline(always)]
    fn rows(&self) -> Rows<'_> {
        let ([lx, ly, lz], [hx, hy, hz]) = (&self.low, &self.high);
        Rows { low: [lx, ly, lz], high: [hx, hy, hz], radius: &self.radius }
    }
}

/// Which of the sixteen boxes from `first` on, grown by their radii, come within `reach` of the box
/// `low..high`, and the squares of the distances between the boxes themselves.
#[inline(always)]
fn apart<S: Simd>(
    simd: S,
    rows: Rows<'_>,
    first: usize,
    (low, high, reach): (Vec3, Vec3, f32),
) -> (u64, f32x16<S>) {
    let zero = f32x16::splat(simd, 0.0);
    let mut square = zero;
    for axis in 0..3 {
        let below = f32x16::from_slice(simd, &rows.low[axis][first..first + LANES]) - high[axis];
        let above = f32x16::splat(simd, low[axis])
            - f32x16::from_slice(simd, &rows.high[axis][first..first + LANES]);
        let gap = below.max(above).max(zero);
        square = gap.mul_add(gap, square);
    }
    let reach = f32x16::from_slice(simd, &rows.radius[first..first + LANES]) + reach;
    (square.simd_le(reach * reach).to_bitmask(), square)
}
