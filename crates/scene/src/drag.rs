//! A cutting plane from a line drawn on the picture (Chaudhari, §3.1, Fig. 1).
//!
//! The user drags from P1 to P2; both are brought back into the world as P1ₒ and P2ₒ, with the depth that the
//! picture has there, and the plane goes through P1ₒ with the normal P2ₒ − P1ₒ. The paper's formula for Pₒ,
//!
//! > Pₒ = Pₙ + normalize(P_f − Pₙ)
//!
//! lacks the depth: read here as Pₒ = eye + depth·direction, the point that the ray through P meets. The
//! paper does not say what holds where there is none. Here, where P2 misses everything it lies as deep in the
//! view as P1ₒ; where P1 misses everything too, both lie as deep as what is nearest along the line.

use glam::{DVec2, DVec3};

use crate::camera::CameraView;
use crate::error::{Result, SceneError};
use crate::scene::Projection;
use crate::section::Section;

impl CameraView {
    /// Where the ray through `at` (pixels; i+½ at a pixel's centre) starts, and its direction.
    pub fn ray(&self, at: DVec2) -> (DVec3, DVec3) {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        let pixel = 2.0 * self.half_height / size.y;
        let a = (at - 0.5 * size) * pixel;
        let across = self.right * a.x - self.up * a.y;
        match self.projection {
            Projection::Perspective => (self.eye, (self.forward + across).normalize()),
            Projection::Orthographic => (self.eye + across, self.forward),
        }
    }

    /// The point of the ray through `at` that lies at `depth` along the looking direction.
    fn at_depth(&self, at: DVec2, depth: f64) -> DVec3 {
        let (origin, direction) = self.ray(at);
        origin + direction * (depth / direction.dot(self.forward))
    }

    /// The section that a drag from `from` to `to` means. `seen` gives the distance along the ray to what is
    /// seen in a pixel (column, row), if anything is.
    ///
    /// # Errors
    /// The points lie outside the picture or at the same place, or nothing is seen between them.
    pub fn section_of_drag(
        &self,
        (from, to): (DVec2, DVec2),
        seen: &dyn Fn(u32, u32) -> Option<f64>,
    ) -> Result<Section> {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        let inside = |p: DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(size).all();
        let found = format!("{},{},{},{}", from.x, from.y, to.x, to.y);
        let wrong = |expected: String| SceneError::value("drag", expected, &found);
        if !inside(from) || !inside(to) {
            return Err(wrong(format!("two points in 0..{} and 0..{}", size.x, size.y)));
        }
        // How deep in the view what a point shows lies.
        let depth = |at: DVec2| {
            let pixel = at.min(size - 1.0).max(DVec2::ZERO).as_uvec2();
            let distance = seen(pixel.x, pixel.y).filter(|distance| distance.is_finite())?;
            Some(distance * self.ray(at).1.dot(self.forward))
        };
        let near = || {
            let steps = (to - from).abs().max_element().ceil();
            let along = (0..=steps as u32).map(|i| from.lerp(to, f64::from(i) / steps.max(1.0)));
            along.filter_map(depth).reduce(f64::min)
        };
        let nothing = || wrong("a line that leads over something that is seen".into());
        let deep = depth(from).or_else(near).ok_or_else(nothing)?;
        let point = self.at_depth(from, deep);
        let normal = self.at_depth(to, depth(to).unwrap_or(deep)) - point;
        if normal.normalize_or_zero() == DVec3::ZERO {
            return Err(wrong("two points apart".into()));
        }
        Ok(Section { point, normal: normal.normalize(), ..Section::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;

    fn view(projection: &str) -> CameraView {
        let mut scene = Scene::default();
        for (path, value) in [
            ("camera.projection", projection),
            ("camera.position", "3,-20,5"),
            ("camera.target", "1,2,3"),
            ("camera.height", "30"),
            ("image.width", "400"),
            ("image.height", "300"),
        ] {
            scene.set(path, value).unwrap();
        }
        scene.resolve(None).unwrap().view
    }

    #[test]
    fn points_come_back_to_where_they_were_seen() {
        for projection in ["perspective", "orthographic"] {
            let view = view(projection);
            let (a, b) = (DVec3::new(0.5, 1.0, 2.0), DVec3::new(3.0, -1.0, 4.0));
            let [pa, pb] = [a, b].map(|p| view.project(p).unwrap());
            let at = |p: crate::Projected| DVec2::new(p.x, p.y);
            let seen =
                |x: u32, _: u32| Some(if x == pa.x as u32 { pa.distance } else { pb.distance });
            let section = view.section_of_drag((at(pa), at(pb)), &seen).unwrap();
            assert!(section.point.distance(a) < 1e-9, "{section:?}");
            assert!(section.normal.distance((b - a).normalize()) < 1e-9);
        }
    }

    #[test]
    fn what_misses_takes_the_depth_of_what_is_hit() {
        for projection in ["perspective", "orthographic"] {
            let view = view(projection);
            let ball =
                |x: u32, _: u32| (180..220).contains(&x).then_some(20.0 + f64::from(x) / 100.0);
            let (left, middle, right) =
                (DVec2::new(20.5, 100.5), DVec2::new(190.5, 100.5), DVec2::new(390.5, 150.5));
            let drag = |from, to| view.section_of_drag((from, to), &ball).unwrap();
            // P2 misses: the plane stands upright in the view.
            let section = drag(middle, right);
            assert!(section.normal.dot(view.forward).abs() < 1e-9);
            assert!((section.point - view.eye).length() >= 20.0);
            // P1 misses: as deep as what P2 shows, or as what is nearest between.
            let deep = |section: Section| (section.point - view.eye).dot(view.forward);
            let to_ball = drag(left, middle);
            assert!((deep(to_ball) - 21.9 * view.ray(middle).1.dot(view.forward)).abs() < 0.2);
            let over = drag(left, right);
            assert!((deep(over.clone()) - 21.8).abs() < 0.3, "{over:?}");
            assert!(over.normal.dot(view.forward).abs() < 1e-9);
        }
    }

    #[test]
    fn drags_that_mean_nothing_are_refused() {
        let view = view("perspective");
        let points = |a: [f64; 4]| (DVec2::new(a[0], a[1]), DVec2::new(a[2], a[3]));
        let error = |a, seen: Option<f64>| {
            view.section_of_drag(points(a), &|_, _| seen).unwrap_err().to_string()
        };
        assert!(error([1.0, 2.0, 30.0, 4.0], None).contains("something that is seen"));
        assert!(error([1.0, 2.0, 1.0, 2.0], Some(3.0)).contains("two points apart"));
        assert!(error([1.0, 2.0, 1.0, 301.0], Some(3.0)).contains("0..400 and 0..300"));
        assert!(error([f64::NAN, 2.0, 1.0, 3.0], Some(3.0)).contains("two points in"));
    }
}
