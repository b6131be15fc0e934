//! NPY and NPZ files as NumPy writes them: positions are 10 i + c + ½, frames 100 apart.

mod common;

use std::path::PathBuf;

use motes_particles::read::{names, open};
use motes_particles::{Particles, Radius, Values};

const ROWS: usize = 20;

fn path(name: &str) -> PathBuf {
    common::own_data().join("numpy").join(name)
}

fn place(particles: &Particles, row: usize) -> [f64; 3] {
    std::array::from_fn(|i| particles.origin[i] + f64::from(particles.positions[row][i]))
}

fn assert_places(name: &str, particles: &Particles, shift: f64) {
    assert_eq!(particles.len(), ROWS, "{name}");
    for row in 0..ROWS {
        let expected: [f64; 3] =
            std::array::from_fn(|c| 10.0 * row as f64 + c as f64 + 0.5 + shift);
        assert_eq!(place(particles, row), expected, "{name}, row {row}");
    }
}

fn message(name: &str) -> String {
    match open(&path(name)) {
        Ok(_) => panic!("{name} was opened"),
        Err(e) => e.to_string(),
    }
}

#[test]
fn every_order_and_width_gives_the_same_positions() {
    let files = ["fortran_f8", "big_endian_f4", "half", "transposed", "seven_columns"];
    for name in files {
        let particles = common::read(&path(&format!("{name}.npy")), 0);
        assert_places(name, &particles, 0.0);
        assert_eq!(particles.radius, Radius::Unknown);
    }
}

#[test]
fn two_columns_lie_in_a_plane() {
    let particles = common::read(&path("int16_2d.npy"), 0);
    assert_eq!(place(&particles, 3), [30.0, 31.0, 0.0]);
}

#[test]
fn the_fourth_of_four_columns_is_the_radius() {
    let particles = common::read(&path("points.npy"), 0);
    let Radius::Each(radii) = &particles.radius else { panic!("no radii") };
    assert_eq!((radii[0], radii[8], place(&particles, 4)), (0.5, 1.5, [2.0, 4.0, -4.0]));
    assert!(particles.columns.is_empty());
}

#[test]
fn further_columns_are_kept_by_number() {
    let particles = common::read(&path("seven_columns.npy"), 0);
    let found: Vec<_> = particles.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(found, ["Column 4", "Column 5", "Column 6", "Column 7"]);
    assert_eq!(particles.columns[2].number(1, 0), 12.5);
}

#[test]
fn a_third_dimension_is_time() {
    for name in ["frames_f4.npy", "frames_fortran.npy", "frames_deflated.npz"] {
        let (_, mut reader) = open(&path(name)).unwrap();
        assert_eq!(reader.count(&|_, _| {}).unwrap(), 3, "{name}");
        for frame in [0, 2, 1] {
            let particles = common::frame(&mut *reader, frame);
            assert_places(name, &particles, 100.0 * frame as f64);
        }
    }
}

#[test]
fn records_have_named_fields() {
    let particles = common::read(&path("record.npy"), 0);
    assert_places("record", &particles, 0.0);
    let velocity = particles.column(names::VELOCITY).unwrap();
    assert_eq!((velocity.components, velocity.number(2, 1)), (3, -21.5));
    let ids = particles.column(names::PARTICLE_IDENTIFIER).unwrap();
    assert_eq!(ids.values, Values::I64((1..=ROWS as i64).collect()));
    assert_eq!(particles.column(names::PARTICLE_TYPE).unwrap().values.type_name(), "i32");
    let Radius::Each(radii) = &particles.radius else { panic!("no radii") };
    assert_eq!(radii[4], 1.0);
    let (_, reader) = open(&path("record.npy")).unwrap();
    assert!(reader.warnings()[0].contains("label"), "{:?}", reader.warnings());
}

#[test]
fn scalar_fields_join_to_vectors() {
    let particles = common::read(&path("record_xyz.npy"), 0);
    assert_places("record_xyz", &particles, 0.0);
    let found: Vec<_> = particles.columns.iter().map(|c| (c.name.as_str(), c.components)).collect();
    assert_eq!(found, [(names::VELOCITY, 3), ("flag", 1)]);
    assert_eq!(particles.columns[1].values.type_name(), "u8");
}

#[test]
fn an_archive_s_arrays_are_columns() {
    let (_, mut reader) = open(&path("frames_deflated.npz")).unwrap();
    let particles = common::frame(&mut *reader, 1);
    let number = |name: &str, row, c| particles.column(name).unwrap().number(row, c);
    assert_eq!(number(names::VELOCITY, 3, 2), -132.5);
    assert_eq!(number(names::MASS, 3, 0), 3.0);
    assert_eq!(number(names::PARTICLE_IDENTIFIER, 3, 0), 16.0);
    assert_eq!(number("energy", 3, 0), 130.5);
    let warnings = reader.warnings().join(" ");
    assert!(warnings.contains("box") && warnings.contains("note"), "{warnings}");
}

#[test]
fn single_coordinates_a_radius_and_a_colour() {
    let particles = common::read(&path("xyz_radius.npz"), 0);
    assert_places("xyz_radius", &particles, 0.0);
    assert_eq!(particles.radius, Radius::Each(vec![0.25; ROWS]));
    let color = particles.column(names::COLOR).unwrap();
    assert_eq!((color.components, color.values.type_name(), color.number(7, 1)), (3, "u8", 128.0));
    assert_eq!(particles.column("tensor").unwrap().components, 9);
}

#[test]
fn an_archive_s_only_array_is_bare() {
    assert_places("unnamed", &common::read(&path("unnamed.npz"), 0), 0.0);
}

#[test]
fn no_rows_are_an_empty_frame() {
    assert!(common::read(&path("empty.npy"), 0).is_empty());
}

#[test]
fn what_is_no_table_of_numbers_is_refused() {
    assert!(message("objects.npy").contains("pickle"));
    assert!(message("objects.npz").contains("pickle"));
    assert!(message("complex.npy").contains("c16"));
    assert!(message("one_dimension.npy").contains("[20]"));
}

#[test]
fn a_cut_file_gives_its_whole_frames() {
    let bytes = std::fs::read(path("frames_f4.npy")).unwrap();
    let cut = common::scratch("numpy").join("cut.npy");
    std::fs::write(&cut, &bytes[..bytes.len() - 1]).unwrap();
    let (_, mut reader) = open(&cut).unwrap();
    assert_eq!(reader.count(&|_, _| {}).unwrap(), 2);
    assert!(reader.warnings()[0].contains("2 are whole"));
    assert_places("cut", &common::frame(&mut *reader, 1), 100.0);
    std::fs::write(&cut, &bytes[..200]).unwrap();
    let error = open(&cut).map(|(name, _)| name).unwrap_err().to_string();
    assert!(error.contains("byte 128") && error.contains("found 72"), "{error}");
}

#[test]
fn a_count_beyond_the_file_takes_no_memory() {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (900000000000, 3), }";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    let huge = common::scratch("numpy").join("huge.npy");
    std::fs::write(&huge, &bytes).unwrap();
    assert!(open(&huge).is_err());
}
