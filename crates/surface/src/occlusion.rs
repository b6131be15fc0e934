//! Occlusion: how much of the fill light the liquid itself keeps away.
//!
//! Zirr & Dachsbacher 2015, §3.6, after Mittring 2007: places in the half ball over a surface point are
//! looked up in the columns they lie in. As these hold many layers, nothing is hidden from the test.

use glam::Vec3;

use crate::Surfaces;

/// How occlusion is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Occlusion {
    /// Places in the unit ball, nearer to its middle more than elsewhere.
    places: Vec<Vec3>,
    /// Radius of the ball, world units.
    radius: f32,
}

impl Occlusion {
    /// With `count` places within `radius`, world units.
    pub fn new(count: u32, radius: f32) -> Self {
        // A Fibonacci sphere; radii by the golden ratio, so that neither direction goes with distance.
        let place = |i: u32| {
            let part = (f64::from(i) + 0.5) / f64::from(count);
            let (z, angle) = (1.0 - 2.0 * part, f64::from(i) * 2.399_963_229_728_653);
            let r = (1.0 - z * z).sqrt();
            let reach = 0.1 + 0.9 * (f64::from(i) * 0.618_033_988_749_895).fract();
            (glam::DVec3::new(r * angle.cos(), r * angle.sin(), z) * reach).as_vec3()
        };
        Self { places: (0..count).map(place).collect(), radius }
    }

    /// The part of the fill light that reaches a surface of a pixel.
    pub fn open(&self, surfaces: &Surfaces, (pixel, surface): ([usize; 2], usize)) -> f32 {
        let normal = surfaces.normal(surface);
        let [x, y] = pixel.map(|i| i as f32 + 0.5);
        let point = surfaces.view.point([x, y], surfaces.nearness[surface]);
        let turn = turned(pixel);
        let in_liquid = |place: &Vec3| {
            let place = turn.0 * place.x + turn.1 * place.y + turn.2 * place.z;
            let place = if place.dot(normal) < 0.0 { -place } else { place };
            // Off the surface, which is uneven by a little.
            is_inside(surfaces, point + (place + 0.05 * normal) * self.radius)
        };
        let count = self.places.iter().filter(|p| in_liquid(p)).count();
        // A plane has all places open; a corner of three walls, an eighth.
        1.0 - count as f32 / self.places.len().max(1) as f32
    }
}

/// Axes turned about by an angle of the pixel's own, alike for each sixteen by sixteen.
fn turned([x, y]: [usize; 2]) -> (Vec3, Vec3, Vec3) {
    // Interleaved gradient noise: neighbours differ evenly.
    let noise = |x: usize, y: usize| {
        let inner = 0.067_110_56 * (x % 16) as f32 + 0.005_837_15 * (y % 16) as f32;
        (52.982_918 * inner.fract()).fract()
    };
    let (sin, cos) = (std::f32::consts::TAU * noise(x, y)).sin_cos();
    (Vec3::new(cos, sin, 0.0), Vec3::new(-sin, cos, 0.0), Vec3::Z)
}

/// Whether a point lies in the liquid, as far as the view's columns tell.
fn is_inside(surfaces: &Surfaces, point: Vec3) -> bool {
    let (view, size) = (&surfaces.view, surfaces.view.size);
    let ([x, y], z) = view.place(point);
    if !(x >= 0.0 && y >= 0.0 && x < size.0 as f32 && y < size.1 as f32) || z <= 0.0 {
        return false;
    }
    let nearness = view.nearness(z);
    let column = surfaces.of(y as usize * size.0 as usize + x as usize);
    let before = surfaces.nearness[column].iter().filter(|n| **n > nearness).count();
    before % 2 == 1
}
