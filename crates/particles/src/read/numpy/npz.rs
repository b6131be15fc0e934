//! NPZ: a ZIP archive of NPY arrays, one per name.
//!
//! Positions are `x`, `y` and perhaps `z`, or one array called `position`, `pos`, `coordinates` …; or
//! the only array, as if it were bare. Arrays with as many rows are columns; `time` and `step`, with a number for
//! all frames or one for each, are those of the frames.

use std::io::Read;
use std::sync::Arc;

use super::array::{Array, HEADER_BYTES, Item, MOST_COLUMNS_BESIDE_ROWS, View};
use super::zip::{self, Member};
use super::{NamedLane, bare_columns};
use crate::read::fields::{POSITION_VECTORS, Plan, Slot, Table};
use crate::read::lanes::Lane;
use crate::read::{Confidence, Format, Head, Input, Progress, Reader, Wanted};
use crate::{Particles, Place, ReadError, Result};

/// The format.
pub(in crate::read) struct Npz;

impl Format for Npz {
    fn name(&self) -> &'static str {
        "NPZ"
    }

    fn recognise(&self, head: &Head<'_>) -> Confidence {
        if !head.bytes.starts_with(zip::MAGIC) {
            return Confidence::No;
        }
        let name_bytes =
            head.bytes.get(26..28).map_or(0, |b| usize::from(b[0]) | usize::from(b[1]) << 8);
        match head.bytes.get(30..30 + name_bytes) {
            Some(name) if name.ends_with(b".npy") => Confidence::Certain,
            _ if head.has_extension(&["npz"]) => Confidence::Likely,
            _ => Confidence::No,
        }
    }

    fn open(&self, input: Input) -> Result<Box<dyn Reader>> {
        let mut reader = NpzReader {
            input: Arc::new(input),
            arrays: vec![],
            clock: [None, None],
            frames: 1,
            left_out: vec![],
        };
        reader.find()?;
        Ok(Box::new(reader))
    }
}

/// An array that is read.
struct Part {
    file: File,
    array: Array,
    view: View,
    columns: Vec<NamedLane>,
}

struct NpzReader {
    input: Arc<Input>,
    arrays: Vec<Part>,
    /// Time and step, if there are any.
    clock: [Option<(File, Array)>; 2],
    frames: u64,
    left_out: Vec<String>,
}

/// A member and the stream last read from it: frames forward are read on, not from the start again.
struct File {
    name: String,
    member: Member,
    stream: Option<(Box<dyn Read + Send>, u64)>,
}

impl File {
    /// `bytes` bytes of the content from `offset`.
    fn read(&mut self, input: &Input, offset: u64, bytes: u64) -> Result<Vec<u8>> {
        let io = |e: &std::io::Error| {
            ReadError::new(input.path(), Place::Whole, format!("array `{}`: {e}", self.name))
        };
        let (mut stream, at) = match self.stream.take() {
            Some((stream, at)) if at <= offset => (stream, at),
            _ => (self.member.stream(input)?, 0),
        };
        std::io::copy(&mut stream.by_ref().take(offset - at), &mut std::io::sink())
            .map_err(|e| io(&e))?;
        let mut out = Vec::new();
        stream.by_ref().take(bytes).read_to_end(&mut out).map_err(|e| io(&e))?;
        self.stream = Some((stream, offset + out.len() as u64));
        Ok(out)
    }
}

/// The array's columns where it is one beside the positions.
fn named_columns(name: &str, array: &Array, view: &View) -> Vec<NamedLane> {
    if array.is_record {
        return bare_columns(array, view);
    }
    let count = view.columns.0 as usize;
    let one = |c: usize| {
        let item = array.items.first()?;
        let component = (count > 1).then_some((c, count));
        let slot = Slot { name: name.into(), component, scalar: item.scalar };
        Some(NamedLane { slot, item: item.clone(), offset: c as u64 * view.columns.1 })
    };
    (0..count).filter_map(one).collect()
}

/// Which array the positions are in, and how it is cut; `bare` where its columns go by number.
struct Found {
    frames: Option<u64>,
    rows: u64,
    bare: Option<usize>,
}

fn find_positions(arrays: &[(File, Array)]) -> Option<Found> {
    let named = |wanted: &str| arrays.iter().position(|(f, _)| f.name.eq_ignore_ascii_case(wanted));
    let shape = |i: usize| arrays[i].1.shape.as_slice();
    if let (Some(x), Some(y)) = (named("x"), named("y"))
        && let ([n], [m]) = (shape(x), shape(y))
    {
        return (n == m).then_some(Found { frames: None, rows: *n, bare: None });
    }
    let table = |i: usize, bare: bool| {
        let view = arrays[i].1.table()?;
        let frames = (shape(i).len() == 3 || arrays[i].1.is_record && shape(i).len() == 2)
            .then_some(view.frames.0);
        Some(Found { frames, rows: view.rows.0, bare: bare.then_some(i) })
    };
    for i in POSITION_VECTORS.iter().filter_map(|name| named(name)) {
        match shape(i) {
            [_, 2..=3] | [_, _, 2..=3] if !arrays[i].1.is_record => return table(i, false),
            [2..=4, n] if *n > MOST_COLUMNS_BESIDE_ROWS => return table(i, true),
            [_, 4] | [_, _, 4] => return table(i, true),
            _ => {}
        }
    }
    let only = if arrays.len() == 1 { Some(0) } else { named("arr_0") };
    only.and_then(|i| table(i, true))
}

impl NpzReader {
    /// Reads the arrays' headers and decides what each is for.
    fn find(&mut self) -> Result<()> {
        let mut arrays = Vec::new();
        for member in zip::members(&self.input)? {
            let Some(name) = member.name.strip_suffix(".npy").map(str::to_owned) else { continue };
            let mut file = File { name, member, stream: None };
            let header = file.read(&self.input, 0, HEADER_BYTES)?;
            file.stream = None;
            match Array::parse(&header) {
                Ok(array) if !array.items.is_empty() => arrays.push((file, array)),
                Ok(array) => self.left_out.push(format!("{} ({:?})", file.name, array.left_out)),
                Err((_, message)) => self.left_out.push(format!("{}: {message}", file.name)),
            }
        }
        let Some(found) = find_positions(&arrays) else {
            let list: Vec<_> =
                arrays.iter().map(|(f, a)| format!("{} {:?}", f.name, a.shape)).collect();
            let mut message =
                format!("expected arrays x, y, z or position (N, 3); found {}", list.join(", "));
            if !self.left_out.is_empty() {
                message.push_str(&format!("; left out {}", self.left_out.join(", ")));
            }
            return Err(ReadError::new(self.input.path(), Place::Whole, message));
        };
        self.frames = found.frames.unwrap_or(1);
        for (i, (file, array)) in arrays.into_iter().enumerate() {
            let bare = found.bare == Some(i);
            if let Some(hand) = self.hand(&file.name, &array, found.rows).filter(|_| !bare) {
                self.clock[hand] = Some((file, array));
                continue;
            }
            let view = if bare { array.table() } else { array.beside(found.frames, found.rows) };
            match view {
                Some(view) if view.columns.0 <= 9 || bare => {
                    let columns = match bare {
                        true => bare_columns(&array, &view),
                        false => named_columns(&file.name, &array, &view),
                    };
                    self.arrays.push(Part { file, array, view, columns });
                }
                _ => self.left_out.push(format!("{} {:?}", file.name, array.shape)),
            }
        }
        Ok(())
    }

    /// Whether an array is the time (0) or the step (1) of the frames: one number for all, or one for each. Of one
    /// particle alone, a list of one number may as well be its own.
    fn hand(&self, name: &str, array: &Array, rows: u64) -> Option<usize> {
        let hand = ["time", "step"].iter().position(|word| name.eq_ignore_ascii_case(word))?;
        let numbers = array.shape.iter().product::<u64>();
        let one = numbers == 1 && (rows != 1 || array.shape.is_empty());
        let each = self.frames > 1 && numbers == self.frames && array.shape[0] == numbers;
        let plain = !array.is_record && array.items.len() == 1 && self.clock[hand].is_none();
        (plain && (one || each)).then_some(hand)
    }

    /// The time (0) or the step (1) of a frame.
    fn clock(&mut self, hand: usize, frame: u64) -> Result<Option<f64>> {
        let Some((file, array)) = &mut self.clock[hand] else { return Ok(None) };
        let Some(Item { scalar, order, .. }) = array.items.first().cloned() else {
            return Ok(None);
        };
        let numbers = array.shape.iter().product::<u64>();
        let bytes = scalar.bytes();
        let at = array.start + if numbers > 1 { frame * bytes as u64 } else { 0 };
        let data = file.read(&self.input, at, bytes as u64)?;
        let lane = Lane { bytes: &data, start: 0, stride: bytes, scalar, order };
        Ok(lane.holds(1).then(|| lane.number(0)))
    }

    /// The bytes of `part` that hold `frame`, and where the frame's first row lies in them.
    fn load(input: &Input, part: &mut Part, frame: u64) -> Result<(Vec<u8>, u64)> {
        let view = &part.view;
        let frame = if view.frames.0 > 1 { frame } else { 0 };
        let whole = part.array.bytes().unwrap_or(u64::MAX);
        let (offset, bytes, start) = match view.is_row_major(part.array.item_bytes) {
            true => (frame * view.frames.1, view.rows.0 * view.rows.1, 0),
            false => (0, whole, frame * view.frames.1),
        };
        let data = part.file.read(input, part.array.start + offset, bytes)?;
        if data.len() as u64 == bytes {
            return Ok((data, start));
        }
        let message =
            format!("expected {bytes} bytes in array `{}`, found {}", part.file.name, data.len());
        Err(ReadError::new(input.path(), Place::Whole, message))
    }
}

impl Reader for NpzReader {
    fn count(&mut self, _progress: Progress<'_>) -> Result<usize> {
        Ok(usize::try_from(self.frames).unwrap_or(0))
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, progress: Progress<'_>) -> Result<Particles> {
        if frame as u64 >= self.frames {
            let message = format!("there are {} frames", self.frames);
            return Err(ReadError::new(self.input.path(), Place::Frame(frame), message));
        }
        let slots: Vec<_> =
            self.arrays.iter().flat_map(|a| &a.columns).map(|c| c.slot.clone()).collect();
        let Some(plan) = Plan::new(&slots, wanted) else {
            let message = "expected arrays x, y, z or position";
            return Err(ReadError::new(self.input.path(), Place::Whole, message));
        };
        let mut loaded = Vec::new();
        let mut first = 0;
        for part in &mut self.arrays {
            let used = (first..first + part.columns.len()).any(|slot| plan.uses(slot));
            first += part.columns.len();
            loaded.push(if used {
                Self::load(&self.input, part, frame as u64)?
            } else {
                (vec![], 0)
            });
            progress(loaded.len() as u64, slots.len() as u64);
        }
        let mut lanes = Vec::new();
        let mut rows = 0;
        for (part, (bytes, start)) in self.arrays.iter().zip(&loaded) {
            rows = usize::try_from(part.view.rows.0).unwrap_or(usize::MAX);
            for NamedLane { item, offset, .. } in &part.columns {
                let start = (start + offset) as usize;
                let (scalar, order) = (item.scalar, item.order);
                let lane = Lane { bytes, start, stride: part.view.rows.1 as usize, scalar, order };
                lanes.push(if lane.holds(rows) { lane } else { Lane::zero(scalar) });
            }
        }
        let mut table = Table::new(plan);
        if rows > 0 {
            table.push(&lanes, rows);
        }
        let mut particles = table.finish();
        particles.time = self.clock(0, frame as u64)?.filter(|time| time.is_finite());
        // A length of steps is not a step.
        let whole = |step: &f64| step.fract() == 0.0 && step.abs() < 9e15;
        particles.step = self.clock(1, frame as u64)?.filter(whole).map(|step| step as i64);
        Ok(particles)
    }

    fn warnings(&self) -> Vec<String> {
        match self.left_out.is_empty() {
            true => Vec::new(),
            false => vec![format!("arrays left out: {}", self.left_out.join(", "))],
        }
    }
}
