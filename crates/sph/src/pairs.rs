//! Sums over all pairs of particles within the support: the one loop under every pass.
//!
//! Each pair is visited once. A cell works with itself and the thirteen cells that come after it among
//! its neighbours: five runs of the cell order, copied into a buffer that stays in L1. Each particle of
//! the cell meets the buffer sixteen at a time; what its partners get is added up in the buffer and
//! brought back at the end. A plane of cells therefore writes to itself and to the next plane: first all
//! even planes are worked at in parallel, then all odd ones, and every sum is made in the same order for
//! any number of threads.
//!
//! Lengths are in supports, as seen from the cell. Every contribution carries a factor
//! w = 1 − (r/h)², no less than 0; so no pair needs a test, and none a root.

use bytemuck::{Pod, Zeroable};
use fearless_simd::{Level, dispatch, f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use crate::cells::Lattice;
use crate::walls::Walls;

/// Numbers in a vector.
pub(crate) const LANES: usize = 16;
/// A coordinate out of everything's reach, whose square is still finite.
const FAR: f32 = 1e15;

/// The length of rows for `count` particles: a vector may be read from any of them.
pub(crate) fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES) + LANES
}

/// Sixteen neighbours of a particle, as seen from it.
#[derive(Clone, Copy)]
pub(crate) struct Apart<S: Simd> {
    /// d, from the neighbour to the particle, in supports.
    pub d: [f32x16<S>; 3],
    /// w = max(1 − d², 0).
    pub w: f32x16<S>,
}

/// What a particle gets from sixteen neighbours: a factor, which vanishes with w, and what it is of.
pub(crate) type Found<S, const OUT: usize> = (f32x16<S>, [f32x16<S>; OUT]);

/// What a pass adds up over pairs: `OUT` sums from `IN` numbers of each particle.
pub(crate) trait Pair<const IN: usize, const OUT: usize>: Copy + Send + Sync {
    /// Whether the partner gets the same (+1), the opposite (−1), or nobody anything but from walls (0).
    const SIGN: [f32; OUT];
    /// Whether there are registers for four particles at a time.
    const FOUR: bool = false;

    /// What the numbers of particles are multiplied by before anything else.
    fn units(self) -> [f32; IN] {
        [1.0; IN]
    }

    /// What particle i gets from j.
    fn pair<S: Simd>(
        self,
        at: Apart<S>,
        i: [f32x16<S>; IN],
        j: [f32x16<S>; IN],
    ) -> Found<S, OUT>;

    /// What particle i gets from a sample of the wall of weight ψ/m.
    fn wall<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; IN], weight: f32x16<S>) -> Found<S, OUT>;
}

/// Particles in cell order, and how to go about them.
#[derive(Clone, Copy)]
pub(crate) struct Neighbors<'a> {
    pub level: Level,
    pub lattice: &'a Lattice,
    /// First particle of each cell.
    pub starts: &'a [u32],
    /// Rows of [`padded`] length.
    pub positions: [&'a [f32]; 3],
    /// h.
    pub support: f32,
    pub walls: &'a Walls,
}

/// Two planes of cells at work.
struct Task<'a, const OUT: usize> {
    plane: usize,
    /// The first particle of the plane.
    first: usize,
    /// The sums of the particles of this plane and the next.
    sums: [&'a mut [f32]; OUT],
}

/// Sixteen numbers on a line of cache.
#[repr(C, align(64))]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Sixteen([f32; LANES]);

/// The buffer of a cell.
struct Desk<const IN: usize, const OUT: usize> {
    positions: [Vec<Sixteen>; 3],
    inputs: [Vec<Sixteen>; IN],
    sums: [Vec<Sixteen>; OUT],
    /// The sums of the cell's own particles: not among those of the buffer, as a vector cannot be read
    /// soon after one of its numbers was written.
    own: [Vec<f32>; OUT],
    walls: [Vec<Sixteen>; 4],
}

impl<const IN: usize, const OUT: usize> Desk<IN, OUT> {
    fn new() -> Self {
        let row = |_| vec![Sixteen::zeroed(); 16];
        Self {
            positions: std::array::from_fn(row),
            inputs: std::array::from_fn(row),
            sums: std::array::from_fn(row),
            own: std::array::from_fn(|_| vec![]),
            walls: std::array::from_fn(row),
        }
    }

    /// Makes room for `count` neighbours.
    fn reserve(&mut self, count: usize) {
        let need = padded(count) / LANES + 1;
        if self.positions[0].len() < need {
            let rows = self.positions.iter_mut().chain(&mut self.inputs).chain(&mut self.sums);
            rows.for_each(|row| row.resize(need * 2, Sixteen::zeroed()));
        }
    }

    fn reserve_walls(&mut self, count: usize) {
        let need = padded(count) / LANES + 1;
        if self.walls[0].len() < need {
            self.walls.iter_mut().for_each(|row| row.resize(need * 2, Sixteen::zeroed()));
        }
    }
}

impl Neighbors<'_> {
    /// Sets `sums` to the sums of `pair` over all neighbours.
    pub fn sum<P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
        &self,
        pair: P,
        inputs: [&[f32]; IN],
        mut sums: [&mut [f32]; OUT],
    ) {
        sums.iter_mut().for_each(|row| row.par_chunks_mut(1 << 14).for_each(|part| part.fill(0.0)));
        for odd in 0..2 {
            let tasks = self.tasks(odd, &mut sums);
            tasks.into_par_iter().with_max_len(1).for_each_init(Desk::new, |desk, mut task| {
                dispatch!(self.level, simd => plane(simd, self, (pair, &inputs), &mut task, desk));
            });
        }
    }

    /// The planes of one parity that hold particles.
    fn tasks<'a, const OUT: usize>(
        &self,
        odd: usize,
        sums: &'a mut [&mut [f32]; OUT],
    ) -> Vec<Task<'a, OUT>> {
        let lattice = self.lattice;
        let begin = |plane: usize| self.starts[plane.min(lattice.planes) * lattice.plane] as usize;
        let mut rests = sums.each_mut().map(|row| &mut **row);
        let mut at = 0;
        let mut tasks = Vec::new();
        for plane in (odd..lattice.planes).step_by(2) {
            let (first, next, end) = (begin(plane), begin(plane + 1), begin(plane + 2));
            let mut cut = |from: usize, to: usize| {
                rests.each_mut().map(|rest| {
                    let (_, after) = std::mem::take(rest).split_at_mut(from);
                    let (own, after) = after.split_at_mut(to - from);
                    *rest = after;
                    own
                })
            };
            let own = cut(first - at, end - at);
            at = end;
            if next > first {
                tasks.push(Task { plane, first, sums: own });
            }
        }
        tasks
    }
}

#[simd]
fn plane<S: Simd, P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
    simd: S,
    all: &Neighbors<'_>,
    (pair, inputs): (P, &[&[f32]; IN]),
    task: &mut Task<'_, OUT>,
    desk: &mut Desk<IN, OUT>,
) {
    let lattice = all.lattice;
    let begin = task.plane * lattice.plane;
    for cell in begin..begin + lattice.plane {
        let (first, end) = (all.starts[cell] as usize, all.starts[cell + 1] as usize);
        if first == end {
            continue;
        }
        let runs = runs(lattice, all.starts, cell);
        let total: usize = runs.iter().map(|(from, to)| to - from).sum();
        desk.reserve(total);
        let view = View::new(simd, all, first);
        load(view, all, (pair, inputs), (&runs, total), desk);
        let walls = if all.walls.near(cell) { load_walls(view, all, cell, desk) } else { 0 };
        let own = end - first;
        desk.own.iter_mut().for_each(|row| row.resize(own, 0.0));
        // Several at a time read and write the buffer once.
        let mut k = 0;
        while P::FOUR && k + 4 <= own {
            some::<_, _, 4, _, _>(simd, pair, (k, total, walls), desk);
            k += 4;
        }
        while k + 2 <= own {
            some::<_, _, 2, _, _>(simd, pair, (k, total, walls), desk);
            k += 2;
        }
        if k < own {
            some::<_, _, 1, _, _>(simd, pair, (k, total, walls), desk);
        }
        store(simd, (&runs, task.first), desk, &mut task.sums);
    }
}

/// The runs of the cell order that a cell meets: itself and those after it.
#[inline(always)]
fn runs(lattice: &Lattice, starts: &[u32], cell: usize) -> [(usize, usize); 5] {
    let three = |middle: usize| (starts[middle - 1] as usize, starts[middle + 2] as usize);
    let next = cell + lattice.plane;
    [
        (starts[cell] as usize, starts[cell + 2] as usize),
        three(cell + lattice.row),
        three(next - lattice.row),
        three(next),
        three(next + lattice.row),
    ]
}

/// From where the particles of a cell and those about it are seen, and in which unit.
#[derive(Clone, Copy)]
struct View<S: Simd> {
    simd: S,
    origin: [f32x16<S>; 3],
    per_length: f32x16<S>,
}

impl<S: Simd> View<S> {
    #[inline(always)]
    fn new(simd: S, all: &Neighbors<'_>, first: usize) -> Self {
        let mut origin = [f32x16::splat(simd, 0.0); 3];
        for axis in 0..3 {
            origin[axis] = f32x16::splat(simd, all.positions[axis][first]);
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
}

/// Copies the runs into the buffer, and clears its sums.
#[inline(always)]
fn load<S: Simd, P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
    view: View<S>,
    all: &Neighbors<'_>,
    (pair, inputs): (P, &[&[f32]; IN]),
    (runs, total): (&[(usize, usize); 5], usize),
    desk: &mut Desk<IN, OUT>,
) {
    let mut at = 0;
    for (from, end) in runs {
        let wide = (end - from).next_multiple_of(LANES);
        let (run, to) = (*from..from + wide, at..at + wide);
        for axis in 0..3 {
            let to = &mut bytemuck::cast_slice_mut(&mut desk.positions[axis])[to.clone()];
            view.coordinates(axis, &all.positions[axis][run.clone()], to);
        }
        for n in 0..IN {
            let to = &mut bytemuck::cast_slice_mut(&mut desk.inputs[n])[to.clone()];
            view.numbers(pair.units()[n], &inputs[n][run.clone()], to);
        }
        at += end - from;
    }
    let vectors = total.div_ceil(LANES);
    bytemuck::cast_slice_mut::<Sixteen, f32>(&mut desk.positions[0])[total..vectors * LANES]
        .fill(FAR);
    let zero = f32x16::splat(view.simd, 0.0);
    for o in 0..OUT {
        for v in &mut desk.sums[o][..vectors] {
            zero.store_slice(&mut v.0);
        }
    }
}

/// Copies the samples of walls about `cell`; how many there are.
#[inline(always)]
fn load_walls<S: Simd, const IN: usize, const OUT: usize>(
    view: View<S>,
    all: &Neighbors<'_>,
    cell: usize,
    desk: &mut Desk<IN, OUT>,
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
    desk.reserve_walls(total);
    let mut at = 0;
    for (from, end) in runs {
        let wide = (end - from).next_multiple_of(LANES);
        for k in 0..4 {
            let to = &mut bytemuck::cast_slice_mut(&mut desk.walls[k])[at..at + wide];
            let from = &walls.rows[k][from..from + wide];
            if k < 3 {
                view.coordinates(k, from, to);
            } else {
                view.numbers(1.0, from, to);
            }
        }
        at += end - from;
    }
    let end = total.next_multiple_of(LANES);
    bytemuck::cast_slice_mut::<Sixteen, f32>(&mut desk.walls[0])[total..end].fill(FAR);
    total
}

/// The sums of the `M` particles of the cell from `k` on, a divisor of [`LANES`]; their partners' go to
/// the buffer.
#[inline(always)]
fn some<S: Simd, P: Pair<IN, OUT>, const M: usize, const IN: usize, const OUT: usize>(
    simd: S,
    pair: P,
    (k, total, wall_count): (usize, usize, usize),
    desk: &mut Desk<IN, OUT>,
) {
    let zero = f32x16::splat(simd, 0.0);
    let (vector, lane) = (k / LANES, k % LANES);
    let (mut place, mut i) = ([[zero; 3]; M], [[zero; IN]; M]);
    // Each particle itself and those before it have been met.
    let mut met = [mask32x16::from_bitmask(simd, 0); M];
    for m in 0..M {
        place[m] = of_buffer(simd, &desk.positions, (vector, lane + m));
        i[m] = of_buffer(simd, &desk.inputs, (vector, lane + m));
        met[m] = mask32x16::from_bitmask(simd, (2u64 << (lane + m)) - 1);
    }
    let mut sums = [[zero; OUT]; M];
    // All of one length, so that no index needs a test.
    let rest = vector..total.div_ceil(LANES);
    let [x, y, z] = desk.positions.each_ref().map(|row| &row[rest.clone()]);
    let inputs = desk.inputs.each_ref().map(|row| &row[rest.clone()]);
    let outputs = desk.sums.each_mut().map(|row| &mut row[rest.clone()]);
    for v in 0..rest.len() {
        let (mut j, mut theirs) = ([zero; IN], [zero; OUT]);
        for n in 0..IN {
            j[n] = f32x16::from_slice(simd, &inputs[n][v].0);
        }
        for o in 0..OUT {
            theirs[o] = f32x16::from_slice(simd, &outputs[o][v].0);
        }
        for m in 0..M {
            let mut at = apart(simd, place[m], [x, y, z], v);
            if v == 0 {
                at.w = met[m].select(zero, at.w);
            }
            let (t, found) = pair.pair(at, i[m], j);
            for o in 0..OUT {
                if P::SIGN[o] != 0.0 {
                    let t_theirs = if P::SIGN[o] < 0.0 { -t } else { t };
                    sums[m][o] = t.mul_add(found[o], sums[m][o]);
                    theirs[o] = t_theirs.mul_add(found[o], theirs[o]);
                }
            }
        }
        for o in 0..OUT {
            if P::SIGN[o] != 0.0 {
                theirs[o].store_slice(&mut outputs[o][v].0);
            }
        }
    }
    for m in 0..M {
        if wall_count > 0 {
            at_walls(simd, pair, (place[m], i[m], wall_count), desk, &mut sums[m]);
        }
        for o in 0..OUT {
            desk.own[o][k + m] = sums[m][o].reduce_sum();
        }
    }
}

/// Adds up over samples of walls.
#[inline(always)]
fn at_walls<S: Simd, P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
    simd: S,
    pair: P,
    (place, i, total): ([f32x16<S>; 3], [f32x16<S>; IN], usize),
    desk: &Desk<IN, OUT>,
    sums: &mut [f32x16<S>; OUT],
) {
    let vectors = total.div_ceil(LANES);
    let [x, y, z, weights] = desk.walls.each_ref().map(|row| &row[..vectors]);
    for v in 0..vectors {
        let at = apart(simd, place, [x, y, z], v);
        let (t, found) = pair.wall(at, i, f32x16::from_slice(simd, &weights[v].0));
        for o in 0..OUT {
            sums[o] = t.mul_add(found[o], sums[o]);
        }
    }
}

/// The numbers of one particle of the buffer, sixteen times.
#[inline(always)]
fn of_buffer<S: Simd, const N: usize>(
    simd: S,
    rows: &[Vec<Sixteen>; N],
    (vector, lane): (usize, usize),
) -> [f32x16<S>; N] {
    let mut numbers = [f32x16::splat(simd, 0.0); N];
    for n in 0..N {
        numbers[n] = f32x16::splat(simd, rows[n][vector].0[lane]);
    }
    numbers
}

/// Sixteen neighbours as seen from `place`.
#[inline(always)]
fn apart<S: Simd>(simd: S, place: [f32x16<S>; 3], rows: [&[Sixteen]; 3], v: usize) -> Apart<S> {
    let mut d = [f32x16::splat(simd, 0.0); 3];
    let mut w = f32x16::splat(simd, 1.0);
    for axis in 0..3 {
        d[axis] = place[axis] - f32x16::from_slice(simd, &rows[axis][v].0);
        w = (-d[axis]).mul_add(d[axis], w);
    }
    Apart { d, w: w.max(f32x16::splat(simd, 0.0)) }
}

/// Brings the sums of the buffer back to their particles.
#[inline(always)]
fn store<S: Simd, const IN: usize, const OUT: usize>(
    simd: S,
    (runs, first): (&[(usize, usize); 5], usize),
    desk: &Desk<IN, OUT>,
    sums: &mut [&mut [f32]; OUT],
) {
    for o in 0..OUT {
        let own = runs[0].0 - first;
        for (to, sum) in sums[o][own..].iter_mut().zip(&desk.own[o]) {
            *to += sum;
        }
    }
    let mut at = 0;
    for (begin, end) in runs {
        let (begin, length) = (begin - first, end - begin);
        for o in 0..OUT {
            let from: &[f32] = bytemuck::cast_slice(&desk.sums[o]);
            add(simd, &from[at..], &mut sums[o][begin..], length);
        }
        at += length;
    }
}

/// Adds `length` numbers; the last of them among zeros, where there is room.
#[inline(always)]
fn add<S: Simd>(simd: S, from: &[f32], to: &mut [f32], length: usize) {
    let mut at = 0;
    while at < length {
        let left = length - at;
        let (from, to) = (&from[at..], &mut to[at..]);
        if to.len() >= LANES {
            let mut sum = f32x16::from_slice(simd, &from[..LANES]);
            if left < LANES {
                let inside = mask32x16::from_bitmask(simd, (1u64 << left) - 1);
                sum = inside.select(sum, f32x16::splat(simd, 0.0));
            }
            (f32x16::from_slice(simd, &to[..LANES]) + sum).store_slice(&mut to[..LANES]);
        } else {
            to[..left].iter_mut().zip(from).for_each(|(to, from)| *to += from);
        }
        at += LANES;
    }
}
