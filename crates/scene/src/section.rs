//! The parameters of sections (Chaudhari, *Real-Time Cross-Sectioning of Dynamic Particle Systems*),
//! under `section.`: planes that cut what is seen open.

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize};

use crate::color::Color;
use crate::error::{Result, SceneError};
use crate::resolve::{need, need_vector, positive};
use crate::scene::{Scene, System};
use crate::settings::{Setting, Shape, settings, words};

settings! {
    /// A section: a plane that keeps what lies on the side its normal points to; several keep what all of them keep.
    pub struct Section {
        /// Name, for messages and lists.
        name: String = String::new(),
        /// Whether it cuts.
        on: bool = true,
        /// A point of the plane, in world coordinates.
        point: DVec3 = DVec3::ZERO,
        /// Towards what is kept, in world coordinates; of any length.
        normal: DVec3 = DVec3::Z,
        /// caps (spheres and liquids are sliced, with flat caps), open (sliced, without caps) or centre (whole particles, by their centres).
        cut: Cut = Cut::Caps,
        /// Sections of one group keep what any of them keeps; empty: a group of its own.
        group: String = String::new(),
        /// Which systems it cuts, by name or number from 0; empty: all.
        system: Names = Names::default(),
        /// Which types or elements of particles it cuts; empty: all.
        types: Names = Names::default(),
        /// Colour of the caps: particle (each like its particle), hatched, a colour, or the name of a property, through the system's colour map.
        cap: CapColor = CapColor::Particle,
        /// Distance between the lines of a hatched cap, in world units; none: a hundredth of the diagonal of what is visible.
        hatch: Option<f64> = None => "1.0",
    }
}

words! {
    /// How a plane cuts.
    pub enum Cut {
        /// Whole particles, by their centres.
        Centre = "centre",
        /// Through particles, closed with flat caps.
        Caps = "caps",
        /// Through particles, left open.
        Open = "open",
    }
}

/// A list of names, or of numbers as names.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Names(pub Vec<String>);

impl Names {
    /// Whether any of them is `name`; where there are none, all are meant.
    pub fn allow(&self, name: &str) -> bool {
        self.0.is_empty() || self.0.iter().any(|n| n == name)
    }
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "names or whole numbers")]
        enum Name {
            Number(i64),
            Text(String),
        }
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a list of names or whole numbers")]
        enum Written {
            One(Name),
            Several(Vec<Name>),
        }
        let names = match Written::deserialize(deserializer)? {
            Written::One(Name::Text(text)) if text.is_empty() => Vec::new(),
            Written::One(name) => vec![name],
            Written::Several(names) => names,
        };
        let text = |name| match name {
            Name::Number(number) => number.to_string(),
            Name::Text(text) => text,
        };
        Ok(Self(names.into_iter().map(text).collect()))
    }
}

impl Setting for Names {
    fn shape() -> Shape {
        Shape::Value("a list of names or whole numbers".into())
    }
}

/// What decides the colour of a cap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum CapColor {
    /// That of its particle.
    Particle,
    /// That of its particle, under lines.
    Hatched,
    /// One colour.
    Color(Color),
    /// A property of its particle, through the system's colour map.
    Property(String),
}

impl TryFrom<String> for CapColor {
    type Error = SceneError;

    fn try_from(word: String) -> Result<Self> {
        Ok(match word.as_str() {
            "" => return Err(SceneError::value("cap", "a word", "nothing")),
            "particle" => Self::Particle,
            "hatched" => Self::Hatched,
            text if text.starts_with('#') => Self::Color(Color::parse(text)?),
            text => match Color::parse(text) {
                Ok(color) => Self::Color(color),
                Err(_) => Self::Property(word),
            },
        })
    }
}

impl From<CapColor> for String {
    fn from(color: CapColor) -> Self {
        match color {
            CapColor::Particle => "particle".into(),
            CapColor::Hatched => "hatched".into(),
            CapColor::Color(color) => color.to_string(),
            CapColor::Property(name) => name,
        }
    }
}

impl Setting for CapColor {
    fn shape() -> Shape {
        Shape::Value("particle, hatched, a colour, or the name of a property".into())
    }
}

impl Section {
    /// As TOML that may follow that of a scene.
    pub fn to_toml(&self) -> String {
        #[derive(Serialize)]
        struct Only<'a> {
            section: [&'a Section; 1],
        }
        toml::to_string(&Only { section: [self] }).unwrap_or_default()
    }

    /// Whether it cuts the system at place `index`.
    pub fn cuts(&self, index: usize, system: &System) -> bool {
        self.on && (self.system.allow(&index.to_string()) || self.system.allow(&system.name))
    }
}

impl Scene {
    /// The sections that cut the system at place `index`, each with its own place.
    pub fn sections_of(&self, index: usize) -> impl Iterator<Item = (usize, &Section)> {
        let system = self.system.get(index);
        let cuts = move |s: &Section| system.is_some_and(|system| s.cuts(index, system));
        self.section.iter().enumerate().filter(move |(_, section)| cuts(section))
    }
}

pub(crate) fn check(scene: &Scene) -> Result<()> {
    for (i, section) in scene.section.iter().enumerate() {
        let at = |name: &str| format!("section.{i}.{name}");
        let point = section.point;
        need(&at("point"), point.to_array(), point.is_finite(), "finite coordinates")?;
        need_vector(&at("normal"), Some(section.normal))?;
        let hatch = section.hatch;
        need(&at("hatch"), hatch, hatch.is_none_or(positive), "a number above 0")?;
        for name in &section.system.0 {
            let number = name.parse::<usize>().is_ok_and(|n| n < scene.system.len());
            let known = number || scene.system.iter().any(|s| s.name == *name);
            let expected = format!("names of systems, or numbers below {}", scene.system.len());
            need(&at("system"), name, known, &expected)?;
        }
        let group = |other: &&Section| {
            !section.group.is_empty() && other.group == section.group && other.on && section.on
        };
        let exact = |section: &Section| section.cut != Cut::Centre;
        let alike = scene.section.iter().filter(group).all(|o| exact(o) == exact(section));
        let expected = "the way of cutting of its group: centre for all, or for none";
        need(&at("cut"), section.cut, alike, expected)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(text: &str) -> Result<Scene> {
        let scene = Scene::from_toml(text)?;
        scene.check().map(|()| scene)
    }

    #[test]
    fn sections_are_written_as_people_write_them() {
        let text = "
            [[system]]
            name = \"protein\"
            [[system]]
            [[section]]
            point = [1, 2, 3]
            normal = [0, 0, -2]
            cut = \"open\"
            system = [\"protein\"]
            types = [1, \"Na\"]
            cap = \"#ff0000\"
            [[section]]
            system = 1
            cap = \"Mass\"
            [[section]]
            on = false
            cap = \"hatched\"";
        let scene = scene(text).unwrap();
        let [first, second, third] = &scene.section[..] else { panic!() };
        assert_eq!((first.point, first.cut), (DVec3::new(1.0, 2.0, 3.0), Cut::Open));
        assert_eq!(first.types, Names(vec!["1".into(), "Na".into()]));
        assert_eq!(first.cap, CapColor::Color(Color::hex(0xff0000)));
        assert_eq!(second.cap, CapColor::Property("Mass".into()));
        assert_eq!((&third.cap, third.on), (&CapColor::Hatched, false));
        let of = |i| scene.sections_of(i).map(|(at, _)| at).collect::<Vec<_>>();
        assert_eq!((of(0), of(1), of(2)), (vec![0], vec![1], vec![]));
        assert_eq!(Scene::from_toml(&scene.to_toml()), Ok(scene.clone()));
        assert_eq!(Scene::from_toml(&scene.to_documented_toml()), Ok(scene));
    }

    #[test]
    fn errors_name_the_field() {
        for (text, named) in [
            ("[[section]]\nnormal = [0, 0, 0]", "section.0.normal: expected a finite vector"),
            ("[[section]]\n[[section]]\nnormal = [0, nan, 0]", "section.1.normal"),
            ("[[section]]\npoint = [0, inf, 0]", "section.0.point: expected finite"),
            ("[[section]]\nhatch = 0", "section.0.hatch"),
            ("[[section]]\nsystem = [3]", "section.0.system: expected names of systems"),
            ("[[section]]\nsystem = [\"x\"]", "section.0.system"),
            ("[[section]]\ncut = \"center\"", "centre, caps, open"),
            ("[[section]]\ncap = \"#12\"", "section.0.cap"),
            ("[[section]]\nnormle = 3", "did you mean `normal`"),
            (
                "[[section]]\ngroup = \"a\"\n[[section]]\ngroup = \"a\"\ncut = \"centre\"",
                "section.0.cut: expected the way of cutting of its group",
            ),
        ] {
            let error = scene(text).unwrap_err().to_string();
            assert!(error.contains(named), "{text}: {error}");
        }
    }
}
