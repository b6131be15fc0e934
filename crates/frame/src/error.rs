//! What can go wrong between a frame and its bytes.

use std::path::PathBuf;

/// The result of this crate's fallible functions.
pub type Result<T, E = FrameError> = std::result::Result<T, E>;

/// Why a frame could not be made, written or read.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// A layer with another number of pixels than its frame.
    #[error("layer `{layer}` of a {width}×{height} frame holds {found} pixels")]
    LayerSize {
        /// The layer's name.
        layer: &'static str,
        /// Width of the frame in pixels.
        width: usize,
        /// Height of the frame in pixels.
        height: usize,
        /// How many pixels the layer has.
        found: usize,
    },
    /// A layer that is needed and not there.
    #[error("the frame has no layer `{layer}`")]
    NoLayer {
        /// The layer's name.
        layer: &'static str,
    },
    /// Two pictures that cannot be compared pixel by pixel.
    #[error("expected a picture of {}×{} pixels, found {}×{}", .expected.0, .expected.1, .found.0, .found.1)]
    PictureSize {
        /// Width and height of the first picture.
        expected: (usize, usize),
        /// Width and height of the second picture.
        found: (usize, usize),
    },
    /// A size that a format cannot hold.
    #[error("{format} cannot hold a picture of {width}×{height} pixels")]
    Unwritable {
        /// The format's name.
        format: &'static str,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// A library refused to encode.
    #[error("writing {format}: {reason}")]
    Encode {
        /// The format's name.
        format: &'static str,
        /// What the encoder said.
        reason: String,
    },
    /// Bytes that are not the picture they should be.
    #[error("expected a PNG picture: {0}")]
    NotPng(String),
    /// A file that is not the image it should be.
    #[error("{}: expected an image (.hdr, .exr or .png): {reason}", .path.display())]
    NotAnImage {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file system said no.
    #[error("{}: {source}", .path.display())]
    File {
        /// The file that was to be written.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file's content could not be made.
    #[error("{}: {source}", .path.display())]
    Content {
        /// The file that was to be written.
        path: PathBuf,
        /// Why its content failed.
        source: Box<FrameError>,
    },
}

impl FrameError {
    /// For `map_err`: what an encoder of `format` said.
    pub(crate) fn encode<E: std::fmt::Display>(format: &'static str) -> impl Fn(E) -> FrameError {
        move |reason| FrameError::Encode { format, reason: reason.to_string() }
    }
}
