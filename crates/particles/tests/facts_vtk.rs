//! Legacy VTK and Houdini geometry against what independent readers say about real files, and
//! against damage.

mod common;

use std::path::PathBuf;

const LEGACY_VTK: [&str; 2] = [".vtk", ".vtk.gz"];

fn ends(file: &str, all: &[&str]) -> bool {
    all.iter().any(|end| file.ends_with(end))
}

#[test]
fn legacy_vtk_agrees_with_the_facts() {
    let checked = common::check_facts(|file| ends(file, &LEGACY_VTK));
    assert!(checked == 0 || checked >= 9, "{checked} files");
}

#[test]
fn houdini_geometry_agrees_with_the_facts() {
    let checked = common::check_facts(|file| ends(file, &[".bgeo", ".geo"]));
    assert!(checked == 0 || checked >= 5, "{checked} files");
}

/// Samples of the repository, and how many particles they hold.
const SAMPLES: [(&str, usize); 7] = [
    ("cube_8_particles.vtk", 8),
    ("para_test.vtk", 12),
    ("point_cloud.vtk", 3),
    ("every_type_42_ascii.vtk", 3),
    ("every_type_42_binary.vtk", 3),
    ("every_type_51_ascii.vtk", 3),
    ("every_type_51_binary.vtk", 3),
];

/// Samples beside the repository.
const SHARED_SAMPLES: [(&str, usize); 2] = [("sph/scatter.bgeo", 25), ("sph/test.geo", 5)];

/// The samples that are there, and how many particles they hold.
fn samples() -> Vec<(PathBuf, usize)> {
    let own = SAMPLES.map(|(name, particles)| (common::own_data().join(name), particles));
    let shared = common::shared_data()
        .into_iter()
        .flat_map(|folder| SHARED_SAMPLES.map(|(name, particles)| (folder.join(name), particles)));
    own.into_iter().chain(shared).collect()
}

#[test]
fn samples_are_read_whole() {
    for (path, particles) in samples() {
        assert_eq!(common::read(&path, 0).len(), particles, "{}", path.display());
    }
}

#[test]
fn damage_is_an_error_at_worst() {
    let folder = common::scratch("damaged_vtk");
    for (path, _) in samples() {
        let bytes = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        common::damage(&bytes, 300, |bytes| common::read_damaged(&folder, name, bytes));
    }
}

/// VTK wrote the same points with an array of every type, four ways.
#[test]
fn every_way_that_vtk_writes_reads_the_same() {
    let read = |way| common::read(&common::own_data().join(format!("every_type_{way}.vtk")), 0);
    let particles = read("51_ascii");
    assert_eq!(particles.positions, [[0.5, 0.0, 0.0], [1.0, 2.25, -3.0], [-1.0, 0.125, 10.0]]);
    assert_eq!((particles.time, particles.step), (Some(0.75), Some(12)));
    assert_eq!(particles.columns.len(), 21);
    for (name, row, expected) in [
        ("a density", 2, -3.75),
        ("Velocity", 2, 6.0),
        ("char", 1, -2.0),
        ("schar", 1, -2.0),
        ("uchar", 2, 255.0),
        ("short", 1, -300.0),
        ("uint", 1, 4_294_967_295.0),
        ("llong", 2, 1_099_511_627_776.0),
        ("an id", 2, 6.0),
        ("bit", 1, 0.0),
        ("GlobalIds", 2, 12.0),
        ("label", 1, 2.0),
    ] {
        let found = particles.column(name).map(|column| column.number(row, 0));
        assert_eq!(found, Some(expected), "{name}");
    }
    for way in ["42_ascii", "42_binary", "51_binary"] {
        assert_eq!(read(way), particles, "{way}");
    }
}
