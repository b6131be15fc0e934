//! Every test file there is: read by its own format, or refused with a reason.
#![allow(clippy::print_stderr)] // the list of who claims what is worth seeing

mod common;

use std::path::{Path, PathBuf};

use motes_particles::read::{Wanted, open};

/// Formats by the end of a file's name.
const FORMATS: [(&str, &[&str]); 9] = [
    ("LAMMPS dump", &[".dump", ".lammpstrj", ".dump.gz"]),
    ("XYZ", &[".xyz", ".extxyz", ".xyz.gz", ".xyz.zst", ".but.not.really"]),
    ("PDB", &[".pdb", ".pdb.gz"]),
    ("PLY", &[".ply"]),
    ("NPY", &[".npy"]),
    ("NPZ", &[".npz"]),
    ("legacy VTK", &[".vtk", ".vtk.gz"]),
    ("Houdini geometry", &[".bgeo", ".geo"]),
    ("text table", &[".csv", ".tab", ".txt"]),
];

/// Files that are not what their name says, or broken so that nothing can be read of them.
const REFUSED: [&str; 11] = [
    "flow/opendrift_leeway_ascii.txt",
    "malformed/diamond_with_bool.ply",
    "malformed/lammps_bad_box-not-numbers.lammpstrj",
    "malformed/lammps_bad_box-wrong-size.lammpstrj",
    "malformed/xyz_bad_extended.xyz",
    "sph/partio_test_maya.pdb",
    "diamond_with_bool.ply",
    "numpy/complex.npy",
    "numpy/objects.npy",
    "numpy/objects.npz",
    "numpy/one_dimension.npy",
];

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() { files(&path, found) } else { found.push(path) }
    }
}

/// What reads `path`, how many frames it has and particles in the last; or why it is refused.
fn read_all(path: &Path) -> Result<(&'static str, usize, usize), String> {
    let read = || {
        let (format, mut reader) = open(path)?;
        let frames = reader.count(&|_, _| {})?;
        let mut particles = 0;
        for frame in [0, frames.saturating_sub(1)] {
            let read = reader.read(frame, &Wanted::All, &|_, _| {})?;
            assert!(read.columns.iter().all(|column| column.rows() == read.len()));
            particles = read.len();
        }
        Ok((format, frames, particles))
    };
    read().map_err(|e: motes_particles::ReadError| e.to_string())
}

#[test]
fn every_file_is_read_by_its_own_format_or_refused() {
    for folder in common::shared_data().into_iter().chain([common::own_data()]) {
        let mut found = Vec::new();
        files(&folder, &mut found);
        for path in found {
            let file = path.strip_prefix(&folder).unwrap().to_string_lossy().into_owned();
            let own = FORMATS.iter().find(|(_, ends)| ends.iter().any(|end| file.ends_with(end)));
            match (read_all(&path), own) {
                (Ok((format, frames, particles)), Some((own, _))) => {
                    eprintln!("{file}: {format}, {frames} frames, {particles} particles");
                    assert_eq!(format, *own, "{file}");
                    assert!(!REFUSED.contains(&file.as_str()), "{file} was read");
                }
                (Ok((format, ..)), None) => panic!("{file} was taken for {format}"),
                (Err(reason), own) => {
                    eprintln!("refused: {reason}");
                    assert!(own.is_none() || REFUSED.contains(&file.as_str()), "{reason}");
                    let (name, reason) = reason.split_once(": ").unwrap();
                    assert!(name.ends_with(&file) && reason.len() > 20, "{file}: {reason}");
                }
            }
        }
    }
}
