//! What the columns of a table mean: coordinates, components of vectors, properties.

use super::layout::Layout;
use crate::read::names;
use crate::read::rows::{self, Group, Kind};

/// What is in front of (or behind) `x`, `y`, `z` or 0, 1, 2 in names of coordinates, best first; `geo`
/// stands for longitude, latitude and height.
const POSITION_STEMS: [&str; 19] = [
    "",
    "points",
    "point",
    "position",
    "positions",
    "pos",
    "p",
    "coordinates",
    "coordinate",
    "coords",
    "coord",
    "location",
    "loc",
    "center",
    "centre",
    "centroid",
    "xyz",
    "r",
    "geo",
];

/// The columns of a table, resolved; see [`rows::Schema`].
pub(super) struct Roles {
    pub(super) groups: Vec<Group>,
    pub(super) fields: Vec<Option<(usize, usize)>>,
    /// Which axes the table has; the others are 0.
    pub(super) present: [bool; 3],
    /// The radii are diameters.
    pub(super) diameter: bool,
    /// What had to be guessed.
    pub(super) warning: Option<String>,
}

impl Roles {
    /// The roles of a table's columns.
    ///
    /// # Errors
    /// It has no two columns of numbers.
    pub(super) fn of(layout: &Layout) -> Result<Self, String> {
        let width = layout.numeric.len();
        let names: Vec<String> = match &layout.names {
            Some(names) => names.iter().map(|n| n.trim().to_owned()).collect(),
            None => vec![String::new(); width],
        };
        let named = position_columns(&names);
        let axes = named.unwrap_or_else(|| first_numbers(layout));
        if axes.iter().flatten().count() < 2 {
            return Err("expected two columns of coordinates at least, found none".to_owned());
        }
        let warning = (named.is_none() && layout.names.is_some()).then(|| {
            let used: Vec<_> = axes.iter().flatten().map(|i| names[*i].as_str()).collect();
            format!(
                "no column is called x, y, z or alike; {} are taken as coordinates",
                used.join(", ")
            )
        });
        let mut roles = Self {
            groups: vec![Group { name: names::POSITION.into(), components: 3, kind: Kind::Real }],
            fields: vec![None; width],
            present: axes.map(|a| a.is_some()),
            diameter: false,
            warning,
        };
        for (axis, field) in axes.iter().enumerate() {
            if let Some(field) = field {
                roles.fields[*field] = Some((0, axis));
            }
        }
        let vectors = vectors(&names, &roles.fields);
        let has_radius = names.iter().any(|n| names::standard(&bare(n)) == Some(names::RADIUS));
        for (i, vector) in vectors.into_iter().enumerate() {
            if roles.fields[i].is_some() {
                continue;
            }
            if let Some((name, component, components)) = vector {
                let make = || Group {
                    kind: kind_of(&name, layout.numeric[i]),
                    name: name.clone(),
                    components,
                };
                let group = rows::group_index(&mut roles.groups, &name, make);
                roles.fields[i] = Some((group, component));
            } else {
                roles.add_scalar(i, &names[i], layout.numeric[i], has_radius);
            }
        }
        Ok(roles)
    }

    fn add_scalar(&mut self, field: usize, name: &str, numeric: Option<bool>, has_radius: bool) {
        let own = if name.is_empty() { format!("Column {}", field + 1) } else { name.to_owned() };
        let is_diameter = !has_radius && matches!(bare(name).as_str(), "diameter" | "diam");
        let standard = match names::standard(name) {
            _ if is_diameter => names::RADIUS,
            // Vectors have more than one component.
            Some(standard) if SCALARS.contains(&standard) => standard,
            _ if names::standard(&bare(name)) == Some(names::RADIUS) => names::RADIUS,
            _ => &own,
        };
        let name = rows::free_name(&self.groups, standard, &own);
        self.diameter |= is_diameter && name == names::RADIUS;
        let kind = kind_of(&name, numeric);
        self.fields[field] = Some((self.groups.len(), 0));
        self.groups.push(Group { name, components: 1, kind });
    }
}

/// Standard properties of one component.
const SCALARS: [&str; 6] = [
    names::RADIUS,
    names::PARTICLE_TYPE,
    names::PARTICLE_IDENTIFIER,
    names::MOLECULE_IDENTIFIER,
    names::MASS,
    names::CHARGE,
];

fn kind_of(name: &str, numeric: Option<bool>) -> Kind {
    const REAL: [&str; 8] = [
        names::RADIUS,
        names::VELOCITY,
        names::FORCE,
        names::ACCELERATION,
        names::ANGULAR_VELOCITY,
        names::MASS,
        names::CHARGE,
        names::NORMAL,
    ];
    match numeric {
        _ if name == names::RADIUS => Kind::Real,
        Some(false) => Kind::Name,
        _ if REAL.contains(&name) => Kind::Real,
        _ => Kind::Guess,
    }
}

/// Whether coordinates are among `names`.
pub(super) fn has_coordinates(names: &[String]) -> bool {
    position_columns(names).is_some()
}

/// A name in lower case, without a unit in brackets at its end.
fn bare(name: &str) -> String {
    let name = name.trim().to_ascii_lowercase();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((stem, unit)) = name.strip_suffix(close).and_then(|n| n.rsplit_once(open))
            && !unit.chars().all(|c| c.is_ascii_digit())
            && !stem.trim().is_empty()
        {
            return stem.trim().to_owned();
        }
    }
    name
}

/// A name as that of a vector's component: the vector, in lower case, the component, and whether a
/// separator or bracket stands between.
fn split_component(name: &str) -> Option<(String, usize, bool)> {
    let name = bare(name);
    let geographic = match name.as_str() {
        "longitude" | "lon" | "long" | "lng" => Some(0),
        "latitude" | "lat" => Some(1),
        "altitude" | "alt" | "height" | "elevation" | "depth" => Some(2),
        _ => None,
    };
    if let Some(axis) = geographic {
        return Some(("geo".to_owned(), axis, true));
    }
    let separators = [':', '.', '_', '-', ' ', '[', '('];
    let axis = |c: &str| match c {
        "x" | "0" => Some(0),
        "y" | "1" => Some(1),
        "z" | "2" => Some(2),
        digit => digit.parse().ok().filter(|d| *d < 9),
    };
    // `x_pos`, `x position`
    if let Some((first, stem)) = name.split_once(['_', ' '])
        && matches!(first, "x" | "y" | "z")
        && !stem.is_empty()
    {
        return Some((stem.to_owned(), axis(first)?, true));
    }
    let inner = name.trim_end_matches([']', ')']);
    let (at, last) = inner.char_indices().next_back()?;
    let component = axis(&inner[at..])?;
    let stem = &inner[..at];
    let parted = stem.ends_with(separators);
    if last.is_ascii_digit() && !parted {
        return None;
    }
    Some((stem.trim_end_matches(separators).to_owned(), component, parted))
}

/// The columns of x, y and z by their names; at least two of them.
fn position_columns(names: &[String]) -> Option<[Option<usize>; 3]> {
    let split: Vec<_> = names.iter().map(|n| split_component(n)).collect();
    let of_stem = |stem: &str| -> [Option<usize>; 3] {
        std::array::from_fn(|axis| {
            split.iter().position(|s| s.as_ref().is_some_and(|(s, a, _)| s == stem && *a == axis))
        })
    };
    let mut found: Vec<_> = POSITION_STEMS.iter().map(|stem| of_stem(stem)).collect();
    // Longitude and latitude with a bare z.
    if let (Some(plain), Some(geographic)) = (found.first().copied(), found.last_mut())
        && geographic[0].is_some()
        && geographic[1].is_some()
        && geographic[2].is_none()
    {
        geographic[2] = plain[2];
    }
    let axes = |n: usize| found.iter().find(|a| a.iter().flatten().count() == n).copied();
    axes(3).or_else(|| axes(2))
}

/// The first three columns of numbers.
fn first_numbers(layout: &Layout) -> [Option<usize>; 3] {
    let mut columns = (0..layout.numeric.len()).filter(|i| layout.numeric[*i] == Some(true));
    std::array::from_fn(|_| columns.next())
}

/// For each column that is no coordinate: the vector it belongs to, its component, how many there are.
fn vectors(
    names: &[String],
    fields: &[Option<(usize, usize)>],
) -> Vec<Option<(String, usize, usize)>> {
    let candidates: Vec<_> = names
        .iter()
        .zip(fields)
        .map(|(name, taken)| if taken.is_some() { None } else { vector_of(name) })
        .collect();
    let complete = |vector: &str| {
        let components: Vec<_> =
            candidates.iter().flatten().filter(|(v, _)| v == vector).map(|(_, c)| *c).collect();
        let size = components.len();
        (matches!(size, 3 | 4 | 6 | 9) && (0..size).all(|c| components.contains(&c)))
            .then_some(size)
    };
    let joined = |(name, component): &(String, usize)| {
        complete(name).map(|size| (name.clone(), *component, size))
    };
    candidates.iter().map(|candidate| candidate.as_ref().and_then(joined)).collect()
}

/// The vector that a column may belong to, and its component.
fn vector_of(name: &str) -> Option<(String, usize)> {
    if let Some((standard, component, _)) = names::component(&bare(name)) {
        return Some((standard.to_owned(), component));
    }
    let (stem, component, parted) = split_component(name)?;
    if !parted || stem.is_empty() || stem == "geo" {
        return None;
    }
    let standard = match stem.as_str() {
        "v" => Some(names::VELOCITY),
        "f" => Some(names::FORCE),
        stem => names::standard(stem),
    };
    // A second set of coordinates, or a vector called like a scalar, stays in single columns.
    if standard.is_some_and(|s| s == names::POSITION || SCALARS.contains(&s)) {
        return None;
    }
    let own = name.get(..stem.len()).filter(|own| own.eq_ignore_ascii_case(&stem));
    Some((standard.unwrap_or(own.unwrap_or(&stem)).to_owned(), component))
}
