//! Sections of a scene, from its text to the picture.

use std::path::PathBuf;
use std::process::Command;

use motes::{Layers, Picture, Quiet, Scene, Session};

/// A cube of touching spheres of two types in layers, 10 along a side, two apart.
fn crystal(folder: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("crystal.xyz");
    let mut text = "1000\n\n".to_owned();
    for i in 0..1000 {
        let (x, y, z) = (i % 10 * 2, i / 10 % 10 * 2, i / 100 * 2);
        let kind = if i / 100 % 2 == 0 { "Na" } else { "Cl" };
        text += &format!("{kind} {x} {y} {z}\n");
    }
    std::fs::write(&path, text).unwrap();
    path.to_string_lossy().into_owned()
}

fn scene(source: &str, text: &str) -> Scene {
    let mut scene = Scene::from_toml(text).unwrap();
    scene.set_sources(&[source.to_owned()]);
    for (path, value) in [
        ("image.width", "120"),
        ("image.height", "100"),
        ("image.samples", "1"),
        ("system.radius", "1"),
        ("camera.position", "9,-60,9"),
        ("camera.target", "9,9,9"),
        ("camera.fov", "25"),
        ("light.occlusion_radius", "5"),
    ] {
        scene.set(path, value).unwrap();
    }
    scene
}

fn draw(scene: Scene) -> Picture {
    Session::open(scene, None).unwrap().render(0, Layers::Yes, &Quiet).unwrap()
}

fn visible(picture: &Picture) -> usize {
    picture.stats.particles["visible"]
}

const CENTRE: &str = "[[section]]\npoint = [0, 9, 0]\nnormal = [0, 1, 0]\ncut = \"centre\"\n";

#[test]
fn particles_go_by_their_centres_or_by_what_is_left_of_them() {
    let source = crystal("by_centre");
    // Five of ten layers lie beyond y = 9; by what is left of them, none more, as 8 + 1 touches the plane.
    assert_eq!(visible(&draw(scene(&source, CENTRE))), 500);
    let at = |y: f64, cut: &str| {
        let text =
            format!("[[section]]\npoint = [0, {y}, 0]\nnormal = [0, 3, 0]\ncut = \"{cut}\"\n");
        draw(scene(&source, &text))
    };
    assert_eq!(visible(&at(8.5, "caps")), 600);
    assert_eq!(visible(&at(8.5, "centre")), 500);
    // The caps are flat, where the plane is.
    let picture = at(8.0, "caps");
    let (depth, normal) = (picture.raw.depth().unwrap(), picture.raw.normal().unwrap());
    let middle = 50 * 120 + 63;
    assert!((depth[middle] - 68.0).abs() < 0.1, "{}", depth[middle]);
    assert!(normal[middle][1] < -0.99999, "{:?}", normal[middle]);
    assert!(at(8.0, "open").raw.depth().unwrap()[middle] > 68.5);
}

#[test]
fn sections_keep_to_their_types_and_systems_and_groups() {
    let source = crystal("scope");
    let count = |more: &str| visible(&draw(scene(&source, &format!("{CENTRE}{more}"))));
    assert_eq!(count("types = \"Na\""), 750);
    assert_eq!(count("types = [\"Na\", \"Cl\"]"), 500);
    assert_eq!(count("types = \"X\""), 1000);
    assert_eq!(count("on = false"), 1000);
    assert_eq!(count("system = 0"), 500);
    let aside = "point = [9, 0, 0]\nnormal = [1, 0, 0]\ncut = \"centre\"\n";
    assert_eq!(count(&format!("[[section]]\n{aside}")), 250);
    assert_eq!(count(&format!("group = \"a\"\n[[section]]\n{aside}group = \"a\"")), 750);
    // Each type by its own plane, exactly: two passes, one picture.
    let caps = "[[section]]\npoint = [0, 8, 0]\nnormal = [0, 1, 0]\ntypes = [\"Na\"]\n";
    let two = draw(scene(&source, caps));
    let system = two.raw.system().unwrap();
    assert!(system.iter().all(|s| *s == 0));
    let id = two.raw.id().unwrap();
    let kinds = [0, 1].map(|kind| id.iter().filter(|i| **i >= 0 && *i / 100 % 2 == kind).count());
    assert!(kinds[0] > 500 && kinds[1] > 500, "{kinds:?}");
}

#[test]
fn a_section_whose_types_nobody_has_is_told_of() {
    let source = crystal("unknown");
    let warnings = |more: &str| {
        let mut session = Session::open(scene(&source, &format!("{CENTRE}{more}")), None).unwrap();
        session.render(0, Layers::No, &Quiet).unwrap();
        session.render(0, Layers::No, &Quiet).unwrap();
        session.warnings()
    };
    let expected = "section.0.types: no particle is of type 'K'";
    assert_eq!(warnings("types = [\"Na\", \"K\"]"), [expected]);
    assert!(warnings("types = [\"Na\"]").is_empty());
}

#[test]
fn a_cut_that_is_off_changes_nothing() {
    let source = crystal("off");
    let off = CENTRE.replace("cut =", "on = false\ncut =");
    let (without, with) = (draw(scene(&source, "")), draw(scene(&source, &off)));
    assert_eq!(without.stats.hash, with.stats.hash);
    assert_ne!(without.stats.hash, draw(scene(&source, CENTRE)).stats.hash);
}

#[test]
fn caps_are_coloured_as_the_section_says() {
    let source = crystal("caps");
    let cap = |cap: &str| {
        let text = format!("[[section]]\npoint = [0, 8, 0]\nnormal = [0, 1, 0]\ncap = \"{cap}\"\n");
        let mut scene = scene(&source, &text);
        scene.set("light.preset", "flat").unwrap();
        let picture = draw(scene);
        let caps = picture.raw.normal().unwrap().iter().zip(picture.raw.color());
        let caps = caps.filter(|(n, _)| n[1] < -0.99999).map(|(_, color)| *color);
        caps.collect::<Vec<_>>()
    };
    let red = cap("#ff0000");
    assert!(red.len() > 500 && red.iter().all(|c| c[0] > 0.9 && c[1] == 0.0), "{:?}", red[0]);
    let distinct = |colors: Vec<[f32; 4]>| {
        let mut bits: Vec<_> = colors.iter().map(|c| c.map(f32::to_bits)).collect();
        bits.sort_unstable();
        bits.dedup();
        bits.len()
    };
    // Two elements; each with and without lines; ten rows of one property.
    assert_eq!(distinct(cap("particle")), 2);
    assert_eq!(distinct(cap("hatched")), 4);
    assert!(distinct(cap("Position")) > 20);
}

#[test]
fn a_line_on_the_picture_cuts_where_it_was_drawn() {
    let source = crystal("drag");
    let scene_file = PathBuf::from(&source).with_file_name("scene.toml");
    let text = scene(&source, "").to_toml().replace("section = []\n", "");
    std::fs::write(&scene_file, format!("# my own words\n{text}")).unwrap();
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motes"));
        let out = command.arg("section").arg(&scene_file).args(args).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (out.status.code(), text(&out.stdout), text(&out.stderr))
    };
    let (code, plane, said) = run(&["--drag", "60.5,50.5,80.5,50.5", "-q"]);
    assert_eq!(code, Some(0), "{said}");
    let numbers: Vec<f64> = plane.trim().split(',').map(|n| n.parse().unwrap()).collect();
    let [px, .., nx, _, nz] = numbers[..] else { panic!("{plane}") };
    assert!((px - 9.0).abs() < 0.3 && nx > 0.5 && nz.abs() < 0.3, "{plane}");
    let after = std::fs::read_to_string(&scene_file).unwrap();
    assert!(after.starts_with("# my own words"));
    let cut = Scene::from_toml(&after).unwrap();
    assert_eq!(cut.section.len(), 1);
    assert!(visible(&draw(cut)) < 700);
    let (code, _, said) = run(&["--drag", "1,1,2,2"]);
    assert!(code == Some(2) && said.contains("something that is seen"), "{said}");
    let (code, _, said) = run(&["--drag", "1,1,2"]);
    assert!(code == Some(2) && said.contains("X1,Y1,X2,Y2"), "{said}");
}
