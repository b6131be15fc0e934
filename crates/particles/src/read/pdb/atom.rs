//! `ATOM` and `HETATM` lines: columns to values.

use super::fields::{OVERFLOWED, columns, number, numbers, real, trim};
use super::first_line;
use crate::read::dictionary::Dictionary;
use crate::read::elements::symbol;
use crate::read::text::{Wrong, shown};
use crate::read::{Wanted, names};
use crate::{Column, Particles, PositionBuilder, Values};

/// Whether a line is a particle.
pub(super) fn is_atom(line: &[u8]) -> bool {
    line.starts_with(b"ATOM  ") || line.starts_with(b"HETATM")
}

/// Particles column by column.
#[derive(Default)]
pub(super) struct Atoms {
    positions: Vec<[f64; 3]>,
    /// The positions of what was appended.
    builder: PositionBuilder,
    serials: Vec<i64>,
    residues: Vec<i64>,
    occupancies: Vec<f64>,
    b_factors: Vec<f64>,
    charges: Vec<i32>,
    hetatm: Vec<u8>,
    elements: Dictionary,
    atoms: Dictionary,
    residue_names: Dictionary,
    chains: Dictionary,
    alternates: Dictionary,
    insertions: Dictionary,
}

/// Residues of which all atoms are H, C, N, O, P or S.
#[rustfmt::skip]
const BIOPOLYMER: &[&[u8]] = &[
    b"ALA", b"ARG", b"ASN", b"ASP", b"CYS", b"GLN", b"GLU", b"GLY", b"HIS", b"ILE", b"LEU", b"LYS",
    b"MET", b"PHE", b"PRO", b"SER", b"THR", b"TRP", b"TYR", b"VAL", b"ASX", b"GLX", b"HSD", b"HSE",
    b"HSP", b"HID", b"HIE", b"HIP", b"CYX", b"CYM", b"ASH", b"GLH", b"LYN", b"ACE", b"NME", b"NH2",
    b"A", b"C", b"G", b"U", b"I", b"DA", b"DC", b"DG", b"DT", b"DU", b"DI",
    b"HOH", b"WAT", b"SOL", b"TIP3", b"TIP", b"TP3", b"DOD", b"H2O",
];

/// The element: columns 77–78; else, by the rule for atom names, the right-justified symbol in columns
/// 13–14. `X` where that is none.
///
/// Programs that write names from column 13 on break the rule (`CA` would be calcium); in amino acids,
/// nucleotides and water the first letter decides.
fn element(line: &[u8]) -> &'static str {
    if let Some(symbol) = symbol(columns(line, 77, 78).trim_ascii()) {
        return symbol;
    }
    let name = columns(line, 13, 16);
    let letters = name.trim_ascii_start();
    let letters = &letters[letters.iter().take_while(|b| b.is_ascii_digit()).count()..];
    let one = symbol(letters.get(..1).unwrap_or_default());
    let two = name.get(..2).filter(|two| two.iter().all(u8::is_ascii_alphabetic)).and_then(symbol);
    let is_full_hydrogen = name.first() == Some(&b'H') && name.trim_ascii().len() == 4;
    let residue = columns(line, 18, 21).trim_ascii();
    match two {
        Some(two) if !is_full_hydrogen && !BIOPOLYMER.contains(&residue) => two,
        _ => one.unwrap_or("X"),
    }
}

/// `2+`, `1-`, also `+2`; 0 where there is none.
fn charge(field: &[u8]) -> i32 {
    match field.trim_ascii() {
        [digit @ b'0'..=b'9', b'+'] | [b'+', digit @ b'0'..=b'9'] => i32::from(digit - b'0'),
        [digit @ b'0'..=b'9', b'-'] | [b'-', digit @ b'0'..=b'9'] => -i32::from(digit - b'0'),
        _ => 0,
    }
}

impl Atoms {
    /// The particles among the lines of `text`.
    pub(super) fn parse(text: &[u8], wanted: &Wanted) -> Result<Self, Wrong> {
        let mut atoms = Self::default();
        let mut at = 0;
        while at < text.len() {
            let line = first_line(&text[at..]);
            if is_atom(line) {
                let line = line.trim_ascii_end();
                atoms.push(line, wanted).map_err(|message| Wrong { at, message })?;
            }
            at += line.len();
        }
        Ok(atoms)
    }

    fn push(&mut self, line: &[u8], wanted: &Wanted) -> Result<(), String> {
        let place = columns(line, 31, 54);
        let wrong = || format!("expected x, y and z in columns 31–54, found {}", shown(place));
        // The last figures of z may have been cut off, unless its point is where it must be.
        let position = numbers(place).filter(|_| place.len() > 20).ok_or_else(wrong)?;
        self.positions.push(position);
        let serial = columns(line, 7, if columns(line, 12, 12) == b" " { 11 } else { 12 });
        let serial = number(serial).or_else(|| number(columns(line, 7, 11)));
        self.serials.push(serial.unwrap_or(OVERFLOWED));
        // Five digits where a program needed them, with no room for an insertion code.
        let is_wide = columns(line, 23, 27).iter().all(u8::is_ascii_digit);
        let residue = number(columns(line, 23, if is_wide { 27 } else { 26 }));
        self.residues.push(residue.unwrap_or(OVERFLOWED));
        self.occupancies.push(real(line, 55, 60, 1.0)?);
        self.b_factors.push(real(line, 61, 66, 0.0)?);
        self.charges.push(charge(columns(line, 79, 80)));
        self.hetatm.push(u8::from(line.starts_with(b"HETATM")));
        let mut word = |words: fn(&mut Self) -> &mut Dictionary, name: &str, word: &[u8]| {
            if wanted.wants(name) {
                words(self).push(trim(word));
            }
        };
        word(|a| &mut a.elements, names::PARTICLE_TYPE, element(line).as_bytes());
        word(|a| &mut a.atoms, names::ATOM_NAME, columns(line, 13, 16));
        word(|a| &mut a.residue_names, names::RESIDUE_NAME, columns(line, 18, 21));
        word(|a| &mut a.chains, names::CHAIN, columns(line, 22, 22));
        word(|a| &mut a.alternates, names::ALTERNATE_LOCATION, columns(line, 17, 17));
        let insertion = if is_wide { &[] } else { columns(line, 27, 27) };
        word(|a| &mut a.insertions, names::INSERTION_CODE, insertion);
        Ok(())
    }

    /// Adds what follows.
    pub(super) fn append(&mut self, other: Self) {
        self.builder.push(&other.positions);
        self.serials.extend(other.serials);
        self.residues.extend(other.residues);
        self.occupancies.extend(other.occupancies);
        self.b_factors.extend(other.b_factors);
        self.charges.extend(other.charges);
        self.hetatm.extend(other.hetatm);
        self.elements.append(other.elements);
        self.atoms.append(other.atoms);
        self.residue_names.append(other.residue_names);
        self.chains.append(other.chains);
        self.alternates.append(other.alternates);
        self.insertions.append(other.insertions);
    }

    /// The frame of what was appended. Columns that are blank in every line are left out.
    pub(super) fn finish(mut self, wanted: &Wanted) -> Particles {
        // A serial that did not fit counts on; a residue that did not fit is that before it.
        fill(&mut self.serials, 1);
        fill(&mut self.residues, 0);
        let (origin, positions) = self.builder.finish();
        let residues = self.residues.into_iter().map(|n| n as i32).collect();
        let mut columns = Vec::new();
        let mut add = |name: &str, values: Values| {
            if wanted.wants(name) && values.len() == positions.len() {
                columns.push(Column::new(name, 1, values));
            }
        };
        add(names::PARTICLE_IDENTIFIER, Values::I64(self.serials));
        add(names::PARTICLE_TYPE, self.elements.into_values());
        add(names::ATOM_NAME, self.atoms.into_values());
        add(names::RESIDUE_NAME, self.residue_names.into_values());
        add(names::RESIDUE_IDENTIFIER, Values::I32(residues));
        for (name, words) in [
            (names::CHAIN, self.chains),
            (names::ALTERNATE_LOCATION, self.alternates),
            (names::INSERTION_CODE, self.insertions),
        ] {
            if !words.is_blank() {
                add(name, words.into_values());
            }
        }
        add(names::OCCUPANCY, Values::F64(self.occupancies));
        add(names::B_FACTOR, Values::F64(self.b_factors));
        if self.charges.iter().any(|charge| *charge != 0) {
            add(names::CHARGE, Values::I32(self.charges));
        }
        add(names::HETATM, Values::U8(self.hetatm));
        Particles { origin, positions, columns, ..Particles::default() }
    }
}

/// Replaces numbers that did not fit by the one before plus `step`.
fn fill(numbers: &mut [i64], step: i64) {
    let mut last = 0;
    for number in numbers {
        if *number == OVERFLOWED {
            *number = last + step;
        }
        last = *number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_element_is_the_column_else_the_name() {
        let known: [(&[u8], &str); 9] = [
            (
                b"HETATM    1 ZN   LIG     1       7.534   5.301   5.301  1.00  0.00          Zn  ",
                "Zn",
            ),
            (b"ATOM      2  CA  MET A   1      26.198  25.467   2.821  1.00  9.72", "C"),
            (b"HETATM    2 CA    CA A   1      26.198  25.467   2.821  1.00  9.72", "Ca"),
            (b"ATOM      2 CA   MET A   1      26.198  25.467   2.821  1.00  9.72      5DFR", "C"),
            (b"ATOM      2 HG11 VAL A   1      26.198  25.467   2.821  1.00  9.72", "H"),
            (b"ATOM      2 1HB  LIG A   1      26.198  25.467   2.821  1.00  9.72", "H"),
            (
                b"HETATM    2 FE   HEM A   1      26.198  25.467   2.821  1.00  9.72      1ABC1234",
                "Fe",
            ),
            (b"HETATM    2 HE21 LIG A   1      26.198  25.467   2.821  1.00  9.72", "H"),
            (b"HETATM    2  Q1  LIG A   1      26.198  25.467   2.821  1.00  9.72", "X"),
        ];
        for (line, expected) in known {
            assert_eq!(element(line), expected, "{}", shown(line));
        }
    }

    #[test]
    fn charges_are_written_either_way() {
        assert_eq!([&b"2+"[..], b"1-", b"+3", b"  ", b"xy"].map(charge), [2, -1, 3, 0, 0]);
    }
}
