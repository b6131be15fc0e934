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
        for axis in order {
            draw_arrow(canvas, [x, y], self.directions[axis], axis);
        }
        2.0 * reach
    }
}

fn draw_arrow(canvas: &mut Canvas<'_>, from: Point, direction: [f32; 3], axis: usize) {
    let em = canvas.em;
    let [right, up, _] = direction.map(|c| c.clamp(-1.0, 1.0));
    let tip = [from[0] + right * LENGTH * em, from[1] - up * LENGTH * em];
    let mut shape = canvas.shape([
        from[0].min(tip[0]) - em,
        from[1].min(tip[1]) - em,
        from[0].max(tip[0]) + em,
        from[1].max(tip[1]) + em,
    ]);
    arrow(&mut shape, [from, tip], em);
    canvas.halo_of(&shape);
    canvas.fill(&shape, COLORS[axis], 1.0);

    // A letter stands beyond its tip; beside it, if the arrow points at the eye.
    let length = right.hypot(up);
    let [dx, dy] = if length > 0.05 { [right / length, up / length] } else { [0.7, 0.7] };
    let gap = 0.62 * em;
    let x_height = 0.547 * em;
    let letter = Text::new(NAMES[axis], em, f32::INFINITY);
    let at = [tip[0] + dx * gap, tip[1] - dy * gap + x_height / 2.0];
    canvas.text_in(&letter, at, Align::Center, COLORS[axis]);
}

/// A shaft and a head; both shrink with an arrow that points at the eye, down to a dot.
fn arrow(shape: &mut Coverage, [from, tip]: [Point; 2], em: f32) {
    let [dx, dy] = [tip[0] - from[0], tip[1] - from[1]];
    let length = dx.hypot(dy);
    let width = 0.19 * em;
    shape.disc(from, width);
    if length < 0.05 * em {
        return;
    }
    let [ux, uy] = [dx / length, dy / length];
    let head = (0.75 * em).min(length);
    let half = 0.27 * em;
    let neck = [tip[0] - ux * head, tip[1] - uy * head];
    shape.line(from, neck, width);
    let corner = |side: f32| [neck[0] - uy * half * side, neck[1] + ux * half * side];
    shape.triangle([tip, corner(1.0), corner(-1.0)]);
}
