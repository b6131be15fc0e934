//! The camera of a film: keyframes, and a turn about the target.
//!
//! Between keyframes i and i+1, with u the part of the way from one to the other, every value goes
//! along the cubic Hermite curve
//!
//! > p(u) = pᵢ + (3u² − 2u³)·(pᵢ₊₁ − pᵢ) + (u³ − 2u² + u)·h·mᵢ + (u³ − u²)·h·mᵢ₊₁
//!
//! where h = tᵢ₊₁ − tᵢ and mᵢ = (pᵢ₊₁ − pᵢ₋₁)/(tᵢ₊₁ − tᵢ₋₁) (Catmull and Rom 1974, at uneven times). At
//! either end, and beside a keyframe with the same value, m is 0: the camera starts and stops gently,
//! and what rests does not swing.

use std::ops::{Add, Mul, Sub};

use glam::{DQuat, DVec3};

use crate::camera::{CameraView, Framing};
use crate::error::Result;
use crate::scene::{Camera, Keyframe, Projection, Scene};

/// A picture of a film.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moment {
    /// Which picture, from 0.
    pub picture: usize,
    /// Of how many.
    pub pictures: usize,
}

impl Moment {
    /// 0 at the first picture, 1 at the last.
    fn time(self) -> f64 {
        self.picture as f64 / self.pictures.saturating_sub(1).max(1) as f64
    }

    /// 0 at the first picture, 1 where one more would be: a film that begins again goes on evenly.
    fn round(self) -> f64 {
        self.picture as f64 / self.pictures.max(1) as f64
    }
}

impl Camera {
    /// Whether it moves in a film.
    pub fn moves(&self) -> bool {
        self.turn != 0.0 || !self.keyframe.is_empty()
    }

    /// The camera as it stands at a moment of a film. It must have been held, see [`Scene::hold`].
    pub fn at(&self, moment: Moment) -> Self {
        let mut still = Self { turn: 0.0, keyframe: Vec::new(), ..self.clone() };
        let time = moment.time();
        let key = |value: &dyn Fn(&Keyframe) -> Option<DVec3>| along(&self.keyframe, time, value);
        still.position = key(&|k| k.position.or(self.position)).or(self.position);
        still.target = key(&|k| k.target.or(self.target)).or(self.target);
        let up = key(&|k| Some(k.up.unwrap_or(self.upward()).normalize()));
        still.up = up.filter(|up| up.length() > 1e-3).or(self.up);
        still.fov =
            within(&self.keyframe, time, |k| Some(k.fov.unwrap_or(self.fov))).unwrap_or(self.fov);
        still.height = within(&self.keyframe, time, |k| k.height.or(self.height)).or(self.height);
        still.turned((self.turn * moment.round()).to_radians())
    }

    /// What is up in the picture.
    fn upward(&self) -> DVec3 {
        self.up.unwrap_or(self.up_axis.vector())
    }

    /// Gone around the target by an angle in radians, to the right.
    fn turned(mut self, angle: f64) -> Self {
        if angle == 0.0 {
            return self;
        }
        let rotation = DQuat::from_axis_angle(self.upward().normalize(), angle);
        if let (Some(position), Some(target)) = (self.position, self.target) {
            self.position = Some(target + rotation * (position - target));
        }
        self.direction = self.direction.map(|d| rotation * d);
        self
    }
}

/// Places at which a turning camera is asked how far away it has to be.
const LOOKS: usize = 36;

impl Scene {
    /// Fixes the camera, and what the light takes from what is visible, for a film: `framing` is shown,
    /// from all sides that a turning camera sees, and nothing changes with what is visible from then on.
    /// What the scene says itself stays.
    ///
    /// # Errors
    /// As [`Scene::check`].
    pub fn hold(&mut self, framing: Framing<'_>) -> Result<()> {
        let resolved = self.resolve_framing(framing)?;
        let mut view = resolved.view;
        if self.camera.turn != 0.0 {
            self.stand_back(&mut view, framing);
        }
        let camera = &mut self.camera;
        camera.position.get_or_insert(view.eye);
        camera.target.get_or_insert(view.target);
        if camera.projection == Projection::Orthographic {
            camera.height.get_or_insert(2.0 * view.half_height);
        }
        let radius = f64::from(resolved.lights.occlusion_radius);
        self.light.occlusion_radius.get_or_insert(radius);
        Ok(())
    }

    /// Moves a view that was free to choose to where all is shown all the way round.
    fn stand_back(&self, view: &mut CameraView, framing: Framing<'_>) {
        let whole = framing.whole;
        if self.camera.position.is_some() {
            return;
        }
        let target = self.camera.target.or(whole.map(|b| b.center())).unwrap_or(view.target);
        let start = Camera {
            target: Some(target),
            direction: Some(view.forward),
            turn: 0.0,
            keyframe: Vec::new(),
            ..self.camera.clone()
        };
        let size = (self.image.width, self.image.height);
        let (mut distance, mut half_height) = (0.0, 0.0);
        for look in 0..LOOKS {
            let angle = self.camera.turn * look as f64 / LOOKS as f64;
            let seen = CameraView::new(&start.clone().turned(angle.to_radians()), framing, size);
            distance = f64::max(distance, (seen.eye - target).length());
            half_height = f64::max(half_height, seen.half_height);
        }
        view.target = target;
        view.eye = target - view.forward * distance;
        view.half_height = half_height;
    }
}

/// The value at `time`; `None` without keyframes, or if some keyframe has no value.
fn along<T>(keys: &[Keyframe], time: f64, value: impl Fn(&Keyframe) -> Option<T>) -> Option<T>
where
    T: Copy + PartialEq + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let points: Vec<(f64, T)> =
        keys.iter().map(|k| Some((k.at, value(k)?))).collect::<Option<_>>()?;
    let next = points.partition_point(|(at, _)| *at <= time);
    let (Some(from), Some(to)) = (next.checked_sub(1), points.get(next)) else {
        // Before the first and after the last, it rests.
        return points.get(next.saturating_sub(1)).map(|(_, p)| *p);
    };
    let ((t0, p0), (t1, p1)) = (points[from], *to);
    let (h, u) = (t1 - t0, (time - t0) / (t1 - t0));
    let (a, b) = (slope(&points, from), slope(&points, next));
    let (u2, u3) = (u * u, u * u * u);
    Some(
        p0 + (p1 - p0) * (3.0 * u2 - 2.0 * u3)
            + a * (h * (u3 - 2.0 * u2 + u))
            + b * (h * (u3 - u2)),
    )
}

fn slope<T>(points: &[(f64, T)], i: usize) -> T
where
    T: Copy + PartialEq + Sub<Output = T> + Mul<f64, Output = T>,
{
    let (_, here) = points[i];
    let neighbours = i.checked_sub(1).map(|before| points[before]).zip(points.get(i + 1).copied());
    match neighbours {
        Some(((t0, p0), (t1, p1))) if p0 != here && here != p1 => (p1 - p0) * (1.0 / (t1 - t0)),
        _ => here * 0.0,
    }
}

/// As [`along`], never beyond what the keyframes have.
fn within(keys: &[Keyframe], time: f64, value: impl Fn(&Keyframe) -> Option<f64>) -> Option<f64> {
    let least = keys.iter().filter_map(&value).fold(f64::INFINITY, f64::min);
    let greatest = keys.iter().filter_map(&value).fold(f64::NEG_INFINITY, f64::max);
    along(keys, time, &value).map(|v| v.clamp(least, greatest.max(least)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Bounds;

    fn camera(keys: &str) -> Camera {
        let mut scene = Scene::default();
        scene.set("camera.position", "10,0,0").unwrap();
        scene.set("camera.target", "0,0,0").unwrap();
        scene.set("camera.keyframe", keys).unwrap();
        scene.check().unwrap();
        scene.camera
    }

    fn at(camera: &Camera, picture: usize, pictures: usize) -> Camera {
        camera.at(Moment { picture, pictures })
    }

    #[test]
    fn a_full_turn_passes_all_sides_and_closes() {
        let mut camera = camera("[]");
        camera.turn = 360.0;
        assert!(camera.moves());
        for (picture, [x, y]) in
            [[10.0, 0.0], [0.0, 10.0], [-10.0, 0.0], [0.0, -10.0]].into_iter().enumerate()
        {
            let still = at(&camera, picture, 4);
            let position = still.position.unwrap();
            assert!(position.abs_diff_eq(DVec3::new(x, y, 0.0), 1e-12), "{position}");
            assert!(!still.moves() && still.target == Some(DVec3::ZERO));
        }
        assert!(at(&camera, 4, 4).position.unwrap().abs_diff_eq(DVec3::X * 10.0, 1e-12));
        // About what is up, wherever that is.
        camera.up = Some(DVec3::new(0.0, -2.0, 0.0));
        assert!(at(&camera, 1, 4).position.unwrap().abs_diff_eq(DVec3::Z * 10.0, 1e-12));
    }

    #[test]
    fn keyframes_are_met_and_the_ends_are_the_first_and_last_picture() {
        let camera = camera(
            "[{ at = 0.0, position = [8, 0, 0], fov = 20 }, { at = 0.25, position = [8, 4, 0] },\
              { at = 1.0, position = [0, 4, 2], target = [0, 0, 1], up = [0, 1, 0] }]",
        );
        for (picture, position) in
            [(0, [8.0, 0.0, 0.0]), (1, [8.0, 4.0, 0.0]), (4, [0.0, 4.0, 2.0])]
        {
            assert_eq!(at(&camera, picture, 5).position, Some(position.into()), "{picture}");
        }
        let last = at(&camera, 4, 5);
        assert_eq!((last.fov, last.target), (35.0, Some(DVec3::Z)));
        assert_eq!(last.up, Some(DVec3::Y));
        assert_eq!(at(&camera, 0, 5).fov, 20.0);
        // One picture is the first.
        assert_eq!(at(&camera, 0, 1).position, Some(DVec3::X * 8.0));
    }

    #[test]
    fn the_way_is_smooth_and_rests_where_it_is_told_to() {
        let camera = camera(
            "[{ at = 0.0, position = [9, 0, 0] }, { at = 0.3, position = [9, 3, 0] },\
              { at = 0.5, position = [9, 3, 0] }, { at = 1.0, position = [9, 9, 5] }]",
        );
        let places: Vec<DVec3> =
            (0..=1000).map(|i| at(&camera, i, 1001).position.unwrap()).collect();
        // It never leaves the box of its keyframes, and rests for a while.
        assert!(places.iter().all(|p| p.x == 9.0 && (-1e-9..=9.0 + 1e-9).contains(&p.y)));
        assert!(places[300..=500].iter().all(|p| p.abs_diff_eq(DVec3::new(9.0, 3.0, 0.0), 1e-12)));
        // Neither place nor speed jumps.
        let speeds: Vec<DVec3> = places.windows(2).map(|p| (p[1] - p[0]) * 1000.0).collect();
        let jump = speeds.windows(2).map(|s| (s[1] - s[0]).length()).fold(0.0, f64::max);
        assert!(jump < 0.3, "{jump}");
        assert!(speeds[0].length() < 0.5 && speeds[999].length() < 0.5);
    }

    #[test]
    fn a_line_at_even_speed_stays_one() {
        // Inner keyframes on a straight, even way change nothing between them.
        let camera = camera(
            "[{ at = 0.0, position = [9, 0, 0] }, { at = 0.2, position = [9, 2, 0] },\
              { at = 0.6, position = [9, 6, 0] }, { at = 1.0, position = [9, 10, 0] }]",
        );
        for i in 20..=60 {
            let y = at(&camera, i, 101).position.unwrap().y;
            assert!((y - 0.1 * i as f64).abs() < 1e-12, "{i}: {y}");
        }
    }

    #[test]
    fn a_turning_camera_shows_all_from_every_side() {
        let bounds = Bounds::new(DVec3::new(-4.0, -1.0, -1.0), DVec3::new(4.0, 1.0, 1.0));
        for projection in ["perspective", "orthographic"] {
            let mut scene = Scene::default();
            scene.set("camera.projection", projection).unwrap();
            scene.set("camera.turn", "360").unwrap();
            scene.hold(Framing::new(&[bounds], 0.0)).unwrap();
            let held = scene.clone();
            for picture in 0..24 {
                scene.camera = held.camera.at(Moment { picture, pictures: 24 });
                let view = scene.resolve(None).unwrap().view;
                for corner in bounds.corners() {
                    let seen = view.project(corner).unwrap();
                    let inside = (0.0..=f64::from(view.width)).contains(&seen.x)
                        && (0.0..=f64::from(view.height)).contains(&seen.y);
                    assert!(inside, "{projection} {picture}: {seen:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_held_is_what_was_framed() {
        let bounds = Bounds::new(DVec3::ZERO, DVec3::new(3.0, 2.0, 1.0));
        let mut scene = Scene::default();
        let framed = scene.resolve(Some(bounds)).unwrap();
        scene.hold(Framing::new(&[bounds], 0.0)).unwrap();
        let held = scene.resolve(None).unwrap();
        assert!(held.view.eye.abs_diff_eq(framed.view.eye, 1e-12));
        assert!(held.view.up.abs_diff_eq(framed.view.up, 1e-12));
        assert_eq!(held.lights.occlusion_radius, framed.lights.occlusion_radius);
        assert_eq!(scene.camera.at(Moment { picture: 3, pictures: 9 }), scene.camera);
    }
}
