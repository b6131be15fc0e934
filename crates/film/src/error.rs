//! What can go wrong with a film.

/// The result of this crate's fallible functions.
pub type Result<T, E = FilmError> = std::result::Result<T, E>;

/// Why there is no film.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// A picture of another size than the film's.
    #[error("expected a picture of {}×{} pixels, found {}×{}", .expected.0, .expected.1, .found.0, .found.1)]
    Size {
        /// Width and height of the film.
        expected: (usize, usize),
        /// Width and height of the picture.
        found: (usize, usize),
    },
    /// Pictures that H.264 has no level for.
    #[error("a film has at most 35 million pixels a picture, and 16880 a side; found {}×{}", .0.0, .0.1)]
    TooLarge((u32, u32)),
    /// The encoder said no.
    #[error("the encoder: {0}")]
    Encoder(String),
    /// The file could not be written.
    #[error(transparent)]
    File(#[from] motes_frame::FrameError),
}
