//! One particle system of one frame: its grids, what is visible of them, and its colours.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use motes_grid::{BlockValues, Clip, Filter, Grid, RadiusClasses, Seen, Visibility};
use motes_particles::expression::{Property, Selection, select};
use motes_particles::read::names;
use motes_particles::{Particles, SimulationBox};
use motes_scene::{Bounds, CapColor, ColorBy, Component, Renderer, Scene, System};
use motes_spheres::Spheres;
use rayon::prelude::*;

use crate::caps::Caps;
use crate::cut::{Keep, Visible};
use crate::paint::{Paint, category_column, find_property, kinds_of};
use crate::radius::{Rule, Spacing};
use crate::{Error, Result, radius};

/// A system ready to be drawn; [`crate::stages::Stages`] makes it.
#[derive(Clone)]
pub(crate) struct Loaded {
    /// Its place in the scene.
    pub number: u16,
    pub particles: Arc<Particles>,
    /// The simulation box, where it is shown.
    pub sim_box: Option<SimulationBox>,
    pub classes: Arc<RadiusClasses>,
    pub visible: Arc<Visible>,
    pub paint: Arc<Paint>,
    /// The colours of what the sections lay open.
    pub caps: Arc<Caps>,
}

impl Loaded {
    /// Where radii were measured in this frame, makes them the scene's for all frames.
    pub fn hold_radius(&self, scene: &mut Scene) {
        let spacing = Spacing::of(scene, self.number as usize);
        let Some(system) = scene.system.get_mut(self.number as usize) else { return };
        let rule = radius::rule(&self.particles, system, spacing);
        let measured = matches!(rule, Rule::HalfSpacing(_));
        if let Some(grid) = self.classes.grids.first().filter(|_| measured) {
            system.radius = Some(f64::from(grid.radius_at(0)) / system.radius_scale);
        }
    }

    /// How many particles pass the filters.
    pub fn count_visible(&self) -> usize {
        self.visible().iter().map(Visibility::visible).sum()
    }

    /// What is visible of the particles, grid by grid.
    pub fn visible(&self) -> &[Visibility] {
        self.visible.all()
    }

    /// The cuts of a liquid that its rays ask, if it has one.
    pub fn clip(&self) -> Option<&Clip> {
        self.visible.clip()
    }

    /// What is visible of each type that has visible particles, by its place among all types.
    ///
    /// # Errors
    /// There are no types.
    pub fn visible_by_type(&self) -> Result<Vec<(usize, Arc<Visible>)>> {
        let (kinds, types) = kinds_of(category_column(&self.particles, &[names::PARTICLE_TYPE])?);
        let mut seen = vec![false; kinds.len()];
        mark(&self.classes, self.visible(), &mut seen);
        let grids = self.classes.grids.iter();
        let of_type = |kind: usize| {
            let keep = |i: u32| seen[i as usize] && kinds[i as usize] as usize == kind;
            let all = grids.clone().map(|grid| Visibility::where_all(grid, &[], Some(&keep)));
            (kind, Arc::new(Visible::uncut(&self.classes, all.collect())))
        };
        let all = (0..types.len()).map(of_type);
        Ok(all.filter(|(_, v)| v.all().iter().any(|v| v.visible() > 0)).collect())
    }

    /// What a tracer of spheres takes, pass by pass.
    pub fn spheres(&self) -> impl Iterator<Item = Spheres<'_>> {
        self.visible.passes().iter().enumerate().map(|(i, pass)| Spheres {
            clip: pass.clip(),
            continues: i > 0,
            ..Spheres::new(&self.classes, pass.visible())
        })
    }

    /// As [`Loaded::spheres`], without cuts.
    pub fn uncut_spheres(&self) -> impl Iterator<Item = Spheres<'_>> {
        self.visible.passes().iter().map(|pass| Spheres::new(&self.classes, pass.all()))
    }

    /// Boxes around what is visible, with radii, in world coordinates.
    pub fn boxes(&self, origin: DVec3) -> Vec<Bounds> {
        boxes(&self.classes, self.visible(), origin)
    }
}

/// Boxes around what is `visible`, with radii, in world coordinates.
pub(crate) fn boxes(classes: &RadiusClasses, visible: &[Visibility], origin: DVec3) -> Vec<Bounds> {
    let in_world =
        |(low, high): (Vec3, Vec3)| Bounds::new(low.as_dvec3() + origin, high.as_dvec3() + origin);
    let of_grid = |(grid, visible): (&Grid, &Visibility)| {
        let blocks = (0..grid.blocks.len() - 1).into_par_iter().with_min_len(256);
        let seen = blocks.filter_map(|block| block_bounds(grid, visible, block));
        seen.map(in_world).collect::<Vec<_>>()
    };
    classes.grids.iter().zip(visible).flat_map(of_grid).collect()
}

/// Whether the system at place `number` is seen as a liquid: the first one that is visible, if anything is.
pub(crate) fn is_liquid(scene: &Scene, number: usize) -> bool {
    scene.renderer != Renderer::Spheres
        && scene.system.iter().position(|system| system.visible) == Some(number)
}

/// Sets `seen`, by index, of the particles that are `visible`.
pub(crate) fn mark(classes: &RadiusClasses, visible: &[Visibility], seen: &mut [bool]) {
    for (grid, visible) in classes.grids.iter().zip(visible) {
        for block in 0..grid.blocks.len() - 1 {
            let of = visible.block(grid, block);
            for (i, slot) in grid.particles_of(block).enumerate() {
                if of.shows(i) {
                    seen[grid.index(slot) as usize] = true;
                }
            }
        }
    }
}

/// The properties that a system's filters ask for, in the order of its grids. They are kept while these
/// stand, so that a range can be dragged.
#[derive(Default)]
pub(crate) struct Filtered {
    /// By property and component, grid by grid.
    values: Vec<(FilterKey, Vec<BlockValues>)>,
}

type FilterKey = (String, Component);

impl Filtered {
    /// Those of a system.
    ///
    /// # Errors
    /// There is no such property.
    pub fn of(particles: &Particles, classes: &RadiusClasses, system: &System) -> Result<Self> {
        let mut filtered = Self::default();
        filtered.update(particles, classes, system)?;
        Ok(filtered)
    }

    /// Makes those that are missing, and lets go of those that no filter of `system` asks for.
    ///
    /// # Errors
    /// There is no such property.
    pub fn update(
        &mut self,
        particles: &Particles,
        classes: &RadiusClasses,
        system: &System,
    ) -> Result<()> {
        let keys = || system.filter.iter().map(|f| (f.property.clone(), f.component));
        self.values.retain(|(had, _)| keys().any(|key| key == *had));
        for key in keys() {
            if self.values.iter().all(|(had, _)| *had != key) {
                let property = find_property(particles, &key.0, key.1)?;
                let value = |i: u32| property.value(particles, i as usize) as f32;
                let grids = classes.grids.iter();
                self.values.push((key, grids.map(|g| BlockValues::of(g, value)).collect()));
            }
        }
        Ok(())
    }

    /// The filters of `system` for the grid at a place.
    fn of_grid(&self, system: &System, grid: usize) -> Vec<Filter<'_>> {
        let filter = |filter: &motes_scene::Filter| {
            let mut all = self.values.iter();
            let (_, values) =
                all.find(|((name, c), _)| *name == filter.property && *c == filter.component)?;
            Some(Filter {
                values: &values[grid],
                min: filter.min.map_or(f32::NEG_INFINITY, |v| v as f32),
                max: filter.max.map_or(f32::INFINITY, |v| v as f32),
            })
        };
        system.filter.iter().filter_map(filter).collect()
    }
}

/// What the filters and the expression of a system let through, of the particles that are `kept` if that is said.
pub(crate) fn visibility(
    (particles, filtered): (&Particles, &Filtered),
    classes: &RadiusClasses,
    system: &System,
    kept: Option<Keep<'_>>,
) -> Result<Vec<Visibility>> {
    let selection: Option<Selection> = match system.r#where.trim() {
        "" => None,
        text => Some(select(text, particles).map_err(|e| Error::Usage(e.to_string()))?),
    };
    let contains = |i: u32| {
        selection.as_ref().is_none_or(|s| s.contains(i)) && kept.is_none_or(|kept| kept(i))
    };
    let keep = (selection.is_some() || kept.is_some()).then_some(&contains as Keep<'_>);
    let of_grid =
        |(i, grid): (usize, &Grid)| Visibility::where_all(grid, &filtered.of_grid(system, i), keep);
    Ok(classes.grids.iter().enumerate().map(of_grid).collect())
}

/// Whether colours or what is visible go by the particles' ages.
pub(crate) fn asks_for_ages(system: &System) -> bool {
    let is_age = |name: &str| names::same(name, names::AGE);
    let colored = matches!(&system.color.by, ColorBy::Property(name) if is_age(name));
    let mut words = system.r#where.split(|c: char| !c.is_alphanumeric() && c != '_');
    colored || words.any(is_age) || system.filter.iter().any(|filter| is_age(&filter.property))
}

/// Whether colours or what is visible go by the particles' positions.
pub(crate) fn asks_for_positions(
    particles: &Particles,
    (scene, system): (&Scene, &System),
) -> bool {
    let by_position =
        |name: &str| matches!(Property::find(particles, name), Ok(Property::Position(_)));
    let color = match &system.color.by {
        ColorBy::Property(name) => by_position(name),
        _ => false,
    };
    let caps = scene.section.iter().any(|section| match &section.cap {
        CapColor::Property(name) => by_position(name),
        _ => false,
    });
    color
        || caps
        || !system.r#where.trim().is_empty()
        || system.filter.iter().any(|filter| by_position(&filter.property))
}

/// The box around the visible spheres of a block.
fn block_bounds(grid: &Grid, visible: &Visibility, index: usize) -> Option<(Vec3, Vec3)> {
    let seen = visible.block(grid, index);
    let block = &grid.blocks[index];
    match seen {
        Seen::Hidden => None,
        Seen::Shown if block.least_radius == block.greatest_radius => {
            Some((block.low - block.greatest_radius, block.high + block.greatest_radius))
        }
        // Where radii differ, each sphere is asked.
        _ => grid
            .particles_of(index)
            .enumerate()
            .filter(|(i, _)| seen.shows(*i))
            .map(|(_, slot)| {
                let (center, radius) = (grid.center(slot), grid.radius_at(slot));
                (center - radius, center + radius)
            })
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))),
    }
}
