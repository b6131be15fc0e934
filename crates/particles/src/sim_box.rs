//! The simulation box: three vectors from a corner, any shape.

/// A simulation box, orthogonal or triclinic, in the file's own coordinates and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulationBox {
    /// The corner the vectors start from.
    pub origin: [f64; 3],
    /// The three edge vectors `a`, `b`, `c`.
    pub vectors: [[f64; 3]; 3],
    /// Which of the three directions is periodic.
    pub periodic: [bool; 3],
}

impl SimulationBox {
    /// An axis-aligned box from `low` to `high`.
    pub fn axis_aligned(low: [f64; 3], high: [f64; 3], periodic: [bool; 3]) -> Self {
        let edge = |i: usize| high[i] - low[i];
        Self {
            origin: low,
            vectors: [[edge(0), 0.0, 0.0], [0.0, edge(1), 0.0], [0.0, 0.0, edge(2)]],
            periodic,
        }
    }

    /// A box from edge lengths and angles in degrees (α between b and c, β between a and c, γ between
    /// a and b), `a` along x and `b` in the xy plane, as crystallographers write it.
    ///
    /// `None` where a length or angle is not finite, not positive, or no such box exists.
    pub fn from_lengths_and_angles(lengths: [f64; 3], angles_deg: [f64; 3]) -> Option<Self> {
        let [a, b, c] = lengths;
        let usable = |v: &f64| v.is_finite() && *v > 0.0;
        if !lengths.iter().chain(&angles_deg).all(usable) {
            return None;
        }
        // Right angles are exact, not cos(90°) = 6e-17.
        let cos = |deg: f64| if deg == 90.0 { 0.0 } else { deg.to_radians().cos() };
        let [cos_alpha, cos_beta, cos_gamma] = angles_deg.map(cos);
        let sin_gamma = (1.0 - cos_gamma * cos_gamma).sqrt();
        let cx = c * cos_beta;
        let cy = c * (cos_alpha - cos_beta * cos_gamma) / sin_gamma;
        let cz2 = c * c - cx * cx - cy * cy;
        if cz2.is_nan() || cz2 <= 0.0 {
            return None;
        }
        Some(Self {
            origin: [0.0; 3],
            vectors: [[a, 0.0, 0.0], [b * cos_gamma, b * sin_gamma, 0.0], [cx, cy, cz2.sqrt()]],
            periodic: [true; 3],
        })
    }

    /// The eight corners, corner `i` adding vector `k` where bit `k` of `i` is set.
    pub fn corners(&self) -> [[f64; 3]; 8] {
        std::array::from_fn(|i| {
            std::array::from_fn(|axis| {
                (0..3)
                    .filter(|k| i >> k & 1 == 1)
                    .fold(self.origin[axis], |sum, k| sum + self.vectors[k][axis])
            })
        })
    }
}
