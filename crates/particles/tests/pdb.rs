//! Protein Data Bank files with known content.

mod common;

use std::path::PathBuf;

use motes_particles::Values;
use motes_particles::read::{names, open};

const CELL: &str = "CRYST1   20.000   30.000   40.000  90.00  90.00  90.00 P 1           1\n";
const CARBON: &str =
    "ATOM      1  CA AALA A  -5A      1.000   2.000   3.000  0.50 12.34           C  \n";
const ZINC: &str =
    "HETATM***** ZN    ZN B  10      -1.000-200.000   3.500  1.00  0.00          ZN2+\n";

fn file(name: &str, content: &str) -> PathBuf {
    let path = common::scratch("pdb").join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn words(values: &Values) -> Vec<&str> {
    let Values::Names { codes, names } = values else { panic!("no names") };
    codes.iter().map(|code| names[*code as usize].as_str()).collect()
}

#[test]
fn columns_are_where_the_format_says() {
    let text = format!("{CELL}{CARBON}ANISOU    1  CA AALA A  -5A\n{ZINC}TER\nEND\n");
    let particles = common::read(&file("two.pdb", &text), 0);
    assert_eq!(particles.positions, [[1.0, 2.0, 3.0], [-1.0, -200.0, 3.5]]);
    let values = |name: &str| &particles.column(name).unwrap_or_else(|| panic!("{name}")).values;
    assert_eq!(*values(names::PARTICLE_IDENTIFIER), Values::I64(vec![1, 2]));
    assert_eq!(words(values(names::PARTICLE_TYPE)), ["C", "Zn"]);
    assert_eq!(words(values(names::ATOM_NAME)), ["CA", "ZN"]);
    assert_eq!(words(values(names::ALTERNATE_LOCATION)), ["A", ""]);
    assert_eq!(words(values(names::RESIDUE_NAME)), ["ALA", "ZN"]);
    assert_eq!(words(values(names::CHAIN)), ["A", "B"]);
    assert_eq!(*values(names::RESIDUE_IDENTIFIER), Values::I32(vec![-5, 10]));
    assert_eq!(words(values(names::INSERTION_CODE)), ["A", ""]);
    assert_eq!(*values(names::OCCUPANCY), Values::F64(vec![0.5, 1.0]));
    assert_eq!(*values(names::B_FACTOR), Values::F64(vec![12.34, 0.0]));
    assert_eq!(*values(names::CHARGE), Values::I32(vec![0, 2]));
    assert_eq!(*values(names::HETATM), Values::U8(vec![0, 1]));
    let cell = particles.sim_box.unwrap();
    assert_eq!([cell.vectors[0][0], cell.vectors[1][1], cell.vectors[2][2]], [20.0, 30.0, 40.0]);
}

#[test]
fn the_cell_of_one_angstrom_is_none() {
    let none = "CRYST1    1.000    1.000    1.000  90.00  90.00  90.00 P 1           1\n";
    let particles = common::read(&file("none.pdb", &format!("{none}{CARBON}")), 0);
    assert_eq!(particles.sim_box, None);
}

#[test]
fn models_are_frames_and_share_the_cell() {
    let text = format!(
        "{CELL}MODEL        1\n{CARBON}ENDMDL\nMODEL        2\n{CARBON}{ZINC}ENDMDL\nMASTER\nEND\n"
    );
    let (_, mut reader) = open(&file("models.pdb", &text)).unwrap();
    assert_eq!(reader.count(&|_, _| {}).unwrap(), 2);
    let second = common::frame(&mut *reader, 1);
    assert_eq!((second.len(), second.sim_box.is_some()), (2, true));
    assert_eq!(common::frame(&mut *reader, 0).len(), 1);
}

#[test]
fn end_parts_the_frames_of_simulations() {
    let text = format!(
        "{CELL}{CARBON}END\nCRYST1   21.000   30.000   40.000  90.00  90.00  90.00\n{ZINC}END\n"
    );
    let (_, mut reader) = open(&file("ends.pdb", &text)).unwrap();
    assert_eq!(reader.count(&|_, _| {}).unwrap(), 2);
    assert_eq!(common::frame(&mut *reader, 1).sim_box.unwrap().vectors[0][0], 21.0);
}

#[test]
fn an_incomplete_last_model_is_a_warning_and_the_first_an_error() {
    let text = format!("MODEL        1\n{CARBON}ENDMDL\nMODEL        2\n{CARBON}{}", &ZINC[..40]);
    let (_, mut reader) = open(&file("cut.pdb", &text)).unwrap();
    assert_eq!(reader.count(&|_, _| {}).unwrap(), 1);
    assert_eq!(reader.warnings().len(), 1);
    let text = format!("MODEL        1\n{CARBON}{}", &ZINC[..40]);
    let (_, mut reader) = open(&file("cut_first.pdb", &text)).unwrap();
    assert!(reader.read(0, &Default::default(), &|_, _| {}).is_err());
}

#[test]
fn errors_name_the_line_and_what_stood_there() {
    let broken = ZINC.replace("-200.000", "  none  ");
    let (_, mut reader) =
        open(&file("broken.pdb", &format!("{CELL}{CARBON}{broken}END\n"))).unwrap();
    let error = reader.read(0, &Default::default(), &|_, _| {}).unwrap_err().to_string();
    assert!(error.contains("line 3") && error.contains("none"), "{error}");
}
