//! Reading forward through a file, whether it is compressed or not.

use std::io::Read;

use super::Input;
use crate::{Place, ReadError, Result};

/// Size of the steps in which memory is given to content of unknown length.
const STEP_BYTES: usize = 4 << 20;

/// An input and the stream last read from it: going on forward, even through a compressed file, never
/// starts again from the beginning.
pub(crate) struct Forward {
    input: Input,
    stream: Option<Box<dyn Read + Send>>,
    at: u64,
    /// Why compressed data ended early.
    broken: Option<String>,
}

impl Forward {
    /// Nothing is read yet.
    pub(crate) fn new(input: Input) -> Self {
        Self { input, stream: None, at: 0, broken: None }
    }

    /// The file.
    pub(crate) fn input(&self) -> &Input {
        &self.input
    }

    /// The offset of the next byte.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Why the compressed data ended early, if it did; to the readers it is the end of the content.
    pub(crate) fn broken(&self) -> Option<&str> {
        self.broken.as_deref()
    }

    /// Goes to byte `offset` of the content, or to its end if that comes first.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<()> {
        let plain = self.input.content_bytes().is_some();
        if self.broken.is_some() {
            self.stream = None;
        }
        if self.stream.is_some() && self.at <= offset && (!plain || self.at == offset) {
            return self.skip(offset - self.at).map(|_| ());
        }
        self.stream = Some(self.input.stream(offset)?);
        self.at = offset;
        Ok(())
    }

    /// Passes over `bytes` bytes; gives how many there were.
    pub(crate) fn skip(&mut self, bytes: u64) -> Result<u64> {
        if self.input.content_bytes().is_some() && bytes > STEP_BYTES as u64 {
            let all = self.input.stored_bytes();
            let there = all.saturating_sub(self.at).min(bytes);
            self.stream = None;
            self.seek(self.at + there)?;
            return Ok(there);
        }
        let start = self.at;
        let mut skipped = Vec::new();
        while self.at - start < bytes {
            let left = bytes - (self.at - start);
            self.read_into(&mut skipped, left.min(STEP_BYTES as u64) as usize)?;
            if skipped.is_empty() {
                break;
            }
        }
        Ok(self.at - start)
    }

    /// Replaces `out` by the next `bytes` bytes, fewer at the end of the content.
    pub(crate) fn read_into(&mut self, out: &mut Vec<u8>, bytes: usize) -> Result<()> {
        out.clear();
        self.read_more(out, bytes)
    }

    /// Appends the next `bytes` bytes, fewer at the end of the content. Memory grows with what is there.
    pub(crate) fn read_more(&mut self, out: &mut Vec<u8>, bytes: usize) -> Result<()> {
        let stream = self.opened()?;
        let before = out.len();
        out.reserve(bytes.min(STEP_BYTES));
        let outcome = stream.take(bytes as u64).read_to_end(out);
        self.at += (out.len() - before) as u64;
        match outcome {
            Err(e) if self.input.content_bytes().is_none() => self.broken = Some(e.to_string()),
            Err(e) => return Err(ReadError::io(self.input.path(), &e)),
            Ok(_) => {}
        }
        Ok(())
    }

    /// As [`Forward::read_into`]; an error where the content ends before.
    pub(crate) fn read_exactly(
        &mut self,
        out: &mut Vec<u8>,
        bytes: usize,
        what: &str,
    ) -> Result<()> {
        let start = self.at;
        self.read_into(out, bytes)?;
        if out.len() == bytes {
            return Ok(());
        }
        let why = self.broken.as_ref().map(|why| format!(" ({why})")).unwrap_or_default();
        let there = out.len();
        let message =
            format!("expected {bytes} bytes of {what}, but the file ends after {there}{why}");
        Err(ReadError::new(self.input.path(), Place::Byte(start), message))
    }

    fn opened(&mut self) -> Result<&mut Box<dyn Read + Send>> {
        let stream = match self.stream.take() {
            Some(stream) => stream,
            None => self.input.stream(self.at)?,
        };
        Ok(self.stream.insert(stream))
    }
}
