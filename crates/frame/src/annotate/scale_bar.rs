//! A bar of a round length.

use super::canvas::{Align, Canvas};
use super::text::Text;
use crate::ticks::Round;

/// How long a round length is in the picture, where the viewer looks.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleBar {
    /// Pixels that one unit of length takes at the distance of the camera's target.
    pub pixels_per_unit: f64,
    /// The unit's name, such as `Å`; may be empty.
    pub unit: String,
}

impl ScaleBar {
    /// Draws at the bottom left, `taken` pixels from where the margin ends.
    pub(super) fn draw(&self, canvas: &mut Canvas<'_>, taken: f32) {
        let (em, margin) = (canvas.em, canvas.margin());
        // At most a fifth of a picture of 4:3, so at least a twelfth of it.
        let most = 0.2 * canvas.width().min(canvas.height() * 4.0 / 3.0);
        let most = f64::from(most) / self.pixels_per_unit;
        let Some(round) = Round::at_most(most) else { return };
        let length = (round.value() * self.pixels_per_unit) as f32;
        let label = format!("{} {}", round.label(), self.unit);
        let label = Text::new(label.trim_end(), em, canvas.width() - 2.0 * margin - taken);

        let thickness = (0.25 * em).round().max(2.0);
        let bottom = (canvas.height() - margin).round();
        let left = (margin + taken + (label.width - length).max(0.0) / 2.0).round();
        let bar = [left, bottom - thickness, left + length, bottom];
        let mut shape = canvas.shape(bar);
        shape.rectangle(bar);
        canvas.halo_of(&shape);
        canvas.fill(&shape, canvas.ink, 1.0);
        canvas.text(&label, [left + length / 2.0, bar[1] - 0.45 * em], Align::Center);
    }
}
