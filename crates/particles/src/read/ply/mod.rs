//! PLY, the Stanford polygon format (Greg Turk, *The PLY Polygon File Format*): its vertices.
//!
//! A text header declares elements and their properties; the body has the elements in that order, as
//! text or binary in either byte order. Only `vertex` is read; faces and all else are passed over. A
//! file without vertices is an empty frame.

mod header;
mod rows;

use std::sync::Arc;

use rayon::prelude::*;

use self::header::{Element, Encoding, Header, Kind};
use self::rows::{Walk, pack_lines, packed_bytes};
use super::fields::{Plan, Slot, Table};
use super::forward::Forward;
use super::lanes::{ByteOrder, Lane};
use super::lines::{LineBlocks, Mark, lines, pieces};
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted};
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
        let header = header::parse(input.path(), &input.read(0, HEADER_BYTES)?)?;
        Ok(Box::new(PlyReader { input: Arc::new(input), header }))
    }
}

struct PlyReader {
    input: Arc<Input>,
    header: Header,
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

impl PlyReader {
    fn error(&self, place: Place, message: impl Into<String>) -> ReadError {
        ReadError::new(self.input.path(), place, message)
    }

    fn binary(&self, vertex: &Element, before: &[Element], rows: &mut Rows<'_>) -> Result<()> {
        let mut forward = Forward::new(Arc::clone(&self.input));
        forward.seek(self.header.bytes)?;
        for element in before {
            match element.row_bytes() {
                Some(bytes) => {
                    let bytes = element.count.saturating_mul(bytes as u64);
                    if forward.skip(bytes)? < bytes {
                        let message = format!("the file ends inside its `{}`", element.name);
                        return Err(self.error(Place::Byte(forward.at()), message));
                    }
                }
                None => {
                    let mut walk = Walk::new(&mut forward, rows.order);
                    walk.rows(element, element.count, None)?;
                    walk.finish()?;
                }
            }
        }
        if vertex.row_bytes().is_none() {
            return self.packed(vertex, &mut forward, rows);
        }
        let row_bytes = rows.row_bytes as u64;
        if let Some(all) = self.input.content_bytes() {
            let there = all.saturating_sub(forward.at()) / row_bytes;
            if there < vertex.count {
                let message = format!("expected {} vertices, found {there}", vertex.count);
                return Err(self.error(Place::Byte(forward.at()), message));
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
            (rows.progress)(forward.at(), self.input.stored_bytes());
        }
        Ok(())
    }

    /// Binary vertices that have lists.
    fn packed(&self, vertex: &Element, forward: &mut Forward, rows: &mut Rows<'_>) -> Result<()> {
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

    fn text(&self, vertex: &Element, before: &[Element], rows: &mut Rows<'_>) -> Result<()> {
        let mut blocks = LineBlocks::new(Arc::clone(&self.input));
        blocks.seek(Mark { byte: self.header.bytes, line: self.header.lines + 1 })?;
        for element in before.iter().chain([vertex]) {
            let is_vertex = std::ptr::eq(element, vertex);
            let mut left = element.count;
            while left > 0 {
                let mark = blocks.mark();
                let block = blocks.look()?;
                if block.is_empty() {
                    let name = &element.name;
                    let message =
                        format!("expected {left} more lines of `{name}`, found the file's end");
                    return Err(self.error(Place::Line(mark.line), message));
                }
                let part = first_rows(block, left);
                if is_vertex {
                    self.pack(&block[..part.bytes], mark, vertex, rows)?;
                }
                left -= part.rows;
                blocks.consume(part.bytes, part.lines);
                (rows.progress)(blocks.mark().byte, self.input.stored_bytes());
            }
        }
        Ok(())
    }

    /// Packs a block in parallel, and adds its pieces in order.
    fn pack(&self, block: &[u8], mark: Mark, vertex: &Element, rows: &mut Rows<'_>) -> Result<()> {
        let pieces = pieces(block, 4 * rayon::current_num_threads());
        let packed: Vec<_> = pieces.par_iter().map(|piece| pack_lines(piece, vertex)).collect();
        for (i, packed) in packed.into_iter().enumerate() {
            match packed {
                Ok(packed) => rows.push(&packed),
                Err((line, message)) => {
                    let before: usize = pieces[..i].iter().map(|piece| lines(piece).count()).sum();
                    let place = Place::Line(mark.line + before as u64 + line);
                    return Err(self.error(place, message));
                }
            }
        }
        Ok(())
    }
}

/// The part of a block with at most so many rows.
#[derive(Default)]
struct Part {
    bytes: usize,
    lines: u64,
    rows: u64,
}

/// The first `most` rows of a block, or all: a row is a line that is not blank.
fn first_rows(block: &[u8], most: u64) -> Part {
    let mut part = Part::default();
    for line in lines(block) {
        if part.rows == most {
            break;
        }
        part.bytes += line.len();
        part.lines += 1;
        part.rows += u64::from(!line.trim_ascii().is_empty());
    }
    part
}

impl Reader for PlyReader {
    fn count(&mut self, _progress: Progress<'_>) -> Result<usize> {
        Ok(1)
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        if frame > 0 {
            return Err(self.error(Place::Frame(frame), "a PLY file has one frame"));
        }
        let elements = &self.header.elements;
        let Some(at) = elements.iter().position(|e| e.name == "vertex" && e.count > 0) else {
            return Ok(Particles::default());
        };
        let (before, vertex) = (&elements[..at], &elements[at]);
        let slots = slots(vertex);
        let all: Vec<_> = slots.iter().map(|(_, slot)| slot.clone()).collect();
        let plan = Plan::new(&all, wanted).ok_or_else(|| {
            let found: Vec<_> = all.iter().map(|slot| slot.name.as_str()).collect();
            let message = format!("expected vertices with x, y and z, found {}", found.join(", "));
            self.error(Place::Whole, message)
        })?;
        let order = match self.header.encoding {
            Encoding::Ascii => ByteOrder::Little,
            Encoding::Binary(order) => order,
        };
        let table = Table::new(plan);
        let mut rows = Rows { slots, row_bytes: packed_bytes(vertex), order, table, progress };
        match self.header.encoding {
            Encoding::Ascii => self.text(vertex, before, &mut rows)?,
            Encoding::Binary(_) => self.binary(vertex, before, &mut rows)?,
        }
        Ok(rows.table.finish())
    }
}
