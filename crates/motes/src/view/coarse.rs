//! What is drawn while something moves: less of everything that costs, so that frames come in time.

use std::time::Duration;

use motes_scene::Scene;

/// What a frame may take, while something moves, with its encoding.
const IN_TIME: Duration = Duration::from_millis(31);
/// How much smaller pictures may become, along each side.
const SMALLEST: f64 = 4.0;

/// How coarse pictures are, learnt from those before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// How many times smaller than the canvas, along each side.
    divide: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Self { divide: 1.0 }
    }
}

impl Pace {
    /// Learns from a coarse picture of `megapixels` that took `drawing`, where encoding a million pixels
    /// takes `encoding`; the whole canvas has `canvas` million pixels.
    pub fn learn(
        &mut self,
        (megapixels, canvas): (f64, f64),
        drawing: Duration,
        encoding: Duration,
    ) {
        let took = drawing.as_secs_f64() + encoding.as_secs_f64() * megapixels;
        // Part of it does not depend on the size; to take it for less ends in the right place too.
        let fits = canvas * took / (megapixels.max(1e-6) * IN_TIME.as_secs_f64());
        let wanted = fits.sqrt().clamp(1.0, SMALLEST);
        let step = if wanted > self.divide { 0.7 } else { 0.25 };
        let divide = self.divide + step * (wanted - self.divide);
        // Sizes that hardly differ only flicker.
        if (divide - self.divide).abs() > 0.04 * self.divide || divide == 1.0 {
            self.divide = if divide < 1.06 { 1.0 } else { divide };
        }
    }

    /// Whether coarse pictures are as large as the canvas.
    pub fn is_whole(self) -> bool {
        self.divide == 1.0
    }

    /// The coarse scene.
    pub fn coarse(self, scene: &Scene) -> Scene {
        let mut scene = simple(scene);
        let smaller = |n: u32| ((f64::from(n) / self.divide).round() as u32).max(1);
        let (width, height) = (scene.image.width, scene.image.height);
        (scene.image.width, scene.image.height) = (smaller(width), smaller(height));
        scene
    }
}

/// One ray a pixel, and no rays from where it ends.
pub(super) fn simple(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    (scene.image.samples, scene.image.max_samples) = (1, 1);
    scene.camera.aperture = 0.0;
    let light = &mut scene.light;
    (light.shadow_rays, light.occlusion_rays, light.bounce_rays) = (0, 0, 0);
    scene.surface.depth = scene.surface.depth.min(2);
    scene.density.depth = scene.density.depth.min(2);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Where a pace settles, if a picture takes a fixed time and one for each million pixels.
    fn settles(fixed: Duration, each: Duration) -> f64 {
        let mut pace = Pace::default();
        for _ in 0..100 {
            let megapixels = 1.0 / pace.divide.powi(2);
            pace.learn((megapixels, 1.0), fixed + each.mul_f64(megapixels), 5 * MS);
        }
        pace.divide
    }

    #[test]
    fn what_is_quick_is_whole_and_what_is_slow_gets_smaller() {
        assert_eq!(settles(2 * MS, 15 * MS), 1.0);
        let divide = settles(Duration::ZERO, 100 * MS);
        assert!((divide.powi(2) - 105.0 / 31.0).abs() < 0.4, "{divide}");
        assert_eq!(settles(500 * MS, MS), SMALLEST);
    }

    #[test]
    fn a_coarse_scene_has_less_of_all_that_costs_and_the_same_view() {
        let mut scene = Scene::default();
        scene.camera.aperture = 1.0;
        let coarse = Pace { divide: 2.5 }.coarse(&scene);
        assert_eq!((coarse.image.width, coarse.image.height), (768, 432));
        assert_eq!((coarse.image.samples, coarse.light.shadow_rays), (1, 0));
        assert!(coarse.check().is_ok());
        let camera = motes_scene::Camera { aperture: 0.0, ..scene.camera.clone() };
        assert_eq!(coarse.camera, camera);
        scene.image.width = 1;
        assert!(Pace { divide: 4.0 }.coarse(&scene).check().is_ok());
    }
}
