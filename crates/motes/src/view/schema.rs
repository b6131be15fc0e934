//! The scene's schema as JSON, for the page's panel.

use motes_scene::{ColorMap, Field, Scene, Setting, Shape};
use serde_json::{Map, Value, json};

/// Colours of a map that the page gets.
const SAMPLES: usize = 64;

/// Every parameter with its name, meaning, default and what it can be.
pub(super) fn schema() -> Value {
    let defaults = serde_json::to_value(Scene::default()).unwrap_or_default();
    of(&Scene::shape(), &defaults)
}

/// Colour maps by name: sRGB bytes of [`SAMPLES`] colours from end to end.
pub(super) fn colormaps() -> Value {
    let samples = |name: &str| {
        let map = ColorMap::by_name(name).ok()?;
        let color = |i: usize| {
            map.sample(i as f32 / (SAMPLES - 1) as f32).map(|c| (c * 255.0).round() as u8)
        };
        Some(json!((0..SAMPLES).map(color).collect::<Vec<_>>()))
    };
    let maps = ColorMap::names().filter_map(|name| Some((name.to_owned(), samples(name)?)));
    Value::Object(maps.collect())
}

fn of(shape: &Shape, default: &Value) -> Value {
    match shape {
        Shape::Value(words) => value(words),
        Shape::Map(inner) => json!({"kind": "map", "of": of(inner, &Value::Null)}),
        Shape::List(inner, defaults) => {
            let default = serde_json::to_value(defaults).unwrap_or_default();
            json!({"kind": "list", "of": of(inner, &default), "default": default})
        }
        Shape::Table(fields) => {
            let fields: Vec<_> = fields.iter().map(|f| field(f, default)).collect();
            json!({"kind": "table", "fields": fields})
        }
    }
}

fn field(field: &Field, defaults: &Value) -> Value {
    let default = defaults.get(field.name).cloned().unwrap_or(Value::Null);
    let mut out = Map::new();
    out.insert("name".into(), field.name.into());
    out.insert("meaning".into(), field.meaning.clone().into());
    if let Some(example) = field.example {
        out.insert("example".into(), example.into());
    }
    if let Some(unit) = unit(&field.meaning) {
        out.insert("unit".into(), unit.into());
    }
    out.insert("shape".into(), of(&field.shape, &default));
    out.insert("default".into(), default);
    Value::Object(out)
}

/// The unit that a line of meaning names, for short.
fn unit(meaning: &str) -> Option<&'static str> {
    const UNITS: &[(&str, &str)] = &[
        ("degrees", "°"),
        ("pixels", "px"),
        ("kg/m³", "kg/m³"),
        ("m²/s²", "m²/s²"),
        ("m²/s", "m²/s"),
        ("m/s²", "m/s²"),
        ("m/s", "m/s"),
    ];
    UNITS.iter().find(|(word, _)| meaning.to_lowercase().contains(word)).map(|(_, unit)| *unit)
}

/// What a value can be: its words, a type, and the choices where there are a few.
fn value(words: &str) -> Value {
    let kind = match words {
        "a number" => "number",
        "a whole number" | "a whole number, 0 or more" => "integer",
        "true or false" => "bool",
        "text" => "text",
        "two numbers, [a, b]" => "range",
        "three numbers, [x, y, z]" => "vec3",
        _ if words.starts_with("a colour") => "color",
        _ => {
            let choices = words.strip_prefix("one of ").map(|list| list.split(", "));
            return match choices {
                Some(choices) => json!({
                    "kind": "value", "expected": words, "type": "choice",
                    "choices": choices.collect::<Vec<_>>(),
                }),
                None => json!({"kind": "value", "expected": words, "type": "text"}),
            };
        }
    };
    json!({"kind": "value", "expected": words, "type": kind})
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The field at a path of the schema.
    fn at<'a>(schema: &'a Value, path: &str) -> &'a Value {
        path.split('.').fold(schema, |shape, name| {
            let shape = shape.get("shape").unwrap_or(shape);
            let shape = if shape["kind"] == "list" { &shape["of"] } else { shape };
            let fields = shape["fields"].as_array().unwrap();
            fields.iter().find(|f| f["name"] == name).unwrap()
        })
    }

    #[test]
    fn every_kind_of_value_is_told_as_such() {
        let schema = schema();
        for (path, kind) in [
            ("camera.fov", "number"),
            ("camera.position", "vec3"),
            ("camera.projection", "choice"),
            ("image.samples", "integer"),
            ("image.transparent", "bool"),
            ("image.background", "color"),
            ("system.where", "text"),
            ("system.color.range", "range"),
            ("system.color.by", "text"),
        ] {
            assert_eq!(at(&schema, path)["shape"]["type"], kind, "{path}");
        }
        let fov = at(&schema, "camera.fov");
        assert_eq!((&fov["default"], &fov["unit"]), (&json!(35.0), &json!("°")));
        let choices = &at(&schema, "camera.projection")["shape"]["choices"];
        assert_eq!(choices, &json!(["perspective", "orthographic"]));
        assert_eq!(at(&schema, "camera.position")["default"], Value::Null);
        assert_eq!(at(&schema, "system")["shape"]["of"]["kind"], "table");
        assert_eq!(at(&schema, "system.radii")["shape"]["kind"], "map");
    }

    #[test]
    fn maps_run_from_end_to_end() {
        let maps = colormaps();
        let viridis = maps["viridis"].as_array().unwrap();
        assert_eq!(viridis.len(), SAMPLES);
        assert_eq!((&viridis[0], &viridis[63]), (&json!([68, 1, 84]), &json!([253, 231, 37])));
    }
}
