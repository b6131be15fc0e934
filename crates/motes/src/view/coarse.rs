//! What is drawn while something moves: less of everything that costs, so that frames come in time.

use std::time::Duration;

use motes_scene::{Renderer, Scene};

/// What a frame may take, while something moves, with its encoding.
const IN_TIME: Duration = Duration::from_millis(28);
/// How many times smaller than the canvas pictures may be, along each side: steps, as sizes that hardly
/// differ only flicker.
const STEPS: [f64; 8] = [1.0, 1.2, 1.45, 1.75, 2.1, 2.6, 3.2, 4.0];
/// A finer step has to be so much quicker than need be.
const EASE: f64 = 0.85;

/// How coarse pictures are, learnt from those before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    step: usize,
    /// Seconds that a picture takes for each million pixels of the canvas, at the size it had.
    cost: Option<f64>,
}

impl Pace {
    /// Learns from a coarse picture of `megapixels` that took `drawing`, where encoding a million pixels
    /// takes `encoding`.
    pub fn learn(
        &mut self,
        (megapixels, canvas): (f64, f64),
        drawing: Duration,
        encoding: Duration,
    ) {
        let took = drawing.as_secs_f64() / megapixels.max(1e-6) + encoding.as_secs_f64();
        // Part of it does not depend on the size; to take it for less ends in the right place too.
        let cost = self.cost.map_or(took, |had| had + 0.4 * (took - had));
        self.cost = Some(cost);
        let fits = |step: usize, time: f64| cost * canvas <= time * STEPS[step].powi(2);
        let time = IN_TIME.as_secs_f64();
        if !fits(self.step, time) {
            // What is much too slow is not tried again on the way.
            let mut all = self.step + 1..STEPS.len();
            self.step = all.find(|step| fits(*step, 1.5 * time)).unwrap_or(STEPS.len() - 1);
        } else if self.step > 0 && fits(self.step - 1, EASE * time) {
            self.step -= 1;
        }
    }

    /// How coarse pictures are before one was drawn: liquids take longer.
    pub fn before(renderer: Renderer) -> Self {
        Self { step: if renderer == Renderer::Spheres { 0 } else { 4 }, cost: None }
    }

    fn divide(self) -> f64 {
        STEPS[self.step]
    }

    /// Whether coarse pictures are as large as the canvas.
    pub fn is_whole(self) -> bool {
        self.step == 0
    }

    /// The coarse scene.
    pub fn coarse(self, scene: &Scene) -> Scene {
        let mut scene = simple(scene);
        let smaller = |n: u32| ((f64::from(n) / self.divide()).round() as u32).max(1);
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
            let megapixels = 1.0 / pace.divide().powi(2);
            pace.learn((megapixels, 1.0), fixed + each.mul_f64(megapixels), 5 * MS);
        }
        pace.divide()
    }

    #[test]
    fn what_is_quick_is_whole_and_what_is_slow_gets_smaller() {
        assert_eq!(settles(2 * MS, 15 * MS), 1.0);
        // 105 ms / 2.1² = 24 ms, and 34 ms at the step before.
        assert_eq!(settles(Duration::ZERO, 100 * MS), 2.1);
        assert_eq!(settles(500 * MS, MS), 4.0);
    }

    #[test]
    fn a_coarse_scene_has_less_of_all_that_costs_and_the_same_view() {
        let mut scene = Scene::default();
        scene.camera.aperture = 1.0;
        let coarse = Pace { step: 5, cost: None }.coarse(&scene);
        assert_eq!((coarse.image.width, coarse.image.height), (738, 415));
        assert_eq!((coarse.image.samples, coarse.light.shadow_rays), (1, 0));
        assert!(coarse.check().is_ok());
        let camera = motes_scene::Camera { aperture: 0.0, ..scene.camera.clone() };
        assert_eq!(coarse.camera, camera);
        scene.image.width = 1;
        assert!(Pace { step: 7, cost: None }.coarse(&scene).check().is_ok());
    }
}
