//! Colours of the residues of proteins and nucleic acids.

use crate::color::Color;

/// Names of residues and their colour: RasMol's amino acids, by their chemistry, and Jmol's nucleotides.
#[rustfmt::skip]
const RESIDUES: &[(&[&str], u32)] = &[
    (&["ASP", "GLU", "ASX", "GLX"], 0xe60a0a),
    (&["CYS", "MET", "CYX", "MSE"], 0xe6e600),
    (&["LYS", "ARG"],               0x145aff),
    (&["SER", "THR"],               0xfa9600),
    (&["PHE", "TYR"],               0x3232aa),
    (&["ASN", "GLN"],               0x00dcdc),
    (&["GLY"],                      0xebebeb),
    (&["LEU", "VAL", "ILE"],        0x0f820f),
    (&["ALA"],                      0xc8c8c8),
    (&["TRP"],                      0xb45ab4),
    (&["HIS", "HID", "HIE", "HIP", "HSD", "HSE", "HSP"], 0x8282d2),
    (&["PRO"],                      0xdc9682),
    (&["A", "DA"],                  0xa0a0ff),
    (&["C", "DC"],                  0xff8c4b),
    (&["G", "DG"],                  0xff7070),
    (&["T", "DT"],                  0xa0ffa0),
    (&["U", "DU"],                  0xff8080),
    (&["I", "DI"],                  0x80ffff),
];

/// The colour of a residue by its name in capitals (`GLY`, `DA`); `None` for others.
pub fn residue_color(name: &str) -> Option<Color> {
    let known = RESIDUES.iter().find(|(names, _)| names.contains(&name));
    known.map(|(_, color)| Color::hex(*color))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amino_acids_are_known_and_each_once() {
        let all = "ALA ARG ASN ASP CYS GLN GLU GLY HIS ILE LEU LYS MET PHE PRO SER THR TRP TYR VAL";
        assert!(all.split(' ').all(|name| residue_color(name).is_some()));
        assert_eq!(residue_color("GLY"), Some(Color::hex(0xebebeb)));
        assert_eq!(residue_color("HOH"), None);
        let mut names: Vec<_> = RESIDUES.iter().flat_map(|(names, _)| *names).collect();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
