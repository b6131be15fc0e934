//! PDB, PLY and NumPy files against what independent readers say about real files.

mod common;

use motes_particles::read::{Wanted, names, open};
use motes_particles::{Column, Values};
use serde_json::Value;

/// Atomic numbers of the elements in the files.
const NUMBERS: &[(&str, f64)] = &[
    ("H", 1.0),
    ("C", 6.0),
    ("N", 7.0),
    ("O", 8.0),
    ("P", 15.0),
    ("S", 16.0),
    ("Ca", 20.0),
    ("Mn", 25.0),
    ("Fe", 26.0),
    ("Zn", 30.0),
];

/// OpenMM writes atom names from column 13 on, where `CA` is calcium by the letter of the format and
/// the facts follow it; the atoms are those of a protein in water.
const LEFT_ALIGNED: &str = "md/openmm_5dfr_solv-cube_equil.pdb";

fn is_pdb(file: &str) -> bool {
    file.ends_with(".pdb")
}

/// The file's properties by our names, the elements apart.
fn renamed(properties: &Value) -> Value {
    let ours = |name: &str| match name {
        "b_factor" => names::B_FACTOR.to_owned(),
        "occupancy" => names::OCCUPANCY.to_owned(),
        other => other.to_owned(),
    };
    let entries = properties.as_object().into_iter().flatten();
    let kept = entries.filter(|(name, _)| *name != "atomic_number");
    Value::Object(kept.map(|(name, range)| (ours(name), range.clone())).collect())
}

fn elements(column: &Column) -> Vec<String> {
    let Values::Names { names, .. } = &column.values else { panic!("elements are names") };
    let mut names = names.clone();
    names.sort();
    names
}

#[test]
fn pdb_files_agree_with_the_facts() {
    let checked = common::check_facts_with(is_pdb, renamed);
    assert!(checked == 0 || checked >= 9, "{checked} files");
    for (path, fact) in common::facts(is_pdb) {
        let file = fact["file"].as_str().unwrap();
        let found = elements(common::read(&path, 0).column(names::PARTICLE_TYPE).unwrap());
        if file == LEFT_ALIGNED {
            assert_eq!(found, ["C", "H", "N", "O", "S"]);
            continue;
        }
        let expected: Vec<_> =
            fact["elements"].as_array().unwrap().iter().map(|e| e.as_str().unwrap()).collect();
        assert_eq!(found, expected, "{file}");
        let number = |name: &String| NUMBERS.iter().find(|(n, _)| n == name).unwrap().1;
        let range = &fact["properties"]["atomic_number"];
        let numbers = || found.iter().map(number);
        assert_eq!(range["min"].as_f64().unwrap(), numbers().fold(f64::MAX, f64::min), "{file}");
        assert_eq!(range["max"].as_f64().unwrap(), numbers().fold(0.0, f64::max), "{file}");
    }
}

#[test]
fn ply_files_agree_with_the_facts() {
    let checked = common::check_facts(|file| file.ends_with(".ply"));
    assert!(checked == 0 || checked >= 3, "{checked} files");
}

#[test]
fn numpy_files_agree_with_the_facts() {
    let checked = common::check_facts(|file| file.ends_with(".npy") || file.ends_with(".npz"));
    assert!(checked == 0 || checked >= 2, "{checked} files");
}

#[test]
fn files_that_only_look_alike_are_refused() {
    let Some(folder) = common::shared_data() else { return };
    let message = |file: &str| match open(&folder.join(file)) {
        Ok((format, _)) => panic!("{file} taken for {format}"),
        Err(e) => e.to_string(),
    };
    assert!(message("sph/partio_test_maya.pdb").contains("no known format"));
    let bool_type = message("malformed/diamond_with_bool.ply");
    assert!(bool_type.contains("line 13") && bool_type.contains("`bool`"), "{bool_type}");
}

#[test]
fn no_other_format_s_file_is_claimed() {
    let Some(folder) = common::shared_data() else { return };
    for (path, _) in common::facts(|_| true) {
        let Ok((format, _)) = open(&path) else { continue };
        let name = path.strip_prefix(&folder).unwrap().to_string_lossy().into_owned();
        let is_ours = ["PDB", "PLY", "NPY", "NPZ"].contains(&format);
        let wanted = [".pdb", ".ply", ".npy", ".npz"].iter().any(|end| name.ends_with(end));
        assert_eq!(is_ours, wanted, "{name} is {format}");
    }
}

#[test]
fn damaged_files_do_no_harm() {
    let folder = common::scratch("damaged_struct");
    let samples = [
        ("1l2y.pdb", 100),
        ("MOF-5.pdb", 100),
        ("diamond.ply", 200),
        ("sedov.npz", 40),
        ("numpy/points.npy", 100),
        ("numpy/record.npy", 100),
        ("numpy/frames_fortran.npy", 100),
        ("numpy/frames_deflated.npz", 200),
        ("numpy/xyz_radius.npz", 100),
    ];
    for (name, variants) in samples {
        let path = common::own_data().join(name);
        let bytes = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        common::damage(&bytes, variants, |damaged| common::read_damaged(&folder, name, damaged));
    }
}

#[test]
fn only_what_is_wanted_is_read() {
    let path = common::own_data().join("1l2y.pdb");
    let (_, mut reader) = open(&path).unwrap();
    let only = Wanted::Only(vec![names::B_FACTOR.into()]);
    let particles = reader.read(3, &only, &|_, _| {}).unwrap();
    let found: Vec<_> = particles.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!((particles.len(), found), (304, vec![names::B_FACTOR]));
}
