//! What can go wrong, and whose fault it is.

use motes_film::FilmError;

/// The result of Motes.
pub type Result<T> = std::result::Result<T, Error>;

/// An error, fit to be shown to the user as it is.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read.
    #[error(transparent)]
    Read(#[from] motes_particles::ReadError),
    /// The scene makes no sense.
    #[error(transparent)]
    Scene(#[from] motes_scene::SceneError),
    /// A file's scene makes no sense.
    #[error("{}: {error}", .path.display())]
    SceneFile {
        /// The file.
        path: std::path::PathBuf,
        /// What is wrong with its scene.
        error: motes_scene::SceneError,
    },
    /// A picture could not be written or read.
    #[error(transparent)]
    Frame(#[from] motes_frame::FrameError),
    /// A film could not be made.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// What was asked for makes no sense for this data.
    #[error("{0}")]
    Usage(String),
    /// The work was cancelled.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// The exit code: 2 for bad usage, 1 for bad data, 130 for what was cancelled.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_) | Self::SceneFile { .. } | Self::Usage(_) => 2,
            Self::Film(FilmError::TooLarge(_)) => 2,
            Self::Read(_) | Self::Frame(_) | Self::Film(_) => 1,
            Self::Cancelled => 130,
        }
    }
}
