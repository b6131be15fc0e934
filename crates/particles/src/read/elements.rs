//! The symbols of the chemical elements.

/// The symbols by atomic number, from hydrogen, 1.
#[rustfmt::skip]
const SYMBOLS: [&str; 118] = [
    "H", "He", "Li", "Be", "B", "C", "N", "O", "F", "Ne", "Na", "Mg", "Al", "Si", "P", "S", "Cl", "Ar",
    "K", "Ca", "Sc", "Ti", "V", "Cr", "Mn", "Fe", "Co", "Ni", "Cu", "Zn", "Ga", "Ge", "As", "Se", "Br", "Kr",
    "Rb", "Sr", "Y", "Zr", "Nb", "Mo", "Tc", "Ru", "Rh", "Pd", "Ag", "Cd", "In", "Sn", "Sb", "Te", "I", "Xe",
    "Cs", "Ba", "La", "Ce", "Pr", "Nd", "Pm", "Sm", "Eu", "Gd", "Tb", "Dy", "Ho", "Er", "Tm", "Yb", "Lu",
    "Hf", "Ta", "W", "Re", "Os", "Ir", "Pt", "Au", "Hg", "Tl", "Pb", "Bi", "Po", "At", "Rn",
    "Fr", "Ra", "Ac", "Th", "Pa", "U", "Np", "Pu", "Am", "Cm", "Bk", "Cf", "Es", "Fm", "Md", "No", "Lr",
    "Rf", "Db", "Sg", "Bh", "Hs", "Mt", "Ds", "Rg", "Cn", "Nh", "Fl", "Mc", "Lv", "Ts", "Og",
];

/// The symbol of the element that is written `text`, in any case; deuterium is `D`.
pub(crate) fn symbol(text: &[u8]) -> Option<&'static str> {
    // Nearly all atoms there are.
    match text {
        b"H" => return Some("H"),
        b"C" => return Some("C"),
        b"N" => return Some("N"),
        b"O" => return Some("O"),
        b"d" | b"D" => return Some("D"),
        [_] | [_, _] => {}
        _ => return None,
    }
    SYMBOLS.iter().find(|symbol| symbol.as_bytes().eq_ignore_ascii_case(text)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order() {
        for (number, symbol) in [(1, "H"), (26, "Fe"), (57, "La"), (80, "Hg"), (118, "Og")] {
            assert_eq!(SYMBOLS[number - 1], symbol);
        }
        assert_eq!((symbol(b"ZN"), symbol(b"d"), symbol(b"Q")), (Some("Zn"), Some("D"), None));
    }
}
