//! NumPy's arrays: a bare one (NPY) and archives of named ones (NPZ).
//!
//! A bare array is `(N, k)` with k ≥ 2: x, y, z (0 where k is 2), the radius where k is 4, further
//! columns where it is more; `(T, N, k)` is T frames. Records (structured arrays) have named fields.
//! Numbers of either byte order in C or Fortran order; Python objects are refused.

mod array;
mod literal;
mod npz;
mod zip;

pub(super) use npz::Npz;

use self::array::{Array, HEADER_BYTES, Item, MAGIC, View};
use super::fields::{Plan, Slot, Table};
use super::forward::Forward;
use super::lanes::Lane;
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted};
use crate::{Particles, Place, ReadError, Result};

/// About how many bytes of rows are turned into columns at once.
const BLOCK_BYTES: u64 = 4 << 20;

/// The format of a bare array.
pub(super) struct Npy;

impl Format for Npy {
    fn name(&self) -> &'static str {
        "NPY"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        if head.bytes.starts_with(MAGIC) { Confidence::Certain } else { Confidence::No }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        let (header, _) = input.start(HEADER_BYTES)?;
        let array = Array::parse(&header)
            .map_err(|(at, message)| ReadError::new(input.path(), Place::Byte(at), message))?;
        let view = array.table().filter(|_| !array.items.is_empty()).ok_or_else(|| {
            let message = match array.left_out.first() {
                Some(other) => format!("expected an array of real numbers, found {other}"),
                None => format!("expected an array (N, 3) or (T, N, 3), found {:?}", array.shape),
            };
            ReadError::new(input.path(), Place::Byte(0), message)
        })?;
        Ok(Box::new(NpyReader::new(input, array, view)?))
    }
}

/// A named number of each row and where it lies.
#[derive(Clone, Debug)]
struct NamedLane {
    slot: Slot,
    item: Item,
    /// From the start of the row's first column.
    offset: u64,
}

/// The columns of a bare array by name.
fn bare_columns(array: &Array, view: &View) -> Vec<NamedLane> {
    let mut columns = Vec::new();
    for item in &array.items {
        for component in 0..item.components {
            let slot = Slot {
                name: item.name.clone(),
                component: (item.components > 1).then_some((component, item.components)),
                scalar: item.scalar,
            };
            let offset = (item.offset + component * item.scalar.bytes()) as u64;
            columns.push(NamedLane { slot, item: item.clone(), offset });
        }
    }
    if array.is_record {
        return columns;
    }
    let Some(only) = columns.pop() else { return columns };
    let name = |i: u64| match (i, view.columns.0) {
        (0, _) => "x".into(),
        (1, _) => "y".into(),
        (2, _) => "z".into(),
        (3, 4) => "radius".into(),
        (i, _) => format!("Column {}", i + 1),
    };
    (0..view.columns.0)
        .map(|i| {
            let mut column = only.clone();
            column.slot.name = name(i);
            column.offset = i * view.columns.1;
            column
        })
        .collect()
}

struct NpyReader {
    forward: Forward,
    array: Array,
    view: View,
    /// Frames that are whole; `None` until a compressed file was read to its end.
    whole: Option<u64>,
}

impl NpyReader {
    fn new(input: Input, array: Array, view: View) -> Result<Self> {
        let mut reader = Self { whole: None, forward: Forward::new(input), array, view };
        if let Some(all) = reader.forward.input().content_bytes() {
            reader.set_end(all)?;
        }
        Ok(reader)
    }

    fn error(&self, place: Place, message: impl Into<String>) -> ReadError {
        ReadError::new(self.forward.input().path(), place, message)
    }

    fn is_row_major(&self) -> bool {
        self.view.is_row_major(self.array.item_bytes)
    }

    /// Counts the whole frames of a file that ends at `end`.
    fn set_end(&mut self, end: u64) -> Result<()> {
        let there = end.saturating_sub(self.array.start);
        let (declared, all) = (self.view.frames.0, self.array.bytes().unwrap_or(u64::MAX));
        let frame_bytes = if self.is_row_major() && declared > 0 { all / declared } else { all };
        let whole = match there.checked_div(frame_bytes) {
            _ if there >= all => declared,
            Some(whole) if self.is_row_major() => whole.min(declared),
            _ => 0,
        };
        if whole == 0 && declared > 0 {
            let message = format!("expected {frame_bytes} bytes of numbers, found {there}");
            return Err(self.error(Place::Byte(self.array.start), message));
        }
        self.whole = Some(whole);
        Ok(())
    }

    /// The lanes of `columns` in bytes that start at the frame's first row.
    fn lanes<'a>(&self, columns: &[NamedLane], bytes: &'a [u8], start: u64) -> Vec<Lane<'a>> {
        let lane = |column: &NamedLane| Lane {
            bytes,
            start: (start + column.offset) as usize,
            stride: self.view.rows.1 as usize,
            scalar: column.item.scalar,
            order: column.item.order,
        };
        columns.iter().map(lane).collect()
    }

    /// A frame that lies in one stretch, block by block.
    fn rows(
        &mut self,
        frame: u64,
        columns: &[NamedLane],
        table: &mut Table,
        progress: Progress<'_>,
    ) -> Result<()> {
        let (mut left, row_bytes) = self.view.rows;
        self.forward.seek(self.array.start + frame * self.view.frames.1)?;
        if self.whole.is_some() {
            table.reserve(usize::try_from(left).unwrap_or(0));
        }
        let all = left.saturating_mul(row_bytes);
        let mut block = Vec::new();
        while left > 0 {
            let now = left.min((BLOCK_BYTES / row_bytes.max(1)).max(1));
            self.forward.read_exactly(&mut block, (now * row_bytes) as usize, "rows")?;
            table.push(&self.lanes(columns, &block, 0), now as usize);
            left -= now;
            progress(all - left * row_bytes, all);
        }
        Ok(())
    }

    /// A frame whose columns lie apart.
    fn columns(&mut self, frame: u64, columns: &[NamedLane], table: &mut Table) -> Result<()> {
        let all = usize::try_from(self.array.bytes().unwrap_or(u64::MAX)).unwrap_or(usize::MAX);
        self.forward.seek(self.array.start)?;
        let mut bytes = Vec::new();
        self.forward.read_exactly(&mut bytes, all, "numbers")?;
        let rows = usize::try_from(self.view.rows.0).unwrap_or(usize::MAX);
        let lanes = self.lanes(columns, &bytes, frame * self.view.frames.1);
        if rows > 0 && lanes.iter().all(|lane| lane.holds(rows)) {
            table.push(&lanes, rows);
        }
        Ok(())
    }
}

impl Reader for NpyReader {
    fn count(&mut self, _progress: Progress<'_>) -> Result<usize> {
        if self.whole.is_none() {
            let end = self.array.start.saturating_add(self.array.bytes().unwrap_or(u64::MAX));
            self.forward.seek(self.array.start)?;
            let there = self.forward.skip(end - self.array.start)?;
            self.set_end(self.array.start + there)?;
        }
        Ok(self.whole.and_then(|n| usize::try_from(n).ok()).unwrap_or(0))
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        let frames = self.whole.unwrap_or(self.view.frames.0);
        if frame as u64 >= frames {
            let message = format!("there are {frames} frames");
            return Err(self.error(Place::Frame(frame), message));
        }
        if self.view.columns.0 > MOST_COLUMNS {
            let message =
                format!("expected at most {MOST_COLUMNS} columns, found {:?}", self.array.shape);
            return Err(self.error(Place::Byte(0), message));
        }
        let columns = bare_columns(&self.array, &self.view);
        let slots: Vec<_> = columns.iter().map(|c| c.slot.clone()).collect();
        let plan = Plan::new(&slots, wanted).ok_or_else(|| {
            let names: Vec<_> = slots.iter().map(|slot| slot.name.as_str()).collect();
            let message =
                format!("expected fields x, y, z or position, found {}", names.join(", "));
            self.error(Place::Byte(0), message)
        })?;
        let mut table = Table::new(plan);
        match self.is_row_major() {
            true => self.rows(frame as u64, &columns, &mut table, progress)?,
            false => self.columns(frame as u64, &columns, &mut table)?,
        }
        Ok(table.finish())
    }

    fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(whole) = self.whole.filter(|whole| *whole < self.view.frames.0) {
            let declared = self.view.frames.0;
            let why = self
                .forward
                .broken()
                .map(|why| format!(": the compressed data ends early ({why})"));
            let why = why.unwrap_or_default();
            warnings.push(format!("{declared} frames are declared, {whole} are whole{why}"));
        }
        if !self.array.left_out.is_empty() {
            warnings.push(format!("left out, no numbers: {}", self.array.left_out.join(", ")));
        }
        warnings
    }
}

/// More columns than this are no particles.
const MOST_COLUMNS: u64 = 4096;
