//! Extended XYZ: `Properties` names the columns (blanks become underscores), `Lattice` and `Origin` are
//! the box, `Time` and `Step` the frame's. Numbers are the shortest that are read back the same.

use std::fmt::{Display, Write as _};
use std::io::{self, Write};

use rayon::prelude::*;

use super::{plain, radii};
use crate::{Particles, Values};

/// Rows that are written by one thread at a time.
const CHUNK: usize = 1 << 12;

pub(super) fn write(particles: &Particles, mut out: impl Write) -> io::Result<()> {
    writeln!(out, "{}\n{}", particles.len(), comment(particles))?;
    let radii = radii(particles);
    let columns: Vec<_> =
        particles.columns.iter().map(|column| (column.components, plain(column))).collect();
    let row = |text: &mut String, i: usize| {
        for axis in 0..3 {
            let value = particles.positions[i][axis];
            let origin = particles.origin[axis];
            match origin == 0.0 {
                true => put(text, value),
                false => put(text, origin + f64::from(value)),
            }
        }
        if let Some(radii) = &radii {
            put(text, radii[i]);
        }
        for (components, values) in &columns {
            for at in i * components..(i + 1) * components {
                put_value(text, values, at);
            }
        }
        // In place of the last blank.
        text.pop();
        text.push('\n');
    };
    let starts: Vec<usize> = (0..particles.len()).step_by(CHUNK).collect();
    for starts in starts.chunks(4 * rayon::current_num_threads()) {
        let parts: Vec<String> = starts
            .par_iter()
            .map(|start| {
                let mut text = String::new();
                (*start..(start + CHUNK).min(particles.len())).for_each(|i| row(&mut text, i));
                text
            })
            .collect();
        parts.iter().try_for_each(|part| out.write_all(part.as_bytes()))?;
    }
    out.flush()
}

fn put(text: &mut String, value: impl Display) {
    // A string takes everything.
    let _ = write!(text, "{value} ");
}

fn put_value(text: &mut String, values: &Values, at: usize) {
    match values {
        Values::F32(v) => put(text, v[at]),
        Values::F64(v) => {
            let _ = write!(text, "{:?} ", v[at]);
        }
        Values::I32(v) => put(text, v[at]),
        Values::I64(v) => put(text, v[at]),
        Values::U8(v) => put(text, v[at]),
        Values::Names { codes, .. } => put(text, u64::from(codes[at]) + 1),
    }
}

fn comment(particles: &Particles) -> String {
    let mut text = String::new();
    if let Some(sim_box) = &particles.sim_box {
        let numbers = |v: &[f64]| v.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let periodic = sim_box.periodic.map(|p| if p { "T" } else { "F" }).join(" ");
        let _ = write!(
            text,
            "Lattice=\"{}\" Origin=\"{}\" pbc=\"{periodic}\" ",
            numbers(sim_box.vectors.as_flattened()),
            numbers(&sim_box.origin)
        );
    }
    text.push_str("Properties=pos:R:3");
    if !matches!(particles.radius, crate::Radius::Unknown) {
        text.push_str(":radius:R:1");
    }
    for column in &particles.columns {
        let real = matches!(column.values, Values::F32(_) | Values::F64(_));
        let kind = if real { 'R' } else { 'I' };
        let name: String =
            column.name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        let _ = write!(text, ":{name}:{kind}:{}", column.components);
    }
    if let Some(time) = particles.time {
        let _ = write!(text, " Time={time}");
    }
    if let Some(step) = particles.step {
        let _ = write!(text, " Step={step}");
    }
    text
}
