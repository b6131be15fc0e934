//! One particle system of one frame: its grids, what is visible of them, and its colours.

use std::borrow::Cow;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use motes_grid::{
    BlockRanges, Clip, Filter, Grid, Params, RadiusClasses, Resolution, Seen, Visibility,
};
use motes_particles::expression::{Property, Selection, select};
use motes_particles::read::names;
use motes_particles::{Particles, SimulationBox};
use motes_scene::{Bounds, CapColor, ColorBy, Renderer, Scene, System};
use motes_spheres::Spheres;

use crate::annotate::box_shown;
use crate::caps::Caps;
use crate::cut::{Body, Keep, Pass};
use crate::paint::{Paint, category_column, find_property, kinds_of};
use crate::radius::Rule;
use crate::{Error, Result, radius};

/// A system ready to be drawn.
pub(crate) struct Loaded {
    /// Its place in the scene.
    pub number: u16,
    pub particles: Arc<Particles>,
    /// The simulation box, where it is shown.
    pub sim_box: Option<SimulationBox>,
    pub classes: RadiusClasses,
    /// What the sections leave.
    passes: Vec<Pass>,
    /// What is visible of all passes, where there are several.
    merged: Vec<Visibility>,
    pub paint: Paint,
    /// The colours of what the sections lay open.
    pub caps: Caps,
}

impl Loaded {
    /// Builds the grids of `particles` about the scene's `origin`, and what is visible of them. Of
    /// particles that nobody else holds the positions are let go once the grids hold them. They are built in the
    /// memory of `spare`, such as those of the last frame.
    ///
    /// # Errors
    /// A filter or colour names a property that is not there; an expression makes no sense.
    pub fn new(
        (mut particles, spare): (Arc<Particles>, RadiusClasses),
        (scene, system): (&Scene, &System),
        (number, origin): (u16, DVec3),
        range: Option<[f64; 2]>,
    ) -> Result<Self> {
        let rule = radius::rule(&particles, system);
        let params = Params {
            resolution: Resolution::CellsPerParticle(scene.spheres.lambda as f32),
            block_cells: scene.spheres.block,
        };
        let scale = system.radius_scale as f32;
        let shift = DVec3::from_array(particles.origin) - origin;
        let keeps = asks_for_positions(&particles, (scene, system));
        let own = Arc::get_mut(&mut particles).filter(|_| !keeps);
        let mut positions = match own.map(Particles::take_positions) {
            Some(positions) => Cow::Owned(positions),
            None => Cow::Borrowed(&particles.positions[..]),
        };
        if shift != DVec3::ZERO {
            let about = |p: &mut [f32; 3]| {
                *p = (Vec3::from_array(*p).as_dvec3() + shift).as_vec3().to_array();
            };
            positions.to_mut().iter_mut().for_each(about);
        }
        let mut classes = radius::classes(spare, positions, rule, scale, params);
        let paint = Paint::new(&particles, system, range)?;
        if !paint.opacity.is_opaque() {
            // What is translucent hides nothing that coincides with it.
            classes.grids.iter_mut().for_each(|grid| grid.crowded.clear());
        }
        let sim_box = box_shown(&particles, scene.overlay.r#box);
        let (passes, merged, caps) = (Vec::new(), Vec::new(), Caps::default());
        let mut loaded = Self { number, particles, sim_box, classes, passes, merged, paint, caps };
        loaded.cut(scene, origin)?;
        Ok(loaded)
    }

    /// A system without cuts.
    pub fn uncut(
        (particles, paint): (Arc<Particles>, Paint),
        (classes, visible): (RadiusClasses, Vec<Visibility>),
    ) -> Self {
        let (number, passes) = (0, vec![Pass::uncut(&classes, visible)]);
        let (sim_box, merged, caps) = (None, Vec::new(), Caps::default());
        Self { number, particles, sim_box, classes, passes, merged, paint, caps }
    }

    /// Goes over to the sections of `scene`, in which nothing else has changed.
    ///
    /// # Errors
    /// A section makes no sense here.
    pub fn cut(&mut self, scene: &Scene, origin: DVec3) -> Result<()> {
        let number = usize::from(self.number);
        let first = scene.system.iter().position(|system| system.visible);
        let body = Body {
            particles: &self.particles,
            classes: &self.classes,
            number,
            origin,
            liquid: scene.renderer != Renderer::Spheres && first == Some(number),
        };
        let system = &scene.system[number];
        let visible =
            |keep: Option<Keep<'_>>| visibility(body.particles, body.classes, system, keep);
        body.cut(scene, &mut self.passes, visible)?;
        self.merged.clear();
        if self.passes.len() > 1 {
            let mut seen = vec![false; self.particles.len()];
            self.passes.iter().for_each(|pass| self.mark(pass.visible(), &mut seen));
            let keep = |i: u32| seen[i as usize];
            let of = |grid| Visibility::where_all(grid, &[], Some(&keep));
            self.merged = self.classes.grids.iter().map(of).collect();
        }
        let visible = self.boxes(origin).into_iter().reduce(Bounds::union);
        let diagonal = visible.map_or(1.0, |bounds| bounds.diagonal());
        self.caps = Caps::new((scene, number), &self.particles, diagonal)?;
        Ok(())
    }

    /// What is visible of the particles, grid by grid.
    pub fn visible(&self) -> &[Visibility] {
        match &self.passes[..] {
            [pass] => pass.visible(),
            _ => &self.merged,
        }
    }

    /// The cuts of a liquid that its rays ask, if it has one; those of some types only are left out.
    pub fn clip(&self) -> Option<&Clip> {
        match &self.passes[..] {
            [pass] => pass.clip(),
            _ => None,
        }
    }

    /// Bytes of what is visible.
    pub fn visibility_bytes(&self) -> usize {
        let merged = self.merged.iter().map(Visibility::bytes).sum::<usize>();
        merged + self.passes.iter().map(Pass::bytes).sum::<usize>()
    }

    /// Sets `seen` of the particles that are `visible`.
    fn mark(&self, visible: &[Visibility], seen: &mut [bool]) {
        for (grid, visible) in self.classes.grids.iter().zip(visible) {
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

    /// Where radii were measured in this frame, makes them the scene's for all frames.
    pub fn hold_radius(&self, scene: &mut Scene) {
        let Some(system) = scene.system.get_mut(self.number as usize) else { return };
        let measured = matches!(radius::rule(&self.particles, system), Rule::HalfSpacing);
        if let Some(grid) = self.classes.grids.first().filter(|_| measured) {
            system.radius = Some(f64::from(grid.radius_at(0)) / system.radius_scale);
        }
    }

    /// How many particles pass the filters.
    pub fn count_visible(&self) -> usize {
        self.visible().iter().map(Visibility::visible).sum()
    }

    /// What is visible of each type that has visible particles, by its place among all types.
    ///
    /// # Errors
    /// There are no types.
    pub fn visible_by_type(&self) -> Result<Vec<(usize, Vec<Visibility>)>> {
        let (kinds, types) = kinds_of(category_column(&self.particles, &[names::PARTICLE_TYPE])?);
        let mut seen = vec![false; kinds.len()];
        self.mark(self.visible(), &mut seen);
        let grids = self.classes.grids.iter();
        let of_type = |kind: usize| {
            let keep = |i: u32| seen[i as usize] && kinds[i as usize] as usize == kind;
            let all = grids.clone().map(|grid| Visibility::where_all(grid, &[], Some(&keep)));
            (kind, all.collect::<Vec<_>>())
        };
        let all = (0..types.len()).map(of_type);
        Ok(all.filter(|(_, v)| v.iter().any(|v| v.visible() > 0)).collect())
    }

    /// What a tracer of spheres takes, pass by pass.
    pub fn spheres(&self) -> impl Iterator<Item = Spheres<'_>> {
        self.passes.iter().enumerate().map(|(i, pass)| Spheres {
            clip: pass.clip(),
            continues: i > 0,
            ..Spheres::new(&self.classes, pass.visible())
        })
    }

    /// As [`Loaded::spheres`], without cuts.
    pub fn uncut_spheres(&self) -> impl Iterator<Item = Spheres<'_>> {
        self.passes.iter().map(|pass| Spheres::new(&self.classes, pass.all()))
    }

    /// Boxes around what is visible, with radii, in world coordinates.
    pub fn boxes(&self, origin: DVec3) -> Vec<Bounds> {
        let mut boxes = Vec::new();
        for (grid, visible) in self.classes.grids.iter().zip(self.visible()) {
            let blocks = 0..grid.blocks.len() - 1;
            let seen = blocks.filter_map(|block| block_bounds(grid, visible, block));
            boxes.extend(
                seen.map(|(low, high)| {
                    Bounds::new(low.as_dvec3() + origin, high.as_dvec3() + origin)
                }),
            );
        }
        boxes
    }
}

/// What the filters and the expression of a system let through, of the particles that are `kept` if that is said.
pub(crate) fn visibility(
    particles: &Particles,
    classes: &RadiusClasses,
    system: &System,
    kept: Option<Keep<'_>>,
) -> Result<Vec<Visibility>> {
    let selection: Option<Selection> = match system.r#where.trim() {
        "" => None,
        text => Some(select(text, particles).map_err(|e| Error::Usage(e.to_string()))?),
    };
    let properties = system
        .filter
        .iter()
        .map(|f| find_property(particles, &f.property, f.component))
        .collect::<Result<Vec<_>>>()?;
    let values: Vec<Box<dyn Fn(u32) -> f32 + Sync + '_>> = properties
        .iter()
        .map(|p| {
            Box::new(|i: u32| p.value(particles, i as usize) as f32)
                as Box<dyn Fn(u32) -> f32 + Sync>
        })
        .collect();
    let contains = |i: u32| {
        selection.as_ref().is_none_or(|s| s.contains(i)) && kept.is_none_or(|kept| kept(i))
    };
    let keep = (selection.is_some() || kept.is_some()).then_some(&contains as Keep<'_>);
    let of_grid = |grid: &Grid| {
        let ranges: Vec<BlockRanges> = values.iter().map(|v| BlockRanges::of(grid, v)).collect();
        let filters: Vec<Filter<'_>> = system
            .filter
            .iter()
            .zip(values.iter().zip(&ranges))
            .map(|(filter, (value, ranges))| Filter {
                value,
                ranges,
                min: filter.min.map_or(f32::NEG_INFINITY, |v| v as f32),
                max: filter.max.map_or(f32::INFINITY, |v| v as f32),
            })
            .collect();
        Visibility::where_all(grid, &filters, keep)
    };
    Ok(classes.grids.iter().map(of_grid).collect())
}

/// Whether colours or what is visible go by the particles' positions.
fn asks_for_positions(particles: &Particles, (scene, system): (&Scene, &System)) -> bool {
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
