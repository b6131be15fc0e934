//! The writers: one file per format, one frame per file. What is written, the readers read back: the
//! same positions, radii and columns, in the precision they have.

mod npz;
mod vtk;
mod xyz;

use std::io::{self, Seek, Write};
use std::path::Path;

use crate::{Column, Particles, Radius, Values};

/// A format that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Legacy VTK, binary.
    Vtk,
    /// NPZ: a ZIP archive of NumPy arrays.
    Npz,
    /// Extended XYZ.
    Xyz,
}

/// The formats and the ends of their files' names.
const ENDS: [(&str, Format); 4] =
    [("vtk", Format::Vtk), ("npz", Format::Npz), ("xyz", Format::Xyz), ("extxyz", Format::Xyz)];

impl Format {
    /// The format of a file of this name.
    ///
    /// # Errors
    /// None is known: which there are, in words.
    pub fn of(path: &Path) -> std::result::Result<Self, String> {
        let end = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let known = ENDS.iter().find(|(known, _)| *known == end);
        known.map(|(_, format)| *format).ok_or_else(|| {
            let path = path.display();
            format!("{path}: expected a name that ends in .vtk, .npz or .xyz")
        })
    }

    /// Writes `particles`.
    ///
    /// # Errors
    /// If `out` fails.
    pub fn write(self, particles: &Particles, out: impl Write + Seek) -> io::Result<()> {
        match self {
            Self::Vtk => vtk::write(particles, out),
            Self::Npz => npz::write(particles, out),
            Self::Xyz => xyz::write(particles, out),
        }
    }
}

/// The radii, where they are known, one each.
fn radii(particles: &Particles) -> Option<Vec<f32>> {
    match &particles.radius {
        Radius::Unknown => None,
        Radius::Uniform(radius) => Some(vec![*radius; particles.len()]),
        Radius::Each(radii) => Some(radii.clone()),
    }
}

/// Names become their numbers: the formats have no dictionaries.
fn plain(column: &Column) -> std::borrow::Cow<'_, Values> {
    match &column.values {
        Values::Names { codes, .. } => {
            std::borrow::Cow::Owned(Values::I64(codes.iter().map(|c| i64::from(*c) + 1).collect()))
        }
        other => std::borrow::Cow::Borrowed(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimulationBox;
    use crate::read::{Input, Wanted, open_input};

    fn particles() -> Particles {
        let velocity = (0..15).map(|i| 0.1 * i as f32 - 1.0 / 3.0).collect();
        let sides = (0..30).map(|i| i as f32 / 29.0).collect();
        Particles {
            positions: (0..5).map(|i| [i as f32 / 7.0, -1e-7 * i as f32, 2.0]).collect(),
            radius: Radius::Uniform(0.1),
            columns: vec![
                Column::new("Velocity", 3, Values::F32(velocity)),
                Column::new("Particle Identifier", 1, Values::I64(vec![5, 3, 1 << 40, 2, 1])),
                Column::new("Particle Mask", 6, Values::F32(sides)),
                Column::new("Energy", 1, Values::F64(vec![0.1, 1e-300, -2.5, 3.0, 1e10])),
                Column::new("Count", 1, Values::I32(vec![-1, 2, 3, 4, 5])),
            ],
            sim_box: Some(SimulationBox::axis_aligned([-1.0; 3], [1.5, 2.0, 2.5], [false; 3])),
            time: Some(0.125),
            step: Some(42),
            ..Particles::default()
        }
    }

    fn written(format: Format, particles: &Particles) -> Vec<u8> {
        let mut out = io::Cursor::new(vec![]);
        format.write(particles, &mut out).unwrap();
        out.into_inner()
    }

    fn read(name: &str, bytes: Vec<u8>) -> Particles {
        let (_, mut reader) = open_input(Input::of_bytes(name, bytes.leak()).unwrap()).unwrap();
        let particles = reader.read(0, &Wanted::All, &|_, _| {}).unwrap();
        assert_eq!(reader.warnings(), Vec::<String>::new(), "{name}");
        assert_eq!(reader.count(&|_, _| {}), Ok(1));
        particles
    }

    #[test]
    fn what_is_written_is_read_back() {
        let before = particles();
        for (end, format) in ENDS {
            let after = read(&format!("out.{end}"), written(format, &before));
            assert_eq!(after.positions, before.positions, "{end}");
            assert_eq!(after.radius, Radius::Each(vec![0.1; 5]), "{end}");
            assert_eq!(after.columns.len(), 5, "{end}");
            for column in &before.columns {
                let found =
                    after.columns.iter().find(|c| crate::read::names::same(&c.name, &column.name));
                let found = found.unwrap_or_else(|| panic!("{end}: no {}", column.name));
                assert_eq!(found.components, column.components, "{end}: {}", column.name);
                for i in 0..column.values.len() {
                    let (a, b) = (found.values.number(i), column.values.number(i));
                    // Text is read in double precision: the same once it is f32 again.
                    let single = matches!(column.values, Values::F32(_));
                    let (a, b) = if single { (f64::from(a as f32), b) } else { (a, b) };
                    assert_eq!(a, b, "{end}: {} {i}", column.name);
                }
            }
            assert_eq!((after.time, after.step), (Some(0.125), Some(42)), "{end}");
            if format == Format::Xyz {
                assert_eq!(after.sim_box, before.sim_box);
            }
        }
    }

    #[test]
    fn no_particles_and_far_ones_are_written() {
        for (end, format) in ENDS {
            let name = format!("out.{end}");
            let none = Particles { radius: Radius::Uniform(1.0), ..Particles::default() };
            assert!(read(&name, written(format, &none)).is_empty(), "{end}");
            let far = Particles {
                origin: [1e6, -2e6, 0.0],
                positions: vec![[0.125, 0.25, 0.5], [1.0, 2.0, 3.0]],
                ..Particles::default()
            };
            assert_eq!(read(&name, written(format, &far)).bounds(), far.bounds(), "{end}");
        }
    }

    #[test]
    fn a_name_tells_the_format() {
        assert_eq!(Format::of("a/out_%04d.vtk".as_ref()), Ok(Format::Vtk));
        assert_eq!(Format::of("OUT.NPZ".as_ref()), Ok(Format::Npz));
        assert!(Format::of("out.png".as_ref()).unwrap_err().contains(".vtk, .npz or .xyz"));
    }
}
