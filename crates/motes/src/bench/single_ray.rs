//! One ray at a time through the standard grid (Gribble et al. 2007, Table 9; Parker et al. 1999): from
//! macrocell to macrocell, and in those that hold anything from cell to cell, by 3-D DDA (Amanatides &
//! Woo 1987).

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::draw::{Way, Worker};
use super::standard_grid::StandardGrid;

/// The single-ray walk.
pub(super) struct SingleRay<'a> {
    pub grid: &'a StandardGrid,
    pub level: Level,
}

impl Way for SingleRay<'_> {
    fn trace(&self, rays: &[(Vec3, Vec3)], worker: &mut Worker) {
        dispatch!(self.level, simd => trace(simd, self.grid, rays, worker));
    }
}

/// Traces rays one after the other.
#[simd]
pub(super) fn trace<S: Simd>(
    simd: S,
    grid: &StandardGrid,
    rays: &[(Vec3, Vec3)],
    worker: &mut Worker,
) {
    let _ = simd;
    for (origin, direction) in rays {
        let ray = Ray { origin: *origin, direction: *direction, inverse: direction.recip() };
        let mut nearest = Nearest { distance: f32::INFINITY, id: u32::MAX, tests: 0 };
        ray.walk(grid, &mut nearest);
        worker.counts.tests += nearest.tests;
        worker.counts.tested += nearest.tests;
        worker.counts.spheres += nearest.tests;
        let hit = (nearest.id != u32::MAX).then(|| grid.hit(nearest.distance, nearest.id));
        worker.hits.push(hit);
    }
}

struct Ray {
    origin: Vec3,
    direction: Vec3,
    inverse: Vec3,
}

struct Nearest {
    distance: f32,
    id: u32,
    tests: u64,
}

impl Ray {
    /// Macrocell by macrocell.
    #[inline(always)]
    fn walk(&self, grid: &StandardGrid, nearest: &mut Nearest) {
        let (a, b) =
            ((grid.low - self.origin) * self.inverse, (grid.high - self.origin) * self.inverse);
        let (enter, exit) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if enter > exit {
            return;
        }
        let edge = grid.edge * grid.block as f32;
        let mut blocks = Dda::new(self, (grid.low, edge), [[0; 3], grid.block_dims], enter);
        while let Some((block, enter, exit)) = blocks.next() {
            if !grid.is_occupied(block) {
                continue;
            }
            let first = block.map(|b| b * grid.block);
            let end = [0, 1, 2].map(|axis| (first[axis] + grid.block).min(grid.dims[axis]));
            let mut cells = Dda::new(self, (grid.low, grid.edge), [first, end], enter);
            while let Some((cell, _, exit)) = cells.next() {
                self.test_cell(grid, cell, nearest);
                if nearest.distance <= exit {
                    return;
                }
            }
            if nearest.distance <= exit {
                return;
            }
        }
    }

    #[inline(always)]
    fn test_cell(&self, grid: &StandardGrid, cell: [usize; 3], nearest: &mut Nearest) {
        let cell = grid.index(cell);
        for i in grid.starts[cell]..grid.starts[cell + 1] {
            let id = grid.references[i as usize];
            nearest.tests += 1;
            if let Some(distance) = self.distance(grid.spheres[id as usize])
                && (distance < nearest.distance || distance == nearest.distance && id < nearest.id)
            {
                (nearest.distance, nearest.id) = (distance, id);
            }
        }
    }

    /// Where the ray meets a sphere: the packets' arithmetic, so that the bits are the same.
    #[inline(always)]
    fn distance(&self, [x, y, z, radius]: [f32; 4]) -> Option<f32> {
        let (o, d) = (Vec3::new(x, y, z) - self.origin, self.direction);
        let b = o.z.mul_add(d.z, o.y.mul_add(d.y, o.x * d.x));
        let (px, py, pz) = ((-b).mul_add(d.x, o.x), (-b).mul_add(d.y, o.y), (-b).mul_add(d.z, o.z));
        let inside = radius * radius - pz.mul_add(pz, py.mul_add(py, px * px));
        if inside < 0.0 {
            return None;
        }
        let half = inside.sqrt();
        let distance = if b - half > 0.0 { b - half } else { b + half };
        (distance > 0.0).then_some(distance)
    }
}

/// The cells of a box of cells that a ray goes through, one after the other.
struct Dda {
    cell: [isize; 3],
    step: [isize; 3],
    first: [isize; 3],
    end: [isize; 3],
    /// From the ray's origin to the corner of cell 0.
    low: Vec3,
    edge: f32,
    inverse: Vec3,
    /// Distance to the next cell along each axis.
    next: Vec3,
    enter: f32,
}

impl Dda {
    /// The cells of `range` (first and end along each axis) from distance `enter` on.
    #[inline(always)]
    fn new(ray: &Ray, (low, edge): (Vec3, f32), range: [[usize; 3]; 2], enter: f32) -> Self {
        let at = (ray.origin + ray.direction * enter - low) / edge;
        let [first, end] = range.map(|cell| cell.map(|c| c as isize));
        let mut dda = Self {
            cell: [0; 3],
            step: [0; 3],
            first,
            end,
            low: low - ray.origin,
            edge,
            inverse: ray.inverse,
            next: Vec3::INFINITY,
            enter,
        };
        for axis in 0..3 {
            dda.cell[axis] = (at[axis] as isize).clamp(first[axis], end[axis] - 1);
            let d = ray.direction[axis];
            if d != 0.0 {
                dda.step[axis] = if d > 0.0 { 1 } else { -1 };
                dda.next[axis] = dda.face(axis);
            }
        }
        dda
    }

    /// Distance to the face through which the ray leaves the cell along an axis. Not a running sum, whose
    /// roundings would add up.
    #[inline(always)]
    fn face(&self, axis: usize) -> f32 {
        let face = self.cell[axis] + isize::from(self.step[axis] > 0);
        (face as f32).mul_add(self.edge, self.low[axis]) * self.inverse[axis]
    }

    /// The next cell, and where the ray enters and leaves it.
    #[inline(always)]
    fn next(&mut self) -> Option<([usize; 3], f32, f32)> {
        let inside = |axis: usize| (self.first[axis]..self.end[axis]).contains(&self.cell[axis]);
        if !(inside(0) && inside(1) && inside(2)) {
            return None;
        }
        let cell = self.cell.map(|c| c as usize);
        let axis = self.next.min_position();
        let (enter, exit) = (self.enter, self.next[axis]);
        self.cell[axis] += self.step[axis];
        self.next[axis] = self.face(axis);
        self.enter = exit;
        Some((cell, enter, exit))
    }
}
