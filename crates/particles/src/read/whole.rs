//! Formats that are one frame a file, read as a whole.

use std::path::Path;

use super::{Input, Progress, Reader, Wanted, only_frame};
use crate::{Particles, Result};

/// Makes the particles of a file's content, and says what was odd.
type Parse = fn(&Path, &[u8], &Wanted) -> Result<(Particles, Vec<String>)>;

/// A file that is one frame.
pub(super) struct WholeFile {
    input: Input,
    parse: Parse,
    warnings: Vec<String>,
}

impl WholeFile {
    pub(super) fn new(input: Input, parse: Parse) -> Self {
        Self { input, parse, warnings: vec![] }
    }
}

impl Reader for WholeFile {
    fn count(&mut self, _: Progress<'_>) -> Result<usize> {
        Ok(1)
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        let path = self.input.path();
        only_frame(path, frame)?;
        let all = self.input.stored_bytes();
        progress(0, all);
        let bytes = self.input.read(0, u64::MAX)?;
        let (particles, warnings) = (self.parse)(path, &bytes, wanted)?;
        self.warnings = warnings;
        progress(all, all);
        Ok(particles)
    }

    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }
}
