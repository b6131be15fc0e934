//! Files written here, word by word, from the format's description.

use super::*;
use crate::read::names;
use crate::{Column, Radius};

fn read(content: &[u8]) -> Result<(Particles, Vec<String>)> {
    read_only(content, &Wanted::All)
}

fn read_only(content: &[u8], wanted: &Wanted) -> Result<(Particles, Vec<String>)> {
    let cursor = Cursor::open(std::path::Path::new("x.vtk"), content)?;
    let mut data_set = DataSet::new(cursor, wanted);
    data_set.read()?;
    data_set.finish()
}

fn good(content: &[u8]) -> Particles {
    read(content).map(|(particles, _)| particles).unwrap_or_else(|e| panic!("{e}"))
}

fn message(content: &[u8]) -> String {
    read(content).err().map(|e| e.to_string()).unwrap_or_default()
}

fn column(particles: &Particles, name: &str) -> Column {
    let names: Vec<_> = particles.columns.iter().map(|c| &c.name).collect();
    particles.column(name).cloned().unwrap_or_else(|| panic!("no {name} in {names:?}"))
}

const ASCII: &str = "# vtk DataFile Version 3.0
A title
ASCII
DATASET POLYDATA
FIELD FieldData 2
TIME 1 1 double
0.25
METADATA
INFORMATION 1
NAME L2_NORM_RANGE LOCATION vtkDataArray
DATA 2 1 2

CYCLE 1 1 int
42
POINTS 3 float
0 0 0  1 0 0
0 2 -1e0
VERTICES 3 6
1 0 1 1 1 2
CELL_DATA 3
SCALARS of_cells int 1
LOOKUP_TABLE default
7 8 9
POINT_DATA 3
SCALARS density double
LOOKUP_TABLE default
1.5 nan 2.5
SCALARS two%20words short 2
LOOKUP_TABLE mine
1 2 3 4 5 -6
LOOKUP_TABLE mine 1
0 0 0 1
VECTORS velocity float
1 2 3
4 5 6
7 8 9
NORMALS normals float
0 0 1 0 0 1 0 0 1
TENSORS stress float
1 2 3 4 5 6 7 8 9  1 2 3 4 5 6 7 8 9  1 2 3 4 5 6 7 8 9
TEXTURE_COORDINATES uv 2 float
0 0 1 1 0 1
COLOR_SCALARS tint 4
1 0 0 1  0 1 0 0.5  0 0 1 0
FIELD FieldData 5
id 1 3 unsigned_int
4294967295 2 3
radius 1 3 float
0.5 0.25 0.125
label 1 3 string
a%20b
c
a%20b
NULL_ARRAY
other_length 1 2 int
1 2
";

#[test]
fn every_kind_of_ascii_array_is_read() {
    let particles = good(ASCII.as_bytes());
    assert_eq!(particles.positions, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, -1.0]]);
    assert_eq!((particles.time, particles.step), (Some(0.25), Some(42)));
    assert_eq!(particles.radius, Radius::Each(vec![0.5, 0.25, 0.125]));
    assert_eq!(column(&particles, "density").range(), [Some((1.5, 2.5))]);
    let words = Column::new("two words", 2, Values::I32(vec![1, 2, 3, 4, 5, -6]));
    assert_eq!(column(&particles, "two words"), words);
    let velocity = Values::F32((1..10).map(|v| v as f32).collect());
    assert_eq!(column(&particles, names::VELOCITY), Column::new(names::VELOCITY, 3, velocity));
    assert_eq!(column(&particles, names::NORMAL).components, 3);
    assert_eq!(column(&particles, "stress").components, 9);
    assert_eq!(column(&particles, "uv").values, Values::F32(vec![0.0, 0.0, 1.0, 1.0, 0.0, 1.0]));
    let color = Values::F32(vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(column(&particles, names::COLOR).values, color);
    let clear = Values::F32(vec![0.0, 0.5, 1.0]);
    assert_eq!(column(&particles, names::TRANSPARENCY).values, clear);
    let ids = Values::I64(vec![4_294_967_295, 2, 3]);
    assert_eq!(column(&particles, names::PARTICLE_IDENTIFIER).values, ids);
    let labels = Values::Names { codes: vec![0, 1, 0], names: vec!["a b".into(), "c".into()] };
    assert_eq!(column(&particles, "label").values, labels);
    assert_eq!(particles.columns.len(), 10);
}

#[test]
fn only_wanted_columns_are_kept() {
    let wanted = Wanted::Only(vec![names::VELOCITY.into()]);
    let (particles, _) = read_only(ASCII.as_bytes(), &wanted).unwrap_or_else(|e| panic!("{e}"));
    let names: Vec<_> = particles.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, [names::VELOCITY]);
    assert_ne!(particles.radius, Radius::Unknown);
}

/// A binary file of the pieces, each a line of text or bytes.
fn binary(pieces: &[&[u8]]) -> Vec<u8> {
    let mut file = b"# vtk DataFile Version 5.1\ntitle\nBINARY\n".to_vec();
    pieces.iter().for_each(|piece| file.extend_from_slice(piece));
    file
}

fn bytes<const N: usize, T: Copy>(values: &[T], to: fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|v| to(*v)).chain(*b"\n").collect()
}

#[test]
fn every_binary_type_is_read() {
    let points = bytes(&[0.0, 0.1, 0.2, 1.0, 1.1, 1.2f64], f64::to_be_bytes);
    let file = binary(&[
        b"DATASET UNSTRUCTURED_GRID\nPOINTS 2 double\n",
        &points,
        b"CELLS 3 2\nOFFSETS vtktypeint64\n",
        &bytes(&[0, 1, 2i64], i64::to_be_bytes),
        b"CONNECTIVITY vtktypeint64\n",
        &bytes(&[0, 1i64], i64::to_be_bytes),
        b"CELL_TYPES 2\n",
        &bytes(&[1, 1i32], i32::to_be_bytes),
        b"POINT_DATA 2\nSCALARS no_table unsigned_short\n",
        &bytes(&[65535, 10u16], u16::to_be_bytes),
        b"SCALARS short short 1\nLOOKUP_TABLE default\n",
        &bytes(&[-2, 2570i16], i16::to_be_bytes),
        b"COLOR_SCALARS rgb 3\n",
        &[255, 0, 0, 10, 10, 10],
        b"\nFIELD FieldData 9\nlong 1 2 long\n",
        &bytes(&[-5, 1i64 << 40], i64::to_be_bytes),
        b"METADATA\nINFORMATION 0\n\nids 1 2 vtkIdType\n",
        &bytes(&[7, 8i32], i32::to_be_bytes),
        b"ulong 1 2 unsigned_long\n",
        &bytes(&[7, 8u64], u64::to_be_bytes),
        b"bits 1 2 bit\n",
        &[0b0100_0000, b'\n'],
        b"char 1 2 char\n",
        &[0xff, 3, b'\n'],
        b"uchar 1 2 unsigned_char\n",
        &[0xff, 3, b'\n'],
        b"uint 1 2 unsigned_int\n",
        &bytes(&[u32::MAX, 1], u32::to_be_bytes),
        b"words 1 2 string\n",
        &[0xc2, b'h', b'i', 0x80, 0x01, b'x', b'\n'],
        b"float 2 2 float\n",
        &bytes(&[1.0, 2.0, 3.0, 4.0f32], f32::to_be_bytes),
    ]);
    let particles = good(&file);
    assert_eq!(particles.positions, [[0.0, 0.1, 0.2], [1.0, 1.1, 1.2]]);
    let values = |name| column(&particles, name).values;
    assert_eq!(values("no_table"), Values::I32(vec![65535, 10]));
    assert_eq!(values("short"), Values::I32(vec![-2, 2570]));
    assert_eq!(values(names::COLOR), Values::U8(vec![255, 0, 0, 10, 10, 10]));
    assert_eq!(values("long"), Values::I64(vec![-5, 1 << 40]));
    assert_eq!(values(names::PARTICLE_IDENTIFIER), Values::I64(vec![7, 8]));
    assert_eq!(values("ulong"), Values::I64(vec![7, 8]));
    assert_eq!(values("bits"), Values::U8(vec![0, 1]));
    assert_eq!(values("char"), Values::I32(vec![-1, 3]));
    assert_eq!(values("uchar"), Values::U8(vec![255, 3]));
    assert_eq!(values("uint"), Values::I64(vec![4_294_967_295, 1]));
    let words = Values::Names { codes: vec![0, 1], names: vec!["hi".into(), "x".into()] };
    assert_eq!(values("words"), words);
    assert_eq!(column(&particles, "float").components, 2);
}

#[test]
fn lattices_are_points_too() {
    let head = "# vtk DataFile Version 2.0\nt\nASCII\n";
    let image = format!(
        "{head}DATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 1\nASPECT_RATIO 0.5 1 1\nORIGIN 1 0 0\n\
         POINT_DATA 6\nSCALARS s int\nLOOKUP_TABLE default\n1 2 3 4 5 6\n"
    );
    let particles = good(image.as_bytes());
    assert_eq!(particles.positions[1], [1.5, 0.0, 0.0]);
    assert_eq!(particles.positions[3], [1.0, 1.0, 0.0]);
    assert_eq!(column(&particles, "s").rows(), 6);
    let rectilinear = format!(
        "{head}DATASET RECTILINEAR_GRID\nDIMENSIONS 2 1 2\nX_COORDINATES 2 float\n0 5\n\
         Y_COORDINATES 1 float\n3\nZ_COORDINATES 2 double\n-1 1\n"
    );
    let particles = good(rectilinear.as_bytes());
    assert_eq!(
        particles.positions,
        [[0.0, 3.0, -1.0], [5.0, 3.0, -1.0], [0.0, 3.0, 1.0], [5.0, 3.0, 1.0]]
    );
    let empty = format!("{head}DATASET STRUCTURED_POINTS\nDIMENSIONS 999999999999 0 1\n");
    assert!(good(empty.as_bytes()).is_empty());
    let grid = format!("{head}DATASET STRUCTURED_GRID\nDIMENSIONS 1 1 1\nPOINTS 1 float\n1 2 3\n");
    assert_eq!(good(grid.as_bytes()).positions, [[1.0, 2.0, 3.0]]);
}

#[test]
fn components_in_arrays_of_their_own_are_joined() {
    let file = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n1 2 3\n\
                POINT_DATA 1\nFIELD F 4\nvz 1 1 float\n6\nvx 1 1 float\n4\nm 1 1 float\n1\nvy 1 1 float\n5\n";
    let particles = good(file.as_bytes());
    let names: Vec<_> = particles.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, [names::VELOCITY, "m"]);
    assert_eq!(particles.columns[0].values, Values::F32(vec![4.0, 5.0, 6.0]));
}

#[test]
fn long_ascii_arrays_are_read_in_pieces() {
    let n = 200_000;
    let numbers: String = (0..3 * n).map(|i| format!("{i}\n")).collect();
    let file = format!(
        "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\nPOINTS {n} int\n{numbers}POINT_DATA {n}\nFIELD F 2\n1 1 {n} int\n{}2 1 {n} float\n{}",
        "5 ".repeat(n),
        "6 ".repeat(n)
    );
    let particles = good(file.as_bytes());
    assert_eq!(particles.len(), n);
    for (i, p) in particles.positions.iter().enumerate() {
        assert_eq!(*p, [3 * i, 3 * i + 1, 3 * i + 2].map(|v| v as f32));
    }
    assert_eq!(column(&particles, "1").range(), [Some((5.0, 5.0))]);
    assert_eq!(column(&particles, "2").range(), [Some((6.0, 6.0))]);
}

#[test]
fn errors_say_where_and_what() {
    let head = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET POLYDATA\n";
    let with = |rest: &str| message(format!("{head}{rest}").as_bytes());
    assert_eq!(with("POINTS 1 float\n1 x 3\n"), "x.vtk: line 6: expected 3 numbers, found `x`");
    assert_eq!(
        with("POINTS 2 float\n1 2 3 4\n"),
        "x.vtk: line 7: expected 6 values, but the file ends after 4 of them"
    );
    assert!(with("POINTS 99999999999999 float\n1 2 3\n").contains("ends after 3"));
    assert!(
        with("POINTS 1 flaot\n").contains("line 5: expected a type such as float, found `flaot`")
    );
    assert!(
        with("PIONTS 1 float\n")
            .contains("line 5: expected a keyword of legacy VTK, found `PIONTS`")
    );
    assert!(
        with("POINTS 1 float\n1 2 3\nPOINT_DATA 2\n")
            .contains("describes 2 points, but there are 1")
    );
    assert!(with("").contains("expected POINTS"));
    assert!(with("DIMENSIONS 999999 999999 999999\nPOINT_DATA 1").contains("more than the file"));
    let cut = binary(&[b"DATASET POLYDATA\nPOINTS 2 float\n", &[0; 20]]);
    assert_eq!(
        message(&cut),
        "x.vtk: byte 72: expected 6 values in 24 bytes, but 20 bytes are left"
    );
    assert!(
        message(b"# vtk DataFile Version 2.0\nt\nBINRAY\n")
            .contains("line 3: expected ASCII or BINARY")
    );
}
