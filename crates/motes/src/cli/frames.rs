//! Which frames are rendered, and the names of their files.

use std::str::FromStr;

use super::values::whole;

/// `--frame`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Frames {
    /// `7`
    One(usize),
    /// `3..9`, both ends included; without an end, up to the last.
    Range(usize, Option<usize>),
    /// `last`
    Last,
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            whole(text)
                .map(|n| n as usize)
                .map_err(|_| "expected a frame such as 7, frames such as 0..9, all or last".into())
        };
        match (text, text.split_once("..")) {
            ("all", _) => Ok(Self::Range(0, None)),
            ("last", _) => Ok(Self::Last),
            (_, None) => number(text).map(Self::One),
            (_, Some((first, ""))) => Ok(Self::Range(number(first)?, None)),
            (_, Some((first, last))) => {
                // Rust's own spelling of both ends included is welcome.
                let (first, last) = (number(first)?, number(last.trim_start_matches('='))?);
                match first <= last {
                    true => Ok(Self::Range(first, Some(last))),
                    false => Err(format!("expected the lower frame first: {last}..{first}")),
                }
            }
        }
    }
}

/// The name of frame `frame`'s file: `{}` and `%04d` in `name` stand for its number; `None` if
/// neither is there.
pub(crate) fn numbered(name: &str, frame: usize) -> Option<String> {
    if let Some((before, after)) = name.split_once("{}") {
        return Some(format!("{before}{frame}{after}"));
    }
    name.match_indices('%').find_map(|(at, _)| {
        let (before, rest) = (&name[..at], &name[at + 1..]);
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        let after = rest[digits..].strip_prefix('d')?;
        let width: usize = if digits == 0 { 1 } else { rest[..digits].parse().ok()? };
        (width <= 20).then(|| format!("{before}{frame:0width$}{after}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_as_typed() {
        assert_eq!("7".parse(), Ok(Frames::One(7)));
        assert_eq!("3..9".parse(), Ok(Frames::Range(3, Some(9))));
        assert_eq!("3..=9".parse(), Ok(Frames::Range(3, Some(9))));
        assert_eq!("3..".parse(), Ok(Frames::Range(3, None)));
        assert_eq!("all".parse(), Ok(Frames::Range(0, None)));
        assert_eq!("last".parse(), Ok(Frames::Last));
        for bad in ["", "..", "..3", "a..b", "-1", "9..3", "1.5", "1...3"] {
            assert!(bad.parse::<Frames>().is_err(), "{bad}");
        }
    }

    #[test]
    fn files_are_numbered() {
        let of = |name: &str| numbered(name, 7);
        assert_eq!(of("out_%04d.png").as_deref(), Some("out_0007.png"));
        assert_eq!(of("out_%d.png").as_deref(), Some("out_7.png"));
        assert_eq!(of("100%/out_{}.png").as_deref(), Some("100%/out_7.png"));
        assert_eq!(of("100%/ä%3d.png").as_deref(), Some("100%/ä007.png"));
        for bad in ["out.png", "100%.png", "%s.png", "%99999999999999999999d", "%100d"] {
            assert_eq!(of(bad), None, "{bad}");
        }
    }
}
