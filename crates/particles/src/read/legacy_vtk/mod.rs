//! Legacy VTK (`.vtk`), versions 1.0 to 5.1, ASCII and binary (big endian).
//!
//! Particles are the points of any data set: `POINTS`, or the lattice of `STRUCTURED_POINTS` and
//! `RECTILINEAR_GRID`. Columns are the arrays of `POINT_DATA`; cells and their data are skipped. A
//! field array `TIME` (or `TimeValue`) is the time, `CYCLE` the step. The format is described in *The
//! VTK User's Guide*, "VTK File Formats"; what changed in 5.1 (`OFFSETS`, `CONNECTIVITY`) in VTK's
//! documentation of the legacy format.

mod columns;
mod cursor;

use std::path::Path;

use columns::Columns;
use cursor::{Cursor, Type};

use super::whole::WholeFile;
use super::{Confidence, Format, Head, Input, Reader, Wanted};
use crate::{Particles, PositionBuilder, Result, Values};

/// A lattice of points may have this many, however small the file: it has to be stored in no array.
const FREE_LATTICE_POINTS: u64 = 1 << 20;

/// Legacy VTK.
pub(super) struct LegacyVtk;

impl Format for LegacyVtk {
    fn name(&self) -> &'static str {
        "legacy VTK"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        match head.bytes.starts_with(b"# vtk DataFile Version") {
            true => Confidence::Certain,
            false => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        Ok(Box::new(WholeFile::new(input, parse)))
    }
}

fn parse(path: &Path, bytes: &[u8], wanted: &Wanted) -> Result<(Particles, Vec<String>)> {
    let mut data_set = DataSet::new(Cursor::open(path, bytes)?, wanted);
    data_set.read()?;
    data_set.finish()
}

/// What the arrays that are being read belong to.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    /// The data set as a whole.
    Geometry,
    /// So many points.
    Points(usize),
    /// So many cells, edges, …
    Others(usize),
}

/// A data set as far as it is read.
struct DataSet<'a> {
    cursor: Cursor<'a>,
    kind: String,
    section: Section,
    positions: Option<PositionBuilder>,
    dimensions: Option<[usize; 3]>,
    origin: [f64; 3],
    spacing: [f64; 3],
    /// Coordinates along the axes of a `RECTILINEAR_GRID`.
    axes: [Option<Vec<f64>>; 3],
    columns: Columns<'a>,
    time: Option<f64>,
    step: Option<i64>,
}

impl<'a> DataSet<'a> {
    fn new(cursor: Cursor<'a>, wanted: &'a Wanted) -> Self {
        Self {
            cursor,
            kind: String::new(),
            section: Section::Geometry,
            positions: None,
            dimensions: None,
            origin: [0.0; 3],
            spacing: [1.0; 3],
            axes: [None, None, None],
            columns: Columns::new(wanted),
            time: None,
            step: None,
        }
    }

    /// Reads keyword after keyword.
    fn read(&mut self) -> Result<()> {
        loop {
            let at = self.cursor.at();
            let keyword = self.cursor.word().to_ascii_lowercase();
            if keyword.is_empty() {
                return Ok(());
            }
            match &keyword[..] {
                b"dataset" => self.kind = self.cursor.text()?.to_ascii_uppercase(),
                b"point_data" => self.section = Section::Points(self.point_data(at)?),
                b"cell_data" | b"vertex_data" | b"edge_data" | b"row_data" => {
                    self.section = Section::Others(self.cursor.count()?);
                }
                b"metadata" => self.cursor.skip_metadata(),
                b"field" => self.field()?,
                _ if self.geometry(&keyword)? => {}
                _ if self.attribute(&keyword)? => {}
                _ => return Err(self.cursor.error(at, "expected a keyword of legacy VTK")),
            }
        }
    }

    /// Reads what belongs to `keyword`, if it is one of the geometry.
    fn geometry(&mut self, keyword: &[u8]) -> Result<bool> {
        let cursor = &mut self.cursor;
        match keyword {
            b"points" => {
                let (n, kind) = (cursor.count()?, cursor.kind()?);
                self.positions = Some(positions(&cursor.values(kind, cursor.product(n, 3)?)?));
            }
            b"dimensions" => {
                self.dimensions = Some([cursor.count()?, cursor.count()?, cursor.count()?]);
            }
            b"origin" => self.origin = [cursor.real()?, cursor.real()?, cursor.real()?],
            b"spacing" | b"aspect_ratio" => {
                self.spacing = [cursor.real()?, cursor.real()?, cursor.real()?];
            }
            b"x_coordinates" | b"y_coordinates" | b"z_coordinates" => {
                let (n, kind) = (cursor.count()?, cursor.kind()?);
                let values = cursor.values(kind, n)?;
                let axis = usize::from(keyword[0] - b'x');
                self.axes[axis] = Some((0..n).map(|i| values.number(i)).collect());
            }
            b"vertices" | b"lines" | b"polygons" | b"triangle_strips" | b"cells" => {
                let (n, size) = (cursor.count()?, cursor.count()?);
                skip_cells(cursor, n, size)?;
            }
            b"cell_types" => {
                let n = cursor.count()?;
                cursor.skip_values(Type::I32, n)?;
            }
            b"blanking" => {
                let (n, kind) = (cursor.count()?, cursor.kind()?);
                cursor.skip_values(kind, n)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// How many points the data of `POINT_DATA` describe: as many as there are.
    fn point_data(&mut self, at: usize) -> Result<usize> {
        let n = self.cursor.count()?;
        match self.points()? {
            Some(points) if points != n => {
                let message = format!("POINT_DATA describes {n} points, but there are {points}");
                Err(self.cursor.error_saying(at, message))
            }
            _ => Ok(n),
        }
    }

    /// How many points there are, if that is known.
    fn points(&self) -> Result<Option<usize>> {
        if let Some(positions) = &self.positions {
            return Ok(Some(positions.len()));
        }
        let Some([x, y, z]) = self.dimensions else { return Ok(None) };
        let all = x.checked_mul(y).and_then(|xy| xy.checked_mul(z));
        // Each point of a larger one has a byte of data at least.
        let most = FREE_LATTICE_POINTS.max(self.cursor.len() as u64);
        match all.filter(|all| *all as u64 <= most) {
            Some(all) => Ok(Some(all)),
            None => {
                let message = format!("DIMENSIONS {x} {y} {z} is more than the file can hold");
                Err(self.cursor.error_saying(0, message))
            }
        }
    }

    /// Reads an array that has a keyword of its own, if `keyword` is one.
    fn attribute(&mut self, keyword: &[u8]) -> Result<bool> {
        let rows = match self.section {
            Section::Geometry => return Ok(false),
            Section::Points(rows) | Section::Others(rows) => rows,
        };
        let cursor = &mut self.cursor;
        let name = cursor.name()?;
        let fixed = match keyword {
            b"scalars" => None,
            b"vectors" | b"normals" => Some(3),
            b"tensors" => Some(9),
            b"tensors6" => Some(6),
            b"texture_coordinates" => Some(cursor.count()?),
            b"global_ids" | b"pedigree_ids" | b"edge_flags" => Some(1),
            b"color_scalars" => {
                let components = cursor.count()?;
                return self.color_scalars(name, components, rows).map(|()| true);
            }
            b"lookup_table" => {
                let entries = cursor.count()?;
                let kind = if cursor.is_binary() { Type::U8 } else { Type::F32 };
                cursor.skip_values(kind, cursor.product(entries, 4)?)?;
                return Ok(true);
            }
            _ => return Ok(false),
        };
        let kind = cursor.kind()?;
        let components = match fixed {
            Some(components) => components,
            None => cursor.components_of_scalars()?,
        };
        self.array(Array { name, kind, components, rows })?;
        Ok(true)
    }

    /// Colours: bytes in binary, 0–1 in ASCII.
    fn color_scalars(&mut self, name: String, components: usize, rows: usize) -> Result<()> {
        let kind = if self.cursor.is_binary() { Type::U8 } else { Type::F32 };
        let count = self.cursor.product(rows, components)?;
        if !matches!(self.section, Section::Points(_)) {
            return self.cursor.skip_values(kind, count);
        }
        let values = self.cursor.values(kind, count)?;
        self.columns.add_colors(name, components, values);
        Ok(())
    }

    /// `FIELD name n` and its arrays.
    fn field(&mut self) -> Result<()> {
        self.cursor.name()?;
        let arrays = self.cursor.count()?;
        for _ in 0..arrays {
            while self.cursor.peek().eq_ignore_ascii_case(b"METADATA") {
                self.cursor.word();
                self.cursor.skip_metadata();
            }
            let name = self.cursor.name()?;
            if name == "NULL_ARRAY" {
                continue;
            }
            let (components, rows) = (self.cursor.count()?, self.cursor.count()?);
            let kind = self.cursor.kind()?;
            self.array(Array { name, kind, components, rows })?;
        }
        Ok(())
    }

    /// Reads an array, if it describes points or tells the time, else skips it.
    fn array(&mut self, array: Array) -> Result<()> {
        let count = self.cursor.product(array.components, array.rows)?;
        let of_points = self.section == Section::Points(array.rows);
        if of_points && count > 0 && self.columns.wants(&array.name, array.components) {
            let values = self.cursor.values(array.kind, count)?;
            self.columns.add(array.name, array.components, values);
            return Ok(());
        }
        let name = array.name.to_ascii_lowercase();
        if count != 1 || !["time", "timevalue", "cycle"].contains(&name.as_str()) {
            return self.cursor.skip_values(array.kind, count);
        }
        let value = self.cursor.values(array.kind, 1)?;
        match (name.as_str(), self.section) {
            (_, Section::Points(_) | Section::Others(_)) => {}
            ("cycle", _) => self.step = Some(value.number(0) as i64),
            _ => self.time = Some(value.number(0)),
        }
        Ok(())
    }

    fn finish(mut self) -> Result<(Particles, Vec<String>)> {
        let (origin, positions) = match self.positions.take() {
            Some(positions) => positions.finish(),
            None => self.lattice()?.finish(),
        };
        if let Section::Points(rows) = self.section
            && rows != positions.len()
        {
            let message =
                format!("POINT_DATA describes {rows} points, but there are {}", positions.len());
            return Err(self.cursor.error_saying(self.cursor.len(), message));
        }
        let (radius, columns, warnings) = self.columns.finish(positions.len());
        let (time, step) = (self.time, self.step);
        let particles =
            Particles { origin, positions, radius, columns, time, step, ..Particles::default() };
        Ok((particles, warnings))
    }

    /// The points of a data set that has none written down.
    fn lattice(&self) -> Result<PositionBuilder> {
        let nothing = || {
            let kind = if self.kind.is_empty() { "no DATASET" } else { &self.kind };
            let message = format!("expected POINTS or a lattice of points, found {kind} without");
            self.cursor.error_saying(self.cursor.len(), message)
        };
        let dimensions = self.dimensions.ok_or_else(nothing)?;
        if self.points()? == Some(0) {
            return Ok(PositionBuilder::default());
        }
        let axes: [Vec<f64>; 3] = match (self.kind.as_str(), &self.axes) {
            ("RECTILINEAR_GRID", [Some(x), Some(y), Some(z)]) => [x.clone(), y.clone(), z.clone()],
            ("STRUCTURED_POINTS", _) => std::array::from_fn(|i| {
                (0..dimensions[i]).map(|k| self.origin[i] + k as f64 * self.spacing[i]).collect()
            }),
            _ => return Err(nothing()),
        };
        if axes.each_ref().map(Vec::len) != dimensions {
            let found = axes.each_ref().map(Vec::len);
            let message =
                format!("expected {dimensions:?} coordinates as in DIMENSIONS, found {found:?}");
            return Err(self.cursor.error_saying(self.cursor.len(), message));
        }
        let mut positions = PositionBuilder::default();
        for z in &axes[2] {
            for y in &axes[1] {
                let row: Vec<[f64; 3]> = axes[0].iter().map(|x| [*x, *y, *z]).collect();
                positions.push(&row);
            }
        }
        Ok(positions)
    }
}

/// The head of an array.
struct Array {
    name: String,
    kind: Type,
    components: usize,
    rows: usize,
}

fn positions(values: &Values) -> PositionBuilder {
    const BLOCK: usize = 1 << 16;
    let mut positions = PositionBuilder::default();
    let rows = values.len() / 3;
    for start in (0..rows).step_by(BLOCK) {
        let block: Vec<[f64; 3]> = (start..rows.min(start + BLOCK))
            .map(|row| std::array::from_fn(|i| values.number(3 * row + i)))
            .collect();
        positions.push(&block);
    }
    positions
}

/// Skips cells: since 5.1 offsets and corners in two arrays, before that one list.
fn skip_cells(cursor: &mut Cursor<'_>, n: usize, size: usize) -> Result<()> {
    if !cursor.peek().eq_ignore_ascii_case(b"OFFSETS") {
        return cursor.skip_values(Type::I32, size);
    }
    cursor.word();
    let kind = cursor.kind()?;
    cursor.skip_values(kind, n)?;
    if !cursor.peek().eq_ignore_ascii_case(b"CONNECTIVITY") {
        return Err(cursor.error(cursor.at(), "expected CONNECTIVITY"));
    }
    cursor.word();
    let kind = cursor.kind()?;
    cursor.skip_values(kind, size)
}

#[cfg(test)]
mod tests;
