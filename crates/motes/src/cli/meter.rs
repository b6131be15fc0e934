//! A progress bar, where there is a terminal to see it and work that is worth it.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use motes::Watch;

use super::talk::Talk;

/// Work that takes less is done before one has read about it.
const WORTH: Duration = Duration::from_secs(1);

/// Parts of a picture in the bar of a film.
const PARTS: u64 = 100;

/// Shows long work on stderr, and ends it when the user has had enough.
pub(crate) struct Meter {
    state: Option<Mutex<State>>,
    cancelled: Arc<AtomicBool>,
}

struct State {
    /// Which picture of a film, of how many.
    film: Option<(u64, u64)>,
    stage: &'static str,
    since: Instant,
    bar: Option<ProgressBar>,
}

impl Meter {
    /// A meter that shows nothing where the user wants quiet or stderr is no terminal.
    pub fn new(talk: Talk) -> Self {
        let shown = !talk.quiet && std::io::stderr().is_terminal();
        let state = || State { film: None, stage: "", since: Instant::now(), bar: None };
        let cancelled = Arc::new(AtomicBool::new(false));
        let asked = cancelled.clone();
        // Without a handler the system ends it, and leaves an unfinished file.
        let _ = ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
        Self { state: shown.then(|| Mutex::new(state())), cancelled }
    }

    /// From here on one bar is for all pictures of a film.
    pub fn picture(&self, picture: usize, pictures: usize) {
        if let Some(mut state) = self.state.as_ref().and_then(|state| state.lock().ok()) {
            state.film = (pictures > 1).then_some((picture as u64, pictures as u64));
            state.tell("render", 0, 1);
        }
    }

    /// Takes the bar away, for other lines.
    pub fn clear(&self) {
        if let Some(mut state) = self.state.as_ref().and_then(|state| state.lock().ok()) {
            state.begin("");
        }
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        self.clear();
    }
}

impl Watch for Meter {
    fn progress(&self, stage: &'static str, done: u64, total: u64) -> bool {
        // Whoever finds another thread telling has nothing to add.
        if let Some(mut state) = self.state.as_ref().and_then(|state| state.try_lock().ok()) {
            state.tell(stage, done, total);
        }
        !self.cancelled.load(Ordering::Relaxed)
    }
}

impl State {
    fn begin(&mut self, stage: &'static str) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
        (self.stage, self.since) = (stage, Instant::now());
    }

    fn tell(&mut self, stage: &'static str, done: u64, total: u64) {
        let (stage, done, total) = match self.film {
            Some((picture, pictures)) if stage == "render" => {
                ("film", picture * PARTS + PARTS * done / total.max(1), pictures * PARTS)
            }
            Some(_) => return,
            None => (stage, done, total),
        };
        if self.stage != stage {
            self.begin(stage);
        }
        if self.bar.is_none() && self.since.elapsed() > WORTH {
            let style = ProgressStyle::with_template("{msg:8} [{bar:40}] {percent:>3} %  {eta}");
            let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(total).with_style(style.progress_chars("=> "));
            self.bar = Some(bar.with_message(stage));
        }
        if let Some(bar) = &self.bar {
            bar.set_length(total);
            bar.set_position(done);
        }
    }
}
