//! Rows of a PLY element with lists, or written as text, packed to rows of plain bytes.
//!
//! The packed row has the scalar properties in order, without lists, so that text, lists and plain
//! binary all end in the same columns.

use crate::read::forward::Forward;
use crate::read::lanes::{ByteOrder, Lane, Scalar};
use crate::read::text::{Wrong, integer, shown};
use crate::{Place, ReadError, Result};

use super::header::{Element, Kind};

/// How much is read at once.
const BLOCK_BYTES: usize = 4 << 20;

/// Bytes of a packed row.
pub(super) fn packed_bytes(element: &Element) -> usize {
    let bytes = |kind| match kind {
        Kind::Scalar(scalar) => scalar.bytes(),
        Kind::List { .. } => 0,
    };
    element.properties.iter().map(|p| bytes(p.kind)).sum()
}

/// Walks through binary rows whose length is not known before.
pub(super) struct Walk<'a> {
    forward: &'a mut Forward,
    order: ByteOrder,
    block: Vec<u8>,
    at: usize,
}

impl<'a> Walk<'a> {
    /// From where `forward` stands.
    pub(super) fn new(forward: &'a mut Forward, order: ByteOrder) -> Self {
        Self { forward, order, block: Vec::new(), at: 0 }
    }

    /// Leaves `forward` after the last row.
    pub(super) fn finish(self) -> Result<()> {
        let ahead = (self.block.len() - self.at) as u64;
        self.forward.seek(self.forward.at() - ahead)
    }

    /// Passes `rows` rows, appending their scalars to `packed`, if any.
    pub(super) fn rows(
        &mut self,
        element: &Element,
        rows: u64,
        mut packed: Option<&mut Vec<u8>>,
    ) -> Result<()> {
        for _ in 0..rows {
            for property in &element.properties {
                match property.kind {
                    Kind::Scalar(scalar) => {
                        let bytes = self.take(scalar.bytes())?;
                        if let Some(packed) = &mut packed {
                            packed.extend_from_slice(bytes);
                        }
                    }
                    Kind::List { count, item } => {
                        let order = self.order;
                        let bytes = self.take(count.bytes())?;
                        let lane = Lane { bytes, start: 0, stride: 0, scalar: count, order };
                        let items = lane.number(0);
                        if items < 0.0 {
                            return Err(self.error(&format!("a list of {items} items")));
                        }
                        // At most 2³² items of 8 bytes.
                        self.skip(items as u64 * item.bytes() as u64)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn take(&mut self, bytes: usize) -> Result<&[u8]> {
        if self.block.len() - self.at < bytes {
            self.block.drain(..self.at);
            self.at = 0;
            self.forward.read_more(&mut self.block, BLOCK_BYTES)?;
            if self.block.len() < bytes {
                return Err(self.error("the file ends inside an element"));
            }
        }
        self.at += bytes;
        Ok(&self.block[self.at - bytes..self.at])
    }

    fn skip(&mut self, bytes: u64) -> Result<()> {
        let here = (self.block.len() - self.at) as u64;
        if bytes <= here {
            self.at += bytes as usize;
            return Ok(());
        }
        self.block.clear();
        self.at = 0;
        match self.forward.skip(bytes - here)? {
            skipped if skipped == bytes - here => Ok(()),
            _ => Err(self.error("the file ends inside a list")),
        }
    }

    fn error(&self, message: &str) -> ReadError {
        let at = self.forward.at() - (self.block.len() - self.at) as u64;
        ReadError::new(self.forward.input().path(), Place::Byte(at), message)
    }
}

/// Packs lines of text, blank ones left out.
pub(super) fn pack_lines(text: &[u8], element: &Element) -> std::result::Result<Vec<u8>, Wrong> {
    let mut packed = Vec::with_capacity(text.len() / 2);
    let mut at = 0;
    for line in text.split_inclusive(|b| *b == b'\n') {
        if !line.trim_ascii().is_empty() {
            pack_line(line, element, &mut packed).map_err(|message| Wrong { at, message })?;
        }
        at += line.len();
    }
    Ok(packed)
}

fn pack_line(
    line: &[u8],
    element: &Element,
    packed: &mut Vec<u8>,
) -> std::result::Result<(), String> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    for property in &element.properties {
        let name = &property.name;
        let word =
            words.next().ok_or_else(|| format!("expected `{name}`, found the line's end"))?;
        let wrong = |what: &str| format!("expected {what} `{name}`, found {}", shown(word));
        match property.kind {
            Kind::Scalar(scalar) => pack(word, scalar, packed).ok_or_else(|| wrong("a number"))?,
            Kind::List { .. } => {
                let items = integer(word).ok_or_else(|| wrong("the length of list"))?;
                for _ in 0..items {
                    words.next().ok_or_else(|| format!("expected {items} items of `{name}`"))?;
                }
            }
        }
    }
    match words.next() {
        None => Ok(()),
        Some(word) => Err(format!("expected the line's end, found {}", shown(word))),
    }
}

/// Appends the number `word`, little-endian; `None` where it is none, or does not fit.
fn pack(word: &[u8], scalar: Scalar, packed: &mut Vec<u8>) -> Option<()> {
    match scalar {
        Scalar::F64 => packed.extend(fast_float2::parse::<f64, _>(word).ok()?.to_le_bytes()),
        Scalar::F32 | Scalar::F16 => {
            packed.extend(fast_float2::parse::<f32, _>(word).ok()?.to_le_bytes());
        }
        _ => {
            let bytes = scalar.bytes();
            let value = whole(word)?;
            let (low, high) = match scalar {
                Scalar::I8 | Scalar::I16 | Scalar::I32 => {
                    (-(1i64 << (8 * bytes - 1)), (1i64 << (8 * bytes - 1)) - 1)
                }
                Scalar::U8 | Scalar::U16 | Scalar::U32 => (0, (1i64 << (8 * bytes)) - 1),
                _ => (i64::MIN, i64::MAX),
            };
            if !(low..=high).contains(&value) {
                return None;
            }
            packed.extend_from_slice(&value.to_le_bytes()[..bytes]);
        }
    }
    Some(())
}

/// An integer; also one written as `255.0`, as some writers do.
fn whole(word: &[u8]) -> Option<i64> {
    integer(word).or_else(|| {
        let value: f64 = fast_float2::parse(word).ok()?;
        (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i64)
    })
}
