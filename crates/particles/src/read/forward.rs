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
}

impl Forward {
    /// Nothing is read yet.
    pub(crate) fn new(input: Input) -> Self {
        Self { input, stream: None, at: 0 }
    }

    /// The file.
    pub(crate) fn input(&self) -> &Input {
        &self.input
    }

    /// The offset of the next byte.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Goes to byte `offset` of the content, or to its end if that comes first.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<()> {
        let plain = self.input.content_bytes().is_some();
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
        let path = self.input.path().to_path_buf();
        let stream = self.opened()?;
        let skipped = std::io::copy(&mut stream.take(bytes), &mut std::io::sink())
            .map_err(|e| ReadError::io(path, &e))?;
        self.at += skipped;
        Ok(skipped)
    }

    /// Replaces `out` by the next `bytes` bytes, fewer at the end of the content.
    pub(crate) fn read_into(&mut self, out: &mut Vec<u8>, bytes: usize) -> Result<()> {
        out.clear();
        self.read_more(out, bytes)
    }

    /// Appends the next `bytes` bytes, fewer at the end of the content. Memory grows with what is there.
    pub(crate) fn read_more(&mut self, out: &mut Vec<u8>, bytes: usize) -> Result<()> {
        let path = self.input.path().to_path_buf();
        let stream = self.opened()?;
        let before = out.len();
        out.reserve(bytes.min(STEP_BYTES));
        stream.take(bytes as u64).read_to_end(out).map_err(|e| ReadError::io(path, &e))?;
        self.at += (out.len() - before) as u64;
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
        let message =
            format!("expected {bytes} bytes of {what}, but the file ends after {}", out.len());
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
