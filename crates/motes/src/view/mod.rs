//! What the viewer shows: one loaded series, and each client's own view of it.
//!
//! ```text
//! Gallery ── opens ──► Guest: one client
//!                        state.rs   its scene, undo and redo, what is moving or playing
//!                        ask.rs     requests ── change ──► state, or look at what is shown
//!                        guest.rs   draws the newest state: coarse (coarse.rs) while it moves, then exact
//!                        schema.rs, systems.rs, pick.rs, command.rs, save.rs: what they tell
//! ```

mod ask;
mod coarse;
mod command;
mod guest;
mod schema;
mod state;
mod systems;

use std::sync::{Mutex, PoisonError};

use motes_viewer::{Exhibit, View};

use crate::{Quiet, Result, Scene, Session};
use guest::Guest;

/// A scene and its open sources, for any number of clients.
pub struct Gallery {
    /// What each client begins with.
    session: Mutex<Session>,
    frames: usize,
}

impl Gallery {
    /// Opens the sources of a scene.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn open(scene: Scene) -> Result<Self> {
        let mut session = Session::open(scene, None)?;
        let frames = session.frames(&Quiet)?;
        Ok(Self { session: Mutex::new(session), frames })
    }
}

/// How many threads all work of this process has, where no session has its own. Only before any work.
///
/// # Errors
/// Work has begun, or the system gives no threads.
pub fn set_threads(threads: usize) -> Result<()> {
    let global = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    global.map_err(|e| crate::Error::Usage(format!("threads: {e}")))
}

impl Exhibit for Gallery {
    fn open(&self) -> std::result::Result<Box<dyn View>, String> {
        let session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let guest = Guest::new(session.share(), self.frames);
        Ok(Box::new(guest.map_err(|e| e.to_string())?))
    }
}
