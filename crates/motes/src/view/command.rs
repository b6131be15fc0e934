//! The command line that makes the very picture that is shown, and its scene as text.

use motes_scene::{Light, Scene, Setting, Shape};
use toml::{Table, Value};

use crate::session::make_absolute;

/// What differs from the defaults, as TOML.
pub(super) fn scene_text(scene: &Scene) -> String {
    let mut scene = scene.clone();
    scene.system.iter_mut().for_each(|system| make_absolute(&mut system.source));
    let own = Table::try_from(&scene).unwrap_or_default();
    let defaults = Table::try_from(defaults(&scene)).unwrap_or_default();
    let table = differences(&own, &defaults, &Scene::shape());
    toml::to_string(&table).unwrap_or_default()
}

/// What a scene is compared with: the rest of its light with what its preset says.
fn defaults(scene: &Scene) -> Scene {
    let mut defaults = Scene::default();
    let one = defaults.system.first().cloned().unwrap_or_default();
    defaults.system.resize(scene.system.len(), one);
    let preset = defaults.light.preset;
    defaults.light = Light { preset, ..Light::of(scene.light.preset) };
    defaults
}

/// The fields of a table that are not as by default; lists whole, their items without defaults.
fn differences(own: &Table, defaults: &Table, shape: &Shape) -> Table {
    let Shape::Table(fields) = shape else { return own.clone() };
    let mut out = Table::new();
    for field in fields {
        let Some(value) = own.get(field.name) else { continue };
        let default = defaults.get(field.name);
        if default == Some(value) {
            continue;
        }
        let value = match (&field.shape, value, default) {
            (Shape::Table(_), Value::Table(own), Some(Value::Table(defaults))) => {
                Value::Table(differences(own, defaults, &field.shape))
            }
            (Shape::List(of, defaults), Value::Array(items), _) => {
                let item = |item: &Value| match item {
                    Value::Table(own) => Value::Table(differences(own, defaults, of)),
                    other => other.clone(),
                };
                Value::Array(items.iter().map(item).collect())
            }
            _ => value.clone(),
        };
        out.insert(field.name.into(), value);
    }
    out
}

/// `motes render …` for the picture that is shown.
pub(super) fn command(scene: &Scene) -> String {
    let mut words = vec!["motes".to_owned(), "render".to_owned()];
    words.extend(scene.system.iter().map(|system| quoted(&system.source)));
    words.extend(["-o".into(), "picture.png".into()]);
    words.push(format!("--size {}x{}", scene.image.width, scene.image.height));
    let mut scene = scene.clone();
    scene.system.iter_mut().for_each(|system| system.source.clear());
    (scene.image.width, scene.image.height) = {
        let image = motes_scene::Image::default();
        (image.width, image.height)
    };
    let own = Table::try_from(&scene).unwrap_or_default();
    let defaults = Table::try_from(defaults(&scene)).unwrap_or_default();
    let root = (&Scene::shape(), Value::Table(own), Some(Value::Table(defaults)));
    settings(&mut words, "", root);
    words.join(" ")
}

/// `--set` for everything below `path` that is not as by default.
fn settings(
    out: &mut Vec<String>,
    path: &str,
    (shape, own, default): (&Shape, Value, Option<Value>),
) {
    if default.as_ref() == Some(&own) {
        return;
    }
    let below = |name: &str| if path.is_empty() { name.into() } else { format!("{path}.{name}") };
    match (shape, own, default) {
        (Shape::Table(fields), Value::Table(mut own), Some(Value::Table(mut default))) => {
            for field in fields {
                if let Some(value) = own.remove(field.name) {
                    let of = (&field.shape, value, default.remove(field.name));
                    settings(out, &below(field.name), of);
                }
            }
        }
        (Shape::List(of, _), Value::Array(own), Some(Value::Array(default)))
            if own.len() == default.len() =>
        {
            for (i, (own, default)) in own.into_iter().zip(default).enumerate() {
                settings(out, &below(&i.to_string()), (of, own, Some(default)));
            }
        }
        (_, own, _) => out.push(set(path, &own)),
    }
}

fn set(path: &str, value: &Value) -> String {
    format!("--set {}", quoted(&format!("{path}={}", inline(value))))
}

/// A value on one line, as TOML has it.
fn inline(value: &Value) -> String {
    value.to_string()
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./:=,+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.into();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// Whether two sources are the same, however their paths are written.
pub(super) fn same_source(a: &str, b: &str) -> bool {
    let absolute = |source: &str| {
        let mut source = source.to_owned();
        make_absolute(&mut source);
        source
    };
    absolute(a) == absolute(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(assignments: &[&str]) -> Scene {
        let mut scene = Scene::default();
        scene.set_sources(&["demo:random:9".into(), "/some where/it's.xyz".into()]);
        assignments.iter().for_each(|a| scene.set_text(a).unwrap());
        scene
    }

    #[test]
    fn only_what_differs_is_said() {
        let plain =
            "motes render demo:random:9 '/some where/it'\\''s.xyz' -o picture.png --size 640x480";
        let size = ["image.width=640", "image.height=480"];
        assert_eq!(command(&scene(&size)), plain);
        let more =
            [&size[..], &["light.preset=sun", "light.fill=0.5", "system.1.radius=2"]].concat();
        let expected = format!(
            "{plain} --set 'system.1.radius=2.0' --set 'light.preset=\"sun\"' --set light.fill=0.5"
        );
        let words = |text: &str| {
            let mut words: Vec<_> =
                text.replace('\'', "").split(" --").map(str::to_owned).collect();
            words.sort();
            words
        };
        assert_eq!(words(&command(&scene(&more))), words(&expected));
    }

    #[test]
    fn the_text_reads_as_the_scene() {
        for assignments in [
            &[][..],
            &["camera.position=1,2,3", "system.where=x > 'a'", "renderer=surface"],
            &["light.preset=sun", "light.softness=12", "light.fill=0.45"],
            &["system.1.color.colors={ \"a.b\" = \"red\" }", "light.preset=soft"],
            &[
                "system.0.filter=[{ property = \"Mass\", min = 2 }]",
                "camera.keyframe=[{ at = 0.5 }]",
            ],
        ] {
            let scene = scene(assignments);
            assert_eq!(Scene::from_toml(&scene_text(&scene)), Ok(scene), "{assignments:?}");
        }
    }

    #[test]
    fn sources_are_the_same_however_written() {
        let here = std::env::current_dir().unwrap().join("a.xyz");
        assert!(same_source("a.xyz", here.to_str().unwrap()) && same_source("demo:a", "demo:a"));
        assert!(!same_source("a.xyz", "b.xyz"));
    }
}
