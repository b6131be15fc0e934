//! What lies around the particles: a sky over a tiled floor, or an image of all directions.
//!
//! A ray that leaves its medium asks [`Beyond`] what it meets. Images are equirectangular: column u over
//! the width is the azimuth about the upward axis, row v over the height the angle from straight up.

use fearless_simd::Level;
use glam::Vec3;

use crate::look::look;

/// What a ray meets outside its medium: surroundings, floor, particles of another system.
pub trait Beyond: Sync {
    /// The linear light that comes from the first thing met within reach, or, if the reach is infinite, from
    /// the surroundings where there is nothing; with the distance to it. `None` if there is nothing within a
    /// finite reach.
    fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)>;

    /// The distance to the first thing met within reach.
    fn distance(&self, sight: &Sight) -> Option<f32> {
        self.meet(sight).map(|(_, distance)| distance).filter(|d| d.is_finite())
    }

    /// The environment, if it is nothing else: what sixteen rays may ask themselves, see [`crate::look_sixteen`].
    fn environment(&self) -> Option<&Environment> {
        None
    }

    /// Whether something may stand before the medium or in it.
    fn is_amid(&self) -> bool {
        false
    }

    /// Appends to `seen` what each of `sights` meets, as if its reach were infinite: in each entry light and
    /// distance, which is infinite where there is nothing.
    fn look(&self, level: Level, sights: &[Sight], seen: &mut Vec<(Vec3, f32)>) {
        let _ = level;
        seen.extend(sights.iter().map(|sight| {
            let whole = Sight { reach: f32::INFINITY, ..*sight };
            self.meet(&whole).unwrap_or((Vec3::ZERO, f32::INFINITY))
        }));
    }
}

/// A ray that is a narrow cone: nothing finer than its width is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Where it starts.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// How far it goes.
    pub reach: f32,
    /// Its width at its start, in world units.
    pub width: f32,
    /// What its width grows by per unit of length.
    pub spread: f32,
}

/// The surroundings, about the same origin as the particles.
#[derive(Debug, Clone, PartialEq)]
pub struct Environment {
    /// The light from directions that meet no floor.
    pub sky: Sky,
    /// The floor, if there is one.
    pub floor: Option<Floor>,
}

/// The light from far away.
#[derive(Debug, Clone, PartialEq)]
pub enum Sky {
    /// From one colour at the bottom of all directions to another at the top, such as the picture's
    /// background.
    Gradient {
        /// Unit vector upward.
        up: Vec3,
        /// Straight up.
        top: Vec3,
        /// Straight down.
        bottom: Vec3,
    },
    /// A bright day.
    Day {
        /// Unit vector upward.
        up: Vec3,
        /// Unit vector towards the sun.
        sun: Vec3,
    },
    /// An image of all directions.
    Image(Equirectangular),
}

/// An image of all directions in linear light.
#[derive(Debug, Clone, PartialEq)]
pub struct Equirectangular {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Colours, row after row, straight up first.
    pub pixels: Vec<[f32; 3]>,
    /// Unit vector upward.
    pub up: Vec3,
    /// Unit vector of the image's middle column, at a right angle to `up`.
    pub ahead: Vec3,
}

/// A floor of square tiles with joints, which fades into the sky far away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floor {
    /// A point of it.
    pub point: Vec3,
    /// Unit vector upward.
    pub up: Vec3,
    /// Edge of a tile, world units.
    pub tile: f32,
    /// Light of the tiles and of every other tile.
    pub colors: [Vec3; 2],
    /// Distance from `point` at which it has faded by 1/e.
    pub fade: f32,
}

/// Width of a joint between tiles, in tiles.
pub(crate) const JOINT: f32 = 0.03;

/// Colours of a bright day: straight up, at the horizon, below it, of the sun.
pub(crate) const ZENITH: Vec3 = Vec3::new(0.16, 0.34, 0.68);
pub(crate) const HORIZON: Vec3 = Vec3::new(0.78, 0.88, 0.98);
pub(crate) const BELOW: Vec3 = Vec3::new(0.42, 0.44, 0.46);
pub(crate) const SUN: Vec3 = Vec3::new(1.0, 0.92, 0.78);

impl Environment {
    /// The light from `direction`, a unit vector, where no floor is met.
    pub fn sky(&self, direction: Vec3) -> Vec3 {
        self.sky.light(direction)
    }
}

impl Beyond for Environment {
    fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)> {
        let Sight { origin, direction, reach, .. } = *sight;
        let met = self.floor.and_then(|floor| {
            let distance = floor.distance(origin, direction)?;
            (distance <= reach).then_some((floor, distance))
        });
        match met {
            Some((floor, distance)) => {
                let point = origin + direction * distance;
                let seen = (point - floor.point).reject_from_normalized(floor.up);
                let slant = direction.dot(floor.up).abs().sqrt();
                let wide = (sight.width + sight.spread * distance) / slant;
                let left = (-seen.length() / floor.fade).exp();
                // A distant floor is the haze at the horizon.
                let level = direction.reject_from_normalized(floor.up);
                let haze = self.sky.light(level.normalize_or(direction));
                Some((haze.lerp(floor.light(seen, wide), left), distance))
            }
            None if reach == f32::INFINITY => Some((self.sky.light(direction), reach)),
            None => None,
        }
    }

    fn distance(&self, sight: &Sight) -> Option<f32> {
        let distance = self.floor.as_ref()?.distance(sight.origin, sight.direction)?;
        (distance <= sight.reach).then_some(distance)
    }

    fn look(&self, level: Level, sights: &[Sight], seen: &mut Vec<(Vec3, f32)>) {
        look(self, level, sights, seen);
    }

    fn environment(&self) -> Option<&Environment> {
        Some(self)
    }
}

impl Sky {
    /// The light from the unit vector `direction`.
    pub fn light(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::Gradient { up, top, bottom } => bottom.lerp(*top, 0.5 + 0.5 * direction.dot(*up)),
            Self::Day { up, sun } => day(direction, *up, *sun),
            Self::Image(image) => image.light(direction),
        }
    }
}

/// A blue zenith, a bright horizon, a soft sun and grey below.
fn day(direction: Vec3, up: Vec3, sun: Vec3) -> Vec3 {
    let height = direction.dot(up);
    let base = match height >= 0.0 {
        true => HORIZON.lerp(ZENITH, height.sqrt()),
        false => HORIZON.lerp(BELOW, (-4.0 * height).min(1.0)),
    };
    let toward = direction.dot(sun).max(0.0);
    // Of a disk that is not quite sharp, and the haze around it.
    base + SUN * (12.0 * toward.powf(1500.0) + 0.5 * toward.powf(24.0))
}

impl Equirectangular {
    /// The light from the unit vector `direction`, bilinear between pixels.
    pub fn light(&self, direction: Vec3) -> Vec3 {
        let side = self.ahead.cross(self.up);
        let azimuth = direction.dot(side).atan2(direction.dot(self.ahead));
        let from_up = direction.dot(self.up).clamp(-1.0, 1.0).acos();
        let x = (0.5 + azimuth / std::f32::consts::TAU) * self.width as f32 - 0.5;
        let y = (from_up / std::f32::consts::PI * self.height as f32 - 0.5).max(0.0);
        let (x0, y0) = (x.floor(), y.floor());
        let at = |x: f32, y: f32| {
            let column = (x as i64).rem_euclid(self.width as i64) as usize;
            let row = (y as usize).min(self.height - 1);
            Vec3::from(self.pixels[row * self.width + column])
        };
        let above = at(x0, y0).lerp(at(x0 + 1.0, y0), x - x0);
        let below = at(x0, y0 + 1.0).lerp(at(x0 + 1.0, y0 + 1.0), x - x0);
        above.lerp(below, y - y0)
    }
}

impl Floor {
    /// Distance along the unit vector `direction` from `origin`; `None` if the floor is not ahead, or is
    /// seen from below.
    pub fn distance(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let down = -direction.dot(self.up);
        let above = (origin - self.point).dot(self.up);
        let distance = above / down;
        (down > 1e-6 && above > 0.0 && distance.is_finite()).then_some(distance)
    }

    /// The light of the floor at `seen`, a vector in it from its point, averaged over a square of edge
    /// `wide`.
    fn light(&self, seen: Vec3, wide: f32) -> Vec3 {
        let ahead = self.up.any_orthonormal_vector();
        let side = self.up.cross(ahead);
        let at = [seen.dot(ahead), seen.dot(side)].map(|x| x / self.tile);
        let wide = (wide / self.tile).max(1e-3);
        // Of pairs of tiles the first counts as 1, the second as −1.
        let odd = at.map(|x| 2.0 * covered(0.5 * x, 0.5 * wide, 0.5) - 1.0);
        let tiles = self.colors[0].lerp(self.colors[1], 0.5 - 0.5 * odd[0] * odd[1]);
        let bare = at.map(|x| 1.0 - covered(x + 0.5 * JOINT, wide, JOINT));
        tiles * (1.0 - 0.4 * (1.0 - bare[0] * bare[1]))
    }
}

/// The part of the stretch of length `wide` about `x` that lies within `part` behind whole numbers.
fn covered(x: f32, wide: f32, part: f32) -> f32 {
    let up_to = |x: f32| x.floor() * part + (x - x.floor()).min(part);
    (up_to(x + 0.5 * wide) - up_to(x - 0.5 * wide)) / wide
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment() -> Environment {
        let sky = Sky::Gradient { up: Vec3::Z, top: Vec3::ONE, bottom: Vec3::ZERO };
        let floor = Floor {
            point: Vec3::ZERO,
            up: Vec3::Z,
            tile: 1.0,
            colors: [Vec3::ONE, Vec3::ZERO],
            fade: 1e9,
        };
        Environment { sky, floor: Some(floor) }
    }

    fn sight(origin: Vec3, direction: Vec3, reach: f32) -> Sight {
        Sight { origin, direction: direction.normalize(), reach, width: 1e-4, spread: 0.0 }
    }

    fn seen(from: [f32; 3], direction: [f32; 3]) -> Option<(Vec3, f32)> {
        environment().meet(&sight(from.into(), Vec3::from(direction), f32::INFINITY))
    }

    #[test]
    fn floor_below_and_sky_above() {
        let down = seen([0.5, 0.5, 2.0], [0.0, 0.0, -1.0]);
        assert!(down.is_some_and(|(_, distance)| (distance - 2.0).abs() < 1e-6));
        let up = seen([0.5, 0.5, 2.0], [0.0, 0.0, 1.0]);
        assert_eq!(up, Some((Vec3::ONE, f32::INFINITY)));
    }

    #[test]
    fn tiles_take_turns() {
        let at = |x: f32, y: f32| seen([x, y, 1.0], [0.0, 0.0, -1.0]).map(|(light, _)| light.x);
        let places = [at(0.5, 0.5), at(1.5, 0.5), at(1.5, 1.5)];
        let [one, next, across] = places.map(|light| light.unwrap_or(-1.0));
        // Up to the rounding of what the average is taken of.
        assert!((one - across).abs() < 1e-3 && (one - next).abs() > 0.99, "{places:?}");
    }

    #[test]
    fn far_tiles_are_their_mean() {
        // The cone is as wide as many tiles there.
        let far = sight(Vec3::new(0.3, 0.4, 500.0), -Vec3::Z, f32::INFINITY);
        let light = environment().meet(&Sight { spread: 1.0, ..far });
        let expected = 0.5 * (1.0 - 0.4 * (1.0 - (1.0 - JOINT).powi(2)));
        assert!(light.is_some_and(|(l, _)| (l.x - expected).abs() < 1e-2), "{light:?}");
    }

    #[test]
    fn only_the_floor_is_within_reach() {
        let environment = environment();
        let from = Vec3::new(0.5, 0.5, 2.0);
        assert!(environment.meet(&sight(from, -Vec3::Z, 1.9)).is_none());
        assert!(environment.meet(&sight(from, -Vec3::Z, 2.1)).is_some());
    }

    #[test]
    fn images_are_looked_up_by_direction() {
        // Azimuths −135°, −45°, 45°, 135° from straight ahead; upper and lower half.
        let pixels = (0..8).map(|i| [i as f32, 0.0, 0.0]).collect();
        let image = Equirectangular { width: 4, height: 2, pixels, up: Vec3::Z, ahead: Vec3::X };
        let at = |x: f32, y: f32, z: f32| image.light(Vec3::new(x, y, z).normalize()).x;
        // To the right of straight ahead (−y) columns go up.
        assert!((at(1.0, -1.0, 1e-3) - at(1.0, 1.0, 1e-3) - 1.0).abs() < 1e-2);
        assert!((at(1.0, -1.0, 2.0) - 2.0).abs() < 1e-3);
        assert!((at(-1.0, 1.0, -2.0) - 4.0).abs() < 1e-3);
        // Around the back the last column meets the first.
        assert!((at(-1.0, 0.0, 2.0) - 1.5).abs() < 1e-3);
    }
}
