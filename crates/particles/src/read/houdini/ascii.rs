//! Classic geometry in ASCII.

use std::path::Path;

use super::{ASCII, Attribute, Kind, Points, VERSION, named, warnings};
use crate::read::{Wanted, text};
use crate::{Place, PositionBuilder, ReadError, Result, Values};

/// Reads the points.
pub(super) fn points(path: &Path, bytes: &[u8], wanted: &Wanted) -> Result<Points> {
    let mut words = Words { path, bytes, at: ASCII.len() };
    let at = words.at;
    let version = format!("V{VERSION}");
    if words.next() != version.as_bytes() {
        return Err(
            words.error(at, &format!("expected version {version} of Houdini's classic geometry"))
        );
    }
    let count = words.labelled("NPoints")?;
    for label in ["NPrims", "NPointGroups", "NPrimGroups"] {
        words.labelled(label)?;
    }
    let attribute_count = words.labelled("NPointAttrib")?;
    for label in ["NVertexAttrib", "NPrimAttrib", "NAttrib"] {
        words.labelled(label)?;
    }
    let mut attributes = Vec::new();
    if attribute_count > 0 {
        words.expect("PointAttrib")?;
    }
    for _ in 0..attribute_count {
        attributes.push(words.attribute()?);
    }
    words.rows(count, attributes, wanted)
}

/// A place in the file. Parentheses only set the attributes apart and are taken for space.
struct Words<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

fn is_space(byte: &u8) -> bool {
    byte.is_ascii_whitespace() || matches!(byte, b'(' | b')')
}

impl<'a> Words<'a> {
    /// The next word, or what is in quotes; empty at the end.
    fn next(&mut self) -> &'a [u8] {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let space = rest.iter().take_while(|b| is_space(b)).count();
        let rest = &rest[space..];
        self.at += space;
        if let [b'"', quoted @ ..] = rest
            && let Some(length) = memchr::memchr(b'"', quoted)
        {
            self.at += length + 2;
            return &quoted[..length];
        }
        let length = rest.iter().take_while(|b| !is_space(b)).count();
        self.at += length;
        &rest[..length]
    }

    /// An error at the word after byte `at`.
    fn error(&self, at: usize, expected: &str) -> ReadError {
        let mut there = Self { at, ..*self };
        let word = there.next();
        let found = match there.at == self.bytes.len() && word.is_empty() {
            true => "the end of the file".into(),
            false => text::shown(word),
        };
        let before = self.bytes.get(..there.at).unwrap_or(self.bytes);
        let line = 1 + memchr::memchr_iter(b'\n', before).count() as u64;
        ReadError::new(self.path, Place::Line(line), format!("{expected}, found {found}"))
    }

    fn parsed<T>(&mut self, expected: &str, parse: fn(&[u8]) -> Option<T>) -> Result<T> {
        let at = self.at;
        parse(self.next()).ok_or_else(|| self.error(at, expected))
    }

    fn expect(&mut self, word: &str) -> Result<()> {
        let at = self.at;
        match self.next() == word.as_bytes() {
            true => Ok(()),
            false => Err(self.error(at, &format!("expected {word}"))),
        }
    }

    fn count(&mut self) -> Result<usize> {
        self.parsed("expected a count", |word| usize::try_from(text::integer(word)?).ok())
    }

    fn labelled(&mut self, label: &str) -> Result<usize> {
        self.expect(label)?;
        self.count()
    }

    fn string(&mut self) -> Result<String> {
        self.parsed("expected a name", |word| Some(String::from_utf8_lossy(word).into_owned()))
    }

    fn real(&mut self) -> Result<f64> {
        self.parsed("expected a number", text::real)
    }

    /// Name, components, type, and the default value or the strings.
    fn attribute(&mut self) -> Result<Attribute> {
        let at = self.at;
        let name = self.string()?;
        if self.at == self.bytes.len() {
            return Err(self.error(at, "expected an attribute"));
        }
        let components = self.count()?;
        let kind = self.parsed("expected float, int, index or vector", |word| match word {
            b"float" | b"vector" => Some(Kind::Float),
            b"int" => Some(Kind::Int),
            b"index" => Some(Kind::Index),
            _ => None,
        })?;
        let mut strings = Vec::new();
        let more = if kind == Kind::Index { self.count()? } else { components };
        for _ in 0..more {
            if kind == Kind::Index && self.at < self.bytes.len() {
                strings.push(self.string()?);
            } else {
                self.real()?;
            }
        }
        Ok(Attribute { name, components, kind, strings })
    }

    fn rows(mut self, count: usize, attributes: Vec<Attribute>, wanted: &Wanted) -> Result<Points> {
        let mut positions = PositionBuilder::default();
        let mut columns = vec![Vec::new(); attributes.len()];
        let wants: Vec<_> = attributes.iter().map(|a| a.is_wanted(wanted)).collect();
        for _ in 0..count {
            positions.push(&[[self.real()?, self.real()?, self.real()?]]);
            self.real()?;
            for ((attribute, column), wants) in attributes.iter().zip(&mut columns).zip(&wants) {
                for _ in 0..attribute.components {
                    let value = self.real()?;
                    if *wants {
                        column.push(value);
                    }
                }
            }
        }
        let warnings = warnings(&attributes);
        let kept = attributes.into_iter().zip(columns).zip(wants).filter(|(_, wants)| *wants);
        let attributes = kept.map(|((attribute, column), _)| with_values(attribute, &column));
        Ok(Points { positions, attributes: attributes.collect(), warnings })
    }
}

fn with_values(attribute: Attribute, column: &[f64]) -> (Attribute, Values) {
    let ints = column.iter().map(|v| *v as i32);
    let values = match attribute.kind {
        Kind::Float => Values::F32(column.iter().map(|v| *v as f32).collect()),
        Kind::Int => Values::I32(ints.collect()),
        Kind::Index => named(ints, &attribute.strings),
    };
    (attribute, values)
}
