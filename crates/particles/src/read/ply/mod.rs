//! PLY, the Stanford polygon format (Greg Turk, *The PLY Polygon File Format*): its vertices.
//!
//! A text header declares elements and their properties; the body has the elements in that order, as
//! text or binary in either byte order. Only `vertex` is read; faces and all else are passed over. A
//! file without vertices is an empty frame.

use std::path::PathBuf;

mod header;
mod rows;

use self::header::{Element, Encoding, Header, Kind};
use self::rows::{Walk, pack_lines, packed_bytes};
use super::fields::{Plan, Slot, Table};
use super::forward::Forward;
use super::lanes::{ByteOrder, Lane};
use super::text::{Lines, Mark};
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted, only_frame};
use crate::{Particles, Place, ReadError, Result};

/// No header is longer.
const HEADER_BYTES: u64 = 4 << 20;
/// About how many bytes of rows are turned into columns at once.
const BLOCK_BYTES: usize = 4 << 20;

/// The format.
pub(super) struct Ply;

impl Format for Ply {
    fn name(&self) -> &'static str {
        "PLY"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        match head.bytes {
            [b'p', b'l', b'y', b'\n' | b'\r', ..] => Confidence::Certain,
            _ => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        let header = header::parse(input.path(), &input.start(HEADER_BYTES)?.0)?;
        let path = input.path().to_path_buf();
        let body = match header.encoding {
            Encoding::Ascii => Body::Text(Lines::new(input)),
            Encoding::Binary(order) => Body::Binary(Forward::new(input), order),
        };
        Ok(Box::new(PlyReader { path, header, body }))
    }
}

struct PlyReader {
    path: PathBuf,
    header: Header,
    body: Body,
}

/// What follows the header.
enum Body {
    Text(Lines),
    Binary(Forward, ByteOrder),
}

/// Rows of one layout on their way into the table.
struct Rows<'a> {
    slots: Vec<(usize, Slot)>,
    row_bytes: usize,
    order: ByteOrder,
    table: Table,
    progress: Progress<'a>,
}

impl Rows<'_> {
    fn push(&mut self, bytes: &[u8]) {
        let rows = bytes.len() / self.row_bytes;
        let (stride, order) = (self.row_bytes, self.order);
        let lane = |(start, slot): &(usize, Slot)| Lane {
            bytes,
            start: *start,
            stride,
            scalar: slot.scalar,
            order,
        };
        self.table.push(&self.slots.iter().map(lane).collect::<Vec<_>>(), rows);
    }
}

/// The scalar properties, each with its offset in the packed row.
fn slots(element: &Element) -> Vec<(usize, Slot)> {
    let mut offset = 0;
    let mut slots = Vec::new();
    for property in &element.properties {
        if let Kind::Scalar(scalar) = property.kind {
            slots.push((offset, Slot { name: property.name.clone(), component: None, scalar }));
            offset += scalar.bytes();
        }
    }
    slots
}

impl Header {
    fn binary(&self, forward: &mut Forward, at: usize, rows: &mut Rows<'_>) -> Result<()> {
        let (before, vertex) = (&self.elements[..at], &self.elements[at]);
        let error = |forward: &Forward, message: String| {
            ReadError::new(forward.input().path(), Place::Byte(forward.at()), message)
        };
        forward.seek(self.bytes)?;
        for element in before {
            match element.row_bytes() {
                Some(bytes) => {
                    let bytes = element.count.saturating_mul(bytes as u64);
                    if forward.skip(bytes)? < bytes {
                        let message = format!("the file ends inside its `{}`", element.name);
                        return Err(error(forward, message));
                    }
                }
                None => {
                    let mut walk = Walk::new(forward, rows.order);
                    walk.rows(element, element.count, None)?;
                    walk.finish()?;
                }
            }
        }
        if vertex.row_bytes().is_none() {
            return packed(vertex, forward, rows);
        }
        let row_bytes = rows.row_bytes as u64;
        if let Some(all) = forward.input().content_bytes() {
            let there = all.saturating_sub(forward.at()) / row_bytes;
            if there < vertex.count {
                let message = format!("expected {} vertices, found {there}", vertex.count);
                return Err(error(forward, message));
            }
            rows.table.reserve(usize::try_from(vertex.count).unwrap_or(0));
        }
        let mut block = Vec::new();
        let mut left = vertex.count;
        while left > 0 {
            let now = left.min((BLOCK_BYTES as u64 / row_bytes).max(1));
            forward.read_exactly(&mut block, (now * row_bytes) as usize, "vertices")?;
            rows.push(&block);
            left -= now;
            (rows.progress)(forward.at(), forward.input().stored_bytes());
        }
        Ok(())
    }

    fn text(&self, lines: &mut Lines, at: usize, rows: &mut Rows<'_>) -> Result<()> {
        let (before, vertex) = (&self.elements[..at], &self.elements[at]);
        lines.go_to(Mark { offset: self.bytes, line: self.lines + 1 })?;
        for element in before {
            let mut left = element.count;
            while left > 0 {
                let Some(block) = lines.block(left)? else {
                    return Err(lines.cut(&format!("{left} more lines of `{}`", element.name)));
                };
                let full =
                    block.bytes.split(|b| *b == b'\n').filter(|l| !l.trim_ascii().is_empty());
                left -= full.count() as u64;
            }
        }
        let mut left = vertex.count;
        while left > 0 {
            // A row is a line that is not blank.
            let Some(block) = lines.block(left)? else {
                return Err(lines.cut(&format!("{left} more vertices")));
            };
            match block.map_chunks(|text| pack_lines(text, vertex)) {
                Ok(packed) => {
                    for packed in packed {
                        left -= (packed.len() / rows.row_bytes) as u64;
                        rows.push(&packed);
                    }
                }
                Err(wrong) => {
                    let line = block.line_of(wrong.at);
                    return Err(lines.error(line, wrong.message));
                }
            }
            let (done, all) = lines.progress();
            (rows.progress)(done, all);
        }
        Ok(())
    }
}

/// Binary vertices that have lists.
fn packed(vertex: &Element, forward: &mut Forward, rows: &mut Rows<'_>) -> Result<()> {
    let mut walk = Walk::new(forward, rows.order);
    let mut packed = Vec::new();
    let mut left = vertex.count;
    while left > 0 {
        let now = left.min((BLOCK_BYTES / rows.row_bytes).max(1) as u64);
        packed.clear();
        walk.rows(vertex, now, Some(&mut packed))?;
        rows.push(&packed);
        left -= now;
    }
    Ok(())
}

impl PlyReader {
    fn error(&self, place: Place, message: impl Into<String>) -> ReadError {
        ReadError::new(&self.path, place, message)
    }
}

impl Reader for PlyReader {
    fn count(&mut self, _progress: Progress<'_>) -> Result<usize> {
        Ok(1)
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        only_frame(&self.path, frame)?;
        let elements = &self.header.elements;
        let Some(at) = elements.iter().position(|e| e.name == "vertex" && e.count > 0) else {
            return Ok(Particles::default());
        };
        let vertex = &elements[at];
        let slots = slots(vertex);
        let all: Vec<_> = slots.iter().map(|(_, slot)| slot.clone()).collect();
        let plan = Plan::new(&all, wanted).ok_or_else(|| {
            let found: Vec<_> = all.iter().map(|slot| slot.name.as_str()).collect();
            let message = format!("expected vertices with x, y and z, found {}", found.join(", "));
            self.error(Place::Whole, message)
        })?;
        let order = match &self.body {
            Body::Text(_) => ByteOrder::Little,
            Body::Binary(_, order) => *order,
        };
        let table = Table::new(plan);
        let mut rows = Rows { slots, row_bytes: packed_bytes(vertex), order, table, progress };
        match &mut self.body {
            Body::Text(lines) => self.header.text(lines, at, &mut rows)?,
            Body::Binary(forward, _) => self.header.binary(forward, at, &mut rows)?,
        }
        Ok(rows.table.finish())
    }
}
