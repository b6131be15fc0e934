//! What there is to be seen, as the page is told.

use std::sync::Arc;

use motes_particles::read::names;
use motes_scene::{Projection, Scene};
use serde_json::{Value, json};

use crate::info::properties;
use crate::paint::{kinds_of, type_colors};
use crate::session::Seen;
use crate::system::Loaded;

/// Kinds of particles that are listed.
const MOST_TYPES: usize = 200;

/// Each system: its source, particles, properties and types.
pub(super) fn systems(scene: &Scene, seen: &Seen, frames: usize) -> Vec<Value> {
    let of = |(i, system): (usize, &motes_scene::System)| {
        let loaded = seen.loaded.iter().find(|l| usize::from(l.number) == i);
        let mut about = json!({
            "name": if system.name.is_empty() { short(&system.source) } else { &system.name },
            "source": system.source,
            "frames": frames,
            "live": system.source.starts_with("sim:"),
            "particles": 0,
            "properties": [],
            "types": [],
            "box": null,
        });
        if let Some(loaded) = loaded {
            describe(&mut about, system, loaded);
        }
        about
    };
    scene.system.iter().enumerate().map(of).collect()
}

fn describe(about: &mut Value, system: &motes_scene::System, loaded: &Loaded) {
    let particles = &loaded.particles;
    about["particles"] = particles.len().into();
    about["visible"] = loaded.count_visible().into();
    about["properties"] = json!(properties(particles));
    if let Some(types) = particles.column(names::PARTICLE_TYPE) {
        let (kinds, words) = kinds_of(types);
        let mut counts = vec![0_usize; words.len()];
        kinds.iter().for_each(|kind| counts[*kind as usize] += 1);
        let colors = type_colors(types, &system.color);
        let all = words.iter().zip(&counts).zip(&colors).take(MOST_TYPES);
        let all = all.map(|((name, count), color)| {
            json!({"name": name, "count": count, "color": color.to_string()})
        });
        about["types"] = all.collect();
    }
    if let Some(sim_box) = &particles.sim_box {
        about["box"] = json!({
            "origin": sim_box.origin,
            "vectors": sim_box.vectors,
            "periodic": sim_box.periodic,
        });
    }
}

/// The last part of a path.
fn short(source: &str) -> &str {
    source.rsplit('/').next().unwrap_or(source)
}

/// Whether other particles are seen.
pub(super) fn differ(had: &Seen, seen: &Seen) -> bool {
    let same = |(a, b): (&Loaded, &Loaded)| {
        Arc::ptr_eq(&a.particles, &b.particles) && Arc::ptr_eq(&a.visible, &b.visible)
    };
    had.loaded.len() != seen.loaded.len() || !had.loaded.iter().zip(&seen.loaded).all(same)
}

/// What the scene comes to, with what was seen last.
pub(super) fn resolved(scene: &Scene, seen: &Seen, (frames, playing): (usize, bool)) -> Value {
    let resolved = scene.resolve_framing(seen.framing(scene));
    let resolved = resolved.as_ref().unwrap_or(&seen.resolved);
    let view = &resolved.view;
    let whole = seen.boxes.whole;
    let projection = match view.projection {
        Projection::Perspective => "perspective",
        Projection::Orthographic => "orthographic",
    };
    let radius = seen.loaded.iter().flat_map(|l| &l.classes.grids).map(|g| g.greatest_radius);
    json!({
        "camera": {
            "projection": projection,
            "position": view.eye,
            "target": view.target,
            "up": view.up,
            "fov": scene.camera.fov,
            "height": 2.0 * view.half_height * match view.projection {
                Projection::Perspective => (view.target - view.eye).length(),
                Projection::Orthographic => 1.0,
            },
        },
        "bounds": whole.map(|b| json!({"min": b.min, "max": b.max})),
        "radius": radius.fold(0.0, f32::max),
        "frame": scene.image.frame,
        "frames": frames,
        "playing": playing,
    })
}
