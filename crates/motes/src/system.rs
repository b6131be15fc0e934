//! One particle system of one frame: its grids, what is visible of them, and its colours.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use motes_grid::{BlockRanges, Filter, Grid, Params, RadiusClasses, Resolution, Seen, Visibility};
use motes_particles::Particles;
use motes_particles::expression::{Selection, select};
use motes_scene::{Bounds, Scene, System};

use crate::paint::{Paint, Property};
use crate::{Error, Result, radius};

/// A system ready to be drawn.
pub(crate) struct Loaded {
    /// Its place in the scene.
    pub number: u16,
    pub particles: Arc<Particles>,
    pub classes: RadiusClasses,
    pub visible: Vec<Visibility>,
    pub paint: Paint,
}

impl Loaded {
    /// Builds the grids of `particles` about the scene's `origin`, and what is visible of them.
    ///
    /// # Errors
    /// A filter or colour names a property that is not there; an expression makes no sense.
    pub fn new(
        particles: Arc<Particles>,
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
        let classes = if shift == DVec3::ZERO {
            radius::classes(&particles.positions, rule, scale, params)
        } else {
            let about = |p: &[f32; 3]| (Vec3::from_array(*p).as_dvec3() + shift).as_vec3();
            let positions: Vec<[f32; 3]> =
                particles.positions.iter().map(|p| about(p).to_array()).collect();
            radius::classes(&positions, rule, scale, params)
        };
        let visible = visibility(&particles, &classes, system)?;
        let paint = Paint::new(&particles, &system.color, range)?;
        Ok(Self { number, particles, classes, visible, paint })
    }

    /// How many particles pass the filters.
    pub fn count_visible(&self) -> usize {
        self.visible.iter().map(Visibility::visible).sum()
    }

    /// The box around what is visible, with radii, in world coordinates.
    pub fn bounds(&self, origin: DVec3) -> Option<Bounds> {
        let boxes = self.classes.grids.iter().zip(&self.visible);
        let bounds = boxes.filter_map(|(grid, visible)| visible_bounds(grid, visible));
        let (low, high) = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        Some(Bounds::new(low.as_dvec3() + origin, high.as_dvec3() + origin))
    }
}

fn visibility(
    particles: &Particles,
    classes: &RadiusClasses,
    system: &System,
) -> Result<Vec<Visibility>> {
    let selection: Option<Selection> = match system.r#where.trim() {
        "" => None,
        text => Some(select(text, particles).map_err(|e| Error::Usage(e.to_string()))?),
    };
    let properties = system
        .filter
        .iter()
        .map(|f| Property::find(particles, &f.property, f.component))
        .collect::<Result<Vec<_>>>()?;
    let values: Vec<Box<dyn Fn(u32) -> f32 + Sync + '_>> = properties
        .iter()
        .map(|p| {
            Box::new(|i: u32| p.value(particles, i as usize) as f32)
                as Box<dyn Fn(u32) -> f32 + Sync>
        })
        .collect();
    let contains = |i: u32| selection.as_ref().is_none_or(|s| s.contains(i));
    let keep = selection.is_some().then_some(&contains as &(dyn Fn(u32) -> bool + Sync));
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

/// The box around the visible spheres of a grid.
fn visible_bounds(grid: &Grid, visible: &Visibility) -> Option<(Vec3, Vec3)> {
    let mut bounds: Option<(Vec3, Vec3)> = None;
    let mut include = |low: Vec3, high: Vec3| {
        let (a, b) = bounds.unwrap_or((low, high));
        bounds = Some((a.min(low), b.max(high)));
    };
    for index in 0..grid.blocks.len() - 1 {
        match visible.block(grid, index) {
            Seen::Hidden => {}
            // The block's greatest radius would be wrong only by less than its class's spread;
            // where radii differ, each sphere is asked.
            Seen::Shown if grid.least_radius == grid.greatest_radius => {
                let block = &grid.blocks[index];
                include(block.low - grid.greatest_radius, block.high + grid.greatest_radius);
            }
            seen => {
                for (i, slot) in grid.particles_of(index).enumerate() {
                    let shown = match seen {
                        Seen::Mixed(words) => words[i / 64] >> (i % 64) & 1 == 1,
                        _ => true,
                    };
                    if shown {
                        let (center, radius) = (grid.center(slot), grid.radius_at(slot));
                        include(center - radius, center + radius);
                    }
                }
            }
        }
    }
    bounds
}
