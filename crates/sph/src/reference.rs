//! What the passes mean: every particle with every other, in double precision.

use fearless_simd::Level;

use crate::cells::{Lattice, Order};
use crate::kernel::{Kernel, Kind, Smooth, Wendland};
use crate::mask::from_sums;
use crate::pairs::{Neighbors, Pair, padded};
use crate::passes::{Density, DensityAndMask, Divergence, Factors, Force, Push};
use crate::random::{points, uniform};
use crate::walls::{Solid, Walls};

const SUPPORT: f32 = 0.11;
const FORCE: Force<Smooth> =
    Force { kernel: Smooth, viscosity: 0.02, cohesion: 0.3, gravity: [0.5, -0.1, -2.0] };

/// Particles in a box with walls, in cell order, with four numbers each.
struct Case {
    count: usize,
    lattice: Lattice,
    order: Order,
    walls: Walls,
    rows: [Vec<f32>; 3],
    inputs: [Vec<f32>; 4],
}

impl Case {
    fn new(count: usize) -> Self {
        let size = [0.9, 0.5, 0.4];
        let mut rows = points(count, size);
        let lattice = Lattice::new([-0.05; 3], size.map(|v| v + 0.05), SUPPORT);
        let mut order = Order::default();
        order.sort(Level::new(), &lattice, [&rows[0], &rows[1], &rows[2]], count);
        for row in &mut rows {
            let mut sorted: Vec<f32> = order.from.iter().map(|i| row[*i as usize]).collect();
            sorted.resize(padded(count), 0.0);
            *row = sorted;
        }
        let solids = [Solid::Box([0.0; 3], size), Solid::Ball([0.4, 0.25, 0.2], 0.1)];
        let walls = Walls::new(
            (&solids, 0.5),
            0.5 * SUPPORT,
            &Kernel::new(Kind::Smooth, SUPPORT),
            &lattice,
        );
        let inputs = std::array::from_fn(|k| {
            (0..padded(count)).map(|i| uniform(9 + k as u64, i as u64) - 0.4).collect()
        });
        Self { count, lattice, order, walls, rows, inputs }
    }

    /// The sums by the fast way.
    fn fast<P: Pair<IN, OUT>, const IN: usize, const OUT: usize>(
        &self,
        pair: P,
        level: Level,
    ) -> Vec<[f32; OUT]> {
        let neighbors = Neighbors {
            level,
            lattice: &self.lattice,
            starts: &self.order.starts,
            positions: [&self.rows[0], &self.rows[1], &self.rows[2]],
            support: SUPPORT,
            walls: &self.walls,
        };
        let inputs: [&[f32]; IN] = std::array::from_fn(|k| &self.inputs[k][..]);
        let mut sums: [Vec<f32>; OUT] = std::array::from_fn(|_| vec![1.0; self.count]);
        neighbors.sum(pair, inputs, sums.each_mut().map(|row| &mut row[..]));
        (0..self.count).map(|i| std::array::from_fn(|o| sums[o][i])).collect()
    }

    /// The sums by definition: of the way d in supports, w, and the numbers of both; a wall has the weight.
    fn slow<const OUT: usize>(
        &self,
        pair: impl Fn([f64; 3], f64, [f64; 4], [f64; 4]) -> [f64; OUT],
        wall: impl Fn([f64; 3], f64, [f64; 4], f64) -> [f64; OUT],
    ) -> Vec<[f64; OUT]> {
        let place = |rows: &[Vec<f32>], i: usize| [0, 1, 2].map(|a| f64::from(rows[a][i]));
        let numbers = |i: usize| self.inputs.each_ref().map(|row| f64::from(row[i]));
        (0..self.count)
            .map(|i| {
                let here = place(&self.rows, i);
                let mut sums = [0.0; OUT];
                let mut add = |found: [f64; OUT]| (0..OUT).for_each(|o| sums[o] += found[o]);
                let apart = |there: [f64; 3]| {
                    let d = [0, 1, 2].map(|a| (here[a] - there[a]) / f64::from(SUPPORT));
                    (d, (1.0 - d.iter().map(|v| v * v).sum::<f64>()).max(0.0))
                };
                for k in (0..self.count).filter(|k| *k != i) {
                    let (d, w) = apart(place(&self.rows, k));
                    add(pair(d, w, numbers(i), numbers(k)));
                }
                for k in 0..self.walls.count() {
                    let (d, w) = apart(place(&self.walls.rows, k));
                    add(wall(d, w, numbers(i), f64::from(self.walls.rows[3][k])));
                }
                sums
            })
            .collect()
    }
}

/// Every number of one is within `tolerance` of the other's, as a part of the greatest of its kind.
fn assert_near<const OUT: usize>(fast: &[[f32; OUT]], slow: &[[f64; OUT]], tolerance: f64) {
    for o in 0..OUT {
        let size = slow.iter().map(|s| s[o].abs()).fold(0.0, f64::max);
        for (i, (a, b)) in fast.iter().zip(slow).enumerate() {
            let (a, b) = (f64::from(a[o]), b[o]);
            assert!((a - b).abs() <= tolerance * size, "sum {o} of {i}: {a} instead of {b}");
        }
    }
}

fn shape(w: f64) -> f64 {
    w.powi(5)
}

/// Sums of some hundred f32 numbers: their rounding.
const TOLERANCE: f64 = 3e-6;

#[test]
fn passes_are_sums_over_all_pairs() {
    let case = Case::new(1500);
    let level = Level::new();
    let slow = case.slow(|_, w, _, _| [shape(w)], |_, w, _, weight| [shape(w) * weight]);
    assert!(slow.iter().any(|s| s[0] > 1.0));
    assert_near(&case.fast(Density(Smooth), level), &slow, TOLERANCE);
    let wendland = |w: f64| {
        let d = (1.0 - w).sqrt();
        [(1.0 - d).powi(3), (1.0 - d) * (1.0 + 4.0 * d)]
    };
    let value = |w: f64| wendland(w)[0] * wendland(w)[1];
    let slow = case.slow(|_, w, _, _| [value(w)], |_, w, _, weight| [value(w) * weight]);
    assert_near(&case.fast(Density(Wendland), level), &slow, TOLERANCE);

    let factors = |d: [f64; 3], w: f64, weight: f64| {
        let t = w.powi(4) * weight;
        [shape(w) * weight, t * d[0], t * d[1], t * d[2]]
    };
    let slow = case.slow(
        |d, w, _, _| {
            let [a, b, c, e] = factors(d, w, 1.0);
            [a, b, c, e, 0.0, 0.0, 0.0, b * b + c * c + e * e]
        },
        |d, w, _, weight| {
            let [a, b, c, e] = factors(d, w, weight);
            [a, b, c, e, b, c, e, 0.0]
        },
    );
    assert_near(&case.fast(Factors(Smooth), level), &slow, TOLERANCE);

    let along = |d: [f64; 3], v: [f64; 3]| (0..3).map(|a| d[a] * v[a]).sum::<f64>();
    let slow = case.slow(
        |d, w, i, j| [w.powi(4) * along(d, [0, 1, 2].map(|a| i[a] - j[a]))],
        |d, w, i, weight| [w.powi(4) * weight * along(d, [i[0], i[1], i[2]])],
    );
    assert_near(&case.fast(Divergence(Smooth), level), &slow, TOLERANCE);

    let slow = case.slow(
        |d, w, i, j| d.map(|d| w.powi(4) * (i[0] + j[0]) * d),
        |d, w, i, weight| d.map(|d| 2.0 * w.powi(4) * weight * i[0] * d),
    );
    assert_near(&case.fast(Push(Smooth), level), &slow, TOLERANCE);
}

#[test]
fn forces_are_sums_over_all_pairs() {
    let case = Case::new(1200);
    let force = FORCE;
    let slow = case.slow(
        |d, w, i, j| {
            let t = w.powi(4);
            [0, 1, 2].map(|a| {
                let drag = f64::from(0.02f32) * (i[a + 1] - j[a + 1]);
                t * ((i[0] + j[0] - f64::from(0.3f32) * w) * d[a] - drag)
            })
        },
        |d, w, i, weight| {
            let rise = -(0..3).map(|a| f64::from(FORCE.gravity[a]) * d[a]).sum::<f64>();
            d.map(|d| w.powi(4) * weight * (i[0] + rise.clamp(-i[0].abs(), i[0].abs())) * d)
        },
    );
    assert_near(&case.fast(force, Level::new()), &slow, TOLERANCE);
}

#[test]
fn masks_are_sums_over_all_pairs() {
    let case = Case::new(1500);
    let fast: Vec<[f32; 6]> = case
        .fast(DensityAndMask(Smooth), Level::new())
        .into_iter()
        .map(|s: [f32; 7]| from_sums([s[1], s[2], s[3]], [s[4], s[5], s[6]]))
        .collect();
    let slow = case.slow(
        |d, w, _, _| {
            let mut sides = [0.0; 6];
            for a in 0..3 {
                // d points from the neighbour: it is on the + side where d is negative.
                sides[2 * a + usize::from(d[a] > 0.0)] = 1.4 * d[a] * d[a] * w * w;
            }
            sides
        },
        |_, _, _, _| [0.0; 6],
    );
    let slow: Vec<[f64; 6]> = slow.into_iter().map(|s| s.map(|v| v.min(1.0))).collect();
    assert_near(&fast, &slow, TOLERANCE);

    // The same from a grid alone.
    let positions: Vec<[f32; 3]> =
        (0..case.count).map(|i| [0, 1, 2].map(|a| case.rows[a][i])).collect();
    let radii = motes_grid::Radii::Uniform(0.25 * SUPPORT);
    let grid = motes_grid::Grid::build(&positions[..], radii, None, motes_grid::Params::default());
    let masks = crate::masks(&grid, SUPPORT);
    let mut by_index = vec![[0.0; 6]; case.count];
    (0..case.count).for_each(|slot| by_index[grid.index(slot) as usize] = masks[slot]);
    assert_near(&by_index, &slow, TOLERANCE);
}

#[test]
fn instruction_sets_and_numbers_of_threads_agree() {
    let case = Case::new(1500);
    let force = FORCE;
    let fast = case.fast(force, Level::new());
    let plain = case.fast(force, Level::baseline());
    let wide: Vec<[f64; 3]> = plain.iter().map(|s| s.map(f64::from)).collect();
    assert_near(&fast, &wide, TOLERANCE);
    for threads in 1..=4 {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| case.fast(force, Level::new())), fast, "{threads} threads");
    }
}
