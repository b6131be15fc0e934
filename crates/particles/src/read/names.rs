//! The field's standard names of properties.
//!
//! One spelling per property, as OVITO and the simulation codes' users know them; a format maps its
//! own spellings to these and keeps what it does not know.

use crate::{Column, Values};

/// Particle positions; never a column, but the name users write in expressions.
pub const POSITION: &str = "Position";
/// Sphere radii; stored apart from the columns.
pub const RADIUS: &str = "Radius";
/// Type or element, a number or a name.
pub const PARTICLE_TYPE: &str = "Particle Type";
/// The simulation's own number of the particle.
pub const PARTICLE_IDENTIFIER: &str = "Particle Identifier";
/// The number of the molecule.
pub const MOLECULE_IDENTIFIER: &str = "Molecule Identifier";
/// Velocity, three components.
pub const VELOCITY: &str = "Velocity";
/// Angular velocity, three components.
pub const ANGULAR_VELOCITY: &str = "Angular Velocity";
/// Force, three components.
pub const FORCE: &str = "Force";
/// Mass.
pub const MASS: &str = "Mass";
/// Electric charge.
pub const CHARGE: &str = "Charge";
/// How often the particle crossed each periodic boundary.
pub const PERIODIC_IMAGE: &str = "Periodic Image";
/// Red, green, blue: 0–1 as floats, 0–255 as bytes.
pub const COLOR: &str = "Color";
/// 0 opaque, 1 invisible.
pub const TRANSPARENCY: &str = "Transparency";
/// Orientation quaternion.
pub const ORIENTATION: &str = "Orientation";
/// Chain of a macromolecule.
pub const CHAIN: &str = "Chain Identifier";
/// Residue name.
pub const RESIDUE_NAME: &str = "Residue Name";
/// Residue number.
pub const RESIDUE_IDENTIFIER: &str = "Residue Identifier";
/// Atom name within its residue.
pub const ATOM_NAME: &str = "Atom Name";
/// Temperature factor.
pub const B_FACTOR: &str = "B Factor";
/// Occupancy.
pub const OCCUPANCY: &str = "Occupancy";
/// Unit vector across the surface a point was taken from, three components.
pub const NORMAL: &str = "Normal";
/// Acceleration, three components.
pub const ACCELERATION: &str = "Acceleration";
/// Which of an atom's alternate locations it is.
pub const ALTERNATE_LOCATION: &str = "Alternate Location";
/// What tells residues of one number apart.
pub const INSERTION_CODE: &str = "Insertion Code";
/// 1 where the atom is of a ligand or solvent (a `HETATM` line), else 0.
pub const HETATM: &str = "HETATM";
/// Angular momentum, three components.
pub const ANGULAR_MOMENTUM: &str = "Angular Momentum";
/// Dipole moment, three components.
pub const DIPOLE: &str = "Dipole Orientation";
/// How much of the surroundings is filled, in six directions: +x, −x, +y, −y, +z, −z.
pub const PARTICLE_MASK: &str = "Particle Mask";
/// How long ago the particle appeared; see [`crate::Series::add_ages`].
pub const AGE: &str = "Age";
/// Torque, three components.
pub const TORQUE: &str = "Torque";

/// Spellings of properties, in lower case.
const SPELLINGS: &[(&str, &[&str])] = &[
    (POSITION, &["position", "positions", "pos", "points", "coordinates"]),
    (RADIUS, &["radius", "radii", "radius_particle", "particle_radius"]),
    (
        PARTICLE_TYPE,
        &["species", "type", "element", "particle type", "particle_type", "particletype"],
    ),
    (
        PARTICLE_IDENTIFIER,
        &[
            "id",
            "ids",
            "idp",
            "particle identifier",
            "particle_identifier",
            "particle id",
            "particle_id",
            "particleid",
            "particleids",
            "identifier",
        ],
    ),
    (
        MOLECULE_IDENTIFIER,
        &["mol", "molecule", "molecule identifier", "molecule_identifier", "molecule_id"],
    ),
    (VELOCITY, &["velocity", "velocities", "vel", "velo", "vels"]),
    (
        ANGULAR_VELOCITY,
        &["omega", "angular velocity", "angular_velocity", "angularvelocity", "angvel"],
    ),
    (ANGULAR_MOMENTUM, &["angmom", "angular momentum", "angular_momentum"]),
    (FORCE, &["force", "forces"]),
    (TORQUE, &["torque", "torques", "tq"]),
    (ACCELERATION, &["acceleration", "accelerations", "acc", "ace", "accel"]),
    (MASS, &["mass", "masses"]),
    (CHARGE, &["q", "charge", "charges"]),
    (PERIODIC_IMAGE, &["periodic image", "periodic_image", "map_shift"]),
    (COLOR, &["color", "colour", "colors", "rgb"]),
    (TRANSPARENCY, &["transparency"]),
    (ORIENTATION, &["orientation", "quaternion", "quat"]),
    (NORMAL, &["normal", "normals"]),
    (PARTICLE_MASK, &["particle mask", "particle_mask"]),
    (DIPOLE, &["dipole orientation", "dipole", "mu"]),
];

/// Spellings of the components of vectors, in lower case, x before y before z.
const COMPONENTS: &[(&str, &[&str])] = &[
    (VELOCITY, &["vx", "vy", "vz"]),
    (FORCE, &["fx", "fy", "fz"]),
    (ANGULAR_VELOCITY, &["omegax", "omegay", "omegaz"]),
    (ANGULAR_VELOCITY, &["wx", "wy", "wz"]),
    (ANGULAR_MOMENTUM, &["angmomx", "angmomy", "angmomz"]),
    (TORQUE, &["tqx", "tqy", "tqz"]),
    (DIPOLE, &["mux", "muy", "muz"]),
    (PERIODIC_IMAGE, &["ix", "iy", "iz"]),
    (ACCELERATION, &["ax", "ay", "az"]),
    (NORMAL, &["nx", "ny", "nz"]),
    (ORIENTATION, &["quati", "quatj", "quatk", "quatw"]),
    (COLOR, &["r", "g", "b"]),
    (COLOR, &["red", "green", "blue"]),
    (COLOR, &["diffuse_red", "diffuse_green", "diffuse_blue"]),
];

/// The standard name of a property that is spelled `name`, in any case.
pub fn standard(name: &str) -> Option<&'static str> {
    let name = name.to_ascii_lowercase();
    SPELLINGS.iter().find(|(_, all)| all.contains(&name.as_str())).map(|(standard, _)| *standard)
}

/// Whether two names differ only in case, blanks and underscores.
pub fn same(a: &str, b: &str) -> bool {
    let letters = |name: &str| -> Vec<char> {
        let letters = name.chars().filter(|c| !matches!(c, ' ' | '_'));
        letters.map(|c| c.to_ascii_lowercase()).collect()
    };
    letters(a) == letters(b)
}

/// The standard name and the component of a vector's component that is spelled `name`, in any case,
/// and how many components that vector has.
pub fn component(name: &str) -> Option<(&'static str, usize, usize)> {
    let name = name.to_ascii_lowercase();
    COMPONENTS.iter().find_map(|(standard, all)| {
        all.iter().position(|n| *n == name).map(|i| (*standard, i, all.len()))
    })
}

/// As [`standard`], but only where the property has so many components: a speed is no velocity.
pub fn standard_of(name: &str, components: usize) -> Option<&'static str> {
    let standard = standard(name).filter(|standard| *standard != POSITION)?;
    let expected = match standard {
        RADIUS | PARTICLE_TYPE | PARTICLE_IDENTIFIER | MOLECULE_IDENTIFIER => 1,
        MASS | CHARGE | TRANSPARENCY => 1,
        ORIENTATION => 4,
        PARTICLE_MASK => 6,
        _ => 3,
    };
    (components == expected).then_some(standard)
}

/// Joins columns `vx`, `vy`, `vz` and the like into one, where all are there and of one type.
pub fn joined(mut columns: Vec<Column>) -> Vec<Column> {
    for (standard, spellings) in COMPONENTS {
        let place = |spelling: &&str| {
            let fits = |c: &Column| c.components == 1 && c.name.eq_ignore_ascii_case(spelling);
            columns.iter().position(fits)
        };
        let Some(places) = spellings.iter().map(place).collect::<Option<Vec<_>>>() else {
            continue;
        };
        let parts: Vec<&Values> = places.iter().map(|at| &columns[*at].values).collect();
        let Some(values) = interleaved(&parts) else { continue };
        if columns.iter().any(|column| column.name == *standard) {
            continue;
        }
        let first = places.iter().copied().min().unwrap_or(0);
        columns[first] = Column::new(*standard, spellings.len(), values);
        let mut at = 0..;
        columns.retain(|_| at.next().is_none_or(|at| at == first || !places.contains(&at)));
    }
    columns
}

fn interleaved(parts: &[&Values]) -> Option<Values> {
    fn rows<T: Copy>(parts: &[&Vec<T>]) -> Vec<T> {
        let rows = parts.iter().map(|part| part.len()).min().unwrap_or(0);
        (0..rows).flat_map(|row| parts.iter().map(move |part| part[row])).collect()
    }
    macro_rules! of {
        ($kind:ident) => {
            parts
                .iter()
                .map(|part| if let Values::$kind(v) = part { Some(v) } else { None })
                .collect::<Option<Vec<_>>>()
                .map(|parts| Values::$kind(rows(&parts)))
        };
    }
    of!(F32).or_else(|| of!(F64)).or_else(|| of!(I32)).or_else(|| of!(I64)).or_else(|| of!(U8))
}
