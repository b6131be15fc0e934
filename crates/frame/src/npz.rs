//! NPZ: every layer as a NumPy array, under the names of [`Frame::named_values`].
//!
//! A zip archive of `.npy` files (NumPy enhancement proposal 1, format version 1.0): `color` and
//! `normal` are H×W×4 and H×W×3, all others H×W; the least significant byte comes first.

use std::borrow::Cow;
use std::io::{Seek, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::frame::le_bytes;
use crate::{Frame, FrameError, Result, Values};

/// Writes colour and all layers as an NPZ archive.
///
/// # Errors
///
/// If `out` fails.
pub fn write_npz(frame: &Frame, out: impl Write + Seek) -> Result<()> {
    let failed = FrameError::encode::<zip::result::ZipError>("NPZ");
    let io_failed = FrameError::encode::<std::io::Error>("NPZ");
    let mut archive = ZipWriter::new(out);
    for (name, values) in frame.named_values() {
        let (descriptor, components, bytes) = described(values);
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            // Floats hardly shrink further for ten times the work.
            .compression_level(Some(1))
            .large_file(bytes.len() as u64 >= u64::from(u32::MAX) / 2);
        archive.start_file(format!("{name}.npy"), options).map_err(&failed)?;
        let header = npy_header(descriptor, frame.height(), frame.width(), components);
        archive.write_all(&header).map_err(&io_failed)?;
        archive.write_all(&bytes).map_err(&io_failed)?;
    }
    archive.finish().map_err(&failed)?.flush().map_err(&io_failed)
}

/// NumPy's type, the number of components if there are several, and the bytes.
fn described(values: Values<'_>) -> (&'static str, Option<usize>, Cow<'_, [u8]>) {
    match values {
        Values::F32(v) => ("<f4", None, le_bytes(v)),
        Values::F32x3(v) => ("<f4", Some(3), le_bytes(v)),
        Values::F32x4(v) => ("<f4", Some(4), le_bytes(v)),
        Values::I64(v) => ("<i8", None, le_bytes(v)),
        Values::U16(v) => ("<u2", None, le_bytes(v)),
        Values::U32(v) => ("<u4", None, le_bytes(v)),
    }
}

/// Magic, version, header length, a Python dictionary, spaces up to a multiple of 64, a line feed.
fn npy_header(descriptor: &str, height: usize, width: usize, components: Option<usize>) -> Vec<u8> {
    let shape = match components {
        Some(n) => format!("({height}, {width}, {n})"),
        None => format!("({height}, {width})"),
    };
    let dictionary =
        format!("{{'descr': '{descriptor}', 'fortran_order': False, 'shape': {shape}, }}");
    let length = (10 + dictionary.len() + 1).next_multiple_of(64) - 10;
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    // At most some 120 bytes, whatever the shape.
    header.extend((length as u16).to_le_bytes());
    header.extend(format!("{dictionary:<width$}\n", width = length - 1).bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_numpys_own() {
        // What numpy.save writes for an array of 2×3 float32 before its data.
        let expected = format!(
            "\u{1}\0v\0{:<117}\n",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }"
        );
        let header = npy_header("<f4", 2, 3, None);
        assert_eq!(&header[..6], b"\x93NUMPY");
        assert_eq!(&header[6..], expected.as_bytes());
    }

    #[test]
    fn headers_of_every_size_are_aligned() {
        for side in [0, 1, 12, 123_456, usize::MAX] {
            assert_eq!(npy_header("<i8", side, side, Some(4)).len() % 64, 0);
        }
    }
}
