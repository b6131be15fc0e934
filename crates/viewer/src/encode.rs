//! Pictures to bytes: the head of a frame, then JPEG or PNG.
//!
//! The head has 40 bytes, little endian: `MOTE`, serial, flags (1 exact, 2 coarse, 4 playing), width and
//! height (u16), codec (1 JPEG, 2 PNG) and three zeros, frame, milliseconds (f32), state, hash (u64).

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};

use crate::Picture;

/// How pixels become bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Codec {
    /// With a quality of 1 to 100.
    Jpeg(u8),
    /// Without loss.
    Png,
}

/// From this quality on colours are as sharp as brightness.
const SHARP: u8 = 90;

/// The bytes of a frame.
///
/// # Errors
/// The picture has no pixels, or not as many as its size says.
pub(crate) fn frame(picture: &Picture, serial: u32, codec: Codec) -> Result<Vec<u8>, String> {
    let (width, height) = picture.size;
    if picture.rgb.len() != 3 * usize::from(width) * usize::from(height) {
        return Err(format!("a picture of {width}×{height} has {} bytes", picture.rgb.len()));
    }
    let mut out = head(picture, serial, codec);
    match codec {
        Codec::Jpeg(quality) => {
            let mut encoder = Encoder::new(&mut out, quality);
            let sharp = quality >= SHARP;
            encoder.set_sampling_factor(if sharp {
                SamplingFactor::F_1_1
            } else {
                SamplingFactor::F_2_2
            });
            encoder
                .encode(&picture.rgb, width, height, ColorType::Rgb)
                .map_err(|e| e.to_string())?;
        }
        Codec::Png => {
            let mut encoder = png::Encoder::new(&mut out, width.into(), height.into());
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_compression(png::Compression::Fast);
            let mut writer = encoder.write_header().map_err(|e| e.to_string())?;
            writer.write_image_data(&picture.rgb).map_err(|e| e.to_string())?;
        }
    }
    Ok(out)
}

fn head(picture: &Picture, serial: u32, codec: Codec) -> Vec<u8> {
    let flag = |on: bool, bit: u32| if on { bit } else { 0 };
    let flags = flag(picture.exact, 1) | flag(picture.coarse, 2) | flag(picture.playing, 4);
    let codec = match codec {
        Codec::Jpeg(_) => 1,
        Codec::Png => 2,
    };
    let ms = picture.took.as_secs_f32() * 1e3;
    let mut out = Vec::with_capacity(picture.rgb.len() / 4);
    out.extend(b"MOTE");
    out.extend(serial.to_le_bytes());
    out.extend(flags.to_le_bytes());
    out.extend(picture.size.0.to_le_bytes());
    out.extend(picture.size.1.to_le_bytes());
    out.extend([codec, 0, 0, 0]);
    out.extend(picture.frame.to_le_bytes());
    out.extend(ms.to_le_bytes());
    out.extend(picture.state.to_le_bytes());
    out.extend(picture.hash.to_le_bytes());
    out
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn picture(rgb: Vec<u8>) -> Picture {
        Picture {
            size: (2, 1),
            rgb,
            exact: true,
            coarse: false,
            playing: true,
            frame: 7,
            took: Duration::from_millis(12),
            state: 9,
            hash: 0x0123_4567_89ab_cdef,
        }
    }

    #[test]
    fn the_head_is_as_agreed() {
        let png = frame(&picture(vec![0, 1, 2, 253, 254, 255]), 5, Codec::Png).unwrap();
        let head = b"MOTE\x05\0\0\0\x05\0\0\0\x02\0\x01\0\x02\0\0\0\x07\0\0\0";
        assert_eq!(&png[..24], head);
        assert_eq!(f32::from_le_bytes(png[24..28].try_into().unwrap()), 12.0);
        assert_eq!(&png[28..40], b"\x09\0\0\0\xef\xcd\xab\x89\x67\x45\x23\x01");
        let mut reader = png::Decoder::new(std::io::Cursor::new(&png[40..])).read_info().unwrap();
        let mut pixels = vec![0; 6];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, [0, 1, 2, 253, 254, 255]);
    }

    #[test]
    fn a_jpeg_begins_as_one() {
        for quality in [40, 95] {
            let jpeg = frame(&picture(vec![9; 6]), 1, Codec::Jpeg(quality)).unwrap();
            assert_eq!((jpeg[16], &jpeg[40..43]), (1, &b"\xff\xd8\xff"[..]));
        }
    }

    #[test]
    fn too_few_pixels_are_refused() {
        assert!(frame(&picture(vec![0; 5]), 1, Codec::Png).is_err());
    }
}
