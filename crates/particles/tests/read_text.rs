//! Known answers for XYZ, LAMMPS dumps, tables and compressed files.

mod common;

use std::path::PathBuf;

use common::{frame, own_data, read, scratch};
use motes_particles::read::{self as reading, Reader, Wanted};
use motes_particles::{Particles, Place, Radius, ReadError, Values};

/// Writes `text` to a file called `name` and opens it.
fn open(name: &str, text: &str) -> Result<Box<dyn Reader>, ReadError> {
    reading::open(&file(name, text.as_bytes())).map(|(_, reader)| reader)
}

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = scratch("read_text").join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn first(name: &str, text: &str) -> Particles {
    frame(&mut *open(name, text).unwrap(), 0)
}

fn fails(name: &str, text: &str) -> ReadError {
    match open(name, text).and_then(|mut r| r.read(0, &Wanted::All, &|_, _| {})) {
        Ok(_) => panic!("{name} was read"),
        Err(error) => error,
    }
}

fn count(reader: &mut dyn Reader) -> usize {
    reader.count(&|_, _| {}).unwrap()
}

fn reals(particles: &Particles, name: &str) -> Vec<f64> {
    let column =
        particles.column(name).unwrap_or_else(|| panic!("no {name}: {:?}", names(particles)));
    (0..column.values.len()).map(|i| column.values.number(i)).collect()
}

fn names(particles: &Particles) -> Vec<&str> {
    particles.columns.iter().map(|c| c.name.as_str()).collect()
}

fn words(particles: &Particles, name: &str) -> Vec<String> {
    match &particles.column(name).unwrap().values {
        Values::Names { codes, names } => {
            codes.iter().map(|c| names[*c as usize].clone()).collect()
        }
        other => panic!("{name} is {}", other.type_name()),
    }
}

#[test]
fn extended_xyz_has_its_box_columns_and_time() {
    let p = first(
        "a.xyz",
        "2\nLattice=\"4 0 0 1 5 0 0 2 6\" Origin='-1 -2 -3' pbc=[T, F, T] Time=2.5 Step=7 \
         Properties=species:S:1:pos:R:3:vel:R:3:id:I:1:fixed:L:1:diameter:R:1:tag:S:1 note=\"a=\\\"b\\\" c\"\n\
         Al 0 0.5 1 1 2 3 11 T 2.0 left\nCu 1 1.5 2 4 5 6 12 F 1.0 right\n",
    );
    assert_eq!(p.positions, [[0.0, 0.5, 1.0], [1.0, 1.5, 2.0]]);
    assert_eq!(p.radius, Radius::Each(vec![1.0, 0.5]));
    let sim_box = p.sim_box.unwrap();
    assert_eq!(sim_box.vectors, [[4.0, 0.0, 0.0], [1.0, 5.0, 0.0], [0.0, 2.0, 6.0]]);
    assert_eq!((sim_box.origin, sim_box.periodic), ([-1.0, -2.0, -3.0], [true, false, true]));
    assert_eq!((p.time, p.step), (Some(2.5), Some(7)));
    assert_eq!(names(&p), ["Particle Type", "Velocity", "Particle Identifier", "fixed", "tag"]);
    assert_eq!(words(&p, "Particle Type"), ["Al", "Cu"]);
    assert_eq!(reals(&p, "Velocity"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(p.column("Particle Identifier").unwrap().values, Values::I64(vec![11, 12]));
    assert_eq!(p.column("fixed").unwrap().values, Values::U8(vec![1, 0]));
}

#[test]
fn plain_xyz_takes_any_comment_and_numbers_as_species() {
    let p = first(
        "b.xyz",
        "2\n i = 3, time = 0.25, E = nothing \"open\n6 0 0 0 0.5 7\n8 1 2 3 1.5 8\n",
    );
    assert_eq!(p.time, Some(0.25));
    assert_eq!(p.column("Particle Type").unwrap().values, Values::I64(vec![6, 8]));
    assert_eq!(p.column("Column 5").unwrap().values, Values::F64(vec![0.5, 1.5]));
    assert_eq!(p.column("Column 6").unwrap().values, Values::I64(vec![7, 8]));
    // A name after a number: all are names.
    let p = first("c.xyz", "2\n\n6 0 0 0\nC 1D+0 2 3\n");
    assert_eq!(words(&p, "Particle Type"), ["6", "C"]);
    assert_eq!(p.positions[1], [1.0, 2.0, 3.0]);
    let p = first("d.xyz", "1\r\ncomment\r\n1 2 3\r\n");
    assert_eq!((p.positions, p.columns.len()), (vec![[1.0, 2.0, 3.0]], 0));
}

#[test]
fn xyz_frames_may_differ_in_count_and_be_empty() {
    let mut reader = open("e.xyz", "1\na\nH 1 2 3\n0\n\n2\nc\nH 4 5 6\nHe 7 8 9\n\n\n").unwrap();
    // The last frame first: what comes before is passed over.
    assert_eq!(frame(&mut *reader, 2).positions, [[4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]);
    assert!(frame(&mut *reader, 1).is_empty());
    assert_eq!(frame(&mut *reader, 0).len(), 1);
    assert_eq!(count(&mut *reader), 3);
    assert!(reader.warnings().is_empty());
    assert!(reader.read(3, &Wanted::All, &|_, _| {}).is_err());
}

#[test]
fn an_incomplete_last_frame_is_a_warning_and_a_first_one_an_error() {
    for tail in ["2\nc\nH 4 5 6\n", "2\nc\nH 4 5 6\nHe 7 8", "2\nc", "2"] {
        let mut reader = open("f.xyz", &format!("1\na\nH 1 2 3\n{tail}")).unwrap();
        assert_eq!(count(&mut *reader), 1, "{tail:?}");
        assert!(reader.warnings()[0].contains("incomplete"), "{:?}", reader.warnings());
        assert_eq!(frame(&mut *reader, 0).len(), 1);
        assert!(reader.read(1, &Wanted::All, &|_, _| {}).is_err());
    }
    let error = fails("g.xyz", "3\nc\nH 4 5 6\nHe 7 8 9\n");
    assert!(error.to_string().contains("1 more rows"), "{error}");
    // The last line needs no end.
    let mut reader = open("h.xyz", "1\na\nH 1 2 3").unwrap();
    assert_eq!(count(&mut *reader), 1);
}

#[test]
fn broken_xyz_names_the_line_and_what_stood_there() {
    let error = fails("i.xyz", "2\nc\nH 1 2 3\nH 1 two 3\n");
    assert_eq!(error.place, Place::Line(4));
    assert!(error.message.contains("`two`"), "{error}");
    let error = fails("j.xyz", "1\nProperties=species:S:1:pos:R:3:v:R:9\nH 1 2 3\n");
    assert_eq!(error.place, Place::Line(3));
    let error = fails("k.xyz", "1\nProperties=species:S:1:pos:R:3:bad:Q:1\nH 1 2 3 4\n");
    assert!(error.message.contains("`Q`"), "{error}");
    let error = fails("l.xyz", "999999999999999\nc\nH 1 2 3\n");
    assert!(error.message.contains("more rows"), "{error}");
}

const DUMP_HEAD: &str =
    "ITEM: UNITS\nlj\nITEM: TIMESTEP\n42\nITEM: TIME\n0.5\nITEM: NUMBER OF ATOMS\n2\n";

#[test]
fn a_triclinic_dump_has_its_true_box_and_absolute_positions() {
    let text = format!(
        "{DUMP_HEAD}ITEM: BOX BOUNDS xy xz yz pp ff ps\n-1 14 -1\n0 12 4\n0 10 2\nITEM: ATOMS id type xs ys zs\n\
         1 1 0 0 0\n2 2 0.5 0.5 0.5\n"
    );
    let p = first("a.dump", &text);
    let sim_box = p.sim_box.unwrap();
    // min(0, −1, 4, 3) = −1 and max = 4 are taken off x; max(0, 2) off y.
    assert_eq!(sim_box.origin, [0.0, 0.0, 0.0]);
    assert_eq!(sim_box.vectors, [[10.0, 0.0, 0.0], [-1.0, 10.0, 0.0], [4.0, 2.0, 10.0]]);
    assert_eq!(sim_box.periodic, [true, false, false]);
    assert_eq!(p.positions, [[0.0, 0.0, 0.0], [6.5, 6.0, 5.0]]);
    assert_eq!((p.step, p.time), (Some(42), Some(0.5)));
}

#[test]
fn a_general_triclinic_dump_has_its_vectors() {
    let text = format!(
        "{DUMP_HEAD}ITEM: BOX BOUNDS abc origin pp pp pp\n0 2 0 10\n-3 0 0 20\n0 1 4 30\nITEM: ATOMS id type xs ys zs\n\
         1 1 0 0 0\n2 1 1 1 1\n"
    );
    let p = first("b.dump", &text);
    assert_eq!(p.sim_box.unwrap().vectors, [[0.0, 2.0, 0.0], [-3.0, 0.0, 0.0], [0.0, 1.0, 4.0]]);
    assert_eq!(p.bounds().unwrap(), ([7.0, 20.0, 30.0], [10.0, 23.0, 34.0]));
}

#[test]
fn dump_columns_get_standard_names() {
    let text = format!(
        "{DUMP_HEAD}ITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\nITEM: ATOMS id mol element xu yu zu diameter q mass \
         vx vy vz ix iy iz c_a f_b[1] v_t angmomx angmomy angmomz\n\
         7 1 Si 1 2 3 4 -0.5 28 .1 .2 .3 0 1 -1 5 6 7 8 9 10\n8 1 O 4 5 6 2 1 16 0 0 0 0 0 0 0.5 0 1e3 0 0 0\n"
    );
    let p = first("c.dump", &text);
    let expected = [
        "Particle Identifier",
        "Molecule Identifier",
        "Particle Type",
        "Charge",
        "Mass",
        "Velocity",
        "Periodic Image",
        "c_a",
        "f_b[1]",
        "v_t",
        "Angular Momentum",
    ];
    assert_eq!(names(&p), expected);
    assert_eq!(p.radius, Radius::Each(vec![2.0, 1.0]));
    assert_eq!(p.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(words(&p, "Particle Type"), ["Si", "O"]);
    assert_eq!(p.column("Periodic Image").unwrap().values, Values::I64(vec![0, 1, -1, 0, 0, 0]));
    assert_eq!(reals(&p, "v_t"), [7.0, 1000.0]);
    // Only what is wanted.
    let mut reader = open("c.dump", &text).unwrap();
    let p = reader.read(0, &Wanted::Only(vec!["Mass".into()]), &|_, _| {}).unwrap();
    assert_eq!(names(&p), ["Mass"]);
    assert_eq!(p.radius, Radius::Each(vec![2.0, 1.0]));
}

#[test]
fn x_is_preferred_to_xu_and_xs() {
    let text = format!(
        "{DUMP_HEAD}ITEM: BOX BOUNDS\n0 2\n0 2\n0 2\nITEM: ATOMS xs ys zs x y z xu yu zu\n.5 .5 .5 1 1 1 3 3 3\n0 0 0 0 0 0 2 2 2\n"
    );
    let p = first("d.dump", &text);
    assert_eq!(p.positions, [[1.0; 3], [0.0; 3]]);
    assert_eq!(names(&p), ["xs", "ys", "zs", "xu", "yu", "zu"]);
}

#[test]
fn broken_dumps_say_where() {
    let Some(folder) = common::shared_data() else { return };
    let read_error = |name: &str| {
        let opened = reading::open(&folder.join("malformed").join(name));
        opened.and_then(|(_, mut r)| r.read(0, &Wanted::All, &|_, _| {})).map(|_| ()).unwrap_err()
    };
    for name in ["lammps_bad_box-not-numbers.lammpstrj", "lammps_bad_box-wrong-size.lammpstrj"] {
        assert_eq!(read_error(name).place, Place::Line(6), "{name}");
    }
    assert_eq!(read_error("xyz_bad_extended.xyz").place, Place::Line(3));
    let (_, mut reader) =
        reading::open(&folder.join("malformed/lammps_bad_items-after-atoms.lammpstrj")).unwrap();
    assert_eq!(count(&mut *reader), 1);
    assert_eq!(reader.warnings().len(), 1);
    let leeway =
        reading::open(&folder.join("flow/opendrift_leeway_ascii.txt")).map(|_| ()).unwrap_err();
    assert!(matches!(leeway.place, Place::Line(_)), "{leeway}");
}

#[test]
fn tables_are_read_whatever_parts_their_fields() {
    let texts = [
        ("a.csv", "x,y,z,vx,vy,vz,kind\n1,2,3,4,5,6,sand\n-1,0,1e1,,NA,nan,\"clay, wet\"\n"),
        (
            "b.csv",
            "\u{feff}X;Y;Z;v_x;v_y;v_z;kind\r\n1;2;3;4;5;6;sand\r\n-1,0;0;10,0;;;;clay, wet\r\n",
        ),
        (
            "c.tsv",
            "# made by hand\nPosition.X\tPosition.Y\tPosition.Z\tVel:0\tVel:1\tVel:2\tkind\n1\t2\t3\t4\t5\t6\tsand\n\n-1\t0\t10\t\t\t\tclay, wet\n",
        ),
        (
            "d.txt",
            "% x [m] is not named here\n#pos_x pos_y pos_z velocity_x velocity_y velocity_z kind\n1 2 3 4 5 6 sand\n-1   0 10 nan NaN NA \"clay, wet\"",
        ),
        (
            "e.dat",
            "\"Points:0\" \"Points:1\" \"Points:2\" vx vy vz kind\n1 2 3 4 5 6 sand\n-1 0 10 - - - \"clay, wet\"\n",
        ),
    ];
    for (name, text) in texts {
        let p = first(name, text);
        assert_eq!(p.positions, [[1.0, 2.0, 3.0], [-1.0, 0.0, 10.0]], "{name}");
        assert_eq!(names(&p), ["Velocity", "kind"], "{name}");
        assert_eq!(words(&p, "kind"), ["sand", "clay, wet"], "{name}");
        let velocity = reals(&p, "Velocity");
        assert_eq!(velocity[..3], [4.0, 5.0, 6.0], "{name}");
        assert!(velocity[3..].iter().all(|v| v.is_nan()), "{name}");
    }
}

#[test]
fn tables_without_names_take_the_first_numbers() {
    let p = first("f.txt", "0.5 1 2 9\n3 4 5 8.5\n");
    assert_eq!(p.positions, [[0.5, 1.0, 2.0], [3.0, 4.0, 5.0]]);
    assert_eq!(reals(&p, "Column 4"), [9.0, 8.5]);
    // Two columns lie in a plane; a count is compared.
    let p = first("g.txt", "2\n1 2\n3 4\n");
    assert_eq!(p.positions, [[1.0, 2.0, 0.0], [3.0, 4.0, 0.0]]);
    let error = fails("h.txt", "3\n1 2 3\n3 4 5\n");
    assert!(error.message.contains("3 rows"), "{error}");
    let mut reader = open("i.txt", "1\n1 2 3\n3 4 5\n").unwrap();
    assert_eq!(frame(&mut *reader, 0).len(), 2);
    assert_eq!(reader.warnings().len(), 1);
}

#[test]
fn names_of_coordinates_are_found_among_others() {
    let headers = [
        "id,lon,lat,depth,T",
        "id,x [m],y [m],z [m],T",
        "id,Points_0,Points_1,Points_2,T",
        "id,x(m),y(m),z(m),T",
        "id,posX,posY,posZ,T",
        "id,Coordinates:0,Coordinates:1,Coordinates:2,T",
        "id,x_pos,y_pos,z_pos,T",
        "id,px,py,pz,T",
        "id,position[0],position[1],position[2],T",
    ];
    for header in headers {
        let p = first("j.csv", &format!("{header}\n7,1,2,3,9\n8,4,5,6,9.5\n"));
        assert_eq!(p.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{header}");
        assert_eq!(names(&p), ["Particle Identifier", "T"], "{header}");
    }
    let p = first("k.csv", "x,z,Radius,rho\n1,2,0.5,1000\n3,4,0.25,1001\n");
    assert_eq!(p.positions, [[1.0, 0.0, 2.0], [3.0, 0.0, 4.0]]);
    assert_eq!(p.radius, Radius::Each(vec![0.5, 0.25]));
    assert_eq!(p.column("rho").unwrap().values, Values::I64(vec![1000, 1001]));
    assert!(first("l.csv", "x,y,z\n").is_empty());
}

#[test]
fn a_ragged_table_is_refused_with_its_line() {
    let error = fails("m.csv", "x,y,z\n1,2,3\n1,2\n");
    assert_eq!(error.place, Place::Line(3));
    let mut text = "x,y,z\n".to_owned();
    (0..30_000).for_each(|i| text.push_str(&format!("{i},1,2\n")));
    let error = fails("n.csv", &format!("{text}1,2,oops\n"));
    assert_eq!(error.place, Place::Line(30_002));
    assert!(error.message.contains("`oops`"), "{error}");
    // Words after many numbers make a column of words.
    let p = first(
        "o.csv",
        &format!("{}1,2,3,b\n", text.replace(",2\n", ",2,7\n").replace("x,y,z", "x,y,z,n")),
    );
    assert_eq!(words(&p, "n")[29_999..], ["7", "b"]);
}

#[test]
fn compressed_members_are_one_content() {
    let plain = own_data().join("trajectory.xyz");
    for name in ["trajectory_two_members.xyz.gz", "trajectory_skippable.xyz.zst"] {
        let (format, mut reader) = reading::open(&own_data().join(name)).unwrap();
        assert_eq!((format, count(&mut *reader)), ("XYZ", 2), "{name}");
        // Backwards, too.
        for i in [1, 0, 1] {
            assert_eq!(frame(&mut *reader, i), read(&plain, i), "{name}");
        }
        assert!(reader.warnings().is_empty(), "{name}");
    }
}

#[test]
fn cut_or_damaged_compressed_files_end_in_an_error_or_a_warning() {
    for name in ["trajectory_two_members.xyz.gz", "trajectory_skippable.xyz.zst"] {
        let bytes = std::fs::read(own_data().join(name)).unwrap();
        let mut whole = 0;
        for cut in 1..bytes.len() {
            let Ok((_, mut reader)) = reading::open(&file(name, &bytes[..cut])) else { continue };
            let Ok(frames) = reader.count(&|_, _| {}) else { continue };
            assert!(frames == 2 || !reader.warnings().is_empty(), "{name} cut at {cut}");
            whole += usize::from(frames == 2);
        }
        // Only what says nothing of the particles may be lost unseen: checksums, a skippable frame.
        assert!(whole < 40, "{name} was whole {whole} times");
        common::damage(&bytes, 400, |bytes| {
            common::read_damaged(&scratch("cut_compressed"), name, bytes)
        });
    }
}

#[test]
fn a_long_compressed_trajectory_that_is_cut_gives_its_whole_frames() {
    let mut text = String::new();
    for frame in 0..40 {
        text.push_str("1000\nframe\n");
        (0..1000).for_each(|i| {
            text.push_str(&format!("H {} {}.5 {}\n", i * 37 % 101, i * frame % 97, frame))
        });
    }
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut encoder, text.as_bytes()).unwrap();
    let whole = encoder.finish().unwrap();
    let path = file("long.xyz.gz", &whole[..whole.len() / 2]);
    let (_, mut reader) = reading::open(&path).unwrap();
    let frames = count(&mut *reader);
    assert!((10..30).contains(&frames), "{frames}");
    assert_eq!(reader.warnings().len(), 1);
    assert_eq!(frame(&mut *reader, frames - 1).len(), 1000);
}

#[test]
fn damaged_text_never_panics() {
    let folder = scratch("damaged_text");
    for name in ["trajectory.xyz", "extended.xyz", "mdapy_extended.xyz", "dump_multiframe_5x8.dump"]
    {
        let bytes = std::fs::read(own_data().join(name)).unwrap();
        common::damage(&bytes, 300, |bytes| common::read_damaged(&folder, name, bytes));
    }
    let table = "\"id\",\"x\",\"y\",\"z\",\"Vel:0\",\"Vel:1\",\"Vel:2\",name\n1,2,3,4,5,6,7,\"a b\"\n2,3,4,5,,,,c\n";
    common::damage(table.as_bytes(), 300, |bytes| {
        common::read_damaged(&folder, "damaged.csv", bytes)
    });
    let tri = format!(
        "{DUMP_HEAD}ITEM: BOX BOUNDS xy xz yz pp ff ps\n-1 14 -1\n0 12 4\n0 10 2\nITEM: ATOMS id type xs ys zs\n1 1 0 0 0\n2 2 0.5 0.5 0.5\n"
    );
    common::damage(tri.as_bytes(), 300, |bytes| {
        common::read_damaged(&folder, "damaged.dump", bytes)
    });
}

#[test]
fn blocks_do_not_show_in_the_result() {
    // Several blocks and chunks, with types that appear late.
    let mut text = "200000\nProperties=species:S:1:pos:R:3:n:I:1\n".to_owned();
    for i in 0..200_000 {
        let species = if i > 150_000 { "Xe" } else { ["H", "He"][i % 2] };
        text.push_str(&format!("{species} {i} {}.25 -{i}e-1 {i}\n", i % 7));
    }
    let p = first("blocks.xyz", &text);
    assert_eq!(p.len(), 200_000);
    for i in [0, 4095, 4096, 99_999, 150_001, 199_999] {
        assert_eq!(p.positions[i], [i as f32, (i % 7) as f32 + 0.25, (-(i as f64) / 10.0) as f32]);
        assert_eq!(p.column("n").unwrap().number(i, 0), i as f64);
    }
    let Values::Names { names, .. } = &p.column("Particle Type").unwrap().values else {
        panic!("no names")
    };
    assert_eq!(names[..], ["H", "He", "Xe"]);
}

#[test]
fn columns_called_like_positions_or_radii_do_no_harm() {
    let p = first(
        "p.csv",
        "x,y,z,Points:0,Points:1,Points:2,Radius:0,Radius:1,Radius:2,Position\n1,2,3,4,5,6,7,8,9,0\n",
    );
    assert_eq!(
        (p.positions.as_slice(), &p.radius),
        ([[1.0, 2.0, 3.0]].as_slice(), &Radius::Unknown)
    );
    assert_eq!((p.columns.len(), reals(&p, "Points:2")), (7, vec![6.0]));
    let p = first("q.xyz", "1\nProperties=Position:R:2:pos:R:3:Radius:R:3\n8 9 1 2 3 4 5 6\n");
    assert_eq!(
        (p.positions.as_slice(), &p.radius),
        ([[1.0, 2.0, 3.0]].as_slice(), &Radius::Unknown)
    );
    assert_eq!(reals(&p, "radius"), [4.0, 5.0, 6.0]);
}

#[test]
fn other_text_formats_are_not_claimed() {
    let texts = [
        "Water\n    2\n    1SOL     OW    1   0.1   0.2   0.3\n    1SOL    HW1    2   0.1   0.2   0.4\n 1 1 1\n",
        "ATOM      1  N   MET A   1      27.340  24.430   2.614  1.00  9.67           N\nEND\n",
        "MnO\n1.0\n4 0 0\n0 4 0\n0 0 4\nMn O\n1 1\nDirect\n0 0 0\n.5 .5 .5\n",
        "#F A 1 1 0 3 0 0\n#C number type x y z\n#X 9 0 0\n#E\n0 1 2 3 4\n1 1 2 3 5\n",
        "LAMMPS data file\n\n2 atoms\n1 atom types\n0 1 xlo xhi\n\nAtoms\n\n1 1 0 0 0\n2 1 0 0 1\n",
    ];
    for (i, text) in texts.iter().enumerate() {
        if let Ok((format, _)) = reading::open(&file(&format!("other{i}"), text.as_bytes())) {
            assert!(
                !["text table", "XYZ", "LAMMPS dump"].contains(&format),
                "{i} is called {format}"
            );
        }
    }
}
