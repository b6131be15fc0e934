//! OpenEXR: every layer as a part of one file, lossless, for compositing.
//!
//! Parts bear the names of [`Frame::named_values`]. Channels: `color` R, G, B, A (linear,
//! premultiplied); `normal` X, Y, Z; `depth` and `thickness` Z; `id`, `system` and `span_count` as
//! unsigned 32-bit channels of their part's name. OpenEXR has no 64-bit integers, so `id` holds the low
//! half of the index in two's complement: −1, nothing, is 4 294 967 295. Only when an index needs more
//! than 32 bits does the part have a second channel, `id.high`, with the other half.

use std::io::{Seek, Write};

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, Vec2, WritableImage,
};

use crate::{Frame, FrameError, Result, Values};

/// Lossless, line by line from the top, so that equal frames have equal bytes.
const ENCODING: Encoding = Encoding {
    compression: Compression::ZIP1,
    blocks: Blocks::ScanLines,
    line_order: LineOrder::Increasing,
};

/// Writes colour and all layers as a multi-part OpenEXR file.
///
/// # Errors
///
/// If the frame has no pixel or more than 2³⁰ a side, or `out` fails.
pub fn write_exr(frame: &Frame, out: impl Write + Seek) -> Result<()> {
    let (width, height) = (frame.width(), frame.height());
    if [width, height].iter().any(|side| !(1..=1 << 30).contains(side)) {
        return Err(FrameError::Unwritable { format: "EXR", width, height });
    }
    let parts = frame.named_values().map(|(name, values)| {
        Layer::new(
            Vec2(width, height),
            LayerAttributes::named(name),
            ENCODING,
            AnyChannels::sort(channels(name, values).into()),
        )
    });
    let attributes = exr::prelude::ImageAttributes::with_size((width, height));
    let image = Image::from_layers(attributes, parts.collect::<Vec<_>>());
    image.write().to_buffered(out).map_err(FrameError::encode("EXR"))
}

fn channels(name: &str, values: Values<'_>) -> Vec<AnyChannel<FlatSamples>> {
    let number = |name: &str, samples| AnyChannel::new(name, FlatSamples::F32(samples));
    let index = |name: &str, samples| AnyChannel::new(name, FlatSamples::U32(samples));
    match values {
        Values::F32(v) => vec![number("Z", v.to_vec())],
        Values::F32x3(v) => components(v, ["X", "Y", "Z"]),
        Values::F32x4(v) => components(v, ["R", "G", "B", "A"]),
        Values::U16(v) => vec![index(name, v.iter().map(|&n| u32::from(n)).collect())],
        Values::U32(v) => vec![index(name, v.to_vec())],
        Values::I64(v) => {
            let mut halves = vec![index(name, v.iter().map(|&n| n as u32).collect())];
            if v.iter().any(|&n| n < -1 || n >= i64::from(u32::MAX)) {
                let high = v.iter().map(|&n| (n >> 32) as u32).collect();
                halves.push(index(&format!("{name}.high"), high));
            }
            halves
        }
    }
}

fn components<const N: usize>(
    pixels: &[[f32; N]],
    names: [&str; N],
) -> Vec<AnyChannel<FlatSamples>> {
    let channel = |(i, name): (usize, &str)| {
        let samples = pixels.iter().filter_map(|p| p.get(i).copied()).collect();
        AnyChannel::new(name, FlatSamples::F32(samples))
    };
    names.into_iter().enumerate().map(channel).collect()
}
