//! The camera: from what is typed and what is visible to rays, and from points back to pixels.
//!
//! Right-handed world; pixel (column i, row j) has its centre at (i+½, j+½); row 0 is the top. With f, r, u
//! the unit vectors forward, right and up (r × u = −f), and s the size of a pixel on the plane at
//! distance 1 (orthographic: in the world), a ray has
//!
//! > a = (x − W/2)·s,  b = (H/2 − y)·s,
//! > perspective: origin = eye, direction ∝ f + r·a + u·b;  s = 2·tan(fov/2)/H
//! > orthographic: origin = eye + r·a + u·b, direction = f;  s = height/H

use glam::{DVec3, Vec3};

use crate::bounds::Bounds;
use crate::scene::{Axis, Camera, Projection};

/// A camera that stands: all in world coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraView {
    /// Where the rays start (orthographic: the middle of where they start).
    pub eye: DVec3,
    /// The point looked at, on the axis.
    pub target: DVec3,
    /// Unit vector of the looking direction.
    pub forward: DVec3,
    /// Unit vector to the right in the picture.
    pub right: DVec3,
    /// Unit vector upward in the picture.
    pub up: DVec3,
    /// How the world is put on the picture.
    pub projection: Projection,
    /// Half the picture's height: at distance 1 (the tangent of half the field of view) in perspective,
    /// in world units in orthographic projection.
    pub half_height: f64,
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
    /// The lens of a perspective that is not through a pinhole.
    pub lens: Option<Lens>,
}

/// A thin lens at the eye, across the looking direction; world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Half its diameter.
    pub radius: f32,
    /// How far along the looking direction the picture is sharp.
    pub focus: f32,
}

/// The camera's rays in f32, relative to an origin near the particles, for kernels.
///
/// With a = (x − `center[0]`)·`pixel` and b = (`center[1]` − y)·`pixel`: a perspective ray starts at
/// `origin` along `forward + right·a + up·b`, not normalised, so that its parameter is the depth along
/// `forward`; an orthographic one starts at `origin + right·a + up·b` along `forward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rays {
    /// The eye, relative to the scene's origin.
    pub origin: Vec3,
    /// Unit vector of the looking direction.
    pub forward: Vec3,
    /// Unit vector to the right in the picture.
    pub right: Vec3,
    /// Unit vector upward in the picture.
    pub up: Vec3,
    /// The middle of the picture, pixels.
    pub center: [f32; 2],
    /// Size of a pixel, at distance 1 (perspective) or in world units (orthographic).
    pub pixel: f32,
    /// How the world is put on the picture.
    pub projection: Projection,
}

/// Where a point of the world is in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projected {
    /// Column coordinate, pixels; i+½ at the centre of pixel i.
    pub x: f64,
    /// Row coordinate, pixels, downward.
    pub y: f64,
    /// Distance along the ray through (x, y), world units.
    pub distance: f64,
}

impl Axis {
    /// The unit vector.
    pub fn vector(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }

    /// Turns a vector given for a world with z up to one with this axis up, by a quarter turn.
    pub fn turn(self, v: DVec3) -> DVec3 {
        match self {
            Self::X => DVec3::new(v.z, v.y, -v.x),
            Self::Y => DVec3::new(v.x, v.z, -v.y),
            Self::Z => v,
        }
    }
}

/// The default looking direction, for z up.
const DIRECTION: DVec3 = DVec3::new(2.0, 1.0, -1.0);

/// Least distance from the eye to what is framed, as a part of its diagonal.
const CLEARANCE: f64 = 0.05;

/// What a camera that is free to choose shows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Framing<'a> {
    /// Boxes around all that is to be seen; the more there are, the closer the fit. None: a unit box
    /// about the world's origin.
    pub boxes: &'a [Bounds],
    /// The box around all of them.
    pub whole: Option<Bounds>,
    /// Part of the picture's width that is kept free at the right, for a legend.
    pub free_right: f64,
}

impl<'a> Framing<'a> {
    /// Frames `boxes`, and keeps a part of the width free.
    pub fn new(boxes: &'a [Bounds], free_right: f64) -> Self {
        Self { boxes, whole: boxes.iter().copied().reduce(Bounds::union), free_right }
    }
}

impl CameraView {
    /// The view of `camera` on a picture of `size` (width, height) pixels, framing what `framing` says
    /// as far as position and target leave it open.
    ///
    /// `camera` is taken to be checked, see [`crate::Scene::resolve`]. An `up` along the looking
    /// direction is replaced by an axis that is not.
    pub fn new(camera: &Camera, framing: Framing<'_>, size: (u32, u32)) -> Self {
        let whole = framing.whole;
        let bounds = framed(whole);
        let forward = match (camera.position, camera.target, camera.direction) {
            (Some(p), Some(t), _) => t - p,
            (Some(p), None, None) if p != bounds.center() => bounds.center() - p,
            (_, _, Some(direction)) => direction,
            _ => camera.up_axis.turn(DIRECTION),
        }
        .normalize();
        let up = upright(camera.up.unwrap_or(camera.up_axis.vector()), forward);
        let right = forward.cross(up).normalize();
        let mut view = Self {
            eye: DVec3::ZERO,
            target: DVec3::ZERO,
            forward,
            right,
            up: right.cross(forward),
            projection: camera.projection,
            half_height: (camera.fov.to_radians() / 2.0).tan(),
            width: size.0,
            height: size.1,
            lens: None,
        };
        // A box that had to be given an extent stands for all; so does any before a camera that says where it
        // stands and how much it sees.
        let tight = match camera.projection {
            Projection::Perspective => camera.position.is_none(),
            Projection::Orthographic => camera.position.is_none() || camera.height.is_none(),
        };
        let boxes = if tight && whole == Some(bounds) { framing.boxes } else { &[bounds] };
        let corners: Vec<DVec3> =
            boxes.iter().flat_map(Bounds::corners).map(|c| view.in_view(c)).collect();
        let free = framing.free_right.clamp(0.0, 0.4);
        match camera.projection {
            Projection::Perspective => view.stand_perspective(camera, &bounds, (&corners, free)),
            Projection::Orthographic => view.stand_orthographic(camera, &bounds, (&corners, free)),
        }
        if camera.aperture > 0.0 {
            let focus = camera.focus.unwrap_or((view.target - view.eye).dot(view.forward));
            view.lens = Some(Lens { radius: camera.aperture as f32 / 2.0, focus: focus as f32 });
        }
        view
    }

    /// `v` along right, up and forward.
    fn in_view(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.right), v.dot(self.up), v.dot(self.forward))
    }

    /// The inverse of [`Self::in_view`].
    fn in_world(&self, v: DVec3) -> DVec3 {
        self.right * v.x + self.up * v.y + self.forward * v.z
    }

    fn aspect(&self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }

    /// Places the eye of a perspective; `corners` are those of all boxes, in view axes, and a part
    /// `free` of the width stays free at the right.
    fn stand_perspective(
        &mut self,
        camera: &Camera,
        bounds: &Bounds,
        (corners, free): (&[DVec3], f64),
    ) {
        let tan_y = self.half_height * (1.0 - camera.margin);
        let (tan_x, near) = (tan_y * self.aspect(), CLEARANCE * bounds.diagonal());
        let center_depth = bounds.center().dot(self.forward);
        let nearest = corners.iter().map(|c| c.z).fold(f64::INFINITY, f64::min) - near;
        self.eye = match (camera.position, camera.target) {
            (Some(position), _) => position,
            (None, Some(target)) => {
                let t = self.in_view(target);
                let needed = |c: &DVec3| {
                    let (x, y) = ((c.x - t.x).abs() / tan_x, (c.y - t.y).abs() / tan_y);
                    x.max(y) - (c.z - t.z)
                };
                let distance = corners.iter().map(needed).fold(t.z - nearest, f64::max);
                target - self.forward * distance
            }
            (None, None) => {
                let x = Fit::new(corners, 0, (tan_x, tan_x * (1.0 - 2.0 * free)));
                let y = Fit::new(corners, 1, (tan_y, tan_y));
                let depth = x.depth().min(y.depth()).min(nearest);
                self.in_world(DVec3::new(x.across(depth), y.across(depth), depth))
            }
        };
        self.target = camera.target.unwrap_or_else(|| self.on_axis(center_depth, bounds));
    }

    /// Places the eye of an orthographic view before all of `bounds`, and takes its height.
    fn stand_orthographic(
        &mut self,
        camera: &Camera,
        bounds: &Bounds,
        (corners, free): (&[DVec3], f64),
    ) {
        let [(x0, x1), (y0, y1)] = [0, 1].map(|axis| {
            let along = corners.iter().map(|c| c[axis]);
            (along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max))
        });
        let center = self.in_view(bounds.center());
        self.eye = camera.position.unwrap_or_else(|| {
            let target = camera.target.map_or(center, |t| self.in_view(t));
            let (x, y) = match camera.target {
                Some(_) => (target.x, target.y),
                None => {
                    let wide = (x1 - x0) / (2.0 * self.aspect() * (1.0 - free));
                    let half_height = (0.5 * (y1 - y0)).max(wide) / (1.0 - camera.margin);
                    let aside = half_height * self.aspect() * free;
                    (f64::midpoint(x0, x1) + aside, f64::midpoint(y0, y1))
                }
            };
            // A whole diagonal before the centre: every corner is in front.
            let depth = target.z.min(center.z) - bounds.diagonal();
            self.in_world(DVec3::new(x, y, depth))
        });
        let eye = self.in_view(self.eye);
        let half = |low: f64, high: f64, at: f64| (high - at).max(at - low);
        let fitting = half(y0, y1, eye.y).max(half(x0, x1, eye.x) / self.aspect());
        // Seen edge on, flat things have no height of their own.
        let fitting = fitting.max(1e-3 * bounds.diagonal()) / (1.0 - camera.margin);
        self.half_height = camera.height.map_or(fitting, |h| h / 2.0);
        self.target = camera.target.unwrap_or_else(|| self.on_axis(center.z, bounds));
    }

    /// The point of the axis at a depth; one diagonal ahead if that lies behind the eye.
    fn on_axis(&self, depth: f64, bounds: &Bounds) -> DVec3 {
        let ahead = depth - self.eye.dot(self.forward);
        self.eye + self.forward * if ahead > 0.0 { ahead } else { bounds.diagonal() }
    }

    /// Size of a pixel: at distance 1 in perspective, in world units in orthographic projection.
    fn pixel(&self) -> f64 {
        2.0 * self.half_height / f64::from(self.height)
    }

    /// Size of a pixel in world units at a depth along `forward`.
    pub fn pixel_size(&self, depth: f64) -> f64 {
        match self.projection {
            Projection::Perspective => self.pixel() * depth,
            Projection::Orthographic => self.pixel(),
        }
    }

    /// Distances along rays between which a box lies, from 0 (at the eye) on.
    pub fn distances(&self, bounds: &Bounds) -> [f64; 2] {
        let corners = bounds.corners();
        let far = |of: &dyn Fn(DVec3) -> f64| corners.into_iter().map(of).fold(0.0, f64::max);
        match self.projection {
            Projection::Perspective => {
                let nearest = self.eye.clamp(bounds.min, bounds.max);
                [nearest.distance(self.eye), far(&|c| c.distance(self.eye))]
            }
            Projection::Orthographic => {
                let along = |c: DVec3| (c - self.eye).dot(self.forward);
                let near = corners.into_iter().map(along).fold(f64::INFINITY, f64::min);
                [near.max(0.0), far(&along)]
            }
        }
    }

    /// The rays in f32, relative to `origin`, a point of the world near the particles.
    pub fn rays(&self, origin: DVec3) -> Rays {
        Rays {
            origin: (self.eye - origin).as_vec3(),
            forward: self.forward.as_vec3(),
            right: self.right.as_vec3(),
            up: self.up.as_vec3(),
            center: [self.width as f32 / 2.0, self.height as f32 / 2.0],
            pixel: self.pixel() as f32,
            projection: self.projection,
        }
    }

    /// Where `point` is in the picture; `None` behind the eye. May lie outside the picture.
    pub fn project(&self, point: DVec3) -> Option<Projected> {
        let v = self.in_view(point - self.eye);
        if v.z.is_nan() || v.z <= 0.0 {
            return None;
        }
        let (scale, distance) = match self.projection {
            Projection::Perspective => (1.0 / (v.z * self.pixel()), v.length()),
            Projection::Orthographic => (1.0 / self.pixel(), v.z),
        };
        Some(Projected {
            x: f64::from(self.width) / 2.0 + v.x * scale,
            y: f64::from(self.height) / 2.0 - v.y * scale,
            distance,
        })
    }
}

impl Rays {
    /// The ray through (x, y) in pixels (i+½, j+½ at a pixel's centre): origin and unit direction.
    #[inline]
    pub fn ray(&self, x: f32, y: f32) -> (Vec3, Vec3) {
        let a = (x - self.center[0]) * self.pixel;
        let b = (self.center[1] - y) * self.pixel;
        let across = self.right * a + self.up * b;
        match self.projection {
            Projection::Perspective => (self.origin, (self.forward + across).normalize()),
            Projection::Orthographic => (self.origin + across, self.forward),
        }
    }
}

/// Where an eye may stand, along one axis of the view and in depth, for all corners c to lie in the angle
/// between the tangents −`tan.0` and `tan.1`: −tan.0·d ≤ c − eye ≤ tan.1·d with d = depth − eye's depth.
struct Fit {
    tan: (f64, f64),
    /// The least c + tan.0·depth and the greatest c − tan.1·depth.
    low: f64,
    high: f64,
}

impl Fit {
    fn new(corners: &[DVec3], axis: usize, tan: (f64, f64)) -> Self {
        let low = corners.iter().map(|c| c[axis] + tan.0 * c.z).fold(f64::INFINITY, f64::min);
        let high = corners.iter().map(|c| c[axis] - tan.1 * c.z).fold(f64::NEG_INFINITY, f64::max);
        Self { tan, low, high }
    }

    /// The greatest depth from which there is such a place.
    fn depth(&self) -> f64 {
        (self.low - self.high) / (self.tan.0 + self.tan.1)
    }

    /// The middle of such places at `depth`.
    fn across(&self, depth: f64) -> f64 {
        f64::midpoint(self.low - self.tan.0 * depth, self.high + self.tan.1 * depth)
    }
}

/// The box to frame: never without extent.
fn framed(bounds: Option<Bounds>) -> Bounds {
    let finite = bounds.filter(|b| b.min.is_finite() && b.max.is_finite());
    let b = finite.unwrap_or(Bounds { min: DVec3::ZERO, max: DVec3::ZERO });
    // Far from the origin, an extent below the rounding of the coordinates is none.
    let least = 1e-12 * b.center().abs().max_element();
    if b.diagonal() > least {
        return b;
    }
    let half = DVec3::splat(0.5_f64.max(least));
    Bounds { min: b.min - half, max: b.max + half }
}

/// `up`, or the first axis that is not along `forward`.
fn upright(up: DVec3, forward: DVec3) -> DVec3 {
    [up.normalize(), DVec3::Y, DVec3::Z, DVec3::X]
        .into_iter()
        .find(|u| u.cross(forward).length() > 1e-6)
        .unwrap_or(up)
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
