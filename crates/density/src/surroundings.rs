//! What sixteen rays meet outside: of plain surroundings all at once, of anything else ray by ray.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use glam::Vec3;
use motes_scene::{Sight, look_sixteen};

use crate::lanes::{LANES, Lanes, V3};
use crate::shade::Around;

/// Sixteen sights, see [`Sight`].
#[derive(Clone, Copy)]
pub(crate) struct Sights<S: Simd> {
    pub origin: V3<S>,
    pub direction: V3<S>,
    pub reach: f32x16<S>,
    pub width: f32x16<S>,
    pub spread: f32x16<S>,
}

/// What they meet.
pub(crate) struct Met<S: Simd> {
    pub light: V3<S>,
    /// +∞ for what is far away.
    pub distance: f32x16<S>,
    /// Whether anything is met.
    pub any: mask32x16<S>,
}

/// What some sights meet; of the others anything may be told.
#[inline(always)]
pub(crate) fn meet<S: Simd>(
    simd: S,
    around: &Around<'_>,
    sights: &Sights<S>,
    wanted: mask32x16<S>,
) -> Met<S> {
    let Some(environment) = around.beyond.environment() else {
        return meet_each(simd, around, sights, wanted);
    };
    let cone = [sights.width, sights.spread];
    let ray = (sights.origin.0, sights.direction.0, cone);
    let (light, distance) = look_sixteen(simd, environment, ray);
    let met = Met { light: V3(light), distance, any: distance.simd_le(sights.reach) };
    match around.shadow {
        Some(shadow) => {
            let there = met.distance.simd_lt(f32x16::splat(simd, f32::INFINITY)) & wanted & met.any;
            let points = store(sights.origin.along(sights.direction, met.distance));
            let mut lit = Lanes([1.0; LANES]);
            let mut left = there.to_bitmask();
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                lit.0[lane] = shadow.lit(lane_of(&points, lane));
            }
            Met { light: met.light * f32x16::from_slice(simd, &lit.0), ..met }
        }
        None => met,
    }
}

/// Ray by ray.
#[inline(never)]
fn meet_each<S: Simd>(
    simd: S,
    around: &Around<'_>,
    sights: &Sights<S>,
    wanted: mask32x16<S>,
) -> Met<S> {
    let (origin, direction) = (store(sights.origin), store(sights.direction));
    let numbers = store(V3([sights.reach, sights.width, sights.spread]));
    let mut light = [Lanes([0.0; LANES]); 3];
    let (mut distance, mut any) = (Lanes([f32::INFINITY; LANES]), 0_u64);
    let mut left = wanted.to_bitmask();
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        let [reach, width, spread] = lane_of(&numbers, lane).to_array();
        let (origin, direction) = (lane_of(&origin, lane), lane_of(&direction, lane));
        if let Some((seen, to)) = around.meet(&Sight { origin, direction, reach, width, spread }) {
            any |= 1 << lane;
            distance.0[lane] = to;
            (0..3).for_each(|c| light[c].0[lane] = seen[c]);
        }
    }
    let of = |lanes: &Lanes<f32>| f32x16::from_slice(simd, &lanes.0);
    Met {
        light: V3([of(&light[0]), of(&light[1]), of(&light[2])]),
        distance: of(&distance),
        any: mask32x16::from_bitmask(simd, any),
    }
}

/// Vectors, to be taken apart.
#[inline(always)]
pub(crate) fn store<S: Simd>(v: V3<S>) -> [Lanes<f32>; 3] {
    let mut lanes = [Lanes([0.0; LANES]); 3];
    for k in 0..3 {
        v.0[k].store_slice(&mut lanes[k].0);
    }
    lanes
}

#[inline(always)]
pub(crate) fn lane_of(rows: &[Lanes<f32>; 3], lane: usize) -> Vec3 {
    Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane])
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};
    use fearless_simd_macros::simd;
    use motes_scene::{Beyond, Environment, Floor, Sky};

    use super::*;

    /// What one sight meets, asked for as one of sixteen.
    #[simd]
    fn one<S: Simd>(simd: S, around: &Around<'_>, sight: &Sight) -> Option<(Vec3, f32)> {
        let splat = |v: f32| f32x16::splat(simd, v);
        let sights = Sights {
            origin: V3::splat(simd, sight.origin),
            direction: V3::splat(simd, sight.direction),
            reach: splat(sight.reach),
            width: splat(sight.width),
            spread: splat(sight.spread),
        };
        let met = meet(simd, around, &sights, mask32x16::splat(simd, true));
        let any = met.any.to_bitmask() & 1 == 1;
        any.then(|| (lane_of(&store(met.light), 5), met.distance.as_slice()[5]))
    }

    #[test]
    fn sixteen_meet_what_one_does() {
        let up = Vec3::new(0.1, -0.2, 1.0).normalize();
        let floor = Floor {
            point: Vec3::new(0.3, 0.2, -0.5),
            up,
            tile: 0.7,
            colors: [Vec3::new(0.8, 0.7, 0.6), Vec3::new(0.2, 0.3, 0.5)],
            fade: 6.0,
        };
        let skies = [
            Sky::Day { up, sun: Vec3::new(0.5, 0.3, 0.6).normalize() },
            Sky::Gradient { up, top: Vec3::X, bottom: Vec3::ONE },
        ];
        let mut seed = 3_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
            (seed >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        let (mut floors, mut far, mut none) = (0, 0, 0);
        for sky in skies {
            for floor in [Some(floor), None] {
                let environment = Environment { sky: sky.clone(), floor };
                let around =
                    Around { beyond: &environment, shown: true, shadow: None, paint: None };
                for i in 0..3000 {
                    let toward = Vec3::new(0.5, 0.3, 0.6) * if i % 3 == 0 { 1.0 } else { 0.0 };
                    let way = Vec3::new(next(), next(), next()) * 0.6 + toward;
                    let sight = Sight {
                        origin: 2.0 * Vec3::new(next(), next(), next()),
                        direction: way.normalize_or(Vec3::X),
                        reach: if i % 2 == 0 { f32::INFINITY } else { 3.0 * (next() + 0.5) },
                        width: 0.01,
                        spread: 0.02,
                    };
                    let found = dispatch!(Level::new(), simd => one(simd, &around, &sight));
                    match (environment.meet(&sight), found) {
                        (Some((a, to_a)), Some((b, to_b))) => {
                            // The disk of the sun is a very high power.
                            let off = (a - b).abs().max_element();
                            assert!(off < 3e-3 * a.max_element().max(1.0), "{sight:?} {a} {b}");
                            assert!(to_a == to_b || (to_a - to_b).abs() < 1e-4 * to_a);
                            (floors, far) = match to_a.is_finite() {
                                true => (floors + 1, far),
                                false => (floors, far + 1),
                            };
                        }
                        (None, None) => none += 1,
                        (a, b) => panic!("{sight:?}: {a:?} {b:?}"),
                    }
                }
            }
        }
        assert!(floors > 500 && far > 2000 && none > 2000, "{floors} {far} {none}");
    }
}
