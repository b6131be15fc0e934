//! What tracers take of several systems: an entry for each pass of each.

use glam::Vec3;
use motes_scene::Light;
use motes_spheres::{Cap, Spheres};

use crate::system::Loaded;

/// The passes of all systems, and their colours.
pub(crate) struct Entries<'a> {
    loaded: &'a [Loaded],
    pub spheres: Vec<Spheres<'a>>,
    /// What keeps light away instead, if that is said.
    pub casters: Vec<Spheres<'a>>,
    /// The system of each.
    of: Vec<usize>,
}

impl<'a> Entries<'a> {
    pub fn new(loaded: &'a [Loaded], light: &Light) -> Self {
        let (spheres, casters, of) = (Vec::new(), Vec::new(), Vec::new());
        let mut entries = Self { loaded, spheres, casters, of };
        for (i, system) in loaded.iter().enumerate() {
            entries.spheres.extend(system.spheres());
            entries.of.resize(entries.spheres.len(), i);
            if light.uncut {
                entries.casters.extend(system.uncut_spheres());
            }
        }
        entries
    }

    /// Whether entries are numbered as the scene's systems are.
    pub fn are_systems(&self) -> bool {
        let numbers = self.of.iter().map(|of| usize::from(self.loaded[*of].number));
        numbers.eq(0..self.of.len())
    }

    /// The system of an entry.
    pub fn system(&self, entry: u16) -> &'a Loaded {
        &self.loaded[self.of[entry as usize]]
    }
}

impl motes_spheres::Paint for Entries<'_> {
    fn color(&self, entry: u16, index: u32) -> Vec3 {
        self.system(entry).paint.color(index)
    }

    fn uniform(&self, entry: u16) -> Option<Vec3> {
        self.system(entry).paint.uniform()
    }

    fn cap(&self, entry: u16, index: u32, cap: Cap) -> Option<Vec3> {
        let system = self.system(entry);
        system.caps.color(index, cap, || system.paint.color(index))
    }

    fn opacity(&self, entry: u16, index: u32) -> f32 {
        self.system(entry).paint.opacity.of(index)
    }

    fn translucent(&self) -> bool {
        self.loaded.iter().any(|l| !l.paint.opacity.is_opaque())
    }
}
