//! Surroundings seen by sixteen rays at once: [`Beyond::look`](crate::Beyond::look) of an [`Environment`].
//!
//! The same formulas as for one ray in `environment.rs`, but for e^x and powers, which are products here and
//! good to 1e-6 and 1e-4.

use fearless_simd::{Level, Simd, dispatch, f32x16, i32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::environment::{BELOW, HORIZON, JOINT, SUN, ZENITH};
use crate::{Environment, Floor, Sight, Sky};

const LANES: usize = 16;

/// Appends to `seen` what each of `sights` meets, whatever its reach, and at which distance.
pub(crate) fn look(
    environment: &Environment,
    level: Level,
    sights: &[Sight],
    seen: &mut Vec<(Vec3, f32)>,
) {
    seen.reserve(sights.len());
    dispatch!(level, simd => look_all(simd, environment, sights, seen));
}

type Vec3x16<S> = [f32x16<S>; 3];

#[simd]
fn look_all<S: Simd>(
    simd: S,
    environment: &Environment,
    sights: &[Sight],
    seen: &mut Vec<(Vec3, f32)>,
) {
    for chunk in sights.chunks(LANES) {
        let mut of = [[0.0_f32; LANES]; 8];
        for lane in 0..LANES {
            let Sight { origin, direction, width, spread, .. } = chunk[lane.min(chunk.len() - 1)];
            of[0][lane] = origin.x;
            of[1][lane] = origin.y;
            of[2][lane] = origin.z;
            of[3][lane] = direction.x;
            of[4][lane] = direction.y;
            of[5][lane] = direction.z;
            of[6][lane] = width;
            of[7][lane] = spread;
        }
        let origin = [load(simd, &of[0]), load(simd, &of[1]), load(simd, &of[2])];
        let direction = [load(simd, &of[3]), load(simd, &of[4]), load(simd, &of[5])];
        let cone = [load(simd, &of[6]), load(simd, &of[7])];
        let (light, distance) = look_sixteen(simd, environment, (origin, direction, cone));
        let mut out = [[0.0_f32; LANES]; 4];
        light[0].store_slice(&mut out[0]);
        light[1].store_slice(&mut out[1]);
        light[2].store_slice(&mut out[2]);
        distance.store_slice(&mut out[3]);
        let [r, g, b, distance] = out;
        let each = r.into_iter().zip(g).zip(b).zip(distance).take(chunk.len());
        seen.extend(each.map(|(((r, g), b), distance)| (Vec3::new(r, g, b), distance)));
    }
}

/// What sixteen rays with origins, unit directions and cones (width and spread, see [`Sight`]) meet, whatever
/// their reach: light and distance, which is infinite where there is no floor.
#[inline(always)]
pub fn look_sixteen<S: Simd>(
    simd: S,
    environment: &Environment,
    (origin, direction, cone): (Vec3x16<S>, Vec3x16<S>, [f32x16<S>; 2]),
) -> (Vec3x16<S>, f32x16<S>) {
    let Environment { sky: above, floor } = environment;
    match floor {
        Some(floor) => {
            let axes = floor_axes(floor);
            with_floor(simd, (above, floor, &axes), (origin, direction, cone))
        }
        None => (sky(simd, above, direction), f32x16::splat(simd, f32::INFINITY)),
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, lanes: &[f32; LANES]) -> f32x16<S> {
    f32x16::from_slice(simd, lanes)
}

/// The axes of the tiles.
fn floor_axes(floor: &Floor) -> [Vec3; 2] {
    let ahead = floor.up.any_orthonormal_vector();
    [ahead, floor.up.cross(ahead)]
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: Vec3x16<S>, b: Vec3) -> f32x16<S> {
    let [x, y, z] = [b.x, b.y, b.z];
    a[0] * f32x16::splat(simd, x) + a[1] * f32x16::splat(simd, y) + a[2] * f32x16::splat(simd, z)
}

#[inline(always)]
fn with_floor<S: Simd>(
    simd: S,
    (sky_above, floor, axes): (&Sky, &Floor, &[Vec3; 2]),
    (origin, direction, cone): (Vec3x16<S>, Vec3x16<S>, [f32x16<S>; 2]),
) -> (Vec3x16<S>, f32x16<S>) {
    let splat = f32x16::splat(simd, 0.0);
    let one = f32x16::splat(simd, 1.0);
    let far = f32x16::splat(simd, f32::INFINITY);
    let along = dot(simd, direction, floor.up);
    let above = dot(simd, origin, floor.up) - f32x16::splat(simd, floor.point.dot(floor.up));
    let distance = above / (splat - along);
    let met = along.simd_lt(f32x16::splat(simd, -1e-6)) & above.simd_gt(splat);
    let met = met & distance.simd_lt(far);
    // Where there is no floor, what is worked out for it is not used, but is to be finite.
    let distance = met.select(distance, one);
    let mut at = [splat; 2];
    for (at, axis) in at.iter_mut().zip(axes) {
        let from = dot(simd, origin, *axis) - f32x16::splat(simd, floor.point.dot(*axis));
        *at = distance.mul_add_precise(dot(simd, direction, *axis), from);
    }
    let length = (at[0] * at[0] + at[1] * at[1]).sqrt();
    let left = exp(simd, length * f32x16::splat(simd, -1.0 / floor.fade));
    let slant = along.abs().max(f32x16::splat(simd, 1e-12)).sqrt();
    let wide = cone[1].mul_add_precise(distance, cone[0]) / slant;
    let tiles = tiles(simd, floor, (at, wide));
    // A distant floor is the haze at the horizon.
    let mut level = direction;
    for (level, up) in level.iter_mut().zip(floor.up.to_array()) {
        *level -= along * f32x16::splat(simd, up);
    }
    let square = level[0] * level[0] + level[1] * level[1] + level[2] * level[2];
    let some = square.simd_gt(f32x16::splat(simd, 1e-20));
    let scale = one / some.select(square, one).sqrt();
    let mut towards = direction;
    for (towards, level) in towards.iter_mut().zip(level) {
        *towards = (met & some).select(level * scale, *towards);
    }
    let mut light = sky(simd, sky_above, towards);
    for (light, tile) in light.iter_mut().zip(tiles) {
        *light = met.select((tile - *light).mul_add_precise(left, *light), *light);
    }
    (light, met.select(distance, far))
}

/// The light of the floor's tiles, averaged over squares of edge `wide`.
#[inline(always)]
fn tiles<S: Simd>(simd: S, floor: &Floor, (at, wide): ([f32x16<S>; 2], f32x16<S>)) -> Vec3x16<S> {
    let [half, one] = [f32x16::splat(simd, 0.5), f32x16::splat(simd, 1.0)];
    let per_tile = f32x16::splat(simd, 1.0 / floor.tile);
    let wide = (wide * per_tile).max(f32x16::splat(simd, 1e-3));
    let mut odd = one;
    let mut bare = one;
    for at in at {
        let at = at * per_tile;
        let even = covered(simd, (at * half, wide * half), 0.5);
        odd *= even + even - one;
        let joint = f32x16::splat(simd, 0.5 * JOINT);
        bare *= one - covered(simd, (at + joint, wide), JOINT);
    }
    let second = half - half * odd;
    let dim = one - f32x16::splat(simd, 0.4) * (one - bare);
    let [a, b] = floor.colors.map(|c| c.to_array());
    let mut light = [one; 3];
    for (i, light) in light.iter_mut().enumerate() {
        let [a, b] = [f32x16::splat(simd, a[i]), f32x16::splat(simd, b[i])];
        *light = (b - a).mul_add_precise(second, a) * dim;
    }
    light
}

/// The part of the stretch of length `wide` about `x` that lies within `part` behind whole numbers.
#[inline(always)]
fn covered<S: Simd>(simd: S, (x, wide): (f32x16<S>, f32x16<S>), part: f32) -> f32x16<S> {
    let part = f32x16::splat(simd, part);
    let half = wide * f32x16::splat(simd, 0.5);
    let [high, low] = [x + half, x - half];
    let [high_floor, low_floor] = [high.floor(), low.floor()];
    let whole = (high_floor - low_floor) * part;
    let over = (high - high_floor).min(part) - (low - low_floor).min(part);
    (whole + over) / wide
}

#[inline(always)]
fn sky<S: Simd>(simd: S, sky: &Sky, direction: Vec3x16<S>) -> Vec3x16<S> {
    match sky {
        Sky::Gradient { up, top, bottom } => {
            let half = f32x16::splat(simd, 0.5);
            let part = half.mul_add_precise(dot(simd, direction, *up), half);
            mixed(simd, [*bottom, *top], part)
        }
        Sky::Day { up, sun } => day(simd, direction, (*up, *sun)),
        Sky::Image(image) => {
            let mut way = [[0.0_f32; LANES]; 3];
            direction[0].store_slice(&mut way[0]);
            direction[1].store_slice(&mut way[1]);
            direction[2].store_slice(&mut way[2]);
            let mut light = [[0.0_f32; LANES]; 3];
            for lane in 0..LANES {
                let seen = image.light(Vec3::new(way[0][lane], way[1][lane], way[2][lane]));
                light[0][lane] = seen.x;
                light[1][lane] = seen.y;
                light[2][lane] = seen.z;
            }
            [load(simd, &light[0]), load(simd, &light[1]), load(simd, &light[2])]
        }
    }
}

/// From one colour to another.
#[inline(always)]
fn mixed<S: Simd>(simd: S, [from, to]: [Vec3; 2], part: f32x16<S>) -> Vec3x16<S> {
    let mut light = [part; 3];
    for (i, light) in light.iter_mut().enumerate() {
        let (from, to) = (from[i], to[i]);
        *light = part.mul_add_precise(f32x16::splat(simd, to - from), f32x16::splat(simd, from));
    }
    light
}

#[inline(always)]
fn day<S: Simd>(simd: S, direction: Vec3x16<S>, (up, sun): (Vec3, Vec3)) -> Vec3x16<S> {
    let zero = f32x16::splat(simd, 0.0);
    let height = dot(simd, direction, up);
    let above = mixed(simd, [HORIZON, ZENITH], height.max(zero).sqrt());
    let under = height * f32x16::splat(simd, -4.0);
    let below = mixed(simd, [HORIZON, BELOW], under.min(f32x16::splat(simd, 1.0)).max(zero));
    let is_above = height.simd_ge(zero);
    // The powers 24 and 1500 of what lies towards the sun, by squares.
    let toward = dot(simd, direction, sun).max(zero);
    let x2 = toward * toward;
    let x4 = x2 * x2;
    let x8 = x4 * x4;
    let x16 = x8 * x8;
    let x24 = x16 * x8;
    let x64 = x16 * x16 * x16 * x16;
    let x256 = x64 * x64 * x64 * x64;
    let x1024 = x256 * x256 * x256 * x256;
    // 1500 = 1024 + 256 + 128 + 64 + 24 + 4.
    let x1500 = x1024 * x256 * (x64 * x64) * x64 * x24 * x4;
    let shine = x1500.mul_add_precise(f32x16::splat(simd, 12.0), x24 * f32x16::splat(simd, 0.5));
    let mut light = above;
    for (i, light) in light.iter_mut().enumerate() {
        let base = is_above.select(*light, below[i]);
        *light = shine.mul_add_precise(f32x16::splat(simd, SUN[i]), base);
    }
    light
}

/// e^x for x ≤ 0, to 1e-6 of it; of less than −87 nothing is left.
///
/// > e^x = 2ⁿ·e^r with n = round(x·log₂e) and |r| ≤ ½·ln 2, where the series up to r⁶ serves.
#[inline(always)]
pub fn exp<S: Simd>(simd: S, x: f32x16<S>) -> f32x16<S> {
    let least = f32x16::splat(simd, -87.0);
    let some = x.simd_ge(least);
    let x = x.max(least);
    let n = (x * f32x16::splat(simd, std::f32::consts::LOG2_E)).round_ties_even();
    // ln 2 in two parts, the first exact in products with n.
    let r = n.mul_add_precise(f32x16::splat(simd, -0.693_359_4), x);
    let r = n.mul_add_precise(f32x16::splat(simd, 2.121_944_4e-4), r);
    let mut sum = f32x16::splat(simd, 1.0 / 720.0);
    for factor in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        sum = sum.mul_add_precise(r, f32x16::splat(simd, factor));
    }
    let exponent: i32x16<S> = n.to_int();
    let power = ((exponent + i32x16::splat(simd, 127)) << 23_u32).bitcast::<f32x16<S>>();
    some.select(sum * power, f32x16::splat(simd, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Beyond, Equirectangular};

    /// Numbers of −1 to 1.
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        }
    }

    #[test]
    fn many_rays_see_what_one_sees() {
        let mut next = numbers();
        let mut vector = || Vec3::new(next(), next(), next());
        let sights: Vec<_> = (0..1003)
            .map(|i| Sight {
                origin: 3.0 * vector(),
                direction: if i == 0 { -Vec3::Z } else { vector().normalize() },
                reach: f32::INFINITY,
                width: 0.01,
                spread: 0.001 * (i % 7) as f32,
            })
            .collect();
        let sun = Vec3::new(0.3, -0.5, 0.8).normalize();
        let pixels = (0..32).map(|i| [i as f32 / 32.0, (i % 5) as f32, 1.0]).collect();
        let skies = [
            Sky::Gradient { up: Vec3::Z, top: Vec3::ONE, bottom: Vec3::X },
            Sky::Day { up: Vec3::Z, sun },
            Sky::Image(Equirectangular {
                width: 8,
                height: 4,
                pixels,
                up: Vec3::Z,
                ahead: Vec3::X,
            }),
        ];
        let floor = Floor {
            point: Vec3::new(0.1, 0.2, -1.0),
            up: Vec3::Z,
            tile: 0.7,
            colors: [Vec3::ONE, Vec3::new(0.2, 0.4, 0.6)],
            fade: 20.0,
        };
        for (sky, floor) in skies.into_iter().flat_map(|s| [(s.clone(), None), (s, Some(floor))]) {
            let environment = Environment { sky, floor };
            for level in [Level::baseline(), Level::new()] {
                let mut seen = Vec::new();
                environment.look(level, &sights, &mut seen);
                assert_eq!(seen.len(), sights.len());
                for (sight, (light, distance)) in sights.iter().zip(seen) {
                    let Some((one, at)) = environment.meet(sight) else { panic!("always") };
                    // 24·1500 roundings in the sun, as bright as 12.
                    assert!(light.distance(one) < 2e-3, "{sight:?}: {light} {one}");
                    let same = distance == at || (distance - at).abs() < 1e-4 * at;
                    assert!(same, "{sight:?}: {distance} {at}");
                }
            }
        }
    }

    #[test]
    fn exponentials() {
        for level in [Level::baseline(), Level::new()] {
            for i in 0..2000 {
                let x = -0.05 * i as f32;
                let mut found = [0.0; LANES];
                dispatch!(level, simd => exp(simd, f32x16::splat(simd, x)).store_slice(&mut found));
                let expected = if x < -87.0 { 0.0 } else { f64::from(x).exp() };
                let error = (f64::from(found[0]) - expected).abs();
                assert!(error <= 1e-6 * expected, "{x}: {} {expected}", found[0]);
            }
        }
    }
}
