//! Surfaces: what is known of the liquid once spans are connected, smoothed and have normals.

use std::ops::Range;

use fearless_simd::Level;
use glam::Vec3;
use motes_scene::Projection;

use crate::connect::{Links, connect};
use crate::filter::{self, Scale};
use crate::normals::{normals, unpack};
use crate::{Extended, Spans, View, flow, recursion};

/// The ends of all spans, smoothed, with normals: all that pictures are made from.
#[derive(Clone, Debug, PartialEq)]
pub struct Surfaces {
    /// Where they are seen from.
    pub view: View,
    /// First span of each pixel, row by row, and the number of all at the end.
    pub starts: Vec<u32>,
    /// How near each surface is, see [`filter::nearness`]: falling in each column.
    pub nearness: Vec<f32>,
    /// Unit normals out of the liquid, see [`crate::normals::pack`].
    pub normals: Vec<u32>,
    /// Pixels that had more spans than are stored, in order.
    pub extended: Vec<Extended>,
    /// The particle of each surface, or empty; see [`Spans::particles`].
    pub particles: Vec<u32>,
    /// Whose cap each surface is, [`crate::NO_CAP`] where it is none; empty where nothing was cut.
    pub caps: Vec<u16>,
}

/// How surfaces are smoothed; lengths in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// The standard deviation; 0: not at all.
    pub radius: f32,
    /// Diameter of drops, which recursion leaves as they are.
    pub drop: f32,
    /// The way.
    pub filter: Filter,
}

/// A way to smooth surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// As [`recursion::smooth`] does.
    Recursive,
    /// As [`flow::iterate`] does, at most so many times.
    Iterated(u32),
    /// As [`flow::curvature`] does, at most so many times.
    Curvature(u32),
}

impl Smoothing {
    /// None.
    pub const NONE: Self = Self { radius: 0.0, drop: 0.0, filter: Filter::Recursive };

    /// Smooths the [`filter::nearness`] of each surface.
    pub fn apply(
        self,
        nearness: &mut Vec<f32>,
        net: (&Spans, &[Links]),
        (view, level): (&View, Level),
    ) {
        if self.radius <= 0.0 {
            return;
        }
        let scale = Scale::new(self.radius, self.drop, view);
        match self.filter {
            Filter::Recursive => recursion::smooth(nearness, net, &scale, level),
            Filter::Iterated(most) => flow::iterate(nearness, net, (&scale, most)),
            Filter::Curvature(most) => flow::curvature(nearness, net, (&scale, most), view),
        }
    }
}

impl Surfaces {
    /// Connects, smooths and finds the normals of `spans`, which `view` shows.
    pub fn new(spans: Spans, view: View, smoothing: Smoothing, level: Level) -> Self {
        let links = connect(&spans, level);
        let mut nearness = filter::nearness(&spans, view.rays.projection);
        smoothing.apply(&mut nearness, (&spans, &links), (&view, level));
        let normals = normals(&nearness, (&spans, &links), &view, level);
        Self::of_spans(spans, view, (nearness, normals))
    }

    /// The ends of `spans`, which `view` shows, with what was found of each: nearness and normal.
    pub fn of_spans(spans: Spans, view: View, (nearness, normals): (Vec<f32>, Vec<u32>)) -> Self {
        let Spans { starts, extended, particles, .. } = spans;
        Self { view, starts, nearness, normals, extended, particles, caps: Vec::new() }
    }

    /// No surfaces at all.
    pub(crate) fn of_nothing(view: View) -> Self {
        Self {
            view,
            starts: Vec::new(),
            nearness: Vec::new(),
            normals: Vec::new(),
            extended: Vec::new(),
            particles: Vec::new(),
            caps: Vec::new(),
        }
    }

    /// The surfaces of a pixel.
    #[inline]
    pub fn of(&self, pixel: usize) -> Range<usize> {
        2 * self.starts[pixel] as usize..2 * self.starts[pixel + 1] as usize
    }

    /// The depth of a surface, along the view's `forward`.
    #[inline]
    pub fn depth(&self, surface: usize) -> f32 {
        filter::depth(self.nearness[surface], self.view.rays.projection)
    }

    /// The unit normal of a surface, out of the liquid.
    #[inline]
    pub fn normal(&self, surface: usize) -> Vec3 {
        unpack(self.normals[surface])
    }

    /// What a pixel had beyond what is stored, if it had.
    fn extended(&self, pixel: usize) -> Option<&Extended> {
        Extended::of(&self.extended, pixel)
    }

    /// What is empty inside the last stored span of a pixel, in depth.
    pub fn empty(&self, pixel: usize) -> f32 {
        self.extended(pixel).map_or(0.0, |e| e.empty)
    }

    /// How many spans a pixel truly has.
    pub fn count(&self, pixel: usize) -> u32 {
        self.extended(pixel).map_or(self.starts[pixel + 1] - self.starts[pixel], |e| e.count)
    }

    /// Length inside the liquid, in depth, along the ray of a pixel.
    pub fn thickness(&self, pixel: usize) -> f32 {
        let of = self.of(pixel);
        let spans = of.step_by(2).map(|entry| self.depth(entry + 1) - self.depth(entry));
        spans.sum::<f32>() - self.empty(pixel)
    }

    /// Bytes of all parts.
    pub fn bytes(&self) -> usize {
        let words = self.starts.len() + 2 * self.nearness.len() + self.particles.len();
        words * 4 + self.caps.len() * 2 + self.extended.len() * size_of::<Extended>()
    }
}

impl View {
    /// The nearness of a depth.
    #[inline]
    pub fn nearness(&self, depth: f32) -> f32 {
        match self.rays.projection {
            Projection::Perspective => 1.0 / depth,
            Projection::Orthographic => -depth,
        }
    }

    /// The place of the picture and the depth of a point; of use where the depth is above 0.
    #[inline]
    pub fn place(&self, point: Vec3) -> ([f32; 2], f32) {
        let rays = &self.rays;
        let v = point - rays.origin;
        let z = v.dot(rays.forward);
        let scale = match rays.projection {
            Projection::Perspective => 1.0 / (rays.pixel * z),
            Projection::Orthographic => 1.0 / rays.pixel,
        };
        let x = rays.center[0] + v.dot(rays.right) * scale;
        let y = rays.center[1] - v.dot(rays.up) * scale;
        ([x, y], z)
    }

    /// The point at a place of the picture and a nearness.
    #[inline]
    pub fn point(&self, [x, y]: [f32; 2], nearness: f32) -> Vec3 {
        let rays = &self.rays;
        let a = (x - rays.center[0]) * rays.pixel;
        let b = (rays.center[1] - y) * rays.pixel;
        let z = filter::depth(nearness, rays.projection);
        let across = rays.right * a + rays.up * b;
        match rays.projection {
            Projection::Perspective => rays.origin + (rays.forward + across) * z,
            Projection::Orthographic => rays.origin + across + rays.forward * z,
        }
    }
}
