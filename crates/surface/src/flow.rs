//! Filters that are repeated: the paper's kernel, and curvature flow.
//!
//! Zirr & Dachsbacher 2015, §3.4 and §4.6. The kernel of 3×3 pixels is (¼ ½ ¼) along rows, then along
//! columns, following links wherever they lead. n repetitions have the variance n/2 pixels², so that for a
//! standard deviation of σ pixels n = 2·σ², which goes by the distance, up to a number (the paper's 20).
//!
//! Curvature flow (van der Laan et al. 2009) moves the surface z(x, y) along the view by its mean curvature,
//! here with all lengths in pixels p of the world at that depth, and steps of a quarter:
//!
//! > z ← z + ¼·((1 + z_y²)·z_xx − 2·z_x·z_y·z_xy + (1 + z_x²)·z_yy) / (1 + z_x² + z_y²)^(3/2)

use rayon::prelude::*;

use crate::connect::{Links, Net, Place, Side, rows_mut};
use crate::filter::{Scale, depth};
use crate::{Spans, View};
use motes_scene::Projection;

/// Smooths `values`, the nearness of each surface, by the paper's kernel, repeated at most `most` times.
pub fn iterate(
    values: &mut Vec<f32>,
    (spans, links): (&Spans, &[Links]),
    (scale, most): (&Scale, u32),
) {
    let net = Net::new(spans, links);
    let mean = |sides: [Side; 2]| {
        move |at: Place, old: &[f32]| {
            let [a, b] = sides.map(|side| old[net.follow(at, side).surface]);
            0.5 * old[at.surface] + 0.25 * (a + b)
        }
    };
    let passes = [mean([Side::Left, Side::Right]), mean([Side::Up, Side::Down])];
    repeat(values, spans, (scale, most), &passes);
}

/// Smooths `values`, the nearness of each surface, by curvature flow of at most `most` steps.
pub fn curvature(
    values: &mut Vec<f32>,
    (spans, links): (&Spans, &[Links]),
    (scale, most): (&Scale, u32),
    view: &View,
) {
    let (net, projection) = (Net::new(spans, links), view.rays.projection);
    let moved = |at: Place, old: &[f32]| {
        let z = |p: Place| depth(old[p.surface], projection);
        // From depth to nearness as from nearness to depth.
        depth(z(at) - step(&net, at, z, view), projection)
    };
    repeat(values, spans, (scale, most), &[moved]);
}

/// Repeats `passes`, each with half a pixel² of variance along its axes, where a surface is near enough for
/// that many, at most `most` times.
fn repeat(
    values: &mut Vec<f32>,
    spans: &Spans,
    (scale, most): (&Scale, u32),
    passes: &[impl Fn(Place, &[f32]) -> f32 + Sync],
) {
    let times = |nearness: f32| {
        let sigma = scale.sigma(nearness);
        ((2.0 * sigma * sigma).round() as u32).min(most)
    };
    let greatest = values.iter().map(|n| times(*n)).max().unwrap_or(0);
    for time in 0..greatest {
        for pass in passes {
            *values = each((spans, values), |at, old| {
                let own = old[at.surface];
                if times(own) <= time { own } else { pass(at, old) }
            });
        }
    }
}

/// How far a surface moves in one step, in depth.
fn step(net: &Net<'_>, at: Place, z: impl Fn(Place) -> f32, view: &View) -> f32 {
    let side = |side| z(net.follow(at, side));
    let (own, [l, r, u, d]) = (z(at), Side::ALL.map(side));
    let corner = |a, b| z(net.follow(net.follow(at, a), b));
    let cross = 0.25
        * ((corner(Side::Right, Side::Down) - corner(Side::Left, Side::Down))
            - (corner(Side::Right, Side::Up) - corner(Side::Left, Side::Up)));
    let (zx, zy) = (0.5 * (r - l), 0.5 * (d - u));
    let (zxx, zyy) = (l + r - 2.0 * own, u + d - 2.0 * own);
    let c = view.rays.pixel;
    // The world's size of a pixel there; a leap counts as flat.
    let pixel = match view.rays.projection {
        Projection::Perspective => c * own,
        Projection::Orthographic => c,
    };
    let (px, py) = (zx / pixel, zy / pixel);
    let steep = 1.0 + px * px + py * py;
    // Mean curvature of a graph over the picture, with lengths in pixels.
    let twice = ((1.0 + py * py) * zxx - 2.0 * px * py * cross + (1.0 + px * px) * zyy)
        / (steep * steep.sqrt());
    let moved = -0.25 * twice;
    // Where a surface ends its neighbours are no part of it.
    moved.clamp(-pixel, pixel)
}

/// The new value of every surface, from its place and the old values.
fn each((spans, old): (&Spans, &[f32]), new: impl Fn(Place, &[f32]) -> f32 + Sync) -> Vec<f32> {
    let mut values = vec![0.0; old.len()];
    let width = spans.size.0 as usize;
    rows_mut(&mut values, spans).into_par_iter().enumerate().for_each(|(y, row)| {
        let first = 2 * spans.starts[y * width] as usize;
        for x in 0..width {
            let of = spans.of(y * width + x);
            for surface in 2 * of.start..2 * of.end {
                row[surface - first] = new(Place { pixel: [x, y], surface }, old);
            }
        }
    });
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::connect::connect;
    use crate::filter::nearness;
    use crate::filter::tests::{sheet, view};
    use fearless_simd::Level;

    const SIZE: (u32, u32) = (61, 61);

    fn bump(x: u32, y: u32) -> f32 {
        if (x, y) == (30, 30) { -0.1 } else { 0.0 }
    }

    #[test]
    fn repeated_kernels_are_as_wide_as_the_radius() {
        let spans = sheet(SIZE, bump);
        let projection = Projection::Orthographic;
        let view = view(SIZE, projection);
        let mut values = nearness(&spans, projection);
        // σ of three pixels: 18 repetitions.
        iterate(
            &mut values,
            (&spans, &connect(&spans, Level::new())),
            (&Scale::new(0.03, 0.0, &view), 20),
        );
        let weights = (0..61 * 61).map(|i| (i % 61, f64::from(values[2 * i])));
        let (sum, moment) = weights.fold((0.0, 0.0), |(sum, moment), (x, weight)| {
            (sum + weight, moment + weight * (x as f64 - 30.0).powi(2))
        });
        assert!((sum - 0.1).abs() < 1e-4 && (moment / sum - 9.0).abs() < 0.05, "{sum} {moment}");
    }

    #[test]
    fn no_more_repetitions_than_asked() {
        let spans = sheet(SIZE, bump);
        let view = view(SIZE, Projection::Orthographic);
        let mut values = nearness(&spans, Projection::Orthographic);
        iterate(
            &mut values,
            (&spans, &connect(&spans, Level::new())),
            (&Scale::new(1.0, 0.0, &view), 1),
        );
        assert!((values[2 * (30 * 61 + 30)] - 0.025).abs() < 1e-6);
        assert_eq!(values[2 * (30 * 61 + 32)], 0.0);
    }

    #[test]
    fn curvature_flow_keeps_planes_and_levels_bumps() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let view = view(SIZE, projection);
            let tilted = |x: u32, y: u32| {
                let w = 0.1 + 1e-4 * x as f32 + 2e-4 * y as f32;
                if projection == Projection::Perspective { 1.0 / w } else { 30.0 * w }
            };
            let rough =
                |x: u32, y: u32| tilted(x, y) - if (x + y).is_multiple_of(2) { 0.02 } else { 0.0 };
            for (entry, most) in [(&tilted as &dyn Fn(u32, u32) -> f32, 1e-3), (&rough, 0.015)] {
                let spans = sheet(SIZE, entry);
                let mut values = nearness(&spans, projection);
                let scale = Scale::new(0.5, 0.0, &view);
                curvature(
                    &mut values,
                    (&spans, &connect(&spans, Level::new())),
                    (&scale, 10),
                    &view,
                );
                for (x, y) in (20..40).flat_map(|x| (20..40).map(move |y| (x, y))) {
                    let found = depth(values[2 * (y * 61 + x)], projection);
                    let off = (found - tilted(x as u32, y as u32)).abs();
                    assert!(off < most, "{projection:?} ({x}, {y}): {off}");
                }
            }
        }
    }
}
