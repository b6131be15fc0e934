//! The scene's sections as cuts of one system's grids.
//!
//! A section may cut some types of particles only. What sees particles knows no types: those that the same
//! sections cut are a [`Pass`], over the grids that all share.

use glam::DVec3;
use motes_grid::{Clause, Clip, Cut, Face, Plane, RadiusClasses, Sections, Visibility, Width};
use motes_particles::Particles;
use motes_particles::read::names;
use motes_scene::{Scene, Section};

use crate::paint::{category_column, kinds_of};
use crate::system::mark;
use crate::{Error, Result};

/// What is visible of a system: what passes the filters, less what sections cut away.
#[derive(Clone)]
pub(crate) struct Visible {
    passes: Vec<Pass>,
    /// What is visible of all passes, where there are several.
    merged: Vec<Visibility>,
    /// Types that sections name, by the section's place, and no particle has.
    unknown: Vec<(usize, String)>,
}

impl Visible {
    /// What passes the filters, without cuts.
    pub fn uncut(classes: &RadiusClasses, visible: Vec<Visibility>) -> Self {
        Self { passes: vec![Pass::new(classes, (None, visible))], ..Self::nothing() }
    }

    /// What sections leave, to be cut.
    pub fn nothing() -> Self {
        Self { passes: Vec::new(), merged: Vec::new(), unknown: Vec::new() }
    }

    /// Goes over to the sections of `scene`: made anew where other particles than before are cut alike, else the
    /// blocks that change alone. `visible` is what passes the filters, of all particles or of those to be kept.
    ///
    /// # Errors
    /// A section cannot be, or names types where there are none; or those of `visible`.
    pub fn cut(
        &mut self,
        body: Body<'_>,
        scene: &Scene,
        visible: impl Fn(Option<Keep<'_>>) -> Result<Vec<Visibility>>,
    ) -> Result<()> {
        self.unknown = body.cut(scene, &mut self.passes, visible)?;
        self.merged.clear();
        if self.passes.len() > 1 {
            let mut seen = vec![false; body.particles.len()];
            self.passes.iter().for_each(|pass| mark(body.classes, pass.visible(), &mut seen));
            let keep = |i: u32| seen[i as usize];
            let of = |grid| Visibility::where_all(grid, &[], Some(&keep));
            self.merged = body.classes.grids.iter().map(of).collect();
        }
        Ok(())
    }

    /// Those that are cut alike.
    pub fn passes(&self) -> &[Pass] {
        &self.passes
    }

    /// All that is visible, grid by grid.
    pub fn all(&self) -> &[Visibility] {
        match &self.passes[..] {
            [pass] => pass.visible(),
            _ => &self.merged,
        }
    }

    /// The cuts of a liquid that its rays ask, if there are any.
    pub fn clip(&self) -> Option<&Clip> {
        match &self.passes[..] {
            [pass] => pass.clip(),
            _ => None,
        }
    }

    /// Types that sections name, by the section's place, and no particle has.
    pub fn unknown(&self) -> &[(usize, String)] {
        &self.unknown
    }

    /// Bytes of all parts.
    pub fn bytes(&self) -> usize {
        let merged = self.merged.iter().map(Visibility::bytes).sum::<usize>();
        merged + self.passes.iter().map(Pass::bytes).sum::<usize>()
    }
}

/// Particles of a system that the same sections cut.
#[derive(Clone)]
pub(crate) struct Pass {
    /// Which they are, by kind; `None`: all.
    kinds: Option<Vec<bool>>,
    sections: Sections,
    /// The cuts that rays ask.
    exact: Clip,
}

impl Pass {
    fn new(classes: &RadiusClasses, (kinds, base): (Option<Vec<bool>>, Vec<Visibility>)) -> Self {
        let sections = Sections::new(&classes.grids, base, Width::default());
        Self { kinds, sections, exact: Clip::default() }
    }

    /// What is seen of them, grid by grid.
    pub fn visible(&self) -> &[Visibility] {
        self.sections.visible()
    }

    /// What would be seen of them without cuts.
    pub fn all(&self) -> &[Visibility] {
        self.sections.uncut()
    }

    /// Where rays meet them; `None`: everywhere.
    pub fn clip(&self) -> Option<&Clip> {
        (!self.exact.is_empty()).then_some(&self.exact)
    }

    /// Bytes of what is visible.
    pub fn bytes(&self) -> usize {
        self.sections.bytes()
    }
}

/// What the sections of a scene cut.
#[derive(Clone, Copy)]
pub(crate) struct Body<'a> {
    pub particles: &'a Particles,
    pub classes: &'a RadiusClasses,
    /// The system's place in the scene.
    pub number: usize,
    /// What positions are given about.
    pub origin: DVec3,
    /// Whether it is seen as a liquid, which is cut where rays pass, not particle by particle.
    pub liquid: bool,
}

/// Particles that are kept, by their index.
pub(crate) type Keep<'a> = &'a (dyn Fn(u32) -> bool + Sync);

impl Body<'_> {
    /// How far beyond a cut particles of a liquid still count, as gaps are bridged and surfaces smoothed over it.
    fn margin(&self) -> f32 {
        const RADII: f32 = 16.0;
        RADII * self.classes.grids.iter().map(|grid| grid.greatest_radius).fold(0.0, f32::max)
    }

    /// Cuts `passes` as the scene says: made anew where other particles than before are cut alike, else the
    /// blocks that change alone. `visible` is what passes the filters, of all particles or of those to be kept.
    /// Gives the types that sections name, by the section's place, and no particle has.
    ///
    /// # Errors
    /// A section cannot be, or names types where there are none; or those of `visible`.
    pub fn cut(
        self,
        scene: &Scene,
        passes: &mut Vec<Pass>,
        visible: impl Fn(Option<Keep<'_>>) -> Result<Vec<Visibility>>,
    ) -> Result<Vec<(usize, String)>> {
        let Scopes { kind_of, scopes, unknown } = self.scopes(scene)?;
        let same = passes.len() == scopes.len()
            && passes.iter().zip(&scopes).all(|(pass, scope)| pass.kinds == scope.kinds);
        if !same {
            passes.clear();
            for scope in &scopes {
                let base = match &scope.kinds {
                    None => visible(None)?,
                    Some(kinds) => visible(Some(&|i| kinds[kind_of[i as usize] as usize]))?,
                };
                passes.push(Pass::new(self.classes, (scope.kinds.clone(), base)));
            }
        }
        for (pass, scope) in passes.iter_mut().zip(&scopes) {
            let clip = clip_of(&scope.sections, self.origin)?;
            pass.exact = clip.exact();
            let clip = if self.liquid { clip.of_liquid(self.margin()) } else { clip };
            pass.sections.set(&self.classes.grids, clip);
        }
        Ok(unknown)
    }

    /// The kind of each particle, where that matters, and which sections cut which kinds.
    fn scopes<'a>(&self, scene: &'a Scene) -> Result<Scopes<'a>> {
        let sections: Vec<(usize, &Section)> = scene.sections_of(self.number).collect();
        let Some((first, _)) = sections.iter().find(|(_, s)| !s.types.0.is_empty()) else {
            return Ok(Scopes::all(sections));
        };
        if self.particles.is_empty() {
            return Ok(Scopes::all(Vec::new()));
        }
        let types = category_column(self.particles, &[names::PARTICLE_TYPE])
            .map_err(|e| Error::Usage(format!("section.{first}.types: {e}")))?;
        let (kind_of, names) = kinds_of(types);
        let mut scopes: Vec<Scope<'_>> = Vec::new();
        for (kind, name) in names.iter().enumerate() {
            let cuts = sections.iter().copied().filter(|(_, s)| s.types.allow(name));
            let cuts: Vec<_> = cuts.collect();
            let alike = |scope: &&mut Scope<'_>| {
                scope.sections.iter().map(|(i, _)| i).eq(cuts.iter().map(|(i, _)| i))
            };
            match scopes.iter_mut().find(alike).and_then(|scope| scope.kinds.as_mut()) {
                Some(kinds) => kinds[kind] = true,
                None => {
                    let kinds = Some((0..names.len()).map(|other| other == kind).collect());
                    scopes.push(Scope { kinds, sections: cuts });
                }
            }
        }
        if let [all] = &mut scopes[..] {
            all.kinds = None;
        }
        let of_section = |(i, s): &(usize, &Section)| {
            let unknown = s.types.0.iter().filter(|name| !names.contains(name));
            unknown.map(|name| (*i, name.clone())).collect::<Vec<_>>()
        };
        let unknown = sections.iter().flat_map(of_section).collect();
        Ok(Scopes { kind_of, scopes, unknown })
    }
}

/// Which sections cut which kinds.
struct Scopes<'a> {
    /// The kind of each particle, where that matters.
    kind_of: Vec<u32>,
    scopes: Vec<Scope<'a>>,
    /// Types that sections name, by the section's place, and no particle has.
    unknown: Vec<(usize, String)>,
}

impl<'a> Scopes<'a> {
    /// All kinds are cut by the same sections.
    fn all(sections: Vec<(usize, &'a Section)>) -> Self {
        let scopes = vec![Scope { kinds: None, sections }];
        Self { kind_of: Vec::new(), scopes, unknown: Vec::new() }
    }
}

/// Kinds of particles that the same sections cut.
struct Scope<'a> {
    /// `None`: all kinds.
    kinds: Option<Vec<bool>>,
    sections: Vec<(usize, &'a Section)>,
}

/// Sections as cuts about `origin`: those of a group are one clause.
fn clip_of(sections: &[(usize, &Section)], origin: DVec3) -> Result<Clip> {
    let mut clip = Clip::default();
    let mut groups: Vec<&str> = Vec::new();
    for (i, section) in sections {
        let plane = Plane::new(section.point - origin, section.normal).ok_or_else(|| {
            let point = section.point;
            let wrong = format!("expected a point nearer to the particles, found {point}");
            Error::Usage(format!("section.{i}.point: {wrong}"))
        })?;
        let cut = match section.cut {
            motes_scene::Cut::Centre => Cut::Center,
            motes_scene::Cut::Caps => Cut::Caps,
            motes_scene::Cut::Open => Cut::Open,
        };
        let face = Face { plane, cut, owner: *i as u16 };
        let group = groups.iter().position(|g| !g.is_empty() && *g == section.group);
        match group {
            Some(group) => clip.clauses[group].faces.push(face),
            None => {
                clip.clauses.push(Clause { faces: vec![face] });
                groups.push(&section.group);
            }
        }
    }
    Ok(clip)
}
