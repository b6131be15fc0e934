//! XYZ and extended XYZ.
//!
//! A frame is the number of particles, a line of comment, and a line for each particle. In extended XYZ
//! the comment is a list of `key=value`: `Properties=species:S:1:pos:R:3:…` names the columns (R real,
//! I integer, S word, L logical, each with its number of components), `Lattice="ax ay az bx by bz cx cy cz"`
//! is the box, `Origin` its corner, `pbc` its periodic directions (all, where a lattice is given without).
//! `Time` and `Step` (or `Timestep`) are the frame's. Values are bare, quoted, or arrays in brackets; a
//! nested array for `Lattice` has the vectors as its columns, as libAtoms' specification says.
//!
//! Without `Properties` a line is `species x y z`, or `x y z` where it has three fields; what follows is
//! kept as `Column 5`, `Column 6` …

use super::rows::{self, Group, Kind, Schema, Stop};
use super::text::{self, Lines, Separator};
use super::trajectory::{Layout, Trajectory};
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted, names};
use crate::{Particles, Radius, Result, SimulationBox};

/// XYZ and extended XYZ.
pub(super) struct Xyz;

impl Format for Xyz {
    fn name(&self) -> &'static str {
        "XYZ"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        let mut lines = head.lines();
        let Some(count) = lines.next().and_then(|line| parse_count(&line)) else {
            return Confidence::No;
        };
        let comment = lines.next().unwrap_or_default();
        if comment.contains("Properties=") && comment.contains(":R:3") {
            return Confidence::Certain;
        }
        let named = head.has_extension(&["xyz", "extxyz", "exyz"]);
        let row = lines.next().unwrap_or_default();
        let tokens: Vec<_> = row.split_ascii_whitespace().collect();
        let numeric = |t: &&str| text::real(t.as_bytes()).is_some();
        let fits = match tokens.len() {
            0 => count == 0,
            1 | 2 => false,
            // `x y z` alone is a table behind its count, unless the line before is no row of it.
            3 => tokens.iter().all(numeric) && !rows_alike(&comment, &row),
            _ => tokens[1..4].iter().all(numeric) && (named || !rows_alike(&comment, &row)),
        };
        match (fits, named) {
            (true, true) => Confidence::Certain,
            (true, false) => Confidence::Likely,
            (false, true) => Confidence::Perhaps,
            (false, false) => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        Ok(Box::new(Trajectory::open(Frame, input)?))
    }
}

/// Whether both lines have as many fields, and numbers and words in the same places.
fn rows_alike(a: &str, b: &str) -> bool {
    let kinds = |line: &str| -> Vec<bool> {
        line.split_ascii_whitespace().map(|t| text::real(t.as_bytes()).is_some()).collect()
    };
    kinds(a) == kinds(b)
}

fn parse_count(line: &str) -> Option<u64> {
    text::integer(line.trim().trim_start_matches('\u{feff}').as_bytes())
        .and_then(|n| u64::try_from(n).ok())
}

struct Frame;

struct Header {
    count: u64,
    schema: Schema,
    diameter: bool,
    sim_box: Option<SimulationBox>,
    time: Option<f64>,
    step: Option<i64>,
}

impl Layout for Frame {
    type Header = Header;

    fn header(&self, lines: &mut Lines) -> std::result::Result<Option<Header>, Stop> {
        let first = loop {
            match lines.next_line()? {
                None => return Ok(None),
                Some(line) if line.text.trim().is_empty() => {}
                Some(line) => break line,
            }
        };
        let Some(count) = parse_count(&first.text) else {
            let found = text::shown(first.text.trim().as_bytes());
            let message = format!("expected the number of particles, found {found}");
            return Err(Stop::Error(lines.error(first.number, message)));
        };
        let comment = match lines.next_line()? {
            Some(line) if line.ended || count == 0 => line,
            None if count == 0 && first.ended => first,
            _ => return Err(Stop::Cut(lines.cut("a line of comment and the particles"))),
        };
        let pairs = parse_comment(&comment.text);
        let row = if count > 0 { lines.peek()? } else { None };
        let row = row.as_ref().map_or("", |line| &line.text);
        let (mut schema, diameter) = match find(&pairs, &["properties"]) {
            Some(properties) => declared_schema(properties)
                .map_err(|message| lines.error(comment.number, message))?,
            None => (plain_schema(row), false),
        };
        schema.settle(row);
        let number =
            |keys: &[&str]| find(&pairs, keys).and_then(|v| text::real(v.trim().as_bytes()));
        let step = find(&pairs, &["timestep", "step", "frame_step"])
            .and_then(|v| text::integer(v.trim().as_bytes()));
        let sim_box = parse_box(&pairs);
        Ok(Some(Header { count, schema, diameter, sim_box, time: number(&["time"]), step }))
    }

    fn skip(&self, header: &Header, lines: &mut Lines) -> std::result::Result<(), Stop> {
        rows::skip_rows(lines, &header.schema, header.count)
    }

    fn read(
        &self,
        header: &Header,
        lines: &mut Lines,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> std::result::Result<Particles, Stop> {
        let mut schema = header.schema.clone();
        schema.keep_wanted(wanted);
        let mut particles =
            rows::read_guessing(lines, schema, Some(header.count), &|p| p, progress)?;
        if let (true, Radius::Each(radii)) = (header.diameter, &mut particles.radius) {
            radii.iter_mut().for_each(|r| *r *= 0.5);
        }
        particles.sim_box = header.sim_box;
        particles.time = header.time;
        particles.step = header.step;
        Ok(particles)
    }
}

/// The `key=value` pairs of a comment, keys in lower case. Text that is none is passed over.
fn parse_comment(comment: &str) -> Vec<(String, String)> {
    let mut pairs = Vec::new();
    let mut rest = comment.trim_start();
    while !rest.is_empty() {
        let end = rest.find(|c: char| c == '=' || c.is_whitespace()).unwrap_or(rest.len());
        let key = rest[..end].trim_matches('"').to_ascii_lowercase();
        rest = &rest[end..];
        // Blanks around the equals sign are allowed.
        let after = rest.trim_start();
        let Some(value) = after.strip_prefix('=') else {
            rest = after;
            continue;
        };
        let (value, after) = take_value(value.trim_start());
        pairs.push((key, value));
        rest = after.trim_start();
    }
    pairs
}

/// The value that `text` begins with, without its quotes or outer brackets, and what follows.
fn take_value(text: &str) -> (String, &str) {
    let close = match text.as_bytes().first() {
        Some(b'"') => '"',
        Some(b'\'') => '\'',
        Some(b'{') => '}',
        Some(b'[') => return take_brackets(text),
        _ => {
            let end = text.find(char::is_whitespace).unwrap_or(text.len());
            // `time = 0.5, E = …`
            return (text[..end].trim_end_matches(',').to_owned(), &text[end..]);
        }
    };
    let inner = &text[1..];
    let mut escaped = false;
    for (i, c) in inner.char_indices() {
        if c == close && !escaped {
            return (inner[..i].to_owned(), &inner[i + c.len_utf8()..]);
        }
        escaped = c == '\\' && !escaped;
    }
    (inner.to_owned(), "")
}

/// `[…]` with all that is nested in it; the outermost brackets stay.
fn take_brackets(text: &str) -> (String, &str) {
    let mut depth = 0_usize;
    for (i, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return (text[..=i].to_owned(), &text[i + 1..]);
        }
    }
    (text.to_owned(), "")
}

fn find<'a>(pairs: &'a [(String, String)], keys: &[&str]) -> Option<&'a str> {
    pairs.iter().find(|(key, _)| keys.contains(&key.as_str())).map(|(_, value)| value.as_str())
}

fn words(value: &str) -> impl Iterator<Item = &str> {
    value
        .split(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']'))
        .filter(|w| !w.is_empty())
}

/// A box from `Lattice`, `Origin` and `pbc`; none where these are not what they should be, for a comment
/// may hold anything.
fn parse_box(pairs: &[(String, String)]) -> Option<SimulationBox> {
    let numbers = |value: &str| -> Option<Vec<f64>> {
        words(value).map(|w| text::real(w.as_bytes())).collect()
    };
    let lattice = find(pairs, &["lattice", "cell"])?;
    let values = numbers(lattice)?;
    let vectors = match values[..] {
        [a, b, c] => [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]],
        [ax, ay, az, bx, by, bz, cx, cy, cz] if !lattice.starts_with("[[") => {
            [[ax, ay, az], [bx, by, bz], [cx, cy, cz]]
        }
        [ax, bx, cx, ay, by, cy, az, bz, cz] => [[ax, ay, az], [bx, by, bz], [cx, cy, cz]],
        _ => return None,
    };
    let origin =
        find(pairs, &["origin", "cell_origin"]).and_then(numbers).and_then(|v| v.try_into().ok());
    let flag = |w: &str| match w.to_ascii_lowercase().as_str() {
        "t" | "1" | "true" => Some(true),
        "f" | "0" | "false" => Some(false),
        _ => None,
    };
    let periodic: Option<Vec<bool>> =
        find(pairs, &["pbc"]).and_then(|v| words(v).map(flag).collect());
    let periodic = periodic.and_then(|v| v.try_into().ok()).unwrap_or([true; 3]);
    Some(SimulationBox { origin: origin.unwrap_or_default(), vectors, periodic })
}

fn position_group() -> Group {
    Group { name: names::POSITION.into(), components: 3, kind: Kind::Real }
}

/// The columns that `Properties` declares; whether its radii are diameters.
fn declared_schema(properties: &str) -> std::result::Result<(Schema, bool), String> {
    let parts: Vec<&str> = properties.trim().split(':').collect();
    let (triples, rest) = parts.as_chunks::<3>();
    if !rest.is_empty() || triples.is_empty() {
        return Err(format!(
            "expected Properties=name:type:count:…, found {}",
            text::shown(properties.as_bytes())
        ));
    }
    let mut schema =
        Schema { groups: vec![], fields: vec![], separator: Separator::Blank, loose: false };
    let has_radius = triples.iter().any(|[name, ..]| names::standard(name) == Some(names::RADIUS));
    let mut diameter = false;
    for [name, kind, count] in triples {
        let components = count.parse().ok().filter(|n| (1..=rows::MOST_COLUMNS).contains(n));
        let Some(components) = components else {
            return Err(format!(
                "expected the number of components of {name}, found {}",
                text::shown(count.as_bytes())
            ));
        };
        let standard = names::standard(name).unwrap_or(name);
        let is_diameter = !has_radius && name.eq_ignore_ascii_case("diameter");
        let standard = if is_diameter { names::RADIUS } else { standard };
        diameter |= is_diameter;
        let fitting = match standard {
            names::POSITION => components == 3,
            names::RADIUS | names::PARTICLE_TYPE => components == 1,
            _ => true,
        };
        let kind = match (*kind, standard) {
            (_, names::POSITION | names::RADIUS) if fitting => Kind::Real,
            ("R", _) => Kind::Real,
            ("I", _) => Kind::Integer,
            ("S", names::PARTICLE_TYPE) => Kind::Guess,
            ("S", _) => Kind::Name,
            ("L", _) => Kind::Logical,
            _ => {
                return Err(format!(
                    "expected R, I, S or L as the type of {name}, found {}",
                    text::shown(kind.as_bytes())
                ));
            }
        };
        // A vector called `Radius` must not be taken for radii.
        let fallback = name.to_ascii_lowercase();
        let wish = if fitting { standard } else { &fallback };
        let own = rows::free_name(&schema.groups, wish, name);
        let group = schema.groups.len();
        schema.groups.push(Group { name: own, components, kind });
        schema.fields.extend((0..components).map(|c| Some((group, c))));
        if schema.fields.len() > rows::MOST_COLUMNS {
            return Err(format!("expected at most {} columns, found more", rows::MOST_COLUMNS));
        }
    }
    if !schema.groups.iter().any(|g| g.name == names::POSITION) {
        return Err(format!(
            "expected pos:R:3 among the properties, found {}",
            text::shown(properties.as_bytes())
        ));
    }
    Ok((schema, diameter))
}

/// The columns of a plain file, from its first row.
fn plain_schema(row: &str) -> Schema {
    let fields = row.split_ascii_whitespace().count().min(rows::MOST_COLUMNS);
    let mut groups = vec![position_group()];
    let mut schema_fields = Vec::new();
    if fields != 3 {
        groups.push(Group { name: names::PARTICLE_TYPE.into(), components: 1, kind: Kind::Guess });
        schema_fields.push(Some((1, 0)));
    }
    schema_fields.extend((0..3).map(|axis| Some((0, axis))));
    for column in 5..=fields {
        groups.push(Group { name: format!("Column {column}"), components: 1, kind: Kind::Guess });
        schema_fields.push(Some((groups.len() - 1, 0)));
    }
    Schema { groups, fields: schema_fields, separator: Separator::Blank, loose: false }
}
