//! Numbers that are the same bits everywhere: only additions, multiplications, divisions.

use std::f64::consts::{LN_2, PI, SQRT_2};

/// The `i`-th output of splitmix64 (Steele, Lea & Flood 2014) started at `seed`.
pub(super) fn bits(seed: u64, i: u64) -> u64 {
    let z = seed.wrapping_add(i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Uniform in [0, 1), a multiple of 2⁻²⁴ and so exact as f32.
pub(super) fn uniform(seed: u64, i: u64) -> f64 {
    (bits(seed, i) >> 40) as f64 / (1u64 << 24) as f64
}

/// Nearly normal with mean 0 and variance 1, within ±3.47: the sum of four uniform 16-bit numbers.
pub(super) fn normal(seed: u64, i: u64) -> f64 {
    let bits = bits(seed, i);
    let sum: u64 = [0, 16, 32, 48].map(|shift| (bits >> shift) & 0xffff).iter().sum();
    (sum as f64 - 2.0 * 65535.0) * (1.732_050_807_568_877_2 / 65536.0)
}

/// Exponential with mean 1.
pub(super) fn exponential(seed: u64, i: u64) -> f64 {
    -logarithm(uniform(seed, i) + 0.5 / (1u64 << 24) as f64)
}

/// sin x for |x| below some thousands, to 1e-11.
pub(super) fn sine(x: f64) -> f64 {
    let half_turns = (x * (1.0 / PI) + if x < 0.0 { -0.5 } else { 0.5 }) as i64;
    let r = x - half_turns as f64 * PI;
    let square = r * r;
    // r − r³/3! + r⁵/5! − … by Horner's rule: each term over the one before it.
    const RATIOS: [f64; 7] =
        [1.0 / 210.0, 1.0 / 156.0, 1.0 / 110.0, 1.0 / 72.0, 1.0 / 42.0, 1.0 / 20.0, 1.0 / 6.0];
    let series = RATIOS.iter().fold(1.0, |inner, ratio| 1.0 - square * ratio * inner);
    if half_turns % 2 == 0 { r * series } else { -r * series }
}

/// cos x, as [`sine`].
pub(super) fn cosine(x: f64) -> f64 {
    sine(x + 0.5 * PI)
}

/// ln x for normal positive x, to 1e-12: 2 artanh((m − 1)/(m + 1)) of the mantissa m.
fn logarithm(x: f64) -> f64 {
    let exponent = ((x.to_bits() >> 52) & 0x7ff) as f64 - 1023.0;
    let mantissa = f64::from_bits((x.to_bits() & ((1 << 52) - 1)) | (1023 << 52));
    let (mantissa, exponent) =
        if mantissa > SQRT_2 { (0.5 * mantissa, exponent + 1.0) } else { (mantissa, exponent) };
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let series = (0..=7).rev().fold(0.0, |sum, n| sum * s * s + 1.0 / f64::from(2 * n + 1));
    2.0 * s * series + exponent * LN_2
}

/// ∛x for positive x by Newton's method, whose steps from above shrink by a third until it is close.
pub(super) fn cube_root(x: f64) -> f64 {
    (0..100).fold(x.max(1.0), |root, _| (2.0 * root + x / (root * root)) / 3.0)
}

/// The place of `i` in a permutation of 0 … `count` − 1 chosen by `seed`: a Feistel network on the
/// next even number of bits, walked until it is back in range.
pub(super) fn permuted(seed: u64, count: u64, i: u64) -> u64 {
    let half_bits = (64 - count.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1u64 << half_bits) - 1;
    let mut value = i;
    loop {
        let (mut left, mut right) = (value >> half_bits, value & mask);
        for round in 0..4 {
            let mixed = left ^ (bits(seed, (round << 32) | right) & mask);
            (left, right) = (right, mixed);
        }
        value = (left << half_bits) | right;
        if value < count {
            return value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitmix64_gives_its_reference_values() {
        let expected = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!([0, 1, 2, 3, 4].map(|i| bits(1_234_567, i)), expected);
    }

    #[test]
    fn functions_agree_with_the_platform() {
        for i in 1..2000 {
            let x = f64::from(i) * 0.0371;
            assert!((sine(x) - x.sin()).abs() < 1e-11, "sin {x}");
            assert!((cosine(-x) - x.cos()).abs() < 1e-11, "cos {x}");
            assert!((logarithm(x * 1e-3) - (x * 1e-3).ln()).abs() < 1e-12, "ln {x}");
            for v in [x, x * 1e9, x * 1e-12] {
                assert!((cube_root(v) / v.cbrt() - 1.0).abs() < 1e-14, "cbrt {v}");
            }
        }
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        let n = 200_000;
        let moment = |sample: fn(u64, u64) -> f64, power: i32| {
            (0..n).map(|i| sample(5, i).powi(power)).sum::<f64>() / n as f64
        };
        // Four standard errors of 200 000 samples.
        assert!((moment(uniform, 1) - 0.5).abs() < 0.0026);
        assert!(moment(normal, 1).abs() < 0.009 && (moment(normal, 2) - 1.0).abs() < 0.013);
        assert!((moment(exponential, 1) - 1.0).abs() < 0.009);
        assert!((moment(exponential, 2) - 2.0).abs() < 0.04);
    }

    #[test]
    fn a_permutation_gives_every_place_once() {
        for count in [1, 2, 3, 4, 5, 17, 1000, 4097] {
            let mut places: Vec<_> = (0..count).map(|i| permuted(9, count, i)).collect();
            assert!(count < 1000 || places.iter().zip(0..).filter(|(p, i)| *p == i).count() < 10);
            places.sort_unstable();
            assert!(places.iter().copied().eq(0..count), "{count}");
        }
    }
}
