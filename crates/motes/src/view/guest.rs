//! One client: what it wants to see, and the pictures of it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use motes_frame::{Frame, rgb8};
use motes_scene::Renderer;
use motes_viewer::{Link, Next, Picture, Request, Step, View};
use serde_json::{Map, Value, json};

use super::Frames;
use super::coarse::{Pace, simple};
use super::play::Turn;
use super::state::State;
use super::{save, schema, systems};
use crate::session::{Look, Seen};
use crate::{Error, Result, Scene, Session, Watch};

/// An exact picture that is drawn sooner needs no coarse one before it.
const AT_ONCE: Duration = Duration::from_millis(60);
/// After this, what moves is taken to stand still.
const AT_REST: Duration = Duration::from_millis(150);
/// A frame that is being read is looked for so often.
const SOON: Duration = Duration::from_millis(3);
/// How often more frames are looked for.
const FOLLOWING: Duration = Duration::from_millis(250);
/// Work that takes longer is told of.
const LONG: Duration = Duration::from_secs(1);

/// One client.
pub(super) struct Guest {
    pub state: Mutex<State>,
    /// The number of the newest state.
    newest: AtomicU32,
    closed: AtomicBool,
    studio: Mutex<Studio>,
    /// The sources, for files that are saved while something is drawn.
    sources: Mutex<Session>,
    /// What was drawn last.
    pub seen: Mutex<Option<Seen>>,
    /// How many frames there are; those of a growing source become more.
    frames: Mutex<Arc<Frames>>,
    /// How many were known of when it was looked at last, and whether those were all.
    counted: Mutex<(usize, bool)>,
    follows: bool,
}

/// What pictures are drawn with.
struct Studio {
    session: Session,
    /// How coarse pictures are, by way of seeing.
    paces: [(Renderer, Pace); 3],
    /// The state that was drawn last, and how well.
    drawn: Option<(u32, Grade)>,
    /// How long the last exact picture took.
    exact_took: Duration,
    /// When the state that is drawn was first drawn.
    since: Instant,
    /// What was odd and has been told.
    warned: Vec<String>,
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

/// What makes a picture the first of many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moving {
    Not,
    Dragged,
    Plays,
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
    pub fn new(mut session: Session, frames: Arc<Frames>, follows: bool) -> Result<Self> {
        let state = State::new(session.scene().clone());
        let seen = session.survey(&crate::Quiet)?;
        let sources = Mutex::new(session.share());
        let studio = Studio {
            session,
            paces: [Renderer::Spheres, Renderer::Surface, Renderer::Density]
                .map(|renderer| (renderer, Pace::before(renderer))),
            drawn: None,
            exact_took: Duration::MAX,
            since: Instant::now(),
            warned: Vec::new(),
        };
        Ok(Self {
            newest: AtomicU32::new(state.number),
            state: Mutex::new(state),
            closed: AtomicBool::new(false),
            studio: Mutex::new(studio),
            sources,
            seen: Mutex::new(Some(seen)),
            counted: Mutex::new(frames.get()),
            frames: Mutex::new(frames),
            follows,
        })
    }

    /// Changes the state; drawing learns of it.
    pub fn change<T>(&self, change: impl FnOnce(&mut State) -> Result<T>) -> Result<T> {
        let mut state = lock(&self.state);
        let done = change(&mut state);
        self.newest.store(state.number, Ordering::Release);
        done
    }

    /// How many frames there are.
    pub fn frame_count(&self) -> usize {
        lock(&self.frames).get().0
    }

    /// Goes on with other sources, from their first frame.
    ///
    /// # Errors
    /// They cannot be opened.
    pub fn reopen(&self, rename: &dyn Fn(&str) -> String) -> Result<()> {
        let mut scene = lock(&self.state).scene().clone();
        scene.system.iter_mut().for_each(|system| system.source = rename(&system.source));
        let mut session = Session::open(scene, None)?;
        let frames = session.frames(&crate::Quiet)?;
        // What is being drawn is of no use any more.
        self.change(|state| {
            state.changed();
            Ok(())
        })?;
        let mut studio = lock(&self.studio);
        studio.session = session.share();
        *lock(&self.sources) = session;
        *lock(&self.frames) = Frames::new(frames, true);
        *lock(&self.counted) = (frames, true);
        self.change(|state| {
            state.rename(rename);
            state.go_to(0);
            Ok(())
        })
    }

    /// A session of its own, for files.
    fn own_session(&self, scene: Scene) -> Result<Session> {
        let mut session = lock(&self.sources).share();
        session.set_scene(scene)?;
        Ok(session)
    }

    /// Goes on to the frame that is due, where frame follows frame and it has been read; gives for how long
    /// nothing is.
    fn go_on(&self, session: &Session, tell: &(dyn Fn(Value) + Sync)) -> Option<Duration> {
        let running = lock(&self.state).running?;
        let frames = u32::try_from(self.frame_count()).unwrap_or(u32::MAX);
        let now = Instant::now();
        let (due, wait) = match running.turn(frames, now) {
            Turn::Frame(frame) => (frame, None),
            Turn::Wait(time, frame) => (frame, Some(time)),
            Turn::End => {
                let _ = self.change(|state| {
                    state.running = None;
                    state.changed();
                    Ok(())
                });
                self.tell_scene(tell);
                return None;
            }
        };
        session.read_ahead(due as usize);
        if wait.is_some() {
            return wait;
        }
        // Any frame that is there is better than to wait for a later one.
        let there = session.is_ahead().and_then(|frame| u32::try_from(frame).ok());
        let Some(frame) = there.filter(|frame| running.play.drop || *frame == due) else {
            return Some(SOON);
        };
        let _ = self.change(|state| {
            if let Some(running) = &mut state.running {
                running.show(frame, now);
                state.go_to(frame);
            }
            Ok(())
        });
        None
    }

    /// Tells if there are more frames than before. Who follows and has seen the last one gets the new last
    /// one. Gives when to look again.
    fn keep_up(&self, tell: &(dyn Fn(Value) + Sync)) -> Option<Duration> {
        let now = lock(&self.frames).get();
        let before = std::mem::replace(&mut *lock(&self.counted), now);
        if now != before {
            let last = |count: usize| u32::try_from(count.saturating_sub(1)).unwrap_or(u32::MAX);
            let _ = self.change(|state| {
                let at_end = state.scene().image.frame >= last(before.0);
                if self.follows && before.1 && at_end && state.running.is_none() {
                    state.go_to(last(now.0));
                }
                Ok(())
            });
            self.tell_scene(tell);
        }
        (self.follows || !now.1).then_some(FOLLOWING)
    }

    /// Tells of the scene as it stands; gives the number of its state.
    pub fn tell_scene(&self, tell: &(dyn Fn(Value) + Sync)) -> Value {
        let mut message = self.scene_message();
        let number = message["state"].clone();
        message.insert("is".into(), "scene".into());
        tell(Value::Object(message));
        number
    }

    /// Finds out what there is to be seen, if that was let go of.
    fn look_again(&self) {
        if lock(&self.seen).is_some() {
            return;
        }
        let mut studio = lock(&self.studio);
        let scene = lock(&self.state).seen();
        let surveyed = studio.session.set_scene(scene);
        let seen = surveyed.and_then(|()| studio.session.survey(&crate::Quiet));
        // What is wrong is told when it is drawn.
        *lock(&self.seen) = seen.ok();
    }

    /// The message about the scene as it stands.
    fn scene_message(&self) -> Map<String, Value> {
        let state = lock(&self.state);
        let (undo, redo) = state.steps();
        let mut message = Map::new();
        message.insert("scene".into(), json!(state.scene()));
        message.insert("state".into(), state.number.into());
        message.insert("undo".into(), undo.into());
        message.insert("redo".into(), redo.into());
        let scene = state.seen();
        let about = (self.frame_count(), state.running.is_some());
        drop(state);
        if let Some(seen) = &*lock(&self.seen) {
            message.insert("resolved".into(), systems::resolved(&scene, seen, about));
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
        let (of, enlarged) = match grade {
            Grade::Coarse => (studio.pace(scene).coarse(scene), studio.pace(scene).divide()),
            Grade::Simple => (simple(scene), 1.0),
            Grade::Exact => (scene.clone(), 1.0),
        };
        studio.session.set_scene(of)?;
        let watch = Drawing { guest: self, number, grade, since: Instant::now(), tell };
        let look = studio.session.look(
            scene.image.frame as usize,
            (grade == Grade::Exact, enlarged as f32),
            &watch,
        )?;
        Ok((look, watch.since.elapsed()))
    }

    /// Which picture comes next of a state, and what then; or when to look again.
    fn grade(
        &self,
        (studio, whole): (&Studio, bool),
        number: u32,
        moving: Moving,
    ) -> std::result::Result<(Grade, Next), Next> {
        let before = studio.drawn.filter(|(drawn, _)| *drawn == number).map(|(_, grade)| grade);
        let rest = AT_REST.saturating_sub(studio.since.elapsed());
        let quick = studio.exact_took < AT_ONCE;
        Ok(match (before, moving) {
            (None, Moving::Plays) => (Grade::Coarse, Next::Now),
            (Some(_), Moving::Plays) => return Err(Next::Asked),
            (None, Moving::Dragged) => (Grade::Coarse, Next::After(AT_REST)),
            (None, _) if quick => (Grade::Exact, Next::Asked),
            (None, _) => (Grade::Coarse, Next::Now),
            (Some(Grade::Exact), _) => return Err(Next::Asked),
            (Some(_), Moving::Dragged) if !rest.is_zero() => return Err(Next::After(rest)),
            (Some(Grade::Coarse), _) if !whole && !quick => (Grade::Simple, Next::Now),
            (Some(_), _) => (Grade::Exact, Next::Asked),
        })
    }

    /// The picture as it is sent, and as it was drawn; beside an exact one more is told.
    fn told(
        &self,
        ((look, took), grade, playing): ((Look, Duration), Grade, bool),
        (scene, number): (&Scene, u32),
        tell: &(dyn Fn(Value) + Sync),
    ) -> (Picture, Frame) {
        if grade == Grade::Exact {
            self.tell_of(&look, tell);
        } else {
            *lock(&self.seen) = Some(look.seen);
        }
        let side = |n: usize| u16::try_from(n).unwrap_or(u16::MAX);
        let picture = Picture {
            size: (side(look.shown.width()), side(look.shown.height())),
            rgb: rgb8(&look.shown),
            exact: grade == Grade::Exact,
            coarse: grade != Grade::Exact,
            playing,
            frame: scene.image.frame,
            took,
            state: number,
            hash: look.hash,
        };
        (picture, look.shown)
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
            let all = systems::systems(&scene, &look.seen, self.frame_count());
            tell(json!({"is": "systems", "systems": all}));
            self.tell_scene(tell);
        }
    }
}

impl View for Guest {
    fn hello(&self) -> Map<String, Value> {
        self.look_again();
        let mut hello = self.scene_message();
        hello.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        hello.insert("schema".into(), schema::schema());
        hello.insert("colormaps".into(), schema::colormaps());
        let scene = lock(&self.state).seen();
        if let Some(seen) = &*lock(&self.seen) {
            hello.insert(
                "systems".into(),
                systems::systems(&scene, seen, self.frame_count()).into(),
            );
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
            studio.warned.clear();
        }
        let look_again = self.keep_up(tell);
        let wait = self.go_on(&studio.session, tell).or(look_again);
        let (scene, number, moving) = {
            let state = lock(&self.state);
            let moving = match (state.running.is_some(), state.moving()) {
                (true, _) => Moving::Plays,
                (false, true) => Moving::Dragged,
                (false, false) => Moving::Not,
            };
            (state.seen(), state.number, moving)
        };
        // What is to be done after nothing, or after the last picture.
        let then = |next| match next {
            Next::Asked => wait.map_or(Next::Asked, Next::After),
            next => next,
        };
        let whole = studio.pace(&scene).is_whole();
        let (grade, next) = match self.grade((studio, whole), number, moving) {
            Ok(one) => one,
            Err(next) => return Step { picture: None, next: then(next) },
        };
        if studio.drawn.is_none_or(|(drawn, _)| drawn != number) {
            studio.since = Instant::now();
        }
        match self.picture(studio, (&scene, number, grade), tell) {
            Ok(made) => {
                studio.drawn = Some((number, grade));
                studio.learn(&scene, (grade, &made), link);
                let playing = moving == Moving::Plays;
                let (picture, shown) = self.told((made, grade, playing), (&scene, number), tell);
                studio.session.recycle(shown);
                if grade == Grade::Exact {
                    studio.warn(tell);
                }
                Step { picture: Some(picture), next: then(next) }
            }
            Err(Error::Cancelled) => Step { picture: None, next: Next::Now },
            Err(error) => {
                studio.drawn = Some((number, Grade::Exact));
                let text = error.to_string();
                tell(json!({"is": "notice", "severity": "error", "text": text}));
                Step { picture: None, next: then(Next::Asked) }
            }
        }
    }

    fn save(
        &self,
        file: &str,
        wanted: &BTreeMap<String, String>,
    ) -> std::result::Result<Vec<u8>, String> {
        let made = || {
            let scene = save::scene_of(lock(&self.state).seen(), wanted)?;
            let watch = Saving { closed: &self.closed };
            match file {
                "scene.toml" => Ok(super::command::scene_text(&scene).into_bytes()),
                "film.mp4" => save::film(self.own_session(scene)?, wanted, &watch),
                file => save::picture(&mut self.own_session(scene)?, file, &watch),
            }
        };
        made().map_err(|error: Error| error.to_string())
    }

    fn rest(&self) {
        let mut studio = lock(&self.studio);
        studio.session = studio.session.share();
        *lock(&self.seen) = None;
    }

    fn close(&self) {
        self.closed.store(true, Ordering::Release);
    }
}

impl Studio {
    /// How coarse pictures of a scene are.
    fn pace(&mut self, scene: &Scene) -> &mut Pace {
        let at = self.paces.iter().position(|(renderer, _)| *renderer == scene.renderer);
        &mut self.paces[at.unwrap_or(0)].1
    }

    /// Tells of what was odd and has not been told.
    fn warn(&mut self, tell: &(dyn Fn(Value) + Sync)) {
        for text in self.session.warnings() {
            if !self.warned.contains(&text) {
                tell(json!({"is": "notice", "severity": "warning", "text": text}));
                self.warned.push(text);
            }
        }
    }

    /// Learns from a picture how the next ones are to be.
    fn learn(
        &mut self,
        scene: &Scene,
        (grade, (look, took)): (Grade, &(Look, Duration)),
        link: Link,
    ) {
        match grade {
            Grade::Exact => self.exact_took = *took,
            Grade::Coarse => {
                let canvas = f64::from(scene.image.width) * f64::from(scene.image.height) / 1e6;
                let megapixels = look.shown.color().len() as f64 / 1e6;
                self.pace(scene).learn((megapixels, canvas), *took, link.encoding);
            }
            Grade::Simple => {}
        }
    }
}

/// Ends saving with the visit.
struct Saving<'a> {
    closed: &'a AtomicBool,
}

impl Watch for Saving<'_> {
    fn progress(&self, _: &'static str, _: u64, _: u64) -> bool {
        !self.closed.load(Ordering::Acquire)
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
