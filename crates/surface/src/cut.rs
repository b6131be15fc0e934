//! Sections: liquid cut open by planes, with flat caps.
//!
//! Gaps are bridged, and surfaces smoothed, as if nothing were cut; then of each column's spans only what
//! the cuts leave of its ray is kept. Where a span begins or ends in a plane, there is a cap: a surface in
//! the plane, with the plane's normal. Of an open cut there is no cap, and what it opens is a shell: the other end of the
//! span, with nothing behind.

use glam::Vec3;
use motes_grid::{Clip, Cut, Face, Stretch};
use rayon::prelude::*;

use crate::normals::pack;
use crate::{Extended, Spans, Surfaces, View};

/// The owner of a surface that is no cap.
pub const NO_CAP: u16 = u16::MAX;

/// The particle nearest to a point: which particle a cap is of.
pub type Nearest<'a> = &'a (dyn Fn(Vec3) -> u32 + Sync);

/// An end of what is left of a span.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// That of the span.
    Own,
    /// The face, at a depth.
    Cap(Face, f32),
    /// As far as the other end, on its other side.
    Shell,
}

/// What is left of a span.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    /// Its place among the column's.
    span: usize,
    entry: End,
    exit: End,
    /// How much of its length is left.
    part: f32,
}

/// Adds to `pieces` what `stretches` of the ray, whose depth grows by `slant` with the distance, leave of spans with these depths.
fn cut_column(
    depths: impl Iterator<Item = [f32; 2]>,
    (stretches, slant): (&[Stretch], f32),
    pieces: &mut Vec<Piece>,
) {
    pieces.clear();
    for (span, [from, to]) in depths.enumerate() {
        for stretch in stretches {
            let (begin, end) = (stretch.begin * slant, stretch.end * slant);
            let (low, high) = (begin.max(from), end.min(to));
            if low >= high {
                continue;
            }
            let end_at = |face: Option<Face>, depth: f32, inner: bool| match face {
                Some(face) if inner && face.cut == Cut::Open => End::Shell,
                Some(face) if inner => End::Cap(face, depth),
                _ => End::Own,
            };
            let entry = end_at(stretch.enters, begin, begin > from);
            let exit = end_at(stretch.leaves, end, end < to);
            if (entry, exit) != (End::Shell, End::Shell) {
                let part = (high - low) / (to - from);
                pieces.push(Piece { span, entry, exit, part });
            }
        }
    }
}

/// The rays of a row of pixels against cuts, and what is left of one pixel's spans after the other.
struct Cutter<'a> {
    clip: &'a Clip,
    view: &'a View,
    stretches: Vec<Stretch>,
    pieces: Vec<Piece>,
}

impl<'a> Cutter<'a> {
    fn new(clip: &'a Clip, view: &'a View) -> Self {
        Self { clip, view, stretches: Vec::new(), pieces: Vec::new() }
    }

    /// What is left of the spans of a pixel.
    fn pixel(&mut self, pixel: usize, depths: impl Iterator<Item = [f32; 2]>) -> &[Piece] {
        let width = self.view.size.0 as usize;
        let [x, y] = [pixel % width, pixel / width].map(|i| i as f32 + 0.5);
        let ray = self.view.rays.ray(x, y);
        let slant = ray.1.dot(self.view.rays.forward);
        self.clip.stretches(ray, (0.0, f32::INFINITY), &mut self.stretches);
        cut_column(depths, (&self.stretches, slant), &mut self.pieces);
        &self.pieces
    }
}

/// What a pixel had beyond what is stored, cut: what is empty, by the part that is left of the last span.
fn cut_extended(of: &Extended, (stored, pieces): (usize, &[Piece])) -> Option<Extended> {
    let last: Vec<&Piece> = pieces.iter().filter(|p| p.span + 1 == stored).collect();
    let part: f32 = last.iter().map(|p| p.part).sum();
    let before = pieces.len() - last.len();
    // How its spans lie in the last stored one is not known.
    let more = (part * (of.count + 1 - stored as u32) as f32).ceil() as u32;
    let count = before as u32 + more.max(last.len() as u32);
    let empty = part * of.empty;
    (!last.is_empty()).then_some(Extended { count, empty, ..*of })
}

/// Surfaces of a row of pixels.
#[derive(Default)]
struct Row {
    counts: Vec<u32>,
    nearness: Vec<f32>,
    normals: Vec<u32>,
    particles: Vec<u32>,
    caps: Vec<u16>,
    extended: Vec<Extended>,
}

/// Where the spans of each pixel start, and how many there are.
fn starts(rows: &[Row]) -> Vec<u32> {
    let mut sum = 0;
    let ends = rows.iter().flat_map(|row| &row.counts).map(|count| {
        sum += count;
        sum
    });
    std::iter::once(0).chain(ends).collect()
}

impl Surfaces {
    /// What `clip` leaves, given about the same origin; with particles, `nearest` tells that of a cap.
    pub fn cut(&self, clip: &Clip, nearest: Nearest<'_>) -> Self {
        let width = self.view.size.0 as usize;
        let rows: Vec<Row> = (0..self.view.size.1 as usize)
            .into_par_iter()
            .map(|y| self.cut_row(y * width..(y + 1) * width, clip, nearest))
            .collect();
        let mut cut = Self { starts: starts(&rows), ..Self::of_nothing(self.view) };
        for row in rows {
            cut.nearness.extend(row.nearness);
            cut.normals.extend(row.normals);
            cut.particles.extend(row.particles);
            cut.caps.extend(row.caps);
            cut.extended.extend(row.extended);
        }
        cut
    }

    fn cut_row(&self, pixels: std::ops::Range<usize>, clip: &Clip, nearest: Nearest<'_>) -> Row {
        let mut row = Row::default();
        let mut cutter = Cutter::new(clip, &self.view);
        for pixel in pixels {
            let of = self.of(pixel);
            if of.is_empty() {
                row.counts.push(0);
                continue;
            }
            let depths = of.clone().step_by(2).map(|s| [self.depth(s), self.depth(s + 1)]);
            let pieces = cutter.pixel(pixel, depths);
            row.counts.push(pieces.len() as u32);
            for piece in pieces {
                self.add_piece((pixel, of.start + 2 * piece.span), piece, nearest, &mut row);
            }
            let extended = Extended::of(&self.extended, pixel);
            row.extended.extend(extended.and_then(|e| cut_extended(e, (of.len() / 2, pieces))));
        }
        row
    }

    /// Adds both ends of a piece of the span whose entry is surface `entry`.
    fn add_piece(
        &self,
        (pixel, entry): (usize, usize),
        piece: &Piece,
        nearest: Nearest<'_>,
        row: &mut Row,
    ) {
        let width = self.view.size.0 as usize;
        let place = [pixel % width, pixel / width].map(|i| i as f32 + 0.5);
        let with_particles = !self.particles.is_empty();
        for (end, own, other) in [(piece.entry, entry, entry + 1), (piece.exit, entry + 1, entry)] {
            let (nearness, normal, surface) = match end {
                End::Own => (self.nearness[own], self.normals[own], own),
                End::Cap(face, depth) => (self.view.nearness(depth), pack(-face.plane.normal), own),
                End::Shell => {
                    let at = self.nearness[other];
                    let beside = if other > own { at.next_up() } else { at.next_down() };
                    (beside, pack(-self.normal(other)), other)
                }
            };
            row.nearness.push(nearness);
            row.normals.push(normal);
            let cap = if let End::Cap(face, _) = end { Some(face.owner) } else { None };
            row.caps.push(cap.unwrap_or(NO_CAP));
            if with_particles {
                row.particles.push(match cap {
                    Some(_) => nearest(self.view.point(place, nearness)),
                    None => self.particles[surface],
                });
            }
        }
    }
}

impl Spans {
    /// What `clip` leaves of the spans that `view` shows. Their particles are not told.
    pub fn cut(&self, clip: &Clip, view: &View) -> Self {
        let width = self.size.0 as usize;
        let rows: Vec<Row> = (0..self.size.1 as usize)
            .into_par_iter()
            .map(|y| {
                let mut row = Row::default();
                let mut cutter = Cutter::new(clip, view);
                for pixel in y * width..(y + 1) * width {
                    let of = self.of(pixel);
                    let depths = &self.depths[2 * of.start..2 * of.end];
                    let spans = depths.as_chunks::<2>().0;
                    let pieces = cutter.pixel(pixel, spans.iter().copied());
                    row.counts.push(pieces.len() as u32);
                    for piece in pieces {
                        let [from, to] = spans[piece.span];
                        let at = |end: End, own: f32, other: f32| match end {
                            End::Own => own,
                            End::Cap(_, depth) => depth,
                            End::Shell => other,
                        };
                        let ends = [at(piece.entry, from, to), at(piece.exit, to, from)];
                        row.nearness.extend(ends);
                    }
                    let more = self.extended(pixel);
                    row.extended.extend(more.and_then(|e| cut_extended(e, (spans.len(), pieces))));
                }
                row
            })
            .collect();
        let (size, near, far) = (self.size, self.near, self.far);
        let mut cut = Self { size, near, far, starts: starts(&rows), ..Self::default() };
        for row in rows {
            cut.depths.extend(row.nearness);
            cut.extended.extend(row.extended);
        }
        cut
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Boundary, Input, Params, Particles, Smoothing, voxelize};
    use fearless_simd::Level;
    use glam::DVec3;
    use motes_grid::{Clause, Plane, Radii};
    use motes_scene::{Bounds, Scene};

    /// A ball of radius 1 at the origin, with one of a third of it behind, seen from (0, −4, 0) along y.
    fn seen() -> (Surfaces, Spans) {
        let mut scene = Scene::default();
        scene.camera.position = Some(DVec3::new(0.0, -4.0, 0.0));
        scene.camera.target = Some(DVec3::ZERO);
        (scene.image.width, scene.image.height) = (81, 61);
        let whole = Bounds::new(DVec3::splat(-1.0), DVec3::splat(3.0));
        let resolved = scene.resolve(Some(whole)).unwrap();
        let rays = resolved.view.rays(DVec3::ZERO);
        let view = View { rays, size: (81, 61), near: 0.5, far: 10.0 };
        let positions = [[0.0; 3], [0.0, 2.0, 0.0]];
        let radii = [1.0, 1.0 / 3.0];
        let particles = Particles::Unsorted(&positions, Radii::Each(&radii));
        let params = Params { ids: true, cull: crate::Cull::Off, ..Params::default() };
        let level = Level::new();
        let input = Input { particles, radius_scale: 1.0 };
        let boundary = Boundary::extract(&input, &params, level);
        let (spans, _) = voxelize(&boundary, &view, &params, level);
        (Surfaces::new(spans.clone(), view, Smoothing::NONE, level), spans)
    }

    fn clip(faces: &[([f64; 3], [f64; 3], Cut)]) -> Clip {
        let clause = |(i, (point, normal, cut)): (usize, &([f64; 3], [f64; 3], Cut))| {
            let plane = Plane::new((*point).into(), (*normal).into()).unwrap();
            Clause { faces: vec![Face { plane, cut: *cut, owner: 7 + i as u16 }] }
        };
        Clip { clauses: faces.iter().enumerate().map(clause).collect() }
    }

    /// Depths and normals along y of the surfaces of the picture's middle.
    fn middle(surfaces: &Surfaces) -> Vec<(f32, f32, u16)> {
        let of = surfaces.of(30 * 81 + 40);
        of.map(|s| (surfaces.depth(s), surfaces.normal(s).y, surfaces.caps[s])).collect()
    }

    fn assert_like(found: &[(f32, f32, u16)], expected: &[(f32, f32, u16)]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (a, b) in found.iter().zip(expected) {
            let near = (a.0 - b.0).abs() < 1e-3 && (a.1 - b.1).abs() < 1e-2;
            assert!(near && a.2 == b.2, "{found:?}, expected {expected:?}");
        }
    }

    #[test]
    fn a_cap_has_the_planes_depth_normal_owner_and_nearest_particle() {
        let (surfaces, _) = seen();
        let behind = clip(&[([0.0, 0.2, 0.0], [0.0, 3.0, 0.0], Cut::Caps)]);
        let nearest = |point: Vec3| {
            assert!((point - Vec3::new(0.0, 0.2, 0.0)).dot(Vec3::Y).abs() < 1e-3);
            5
        };
        let cut = surfaces.cut(&behind, &nearest);
        let rest = [(5.0, 1.0, NO_CAP), (5.6667, -1.0, NO_CAP), (6.3333, 1.0, NO_CAP)];
        assert_like(&middle(&cut), &[&[(4.2, -1.0, 7)], &rest[..]].concat());
        assert_eq!(cut.particles[cut.of(30 * 81 + 40)], [5, 0, 1, 1]);
        // Beside the smaller ball: every cap in the plane.
        let caps = (0..cut.view.pixels()).flat_map(|pixel| cut.of(pixel).map(move |s| (pixel, s)));
        let mut count = 0;
        for (pixel, surface) in caps.filter(|(_, s)| cut.caps[*s] == 7) {
            let place = [pixel % 81, pixel / 81].map(|i| i as f32 + 0.5);
            let point = cut.view.point(place, cut.nearness[surface]);
            assert!((point.y - 0.2).abs() < 1e-4 && point.length() < 1.001, "{point}");
            assert!(cut.normal(surface).distance(Vec3::NEG_Y) < 1e-3);
            count += 1;
        }
        assert!(count > 400, "{count}");
    }

    #[test]
    fn what_lies_between_two_planes_is_left_and_without_planes_all_is() {
        let (surfaces, spans) = seen();
        let slab = clip(&[
            ([0.0, -0.5, 0.0], [0.0, 1.0, 0.0], Cut::Caps),
            ([0.0, 0.5, 0.0], [0.0, -1.0, 0.0], Cut::Caps),
        ]);
        let cut = surfaces.cut(&slab, &|_| 0);
        assert_like(&middle(&cut), &[(3.5, -1.0, 7), (4.5, 1.0, 8)]);
        let depths = spans.cut(&slab, &surfaces.view);
        let of = depths.of(30 * 81 + 40);
        let [from, to] = depths.depths[2 * of.start..2 * of.end] else { panic!() };
        assert!((from - 3.5).abs() < 1e-4 && (to - 4.5).abs() < 1e-4, "{from} {to}");
        let all = surfaces.cut(&Clip::default(), &|_| 0);
        assert_eq!(Surfaces { caps: Vec::new(), ..all }, surfaces);
        assert_eq!(spans.cut(&Clip::default(), &surfaces.view).depths, spans.depths);
    }

    #[test]
    fn an_open_cut_leaves_a_shell() {
        let (surfaces, _) = seen();
        let open = clip(&[([0.0, 0.2, 0.0], [0.0, 1.0, 0.0], Cut::Open)]);
        let cut = surfaces.cut(&open, &|_| 0);
        let small = [(5.6667, -1.0, NO_CAP), (6.3333, 1.0, NO_CAP)];
        let shell = [(5.0, -1.0, NO_CAP), (5.0, 1.0, NO_CAP)];
        assert_like(&middle(&cut), &[&shell[..], &small[..]].concat());
        let of = cut.of(30 * 81 + 40);
        assert!(cut.nearness[of.start] > cut.nearness[of.start + 1]);
    }
}
