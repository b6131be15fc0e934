//! One colour, and sRGB to linear light and back.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::error::{Result, SceneError, hint, quoted};
use crate::settings::{Setting, Shape};

/// A colour in sRGB, each channel in 0..=1, as one picks it on a screen.
///
/// Written as `"#rrggbb"`, `"#rgb"`, a name of [`Color::NAMES`], or three numbers in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Color(pub [f64; 3]);

impl Color {
    /// The names a colour can have, with their `0xrrggbb`.
    pub const NAMES: &'static [(&'static str, u32)] = &[
        ("black", 0x000000),
        ("white", 0xffffff),
        ("gray", 0x808080),
        ("silver", 0xc0c0c0),
        ("red", 0xff0000),
        ("orange", 0xffa500),
        ("yellow", 0xffff00),
        ("green", 0x008000),
        ("cyan", 0x00ffff),
        ("teal", 0x008080),
        ("blue", 0x0000ff),
        ("navy", 0x000080),
        ("purple", 0x800080),
        ("magenta", 0xff00ff),
        ("pink", 0xffc0cb),
        ("brown", 0xa52a2a),
        ("gold", 0xffd700),
    ];

    /// From `0xrrggbb`.
    pub const fn hex(rgb: u32) -> Self {
        Self([
            ((rgb >> 16) & 255) as f64 / 255.0,
            ((rgb >> 8) & 255) as f64 / 255.0,
            (rgb & 255) as f64 / 255.0,
        ])
    }

    /// From `#rrggbb`, `#rgb` or a name.
    ///
    /// # Errors
    /// The text is none of these; the nearest name is given.
    pub fn parse(text: &str) -> Result<Self> {
        if let Some(digits) = text.strip_prefix('#') {
            let value = u32::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+'));
            return match (digits.len(), value) {
                (6, Some(v)) => Ok(Self::hex(v)),
                (3, Some(v)) => {
                    Ok(Self::hex((v >> 8) * 0x110000 + (v >> 4 & 15) * 0x1100 + (v & 15) * 0x11))
                }
                _ => Err(SceneError::value("colour", "#rrggbb or #rgb", format!("`{text}`"))),
            };
        }
        let names = Self::NAMES;
        names.iter().find(|(n, _)| n.eq_ignore_ascii_case(text)).map(|n| Self::hex(n.1)).ok_or_else(
            || SceneError::UnknownName {
                kind: "colour",
                name: quoted(text),
                hint: hint(text, names.iter().map(|n| n.0)),
            },
        )
    }

    /// In linear light.
    pub fn linear(self) -> [f32; 3] {
        self.0.map(|c| linear_from_srgb(c as f32))
    }

    /// As sRGB f32.
    pub fn srgb(self) -> [f32; 3] {
        self.0.map(|c| c as f32)
    }
}

impl fmt::Display for Color {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0.map(|c| (c * 255.0).round() as u8);
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

impl Serialize for Color {
    /// As `#rrggbb` where that is exact, else as three numbers.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let text = self.to_string();
        match Self::parse(&text) {
            Ok(same) if same == *self => text.serialize(serializer),
            _ => self.0.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a colour: \"#rrggbb\", a name, or [r, g, b] in 0 to 1")]
        enum Written {
            Text(String),
            Channels([f64; 3]),
        }
        match Written::deserialize(deserializer)? {
            Written::Text(text) => Self::parse(&text).map_err(de::Error::custom),
            Written::Channels(c) if c.iter().all(|c| (0.0..=1.0).contains(c)) => Ok(Self(c)),
            Written::Channels(c) => {
                Err(de::Error::custom(format!("expected channels in 0 to 1, found {c:?}")))
            }
        }
    }
}

impl Setting for Color {
    fn shape() -> Shape {
        Shape::Value("a colour: \"#rrggbb\", a name, or [r, g, b] in 0 to 1".into())
    }
}

/// Linear light from an sRGB channel (IEC 61966-2-1, piecewise), both in 0..=1.
pub fn linear_from_srgb(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// An sRGB channel from linear light (IEC 61966-2-1, piecewise), both in 0..=1.
pub fn srgb_from_linear(c: f32) -> f32 {
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_known_answers() {
        // Middle grey 188/255 is close to half the light; the ends are exact.
        assert!((linear_from_srgb(188.0 / 255.0) - 0.5).abs() < 3e-3);
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
        assert_eq!([linear_from_srgb(0.0), srgb_from_linear(0.0)], [0.0, 0.0]);
        assert_eq!(linear_from_srgb(1.0), 1.0);
        for i in 0..=255 {
            let c = i as f32 / 255.0;
            assert!((srgb_from_linear(linear_from_srgb(c)) - c).abs() < 1e-6, "{c}");
        }
    }

    #[test]
    fn spellings() {
        assert_eq!(Color::parse("#ff8000"), Ok(Color::hex(0xff8000)));
        assert_eq!(Color::parse("#f80"), Ok(Color::hex(0xff8800)));
        assert_eq!(Color::parse("White"), Ok(Color([1.0; 3])));
        assert_eq!(Color::hex(0x0a0b0c).to_string(), "#0a0b0c");
        for bad in ["#ff", "#gg0000", "#+12345", "#ÿÿÿ", ""] {
            assert!(Color::parse(bad).is_err(), "{bad}");
        }
        let error = Color::parse("purpel").unwrap_err().to_string();
        assert!(error.contains("did you mean `purple`"), "{error}");
    }
}
