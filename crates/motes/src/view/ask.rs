//! Requests and their answers.

use motes_scene::Scene;
use motes_viewer::Request;
use serde_json::{Map, Value, json};

use super::guest::{Guest, lock};
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
        "scene" => return Ok(with("text", super::command::scene_text(&lock(&guest.state).seen()))),
        "command" => return Ok(with("text", super::command::command(&lock(&guest.state).seen()))),
        other => {
            return Err(Error::Usage(format!("no request is called `{other}`")));
        }
    }
    let mut message = guest.scene_message();
    let answer = with("state", message["state"].clone());
    message.insert("is".into(), "scene".into());
    tell(Value::Object(message));
    Ok(answer)
}

fn with(name: &str, value: impl Into<Value>) -> Map<String, Value> {
    Map::from_iter([(name.to_owned(), value.into())])
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
    guest.change(|state| {
        let mut scene = state.scene().clone();
        for (path, value) in changes {
            put(&mut scene, path, value)?;
        }
        state.change(scene, ends)
    })
}

/// Puts a JSON value into the scene; none is the default.
fn put(scene: &mut Scene, path: &str, value: &Value) -> Result<()> {
    let value = match value {
        Value::Null => None,
        value => Some(toml::Value::try_from(without_nulls(value)).map_err(|_| {
            missing(&format!("for {path} a value that a scene can have"))
        })?),
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
        state.size = (width as u32, height as u32);
        state.changed();
        Ok(())
    })
}
