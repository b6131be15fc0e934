//! Round numbers: 1, 2 or 5 times a power of ten.

/// Where the ticks of an axis stand and what is written beside them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ticks {
    /// The values, rising.
    pub values: Vec<f64>,
    /// One label for each value, with a true minus sign and as many decimals as the step needs.
    pub labels: Vec<String>,
    /// What every label is to be multiplied by, such as `×10⁻⁶`, if that spares digits.
    pub multiplier: Option<String>,
}

/// A whole number of tens to some power, exact where an f64 is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Round {
    digits: i64,
    exponent: i32,
}

/// Round ticks from `min` to `max` (in either order), about as many as fit but no more than `most`.
///
/// A range of no length has one tick; a range that is not finite has none. `most` is taken as 2 … 50.
pub fn ticks(min: f64, max: f64, most: usize) -> Ticks {
    let (low, high) = if min <= max { (min, max) } else { (max, min) };
    if !(low.is_finite() && high.is_finite()) {
        return Ticks::default();
    }
    let most = most.clamp(2, 50);
    let multiples = multiples_between(low, high, most);
    let values: Vec<f64> = multiples.iter().map(|tick| tick.value()).collect();
    if values.is_empty() || !values.is_sorted_by(|a, b| a < b) {
        return ticks_at_the_ends(low, high);
    }
    let shift = shared_exponent(low, high);
    let labels = multiples.iter().map(|tick| tick.decimal(shift)).collect();
    Ticks { values, labels, multiplier: power_of_ten(shift) }
}

/// The multiples of the smallest round step that leaves at most `most` of them; none for no length.
fn multiples_between(low: f64, high: f64, most: usize) -> Vec<Round> {
    // Halves, because the length of the whole range may be more than an f64 can hold.
    let Some(mut step) = Round::at_least((high / 2.0 - low / 2.0) / most as f64 * 2.0) else {
        return Vec::new();
    };
    loop {
        // A tick that misses the end by rounding alone belongs to the range.
        let slack = 1e-9 * (high / step.value() - low / step.value()).abs();
        let first = (low / step.value() - slack).ceil();
        let last = (high / step.value() + slack).floor();
        if first.abs().max(last.abs()) > 9e15 {
            return Vec::new();
        }
        if last - first < most as f64 {
            let tick = |n: i64| Round { digits: n * step.digits, ..step };
            return (first as i64..=last as i64).map(tick).collect();
        }
        step = step.next();
    }
}

fn ticks_at_the_ends(low: f64, high: f64) -> Ticks {
    let shift = shared_exponent(low, high);
    let values = if low == high { vec![low] } else { vec![low, high] };
    let label = |v: &f64| {
        let mantissa = format!("{:.6}", v / 10_f64.powi(shift));
        let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
        if mantissa == "-0" { "0".to_owned() } else { mantissa.replace('-', "−") }
    };
    let labels = values.iter().map(label).collect();
    Ticks { values, labels, multiplier: power_of_ten(shift) }
}

/// 0 for numbers from a thousandth to 99 999, else the multiple of three that leaves 1 … 999.
fn shared_exponent(low: f64, high: f64) -> i32 {
    let largest = low.abs().max(high.abs());
    if largest == 0.0 || (1e-3..1e5).contains(&largest) {
        return 0;
    }
    (largest.log10() / 3.0).floor().max(-102.0) as i32 * 3
}

/// `×10⁻⁶` for −6, nothing for 0.
fn power_of_ten(exponent: i32) -> Option<String> {
    let raised = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => {
            char::from_u32('⁰' as u32 + (digit as u32).wrapping_sub('0' as u32)).unwrap_or(digit)
        }
    };
    (exponent != 0)
        .then(|| format!("×10{}", exponent.to_string().chars().map(raised).collect::<String>()))
}

impl Round {
    /// The smallest 1, 2 or 5 times a power of ten that is at least `bound`.
    fn at_least(bound: f64) -> Option<Round> {
        let mut round = Round::start(bound)?;
        while round.value() < bound * (1.0 - 1e-12) {
            round = round.next();
        }
        round.value().is_finite().then_some(round)
    }

    /// The largest 1, 2 or 5 times a power of ten that is at most `bound`.
    pub(crate) fn at_most(bound: f64) -> Option<Round> {
        let mut round = Round::start(bound)?;
        while round.next().value() <= bound * (1.0 + 1e-12) {
            round = round.next();
        }
        (round.value() <= bound * (1.0 + 1e-12)).then_some(round)
    }

    fn start(bound: f64) -> Option<Round> {
        let positive = bound.is_finite() && bound > 0.0;
        positive.then(|| Round { digits: 1, exponent: bound.log10().floor() as i32 - 1 })
    }

    fn next(self) -> Round {
        match self.digits {
            1 => Round { digits: 2, ..self },
            2 => Round { digits: 5, ..self },
            _ => Round { digits: 1, exponent: self.exponent + 1 },
        }
    }

    /// The nearest f64.
    pub(crate) fn value(self) -> f64 {
        format!("{}e{}", self.digits, self.exponent).parse().unwrap_or(f64::NAN)
    }

    /// Written without an exponent from a thousandth to ten thousands, else as `2×10⁻⁹`.
    pub(crate) fn label(self) -> String {
        match (-3..5).contains(&self.exponent) {
            true => self.decimal(0),
            false => format!("{}{}", self.digits, power_of_ten(self.exponent).unwrap_or_default()),
        }
    }

    /// The number over 10^`shift`, with the decimals of its own power of ten.
    fn decimal(self, shift: i32) -> String {
        let exponent = self.exponent - shift;
        let decimals = usize::try_from(-exponent).unwrap_or(0);
        let value = Round { exponent, ..self }.value();
        format!("{value:.decimals$}").replace('-', "−")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(min: f64, max: f64, most: usize) -> String {
        let ticks = ticks(min, max, most);
        format!("{} {}", ticks.labels.join(" "), ticks.multiplier.unwrap_or_default())
    }

    #[test]
    fn ranges_as_a_hand_would_divide_them() {
        assert_eq!(labels(0.0, 1.0, 6), "0.0 0.2 0.4 0.6 0.8 1.0 ");
        assert_eq!(labels(0.0, 1.0, 11), "0.0 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0.9 1.0 ");
        assert_eq!(labels(0.0, 97.3, 5), "0 20 40 60 80 ");
        assert_eq!(labels(12.0, 338.0, 4), "100 200 300 ");
        assert_eq!(labels(1000.0, 1000.004, 5), "1000.000 1000.001 1000.002 1000.003 1000.004 ");
    }

    #[test]
    fn negative_ranges_have_a_minus_sign_and_no_negative_zero() {
        assert_eq!(labels(-0.5, 0.5, 5), "−0.4 −0.2 0.0 0.2 0.4 ");
        assert_eq!(labels(-30.0, -10.0, 3), "−30 −20 −10 ");
        assert_eq!(labels(-1e-7, 1e-7, 3), "−100 0 100 ×10⁻⁹");
    }

    #[test]
    fn either_order_gives_the_same() {
        assert_eq!(ticks(3.0, -1.0, 6), ticks(-1.0, 3.0, 6));
    }

    #[test]
    fn tiny_and_huge_numbers_share_a_power_of_ten() {
        assert_eq!(labels(0.0, 4.2e-6, 5), "0 1 2 3 4 ×10⁻⁶");
        assert_eq!(labels(0.0, 2.5e8, 6), "0 50 100 150 200 250 ×10⁶");
        assert_eq!(labels(0.0, 0.5, 6), "0.0 0.1 0.2 0.3 0.4 0.5 ");
        assert_eq!(labels(0.0, 80_000.0, 5), "0 20000 40000 60000 80000 ");
    }

    #[test]
    fn no_length_has_one_tick() {
        assert_eq!(labels(2.5, 2.5, 5), "2.5 ");
        assert_eq!(labels(0.0, -0.0, 5), "0 ");
        assert_eq!(labels(-3e9, -3e9, 5), "−3 ×10⁹");
    }

    #[test]
    fn nonsense_has_no_ticks() {
        for (min, max) in [(f64::NAN, 1.0), (0.0, f64::NAN), (f64::NEG_INFINITY, 0.0)] {
            assert_eq!(ticks(min, max, 5), Ticks::default());
        }
    }

    #[test]
    fn every_range_gets_some_ticks_but_not_too_many() {
        let ends =
            [-f64::MAX, -1e300, -7.0, -1e-310, 0.0, 5e-324, 1e-20, 1.0, 1.0 + 1e-15, f64::MAX];
        for (i, &min) in ends.iter().enumerate() {
            for &max in &ends[i..] {
                for most in [0, 2, 7, usize::MAX] {
                    let ticks = ticks(min, max, most);
                    assert!((1..=50).contains(&ticks.values.len()), "{min:e} {max:e}: {ticks:?}");
                    assert!(ticks.values.len() <= most.max(2), "{min:e} {max:e}: {ticks:?}");
                    assert_eq!(ticks.values.len(), ticks.labels.len());
                    assert!(ticks.values.is_sorted_by(|a, b| a < b));
                }
            }
        }
    }

    #[test]
    fn lengths_are_round_and_fit() {
        let label = |most: f64| Round::at_most(most).map(Round::label);
        let cases = [
            (1.0, "1"),
            (1.9999, "1"),
            (2.0, "2"),
            (49.0, "20"),
            (50.0, "50"),
            (0.07, "0.05"),
            (3e-9, "2×10⁻⁹"),
            (7e12, "5×10¹²"),
            (99_999.0, "50000"),
        ];
        for (most, expected) in cases {
            assert_eq!(label(most).as_deref(), Some(expected), "{most}");
        }
        for nonsense in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(label(nonsense), None);
        }
    }
}
