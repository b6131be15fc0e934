//! Rigid walls as samples on their surfaces.
//!
//! A sample b stands for as much liquid as its neighbours among the samples leave it:
//! ψ_b = γ ρ₀ / Σ_k W(x_b − x_k) (Akinci et al. 2012, §3, Eq. 4–5). γ is such that a sample of a plane
//! sampled at the particles' spacing weighs as much as a particle: a lattice of particles at rest then
//! keeps its density up to the wall. Samples lie half a spacing behind the surface, so that particles at
//! rest touch it; or further, and are the heavier, so that their sum over a plane, as those particles see it,
//! is the same.

use rayon::prelude::*;

use crate::cells::{Lattice, Order};
use crate::kernel::Kernel;
use crate::pairs::padded;

/// A solid thing in the way of the liquid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// The liquid is inside this box, from its least to its greatest corner, metres.
    Box([f32; 3], [f32; 3]),
    /// The liquid is outside this ball: its centre and radius, metres.
    Ball([f32; 3], f32),
}

/// Samples of walls in cell order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Walls {
    /// Position, and ψ/m.
    pub rows: [Vec<f32>; 4],
    /// First sample of each cell.
    pub starts: Vec<u32>,
    /// Whether there are samples within reach of each cell.
    near: Vec<bool>,
}

impl Walls {
    /// Samples of `solids`, `behind` spacings behind their surfaces.
    pub fn new(
        (solids, behind): (&[Solid], f32),
        spacing: f32,
        kernel: &Kernel,
        lattice: &Lattice,
    ) -> Self {
        let points: Vec<[f32; 3]> =
            solids.iter().flat_map(|solid| sample(*solid, behind * spacing, spacing)).collect();
        let count = points.len();
        let mut rows: [Vec<f32>; 3] =
            std::array::from_fn(|a| points.iter().map(|p| p[a]).collect());
        let mut order = Order::default();
        order.sort(fearless_simd::Level::new(), lattice, [&rows[0], &rows[1], &rows[2]], count);
        for row in &mut rows {
            *row = order.from.iter().map(|i| row[*i as usize]).collect();
            row.resize(padded(count), 0.0);
        }
        let [x, y, z] = rows;
        let mut walls =
            Self { rows: [x, y, z, vec![0.0; padded(count)]], starts: order.starts, near: vec![] };
        // A hair more, as cells are told in single precision.
        let reach = 1.001 * kernel.support;
        let reaches = |cell: usize, k: usize| {
            let point = [walls.rows[0][k], walls.rows[1][k], walls.rows[2][k]];
            lattice.reaches(cell, point, reach)
        };
        let near = |cell: usize| {
            walls.runs(lattice, cell).any(|(from, to)| (from..to).any(|k| reaches(cell, k)))
        };
        walls.near = (0..lattice.cells()).into_par_iter().map(near).collect();
        walls.weigh(f64::from(spacing), f64::from(behind), kernel, lattice);
        walls
    }

    /// How many samples there are.
    pub fn count(&self) -> usize {
        self.starts.last().map_or(0, |n| *n as usize)
    }

    /// Whether there are samples within reach of `cell`.
    #[inline(always)]
    pub fn near(&self, cell: usize) -> bool {
        self.near[cell]
    }

    /// The runs of samples about a cell; none about the rim.
    fn runs(&self, lattice: &Lattice, cell: usize) -> impl Iterator<Item = (usize, usize)> {
        let below = lattice.plane + lattice.row + 1;
        let inside = cell >= below && cell + below < lattice.cells();
        (0..if inside { 9 } else { 0 }).map(move |n| {
            let plane = cell + (n / 3) * lattice.plane - lattice.plane;
            let middle = plane + (n % 3) * lattice.row - lattice.row;
            (self.starts[middle - 1] as usize, self.starts[middle + 2] as usize)
        })
    }

    fn weigh(&mut self, spacing: f64, behind: f64, kernel: &Kernel, lattice: &Lattice) {
        let plane = |away: f64| kernel.plane_sum(spacing, away * spacing);
        let full = plane(0.0) * plane(1.0) / plane(0.5 + behind);
        let point = |i: usize| -> [f32; 3] { std::array::from_fn(|a| self.rows[a][i]) };
        let weights: Vec<f32> = (0..self.count())
            .map(|i| {
                let p = point(i);
                let mut sum = 0.0;
                for (from, to) in self.runs(lattice, lattice.cell(p)) {
                    for k in from..to {
                        let q = point(k);
                        let square: f32 = (0..3).map(|a| (p[a] - q[a]).powi(2)).sum();
                        sum += kernel.shape(f64::from(square).sqrt());
                    }
                }
                (full / sum) as f32
            })
            .collect();
        self.rows[3][..weights.len()].copy_from_slice(&weights);
    }
}

/// Points half a spacing behind the surface.
fn sample(solid: Solid, behind: f32, spacing: f32) -> Vec<[f32; 3]> {
    match solid {
        Solid::Box(low, high) => {
            sample_box(low.map(|v| v - behind), high.map(|v| v + behind), spacing)
        }
        Solid::Ball(center, radius) => sample_ball(center, radius - behind, spacing),
    }
}

fn sample_box(low: [f32; 3], high: [f32; 3], spacing: f32) -> Vec<[f32; 3]> {
    let counts: [u32; 3] =
        std::array::from_fn(|a| ((high[a] - low[a]) / spacing).round().max(1.0) as u32);
    let along = |a: usize, i: u32| low[a] + (high[a] - low[a]) * i as f32 / counts[a] as f32;
    let mut points = Vec::new();
    for z in 0..=counts[2] {
        for y in 0..=counts[1] {
            let inner = ![0, counts[2]].contains(&z) && ![0, counts[1]].contains(&y);
            let step = if inner { counts[0] as usize } else { 1 };
            for x in (0..=counts[0]).step_by(step) {
                points.push([along(0, x), along(1, y), along(2, z)]);
            }
        }
    }
    points
}

/// Points of the golden spiral.
fn sample_ball(center: [f32; 3], radius: f32, spacing: f32) -> Vec<[f32; 3]> {
    if radius <= 0.0 {
        return vec![center];
    }
    let area = 4.0 * std::f32::consts::PI * radius * radius;
    let count = (area / (spacing * spacing)).ceil().max(1.0) as u32;
    let turn = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (sin, cos) = (turn * f64::from(i)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            let way = [across * cos, across * sin, z].map(|v| v as f32 * radius);
            std::array::from_fn(|a| center[a] + way[a])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Kind;

    #[test]
    fn a_plane_weighs_as_much_as_liquid() {
        let (low, high, spacing) = ([0.0; 3], [1.0, 1.0, 1.0], 0.1);
        let kernel = Kernel::new(Kind::Wendland, 0.2);
        let lattice = Lattice::new([-0.05; 3], [1.05; 3], 0.2);
        let walls = Walls::new((&[Solid::Box(low, high)], 0.5), spacing, &kernel, &lattice);
        assert_eq!(walls.count(), 12usize.pow(3) - 10usize.pow(3));
        let mut planes = 0;
        for i in 0..walls.count() {
            let on = (0..3).filter(|a| {
                let v = walls.rows[*a][i];
                // Within the support of an edge the other side counts as well.
                v > 0.1 && v < 0.9
            });
            if on.count() == 2 {
                planes += 1;
                assert!((walls.rows[3][i] - 1.0).abs() < 1e-4, "{}", walls.rows[3][i]);
            } else {
                // An edge has as much of two half planes; a corner three quarters of one.
                assert!((0.7..1.34).contains(&walls.rows[3][i]), "{}", walls.rows[3][i]);
            }
        }
        assert_eq!(planes, 6 * 8 * 8);
    }

    #[test]
    fn a_ball_is_sampled_at_the_spacing() {
        let points = sample(Solid::Ball([1.0, 2.0, 3.0], 1.05), 0.05, 0.1);
        assert_eq!(points.len(), (4.0 * std::f32::consts::PI * 100.0).ceil() as usize);
        for p in points {
            let r = ((p[0] - 1.0).powi(2) + (p[1] - 2.0).powi(2) + (p[2] - 3.0).powi(2)).sqrt();
            assert!((r - 1.0).abs() < 1e-5);
        }
    }
}
