//! ZIP archives (PKWARE's APPNOTE 6.3): the central directory, stored and deflated members, Zip64.

use std::io::Read;

use crate::read::{Input, inflate};
use crate::{Place, ReadError, Result};

/// What a local file header begins with.
pub(super) const MAGIC: &[u8] = b"PK\x03\x04";
/// The end record is 22 bytes, after it a comment of at most 65535; before it a Zip64 locator.
const TAIL_BYTES: u64 = 22 + 65_535 + 20;
/// No directory of arrays is larger.
const DIRECTORY_BYTES: u64 = 64 << 20;

/// One file of the archive.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) name: String,
    deflated: bool,
    compressed: u64,
    /// Where its local header lies.
    header: u64,
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(2)?)?;
    Some(u64::from(u16::from_le_bytes(bytes.try_into().ok()?)))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(4)?)?;
    Some(u64::from(u32::from_le_bytes(bytes.try_into().ok()?)))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?))
}

/// Offset and size of the central directory, from the file's last bytes.
fn directory_place(input: &Input, tail: &[u8]) -> Result<Option<(u64, u64)>> {
    let Some(end) = memchr::memmem::rfind(tail, b"PK\x05\x06") else { return Ok(None) };
    let (size, offset) = (u32_at(tail, end + 12), u32_at(tail, end + 16));
    let locator = end.checked_sub(20).filter(|at| tail[*at..].starts_with(b"PK\x06\x07"));
    if let Some(record) = locator.and_then(|at| u64_at(tail, at + 8)) {
        let record = input.read(record, 56)?;
        if record.starts_with(b"PK\x06\x06") {
            return Ok(u64_at(&record, 48).zip(u64_at(&record, 40)));
        }
    }
    Ok(offset.zip(size))
}

/// The member at `at` of the central directory, and where the next one lies.
fn member(directory: &[u8], at: usize) -> Option<(Member, u64, usize)> {
    if !directory.get(at..)?.starts_with(b"PK\x01\x02") {
        return None;
    }
    let field = |offset: usize| u16_at(directory, at + offset).map(|v| v as usize);
    let (name_bytes, extra_bytes, comment_bytes) = (field(28)?, field(30)?, field(32)?);
    let name_end = at + 46 + name_bytes;
    let name = String::from_utf8_lossy(directory.get(at + 46..name_end)?).into_owned();
    let extra = directory.get(name_end..name_end + extra_bytes)?;
    // Zip64: the sizes and the offset that do not fit, in this order.
    let mut wide = zip64(extra);
    let mut value = |offset| match u32_at(directory, at + offset)? {
        0xffff_ffff => {
            let value = u64_at(wide, 0)?;
            wide = &wide[8..];
            Some(value)
        }
        value => Some(value),
    };
    let _uncompressed = value(24)?;
    let (compressed, header) = (value(20)?, value(42)?);
    let method = field(10)? as u64;
    let member = Member { name, deflated: method == 8, compressed, header };
    Some((member, method, name_end + extra_bytes + comment_bytes))
}

/// The content of the Zip64 extra field, or nothing.
fn zip64(mut extra: &[u8]) -> &[u8] {
    while let (Some(id), Some(size)) = (u16_at(extra, 0), u16_at(extra, 2)) {
        let Some(content) = extra.get(4..4 + size as usize) else { break };
        if id == 1 {
            return content;
        }
        extra = &extra[4 + size as usize..];
    }
    &[]
}

/// The members of the archive.
pub(super) fn members(input: &Input) -> Result<Vec<Member>> {
    let error = |message: String| ReadError::new(input.path(), Place::Whole, message);
    let tail = match input.content_bytes() {
        Some(all) => input.read(all.saturating_sub(TAIL_BYTES), TAIL_BYTES)?,
        None => return Err(error("an archive within a compressed file is not read".into())),
    };
    let missing = || error("expected a ZIP archive's directory at the end: the file is cut".into());
    let (offset, size) = directory_place(input, &tail)?.ok_or_else(missing)?;
    if size > DIRECTORY_BYTES {
        return Err(error(format!("a ZIP directory of {size} bytes")));
    }
    let directory = input.read(offset, size)?;
    let mut members = Vec::new();
    let mut at = 0;
    while at < directory.len() {
        let broken = || {
            let place = Place::Byte(offset.saturating_add(at as u64));
            ReadError::new(input.path(), place, "expected an entry of the ZIP directory")
        };
        let (member, method, next) = member(&directory, at).ok_or_else(broken)?;
        if !matches!(method, 0 | 8) {
            let name = member.name;
            return Err(error(format!(
                "`{name}` is compressed by method {method}; 0 and 8 are read"
            )));
        }
        members.push(member);
        at = next;
    }
    if directory.is_empty() && size > 0 {
        return Err(missing());
    }
    Ok(members)
}

impl Member {
    /// The member's content from its start.
    pub(super) fn stream(&self, input: &Input) -> Result<Box<dyn Read + Send>> {
        let local = input.read(self.header, 30)?;
        let lengths = u16_at(&local, 26).zip(u16_at(&local, 28));
        let Some((name, extra)) = lengths.filter(|_| local.starts_with(MAGIC)) else {
            let message = format!("expected the ZIP header of `{}`", self.name);
            return Err(ReadError::new(input.path(), Place::Byte(self.header), message));
        };
        let start = self.header + 30 + name + extra;
        let stored = input.stream(start)?.take(self.compressed);
        if self.deflated { Ok(inflate::deflate(stored)) } else { Ok(Box::new(stored)) }
    }
}
