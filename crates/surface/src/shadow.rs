//! Shadow: what the liquid keeps of the key light, by a voxelization of the light's own.
//!
//! Zirr & Dachsbacher 2015, §6: "for shadow mapping or other approaches where a further from-point view is
//! required, we can still compute a second voxelization". A far light sees the liquid in orthographic
//! projection, a lamp in perspective; the length of the spans before a point is what its light went through.

use glam::Vec3;
use motes_scene::Projection;

use crate::{Spans, View};

/// The liquid as the key light sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Shadow {
    /// The light's view.
    pub view: View,
    /// The spans that it sees.
    pub spans: Spans,
    /// What is taken of the light per unit of length of liquid.
    pub extinction: f32,
    /// How far in front of a surface it is looked for what casts a shadow on it, world units: the surface is
    /// smoother than the spans.
    pub offset: f32,
    /// The part of the light on things outside that is fill light, which comes from elsewhere.
    pub fill: f32,
}

impl Shadow {
    /// The part of the key light that reaches a surface point with a unit normal.
    pub fn reached(&self, point: Vec3, normal: Vec3) -> f32 {
        (-self.extinction * self.before(point + normal * self.offset)).exp()
    }

    /// The light on a point outside, of which the key light has its way through the liquid.
    pub(crate) fn fill_and_key(&self, point: Vec3) -> Vec3 {
        let key = (-self.extinction * self.before(point)).exp();
        Vec3::splat(self.fill + (1.0 - self.fill) * key)
    }

    /// Length of liquid between the light and a point: the mean of the four columns about it.
    fn before(&self, point: Vec3) -> f32 {
        let rays = &self.view.rays;
        let ([x, y], z) = self.view.place(point);
        let [x, y] = [x - 0.5, y - 0.5];
        let slant = match rays.projection {
            Projection::Perspective => (point - rays.origin).length() / z,
            Projection::Orthographic => 1.0,
        };
        if z <= self.view.near || !x.is_finite() || !y.is_finite() {
            return 0.0;
        }
        let (i, j) = (x.floor(), y.floor());
        let at = |di: f32, dj: f32| self.column([i + di, j + dj], z);
        let above = at(0.0, 0.0) + (at(1.0, 0.0) - at(0.0, 0.0)) * (x - i);
        let below = at(0.0, 1.0) + (at(1.0, 1.0) - at(0.0, 1.0)) * (x - i);
        (above + (below - above) * (y - j)) * slant
    }

    /// Depth of liquid before `z` in a column.
    fn column(&self, [i, j]: [f32; 2], z: f32) -> f32 {
        let [width, height] = [self.view.size.0 as f32, self.view.size.1 as f32];
        if i < 0.0 || j < 0.0 || i >= width || j >= height {
            return 0.0;
        }
        let pixel = j as usize * self.view.size.0 as usize + i as usize;
        let of = self.spans.of(pixel);
        let depths = &self.spans.depths[2 * of.start..2 * of.end];
        let spans = depths.chunks_exact(2).take_while(|span| span[0] < z);
        spans.map(|span| span[1].min(z) - span[0]).sum()
    }
}
