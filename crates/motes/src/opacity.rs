//! How much each particle hides of what lies behind it.

use motes_particles::read::names;
use motes_particles::{Column, Particles, Values};

/// Name of the column that some formats give the alpha of a colour as.
pub(crate) const ALPHA: &str = "alpha";

/// The opacities of one system's particles, 0 to 1.
#[derive(Clone, Debug)]
pub(crate) enum Opacity {
    /// One for all.
    Uniform(f32),
    /// One each, in the file's order.
    Each(Vec<f32>),
}

impl Opacity {
    /// `factor` · (1 − transparency) · alpha, as far as the particles have these; the alpha is that of
    /// `own_color`, the column of colours that is shown.
    pub fn new(particles: &Particles, own_color: Option<&Column>, factor: f64) -> Self {
        let transparency = particles.column(names::TRANSPARENCY);
        let alpha = own_color.and_then(|color| match color.components {
            4.. => Some((color, 3)),
            _ => particles.column(ALPHA).map(|alpha| (alpha, 0)),
        });
        if transparency.is_none() && alpha.is_none() {
            return Self::Uniform(factor as f32);
        }
        let part = |value: f64| if value.is_nan() { 1.0 } else { value.clamp(0.0, 1.0) };
        let of = |row: usize| {
            let clear = transparency.map_or(0.0, |c| c.number(row, 0));
            let alpha = alpha.map_or(1.0, |(c, component)| c.number(row, component) * unit(c));
            (factor * part(1.0 - clear) * part(alpha)) as f32
        };
        let each: Vec<f32> = (0..particles.len()).map(of).collect();
        if each.iter().all(|o| *o == 1.0) { Self::Uniform(1.0) } else { Self::Each(each) }
    }

    /// That of particle `index`.
    pub fn of(&self, index: u32) -> f32 {
        match self {
            Self::Uniform(opacity) => *opacity,
            Self::Each(each) => each[index as usize],
        }
    }

    /// Whether all are wholly opaque.
    pub fn is_opaque(&self) -> bool {
        matches!(self, Self::Uniform(1.0))
    }
}

/// The factor that brings a column's colours to 0..=1.
fn unit(column: &Column) -> f64 {
    if matches!(column.values, Values::U8(_)) { 1.0 / 255.0 } else { 1.0 }
}
