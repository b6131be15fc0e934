//! Files that are there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::{FrameError, Result};

/// A file that is being written under a temporary name beside its own. [`Unfinished::finish`] gives it
/// its own; dropped before, it is gone.
///
/// Whoever looks at the path sees the old file or the whole new one; if anything fails, the old one stays.
#[derive(Debug)]
pub struct Unfinished {
    out: BufWriter<File>,
    temporary: PathBuf,
    path: PathBuf,
}

impl Unfinished {
    /// Begins the file `path`.
    ///
    /// # Errors
    /// Those of the file system, with the file's name.
    pub fn create(path: &Path) -> Result<Self> {
        let (file, temporary) = create_beside(path).map_err(|e| file_failed(path, e))?;
        let out = BufWriter::with_capacity(1 << 20, file);
        Ok(Self { out, temporary, path: path.into() })
    }

    /// Where its content goes.
    pub fn out(&mut self) -> &mut BufWriter<File> {
        &mut self.out
    }

    /// The name it will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// Those of the file system, with the file's name.
    pub fn finish(mut self) -> Result<()> {
        let flushed = self.out.flush();
        let named = flushed.and_then(|()| fs::rename(&self.temporary, &self.path));
        named.map_err(|e| file_failed(&self.path, e))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        // Once it has its name there is nothing here; and the first error is the one to tell.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// Writes a file through `content`, as an [`Unfinished`] one.
///
/// # Errors
///
/// Those of the file system and of `content`, each with the file's name.
pub fn save(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let mut file = Unfinished::create(path)?;
    content(file.out())
        .map_err(|source| FrameError::Content { path: path.to_owned(), source: source.into() })?;
    file.finish()
}

fn file_failed(path: &Path, source: std::io::Error) -> FrameError {
    FrameError::File { path: path.to_owned(), source }
}

/// A new file in the directory of `path`, under a name that nobody has.
fn create_beside(path: &Path) -> std::io::Result<(File, PathBuf)> {
    let name = path.file_name().ok_or(std::io::Error::new(
        ErrorKind::InvalidInput,
        "expected the name of a file, found a directory",
    ))?;
    let mut attempt = 0;
    loop {
        let mut temporary = std::ffi::OsString::from(".");
        temporary.push(name);
        temporary.push(format!(".{}-{attempt}.part", std::process::id()));
        let temporary = path.with_file_name(temporary);
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists && attempt < 1000 => attempt += 1,
            opened => return opened.map(|file| (file, temporary)),
        }
    }
}
