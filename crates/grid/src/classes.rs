//! Radius classes: one grid for each factor of four between radii.
//!
//! A grid enlarges every frustum by its greatest radius (Gribble et al. 2007, §4.1, "Discussion"),
//! which one huge sphere would spoil for a million small ones.

use std::borrow::Cow;

use crate::{Grid, Params, Radii};

/// The grids of one particle system, greatest radii first.
#[derive(Clone, Debug, Default)]
pub struct RadiusClasses {
    /// One grid per class that has particles.
    pub grids: Vec<Grid>,
    /// Particles that cannot be drawn: position not finite, or radius not positive and finite.
    pub left_out: usize,
}

/// Radii in one class differ by no more than this.
const CLASS_FACTOR: f32 = 4.0;

impl RadiusClasses {
    /// Sorts particles into classes and builds a grid for each. Positions that are handed over are freed
    /// as soon as they are no longer needed.
    ///
    /// # Panics
    /// As [`Grid::build`].
    pub fn build<'a>(
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        radii: Radii<&[f32]>,
        params: Params,
    ) -> Self {
        Self::default().rebuild(positions, radii, params)
    }

    /// [`RadiusClasses::build`] in the memory of grids that are no longer needed.
    ///
    /// # Panics
    /// As [`Grid::build`].
    pub fn rebuild<'a>(
        self,
        positions: impl Into<Cow<'a, [[f32; 3]]>>,
        radii: Radii<&[f32]>,
        params: Params,
    ) -> Self {
        let mut spare = self.grids.into_iter();
        let mut positions = positions.into();
        let count = positions.len();
        let classes = match radii {
            Radii::Uniform(r) if !drawable(r) => Vec::new(),
            Radii::Uniform(_) => vec![None],
            Radii::Each(each) => classes_of(each),
        };
        let last = classes.len().saturating_sub(1);
        let build = |(i, chosen): (usize, &Option<Vec<u32>>)| {
            // The last may let go of them.
            let positions = match i == last {
                true => std::mem::take(&mut positions),
                false => Cow::Borrowed(&*positions),
            };
            let spare = spare.next().unwrap_or_else(Grid::empty);
            spare.rebuild(positions, radii, chosen.as_deref(), params)
        };
        let grids: Vec<Grid> = classes.iter().enumerate().map(build).collect();
        let drawn: usize = grids.iter().map(Grid::len).sum();
        let grids = grids.into_iter().filter(|g| !g.is_empty()).collect();
        Self { grids, left_out: count - drawn }
    }

    /// How many particles the grids hold.
    pub fn len(&self) -> usize {
        self.grids.iter().map(Grid::len).sum()
    }

    /// Whether they hold none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn drawable(radius: f32) -> bool {
    radius.is_finite() && radius > 0.0
}

/// The particles of each class, greatest radii first; `None` stands for all of them.
fn classes_of(radii: &[f32]) -> Vec<Option<Vec<u32>>> {
    let greatest = radii.iter().copied().filter(|r| drawable(*r)).fold(0.0, f32::max);
    let least = radii.iter().copied().fold(f32::INFINITY, f32::min);
    if least > 0.0 && radii.iter().all(|r| drawable(*r)) && greatest <= CLASS_FACTOR * least {
        return vec![None];
    }
    let mut classes: Vec<Vec<u32>> = Vec::new();
    for (i, radius) in radii.iter().enumerate().filter(|(_, r)| drawable(**r)) {
        // Halving exponents is exact: greatest / 4^(class + 1) < radius ≤ greatest / 4^class.
        let mut class = 0;
        let mut bound = greatest / CLASS_FACTOR;
        while *radius <= bound && bound > 0.0 {
            class += 1;
            bound /= CLASS_FACTOR;
        }
        if classes.len() <= class {
            classes.resize_with(class + 1, Vec::new);
        }
        classes[class].push(i as u32);
    }
    classes.into_iter().filter(|c| !c.is_empty()).map(Some).collect()
}
