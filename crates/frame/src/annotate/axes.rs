//! Three arrows that show where x, y and z point.

use super::Side;
use super::canvas::{Align, Canvas};
use super::coverage::{Coverage, Point};
use super::text::Text;

/// Where the axes of the world point, seen by the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Unit vectors along x, y and z of the world: to the right, up, and towards the viewer.
    pub directions: [[f32; 3]; 3],
    /// In which bottom corner they stand.
    pub side: Side,
}

/// Red, green and blue that read on white as on black; linear.
const COLORS: [[f32; 3]; 3] = [[0.73, 0.045, 0.04], [0.035, 0.36, 0.06], [0.04, 0.155, 0.80]];
const NAMES: [&str; 3] = ["x", "y", "z"];
/// Length of an arrow in ems.
const LENGTH: f32 = 2.6;
/// From the tip to the middle of the letter in ems.
const GAP: f32 = 0.62;

impl Axes {
    /// Draws the arrows, the farthest first, and returns the side of the square they take.
    pub(super) fn draw(&self, canvas: &mut Canvas<'_>) -> f32 {
        let em = canvas.em;
        // The arrow, the gap, and half a letter.
        let reach = (LENGTH + 1.0) * em;
        let y = canvas.height() - 0.8 * canvas.margin() - reach;
        let x = match self.side {
            Side::Left => 0.8 * canvas.margin() + reach,
            Side::Right => canvas.width() - 0.8 * canvas.margin() - reach,
        };
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| self.directions[a][2].total_cmp(&self.directions[b][2]));
        let arrows = order.map(|axis| (axis, arrow(canvas, [x, y], self.directions[axis])));
        // All halos lie below all arrows, or they would part the arrows at their root.
        arrows.iter().for_each(|(_, shape)| canvas.halo_of(shape));
        for (axis, shape) in &arrows {
            // Towards a light ink the colours move too, because deep blue drowns in black.
            let light = 0.15 * canvas.ink[0];
            let color = COLORS[*axis].map(|c| c + (1.0 - c) * light);
            canvas.fill(shape, color, 1.0);
            let letter = Text::new(NAMES[*axis], em, f32::INFINITY);
            let at = beyond_tip([x, y], self.directions[*axis], em);
            canvas.text_in(&letter, at, Align::Center, color);
        }
        2.0 * reach
    }
}

/// Where a letter's foot stands beyond the tip of an arrow; beside it, if the arrow points at the eye.
fn beyond_tip(from: Point, [right, up, _]: [f32; 3], em: f32) -> Point {
    let length = right.hypot(up);
    let [dx, dy] = if length > 0.05 { [right / length, up / length] } else { [0.7, 0.7] };
    let tip = tip(from, [right, up], em);
    let x_height = 0.547 * em;
    [tip[0] + dx * GAP * em, tip[1] - dy * GAP * em + x_height / 2.0]
}

fn tip(from: Point, [right, up]: [f32; 2], em: f32) -> Point {
    let [right, up] = [right, up].map(|c| c.clamp(-1.0, 1.0) * LENGTH * em);
    [from[0] + right, from[1] - up]
}

/// A shaft and a head; both shrink with an arrow that points at the eye, down to a dot.
fn arrow(canvas: &Canvas<'_>, from: Point, [right, up, _]: [f32; 3]) -> Coverage {
    let em = canvas.em;
    let tip = tip(from, [right, up], em);
    let mut shape = canvas.shape([
        from[0].min(tip[0]) - em,
        from[1].min(tip[1]) - em,
        from[0].max(tip[0]) + em,
        from[1].max(tip[1]) + em,
    ]);
    let [dx, dy] = [tip[0] - from[0], tip[1] - from[1]];
    let length = dx.hypot(dy);
    let width = 0.19 * em;
    if length < 0.05 * em {
        shape.disc(tip, 0.27 * em);
        return shape;
    }
    let [ux, uy] = [dx / length, dy / length];
    let head = (0.75 * em).min(length);
    let half = 0.27 * em;
    let neck = [tip[0] - ux * head, tip[1] - uy * head];
    shape.line(from, neck, width);
    let corner = |side: f32| [neck[0] - uy * half * side, neck[1] + ux * half * side];
    shape.triangle([tip, corner(1.0), corner(-1.0)]);
    shape
}
