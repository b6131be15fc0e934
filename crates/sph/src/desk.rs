//! The buffers that a row of cells works with: what is copied into them, and brought back.
//!
//! Lengths are in supports, as seen from the row's middle.

use bytemuck::{Pod, Zeroable};
use fearless_simd::{f32x16, mask32x16, prelude::*};

use crate::cells::Lattice;
use crate::pairs::{LANES, Neighbors, Pair, padded};

/// A coordinate out of everything's reach, whose square is still finite.
const FAR: f32 = 1e15;

/// Sixteen numbers on a line of cache.
#[repr(C, align(64))]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct Sixteen(pub [f32; LANES]);

/// Particles that are met, and what they get.
pub(crate) struct Desk<const IN: usize, const OUT: usize> {
    pub positions: [Vec<Sixteen>; 3],
    pub inputs: [Vec<Sixteen>; IN],
    pub sums: [Vec<Sixteen>; OUT],
    /// How many there are.
    pub count: usize,
}

impl<const IN: usize, const OUT: usize> Desk<IN, OUT> {
    fn new() -> Self {
        Self {
            positions: std::array::from_fn(|_| vec![]),
            inputs: std::array::from_fn(|_| vec![]),
            sums: std::array::from_fn(|_| vec![]),
            count: 0,
        }
    }

    /// Makes room for `count` particles, and has none.
    fn clear(&mut self, count: usize) {
        let need = padded(count) / LANES + 1;
        if self.positions[0].len() < need {
            let rows = self.positions.iter_mut().chain(&mut self.inputs).chain(&mut self.sums);
            rows.for_each(|row| row.resize(need * 2, Sixteen::zeroed()));
        }
        self.count = 0;
    }
}

/// What a row of cells is worked at with.
pub(crate) struct Place<const IN: usize, const OUT: usize> {
    /// Its own particles.
    pub own: Desk<IN, OUT>,
    /// Those of the rows after it, cell by cell.
    pub later: Desk<IN, OUT>,
    /// Where those of each cell begin.
    pub begins: Vec<usize>,
    /// The sums of the own particles, `OUT` of each: not in the buffer, as a vector cannot be read soon
    /// after one of its numbers was written.
    pub sums: [Vec<f32>; OUT],
    /// Samples of walls about a cell.
    pub walls: [Vec<Sixteen>; 4],
}

impl<const IN: usize, const OUT: usize> Place<IN, OUT> {
    pub fn new() -> Self {
        Self {
            own: Desk::new(),
            later: Desk::new(),
            begins: vec![],
            sums: std::array::from_fn(|_| vec![]),
            walls: std::array::from_fn(|_| vec![]),
        }
    }

    fn reserve_walls(&mut self, count: usize) {
        let need = padded(count) / LANES + 1;
        if self.walls[0].len() < need {
            self.walls.iter_mut().for_each(|row| row.resize(need * 2, Sixteen::zeroed()));
        }
    }
}

/// The rows that come after the one that begins with cell `row`.
#[inline(always)]
fn later_rows(lattice: &Lattice, row: usize) -> [usize; 4] {
    let next = row + lattice.plane;
    [row + lattice.row, next - lattice.row, next, next + lattice.row]
}

/// From where particles are seen, and in which unit.
#[derive(Clone, Copy)]
pub(crate) struct View<S: Simd> {
    simd: S,
    origin: [f32x16<S>; 3],
    per_length: f32x16<S>,
}

impl<S: Simd> View<S> {
    #[inline(always)]
    pub fn new(simd: S, all: &Neighbors<'_>, at: usize) -> Self {
        let mut origin = [f32x16::splat(simd, 0.0); 3];
        for axis in 0..3 {
            origin[axis] = f32x16::splat(simd, all.positions[axis][at]);
        }
        Self { simd, origin, per_length: f32x16::splat(simd, 1.0 / all.support) }
    }

    /// Copies a run of coordinates, in whole vectors: what is too much is overwritten.
    #[inline(always)]
    fn coordinates(self, axis: usize, from: &[f32], to: &mut [f32]) {
        for (to, from) in to.chunks_exact_mut(LANES).zip(from.chunks_exact(LANES)) {
            let from = f32x16::from_slice(self.simd, from);
            ((from - self.origin[axis]) * self.per_length).store_slice(to);
        }
    }

    /// Copies a run of other numbers, `unit` times.
    #[inline(always)]
    fn numbers(self, unit: f32, from: &[f32], to: &mut [f32]) {
        for (to, from) in to.chunks_exact_mut(LANES).zip(from.chunks_exact(LANES)) {
            (f32x16::from_slice(self.simd, from) * unit).store_slice(to);
        }
    }

    /// Adds particles `from..end` to the desk.
    #[inline(always)]
    fn put<P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
        self,
        all: &Neighbors<'_>,
        (pair, inputs): (P, &[&[f32]; IN]),
        (from, end): (usize, usize),
        desk: &mut Desk<IN, OUT>,
    ) {
        let wide = (end - from).next_multiple_of(LANES);
        let (run, to) = (from..from + wide, desk.count..desk.count + wide);
        for axis in 0..3 {
            let to = &mut bytemuck::cast_slice_mut(&mut desk.positions[axis])[to.clone()];
            self.coordinates(axis, &all.positions[axis][run.clone()], to);
        }
        for n in 0..IN {
            let to = &mut bytemuck::cast_slice_mut(&mut desk.inputs[n])[to.clone()];
            self.numbers(pair.units()[n], &inputs[n][run.clone()], to);
        }
        desk.count += end - from;
    }

    /// Ends the desk by what is out of reach, and clears its sums.
    #[inline(always)]
    fn finish<const IN: usize, const OUT: usize>(self, desk: &mut Desk<IN, OUT>) {
        let vectors = desk.count.div_ceil(LANES);
        bytemuck::cast_slice_mut::<Sixteen, f32>(&mut desk.positions[0])
            [desk.count..vectors * LANES]
            .fill(FAR);
        let zero = f32x16::splat(self.simd, 0.0);
        for o in 0..OUT {
            for v in &mut desk.sums[o][..vectors] {
                zero.store_slice(&mut v.0);
            }
        }
    }
}

/// Copies all that a row of cells works with.
#[inline(always)]
pub(crate) fn load<S: Simd, P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
    view: View<S>,
    all: &Neighbors<'_>,
    work: (P, &[&[f32]; IN]),
    row: usize,
    at: &mut Place<IN, OUT>,
) {
    let (lattice, starts) = (all.lattice, all.starts);
    let run = |from: usize, end: usize| (starts[from] as usize, starts[end] as usize);
    let own = run(row, row + lattice.row);
    at.own.clear(own.1 - own.0);
    view.put(all, work, own, &mut at.own);
    view.finish(&mut at.own);
    at.sums.iter_mut().for_each(|sums| sums.resize(own.1 - own.0, 0.0));

    let rows = later_rows(lattice, row);
    let most = rows.map(|row| run(row, row + lattice.row)).iter().map(|(a, b)| b - a).sum();
    at.later.clear(most);
    at.begins.clear();
    for x in 0..lattice.row {
        at.begins.push(at.later.count);
        // Only what a particle meets.
        let (from, end) = run(row + x.max(1) - 1, row + (x + 2).min(lattice.row));
        if from < end {
            for row in rows {
                view.put(all, work, run(row + x, row + x + 1), &mut at.later);
            }
        }
    }
    at.begins.push(at.later.count);
    view.finish(&mut at.later);
}

/// Copies the samples of walls about `cell`; how many there are.
#[inline(always)]
pub(crate) fn load_walls<S: Simd, const IN: usize, const OUT: usize>(
    view: View<S>,
    all: &Neighbors<'_>,
    cell: usize,
    at: &mut Place<IN, OUT>,
) -> usize {
    let (lattice, walls) = (all.lattice, all.walls);
    let mut runs = [(0, 0); 9];
    let mut total = 0;
    for (n, run) in runs.iter_mut().enumerate() {
        let plane = cell + (n / 3) * lattice.plane - lattice.plane;
        let middle = plane + (n % 3) * lattice.row - lattice.row;
        *run = (walls.starts[middle - 1] as usize, walls.starts[middle + 2] as usize);
        total += run.1 - run.0;
    }
    at.reserve_walls(total);
    let mut put = 0;
    for (from, end) in runs {
        let wide = (end - from).next_multiple_of(LANES);
        for k in 0..4 {
            let to = &mut bytemuck::cast_slice_mut(&mut at.walls[k])[put..put + wide];
            let from = &walls.rows[k][from..from + wide];
            if k < 3 {
                view.coordinates(k, from, to);
            } else {
                view.numbers(1.0, from, to);
            }
        }
        put += end - from;
    }
    let end = total.next_multiple_of(LANES);
    bytemuck::cast_slice_mut::<Sixteen, f32>(&mut at.walls[0])[total..end].fill(FAR);
    total
}

/// Brings the sums of the buffers back to their particles; those of the slices begin with `first`.
#[inline(always)]
pub(crate) fn store<S: Simd, const IN: usize, const OUT: usize>(
    simd: S,
    all: &Neighbors<'_>,
    (row, first): (usize, usize),
    at: &Place<IN, OUT>,
    sums: &mut [&mut [f32]; OUT],
) {
    let (lattice, starts) = (all.lattice, all.starts);
    let place = |cell: usize| starts[cell] as usize - first;
    let own = place(row);
    for o in 0..OUT {
        add(simd, &at.sums[o], &mut sums[o][own..], at.sums[o].len());
        let partners = bytemuck::cast_slice(&at.own.sums[o]);
        add(simd, partners, &mut sums[o][own..], at.own.count);
    }
    let rows = later_rows(lattice, row);
    for (x, begins) in at.begins.windows(2).enumerate() {
        let mut from = begins[0];
        if from == begins[1] {
            continue;
        }
        for row in rows {
            let (begin, end) = (place(row + x), place(row + x + 1));
            for o in 0..OUT {
                let partners: &[f32] = bytemuck::cast_slice(&at.later.sums[o]);
                add(simd, &partners[from..], &mut sums[o][begin..], end - begin);
            }
            from += end - begin;
        }
    }
}

/// Adds `length` numbers; the last of them among zeros, where there is room.
#[inline(always)]
fn add<S: Simd>(simd: S, from: &[f32], to: &mut [f32], length: usize) {
    let mut at = 0;
    while at < length {
        let left = length - at;
        let (from, to) = (&from[at..], &mut to[at..]);
        if to.len() >= LANES && from.len() >= LANES {
            let mut sum = f32x16::from_slice(simd, &from[..LANES]);
            if left < LANES {
                let inside = mask32x16::from_bitmask(simd, (1u64 << left) - 1);
                sum = inside.select(sum, f32x16::splat(simd, 0.0));
            }
            (f32x16::from_slice(simd, &to[..LANES]) + sum).store_slice(&mut to[..LANES]);
        } else {
            let left = left.min(LANES);
            to[..left].iter_mut().zip(from).for_each(|(to, from)| *to += from);
        }
        at += LANES;
    }
}
