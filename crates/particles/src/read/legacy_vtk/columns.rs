//! The arrays of points, as columns with standard names.

use crate::read::{MOST_COMPONENTS, Wanted, names};
use crate::{Column, Radius, Values};

/// The columns as far as they are read.
pub(super) struct Columns<'a> {
    wanted: &'a Wanted,
    columns: Vec<Column>,
    radius: Radius,
    warnings: Vec<String>,
}

impl<'a> Columns<'a> {
    pub(super) fn new(wanted: &'a Wanted) -> Self {
        Self { wanted, columns: vec![], radius: Radius::Unknown, warnings: vec![] }
    }

    /// Whether an array is worth reading.
    pub(super) fn wants(&mut self, own: &str, components: usize) -> bool {
        if components > MOST_COMPONENTS {
            let most = MOST_COMPONENTS;
            self.warnings
                .push(format!("{own} has {components} components, more than {most}: left out"));
            return false;
        }
        let standard = names::standard_of(own, components);
        standard == Some(names::RADIUS) || self.wanted.wants(standard.unwrap_or(own))
    }

    /// Adds an array that is wanted; of two with one name the second keeps the file's.
    pub(super) fn add(&mut self, own: String, components: usize, values: Values) {
        let standard = names::standard_of(&own, components);
        if standard == Some(names::RADIUS) && self.radius == Radius::Unknown {
            self.radius =
                Radius::Each((0..values.len()).map(|i| values.number(i) as f32).collect());
            return;
        }
        let free = |name: &&str| self.columns.iter().all(|column| column.name != *name);
        let name = standard.filter(free).map_or(own, str::to_owned);
        self.columns.push(Column::new(name, components, values));
    }

    /// Adds colours: bytes, or 0–1. Three components are a colour, a fourth is its opacity.
    pub(super) fn add_colors(&mut self, own: String, components: usize, values: Values) {
        if !(3..=4).contains(&components) || values.is_empty() {
            if (1..=MOST_COMPONENTS).contains(&components) && self.wanted.wants(&own) {
                self.add(own, components, values);
            }
            return;
        }
        let color = match &values {
            Values::U8(bytes) => Values::U8(of_rows(bytes, components)),
            Values::F32(parts) => Values::F32(of_rows(parts, components)),
            other => other.clone(),
        };
        if components == 4 && self.wanted.wants(names::TRANSPARENCY) {
            let full = if matches!(values, Values::U8(_)) { 255.0 } else { 1.0 };
            let rows = values.len() / 4;
            let seen_through = |row| (1.0 - values.number(4 * row + 3) / full) as f32;
            let transparency = Values::F32((0..rows).map(seen_through).collect());
            self.columns.push(Column::new(names::TRANSPARENCY, 1, transparency));
        }
        let taken = self.columns.iter().any(|column| column.name == names::COLOR);
        let name = if taken { own } else { names::COLOR.to_owned() };
        if self.wanted.wants(&name) {
            self.columns.push(Column::new(name, 3, color));
        }
    }

    /// Radius, columns and warnings; what does not have a value for each of `rows` is left out.
    pub(super) fn finish(mut self, rows: usize) -> (Radius, Vec<Column>, Vec<String>) {
        self.columns.retain(|column| column.rows() == rows);
        (self.radius, names::joined(self.columns), self.warnings)
    }
}

/// The first three of every `components` values.
fn of_rows<T: Copy>(values: &[T], components: usize) -> Vec<T> {
    values.chunks_exact(components).flat_map(|row| row.iter().take(3).copied()).collect()
}
