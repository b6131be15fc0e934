//! Colour maps: from a number in 0..=1 to a colour; and palettes: from a count to a distinct colour.

use std::fmt;

use colorous::Gradient;

use crate::color::{Color, linear_from_srgb};
use crate::color_points::{POINTS, Points};
use crate::error::{Result, SceneError, hint, quoted};
use crate::scene::Palette;

/// The maps from `colorous`: viridis and its family, d3's cyclic sinebow, and ColorBrewer's, smoothed by
/// splines; each in the order of its name, so that rdbu has red at the lower end.
const GRADIENTS: &[(&str, Gradient)] = &[
    ("viridis", colorous::VIRIDIS),
    ("magma", colorous::MAGMA),
    ("inferno", colorous::INFERNO),
    ("plasma", colorous::PLASMA),
    ("cubehelix", colorous::CUBEHELIX),
    ("sinebow", colorous::SINEBOW),
    ("spectral", colorous::SPECTRAL),
    ("rdbu", colorous::RED_BLUE),
    ("rdylbu", colorous::RED_YELLOW_BLUE),
    ("brbg", colorous::BROWN_GREEN),
    ("piyg", colorous::PINK_GREEN),
    ("ylgnbu", colorous::YELLOW_GREEN_BLUE),
    ("ylorrd", colorous::YELLOW_ORANGE_RED),
    ("blues", colorous::BLUES),
    ("greens", colorous::GREENS),
    ("oranges", colorous::ORANGES),
    ("purples", colorous::PURPLES),
    ("reds", colorous::REDS),
];

/// Other names that people use.
const ALIASES: &[(&str, &str)] = &[
    ("grey", "gray"),
    ("greys", "gray"),
    ("grayscale", "gray"),
    ("blackbody", "hot"),
    ("cool-warm", "coolwarm"),
    ("cool to warm", "coolwarm"),
    ("blue-white-red", "bwr"),
    ("phase", "romaO"),
    ("cyclic", "romaO"),
];

/// A colour map: 256 colours, with straight lines in sRGB between them.
///
/// # Invariants
/// Each channel of `srgb` is in 0..=1.
#[derive(Clone, PartialEq)]
pub struct ColorMap {
    name: &'static str,
    srgb: Box<[[f32; 3]; 256]>,
}

impl ColorMap {
    /// Every name of a map, without the other names and the `_r` for a map backwards.
    pub fn names() -> impl Iterator<Item = &'static str> {
        GRADIENTS.iter().map(|g| g.0).chain(POINTS.iter().map(|p| p.0))
    }

    /// The map of this name, in any case; with `_r` at its end, backwards.
    ///
    /// # Errors
    /// There is no such map; the nearest name is given.
    pub fn by_name(name: &str) -> Result<Self> {
        let lower = name.trim().to_lowercase();
        let (base, reverse) = match lower.strip_suffix("_r") {
            Some(base) => (base, true),
            None => (lower.as_str(), false),
        };
        let base = ALIASES.iter().find(|a| a.0 == base).map_or(base, |a| a.1);
        let gradient = GRADIENTS.iter().find(|g| g.0.eq_ignore_ascii_case(base));
        let points = POINTS.iter().find(|p| p.0.eq_ignore_ascii_case(base));
        let map = match (gradient, points) {
            (Some((name, gradient)), _) => Self::from_gradient(name, gradient),
            (None, Some(points)) => Self::from_points(points),
            (None, None) => {
                return Err(SceneError::UnknownName {
                    kind: "colour map",
                    name: quoted(name),
                    hint: hint(base, Self::names()),
                });
            }
        };
        Ok(if reverse { map.reversed() } else { map })
    }

    fn from_gradient(name: &'static str, gradient: &Gradient) -> Self {
        let srgb = Box::new(std::array::from_fn(|i| {
            let c = gradient.eval_rational(i, 256);
            [c.r, c.g, c.b].map(|v| f32::from(v) / 255.0)
        }));
        Self { name, srgb }
    }

    fn from_points(&(name, points): &Points) -> Self {
        let place = |p: u32| (p >> 24) as f32;
        let color = |p: u32| Color::hex(p & 0xff_ffff).srgb();
        let srgb = Box::new(std::array::from_fn(|i| {
            let at = i as f32;
            let segment = points.windows(2).find(|w| at <= place(w[1]));
            segment.map_or([0.0; 3], |w| {
                let t = (at - place(w[0])) / (place(w[1]) - place(w[0]));
                mix(color(w[0]), color(w[1]), t)
            })
        }));
        Self { name, srgb }
    }

    /// The same colours from the other end.
    pub fn reversed(mut self) -> Self {
        self.srgb.reverse();
        self
    }

    /// The name, as in [`Self::names`].
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The sRGB colour at `t` in 0..=1; beyond, that of the end; NaN, that of the lower end.
    pub fn sample(&self, t: f32) -> [f32; 3] {
        let at = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) * 255.0 };
        let i = (at as usize).min(254);
        mix(self.srgb[i], self.srgb[i + 1], at - i as f32)
    }

    /// The 256 colours in linear light, from `t` = 0 to 1, for kernels.
    pub fn linear_table(&self) -> [[f32; 3]; 256] {
        self.srgb.map(|c| c.map(linear_from_srgb))
    }
}

impl fmt::Debug for ColorMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ColorMap").field("name", &self.name).finish_non_exhaustive()
    }
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] * (1.0 - t) + b[i] * t)
}

/// Tableau 10.
const TABLEAU: [u32; 10] = [
    0x4e79a7, 0xf28e2c, 0xe15759, 0x76b7b2, 0x59a14f, 0xedc949, 0xaf7aa1, 0xff9da7, 0x9c755f,
    0xbab0ab,
];

/// Okabe and Ito 2008, distinct for every kind of colour vision.
const OKABE_ITO: [u32; 8] =
    [0xe69f00, 0x56b4e9, 0x009e73, 0xf0e442, 0x0072b2, 0xd55e00, 0xcc79a7, 0x4d4d4d];

impl Palette {
    /// The colour of the `index`-th kind; after the last colour the palette starts again.
    pub fn color(self, index: usize) -> Color {
        Color::hex(match self {
            Self::Tableau => TABLEAU[index % TABLEAU.len()],
            Self::OkabeIto => OKABE_ITO[index % OKABE_ITO.len()],
        })
    }

    /// How many distinct colours there are.
    pub fn count(self) -> usize {
        match self {
            Self::Tableau => TABLEAU.len(),
            Self::OkabeIto => OKABE_ITO.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The colour as 0xrrggbb.
    fn at(name: &str, t: f32) -> u32 {
        let [r, g, b] =
            ColorMap::by_name(name).unwrap().sample(t).map(|c| (c * 255.0).round() as u32);
        r << 16 | g << 8 | b
    }

    #[test]
    fn published_colors() {
        // The ends, and one colour within, of the published tables.
        for (name, ends) in [
            ("viridis", [0x440154, 0xfde725]),
            ("magma", [0x000004, 0xfcfdbf]),
            ("inferno", [0x000004, 0xfcffa4]),
            ("plasma", [0x0d0887, 0xf0f921]),
            ("cividis", [0x00224e, 0xfee838]),
            ("turbo", [0x30123b, 0x7a0403]),
            ("coolwarm", [0x3b4cc0, 0xb40426]),
            ("batlow", [0x011959, 0xfaccfa]),
            ("gray", [0x000000, 0xffffff]),
            ("jet", [0x000080, 0x800000]),
        ] {
            assert_eq!([at(name, 0.0), at(name, 1.0)], ends, "{name}");
        }
        // The published (0.1276, 0.5669, 0.5506), of which the table cuts the fractions of 1/255.
        assert_eq!(at("viridis", 128.0 / 255.0), 0x20918c);
        assert_eq!(at("gray", 0.2), 0x333333);
        assert_eq!(at("bwr", 128.0 / 255.0), 0xffffff);
    }

    #[test]
    fn cold_is_low() {
        for name in
            ["coolwarm", "vik", "rdbu_r", "rdylbu_r", "spectral_r", "bwr", "turbo", "rainbow"]
        {
            let map = ColorMap::by_name(name).unwrap();
            let [low, high] = [map.sample(0.1), map.sample(0.9)];
            assert!(low[2] > low[0] && high[0] > high[2], "{name}: {low:?} {high:?}");
        }
    }

    #[test]
    fn every_map_is_whole() {
        for name in ColorMap::names() {
            let map = ColorMap::by_name(name).unwrap();
            assert_eq!(map.name(), name);
            for w in map.srgb.windows(2) {
                let step = (0..3).map(|i| (w[0][i] - w[1][i]).abs()).fold(0.0, f32::max);
                assert!(step < 0.04, "{name} jumps by {step}");
                assert!(w[1].iter().all(|c| (0.0..=1.0).contains(c)), "{name}");
            }
        }
        for &(name, points) in POINTS {
            assert_eq!((points[0] >> 24, points[points.len() - 1] >> 24), (0, 255), "{name}");
            assert!(points.windows(2).all(|w| w[0] >> 24 < w[1] >> 24), "{name}");
        }
    }

    #[test]
    fn cyclic_maps_close() {
        for name in ["twilight", "romaO", "vikO", "hsv", "sinebow", "phase"] {
            let map = ColorMap::by_name(name).unwrap();
            let (a, b) = (map.sample(0.0), map.sample(1.0));
            assert!((0..3).all(|i| (a[i] - b[i]).abs() < 0.03), "{name}: {a:?} {b:?}");
        }
    }

    #[test]
    fn names_are_found() {
        assert_eq!(ColorMap::by_name("Viridis").unwrap().name(), "viridis");
        assert_eq!(ColorMap::by_name("RomaO_r").unwrap().name(), "romaO");
        assert_eq!(at("grey_r", 0.0), 0xffffff);
        let error = ColorMap::by_name("virdis").unwrap_err().to_string();
        assert_eq!(error, "no colour map `virdis`; did you mean `viridis`?");
    }

    #[test]
    fn samples_beyond_the_ends() {
        let map = ColorMap::by_name("viridis").unwrap();
        assert_eq!(map.sample(-1.0), map.sample(0.0));
        assert_eq!(map.sample(f32::NAN), map.sample(0.0));
        assert_eq!(map.sample(f32::INFINITY), map.srgb[255]);
        assert_eq!(map.linear_table()[255], map.srgb[255].map(linear_from_srgb));
    }

    #[test]
    fn palettes_are_distinct_and_go_round() {
        for palette in [Palette::Tableau, Palette::OkabeIto] {
            let colors: Vec<_> = (0..palette.count()).map(|i| palette.color(i)).collect();
            for (i, a) in colors.iter().enumerate() {
                for b in &colors[..i] {
                    let far = (0..3).map(|k| (a.0[k] - b.0[k]).abs()).sum::<f64>();
                    assert!(far > 0.15, "{palette:?}: {a} {b}");
                }
            }
            assert_eq!(palette.color(palette.count()), palette.color(0));
        }
    }
}
