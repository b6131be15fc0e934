//! Legacy VTK 3.0, binary: the points of a `POLYDATA`, with a vertex each, so that every program shows
//! them. Columns are arrays of the field of `POINT_DATA`; time and step the field `TIME` and `CYCLE`.
//! Numbers are big endian.

use std::io::{self, BufWriter, Write};

use super::{plain, radii};
use crate::{Particles, Values};

/// The numbers of an array that a file's positions are in double precision for.
fn absolute(particles: &Particles) -> Values {
    if particles.origin == [0.0; 3] {
        return Values::F32(particles.positions.iter().flatten().copied().collect());
    }
    let place = |p: &[f32; 3]| [0, 1, 2].map(|a| particles.origin[a] + f64::from(p[a]));
    Values::F64(particles.positions.iter().flat_map(place).collect())
}

pub(super) fn write(particles: &Particles, out: impl Write) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 18, out);
    let count = particles.len();
    out.write_all(b"# vtk DataFile Version 3.0\nparticles\nBINARY\nDATASET POLYDATA\n")?;
    let times = [particles.time.is_some(), particles.step.is_some()];
    let fields = times.iter().filter(|known| **known).count();
    if fields > 0 {
        writeln!(out, "FIELD FieldData {fields}")?;
    }
    if let Some(time) = particles.time {
        array(&mut out, ("TIME", 1, 1), &Values::F64(vec![time]))?;
    }
    if let Some(step) = particles.step {
        array(&mut out, ("CYCLE", 1, 1), &Values::I64(vec![step]))?;
    }
    let positions = absolute(particles);
    writeln!(out, "POINTS {count} {}", kind(&positions))?;
    numbers(&mut out, &positions)?;
    writeln!(out, "VERTICES {count} {}", 2 * count)?;
    for i in 0..count {
        out.write_all(&1i32.to_be_bytes())?;
        out.write_all(&(i as i32).to_be_bytes())?;
    }
    out.write_all(b"\n")?;
    let radii = radii(particles).map(Values::F32);
    let arrays = particles.columns.len() + usize::from(radii.is_some());
    if count > 0 && arrays > 0 {
        writeln!(out, "POINT_DATA {count}\nFIELD FieldData {arrays}")?;
        if let Some(radii) = &radii {
            array(&mut out, ("Radius", 1, count), radii)?;
        }
        for column in &particles.columns {
            array(&mut out, (&column.name, column.components, count), &plain(column))?;
        }
    }
    out.flush()
}

/// An array of a field: its name, components and rows.
fn array(
    out: &mut impl Write,
    (name, components, rows): (&str, usize, usize),
    values: &Values,
) -> io::Result<()> {
    writeln!(out, "{} {components} {rows} {}", encoded(name), kind(values))?;
    numbers(out, values)
}

/// A name as VTK writes it: what is no plain letter by its number.
fn encoded(name: &str) -> String {
    let mut text = String::new();
    for byte in name.bytes() {
        match byte {
            b'!'..=b'~' if byte != b'%' && byte != b'"' => text.push(char::from(byte)),
            _ => text.push_str(&format!("%{byte:02X}")),
        }
    }
    text
}

fn kind(values: &Values) -> &'static str {
    match values {
        Values::F32(_) => "float",
        Values::F64(_) => "double",
        Values::I32(_) => "int",
        Values::U8(_) => "unsigned_char",
        Values::I64(_) | Values::Names { .. } => "vtktypeint64",
    }
}

fn numbers(out: &mut impl Write, values: &Values) -> io::Result<()> {
    match values {
        Values::F32(v) => v.iter().try_for_each(|v| out.write_all(&v.to_be_bytes()))?,
        Values::F64(v) => v.iter().try_for_each(|v| out.write_all(&v.to_be_bytes()))?,
        Values::I32(v) => v.iter().try_for_each(|v| out.write_all(&v.to_be_bytes()))?,
        Values::I64(v) => v.iter().try_for_each(|v| out.write_all(&v.to_be_bytes()))?,
        Values::U8(v) => out.write_all(v)?,
        Values::Names { codes, .. } => {
            codes.iter().try_for_each(|c| out.write_all(&(i64::from(*c) + 1).to_be_bytes()))?;
        }
    }
    out.write_all(b"\n")
}
