//! Rows of text, one particle each, read into columns.
//!
//! A format describes its rows by a [`Schema`]: which output column, and which component of it, each
//! field of a line belongs to. [`read_rows`] does the rest, a block at a time, in parallel, with the
//! same result for any number of threads.

use super::dictionary::Dictionary;
use super::text::{self, Block, Lines, Separator, Wrong};
use super::{Progress, Wanted, names};
use crate::{Column, Particles, PositionBuilder, Radius, ReadError, Values};

/// What the values of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Numbers, kept in double precision.
    Real,
    /// Numbers, kept as integers while all are.
    Integer,
    /// As `Integer`; if something else turns up, the rows must be read again with it as `Name`.
    Guess,
    /// Words.
    Name,
    /// `T` or `F`, kept as 1 and 0.
    Logical,
}

/// A column that rows are read into.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Standard name; `Position` and `Radius` go where [`Particles`] keeps them.
    pub(super) name: String,
    /// Values per row.
    pub(super) components: usize,
    /// What they are.
    pub(super) kind: Kind,
}

/// No more columns than this: what has more is not about particles.
pub(super) const MOST_COLUMNS: usize = 1000;

/// How lines become rows.
#[derive(Clone, Debug)]
pub(super) struct Schema {
    /// The columns.
    pub(super) groups: Vec<Group>,
    /// For each field of a line its group and component, or nothing where it is left out.
    pub(super) fields: Vec<Option<(usize, usize)>>,
    /// What parts the fields.
    pub(super) separator: Separator,
    /// Tables made by hand or by spreadsheets: empty lines, lines that begin with `#` or `%` do not
    /// count, and a number may be missing (it becomes NaN).
    pub(super) loose: bool,
}

/// The index of the group called `name`, made by `make` if there is none.
pub(super) fn group_index(
    groups: &mut Vec<Group>,
    name: &str,
    make: impl FnOnce() -> Group,
) -> usize {
    groups.iter().position(|g| g.name == name).unwrap_or_else(|| {
        groups.push(make());
        groups.len() - 1
    })
}

impl Schema {
    /// Leaves out what is not wanted; positions and radii always are.
    pub(super) fn keep_wanted(&mut self, wanted: &Wanted) {
        for field in &mut self.fields {
            let keep = |(group, _): &(usize, usize)| {
                let name = &self.groups[*group].name;
                name == names::POSITION || name == names::RADIUS || wanted.wants(name)
            };
            *field = field.filter(keep);
        }
    }

    /// Settles guesses by the first row: what is no number there is a word everywhere.
    pub(super) fn settle(&mut self, first_row: &str) {
        for (token, field) in text::fields(first_row.as_bytes(), self.separator).zip(&self.fields) {
            if let Some(group) = field.and_then(|(group, _)| self.groups.get_mut(group))
                && group.kind == Kind::Guess
                && text::real(token).is_none()
            {
                group.kind = Kind::Name;
            }
        }
    }

    /// How many fields a line must have.
    pub(super) fn needed_fields(&self) -> usize {
        self.fields.len()
    }

    /// The groups that have a field.
    fn used(&self) -> Vec<bool> {
        let mut used = vec![false; self.groups.len()];
        for (group, _) in self.fields.iter().flatten() {
            used[*group] = true;
        }
        used
    }
}

/// The values of a group, row by row.
#[derive(Debug)]
enum Cells {
    Integer(Vec<i64>),
    Real(Vec<f64>),
    Byte(Vec<u8>),
    Word(Dictionary),
}

impl Cells {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Real => Self::Real(Vec::new()),
            Kind::Integer | Kind::Guess => Self::Integer(Vec::new()),
            Kind::Logical => Self::Byte(Vec::new()),
            Kind::Name => Self::Word(Dictionary::default()),
        }
    }

    fn add_row(&mut self, components: usize) {
        match self {
            Self::Integer(v) => v.resize(v.len() + components, 0),
            Self::Real(v) => v.resize(v.len() + components, f64::NAN),
            Self::Byte(v) => v.resize(v.len() + components, 0),
            Self::Word(d) => d.codes.resize(d.codes.len() + components, 0),
        }
    }

    /// Integers as real numbers, from here on.
    fn make_real(&mut self) {
        if let Self::Integer(v) = self {
            *self = Self::Real(v.iter().map(|i| *i as f64).collect());
        }
    }

    /// Sets the value `back` places before the end; says whether `token` could be one.
    fn set(&mut self, back: usize, token: &[u8]) -> bool {
        match self {
            Self::Real(v) => match text::real(token) {
                Some(value) => {
                    let at = v.len() - back;
                    v[at] = value;
                    true
                }
                None => false,
            },
            Self::Integer(v) => match text::integer(token) {
                Some(value) => {
                    let at = v.len() - back;
                    v[at] = value;
                    true
                }
                None if text::real(token).is_some() => {
                    self.make_real();
                    self.set(back, token)
                }
                None => false,
            },
            Self::Byte(v) => match logical(token) {
                Some(value) => {
                    let at = v.len() - back;
                    v[at] = u8::from(value);
                    true
                }
                None => false,
            },
            Self::Word(d) => {
                let at = d.codes.len() - back;
                d.codes[at] = d.code(token);
                true
            }
        }
    }

    /// Marks the value `back` places before the end as missing.
    fn set_missing(&mut self, back: usize) {
        self.make_real();
        if let Self::Real(v) = self {
            let at = v.len() - back;
            v[at] = f64::NAN;
        }
    }

    fn append(&mut self, mut other: Self) {
        if matches!(self, Self::Real(_)) {
            other.make_real();
        } else if matches!(other, Self::Real(_)) {
            self.make_real();
        }
        match (self, other) {
            (Self::Integer(a), Self::Integer(b)) => a.extend(b),
            (Self::Real(a), Self::Real(b)) => a.extend(b),
            (Self::Byte(a), Self::Byte(b)) => a.extend(b),
            (Self::Word(a), Self::Word(b)) => a.append(b),
            // A group has one kind, and numbers were made alike above.
            (_, _) => {}
        }
    }

    fn reserve(&mut self, values: usize) {
        match self {
            Self::Integer(v) => v.reserve_exact(values),
            Self::Real(v) => v.reserve_exact(values),
            Self::Byte(v) => v.reserve_exact(values),
            Self::Word(d) => d.codes.reserve_exact(values),
        }
    }

    fn into_values(self) -> Values {
        match self {
            Self::Integer(v) => Values::I64(v),
            Self::Real(v) => Values::F64(v),
            Self::Byte(v) => Values::U8(v),
            Self::Word(d) => d.into_values(),
        }
    }
}

fn logical(token: &[u8]) -> Option<bool> {
    match token {
        b"T" | b"t" | b"1" => Some(true),
        b"F" | b"f" | b"0" => Some(false),
        _ if token.eq_ignore_ascii_case(b"true") => Some(true),
        _ if token.eq_ignore_ascii_case(b"false") => Some(false),
        _ => None,
    }
}

/// Whether a table leaves a number out with `token`.
pub(super) fn is_missing(token: &[u8]) -> bool {
    const WORDS: [&str; 9] = ["", "na", "n/a", "null", "none", "-", "--", "?", "#n/a"];
    token.len() <= 4 && WORDS.iter().any(|w| token.eq_ignore_ascii_case(w.as_bytes()))
}

/// Whether a line of a loose table holds no row.
pub(super) fn is_comment(line: &[u8]) -> bool {
    matches!(text::trim(line).first(), None | Some(b'#' | b'%'))
}

/// Rows of one chunk or of the whole frame.
struct Part {
    cells: Vec<Cells>,
    /// Groups of kind `Guess` that hold something else than numbers.
    words: Vec<bool>,
}

impl Part {
    fn new(schema: &Schema) -> Self {
        let cells = schema.groups.iter().map(|g| Cells::new(g.kind)).collect();
        Self { cells, words: vec![false; schema.groups.len()] }
    }
}

fn parse_chunk(chunk: &[u8], schema: &Schema, used: &[bool]) -> std::result::Result<Part, Wrong> {
    let mut part = Part::new(schema);
    let mut start = 0;
    while start < chunk.len() {
        let end = memchr::memchr(b'\n', &chunk[start..]).map_or(chunk.len(), |i| start + i);
        let line = &chunk[start..end];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if !(schema.loose && is_comment(line)) {
            parse_row(line, schema, used, &mut part)
                .map_err(|message| Wrong { at: start, message })?;
        }
        start = end + 1;
    }
    Ok(part)
}

fn parse_row(
    line: &[u8],
    schema: &Schema,
    used: &[bool],
    part: &mut Part,
) -> std::result::Result<(), String> {
    for ((cells, group), used) in part.cells.iter_mut().zip(&schema.groups).zip(used) {
        if *used {
            cells.add_row(group.components);
        }
    }
    let mut tokens = text::fields(line, schema.separator);
    for (i, field) in schema.fields.iter().enumerate() {
        let Some(token) = tokens.next() else {
            let needed = schema.needed_fields();
            return Err(format!("expected {needed} values, found {i} in {}", text::shown(line)));
        };
        let Some((index, component)) = *field else { continue };
        let group = &schema.groups[index];
        let cells = &mut part.cells[index];
        let back = group.components - component;
        if cells.set(back, token) {
            continue;
        }
        if schema.loose && is_missing(token) {
            cells.set_missing(back);
        } else if let Some(value) = decimal_comma(token, schema) {
            cells.make_real();
            cells.set(back, &value);
        } else if group.kind == Kind::Guess {
            part.words[index] = true;
        } else {
            let what = if group.kind == Kind::Logical { "T or F" } else { "a number" };
            return Err(format!(
                "expected {what} for {}, found {}",
                group.name,
                text::shown(token)
            ));
        }
    }
    match tokens.find(|t| schema.loose && !t.is_empty()) {
        Some(extra) => Err(format!(
            "expected {} values, found more: {}",
            schema.needed_fields(),
            text::shown(extra)
        )),
        None => Ok(()),
    }
}

/// `1,5` in a table parted by semicolons.
fn decimal_comma(token: &[u8], schema: &Schema) -> Option<Vec<u8>> {
    if schema.separator != Separator::Byte(b';') || token.len() > 64 || !token.contains(&b',') {
        return None;
    }
    let token: Vec<u8> = token.iter().map(|b| if *b == b',' { b'.' } else { *b }).collect();
    text::real(&token).map(|_| token)
}

/// A frame that ends before its last row.
#[derive(Debug)]
pub(super) enum Stop {
    /// The file ends inside; the error says what is missing.
    Cut(ReadError),
    /// Anything else.
    Error(ReadError),
}

impl From<ReadError> for Stop {
    fn from(error: ReadError) -> Self {
        Self::Error(error)
    }
}

impl From<Stop> for ReadError {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Cut(error) | Stop::Error(error) => error,
        }
    }
}

/// What [`read_rows`] gives.
pub(super) struct RowData {
    /// Groups of kind `Guess` that hold words: change their kind and read again.
    pub(super) words: Vec<usize>,
    positions: PositionBuilder,
    cells: Vec<(Group, Cells)>,
}

/// Reads `rows` rows (lines), or all that follow, from where `lines` stands.
///
/// `place` turns a position of the file into one in the file's coordinates (scaled → absolute).
///
/// # Errors
/// `Cut` where the file has fewer rows, unless all were asked for; broken rows.
pub(super) fn read_rows(
    lines: &mut Lines,
    schema: &Schema,
    rows: Option<u64>,
    place: &dyn Fn([f64; 3]) -> [f64; 3],
    progress: Progress<'_>,
) -> std::result::Result<RowData, Stop> {
    let used = schema.used();
    let mut whole = Part::new(schema);
    let mut positions = PositionBuilder::default();
    let position_group = schema.groups.iter().position(|g| g.name == names::POSITION);
    if let (Some(rows), Some(room)) = (rows, lines.room_for(2 * schema.needed_fields() as u64)) {
        let expected = usize::try_from(rows.min(room)).unwrap_or(0);
        for (i, (cells, group)) in whole.cells.iter_mut().zip(&schema.groups).enumerate() {
            if used[i] && position_group != Some(i) {
                cells.reserve(expected.saturating_mul(group.components));
            }
        }
    }
    let mut left = rows.unwrap_or(u64::MAX);
    loop {
        let parsed = match lines.block(left)? {
            None => break,
            Some(block) => {
                left -= block.lines;
                parse_block(&block, schema, &used)
            }
        };
        let parts = parsed.map_err(|bad| bad.into_stop(lines))?;
        for mut part in parts {
            if let Some(i) = position_group
                && let Cells::Real(v) =
                    std::mem::replace(&mut part.cells[i], Cells::Real(Vec::new()))
            {
                let (points, _) = v.as_chunks::<3>();
                let points: Vec<_> = points.iter().map(|p| place(*p)).collect();
                positions.push(&points);
            }
            whole.words.iter_mut().zip(&part.words).for_each(|(all, one)| *all |= one);
            whole.cells.iter_mut().zip(part.cells).for_each(|(all, one)| all.append(one));
        }
        let (done, all) = lines.progress();
        progress(done, all);
    }
    if rows.is_some() && left > 0 {
        return Err(Stop::Cut(lines.cut(&format!("{left} more rows"))));
    }
    let words = (0..whole.words.len()).filter(|i| whole.words[*i]).collect();
    let cells = schema.groups.iter().cloned().zip(whole.cells).zip(used);
    let cells = cells.filter(|(_, used)| *used).map(|(both, _)| both).collect();
    Ok(RowData { words, positions, cells })
}

/// A broken row.
struct BadRow {
    line: u64,
    message: String,
    /// It is the file's last line and has no end: the file was cut there.
    cut: bool,
}

impl BadRow {
    fn into_stop(self, lines: &Lines) -> Stop {
        if self.cut {
            let message = format!("{}, where {}", self.message, lines.end());
            return Stop::Cut(lines.error(self.line, message));
        }
        Stop::Error(lines.error(self.line, self.message))
    }
}

fn parse_block(
    block: &Block<'_>,
    schema: &Schema,
    used: &[bool],
) -> std::result::Result<Vec<Part>, BadRow> {
    block.map_chunks(|chunk| parse_chunk(chunk, schema, used)).map_err(|wrong| {
        let line = block.line_of(wrong.at);
        let cut = !block.bytes.ends_with(b"\n") && line + 1 == block.first_line + block.lines;
        BadRow { line, message: wrong.message, cut }
    })
}

/// Goes past `rows` rows; only where the last one has no line end, and may be cut, it is read.
///
/// # Errors
/// `Cut` where the file has fewer rows.
pub(super) fn skip_rows(
    lines: &mut Lines,
    schema: &Schema,
    rows: u64,
) -> std::result::Result<(), Stop> {
    let skipped = lines.skip(rows.saturating_sub(1))?;
    let last = if rows > 0 { lines.block(1)? } else { return Ok(()) };
    match last {
        None => Err(Stop::Cut(lines.cut(&format!("{} more rows", rows - skipped)))),
        Some(block) if block.bytes.ends_with(b"\n") => Ok(()),
        Some(block) => match parse_block(&block, schema, &schema.used()) {
            Ok(_) if rows == skipped + 1 => Ok(()),
            Ok(_) => Err(Stop::Cut(lines.cut("more rows"))),
            Err(bad) => Err(bad.into_stop(lines)),
        },
    }
}

/// Reads rows as [`read_rows`] does, and once more where a guess at numbers was wrong.
///
/// # Errors
/// As [`read_rows`].
pub(super) fn read_guessing(
    lines: &mut Lines,
    mut schema: Schema,
    rows: Option<u64>,
    place: &dyn Fn([f64; 3]) -> [f64; 3],
    progress: Progress<'_>,
) -> std::result::Result<Particles, Stop> {
    let start = lines.mark();
    let mut data = read_rows(lines, &schema, rows, place, progress)?;
    if !data.words.is_empty() {
        for group in std::mem::take(&mut data.words) {
            schema.groups[group].kind = Kind::Name;
        }
        drop(data);
        lines.go_to(start)?;
        data = read_rows(lines, &schema, rows, place, progress)?;
    }
    Ok(data.into_particles())
}

impl RowData {
    /// The rows as particles; box, time and step are left to the caller.
    pub(super) fn into_particles(self) -> Particles {
        let (origin, positions) = self.positions.finish();
        let mut particles = Particles { origin, positions, ..Particles::default() };
        for (group, cells) in self.cells {
            if group.name == names::POSITION {
                continue;
            }
            if group.name == names::RADIUS
                && let Cells::Real(radii) = &cells
            {
                particles.radius = Radius::Each(radii.iter().map(|r| *r as f32).collect());
                continue;
            }
            let values = cells.into_values();
            particles.columns.push(Column::new(group.name, group.components, values));
        }
        particles
    }
}

/// `standard` if no group has that name yet, else `own`, numbered if that is taken too.
pub(super) fn free_name(groups: &[Group], standard: &str, own: &str) -> String {
    let taken = |name: &str| groups.iter().any(|g| g.name == name);
    if !taken(standard) {
        return standard.to_owned();
    }
    let numbered = (groups.len()..).map(|i| format!("{own}.{i}"));
    std::iter::once(own.to_owned()).chain(numbered).find(|n| !taken(n)).unwrap_or_default()
}
