//! One NPY array: its header (NumPy's `numpy.lib.format`, versions 1 to 3) and where its numbers lie.

use super::literal::{Literal, parse};
use crate::read::MOST_COMPONENTS;
use crate::read::lanes::{ByteOrder, Scalar};

/// What every NPY file begins with.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// No header is longer; NumPy itself refuses more than 10 kB unless told otherwise.
pub(super) const HEADER_BYTES: u64 = 1 << 20;
/// Two to four rows with more columns than this are x, y, z (and the radius) one after another.
pub(super) const MOST_COLUMNS_BESIDE_ROWS: u64 = 16;

/// One field of a record; a plain array has one without a name.
#[derive(Clone, Debug)]
pub(super) struct Item {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) order: ByteOrder,
    /// Where it lies in its record.
    pub(super) offset: usize,
    pub(super) components: usize,
}

#[derive(Clone, Debug)]
pub(super) struct Array {
    pub(super) items: Vec<Item>,
    /// Whether it is an array of records.
    pub(super) is_record: bool,
    /// Bytes of an element.
    pub(super) item_bytes: usize,
    pub(super) shape: Vec<u64>,
    pub(super) fortran: bool,
    /// Where the numbers begin.
    pub(super) start: u64,
    /// Fields that hold no numbers.
    pub(super) left_out: Vec<String>,
}

/// What an element is.
enum Element {
    Number(Scalar, ByteOrder),
    /// So many bytes of something else.
    Other(usize),
}

/// NumPy's type strings: byte order, kind, bytes.
fn element(descr: &str) -> Result<Element, String> {
    let wrong = || format!("expected a type like `<f8`, found `{descr}`");
    let (order, rest) = match descr.as_bytes() {
        [b'>', ..] => (ByteOrder::Big, &descr[1..]),
        [b'<' | b'|' | b'=', ..] => (ByteOrder::Little, &descr[1..]),
        _ => (ByteOrder::Little, descr),
    };
    let scalar = match rest {
        "f2" => Scalar::F16,
        "f4" => Scalar::F32,
        "f8" => Scalar::F64,
        "i1" => Scalar::I8,
        "i2" => Scalar::I16,
        "i4" => Scalar::I32,
        "i8" => Scalar::I64,
        "u1" | "b1" | "?" => Scalar::U8,
        "u2" => Scalar::U16,
        "u4" => Scalar::U32,
        "u8" => Scalar::U64,
        _ => {
            let mut letters = rest.chars();
            let kind = letters.next().ok_or_else(wrong)?;
            let digits: String = letters.take_while(char::is_ascii_digit).collect();
            let bytes = digits.parse::<usize>().ok();
            return match (kind, bytes) {
                ('O', _) => Err("Python objects (a pickle) are not read".into()),
                ('S' | 'a' | 'V' | 'c' | 'f' | 'm' | 'M', Some(bytes)) => Ok(Element::Other(bytes)),
                ('U', Some(letters)) => {
                    Ok(Element::Other(letters.checked_mul(4).ok_or_else(wrong)?))
                }
                _ => Err(wrong()),
            };
        }
    };
    Ok(Element::Number(scalar, order))
}

fn count(literal: &Literal) -> Option<u64> {
    match literal {
        Literal::Integer(n) => u64::try_from(*n).ok(),
        _ => None,
    }
}

/// Numbers of a subarray: an integer or a tuple of them.
fn components(shape: Option<&Literal>) -> Option<u64> {
    match shape {
        None => Some(1),
        Some(Literal::Sequence(lengths)) => {
            lengths.iter().try_fold(1u64, |all, n| all.checked_mul(count(n)?))
        }
        Some(length) => count(length),
    }
}

impl Array {
    /// Parses the header at the start of `bytes`. `Err` has the byte and what stood there.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, (u64, String)> {
        let whole = |message: &str| (0, message.to_owned());
        let cut = || whole("the file ends inside the NPY header");
        if !bytes.starts_with(MAGIC) {
            return Err(whole("expected an NPY array"));
        }
        let (length, prefix): (usize, usize) = match bytes.get(6).ok_or_else(cut)? {
            1 => {
                let length = bytes.get(8..10).and_then(|b| b.try_into().ok()).ok_or_else(cut)?;
                (usize::from(u16::from_le_bytes(length)), 10)
            }
            2 | 3 => {
                let length = bytes.get(8..12).and_then(|b| b.try_into().ok()).ok_or_else(cut)?;
                (u32::from_le_bytes(length) as usize, 12)
            }
            version => return Err((6, format!("expected NPY version 1, 2 or 3, found {version}"))),
        };
        let header = bytes.get(prefix..prefix.saturating_add(length)).ok_or_else(cut)?;
        let header = String::from_utf8_lossy(header);
        let literal = parse(&header)
            .map_err(|at| ((prefix + at) as u64, "this is no NPY header".to_owned()))?;
        let start = (prefix + length) as u64;
        Self::from_header(&literal, start).map_err(|message| (prefix as u64, message))
    }

    fn from_header(header: &Literal, start: u64) -> Result<Self, String> {
        let fortran = matches!(header.get("fortran_order"), Some(Literal::Bool(true)));
        let shape = match header.get("shape") {
            Some(Literal::Sequence(lengths)) => {
                let lengths: Option<Vec<_>> = lengths.iter().map(count).collect();
                lengths.ok_or("expected a shape of whole numbers")?
            }
            _ => return Err("expected a `shape` in the header".into()),
        };
        let mut array = Self {
            items: Vec::new(),
            is_record: false,
            item_bytes: 0,
            shape,
            fortran,
            start,
            left_out: Vec::new(),
        };
        match header.get("descr") {
            Some(Literal::Text(descr)) => array.add("", descr, 1)?,
            Some(Literal::Sequence(fields)) => {
                array.is_record = true;
                fields.iter().try_for_each(|field| array.add_field(field))?;
            }
            _ => return Err("expected a `descr` in the header".into()),
        }
        let nonzero =
            Self { shape: array.shape.iter().map(|n| *n.max(&1)).collect(), ..array.clone() };
        nonzero.bytes().ok_or("the shape is larger than any memory")?;
        Ok(array)
    }

    fn add_field(&mut self, field: &Literal) -> Result<(), String> {
        let Literal::Sequence(parts) = field else {
            return Err("expected fields (name, type)".into());
        };
        let name = match parts.first() {
            // (title, name)
            Some(Literal::Sequence(names)) => names.last(),
            name => name,
        };
        match (name, parts.get(1)) {
            (Some(Literal::Text(name)), Some(Literal::Text(descr))) => {
                let components = components(parts.get(2)).ok_or("expected the shape of a field")?;
                self.add(name, descr, components)
            }
            (Some(Literal::Text(name)), _) => {
                Err(format!("field `{name}` is itself a record, which is not read"))
            }
            _ => Err("expected fields (name, type)".into()),
        }
    }

    fn add(&mut self, name: &str, descr: &str, components: u64) -> Result<(), String> {
        let too_large = || format!("field `{name}` is larger than any memory");
        let components = usize::try_from(components).map_err(|_| too_large())?;
        let element = element(descr)?;
        let bytes = match element {
            Element::Number(scalar, _) => scalar.bytes(),
            Element::Other(bytes) => bytes,
        };
        let offset = self.item_bytes;
        let bytes = bytes.checked_mul(components).and_then(|b| b.checked_add(offset));
        self.item_bytes = bytes.ok_or_else(too_large)?;
        match element {
            Element::Number(scalar, order) if (1..=MOST_COMPONENTS).contains(&components) => {
                self.items.push(Item { name: name.into(), scalar, order, offset, components });
            }
            // Padding has no name.
            _ if name.is_empty() && self.is_record => {}
            _ => self.left_out.push(format!("{name} ({descr})")),
        }
        Ok(())
    }

    /// Bytes of all numbers.
    pub(super) fn bytes(&self) -> Option<u64> {
        let bytes = self.shape.iter().try_fold(self.item_bytes as u64, |n, d| n.checked_mul(*d))?;
        (bytes <= i64::MAX as u64).then_some(bytes)
    }

    /// Elements from one index to the next, for each dimension, in bytes.
    fn strides(&self) -> Vec<u64> {
        let mut next = self.item_bytes as u64;
        let mut strides = vec![0; self.shape.len()];
        let mut set = |i: usize| {
            strides[i] = next;
            next = next.saturating_mul(self.shape[i]);
        };
        match self.fortran {
            true => (0..self.shape.len()).for_each(&mut set),
            false => (0..self.shape.len()).rev().for_each(&mut set),
        }
        strides
    }

    /// The array as (frames of) rows, the way a bare array of positions is meant.
    ///
    /// `(N,)` records; `(N, k)`; `(T, N, k)`; and `(k, N)` where k is 2 to 4 and N too great to be
    /// meant as columns.
    pub(super) fn table(&self) -> Option<View> {
        let strides = self.strides();
        let axis = |i: usize| (self.shape[i], strides[i]);
        match (self.shape.as_slice(), self.is_record) {
            ([_], true) => Some(View { frames: (1, 0), rows: axis(0), columns: (1, 0) }),
            ([_, _], true) => Some(View { frames: axis(0), rows: axis(1), columns: (1, 0) }),
            (&[2..=4, n], false) if n > MOST_COLUMNS_BESIDE_ROWS => {
                Some(View { frames: (1, 0), rows: axis(1), columns: axis(0) })
            }
            (&[_, k], false) if k >= 2 => {
                Some(View { frames: (1, 0), rows: axis(0), columns: axis(1) })
            }
            (&[_, _, k], false) if k >= 2 => {
                Some(View { frames: axis(0), rows: axis(1), columns: axis(2) })
            }
            _ => None,
        }
    }

    /// The array as a column beside `frames` frames of `rows` particles; `None` where it is none.
    pub(super) fn beside(&self, frames: Option<u64>, rows: u64) -> Option<View> {
        let strides = self.strides();
        let (frame_axis, rest) = match (frames, self.shape.as_slice()) {
            (Some(frames), [t, rest @ ..]) if *t == frames && rest.first() == Some(&rows) => {
                ((frames, strides[0]), rest)
            }
            (_, shape) => ((1, 0), shape),
        };
        let first = self.shape.len() - rest.len();
        let columns = match rest {
            [n] if *n == rows => (1, 0),
            [n, k @ 1..=9] if *n == rows && !self.is_record => (*k, strides[first + 1]),
            [n, k, l] if *n == rows && k.saturating_mul(*l) <= 9 && !self.fortran => {
                (k * l, strides[first + 2])
            }
            _ => return None,
        };
        Some(View { frames: frame_axis, rows: (rows, strides[first]), columns })
    }
}

/// How an array's bytes are cut: a length and a stride in bytes along frames, rows and columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    pub(super) frames: (u64, u64),
    pub(super) rows: (u64, u64),
    pub(super) columns: (u64, u64),
}

impl View {
    /// Whether a frame lies in one stretch, row after row.
    pub(super) fn is_row_major(&self, item_bytes: usize) -> bool {
        self.rows.1 == self.columns.0.saturating_mul(item_bytes as u64)
            && (self.frames.0 <= 1 || self.frames.1 == self.rows.0.saturating_mul(self.rows.1))
    }
}
