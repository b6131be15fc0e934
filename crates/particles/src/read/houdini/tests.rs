//! Files written here, from the format's description.

use super::*;

fn read(content: &[u8]) -> Result<(Particles, Vec<String>)> {
    let path = std::path::Path::new("x.bgeo");
    let points = match content.starts_with(BINARY) {
        true => binary::points(path, content, &Wanted::All)?,
        false => ascii::points(path, content, &Wanted::All)?,
    };
    Ok(points.into_particles())
}

fn message(content: &[u8]) -> String {
    read(content).err().map(|e| e.to_string()).unwrap_or_default()
}

/// Two points with an attribute of every type, and the start of a primitive.
fn sample() -> Vec<u8> {
    let mut file = b"BgeoV".to_vec();
    let ints = |file: &mut Vec<u8>, values: &[i32]| {
        values.iter().for_each(|v| file.extend(v.to_be_bytes()));
    };
    let string = |file: &mut Vec<u8>, text: &str| {
        file.extend((text.len() as u16).to_be_bytes());
        file.extend(text.as_bytes());
    };
    ints(&mut file, &[5, 2, 1, 0, 0, 4, 0, 0, 0]);
    for (name, size, kind) in [("v", 3u16, 5), ("pscale", 1, 0), ("id", 1, 1), ("kind", 1, 4)] {
        string(&mut file, name);
        file.extend(size.to_be_bytes());
        ints(&mut file, &[kind]);
        if kind == 4 {
            ints(&mut file, &[2]);
            string(&mut file, "first");
            string(&mut file, "second");
        } else {
            ints(&mut file, &vec![0; usize::from(size)]);
        }
    }
    for (point, index) in [(0.0f32, 1), (10.0, -1)] {
        // x, y, z, w, v, pscale
        for k in [0.0, 1.0, 2.0, 1.0, 3.0, 4.0, 5.0, 0.5] {
            file.extend((point + k).to_be_bytes());
        }
        ints(&mut file, &[7 + index, index]);
    }
    file.extend(b"Part");
    file
}

#[test]
fn every_type_of_attribute_is_read() {
    let (particles, warnings) = read(&sample()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(particles.positions, [[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]]);
    assert_eq!(particles.radius, Radius::Each(vec![0.5, 10.5]));
    let velocity = Values::F32(vec![3.0, 4.0, 5.0, 13.0, 14.0, 15.0]);
    let names = Values::Names { codes: vec![0, 1], names: vec!["second".into(), String::new()] };
    let expected = [
        Column::new(names::VELOCITY, 3, velocity),
        Column::new(names::PARTICLE_IDENTIFIER, 1, Values::I32(vec![8, 6])),
        Column::new("kind", 1, names),
    ];
    assert_eq!(particles.columns, expected);
    assert!(warnings.is_empty());
}

#[test]
fn ascii_says_the_same() {
    let text = "PGEOMETRY V5\nNPoints 2 NPrims 1\nNPointGroups 0 NPrimGroups 0\n\
        NPointAttrib 4 NVertexAttrib 0 NPrimAttrib 1 NAttrib 0\nPointAttrib\n\
        v 3 vector 0 0 0\npscale 1 float 0\nid 1 int 0\nkind 1 index 2 first \"second\"\n\
        0 1 2 1 (3 4 5\t0.5\t8\t1)\n10 11 12 11 (13 14 15\t10.5\t6\t-1)\n\
        PrimitiveAttrib\ngenerator 1 index 1 papi\nPart 2 0 1 [0]\nbeginExtra\nendExtra\n";
    let ascii = read(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    let binary = read(&sample()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(ascii, binary);
}

#[test]
fn errors_say_where_and_what() {
    let file = sample();
    let cut = message(&file[..file.len() - 5]);
    assert!(cut.contains("expected 2 points of 40 bytes each, but 79 bytes are left"), "{cut}");
    let mut many = file.clone();
    many[9] = 0x7f;
    assert!(message(&many).contains("points of 40 bytes each"));
    many[5] = 1;
    assert!(message(&many).contains("byte 5: expected version 5"));
    assert!(message(&file[..20]).contains("byte 17: expected 4 bytes more, but 3 are left"));
    let text = "PGEOMETRY V5\nNPoints 2 NPrims x\n";
    assert_eq!(message(text.as_bytes()), "x.bgeo: line 2: expected a count, found `x`");
    assert!(message(b"PGEOMETRY V4\n").contains("expected version V5"));
}

#[test]
fn newer_geometry_is_refused_by_name() -> std::io::Result<()> {
    let folder = std::env::temp_dir().join(format!("motes-houdini-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    for content in [&b"\x7fNSJb\x00\x01"[..], b"[\n\t\"fileversion\",\"18.0\","] {
        let path = folder.join("new.bgeo");
        std::fs::write(&path, content)?;
        let error = crate::read::open(&path).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains("new.bgeo: this is Houdini's newer geometry"), "{error}");
    }
    std::fs::remove_dir_all(&folder)
}
