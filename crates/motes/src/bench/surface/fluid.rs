//! Particles in memory, in the source's order, and a frame of them.

use std::sync::Arc;

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_grid::{Radii, RadiusClasses};
use motes_particles::Particles;
use motes_scene::{Bounds, Framing, Resolved, Scene};
use motes_surface::{Boundary, Mode, Optics, Surfaces};

use crate::bench::shot::pack;
use crate::bench::{hash, timed};
use crate::liquid::{Liquid, Matter};
use crate::radius::{self, Rule, Spacing};
use crate::{Error, Result, Stats, paint};

/// Particles in memory, in the source's order.
pub(in crate::bench) struct Fluid {
    pub particles: Arc<Particles>,
    pub radii: Radii,
    paint: paint::Paint,
    /// The box around the spheres.
    pub bounds: Bounds,
    pub mean_radius: f64,
    greatest_radius: f64,
    /// How many can be drawn.
    drawable: usize,
}

impl Fluid {
    /// The particles as the first system of `scene` means them. Radii that nothing tells are measured, which
    /// takes a grid; no time is counted for it.
    ///
    /// # Errors
    /// Nothing can be drawn, or the system selects particles, which arrays cannot.
    pub fn new(particles: Arc<Particles>, scene: &Scene) -> Result<Self> {
        let system = &scene.system[0];
        if !system.r#where.trim().is_empty() || !system.filter.is_empty() {
            return Err(Error::Usage(
                "bench surface: where and filter: expected none; all particles are measured".into(),
            ));
        }
        let radii = radii(&particles, scene);
        let paint = paint::Paint::new(&particles, system, None)?;
        let radius = |i: usize| match &radii {
            Radii::Uniform(r) => *r,
            Radii::Each(radii) => radii[i],
        };
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (mut sum, mut greatest, mut drawable) = (0.0, 0.0_f32, 0);
        for (i, p) in particles.positions.iter().enumerate() {
            let (center, radius) = (Vec3::from_array(*p), radius(i));
            if center.is_finite() && radius.is_finite() && radius > 0.0 {
                (low, high) = (low.min(center - radius), high.max(center + radius));
                (greatest, drawable) = (greatest.max(radius), drawable + 1);
                sum += f64::from(radius);
            }
        }
        if drawable == 0 {
            return Err(Error::Usage(format!("{}: no particle can be drawn", system.source)));
        }
        let origin = DVec3::from_array(particles.origin);
        Ok(Self {
            bounds: Bounds::new(low.as_dvec3() + origin, high.as_dvec3() + origin),
            mean_radius: sum / drawable as f64,
            greatest_radius: f64::from(greatest),
            particles,
            radii,
            paint,
            drawable,
        })
    }

    /// What the default camera frames: the box around the spheres.
    pub fn framing(&self) -> Framing<'_> {
        Framing::new(std::slice::from_ref(&self.bounds), 0.0)
    }

    /// The particles as a liquid.
    pub fn liquid<'a>(&'a self, scene: &'a Scene, resolved: &'a Resolved) -> Liquid<'a> {
        let radii = match &self.radii {
            Radii::Uniform(r) => Radii::Uniform(*r),
            Radii::Each(radii) => Radii::Each(&radii[..]),
        };
        let matter = Matter {
            particles: motes_surface::Particles::Unsorted(&self.particles.positions, radii),
            identity: None,
            visible: self.drawable,
            mean_radius: self.mean_radius,
            greatest_radius: self.greatest_radius,
            paint: &self.paint,
            system: 0,
        };
        Liquid {
            scene,
            matter,
            media: &[],
            resolved,
            bounds: Some(self.bounds),
            origin: DVec3::from_array(self.particles.origin),
            level: Level::new(),
            others: None,
            opened: None,
            boundaries: None,
        }
    }

    /// What has to be drawn of the particles, and the milliseconds to find out.
    pub(super) fn extract(&self, scene: &Scene) -> Result<(f64, Extracted)> {
        let resolved = scene.resolve_framing(self.framing())?;
        let liquid = self.liquid(scene, &resolved);
        let (params, mut stats) = (liquid.params(liquid.painted()), Stats::default());
        let (ms, boundary) = timed(|| liquid.boundary(&params, &mut stats));
        Ok((ms, Extracted { boundary, stats }))
    }

    /// Draws a frame of what was extracted in one mode, then shades it in others.
    ///
    /// # Errors
    /// The environment cannot be read.
    pub(super) fn draw(
        &self,
        extracted: &Extracted,
        (scene, resolved): (&Scene, &Resolved),
        (mode, others): (Mode, &[Mode]),
    ) -> Result<Drawn> {
        let liquid = self.liquid(scene, resolved);
        let (boundary, mut stats) = (&extracted.boundary, extracted.stats.clone());
        let params = liquid.params(liquid.painted());
        let view = liquid.view(self.bounds, liquid.finer());
        let shade = |surfaces: &[(Surfaces, f32)], mode: Mode, stats: &mut Stats| {
            let optics = Optics { mode, ..liquid.optics(self.bounds) };
            let setting = liquid.setting(self.bounds, (boundary, &optics), stats)?;
            Ok::<_, Error>(liquid.shade(surfaces, (&optics, &setting), stats))
        };
        let hash = |color: &[[f32; 4]]| {
            let pixels: Vec<u32> = color.iter().map(pack).collect();
            let finer = liquid.finer();
            hash((view.size.0 / finer, view.size.1 / finer), &pixels)
        };
        let (ms, frame) = timed(|| {
            let surfaces = liquid.surfaces((boundary, &params), view, &mut stats);
            let surfaces = [(surfaces, liquid.ior())];
            shade(&surfaces, mode, &mut stats).map(|color| (surfaces, color))
        });
        let (surfaces, color) = frame?;
        let mut hashes = vec![hash(&color)];
        for mode in others {
            hashes.push(hash(&shade(&surfaces, *mode, &mut stats)?));
        }
        stats.ms.insert("frame", ms);
        let [(surfaces, _)] = surfaces;
        Ok(Drawn { stats, hashes, surfaces, color })
    }
}

/// What is to be drawn, and what is known of it.
pub(super) struct Extracted {
    pub boundary: Arc<Boundary>,
    pub stats: Stats,
}

/// A frame.
pub(super) struct Drawn {
    /// What each stage took; `frame`: all of the first picture.
    pub stats: Stats,
    /// Of the picture in each mode.
    pub hashes: Vec<String>,
    pub surfaces: Surfaces,
    /// The first picture: linear, premultiplied.
    pub color: Vec<[f32; 4]>,
}

/// The radius of each particle, scaled.
fn radii(particles: &Particles, scene: &Scene) -> Radii {
    let system = &scene.system[0];
    let scale = system.radius_scale as f32;
    let rule = match radius::rule(particles, system, Spacing::Share) {
        Rule::Uniform(r) => return Radii::Uniform(r * scale),
        Rule::Each(radii) => return Radii::Each(radii.into_iter().map(|r| r * scale).collect()),
        measured => measured,
    };
    let params = motes_grid::Params {
        resolution: motes_grid::Resolution::CellsPerParticle(scene.spheres.lambda as f32),
        block_cells: scene.spheres.block,
    };
    let positions = particles.positions[..].into();
    let classes = radius::classes(RadiusClasses::default(), positions, rule, scale, params);
    // Those in no grid are not drawn.
    let mut radii = vec![0.0; particles.len()];
    for grid in &classes.grids {
        (0..grid.len()).for_each(|slot| radii[grid.index(slot) as usize] = grid.radius_at(slot));
    }
    match classes.grids.first().filter(|_| classes.grids.len() == 1 && classes.left_out == 0) {
        Some(grid) if grid.least_radius == grid.greatest_radius => {
            Radii::Uniform(grid.least_radius)
        }
        _ => Radii::Each(radii),
    }
}
