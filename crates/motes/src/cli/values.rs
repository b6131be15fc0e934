//! Values as they are typed.

/// Sizes that have a name.
const SIZES: &[(&str, [u32; 2])] = &[
    ("720p", [1280, 720]),
    ("1080p", [1920, 1080]),
    ("1440p", [2560, 1440]),
    ("4k", [3840, 2160]),
    ("8k", [7680, 4320]),
];

/// `1920x1080`, or a name of [`SIZES`].
pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    if let Some((_, size)) = SIZES.iter().find(|(name, _)| name.eq_ignore_ascii_case(text)) {
        return Ok(*size);
    }
    let sides = text.split_once(['x', 'X', '×']);
    let sides = sides.and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    sides.ok_or_else(|| {
        let names: Vec<_> = SIZES.iter().map(|(name, _)| *name).collect();
        format!("expected WIDTHxHEIGHT in pixels, or one of {}", names.join(", "))
    })
}

/// A whole number, 0 or more: `12`, `1e6`.
pub(crate) fn whole(text: &str) -> Result<u32, String> {
    let number = text.parse::<f64>().ok();
    number
        .filter(|n| n.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(n))
        .map(|n| n as u32)
        .ok_or_else(|| "expected a whole number such as 16 or 1e3".into())
}

/// A number of threads.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    whole(text)
        .ok()
        .filter(|n| (1..=1024).contains(n))
        .map(|n| n as usize)
        .ok_or_else(|| "expected 1 to 1024 threads".into())
}

/// A number for people: six digits, no more than it has.
pub(crate) fn short(number: f64) -> String {
    let size = number.abs();
    if number == 0.0 {
        return "0".into();
    }
    if !(1e-4..1e9).contains(&size) {
        let text = format!("{number:.5e}");
        return match text.split_once('e') {
            Some((digits, power)) if digits.contains('.') => {
                format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
            }
            _ => text,
        };
    }
    let decimals = (5 - size.log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{number:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// A count with a comma between thousands.
pub(crate) fn count(number: usize) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("640x480"), Ok([640, 480]));
        assert_eq!(size("4K"), Ok([3840, 2160]));
        for bad in ["640", "640x", "x480", "-1x2", "axb", "1x2x3", ""] {
            assert!(size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn whole_numbers() {
        assert_eq!((whole("16"), whole("1e3")), (Ok(16), Ok(1000)));
        for bad in ["-1", "1.5", "1e99", "nan", "inf", "many", ""] {
            assert!(whole(bad).is_err(), "{bad}");
        }
        assert!(threads("0").is_err() && threads("1e9").is_err());
        assert_eq!(threads("3"), Ok(3));
    }

    #[test]
    fn numbers_for_people() {
        for (number, text) in [
            (0.0, "0"),
            (f64::from(0.1f32), "0.1"),
            (-12.5, "-12.5"),
            (123456.7, "123457"),
            (1200.0, "1200"),
            (1.5e12, "1.5e12"),
            (2e-7, "2e-7"),
            (1.0 / 3.0, "0.333333"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(short(number), text);
        }
        assert_eq!([0, 999, 1000, 1234567].map(count), ["0", "999", "1,000", "1,234,567"]);
    }
}
