//! Text files: lines from a stream that is read forward, and the numbers in them.
//!
//! [`Lines`] is the one way to text. It holds one block of the file, reads on where it stands, and
//! goes back only where a caller asks: a compressed trajectory that is read frame after frame is
//! decompressed once.

use std::io::Read;

use rayon::prelude::*;

use super::Input;
use crate::{Place, ReadError, Result};

/// The first block after a jump; each further one is twice as large.
const FIRST_BLOCK_BYTES: usize = 256 * 1024;
/// The largest block.
const BLOCK_BYTES: usize = 16 * 1024 * 1024;
/// What one thread parses at a time.
const CHUNK_BYTES: usize = 256 * 1024;
/// No text format writes longer lines; what does is no text.
const LONGEST_LINE: usize = 4 * 1024 * 1024;

/// The start of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// Bytes before it, in decompressed content.
    pub(super) offset: u64,
    /// Its number, counted from 1.
    pub(super) line: u64,
}

impl Mark {
    /// The start of the file.
    pub(super) const START: Self = Self { offset: 0, line: 1 };
}

/// One line, without its end.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// Counted from 1.
    pub(super) number: u64,
    /// The text; bytes that are not UTF-8 are replaced.
    pub(super) text: String,
    /// Whether a line end follows; if not, the file may be cut here.
    pub(super) ended: bool,
}

/// Whole lines, in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a> {
    /// The lines with their ends; the last line of the file may have none.
    pub(super) bytes: &'a [u8],
    /// The number of the first line, counted from 1.
    pub(super) first_line: u64,
    /// How many lines there are.
    pub(super) lines: u64,
}

/// Something wrong at a byte of a block.
#[derive(Debug)]
pub(super) struct Wrong {
    /// Bytes from the start of the block (of the chunk, until the block adds its own start).
    pub(super) at: usize,
    /// What was expected and what stood there.
    pub(super) message: String,
}

impl Block<'_> {
    /// Applies `parse` to pieces of whole lines, in parallel; the results are in the file's order.
    ///
    /// # Errors
    /// The first error in the file's order, with its byte in the block.
    pub(super) fn map_chunks<T: Send>(
        &self,
        parse: impl Fn(&[u8]) -> std::result::Result<T, Wrong> + Sync,
    ) -> std::result::Result<Vec<T>, Wrong> {
        let mut chunks = Vec::new();
        let mut start = 0;
        while start < self.bytes.len() {
            let wish = self.bytes.len().min(start + CHUNK_BYTES);
            let end = memchr::memchr(b'\n', &self.bytes[wish..])
                .map_or(self.bytes.len(), |i| wish + i + 1);
            chunks.push((start, &self.bytes[start..end]));
            start = end;
        }
        let parsed: Vec<_> = chunks
            .into_par_iter()
            .map(|(start, chunk)| parse(chunk).map_err(|w| Wrong { at: w.at + start, ..w }))
            .collect();
        parsed.into_iter().collect()
    }

    /// The number of the line that byte `at` lies in.
    pub(super) fn line_of(&self, at: usize) -> u64 {
        let before = &self.bytes[..at.min(self.bytes.len())];
        self.first_line + memchr::memchr_iter(b'\n', before).count() as u64
    }
}

/// The lines of a file, from any place on.
pub(super) struct Lines {
    input: Input,
    stream: Option<Box<dyn Read + Send>>,
    /// A part of the content.
    buffer: Vec<u8>,
    /// Where the buffer begins in the content.
    buffer_offset: u64,
    /// How much of the buffer is read.
    used: usize,
    /// The number of the line that begins at `used`.
    line: u64,
    next_block: usize,
    /// The stream has no more.
    ended: bool,
    /// Why the stream ended early: compressed data that is cut or damaged.
    broken: Option<String>,
}

impl Lines {
    /// At the start of `input`.
    pub(super) fn new(input: Input) -> Self {
        Self {
            input,
            stream: None,
            buffer: Vec::new(),
            buffer_offset: 0,
            used: 0,
            line: 1,
            next_block: FIRST_BLOCK_BYTES,
            ended: false,
            broken: None,
        }
    }

    /// The file.
    pub(super) fn input(&self) -> &Input {
        &self.input
    }

    /// Where the next line begins.
    pub(super) fn mark(&self) -> Mark {
        Mark { offset: self.buffer_offset + self.used as u64, line: self.line }
    }

    /// Why compressed data ended early, if it did.
    pub(super) fn broken(&self) -> Option<&str> {
        self.broken.as_deref()
    }

    /// Bytes read and bytes in all, for a progress bar; a guess where the file is compressed.
    pub(super) fn progress(&self) -> (u64, u64) {
        let done = self.mark().offset;
        (done, self.input.content_bytes().unwrap_or(self.input.stored_bytes()).max(done))
    }

    /// How many lines of at least `bytes` bytes can still follow; `None` where that is unknown.
    pub(super) fn room_for(&self, bytes: u64) -> Option<u64> {
        let rest = self.input.content_bytes()?.saturating_sub(self.mark().offset);
        Some(rest / bytes.max(1) + 1)
    }

    /// An error at `line`.
    pub(super) fn error(&self, line: u64, message: impl Into<String>) -> ReadError {
        ReadError::new(self.input.path(), Place::Line(line), message)
    }

    /// An error about what is missing at the end of the file.
    pub(super) fn cut(&self, expected: &str) -> ReadError {
        self.error(self.line, format!("expected {expected}, but {}", self.end()))
    }

    /// What the file's end is: that, or the end of sound compressed data.
    pub(super) fn end(&self) -> String {
        self.broken().map_or("the file ends".to_owned(), |why| {
            format!("the compressed data ends early ({why})")
        })
    }

    /// Goes to a line whose mark was taken before.
    ///
    /// # Errors
    /// The operating system's.
    pub(super) fn go_to(&mut self, mark: Mark) -> Result<()> {
        let in_buffer = mark.offset >= self.buffer_offset
            && mark.offset - self.buffer_offset <= self.buffer.len() as u64
            && (self.stream.is_some() || !self.buffer.is_empty());
        if in_buffer {
            self.used = (mark.offset - self.buffer_offset) as usize;
        } else if self.input.content_bytes().is_some() || mark.offset < self.buffer_offset {
            let from = self.input.content_bytes().map_or(0, |_| mark.offset);
            self.reopen(from)?;
        }
        while self.mark().offset < mark.offset {
            let here = self.buffer.len() - self.used;
            let missing = mark.offset - self.mark().offset;
            self.used += here.min(usize::try_from(missing).unwrap_or(usize::MAX));
            if self.used == self.buffer.len() && !self.fill()? {
                break;
            }
        }
        self.line = mark.line;
        Ok(())
    }

    fn reopen(&mut self, offset: u64) -> Result<()> {
        self.stream = Some(self.input.stream(offset)?);
        self.buffer.clear();
        self.buffer_offset = offset;
        self.used = 0;
        self.next_block = FIRST_BLOCK_BYTES;
        self.ended = false;
        Ok(())
    }

    /// Reads another block behind what is unread; says whether there was more.
    fn fill(&mut self) -> Result<bool> {
        if self.ended {
            return Ok(false);
        }
        let mut stream = match self.stream.take() {
            Some(stream) => stream,
            None => self.input.stream(self.buffer_offset + self.buffer.len() as u64)?,
        };
        self.buffer.drain(..self.used);
        self.buffer_offset += self.used as u64;
        self.used = 0;
        let before = self.buffer.len();
        let outcome = stream.by_ref().take(self.next_block as u64).read_to_end(&mut self.buffer);
        self.next_block = (self.next_block * 2).min(BLOCK_BYTES);
        self.stream = Some(stream);
        match outcome {
            Ok(_) => {}
            Err(e) if self.input.content_bytes().is_none() => {
                self.broken = Some(e.to_string());
                self.ended = true;
            }
            Err(e) => return Err(ReadError::io(self.input.path(), &e)),
        }
        let more = self.buffer.len() > before;
        self.ended |= !more;
        Ok(more)
    }

    /// The next line; `None` at the end of the file.
    ///
    /// # Errors
    /// The operating system's, or a line of several megabytes.
    pub(super) fn next_line(&mut self) -> Result<Option<Line>> {
        let mut searched = 0;
        let end = loop {
            let rest = &self.buffer[self.used..];
            if let Some(i) = memchr::memchr(b'\n', &rest[searched..]) {
                break Some(searched + i);
            }
            searched = rest.len();
            if searched > LONGEST_LINE {
                return Err(
                    self.error(self.line, "expected text, found a line of several megabytes")
                );
            }
            if !self.fill()? {
                break None;
            }
        };
        let rest = &self.buffer[self.used..];
        if end.is_none() && rest.is_empty() {
            return Ok(None);
        }
        let text = &rest[..end.unwrap_or(rest.len())];
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        let text = String::from_utf8_lossy(text).into_owned();
        let line = Line { number: self.line, text, ended: end.is_some() };
        self.used += end.map_or(rest.len(), |i| i + 1);
        self.line += 1;
        Ok(Some(line))
    }

    /// The next line, which will be read again.
    ///
    /// # Errors
    /// As [`Lines::next_line`].
    pub(super) fn peek(&mut self) -> Result<Option<Line>> {
        let mark = self.mark();
        let line = self.next_line()?;
        self.go_to(mark)?;
        Ok(line)
    }

    /// Goes past up to `lines` lines; gives how many there were.
    ///
    /// # Errors
    /// The operating system's.
    pub(super) fn skip(&mut self, lines: u64) -> Result<u64> {
        let mut skipped = 0;
        let mut inside = false;
        while skipped < lines {
            let rest = &self.buffer[self.used..];
            let mut taken = 0;
            for end in memchr::memchr_iter(b'\n', rest) {
                taken = end + 1;
                skipped += 1;
                if skipped == lines {
                    break;
                }
            }
            if skipped < lines {
                inside = taken < rest.len() || (inside && taken == 0);
                taken = rest.len();
            }
            self.used += taken;
            if skipped < lines && !self.fill()? {
                skipped += u64::from(inside);
                break;
            }
        }
        self.line += skipped;
        Ok(skipped)
    }

    /// The next lines, at most `most`, as one block; `None` at the end of the file.
    ///
    /// # Errors
    /// As [`Lines::next_line`].
    pub(super) fn block(&mut self, most: u64) -> Result<Option<Block<'_>>> {
        if most == 0 {
            return Ok(None);
        }
        while memchr::memrchr(b'\n', &self.buffer[self.used..]).is_none() {
            if self.buffer.len() - self.used > LONGEST_LINE {
                return Err(
                    self.error(self.line, "expected text, found a line of several megabytes")
                );
            }
            if !self.fill()? {
                break;
            }
        }
        let start = self.used;
        let rest = &self.buffer[start..];
        let (mut bytes, mut lines) = (0, 0);
        for end in memchr::memchr_iter(b'\n', rest) {
            bytes = end + 1;
            lines += 1;
            if lines == most {
                break;
            }
        }
        if lines == 0 {
            bytes = rest.len();
            lines = u64::from(bytes > 0);
        }
        if lines == 0 {
            return Ok(None);
        }
        let first_line = self.line;
        self.used += bytes;
        self.line += lines;
        Ok(Some(Block { bytes: &self.buffer[start..start + bytes], first_line, lines }))
    }
}

/// How the fields of a line are parted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// Any number of blanks and tabs.
    Blank,
    /// Any number of blanks and tabs; a field may be quoted.
    BlankQuoted,
    /// One of this byte; a field may be quoted, blanks around it do not count.
    Byte(u8),
}

/// The fields of a line. Quotes are taken off; a doubled quote inside stays doubled.
pub(super) struct Fields<'a> {
    rest: Option<&'a [u8]>,
    separator: Separator,
}

/// The fields of `line`, which has no line end.
pub(super) fn fields(line: &[u8], separator: Separator) -> Fields<'_> {
    Fields { rest: Some(line), separator }
}

fn is_blank(byte: &u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\x0b' | b'\x0c')
}

/// `bytes` without blanks at both ends.
pub(super) fn trim(bytes: &[u8]) -> &[u8] {
    let start = bytes.iter().position(|b| !is_blank(b)).unwrap_or(bytes.len());
    let end = bytes.iter().rposition(|b| !is_blank(b)).map_or(start, |i| i + 1);
    &bytes[start..end]
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest?;
        let start = rest.iter().position(|b| !is_blank(b) && self.separator != Separator::Byte(*b));
        match self.separator {
            Separator::Byte(separator) => {
                let quote = start.filter(|i| {
                    rest[*i] == b'"'
                        && rest[..*i].iter().all(is_blank)
                        && !rest[..*i].contains(&separator)
                });
                let (field, after) =
                    match quote.and_then(|i| quoted(&rest[i..]).map(|f| (f, i + f.len() + 2))) {
                        Some(both) => both,
                        None => (&rest[..0], 0),
                    };
                let end = memchr::memchr(separator, &rest[after..]).map(|i| after + i);
                self.rest = end.map(|i| &rest[i + 1..]);
                Some(if after > 0 { field } else { trim(&rest[..end.unwrap_or(rest.len())]) })
            }
            separator => {
                let rest = &rest[start?..];
                if separator == Separator::BlankQuoted
                    && let Some(field) = quoted(rest)
                {
                    self.rest = Some(&rest[field.len() + 2..]);
                    return Some(field);
                }
                let end = rest.iter().position(is_blank).unwrap_or(rest.len());
                self.rest = Some(&rest[end..]);
                Some(&rest[..end])
            }
        }
    }
}

/// What stands between the quotes that `text` begins with.
fn quoted(text: &[u8]) -> Option<&[u8]> {
    let inner = text.strip_prefix(b"\"")?;
    let mut i = 0;
    loop {
        i += memchr::memchr(b'"', &inner[i..])?;
        if inner.get(i + 1) != Some(&b'"') {
            return Some(&inner[..i]);
        }
        i += 2;
    }
}

/// A real number as C, Fortran (`1.5D+03`) and Python write it, `nan` and `inf` included.
pub(super) fn real(token: &[u8]) -> Option<f64> {
    if let Ok(value) = fast_float2::parse(token) {
        return Some(value);
    }
    if token.len() > 64 || !token.iter().any(|b| matches!(b, b'd' | b'D')) {
        return None;
    }
    let token: Vec<u8> =
        token.iter().map(|b| if matches!(b, b'd' | b'D') { b'e' } else { *b }).collect();
    fast_float2::parse(&token).ok()
}

/// A decimal integer.
pub(super) fn integer(token: &[u8]) -> Option<i64> {
    let (negative, digits) = match token {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] | digits => (false, digits),
    };
    if digits.is_empty() {
        return None;
    }
    digits.iter().try_fold(0_i64, |value, byte| {
        let digit = i64::from(byte.is_ascii_digit().then(|| byte - b'0')?);
        let value = value.checked_mul(10)?;
        if negative { value.checked_sub(digit) } else { value.checked_add(digit) }
    })
}

/// A token or line as an error shows it: short, printable, in quotes.
pub(super) fn shown(text: &[u8]) -> String {
    let short = &text[..text.len().min(40)];
    let more = if text.len() > 40 { "…" } else { "" };
    format!("`{}{more}`", String::from_utf8_lossy(short).escape_debug())
}
