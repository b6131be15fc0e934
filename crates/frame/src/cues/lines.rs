//! Where surfaces end and where they meet, between the middles of pixels, and lines there.
//!
//! Of two neighbours p and q that show different things, p the nearer one:
//!
//! - if p's surface goes on to q, and lies behind q's there, and q's lies behind p's at p, they intersect:
//!   with h the distance from one to the other, at p and its slope ∇h, the seam is h/|∇h| from p;
//! - else p's surface ends between them: on a sphere, (1 − sin θ)/κ from p; where that is not known, halfway.
//!
//! A line is a short arc before each such p, with the direction across it, its distance and its curvature;
//! a pixel takes what the arcs near it cover of it.

use fearless_simd::Simd;

use super::patch::Patch;
use super::{Cues, smooth};

/// Lines of a patch, and what their two sides share.
#[derive(Default)]
pub(super) struct Lines {
    /// How much of each pixel the edges cover, times their strength; empty where there are none.
    pub edges: Vec<f32>,
    /// The same of seams.
    pub seams: Vec<f32>,
    /// By pixel, the greatest part of it that the surface of a neighbour has.
    parts: Vec<f32>,
    /// Pixel, neighbour, part; of a pixel's several, the last has the greatest part.
    shares: Vec<(u32, u32, f32)>,
    /// By place, 1 where something differs from the pixel to the right, 2 from that below.
    flags: Vec<u8>,
    /// By row, whether there are flags.
    flagged: Vec<bool>,
    edge_arcs: Vec<Arc>,
    seam_arcs: Vec<Arc>,
}

/// A short piece of a line beside pixel `at`.
#[derive(Clone, Copy, Debug)]
struct Arc {
    at: usize,
    /// The way to the line, a unit vector; right and down.
    toward: [f32; 2],
    /// How far it is, pixels.
    distance: f32,
    /// Of the line, bent back around `at`, per pixel.
    curvature: f32,
    strength: f32,
}

/// Surfaces whose normals differ by less (cosines of 10° and 25°) have no seam, or a faint one.
const CREASE: [f32; 2] = [0.985, 0.906];
/// Part of a pixel's width by which distances may be wrong.
const TOLERANCE: f32 = 0.05;

impl Lines {
    /// Finds where what is shown differs between neighbours, by row.
    #[inline(always)]
    pub fn flag<S: Simd>(&mut self, simd: S, cues: &Cues, patch: &Patch) -> &mut [bool] {
        self.flags.clear();
        self.flags.resize(patch.distance.len(), 0);
        self.flagged.clear();
        for row in 0..patch.rows.len() {
            let any = self.flag_row(simd, cues, patch, row);
            self.flagged.push(any);
        }
        &mut self.flagged
    }

    /// Finds and draws the lines where flags are, in `widths` of pixels (edges and seams).
    #[inline(always)]
    pub fn find<S: Simd>(&mut self, simd: S, cues: &Cues, patch: &Patch, widths: [f32; 2]) {
        let size = [patch.columns.len(), patch.rows.len()];
        self.edge_arcs.clear();
        self.seam_arcs.clear();
        self.shares.clear();
        self.parts.clear();
        self.parts.resize(patch.distance.len(), 0.0);
        for row in 0..size[1] {
            if !self.flagged[row] {
                continue;
            }
            for at in row * size[0]..(row + 1) * size[0] {
                let flags = self.flags[at];
                if flags & 1 != 0 {
                    self.pair((cues, patch), (at, at + 1), [1.0, 0.0]);
                }
                if flags & 2 != 0 {
                    self.pair((cues, patch), (at, at + size[0]), [0.0, 1.0]);
                }
            }
        }
        cover(simd, &mut self.edges, &self.edge_arcs, (size, widths[0]));
        cover(simd, &mut self.seams, &self.seam_arcs, (size, widths[1]));
    }

    /// Every pixel, neighbour, and the part of the pixel that the neighbour's surface has.
    pub fn shares(&self) -> impl Iterator<Item = (usize, usize, f32)> {
        let of = |share: &(u32, u32, f32)| (share.0 as usize, share.1 as usize, share.2);
        self.shares.iter().map(of).filter(|(at, _, part)| self.parts[*at] == *part)
    }

    #[inline(always)]
    fn flag_row<S: Simd>(&mut self, _: S, cues: &Cues, patch: &Patch, row: usize) -> bool {
        let width = patch.columns.len();
        let start = row * width;
        let all = cues.any_particle();
        let least = 0.5 * cues.structure;
        let flags = &mut self.flags[start..][..width];
        let (here, key) = (&patch.distance[start..][..width], &patch.key[start..][..width]);
        let mut any = 0;
        for x in 0..width - 1 {
            // Nothing beside nothing has no difference: ∞ − ∞ is no number.
            let apart = (here[x] - here[x + 1]).abs() > least;
            flags[x] = u8::from(apart | (all & (key[x] != key[x + 1])));
            any |= flags[x];
        }
        if row + 1 < patch.rows.len() {
            let below = &patch.distance[start + width..][..width];
            let key_below = &patch.key[start + width..][..width];
            for x in 0..width {
                let apart = (here[x] - below[x]).abs() > least;
                flags[x] |= u8::from(apart | (all & (key[x] != key_below[x]))) << 1;
                any |= flags[x];
            }
        }
        any != 0
    }

    /// Looks between two neighbours, `step` from the first to the second.
    fn pair(&mut self, of: (&Cues, &Patch), (a, b): (usize, usize), step: [f32; 2]) {
        match of.1.distance[a] < of.1.distance[b] {
            true => self.between(of, (a, b), step),
            false => self.between(of, (b, a), [-step[0], -step[1]]),
        }
    }

    /// What is between a near surface and a far one, `step` away.
    fn between(&mut self, (cues, patch): (&Cues, &Patch), ends: (usize, usize), step: [f32; 2]) {
        let (near, far) = ends;
        let arc = match meeting(patch, ends, step) {
            Some(apart) => {
                let Some(arc) = seam(patch, ends, apart) else { return };
                let strength = arc.strength * cues.seam.map_or(0.0, |s| s.strength);
                if strength > 0.0 {
                    self.seam_arcs.push(Arc { strength, ..arc });
                }
                arc
            }
            None => {
                let jump = patch.distance[far] - patch.distance[near];
                let arc = end(patch, near, (step, 0.5 * jump.min(cues.structure)));
                let apart = smooth(cues.structure, 2.0 * cues.structure, jump);
                // Lines are drawn last, and fade with what they end.
                let fade = 1.0 - cues.fade(patch.distance[near]);
                let strength = apart * fade * cues.edges.map_or(0.0, |s| s.strength);
                if strength > 0.0 {
                    self.edge_arcs.push(Arc { strength, ..arc });
                }
                arc
            }
        };
        if patch.distance[far] == f32::INFINITY {
            self.share(far, near, 1.0);
        } else {
            let along = arc.toward[0] * step[0] + arc.toward[1] * step[1];
            self.share(near, far, 0.5 - arc.distance);
            self.share(far, near, 0.5 - (along - arc.distance));
        }
    }

    /// Of several neighbours that have a part of a pixel, the one with the most counts.
    fn share(&mut self, at: usize, other: usize, part: f32) {
        if part > self.parts[at] {
            self.parts[at] = part;
            self.shares.push((at as u32, other as u32, part));
        }
    }
}

/// How far a far surface is behind a near one's pixel (in pixels), where the two meet between them.
fn meeting(patch: &Patch, (near, far): (usize, usize), step: [f32; 2]) -> Option<f32> {
    if patch.distance[far] == f32::INFINITY {
        return None;
    }
    let there = patch.beside(near, step)? - patch.distance[far];
    let here = patch.beside(far, step.map(|v| -v))? - patch.distance[near];
    let unit = patch.unit[near];
    (here.min(there) > -TOLERANCE * unit).then_some(here / unit)
}

/// Where a near surface ends, a `step` before something that is more than `behind` farther.
fn end(patch: &Patch, near: usize, (step, behind): ([f32; 2], f32)) -> Arc {
    let (e, curvature) = (patch.across(near), patch.curvature[near]);
    let sine = (e[0] * e[0] + e[1] * e[1]).sqrt();
    let out = if sine > 0.0 { [e[0] / sine, e[1] / sine] } else { step };
    let along = out[0] * step[0] + out[1] * step[1];
    if curvature > 0.0 && 1.0 - sine < 1.5 * curvature && along > 0.1 {
        let distance = ((1.0 - sine) / curvature).min(along);
        return Arc { at: near, toward: out, distance, curvature, strength: 1.0 };
    }
    let (toward, distance) = border(patch, near, behind).unwrap_or((step, 0.5));
    Arc { at: near, toward, distance, curvature: 0.0, strength: 1.0 }
}

/// The way and the distance to a straight border between what is around `at` and what is more than `behind`
/// farther: of a window of five pixels, the border leaves 0.5 − distance/5 to the far side.
fn border(patch: &Patch, at: usize, behind: f32) -> Option<([f32; 2], f32)> {
    let (width, rows) = (patch.columns.len(), patch.rows.len());
    let (x, y) = (at % width, at / width);
    let (mut count, mut sum) = (0.0, [0.0, 0.0]);
    for down in -2i32..=2 {
        for beside in -2i32..=2 {
            let column = x.saturating_add_signed(beside as isize).min(width - 1);
            let row = y.saturating_add_signed(down as isize).min(rows - 1);
            if patch.distance[row * width + column] - patch.distance[at] > behind {
                count += 1.0;
                sum = [sum[0] + beside as f32, sum[1] + down as f32];
            }
        }
    }
    let length = (sum[0] * sum[0] + sum[1] * sum[1]).sqrt();
    let distance = (2.5 - count / 5.0f32).clamp(0.0, 1.0);
    (length > 1.0).then(|| ([sum[0] / length, sum[1] / length], distance))
}

/// Where two surfaces meet that are `apart` (pixels, along the ray) at the nearer one's pixel.
fn seam(patch: &Patch, (near, far): (usize, usize), apart: f32) -> Option<Arc> {
    let crease = smooth(-CREASE[0], -CREASE[1], -patch.likeness(near, far));
    let steepness = |at: usize| 1.0 / patch.facing[at].max(0.05);
    let (of_near, of_far) = (steepness(near), steepness(far));
    // Distance grows along e; the way to the seam is where the far surface comes closer.
    let closer = [
        patch.right[near] * of_near - patch.right[far] * of_far,
        patch.down[near] * of_near - patch.down[far] * of_far,
    ];
    let steep = (closer[0] * closer[0] + closer[1] * closer[1]).sqrt();
    (crease > 0.0 && steep > 1e-6).then(|| Arc {
        at: near,
        toward: [closer[0] / steep, closer[1] / steep],
        distance: (apart.max(0.0) / steep).min(1.5),
        curvature: 0.0,
        strength: crease,
    })
}

/// What lines of `width` pixels along `arcs` cover of each pixel, times the strongest one's strength.
#[inline(always)]
fn cover<S: Simd>(
    _: S,
    cover: &mut Vec<f32>,
    arcs: &[Arc],
    ([columns, rows], width): ([usize; 2], f32),
) {
    cover.clear();
    if arcs.is_empty() {
        return;
    }
    cover.resize(columns * rows, 0.0);
    // A line thinner than a pixel is fainter instead.
    let (half, most) = (0.5 * width.max(1.0), width.min(1.0));
    let reach = half.ceil() as usize + 1;
    for arc in arcs {
        let (x, y) = (arc.at % columns, arc.at / columns);
        let left = x.saturating_sub(reach);
        let right = (x + reach).min(columns - 1);
        let strength = arc.strength * most;
        for row in y.saturating_sub(reach)..=(y + reach).min(rows - 1) {
            let down = row as i32 as f32 - y as i32 as f32;
            let line = &mut cover[row * columns + left..=row * columns + right];
            for (i, pixel) in line.iter_mut().enumerate() {
                let beside = (left + i) as i32 as f32 - x as i32 as f32;
                let along = arc.toward[0] * beside + arc.toward[1] * down;
                let aside = arc.toward[0] * down - arc.toward[1] * beside;
                let off = along - arc.distance + 0.5 * arc.curvature * aside * aside;
                let part = (half + 0.5 - off.abs()).clamp(0.0, 1.0);
                // Pieces end softly, where the next ones have begun.
                let part = part * (1.75 - aside.abs()).clamp(0.0, 1.0) * strength;
                *pixel = pixel.max(part);
            }
        }
    }
}
