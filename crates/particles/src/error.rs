//! What went wrong while reading: file, place, what was expected and what stood there.

use std::fmt;
use std::path::{Path, PathBuf};

/// The result of reading.
pub type Result<T> = std::result::Result<T, ReadError>;

/// Where in a file an error lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole (it cannot be opened, its format is unknown …).
    Whole,
    /// A line of text, counted from 1.
    Line(u64),
    /// A byte offset, counted from 0, in the decompressed content.
    Byte(u64),
    /// A frame, counted from 0.
    Frame(usize),
}

/// An error in a file, fit to be shown to the user as it is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct ReadError {
    /// The file, as the user named it.
    pub path: PathBuf,
    /// Where in the file.
    pub place: Place,
    /// What was expected and what stood there.
    pub message: String,
}

impl ReadError {
    /// An error of `path` at `place`.
    pub fn new(path: impl AsRef<Path>, place: Place, message: impl Into<String>) -> Self {
        Self { path: path.as_ref().to_path_buf(), place, message: message.into() }
    }

    /// An error of the operating system about the file as a whole.
    pub fn io(path: impl AsRef<Path>, error: &std::io::Error) -> Self {
        Self::new(path, Place::Whole, error.to_string())
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.path.display())?;
        match self.place {
            Place::Whole => {}
            Place::Line(line) => write!(f, "line {line}: ")?,
            Place::Byte(byte) => write!(f, "byte {byte}: ")?,
            Place::Frame(frame) => write!(f, "frame {frame}: ")?,
        }
        f.write_str(&self.message)
    }
}
