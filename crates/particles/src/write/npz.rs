//! NPZ: a ZIP archive, not compressed, of one NPY array (NumPy enhancement proposal 1, version 1.0) for
//! `position`, `radius` and each column, little endian; `time` and `step`, one number each, where they are known.

use std::borrow::Cow;
use std::io::{self, Seek, Write};

use bytemuck::Pod;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::{plain, radii};
use crate::{Particles, Values};

pub(super) fn write(particles: &Particles, out: impl Write + Seek) -> io::Result<()> {
    let mut archive = ZipWriter::new(out);
    let count = particles.len();
    let flat = || particles.positions.iter().flatten().copied();
    let positions = if particles.origin == [0.0; 3] {
        Values::F32(flat().collect())
    } else {
        let origin = particles.origin.iter().cycle();
        Values::F64(flat().zip(origin).map(|(p, origin)| origin + f64::from(p)).collect())
    };
    array(&mut archive, ("position", 3, count), &positions)?;
    if let Some(radii) = radii(particles) {
        array(&mut archive, ("radius", 1, count), &Values::F32(radii))?;
    }
    for column in &particles.columns {
        array(&mut archive, (&column.name, column.components, count), &plain(column))?;
    }
    // A property of that name comes first.
    if let Some(time) = particles.time.filter(|_| particles.column("time").is_none()) {
        array(&mut archive, ("time", 1, 1), &Values::F64(vec![time]))?;
    }
    if let Some(step) = particles.step.filter(|_| particles.column("step").is_none()) {
        array(&mut archive, ("step", 1, 1), &Values::I64(vec![step]))?;
    }
    archive.finish()?.flush()
}

/// An array: its name, components and rows.
fn array(
    archive: &mut ZipWriter<impl Write + Seek>,
    (name, components, rows): (&str, usize, usize),
    values: &Values,
) -> io::Result<()> {
    let (descriptor, bytes): (_, Cow<'_, [u8]>) = match values {
        Values::F32(v) => ("<f4", little(v)),
        Values::F64(v) => ("<f8", little(v)),
        Values::I32(v) => ("<i4", little(v)),
        Values::I64(v) => ("<i8", little(v)),
        Values::U8(v) => ("|u1", v.into()),
        Values::Names { codes, .. } => ("<u4", little(codes)),
    };
    let shape =
        if components == 1 { format!("({rows},)") } else { format!("({rows}, {components})") };
    let dictionary =
        format!("{{'descr': '{descriptor}', 'fortran_order': False, 'shape': {shape}, }}");
    let length = (10 + dictionary.len() + 1).next_multiple_of(64) - 10;
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(bytes.len() as u64 >= u64::from(u32::MAX) / 2);
    archive.start_file(format!("{name}.npy"), options)?;
    archive.write_all(b"\x93NUMPY\x01\x00")?;
    archive.write_all(&(length as u16).to_le_bytes())?;
    writeln!(archive, "{dictionary:<width$}", width = length - 1)?;
    archive.write_all(&bytes)
}

/// The bytes of numbers, the least significant first.
fn little<T: Pod>(values: &[T]) -> Cow<'_, [u8]> {
    let bytes = bytemuck::cast_slice(values);
    if cfg!(target_endian = "little") {
        return bytes.into();
    }
    bytes.chunks_exact(size_of::<T>()).flat_map(|number| number.iter().rev().copied()).collect()
}
