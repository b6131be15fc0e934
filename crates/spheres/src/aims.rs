//! Where secondary rays go: the same for a whole picture.

use fearless_simd::{f32x16, prelude::*};
use glam::Vec3;
use motes_scene::{Lights, Toward};

use crate::lanes::Lanes;
use crate::packet::LANES;
use crate::shaft::Cone;

/// Turns of the light's samples that neighbouring pixels differ by: a power of two.
pub(crate) const TURNS: u32 = 64;

/// The directions of shadow and occlusion rays.
#[derive(Debug)]
pub(crate) struct Aims {
    /// Samples of a pixel, over all rounds.
    pub samples: u32,
    /// Towards the key light: for each turn and each sample, its rays.
    key: Vec<Vec3>,
    /// The part of the light each of them leads to: of its area, and around it, in turns.
    key_parts: Vec<(f32, f32)>,
    /// The directions, coordinate by coordinate.
    key_rows: [Lanes<f32>; 3],
    /// Shadow rays of a sample.
    pub key_rays: usize,
    /// The cone around them.
    pub key_cone: Option<Cone>,
    /// Over the sphere: for each quarter and each sample, its rays.
    fill: Vec<Vec3>,
    /// Occlusion rays of a sample, those below the surface included: about twice those above.
    pub fill_rays: usize,
    /// How far occlusion rays reach.
    pub reach: f32,
}

impl Aims {
    /// The directions for pixels of `samples` samples.
    pub fn new(lights: &Lights, samples: u32) -> Self {
        let light = Cap::new(lights.key.direction, lights.key.cos_half_angle);
        let key_rays = lights.key.shadow_rays;
        let (mut key, mut key_parts) = (Vec::new(), Vec::new());
        for turn in 0..TURNS {
            for sample in 0..samples {
                for ray in 0..key_rays {
                    let place = (ray * samples + sample, key_rays * samples);
                    let (area, around) = key_part(turn, place);
                    key.push(light.direction(area, around));
                    key_parts.push((area, around));
                }
            }
        }
        let mut key_rows = [(); 3].map(|()| Lanes::new(0.0, key.len().next_multiple_of(LANES)));
        for (place, direction) in key.iter().enumerate() {
            for axis in 0..3 {
                key_rows[axis][place] = direction[axis];
            }
        }
        // Every point sees a lamp in directions of its own.
        let far = lights.key.lamp.is_none() && !key.is_empty();
        let key_cone = if far { Cone::around(&key) } else { None };
        let fill_rays = 2 * lights.occlusion_rays;
        let mut fill = Vec::new();
        for quarter in 0..4 {
            for sample in 0..samples {
                for ray in 0..fill_rays {
                    let place = (ray * samples + sample, fill_rays * samples);
                    fill.push(fill_direction(place, quarter));
                }
            }
        }
        Self {
            samples,
            key_rows,
            key_parts,
            key,
            key_rays: key_rays as usize,
            key_cone,
            fill,
            fill_rays: fill_rays as usize,
            reach: lights.occlusion_radius,
        }
    }

    /// Where the key directions of a turn and a sample begin.
    #[inline(always)]
    pub fn key_set(&self, turn: u32, sample: u32) -> usize {
        (turn * self.samples + sample) as usize * self.key_rays
    }

    /// Whether the rays of a set come in whole sixteens.
    #[inline(always)]
    pub fn key_whole(&self) -> bool {
        self.key_rays.is_multiple_of(LANES)
    }

    /// Sixteen key directions from a place on, coordinate by coordinate.
    #[inline(always)]
    pub fn key_sixteen<S: Simd>(&self, simd: S, place: usize) -> [f32x16<S>; 3] {
        let [x, y, z] = &self.key_rows;
        let lanes = place..place + LANES;
        [
            f32x16::from_slice(simd, &x[lanes.clone()]),
            f32x16::from_slice(simd, &y[lanes.clone()]),
            f32x16::from_slice(simd, &z[lanes]),
        ]
    }

    /// A key direction by its place.
    #[inline(always)]
    pub fn key_direction(&self, place: usize) -> Vec3 {
        self.key[place]
    }

    /// The direction of a place towards a lamp, as seen from one point.
    pub fn toward(&self, place: usize, toward: Toward) -> Vec3 {
        let (area, turn) = self.key_parts[place];
        Cap::new(toward.direction, toward.cos_half_angle).direction(area, turn)
    }

    /// The occlusion directions of a quarter and a sample.
    #[inline(always)]
    pub fn fill_set(&self, quarter: u32, sample: u32) -> &[Vec3] {
        let first = (quarter * self.samples + sample) as usize * self.fill_rays;
        &self.fill[first..first + self.fill_rays]
    }
}

/// A cap of directions around an axis.
#[derive(Clone, Copy)]
struct Cap {
    axis: Vec3,
    across: (Vec3, Vec3),
    /// One minus the cosine of the half angle at the rim.
    depth: f32,
}

impl Cap {
    fn new(axis: Vec3, cos_half_angle: f32) -> Self {
        Self { axis, across: axis.any_orthonormal_pair(), depth: 1.0 - cos_half_angle }
    }

    /// The direction that `area` (0..1, from the middle to the rim) and `turn` (in turns) lead to.
    fn direction(&self, area: f32, turn: f32) -> Vec3 {
        let cosine = 1.0 - area * self.depth;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (sin, cos) = (turn.fract() * std::f32::consts::TAU).sin_cos();
        self.axis * cosine + (self.across.0 * cos + self.across.1 * sin) * sine
    }
}

/// The golden angle, in turns.
pub(crate) const GOLDEN_TURN: f32 = 0.381_966;

/// Part `place` of `places` of a round light: parts of equal area along a Fibonacci spiral, turned as a
/// whole.
fn key_part(turn: u32, (place, places): (u32, u32)) -> (f32, f32) {
    // Within its part, each turn looks at another ring.
    let within = (turn.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
    let area = (place as f32 + within) / places as f32;
    (area, place as f32 * GOLDEN_TURN + turn as f32 / TURNS as f32)
}

/// Direction `place` of `places` over the sphere, for pixels of one quarter: the middles of parts of
/// equal area along a Fibonacci spiral. The directions of the four quarters lie between each other.
fn fill_direction((place, places): (u32, u32), quarter: u32) -> Vec3 {
    let between = (quarter as f32 + 0.5) / 4.0;
    let area = (place as f32 + between) / places as f32;
    Cap::new(Vec3::Z, -1.0).direction(area, (place as f32 + between) * GOLDEN_TURN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fill_directions_cover_the_sphere_evenly() {
        // The mean of max(0, n·d) over the sphere is 1/4, of d itself zero.
        let all: Vec<Vec3> = (0..4)
            .flat_map(|quarter| (0..64).map(move |place| fill_direction((place, 64), quarter)))
            .collect();
        let mean = all.iter().sum::<Vec3>() / 256.0;
        assert!(mean.length() < 0.02, "{mean}");
        for normal in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize()] {
            let cosine = all.iter().map(|d| d.dot(normal).max(0.0)).sum::<f32>() / 256.0;
            assert!((cosine - 0.25).abs() < 0.02, "{normal}: {cosine}");
        }
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn key_directions_stay_within_the_light_and_fill_it() {
        let light = Cap::new(Vec3::new(0.6, 0.0, 0.8), 0.9);
        for turn in 0..TURNS {
            let all: Vec<Vec3> = (0..64)
                .map(|place| key_part(turn, (place, 64)))
                .map(|(area, around)| light.direction(area, around))
                .collect();
            assert!(all.iter().all(|d| d.dot(light.axis) > 0.9 - 1e-5));
            let mean = all.iter().map(|d| d.dot(light.axis)).sum::<f32>() / 64.0;
            assert!((mean - 0.95).abs() < 0.005, "{mean}");
        }
    }
}
