//! Particles as a liquid by a field of voxels, through the front door.

use motes::{Error, Layers, Picture, Quiet, Scene, Session, Watch};
use motes_frame::Values;

fn session(source: &str, assignments: &[&str], threads: usize) -> Session {
    let mut scene = Scene::default();
    scene.set_sources(&[source.into()]);
    let common = ["renderer=density", "image.width=120", "image.height=90", "image.samples=1"];
    for assignment in common.iter().chain(assignments) {
        scene.set_text(assignment).unwrap();
    }
    Session::open(scene, Some(threads)).unwrap()
}

fn render(assignments: &[&str], threads: usize) -> Picture {
    session("demo:dam:2e4", assignments, threads).render(0, Layers::Yes, &Quiet).unwrap()
}

/// The values of a layer of numbers.
fn numbers(picture: &Picture, name: &str) -> Vec<f64> {
    let (_, values) = picture.raw.named_values().find(|(n, _)| *n == name).unwrap();
    match values {
        Values::F32(v) => v.iter().map(|v| f64::from(*v)).collect(),
        Values::U32(v) => v.iter().map(|v| f64::from(*v)).collect(),
        Values::I64(v) => v.iter().map(|v| *v as f64).collect(),
        _ => panic!("{name} is not a layer of numbers"),
    }
}

#[test]
fn the_picture_is_the_same_for_any_number_of_threads() {
    for more in [&[][..], &["image.samples=4"], &["density.mask=true", "system.color.by=Position"]]
    {
        let expected = render(more, 1).raw;
        assert!(render(more, 2).raw == expected && render(more, 3).raw == expected, "{more:?}");
    }
}

#[test]
fn layers_agree_with_each_other() {
    let picture = render(&[], 2);
    let (depth, id) = (numbers(&picture, "depth"), numbers(&picture, "id"));
    let thickness = numbers(&picture, "thickness");
    let normals = picture.raw.normal().unwrap();
    let mut seen = 0;
    for i in 0..depth.len() {
        let liquid = depth[i].is_finite();
        assert_eq!(thickness[i] > 0.0, liquid, "pixel {i}");
        assert_eq!(id[i] >= 0.0, liquid, "pixel {i}: {}", id[i]);
        let length = normals[i].iter().map(|n| n * n).sum::<f32>();
        assert!((length - f32::from(u8::from(liquid))).abs() < 1e-4, "pixel {i}: {length}");
        seen += usize::from(liquid);
    }
    assert!(seen > depth.len() / 10, "{seen}");
}

#[test]
fn hidden_particles_do_not_count() {
    let half = [
        "system.where='Position.X < 0.3'",
        "camera.target=0.2,0.5,0.3",
        "camera.position=0.2,-3,1",
    ];
    let hidden = render(&half, 2);
    let whole = render(&half[1..], 2);
    let sum = |picture: &Picture| numbers(picture, "thickness").iter().sum::<f64>();
    assert!(sum(&hidden) > 0.0 && sum(&hidden) < 0.7 * sum(&whole));
    assert!(hidden.stats.particles["visible"] < whole.stats.particles["visible"]);
    let nothing = render(&["system.where='Position.X > 9'"], 1);
    assert!(numbers(&nothing, "depth").iter().all(|d| d.is_infinite()));
}

#[test]
fn a_drop_is_the_particle_and_seen() {
    let alone = render(&["system.where='Index == 7'", "density.resolution=4"], 1);
    let id = numbers(&alone, "id");
    let seen = id.iter().filter(|id| **id == 7.0).count();
    assert!(seen > 1000 && id.iter().all(|id| [7.0, -1.0].contains(id)), "{seen}");
    assert_eq!(alone.stats.particles["drops"], 1);
}

#[test]
fn colors_are_the_particles() {
    let tinted = render(&["system.color.by=uniform", "system.color.uniform='#ff0000'"], 1);
    let plain = render(&[], 1);
    // One colour for all is clear water; colours by a property are not.
    assert!(tinted.raw == plain.raw);
    let map = ["system.color.by=Position.X", "system.color.map=coolwarm"];
    assert!(render(&map, 1).raw != plain.raw);
}

#[test]
fn masks_are_the_files_or_made() {
    // A simulation brings masks; here they are made anew, as some particles are hidden.
    let at = |more: &[&str]| {
        let all = [&["density.mask=true"], more].concat();
        let mut session = session("sim:dam-break?particles=500", &all, 2);
        session.render(1, Layers::Yes, &Quiet).unwrap()
    };
    let seen =
        |picture: &Picture| numbers(picture, "depth").iter().filter(|d| d.is_finite()).count();
    let (own, made) = (at(&[]), at(&["system.where='Index != 3'"]));
    let (own, made) = (seen(&own) as f64, seen(&made) as f64);
    assert!(own > 100.0 && (own - made).abs() < 0.1 * own, "{own} {made}");
}

#[test]
fn a_watch_can_cancel() {
    struct Impatient;
    impl Watch for Impatient {
        fn progress(&self, stage: &'static str, done: u64, _: u64) -> bool {
            stage != "density" || done == 0
        }
    }
    let mut session = session("demo:dam:1000", &[], 1);
    let error = session.render(0, Layers::No, &Impatient).unwrap_err();
    assert!(matches!(error, Error::Cancelled), "{error}");
}

#[test]
fn other_systems_stand_beside_it() {
    let picture = |sources: &[String]| {
        let mut scene = Scene::default();
        scene.set_sources(sources);
        let view = ["camera.position=0.5,-3,1.5", "camera.target=0.5,0.5,0.5"];
        let rest = ["renderer=density", "image.width=60", "image.height=45"];
        for assignment in view.iter().chain(&rest) {
            scene.set_text(assignment).unwrap();
        }
        let mut session = Session::open(scene, Some(2)).unwrap();
        session.render(0, Layers::No, &Quiet).unwrap().raw
    };
    let both = ["demo:dam:1000", "demo:packed:1000"].map(String::from);
    assert!(picture(&both) != picture(&both[..1]));
}
