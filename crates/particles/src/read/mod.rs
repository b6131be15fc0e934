//! The readers: one file per format, each by the format's own specification.
//!
//! A [`Format`] recognises a file by its content (its name only breaks ties) and opens it as a
//! [`Reader`], which gives frames by number. To add a format, write `read/<format>.rs`, list it in
//! [`FORMATS`], and its tests beside it.
//!
//! # What every reader promises
//! - Nothing in a file makes it panic, hang, or take memory out of proportion to the file: a count
//!   declared in a file is checked against what is there before memory is reserved for it.
//! - Frames are found lazily: frame 0 of a 100 GB trajectory does not read to its end.
//! - Columns carry the field's standard names ([`names`]); those it does not know keep their own.
//! - An incomplete last frame is a warning, and the whole frames before it are served.

mod dictionary;
mod dump;
mod elements;
mod fields;
mod forward;
mod houdini;
mod inflate;
mod input;
mod lanes;
mod legacy_vtk;
pub mod names;
mod numpy;
mod pdb;
mod ply;
mod rows;
mod table;
mod text;
mod trajectory;
mod whole;
mod xyz;

pub use input::{Head, Input};

use std::path::Path;

use crate::{Particles, Place, ReadError, Result};

/// The most components a column has.
const MOST_COMPONENTS: usize = 9;

/// How sure a format is that a file is its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Confidence {
    /// It is not.
    No,
    /// The content would do and nothing speaks against it (bare tables of numbers).
    Perhaps,
    /// Content and file name fit.
    Likely,
    /// A signature or header that nothing else has.
    Certain,
}

/// A file format.
pub trait Format: Sync {
    /// What users call it: `LAMMPS dump`, `legacy VTK`.
    fn name(&self) -> &'static str;
    /// How sure it is, from the first bytes and the name.
    fn recognise(&self, head: &Head<'_>) -> Confidence;
    /// Opens the file; reads no more than it needs to know that it can.
    ///
    /// # Errors
    /// The header is broken.
    fn open(&self, input: Input) -> Result<Box<dyn Reader>>;
}

/// Which columns are wanted.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Wanted {
    /// All of them.
    #[default]
    All,
    /// These, by standard name, in any case and with or without blanks; a reader may give more where
    /// leaving out saves nothing.
    Only(Vec<String>),
}

impl Wanted {
    /// Whether column `name` is wanted.
    pub fn wants(&self, name: &str) -> bool {
        match self {
            Self::All => true,
            Self::Only(names) => names.iter().any(|n| names::same(n, name)),
        }
    }
}

/// Is told of long work: bytes done and bytes in all.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) + Sync);

/// An open file of one format.
pub trait Reader: Send {
    /// How many whole frames there are. Scans to the end of the file the first time.
    ///
    /// # Errors
    /// The operating system's, and content between frames that is no frame.
    fn count(&mut self, progress: Progress<'_>) -> Result<usize>;

    /// Reads frame `frame`, counted from 0.
    ///
    /// # Errors
    /// Broken content, or no such frame.
    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles>;

    /// What was odd but could be read: an incomplete last frame, a count that does not agree.
    fn warnings(&self) -> Vec<String> {
        Vec::new()
    }
}

/// All formats, in the order they are asked; a tie goes to the earlier. Tables, which any text may look
/// like, come last.
#[rustfmt::skip] // one a line
pub static FORMATS: &[&dyn Format] = &[
    &dump::LammpsDump,
    &xyz::Xyz,
    &pdb::Pdb,
    &ply::Ply,
    &numpy::Npy,
    &numpy::Npz,
    &legacy_vtk::LegacyVtk,
    &houdini::Houdini,
    &table::Table,
];

/// Opens a file with the format that recognises it best; gives the format's name and the reader.
///
/// # Errors
/// The file cannot be read, is empty, or no format recognises it.
pub fn open(path: &Path) -> Result<(&'static str, Box<dyn Reader>)> {
    open_input(Input::open(path)?)
}

/// Opens `input` as [`open`] does.
///
/// # Errors
/// It is empty, or no format recognises it.
pub fn open_input(input: Input) -> Result<(&'static str, Box<dyn Reader>)> {
    let path = input.path();
    if input.head().bytes.is_empty() {
        return Err(ReadError::new(path, Place::Whole, "the file is empty"));
    }
    let best = FORMATS
        .iter()
        .map(|format| (format.recognise(&input.head()), format))
        .reduce(|best, next| if next.0 > best.0 { next } else { best })
        .filter(|(confidence, _)| *confidence > Confidence::No);
    match best {
        Some((_, format)) => Ok((format.name(), format.open(input)?)),
        None => {
            let known: Vec<_> = FORMATS.iter().map(|f| f.name()).collect();
            let message = format!("no known format; Motes reads {}", known.join(", "));
            Err(ReadError::new(path, Place::Whole, message))
        }
    }
}

/// Refuses all but frame 0 of a file that is one frame.
fn only_frame(path: &Path, frame: usize) -> Result<()> {
    match frame {
        0 => Ok(()),
        _ => Err(ReadError::new(
            path,
            Place::Frame(frame),
            "there is no such frame; the file is one",
        )),
    }
}
