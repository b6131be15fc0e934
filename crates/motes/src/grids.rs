//! Grids that several sessions look at: who asks for the same grids of the same particles gets them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use motes_grid::RadiusClasses;
use motes_particles::Particles;

use crate::stages::GridKey;

/// The grids of one system that somebody looks at.
#[derive(Default)]
pub(crate) struct SharedGrids {
    known: Mutex<Vec<Known>>,
}

struct Known {
    particles: Weak<Particles>,
    key: GridKey,
    grids: Weak<RadiusClasses>,
}

impl SharedGrids {
    /// Those of `particles`, made as `key` says, if there are any.
    pub fn find(&self, particles: &Arc<Particles>, key: &GridKey) -> Option<Arc<RadiusClasses>> {
        let known = self.known();
        let mut same = known.iter().filter(|known| known.key == *key);
        same.find(|known| Weak::as_ptr(&known.particles) == Arc::as_ptr(particles))?.grids.upgrade()
    }

    /// Lets others have grids; gives those that somebody else has made meanwhile, if there are any.
    pub fn put(
        &self,
        particles: &Arc<Particles>,
        key: GridKey,
        grids: Arc<RadiusClasses>,
    ) -> Arc<RadiusClasses> {
        if let Some(others) = self.find(particles, &key) {
            return others;
        }
        let known = (Arc::downgrade(particles), Arc::downgrade(&grids));
        self.known().push(Known { particles: known.0, key, grids: known.1 });
        grids
    }

    /// Keeps grids from others, as they are to be changed.
    pub fn remove(&self, grids: &Arc<RadiusClasses>) {
        self.known().retain(|known| Weak::as_ptr(&known.grids) != Arc::as_ptr(grids));
    }

    /// All that are still there.
    fn known(&self) -> MutexGuard<'_, Vec<Known>> {
        // A list is whole after each step.
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|known| known.grids.strong_count() > 0);
        known
    }
}
