//! Which frame is shown when, while frame follows frame.

use std::time::{Duration, Instant};

/// How frame follows frame, as it was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Play {
    /// Frames a second.
    pub fps: f64,
    /// Whether the first frame follows the last.
    pub around: bool,
    /// Whether frames are left out where they would come late.
    pub drop: bool,
}

/// A film that runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Running {
    pub play: Play,
    /// The frame that is shown, and since when; with `drop` that is when it was due.
    frame: u32,
    since: Instant,
}

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Turn {
    /// This frame.
    Frame(u32),
    /// Nothing yet; then probably this frame.
    Wait(Duration, u32),
    /// Nothing any more.
    End,
}

impl Running {
    pub fn new(play: Play, frame: u32, now: Instant) -> Self {
        Self { play, frame, since: now }
    }

    fn each(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.play.fps)
    }

    /// What comes next, of `frames` in all.
    pub fn turn(&self, frames: u32, now: Instant) -> Turn {
        let each = self.each();
        let passed = now.saturating_duration_since(self.since);
        let steps = match self.play.drop {
            true => (passed.as_secs_f64() * self.play.fps) as u32,
            false => 1,
        };
        let next = self.frame.saturating_add(steps.max(1));
        let frames = frames.max(1);
        let next = match (next < frames, self.play.around) {
            (true, _) => next,
            (false, true) => next % frames,
            (false, false) if self.frame + 1 < frames => frames - 1,
            (false, false) if passed < each => return Turn::Wait(each - passed, self.frame),
            (false, false) => return Turn::End,
        };
        if passed < each { Turn::Wait(each - passed, next) } else { Turn::Frame(next) }
    }

    /// Frame `frame` is shown.
    pub fn show(&mut self, frame: u32, now: Instant) {
        let due = self.since + self.each() * frame.saturating_sub(self.frame).max(1);
        // What is late stays late, but is not made up for; around the end a new round begins.
        let late = frame <= self.frame || now.saturating_duration_since(due) > self.each();
        (self.frame, self.since) = (frame, if late { now } else { due });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn running(around: bool, drop: bool) -> (Running, Instant) {
        let now = Instant::now();
        (Running::new(Play { fps: 10.0, around, drop }, 0, now), now)
    }

    const MS: Duration = Duration::from_millis(1);

    /// Goes on, as fast as frames can be shown.
    fn step(film: &mut Running, frames: u32, now: Instant) -> Turn {
        let turn = film.turn(frames, now);
        if let Turn::Frame(frame) = turn {
            film.show(frame, now);
        }
        turn
    }

    #[test]
    fn frames_come_in_time_and_the_last_ends_it() {
        let (mut film, start) = running(false, false);
        assert_eq!(step(&mut film, 3, start + 40 * MS), Turn::Wait(60 * MS, 1));
        assert_eq!(step(&mut film, 3, start + 100 * MS), Turn::Frame(1));
        assert_eq!(step(&mut film, 3, start + 110 * MS), Turn::Wait(90 * MS, 2));
        assert_eq!(step(&mut film, 3, start + 210 * MS), Turn::Frame(2));
        assert_eq!(step(&mut film, 3, start + 290 * MS), Turn::Wait(10 * MS, 2));
        assert_eq!(step(&mut film, 3, start + 310 * MS), Turn::End);
    }

    #[test]
    fn late_frames_are_left_out_if_so_wished() {
        let (mut film, start) = running(true, true);
        assert_eq!(step(&mut film, 10, start + 350 * MS), Turn::Frame(3));
        assert_eq!(step(&mut film, 10, start + 350 * MS), Turn::Wait(50 * MS, 4));
        assert_eq!(step(&mut film, 10, start + 1200 * MS), Turn::Frame(2));
        let (mut film, start) = running(false, true);
        assert_eq!(step(&mut film, 10, start + 9999 * MS), Turn::Frame(9));
        assert_eq!(step(&mut film, 10, start + 99999 * MS), Turn::End);
    }

    #[test]
    fn every_frame_comes_if_none_may_be_left_out() {
        let (mut film, start) = running(true, false);
        let late = start + 5000 * MS;
        assert_eq!(step(&mut film, 3, late), Turn::Frame(1));
        assert_eq!(step(&mut film, 3, late + 100 * MS), Turn::Frame(2));
        assert_eq!(step(&mut film, 3, late + 200 * MS), Turn::Frame(0));
    }
}
