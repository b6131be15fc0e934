//! A table as the paper prints it, for people and for machines.

use std::fmt::{self, Display};

use serde::{Serialize, Serializer, ser::SerializeMap};

/// A table: rows are sets, columns what is compared.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// The name of its stage, such as `table2`.
    pub stage: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// The columns after the set's name.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<Row>,
}

/// A row of a [`Table`].
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The set.
    pub dataset: &'static str,
    /// How many particles it has here.
    pub particles: usize,
    /// One per column.
    pub values: Vec<Cell>,
    /// Hashes of the pictures, each once; one where all columns show the same picture.
    pub hashes: Vec<String>,
}

/// A value of a [`Table`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell {
    /// Milliseconds of a frame, told as frames per second.
    Frame(f64),
    /// Milliseconds.
    Ms(f64),
    /// A count.
    Count(u64),
    /// A factor or a mean.
    Factor(f64),
    /// Percent.
    Percent(f64),
    /// Degrees.
    Degrees(f64),
    /// Bytes, told in MiB.
    Bytes(usize),
    /// Not measured here.
    Missing,
}

impl Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frame(ms) => write!(f, "{:.2} ({:.1} ms)", 1e3 / ms, ms),
            Self::Ms(ms) => write!(f, "{ms:.2} ms"),
            Self::Count(n) => write!(f, "{n}"),
            Self::Factor(x) => write!(f, "{x:.2}"),
            Self::Percent(x) => write!(f, "{x:.2} %"),
            Self::Degrees(x) => write!(f, "{x:.3}°"),
            Self::Bytes(n) => write!(f, "{:.1} MiB", *n as f64 / f64::from(1 << 20)),
            Self::Missing => write!(f, "not measured"),
        }
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Frame(ms) => {
                let mut map = serializer.serialize_map(Some(2))?;
                map.serialize_entry("frames_per_second", &(1e3 / ms))?;
                map.serialize_entry("ms", ms)?;
                map.end()
            }
            Self::Ms(x) | Self::Factor(x) | Self::Percent(x) | Self::Degrees(x) => {
                serializer.serialize_f64(*x)
            }
            Self::Count(n) => serializer.serialize_u64(*n),
            Self::Bytes(n) => serializer.serialize_u64(*n as u64),
            Self::Missing => serializer.serialize_none(),
        }
    }
}

impl Table {
    pub(super) fn new(stage: &'static str, title: &'static str, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|c| (*c).to_owned()).collect();
        Self { stage, title, columns, rows: Vec::new() }
    }

    /// Adds a row; of equal hashes one is kept.
    pub(super) fn push(
        &mut self,
        (dataset, particles): (&'static str, usize),
        values: Vec<Cell>,
        hashes: impl IntoIterator<Item = String>,
    ) {
        let mut each = Vec::new();
        for hash in hashes {
            if !each.contains(&hash) {
                each.push(hash);
            }
        }
        self.rows.push(Row { dataset, particles, values, hashes: each });
    }
}

impl Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heads = ["Dataset", "particles"].into_iter().map(str::to_owned);
        let heads = heads.chain(self.columns.iter().cloned()).chain(["hash".to_owned()]);
        let mut lines = vec![heads.collect::<Vec<_>>()];
        for row in &self.rows {
            let mut line = vec![row.dataset.to_owned(), row.particles.to_string()];
            line.extend(row.values.iter().map(Cell::to_string));
            line.push(row.hashes.join(" "));
            lines.push(line);
        }
        let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            let cells = lines.iter().filter_map(|line| line.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        writeln!(f, "{}: {}", self.stage, self.title)?;
        for line in &lines {
            for (column, cell) in line.iter().enumerate() {
                let gap = if column == 0 { "" } else { "  " };
                // Names and hashes to the left, numbers to the right.
                if column == 0 || column + 1 == columns {
                    write!(f, "{gap}{cell:<0$}", widths[column])?;
                } else {
                    write!(f, "{gap}{cell:>0$}", widths[column])?;
                }
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
