//! From a frame's particles to what can be drawn of a system, stage by stage. Each is redone only when
//! what it depends on has changed:
//!
//! > particles ──radii──► grids ──where, filters──► visible
//! > particles ──color, opacity──► paint

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use motes_grid::{Params, RadiusClasses, Resolution};
use motes_particles::{Particles, SimulationBox};
use motes_scene::{Coloring, Scene, Section, Show, System};

use crate::annotate::box_shown;
use crate::cut::{Body, Keep, Visible};
use crate::paint::Paint;
use crate::radius::Spacing;
use crate::system::{Loaded, asks_for_positions, visibility};
use crate::{Result, radius};

/// The stages of one system.
#[derive(Default)]
pub(crate) struct Stages {
    /// What all the others were made of.
    particles: Option<Arc<Particles>>,
    sim_box: Option<(Show, Option<SimulationBox>)>,
    grids: Option<(GridKey, Arc<RadiusClasses>)>,
    /// Whether the grids no longer know which of their particles coincide.
    forgotten: bool,
    paint: Option<(PaintKey, Arc<Paint>)>,
    visible: Option<(VisibleKey, CutKey, Arc<Visible>)>,
}

/// What grids depend on besides particles.
#[derive(Clone, PartialEq)]
struct GridKey {
    radius: Option<f64>,
    scale: f64,
    radii: BTreeMap<String, f64>,
    lambda: f64,
    block: u32,
    /// What is measured where radii are not known.
    spacing: Spacing,
    /// From the particles' own origin to the scene's.
    shift: DVec3,
}

/// What paint depends on besides particles.
#[derive(PartialEq)]
struct PaintKey {
    color: Coloring,
    opacity: f64,
    range: Option<[f64; 2]>,
}

/// What visibility depends on besides particles: the system without what does not matter to it.
#[derive(PartialEq)]
struct VisibleKey(System);

/// What cuts depend on besides what is visible without them.
#[derive(PartialEq)]
struct CutKey {
    sections: Vec<Section>,
    liquid: bool,
    origin: DVec3,
}

impl VisibleKey {
    fn of(system: &System) -> Self {
        let (color, name) = (Coloring::default(), String::new());
        Self(System { color, name, opacity: 1.0, ..system.clone() })
    }
}

impl Stages {
    /// What is to be drawn of `particles` about the scene's `origin`. Of particles that nobody else holds
    /// the positions are let go once the grids hold them. Grids are built in the memory of those before.
    ///
    /// # Errors
    /// A filter or colour names a property that is not there; an expression makes no sense.
    pub fn load(
        &mut self,
        mut particles: Arc<Particles>,
        (scene, system): (&Scene, &System),
        (number, origin): (u16, DVec3),
        range: Option<[f64; 2]>,
    ) -> Result<Loaded> {
        let spare = self.begin(&particles);
        let key = GridKey {
            radius: system.radius,
            scale: system.radius_scale,
            radii: system.radii.clone(),
            lambda: scene.spheres.lambda,
            block: scene.spheres.block,
            spacing: Spacing::of(scene, number as usize),
            shift: DVec3::from_array(particles.origin) - origin,
        };
        self.build(&key, spare, (&mut particles, system));
        self.particles = Some(particles.clone());
        let paint = self.painted(&particles, PaintKey {
            color: system.color.clone(),
            opacity: system.opacity,
            range,
        }, system)?;
        self.forget_coinciding(!paint.opacity.is_opaque(), &key, (&mut particles, system));
        let Some((_, classes)) = &self.grids else { return Err(crate::Error::Cancelled) };
        let classes = classes.clone();
        let number_of = usize::from(number);
        let body = Body {
            particles: &particles,
            classes: &classes,
            number: number_of,
            origin,
            liquid: Spacing::of(scene, number_of) == Spacing::Share,
        };
        let visible = self.seen(body, scene)?;
        let sim_box = self.boxed(&particles, scene.overlay.r#box);
        Ok(Loaded { number, particles, sim_box, classes, visible, paint })
    }

    /// Forgets what was made of other particles; gives the memory of their grids.
    fn begin(&mut self, particles: &Arc<Particles>) -> RadiusClasses {
        if self.particles.as_ref().is_some_and(|had| Arc::ptr_eq(had, particles)) {
            return RadiusClasses::default();
        }
        let grids = self.grids.take();
        *self = Self::default();
        spare(grids)
    }

    fn build(
        &mut self,
        key: &GridKey,
        mut memory: RadiusClasses,
        (particles, system): (&mut Arc<Particles>, &System),
    ) {
        if self.grids.as_ref().is_some_and(|(had, _)| had == key) {
            return;
        }
        if let Some(grids) = self.grids.take() {
            memory = spare(Some(grids));
        }
        self.particles = None;
        let rule = radius::rule(particles, system, key.spacing);
        let params = Params {
            resolution: Resolution::CellsPerParticle(key.lambda as f32),
            block_cells: key.block,
        };
        let keeps = asks_for_positions(particles, system);
        let own = Arc::get_mut(particles).filter(|_| !keeps);
        let mut positions = match own.map(Particles::take_positions) {
            Some(positions) => positions.into(),
            None => std::borrow::Cow::Borrowed(&particles.positions[..]),
        };
        if key.shift != DVec3::ZERO {
            let about = |p: &mut [f32; 3]| {
                *p = (Vec3::from_array(*p).as_dvec3() + key.shift).as_vec3().to_array();
            };
            positions.to_mut().iter_mut().for_each(about);
        }
        let classes = radius::classes(memory, positions, rule, key.scale as f32, params);
        self.grids = Some((key.clone(), Arc::new(classes)));
        (self.forgotten, self.visible) = (false, None);
    }

    fn painted(
        &mut self,
        particles: &Arc<Particles>,
        key: PaintKey,
        system: &System,
    ) -> Result<Arc<Paint>> {
        match &self.paint {
            Some((had, paint)) if *had == key => Ok(paint.clone()),
            _ => {
                let paint = Arc::new(Paint::new(particles, system, key.range)?);
                self.paint = Some((key, paint.clone()));
                Ok(paint)
            }
        }
    }

    /// What is translucent hides nothing that coincides with it.
    fn forget_coinciding(
        &mut self,
        forget: bool,
        key: &GridKey,
        of: (&mut Arc<Particles>, &System),
    ) {
        let some = self.grids.iter().any(|(_, c)| c.grids.iter().any(|g| !g.crowded.is_empty()));
        if (forget && !some) || (!forget && !self.forgotten) {
            return;
        }
        let shared = self.grids.as_mut().is_some_and(|(_, c)| Arc::get_mut(c).is_none());
        if !forget || shared {
            let had = self.particles.take();
            self.grids = None;
            self.build(key, RadiusClasses::default(), of);
            self.particles = had;
        }
        if let Some(classes) = self.grids.as_mut().and_then(|(_, c)| Arc::get_mut(c)).filter(|_| forget) {
            classes.grids.iter_mut().for_each(|grid| grid.crowded.clear());
            (self.forgotten, self.visible) = (true, None);
        }
    }

    /// What is visible: where only sections have changed, by the blocks that these change alone.
    fn seen(&mut self, body: Body<'_>, scene: &Scene) -> Result<Arc<Visible>> {
        let system = &scene.system[body.number];
        let sections = scene.sections_of(body.number).map(|(_, section)| section.clone());
        let key = VisibleKey::of(system);
        let cuts = CutKey { sections: sections.collect(), liquid: body.liquid, origin: body.origin };
        let had = self.visible.take().filter(|(had, ..)| *had == key);
        let (had_cuts, mut visible) = match had {
            Some((_, cuts, visible)) => (Some(cuts), visible),
            None => (None, Arc::new(Visible::nothing())),
        };
        if had_cuts.as_ref() != Some(&cuts) {
            let base =
                |keep: Option<Keep<'_>>| visibility(body.particles, body.classes, system, keep);
            Arc::make_mut(&mut visible).cut(body, scene, base)?;
        }
        self.visible = Some((key, cuts, visible.clone()));
        Ok(visible)
    }

    fn boxed(&mut self, particles: &Particles, show: Show) -> Option<SimulationBox> {
        match self.sim_box {
            Some((had, sim_box)) if had == show => sim_box,
            _ => {
                let sim_box = box_shown(particles, show);
                self.sim_box = Some((show, sim_box));
                sim_box
            }
        }
    }
}

/// The memory of grids that nobody else looks at.
fn spare(grids: Option<(GridKey, Arc<RadiusClasses>)>) -> RadiusClasses {
    grids.and_then(|(_, classes)| Arc::try_unwrap(classes).ok()).unwrap_or_default()
}
