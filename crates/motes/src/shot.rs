//! What a picture is of: a frame, and when in a film.

use motes_scene::{Moment, Scene};

/// What a picture is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// The frame of the sources.
    pub frame: usize,
    /// When in a film, for a camera that moves in one; none: it stands.
    pub moment: Option<Moment>,
}

impl From<usize> for Shot {
    /// A frame, before a camera that stands.
    fn from(frame: usize) -> Self {
        Self { frame, moment: None }
    }
}

/// Seconds of a film of a single frame, where nothing else is said.
const STILL_SECONDS: f64 = 8.0;

impl Shot {
    /// The pictures of a film of some frames, as many as the scene says.
    pub fn film(scene: &Scene, frames: std::ops::RangeInclusive<usize>) -> Vec<Self> {
        let (first, last) = (*frames.start(), *frames.end());
        let frames = (last + 1).saturating_sub(first);
        let pictures = match scene.film.frames {
            Some(pictures) => pictures as usize,
            None if frames == 1 && scene.camera.moves() => {
                (STILL_SECONDS * scene.film.fps).ceil() as usize
            }
            None => frames,
        };
        let shot = |picture| Self {
            frame: first + picture * frames / pictures,
            moment: Some(Moment { picture, pictures }),
        };
        (0..pictures).map(shot).collect()
    }
}
