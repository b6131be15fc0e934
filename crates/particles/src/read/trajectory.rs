//! Trajectories in text: frames one after another, found as they are needed.

use super::rows::Stop;
use super::text::{Lines, Mark};
use super::{Input, Progress, Reader, Wanted};
use crate::{Particles, Place, ReadError, Result};

/// How one format lays out a frame.
pub(super) trait Layout: Send {
    /// What the lines before the particles say.
    type Header;

    /// Reads the lines before the particles; `None` where the file ends properly.
    fn header(&self, lines: &mut Lines) -> std::result::Result<Option<Self::Header>, Stop>;

    /// Goes past the particles.
    fn skip(&self, header: &Self::Header, lines: &mut Lines) -> std::result::Result<(), Stop>;

    /// Reads the particles.
    fn read(
        &self,
        header: &Self::Header,
        lines: &mut Lines,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> std::result::Result<Particles, Stop>;
}

/// A file of frames, each with a header.
///
/// # Invariants
/// `starts[i]` is where frame `i` begins; all but the last are whole. Where `ended`, nothing whole
/// begins at the last.
pub(super) struct Trajectory<L> {
    layout: L,
    lines: Lines,
    starts: Vec<Mark>,
    ended: bool,
    warning: Option<String>,
}

impl<L: Layout> Trajectory<L> {
    /// The frames of `input`; refuses a file whose first header is broken.
    ///
    /// # Errors
    /// There is no frame, or its header is broken.
    pub(super) fn open(layout: L, input: Input) -> Result<Self> {
        let mut lines = Lines::new(input);
        if layout.header(&mut lines)?.is_none() {
            return Err(ReadError::new(
                lines.input().path(),
                Place::Whole,
                "expected a frame, found none",
            ));
        }
        let starts = vec![Mark::START];
        Ok(Self { layout, lines, starts, ended: false, warning: None })
    }

    fn whole(&self) -> usize {
        self.starts.len() - 1
    }

    /// Goes to the first frame that is not known to be whole, and has `body` deal with its particles.
    fn next_frame<T>(
        &mut self,
        body: impl FnOnce(&L, &L::Header, &mut Lines) -> std::result::Result<T, Stop>,
    ) -> Result<Option<T>> {
        let Some(start) = self.starts.last().copied().filter(|_| !self.ended) else {
            return Ok(None);
        };
        self.lines.go_to(start)?;
        let outcome = match self.layout.header(&mut self.lines) {
            Ok(Some(header)) => body(&self.layout, &header, &mut self.lines).map(Some),
            Ok(None) => Ok(None),
            Err(stop) => Err(stop),
        };
        match outcome {
            Ok(Some(result)) => {
                self.starts.push(self.lines.mark());
                return Ok(Some(result));
            }
            Ok(None) => {
                self.warning = self
                    .lines
                    .broken()
                    .map(|why| format!("the compressed data ends early ({why})"));
            }
            Err(Stop::Cut(error)) if self.whole() > 0 => {
                let frame = self.whole();
                self.warning = Some(format!("{error}; frame {frame}, the last, is incomplete"));
            }
            Err(stop) => return Err(stop.into()),
        }
        self.ended = true;
        Ok(None)
    }

    fn skip_frame(&mut self, progress: Progress<'_>) -> Result<bool> {
        let found = self.next_frame(|layout, header, lines| layout.skip(header, lines))?.is_some();
        let (done, all) = self.lines.progress();
        progress(done, all);
        Ok(found)
    }
}

impl<L: Layout> Reader for Trajectory<L> {
    fn count(&mut self, progress: Progress<'_>) -> Result<usize> {
        while self.skip_frame(progress)? {}
        Ok(self.whole())
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        while self.whole() < frame && self.skip_frame(progress)? {}
        if frame < self.whole() {
            self.lines.go_to(self.starts[frame])?;
            let header = self.layout.header(&mut self.lines)?;
            let header = header.ok_or_else(|| self.missing(frame))?;
            return Ok(self.layout.read(&header, &mut self.lines, wanted, progress)?);
        }
        let read =
            self.next_frame(|layout, header, lines| layout.read(header, lines, wanted, progress))?;
        read.ok_or_else(|| self.missing(frame))
    }

    fn warnings(&self) -> Vec<String> {
        self.warning.iter().cloned().collect()
    }
}

impl<L: Layout> Trajectory<L> {
    fn missing(&self, frame: usize) -> ReadError {
        let found = self.whole();
        let mut message = format!("there is no such frame; the file has {found}");
        if let Some(warning) = &self.warning {
            message = format!("{message} ({warning})");
        }
        ReadError::new(self.lines.input().path(), Place::Frame(frame), message)
    }
}
