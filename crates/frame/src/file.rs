//! Files that are there whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::{FrameError, Result};

/// Writes a file through `content`, under a temporary name beside `path` that becomes `path` at the end.
///
/// Whoever looks at `path` sees the old file or the whole new one; if anything fails, the old one stays.
///
/// # Errors
///
/// Those of the file system and of `content`, each with the file's name.
pub fn save(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let file_failed = |source| FrameError::File { path: path.to_owned(), source };
    let (file, temporary) = create_beside(path).map_err(file_failed)?;
    let mut out = BufWriter::with_capacity(1 << 20, file);
    let written = content(&mut out)
        .map_err(|source| FrameError::Content { path: path.to_owned(), source: source.into() })
        .and_then(|()| out.flush().map_err(file_failed));
    drop(out);
    let done = written.and_then(|()| fs::rename(&temporary, path).map_err(file_failed));
    if done.is_err() {
        // The first error is the one to tell.
        let _ = fs::remove_file(&temporary);
    }
    done
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
