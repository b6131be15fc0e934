//! How large each particle is: the file's radius, else the element's, else half the spacing. The spacing of spheres is
//! that of nearest neighbours; that of a liquid, whose particles may lie in pairs and strings, is the edge of the cube that a
//! particle has for itself.

use std::borrow::Cow;
use std::collections::HashMap;

use motes_grid::{Grid, Radii, RadiusClasses};
use motes_particles::read::names;
use motes_particles::{Column, Particles, Radius, Values};
use motes_scene::{Element, Scene, System};

use crate::system::is_liquid;

/// The radius of particles that have no neighbour to measure by.
const LONE_RADIUS: f32 = 0.5;

/// Where a system's radii come from, before scaling.
#[derive(Debug)]
pub(crate) enum Rule {
    /// One radius for all.
    Uniform(f32),
    /// One radius each, in the file's order.
    Each(Vec<f32>),
    /// Half the spacing: known once there is a grid.
    HalfSpacing(Spacing),
    /// A radius for some; for the others as above.
    SomeElseHalfSpacing(Vec<Option<f32>>, Spacing),
}

/// What is taken for the spacing of particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spacing {
    /// The median distance to the nearest neighbour.
    Nearest,
    /// [`Grid::share_edge`].
    Share,
}

impl Spacing {
    /// That of the system at place `system`.
    pub fn of(scene: &Scene, system: usize) -> Self {
        if is_liquid(scene, system) { Self::Share } else { Self::Nearest }
    }
}

/// The rule for `particles`: `radius` of the scene; else, per type, `radii` of the scene; else the
/// file's; else the element's; else half the spacing.
pub(crate) fn rule(particles: &Particles, system: &System, spacing: Spacing) -> Rule {
    if let Some(radius) = system.radius {
        return Rule::Uniform(radius as f32);
    }
    let types = particles.column(names::PARTICLE_TYPE);
    let given = (!system.radii.is_empty())
        .then_some(types)
        .flatten()
        .map(|column| per_type(column, |name| system.radii.get(name).map(|r| *r as f32)));
    let rest = match &particles.radius {
        Radius::Uniform(r) => Rule::Uniform(*r),
        Radius::Each(radii) => Rule::Each(radii.clone()),
        Radius::Unknown => {
            types.and_then(of_elements).map_or(Rule::HalfSpacing(spacing), Rule::Each)
        }
    };
    let Some(given) = given else { return rest };
    let other = |i: usize| match &rest {
        Rule::Uniform(r) => Some(*r),
        Rule::Each(radii) => Some(radii[i]),
        _ => None,
    };
    let radii: Vec<Option<f32>> =
        given.iter().enumerate().map(|(i, r)| r.or_else(|| other(i))).collect();
    match radii.iter().copied().collect() {
        Some(all) => Rule::Each(all),
        None => Rule::SomeElseHalfSpacing(radii, spacing),
    }
}

/// The radius of an element: Bondi's van der Waals radius for what molecules are made of, else
/// Cordero's covalent radius, as metals touch their neighbours.
fn element_radius(symbol: &str) -> Option<f32> {
    const MOLECULAR: [&str; 17] = [
        "H", "D", "T", "He", "C", "N", "O", "F", "Ne", "P", "S", "Cl", "Ar", "Se", "Br", "Kr", "I",
    ];
    let element = Element::by_symbol(symbol)?;
    let radius = if MOLECULAR.contains(&element.symbol) {
        element.vdw_radius
    } else {
        element.covalent_radius.or(element.vdw_radius)
    };
    radius.map(|r| r as f32)
}

/// Radii by element, where every particle's type is one.
fn of_elements(types: &Column) -> Option<Vec<f32>> {
    let Values::Names { .. } = types.values else { return None };
    per_type(types, element_radius).into_iter().collect()
}

/// A value per particle from its type's name (or number, as text).
pub(crate) fn per_type<T: Copy>(
    types: &Column,
    value: impl Fn(&str) -> Option<T>,
) -> Vec<Option<T>> {
    match &types.values {
        Values::Names { codes, names } => {
            let values: Vec<Option<T>> = names.iter().map(|name| value(name)).collect();
            codes.iter().map(|code| values[*code as usize]).collect()
        }
        _ => {
            let mut known: HashMap<u64, Option<T>> = HashMap::new();
            (0..types.rows())
                .map(|row| {
                    let number = types.number(row, 0);
                    *known.entry(number.to_bits()).or_insert_with(|| value(&number.to_string()))
                })
                .collect()
        }
    }
}

/// Builds the grids of a system under its rule, in the memory of others that are no longer needed.
pub(crate) fn classes(
    spare: RadiusClasses,
    positions: Cow<'_, [[f32; 3]]>,
    rule: Rule,
    scale: f32,
    params: motes_grid::Params,
) -> RadiusClasses {
    match rule {
        Rule::Uniform(r) => spare.rebuild(positions, Radii::Uniform(r * scale), params),
        Rule::Each(mut radii) => {
            radii.iter_mut().for_each(|r| *r *= scale);
            spare.rebuild(positions, Radii::Each(&radii), params)
        }
        Rule::HalfSpacing(spacing) => {
            let count = positions.len();
            let spare = spare.grids.into_iter().next().unwrap_or_else(Grid::empty);
            let (mut grid, radius) = half_spacing((spare, spacing), positions, params);
            grid.set_radius(radius * scale);
            let left_out = count - grid.len();
            let grids = if grid.is_empty() { vec![] } else { vec![grid] };
            RadiusClasses { grids, left_out }
        }
        Rule::SomeElseHalfSpacing(radii, spacing) => {
            let (_, other) =
                half_spacing((Grid::empty(), spacing), Cow::Borrowed(&positions), params);
            let radii = radii.into_iter().map(|r| r.unwrap_or(other)).collect();
            classes(spare, positions, Rule::Each(radii), scale, params)
        }
    }
}

/// A grid over the positions, and half the spacing in it.
fn half_spacing(
    (spare, spacing): (Grid, Spacing),
    positions: Cow<'_, [[f32; 3]]>,
    params: motes_grid::Params,
) -> (Grid, f32) {
    // The least radius there is lets the grid be as fine as λ says.
    let grid = spare.rebuild(positions, Radii::Uniform(f32::MIN_POSITIVE), None, params);
    let spacing = match spacing {
        Spacing::Nearest => grid.median_spacing(),
        Spacing::Share => grid.share_edge(),
    };
    let radius = spacing.map_or(LONE_RADIUS, |spacing| 0.5 * spacing);
    (grid, radius)
}
