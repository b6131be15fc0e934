//! The Protein Data Bank's format (wwPDB, *Atomic Coordinate Entry Format Description*, version 3.3).
//!
//! Fixed columns. `ATOM` and `HETATM` lines are particles, all alternate locations among them; `MODEL`
//! … `ENDMDL` is a frame, as is what ends in `END` in the trajectories of simulation programs; `CRYST1`
//! is the box, unless it is the 1 Å cell that stands for none. Everything else is passed over.

mod atom;
mod fields;

use self::atom::{Atoms, is_atom};
use self::fields::numbers;
use super::rows::Stop;
use super::text::{Block, Lines, Mark};
use super::trajectory::{Layout, Trajectory};
use super::{Confidence, Format, Head, Input, Progress, Reader, Wanted};
use crate::{Particles, SimulationBox};

/// The format.
pub(super) struct Pdb;

/// What the lines of a PDB file begin with.
#[rustfmt::skip]
const RECORDS: &[&str] = &[
    "HEADER", "OBSLTE", "TITLE", "SPLIT", "CAVEAT", "COMPND", "SOURCE", "KEYWDS", "EXPDTA", "NUMMDL",
    "MDLTYP", "AUTHOR", "REVDAT", "SPRSDE", "JRNL", "REMARK", "DBREF", "DBREF1", "DBREF2", "SEQADV",
    "SEQRES", "MODRES", "HET", "HETNAM", "HETSYN", "FORMUL", "HELIX", "SHEET", "TURN", "SSBOND", "LINK",
    "CISPEP", "SITE", "CRYST1", "ORIGX1", "ORIGX2", "ORIGX3", "SCALE1", "SCALE2", "SCALE3", "MTRIX1",
    "MTRIX2", "MTRIX3", "MODEL", "ATOM", "ANISOU", "TER", "HETATM", "ENDMDL", "CONECT", "MASTER", "END",
];

/// What stands before the first atom is no longer.
const TITLE_BYTES: u64 = 4 << 20;

fn is_record(line: &str) -> bool {
    let record = line.get(..6).unwrap_or(line).trim_end();
    RECORDS.contains(&record)
}

impl Format for Pdb {
    fn name(&self) -> &'static str {
        "PDB"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        let (mut records, mut others) = (0, 0);
        for line in head.lines().filter(|line| !line.trim().is_empty()) {
            if is_atom(line.as_bytes()) {
                let place = line.as_bytes().get(30..54);
                let columns = place.is_some_and(|place| numbers(place).is_some());
                return match columns && others <= records {
                    true => Confidence::Certain,
                    false => Confidence::No,
                };
            }
            if is_record(&line) { records += 1 } else { others += 1 }
        }
        // Remarks may fill the head of the file.
        match records > 3 && others == 0 {
            true if head.has_extension(&["pdb", "ent"]) => Confidence::Certain,
            true => Confidence::Likely,
            false => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> crate::Result<Box<dyn Reader>> {
        let (title, _) = input.start(TITLE_BYTES)?;
        let mut lines = title.split(|b| *b == b'\n').take_while(|line| !is_atom(line));
        let cell = lines.find_map(cell).flatten();
        Ok(Box::new(Trajectory::open(PdbLayout { cell }, input)?))
    }
}

/// The box of a `CRYST1` line; within, `None` where it stands for none.
fn cell(line: &[u8]) -> Option<Option<SimulationBox>> {
    if !line.starts_with(b"CRYST1") {
        return None;
    }
    let fields = [6..15, 15..24, 24..33, 33..40, 40..47, 47..54];
    let mut values = [0.0; 6];
    for (value, field) in values.iter_mut().zip(fields) {
        *value = fast_float2::parse(line.get(field)?.trim_ascii()).ok()?;
    }
    let [a, b, c, alpha, beta, gamma] = values;
    let is_none = [a, b, c] == [1.0; 3] || [a, b, c] == [0.0; 3];
    let found = SimulationBox::from_lengths_and_angles([a, b, c], [alpha, beta, gamma]);
    Some(found.filter(|_| !is_none))
}

struct PdbLayout {
    /// The box before the first atom, for models without their own.
    cell: Option<SimulationBox>,
}

/// What stands before a frame's atoms.
struct FrameHeader {
    cell: Option<SimulationBox>,
    /// Begun by `MODEL`, so that it must end in `ENDMDL`.
    is_model: bool,
}

/// Whether a line ends a frame, and whether it is part of it.
fn frame_end(line: &[u8]) -> Option<bool> {
    match line.trim_ascii_end() {
        b"END" | b"ENDMDL" => Some(true),
        _ if line.starts_with(b"MODEL ") => Some(false),
        _ => None,
    }
}

/// The first line of what is not empty, with its end.
fn first_line(text: &[u8]) -> &[u8] {
    memchr::memchr(b'\n', text).map_or(text, |end| &text[..=end])
}

/// The part of a block up to a frame's end.
struct Part<'a> {
    block: Block<'a>,
    is_end: bool,
    end: Mark,
}

/// Cuts the block that starts at `start` behind the line that ends the frame.
fn cut<'a>(block: Block<'a>, start: Mark) -> Part<'a> {
    let (mut bytes, mut lines, mut is_end) = (0, 0, false);
    while bytes < block.bytes.len() {
        let line = first_line(&block.bytes[bytes..]);
        let end = if matches!(line[0], b'E' | b'M') { frame_end(line) } else { None };
        is_end = end.is_some();
        if end == Some(false) {
            break;
        }
        bytes += line.len();
        lines += 1;
        if is_end {
            break;
        }
    }
    let end = Mark { offset: start.offset + bytes as u64, line: start.line + lines };
    let block = Block { bytes: &block.bytes[..bytes], lines, ..block };
    Part { block, is_end, end }
}

impl PdbLayout {
    /// Gives the frame's atoms to `each`, in blocks.
    fn walk(
        &self,
        header: &FrameHeader,
        lines: &mut Lines,
        mut each: impl FnMut(&Block<'_>) -> std::result::Result<(), (u64, String)>,
    ) -> std::result::Result<(), Stop> {
        loop {
            let start = lines.mark();
            let Some(block) = lines.block(u64::MAX)? else {
                let is_cut = header.is_model || lines.broken().is_some();
                return if is_cut { Err(Stop::Cut(lines.cut("ENDMDL"))) } else { Ok(()) };
            };
            let part = cut(block, start);
            let (end, is_end) = (part.end, part.is_end);
            // A last line that the file's end cut short.
            let is_last = !part.block.bytes.ends_with(b"\n") && !is_end;
            if let Err((line, message)) = each(&part.block) {
                return Err(match is_last && line + 1 == end.line {
                    true => {
                        Stop::Cut(lines.error(line, format!("{message}, where {}", lines.end())))
                    }
                    false => Stop::Error(lines.error(line, message)),
                });
            }
            if is_end {
                return Ok(lines.go_to(end)?);
            }
        }
    }
}

impl Layout for PdbLayout {
    type Header = FrameHeader;

    fn header(&self, lines: &mut Lines) -> std::result::Result<Option<FrameHeader>, Stop> {
        let mut header = FrameHeader { cell: self.cell, is_model: false };
        loop {
            let mark = lines.mark();
            let Some(line) = lines.next_line()? else { return Ok(None) };
            let text = line.text.as_bytes();
            if let Some(cell) = cell(text) {
                header.cell = cell;
            }
            header.is_model = text == b"MODEL" || text.starts_with(b"MODEL ");
            if header.is_model || is_atom(text) {
                if !header.is_model {
                    lines.go_to(mark)?;
                }
                return Ok(Some(header));
            }
        }
    }

    fn skip(&self, header: &FrameHeader, lines: &mut Lines) -> std::result::Result<(), Stop> {
        self.walk(header, lines, |block| {
            // The last line of a cut file is no whole atom.
            let last = block.bytes.split_inclusive(|b| *b == b'\n').next_back().unwrap_or_default();
            match is_atom(last) && !last.ends_with(b"\n") {
                true => Atoms::parse(last, &Wanted::Only(Vec::new()))
                    .map(|_| ())
                    .map_err(|wrong| (block.first_line + block.lines - 1, wrong.message)),
                false => Ok(()),
            }
        })
    }

    fn read(
        &self,
        header: &FrameHeader,
        lines: &mut Lines,
        wanted: &Wanted,
        progress: Progress<'_>,
    ) -> std::result::Result<Particles, Stop> {
        let mut atoms = Atoms::default();
        let (mut done, all) = lines.progress();
        self.walk(header, lines, |block| {
            let parts = block.map_chunks(|text| Atoms::parse(text, wanted));
            let parts = parts.map_err(|wrong| (block.line_of(wrong.at), wrong.message))?;
            parts.into_iter().for_each(|part| atoms.append(part));
            done += block.bytes.len() as u64;
            progress(done, all.max(done));
            Ok(())
        })?;
        let mut particles = atoms.finish(wanted);
        particles.sim_box = header.cell;
        Ok(particles)
    }
}
