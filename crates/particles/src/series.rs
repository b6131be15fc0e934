//! Frames over time, on demand, from one source.
//!
//! A [`Series`] knows which file holds a frame and finds that out as late as it can: frame 0 counts
//! nothing, and going forward counts a file only when its frames have been read. Frames in use stay in
//! a bounded cache. Once two frames are asked for in a row, the one after is read ahead on a thread.
//!
//! # Invariants
//! - At most one thread per series; it ends with the series.
//! - What goes wrong while reading ahead is forgotten: the frame is read again, and fails, when it is
//!   asked for.
//! - At most the last frame, the one read ahead, and [`CACHE_BYTES`] of others stay in memory.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::thread::JoinHandle;
use std::time::Duration;

use rayon::prelude::*;

use crate::age::Ages;
use crate::demo::DemoReader;
use crate::read::{self, Progress, Reader, Wanted, names};
use crate::source::Source;
use crate::{Particles, Place, ReadError, Result};

/// How many bytes of frames are kept besides the last one and the one read ahead.
const CACHE_BYTES: usize = 256 << 20;
/// A frame that takes more is not followed by reading ahead: two of them may not fit in memory.
const READ_AHEAD_BYTES: usize = 4 << 30;
/// How many files stay open: the one in use, and the next one for reading ahead.
const OPEN_FILES: usize = 2;

/// Opens a file: the format's name and its reader.
type Opener = Box<dyn Fn(&Path) -> Result<(&'static str, Box<dyn Reader>)> + Send + Sync>;

/// The frames of a source.
pub struct Series {
    source: String,
    format: String,
    shared: Arc<Shared>,
    /// The frame that was asked for last.
    last: Option<usize>,
    ahead: Option<ReadAhead>,
}

impl Series {
    /// Opens `source`: a path, a quoted pattern (`dump.*.gz`, `out_%04d.vtk`, `run{}/x.ply`; natural
    /// order), or `demo:KIND:N`.
    ///
    /// # Errors
    /// No such file, no match, or the first file is of no known format.
    pub fn open(source: &str) -> Result<Self> {
        match Source::find(source)? {
            Source::Files(files) => Self::of_files(source, files, Box::new(read::open)),
            Source::Demo(demo) => {
                let mut series = Self::from_reader("demo", Box::new(DemoReader::new(demo)));
                series.source = source.into();
                Ok(series)
            }
        }
    }

    /// The frames of a reader that is no file, such as a running simulation; `format` is what
    /// [`Series::format`] will say.
    pub fn from_reader(format: &str, reader: Box<dyn Reader>) -> Self {
        let opener: Opener = Box::new(|path| {
            Err(ReadError::new(path, Place::Whole, "cannot be opened a second time"))
        });
        Self::new(format, format, Files::new(vec![PathBuf::from(format)], opener, reader))
    }

    fn of_files(source: &str, files: Vec<PathBuf>, opener: Opener) -> Result<Self> {
        let Some(first) = files.first() else {
            return Err(ReadError::new(source, Place::Whole, "names no file"));
        };
        let (format, reader) = opener(first)?;
        Ok(Self::new(source, format, Files::new(files, opener, reader)))
    }

    fn new(source: &str, format: &str, files: Files) -> Self {
        let core = Core { files, cache: VecDeque::new(), ages: None };
        let shared = Arc::new(Shared { core: Mutex::new(core), warnings: Mutex::new(vec![]) });
        Self { source: source.into(), format: format.into(), shared, last: None, ahead: None }
    }

    /// The source as the user wrote it.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The name of the (first file's) format.
    pub fn format(&self) -> &str {
        &self.format
    }

    /// How many whole frames there are. Scans all files the first time.
    ///
    /// # Errors
    /// A file that cannot be read; the last of several files is instead left out, with a warning, as
    /// it may still be being written.
    pub fn frames(&mut self, progress: Progress<'_>) -> Result<usize> {
        self.shared.run(|core| core.files.total(progress))
    }

    /// Frame `frame`, counted from 0. Frames of one series may differ in particles and columns.
    ///
    /// # Errors
    /// Broken content, or no such frame.
    pub fn frame(
        &mut self,
        frame: usize,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> Result<Arc<Particles>> {
        let particles = self.shared.run(|core| core.frame(frame, wanted, progress))?;
        let in_order = frame.checked_sub(1).is_some_and(|before| self.last == Some(before));
        self.last = Some(frame);
        if in_order && particles.bytes() <= READ_AHEAD_BYTES {
            let shared = &self.shared;
            let ahead = self.ahead.get_or_insert_with(|| ReadAhead::start(shared.clone()));
            ahead.ask(frame + 1, wanted);
        }
        Ok(particles)
    }

    /// As [`Series::frame`], for who asks for a frame once: it is not kept here.
    ///
    /// # Errors
    /// As [`Series::frame`].
    pub fn take(
        &mut self,
        frame: usize,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> Result<Particles> {
        self.shared.run(|core| core.take(frame, wanted, progress))
    }

    /// From now on particles that have identifiers, and no `Age`, get one: the time, or the frames where there is
    /// none, since their identifier first appeared. All frames before the one asked for are read for it, once.
    pub fn add_ages(&mut self) {
        self.shared.run(|core| {
            core.cache.clear();
            core.ages.get_or_insert_default();
        });
    }

    /// What was odd but could be read, so far: an incomplete last frame, a count that does not agree.
    pub fn warnings(&self) -> Vec<String> {
        lock(&self.shared.warnings).clone()
    }
}

impl std::fmt::Debug for Series {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Series").field("source", &self.source).finish_non_exhaustive()
    }
}

/// What the series and its thread both use.
struct Shared {
    core: Mutex<Core>,
    warnings: Mutex<Vec<String>>,
}

impl Shared {
    /// Works on the core, then publishes its warnings.
    fn run<T>(&self, work: impl FnOnce(&mut Core) -> T) -> T {
        let mut core = lock(&self.core);
        let result = work(&mut core);
        lock(&self.warnings).clone_from(&core.files.warnings);
        result
    }
}

/// Locks `mutex`. A thread of rayon's goes on working for others meanwhile: whoever holds the lock
/// may need it to finish.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    loop {
        match mutex.try_lock() {
            Ok(guard) => return guard,
            // A reader that panicked leaves nothing half done that matters here.
            Err(TryLockError::Poisoned(poisoned)) => return poisoned.into_inner(),
            Err(TryLockError::WouldBlock) if rayon::current_thread_index().is_none() => {
                return mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            }
            Err(TryLockError::WouldBlock) => wait_in_pool(),
        }
    }
}

/// Lets the pool of the calling thread, if it is in one, do something else for a moment.
fn wait_in_pool() {
    if rayon::yield_now() != Some(rayon::Yield::Executed) {
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// The thread that reads the next frame into the cache.
struct ReadAhead {
    /// `None` only while being dropped: closing the channel ends the thread.
    requests: Option<Sender<(usize, Wanted)>>,
    /// `None` where the system gave no thread: then nothing is read ahead.
    thread: Option<JoinHandle<()>>,
}

impl ReadAhead {
    fn start(shared: Arc<Shared>) -> Self {
        let (requests, incoming) = channel();
        let thread = std::thread::Builder::new()
            .name("read-ahead".into())
            .spawn(move || read_ahead(&shared, &incoming))
            .ok();
        Self { requests: Some(requests), thread }
    }

    fn ask(&self, frame: usize, wanted: &Wanted) {
        if let Some(requests) = &self.requests {
            // An ended thread reads nothing ahead; the frame is then read when asked for.
            let _ = requests.send((frame, wanted.clone()));
        }
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            while !thread.is_finished() {
                wait_in_pool();
            }
        }
    }
}

fn read_ahead(shared: &Shared, requests: &Receiver<(usize, Wanted)>) {
    while let Ok(mut request) = requests.recv() {
        while let Ok(newer) = requests.try_recv() {
            request = newer;
        }
        let (frame, wanted) = request;
        shared.run(|core| {
            if core.files.may_hold(frame) {
                let _ = core.frame(frame, &wanted, &|_, _| {});
            }
        });
    }
}

/// A frame in memory.
struct Cached {
    frame: usize,
    wanted: Wanted,
    particles: Arc<Particles>,
}

/// The files and the frames kept in memory.
struct Core {
    files: Files,
    /// The latest last.
    cache: VecDeque<Cached>,
    /// Where ages are asked for.
    ages: Option<Ages>,
}

impl Core {
    fn frame(
        &mut self,
        frame: usize,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> Result<Arc<Particles>> {
        let serves = |c: &Cached| c.frame == frame && covers(&c.wanted, wanted);
        let hit = self.cache.iter().position(serves).and_then(|at| self.cache.remove(at));
        if let Some(cached) = hit {
            let particles = cached.particles.clone();
            self.cache.push_back(cached);
            return Ok(particles);
        }
        self.cache.retain(|c| c.frame != frame);
        self.make_room();
        let particles = Arc::new(self.read(frame, wanted, progress)?);
        let cached = Cached { frame, wanted: wanted.clone(), particles: particles.clone() };
        self.cache.push_back(cached);
        Ok(particles)
    }

    /// Reads a frame that is not kept.
    fn take(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        let cached = self.cache.iter().position(|c| c.frame == frame);
        match cached.and_then(|at| self.cache.remove(at)) {
            Some(cached) if covers(&cached.wanted, wanted) => {
                Ok(Arc::unwrap_or_clone(cached.particles))
            }
            _ => {
                self.make_room();
                self.read(frame, wanted, progress)
            }
        }
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        let Some(ages) = self.ages.as_mut().filter(|_| wanted.wants(names::AGE)) else {
            return self.files.read(frame, wanted, progress);
        };
        let mut particles = self.files.read(frame, &Ages::wanted(wanted), progress)?;
        let files = &mut self.files;
        ages.give(frame, &mut particles, |frame, wanted| files.read(frame, wanted, progress))?;
        Ok(particles)
    }

    /// Before another frame as large as the latest: only that one is sure to stay.
    fn make_room(&mut self) {
        let expected = self.cache.back().map_or(0, |c| c.particles.bytes());
        if expected > READ_AHEAD_BYTES {
            self.cache.clear();
        }
        let mut bytes: usize = self.cache.iter().map(|c| c.particles.bytes()).sum();
        while self.cache.len() > 1 && bytes > CACHE_BYTES + expected {
            bytes -= self.cache.pop_front().map_or(0, |c| c.particles.bytes());
        }
    }
}

/// Whether a frame read with `had` serves a request for `wanted`.
fn covers(had: &Wanted, wanted: &Wanted) -> bool {
    match (had, wanted) {
        (Wanted::All, _) => true,
        (Wanted::Only(_), Wanted::All) => false,
        (Wanted::Only(_), Wanted::Only(names)) => names.iter().all(|name| had.wants(name)),
    }
}

/// The files of a series, each with one or several frames.
struct Files {
    paths: Vec<PathBuf>,
    /// Whole frames per file, where counted.
    counts: Vec<Option<usize>>,
    /// By number of file, the latest used first.
    open: VecDeque<(usize, Box<dyn Reader>)>,
    opener: Opener,
    warnings: Vec<String>,
}

impl Files {
    fn new(paths: Vec<PathBuf>, opener: Opener, first: Box<dyn Reader>) -> Self {
        let counts = vec![None; paths.len()];
        Self { paths, counts, open: VecDeque::from([(0, first)]), opener, warnings: vec![] }
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        let (file, within) = self.locate(frame, progress)?;
        let path = &self.paths[file];
        if let Some(count) = self.counts[file].filter(|count| within >= *count) {
            let all = self.counts[..file].iter().flatten().sum::<usize>() + count;
            let message =
                format!("there is no frame {frame}; the frames are 0 to {}", all.max(1) - 1);
            return Err(ReadError::new(path, Place::Whole, message));
        }
        let result = self.reader(file)?.read(within, wanted, progress);
        self.note_warnings(file);
        let mut particles = result?;
        particles.radius = std::mem::take(&mut particles.radius).simplified();
        Ok(particles)
    }

    /// The file of a frame and the frame's number in it. Counts the files before it and no more.
    fn locate(&mut self, frame: usize, progress: Progress<'_>) -> Result<(usize, usize)> {
        let last = self.paths.len() - 1;
        // Every file before holds a frame at least, so that no more than `frame` need counting; one
        // that was just read through is best counted by its own reader.
        let unknown = self.counts[..last.min(frame)].iter().filter(|c| c.is_none()).count();
        if unknown > 1 {
            self.count_up_to(last.min(frame), progress)?;
        }
        let mut before = 0;
        for file in 0..last {
            if frame == before && self.counts[file] != Some(0) {
                return Ok((file, 0));
            }
            let count = self.count(file, progress)?;
            if frame < before + count {
                return Ok((file, frame - before));
            }
            before += count;
        }
        Ok((last, frame - before))
    }

    /// Whether frame `frame` may exist, as far as is known.
    fn may_hold(&self, frame: usize) -> bool {
        let known: Option<usize> = self.counts.iter().copied().sum();
        known.is_none_or(|all| frame < all)
    }

    fn total(&mut self, progress: Progress<'_>) -> Result<usize> {
        let last = self.paths.len() - 1;
        if last > 0 {
            self.count_up_to(last, progress)?;
        }
        if let Err(error) = self.count(last, progress) {
            if last == 0 {
                return Err(error);
            }
            self.counts[last] = Some(0);
            self.warn(format!("left out: {error}"));
        }
        Ok(self.counts.iter().flatten().sum())
    }

    /// Counts the frames of one file with its own reader.
    fn count(&mut self, file: usize, progress: Progress<'_>) -> Result<usize> {
        if let Some(count) = self.counts[file] {
            return Ok(count);
        }
        let count = self.reader(file)?.count(progress)?;
        self.counts[file] = Some(count);
        self.note_warnings(file);
        Ok(count)
    }

    /// Counts the frames of all files before `end`, several at a time.
    fn count_up_to(&mut self, end: usize, progress: Progress<'_>) -> Result<()> {
        let unknown: Vec<usize> = (0..end).filter(|file| self.counts[*file].is_none()).collect();
        let step = 4 * rayon::current_num_threads();
        for (done, files) in unknown.chunks(step).enumerate() {
            progress((done * step) as u64, unknown.len() as u64);
            let (paths, opener) = (&self.paths, &self.opener);
            let count = |file: &usize| {
                let (_, mut reader) = opener(&paths[*file])?;
                Ok((*file, reader.count(&|_, _| {})?, reader.warnings()))
            };
            for counted in files.par_iter().map(count).collect::<Vec<Result<_>>>() {
                let (file, count, warnings) = counted?;
                self.counts[file] = Some(count);
                warnings.into_iter().for_each(|warning| self.warn_of(file, warning));
            }
        }
        Ok(())
    }

    /// The reader of a file, opened if need be.
    fn reader(&mut self, file: usize) -> Result<&mut dyn Reader> {
        let entry = match self.open.iter().position(|(open, _)| *open == file) {
            Some(at) => self.open.remove(at),
            None => None,
        };
        let entry = match entry {
            Some(entry) => entry,
            None => (file, (self.opener)(&self.paths[file])?.1),
        };
        self.open.push_front(entry);
        self.open.truncate(OPEN_FILES);
        Ok(&mut *self.open[0].1)
    }

    fn note_warnings(&mut self, file: usize) {
        let reader = self.open.iter().find(|(open, _)| *open == file);
        let warnings = reader.map(|(_, reader)| reader.warnings()).unwrap_or_default();
        warnings.into_iter().for_each(|warning| self.warn_of(file, warning));
    }

    /// Adds a reader's warning; of several files it says which.
    fn warn_of(&mut self, file: usize, warning: String) {
        let path = self.paths[file].display().to_string();
        let named = self.paths.len() == 1 || warning.contains(&path);
        self.warn(if named { warning } else { format!("{path}: {warning}") });
    }

    fn warn(&mut self, warning: String) {
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }
}

#[cfg(test)]
#[path = "series_tests.rs"]
mod tests;
