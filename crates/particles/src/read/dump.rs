//! LAMMPS dump files in text, by the documentation of LAMMPS' `dump` and `Howto_triclinic`.
//!
//! A frame is a list of items, `ITEM: NAME …`, each with its lines:
//! - `TIMESTEP`, one integer; `TIME`, one number; `UNITS`, one word;
//! - `NUMBER OF ATOMS`, one integer;
//! - `BOX BOUNDS pp pp pp`, three lines `lo hi`. With `xy xz yz` before the flags there are three lines
//!   `lo_bound hi_bound tilt` of the box that bounds the restricted triclinic one:
//!   xlo = xlo_bound − min(0, xy, xz, xy+xz), xhi = xhi_bound − max(0, xy, xz, xy+xz),
//!   ylo = ylo_bound − min(0, yz), yhi = yhi_bound − max(0, yz).
//!   With `abc origin` there are three lines `ax ay az ox`, `bx by bz oy`, `cx cy cz oz`;
//! - `ATOMS column …`, a line for each atom; without names, `id type xs ys zs`.
//!
//! Coordinates are taken from `x`, else `xu`, `xs`, `xsu` (likewise y, z); the last two are fractions of
//! the box: origin + sx·a + sy·b + sz·c. Positions are not wrapped.

use super::rows::{self, Group, Kind, Schema, Stop};
use super::text::{self, Lines, Separator};
use super::trajectory::{Layout, Trajectory};
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted, names};
use crate::{Particles, Radius, Result, SimulationBox};

/// LAMMPS dump files in text.
pub(super) struct LammpsDump;

impl Format for LammpsDump {
    fn name(&self) -> &'static str {
        "LAMMPS dump"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        let first = head.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        if first.starts_with("ITEM:") { Confidence::Certain } else { Confidence::No }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        Ok(Box::new(Trajectory::open(Frame, input)?))
    }
}

struct Frame;

struct Header {
    atoms: u64,
    columns: Columns,
    sim_box: Option<SimulationBox>,
    time: Option<f64>,
    step: Option<i64>,
}

/// The columns of `ITEM: ATOMS`, resolved.
struct Columns {
    schema: Schema,
    /// Which axes are fractions of the box.
    scaled: [bool; 3],
    /// Which axes are given at all.
    present: [bool; 3],
    /// The radii are diameters.
    diameter: bool,
}

impl Layout for Frame {
    type Header = Header;

    fn header(&self, lines: &mut Lines) -> std::result::Result<Option<Header>, Stop> {
        let mut header =
            Header { atoms: 0, columns: columns("", None), sim_box: None, time: None, step: None };
        let mut atoms = None;
        let mut begun = false;
        loop {
            let Some(line) = lines.next_line()? else {
                return if begun { Err(Stop::Cut(lines.cut("ITEM: ATOMS"))) } else { Ok(None) };
            };
            let text = line.text.trim();
            if text.is_empty() && !begun {
                continue;
            }
            let Some(item) = text.strip_prefix("ITEM:").map(str::trim) else {
                let message = format!("expected ITEM:, found {}", text::shown(text.as_bytes()));
                // Cut inside the word, at the end of the file.
                let cut = !line.ended && "ITEM:".starts_with(text);
                let error = lines.error(line.number, message);
                return Err(if cut { Stop::Cut(error) } else { Stop::Error(error) });
            };
            begun = true;
            // The last line of the file may be cut; only an empty frame can end with its names.
            let names = item.strip_prefix("ATOMS");
            if !line.ended && (names.is_none() || atoms != Some(0)) {
                return Err(Stop::Cut(lines.cut("the lines of the item")));
            }
            if let Some(names) = names {
                header.atoms = atoms.ok_or_else(|| {
                    lines.error(line.number, "expected ITEM: NUMBER OF ATOMS before ITEM: ATOMS")
                })?;
                let first = if header.atoms > 0 { lines.peek()? } else { None };
                header.columns = columns(names, first.as_ref().map(|l| l.text.as_str()));
                check_columns(&header, lines, line.number)?;
                return Ok(Some(header));
            }
            match item {
                "NUMBER OF ATOMS" => {
                    let count = |t: &[u8]| text::integer(t).and_then(|n| u64::try_from(n).ok());
                    atoms = Some(value(lines, "the number of atoms", count)?);
                }
                _ => header.item(item, &line, lines)?,
            }
        }
    }

    fn skip(&self, header: &Header, lines: &mut Lines) -> std::result::Result<(), Stop> {
        rows::skip_rows(lines, &header.columns.schema, header.atoms)
    }

    fn read(
        &self,
        header: &Header,
        lines: &mut Lines,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> std::result::Result<Particles, Stop> {
        let mut schema = header.columns.schema.clone();
        schema.keep_wanted(wanted);
        let place = |p| header.columns.place(p, header.sim_box.as_ref());
        let mut particles =
            rows::read_guessing(lines, schema, Some(header.atoms), &place, progress)?;
        if let (true, Radius::Each(radii)) = (header.columns.diameter, &mut particles.radius) {
            radii.iter_mut().for_each(|r| *r *= 0.5);
        }
        particles.sim_box = header.sim_box;
        particles.time = header.time;
        particles.step = header.step;
        Ok(particles)
    }
}

impl Header {
    /// Reads the lines of an item that says something about the frame.
    fn item(
        &mut self,
        item: &str,
        line: &text::Line,
        lines: &mut Lines,
    ) -> std::result::Result<(), Stop> {
        match item {
            "TIMESTEP" => self.step = Some(value(lines, "a time step", text::integer)?),
            "TIME" => self.time = Some(value(lines, "a time", text::real)?),
            "UNITS" => drop(next(lines, "a system of units")?),
            _ if item.starts_with("BOX BOUNDS") => self.sim_box = Some(read_box(lines, item)?),
            _ => {
                let found = text::shown(line.text.trim().as_bytes());
                let message = format!("expected an item of a dump of atoms, found {found}");
                return Err(Stop::Error(lines.error(line.number, message)));
            }
        }
        Ok(())
    }
}

/// The next line; its absence is a cut.
fn next(lines: &mut Lines, expected: &str) -> std::result::Result<text::Line, Stop> {
    match lines.next_line()? {
        Some(line) if line.ended => Ok(line),
        _ => Err(Stop::Cut(lines.cut(expected))),
    }
}

/// The next line as one value.
fn value<T>(
    lines: &mut Lines,
    expected: &str,
    parse: impl Fn(&[u8]) -> Option<T>,
) -> std::result::Result<T, Stop> {
    let line = next(lines, expected)?;
    parse(line.text.trim().as_bytes()).ok_or_else(|| {
        let found = text::shown(line.text.trim().as_bytes());
        Stop::Error(lines.error(line.number, format!("expected {expected}, found {found}")))
    })
}

/// The next line as `N` numbers.
fn numbers<const N: usize>(lines: &mut Lines) -> std::result::Result<[f64; N], Stop> {
    let line = next(lines, "the bounds of the box")?;
    let values: Option<Vec<f64>> =
        line.text.split_ascii_whitespace().map(|t| text::real(t.as_bytes())).collect();
    values.and_then(|v| v.try_into().ok()).ok_or_else(|| {
        let found = text::shown(line.text.trim().as_bytes());
        Stop::Error(lines.error(
            line.number,
            format!("expected {N} numbers for the bounds of the box, found {found}"),
        ))
    })
}

fn read_box(lines: &mut Lines, item: &str) -> std::result::Result<SimulationBox, Stop> {
    let words: Vec<_> = item.split_ascii_whitespace().skip(2).collect();
    let is_flag = |w: &&str| w.len() == 2 && w.bytes().all(|b| b"pfsm".contains(&b));
    // Old files have no flags; LAMMPS' own default is periodic.
    let flags: Vec<bool> = words.iter().filter(|w| is_flag(w)).map(|w| *w == "pp").collect();
    let periodic = std::array::from_fn(|i| flags.get(i).copied().unwrap_or(true));
    if words.starts_with(&["abc", "origin"]) {
        let [a, b, c] = [numbers::<4>(lines)?, numbers::<4>(lines)?, numbers::<4>(lines)?];
        let vector = |v: [f64; 4]| [v[0], v[1], v[2]];
        return Ok(SimulationBox {
            origin: [a[3], b[3], c[3]],
            vectors: [a, b, c].map(vector),
            periodic,
        });
    }
    if !words.starts_with(&["xy", "xz", "yz"]) {
        let bounds = [numbers::<2>(lines)?, numbers::<2>(lines)?, numbers::<2>(lines)?];
        return Ok(SimulationBox::axis_aligned(
            bounds.map(|b| b[0]),
            bounds.map(|b| b[1]),
            periodic,
        ));
    }
    let [[xlo, xhi, xy], [ylo, yhi, xz], [zlo, zhi, yz]] =
        [numbers::<3>(lines)?, numbers::<3>(lines)?, numbers::<3>(lines)?];
    let low = [xlo - 0_f64.min(xy).min(xz).min(xy + xz), ylo - 0_f64.min(yz), zlo];
    let high = [xhi - 0_f64.max(xy).max(xz).max(xy + xz), yhi - 0_f64.max(yz), zhi];
    let mut sim_box = SimulationBox::axis_aligned(low, high, periodic);
    sim_box.vectors[1][0] = xy;
    sim_box.vectors[2][0] = xz;
    sim_box.vectors[2][1] = yz;
    Ok(sim_box)
}

/// The spellings of a coordinate, the preferred first, and whether it is a fraction of the box.
const COORDINATES: [([&str; 3], bool); 4] = [
    (["x", "y", "z"], false),
    (["xu", "yu", "zu"], false),
    (["xs", "ys", "zs"], true),
    (["xsu", "ysu", "zsu"], true),
];

fn columns(names: &str, first_row: Option<&str>) -> Columns {
    // One too many is refused in `check_columns`.
    let mut words: Vec<&str> =
        names.split_ascii_whitespace().take(rows::MOST_COLUMNS + 1).collect();
    if words.is_empty() {
        words = vec!["id", "type", "xs", "ys", "zs"];
    }
    let tokens: Vec<&str> = first_row.unwrap_or_default().split_ascii_whitespace().collect();
    let mut resolved = Columns {
        schema: Schema {
            groups: vec![Group { name: names::POSITION.into(), components: 3, kind: Kind::Real }],
            fields: vec![None; words.len()],
            separator: Separator::Blank,
            loose: false,
        },
        scaled: [false; 3],
        present: [false; 3],
        diameter: false,
    };
    for axis in 0..3 {
        let found = COORDINATES.iter().find_map(|(spelling, scaled)| {
            words.iter().position(|w| *w == spelling[axis]).map(|field| (field, *scaled))
        });
        if let Some((field, scaled)) = found {
            resolved.schema.fields[field] = Some((0, axis));
            resolved.scaled[axis] = scaled;
            resolved.present[axis] = true;
        }
    }
    resolved.diameter = !words.contains(&"radius") && words.contains(&"diameter");
    for (i, word) in words.iter().enumerate() {
        if resolved.schema.fields[i].is_none() {
            let is_number = tokens.get(i).is_none_or(|t| text::real(t.as_bytes()).is_some());
            resolved.schema.fields[i] =
                Some(add_column(&mut resolved.schema.groups, &words, word, is_number));
        }
    }
    resolved.schema.settle(first_row.unwrap_or_default());
    resolved
}

/// Finds or makes the group of column `word`, and gives the component.
fn add_column(
    groups: &mut Vec<Group>,
    words: &[&str],
    word: &str,
    is_number: bool,
) -> (usize, usize) {
    let vector = names::component(word).filter(|(name, _, size)| {
        // Only whole vectors are joined.
        let there = words.iter().filter(|w| names::component(w).is_some_and(|(n, ..)| n == *name));
        *name != names::COLOR && there.count() == *size
    });
    if let Some((name, component, components)) = vector {
        let kind = if name == names::PERIODIC_IMAGE { Kind::Integer } else { Kind::Real };
        let make = || Group { name: name.into(), components, kind };
        return (rows::group_index(groups, name, make), component);
    }
    let standard = match word {
        "element" if words.contains(&"type") => "Element",
        "diameter" if !words.contains(&"radius") => names::RADIUS,
        "id" | "type" | "element" | "mol" | "mass" | "q" | "radius" => {
            names::standard(word).unwrap_or(word)
        }
        _ => word,
    };
    let kind = match word {
        "type" => Kind::Guess,
        "element" | "typelabel" => Kind::Name,
        "id" | "mol" | "proc" | "procp1" | "ix" | "iy" | "iz" => Kind::Integer,
        _ if word.starts_with("i_") || word.starts_with("i2_") => Kind::Integer,
        _ if standard == names::RADIUS || is_number => Kind::Real,
        _ => Kind::Name,
    };
    let name = rows::free_name(groups, standard, word);
    groups.push(Group { name, components: 1, kind });
    (groups.len() - 1, 0)
}

fn check_columns(header: &Header, lines: &Lines, line: u64) -> Result<()> {
    let columns = &header.columns;
    if columns.schema.fields.len() > rows::MOST_COLUMNS {
        let message = format!("expected at most {} columns, found more", rows::MOST_COLUMNS);
        return Err(lines.error(line, message));
    }
    if !columns.present.contains(&true) {
        return Err(lines.error(
            line,
            "expected coordinates (x, xu, xs or xsu, and so on) among the columns, found none",
        ));
    }
    if columns.scaled.contains(&true) {
        let Some(sim_box) = &header.sim_box else {
            return Err(lines.error(
                line,
                "expected ITEM: BOX BOUNDS, which scaled coordinates need, found none",
            ));
        };
        let slanted = (0..3).any(|i| (0..3).any(|j| i != j && sim_box.vectors[i][j] != 0.0));
        if slanted && columns.scaled.contains(&false) {
            return Err(lines.error(
                line,
                "expected all coordinates scaled in a triclinic box, found some that are not",
            ));
        }
    }
    Ok(())
}

impl Columns {
    /// A position of the file in its own coordinates.
    fn place(&self, p: [f64; 3], sim_box: Option<&SimulationBox>) -> [f64; 3] {
        let given: [f64; 3] = std::array::from_fn(|i| if self.present[i] { p[i] } else { 0.0 });
        let Some(sim_box) = sim_box.filter(|_| self.scaled.contains(&true)) else {
            return given;
        };
        std::array::from_fn(|axis| {
            if !self.scaled[axis] {
                return given[axis];
            }
            let along =
                |k: usize| if self.scaled[k] { given[k] * sim_box.vectors[k][axis] } else { 0.0 };
            sim_box.origin[axis] + along(0) + along(1) + along(2)
        })
    }
}
