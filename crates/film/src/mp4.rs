//! MP4, as ISO/IEC 14496-12 (boxes) and 14496-15 (H.264 in them) have it: one track of pictures.
//!
//! > ftyp, mdat (every picture), moov (what they are and where)
//!
//! The pictures go to the file as they come; only their sizes stay in memory, and the table of them is
//! written last. A file without it is no film, which is why it lies under another name until then.

use std::io::{Seek, SeekFrom, Write};

/// What is known of a film before its first picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    pub width: u16,
    pub height: u16,
    /// Ticks of the clock in a second.
    pub timescale: u32,
    /// Ticks that a picture is shown for.
    pub ticks: u32,
}

/// A film that is being written; every call is given the same file.
pub(crate) struct Mp4 {
    track: Track,
    /// SPS and PPS, without start codes.
    parameters: Option<[Vec<u8>; 2]>,
    /// Bytes of each picture.
    sizes: Vec<u32>,
    /// Numbers, from 1, of the pictures that need no other.
    keys: Vec<u32>,
    bytes: u64,
}

/// Begins the film's data: a box whose length follows its name in 64 bits.
const MDAT_HEAD: u64 = 16;

/// NAL unit types, ITU-T H.264, table 7-1.
const IDR: u8 = 5;
const SPS: u8 = 7;
const PPS: u8 = 8;
const DELIMITER: u8 = 9;

impl Mp4 {
    pub fn begin(out: &mut impl Write, track: Track) -> std::io::Result<Self> {
        out.write_all(&file_type())?;
        // The length is put in at the end.
        out.write_all(&[0, 0, 0, 1])?;
        out.write_all(b"mdat")?;
        out.write_all(&0u64.to_be_bytes())?;
        Ok(Self { track, parameters: None, sizes: Vec::new(), keys: Vec::new(), bytes: 0 })
    }

    /// Adds a picture: an access unit with start codes (H.264, Annex B). In the file each unit has its
    /// length before it, and the parameter sets stand apart.
    pub fn add(&mut self, out: &mut impl Write, access_unit: &[u8]) -> std::io::Result<()> {
        let mut size = 0;
        let mut sets = [None, None];
        let mut is_key = false;
        for unit in units(access_unit) {
            match unit.first().map(|head| head & 31) {
                Some(SPS) => sets[0] = Some(unit.to_vec()),
                Some(PPS) => sets[1] = Some(unit.to_vec()),
                Some(DELIMITER) | None => {}
                Some(kind) => {
                    is_key |= kind == IDR;
                    let length = u32::try_from(unit.len()).map_err(std::io::Error::other)?;
                    out.write_all(&length.to_be_bytes())?;
                    out.write_all(unit)?;
                    size += 4 + length;
                }
            }
        }
        if let (None, [Some(sps), Some(pps)]) = (&self.parameters, sets) {
            self.parameters = Some([sps, pps]);
        }
        self.sizes.push(size);
        if is_key {
            self.keys.push(self.sizes.len() as u32);
        }
        self.bytes += u64::from(size);
        Ok(())
    }

    /// Writes the tables.
    pub fn end(self, out: &mut (impl Write + Seek)) -> std::io::Result<()> {
        let start = file_type().len() as u64;
        let [sps, pps] =
            self.parameters.as_ref().ok_or_else(|| std::io::Error::other("no picture"))?;
        let table = movie(&self, [sps, pps], start + MDAT_HEAD);
        out.write_all(&table)?;
        out.seek(SeekFrom::Start(start + 8))?;
        out.write_all(&(MDAT_HEAD + self.bytes).to_be_bytes())
    }
}

/// The units between the start codes 00 00 01, without the zeros before these.
fn units(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut starts: Vec<usize> =
        bytes.windows(3).enumerate().filter(|(_, w)| *w == [0, 0, 1]).map(|(i, _)| i).collect();
    starts.push(bytes.len());
    let found: Vec<&[u8]> = starts
        .windows(2)
        .map(|pair| {
            let mut unit = &bytes[pair[0] + 3..pair[1]];
            // A unit never ends in a zero byte (7.4.1).
            while let [rest @ .., 0] = unit {
                unit = rest;
            }
            unit
        })
        .collect();
    found.into_iter()
}

/// A box: its length, its name, its content.
fn boxed(name: &[u8; 4], content: &[&[u8]]) -> Vec<u8> {
    let length = 8 + content.iter().map(|c| c.len()).sum::<usize>();
    let mut out = Vec::with_capacity(length);
    out.extend((length as u32).to_be_bytes());
    out.extend(name);
    content.iter().for_each(|c| out.extend(*c));
    out
}

/// A box that begins with its version, 0, and 24 flags.
fn full(name: &[u8; 4], flags: u32, content: &[&[u8]]) -> Vec<u8> {
    boxed(name, &[&[&flags.to_be_bytes()[..]], content].concat())
}

fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_be_bytes()).collect()
}

fn halves(halves: &[u16]) -> Vec<u8> {
    halves.iter().flat_map(|h| h.to_be_bytes()).collect()
}

fn file_type() -> Vec<u8> {
    boxed(b"ftyp", &[b"isom", &words(&[0x200]), b"isomiso2avc1mp41"])
}

/// One, in 16.16 fixed point.
const ONE: u32 = 1 << 16;
/// The picture as it is: a 3 × 3 matrix, the last column in 2.30 fixed point.
const UPRIGHT: [u32; 9] = [ONE, 0, 0, 0, ONE, 0, 0, 0, 1 << 30];

fn movie(film: &Mp4, parameters: [&[u8]; 2], data: u64) -> Vec<u8> {
    let Track { width, height, timescale, ticks } = film.track;
    let duration = ticks.saturating_mul(film.sizes.len() as u32);
    let movie_head = full(
        b"mvhd",
        0,
        &[
            &words(&[0, 0, timescale, duration, ONE]),
            &halves(&[0x100, 0, 0, 0, 0, 0]),
            &words(&UPRIGHT),
            &words(&[0, 0, 0, 0, 0, 0, 2]),
        ],
    );
    let track_head = full(
        b"tkhd",
        3, // enabled, and part of the film
        &[
            &words(&[0, 0, 1, 0, duration, 0, 0, 0, 0]),
            &words(&UPRIGHT),
            &words(&[u32::from(width) << 16, u32::from(height) << 16]),
        ],
    );
    // Undetermined language: "und", five bits a letter.
    let media_head =
        full(b"mdhd", 0, &[&words(&[0, 0, timescale, duration]), &halves(&[0x55c4, 0])]);
    let handler = full(b"hdlr", 0, &[&words(&[0]), b"vide", &words(&[0, 0, 0]), b"pictures\0"]);
    let here = full(b"dref", 0, &[&words(&[1]), &full(b"url ", 1, &[])]);
    let information = boxed(
        b"minf",
        &[
            &full(b"vmhd", 1, &[&halves(&[0, 0, 0, 0])]),
            &boxed(b"dinf", &[&here]),
            &samples(film, parameters, data),
        ],
    );
    let media = boxed(b"mdia", &[&media_head, &handler, &information]);
    boxed(b"moov", &[&movie_head, &boxed(b"trak", &[&track_head, &media])])
}

/// The tables of the pictures: all in one piece at `data`, all shown for as long.
fn samples(film: &Mp4, parameters: [&[u8]; 2], data: u64) -> Vec<u8> {
    let count = film.sizes.len() as u32;
    let entry = visual(film.track, parameters);
    boxed(
        b"stbl",
        &[
            &full(b"stsd", 0, &[&words(&[1]), &entry]),
            &full(b"stts", 0, &[&words(&[1, count, film.track.ticks])]),
            &full(b"stss", 0, &[&words(&[film.keys.len() as u32]), &words(&film.keys)]),
            &full(b"stsc", 0, &[&words(&[1, 1, count, 1])]),
            &full(b"stsz", 0, &[&words(&[0, count]), &words(&film.sizes)]),
            &full(b"co64", 0, &[&words(&[1]), &data.to_be_bytes()]),
        ],
    )
}

/// H.264 of this size, in the colours of BT.709, limited range.
fn visual(track: Track, [sps, pps]: [&[u8]; 2]) -> Vec<u8> {
    // Primaries, transfer and matrix of BT.709 (ITU-T H.273), and no full range.
    let color = boxed(b"colr", &[b"nclx", &halves(&[1, 1, 1]), &[0]]);
    let dpi = 72 * ONE;
    boxed(
        b"avc1",
        &[
            &[0; 6],
            &halves(&[1]),
            &[0; 16],
            &halves(&[track.width, track.height]),
            &words(&[dpi, dpi, 0]),
            &halves(&[1]),
            &[0; 32],
            &halves(&[24, 0xffff]),
            &boxed(b"avcC", &[&configuration(sps, pps)]),
            &color,
        ],
    )
}

/// 14496-15, 5.3.3.1: version, profile, its constraints, level; lengths of four bytes; the sets.
fn configuration(sps: &[u8], pps: &[u8]) -> Vec<u8> {
    let mut out = vec![1];
    out.extend(sps.iter().skip(1).take(3));
    out.push(0xff);
    for (count, set) in [(0xe1, sps), (1, pps)] {
        out.push(count);
        out.extend((set.len() as u16).to_be_bytes());
        out.extend(set);
    }
    // High profile tells chroma and depths again: 4:2:0, eight bits, no extension.
    if sps.get(1) == Some(&100) {
        out.extend([0xfd, 0xf8, 0xf8, 0]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// The content of the first box of a path, such as `moov/trak`; names within `stsd` come after
    /// its count, and within `avc1` after its fixed part.
    fn find<'a>(mut bytes: &'a [u8], path: &str) -> &'a [u8] {
        for name in path.split('/') {
            bytes = loop {
                let (head, rest) = bytes.split_at(8);
                let (head_bytes, length) = match numbers(head)[0] {
                    1 => (16, numbers(rest)[1] as usize),
                    length => (8, length as usize),
                };
                let content = &bytes[head_bytes..];
                let length = length - head_bytes;
                if head[4..] == *name.as_bytes() {
                    break &content[..length];
                }
                bytes = &content[length..];
            };
            bytes = match name {
                "stsd" => &bytes[8..],
                "avc1" => &bytes[78..],
                _ => bytes,
            };
        }
        bytes
    }

    fn numbers(bytes: &[u8]) -> Vec<u32> {
        bytes.chunks_exact(4).map(|w| u32::from_be_bytes(w.try_into().unwrap())).collect()
    }

    const SETS: &[u8] = &[0, 0, 0, 1, 0x67, 100, 0, 40, 9, 0, 0, 1, 0x68, 3];

    fn film() -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        let track = Track { width: 320, height: 200, timescale: 25000, ticks: 1000 };
        let mut film = Mp4::begin(&mut out, track).unwrap();
        film.add(&mut out, &[SETS, &[0, 0, 0, 1, 0x65, 1, 2, 3]].concat()).unwrap();
        film.add(&mut out, &[0, 0, 1, 0x41, 4, 0, 0, 3]).unwrap();
        film.add(&mut out, &[SETS, &[0, 0, 1, 0x65, 5]].concat()).unwrap();
        film.end(&mut out).unwrap();
        out.into_inner()
    }

    #[test]
    fn pictures_lie_in_the_data_with_their_lengths() {
        let file = film();
        let data: &[u8] =
            &[0, 0, 0, 4, 0x65, 1, 2, 3, 0, 0, 0, 5, 0x41, 4, 0, 0, 3, 0, 0, 0, 2, 0x65, 5];
        assert_eq!(find(&file, "mdat"), data);
        let stbl = find(&file, "moov/trak/mdia/minf/stbl");
        assert_eq!(numbers(find(stbl, "stsz")), [0, 0, 3, 8, 9, 6]);
        assert_eq!(numbers(find(stbl, "stss")), [0, 2, 1, 3]);
        assert_eq!(numbers(find(stbl, "stts")), [0, 1, 3, 1000]);
        let at = numbers(find(stbl, "co64"))[3] as usize;
        assert_eq!(&file[at..at + data.len()], data);
    }

    #[test]
    fn sizes_times_and_colours_are_told() {
        let file = film();
        let entry = "moov/trak/mdia/minf/stbl/stsd/avc1";
        let avcc = find(&file, &format!("{entry}/avcC"));
        let sets = [&[1, 100, 0, 40, 0xff, 0xe1, 0, 5][..], &SETS[4..9], &[1, 0, 2, 0x68, 3]];
        assert_eq!(avcc, [&sets.concat()[..], &[0xfd, 0xf8, 0xf8, 0]].concat());
        assert_eq!(find(&file, &format!("{entry}/colr")), b"nclx\0\x01\0\x01\0\x01\0");
        assert_eq!(numbers(&find(&file, "moov/mvhd")[12..20]), [25000, 3000]);
        let tkhd = find(&file, "moov/trak/tkhd");
        assert_eq!(numbers(&tkhd[tkhd.len() - 8..]), [320 << 16, 200 << 16]);
    }

    #[test]
    fn a_film_without_a_picture_is_none() {
        let track = Track { width: 2, height: 2, timescale: 25000, ticks: 1000 };
        let mut out = Cursor::new(Vec::new());
        let film = Mp4::begin(&mut out, track).unwrap();
        assert!(film.end(&mut out).is_err());
    }
}
