//! The chemical elements: mass, radii and colour.

use crate::color::Color;

/// An element, or an isotope of hydrogen by its own symbol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Element {
    /// Atomic number, 1 to 118.
    pub number: u8,
    /// The symbol, as in `Fe`.
    pub symbol: &'static str,
    /// Standard atomic weight (IUPAC), or the mass number of an element that has none; daltons.
    pub mass: f64,
    /// Covalent radius, Å: Cordero et al. 2008 (carbon sp³; manganese, iron, cobalt low-spin); to curium.
    pub covalent_radius: Option<f64>,
    /// Van der Waals radius, Å: Bondi 1964, else Mantina et al. 2009, else Alvarez 2013; to einsteinium,
    /// but for promethium.
    pub vdw_radius: Option<f64>,
    /// Jmol's colour; from meitnerium on, meitnerium's.
    pub color: Color,
}

impl Element {
    /// By symbol, in any case (`Fe`, `FE`), `D` and `T` included; `None` for anything else.
    pub fn by_symbol(symbol: &str) -> Option<Self> {
        let symbol = symbol.trim();
        let isotope = |symbol, mass| Self::by_number(1).map(|h| Self { symbol, mass, ..h });
        if symbol.eq_ignore_ascii_case("D") {
            return isotope("D", 2.014_101_778);
        }
        if symbol.eq_ignore_ascii_case("T") {
            return isotope("T", 3.016_049_282);
        }
        let index = ELEMENTS.iter().position(|e| e.0.eq_ignore_ascii_case(symbol))?;
        Self::by_number(u8::try_from(index + 1).ok()?)
    }

    /// By atomic number, from 1; `None` beyond 118.
    pub fn by_number(number: u8) -> Option<Self> {
        let index = usize::from(number).checked_sub(1)?;
        let &(symbol, mass, covalent, vdw, color) = ELEMENTS.get(index)?;
        let radius = |pm: u16| (pm > 0).then(|| f64::from(pm) / 100.0);
        Some(Self {
            number,
            symbol,
            mass,
            covalent_radius: radius(covalent),
            vdw_radius: radius(vdw),
            color: Color::hex(color),
        })
    }
}

/// By atomic number: symbol, mass (Da), covalent and van der Waals radius (pm, 0: not known), colour.
#[rustfmt::skip]
const ELEMENTS: [(&str, f64, u16, u16, u32); 118] = [
    ("H", 1.008, 31, 120, 0xffffff),
    ("He", 4.0026, 28, 140, 0xd9ffff),
    ("Li", 6.94, 128, 182, 0xcc80ff),
    ("Be", 9.0122, 96, 153, 0xc2ff00),
    ("B", 10.81, 84, 192, 0xffb5b5),
    ("C", 12.011, 76, 170, 0x909090),
    ("N", 14.007, 71, 155, 0x3050f8),
    ("O", 15.999, 66, 152, 0xff0d0d),
    ("F", 18.9984, 56, 147, 0x90e050),
    ("Ne", 20.1797, 57, 154, 0xb3e3f5),
    ("Na", 22.9898, 166, 227, 0xab5cf2),
    ("Mg", 24.305, 141, 173, 0x8aff00),
    ("Al", 26.9815, 121, 184, 0xbfa6a6),
    ("Si", 28.085, 111, 210, 0xf0c8a0),
    ("P", 30.9738, 107, 180, 0xff8000),
    ("S", 32.06, 105, 180, 0xffff30),
    ("Cl", 35.45, 102, 175, 0x1ff01f),
    ("Ar", 39.948, 106, 188, 0x80d1e3),
    ("K", 39.0983, 202, 275, 0x8f40d4),
    ("Ca", 40.078, 176, 231, 0x3dff00),
    ("Sc", 44.9559, 170, 258, 0xe6e6e6),
    ("Ti", 47.867, 160, 246, 0xbfc2c7),
    ("V", 50.9415, 153, 242, 0xa6a6ab),
    ("Cr", 51.9961, 139, 245, 0x8a99c7),
    ("Mn", 54.938, 139, 245, 0x9c7ac7),
    ("Fe", 55.845, 132, 244, 0xe06633),
    ("Co", 58.9332, 126, 240, 0xf090a0),
    ("Ni", 58.6934, 124, 163, 0x50d050),
    ("Cu", 63.546, 132, 140, 0xc88033),
    ("Zn", 65.38, 122, 139, 0x7d80b0),
    ("Ga", 69.723, 122, 187, 0xc28f8f),
    ("Ge", 72.63, 120, 211, 0x668f8f),
    ("As", 74.9216, 119, 185, 0xbd80e3),
    ("Se", 78.971, 120, 190, 0xffa100),
    ("Br", 79.904, 120, 185, 0xa62929),
    ("Kr", 83.798, 115, 202, 0x5cb8d1),
    ("Rb", 85.4678, 220, 303, 0x702eb0),
    ("Sr", 87.62, 195, 249, 0x00ff00),
    ("Y", 88.9058, 190, 275, 0x94ffff),
    ("Zr", 91.224, 175, 252, 0x94e0e0),
    ("Nb", 92.9064, 164, 256, 0x73c2c9),
    ("Mo", 95.95, 154, 245, 0x54b5b5),
    ("Tc", 97.9072, 147, 244, 0x3b9e9e),
    ("Ru", 101.07, 146, 246, 0x248f8f),
    ("Rh", 102.9055, 142, 244, 0x0a7d8c),
    ("Pd", 106.42, 139, 163, 0x006985),
    ("Ag", 107.8682, 145, 172, 0xc0c0c0),
    ("Cd", 112.414, 144, 158, 0xffd98f),
    ("In", 114.818, 142, 193, 0xa67573),
    ("Sn", 118.71, 139, 217, 0x668080),
    ("Sb", 121.76, 139, 206, 0x9e63b5),
    ("Te", 127.6, 138, 206, 0xd47a00),
    ("I", 126.9045, 139, 198, 0x940094),
    ("Xe", 131.293, 140, 216, 0x429eb0),
    ("Cs", 132.9055, 244, 343, 0x57178f),
    ("Ba", 137.327, 215, 268, 0x00c900),
    ("La", 138.9055, 206, 298, 0x70d4ff),
    ("Ce", 140.116, 204, 288, 0xffffc7),
    ("Pr", 140.9077, 202, 292, 0xd9ffc7),
    ("Nd", 144.242, 200, 295, 0xc7ffc7),
    ("Pm", 145.0, 199, 0, 0xa3ffc7),
    ("Sm", 150.36, 198, 290, 0x8fffc7),
    ("Eu", 151.964, 198, 287, 0x61ffc7),
    ("Gd", 157.25, 196, 283, 0x45ffc7),
    ("Tb", 158.9254, 194, 279, 0x30ffc7),
    ("Dy", 162.5, 192, 287, 0x1fffc7),
    ("Ho", 164.9303, 192, 281, 0x00ff9c),
    ("Er", 167.259, 189, 283, 0x00e675),
    ("Tm", 168.9342, 190, 279, 0x00d452),
    ("Yb", 173.045, 187, 280, 0x00bf38),
    ("Lu", 174.9668, 187, 274, 0x00ab24),
    ("Hf", 178.49, 175, 263, 0x4dc2ff),
    ("Ta", 180.9479, 170, 253, 0x4da6ff),
    ("W", 183.84, 162, 257, 0x2194d6),
    ("Re", 186.207, 151, 249, 0x267dab),
    ("Os", 190.23, 144, 248, 0x266696),
    ("Ir", 192.217, 141, 241, 0x175487),
    ("Pt", 195.084, 136, 175, 0xd0d0e0),
    ("Au", 196.9666, 136, 166, 0xffd123),
    ("Hg", 200.592, 132, 155, 0xb8b8d0),
    ("Tl", 204.38, 145, 196, 0xa6544d),
    ("Pb", 207.2, 146, 202, 0x575961),
    ("Bi", 208.9804, 148, 207, 0x9e4fb5),
    ("Po", 209.0, 140, 197, 0xab5c00),
    ("At", 210.0, 150, 202, 0x754f45),
    ("Rn", 222.0, 150, 220, 0x428296),
    ("Fr", 223.0, 260, 348, 0x420066),
    ("Ra", 226.0, 221, 283, 0x007d00),
    ("Ac", 227.0, 215, 280, 0x70abfa),
    ("Th", 232.0377, 206, 293, 0x00baff),
    ("Pa", 231.0359, 200, 288, 0x00a1ff),
    ("U", 238.0289, 196, 186, 0x008fff),
    ("Np", 237.0, 190, 282, 0x0080ff),
    ("Pu", 244.0, 187, 281, 0x006bff),
    ("Am", 243.0, 180, 283, 0x545cf2),
    ("Cm", 247.0, 169, 305, 0x785ce3),
    ("Bk", 247.0, 0, 340, 0x8a4fe3),
    ("Cf", 251.0, 0, 305, 0xa136d4),
    ("Es", 252.0, 0, 270, 0xb31fd4),
    ("Fm", 257.0, 0, 0, 0xb31fba),
    ("Md", 258.0, 0, 0, 0xb30da6),
    ("No", 259.0, 0, 0, 0xbd0d87),
    ("Lr", 262.0, 0, 0, 0xc70066),
    ("Rf", 267.0, 0, 0, 0xcc0059),
    ("Db", 268.0, 0, 0, 0xd1004f),
    ("Sg", 271.0, 0, 0, 0xd90045),
    ("Bh", 274.0, 0, 0, 0xe00038),
    ("Hs", 269.0, 0, 0, 0xe6002e),
    ("Mt", 276.0, 0, 0, 0xeb0026),
    ("Ds", 281.0, 0, 0, 0xeb0026),
    ("Rg", 281.0, 0, 0, 0xeb0026),
    ("Cn", 285.0, 0, 0, 0xeb0026),
    ("Nh", 286.0, 0, 0, 0xeb0026),
    ("Fl", 289.0, 0, 0, 0xeb0026),
    ("Mc", 288.0, 0, 0, 0xeb0026),
    ("Lv", 293.0, 0, 0, 0xeb0026),
    ("Ts", 294.0, 0, 0, 0xeb0026),
    ("Og", 294.0, 0, 0, 0xeb0026),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers() {
        let fe = Element::by_symbol("FE").unwrap();
        assert_eq!((fe.number, fe.symbol, fe.mass), (26, "Fe", 55.845));
        assert_eq!((fe.covalent_radius, fe.vdw_radius), (Some(1.32), Some(2.44)));
        assert_eq!(fe.color, Color::hex(0xe06633));
        let vdw = |s| Element::by_symbol(s).and_then(|e| e.vdw_radius);
        // Bondi; Mantina (aluminium); Alvarez (titanium).
        let radii = ["H", "C", "N", "O", "Cu", "Al", "Ti"].map(vdw);
        assert_eq!(radii, [1.2, 1.7, 1.55, 1.52, 1.4, 1.84, 2.46].map(Some));
    }

    #[test]
    fn isotopes_and_strangers() {
        let d = Element::by_symbol("d").unwrap();
        assert_eq!((d.number, d.symbol, d.vdw_radius), (1, "D", Some(1.2)));
        assert!(Element::by_symbol("T").unwrap().mass > 3.0);
        for name in ["", "X", "CX", "Fe3", "Iron"] {
            assert_eq!(Element::by_symbol(name), None, "{name}");
        }
        assert_eq!((Element::by_number(0), Element::by_number(119)), (None, None));
    }

    #[test]
    fn the_table_is_whole() {
        for (i, row) in ELEMENTS.iter().enumerate() {
            let element = Element::by_symbol(row.0).unwrap();
            assert_eq!(usize::from(element.number), i + 1, "{}", row.0);
            assert_eq!(element.covalent_radius.is_some(), i < 96, "{}", row.0);
            assert_eq!(element.vdw_radius.is_some(), i < 99 && row.0 != "Pm", "{}", row.0);
            assert!((1.0..300.0).contains(&element.mass));
        }
    }
}
