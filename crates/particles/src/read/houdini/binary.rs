//! Classic geometry in binary.

use std::path::Path;

use rayon::prelude::*;

use super::{Attribute, BINARY, Kind, Points, VERSION, named, warnings};
use crate::read::Wanted;
use crate::{Place, PositionBuilder, ReadError, Result, Values};

/// Reads the points.
pub(super) fn points(path: &Path, bytes: &[u8], wanted: &Wanted) -> Result<Points> {
    let mut fields = Fields { path, bytes, at: BINARY.len() };
    let version = fields.int()?;
    if version != VERSION {
        let message =
            format!("expected version {VERSION} of Houdini's classic geometry, found {version}");
        return Err(ReadError::new(path, Place::Byte(BINARY.len() as u64), message));
    }
    let count = fields.count()?;
    // Primitives, groups of points, groups of primitives.
    for _ in 0..3 {
        fields.count()?;
    }
    let attribute_count = fields.count()?;
    // Attributes of vertices, of primitives, of the whole.
    for _ in 0..3 {
        fields.count()?;
    }
    let mut attributes = Vec::new();
    for _ in 0..attribute_count {
        attributes.push(fields.attribute()?);
    }
    let rows = fields.rows(count, &attributes)?;
    Ok(read_rows(&rows, attributes, wanted))
}

/// The points' bytes, and how many each takes.
struct Rows<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl Rows<'_> {
    /// Words `first` to `first + count` of each row.
    fn words<T: Send>(&self, first: usize, count: usize, from: fn([u8; 4]) -> T) -> Vec<T> {
        let rows = self.bytes.par_chunks_exact(self.stride);
        let parts = rows.flat_map_iter(|row| {
            let words = row.as_chunks::<4>().0;
            words.iter().skip(first).take(count).map(|word| from(*word))
        });
        parts.collect()
    }
}

fn read_rows(rows: &Rows<'_>, attributes: Vec<Attribute>, wanted: &Wanted) -> Points {
    let mut positions = PositionBuilder::default();
    for block in rows.bytes.chunks(rows.stride.saturating_mul(1 << 16)) {
        let row = |row: &[u8]| {
            let words = row.as_chunks::<4>().0;
            let word = |i: usize| words.get(i).map_or(f32::NAN, |w| f32::from_be_bytes(*w));
            [0, 1, 2].map(|i| f64::from(word(i)))
        };
        positions.push(&block.chunks_exact(rows.stride).map(row).collect::<Vec<_>>());
    }
    let warnings = warnings(&attributes);
    // x, y, z, w come first.
    let mut first = 4;
    let mut kept = Vec::new();
    for attribute in attributes {
        let components = attribute.components;
        if attribute.is_wanted(wanted) {
            let ints = || rows.words(first, components, i32::from_be_bytes);
            let values = match attribute.kind {
                Kind::Float => Values::F32(rows.words(first, components, f32::from_be_bytes)),
                Kind::Int => Values::I32(ints()),
                Kind::Index => named(ints().into_iter(), &attribute.strings),
            };
            kept.push((attribute, values));
        }
        first += components;
    }
    Points { positions, attributes: kept, warnings }
}

/// A place in the file.
struct Fields<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Fields<'a> {
    fn error(&self, at: usize, message: String) -> ReadError {
        ReadError::new(self.path, Place::Byte(at as u64), message)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8]> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(taken) = rest.get(..length) else {
            let message = format!("expected {length} bytes more, but {} are left", rest.len());
            return Err(self.error(self.at, message));
        };
        self.at += length;
        Ok(taken)
    }

    fn int(&mut self) -> Result<i32> {
        let bytes = self.take(4)?.first_chunk().copied().unwrap_or_default();
        Ok(i32::from_be_bytes(bytes))
    }

    fn short(&mut self) -> Result<usize> {
        let bytes = self.take(2)?.first_chunk().copied().unwrap_or_default();
        Ok(usize::from(u16::from_be_bytes(bytes)))
    }

    fn count(&mut self) -> Result<usize> {
        let at = self.at;
        let count = self.int()?;
        usize::try_from(count)
            .map_err(|_| self.error(at, format!("expected a count, found {count}")))
    }

    fn string(&mut self) -> Result<String> {
        let length = self.short()?;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    /// Name, components, type, and the default value or the strings.
    fn attribute(&mut self) -> Result<Attribute> {
        let name = self.string()?;
        let components = self.short()?;
        let at = self.at;
        let kind = match self.int()? {
            // A vector is floats that turn with the geometry.
            0 | 5 => Kind::Float,
            1 => Kind::Int,
            4 => Kind::Index,
            other => {
                let message = format!(
                    "expected the type of attribute {name} to be 0, 1, 4 or 5 \
                     (float, int, index, vector), found {other}"
                );
                return Err(self.error(at, message));
            }
        };
        let mut strings = Vec::new();
        if kind == Kind::Index {
            for _ in 0..self.count()? {
                strings.push(self.string()?);
            }
        } else {
            self.take(4 * components)?;
        }
        Ok(Attribute { name, components, kind, strings })
    }

    /// The bytes of all points: four words of position each, and the attributes.
    fn rows(&mut self, count: usize, attributes: &[Attribute]) -> Result<Rows<'a>> {
        let words: usize = 4 + attributes.iter().map(|a| a.components).sum::<usize>();
        let at = self.at;
        let left = self.bytes.len().saturating_sub(at);
        let stride = 4 * words;
        match count.checked_mul(stride).filter(|all| *all <= left) {
            Some(all) => Ok(Rows { bytes: self.take(all)?, stride }),
            None => {
                let message = format!(
                    "expected {count} points of {stride} bytes each, but {left} bytes are left"
                );
                Err(self.error(at, message))
            }
        }
    }
}
