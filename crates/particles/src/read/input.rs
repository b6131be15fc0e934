//! A file, or bytes that are built in, as a stream, decompressed on the way.

use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::inflate;
use crate::{Place, ReadError, Result};

/// How many decompressed bytes a format sees to recognise a file.
const HEAD_BYTES: u64 = 64 * 1024;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    None,
    Gzip,
    Zstd,
}

/// What a format sees of a file before it opens it.
#[derive(Clone, Copy, Debug)]
pub struct Head<'a> {
    /// The file's name in lower case, without directories and without `.gz` or `.zst`.
    pub name: &'a str,
    /// The first 64 KiB, decompressed.
    pub bytes: &'a [u8],
    /// Whether `bytes` is the whole content.
    pub whole: bool,
}

impl Head<'_> {
    /// Whether the file's name ends in `.` and one of `extensions`.
    pub fn has_extension(&self, extensions: &[&str]) -> bool {
        self.name.rsplit_once('.').is_some_and(|(_, ext)| extensions.contains(&ext))
    }

    /// The lines that are complete, without their ends; bytes that are not UTF-8 are replaced.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        let end = if self.whole {
            self.bytes.len()
        } else {
            memchr::memrchr(b'\n', self.bytes).unwrap_or(self.bytes.len())
        };
        self.bytes[..end]
            .split(|b| *b == b'\n')
            .map(|line| String::from_utf8_lossy(line).trim_end_matches('\r').to_owned())
    }
}

/// Where stored bytes come from.
trait Stored: Read + Seek + Send {}
impl<T: Read + Seek + Send> Stored for T {}

/// An open file. Cheap to hold: nothing but the head stays in memory.
#[derive(Debug)]
pub struct Input {
    path: PathBuf,
    /// The content, where it is built in and no file.
    built_in: Option<&'static [u8]>,
    name: String,
    compression: Compression,
    stored_bytes: u64,
    head: Vec<u8>,
    whole: bool,
}

impl Input {
    /// Opens `path` and looks at its first bytes. Gzip and Zstandard are known by their signatures.
    ///
    /// # Errors
    /// The file cannot be opened or read, is a directory, or its compressed data is broken from the
    /// first byte on.
    pub fn open(path: &Path) -> Result<Self> {
        Self::new(path, None)
    }

    /// Content that is built into the program, under the name that errors and formats see.
    ///
    /// # Errors
    /// Its compressed data is broken.
    pub fn of_bytes(name: &str, bytes: &'static [u8]) -> Result<Self> {
        Self::new(Path::new(name), Some(bytes))
    }

    fn new(path: &Path, built_in: Option<&'static [u8]>) -> Result<Self> {
        let io = |e: std::io::Error| ReadError::io(path, &e);
        let stored_bytes = match built_in {
            Some(bytes) => bytes.len() as u64,
            None => file_bytes(path)?,
        };
        let mut stored = stored(path, built_in).map_err(io)?;
        let mut magic = [0; 4];
        let mut seen = 0;
        while seen < 4 {
            match stored.read(&mut magic[seen..]).map_err(io)? {
                0 => break,
                n => seen += n,
            }
        }
        let compression = match magic[..seen] {
            [0x1f, 0x8b, ..] => Compression::Gzip,
            // A frame, or a skippable frame before one.
            [0x28, 0xb5, 0x2f, 0xfd] | [0x50..=0x5f, 0x2a, 0x4d, 0x18] => Compression::Zstd,
            _ => Compression::None,
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let name = match compression {
            Compression::None => name,
            _ => name.trim_end_matches(".gz").trim_end_matches(".zst").to_owned(),
        };
        let (path, head, whole) = (path.into(), vec![], false);
        let mut input = Self { path, built_in, name, compression, stored_bytes, head, whole };
        let (head, broken) = input.start(HEAD_BYTES + 1)?;
        input.whole = head.len() as u64 <= HEAD_BYTES && broken.is_none();
        input.head = head;
        input.head.truncate(HEAD_BYTES as usize);
        Ok(input)
    }

    /// The path as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The first bytes and the name.
    pub fn head(&self) -> Head<'_> {
        Head { name: &self.name, bytes: &self.head, whole: self.whole }
    }

    /// Bytes on disk.
    pub fn stored_bytes(&self) -> u64 {
        self.stored_bytes
    }

    /// Bytes of content where the file is stored as it is; `None` where it is compressed.
    pub fn content_bytes(&self) -> Option<u64> {
        (self.compression == Compression::None).then_some(self.stored_bytes)
    }

    /// The content from byte `offset` on (an offset in decompressed content; a compressed file is
    /// decompressed up to there, in bounded memory).
    ///
    /// # Errors
    /// The file cannot be opened, or ends before `offset` in a broken stream.
    pub fn stream(&self, offset: u64) -> Result<Box<dyn Read + Send>> {
        let io = |e: std::io::Error| ReadError::io(&self.path, &e);
        let mut stored = stored(&self.path, self.built_in).map_err(io)?;
        let mut stream: Box<dyn Read + Send> = match self.compression {
            Compression::None => {
                stored.seek(SeekFrom::Start(offset)).map_err(io)?;
                return Ok(Box::new(stored));
            }
            Compression::Gzip => inflate::gzip(stored),
            Compression::Zstd => inflate::zstd(stored),
        };
        std::io::copy(&mut stream.by_ref().take(offset), &mut std::io::sink()).map_err(io)?;
        Ok(stream)
    }

    /// The first `bytes` bytes of the content; fewer where the file ends before, or its compressed data
    /// breaks off, and then why.
    ///
    /// # Errors
    /// The operating system's, or compressed data without a sound byte.
    pub(super) fn start(&self, bytes: u64) -> Result<(Vec<u8>, Option<String>)> {
        let mut out = Vec::new();
        match self.stream(0)?.take(bytes).read_to_end(&mut out) {
            Ok(_) => Ok((out, None)),
            Err(e) if self.content_bytes().is_none() && !out.is_empty() => {
                Ok((out, Some(e.to_string())))
            }
            Err(e) => Err(ReadError::io(&self.path, &e)),
        }
    }

    /// The content from `offset`, `bytes` long; fewer where the file ends before.
    ///
    /// Memory grows with what is there, not with what is asked for.
    ///
    /// # Errors
    /// As [`Input::stream`].
    pub fn read(&self, offset: u64, bytes: u64) -> Result<Vec<u8>> {
        let mut out = Vec::new();
        if let Some(all) = self.content_bytes() {
            let there = all.saturating_sub(offset).min(bytes);
            out.reserve_exact(usize::try_from(there).unwrap_or(0));
        }
        self.stream(offset)?
            .take(bytes)
            .read_to_end(&mut out)
            .map_err(|e| ReadError::io(&self.path, &e))?;
        Ok(out)
    }
}

/// The size of the file at `path`. A pipe is refused: it cannot be read twice, and may never begin.
fn file_bytes(path: &Path) -> Result<u64> {
    let kind = std::fs::metadata(path).map_err(|e| ReadError::io(path, &e))?;
    let found = match (kind.is_file(), kind.is_dir()) {
        (true, _) => return Ok(kind.len()),
        (false, true) => "a directory",
        (false, false) => "a pipe or a device",
    };
    Err(ReadError::new(path, Place::Whole, format!("expected a file, found {found}")))
}

fn stored(path: &Path, built_in: Option<&'static [u8]>) -> std::io::Result<Box<dyn Stored>> {
    Ok(match built_in {
        Some(bytes) => Box::new(Cursor::new(bytes)),
        None => Box::new(File::open(path)?),
    })
}
