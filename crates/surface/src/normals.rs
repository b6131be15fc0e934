//! Normals: Sobel's operator along links, packed into a word.
//!
//! Zirr & Dachsbacher 2015, §3.4 and §4.5. With a, b the picture's coordinates at distance 1, a point at
//! depth z is P = z·(f + a·r + b·u) from the eye, and on a plane n·P = c its reciprocal depth is
//! w = n·(f + a·r + b·u)/c, so that
//!
//! > n ∝ ∂w/∂a·r + ∂w/∂b·u + (w − a·∂w/∂a − b·∂w/∂b)·f.
//!
//! In orthographic projection, with w = −z: n ∝ ∂w/∂a·r + ∂w/∂b·u + f (there a, b are in the world). Both
//! up to the sign. A normal points out of the liquid: towards the eye at an entry, away from it at an exit.
//!
//! The octahedral encoding (Meyer et al. 2010) projects a direction to |x| + |y| + |z| = 1, folds the lower
//! half out, and keeps x and y as 16-bit numbers.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::connect::{Links, Net, Place, Side, rows_mut};
use crate::{Spans, View};
use motes_scene::Projection;

/// A unit vector as two 16-bit numbers.
#[inline]
pub fn pack(n: Vec3) -> u32 {
    let sum = n.x.abs() + n.y.abs() + n.z.abs();
    let mut p = Vec2::new(n.x, n.y) / sum;
    if n.z < 0.0 {
        p = (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * p.signum();
    }
    let word = |x: f32| ((x * 32767.0).round() as i32 as u32) & 0xffff;
    word(p.x) | word(p.y) << 16
}

/// The unit vector of [`pack`]'s word.
#[inline]
pub fn unpack(word: u32) -> Vec3 {
    let number = |bits: u32| f32::from(bits as u16 as i16) / 32767.0;
    let mut p = Vec2::new(number(word & 0xffff), number(word >> 16));
    let z = 1.0 - p.x.abs() - p.y.abs();
    if z < 0.0 {
        p = (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * p.signum();
    }
    Vec3::new(p.x, p.y, z).normalize()
}

/// Differences of values per pixel along both axes of the picture, by Sobel's operator: each the mean of
/// three rows weighted 1, 2, 1.
#[inline]
fn slopes(net: &Net<'_>, at: Place, values: &[f32]) -> [f32; 2] {
    let [left, right, up, down] = Side::ALL.map(|side| net.follow(at, side));
    let difference = |a: Place, b: Place| {
        let pixels = (b.pixel[0] - a.pixel[0]) + (b.pixel[1] - a.pixel[1]);
        // At an edge the surface is seen on one side only; where it bends back, on none.
        match pixels {
            2 => 0.5 * (values[b.surface] - values[a.surface]),
            1 => values[b.surface] - values[a.surface],
            _ => 0.0,
        }
    };
    let across = |p: Place| difference(net.follow(p, Side::Left), net.follow(p, Side::Right));
    let along = |p: Place| difference(net.follow(p, Side::Up), net.follow(p, Side::Down));
    [
        0.25 * (across(up) + 2.0 * difference(left, right) + across(down)),
        0.25 * (along(left) + 2.0 * difference(up, down) + along(right)),
    ]
}

/// The normal of every surface, packed, from its nearness (see [`crate::filter::nearness`]).
pub fn normals(values: &[f32], (spans, links): (&Spans, &[Links]), view: &View) -> Vec<u32> {
    let size = [spans.size.0 as usize, spans.size.1 as usize];
    let net = Net::new(spans, links);
    let mut normals = vec![0; values.len()];
    rows_mut(&mut normals, spans).into_par_iter().enumerate().for_each(|(y, row)| {
        let first = 2 * spans.starts[y * size[0]] as usize;
        for x in 0..size[0] {
            let of = spans.of(y * size[0] + x);
            for surface in 2 * of.start..2 * of.end {
                let normal = normal(Place { pixel: [x, y], surface }, (&net, values), view);
                row[surface - first] = pack(normal);
            }
        }
    });
    normals
}

/// The unit normal out of the liquid.
fn normal(at: Place, (net, values): (&Net<'_>, &[f32]), view: &View) -> Vec3 {
    let rays = &view.rays;
    // b runs upward, rows downward.
    let [across, along] = slopes(net, at, values).map(|slope| slope / rays.pixel);
    let (by_a, by_b) = (across, -along);
    let ahead = match rays.projection {
        Projection::Perspective => {
            let a = (at.pixel[0] as f32 + 0.5 - rays.center[0]) * rays.pixel;
            let b = (rays.center[1] - at.pixel[1] as f32 - 0.5) * rays.pixel;
            values[at.surface] - a * by_a - b * by_b
        }
        Projection::Orthographic => 1.0,
    };
    // Away from the eye.
    let ahead = rays.right * by_a + rays.up * by_b + rays.forward * ahead;
    let ahead = ahead.normalize_or(rays.forward);
    if at.surface % 2 == 1 { ahead } else { -ahead }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::connect::connect;
    use crate::filter::nearness;
    use crate::filter::tests::{sheet, view};

    #[test]
    fn words_hold_directions() {
        for i in 0..1000_u32 {
            let (z, angle) = (f64::from(i) / 499.5 - 1.0, f64::from(i) * 2.4);
            let r = (1.0 - z * z).sqrt();
            let n = glam::DVec3::new(r * angle.cos(), r * angle.sin(), z).as_vec3();
            let error = unpack(pack(n)).distance(n);
            // Half a step in x and y, twice that in z, of a vector no shorter than 1/√3.
            assert!(error < 6.5e-5, "{n}: {error}");
        }
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y] {
            assert!(unpack(pack(n)).distance(n) < 6e-5);
        }
    }

    #[test]
    fn planes_have_their_normals() {
        let n = Vec3::new(0.2, -0.3, -0.9).normalize();
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let view = view((40, 30), projection);
            // The plane n·P = n·(0, 0, 10), and one two behind it.
            let spans = sheet((40, 30), |x, y| {
                let (origin, direction) = view.column(x, y);
                let n = n.as_dvec3();
                ((n.z * 10.0 - n.dot(origin)) / n.dot(direction)) as f32
            });
            let values = nearness(&spans, projection);
            let words = normals(&values, (&spans, &connect(&spans)), &view);
            for (x, y) in (1..39).flat_map(|x| (1..29).map(move |y| (x, y))) {
                let found = unpack(words[2 * (y * 40 + x)]);
                // Depths near 10 are good to 1e-6; the slope over two pixels, to 1e-4.
                assert!(found.distance(n) < 1e-3, "{projection:?} ({x}, {y}): {found}");
                let back = unpack(words[2 * (y * 40 + x) + 1]);
                assert!(back.z > 0.5, "{back}");
            }
        }
    }
}
