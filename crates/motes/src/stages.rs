//! From a frame's particles to what can be drawn of a system, stage by stage. Each is redone only when
//! what it depends on has changed:
//!
//! > particles ──radii──► grids ──where, filters──► visible
//! > particles ──color, opacity──► paint

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use motes_grid::{Params, RadiusClasses, Resolution};
use motes_particles::{Particles, Radius, SimulationBox};
use motes_scene::{Bounds, Coloring, Scene, Section, Show, System};

use crate::annotate::box_shown;
use crate::caps::Caps;
use crate::cut::{Body, Keep, Visible};
use crate::grids::SharedGrids;
use crate::memo::Same;
use crate::paint::Paint;
use crate::radius::Spacing;
use crate::system::{Filtered, Loaded, asks_for_positions, boxes, is_liquid, visibility};
use crate::{Result, radius};

/// The stages of one system.
#[derive(Default)]
pub(crate) struct Stages {
    /// What all the others were made of.
    particles: Option<Arc<Particles>>,
    sim_box: Option<(Show, Option<SimulationBox>)>,
    grids: Option<(GridKey, Arc<RadiusClasses>)>,
    /// Where there are others who look at the same particles.
    shared: Option<Arc<SharedGrids>>,
    /// Whether the grids no longer know which of their particles coincide.
    forgotten: bool,
    paint: Option<(PaintKey, Arc<Paint>)>,
    /// What filters ask for, of these grids.
    filtered: Filtered,
    visible: Option<(VisibleKey, CutKey, Arc<Visible>)>,
    caps: Option<(CapKey, Arc<Caps>)>,
}

/// What grids depend on besides particles.
#[derive(Clone, PartialEq)]
pub(crate) struct GridKey {
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

/// What the colours of caps depend on.
#[derive(PartialEq)]
struct CapKey(Vec<Section>, Coloring, Same<Visible>);

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
    /// Stages beside others that look at the same particles.
    pub fn beside(shared: Arc<SharedGrids>) -> Self {
        Self { shared: Some(shared), ..Self::default() }
    }

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
        // Whether particles fill the box is asked of their positions, which grids may take.
        let sim_box = self.boxed(&particles, scene.overlay.r#box);
        let key = GridKey {
            radius: system.radius,
            scale: system.radius_scale,
            radii: system.radii.clone(),
            lambda: scene.spheres.lambda,
            block: scene.spheres.block,
            spacing: match (system.radius, &particles.radius) {
                (None, Radius::Unknown) => Spacing::of(scene, number as usize),
                _ => Spacing::Nearest,
            },
            shift: DVec3::from_array(particles.origin) - origin,
        };
        self.build(&key, spare, (&mut particles, (scene, system)));
        self.particles = Some(particles.clone());
        let paint = self.painted(
            &particles,
            PaintKey { color: system.color.clone(), opacity: system.opacity, range },
            system,
        )?;
        self.forget_coinciding(!paint.opacity.is_opaque(), &key, (&mut particles, (scene, system)));
        let Some((_, classes)) = &self.grids else { return Err(crate::Error::Cancelled) };
        let classes = classes.clone();
        let number_of = usize::from(number);
        let body = Body {
            particles: &particles,
            classes: &classes,
            number: number_of,
            origin,
            liquid: is_liquid(scene, number_of),
        };
        let visible = self.seen(body, scene)?;
        let caps = self.capped((&particles, &classes), (scene, number_of), (&visible, origin))?;
        Ok(Loaded { number, particles, sim_box, classes, visible, paint, caps })
    }

    /// Forgets all but the memory of the grids: other particles come.
    pub fn forget(&mut self) {
        let (grids, shared) = (self.grids.take(), self.shared.take());
        *self = Self { grids, shared, ..Self::default() };
    }

    /// Forgets what was made of other particles; gives the memory of their grids.
    fn begin(&mut self, particles: &Arc<Particles>) -> RadiusClasses {
        if self.particles.as_ref().is_some_and(|had| Arc::ptr_eq(had, particles)) {
            return RadiusClasses::default();
        }
        self.forget();
        spare(self.grids.take())
    }

    fn build(
        &mut self,
        key: &GridKey,
        mut memory: RadiusClasses,
        (particles, (scene, system)): (&mut Arc<Particles>, (&Scene, &System)),
    ) {
        if self.grids.as_ref().is_some_and(|(had, _)| had == key) {
            return;
        }
        if let Some(grids) = self.grids.take() {
            memory = spare(Some(grids));
        }
        self.particles = None;
        (self.forgotten, self.visible) = (false, None);
        self.filtered = Filtered::default();
        if let Some(grids) = self.shared.as_ref().and_then(|shared| shared.find(particles, key)) {
            self.grids = Some((key.clone(), grids));
            return;
        }
        let rule = radius::rule(particles, system, key.spacing);
        let params = Params {
            resolution: Resolution::CellsPerParticle(key.lambda as f32),
            block_cells: key.block,
        };
        let keeps = asks_for_positions(particles, (scene, system));
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
        let mut classes = Arc::new(classes);
        if let Some(shared) = &self.shared {
            classes = shared.put(particles, key.clone(), classes);
        }
        self.grids = Some((key.clone(), classes));
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
        of: (&mut Arc<Particles>, (&Scene, &System)),
    ) {
        let some = self.grids.iter().any(|(_, c)| c.grids.iter().any(|g| !g.crowded.is_empty()));
        if (forget && !some) || (!forget && !self.forgotten) {
            return;
        }
        // Grids that are changed are nobody else's.
        let beside = if forget { self.shared.take() } else { None };
        if let (Some(beside), Some((_, classes))) = (&beside, &self.grids)
            && Arc::strong_count(classes) == 1
        {
            beside.remove(classes);
        }
        let looked_at = self.grids.as_mut().is_some_and(|(_, c)| Arc::get_mut(c).is_none());
        if !forget || looked_at {
            let had = self.particles.take();
            self.grids = None;
            self.build(key, RadiusClasses::default(), of);
            self.particles = had;
        }
        if let Some(classes) =
            self.grids.as_mut().and_then(|(_, c)| Arc::get_mut(c)).filter(|_| forget)
        {
            classes.grids.iter_mut().for_each(|grid| grid.crowded.clear());
            (self.forgotten, self.visible) = (true, None);
        }
        self.shared = self.shared.take().or(beside);
    }

    /// What is visible: where only sections have changed, by the blocks that these change alone.
    fn seen(&mut self, body: Body<'_>, scene: &Scene) -> Result<Arc<Visible>> {
        let system = &scene.system[body.number];
        let sections = scene.sections_of(body.number).map(|(_, section)| section.clone());
        let sections: Vec<_> = sections.collect();
        let liquid = body.liquid && !sections.is_empty();
        let (key, cuts) =
            (VisibleKey::of(system), CutKey { sections, liquid, origin: body.origin });
        let (same, mut visible) = match &self.visible {
            Some((had, had_cuts, visible)) if *had == key => (*had_cuts == cuts, visible.clone()),
            _ => (false, Arc::new(Visible::nothing())),
        };
        if !same {
            self.filtered.update(body.particles, body.classes, system)?;
            let of = (body.particles, &self.filtered);
            let base = |keep: Option<Keep<'_>>| visibility(of, body.classes, system, keep);
            Arc::make_mut(&mut visible).cut(body, scene, base)?;
            self.visible = Some((key, cuts, visible.clone()));
        }
        Ok(visible)
    }

    /// The colours of caps.
    fn capped(
        &mut self,
        (particles, classes): (&Arc<Particles>, &RadiusClasses),
        (scene, number): (&Scene, usize),
        (visible, origin): (&Arc<Visible>, DVec3),
    ) -> Result<Arc<Caps>> {
        let sections = scene.sections_of(number).map(|(_, section)| section.clone()).collect();
        let key = CapKey(sections, scene.system[number].color.clone(), Same(visible.clone()));
        match &self.caps {
            Some((had, caps)) if *had == key => Ok(caps.clone()),
            _ => {
                let diagonal = || {
                    let boxes = boxes(classes, visible.all(), origin);
                    boxes.into_iter().reduce(Bounds::union).map_or(1.0, |b| b.diagonal())
                };
                let caps = Arc::new(Caps::new((scene, number), particles, diagonal)?);
                self.caps = Some((key, caps.clone()));
                Ok(caps)
            }
        }
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

#[cfg(test)]
mod tests {
    use motes_particles::read::Wanted;

    use super::*;

    /// Stages of a demo set, and its particles.
    fn demo(source: &str) -> (Stages, Arc<Particles>) {
        let mut series = crate::open(source).unwrap();
        (Stages::default(), series.frame(0, &Wanted::All, &|_, _| {}).unwrap())
    }

    fn load(of: &mut (Stages, Arc<Particles>), assignments: &[&str]) -> Loaded {
        let mut scene = Scene::default();
        assignments.iter().for_each(|a| scene.set_text(a).unwrap());
        let system = scene.system[0].clone();
        of.0.load(of.1.clone(), (&scene, &system), (0, DVec3::ZERO), None).unwrap()
    }

    /// Which stages two loads share: grids, visibility, paint.
    fn shared(a: &Loaded, b: &Loaded) -> [bool; 3] {
        [
            Arc::ptr_eq(&a.classes, &b.classes),
            Arc::ptr_eq(&a.visible, &b.visible),
            Arc::ptr_eq(&a.paint, &b.paint),
        ]
    }

    #[test]
    fn only_what_depends_on_a_change_is_made_again() {
        let mut of = demo("demo:random:500");
        let first = load(&mut of, &[]);
        for (assignments, expected) in [
            (&["camera.fov=50", "light.preset=sun", "image.samples=9"][..], [true, true, true]),
            (&["overlay.box=on"], [true, true, true]),
            (&["renderer=surface"], [true, true, true]),
            (
                &["section=[{ point = [0.5, 0.5, 0.5], normal = [1.0, 0.0, 0.0] }]"],
                [true, false, true],
            ),
            (&["system.where=Index < 100"], [true, false, true]),
            (&["system.filter=[{ min = 0.5 }]"], [true, false, true]),
            (&["system.color.by=Position"], [true, true, false]),
            (&["system.opacity=0.5"], [true, true, false]),
            (&["system.radius_scale=2"], [false, false, true]),
            (&["spheres.lambda=2"], [false, false, true]),
            (&["system.name=else"], [true, true, true]),
        ] {
            let before = load(&mut of, &[]);
            let after = load(&mut of, assignments);
            assert_eq!(shared(&before, &after), expected, "{assignments:?}");
            let fresh = load(&mut (Stages::default(), of.1.clone()), assignments);
            assert_eq!(after.count_visible(), fresh.count_visible(), "{assignments:?}");
            assert_eq!(
                after.classes.grids[0].greatest_radius,
                fresh.classes.grids[0].greatest_radius
            );
        }
        of.1 = Arc::new(Particles::clone(&of.1));
        assert_eq!(shared(&first, &load(&mut of, &[])), [false; 3]);
    }

    #[test]
    fn what_coincides_is_hidden_again_once_it_is_opaque() {
        let mut particles = Particles { positions: vec![[0.0; 3]; 600], ..Particles::default() };
        particles.radius = motes_particles::Radius::Uniform(1.0);
        let mut of = (Stages::default(), Arc::new(particles));
        let drawn = |loaded: &Loaded| {
            let grid = &loaded.classes.grids[0];
            let blocks = 0..grid.blocks.len() - 1;
            let of_block = |block| {
                let seen = loaded.visible()[0].block(grid, block);
                grid.particles_of(block).enumerate().filter(|(i, _)| seen.shows(*i)).count()
            };
            blocks.map(of_block).sum::<usize>()
        };
        let opaque = load(&mut of, &[]);
        assert_eq!((drawn(&opaque), opaque.count_visible()), (1, 600));
        // With and without others looking at the grids.
        for _ in 0..2 {
            let clear = load(&mut of, &["system.opacity=0.5"]);
            assert_eq!((drawn(&clear), clear.count_visible()), (600, 600));
            assert_eq!(drawn(&load(&mut of, &[])), 1);
        }
        drop(opaque);
        assert_eq!(drawn(&load(&mut of, &["system.opacity=0.5"])), 600);
        assert_eq!(drawn(&load(&mut of, &[])), 1);
    }

    #[test]
    fn grids_are_shared_and_changed_apart() {
        let mut particles = Particles { positions: vec![[0.0; 3]; 600], ..Particles::default() };
        particles.radius = motes_particles::Radius::Uniform(1.0);
        let (particles, shared) = (Arc::new(particles), Arc::<SharedGrids>::default());
        let mut stages = [(); 2].map(|()| (Stages::beside(shared.clone()), particles.clone()));
        let [first, second] = &mut stages;
        let [a, b] = [load(first, &[]), load(second, &[])];
        assert!(Arc::ptr_eq(&a.classes, &b.classes));
        let crowded = |l: &Loaded| l.classes.grids[0].crowded.len();
        let clear = load(first, &["system.opacity=0.5"]);
        assert_eq!((crowded(&clear), crowded(&load(second, &[]))), (0, 1));
        let other = load(second, &["system.radius_scale=2"]);
        assert!(!Arc::ptr_eq(&a.classes, &other.classes));
        // Back to what is still there, or was there.
        assert!(Arc::ptr_eq(&a.classes, &load(first, &[]).classes));
        drop((a, b, clear, other, stages));
        let again = load(&mut (Stages::beside(shared), particles), &[]);
        assert_eq!(crowded(&again), 1);
    }

    #[test]
    fn a_mistake_leaves_what_was_there() {
        let mut of = demo("demo:random:500");
        let before = load(&mut of, &[]);
        let mut scene = Scene::default();
        scene.set_text("system.where=Nothing > 1").unwrap();
        let system = scene.system[0].clone();
        assert!(of.0.load(of.1.clone(), (&scene, &system), (0, DVec3::ZERO), None).is_err());
        assert_eq!(shared(&before, &load(&mut of, &[])), [true; 3]);
    }
}
