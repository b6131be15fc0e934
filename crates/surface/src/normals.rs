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

use std::ops::Range;

use fearless_simd::{Level, dispatch, f32x16, i32x16, prelude::*, u32x4, u32x16};
use fearless_simd_macros::simd;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::connect::{FOLLOWING, Links, PRECEDING, rows_mut};
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

/// The normal of every surface, packed, from its nearness (see [`crate::filter::nearness`]).
pub fn normals(
    values: &[f32],
    (spans, links): (&Spans, &[Links]),
    view: &View,
    level: Level,
) -> Vec<u32> {
    let mut normals = vec![0; values.len()];
    let mut rows = rows_mut(&mut normals, spans);
    let net = Net { spans, links, values, view };
    rows.par_chunks_mut(BAND).enumerate().for_each_init(Memory::default, |memory, band| {
        let (band, normals) = band;
        dispatch!(level, simd => find_band(simd, &net, (band * BAND, normals), memory));
    });
    normals
}

/// Rows of pixels that are worked on together.
const BAND: usize = 32;
const LANES: usize = 16;
/// Twice a bent link less this is one back or one on.
const BENT: u32 = PRECEDING as u32 + FOLLOWING as u32;

/// What normals are found from.
struct Net<'a> {
    spans: &'a Spans,
    links: &'a [Links],
    values: &'a [f32],
    view: &'a View,
}

/// What a thread works with: differences along rows, a row, and the next one.
#[derive(Default)]
struct Memory {
    across: Across,
    lines: [Line; 2],
}

/// Differences along rows of pixels, from the surface `first` on.
#[derive(Default)]
struct Across {
    first: usize,
    per_pixel: Vec<f32>,
}

/// A row of pixels; of each surface there
#[derive(Default)]
struct Line {
    /// the surfaces that it is linked to,
    around: Vec<[u32; 4]>,
    /// its links as one number, those over the edge of the picture bent,
    links: Vec<u32>,
    /// its pixel's column,
    x: Vec<f32>,
    /// the difference along columns,
    along: Vec<f32>,
    /// and the sums of both differences beside it: above and below, to the left and to the right.
    beside: [Vec<f32>; 2],
}

/// The normals of some rows from one on.
///
/// Differences come first, a row ahead. Then Sobel's operator, the mean of three rows weighted 1, 2, 1, needs only
/// those of the surface and of two beside it.
#[simd]
fn find_band<S: Simd>(
    simd: S,
    net: &Net<'_>,
    (from, normals): (usize, &mut [&mut [u32]]),
    memory: &mut Memory,
) {
    let to = from + normals.len();
    let rows = from.saturating_sub(1)..(to + 1).min(net.spans.size.1 as usize);
    let all = net.row(rows.start).start..net.row(rows.end - 1).end;
    let Memory { across, lines: [line, next] } = memory;
    across.first = all.start;
    across.per_pixel.resize(all.len(), 0.0);
    for y in rows.start..=to {
        if y < rows.end {
            next.read(simd, net, y, across);
        }
        if y > from {
            line.find(simd, net, (y - 1, across), normals[y - 1 - from]);
        }
        std::mem::swap(line, next);
    }
}

impl Net<'_> {
    /// The surfaces of a row.
    fn row(&self, y: usize) -> Range<usize> {
        let (starts, width) = (&self.spans.starts, self.spans.size.0 as usize);
        2 * starts[y * width] as usize..2 * starts[(y + 1) * width] as usize
    }
}

impl Line {
    /// Becomes row `y`, and finds the differences there.
    #[inline(always)]
    fn read<S: Simd>(&mut self, simd: S, net: &Net<'_>, y: usize, across: &mut Across) {
        let row = net.row(y);
        self.around.resize(row.len(), [0; 4]);
        self.links.resize(row.len(), 0);
        self.x.resize(row.len(), 0.0);
        self.along.resize(row.len(), 0.0);
        self.look_around(simd, net, y);
        let across = &mut across.per_pixel[row.start - across.first..row.end - across.first];
        let both = across.iter_mut().zip(&mut self.along);
        for ((across, along), [left, right, up, down]) in both.zip(&self.around) {
            *across = net.values[*right as usize] - net.values[*left as usize];
            *along = net.values[*down as usize] - net.values[*up as usize];
        }
        per_pixel::<S, 0>(simd, &self.links, across);
        per_pixel::<S, 16>(simd, &self.links, &mut self.along);
    }

    /// Finds which surfaces those of row `y` are linked to.
    #[inline(always)]
    fn look_around<S: Simd>(&mut self, simd: S, net: &Net<'_>, y: usize) {
        let [width, height] = [net.spans.size.0 as usize, net.spans.size.1 as usize];
        let [up, down] = [y > 0, y + 1 < height].map(usize::from);
        let rims = ((1 - up as u32) * 0xff_0000) | ((1 - down as u32) * 0xff00_0000);
        let shifts = u32x4::from_slice(simd, &[0, 8, 16, 24]);
        let straight = u32x4::splat(simd, u32::from(PRECEDING));
        let mut places = self.around.iter_mut().zip(&mut self.links).zip(&mut self.x);
        for x in 0..width {
            let pixel = y * width + x;
            let own = net.spans.of(pixel);
            let own = 2 * own.start..2 * own.end;
            let [left, right] = [usize::from(x > 0), usize::from(x + 1 < width)];
            let rims = rims | ((1 - left as u32) * 0xff) | ((1 - right as u32) * 0xff00);
            let pixels = [pixel - left, pixel + right, pixel - up * width, pixel + down * width];
            let mut first = [0; 4];
            for side in 0..4 {
                first[side] = 2 * net.spans.starts[pixels[side]];
            }
            let first = u32x4::from_slice(simd, &first);
            for (surface, ((around, word), column)) in own.zip(&mut places) {
                let links = u32::from_le_bytes(net.links[surface]);
                let places = (u32x4::splat(simd, links) >> shifts) & 0xff;
                let bent = (places << 1) + (surface as u32).wrapping_sub(BENT);
                let linked = places.simd_lt(straight).select(first + places, bent);
                linked.store_slice(around);
                *word = links | rims;
                *column = x as f32;
            }
        }
    }

    /// The normals of row `y`, which this is.
    #[inline(always)]
    fn find<S: Simd>(
        &mut self,
        simd: S,
        net: &Net<'_>,
        (y, across): (usize, &Across),
        normals: &mut [u32],
    ) {
        let row = net.row(y);
        let [beside_across, beside_along] = &mut self.beside;
        beside_across.resize(row.len(), 0.0);
        beside_along.resize(row.len(), 0.0);
        let both = beside_across.iter_mut().zip(&mut *beside_along);
        for ((by_row, by_column), [left, right, up, down]) in both.zip(&self.around) {
            let across = |i: u32| across.per_pixel[i as usize - across.first];
            let along = |i: u32| self.along[i as usize - row.start];
            *by_row = across(*up) + across(*down);
            *by_column = along(*left) + along(*right);
        }
        let across = &across.per_pixel[row.start - across.first..row.end - across.first];
        let values = &net.values[row];
        let axes = Axes::of(simd, net.view, y);
        for at in (0..normals.len()).step_by(LANES) {
            let by_a = load(simd, beside_across, at) + load(simd, across, at) * 2.0;
            let by_b = load(simd, beside_along, at) + load(simd, &self.along, at) * 2.0;
            let (x, value) = (load(simd, &self.x, at), load(simd, values, at));
            let normal = axes.normal(simd, [by_a, by_b], (x, value));
            store(pack_lanes(simd, normal), normals, at);
        }
    }
}

/// Differences of linked values become such per pixel: at an edge the surface is seen on one side only; where
/// it bends back, on none. The links are at `SHIFT`, and eight bits further.
#[inline(always)]
fn per_pixel<S: Simd, const SHIFT: u32>(simd: S, links: &[u32], differences: &mut [f32]) {
    let straight = u32x16::splat(simd, u32::from(PRECEDING));
    for at in (0..links.len()).step_by(LANES) {
        let links = load(simd, bytemuck::cast_slice(links), at).bitcast::<u32x16<S>>();
        let a = ((links >> SHIFT) & 0xff).simd_lt(straight);
        let b = ((links >> (SHIFT + 8)) & 0xff).simd_lt(straight);
        let either = (a | b).select(f32x16::splat(simd, 1.0), f32x16::splat(simd, 0.0));
        let part = (a & b).select(f32x16::splat(simd, 0.5), either);
        store(load(simd, differences, at) * part, differences, at);
    }
}

/// Sixteen values to a place; what is behind the last is dropped.
#[inline(always)]
fn store<S: Simd, V: SimdBase<S>>(values: V, to: &mut [V::Element], at: usize) {
    if let Some(to) = to.get_mut(at..at + LANES) {
        return values.store_slice(to);
    }
    let to = &mut to[at..];
    to.copy_from_slice(&values.as_slice()[..to.len()]);
}

/// Sixteen values from one on, zeros behind the last.
#[inline(always)]
fn load<S: Simd>(simd: S, values: &[f32], at: usize) -> f32x16<S> {
    if let Some(values) = values.get(at..at + LANES) {
        return f32x16::from_slice(simd, values);
    }
    let mut padded = [0.0; LANES];
    padded[..values.len() - at].copy_from_slice(&values[at..]);
    f32x16::from_slice(simd, &padded)
}

/// A row of the picture in the world.
struct Axes<S: Simd> {
    right: [f32x16<S>; 3],
    up: [f32x16<S>; 3],
    forward: [f32x16<S>; 3],
    /// The picture's coordinate b there, the other's origin, pixels, and the width of a pixel.
    b: f32,
    center: f32,
    pixel: f32,
    projection: Projection,
    /// Sign bits of entries, whose normals point to the eye.
    entries: u32x16<S>,
}

impl<S: Simd> Axes<S> {
    #[inline(always)]
    fn of(simd: S, view: &View, y: usize) -> Self {
        let rays = &view.rays;
        let mut axes = [[f32x16::splat(simd, 0.0); 3]; 3];
        for (lanes, axis) in axes.iter_mut().zip([rays.right, rays.up, rays.forward]) {
            *lanes = [
                f32x16::splat(simd, axis.x),
                f32x16::splat(simd, axis.y),
                f32x16::splat(simd, axis.z),
            ];
        }
        let sign = 1 << 31;
        let entries = [sign, 0, sign, 0, sign, 0, sign, 0, sign, 0, sign, 0, sign, 0, sign, 0];
        Self {
            right: axes[0],
            up: axes[1],
            forward: axes[2],
            b: (rays.center[1] - y as f32 - 0.5) * rays.pixel,
            center: rays.center[0],
            pixel: rays.pixel,
            projection: rays.projection,
            entries: u32x16::from_slice(simd, &entries),
        }
    }

    /// The normals, of any length, of surfaces with four times these slopes per pixel, in these columns.
    #[inline(always)]
    fn normal(
        &self,
        simd: S,
        slopes: [f32x16<S>; 2],
        (x, value): (f32x16<S>, f32x16<S>),
    ) -> [f32x16<S>; 3] {
        // b runs upward, rows downward.
        let by_a = slopes[0] * (0.25 / self.pixel);
        let by_b = slopes[1] * (-0.25 / self.pixel);
        let ahead = match self.projection {
            Projection::Perspective => {
                let a = (x + (0.5 - self.center)) * self.pixel;
                value - a * by_a - by_b * self.b
            }
            Projection::Orthographic => f32x16::splat(simd, 1.0),
        };
        let mut normal = [ahead; 3];
        for (i, part) in normal.iter_mut().enumerate() {
            let away = self.right[i] * by_a + self.up[i] * by_b + self.forward[i] * ahead;
            *part = (away.bitcast::<u32x16<S>>() ^ self.entries).bitcast();
        }
        normal
    }
}

/// [`pack`] of vectors of any length.
#[inline(always)]
fn pack_lanes<S: Simd>(simd: S, [x, y, z]: [f32x16<S>; 3]) -> u32x16<S> {
    let sum = (x.abs() + y.abs() + z.abs()).max(f32::MIN_POSITIVE);
    let (x, y) = (x / sum, y / sum);
    let one = f32x16::splat(simd, 1.0);
    let folded = [(one - y.abs()).copysign(x), (one - x.abs()).copysign(y)];
    let below = z.simd_lt(f32x16::splat(simd, 0.0));
    let mut words = [u32x16::splat(simd, 0); 2];
    for ((word, flat), folded) in words.iter_mut().zip([x, y]).zip(folded) {
        let rounded = (below.select(folded, flat) * 32767.0).round_ties_even();
        *word = i32x16::truncate_from(rounded).bitcast::<u32x16<S>>() & 0xffff;
    }
    words[0] | (words[1] << 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::connect::tests::random;
    use crate::connect::{Net, Place, Side, connect};
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
            let words =
                normals(&values, (&spans, &connect(&spans, Level::new())), &view, Level::new());
            for (x, y) in (1..39).flat_map(|x| (1..29).map(move |y| (x, y))) {
                let found = unpack(words[2 * (y * 40 + x)]);
                // Depths near 10 are good to 1e-6; the slope over two pixels, to 1e-4.
                assert!(found.distance(n) < 1e-3, "{projection:?} ({x}, {y}): {found}");
                let back = unpack(words[2 * (y * 40 + x) + 1]);
                assert!(back.z > 0.5, "{back}");
            }
        }
    }

    /// The definition: differences of values per pixel along both axes of the picture, by Sobel's operator:
    /// each the mean of three rows weighted 1, 2, 1.
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

    #[test]
    fn normals_are_sobels_link_by_link() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            for (size, most) in [((150, 40), 5), ((1, 40), 3), ((33, 1), 12), ((2, 33), 2)] {
                let (spans, view) = (random(size, most), view(size, projection));
                let links = connect(&spans, Level::new());
                let values = nearness(&spans, projection);
                let found = normals(&values, (&spans, &links), &view, Level::new());
                let net = Net::new(&spans, &links);
                let width = size.0 as usize;
                for pixel in 0..view.pixels() {
                    let of = spans.of(pixel);
                    let own = 2 * of.start..2 * of.end;
                    for (surface, word) in own.clone().zip(&found[own]) {
                        let at = Place { pixel: [pixel % width, pixel / width], surface };
                        let expected = normal(at, (&net, &values), &view);
                        // Twice the error of words: sums of another order round to the next one.
                        let off = unpack(*word).distance(expected);
                        assert!(off < 1.3e-4, "{projection:?} {size:?} {at:?}: {off}");
                    }
                }
                let plain = normals(&values, (&spans, &links), &view, Level::baseline());
                assert_eq!(found, plain);
            }
        }
    }
}
