//! Filter: surfaces made smooth along their links.
//!
//! Zirr & Dachsbacher 2015, §3.4 and §4.6: reciprocal depth (which is linear over a plane in the picture) is
//! smoothed over connected surfaces, so that spans never cross; how far goes by the distance, so that the
//! radius is the same in the world. Two ways beside the paper's own are in `flow.rs`. Here, the default:
//!
//! The paper's kernel of 3×3 pixels, repeated n times, is nearly a Gaussian of n/2 pixels² variance, and
//! what is near needs hundreds of repetitions. The same Gaussian is had at one cost for every radius by
//! recursion along rows and along columns,
//!
//! > y(i) = x(i) + a·(y(i ∓ 1) − x(i)),
//!
//! once in each direction: each sweep has the variance a/(1 − a)², so that with `ROUNDS` rounds and the
//! standard deviation σ pixels, a/(1 − a)² = v = σ²/(2·ROUNDS) and a = (1 + 2·v − √(1 + 4·v)) / (2·v).
//! A sweep begins anew where a surface ends, and where it leaps by more than `LEAP` σ from one pixel to
//! the next, as what lies there before something else is not smeared over it. What is no thicker than a ball,
//! a drop, stays round; from there on smoothing sets in with thickness.

use std::ops::Range;

use rayon::prelude::*;

use crate::connect::{Links, PRECEDING, Side, rows_mut};
use crate::{Spans, View};
use motes_scene::Projection;

/// Sweeps forth and back over rows and columns.
const ROUNDS: u32 = 2;
/// Leaps of so many standard deviations end a surface.
const LEAP: f32 = 8.0;
/// What is thicker than a drop by this part is smoothed fully.
const THICK: f32 = 0.5;
/// Columns of pixels that are swept together: the values of their rows stay in cache.
const STRIP: usize = 64;

/// How near each surface is: reciprocal depth in perspective, depth backwards in orthographic projection.
/// Nearer is greater, and a plane is linear over the picture.
pub fn nearness(spans: &Spans, projection: Projection) -> Vec<f32> {
    let of = |depth: &f32| match projection {
        Projection::Perspective => 1.0 / depth,
        Projection::Orthographic => -depth,
    };
    spans.depths.par_iter().with_min_len(1 << 14).map(of).collect()
}

/// The depth of a nearness.
#[inline]
pub fn depth(nearness: f32, projection: Projection) -> f32 {
    match projection {
        Projection::Perspective => 1.0 / nearness,
        Projection::Orthographic => -nearness,
    }
}

/// The scale of smoothing at each nearness.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Standard deviation, pixels: this in orthographic projection, times nearness in perspective.
    sigma: f32,
    /// What is a leap: in the world.
    leap: f32,
    /// Diameter of a drop, in the world, and what part of smoothing each unit of thickness brings beyond it.
    drop: f32,
    per_thickness: f32,
    projection: Projection,
}

impl Scale {
    /// Smoothing with the standard deviation `radius`, in world units, as `view` shows it, of what is thicker
    /// than a `drop`.
    pub fn new(radius: f32, drop: f32, view: &View) -> Self {
        Self {
            sigma: radius / view.rays.pixel,
            leap: LEAP * radius,
            drop,
            per_thickness: 1.0 / (THICK * drop).max(f32::MIN_POSITIVE),
            projection: view.rays.projection,
        }
    }

    /// Standard deviation, pixels.
    #[inline]
    pub fn sigma(&self, nearness: f32) -> f32 {
        match self.projection {
            Projection::Perspective => self.sigma * nearness,
            Projection::Orthographic => self.sigma,
        }
    }

    /// The difference of nearness that is a leap.
    #[inline]
    pub fn leap(&self, nearness: f32) -> f32 {
        match self.projection {
            Projection::Perspective => self.leap * nearness * nearness,
            Projection::Orthographic => self.leap,
        }
    }

    /// The part of the standard deviation for a span between two values of nearness.
    #[inline]
    fn part(&self, [a, b]: [f32; 2]) -> f32 {
        let thickness = match self.projection {
            Projection::Perspective => (a - b).abs() / (a * b),
            Projection::Orthographic => (a - b).abs(),
        };
        ((thickness - self.drop) * self.per_thickness).clamp(0.0, 1.0)
    }

    /// The recursion's factor a for one end of a span with this other end.
    #[inline]
    fn factor(&self, nearness: f32, other: f32) -> f32 {
        let sigma = self.sigma(nearness) * self.part([nearness, other]);
        let v = sigma * sigma / (2 * ROUNDS) as f32;
        // The same as above without the difference of large numbers.
        2.0 * v / (1.0 + 2.0 * v + (1.0 + 4.0 * v).sqrt())
    }
}

/// What the sweeps go over: columns, links, and the recursion's factor for each surface.
struct Net<'a> {
    spans: &'a Spans,
    links: &'a [Links],
    factors: Vec<f32>,
    scale: &'a Scale,
}

/// Smooths `values`, the [`nearness`] of each surface, along `links`.
pub fn smooth(values: &mut [f32], (spans, links): (&Spans, &[Links]), scale: &Scale) {
    let mut factors = vec![0.0; values.len()];
    // Spans of one column are pairs of values.
    let pieces = factors.par_chunks_mut(1 << 14).zip(values.par_chunks(1 << 14));
    pieces.for_each(|(factors, values)| {
        for (factors, span) in factors.chunks_exact_mut(2).zip(values.chunks_exact(2)) {
            factors[0] = scale.factor(span[0], span[1]);
            factors[1] = scale.factor(span[1], span[0]);
        }
    });
    let net = Net { spans, links, factors, scale };
    for _ in 0..ROUNDS {
        sweep_rows(values, &net);
        sweep_columns(values, &net);
    }
}

fn sweep_rows(values: &mut [f32], net: &Net<'_>) {
    let (width, scale) = (net.spans.size.0 as usize, net.scale);
    rows_mut(values, net.spans).into_par_iter().enumerate().for_each(|(y, row)| {
        let starts = &net.spans.starts[y * width..=(y + 1) * width];
        let first = starts[0] as usize;
        let all = 2 * first..2 * starts[width] as usize;
        let (links, factors) = (&net.links[all.clone()], &net.factors[all]);
        let column = |x: usize| 2 * (starts[x] as usize - first);
        for x in 1..width {
            let before = column(x - 1);
            for i in column(x)..column(x + 1) {
                let link = links[i][Side::Left as usize];
                if link < PRECEDING {
                    row[i] = drawn(row[i], row[before + link as usize], (factors[i], scale));
                }
            }
        }
        for x in (0..width.saturating_sub(1)).rev() {
            let behind = column(x + 1);
            for i in column(x)..behind {
                let link = links[i][Side::Right as usize];
                if link < PRECEDING {
                    row[i] = drawn(row[i], row[behind + link as usize], (factors[i], scale));
                }
            }
        }
    });
}

/// The value `own` of a surface drawn towards the one before it.
#[inline]
fn drawn(own: f32, before: f32, (factor, scale): (f32, &Scale)) -> f32 {
    let difference = before - own;
    if difference.abs() > scale.leap(own) {
        return own;
    }
    own + factor * difference
}

fn sweep_columns(values: &mut [f32], net: &Net<'_>) {
    let spans = net.spans;
    let [width, height] = [spans.size.0 as usize, spans.size.1 as usize];
    let strips = width.div_ceil(STRIP);
    // Each strip's part of each row.
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
    parts.into_par_iter().enumerate().for_each(|(s, mut part)| {
        let columns = s * STRIP..((s + 1) * STRIP).min(width);
        let at = |y: usize| y * width + columns.start..y * width + columns.end;
        for y in 1..height {
            let (above, rows) = part.split_at_mut(y);
            sweep_row((&mut *rows[0], at(y)), (&*above[y - 1], at(y - 1)), (Side::Up, net));
        }
        for y in (0..height.saturating_sub(1)).rev() {
            let (rows, below) = part.split_at_mut(y + 1);
            sweep_row((&mut *rows[y], at(y)), (&*below[0], at(y + 1)), (Side::Down, net));
        }
    });
}

/// One row of a strip, its values and pixels, drawn towards the row before it.
fn sweep_row(
    (row, pixels): (&mut [f32], Range<usize>),
    (before, pixels_before): (&[f32], Range<usize>),
    (side, net): (Side, &Net<'_>),
) {
    let starts = &net.spans.starts[pixels.start..=pixels.end];
    let starts_before = &net.spans.starts[pixels_before.start..=pixels_before.end];
    let all = 2 * starts[0] as usize..2 * starts[pixels.len()] as usize;
    let (links, factors) = (&net.links[all.clone()], &net.factors[all]);
    for x in 0..pixels.len() {
        let from = 2 * (starts_before[x] - starts_before[0]) as usize;
        for i in 2 * (starts[x] - starts[0])..2 * (starts[x + 1] - starts[0]) {
            let i = i as usize;
            let link = links[i][side as usize];
            if link < PRECEDING {
                let before = before[from + link as usize];
                row[i] = drawn(row[i], before, (factors[i], net.scale));
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::connect::connect;
    use glam::Vec3;
    use motes_scene::Rays;

    pub(crate) fn view(size: (u32, u32), projection: Projection) -> View {
        let rays = Rays {
            origin: Vec3::ZERO,
            forward: Vec3::Z,
            right: Vec3::X,
            up: -Vec3::Y,
            center: [size.0 as f32 / 2.0, size.1 as f32 / 2.0],
            pixel: 0.01,
            projection,
        };
        View { rays, size, near: 0.1, far: 100.0 }
    }

    /// One span in every column, from `entry` on, two long.
    pub(crate) fn sheet(size: (u32, u32), entry: impl Fn(u32, u32) -> f32) -> Spans {
        let pixels = size.0 * size.1;
        let at = |i: u32| entry(i % size.0, i / size.0);
        Spans {
            size,
            near: 0.1,
            far: 100.0,
            starts: (0..=pixels).collect(),
            depths: (0..pixels).flat_map(|i| [at(i), at(i) + 2.0]).collect(),
            ..Spans::default()
        }
    }

    fn smoothed(spans: &Spans, radius: f32, projection: Projection) -> Vec<f32> {
        let mut values = nearness(spans, projection);
        let scale = Scale::new(radius, 0.0, &view(spans.size, projection));
        smooth(&mut values, (spans, &connect(spans)), &scale);
        values.into_iter().map(|n| depth(n, projection)).collect()
    }

    #[test]
    fn one_pixel_becomes_a_gaussian_of_the_radius_in_the_world() {
        // Small enough to be no leap.
        let spans = sheet((81, 81), |x, y| if (x, y) == (40, 40) { -0.1 } else { 0.0 });
        let values = smoothed(&spans, 0.04, Projection::Orthographic);
        let weight = |x: usize, y: usize| f64::from(-values[2 * (y * 81 + x)]);
        let (mut sum, mut moments) = (0.0, [0.0; 2]);
        for (x, y) in (0..81 * 81).map(|i| (i % 81, i / 81)) {
            sum += weight(x, y);
            moments[0] += weight(x, y) * (x as f64 - 40.0).powi(2);
            moments[1] += weight(x, y) * (y as f64 - 40.0).powi(2);
        }
        assert!((sum - 0.1).abs() < 1e-3, "{sum}");
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
}
