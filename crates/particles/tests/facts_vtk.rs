//! Legacy VTK and Houdini geometry against what independent readers say about real files, and
//! against damage.

mod common;

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
const SAMPLES: [(&str, usize); 5] = [
    ("cube_8_particles.vtk", 8),
    ("para_test.vtk", 12),
    ("point_cloud.vtk", 3),
    ("scatter.bgeo", 25),
    ("test.geo", 5),
];

#[test]
fn samples_are_read_whole() {
    for (name, particles) in SAMPLES {
        let read = common::read(&common::own_data().join(name), 0);
        assert_eq!(read.len(), particles, "{name}");
    }
}

#[test]
fn damage_is_an_error_at_worst() {
    let folder = common::scratch("damaged_vtk");
    for (name, _) in SAMPLES {
        let bytes = std::fs::read(common::own_data().join(name)).unwrap();
        common::damage(&bytes, 300, |bytes| common::read_damaged(&folder, name, bytes));
    }
}
