//! The sets of Gribble et al. 2007, Table 1: stand-ins of about their size and structure.

use glam::DVec3;
use motes_grid::{BlockValues, Filter, Params, Radii, RadiusClasses, Resolution, Visibility};
use motes_particles::read::Wanted;
use motes_particles::{Radius, Series};
use motes_scene::{Bounds, Rays, Scene};

use super::timed;
use crate::{Error, Result};

/// A set of the paper and what stands in for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Set {
    /// The paper's name.
    pub name: &'static str,
    /// The demo set.
    kind: &'static str,
    /// Particles.
    count: f64,
    /// The values that Table 7 isolates.
    pub isolated: Option<(f32, f32)>,
}

pub(super) const SETS: [Set; 6] = [
    Set { name: "Cylinder", kind: "cylinder", count: 0.2e6, isolated: None },
    Set { name: "JP8", kind: "jp8", count: 0.8e6, isolated: None },
    Set { name: "Bullet", kind: "bullet", count: 0.5e6, isolated: None },
    Set { name: "Thunder", kind: "thunder", count: 2.8e6, isolated: Some((0.0, 0.999)) },
    Set { name: "Foam", kind: "foam", count: 7.2e6, isolated: None },
    Set { name: "BulletTorso", kind: "torso", count: 34.9e6, isolated: Some((1.0, 3.999)) },
];

/// The particles of a set: all of one radius.
pub(super) struct Loaded {
    pub set: Set,
    pub positions: Vec<[f32; 3]>,
    pub radius: f32,
    /// One per particle.
    pub values: Vec<f32>,
}

impl Set {
    /// Makes the particles, `scale` times as many as the paper's.
    pub fn load(self, scale: f64) -> Result<Loaded> {
        let count = (self.count * scale).round().max(1.0);
        let mut series = Series::open(&format!("demo:{}:{count}", self.kind))?;
        let frame = series.frame(0, &Wanted::All, &|_, _| {})?;
        drop(series);
        let missing = || Error::Usage(format!("{}: no radius or values", self.kind));
        let column = frame.column("Value").ok_or_else(missing)?;
        let values = (0..frame.len()).map(|i| column.number(i, 0) as f32).collect();
        let Radius::Uniform(radius) = frame.radius else { return Err(missing()) };
        // The only copy, where nothing else holds the frame.
        let positions = match std::sync::Arc::try_unwrap(frame) {
            Ok(frame) => frame.positions,
            Err(shared) => shared.positions.clone(),
        };
        Ok(Loaded { set: self, positions, radius, values })
    }
}

/// How a grid of Motes is built in the tables: the paper's λ and M where nothing else is said.
pub(super) fn params(lambda: f32, block_cells: u32) -> Params {
    Params { resolution: Resolution::CellsPerParticle(lambda), block_cells }
}

/// λ = 1 (§5).
pub(super) const LAMBDA: f32 = 1.0;
/// M = 6 (§5).
pub(super) const BLOCK: u32 = 6;

/// Grids and what is visible of them.
pub(super) struct Built {
    pub classes: RadiusClasses,
    pub visible: Vec<Visibility>,
    /// Milliseconds of construction.
    pub ms: f64,
}

impl Built {
    pub fn new(positions: &[[f32; 3]], radius: f32, params: Params) -> Self {
        let (ms, classes) =
            timed(|| RadiusClasses::build(positions, Radii::Uniform(radius), params));
        let visible = classes.grids.iter().map(Visibility::all).collect();
        Self { classes, visible, ms }
    }

    pub fn spheres(&self) -> motes_spheres::Spheres<'_> {
        motes_spheres::Spheres::new(&self.classes, &self.visible)
    }

    /// Bytes beyond the particles' own.
    pub fn structure_bytes(&self) -> usize {
        self.classes.grids.iter().map(motes_grid::Grid::structure_bytes).sum()
    }
}

impl Loaded {
    pub fn label(&self) -> (&'static str, usize) {
        (self.set.name, self.positions.len())
    }

    /// What is visible of the values in `low..=high`, and the milliseconds to find out with the ranges of
    /// the blocks at hand.
    pub fn within(&self, built: &Built, (min, max): (f32, f32)) -> (f64, Vec<Visibility>) {
        let value = |i: u32| self.values[i as usize];
        let grids = &built.classes.grids;
        let values: Vec<_> = grids.iter().map(|grid| BlockValues::of(grid, value)).collect();
        timed(|| {
            let of = |(grid, values)| {
                let filter = Filter { values, min, max };
                Visibility::where_all(grid, &[filter], None)
            };
            grids.iter().zip(&values).map(of).collect()
        })
    }

    /// The positions of the values in `low..=high`.
    pub fn cropped(&self, (low, high): (f32, f32)) -> Vec<[f32; 3]> {
        let all = self.positions.iter().zip(&self.values);
        all.filter(|(_, v)| (low..=high).contains(*v)).map(|(p, _)| *p).collect()
    }

    /// The box around the spheres.
    pub fn bounds(&self) -> Option<Bounds> {
        let center = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        let radius = f64::from(self.radius);
        Bounds::of_spheres(self.positions.iter().map(|p| (center(p), radius)))
    }

    /// The default camera: it frames the set.
    pub fn rays(&self, (width, height): (u32, u32)) -> Result<Rays> {
        let mut scene = Scene::default();
        (scene.image.width, scene.image.height) = (width, height);
        Ok(scene.resolve(self.bounds())?.view.rays(DVec3::ZERO))
    }
}
