//! The PLY header: elements, their counts and properties.

use std::path::Path;

use crate::read::lanes::{ByteOrder, Scalar};
use crate::{Place, ReadError, Result};

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary(ByteOrder),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    /// A count, then so many items.
    List {
        count: Scalar,
        item: Scalar,
    },
}

#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a row where all rows are alike.
    pub(super) fn row_bytes(&self) -> Option<usize> {
        let bytes = |p: &Property| match p.kind {
            Kind::Scalar(scalar) => Some(scalar.bytes()),
            Kind::List { .. } => None,
        };
        self.properties.iter().map(bytes).sum()
    }
}

#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Where the body starts.
    pub(super) bytes: u64,
    /// Lines of the header.
    pub(super) lines: u64,
}

const TYPES: &str = "char, uchar, short, ushort, int, uint, float, double, int8 … float64";

fn scalar(name: &str) -> std::result::Result<Scalar, String> {
    Ok(match name {
        "char" | "int8" | "i1" => Scalar::I8,
        "uchar" | "uint8" | "u1" => Scalar::U8,
        "short" | "int16" | "i2" => Scalar::I16,
        "ushort" | "uint16" | "u2" => Scalar::U16,
        "int" | "int32" | "i4" => Scalar::I32,
        "uint" | "uint32" | "u4" => Scalar::U32,
        "float" | "float32" | "f4" => Scalar::F32,
        "double" | "float64" | "f8" => Scalar::F64,
        _ => return Err(format!("expected a type ({TYPES}), found `{name}`")),
    })
}

fn property(words: &[&str]) -> std::result::Result<Property, String> {
    match words {
        ["list", count, item, name] => {
            let (count, item) = (scalar(count)?, scalar(item)?);
            if count.is_float() {
                return Err("the length of a list cannot be a fraction".into());
            }
            Ok(Property { name: (*name).into(), kind: Kind::List { count, item } })
        }
        [kind, name] => Ok(Property { name: (*name).into(), kind: Kind::Scalar(scalar(kind)?) }),
        _ => Err("expected `property TYPE NAME` or `property list TYPE TYPE NAME`".into()),
    }
}

fn encoding(words: &[&str]) -> std::result::Result<Encoding, String> {
    match words {
        ["ascii", _] => Ok(Encoding::Ascii),
        ["binary_little_endian", _] => Ok(Encoding::Binary(ByteOrder::Little)),
        ["binary_big_endian", _] => Ok(Encoding::Binary(ByteOrder::Big)),
        _ => Err(format!(
            "expected `format ascii|binary_little_endian|binary_big_endian 1.0`, found `format {}`",
            words.join(" ")
        )),
    }
}

/// One line after the first; gives whether it is the last.
fn line(
    text: &str,
    format: &mut Option<Encoding>,
    elements: &mut Vec<Element>,
) -> std::result::Result<bool, String> {
    let words: Vec<_> = text.split_ascii_whitespace().collect();
    match words.as_slice() {
        ["end_header"] => return Ok(true),
        [] | ["comment" | "obj_info", ..] => {}
        ["format", rest @ ..] => *format = Some(encoding(rest)?),
        ["element", name, count] => {
            let count = count
                .parse()
                .map_err(|_| format!("expected a count of {name}, found `{count}`"))?;
            elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
        }
        ["property", rest @ ..] => {
            let element = elements.last_mut().ok_or("a property before any element")?;
            element.properties.push(property(rest)?);
        }
        [word, ..] => return Err(format!("expected a PLY header line, found `{word}`")),
    }
    Ok(false)
}

/// Reads the header from the first bytes of the file.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Header> {
    let (mut format, mut elements) = (None, Vec::new());
    let mut at = 0;
    let mut lines = 0;
    for end in memchr::memchr_iter(b'\n', bytes) {
        lines += 1;
        let text = String::from_utf8_lossy(&bytes[at..end]);
        at = end + 1;
        if lines == 1 {
            continue;
        }
        let error = |message: String| ReadError::new(path, Place::Line(lines), message);
        if line(&text, &mut format, &mut elements).map_err(error)? {
            let missing =
                || ReadError::new(path, Place::Line(lines), "the header has no `format` line");
            let encoding = format.ok_or_else(missing)?;
            return Ok(Header { encoding, elements, bytes: at as u64, lines });
        }
    }
    Err(ReadError::new(
        path,
        Place::Line(lines + 1),
        "expected `end_header`, but the header goes on",
    ))
}
