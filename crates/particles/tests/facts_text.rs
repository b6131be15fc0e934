//! XYZ, LAMMPS dumps and tables against what independent readers say about real files.

mod common;

fn is_dump(file: &str) -> bool {
    file.ends_with(".dump") || file.ends_with(".lammpstrj") || file.ends_with(".dump.gz")
}

#[test]
fn lammps_dumps_agree_with_the_facts() {
    let checked = common::check_facts(is_dump);
    assert!(checked == 0 || checked >= 11, "{checked} files");
}

#[test]
fn xyz_files_agree_with_the_facts() {
    let of_interest = |file: &str| {
        let xyz = [".xyz", ".extxyz", ".xyz.gz", ".really"].iter().any(|end| file.ends_with(end));
        // Its first frame lacks a column that it declares.
        xyz && file != "malformed/xyz_bad_extended.xyz"
    };
    let checked = common::check_facts(of_interest);
    assert!(checked == 0 || checked >= 9, "{checked} files");
}

#[test]
fn tables_agree_with_the_facts() {
    let checked = common::check_facts(|file| {
        file.ends_with(".csv") || file.ends_with(".tab") || file.ends_with(".txt")
    });
    assert!(checked == 0 || checked >= 7, "{checked} files");
}
