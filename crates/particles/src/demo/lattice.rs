//! Sets cut out of a face-centred cubic lattice of touching spheres, each a little off its place.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::maths::{cosine, cube_root, exponential, normal, permuted, sine, uniform};

const PACKED_SEED: u64 = 0x7061_636b;
const SLAB_SEED: u64 = 0x736c_6162;
const SPRAY_SEED: u64 = 0x7370_7261;
const ORDER_SEED: u64 = 0x6f72_6465;

/// The ball's radius and centre.
const BALL_RADIUS: f64 = 0.4;
const CENTRE: f64 = 0.5;
/// The slab's mean height, which is its volume.
const SLAB_HEIGHT: f64 = 0.35;
/// Above every wave.
const SLAB_TOP: f64 = 0.46;
/// Below every wave.
const SLAB_BOTTOM: f32 = 0.25;
/// Mean height of the spray above the surface.
const SPRAY_HEIGHT: f64 = 0.12;

/// A ball in the middle of the cube, in lattice order; the outermost are left out.
pub(super) fn packed(count: usize) -> (Vec<[f32; 3]>, f32) {
    let volume = 4.0 / 3.0 * PI * BALL_RADIUS * BALL_RADIUS * BALL_RADIUS;
    let distance_squared = |p: &[f32; 3]| {
        let d = p.map(|v| f64::from(v) - CENTRE);
        d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    };
    let lattice = Lattice {
        edge: cube_root(4.0 * volume / (count as f64 * 1.03)),
        low: CENTRE - BALL_RADIUS,
        extent: [2.0 * BALL_RADIUS; 3],
        jitter: 0.05,
        seed: PACKED_SEED,
    };
    let inside = |p: &[f32; 3]| distance_squared(p) < BALL_RADIUS * BALL_RADIUS;
    let (points, radius) = lattice.at_least(count, &inside);
    (least(points, count, &distance_squared), radius)
}

/// A slab with a wavy surface and spray above it, shuffled.
pub(super) fn dam(count: usize) -> (Vec<[f32; 3]>, f32) {
    let in_slab = (0.95 * count as f64) as usize;
    let above = |p: &[f32; 3]| f64::from(p[2]) - surface(f64::from(p[0]), f64::from(p[1]));
    let lattice = Lattice {
        edge: cube_root(4.0 * SLAB_HEIGHT / (in_slab.max(1) as f64 * 1.01)),
        low: 0.0,
        extent: [1.0, 1.0, SLAB_TOP],
        jitter: 0.1,
        seed: SLAB_SEED,
    };
    // Below the lowest wave the surface need not be known.
    let inside =
        |p: &[f32; 3]| p[0] <= 1.0 && p[1] <= 1.0 && (p[2] < SLAB_BOTTOM || above(p) < 0.0);
    let (slab, radius) = lattice.at_least(in_slab, &inside);
    let slab = least(slab, in_slab, &above);
    let particle = |i: usize| {
        let place = permuted(ORDER_SEED, count as u64, i as u64);
        slab.get(place as usize).copied().unwrap_or_else(|| spray(place))
    };
    ((0..count).into_par_iter().map(particle).collect(), radius)
}

/// Height of the water at (x, y).
#[allow(clippy::approx_constant)] // the recipe says 6.28, not 2π
fn surface(x: f64, y: f64) -> f64 {
    SLAB_HEIGHT + 0.07 * sine(6.28 * x) * cosine(9.4 * y) + 0.03 * sine(25.0 * x + 13.0 * y)
}

/// The drop of number `i`: fewer the higher, none above the cube.
fn spray(i: u64) -> [f32; 3] {
    let (x, y) = (uniform(SPRAY_SEED, 3 * i), uniform(SPRAY_SEED, 3 * i + 1));
    let z = surface(x, y) + SPRAY_HEIGHT * exponential(SPRAY_SEED, 3 * i + 2);
    [x, y, z.min(1.0)].map(|v| v as f32)
}

/// Where lattice points are tried.
#[derive(Clone, Copy)]
pub(super) struct Lattice {
    /// Edge of the cubic cell.
    pub edge: f64,
    /// The corner's three coordinates.
    pub low: f64,
    pub extent: [f64; 3],
    /// Standard deviation from the lattice's place, in radii.
    pub jitter: f64,
    pub seed: u64,
}

impl Lattice {
    /// Spheres touch along the face's diagonal.
    fn radius(&self) -> f64 {
        self.edge / (2.0 * 2f64.sqrt())
    }

    /// At least `count` points that are `inside`, and their radius; the edge shrinks until they fit.
    pub fn at_least(
        mut self,
        count: usize,
        inside: &(impl Fn(&[f32; 3]) -> bool + Sync),
    ) -> (Vec<[f32; 3]>, f32) {
        loop {
            let points = self.points(inside);
            if points.len() >= count {
                return (points, self.radius() as f32);
            }
            self.edge *= 0.99;
        }
    }

    /// All points that are `inside`, layer by layer.
    fn points(&self, inside: &(impl Fn(&[f32; 3]) -> bool + Sync)) -> Vec<[f32; 3]> {
        const BASIS: [[f64; 3]; 4] =
            [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]];
        let [nx, ny, nz] = self.extent.map(|extent| (extent / self.edge).ceil() as u64 + 1);
        let jitter = self.jitter * self.radius();
        let row = |row: u64| {
            (0..nx).flat_map(move |x| (0..4).map(move |b| (x, b))).map(move |(x, b)| {
                let cell = [x, row % ny, row / ny];
                let number = 4 * (nx * row + x) + b;
                std::array::from_fn(|axis| {
                    let place = (cell[axis] as f64 + BASIS[b as usize][axis]) * self.edge;
                    let off = normal(self.seed, 3 * number + axis as u64) * jitter;
                    (self.low + place + off) as f32
                })
            })
        };
        (0..nz * ny).into_par_iter().flat_map_iter(|r| row(r).filter(|p| inside(p))).collect()
    }
}

/// The `count` points of least `key`, in their order; of equal ones the earlier.
pub(super) fn least(
    mut points: Vec<[f32; 3]>,
    count: usize,
    key: &(impl Fn(&[f32; 3]) -> f64 + Sync),
) -> Vec<[f32; 3]> {
    if points.len() <= count {
        return points;
    }
    let keys: Vec<f32> = points.par_iter().map(|p| key(p) as f32).collect();
    let mut ordered = keys.clone();
    let (below, limit, _) = ordered.select_nth_unstable_by(count, f32::total_cmp);
    let limit = *limit;
    let mut equal = count - below.iter().filter(|k| **k < limit).count();
    let mut keys = keys.iter();
    points.retain(|_| match keys.next() {
        Some(key) if *key == limit => {
            let keep = equal > 0;
            equal = equal.saturating_sub(1);
            keep
        }
        key => key.is_some_and(|key| *key < limit),
    });
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_stay_in_order() {
        let points: Vec<_> = [3.0, 1.0, 2.0, 1.0, 2.0, 0.0, 2.0].map(|v| [v, 0.0, 0.0]).into();
        let kept = |count| -> Vec<f32> {
            let kept = least(points.clone(), count, &|p| f64::from(p[0]));
            kept.iter().map(|p| p[0]).collect()
        };
        assert_eq!(kept(0), []);
        assert_eq!(kept(2), [1.0, 0.0]);
        assert_eq!(kept(4), [1.0, 2.0, 1.0, 0.0]);
        assert_eq!(kept(7), [3.0, 1.0, 2.0, 1.0, 2.0, 0.0, 2.0]);
    }

    #[test]
    fn without_jitter_it_is_the_close_packing() {
        let lattice = Lattice { edge: 0.1, low: 0.0, extent: [0.3; 3], jitter: 0.0, seed: 1 };
        let points = lattice.points(&|_| true);
        let near = |p: &[f32; 3], q: &[f32; 3]| {
            let d: f64 = (0..3).map(|i| f64::from(p[i] - q[i]).powi(2)).sum();
            (d.sqrt() - 2.0 * lattice.radius()).abs() < 1e-6
        };
        // An inner point touches its twelve neighbours and none is nearer.
        let inner = [0.15, 0.15, 0.1f32];
        assert_eq!(points.len(), 4 * 4 * 4 * 4);
        assert_eq!(points.iter().filter(|p| near(p, &inner)).count(), 12);
    }
}
