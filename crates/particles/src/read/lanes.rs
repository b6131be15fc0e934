//! Numbers as files store them, and how whole columns of them are taken out of a block of bytes.
//!
//! A [`Lane`] is one number per row at a constant stride: a property of a PLY vertex, a field of a
//! NumPy record, a column of an array in C or Fortran order. All binary tables are read through it.

use crate::Values;

/// How one number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of one number.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether it holds fractions.
    pub(crate) fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// An empty column for such numbers: floats stay what they are (halves become single), integers
    /// take the next type that holds them all.
    pub(crate) fn empty_values(self) -> Values {
        match self {
            Self::U8 => Values::U8(Vec::new()),
            Self::I8 | Self::I16 | Self::U16 | Self::I32 => Values::I32(Vec::new()),
            Self::U32 | Self::I64 | Self::U64 => Values::I64(Vec::new()),
            Self::F16 | Self::F32 => Values::F32(Vec::new()),
            Self::F64 => Values::F64(Vec::new()),
        }
    }
}

/// Which byte of a number comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

/// One number per row at a constant stride in a block of bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lane<'a> {
    pub(crate) bytes: &'a [u8],
    /// Where row 0 lies.
    pub(crate) start: usize,
    /// Bytes from row to row.
    pub(crate) stride: usize,
    pub(crate) scalar: Scalar,
    pub(crate) order: ByteOrder,
}

/// Single precision from the bits of an IEEE 754 half.
pub(crate) fn half(bits: u16) -> f32 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (bits >> 10 & 31, f32::from(bits & 1023));
    match exponent {
        0 => sign * fraction * 2f32.powi(-24),
        31 if fraction == 0.0 => sign * f32::INFINITY,
        31 => f32::NAN,
        e => sign * (1.0 + fraction / 1024.0) * 2f32.powi(i32::from(e) - 15),
    }
}

impl Lane<'_> {
    /// A lane that is zero in every row.
    pub(crate) fn zero(scalar: Scalar) -> Lane<'static> {
        Lane { bytes: &[0; 8], start: 0, stride: 0, scalar, order: ByteOrder::Little }
    }

    /// Whether `rows` rows lie within the bytes.
    pub(crate) fn holds(&self, rows: usize) -> bool {
        let last = rows.saturating_sub(1).checked_mul(self.stride);
        let end = last.and_then(|l| l.checked_add(self.start)?.checked_add(self.scalar.bytes()));
        rows == 0 || end.is_some_and(|end| end <= self.bytes.len())
    }

    fn at<const N: usize>(&self, row: usize) -> [u8; N] {
        let start = self.start + row * self.stride;
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[start..start + N]);
        bytes
    }

    /// The number of `row`.
    pub(crate) fn number(&self, row: usize) -> f64 {
        let big = self.order == ByteOrder::Big;
        macro_rules! read {
            ($t:ty) => {
                if big {
                    <$t>::from_be_bytes(self.at(row))
                } else {
                    <$t>::from_le_bytes(self.at(row))
                }
            };
        }
        match self.scalar {
            Scalar::I8 => f64::from(read!(i8)),
            Scalar::U8 => f64::from(read!(u8)),
            Scalar::I16 => f64::from(read!(i16)),
            Scalar::U16 => f64::from(read!(u16)),
            Scalar::I32 => f64::from(read!(i32)),
            Scalar::U32 => f64::from(read!(u32)),
            Scalar::I64 => read!(i64) as f64,
            Scalar::U64 => read!(u64) as f64,
            Scalar::F16 => f64::from(half(read!(u16))),
            Scalar::F32 => f64::from(read!(f32)),
            Scalar::F64 => read!(f64),
        }
    }
}

/// Row by row, the numbers of `lanes`, `N` bytes each.
fn gather<const N: usize, T, U: From<T>>(
    out: &mut Vec<U>,
    lanes: &[Lane<'_>],
    rows: usize,
    read: impl Fn([u8; N]) -> T,
) {
    out.reserve(rows * lanes.len());
    match lanes {
        [lane] => out.extend((0..rows).map(|row| U::from(read(lane.at(row))))),
        _ => {
            for row in 0..rows {
                out.extend(lanes.iter().map(|lane| U::from(read(lane.at(row)))));
            }
        }
    }
}

/// Appends `rows` rows of `lanes`, one component each, to a column.
///
/// Lanes of one type keep it as [`Scalar::empty_values`] says; mixed lanes become f64, as does a
/// column of unsigned 64-bit integers with a value that i64 cannot hold.
pub(crate) fn append(values: &mut Values, lanes: &[Lane<'_>], rows: usize) {
    let Some(first) = lanes.first() else { return };
    let (scalar, order) = (first.scalar, first.order);
    if lanes.iter().any(|l| l.scalar != scalar || l.order != order) {
        return append_f64(values, lanes, rows);
    }
    let big = order == ByteOrder::Big;
    macro_rules! take {
        ($out:expr, $t:ty) => {
            gather($out, lanes, rows, |b| {
                if big { <$t>::from_be_bytes(b) } else { <$t>::from_le_bytes(b) }
            })
        };
    }
    match (scalar, &mut *values) {
        (Scalar::U8, Values::U8(out)) => take!(out, u8),
        (Scalar::I8, Values::I32(out)) => take!(out, i8),
        (Scalar::I16, Values::I32(out)) => take!(out, i16),
        (Scalar::U16, Values::I32(out)) => take!(out, u16),
        (Scalar::I32, Values::I32(out)) => take!(out, i32),
        (Scalar::U32, Values::I64(out)) => take!(out, u32),
        (Scalar::I64, Values::I64(out)) => take!(out, i64),
        (Scalar::F32, Values::F32(out)) => take!(out, f32),
        (Scalar::F64, Values::F64(out)) => take!(out, f64),
        (Scalar::F16, Values::F32(out)) => gather(out, lanes, rows, |b| {
            half(if big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
        }),
        (Scalar::U64, Values::I64(out)) => {
            let before = out.len();
            take!(out, Bits);
            if out[before..].iter().any(|v| *v < 0) {
                out.truncate(before);
                append_f64(values, lanes, rows);
            }
        }
        _ => append_f64(values, lanes, rows),
    }
}

/// The bits of an unsigned 64-bit integer, to be looked at as i64.
struct Bits(u64);

impl Bits {
    fn from_le_bytes(b: [u8; 8]) -> Self {
        Self(u64::from_le_bytes(b))
    }

    fn from_be_bytes(b: [u8; 8]) -> Self {
        Self(u64::from_be_bytes(b))
    }
}

impl From<Bits> for i64 {
    fn from(bits: Bits) -> Self {
        bits.0.cast_signed()
    }
}

/// Appends as f64, turning what is there to f64 first.
fn append_f64(values: &mut Values, lanes: &[Lane<'_>], rows: usize) {
    if !matches!(values, Values::F64(_)) {
        *values = Values::F64((0..values.len()).map(|i| values.number(i)).collect());
    }
    if let Values::F64(out) = values {
        for row in 0..rows {
            out.extend(lanes.iter().map(|lane| lane.number(row)));
        }
    }
}

/// The numbers of a lane of little-endian single precision, without looking at its type in each row.
fn singles<'a>(lane: &Lane<'a>, rows: usize) -> Option<impl Iterator<Item = f32> + 'a> {
    let is_single = lane.scalar == Scalar::F32 && lane.order == ByteOrder::Little;
    if !is_single || lane.stride == 0 || !lane.holds(rows) {
        return None;
    }
    let rows = lane.bytes.get(lane.start..)?.chunks(lane.stride).take(rows);
    Some(rows.map(|row| row.first_chunk().map_or(0.0, |bytes| f32::from_le_bytes(*bytes))))
}

/// Appends `rows` positions as single precision.
pub(crate) fn append_positions(out: &mut Vec<[f32; 3]>, lanes: &[Lane<'_>; 3], rows: usize) {
    let [x, y, z] = lanes.each_ref().map(|lane| singles(lane, rows));
    match (x, y, z) {
        (Some(x), Some(y), Some(z)) => out.extend(x.zip(y).zip(z).map(|((x, y), z)| [x, y, z])),
        _ => {
            out.extend((0..rows).map(|row| std::array::from_fn(|i| lanes[i].number(row) as f32)));
        }
    }
}

/// Appends `rows` numbers times `factor` as single precision.
pub(crate) fn append_scaled(out: &mut Vec<f32>, lane: &Lane<'_>, rows: usize, factor: f64) {
    match singles(lane, rows).filter(|_| factor == 1.0) {
        Some(numbers) => out.extend(numbers),
        None => out.extend((0..rows).map(|row| (lane.number(row) * factor) as f32)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lane(bytes: &[u8], stride: usize, scalar: Scalar, order: ByteOrder) -> Lane<'_> {
        Lane { bytes, start: 0, stride, scalar, order }
    }

    #[test]
    fn halves_are_ieee() {
        let known = [(0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65504.0), (0x0001, 5.960_464_5e-8)];
        for (bits, value) in known {
            assert_eq!(half(bits), value);
        }
        assert_eq!(half(0x7c00), f32::INFINITY);
        assert!(half(0x7e01).is_nan());
    }

    #[test]
    fn both_byte_orders_give_the_number() {
        let big = lane(&[0x01, 0x02], 2, Scalar::U16, ByteOrder::Big);
        let little = lane(&[0x01, 0x02], 2, Scalar::U16, ByteOrder::Little);
        assert_eq!((big.number(0), little.number(0)), (258.0, 513.0));
    }

    #[test]
    fn a_lane_knows_where_it_ends() {
        let l = lane(&[0; 10], 4, Scalar::U16, ByteOrder::Little);
        assert!(l.holds(3) && !l.holds(4));
        assert!(!lane(&[0; 10], usize::MAX, Scalar::U8, ByteOrder::Little).holds(3));
    }

    #[test]
    fn great_unsigned_integers_become_f64() {
        let mut values = Scalar::U64.empty_values();
        let small = 7u64.to_le_bytes();
        append(&mut values, &[lane(&small, 8, Scalar::U64, ByteOrder::Little)], 1);
        assert_eq!(values, Values::I64(vec![7]));
        let great = u64::MAX.to_le_bytes();
        append(&mut values, &[lane(&great, 8, Scalar::U64, ByteOrder::Little)], 1);
        assert_eq!(values, Values::F64(vec![7.0, 18_446_744_073_709_551_615.0]));
    }
}
