//! What colour each particle has.

use std::sync::Arc;

use glam::Vec3;
use motes_particles::expression::Property;
use motes_particles::read::names;
use motes_particles::{Column, Particles, Values};
use motes_scene::{
    Color, ColorBy, ColorMap, Coloring, Component, Element, System, nearest, residue_color,
};

use crate::opacity::Opacity;
use crate::{Error, Result};

/// What `color.by` can be besides the name of a property.
const WORDS: &[&str] = &["auto", "uniform", "element", "type", "chain", "residue"];

/// The colours of one system's particles.
#[derive(Clone, Debug)]
pub(crate) struct Paint {
    particles: Arc<Particles>,
    how: How,
    /// How much each particle hides.
    pub opacity: Opacity,
    /// What the colours mean, for the legend.
    pub meaning: Meaning,
}

#[derive(Clone, Debug)]
enum How {
    Uniform(Vec3),
    /// The colours of the file: a column, and the factor that brings it to 0..=1.
    Own {
        column: usize,
        scale: f64,
    },
    /// A kind per particle, and the colours of the kinds.
    Kinds {
        kinds: Vec<u32>,
        colors: Vec<Vec3>,
    },
    Mapped(Mapped),
}

/// A property through a colour map.
#[derive(Clone, Debug)]
struct Mapped {
    property: Property,
    low: f64,
    /// 1 / (high − low); 0 where they are equal.
    scale: f64,
    log: bool,
    table: Box<[Vec3; 256]>,
    missing: Vec3,
}

/// What colours mean.
#[derive(Clone, Debug)]
pub(crate) enum Meaning {
    /// Nothing.
    Nothing,
    /// Values between two ends.
    Range { title: String, range: [f64; 2], colors: Vec<[f32; 3]>, log: bool },
    /// Names, each with its colour.
    Categories { title: String, entries: Vec<(String, Vec3)> },
}

/// Finds the property called `name`; where the name says no component, `component` does.
///
/// # Errors
/// There is no such property; the nearest name is given.
pub(crate) fn find_property(
    particles: &Particles,
    name: &str,
    component: Component,
) -> Result<Property> {
    let found = Property::find(particles, name).map_err(Error::Usage)?;
    let vector = match found {
        Property::Column { component, .. } | Property::Position(component) => component.is_none(),
        _ => false,
    };
    match component_number(component) {
        Some(c) if vector => found.with_component(particles, Some(c)).map_err(Error::Usage),
        _ => Ok(found),
    }
}

fn component_number(component: Component) -> Option<usize> {
    match component {
        Component::X => Some(0),
        Component::Y => Some(1),
        Component::Z => Some(2),
        Component::Magnitude => None,
    }
}

impl Paint {
    /// The paint of `particles` as `system` says; `range` overrides the frame's own range, such as the
    /// whole series'.
    ///
    /// # Errors
    /// No such property or colour map.
    pub fn new(
        particles: &Arc<Particles>,
        system: &System,
        range: Option<[f64; 2]>,
    ) -> Result<Self> {
        let coloring = &system.color;
        let (how, meaning) = match &coloring.by {
            ColorBy::Auto => automatic(particles, coloring),
            ColorBy::Uniform => uniform(coloring),
            ColorBy::Element | ColorBy::Type => {
                let types = category_column(particles, &[names::PARTICLE_TYPE])?;
                let known = if coloring.by == ColorBy::Element { element } else { nothing };
                categories(types, coloring, known)
            }
            ColorBy::Chain => {
                let of = [names::CHAIN, names::MOLECULE_IDENTIFIER];
                categories(category_column(particles, &of)?, coloring, nothing)
            }
            ColorBy::Residue => categories(
                category_column(particles, &[names::RESIDUE_NAME])?,
                coloring,
                residue_color,
            ),
            ColorBy::Property(name) => by_property(particles, coloring, name, range)?,
        };
        let own_color = match how {
            How::Own { column, .. } => Some(&particles.columns[column]),
            _ => None,
        };
        let opacity = Opacity::new(particles, own_color, system.opacity);
        Ok(Self { particles: particles.clone(), how, opacity, meaning })
    }

    /// The one colour of all particles, if they have one.
    pub fn uniform(&self) -> Option<Vec3> {
        match &self.how {
            How::Uniform(color) => Some(*color),
            _ => None,
        }
    }

    /// The colour of particle `index`, linear RGB.
    pub fn color(&self, index: u32) -> Vec3 {
        match &self.how {
            How::Uniform(color) => *color,
            How::Own { column, scale } => {
                own_color(&self.particles.columns[*column], index as usize, *scale)
            }
            How::Kinds { kinds, colors } => colors[kinds[index as usize] as usize],
            How::Mapped(mapped) => mapped.color(&self.particles, index as usize),
        }
    }
}

impl Mapped {
    fn color(&self, particles: &Particles, row: usize) -> Vec3 {
        let value = self.property.value(particles, row);
        let value = if self.log { value.max(f64::MIN_POSITIVE).ln() } else { value };
        if value.is_nan() {
            return self.missing;
        }
        let t = ((value - self.low) * self.scale).clamp(0.0, 1.0) * 255.0;
        let at = (t as usize).min(254);
        self.table[at].lerp(self.table[at + 1], (t - at as f64) as f32)
    }
}

fn uniform(coloring: &Coloring) -> (How, Meaning) {
    (How::Uniform(Vec3::from(coloring.uniform.linear())), Meaning::Nothing)
}

/// The file's own colours, else elements, else types where there are several, else one colour.
fn automatic(particles: &Particles, coloring: &Coloring) -> (How, Meaning) {
    let own = |c: &Column| c.name == names::COLOR && c.components >= 3;
    if let Some(column) = particles.columns.iter().position(own) {
        let bytes = matches!(particles.columns[column].values, Values::U8(_));
        let scale = if bytes { 1.0 / 255.0 } else { 1.0 };
        return (How::Own { column, scale }, Meaning::Nothing);
    }
    match particles.column(names::PARTICLE_TYPE) {
        Some(types) => {
            let elements = matches!(&types.values, Values::Names { names, .. }
                if names.iter().all(|n| Element::by_symbol(n).is_some()));
            let known = if elements { element } else { nothing };
            let (how, meaning) = categories(types, coloring, known);
            match &meaning {
                Meaning::Categories { entries, .. } if entries.len() == 1 && !elements => {
                    uniform(coloring)
                }
                _ => (how, meaning),
            }
        }
        None => uniform(coloring),
    }
}

/// A colour the file gives, in sRGB.
fn own_color(column: &Column, row: usize, scale: f64) -> Vec3 {
    let channel =
        |c| motes_scene::linear_from_srgb((column.number(row, c) * scale).clamp(0.0, 1.0) as f32);
    Vec3::new(channel(0), channel(1), channel(2))
}

pub(crate) fn category_column<'a>(particles: &'a Particles, of: &[&str]) -> Result<&'a Column> {
    of.iter().find_map(|name| particles.column(name)).ok_or_else(|| {
        let wanted = of.join(" or ");
        Error::Usage(format!("the particles have no property {wanted}"))
    })
}

/// The colours that everybody knows things of a name by.
type Known = fn(&str) -> Option<Color>;

fn nothing(_: &str) -> Option<Color> {
    None
}

fn element(name: &str) -> Option<Color> {
    Element::by_symbol(name).map(|e| e.color)
}

/// Distinct colours for names or whole numbers: those that are `known`, else the palette's.
fn categories(column: &Column, coloring: &Coloring, known: Known) -> (How, Meaning) {
    let (kinds, names) = kinds_of(column);
    let color = |(i, name): (usize, &String)| {
        let given = coloring.colors.get(name).copied();
        let color = given.or_else(|| known(name)).unwrap_or_else(|| coloring.palette.color(i));
        Vec3::from(color.linear())
    };
    let colors: Vec<Vec3> = names.iter().enumerate().map(color).collect();
    let entries = names.into_iter().zip(colors.iter().copied()).collect();
    let meaning = Meaning::Categories { title: column.name.clone(), entries };
    (How::Kinds { kinds, colors }, meaning)
}

/// The kind of each particle, counted from 0, and the kinds' names: names in order of appearance,
/// numbers in ascending order.
pub(crate) fn kinds_of(column: &Column) -> (Vec<u32>, Vec<String>) {
    if let Values::Names { codes, names } = &column.values {
        return (codes.clone(), names.clone());
    }
    let mut numbers: Vec<f64> = Vec::new();
    let mut kind_of = std::collections::HashMap::new();
    let rows = 0..column.rows();
    for number in rows.clone().map(|row| column.number(row, 0)) {
        if kind_of.insert(number.to_bits(), 0).is_none() {
            numbers.push(number);
        }
    }
    numbers.sort_by(f64::total_cmp);
    for (kind, number) in numbers.iter().enumerate() {
        kind_of.insert(number.to_bits(), kind as u32);
    }
    let kinds = rows.map(|row| kind_of[&column.number(row, 0).to_bits()]).collect();
    (kinds, numbers.into_iter().map(|n| n.to_string()).collect())
}

fn by_property(
    particles: &Particles,
    coloring: &Coloring,
    name: &str,
    range: Option<[f64; 2]>,
) -> Result<(How, Meaning)> {
    let property =
        find_property(particles, name, coloring.component).map_err(|error| {
            match nearest(name, WORDS.iter().copied()) {
                Some(word) => Error::Usage(format!("{error}; or did you mean `{word}`?")),
                None => error,
            }
        })?;
    if let Property::Column { index, .. } = property
        && let column = &particles.columns[index]
        && let Values::Names { .. } = column.values
    {
        return Ok(categories(column, coloring, nothing));
    }
    let map = ColorMap::by_name(&coloring.map)?;
    let map = if coloring.reverse { map.reversed() } else { map };
    let range = coloring.range.or(range).or_else(|| property.range(particles, coloring.log));
    let range = range.unwrap_or([0.0, 1.0]);
    let along = |v: f64| if coloring.log { v.max(f64::MIN_POSITIVE).ln() } else { v };
    let [low, high] = range.map(along);
    let table = map.linear_table();
    let mapped = Mapped {
        property,
        low,
        scale: if high != low { 1.0 / (high - low) } else { 0.0 },
        log: coloring.log,
        table: Box::new(table.map(Vec3::from)),
        missing: Vec3::from(coloring.missing.linear()),
    };
    let title = title_of(particles, property, name);
    let meaning = Meaning::Range { title, range, colors: table.to_vec(), log: coloring.log };
    Ok((How::Mapped(mapped), meaning))
}

/// The property's name with the component that is shown.
fn title_of(particles: &Particles, property: Property, name: &str) -> String {
    let stem = match property {
        Property::Column { index, .. } => particles.columns[index].name.clone(),
        Property::Position(_) => names::POSITION.into(),
        Property::Radius => return names::RADIUS.into(),
        Property::Index => return name.into(),
    };
    let components = match property {
        Property::Column { index, .. } => particles.columns[index].components,
        _ => 3,
    };
    match property {
        Property::Column { component, .. } | Property::Position(component) if components > 1 => {
            match component {
                Some(c @ 0..3) if components <= 4 => format!("{stem} {}", ["x", "y", "z"][c]),
                Some(c) => format!("{stem} [{c}]"),
                None => format!("{stem} magnitude"),
            }
        }
        _ if stem.is_empty() => name.into(),
        _ => stem,
    }
}
