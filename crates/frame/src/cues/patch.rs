//! What the rays of some rows of the picture met, seen from the eye.
//!
//! With θ the angle between a surface's normal n and the way back along the ray, e is the part of n across the
//! ray, to the right and down in the picture: |e| = sin θ. On a sphere of radius ρ pixels about c (pixels),
//! e = (p − c)/ρ; so neighbours on one sphere say what its curvature κ = 1/ρ is, and it ends
//! (1 − sin θ)/κ from p along e.

use std::ops::Range;

use fearless_simd::Simd;

use super::{Eye, missing};
use crate::Result;
use crate::frame::Layer;

/// The layers of a picture that cues look at.
pub(super) struct Layers<'a> {
    pub size: [usize; 2],
    pub depth: &'a [f32],
    normal: &'a [[f32; 3]],
    id: Option<&'a [i64]>,
    system: Option<&'a [u16]>,
}

impl<'a> Layers<'a> {
    pub fn of(layers: &'a [Layer], size: [usize; 2]) -> Result<Self> {
        let (mut depth, mut normal, mut id, mut system) = (None, None, None, None);
        for layer in layers {
            match layer {
                Layer::Depth(v) => depth = Some(&v[..]),
                Layer::Normal(v) => normal = Some(&v[..]),
                Layer::Id(v) => id = Some(&v[..]),
                Layer::System(v) => system = Some(&v[..]),
                _ => {}
            }
        }
        let depth = depth.ok_or(missing("depth"))?;
        Ok(Self { size, depth, normal: normal.ok_or(missing("normal"))?, id, system })
    }
}

/// A part of the picture. What is by place goes along its rows, from the upper left.
#[derive(Default)]
pub(super) struct Patch {
    /// Columns of the picture.
    pub columns: Range<usize>,
    /// Rows of the picture.
    pub rows: Range<usize>,
    /// Distance along the ray, +∞ where nothing is.
    pub distance: Vec<f32>,
    /// What tells particles apart, of whatever system.
    pub key: Vec<u32>,
    /// The normal across the ray, to the right.
    pub right: Vec<f32>,
    /// The normal across the ray, down.
    pub down: Vec<f32>,
    /// cos θ.
    pub facing: Vec<f32>,
    /// World units that a pixel is wide where the surface is.
    pub unit: Vec<f32>,
    /// κ; 0 where the surface is flat, NaN where no neighbour shows the same particle.
    pub curvature: Vec<f32>,
}

impl Patch {
    /// Reads distances; nothing else is known of the surfaces until [`Self::tell_apart`] and [`Self::look`].
    pub fn load(&mut self, layers: &Layers<'_>, columns: Range<usize>, rows: Range<usize>) {
        self.distance.clear();
        for row in rows.clone() {
            let pixels = row * layers.size[0] + columns.start..row * layers.size[0] + columns.end;
            self.distance.extend_from_slice(&layers.depth[pixels]);
        }
        self.key.resize(self.distance.len(), 0);
        let Self { right, down, facing, unit, curvature, .. } = self;
        for values in [right, down, facing, unit, curvature] {
            values.resize(self.distance.len(), 0.0);
        }
        (self.columns, self.rows) = (columns, rows);
    }

    /// Whether nothing is seen in it.
    pub fn is_empty(&self) -> bool {
        self.distance.iter().all(|distance| *distance == f32::INFINITY)
    }

    /// Looks at the surfaces in rows of which `wanted`, or that above or below, is true.
    #[inline(always)]
    pub fn look<S: Simd>(&mut self, simd: S, (layers, eye): (&Layers<'_>, &Eye), wanted: &[bool]) {
        let rows = self.rows.len();
        let near = |row: usize, by: usize| {
            wanted[row.saturating_sub(by)..(row + by + 1).min(rows)].iter().any(|wanted| *wanted)
        };
        for row in (0..rows).filter(|row| near(*row, 2)) {
            self.read_keys(layers, row);
            self.look_at(simd, row, (layers, eye));
        }
        let flat = if eye.perspective { 1.5 * eye.pixel } else { 1e-6 };
        for row in (0..rows).filter(|row| near(*row, 1)) {
            self.bend(simd, row, flat);
        }
    }

    /// Reads which particles all surfaces are of.
    pub fn tell_apart(&mut self, layers: &Layers<'_>) {
        (0..self.rows.len()).for_each(|row| self.read_keys(layers, row));
    }

    fn read_keys(&mut self, layers: &Layers<'_>, row: usize) {
        let width = self.columns.len();
        let from = (self.rows.start + row) * layers.size[0] + self.columns.start;
        let keys = &mut self.key[row * width..][..width];
        match layers.id {
            Some(id) => keys.iter_mut().zip(&id[from..]).for_each(|(key, id)| *key = *id as u32),
            None => keys.fill(0),
        }
        if let Some(system) = layers.system {
            let mix = |key: &mut u32, s: u16| *key ^= u32::from(s).wrapping_mul(0x9e37_79b1);
            keys.iter_mut().zip(&system[from..]).for_each(|(key, s)| mix(key, *s));
        }
    }

    /// Looks at a row of surfaces.
    #[inline(always)]
    fn look_at<S: Simd>(&mut self, _: S, row: usize, (layers, eye): (&Layers<'_>, &Eye)) {
        let width = self.columns.len();
        let at = row * width;
        let (x, y) = (self.columns.start, self.rows.start + row);
        let middle = [0.5 * layers.size[0] as f32, 0.5 * layers.size[1] as f32];
        // The rays go a to the right and b upward for each unit forward.
        let step = if eye.perspective { eye.pixel } else { 0.0 };
        let (first, b) = (x as f32 + 0.5 - middle[0], (middle[1] - y as f32 - 0.5) * step);
        let (constant, growing) = if eye.perspective { (0.0, eye.pixel) } else { (eye.pixel, 0.0) };
        let normals = &layers.normal[y * layers.size[0] + x..][..width];
        let (right, down) = (&mut self.right[at..][..width], &mut self.down[at..][..width]);
        let (facing, unit) = (&mut self.facing[at..][..width], &mut self.unit[at..][..width]);
        let distance = &self.distance[at..][..width];
        for x in 0..width {
            let a = (x as i32 as f32 + first) * step;
            let shorter = 1.0 / (1.0 + a * a + b * b).sqrt();
            let n = normals[x];
            let r = n[0] * eye.right[0] + n[1] * eye.right[1] + n[2] * eye.right[2];
            let u = n[0] * eye.up[0] + n[1] * eye.up[1] + n[2] * eye.up[2];
            let f = n[0] * eye.forward[0] + n[1] * eye.forward[1] + n[2] * eye.forward[2];
            let cosine = (-shorter * (r * a + u * b + f)).clamp(0.0, 1.0);
            let (r, d) = (r + cosine * a * shorter, -u - cosine * b * shorter);
            // Off the axis, what lies across the ray lies a little along the axis too.
            let scale = ((1.0 - cosine * cosine) / (r * r + d * d).max(1e-12)).sqrt();
            right[x] = r * scale;
            down[x] = d * scale;
            facing[x] = cosine;
            // A pixel is seen under 1/|D|² of its size towards the middle, and 1/|D| aside.
            unit[x] = constant + growing * distance[x] * shorter * shorter.sqrt();
        }
    }

    /// The curvature of a row of surfaces: the mean over the neighbours with the same particle. Less than `flat`
    /// is none.
    #[inline(always)]
    fn bend<S: Simd>(&mut self, _: S, row: usize, flat: f32) {
        let width = self.columns.len();
        let start = row * width;
        // Beyond the patch, a row is its own neighbour: no difference, and no weight.
        let above = if row > 0 { start - width } else { start };
        let below = if row + 1 < self.rows.len() { start + width } else { start };
        let (weight_above, weight_below) =
            (if above < start { 1.0f32 } else { 0.0 }, if below > start { 1.0f32 } else { 0.0 });
        let out = &mut self.curvature[start..][..width];
        let (key, right) = (&self.key[start..][..width], &self.right[start..][..width]);
        let down = &self.down[start..][..width];
        let (key_above, down_above) = (&self.key[above..][..width], &self.down[above..][..width]);
        let (key_below, down_below) = (&self.key[below..][..width], &self.down[below..][..width]);
        for x in 1..width - 1 {
            let before = if key[x - 1] == key[x] { 1.0 } else { 0.0 };
            let after = if key[x + 1] == key[x] { 1.0 } else { 0.0 };
            let over = if key_above[x] == key[x] { weight_above } else { 0.0 };
            let under = if key_below[x] == key[x] { weight_below } else { 0.0 };
            let sum = before * (right[x] - right[x - 1])
                + after * (right[x + 1] - right[x])
                + over * (down[x] - down_above[x])
                + under * (down_below[x] - down[x]);
            let mean = sum / (before + after + over + under);
            out[x] = if mean.abs() < flat { 0.0 } else { mean };
        }
        for (rim, inner) in [(0, 1.min(width - 1)), (width - 1, width.max(2) - 2)] {
            let known = rim != inner && key[rim] == key[inner];
            out[rim] = if known { out[inner] } else { f32::NAN };
        }
    }

    /// The normal across the ray, to the right and down.
    pub fn across(&self, at: usize) -> [f32; 2] {
        [self.right[at], self.down[at]]
    }

    /// cos of the angle between the surfaces of two neighbours.
    pub fn likeness(&self, a: usize, b: usize) -> f32 {
        self.right[a] * self.right[b]
            + self.down[a] * self.down[b]
            + self.facing[a] * self.facing[b]
    }

    /// The distance at which the surface of `at` would be found a step beside it; `None` beyond its end, and
    /// where its curvature is not known.
    ///
    /// On a sphere, with e′ = e + κ·step: distance + r (cos θ − cos θ′).
    pub fn beside(&self, at: usize, step: [f32; 2]) -> Option<f32> {
        let (e, curvature) = (self.across(at), self.curvature[at]);
        let next = [e[0] + curvature * step[0], e[1] + curvature * step[1]];
        let left = 1.0 - next[0] * next[0] - next[1] * next[1];
        let rise = step[0] * (e[0] + next[0]) + step[1] * (e[1] + next[1]);
        let run = self.facing[at] + left.sqrt();
        (left > 0.0).then(|| self.distance[at] + self.unit[at] * rise / run)
    }

    /// How dark the rim of each sphere is: from 0 at a part 1 − `width` of the radius to 1 at its end,
    /// quadratically, and averaged over the pixel; times `strength`.
    #[inline(always)]
    pub fn rims<S: Simd>(&self, _: S, (width, strength): (f32, f32), rims: &mut [f32]) {
        let (facing, curvature) = (&self.facing[..rims.len()], &self.curvature[..rims.len()]);
        for (at, rim) in rims.iter_mut().enumerate() {
            let sine = (1.0 - facing[at] * facing[at]).sqrt();
            // Nothing is known of what is smaller than a pixel.
            let bent = curvature[at].abs();
            let footprint = if bent < 1.0 { bent } else { 1.0 } + 1e-3;
            let (from, to) = ((sine - 0.5 * footprint).max(0.0), (sine + 0.5 * footprint).min(1.0));
            let (a, b) = ((from - 1.0 + width).max(0.0), (to - 1.0 + width).max(0.0));
            let mean = (b * b * b - a * a * a) / (3.0 * width * width * (to - from));
            *rim = if bent == 0.0 { 0.0 } else { mean * strength };
        }
    }
}
