//! Requests and their answers.

use std::time::Instant;

use motes_scene::Scene;
use motes_viewer::Request;
use serde_json::{Map, Value, json};

use super::guest::{Guest, lock};
use super::inquire;
use super::play::{Play, Running};
use crate::{Error, Result};

/// Largest canvas, pixels along a side and in all.
const SIDE: u64 = 8192;
const PIXELS: u64 = 1 << 25;

/// What the page has to know about sizes.
pub(super) fn limits() -> Value {
    json!({"side": SIDE, "pixels": PIXELS, "message_bytes": 1 << 20})
}

type Answer = Result<Map<String, Value>>;

/// Answers a request.
///
/// # Errors
/// What the client is told; nothing has changed then.
pub(super) fn answer(guest: &Guest, request: &Request, tell: &(dyn Fn(Value) + Sync)) -> Answer {
    let fields = &request.fields;
    match request.what.as_str() {
        "set" => set(guest, fields)?,
        "undo" => guest.change(|state| state.undo())?,
        "redo" => guest.change(|state| state.redo())?,
        "reset" => reset(guest, fields)?,
        "load" => load(guest, fields)?,
        "resize" => resize(guest, fields)?,
        "play" => play(guest, fields)?,
        "live" => live(guest, fields)?,
        "pick" | "drag" | "select" | "histogram" | "check" => return inquire_of(guest, request),
        "scene" => return Ok(with("text", super::command::scene_text(&lock(&guest.state).seen()))),
        "command" => return Ok(with("text", super::command::command(&lock(&guest.state).seen()))),
        other => {
            return Err(Error::Usage(format!("no request is called `{other}`")));
        }
    }
    Ok(with("state", guest.tell_scene(tell)))
}

fn with(name: &str, value: impl Into<Value>) -> Map<String, Value> {
    Map::from_iter([(name.to_owned(), value.into())])
}

/// Answers from what was drawn last.
fn inquire_of(guest: &Guest, request: &Request) -> Answer {
    let fields = &request.fields;
    let scene = lock(&guest.state).seen();
    let seen = lock(&guest.seen).clone();
    let seen = seen.ok_or_else(|| missing("a picture first"))?;
    let answer = match request.what.as_str() {
        "pick" => inquire::pick(&scene, &seen, [part(fields, "x")?, part(fields, "y")?]),
        "drag" => inquire::drag(&scene, &seen, [point(fields, "from")?, point(fields, "to")?]),
        "select" => inquire::choose(&scene, &seen, numbers(fields, "box")?),
        "histogram" => inquire::histogram(&seen, fields),
        _ => inquire::check(&seen, fields),
    };
    match answer? {
        Value::Object(answer) => Ok(answer),
        other => Ok(with("value", other)),
    }
}

/// A number in 0 to 1.
fn part(fields: &Map<String, Value>, name: &str) -> Result<f64> {
    let number = fields.get(name).and_then(Value::as_f64).filter(|n| (0.0..=1.0).contains(n));
    number.ok_or_else(|| missing(&format!("`{name}`, 0 to 1")))
}

/// A point of the picture.
fn point(fields: &Map<String, Value>, name: &str) -> Result<[f64; 2]> {
    let point: [f64; 2] = numbers(fields, name)?;
    let inside = point.iter().all(|n| (0.0..=1.0).contains(n));
    if inside { Ok(point) } else { Err(missing(&format!("`{name}`, each 0 to 1"))) }
}

/// So many numbers.
fn numbers<const N: usize>(fields: &Map<String, Value>, name: &str) -> Result<[f64; N]> {
    let all = fields.get(name).and_then(Value::as_array);
    let all: Option<Vec<f64>> = all.and_then(|all| all.iter().map(Value::as_f64).collect());
    let all = all.and_then(|all| <[f64; N]>::try_from(all).ok());
    all.ok_or_else(|| missing(&format!("`{name}`, a list of {N} numbers")))
}

fn missing(what: &str) -> Error {
    Error::Usage(format!("expected {what}"))
}

fn text<'a>(fields: &'a Map<String, Value>, name: &str) -> Result<&'a str> {
    fields.get(name).and_then(Value::as_str).ok_or_else(|| missing(&format!("`{name}`, a text")))
}

/// Sets parameters, all or none.
fn set(guest: &Guest, fields: &Map<String, Value>) -> Result<()> {
    let changes = fields.get("changes").and_then(Value::as_object);
    let changes = changes.ok_or_else(|| missing("`changes`, an object of paths and values"))?;
    let ends = fields.get("mark").and_then(Value::as_bool).unwrap_or(true);
    let seen = lock(&guest.seen).clone();
    guest.change(|state| {
        let mut scene = state.scene().clone();
        for (path, value) in changes {
            put(&mut scene, path, value)?;
        }
        if let Some(seen) = &seen {
            inquire::check_changes((&scene, state.scene()), seen)?;
            // What comes and goes with a filter or a cut is not to move the camera.
            let camera = |path: &String| path.starts_with("camera");
            if changes.keys().any(|path| hides(path)) && !changes.keys().any(camera) {
                // As it would stand now: what was seen last may be of another camera.
                let before = state.seen();
                stand(&mut scene.camera, &before.resolve_framing(seen.framing(&before))?.view);
            }
        }
        state.change(scene, ends)
    })
}

/// Whether a parameter decides which particles are seen.
fn hides(path: &str) -> bool {
    let of_system = ["where", "filter", "visible"].iter().any(|word| path.contains(word));
    path.starts_with("section") || (path.starts_with("system") && of_system)
}

/// Puts a JSON value into the scene; none is the default.
fn put(scene: &mut Scene, path: &str, value: &Value) -> Result<()> {
    let value = match value {
        Value::Null => None,
        value => Some(
            toml::Value::try_from(without_nulls(value))
                .map_err(|_| missing(&format!("for {path} a value that a scene can have")))?,
        ),
    };
    Ok(scene.put(path, value.as_ref())?)
}

/// A value without the fields that are null, which stand for defaults.
fn without_nulls(value: &Value) -> Value {
    match value {
        Value::Object(fields) => {
            let some = fields.iter().filter(|(_, value)| !value.is_null());
            Value::Object(some.map(|(name, v)| (name.clone(), without_nulls(v))).collect())
        }
        Value::Array(items) => items.iter().map(without_nulls).collect(),
        other => other.clone(),
    }
}

fn reset(guest: &Guest, fields: &Map<String, Value>) -> Result<()> {
    let path = text(fields, "path")?;
    guest.change(|state| {
        let mut scene = state.scene().clone();
        scene.put(path, None)?;
        // Without its source there would be nothing to see.
        for (new, old) in scene.system.iter_mut().zip(&state.scene().system) {
            new.source.clone_from(&old.source);
        }
        state.change(scene, true)
    })
}

/// Takes a whole scene; its systems without sources get those that are open.
fn load(guest: &Guest, fields: &Map<String, Value>) -> Result<()> {
    let mut scene = Scene::from_toml(text(fields, "scene")?)?;
    guest.change(|state| {
        for (new, old) in scene.system.iter_mut().zip(&state.scene().system) {
            if new.source.is_empty() || super::command::same_source(&new.source, &old.source) {
                new.source.clone_from(&old.source);
            }
        }
        state.change(scene, true)
    })
}

/// Lets frame follow frame, or ends that.
fn play(guest: &Guest, fields: &Map<String, Value>) -> Result<()> {
    let is = |name: &str, default| fields.get(name).and_then(Value::as_bool).unwrap_or(default);
    let fps = fields.get("fps").and_then(Value::as_f64).unwrap_or(25.0);
    if !(0.1..=240.0).contains(&fps) {
        return Err(missing("`fps`, 0.1 to 240 frames a second"));
    }
    let play = Play { fps, around: is("loop", false), drop: is("drop", false) };
    run(guest, is("on", true).then_some(play))
}

fn run(guest: &Guest, play: Option<Play>) -> Result<()> {
    let frames = guest.frame_count() as u32;
    let seen = lock(&guest.seen).clone();
    guest.change(|state| {
        let first = state.scene().image.frame;
        // From its end a film begins again.
        let first = if play.is_some() && first + 1 >= frames { 0 } else { first };
        // What grows or moves in the course of it is not to move the camera.
        if let Some(seen) = seen.filter(|_| play.is_some()) {
            state.settle(|camera| stand(camera, &seen.resolved.view));
        }
        state.running = play.map(|play| Running::new(play, first, Instant::now()));
        state.go_to(first);
        Ok(())
    })
}

/// Makes a camera stand as it was seen to.
fn stand(camera: &mut motes_scene::Camera, view: &motes_scene::CameraView) {
    if camera.position.is_none() || camera.target.is_none() {
        (camera.position, camera.target) = (Some(view.eye), Some(view.target));
    }
    if view.projection == motes_scene::Projection::Orthographic {
        camera.height.get_or_insert(2.0 * view.half_height);
    }
}

/// Runs a simulation, step by step or on its own; from the start, or with other particles.
fn live(guest: &Guest, fields: &Map<String, Value>) -> Result<()> {
    let scene = lock(&guest.state).scene().clone();
    if !scene.system.iter().any(|system| system.source.starts_with("sim:")) {
        return Err(Error::Usage("no system is a simulation".into()));
    }
    if let Some(particles) = fields.get("particles") {
        let count = particles.as_u64().filter(|n| (1..=20_000_000).contains(n));
        let count = count.ok_or_else(|| missing("`particles`, 1 to 20000000"))?;
        guest.reopen(&|source| with_particles(source, count))?;
    }
    let fps = Play { fps: scene.sph.fps.clamp(0.1, 240.0), around: false, drop: false };
    match fields.get("action").and_then(Value::as_str).unwrap_or("run") {
        "run" => run(guest, Some(fps)),
        "pause" => run(guest, None),
        "restart" => guest.change(|state| {
            state.go_to(0);
            if let Some(running) = &mut state.running {
                *running = Running::new(running.play, 0, Instant::now());
            }
            Ok(())
        }),
        "step" => {
            let last = guest.frame_count().saturating_sub(1) as u32;
            guest.change(|state| {
                state.running = None;
                state.go_to(state.scene().image.frame.saturating_add(1).min(last));
                Ok(())
            })
        }
        _ => Err(missing("`action`: run, pause, step or restart")),
    }
}

/// The source of a simulation with another number of particles; any other source as it is.
fn with_particles(source: &str, count: u64) -> String {
    let Some(simulation) = source.strip_prefix("sim:") else { return source.into() };
    let (name, query) = simulation.split_once('?').unwrap_or((simulation, ""));
    let others = query.split('&').filter(|p| !p.is_empty() && !p.starts_with("particles="));
    let all: Vec<_> =
        std::iter::once(format!("particles={count}")).chain(others.map(str::to_owned)).collect();
    format!("sim:{name}?{}", all.join("&"))
}

fn resize(guest: &Guest, fields: &Map<String, Value>) -> Result<()> {
    let side = |name: &str| {
        let found = fields.get(name).and_then(Value::as_u64).filter(|n| (1..=SIDE).contains(n));
        found.ok_or_else(|| missing(&format!("`{name}`, 1 to {SIDE} pixels")))
    };
    let (width, height) = (side("width")?, side("height")?);
    if width * height > PIXELS {
        return Err(missing(&format!("at most {PIXELS} pixels")));
    }
    guest.change(|state| {
        let size = (width as u32, height as u32);
        if state.size != size {
            state.size = size;
            state.changed();
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulations_get_other_particles() {
        for (source, expected) in [
            ("sim:drop", "sim:drop?particles=7"),
            ("sim:drop?particles=3", "sim:drop?particles=7"),
            ("sim:drop?a=1&particles=3&b=2", "sim:drop?particles=7&a=1&b=2"),
            ("file.xyz", "file.xyz"),
        ] {
            assert_eq!(with_particles(source, 7), expected);
        }
    }

    #[test]
    fn json_becomes_a_scene() {
        let mut scene = Scene::default();
        let filter = json!([{"property": "Mass", "min": 1, "max": null}]);
        put(&mut scene, "system.0.filter", &filter).unwrap();
        put(&mut scene, "camera.position", &json!([1, 2.5, 3])).unwrap();
        assert_eq!(
            (scene.system[0].filter[0].min, scene.system[0].filter[0].max),
            (Some(1.0), None)
        );
        assert_eq!(scene.camera.position.map(|p| p.to_array()), Some([1.0, 2.5, 3.0]));
        put(&mut scene, "camera.position", &Value::Null).unwrap();
        assert_eq!(scene.camera.position, None);
        let huge = json!(18_446_744_073_709_551_615_u64);
        assert!(put(&mut scene, "image.samples", &huge).is_err());
        assert!(put(&mut scene, "camera.position", &json!([1, 2])).is_err());
    }
}
