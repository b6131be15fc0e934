//! One client: what it wants to see, and the pictures of it.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use motes_frame::rgb8;
use motes_viewer::{Link, Next, Picture, Request, Step, View};
use serde_json::{Map, Value, json};

use super::coarse::{Pace, simple};
use super::state::State;
use super::{schema, systems};
use crate::session::{Look, Seen};
use crate::{Error, Result, Scene, Session, Watch};

/// An exact picture that is drawn sooner needs no coarse one before it.
const AT_ONCE: Duration = Duration::from_millis(60);
/// After this, what moves is taken to stand still.
const AT_REST: Duration = Duration::from_millis(150);
/// Work that takes longer is told of.
const LONG: Duration = Duration::from_secs(1);

/// One client.
pub(super) struct Guest {
    pub state: Mutex<State>,
    /// The number of the newest state.
    newest: AtomicU32,
    closed: AtomicBool,
    studio: Mutex<Studio>,
    /// What was drawn last.
    pub seen: Mutex<Option<Seen>>,
    pub frames: usize,
}

/// What pictures are drawn with.
struct Studio {
    session: Session,
    pace: Pace,
    /// The state that was drawn last, and how well.
    drawn: Option<(u32, Grade)>,
    /// How long the last exact picture took.
    exact_took: Duration,
    /// When the state that is drawn was first drawn.
    since: Instant,
}

/// How well a picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Grade {
    /// In time.
    Coarse,
    /// A ray for each pixel.
    Simple,
    /// As the scene says.
    Exact,
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is behind these locks is whole after every step.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Guest {
    /// A client that begins with the scene of a session. The first frame is read.
    ///
    /// # Errors
    /// It cannot be.
    pub fn new(mut session: Session, frames: usize) -> Result<Self> {
        let state = State::new(session.scene().clone());
        let seen = session.survey(&crate::Quiet)?;
        let studio = Studio {
            session,
            pace: Pace::default(),
            drawn: None,
            exact_took: Duration::MAX,
            since: Instant::now(),
        };
        Ok(Self {
            newest: AtomicU32::new(state.number),
            state: Mutex::new(state),
            closed: AtomicBool::new(false),
            studio: Mutex::new(studio),
            seen: Mutex::new(Some(seen)),
            frames,
        })
    }

    /// Changes the state; drawing learns of it.
    pub fn change<T>(&self, change: impl FnOnce(&mut State) -> Result<T>) -> Result<T> {
        let mut state = lock(&self.state);
        let done = change(&mut state);
        self.newest.store(state.number, Ordering::Release);
        done
    }

    /// The message about the scene as it stands.
    pub fn scene_message(&self) -> Map<String, Value> {
        let state = lock(&self.state);
        let (undo, redo) = state.steps();
        let mut message = Map::new();
        message.insert("scene".into(), json!(state.scene()));
        message.insert("state".into(), state.number.into());
        message.insert("undo".into(), undo.into());
        message.insert("redo".into(), redo.into());
        let scene = state.seen();
        let playing = state.play.is_some();
        drop(state);
        if let Some(seen) = &*lock(&self.seen) {
            message.insert("resolved".into(), systems::resolved(&scene, seen, (self.frames, playing)));
        }
        message
    }

    /// Draws a state as well as `grade` says.
    fn picture(
        &self,
        studio: &mut Studio,
        (scene, number, grade): (&Scene, u32, Grade),
        tell: &(dyn Fn(Value) + Sync),
    ) -> Result<(Look, Duration)> {
        let of = match grade {
            Grade::Coarse => studio.pace.coarse(scene),
            Grade::Simple => simple(scene),
            Grade::Exact => scene.clone(),
        };
        studio.session.set_scene(of)?;
        let watch = Drawing { guest: self, number, grade, since: Instant::now(), tell };
        let look = studio.session.look(scene.image.frame as usize, grade == Grade::Exact, &watch)?;
        Ok((look, watch.since.elapsed()))
    }

    /// Which picture comes next of a state, and whether it is the last of it.
    fn grade(&self, studio: &mut Studio, number: u32, moving: bool) -> Option<(Grade, Next)> {
        let before = studio.drawn.filter(|(drawn, _)| *drawn == number).map(|(_, grade)| grade);
        let rests = studio.since.elapsed() >= AT_REST;
        let quick = studio.exact_took < AT_ONCE;
        Some(match before {
            None if moving => (Grade::Coarse, Next::After(AT_REST)),
            None if quick => (Grade::Exact, Next::Asked),
            None => (Grade::Coarse, Next::Now),
            Some(Grade::Exact) => return None,
            Some(_) if moving && !rests => return None,
            Some(Grade::Coarse) if !studio.pace.is_whole() && !quick => (Grade::Simple, Next::Now),
            Some(_) => (Grade::Exact, Next::Asked),
        })
    }

    /// Tells what the page shows beside an exact picture.
    fn tell_of(&self, look: &Look, tell: &(dyn Fn(Value) + Sync)) {
        let stats = &look.stats;
        tell(json!({
            "is": "stats",
            "ms": stats.ms,
            "particles": stats.particles,
            "counts": stats.counts,
            "bytes": stats.bytes,
            "simd": stats.simd,
            "threads": stats.threads,
            "hash": format!("{:016x}", look.hash),
        }));
        let had = lock(&self.seen).replace(look.seen.clone());
        if had.is_none_or(|had| systems::differ(&had, &look.seen)) {
            let scene = lock(&self.state).seen();
            let all = systems::systems(&scene, &look.seen, self.frames);
            tell(json!({"is": "systems", "systems": all}));
            let mut message = self.scene_message();
            message.insert("is".into(), "scene".into());
            tell(Value::Object(message));
        }
    }
}

impl View for Guest {
    fn hello(&self) -> Map<String, Value> {
        let mut hello = self.scene_message();
        hello.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        hello.insert("schema".into(), schema::schema());
        hello.insert("colormaps".into(), schema::colormaps());
        let scene = lock(&self.state).seen();
        if let Some(seen) = &*lock(&self.seen) {
            hello.insert("systems".into(), systems::systems(&scene, seen, self.frames).into());
        }
        hello.insert("limits".into(), super::ask::limits());
        hello
    }

    fn ask(
        &self,
        request: &Request,
        tell: &(dyn Fn(Value) + Sync),
    ) -> std::result::Result<Map<String, Value>, String> {
        super::ask::answer(self, request, tell).map_err(|e| e.to_string())
    }

    fn draw(&self, link: Link, tell: &(dyn Fn(Value) + Sync)) -> Step {
        let mut studio = lock(&self.studio);
        let studio = &mut *studio;
        if link.anew {
            studio.drawn = None;
        }
        let (scene, number, moving) = {
            let state = lock(&self.state);
            (state.seen(), state.number, state.moving())
        };
        let idle = Step { picture: None, next: Next::Asked };
        let Some((grade, next)) = self.grade(studio, number, moving) else { return idle };
        if studio.drawn.is_none_or(|(drawn, _)| drawn != number) {
            studio.since = Instant::now();
        }
        let (look, took) = match self.picture(studio, (&scene, number, grade), tell) {
            Ok(made) => made,
            Err(Error::Cancelled) => return Step { picture: None, next: Next::Now },
            Err(error) => {
                studio.drawn = Some((number, Grade::Exact));
                let text = error.to_string();
                tell(json!({"is": "notice", "severity": "error", "text": text}));
                return idle;
            }
        };
        studio.drawn = Some((number, grade));
        match grade {
            Grade::Exact => studio.exact_took = took,
            Grade::Coarse => {
                let canvas = f64::from(scene.image.width) * f64::from(scene.image.height) / 1e6;
                let megapixels = look.shown.color().len() as f64 / 1e6;
                studio.pace.learn((megapixels, canvas), took, link.encoding);
            }
            Grade::Simple => {}
        }
        if grade == Grade::Exact {
            self.tell_of(&look, tell);
        } else {
            *lock(&self.seen) = Some(look.seen.clone());
        }
        let side = |n: usize| u16::try_from(n).unwrap_or(u16::MAX);
        let picture = Picture {
            size: (side(look.shown.width()), side(look.shown.height())),
            rgb: rgb8(&look.shown),
            exact: grade == Grade::Exact,
            coarse: grade != Grade::Exact,
            playing: false,
            frame: scene.image.frame,
            took,
            state: number,
            hash: look.hash,
        };
        Step { picture: Some(picture), next }
    }

    fn save(
        &self,
        file: &str,
        _wanted: &BTreeMap<String, String>,
    ) -> std::result::Result<Vec<u8>, String> {
        Err(format!("{file}: not yet"))
    }

    fn close(&self) {
        self.closed.store(true, Ordering::Release);
    }
}

/// Ends drawing when there is a newer state, except for coarse pictures: something has to be seen.
struct Drawing<'a> {
    guest: &'a Guest,
    number: u32,
    grade: Grade,
    since: Instant,
    tell: &'a (dyn Fn(Value) + Sync),
}

impl Watch for Drawing<'_> {
    fn progress(&self, stage: &'static str, done: u64, total: u64) -> bool {
        if self.since.elapsed() > LONG && done.is_multiple_of((total / 20).max(1)) {
            (self.tell)(json!({"is": "progress", "stage": stage, "done": done, "total": total}));
        }
        let newer = self.guest.newest.load(Ordering::Acquire) != self.number;
        let stale = newer && self.grade != Grade::Coarse;
        !stale && !self.guest.closed.load(Ordering::Acquire)
    }
}
