//! Text in blocks of whole lines, for formats that parse blocks in parallel.

use std::sync::Arc;

use memchr::{memchr_iter, memrchr};

use super::Input;
use super::forward::Forward;
use crate::{Place, ReadError, Result};

/// How much text is read at once.
const BLOCK_BYTES: usize = 8 << 20;
/// A longer line is no text.
const LONGEST_LINE_BYTES: usize = 16 << 20;

/// A file as blocks of whole lines; like [`std::io::BufRead`], one looks first and then consumes.
pub(crate) struct LineBlocks {
    forward: Forward,
    buffer: Vec<u8>,
    /// The whole lines in `buffer` that are not consumed.
    ready: std::ops::Range<usize>,
    /// Where the first of them stands.
    mark: Mark,
}

/// The start of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mark {
    pub(crate) byte: u64,
    /// Counted from 1; 0 before anything was read.
    pub(crate) line: u64,
}

impl LineBlocks {
    /// At the first line.
    pub(crate) fn new(input: Arc<Input>) -> Self {
        let mark = Mark { byte: 0, line: 1 };
        Self { forward: Forward::new(input), buffer: Vec::new(), ready: 0..0, mark }
    }

    /// The file.
    pub(crate) fn input(&self) -> &Input {
        self.forward.input()
    }

    /// Where the next line starts.
    pub(crate) fn mark(&self) -> Mark {
        self.mark
    }

    /// Goes to `mark`; within the text at hand, and forward through compressed files, nothing is read
    /// twice.
    pub(crate) fn seek(&mut self, mark: Mark) -> Result<()> {
        let ahead = mark.byte.checked_sub(self.mark.byte).and_then(|n| usize::try_from(n).ok());
        match ahead {
            Some(ahead) if ahead <= self.ready.len() => self.ready.start += ahead,
            _ => {
                self.buffer.clear();
                self.ready = 0..0;
                self.forward.seek(mark.byte)?;
            }
        }
        self.mark = mark;
        Ok(())
    }

    /// Whole lines that come next, at least one; empty at the end of the file.
    pub(crate) fn look(&mut self) -> Result<&[u8]> {
        if self.ready.is_empty() {
            self.fill()?;
        }
        Ok(&self.buffer[self.ready.clone()])
    }

    /// Passes over the first `bytes` bytes of what [`LineBlocks::look`] gave, `lines` lines.
    pub(crate) fn consume(&mut self, bytes: usize, lines: u64) {
        let bytes = bytes.min(self.ready.len());
        self.ready.start += bytes;
        self.mark = Mark { byte: self.mark.byte + bytes as u64, line: self.mark.line + lines };
    }

    fn fill(&mut self) -> Result<()> {
        self.buffer.drain(..self.ready.end);
        loop {
            let before = self.buffer.len();
            self.forward.read_more(&mut self.buffer, BLOCK_BYTES)?;
            let ended = self.buffer.len() - before < BLOCK_BYTES;
            let end = match memrchr(b'\n', &self.buffer[before..]) {
                _ if ended => self.buffer.len(),
                Some(newline) => before + newline + 1,
                None if self.buffer.len() > LONGEST_LINE_BYTES => {
                    let message = format!("a line of more than {} MiB", LONGEST_LINE_BYTES >> 20);
                    let place = Place::Line(self.mark.line);
                    return Err(ReadError::new(self.input().path(), place, message));
                }
                None => continue,
            };
            self.ready = 0..end;
            return Ok(());
        }
    }
}

/// The lines of a block with their ends.
pub(crate) fn lines(block: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut start = 0;
    let ends = memchr_iter(b'\n', block).map(|newline| newline + 1);
    let rest = (!block.is_empty() && block.last() != Some(&b'\n')).then_some(block.len());
    ends.chain(rest).map(move |end| &block[std::mem::replace(&mut start, end)..end])
}

/// About `count` pieces of whole lines.
pub(crate) fn pieces(block: &[u8], count: usize) -> Vec<&[u8]> {
    let size = block.len() / count.max(1) + 1;
    let mut pieces = Vec::with_capacity(count);
    let mut rest = block;
    while rest.len() > size {
        let Some(newline) = memchr::memchr(b'\n', &rest[size..]) else { break };
        let (piece, after) = rest.split_at(size + newline + 1);
        pieces.push(piece);
        rest = after;
    }
    if !rest.is_empty() {
        pieces.push(rest);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_keep_their_ends_and_the_last_needs_none() {
        let all: Vec<_> = lines(b"a\r\n\nbc").collect();
        assert_eq!(all, [&b"a\r\n"[..], b"\n", b"bc"]);
        assert_eq!(lines(b"").count(), 0);
    }

    #[test]
    fn pieces_are_whole_lines_and_lose_nothing() {
        let text = b"one\ntwo\nthree\nfour\nfive";
        for count in 0..9 {
            let pieces = pieces(text, count);
            assert_eq!(pieces.concat(), text);
            assert!(pieces.iter().rev().skip(1).all(|p| p.ends_with(b"\n")));
        }
    }
}
