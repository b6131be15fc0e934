//! Words, numbers and arrays of a legacy VTK file.

use std::path::Path;

use rayon::prelude::*;

use crate::read::dictionary::Dictionary;
use crate::read::text;
use crate::{Place, ReadError, Result, Values};

/// What one thread parses at a time.
const PIECE_BYTES: usize = 256 * 1024;
/// How many pieces are parsed before their numbers are put together.
const PIECES: usize = 32;

/// The types of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Type {
    Bit,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    /// `vtkIdType`, which VTK writes as `int`.
    Id,
    String,
}

impl Type {
    fn of(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"bit" => Self::Bit,
            b"char" | b"signed_char" | b"vtktypeint8" => Self::I8,
            b"unsigned_char" | b"vtktypeuint8" => Self::U8,
            b"short" | b"vtktypeint16" => Self::I16,
            b"unsigned_short" | b"vtktypeuint16" => Self::U16,
            b"int" | b"vtktypeint32" => Self::I32,
            b"unsigned_int" | b"vtktypeuint32" => Self::U32,
            b"long" | b"long_long" | b"__int64" | b"vtktypeint64" => Self::I64,
            b"unsigned_long" | b"unsigned_long_long" | b"unsigned___int64" | b"vtktypeuint64" => {
                Self::U64
            }
            b"float" => Self::F32,
            b"double" => Self::F64,
            b"vtkidtype" => Self::Id,
            b"string" | b"utf8_string" => Self::String,
            _ => return None,
        })
    }

    /// Bytes that `count` values take in a binary file; `None` where only reading them tells.
    fn bytes(self, count: usize) -> Option<usize> {
        let each = match self {
            Self::Bit => return Some(count.div_ceil(8)),
            Self::String => return None,
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 | Self::Id => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        };
        Some(count.saturating_mul(each))
    }
}

/// A place in a file, and how its arrays are written.
pub(super) struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    binary: bool,
}

impl<'a> Cursor<'a> {
    /// Reads the three lines that every file begins with.
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let mut cursor = Self { path, bytes, at: 0, binary: false };
        cursor.end_line();
        cursor.end_line();
        cursor.skip_space();
        let at = cursor.at;
        cursor.binary = match cursor.word().to_ascii_uppercase().as_slice() {
            b"ASCII" => false,
            b"BINARY" => true,
            _ => return Err(cursor.error(at, "expected ASCII or BINARY")),
        };
        Ok(cursor)
    }

    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// Bytes in all.
    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }

    pub(super) fn is_binary(&self) -> bool {
        self.binary
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    fn skip_space(&mut self) {
        self.at += self.rest().iter().take_while(|b| b.is_ascii_whitespace()).count();
    }

    /// The next word; empty at the end.
    pub(super) fn word(&mut self) -> &'a [u8] {
        self.skip_space();
        let rest = self.rest();
        let length = rest.iter().take_while(|b| !b.is_ascii_whitespace()).count();
        self.at += length;
        &rest[..length]
    }

    /// The next word, which stays.
    pub(super) fn peek(&mut self) -> &'a [u8] {
        let at = self.at;
        let word = self.word();
        self.at = at;
        word
    }

    /// The rest of the line, without its end.
    fn end_line(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let end = memchr::memchr(b'\n', rest);
        self.at += end.map_or(rest.len(), |end| end + 1);
        text::trim(&rest[..end.unwrap_or(rest.len())])
    }

    /// An error at byte `at`: what was `expected`, and the word that stands there.
    pub(super) fn error(&self, at: usize, expected: &str) -> ReadError {
        let mut there = Self { at, ..*self };
        let found = match there.word() {
            [] => "the end of the file".into(),
            word => text::shown(word),
        };
        self.error_saying(there.at, format!("{expected}, found {found}"))
    }

    /// An error at byte `at`: by line in ASCII, by byte in binary.
    pub(super) fn error_saying(&self, at: usize, message: impl Into<String>) -> ReadError {
        let place = if self.binary {
            Place::Byte(at as u64)
        } else {
            let before = self.bytes.get(..at).unwrap_or(self.bytes);
            Place::Line(1 + memchr::memchr_iter(b'\n', before).count() as u64)
        };
        ReadError::new(self.path, place, message)
    }

    /// Parses the next word.
    fn parsed<T>(&mut self, expected: &str, parse: fn(&[u8]) -> Option<T>) -> Result<T> {
        let at = self.at;
        parse(self.word()).ok_or_else(|| self.error(at, expected))
    }

    /// A word, as text.
    pub(super) fn text(&mut self) -> Result<String> {
        self.parsed("expected a word", |word| match word {
            [] => None,
            _ => Some(String::from_utf8_lossy(word).into_owned()),
        })
    }

    /// The name of an array; `%20` and the like are what VTK writes for characters that end a word.
    pub(super) fn name(&mut self) -> Result<String> {
        self.parsed("expected the name of an array", |word| match word {
            [] => None,
            _ => Some(decoded(word)),
        })
    }

    /// A count.
    pub(super) fn count(&mut self) -> Result<usize> {
        self.parsed("expected a count", |word| usize::try_from(text::integer(word)?).ok())
    }

    /// A number.
    pub(super) fn real(&mut self) -> Result<f64> {
        self.parsed("expected a number", text::real)
    }

    /// A type of values.
    pub(super) fn kind(&mut self) -> Result<Type> {
        self.parsed("expected a type such as float", Type::of)
    }

    /// `a × b` values.
    pub(super) fn product(&self, a: usize, b: usize) -> Result<usize> {
        let too_many = || self.error_saying(self.at, format!("{a} × {b} values are too many"));
        a.checked_mul(b).ok_or_else(too_many)
    }

    /// What follows the type of `SCALARS`: perhaps a number of components, and a `LOOKUP_TABLE`.
    pub(super) fn components_of_scalars(&mut self) -> Result<usize> {
        let at = self.at;
        let components = match self.end_line() {
            [] => 1,
            line => text::integer(line)
                .and_then(|n| usize::try_from(n).ok())
                .ok_or_else(|| self.error(at, "expected a number of components"))?,
        };
        let line = self.at;
        if self.word().eq_ignore_ascii_case(b"LOOKUP_TABLE") {
            self.word();
        } else {
            // Some writers leave it out. The line's end is where binary values begin.
            self.at = line - 1;
        }
        Ok(components)
    }

    /// Skips what follows `METADATA`: lines up to an empty one.
    pub(super) fn skip_metadata(&mut self) {
        self.end_line();
        while !self.end_line().is_empty() {}
    }

    /// Skips an array.
    pub(super) fn skip_values(&mut self, kind: Type, count: usize) -> Result<()> {
        if self.binary && kind != Type::String {
            return self.binary_bytes(kind, count).map(drop);
        }
        if kind == Type::String {
            return self.strings(count).map(drop);
        }
        for i in 0..count {
            if self.word().is_empty() {
                return Err(self.short(i, count));
            }
        }
        Ok(())
    }

    /// Reads an array of `count` values.
    pub(super) fn values(&mut self, kind: Type, count: usize) -> Result<Values> {
        if kind == Type::String {
            return self.strings(count);
        }
        if self.binary {
            let bytes = self.binary_bytes(kind, count)?;
            return Ok(from_big_endian(kind, bytes, count));
        }
        Ok(match kind {
            Type::F32 => Values::F32(self.numbers(count, |word| Some(text::real(word)? as f32))?),
            Type::F64 => Values::F64(self.numbers(count, text::real)?),
            Type::Bit | Type::U8 => {
                Values::U8(self.numbers(count, |word| u8::try_from(whole(word)?).ok())?)
            }
            // VTK writes a negative char as the byte it is.
            Type::I8 => Values::I32(self.numbers(count, |word| match whole(word)? {
                byte @ -128..=255 => Some(i32::from(byte as i8)),
                _ => None,
            })?),
            Type::I16 | Type::U16 | Type::I32 => {
                Values::I32(self.numbers(count, |word| i32::try_from(whole(word)?).ok())?)
            }
            _ => Values::I64(self.numbers(count, whole)?),
        })
    }

    /// The bytes of a binary array, which begin on the next line.
    fn binary_bytes(&mut self, kind: Type, count: usize) -> Result<&'a [u8]> {
        self.end_line();
        let bytes = kind.bytes(count).unwrap_or(0);
        let rest = self.rest();
        let Some(values) = rest.get(..bytes) else {
            let left = rest.len();
            let message =
                format!("expected {count} values in {bytes} bytes, but {left} bytes are left");
            return Err(self.error_saying(self.at, message));
        };
        self.at += bytes;
        Ok(values)
    }

    fn short(&self, read: usize, count: usize) -> ReadError {
        let message = format!("expected {count} values, but the file ends after {read} of them");
        self.error_saying(self.bytes.len(), message)
    }

    /// Numbers in ASCII, parsed in parallel, piece after piece.
    fn numbers<T: Send>(
        &mut self,
        count: usize,
        parse: impl Fn(&[u8]) -> Option<T> + Sync,
    ) -> Result<Vec<T>> {
        let mut numbers = Vec::new();
        while numbers.len() < count {
            self.skip_space();
            // Little more than is needed: what follows is other text.
            let wish = (count - numbers.len()).saturating_mul(16).max(1024);
            let pieces = pieces(self.rest(), wish.min(PIECES * PIECE_BYTES));
            if pieces.is_empty() {
                return Err(self.short(numbers.len(), count));
            }
            let parsed: Vec<(Vec<T>, bool)> =
                pieces.par_iter().map(|piece| leading(piece, &parse)).collect();
            for (piece, (mut found, all)) in pieces.into_iter().zip(parsed) {
                let missing = count - numbers.len();
                let whole = all && found.len() < missing;
                found.truncate(missing);
                if whole {
                    self.at += piece.len();
                } else {
                    for _ in 0..found.len() {
                        self.word();
                    }
                }
                numbers.append(&mut found);
                if !whole {
                    break;
                }
            }
            let at = self.at;
            if numbers.len() < count && parse(self.peek()).is_none() {
                self.skip_space();
                return match self.rest() {
                    [] => Err(self.short(numbers.len(), count)),
                    _ => Err(self.error(at, &format!("expected {count} numbers"))),
                };
            }
        }
        Ok(numbers)
    }

    /// Strings: a line each in ASCII, behind their length in binary.
    fn strings(&mut self, count: usize) -> Result<Values> {
        self.end_line();
        let mut dictionary = Dictionary::default();
        for i in 0..count {
            if self.rest().is_empty() {
                return Err(self.short(i, count));
            }
            let name = if self.binary { self.binary_string()? } else { decoded(self.end_line()) };
            dictionary.push(name.as_bytes());
        }
        Ok(dictionary.into_values())
    }

    /// The two highest bits say in how many bytes the length is written.
    fn binary_string(&mut self) -> Result<String> {
        let rest = self.rest();
        let cut = |cursor: &Self| cursor.error_saying(cursor.at, "the file ends within a string");
        let width = match rest.first().ok_or_else(|| cut(self))? >> 6 {
            3 => 1,
            2 => 2,
            1 => 4,
            _ => 8,
        };
        let head = rest.get(..width).ok_or_else(|| cut(self))?;
        let length = head.iter().fold(0u64, |n, byte| n << 8 | u64::from(*byte));
        let length = length & (u64::MAX >> (64 - (8 * width - 2)));
        let end = usize::try_from(length).ok().and_then(|n| n.checked_add(width));
        let text = end.and_then(|end| rest.get(width..end)).ok_or_else(|| cut(self))?;
        self.at += width + text.len();
        Ok(String::from_utf8_lossy(text).into_owned())
    }
}

/// A whole number, also where a writer gave it a fraction of zero.
fn whole(word: &[u8]) -> Option<i64> {
    let from_real = || text::real(word).filter(|v| v.fract() == 0.0).map(|v| v as i64);
    text::integer(word).or_else(from_real)
}

/// The words up to the first that does not parse, and whether that is all of them.
fn leading<T>(text: &[u8], parse: &impl Fn(&[u8]) -> Option<T>) -> (Vec<T>, bool) {
    let mut parsed = Vec::new();
    for word in text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
        match parse(word) {
            Some(value) => parsed.push(value),
            None => return (parsed, false),
        }
    }
    (parsed, true)
}

/// The first `wish` bytes of `text` in pieces of whole words.
fn pieces(text: &[u8], wish: usize) -> Vec<&[u8]> {
    let mut pieces = Vec::new();
    let mut start = 0;
    while start < text.len().min(wish) {
        let end = text.len().min(start + PIECE_BYTES.min(wish));
        let more = text[end..].iter().take_while(|b| !b.is_ascii_whitespace()).count();
        pieces.push(&text[start..end + more]);
        start = end + more;
    }
    pieces
}

fn decoded(name: &[u8]) -> String {
    let mut out = Vec::new();
    let mut rest = name;
    while let [first, tail @ ..] = rest {
        let code = match (first, tail) {
            (b'%', [high, low, ..]) => hex(*high).zip(hex(*low)),
            _ => None,
        };
        out.push(code.map_or(*first, |(high, low)| 16 * high + low));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn hex(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|d| d as u8)
}

fn from_big_endian(kind: Type, bytes: &[u8], count: usize) -> Values {
    match kind {
        Type::Bit => Values::U8((0..count).map(|i| (bytes[i / 8] >> (7 - i % 8)) & 1).collect()),
        Type::U8 | Type::String => Values::U8(bytes.to_vec()),
        Type::I8 => Values::I32(bytes.iter().map(|b| i32::from(*b as i8)).collect()),
        Type::I16 => Values::I32(swapped(bytes, |b| i32::from(i16::from_be_bytes(b)))),
        Type::U16 => Values::I32(swapped(bytes, |b| i32::from(u16::from_be_bytes(b)))),
        Type::I32 => Values::I32(swapped(bytes, i32::from_be_bytes)),
        Type::U32 => Values::I64(swapped(bytes, |b| i64::from(u32::from_be_bytes(b)))),
        Type::I64 => Values::I64(swapped(bytes, i64::from_be_bytes)),
        Type::U64 => Values::I64(swapped(bytes, i64::from_be_bytes)),
        Type::Id => Values::I64(swapped(bytes, |b| i64::from(i32::from_be_bytes(b)))),
        Type::F32 => Values::F32(swapped(bytes, f32::from_be_bytes)),
        Type::F64 => Values::F64(swapped(bytes, f64::from_be_bytes)),
    }
}

fn swapped<const N: usize, T: Send>(bytes: &[u8], from: fn([u8; N]) -> T) -> Vec<T> {
    bytes.as_chunks::<N>().0.par_iter().map(|chunk| from(*chunk)).collect()
}
