//! A system of particles seen as a liquid by a field of voxels: from the scene's parameters to the density
//! renderer's, and from its picture to a frame.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Instant;

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_density::{
    Around, Field, Liquid, Mask, Optics, Paint, Params, Particles, Seen, Shadow, Space, View,
    layers, shade,
};
use motes_frame::{Frame, Layer};
use motes_grid::{Grid, Radii, Resolution, Visibility};
use motes_particles::read::names;
use motes_scene::{Beyond, Bounds, Environment, Lights, Resolved, Scene};

use crate::cut::Visible;
use crate::environment::{FLOOR_FILL, WATER, environment};
use crate::memo::{Memo, Same};
use crate::nearest::Nearest;
use crate::scenery::{Others, Scenery};
use crate::session::milliseconds;
use crate::stats::Stats;
use crate::system::Loaded;
use crate::{Error, Result, Watch};

/// The visible particles of a system, one after the other.
#[derive(Default)]
pub(crate) struct Cloud {
    pub positions: Vec<[f32; 3]>,
    pub radii: Vec<f32>,
    /// Their index in the file's order.
    indices: Vec<u32>,
    pub masks: Option<Vec<Mask>>,
    pub mean_radius: f64,
}

impl Cloud {
    /// The visible particles of a system; with masks, if these are asked for: its own, or made here.
    fn of(system: &Loaded, masked: bool) -> Self {
        let mut cloud = Self::default();
        for (grid, visible) in system.classes.grids.iter().zip(system.visible()) {
            visit(grid, visible, |slot| {
                cloud.positions.push(grid.center(slot).to_array());
                cloud.radii.push(grid.radius_at(slot));
                cloud.indices.push(grid.index(slot));
            });
        }
        cloud.mean_radius = mean_radius(system);
        if masked && !cloud.positions.is_empty() {
            let own = system.particles.column(names::PARTICLE_MASK);
            // Those of a file count all of its particles.
            let all = cloud.positions.len() == system.particles.len();
            cloud.masks = Some(match own.filter(|column| all && column.components == 6) {
                Some(own) => {
                    let mask =
                        |i: &u32| std::array::from_fn(|side| own.number(*i as usize, side) as f32);
                    cloud.indices.iter().map(mask).collect()
                }
                None => masks(&cloud.positions, cloud.mean_radius as f32),
            });
        }
        cloud
    }

    /// As the renderer takes them.
    pub fn particles(&self) -> Particles<'_> {
        let radii = match self.radii.first() {
            Some(first) if self.radii.iter().all(|r| r == first) => Radii::Uniform(*first),
            _ => Radii::Each(&self.radii[..]),
        };
        Particles { positions: &self.positions, radii, masks: self.masks.as_deref() }
    }
}

/// The mean radius of the visible particles; 0 without any.
fn mean_radius(system: &Loaded) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (grid, visible) in system.classes.grids.iter().zip(system.visible()) {
        visit(grid, visible, |slot| {
            sum += f64::from(grid.radius_at(slot));
            count += 1;
        });
    }
    sum / count.max(1) as f64
}

/// Calls `visit` for the slot of each visible particle.
fn visit(grid: &Grid, visible: &Visibility, mut visit: impl FnMut(usize)) {
    for block in 0..grid.blocks.len() - 1 {
        let slots = grid.particles_of(block);
        match visible.block(grid, block) {
            motes_grid::Seen::Hidden => {}
            motes_grid::Seen::Shown => slots.for_each(&mut visit),
            motes_grid::Seen::Mixed(words) => {
                let seen = |(i, _): &(usize, usize)| words[i / 64] >> (i % 64) & 1 == 1;
                slots.enumerate().filter(seen).for_each(|(_, slot)| visit(slot));
            }
        }
    }
}

/// A grid over positions, for neighbours.
fn grid_of(positions: &[[f32; 3]], radius: f32) -> Grid {
    let resolution = Resolution::CellsPerParticle(1.0);
    let params = motes_grid::Params { resolution, block_cells: 6 };
    Grid::build(positions, Radii::Uniform(radius), None, params)
}

/// The masks of particles that bring none.
pub(crate) fn masks(positions: &[[f32; 3]], radius: f32) -> Vec<Mask> {
    let grid = grid_of(positions, radius);
    let mut masks = vec![[0.0; 6]; positions.len()];
    let by_slot = motes_sph::masks(&grid, 4.0 * radius);
    by_slot.iter().enumerate().for_each(|(slot, mask)| masks[grid.index(slot) as usize] = *mask);
    masks
}

/// How the field is made of particles; `longest` is the longest side of what is visible.
pub(crate) fn params(scene: &Scene, (mean_radius, longest): (f64, f64)) -> Params {
    let d = &scene.density;
    let voxel = d.resolution.map_or(2.0 * mean_radius, |n| longest / f64::from(n));
    Params {
        voxel: voxel as f32,
        support: d.support as f32,
        threshold: d.threshold as f32,
        saturation: (d.saturation * d.threshold) as f32,
        rough: d.rough,
        masked: d.mask,
        drop: d.drop as f32,
    }
}

/// What the liquid does to light.
pub(crate) fn optics(scene: &Scene, bounds: Bounds) -> Optics {
    let d = &scene.density;
    let absorption = d.absorption.unwrap_or(WATER / bounds.diagonal()).as_vec3();
    Optics { ior: d.ior as f32, absorption, depth: d.depth }
}

/// A field, and what it was made of.
pub(crate) struct Made {
    cloud: Cloud,
    field: Field,
    space: Space,
}

/// Fields from one picture to the next.
pub(crate) struct Fields {
    /// By what is visible, how it is made, and whether with masks.
    made: Memo<(Same<Visible>, Params, bool), Made>,
    mean_radii: Memo<Same<Visible>, f64>,
}

impl Default for Fields {
    fn default() -> Self {
        Self { made: Memo::new(1), mean_radii: Memo::new(1) }
    }
}

/// What a liquid is drawn from.
#[derive(Clone, Copy)]
pub(crate) struct Cast<'a> {
    pub scene: &'a Scene,
    pub system: &'a Loaded,
    pub resolved: &'a Resolved,
    /// All that is visible, in world coordinates.
    pub bounds: Option<Bounds>,
    /// The point that positions are about.
    pub origin: DVec3,
    pub level: Level,
    /// What stands before the liquid and in it.
    pub others: Option<Others<'a>>,
    pub fields: &'a Fields,
}

impl Cast<'_> {
    /// The picture, with `layers` or without.
    ///
    /// # Errors
    /// The environment cannot be read, or the watch cancels.
    pub fn draw(&self, with: bool, (stats, watch): (&mut Stats, &dyn Watch)) -> Result<Frame> {
        let view = self.view();
        let Some(bounds) = self.bounds.filter(|_| self.system.count_visible() > 0) else {
            let empty = vec![[0.0; 4]; view.pixels()];
            let frame = Frame::new(view.size.0 as usize, view.size.1 as usize, empty)?;
            let cloud = Cloud::default();
            return if with { self.with_layers(frame, (&[], &cloud)) } else { Ok(frame) };
        };
        let stage = |done: u64| match watch.progress("density", done, 3) {
            true => Ok(()),
            false => Err(Error::Cancelled),
        };
        stage(0)?;
        let environment = environment(
            &self.scene.density.environment,
            (self.scene, self.resolved),
            (bounds, self.origin),
        )?;
        let made = self.made(bounds, stats);
        let Made { cloud, field, space } = &*made;
        stage(1)?;
        let clip = self.system.clip();
        let liquid = Liquid { field, space, clip, level: self.level };
        let setting = (environment, optics(self.scene, bounds));
        let color = self.shade((&liquid, &view), &setting, stats);
        stage(2)?;
        let frame = Frame::new(view.size.0 as usize, view.size.1 as usize, color)?;
        if !with {
            return Ok(frame);
        }
        let frame = self.with_layers(frame, (&layers(&liquid, &view), cloud));
        stage(3)?;
        frame
    }

    /// The field of what is visible, made now if it is not the last one.
    fn made(&self, bounds: Bounds, stats: &mut Stats) -> Arc<Made> {
        let longest = (bounds.max - bounds.min).max_element();
        let masked = self.scene.density.mask;
        let visible = || Same(self.system.visible.clone());
        let mean_radius = || Ok::<_, Infallible>(mean_radius(self.system));
        let Ok(mean_radius) = self.fields.mean_radii.get(visible(), mean_radius);
        let params = params(self.scene, (*mean_radius, longest));
        let (start, mut space_ms) = (Instant::now(), 0.0);
        let made: std::result::Result<_, Infallible> =
            self.fields.made.get((visible(), params, masked), || {
                let cloud = Cloud::of(self.system, masked);
                let (mut field, mut space) = (Field::default(), Space::default());
                field.fill(&cloud.particles(), &params, self.level);
                let start = Instant::now();
                space.fill(&field, (&cloud.particles(), &params), self.level);
                space_ms = milliseconds(start);
                Ok(Made { cloud, field, space })
            });
        let Ok(made) = made;
        stats.ms.insert("field", milliseconds(start) - space_ms);
        stats.ms.insert("space", space_ms);
        stats.bytes.extend([("field", made.field.bytes()), ("space", made.space.bytes())]);
        stats.particles.insert("drops", made.space.drop_count());
        let voxels: usize = made.field.lattice.dims.iter().product();
        stats.counts.insert("voxels", voxels as u64);
        let coarser = made.field.lattice.voxel > params.voxel;
        stats.counts.insert("voxels_coarsened", u64::from(coarser));
        made
    }

    fn view(&self) -> View {
        let image = &self.scene.image;
        View { rays: self.resolved.view.rays(self.origin), size: (image.width, image.height) }
    }

    fn shade(
        &self,
        (liquid, view): (&Liquid<'_>, &View),
        (environment, optics): &(Environment, Optics),
        stats: &mut Stats,
    ) -> Vec<[f32; 4]> {
        let lights: Lights = self.resolved.lights.about(self.origin);
        let start = Instant::now();
        let shadow = (lights.key.shadow_rays > 0).then(|| {
            let extinction = optics.absorption.element_sum() / 3.0;
            Shadow::new(liquid, lights.key.direction, (extinction, FLOOR_FILL))
        });
        stats.ms.insert("shadow", milliseconds(start));
        let start = Instant::now();
        let painted = self.system.paint.uniform().is_none();
        let colors = painted.then(|| Colors { nearest: Nearest::new(self.system), cast: self });
        let scenery = self.others.map(|o| Scenery::new(environment, o, (&lights, self.level)));
        let around = Around {
            beyond: scenery.as_ref().map_or(environment as &dyn Beyond, |s| s),
            shown: self.scene.density.environment != "none" && !self.scene.image.transparent,
            shadow: shadow.as_ref(),
            paint: colors.as_ref().map(|colors| colors as &dyn Paint),
        };
        let finer = f64::from(self.scene.image.samples).sqrt().floor().max(1.0);
        let color = shade(liquid, view, (optics, &around), finer as u32);
        stats.ms.insert("march", milliseconds(start));
        color
    }

    /// Adds what is known of each pixel besides its colour.
    fn with_layers(&self, frame: Frame, (seen, cloud): (&[Seen], &Cloud)) -> Result<Frame> {
        let count = frame.color().len();
        let nearest = Nearest::new(self.system);
        let nothing = Seen {
            distance: f32::INFINITY,
            point: Vec3::ZERO,
            normal: Vec3::ZERO,
            drop: None,
            thickness: 0.0,
        };
        let of = |pixel: usize| seen.get(pixel).copied().unwrap_or(nothing);
        let id = |pixel: usize| {
            let seen = of(pixel);
            let particle = match seen.drop {
                Some(drop) => cloud.indices.get(drop as usize).copied(),
                None if seen.distance.is_finite() => nearest.particle(seen.point),
                None => None,
            };
            particle.map_or(-1, i64::from)
        };
        Ok(frame
            .with(Layer::Depth((0..count).map(|p| of(p).distance).collect()))?
            .with(Layer::Normal((0..count).map(|p| of(p).normal.to_array()).collect()))?
            .with(Layer::Id((0..count).map(id).collect()))?
            .with(Layer::System(vec![self.system.number; count]))?
            .with(Layer::Thickness((0..count).map(|p| of(p).thickness).collect()))?)
    }
}

/// The colours of particles, for the surface near them.
struct Colors<'a> {
    nearest: Nearest<'a>,
    cast: &'a Cast<'a>,
}

impl Paint for Colors<'_> {
    fn color(&self, point: Vec3) -> Vec3 {
        let particle = self.nearest.particle(point);
        particle.map_or(Vec3::ONE, |index| self.cast.system.paint.color(index))
    }
}
