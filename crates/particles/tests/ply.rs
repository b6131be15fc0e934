//! PLY files with known content.

mod common;

use std::path::PathBuf;

use motes_particles::read::{names, open};
use motes_particles::{Particles, Radius, Values};

fn file(name: &str, content: &[u8]) -> PathBuf {
    let path = common::scratch("ply").join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn read(name: &str, content: &[u8]) -> Particles {
    common::read(&file(name, content), 0)
}

fn error(name: &str, content: &[u8]) -> String {
    let (_, mut reader) = match open(&file(name, content)) {
        Ok(found) => found,
        Err(e) => return e.to_string(),
    };
    let error = reader.read(0, &Default::default(), &|_, _| {}).expect_err("it was read");
    error.to_string()
}

/// Faces before vertices, a list among the vertices, mixed types.
const HEADER: &str = "element face 2\nproperty list uchar int vertex_indices\nelement vertex 2\n\
    property double x\nproperty float y\nproperty short z\nproperty list uchar short tags\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n\
    property float radius\nproperty uint extra\nend_header\n";

fn assert_mixed(particles: &Particles) {
    assert_eq!(particles.positions, [[0.5, 1.5, -3.0], [2.5, 3.5, 300.0]]);
    assert_eq!(particles.radius, Radius::Each(vec![0.25, 0.75]));
    let color = particles.column(names::COLOR).unwrap();
    assert_eq!(color.values, Values::U8(vec![255, 0, 1, 7, 8, 9]));
    let transparency = particles.column(names::TRANSPARENCY).unwrap();
    assert_eq!(transparency.values, Values::F32(vec![0.0, 0.8]));
    let extra = particles.column("extra").unwrap();
    assert_eq!(extra.values, Values::I64(vec![1, 4_000_000_000]));
}

#[test]
fn text_with_lists_comments_and_dos_lines() {
    let body = "3 0 1 0\n3 1 0 1\n0.5 1.5 -3 2 5 6 255 0 1 255 0.25 1\n\n\
        2.5 3.5 300 0 7 8 9 51 7.5e-1 4000000000\n";
    let head = "ply\nformat ascii 1.0\ncomment made by hand\nobj_info none\n";
    let text = format!("{head}{HEADER}{body}");
    assert_mixed(&read("text.ply", text.as_bytes()));
    assert_mixed(&read("dos.ply", text.replace('\n', "\r\n").as_bytes()));
}

/// The same in binary; `bytes` turns a little-endian number round where that is wanted.
fn binary(format: &str, big: bool) -> Vec<u8> {
    let mut out = format!("ply\nformat {format} 1.0\n{HEADER}").into_bytes();
    let mut put = |number: &[u8]| {
        let mut number = number.to_vec();
        if big {
            number.reverse();
        }
        out.extend(number);
    };
    for face in [[0i32, 1, 0], [1, 0, 1]] {
        put(&[3]);
        face.iter().for_each(|i| put(&i.to_le_bytes()));
    }
    let rows = [
        (0.5f64, 1.5f32, -3i16, &[5i16, 6][..], [255, 0, 1, 255], 0.25f32, 1u32),
        (2.5, 3.5, 300, &[], [7, 8, 9, 51], 0.75, 4_000_000_000),
    ];
    for (x, y, z, tags, rgba, radius, extra) in rows {
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&z.to_le_bytes());
        put(&[tags.len() as u8]);
        tags.iter().for_each(|tag| put(&tag.to_le_bytes()));
        rgba.iter().for_each(|value| put(&[*value]));
        put(&radius.to_le_bytes());
        put(&extra.to_le_bytes());
    }
    out
}

#[test]
fn binary_in_both_byte_orders() {
    assert_mixed(&read("little.ply", &binary("binary_little_endian", false)));
    assert_mixed(&read("big.ply", &binary("binary_big_endian", true)));
}

#[test]
fn a_cut_file_is_an_error_wherever_it_is_cut() {
    let whole = binary("binary_little_endian", false);
    for length in 3..whole.len() {
        error("cut.ply", &whole[..length]);
    }
}

#[test]
fn a_file_of_faces_is_an_empty_frame() {
    let text = "ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int i\nend_header\n";
    assert!(read("faces.ply", text.as_bytes()).is_empty());
}

#[test]
fn normals_and_float_colours() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
        property float red\nproperty float green\nproperty float blue\nproperty float alpha\n\
        end_header\n1 2 3 0 0 1 0.25 0.5 1 0.75\n";
    let particles = read("normals.ply", text.as_bytes());
    let values = |name: &str| particles.column(name).unwrap().values.clone();
    assert_eq!(values(names::NORMAL), Values::F32(vec![0.0, 0.0, 1.0]));
    assert_eq!(values(names::COLOR), Values::F32(vec![0.25, 0.5, 1.0]));
    assert_eq!(values(names::TRANSPARENCY), Values::F32(vec![0.25]));
}

#[test]
fn errors_name_the_line_and_what_stood_there() {
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property uchar z\nend_header\n";
    let at = |body: &str| error("broken.ply", format!("{header}{body}").as_bytes());
    let message = at("0 0 0\n1 one 1\n2 2 2\n");
    assert!(message.contains("line 9") && message.contains("`y`, found `one`"), "{message}");
    let message = at("0 0 0\n1 1 256\n2 2 2\n");
    assert!(message.contains("line 9") && message.contains("`256`"), "{message}");
    let message = at("0 0 0\n1 1 1\n");
    assert!(message.contains("1 more vertices"), "{message}");
    let message = at("0 0 0\n1 1\n2 2 2\n");
    assert!(message.contains("line 9") && message.contains("line's end"), "{message}");
    let message = error(
        "bool.ply",
        &std::fs::read(common::own_data().join("diamond_with_bool.ply")).unwrap(),
    );
    assert!(message.contains("line 13") && message.contains("`bool`"), "{message}");
}
