//! Lines in space that pass behind what is nearer.
//!
//! Along a straight line 1/z is linear on the screen, z being the depth along the view axis; the depth layer
//! holds distances along each pixel's ray, d = z √(1 + r²/f²), with r the pixels from the picture's centre and
//! f the focal length in pixels. In a parallel projection d = z is itself linear.

use super::canvas::Canvas;
use super::coverage::{Coverage, Point, walk_line};

/// Straight lines in space, such as the edges of the simulation box.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines {
    /// The lines, cut off in front of the camera.
    pub lines: Vec<Line>,
    /// Half the picture's height in pixels over the tangent of half the vertical field of view; infinite for a
    /// parallel projection.
    pub focal_px: f32,
    /// Linear colour; `None` is the ink.
    pub color: Option<[f32; 3]>,
    /// Opacity of what is behind something, 0 … 1; 0.15 shows a box whole without cluttering it.
    pub hidden: f32,
}

/// A straight line in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// One end.
    pub from: LineEnd,
    /// The other end.
    pub to: LineEnd,
}

/// The end of a line in space, seen by the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineEnd {
    /// Column and row in pixels, may be outside; the first pixel's centre is at (½, ½).
    pub pixel: [f32; 2],
    /// Distance along the ray in world units, as in the depth layer; greater than 0.
    pub distance: f32,
}

impl Lines {
    pub(super) fn draw(&self, canvas: &mut Canvas<'_>) {
        let size = canvas.size();
        let mut shape = Coverage::new([0.0, 0.0, canvas.width(), canvas.height()], 0.0, size);
        let width = (canvas.em / 11.0).max(1.0);
        for line in &self.lines {
            self.draw_line(*line, width, canvas, &mut shape);
        }
        // Light on dark looks stronger than dark on light, and a box should not shout.
        let opacity = 0.85 - 0.35 * canvas.ink[0];
        match self.color {
            Some(color) => canvas.fill(&shape, color, 1.0),
            None => canvas.fill(&shape, canvas.ink, opacity),
        }
    }

    fn draw_line(&self, line: Line, width: f32, canvas: &Canvas<'_>, shape: &mut Coverage) {
        let [columns, rows] = canvas.size();
        let center = [columns as f32 / 2.0, rows as f32 / 2.0];
        let Some([first, last]) = inside(line, [columns as f32, rows as f32], width) else {
            return;
        };
        let [from, to] = [line.from.pixel, line.to.pixel];
        let at = |t: f32| [0, 1].map(|i| from[i] + (to[i] - from[i]) * t);
        let slant = |p: Point| {
            let r = (p[0] - center[0]).hypot(p[1] - center[1]) / self.focal_px;
            (1.0 + r * r).sqrt()
        };
        let z = [line.from.distance / slant(from), line.to.distance / slant(to)];
        let distance = |t: f32| {
            if self.focal_px.is_infinite() {
                return z[0] + (z[1] - z[0]) * t;
            }
            slant(at(t)) / (1.0 / z[0] + (1.0 / z[1] - 1.0 / z[0]) * t)
        };
        let depth = canvas.frame.depth();
        walk_line([0, 0, columns, rows], [at(first), at(last)], width, |x, y, t, coverage| {
            let distance = distance(first + (last - first) * t);
            let free = depth.map_or(1.0, |depth| in_front(depth, columns, [x, y], distance));
            let opacity = free + (1.0 - free) * self.hidden.clamp(0.0, 1.0);
            shape.put(x, y, coverage * opacity);
        });
    }
}

/// The share of a pixel and its four neighbours (half its weight each) that `distance` is in front of; the depth
/// layer knows only centres, and this softens its stairs.
fn in_front(depth: &[f32], columns: usize, [x, y]: [usize; 2], distance: f32) -> f32 {
    let center = y * columns + x;
    let (mut front, mut all) = (0.0, 0.0);
    let mut count = |index: Option<usize>, weight: f32| {
        if let Some(nearest) = index.and_then(|i| depth.get(i)) {
            all += weight;
            front += if distance <= *nearest { weight } else { 0.0 };
        }
    };
    count(Some(center), 2.0);
    count((x > 0).then(|| center - 1), 1.0);
    count((x + 1 < columns).then_some(center + 1), 1.0);
    count(center.checked_sub(columns), 1.0);
    count(Some(center + columns), 1.0);
    if all > 0.0 { front / all } else { 1.0 }
}

/// The part of the line, as parameters 0 … 1, that may touch a picture of `size`; Liang and Barsky 1984.
fn inside(line: Line, size: [f32; 2], width: f32) -> Option<[f32; 2]> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    let rim = f64::from(width) + 2.0;
    for (i, side) in size.into_iter().enumerate() {
        let (from, to) = (f64::from(line.from.pixel[i]), f64::from(line.to.pixel[i]));
        if !(from.is_finite() && to.is_finite()) {
            return None;
        }
        let bounds = [-rim - from, f64::from(side) + rim - from];
        if from == to {
            if bounds[0] > 0.0 || bounds[1] < 0.0 {
                return None;
            }
            continue;
        }
        let [a, b] = bounds.map(|bound| bound / (to - from));
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    (first < last).then_some([first as f32, last as f32])
}
