//! What is drawn while something moves: less of everything that costs, so that frames come in time.

use std::time::Duration;

use motes_scene::{Renderer, Scene};

/// What a frame may take, while something moves, with its encoding. The browser needs as much of the machine
/// again, where it runs on the same.
const IN_TIME: f64 = 0.020;
/// How many times smaller than the canvas pictures may be, along each side: steps, as sizes that hardly
/// differ only flicker.
const STEPS: [f64; 8] = [1.0, 1.2, 1.45, 1.75, 2.1, 2.6, 3.2, 4.0];
/// A finer step has to be so much quicker than need be.
const EASE: f64 = 0.85;
/// Where much of the time does not depend on the size, this is how much longer than that part pictures take:
/// smaller ones would be ugly, and hardly quicker.
const FIXED: f64 = 1.4;
/// How much of what was learnt counts with each further picture, and below what it is forgotten.
const MEMORY: f64 = 0.95;
const FORGOTTEN: f64 = 0.01;
/// How much of what is not seen any more is believed with each further picture.
const STALE: f64 = 0.98;

/// How coarse pictures are, learnt from those before.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    step: usize,
    /// What pictures took at each step: how much that counts, and the mean in seconds.
    took: [(f64, f64); STEPS.len()],
    /// The canvas that these were for, million pixels.
    canvas: f64,
    /// The part of a picture's time that does not depend on its size, as it was found last.
    fixed: f64,
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
        if self.canvas != canvas {
            (self.canvas, self.took) = (canvas, Default::default());
        }
        let time = drawing.as_secs_f64() + encoding.as_secs_f64() * megapixels;
        for (weight, _) in &mut self.took {
            *weight *= MEMORY;
            *weight *= f64::from(u8::from(*weight > FORGOTTEN));
        }
        let (weight, mean) = &mut self.took[self.step];
        *mean = (*weight * *mean + time) / (*weight + 1.0);
        *weight += 1.0;
        let size = |step: usize| canvas / STEPS[step].powi(2);
        let (fixed, each) = self.cost(&size);
        self.fixed = fixed / (fixed + each * size(self.step)).max(f64::MIN_POSITIVE);
        let bound = IN_TIME.max(FIXED * fixed);
        let fits = |step: &usize| {
            let bound = if *step < self.step { EASE * bound } else { bound };
            fixed + each * size(*step) <= bound
        };
        self.step = (0..STEPS.len()).find(fits).unwrap_or(STEPS.len() - 1);
    }

    /// The time of a picture that does not depend on its size, and that of each million pixels: the line
    /// nearest to what pictures took.
    fn cost(&self, size: &dyn Fn(usize) -> f64) -> (f64, f64) {
        let known = || self.took.iter().enumerate().map(|(i, (w, time))| (*w, size(i), *time));
        let sum = |f: &dyn Fn(f64, f64) -> f64| known().map(|(w, x, y)| w * f(x, y)).sum::<f64>();
        let (all, x, y) = (sum(&|_, _| 1.0), sum(&|x, _| x), sum(&|_, y| y));
        let (mean, per) = (y / all, y / x.max(1e-12));
        let spread = all * sum(&|x, _| x * x) - x * x;
        let each = if known().filter(|(w, ..)| *w > 0.0).count() > 1 {
            ((all * sum(&|x, y| x * y) - x * y) / spread.max(1e-12)).clamp(0.0, per)
        } else {
            // Of one size only: as it was before, and less and less so.
            per * (1.0 - STALE * self.fixed)
        };
        (mean - each * x / all, each)
    }

    /// How coarse pictures are before one was drawn: liquids take longer.
    pub fn before(renderer: Renderer) -> Self {
        Self { step: if renderer == Renderer::Spheres { 0 } else { 4 }, ..Self::default() }
    }

    /// How many times smaller than the canvas pictures are, along each side.
    pub fn divide(self) -> f64 {
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
pub(crate) fn simple(scene: &Scene) -> Scene {
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
        assert_eq!(settles(2 * MS, 12 * MS), 1.0);
        // 105 ms / 2.6² = 16 ms, and 24 ms at the step before.
        assert_eq!(settles(Duration::ZERO, 100 * MS), 2.6);
    }

    #[test]
    fn what_does_not_depend_on_the_size_does_not_make_pictures_small() {
        assert_eq!(settles(500 * MS, MS), 1.0);
        // 25 + 25 / 1.75² = 33 ms, less than 1.4 × 25; now and then it is tried whether smaller ones are quicker.
        let settled = settles(25 * MS, 20 * MS);
        assert!((1.75..=2.1).contains(&settled), "{settled}");
    }

    #[test]
    fn one_slow_picture_is_forgotten() {
        let mut pace = Pace::default();
        pace.learn((1.0, 1.0), 400 * MS, MS);
        assert!(pace.divide() > 2.0);
        for _ in 0..200 {
            pace.learn((1.0 / pace.divide().powi(2), 1.0), 10 * MS, MS);
        }
        assert!(pace.is_whole());
    }

    #[test]
    fn a_coarse_scene_has_less_of_all_that_costs_and_the_same_view() {
        let mut scene = Scene::default();
        scene.camera.aperture = 1.0;
        let coarse = Pace { step: 5, ..Pace::default() }.coarse(&scene);
        assert_eq!((coarse.image.width, coarse.image.height), (738, 415));
        assert_eq!((coarse.image.samples, coarse.light.shadow_rays), (1, 0));
        assert!(coarse.check().is_ok());
        let camera = motes_scene::Camera { aperture: 0.0, ..scene.camera.clone() };
        assert_eq!(coarse.camera, camera);
        scene.image.width = 1;
        assert!(Pace { step: 7, ..Pace::default() }.coarse(&scene).check().is_ok());
    }
}
