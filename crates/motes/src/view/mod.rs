//! What the viewer shows: one loaded series, and each client's own view of it.
//!
//! ```text
//! Gallery ── opens ──► Guest: one client
//!                        state.rs   its scene, undo and redo, what is moving or playing
//!                        ask.rs     requests ── change ──► state, or look at what is shown
//!                        guest.rs   draws the newest state: coarse (coarse.rs) while it moves, then exact
//!                        schema.rs, systems.rs, inquire.rs, command.rs, save.rs: what they tell
//! ```

mod ask;
mod coarse;
mod command;
mod guest;
mod inquire;
mod play;
mod save;
mod schema;
mod state;
mod systems;

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use motes_viewer::{Exhibit, View};

use crate::{Quiet, Result, Scene, Session};
pub(crate) use coarse::simple;
use guest::{Guest, lock};

/// A scene and its open sources, for any number of clients.
pub struct Gallery {
    /// What each client begins with.
    session: Arc<Mutex<Session>>,
    follows: bool,
    frames: Arc<Frames>,
}

/// How many frames there are.
pub(crate) struct Frames {
    count: AtomicUsize,
    /// Whether they have all been counted.
    known: AtomicBool,
}

impl Frames {
    fn new(count: usize, known: bool) -> Arc<Self> {
        Arc::new(Self { count: AtomicUsize::new(count), known: AtomicBool::new(known) })
    }

    /// How many are known of, and whether that is all.
    fn get(&self) -> (usize, bool) {
        (self.count.load(Ordering::Acquire), self.known.load(Ordering::Acquire))
    }

    fn set(&self, count: usize) {
        self.count.store(count, Ordering::Release);
        self.known.store(true, Ordering::Release);
    }
}

impl Gallery {
    /// Opens the sources of a scene. The frames of files are counted meanwhile: that may take long.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn open(scene: Scene) -> Result<Self> {
        let mut session = Session::open(scene.clone(), None)?;
        let made = scene.system.iter().all(|system| crate::open::is_made(&system.source));
        let frames = match made {
            true => Frames::new(session.frames(&Quiet)?, true),
            false => Frames::new(scene.image.frame as usize + 1, false),
        };
        let counted = frames.clone();
        let count = move || {
            // By readers of its own, as those of the session are in use.
            let count = Session::open(scene, None).and_then(|mut own| own.frames(&Quiet));
            counted.set(count.unwrap_or(1));
        };
        if !made && std::thread::Builder::new().name("count".into()).spawn(count).is_err() {
            frames.set(session.frames(&Quiet)?);
        }
        Ok(Self { session: Arc::new(Mutex::new(session)), follows: false, frames })
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

impl Gallery {
    /// Follows sources that grow: looks for more frames every so often, as long as the gallery is there.
    /// Who looks at the last frame then gets the new last one.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn follow(&mut self, every: Duration) -> std::io::Result<()> {
        self.follows = true;
        let (session, frames) = (Arc::downgrade(&self.session), self.frames.clone());
        let stamps = |session: &Session| {
            let sources = session.scene().system.iter().map(|s| &*s.source);
            sources.map(Stamp::of).collect::<Vec<_>>()
        };
        let mut before = stamps(&lock(&self.session));
        let thread = std::thread::Builder::new().name("follow".into());
        thread.spawn(move || {
            while let Some(session) = session.upgrade() {
                let session = lock(&session);
                let now = stamps(&session);
                if now != before {
                    // What is being written may not be fit to be read yet.
                    if let Ok(count) = session.refresh() {
                        frames.set(count);
                        before = now;
                    }
                }
                drop(session);
                std::thread::sleep(every);
            }
        })?;
        Ok(())
    }
}

/// What changes when a source grows: the length of its file, and when its folder last changed.
#[derive(PartialEq)]
struct Stamp(Option<u64>, Option<std::time::SystemTime>);

impl Stamp {
    fn of(source: &str) -> Self {
        let path = Path::new(source);
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
        let changed = folder.unwrap_or(Path::new(".")).metadata().and_then(|m| m.modified());
        Self(path.metadata().ok().map(|m| m.len()), changed.ok())
    }
}

impl Exhibit for Gallery {
    fn open(&self) -> std::result::Result<Box<dyn View>, String> {
        let session = lock(&self.session).share();
        let guest = Guest::new(session, self.frames.clone(), self.follows);
        Ok(Box::new(guest.map_err(|e| e.to_string())?))
    }
}
