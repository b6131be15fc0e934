//! From the name of a property to where its values are.

use crate::read::names;
use crate::{Particles, Radius, Values};

/// Where the values of a property are: one number of each particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A column's component, or its magnitude.
    Column {
        /// The column's place among the columns.
        index: usize,
        /// The component; none: the magnitude.
        component: Option<usize>,
    },
    /// A coordinate, or the distance from the file's own origin.
    Position(Option<usize>),
    /// The file's radius.
    Radius,
    /// The particle's number in the file's order.
    Index,
}

/// The particle's number in the file's order, counted from 0.
const INDEX: &str = "Index";
/// How like a name must be to be proposed (Jaro–Winkler, 0..=1).
const LIKE: f64 = 0.7;

impl Source {
    /// Finds the property that `name`, with or without a component, means: the field's name, the file's
    /// own spelling, in any case.
    ///
    /// # Errors
    /// There is no such property or component; the nearest name is given.
    pub fn find(particles: &Particles, name: &str) -> Result<Self, String> {
        let known = known(particles);
        if let Some(source) = find_name(&known, name) {
            return source.with_component(particles, None);
        }
        if let Some((stem, component)) = split_component(name)
            && let Some(source) = find_name(&known, stem)
        {
            return source.with_component(particles, component);
        }
        if let Some((vector, component, _)) = names::component(name)
            && let Some(source) = find_name(&known, vector)
        {
            return source.with_component(particles, Some(component));
        }
        Err(unknown(particles, &known, name))
    }

    /// The same property's component `wanted`, or its magnitude.
    ///
    /// # Errors
    /// It has no such component.
    pub fn with_component(
        self,
        particles: &Particles,
        wanted: Option<usize>,
    ) -> Result<Self, String> {
        let (name, components) = match self {
            Self::Column { index, .. } => {
                let column = &particles.columns[index];
                (column.name.as_str(), column.components)
            }
            Self::Position(_) => (names::POSITION, 3),
            Self::Radius => (names::RADIUS, 1),
            Self::Index => (INDEX, 1),
        };
        match wanted {
            Some(c) if c >= components => Err(match components {
                1 => format!("`{name}` has one value and no component [{c}]"),
                n => format!("`{name}` has the components [0] to [{}], found [{c}]", n - 1),
            }),
            _ => Ok(match self {
                Self::Column { index, .. } if components == 1 => {
                    Self::Column { index, component: Some(0) }
                }
                Self::Column { index, .. } => Self::Column { index, component: wanted },
                Self::Position(_) => Self::Position(wanted),
                single => single,
            }),
        }
    }

    /// The value of particle `row`.
    pub fn value(self, particles: &Particles, row: usize) -> f64 {
        let coordinate = |axis: usize| match particles.positions.get(row) {
            Some(position) => particles.origin[axis] + f64::from(position[axis]),
            // It was taken away.
            None => f64::NAN,
        };
        match self {
            Self::Column { index, component: Some(c) } => particles.columns[index].number(row, c),
            Self::Column { index, component: None } => particles.columns[index].magnitude(row),
            Self::Position(Some(axis)) => coordinate(axis),
            Self::Position(None) => (0..3).map(|a| coordinate(a).powi(2)).sum::<f64>().sqrt(),
            Self::Radius => match &particles.radius {
                Radius::Each(radii) => f64::from(radii[row]),
                Radius::Uniform(r) => f64::from(*r),
                Radius::Unknown => f64::NAN,
            },
            Self::Index => row as f64,
        }
    }

    /// Least and greatest finite value, of positive ones only if `positive`.
    pub fn range(self, particles: &Particles, positive: bool) -> Option<[f64; 2]> {
        (0..particles.len())
            .map(|row| self.value(particles, row))
            .filter(|v| v.is_finite() && (!positive || *v > 0.0))
            .fold(None, |range, v| match range {
                None => Some([v, v]),
                Some([low, high]) => Some([v.min(low), v.max(high)]),
            })
    }

    /// The names, if the property holds names and one of them is meant for each particle.
    pub(super) fn names(self, particles: &Particles) -> Option<Names<'_>> {
        let Self::Column { index, component: Some(component) } = self else { return None };
        let column = &particles.columns[index];
        match &column.values {
            Values::Names { codes, names } => {
                Some(Names { codes, names, components: column.components, component })
            }
            _ => None,
        }
    }

    /// `number` rounded as the values of the property were; as it is where that leaves nothing of it.
    pub(super) fn round(self, particles: &Particles, number: f64) -> f64 {
        let single = |v: f64| {
            let rounded = v as f32;
            if rounded.is_normal() { f64::from(rounded) } else { v }
        };
        match self {
            Self::Column { index, component: Some(_) } => match particles.columns[index].values {
                Values::F32(_) => single(number),
                _ => number,
            },
            Self::Position(Some(axis)) => {
                particles.origin[axis] + single(number - particles.origin[axis])
            }
            Self::Radius => single(number),
            _ => number,
        }
    }
}

/// A column of names.
pub(super) struct Names<'a> {
    pub codes: &'a [u32],
    pub names: &'a [String],
    /// Codes for each particle.
    pub components: usize,
    /// Which of them is meant.
    pub component: usize,
}

/// Every property there is.
fn known(particles: &Particles) -> Vec<(&str, Source)> {
    let columns = particles.columns.iter().enumerate();
    let mut known: Vec<(&str, Source)> = columns
        .map(|(index, column)| (column.name.as_str(), Source::Column { index, component: None }))
        .collect();
    known.push((names::POSITION, Source::Position(None)));
    if particles.radius != Radius::Unknown {
        known.push((names::RADIUS, Source::Radius));
    }
    known.push((INDEX, Source::Index));
    known
}

fn find_name(known: &[(&str, Source)], name: &str) -> Option<Source> {
    let by = |same: &dyn Fn(&str) -> bool| known.iter().find(|(n, _)| same(n)).map(|(_, s)| *s);
    by(&|n| n == name)
        .or_else(|| by(&|n| n.eq_ignore_ascii_case(name)))
        .or_else(|| by(&|n| names::same(n, name)))
        .or_else(|| names::standard(name).and_then(|standard| by(&|n| n == standard)))
}

/// `Velocity.X` → (`Velocity`, 0); `Stress[4]` → (`Stress`, 4); `Velocity.Magnitude` → no component.
fn split_component(name: &str) -> Option<(&str, Option<usize>)> {
    if let Some((stem, index)) = name.strip_suffix(']').and_then(|n| n.rsplit_once('[')) {
        return index.parse().ok().map(|i| (stem, Some(i)));
    }
    let (stem, suffix) = name.rsplit_once('.')?;
    let component = match suffix.to_ascii_lowercase().as_str() {
        "x" | "r" | "1" => Some(0),
        "y" | "g" | "2" => Some(1),
        "z" | "b" | "3" => Some(2),
        "w" | "4" => Some(3),
        "magnitude" => None,
        _ => return None,
    };
    Some((stem, component))
}

/// What `name` may be called in a file.
pub(super) fn meanings(name: &str) -> Vec<String> {
    let mut meanings = vec![name];
    meanings.extend(split_component(name).map(|(stem, _)| stem));
    let standard: Vec<&str> = meanings.iter().filter_map(|n| names::standard(n)).collect();
    meanings.extend(standard);
    meanings.extend(names::component(name).map(|(vector, ..)| vector));
    meanings.into_iter().map(str::to_owned).collect()
}

fn unknown(particles: &Particles, known: &[(&str, Source)], name: &str) -> String {
    let is_text = particles.columns.iter().any(
        |c| matches!(&c.values, Values::Names { names, .. } if names.iter().any(|n| n == name)),
    );
    let near = match nearest(known, name) {
        _ if is_text => format!("; did you mean the text \"{name}\"? There are"),
        Some(near) => format!("; did you mean `{near}`? There are"),
        None => "; there are".into(),
    };
    let all: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
    format!("no property `{name}`{near} {}", all.join(", "))
}

/// The name most like the given one, or like it without its component.
fn nearest<'a>(known: &[(&'a str, Source)], name: &str) -> Option<&'a str> {
    let stem = split_component(name).map_or(name, |(stem, _)| stem).to_lowercase();
    known
        .iter()
        .map(|(candidate, _)| (strsim::jaro_winkler(&stem, &candidate.to_lowercase()), *candidate))
        .filter(|(likeness, _)| *likeness > LIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}
