//! Files made to do harm: compressed to a millionth, with absurd numbers and counts, of one endless
//! line, of bytes that are no text. Nothing may panic, hang, or take memory out of proportion.

mod common;

use std::io::Write;
use std::path::PathBuf;

use motes_particles::read::{Wanted, open};

const MEBIBYTE: usize = 1 << 20;
/// How much the bombs inflate to.
const BOMB_MEBIBYTES: usize = 512;

/// A small file of each text format.
const TEXTS: [(&str, &str); 8] = [
    ("a.xyz", "2\nenergy 3\nH 1 2 3 4\nO 5 6 7 8\n2\n\nH 1 2 3 4\nO 5 6 7 8\n"),
    (
        "b.xyz",
        "2\nProperties=species:S:1:pos:R:3:id:I:1 Lattice=\"5 0 0 0 5 0 0 0 5\" Time=1\n\
         H 1 2 3 4\nO 5 6 7 8\n",
    ),
    (
        "a.dump",
        "ITEM: TIMESTEP\n10\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 9\n0 9\n0 9\n\
         ITEM: ATOMS id type xs ys zs\n1 1 0.5 0.5 0.25\n2 1 0.1 0.2 0.3\n",
    ),
    (
        "a.pdb",
        "CRYST1   10.000   10.000   10.000  90.00  90.00  90.00 P 1           1\nMODEL        1\n\
         ATOM      1  N   ASN A   1      -8.901   4.127  -0.555  1.00  2.00           N  \n\
         ATOM      2  CA  ASN A   1      -8.608   3.135  -1.618  1.00  3.00           C  \nENDMDL\n",
    ),
    (
        "a.ply",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty double y\n\
         property int z\nproperty list uchar int more\nend_header\n1 2 3 1 4\n5 6 7 2 8 9\n",
    ),
    (
        "a.vtk",
        "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n1 2 3\n4 5 6\n\
         VERTICES 2 4\n1 0\n1 1\nPOINT_DATA 2\nSCALARS id int 1\nLOOKUP_TABLE default\n7 8\n",
    ),
    (
        "a.geo",
        "PGEOMETRY V5\nNPoints 2 NPrims 0\nNPointGroups 0 NPrimGroups 0\n\
         NPointAttrib 1 NVertexAttrib 0 NPrimAttrib 0 NAttrib 0\nPointAttrib\nid 1 int 0\n\
         1 2 3 1 (7)\n4 5 6 1 (8)\nbeginExtra\nendExtra\n",
    ),
    ("a.csv", "x,y,z,radius,name\n1,2,3,4,a\n5,6,7,8,b\n"),
];

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

/// `head`, then one byte again and again: a gzip file of many members.
fn gzip_bomb(head: &[u8], pattern: &[u8]) -> Vec<u8> {
    let member = gzip(&pattern.repeat(16 * MEBIBYTE / pattern.len()));
    [gzip(head), member.repeat(BOMB_MEBIBYTES / 16)].concat()
}

/// The same as Zstandard (RFC 8878): a frame of one raw block, then one of blocks that say "128 KiB
/// of this byte".
fn zstd_bomb(head: &[u8], byte: u8) -> Vec<u8> {
    let frame = [0x28, 0xb5, 0x2f, 0xfd, 0, 7 << 3];
    let block = |kind: u32, size: usize, last: u32| {
        let header = (size as u32) << 3 | kind << 1 | last;
        header.to_le_bytes()[..3].to_vec()
    };
    let mut out = [&frame[..], &block(0, head.len(), 1), head, &frame[..]].concat();
    let blocks = BOMB_MEBIBYTES * 8;
    for i in 0..blocks {
        out.extend(block(1, 128 << 10, u32::from(i + 1 == blocks)));
        out.push(byte);
    }
    out
}

/// The header of an NPY file of `rows` positions.
fn npy_header(rows: u64) -> Vec<u8> {
    let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, 3), }}");
    let mut out = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    out.extend(format!("{text:<117}\n").bytes());
    out
}

/// An archive of one deflated array.
fn npz(content: &[u8]) -> Vec<u8> {
    let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    deflated.write_all(content).unwrap();
    let data = deflated.finish().unwrap();
    let name = b"position.npy";
    let sizes = [data.len() as u32, content.len() as u32].map(u32::to_le_bytes).concat();
    // Version, flags, method 8, time, date, checksum; sizes; lengths of name and extra.
    let common =
        [&[20, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0], &sizes[..], &[12, 0, 0, 0]].concat();
    let local = [&b"PK\x03\x04"[..], &common, name, &data].concat();
    let entry = [&b"PK\x01\x02\x14\x00"[..], &common, &[0; 14], name].concat();
    let end = [entry.len() as u32, local.len() as u32].map(u32::to_le_bytes).concat();
    let counts = [0, 0, 0, 0, 1, 0, 1, 0];
    [&local, &entry, &b"PK\x05\x06"[..], &counts, &end, &[0, 0]].concat()
}

/// The most memory this process ever held, in MiB, where the system tells.
fn peak_mebibytes() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_ascii_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib / 1024)
}

fn write(name: &str, bytes: &[u8]) -> PathBuf {
    let path = common::scratch("hostile").join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Opens and reads frame 0; the error as text.
fn read_first(path: &std::path::Path) -> Result<usize, String> {
    let read = || open(path)?.1.read(0, &Wanted::All, &|_, _| {}).map(|particles| particles.len());
    read().map_err(|e: motes_particles::ReadError| e.to_string())
}

#[test]
fn bombs_are_refused_in_bounded_memory() {
    let many = 1_000_000_000_000_u64;
    let vtk =
        format!("# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nPOINTS {many} float\n");
    let bgeo = [&b"BgeoV"[..], &[5, i32::MAX, 0, 0, 0, 0, 0, 0, 0].map(i32::to_be_bytes).concat()];
    let ply = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {many}\nproperty float x\n\
         property float y\nproperty float z\nend_header\n"
    );
    let dump = format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{many}\nITEM: BOX BOUNDS pp pp pp\n\
         0 1\n0 1\n0 1\nITEM: ATOMS x y z\n"
    );
    let row = "H 1 2 3\n".repeat(20);
    let heads = [
        ("bomb.vtk", vtk.into_bytes()),
        ("bomb.bgeo", bgeo.concat()),
        ("bomb.ply", ply.into_bytes()),
        ("bomb.npy", npy_header(many)),
        ("bomb.dump", dump.into_bytes()),
        ("bomb.xyz", format!("{many}\n\n{row}").into_bytes()),
        ("bomb.csv", b"x,y,z\n1,2,3\n".to_vec()),
    ];
    for (name, head) in heads {
        let is_text = name.ends_with("xyz") || name.ends_with("csv");
        let byte = if is_text { b'\n' } else { 0 };
        for bomb in [gzip_bomb(&head, &[byte]), zstd_bomb(&head, byte)] {
            let error = read_first(&write(name, &bomb)).unwrap_err();
            assert!(error.contains(name) && error.len() > 40, "{error}");
        }
        // As it is: the count alone.
        assert!(name == "bomb.csv" || read_first(&write(name, &head)).is_err(), "{name}");
    }
    let bomb = gzip_bomb(format!("{many}\n\n{row}").as_bytes(), b"H 1 2 3\n");
    let error = read_first(&write("rows.xyz", &bomb)).unwrap_err();
    assert!(error.contains("inflate"), "{error}");
    let array = [npy_header(many), vec![0; 256 * MEBIBYTE]].concat();
    let archive = npz(&array);
    drop(array);
    let error = read_first(&write("bomb.npz", &archive)).unwrap_err();
    assert!(error.contains("inflate"), "{error}");
    // What is made to test with counts too.
    assert!(peak_mebibytes().is_none_or(|peak| peak < 2048), "{:?} MiB", peak_mebibytes());
}

#[test]
fn a_small_archive_is_read() {
    let content = [npy_header(2), [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat()];
    assert_eq!(read_first(&write("small.npz", &npz(&content.concat()))), Ok(2));
}

#[test]
fn the_texts_are_sound() {
    for (name, text) in TEXTS {
        assert_eq!(read_first(&write(&format!("sound_{name}"), text.as_bytes())), Ok(2), "{name}");
    }
}

/// The text with its `n`-th number replaced.
fn with_number(text: &str, n: usize, number: &str) -> Option<String> {
    let is_digit = |c: char| c.is_ascii_digit();
    let mut starts = text
        .char_indices()
        .filter(|(i, c)| is_digit(*c) && !text[..*i].ends_with(|c: char| is_digit(c) || c == '.'));
    let (start, _) = starts.nth(n)?;
    let rest = &text[start..];
    let end = rest.find(|c: char| !is_digit(c) && c != '.').unwrap_or(rest.len());
    Some(format!("{}{number}{}", &text[..start], &rest[end..]))
}

#[test]
fn absurd_numbers_do_no_harm() {
    let folder = common::scratch("absurd");
    let numbers = [
        "1e400",
        "-1e400",
        "1e-400",
        "-0",
        "-1",
        "nan",
        "inf",
        "9223372036854775808",
        "4294967296",
        "99999999999999999999999999",
        "1000000000000",
        "",
        "0x10",
        "1,5",
        "٣",
        "--",
        "1e",
    ];
    for (name, text) in TEXTS {
        for number in numbers {
            for n in 0.. {
                let Some(text) = with_number(text, n, number) else { break };
                common::read_damaged(&folder, name, text.as_bytes());
            }
        }
    }
}

#[test]
fn bytes_that_are_no_lines_do_no_harm() {
    let folder = common::scratch("no_lines");
    for (name, text) in TEXTS {
        let bytes = text.as_bytes();
        let utf16: Vec<u8> =
            std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let spaced: Vec<u8> = bytes.iter().flat_map(|b| [*b, 0]).collect();
        let variants = [
            utf16,
            spaced,
            text.replace('\n', "\r").into_bytes(),
            text.replace('\n', "\r\n").into_bytes(),
            text.replace('\n', "\n\n").into_bytes(),
            text.replace(' ', "\0").into_bytes(),
            [&[0xef, 0xbb, 0xbf], bytes].concat(),
            [bytes, &[0; 1000]].concat(),
            [bytes, bytes].concat(),
            vec![b'\n'; 100_000],
            vec![b'\r'; 100_000],
            vec![b' '; 100_000],
            vec![0; 100_000],
            vec![0xff; 100_000],
        ];
        for variant in variants {
            common::read_damaged(&folder, name, &variant);
        }
        common::damage(bytes, 200, |bytes| common::read_damaged(&folder, name, bytes));
    }
}

#[test]
fn a_line_of_a_hundred_megabytes_does_no_harm() {
    let folder = common::scratch("long_line");
    for pattern in ["1", "1 "] {
        let line = gzip(pattern.repeat(100 * MEBIBYTE / pattern.len()).as_bytes());
        for (name, text) in TEXTS {
            for end in [text.len(), text.len() - 4, 20] {
                let bytes = [gzip(&text.as_bytes()[..end]), line.clone()].concat();
                common::read_damaged(&folder, &format!("{name}.gz"), &bytes);
            }
        }
    }
}

#[test]
fn whole_frames_before_the_cut_of_a_small_compressed_file_are_served() {
    let frame = |n: usize| -> [(&str, String); 3] {
        // Digits that do not repeat, so that a cut in the file is a cut in the frames.
        let digit = |i: usize| (i * 7919 + n * 104_729) * 2_654_435_761 % 1_000_003;
        let rows = |row: &dyn Fn(usize) -> String| (0..100).map(row).collect::<String>();
        let xyz =
            rows(&|i| format!("H 0.{} 0.{} 1.{}\n", digit(i), digit(i + 100), digit(i + 200)));
        let dump = rows(&|i| format!("0.{} 0.{} 1.{}\n", digit(i), digit(i + 100), digit(i + 200)));
        let atoms = rows(&|i| {
            format!(
                "ATOM  {:5}  CA  ALA A   1     {:7.3} {:7.3} {:7.3}  1.00  0.00           C\n",
                i,
                digit(i) as f64 * 1e-4,
                digit(i + 100) as f64 * 1e-4,
                digit(i + 200) as f64 * 1e-4
            )
        });
        let head = format!("ITEM: TIMESTEP\n{n}\nITEM: NUMBER OF ATOMS\n100\n");
        let bounds = "ITEM: BOX BOUNDS pp pp pp\n0 2\n0 2\n0 2\nITEM: ATOMS x y z\n";
        [
            ("cut.xyz.gz", format!("100\n\n{xyz}")),
            ("cut.dump.gz", format!("{head}{bounds}{dump}")),
            ("cut.pdb.gz", format!("MODEL     {n}\n{atoms}ENDMDL\n")),
        ]
    };
    for format in 0..3 {
        let text: String = (0..8).map(|n| frame(n)[format].1.clone()).collect();
        let name = frame(0)[format].0;
        let whole = gzip(text.as_bytes());
        assert!(whole.len() < 65_536, "{name}: {} bytes", whole.len());
        let path = write(name, &whole[..whole.len() * 6 / 10]);
        let (_, mut reader) = open(&path).unwrap_or_else(|e| panic!("{e}"));
        let frames = reader.count(&|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
        assert!((2..7).contains(&frames), "{name}: {frames} frames");
        assert_eq!(common::frame(&mut *reader, frames - 1).len(), 100, "{name}");
        assert!(
            reader.warnings().iter().any(|w| w.contains("ends early")),
            "{:?}",
            reader.warnings()
        );
        // Without one whole frame it is an error.
        let error = read_first(&write(name, &whole[..whole.len() / 20])).unwrap_err();
        assert!(error.contains("ends early"), "{error}");
    }
}
