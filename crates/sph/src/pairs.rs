//! Sums over all pairs of particles within the support: the one loop under every pass.
//!
//! Each pair is visited once: a particle meets those after it in its own cell and the next along its row, and
//! those of three cells of each of the four rows that come after its own. A row of cells is worked at as a whole: its own
//! particles, and those of the four rows, cell by cell, are copied into buffers that stay in cache. There,
//! whom a cell meets lies together, and each of its particles meets them sixteen at a time; what partners get is
//! added up in the buffer and brought back at the end. A plane of cells therefore writes to itself and to
//! the next plane: first all even planes are worked at in parallel, then all odd ones, and every sum is
//! made in the same order for any number of threads.
//!
//! Lengths are in supports, as seen from the cell. Every contribution carries a factor
//! w = 1 − (r/h)², no less than 0; so no pair needs a test, and none a root.

use fearless_simd::{Level, dispatch, f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use crate::cells::Lattice;
use crate::desk::{Desk, Place, Sixteen, View, load, load_walls, store};
use crate::walls::Walls;

/// Numbers in a vector.
pub(crate) const LANES: usize = 16;
/// So few particles are not worth the threads.
const FEW: u32 = 1 << 11;
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
    fn pair<S: Simd>(self, at: Apart<S>, i: [f32x16<S>; IN], j: [f32x16<S>; IN]) -> Found<S, OUT>;

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

impl Neighbors<'_> {
    /// Sets `sums` to the sums of `pair` over all neighbours.
    pub fn sum<P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
        &self,
        pair: P,
        inputs: [&[f32]; IN],
        mut sums: [&mut [f32]; OUT],
    ) {
        sums.iter_mut().for_each(|row| row.par_chunks_mut(1 << 14).for_each(|part| part.fill(0.0)));
        let sums_are_few = self.starts[self.lattice.cells()] < FEW;
        for odd in 0..2 {
            let tasks = self.tasks(odd, &mut sums);
            let work = |at: &mut Place<IN, OUT>, mut task: Task<'_, OUT>| {
                dispatch!(self.level, simd => plane(simd, self, (pair, &inputs), &mut task, at));
            };
            if sums_are_few {
                let mut at = Place::new();
                tasks.into_iter().for_each(|task| work(&mut at, task));
            } else {
                tasks.into_iter().par_bridge().for_each_init(Place::new, work);
            }
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
    at: &mut Place<IN, OUT>,
) {
    let lattice = all.lattice;
    let begin = task.plane * lattice.plane;
    // Not the rim.
    for row in (begin + lattice.row..begin + lattice.plane - lattice.row).step_by(lattice.row) {
        let (first, end) = (all.starts[row] as usize, all.starts[row + lattice.row] as usize);
        if first == end {
            continue;
        }
        let view = View::new(simd, all, (first + end) / 2);
        load(view, all, (pair, inputs), row, at);
        for x in 1..lattice.row - 1 {
            let cell = row + x;
            let own = (all.starts[cell] as usize - first, all.starts[cell + 1] as usize - first);
            if own.0 < own.1 {
                let walls = if all.walls.near(cell) { load_walls(view, all, cell, at) } else { 0 };
                let next = all.starts[cell + 2] as usize - first;
                cell_of(simd, pair, (own, next), (x, walls), at);
            }
        }
        store(simd, all, (row, task.first), at, &mut task.sums);
    }
}

/// Lets the particles `own` of the row meet those up to `next` and those of the rows after it; several at a
/// time, so that the buffers are read and written once for all of them.
#[inline(always)]
fn cell_of<S: Simd, P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
    simd: S,
    pair: P,
    ((begin, end), next): ((usize, usize), usize),
    (x, walls): (usize, usize),
    at: &mut Place<IN, OUT>,
) {
    let mut k = begin;
    while P::FOUR && k + 4 <= end {
        some::<_, _, 4, _, _>(simd, pair, (k, next), (x, walls), at);
        k += 4;
    }
    while k + 2 <= end {
        some::<_, _, 2, _, _>(simd, pair, (k, next), (x, walls), at);
        k += 2;
    }
    if k < end {
        some::<_, _, 1, _, _>(simd, pair, (k, next), (x, walls), at);
    }
}

/// The sums of the `M` particles of the row from `k` on.
#[inline(always)]
fn some<S: Simd, P: Pair<IN, OUT>, const M: usize, const IN: usize, const OUT: usize>(
    simd: S,
    pair: P,
    (k, next): (usize, usize),
    (x, wall_count): (usize, usize),
    at: &mut Place<IN, OUT>,
) {
    let zero = f32x16::splat(simd, 0.0);
    let mut these = These { place: [[zero; 3]; M], i: [[zero; IN]; M], sums: [[zero; OUT]; M] };
    for m in 0..M {
        these.place[m] = of_buffer(simd, &at.own.positions, k + m);
        these.i[m] = of_buffer(simd, &at.own.inputs, k + m);
    }
    // Each particle itself and those before it have been met.
    let met = k % LANES;
    meet::<_, _, true, M, _, _>(simd, pair, (k / LANES, next, met), &mut at.own, &mut these);
    let later = (at.begins[x - 1] / LANES, at.begins[x + 2], 0);
    meet::<_, _, false, M, _, _>(simd, pair, later, &mut at.later, &mut these);
    for m in 0..M {
        if wall_count > 0 {
            let (place, i) = (these.place[m], these.i[m]);
            at_walls(simd, pair, (place, i, wall_count), &at.walls, &mut these.sums[m]);
        }
    }
    // Eight vectors are added up at a time.
    for first in (0..M * OUT).step_by(8) {
        let mut eight = [zero; 8];
        for n in first..(M * OUT).min(first + 8) {
            eight[n - first] = these.sums[n / OUT][n % OUT];
        }
        let sums = add_up(eight);
        for n in first..(M * OUT).min(first + 8) {
            at.sums[n % OUT][k + n / OUT] = sums[n - first];
        }
    }
}

/// The sums of the numbers of each of eight vectors.
#[inline(always)]
fn add_up<S: Simd>(v: [f32x16<S>; 8]) -> [f32; 8] {
    let twos = [halves(v[0], v[4]), halves(v[2], v[6]), halves(v[1], v[5]), halves(v[3], v[7])];
    let sum = halves(halves(twos[0], twos[1]), halves(twos[2], twos[3]));
    let (low, high) = sum.split();
    let mut sums = [0.0; 8];
    (low + high).store_slice(&mut sums);
    sums
}

/// Half of each vector added to its other half, in turns.
#[inline(always)]
fn halves<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> f32x16<S> {
    a.zip_low(b) + a.zip_high(b)
}

/// Particles at work, each sixteen times.
struct These<S: Simd, const M: usize, const IN: usize, const OUT: usize> {
    place: [[f32x16<S>; 3]; M],
    i: [[f32x16<S>; IN]; M],
    sums: [[f32x16<S>; OUT]; M],
}

/// Lets particles meet those of the desk from vector `begin` up to particle `end`; the first `met` and, one more
/// for each, the particles themselves not, where `MASKED`.
#[inline(always)]
fn meet<
    S: Simd,
    P: Pair<IN, OUT>,
    const MASKED: bool,
    const M: usize,
    const IN: usize,
    const OUT: usize,
>(
    simd: S,
    pair: P,
    (begin, end, met): (usize, usize, usize),
    desk: &mut Desk<IN, OUT>,
    these: &mut These<S, M, IN, OUT>,
) {
    let zero = f32x16::splat(simd, 0.0);
    // All of one length, so that no index needs a test.
    let part = begin..end.div_ceil(LANES).max(begin);
    let positions = desk.positions.each_ref().map(|row| &row[part.clone()]);
    let inputs = desk.inputs.each_ref().map(|row| &row[part.clone()]);
    let outputs = desk.sums.each_mut().map(|row| &mut row[part.clone()]);
    let mut sums = these.sums;
    for v in 0..part.len() {
        let (mut j, mut theirs) = ([zero; IN], [zero; OUT]);
        for n in 0..IN {
            j[n] = f32x16::from_slice(simd, &inputs[n][v].0);
        }
        for o in 0..OUT {
            theirs[o] = f32x16::from_slice(simd, &outputs[o][v].0);
        }
        for m in 0..M {
            let mut at = apart(simd, these.place[m], positions, v);
            if MASKED && v < 2 {
                let met = ((2u64 << (met + m)) - 1) >> (v * LANES);
                at.w = mask32x16::from_bitmask(simd, met & 0xffff).select(zero, at.w);
            }
            let (t, found) = pair.pair(at, these.i[m], j);
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
    these.sums = sums;
}

/// Adds up over samples of walls.
#[inline(always)]
fn at_walls<S: Simd, P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
    simd: S,
    pair: P,
    (place, i, total): ([f32x16<S>; 3], [f32x16<S>; IN], usize),
    walls: &[Vec<Sixteen>; 4],
    sums: &mut [f32x16<S>; OUT],
) {
    let vectors = total.div_ceil(LANES);
    let [x, y, z, weights] = walls.each_ref().map(|row| &row[..vectors]);
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
    k: usize,
) -> [f32x16<S>; N] {
    let mut numbers = [f32x16::splat(simd, 0.0); N];
    for n in 0..N {
        numbers[n] = f32x16::splat(simd, rows[n][k / LANES].0[k % LANES]);
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
