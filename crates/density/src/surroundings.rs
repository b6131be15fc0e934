//! What sixteen rays meet outside: [`Environment::meet`] in vectors, for a day or a gradient over a floor;
//! whatever else is asked ray by ray.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use glam::Vec3;
use motes_scene::{Environment, Floor, Sight, Sky};

use crate::lanes::{LANES, Lanes, V3, exp};
use crate::shade::Around;

/// Least cosine to the sun for which its disk is seen.
const NEAR_SUN: f32 = 0.97;

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
    let met = match around.beyond.environment() {
        Some(Environment { sky, floor }) if !matches!(sky, Sky::Image(_)) => {
            meet_plain(simd, (sky, floor.as_ref()), sights, wanted)
        }
        _ => return meet_each(simd, around, sights, wanted),
    };
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

#[inline(always)]
fn meet_plain<S: Simd>(
    simd: S,
    (sky, floor): (&Sky, Option<&Floor>),
    sights: &Sights<S>,
    wanted: mask32x16<S>,
) -> Met<S> {
    let far = f32x16::splat(simd, f32::INFINITY);
    let Some(floor) = floor else {
        let any = sights.reach.simd_ge(far);
        return Met { light: light_of(simd, sky, sights.direction), distance: far, any };
    };
    let up = V3::splat(simd, floor.up);
    let down = -sights.direction.dot(up);
    let above = (sights.origin - V3::splat(simd, floor.point)).dot(up);
    let distance = above / down;
    let zero = f32x16::splat(simd, 0.0);
    let on_floor = down.simd_gt(f32x16::splat(simd, 1e-6))
        & above.simd_gt(zero)
        & distance.simd_lt(far)
        & distance.simd_le(sights.reach);
    let any = on_floor | sights.reach.simd_ge(far);
    // A distant floor is the haze at the horizon.
    let level = sights.direction.along(up, down).normalize_or(sights.direction);
    let mut light = light_of(simd, sky, V3::select(on_floor, level, sights.direction));
    if (on_floor & wanted).any_true() {
        let point = sights.origin.along(sights.direction, distance);
        let seen = point - V3::splat(simd, floor.point);
        let seen = seen.along(up, -seen.dot(up));
        let wide = distance.mul_add(sights.spread, sights.width) / down.max(zero).sqrt();
        let left = exp(-seen.dot(seen).sqrt() / floor.fade);
        let tiles = tiles(simd, floor, (seen, wide));
        light = V3::select(on_floor, light.mix(tiles, left), light);
    }
    Met { light, distance: on_floor.select(distance, far), any }
}

/// The light of a floor over squares about places in it.
#[inline(always)]
fn tiles<S: Simd>(simd: S, floor: &Floor, (seen, wide): (V3<S>, f32x16<S>)) -> V3<S> {
    let ahead = floor.up.any_orthonormal_vector();
    let side = floor.up.cross(ahead);
    let per_tile = f32x16::splat(simd, 1.0 / floor.tile);
    let wide = (wide * per_tile).max(f32x16::splat(simd, 1e-3));
    let mut odd = [wide; 2];
    let mut bare = [wide; 2];
    for (k, axis) in [ahead, side].into_iter().enumerate() {
        let at = seen.dot(V3::splat(simd, axis)) * per_tile;
        odd[k] = covered(at * 0.5, wide * 0.5, 0.5) * 2.0 - 1.0;
        bare[k] = 1.0 - covered(at + 0.5 * Floor::JOINT, wide, Floor::JOINT);
    }
    let [one, other] = floor.colors.map(|color| V3::splat(simd, color));
    let mixed = one.mix(other, 0.5 - odd[0] * odd[1] * 0.5);
    mixed * (1.0 - (1.0 - bare[0] * bare[1]) * 0.4)
}

/// The part of the stretch of length `wide` about `x` that lies within `part` behind whole numbers.
#[inline(always)]
fn covered<S: Simd>(x: f32x16<S>, wide: f32x16<S>, part: f32) -> f32x16<S> {
    let (low, high) = (x - wide * 0.5, x + wide * 0.5);
    let (before, behind) = (low.floor(), high.floor());
    let part = f32x16::splat(x.token(), part);
    let up_to_low = before.mul_add(part, (low - before).min(part));
    (behind.mul_add(part, (high - behind).min(part)) - up_to_low) / wide
}

/// [`Sky::light`].
#[inline(always)]
fn light_of<S: Simd>(simd: S, sky: &Sky, direction: V3<S>) -> V3<S> {
    let color = |c: Vec3| V3::splat(simd, c);
    match sky {
        Sky::Gradient { up, top, bottom } => {
            let height = direction.dot(V3::splat(simd, *up));
            color(*bottom).mix(
                color(*top),
                height.mul_add(f32x16::splat(simd, 0.5), f32x16::splat(simd, 0.5)),
            )
        }
        Sky::Day { up, sun } => {
            let zero = f32x16::splat(simd, 0.0);
            let height = direction.dot(V3::splat(simd, *up));
            let above = height.simd_ge(zero);
            let part = above
                .select(height.max(zero).sqrt(), (height * -4.0).min(f32x16::splat(simd, 1.0)));
            let other = V3::select(above, color(Sky::ZENITH), color(Sky::BELOW));
            let base = color(Sky::HORIZON).mix(other, part);
            let toward = direction.dot(V3::splat(simd, *sun)).max(zero);
            // toward²⁴; and toward¹⁵⁰⁰, of numbers whose powers are not too small.
            let squares = |mut v: f32x16<S>, times: usize| {
                for _ in 0..times {
                    v *= v;
                }
                v
            };
            let hazy = toward.max(f32x16::splat(simd, 0.03));
            let eight = squares(hazy, 3);
            let haze = eight * eight * eight;
            let near = toward.max(f32x16::splat(simd, NEAR_SUN));
            let four = squares(near, 2);
            let (eight, sixteen) = (four * four, squares(four, 2));
            let sixty_four = squares(sixteen, 2);
            let many = squares(sixty_four, 4);
            let disk = many
                * squares(sixty_four, 2)
                * squares(sixty_four, 1)
                * sixty_four
                * sixteen
                * eight
                * four;
            base.along(color(Sky::SUN), disk * 12.0 + haze * 0.5)
        }
        Sky::Image(_) => color(Vec3::ZERO),
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
    use motes_scene::Beyond;

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
