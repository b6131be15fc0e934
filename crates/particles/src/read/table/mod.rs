//! Tables in text: CSV from ParaView, spreadsheets and scripts, and columns parted by blanks or tabs.
//!
//! Nothing in such a file says what it is, so the plan is guessed from its first 64 KiB ([`layout`]), and
//! the meaning of a column from its name ([`columns`]). A table is one frame.

mod columns;
mod layout;

use super::rows::{self, Schema};
use super::text::Lines;
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted, only_frame};
use crate::{Particles, Place, Radius, ReadError, Result};
use columns::Roles;
use layout::Layout;

/// Tables in text.
pub(super) struct Table;

const EXTENSIONS: [&str; 10] =
    ["csv", "tsv", "tab", "txt", "dat", "asc", "ascii", "pts", "xyz", "table"];

impl Format for Table {
    fn name(&self) -> &'static str {
        "text table"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        if !is_text(head.bytes) {
            return Confidence::No;
        }
        let named = head.has_extension(&EXTENSIONS);
        match Layout::guess(head) {
            Ok(_) if named => Confidence::Likely,
            Ok(_) => Confidence::Perhaps,
            // The error will say why it is no table.
            Err(_) if named => Confidence::Perhaps,
            Err(_) => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        let layout = Layout::guess(&input.head())
            .map_err(|(line, message)| ReadError::new(input.path(), Place::Line(line), message))?;
        let roles = Roles::of(&layout).map_err(|message| {
            ReadError::new(input.path(), Place::Line(layout.first_row), message)
        })?;
        let warnings = roles.warning.iter().cloned().collect();
        Ok(Box::new(Rows { lines: Lines::new(input), layout, roles, warnings }))
    }
}

/// Whether `bytes` has no control characters but those of text.
fn is_text(bytes: &[u8]) -> bool {
    !bytes.iter().any(|b| *b < 0x20 && !matches!(b, b'\n' | b'\r' | b'\t' | b'\x0c'))
}

struct Rows {
    lines: Lines,
    layout: Layout,
    roles: Roles,
    warnings: Vec<String>,
}

impl Reader for Rows {
    fn count(&mut self, _progress: Progress<'_>) -> Result<usize> {
        Ok(1)
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        only_frame(self.lines.input().path(), frame)?;
        self.lines.go_to(super::text::Mark::START)?;
        self.lines.skip(self.layout.first_row - 1)?;
        let mut schema = Schema {
            groups: self.roles.groups.clone(),
            fields: self.roles.fields.clone(),
            separator: self.layout.separator,
            loose: true,
        };
        schema.keep_wanted(wanted);
        let present = self.roles.present;
        let place = |p: [f64; 3]| std::array::from_fn(|i| if present[i] { p[i] } else { 0.0 });
        let mut particles = rows::read_guessing(&mut self.lines, schema, None, &place, progress)?;
        if let Some(why) = self.lines.broken() {
            return Err(self.lines.cut(&format!("the end of the table ({why})")));
        }
        if let (true, Radius::Each(radii)) = (self.roles.diameter, &mut particles.radius) {
            radii.iter_mut().for_each(|r| *r *= 0.5);
        }
        self.check_count(particles.len() as u64)?;
        Ok(particles)
    }

    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }
}

impl Rows {
    /// Compares with the number of rows that the table's first line declares.
    fn check_count(&mut self, found: u64) -> Result<()> {
        let Some(declared) = self.layout.declared.filter(|n| *n != found) else { return Ok(()) };
        if found < declared {
            let expected = format!("{declared} rows as the first line says ({found} are there)");
            return Err(self.lines.cut(&expected));
        }
        let warning = format!("the first line says {declared} rows, {found} are there");
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
        Ok(())
    }
}
