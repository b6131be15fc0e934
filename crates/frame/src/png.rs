//! PNG: eight-bit sRGB for eyes, with the scene in it for the next picture.

use std::io::{Cursor, Write};

use png::{
    BitDepth, ColorType, Compression, Decoder, Encoder, Filter, SrgbRenderingIntent,
    Transformations,
};

use crate::{Frame, FrameError, Result, Rgba8, srgb};

/// The iTXt keyword under which a picture holds the TOML of its scene.
const SCENE_KEYWORD: &str = "motes:scene";
/// Longest scene that is read back, in bytes; a longer one is no scene.
const MAX_SCENE: usize = 16 << 20;

/// Largest picture that is read, in bytes: 16 384 × 16 384 of RGBA.
const MAX_PICTURE: usize = 1 << 30;

/// What a PNG holds besides the colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PngOptions<'a> {
    /// Whether there is an alpha channel.
    pub transparency: Transparency,
    /// The scene as TOML, to be kept in the file.
    pub scene: Option<&'a str>,
}

/// What becomes of alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transparency {
    /// RGB: what is not covered shows black.
    #[default]
    Drop,
    /// RGBA with straight alpha.
    Keep,
}

/// Writes the frame's colours as an eight-bit sRGB PNG.
///
/// # Errors
///
/// If the frame has no pixel or more than 2³¹ − 1 a side, or `out` fails.
pub fn write_png(frame: &Frame, options: PngOptions<'_>, out: impl Write) -> Result<()> {
    let (width, height) = (frame.width(), frame.height());
    let side = |n: usize| u32::try_from(n).ok().filter(|n| (1..=i32::MAX as u32).contains(n));
    let (Some(w), Some(h)) = (side(width), side(height)) else {
        return Err(FrameError::Unwritable { format: "PNG", width, height });
    };
    let failed = FrameError::encode("PNG");
    let mut encoder = Encoder::new(out, w, h);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder.set_compression(Compression::Fast);
    // Three times as fast as trying all filters, and as small for shaded pictures.
    encoder.set_filter(Filter::Paeth);
    if let Some(scene) = options.scene {
        encoder.add_itxt_chunk(SCENE_KEYWORD.into(), scene.into()).map_err(&failed)?;
    }
    let bytes = match options.transparency {
        Transparency::Drop => {
            encoder.set_color(ColorType::Rgb);
            srgb::rgb8(frame)
        }
        Transparency::Keep => {
            encoder.set_color(ColorType::Rgba);
            Rgba8::from(frame).pixels.into_flattened()
        }
    };
    let mut writer = encoder.write_header().map_err(&failed)?;
    writer.write_image_data(&bytes).map_err(&failed)?;
    writer.finish().map_err(&failed)
}

/// The TOML of the scene that a PNG was made from, if it is a PNG and holds one.
pub fn scene_in_png(bytes: &[u8]) -> Option<String> {
    let reader = Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let mut chunk =
        reader.info().utf8_text.iter().find(|chunk| chunk.keyword == SCENE_KEYWORD)?.clone();
    chunk.decompress_text_with_limit(MAX_SCENE).ok()?;
    chunk.get_text().ok()
}

/// Reads any PNG as eight-bit RGBA, for comparing pictures.
///
/// # Errors
///
/// If the bytes are no PNG, or one that is cut off.
pub fn read_png(bytes: &[u8]) -> Result<Rgba8> {
    let failed = |e: png::DecodingError| FrameError::NotPng(e.to_string());
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::normalize_to_color8() | Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(failed)?;
    let size = reader.output_buffer_size().filter(|size| *size <= MAX_PICTURE);
    let size = size.ok_or_else(|| FrameError::NotPng("more than 2³⁰ bytes of pixels".into()))?;
    let mut buffer = vec![0; size];
    let info = reader.next_frame(&mut buffer).map_err(failed)?;
    let pixels = buffer.get(..info.buffer_size()).unwrap_or_default();
    let pixels: Vec<[u8; 4]> = match info.color_type {
        ColorType::GrayscaleAlpha => {
            pixels.chunks_exact(2).map(|p| [p[0], p[0], p[0], p[1]]).collect()
        }
        _ => pixels.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect(),
    };
    Ok(Rgba8 { width: info.width as usize, height: info.height as usize, pixels })
}
