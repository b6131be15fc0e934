//! Houdini's classic geometry, version 5: binary (`.bgeo`, big endian) and ASCII (`.geo`).
//!
//! A header of counts, the definitions of the points' attributes, then for each point x, y, z, w and
//! the attributes' values. Groups, primitives and other attributes follow and are not read. An
//! `index` attribute is a number into a list of strings, −1 for none. The formats are described in
//! the Houdini 11 documentation, "Houdini .geo format" and ".bgeo format".
//!
//! The newer geometry (Houdini 12 and later, JSON in ASCII or binary) is recognised and refused.

mod ascii;
mod binary;

use std::path::Path;

use super::dictionary::Dictionary;
use super::whole::WholeFile;
use super::{Confidence, Format, Head, Input, MOST_COMPONENTS, Reader, Wanted, names};
use crate::{Column, Particles, Place, PositionBuilder, Radius, ReadError, Result, Values};

/// The first bytes of classic binary geometry.
const BINARY: &[u8] = b"BgeoV";
/// The first bytes of classic ASCII geometry.
const ASCII: &[u8] = b"PGEOMETRY";
/// The first bytes of the newer binary geometry.
const JSON_BINARY: &[u8] = b"\x7fNSJb";
/// The version that is read.
const VERSION: i32 = 5;
/// What Houdini's users call the standard properties.
const SPELLINGS: [(&str, &str, usize); 6] = [
    ("v", names::VELOCITY, 3),
    ("N", names::NORMAL, 3),
    ("Cd", names::COLOR, 3),
    ("w", names::ANGULAR_VELOCITY, 3),
    ("orient", names::ORIENTATION, 4),
    ("pscale", names::RADIUS, 1),
];

/// Houdini's classic geometry.
pub(super) struct Houdini;

impl Format for Houdini {
    fn name(&self) -> &'static str {
        "Houdini geometry"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        let known = [BINARY, ASCII, JSON_BINARY].iter().any(|magic| head.bytes.starts_with(magic));
        match known || is_json(head) {
            true => Confidence::Certain,
            false => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        let head = input.head();
        if is_json(&head) || head.bytes.starts_with(JSON_BINARY) {
            let message = "this is Houdini's newer geometry (JSON, since Houdini 12); \
                           only the classic one, version 5, is read";
            return Err(ReadError::new(input.path(), Place::Whole, message));
        }
        Ok(Box::new(WholeFile::new(input, parse)))
    }
}

/// The newer geometry in ASCII.
fn is_json(head: &Head<'_>) -> bool {
    let start = &head.bytes[..head.bytes.len().min(200)];
    let trimmed = start.trim_ascii_start();
    trimmed.starts_with(b"[") && memchr::memmem::find(trimmed, b"\"fileversion\"").is_some()
}

fn parse(path: &Path, bytes: &[u8], wanted: &Wanted) -> Result<(Particles, Vec<String>)> {
    let points = match bytes.starts_with(BINARY) {
        true => binary::points(path, bytes, wanted)?,
        false => ascii::points(path, bytes, wanted)?,
    };
    Ok(points.into_particles())
}

/// The types of attributes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Float,
    Int,
    Index,
}

/// The definition of an attribute of the points.
#[derive(Clone, Debug)]
struct Attribute {
    name: String,
    components: usize,
    kind: Kind,
    /// What an index stands for.
    strings: Vec<String>,
}

impl Attribute {
    /// The standard name, or the file's.
    fn column_name(&self) -> &str {
        let houdini = SPELLINGS
            .iter()
            .find(|(own, _, components)| *own == self.name && *components == self.components)
            .map(|(_, standard, _)| *standard);
        houdini
            .or_else(|| names::standard_of(&self.name, self.components))
            .unwrap_or(self.name.as_str())
    }

    fn is_wanted(&self, wanted: &Wanted) -> bool {
        let name = self.column_name();
        name == names::RADIUS
            || (1..=MOST_COMPONENTS).contains(&self.components) && wanted.wants(name)
    }
}

/// Everything about the points that was read.
struct Points {
    positions: PositionBuilder,
    /// Attributes that are wanted, with their values.
    attributes: Vec<(Attribute, Values)>,
    warnings: Vec<String>,
}

impl Points {
    fn into_particles(self) -> (Particles, Vec<String>) {
        let (origin, positions) = self.positions.finish();
        let mut particles = Particles { origin, positions, ..Particles::default() };
        for (attribute, values) in self.attributes {
            let name = attribute.column_name();
            if name == names::RADIUS && particles.radius == Radius::Unknown {
                let radius = |i| values.number(i) as f32;
                particles.radius = Radius::Each((0..values.len()).map(radius).collect());
                continue;
            }
            let taken = particles.column(name).is_some();
            let name = if taken { &attribute.name } else { name };
            particles.columns.push(Column::new(name, attribute.components, values));
        }
        particles.columns = names::joined(particles.columns);
        (particles, self.warnings)
    }
}

/// Indices as names, in order of first appearance; −1, and an index without a string, is no name.
fn named(indices: impl Iterator<Item = i32>, strings: &[String]) -> Values {
    let mut dictionary = Dictionary::default();
    for index in indices {
        let name = usize::try_from(index).ok().and_then(|i| strings.get(i));
        dictionary.push(name.map_or(b"", |name| name.as_bytes()));
    }
    dictionary.into_values()
}

/// Which attributes have more components than a column may have.
fn warnings(attributes: &[Attribute]) -> Vec<String> {
    let too_wide = attributes.iter().filter(|a| a.components > MOST_COMPONENTS);
    too_wide
        .map(|a| {
            let (name, components) = (&a.name, a.components);
            format!("{name} has {components} components, more than {MOST_COMPONENTS}: left out")
        })
        .collect()
}

#[cfg(test)]
mod tests;
