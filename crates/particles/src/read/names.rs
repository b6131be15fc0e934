//! The field's standard names of properties.
//!
//! One spelling per property, as OVITO and the simulation codes' users know them; a format maps its
//! own spellings to these and keeps what it does not know.

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
