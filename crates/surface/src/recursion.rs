//! Recursion: the default way to smooth surfaces.
//!
//! The paper's kernel of 3×3 pixels, repeated n times, is nearly a Gaussian of n/2 pixels² variance, and
//! what is near needs hundreds of repetitions. The same Gaussian is had at one cost for every radius by
//! recursion along rows and along columns,
//!
//! > y(i) = x(i) + a·(y(i ∓ 1) − x(i)),
//!
//! once in each direction: each sweep has the variance a/(1 − a)², so that with `ROUNDS` rounds and the
//! standard deviation σ pixels, a/(1 − a)² = v = σ²/(2·ROUNDS) and a = (1 + 2·v − √(1 + 4·v)) / (2·v).
//! A sweep begins anew where a surface ends, and where it leaps by `LEAP` σ from one pixel to the next, as what
//! lies there before something else is not smeared over it. What leaps by less is drawn the less the more it
//! leaps, a·(1 − (leap/LEAP)²): at rims, where depth falls ever faster, neighbouring columns would else end at
//! different places, and show as streaks. What is no thicker than a ball, a drop, stays round; from there on
//! smoothing sets in with thickness.
//!
//! Surfaces stay in the order of columns, and links become distances in it: a sweep is a loop without
//! guesses. Along a row each value waits for the one before; along columns a row is drawn at once.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use crate::Spans;
use crate::connect::{Links, PRECEDING, rows_mut};
use crate::filter::Scale;
use motes_scene::Projection;

/// Sweeps forth and back over rows and columns.
const ROUNDS: u32 = 2;
/// Columns of pixels that are swept together: the values of their rows stay in cache, and places in a row's
/// part are 16-bit numbers.
const STRIP: usize = 128;
const LANES: usize = 16;

/// What the sweeps go over; of each surface
struct Paths<'a> {
    spans: &'a Spans,
    scale: &'a Scale,
    /// the recursion's factor,
    factors: Vec<f32>,
    /// how far before it that one stands which it is linked to on the left: itself, if there is none,
    back: Vec<u16>,
    /// and the place of that above in the strip's part of the row there: its end, if there is none.
    up: Vec<u16>,
}

/// Smooths `values`, the [`crate::filter::nearness`] of each surface, along `links`.
pub fn smooth(values: &mut [f32], (spans, links): (&Spans, &[Links]), scale: &Scale, level: Level) {
    let paths = Paths::new(values, (spans, links), scale, level);
    for _ in 0..ROUNDS {
        paths.pairs(values).into_par_iter().for_each(|rows| sweep_rows(rows, scale));
        strips_mut(values, spans).into_par_iter().enumerate().for_each(|(strip, mut parts)| {
            dispatch!(level, simd => sweep_columns(simd, &mut parts, strip, &paths));
        });
    }
}

impl<'a> Paths<'a> {
    fn new(
        values: &[f32],
        (spans, links): (&'a Spans, &[Links]),
        scale: &'a Scale,
        level: Level,
    ) -> Self {
        let count = values.len();
        let mut paths = Self {
            spans,
            scale,
            factors: vec![0.0; count],
            back: vec![0; count],
            up: vec![0; count],
        };
        let factors = rows_mut(&mut paths.factors, spans).into_par_iter();
        let links_to =
            rows_mut(&mut paths.back, spans).into_par_iter().zip(rows_mut(&mut paths.up, spans));
        factors.zip(links_to).enumerate().for_each(|(y, (factors, (back, up)))| {
            let first = 2 * spans.starts[y * spans.size.0 as usize] as usize;
            let all = first..first + factors.len();
            dispatch!(level, simd => find_factors(simd, &values[all.clone()], scale, factors));
            find_paths((spans, y), &links[all], (back, up));
        });
        paths
    }

    /// Rows by two, the last one perhaps with none.
    fn pairs<'b>(&'b self, values: &'b mut [f32]) -> Vec<[Row<'b>; 2]> {
        let row = |(y, values)| {
            let all = self.surfaces([0, y], self.spans.size.0 as usize);
            Row { values, back: &self.back[all.clone()], factors: &self.factors[all] }
        };
        let mut rows = rows_mut(values, self.spans).into_iter().enumerate().map(row);
        let mut pairs = Vec::new();
        while let Some(first) = rows.next() {
            pairs.push([first, rows.next().unwrap_or_default()]);
        }
        pairs
    }

    /// The surfaces of `count` pixels of a row from one on.
    fn surfaces(&self, [x, y]: [usize; 2], count: usize) -> std::ops::Range<usize> {
        let from = y * self.spans.size.0 as usize + x;
        2 * self.spans.starts[from] as usize..2 * self.spans.starts[from + count] as usize
    }

    /// Those of a row of a strip.
    fn part(&self, strip: usize, y: usize) -> std::ops::Range<usize> {
        let from = strip * STRIP;
        self.surfaces([from, y], STRIP.min(self.spans.size.0 as usize - from))
    }
}

/// The recursion's factor of each end of spans that have these values.
#[simd]
fn find_factors<S: Simd>(simd: S, values: &[f32], scale: &Scale, factors: &mut [f32]) {
    const BOTH: usize = 2 * LANES;
    let mut pieces = factors.chunks_exact_mut(BOTH);
    let mut of = values.chunks_exact(BOTH);
    for (factors, values) in (&mut pieces).zip(&mut of) {
        factors_of(simd, values, scale, factors);
    }
    let (last, values) = (pieces.into_remainder(), of.remainder());
    let (mut padded, mut found) = ([1.0; BOTH], [0.0; BOTH]);
    padded[..values.len()].copy_from_slice(values);
    factors_of(simd, &padded, scale, &mut found);
    last.copy_from_slice(&found[..values.len()]);
}

/// Those of sixteen spans.
#[inline(always)]
fn factors_of<S: Simd>(simd: S, values: &[f32], scale: &Scale, factors: &mut [f32]) {
    let low = f32x16::from_slice(simd, &values[..LANES]);
    let high = f32x16::from_slice(simd, &values[LANES..]);
    let (entries, exits) = (low.unzip_low(high), low.unzip_high(high));
    let between = (entries - exits).abs();
    let thickness = match scale.projection {
        Projection::Perspective => between / (entries * exits),
        Projection::Orthographic => between,
    };
    // The part of the standard deviation.
    let part = ((thickness - scale.drop) * scale.per_thickness).max(0.0).min(1.0);
    let entries = factor_of(simd, entries, part, scale);
    let exits = factor_of(simd, exits, part, scale);
    entries.zip_low(exits).store_slice(&mut factors[..LANES]);
    entries.zip_high(exits).store_slice(&mut factors[LANES..]);
}

/// The factor a for a part of the standard deviation.
#[inline(always)]
fn factor_of<S: Simd>(simd: S, nearness: f32x16<S>, part: f32x16<S>, scale: &Scale) -> f32x16<S> {
    let sigma = match scale.projection {
        Projection::Perspective => nearness * scale.sigma(1.0),
        Projection::Orthographic => f32x16::splat(simd, scale.sigma(1.0)),
    };
    let sigma = sigma * part;
    let v = sigma * sigma / (2 * ROUNDS) as f32;
    // The same as above without the difference of large numbers.
    v * 2.0 / (v * 2.0 + 1.0 + (v * 4.0 + 1.0).sqrt())
}

/// How far back the surfaces of row `y` have those that they are linked to on the left, and where in the
/// strips' parts of the row above those stand that they are linked to there.
fn find_paths((spans, y): (&Spans, usize), links: &[Links], (back, up): (&mut [u16], &mut [u16])) {
    let width = spans.size.0 as usize;
    let starts = &spans.starts[y * width..=(y + 1) * width];
    let above = y.saturating_sub(1) * width;
    let above = &spans.starts[above..=above + width];
    // The first column's surfaces are linked to themselves.
    let mut left = starts[0];
    let mut rest = links.iter().zip(back.iter_mut().zip(up));
    for from in (0..width).step_by(STRIP) {
        let to = (from + STRIP).min(width);
        let none = 2 * (above[to] - above[from]) as u16;
        for x in from..to {
            let apart = 2 * (starts[x] - left) as u16;
            let first = 2 * (above[x] - above[from]) as u16;
            left = starts[x];
            let own = 2 * (starts[x + 1] - starts[x]) as u16;
            for (place, (links, (back, up))) in (0..own).zip(&mut rest) {
                let [left, _, above, _] = *links;
                *back = if left < PRECEDING { apart + place - u16::from(left) } else { 0 };
                *up = if above < PRECEDING { first + u16::from(above) } else { none };
            }
        }
    }
}

/// A row of pixels; of each surface its value, how far back that on the left is, and the factor.
#[derive(Default)]
struct Row<'a> {
    values: &'a mut [f32],
    back: &'a [u16],
    factors: &'a [f32],
}

impl Row<'_> {
    #[inline(always)]
    fn draw_right(&mut self, i: usize, (back, factor): (u16, f32), scale: &Scale) {
        let before = self.values[i - back as usize];
        self.values[i] = drawn(self.values[i], before, (factor, scale));
    }

    #[inline(always)]
    fn draw_left(&mut self, i: usize, back: u16, scale: &Scale) {
        let left = i - back as usize;
        self.values[left] = drawn(self.values[left], self.values[i], (self.factors[left], scale));
    }
}

/// Sweeps two rows to the right and back, in turns: while one's value waits for that before it, the other's goes on.
fn sweep_rows([mut a, mut b]: [Row<'_>; 2], scale: &Scale) {
    let both = a.values.len().min(b.values.len());
    let in_a = a.back.iter().zip(a.factors);
    let in_b = b.back.iter().zip(b.factors);
    for (i, (in_a, in_b)) in in_a.zip(in_b).enumerate() {
        a.draw_right(i, (*in_a.0, *in_a.1), scale);
        b.draw_right(i, (*in_b.0, *in_b.1), scale);
    }
    for row in [&mut a, &mut b] {
        let count = row.values.len();
        (both..count).for_each(|i| row.draw_right(i, (row.back[i], row.factors[i]), scale));
        (both..count).rev().for_each(|i| row.draw_left(i, row.back[i], scale));
    }
    for (i, (in_a, in_b)) in a.back[..both].iter().zip(&b.back[..both]).enumerate().rev() {
        a.draw_left(i, *in_a, scale);
        b.draw_left(i, *in_b, scale);
    }
}

/// The value `own` of a surface drawn towards the one before it: the less the farther that is, and not if it leaps or
/// is not a number.
#[inline(always)]
fn drawn(own: f32, before: f32, (factor, scale): (f32, &Scale)) -> f32 {
    let per_leap = 1.0 / scale.leap(own);
    let difference = before - own;
    let known = if difference.is_nan() { 0.0 } else { difference };
    let part = known * per_leap;
    own + factor * (1.0 - part * part).max(0.0) * known
}

/// A part of a list of values for each strip, and in it for each row.
fn strips_mut<'a>(values: &'a mut [f32], spans: &Spans) -> Vec<Vec<&'a mut [f32]>> {
    let [width, height] = [spans.size.0 as usize, spans.size.1 as usize];
    let strips = width.div_ceil(STRIP);
    let mut parts: Vec<Vec<&mut [f32]>> = (0..strips).map(|_| Vec::with_capacity(height)).collect();
    for (y, mut row) in rows_mut(values, spans).into_iter().enumerate() {
        for (s, part) in parts.iter_mut().enumerate() {
            let [from, to] = [s * STRIP, ((s + 1) * STRIP).min(width)].map(|x| y * width + x);
            let count = 2 * (spans.starts[to] - spans.starts[from]) as usize;
            let (own, rest) = row.split_at_mut(count);
            part.push(own);
            row = rest;
        }
    }
    parts
}

/// Sweeps the rows of a strip down and up again.
#[simd]
fn sweep_columns<S: Simd>(simd: S, parts: &mut [&mut [f32]], strip: usize, paths: &Paths<'_>) {
    let longest = 1 + parts.iter().map(|row| row.len()).max().unwrap_or(0);
    // The row before, with what is not a number behind it; and what each value is drawn to.
    let (mut before, mut drawing) = (vec![f32::NAN; longest], vec![f32::NAN; longest]);
    for (y, row) in parts.iter_mut().enumerate() {
        let all = paths.part(strip, y);
        if y > 0 {
            for (to, up) in drawing.iter_mut().zip(&paths.up[all.clone()]) {
                *to = before[*up as usize];
            }
            draw(simd, row, (&drawing, &paths.factors[all]), paths.scale);
        }
        before[..row.len()].copy_from_slice(row);
        before[row.len()] = f32::NAN;
    }
    for y in (1..parts.len()).rev() {
        let (rows, below) = parts.split_at_mut(y);
        let row = &mut *rows[y - 1];
        drawing[..=row.len()].fill(f32::NAN);
        for (value, up) in below[0].iter().zip(&paths.up[paths.part(strip, y)]) {
            drawing[*up as usize] = *value;
        }
        draw(simd, row, (&drawing, &paths.factors[paths.part(strip, y - 1)]), paths.scale);
    }
}

/// Each value of a row drawn towards another, see [`drawn`].
#[inline(always)]
fn draw<S: Simd>(simd: S, row: &mut [f32], (to, factors): (&[f32], &[f32]), scale: &Scale) {
    let to = &to[..row.len()];
    let mut own = row.chunks_exact_mut(LANES);
    let (mut to, mut factors) = (to.chunks_exact(LANES), factors.chunks_exact(LANES));
    for (own, (to, factor)) in (&mut own).zip((&mut to).zip(&mut factors)) {
        let value = f32x16::from_slice(simd, own);
        let difference = f32x16::from_slice(simd, to) - value;
        let per_leap = 1.0 / (value * scale.leap[1] * value + scale.leap[0]);
        let zero = f32x16::splat(simd, 0.0);
        // What is not a number is not equal to itself.
        let known = difference.simd_eq(difference).select(difference, zero);
        let part = known * per_leap;
        let factor = f32x16::from_slice(simd, factor) * (1.0 - part * part).max(zero);
        (value + factor * known).store_slice(own);
    }
    let last = to.remainder().iter().zip(factors.remainder());
    for (own, (to, factor)) in own.into_remainder().iter_mut().zip(last) {
        *own = drawn(*own, *to, (*factor, scale));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::connect::tests::random;
    use crate::connect::{Net, Place, Side, connect};
    use crate::filter::tests::{sheet, view};
    use crate::filter::{depth, nearness};

    fn smoothed(spans: &Spans, radius: f32, projection: Projection) -> Vec<f32> {
        let mut values = nearness(spans, projection);
        let scale = Scale::new(radius, 0.0, &view(spans.size, projection));
        smooth(&mut values, (spans, &connect(spans, Level::new())), &scale, Level::new());
        values.into_iter().map(|n| depth(n, projection)).collect()
    }

    #[test]
    fn one_pixel_becomes_a_gaussian_of_the_radius_in_the_world() {
        // Far smaller than a leap.
        let spans = sheet((81, 81), |x, y| if (x, y) == (40, 40) { -0.001 } else { 0.0 });
        let values = smoothed(&spans, 0.04, Projection::Orthographic);
        let weight = |x: usize, y: usize| f64::from(-values[2 * (y * 81 + x)]);
        let (mut sum, mut moments) = (0.0, [0.0; 2]);
        for (x, y) in (0..81 * 81).map(|i| (i % 81, i / 81)) {
            sum += weight(x, y);
            moments[0] += weight(x, y) * (x as f64 - 40.0).powi(2);
            moments[1] += weight(x, y) * (y as f64 - 40.0).powi(2);
        }
        assert!((sum - 0.001).abs() < 1e-5, "{sum}");
        // σ = 4 pixels.
        for moment in moments {
            assert!((moment / sum - 16.0).abs() < 0.05, "{moments:?}");
        }
    }

    #[test]
    fn a_plane_stays_a_plane() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let spans = sheet((120, 90), |x, y| {
                let linear = 0.1 + 1e-5 * x as f32 - 2e-5 * y as f32;
                if projection == Projection::Perspective { 1.0 / linear } else { 100.0 * linear }
            });
            let after = smoothed(&spans, 0.02, projection);
            // Away from the edge, where the sweeps begin.
            for (x, y) in (40..80).flat_map(|x| (40..50).map(move |y| (x, y))) {
                let i = 2 * (y * 120 + x);
                assert!((after[i] - spans.depths[i]).abs() < 1e-4 * after[i], "({x}, {y})");
            }
        }
    }

    #[test]
    fn what_leaps_is_not_smeared() {
        let step = sheet((40, 40), |x, _| if x < 20 { 10.0 } else { 11.0 });
        assert_eq!(smoothed(&step, 0.1, Projection::Orthographic), step.depths);
    }

    #[test]
    fn spans_do_not_cross() {
        let mut random = 7_u64;
        let mut spans = sheet((64, 64), |_, _| 0.0);
        for span in spans.depths.chunks_mut(2) {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            span[0] = 10.0 + (random >> 40) as f32 / 1e8;
            span[1] = span[0] + (random >> 50) as f32 / 1e5;
        }
        let after = smoothed(&spans, 0.05, Projection::Perspective);
        assert!(after.chunks(2).all(|span| span[0] <= span[1]));
    }

    /// The recursion link by link.
    fn plainly(values: &mut [f32], (spans, links): (&Spans, &[Links]), scale: &Scale) {
        let factor = |i: usize, values: &[f32]| {
            let (a, b) = (values[i], values[i ^ 1]);
            let thickness = match scale.projection {
                Projection::Perspective => (a - b).abs() / (a * b),
                Projection::Orthographic => (a - b).abs(),
            };
            let part = ((thickness - scale.drop) * scale.per_thickness).clamp(0.0, 1.0);
            let sigma = scale.sigma(a) * part;
            let v = sigma * sigma / (2 * ROUNDS) as f32;
            2.0 * v / (1.0 + 2.0 * v + (1.0 + 4.0 * v).sqrt())
        };
        let factors: Vec<f32> = (0..values.len()).map(|i| factor(i, values)).collect();
        let [width, height] = [spans.size.0 as usize, spans.size.1 as usize];
        let net = Net::new(spans, links);
        let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        for _ in 0..ROUNDS {
            for side in Side::ALL {
                let forth: Vec<_> = match side {
                    Side::Left | Side::Up => pixels().collect(),
                    Side::Right | Side::Down => pixels().rev().collect(),
                };
                for pixel in forth {
                    let of = spans.of(pixel[1] * width + pixel[0]);
                    for i in 2 * of.start..2 * of.end {
                        let next = net.follow(Place { pixel, surface: i }, side);
                        if next.pixel != pixel {
                            values[i] = drawn(values[i], values[next.surface], (factors[i], scale));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn sweeps_are_the_recursion_link_by_link() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            for (size, most) in [((150, 40), 5), ((64, 9), 1), ((65, 30), 12), ((1, 20), 3)] {
                let spans = random(size, most);
                let links = connect(&spans, Level::new());
                // Half of the leaps count, and half of the spans are thick.
                let scale = Scale::new(0.2, 1.5, &view(size, projection));
                let start = nearness(&spans, projection);
                let mut expected = start.clone();
                plainly(&mut expected, (&spans, &links), &scale);
                assert_ne!(start, expected);
                for level in [Level::new(), Level::baseline()] {
                    let mut found = start.clone();
                    smooth(&mut found, (&spans, &links), &scale, level);
                    assert_eq!(found, expected, "{projection:?} {size:?}");
                }
            }
        }
    }
}
