//! Antialiased shapes as coverage: the share of each pixel that a shape fills, 0 … 1.
//!
//! A shape's edge is a ramp one pixel wide across its exact distance, which is area coverage for
//! straight edges but for corners. Shapes of one drawing join by the larger coverage, so that overlapping
//! strokes do not darken where they meet.

/// A rectangle of pixels and how much of each is covered.
pub(crate) struct Coverage {
    /// Column and row of the first pixel.
    pub(crate) origin: [usize; 2],
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    /// Row by row.
    pub(crate) values: Vec<f32>,
}

/// Left, top, right and bottom in pixels.
pub(crate) type Bounds = [f32; 4];

/// A point in pixels, y down; the first pixel's centre is at (½, ½).
pub(crate) type Point = [f32; 2];

impl Coverage {
    /// Nothing covered, over those pixels of `bounds` and a rim of `rim` around it that lie in a picture
    /// of `size` pixels.
    pub(crate) fn new(bounds: Bounds, rim: f32, size: [usize; 2]) -> Coverage {
        let range = |low: f32, high: f32, size: usize| {
            // Float casts saturate, and NaN becomes 0.
            let first = ((low - rim - 1.0).floor() as usize).min(size);
            (first, ((high + rim + 1.0).ceil() as usize).min(size).saturating_sub(first))
        };
        let (left, width) = range(bounds[0], bounds[2], size[0]);
        let (top, height) = range(bounds[1], bounds[3], size[1]);
        Coverage { origin: [left, top], size: [width, height], values: vec![0.0; width * height] }
    }

    /// Covers pixel (`x`, `y`) of the picture at least by `coverage`.
    pub(crate) fn put(&mut self, x: usize, y: usize, coverage: f32) {
        let (column, row) = (x.wrapping_sub(self.origin[0]), y.wrapping_sub(self.origin[1]));
        if column < self.size[0] && row < self.size[1] {
            let value = &mut self.values[row * self.size[0] + column];
            *value = value.max(coverage);
        }
    }

    /// A rectangle, by exact area.
    pub(crate) fn rectangle(&mut self, [left, top, right, bottom]: Bounds) {
        let overlap = |low: f32, high: f32, pixel: usize| {
            (high.min(pixel as f32 + 1.0) - low.max(pixel as f32)).clamp(0.0, 1.0)
        };
        for y in self.rows(top, bottom) {
            for x in self.columns(left, right) {
                self.put(x, y, overlap(left, right, x) * overlap(top, bottom, y));
            }
        }
    }

    /// A disc.
    pub(crate) fn disc(&mut self, center: Point, radius: f32) {
        self.line(center, center, 2.0 * radius);
    }

    /// A straight stroke with round ends.
    pub(crate) fn line(&mut self, from: Point, to: Point, width: f32) {
        let bounds = self.bounds();
        walk_line(bounds, [from, to], width, |x, y, _, coverage| self.put(x, y, coverage));
    }

    /// A triangle, its corners in either order.
    pub(crate) fn triangle(&mut self, corners: [Point; 3]) {
        let [a, b, c] = corners;
        let turn = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum();
        let inside = |p: Point| {
            let edges = [(a, b), (b, c), (c, a)];
            let depth = edges.map(|(from, to)| {
                let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
                turn * (dx * (p[1] - from[1]) - dy * (p[0] - from[0])) / dx.hypot(dy).max(1e-6)
            });
            depth[0].min(depth[1]).min(depth[2])
        };
        let low = |i: usize| a[i].min(b[i]).min(c[i]) - 1.0;
        let high = |i: usize| a[i].max(b[i]).max(c[i]) + 1.0;
        for y in self.rows(low(1), high(1)) {
            for x in self.columns(low(0), high(0)) {
                let coverage = (inside([x as f32 + 0.5, y as f32 + 0.5]) + 0.5).clamp(0.0, 1.0);
                self.put(x, y, coverage);
            }
        }
    }

    /// The same shape grown by `radius`, fading over the outer half of it.
    pub(crate) fn grown(&self, radius: f32) -> Coverage {
        let reach = radius.clamp(0.0, 64.0).ceil() as isize;
        let brush: Vec<(isize, isize, f32)> = (-reach..=reach)
            .flat_map(|y| (-reach..=reach).map(move |x| (x, y)))
            .map(|(x, y)| (x, y, 2.0 - 2.0 * (x as f32).hypot(y as f32) / radius.max(1e-3)))
            .filter(|(_, _, fade)| *fade > 0.0)
            .map(|(x, y, fade)| (x, y, fade.min(1.0)))
            .collect();
        let mut grown = Coverage { values: vec![0.0; self.values.len()], ..*self };
        for (i, &value) in self.values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
            let (x, y) = (self.origin[0] + i % self.size[0], self.origin[1] + i / self.size[0]);
            for (dx, dy, fade) in &brush {
                // Left of or above the picture wraps to far outside it.
                grown.put(x.wrapping_add_signed(*dx), y.wrapping_add_signed(*dy), value * fade);
            }
        }
        grown
    }

    fn bounds(&self) -> [usize; 4] {
        let ([left, top], [width, height]) = (self.origin, self.size);
        [left, top, left + width, top + height]
    }

    fn columns(&self, low: f32, high: f32) -> std::ops::Range<usize> {
        pixels(low, high, self.origin[0], self.origin[0] + self.size[0])
    }

    fn rows(&self, low: f32, high: f32) -> std::ops::Range<usize> {
        pixels(low, high, self.origin[1], self.origin[1] + self.size[1])
    }
}

/// The pixels from `low` to `high` that lie in `first .. end`.
fn pixels(low: f32, high: f32, first: usize, end: usize) -> std::ops::Range<usize> {
    (low.floor() as usize).max(first)..(high.ceil() as usize).min(end)
}

/// Visits the pixels of a stroke with round ends inside `bounds` (left, top, right, bottom): column, row,
/// the parameter 0 … 1 of the nearest point of the segment, and the coverage.
pub(crate) fn walk_line(
    bounds: [usize; 4],
    [from, to]: [Point; 2],
    width: f32,
    mut visit: impl FnMut(usize, usize, f32, f32),
) {
    // A hair line is as wide as a pixel and as much fainter.
    let strength = width.clamp(0.0, 1.0);
    let radius = width.max(1.0) / 2.0;
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let length_squared = (dx * dx + dy * dy).max(1e-12);
    let rim = radius + 1.0;
    for y in pixels(from[1].min(to[1]) - rim, from[1].max(to[1]) + rim, bounds[1], bounds[3]) {
        // Only the part of the segment that passes near this row matters.
        let row = y as f32 + 0.5 - from[1];
        let (mut first, mut last) = (0.0, 1.0);
        if dy.abs() > 1e-3 {
            let near = [(row - rim) / dy, (row + rim) / dy];
            first = near[0].min(near[1]).clamp(0.0, 1.0);
            last = near[0].max(near[1]).clamp(0.0, 1.0);
        }
        let ends = [from[0] + dx * first, from[0] + dx * last];
        for x in
            pixels(ends[0].min(ends[1]) - rim, ends[0].max(ends[1]) + rim, bounds[0], bounds[2])
        {
            let column = x as f32 + 0.5 - from[0];
            let t = ((column * dx + row * dy) / length_squared).clamp(0.0, 1.0);
            let distance = (column - dx * t).hypot(row - dy * t);
            let coverage = (radius - distance + 0.5).clamp(0.0, 1.0) * strength;
            if coverage > 0.0 {
                visit(x, y, t, coverage);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(draw: impl FnOnce(&mut Coverage)) -> f32 {
        let mut coverage = Coverage::new([0.0, 0.0, 100.0, 80.0], 0.0, [100, 80]);
        draw(&mut coverage);
        coverage.values.iter().sum()
    }

    #[test]
    fn shapes_cover_their_area() {
        assert!((area(|c| c.rectangle([10.25, 20.5, 14.75, 30.0])) - 4.5 * 9.5).abs() < 1e-3);
        let disc = std::f32::consts::PI * 20.3 * 20.3;
        assert!((area(|c| c.disc([50.2, 40.7], 20.3)) / disc - 1.0).abs() < 2e-3);
        // 3-4-5: length 50, width 4, and two half discs at the ends.
        let stroke = 50.0 * 4.0 + std::f32::consts::PI * 4.0;
        assert!((area(|c| c.line([20.0, 20.0], [60.0, 50.0], 4.0)) / stroke - 1.0).abs() < 5e-3);
        let corners = [[10.0, 10.0], [50.0, 10.0], [10.0, 40.0]];
        assert!((area(|c| c.triangle(corners)) / 600.0 - 1.0).abs() < 5e-3);
        let turned = [corners[0], corners[2], corners[1]];
        assert_eq!(area(|c| c.triangle(turned)), area(|c| c.triangle(corners)));
    }

    #[test]
    fn hair_lines_fade_instead_of_breaking() {
        let thick = area(|c| c.line([10.0, 20.5], [90.0, 20.5], 1.0));
        let thin = area(|c| c.line([10.0, 20.5], [90.0, 20.5], 0.25));
        assert!((thin / thick - 0.25).abs() < 1e-5);
    }

    #[test]
    fn absurd_shapes_neither_panic_nor_linger() {
        for far in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e30] {
            area(|c| c.rectangle([far, 0.0, 1.0, far]));
            area(|c| c.disc([far, far], far));
            area(|c| c.line([far, 0.0], [5.0, far], 2.0));
            area(|c| c.triangle([[far, 0.0], [0.0, far], [1.0, 1.0]]));
            assert!(Coverage::new([far, far, far, far], far, [3, 3]).grown(far).values.len() <= 9);
        }
        assert!(Coverage::new([0.0; 4], 5.0, [0, 0]).grown(3.0).values.is_empty());
    }

    #[test]
    fn growing_reaches_as_far_as_it_says() {
        let mut dot = Coverage::new([0.0, 0.0, 21.0, 21.0], 0.0, [21, 21]);
        dot.put(10, 10, 1.0);
        let grown = dot.grown(4.0);
        let at = |x: usize| grown.values[10 * 21 + x];
        assert_eq!([at(10), at(12), at(13), at(14)], [1.0, 1.0, 0.5, 0.0]);
    }
}
