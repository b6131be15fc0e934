//! The fields of a line: numbers and words in fixed columns.

use crate::read::text::{integer, shown};

/// A field without the blanks around it; these are few.
pub(super) fn trim(mut field: &[u8]) -> &[u8] {
    while let [b' ' | b'\t' | b'\r' | b'\n', rest @ ..] = field {
        field = rest;
    }
    while let [rest @ .., b' ' | b'\t' | b'\r' | b'\n'] = field {
        field = rest;
    }
    field
}

/// Powers of ten that divide an integer below 2⁵³ with one rounding.
const TENS: [f64; 9] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8];

/// A real number, at once where it is a few digits and a point.
fn decimal(field: &[u8]) -> Option<f64> {
    let (negative, digits) = match field {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    let (mut value, mut places, mut seen, mut point) = (0u32, 0, 0, 0);
    for byte in digits {
        match byte {
            b'0'..=b'9' if seen < 8 => {
                value = value * 10 + u32::from(byte - b'0');
                places += point;
                seen += 1;
            }
            b'.' if point == 0 => point = 1,
            _ => return fast_float2::parse(field).ok(),
        }
    }
    let magnitude = f64::from(value) / TENS[places];
    match seen {
        0 => None,
        _ if negative => Some(-magnitude),
        _ => Some(magnitude),
    }
}

/// The three coordinates in columns 31–54, each of eight columns.
pub(super) fn numbers(place: &[u8]) -> Option<[f64; 3]> {
    let mut values = [0.0; 3];
    for (value, field) in values.iter_mut().zip(place.chunks_exact(8)) {
        *value = decimal(trim(field))?;
    }
    Some(values)
}

/// A number that the file's columns were too narrow for.
pub(super) const OVERFLOWED: i64 = i64::MIN;

/// Columns `first` to `last` of a line, counted from 1; what is not there is blank.
pub(super) fn columns(line: &[u8], first: usize, last: usize) -> &[u8] {
    line.get(first - 1..last.min(line.len())).unwrap_or_default()
}

/// A serial or residue number: decimal; `A000` after `9999` (hybrid-36); hexadecimal; or stars.
pub(super) fn number(field: &[u8]) -> Option<i64> {
    let field = trim(field);
    if field.is_empty() || field.iter().all(|b| *b == b'*') {
        return Some(OVERFLOWED);
    }
    integer(field)
        .or_else(|| hybrid36(field))
        .or_else(|| i64::from_str_radix(std::str::from_utf8(field).ok()?, 16).ok())
}

/// Numbers beyond the decimals of a field's width, which must be full (Grosse-Kunstleve, *hybrid-36*):
/// base 36 in capitals from `A0…`, then in small letters from `a0…`.
fn hybrid36(field: &[u8]) -> Option<i64> {
    let width = u32::try_from(field.len()).ok().filter(|w| matches!(w, 4 | 5))?;
    let is_small = match field[0] {
        b'A'..=b'Z' => false,
        b'a'..=b'z' => true,
        _ => return None,
    };
    let value = field.iter().try_fold(0, |value, byte| {
        let digit = match byte {
            b'0'..=b'9' => byte - b'0',
            b'A'..=b'Z' if !is_small => byte - b'A' + 10,
            b'a'..=b'z' if is_small => byte - b'a' + 10,
            _ => return None,
        };
        Some(value * 36 + i64::from(digit))
    })?;
    let block = 36i64.pow(width - 1);
    Some(value + 10i64.pow(width) + if is_small { 16 * block } else { -10 * block })
}

/// A real number, or `default` where the columns are blank or full of stars.
pub(super) fn real(line: &[u8], first: usize, last: usize, default: f64) -> Result<f64, String> {
    let field = trim(columns(line, first, last));
    if field.iter().all(|b| *b == b'*') {
        return Ok(default);
    }
    decimal(field).ok_or_else(|| {
        format!("expected a number in columns {first}–{last}, found {}", shown(field))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hybrid_36_goes_on_where_decimals_end() {
        let known = [
            (&b"99999"[..], 99_999),
            (b"A0000", 100_000),
            (b"A000Z", 100_035),
            (b"ZZZZZ", 43_770_015),
            (b"a0000", 43_770_016),
            (b"zzzzz", 87_440_031),
            (b"A000", 10_000),
            (b"zzzz", 2_436_111),
            (b"-999", -999),
            (b"186a0", 100_000),
            (b"*****", OVERFLOWED),
        ];
        for (field, value) in known {
            assert_eq!(number(field), Some(value), "{}", shown(field));
        }
    }

    #[test]
    fn decimals_are_the_nearest_doubles() {
        for text in
            ["-0.001", "1234.567", "99999999", ".5", "5.", "-7", "0.1", "1e3", "123456789.25"]
        {
            assert_eq!(decimal(text.as_bytes()), text.parse().ok(), "{text}");
        }
        assert!(decimal(b"-0.000").is_some_and(f64::is_sign_negative));
        for text in ["", "-", ".", "1.2.3", "1-2", "x", "--1"] {
            assert_eq!(decimal(text.as_bytes()), None, "{text}");
        }
    }
}
