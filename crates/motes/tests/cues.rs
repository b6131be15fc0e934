//! Cues over every renderer, and colours of molecules and tracers.

use std::fmt::Write as _;

use motes::{Layers, Picture, Quiet, Scene, Session};

fn session(source: &str, settings: &[(&str, &str)]) -> Session {
    let mut scene = Scene::default();
    scene.set_sources(&[source.into()]);
    let small = [("image.width", "96"), ("image.height", "64"), ("image.samples", "1")];
    for (path, value) in small.iter().chain(settings) {
        scene.set(path, value).unwrap();
    }
    Session::open(scene, Some(2)).unwrap()
}

fn picture(source: &str, settings: &[(&str, &str)]) -> Picture {
    session(source, settings).render(0, Layers::Yes, &Quiet).unwrap()
}

/// How many pixels of what is shown differ.
fn differing(a: &Picture, b: &Picture) -> usize {
    let pixels = |p: &Picture| motes_frame::Rgba8::from(&p.shown).pixels;
    pixels(a).iter().zip(pixels(b)).filter(|(a, b)| **a != *b).count()
}

#[test]
fn each_renderer_shows_cues_and_its_layers_have_none() {
    for renderer in ["spheres", "surface", "density"] {
        let with =
            |on: &'static str| picture("demo:dam:3000", &[("renderer", renderer), ("cue.on", on)]);
        let plain = with("");
        for on in ["edges", "depth", "edges,depth,halo"] {
            let cued = with(on);
            assert_eq!(cued.raw, plain.raw, "{renderer}, {on}");
            assert!(differing(&cued, &plain) > 50, "{renderer}, {on}");
        }
    }
}

#[test]
fn cues_of_spheres_and_what_they_are_told() {
    let molecule = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/1l2y.pdb");
    let with = |settings: &[(&'static str, &'static str)]| picture(molecule, settings);
    let plain = with(&[]);
    for on in ["rim", "seam", "sprite"] {
        assert!(differing(&with(&[("cue.on", on)]), &plain) > 50, "{on}");
    }
    // A halo needs something far enough behind.
    let dam = |on: &'static str| picture("demo:dam:3000", &[("cue.on", on)]);
    assert!(differing(&dam("halo"), &dam("")) > 50);
    let edges = with(&[("cue.on", "edges")]);
    for (path, value) in
        [("cue.edges", "0.5"), ("cue.edges_width", "0.01"), ("cue.edges_color", "red")]
    {
        let other = with(&[("cue.on", "edges"), (path, value)]);
        assert!(differing(&other, &edges) > 20, "{path}");
    }
    // What is drawn is neither drawn for colour alone nor for layers alone.
    let once =
        session(molecule, &[("cue.on", "edges")]).render_once(0, Layers::No, &Quiet).unwrap();
    assert_eq!(differing(&once, &edges), 0);
}

#[test]
fn residues_have_colors_and_a_legend() {
    let molecule = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/1l2y.pdb");
    let by = |by: &'static str| picture(molecule, &[("system.color.by", by)]);
    assert!(differing(&by("residue"), &by("element")) > 200);
    assert!(differing(&by("residue"), &by("Residue Name")) > 200);
}

#[test]
fn tracers_are_colored_by_age() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("tracers");
    std::fs::create_dir_all(&folder).unwrap();
    // One particle more in each frame, at the left; the others move on.
    let mut dump = String::new();
    for frame in 0..4 {
        let count = frame + 1;
        let _ = write!(
            dump,
            "ITEM: TIMESTEP\n{frame}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS pp pp pp\n\
             0 10\n0 10\n0 10\nITEM: ATOMS id x y z\n"
        );
        for id in 0..count {
            let _ = writeln!(dump, "{} {} 5 5", id + 1, 1 + 2 * (frame - id));
        }
    }
    let path = folder.join("t.dump");
    std::fs::write(&path, dump).unwrap();
    let source = path.to_str().unwrap();
    let visible = |frame: usize, expression: &str| {
        let mut session = session(source, &[("system.where", expression)]);
        let picture = session.render(frame, Layers::No, &Quiet).unwrap();
        picture.stats.particles["visible"]
    };
    assert_eq!([visible(3, "Age < 2"), visible(3, "Age >= 2"), visible(0, "Age == 0")], [2, 2, 1]);
    let mut session = session(source, &[("system.color.by", "age"), ("system.radius", "0.8")]);
    let aged = session.render(3, Layers::No, &Quiet).unwrap();
    let plain = self::session(source, &[("system.radius", "0.8")]).render(3, Layers::No, &Quiet);
    assert!(differing(&aged, &plain.unwrap()) > 50);
}
