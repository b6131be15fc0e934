//! One frame of particles.

use crate::{Column, SimulationBox};

/// The particles' radii, in the file's units of length.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Radius {
    /// The file says nothing.
    #[default]
    Unknown,
    /// One radius for all.
    Uniform(f32),
    /// One radius each.
    Each(Vec<f32>),
}

impl Radius {
    /// The same, without a list of equal radii.
    pub fn simplified(self) -> Self {
        match &self {
            Self::Each(radii) => match &radii[..] {
                [first, rest @ ..] if rest.iter().all(|r| r == first) => Self::Uniform(*first),
                _ => self,
            },
            _ => self,
        }
    }
}

/// One frame: positions, radii, columns, box, time.
///
/// # Invariants
/// Every column, and `Radius::Each`, has as many rows as there are particles, and there are as many
/// positions, or none once they were taken. Position `i` is
/// `origin + positions[i]` in the file's own coordinates. Positions need not be finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Particles {
    /// What was subtracted from every position, so that f32 keeps the detail; often zero.
    pub origin: [f64; 3],
    /// Positions about `origin`.
    pub positions: Vec<[f32; 3]>,
    /// How many positions were taken away by [`Particles::take_positions`]; else 0.
    pub taken: usize,
    /// Radii.
    pub radius: Radius,
    /// All other properties, in the file's order.
    pub columns: Vec<Column>,
    /// The simulation box, in the file's own coordinates.
    pub sim_box: Option<SimulationBox>,
    /// Simulated time, in the file's unit.
    pub time: Option<f64>,
    /// Time step number.
    pub step: Option<i64>,
}

impl Particles {
    /// How many particles there are.
    pub fn len(&self) -> usize {
        self.positions.len() + self.taken
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Takes the positions away, for who keeps them in another order. All else stays as it is.
    pub fn take_positions(&mut self) -> Vec<[f32; 3]> {
        self.taken += self.positions.len();
        std::mem::take(&mut self.positions)
    }

    /// The column called `name`, exactly.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }

    /// The least box that holds all finite positions, in the file's own coordinates.
    pub fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let finite = self.positions.iter().filter(|p| p.iter().all(|v| v.is_finite()));
        let (low, high) = finite.fold(None, |bounds: Option<([f32; 3], [f32; 3])>, p| {
            let (mut low, mut high) = bounds.unwrap_or((*p, *p));
            for axis in 0..3 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
            Some((low, high))
        })?;
        let absolute = |p: [f32; 3]| std::array::from_fn(|i| self.origin[i] + f64::from(p[i]));
        Some((absolute(low), absolute(high)))
    }

    /// Bytes of memory the frame holds.
    pub fn bytes(&self) -> usize {
        let radius = match &self.radius {
            Radius::Each(radii) => radii.len() * 4,
            _ => 0,
        };
        let columns = self.columns.iter().map(|c| {
            c.values.len()
                * match c.values {
                    crate::Values::F64(_) | crate::Values::I64(_) => 8,
                    crate::Values::U8(_) => 1,
                    _ => 4,
                }
        });
        self.positions.len() * 12 + radius + columns.sum::<usize>()
    }
}

/// Collects positions read in double precision and keeps them as f32 about an origin.
///
/// The origin is chosen by the first 4096 positions: zero where these lie within 16 of their own
/// extents (f32 then still holds 2⁻²⁰ of the extent), else their centre, rounded to whole units. It
/// depends on nothing but the file, however the reader cuts it into blocks.
#[derive(Debug, Default)]
pub struct PositionBuilder {
    origin: Option<[f64; 3]>,
    /// What came before the origin was known.
    waiting: Vec<[f64; 3]>,
    positions: Vec<[f32; 3]>,
}

/// How many positions decide the origin.
const ORIGIN_SAMPLE: usize = 4096;
/// How many extents from zero coordinates may lie before they are shifted.
const FAR_EXTENTS: f64 = 16.0;

impl PositionBuilder {
    /// Adds positions in the file's own coordinates.
    pub fn push(&mut self, block: &[[f64; 3]]) {
        if self.origin.is_some() {
            return self.keep(block);
        }
        self.waiting.extend_from_slice(block);
        if self.waiting.len() >= ORIGIN_SAMPLE {
            self.decide_origin();
        }
    }

    /// How many positions were added.
    pub fn len(&self) -> usize {
        self.positions.len() + self.waiting.len()
    }

    /// Whether none was added.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The origin and the positions about it.
    pub fn finish(mut self) -> ([f64; 3], Vec<[f32; 3]>) {
        self.decide_origin();
        (self.origin.unwrap_or_default(), self.positions)
    }

    fn keep(&mut self, block: &[[f64; 3]]) {
        let origin = self.origin.unwrap_or_default();
        self.positions
            .extend(block.iter().map(|p| std::array::from_fn(|i| (p[i] - origin[i]) as f32)));
    }

    fn decide_origin(&mut self) {
        if self.origin.is_none() {
            self.origin =
                Some(choose_origin(&self.waiting[..self.waiting.len().min(ORIGIN_SAMPLE)]));
            let waiting = std::mem::take(&mut self.waiting);
            self.keep(&waiting);
        }
    }
}

fn choose_origin(sample: &[[f64; 3]]) -> [f64; 3] {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in sample.iter().filter(|p| p.iter().all(|v| v.is_finite())) {
        for axis in 0..3 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let extent = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    let farthest = (0..3).map(|i| low[i].abs().max(high[i].abs())).fold(0.0, f64::max);
    // A single position, or none that is finite, has no extent to lose.
    if extent <= 0.0 || !farthest.is_finite() || farthest <= FAR_EXTENTS * extent {
        return [0.0; 3];
    }
    std::array::from_fn(|i| (0.5 * (low[i] + high[i])).round())
}
