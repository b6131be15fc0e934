//! A progress bar, where there is a terminal to see it and work that is worth it.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use motes::Watch;

use super::talk::Talk;

/// Work that takes less is done before one has read about it.
const WORTH: Duration = Duration::from_secs(1);

/// Shows long work on stderr.
pub(crate) struct Meter(Option<Mutex<State>>);

struct State {
    stage: &'static str,
    since: Instant,
    bar: Option<ProgressBar>,
}

impl Meter {
    /// A meter that shows nothing where the user wants quiet or stderr is no terminal.
    pub fn new(talk: Talk) -> Self {
        let shown = !talk.quiet && std::io::stderr().is_terminal();
        let state = || Mutex::new(State { stage: "", since: Instant::now(), bar: None });
        Self(shown.then(state))
    }

    /// Takes the bar away, for other lines.
    pub fn clear(&self) {
        if let Some(mut state) = self.0.as_ref().and_then(|state| state.lock().ok()) {
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
        if let Some(mut state) = self.0.as_ref().and_then(|state| state.try_lock().ok()) {
            state.tell(stage, done, total);
        }
        true
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
