//! A frame that is let go while it is drawn gives the same picture as one that is kept.

use motes::{Layers, Quiet, Scene, Session};

fn session(source: &str, settings: &[(&str, &str)]) -> Session {
    let mut scene = Scene::default();
    scene.set_sources(&[source.into()]);
    scene.image.width = 96;
    scene.image.height = 64;
    scene.image.samples = 1;
    for (path, value) in settings {
        scene.set(path, value).unwrap();
    }
    Session::open(scene, Some(2)).unwrap()
}

#[test]
fn pictures_do_not_depend_on_what_is_kept() {
    let settings: [&[(&str, &str)]; 6] = [
        &[],
        &[("system.color.by", "Position.Z")],
        &[("system.color.by", "Radius")],
        &[("system.where", "Position.X < 0.4 && Position.Y > 0.1")],
        &[("system.radius_scale", "0.5"), ("system.color.by", "Index")],
        &[("system.radius", "0.01")],
    ];
    let mut hashes = Vec::new();
    for settings in settings {
        let mut session = session("demo:dam:3e4", settings);
        let kept = session.render(0, Layers::Yes, &Quiet).unwrap();
        // In the memory of the grid before.
        let again = session.render(0, Layers::Yes, &Quiet).unwrap();
        let once = session.render_once(0, Layers::Yes, &Quiet).unwrap();
        let once_more = session.render_once(0, Layers::Yes, &Quiet).unwrap();
        for other in [again, once, once_more] {
            assert_eq!(other.stats.hash, kept.stats.hash, "{settings:?}");
            assert_eq!(other.stats.particles, kept.stats.particles, "{settings:?}");
            assert_eq!(other.stats.bytes, kept.stats.bytes, "{settings:?}");
        }
        hashes.push(kept.stats.hash);
    }
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), settings.len(), "the settings change nothing");
}

#[test]
fn the_box_is_drawn_whether_particles_are_kept_or_not() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/extended.xyz");
    let shown = |settings: &[(&str, &str)]| {
        let mut session = session(file, settings);
        let once = session.render_once(0, Layers::No, &Quiet).unwrap();
        assert_eq!(session.render(0, Layers::No, &Quiet).unwrap().shown.hash(), once.shown.hash());
        once.shown.hash()
    };
    assert_ne!(shown(&[]), shown(&[("overlay.box", "off"), ("overlay.legend", "auto")]));
}
