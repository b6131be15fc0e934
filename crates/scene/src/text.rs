//! The scene as TOML: read with errors that name line, path and nearest word; written plain, or with
//! every parameter's line of meaning.

use std::fmt::Write as _;
use std::ops::Range;

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use crate::error::{Result, SceneError, hint, quoted};
use crate::scene::{Light, Scene};
use crate::settings::{Field, Setting, Shape};

impl Scene {
    /// Reads a scene; what it does not name has its default.
    ///
    /// # Errors
    /// The line, and what was expected there: a typo names the nearest word.
    pub fn from_toml(text: &str) -> Result<Self> {
        let at = |span: Range<usize>| line_of(text, span.start);
        let table = DeTable::parse(text).map_err(|e| SceneError::Text {
            line: e.span().map_or(1, at),
            reason: format!("not TOML: {}", e.message().replace('\n', "; ")),
        })?;
        let mut values = Vec::new();
        let found = Unknown::find(table.get_ref(), &Self::shape(), "", &mut values);
        if let Some(Unknown { span, reason }) = found {
            return Err(SceneError::Text { line: at(span), reason });
        }
        let scene: Self = toml::from_str(text).map_err(|e| type_error(text, &e, &values))?;
        if scene.light.preset == Light::default().preset {
            return Ok(scene);
        }
        let mut tree: Table = toml::from_str(text).map_err(|e| type_error(text, &e, &values))?;
        fill_in_preset(&mut tree);
        Value::Table(tree).try_into().map_err(|e| type_error(text, &e, &values))
    }

    /// The scene as TOML, every parameter that has a value, without comments.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// The scene as TOML with every parameter's line of meaning; those without a value stand commented
    /// out, with an example.
    pub fn to_documented_toml(&self) -> String {
        let table = Table::try_from(self).unwrap_or_default();
        let mut out =
            String::from("# A scene of Motes. What is left out has the value shown here.\n");
        if let Shape::Table(fields) = Self::shape() {
            document(&mut out, &fields, &table, "");
        }
        out
    }

    /// The whole scene with its defaults and one line of meaning each; reading it gives the default.
    pub fn documented_toml() -> String {
        Self::default().to_documented_toml()
    }
}

/// A parameter's value in the text: where it stands, its path, and what it can be.
struct ValueAt {
    span: Range<usize>,
    path: String,
    shape: Shape,
}

/// A name in the text that is no parameter.
struct Unknown {
    span: Range<usize>,
    reason: String,
}

impl Unknown {
    /// The first unknown name in `table`; on the way, gathers where every value stands.
    fn find(
        table: &DeTable<'_>,
        shape: &Shape,
        path: &str,
        values: &mut Vec<ValueAt>,
    ) -> Option<Self> {
        for (key, value) in table {
            let name: &str = key.get_ref();
            let inner = match shape {
                Shape::Table(fields) => match fields.iter().find(|f| f.name == name) {
                    Some(field) => &field.shape,
                    None => {
                        let place =
                            if path.is_empty() { String::new() } else { format!(" in {path}") };
                        let hint = hint(name, fields.iter().map(|f| f.name));
                        let reason = format!("no parameter `{}`{place}{hint}", quoted(name));
                        return Some(Self { span: key.span(), reason });
                    }
                },
                Shape::Map(of) => of,
                Shape::Value(_) | Shape::List(..) => continue,
            };
            let found = Self::find_in_value(value, inner, &join(path, name), values);
            if found.is_some() {
                return found;
            }
        }
        None
    }

    fn find_in_value(
        value: &Spanned<DeValue<'_>>,
        shape: &Shape,
        path: &str,
        values: &mut Vec<ValueAt>,
    ) -> Option<Self> {
        values.push(ValueAt { span: value.span(), path: path.into(), shape: shape.clone() });
        match (value.get_ref(), shape) {
            (DeValue::Table(table), _) => Self::find(table, shape, path, values),
            (DeValue::Array(items), Shape::List(of, _)) => items
                .iter()
                .enumerate()
                .find_map(|(i, v)| Self::find_in_value(v, of, &join(path, &i.to_string()), values)),
            _ => None,
        }
    }
}

/// A value of the wrong type: names the parameter whose value the error stands in.
fn type_error(text: &str, error: &toml::de::Error, values: &[ValueAt]) -> SceneError {
    let span = error.span().unwrap_or(0..0);
    let inside = |v: &&ValueAt| v.span.start <= span.start && span.end <= v.span.end;
    let reason = match values.iter().filter(inside).min_by_key(|v| v.span.len()) {
        Some(v) => format!(
            "{}: expected {}, found {} ({})",
            v.path,
            v.shape.expected(),
            quoted(text.get(v.span.clone()).unwrap_or("something else")),
            error.message().replace('\n', "; ")
        ),
        None => error.message().replace('\n', "; "),
    };
    SceneError::Text { line: line_of(text, span.start), reason }
}

/// The line of byte `at`, from 1.
fn line_of(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|b| *b == b'\n').count()
}

/// Gives the light what its preset says and the text does not.
pub(crate) fn fill_in_preset(scene: &mut Table) {
    let Some(Value::Table(light)) = scene.get_mut("light") else { return };
    let preset = light.get("preset").and_then(|word| word.clone().try_into().ok());
    let Some(Ok(defaults)) = preset.map(|preset| Table::try_from(Light::of(preset))) else {
        return;
    };
    for (name, value) in defaults {
        light.entry(name).or_insert(value);
    }
}

pub(crate) fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.into() } else { format!("{path}.{name}") }
}

/// Writes the values of a table, then the tables in it: TOML wants them last.
fn document(out: &mut String, fields: &[Field], table: &Table, path: &str) {
    let is_section = |f: &&Field| matches!(f.shape, Shape::Table(_) | Shape::List(..));
    for field in fields.iter().filter(|f| !is_section(f)) {
        let value = table.get(field.name).filter(|v| v.as_table().is_none_or(|t| !t.is_empty()));
        let value = match (value, field.example) {
            (Some(value), _) => format!("{} = {value}", field.name),
            (None, Some(example)) => format!("# {} = {example}", field.name),
            (None, None) => continue,
        };
        let _ = writeln!(out, "# {}\n{value}", field.meaning);
    }
    for field in fields.iter().filter(is_section) {
        let path = join(path, field.name);
        match (&field.shape, table.get(field.name)) {
            (Shape::List(of, defaults), Some(Value::Array(items))) if items.is_empty() => {
                let mut section = String::new();
                document_section(&mut section, field, (of, defaults), &path);
                section.lines().for_each(|line| {
                    let _ = writeln!(out, "{}{line}", if line.is_empty() { "" } else { "# " });
                });
            }
            (Shape::List(of, _), Some(Value::Array(items))) => {
                for item in items.iter().filter_map(Value::as_table) {
                    document_section(out, field, (of, item), &path);
                }
            }
            (shape, Some(Value::Table(inner))) => {
                document_section(out, field, (shape, inner), &path);
            }
            _ => {}
        }
    }
}

/// A table, or one of a list, under its header.
fn document_section(out: &mut String, field: &Field, of: (&Shape, &Table), path: &str) {
    let (open, close) =
        if matches!(field.shape, Shape::List(..)) { ("[[", "]]") } else { ("[", "]") };
    let _ = writeln!(out, "\n# {}\n{open}{path}{close}", field.meaning);
    if let (Shape::Table(fields), table) = of {
        document(out, fields, table, path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_scene_reads_as_the_default() {
        let text = Scene::documented_toml();
        assert_eq!(Scene::from_toml(&text), Ok(Scene::default()), "{text}");
        assert_eq!(Scene::from_toml(""), Ok(Scene::default()));
    }

    #[test]
    fn every_example_is_fit_and_every_meaning_one_line() {
        fn visit(shape: &Shape, path: &str) {
            match shape {
                Shape::Table(fields) => {
                    for f in fields {
                        let path = join(path, f.name);
                        assert!(f.meaning.ends_with('.') && !f.meaning.contains('\n'), "{path}");
                        if let Some(example) = f.example {
                            let mut scene = Scene::default();
                            match path.rsplit_once('.') {
                                Some((
                                    list @ ("system.filter" | "camera.keyframe" | "section"),
                                    of,
                                )) => {
                                    scene.set(list, "[{}]").unwrap();
                                    scene.set(&format!("{list}.0.{of}"), example).unwrap();
                                }
                                _ => scene.set(&path, example).unwrap(),
                            }
                            assert_ne!(scene, Scene::default(), "{path}");
                        }
                        visit(&f.shape, &path);
                    }
                }
                Shape::List(of, _) => visit(of, path),
                Shape::Map(_) | Shape::Value(_) => {}
            }
        }
        visit(&Scene::shape(), "");
    }

    #[test]
    fn a_scene_round_trips() {
        let mut scene = Scene::default();
        scene.set_sources(&["a.xyz".into(), "b # \"quoted\".xyz".into()]);
        for a in [
            "camera.position=1,2,3",
            "system.1.color.colors={ \"a.b\" = \"red\", 2 = [0.1, 0.2, 0.3] }",
            "system.0.filter=[{ property = \"Mass\", max = inf }]",
            "image.background_bottom=#123456",
        ] {
            scene.set_text(a).unwrap();
        }
        assert_eq!(Scene::from_toml(&scene.to_toml()), Ok(scene.clone()));
        assert_eq!(Scene::from_toml(&scene.to_documented_toml()), Ok(scene));
    }

    #[test]
    fn errors_name_line_and_nearest_word() {
        let error = |text: &str| Scene::from_toml(text).unwrap_err().to_string();
        assert_eq!(
            error("[image]\nwidth = 3\nsampels = 4\n"),
            "line 3: no parameter `sampels` in image; did you mean `samples`?"
        );
        assert_eq!(
            error("[camra]\nfov = 3"),
            "line 1: no parameter `camra`; did you mean `camera`?"
        );
        let text = "[[system]]\n[[system]]\ncolor.mapp = \"magma\"";
        assert_eq!(
            error(text),
            "line 3: no parameter `mapp` in system.1.color; did you mean `map`?"
        );
        let wrong = error("[camera]\n\nfov = \"wide\"");
        assert!(
            wrong.starts_with("line 3: camera.fov: expected a number, found \"wide\""),
            "{wrong}"
        );
        let wrong = error("[image]\nbackground = \"whit\"");
        assert!(wrong.contains("line 2: image.background: expected a colour"), "{wrong}");
        assert!(wrong.contains("did you mean `white`"), "{wrong}");
        assert!(error("a = 1\nb = [").starts_with("line 2: not TOML"), "{}", error("a = 1\nb = ["));
        let wrong = error("image = 3");
        assert!(wrong.starts_with("line 1: image: expected a table of width"), "{wrong}");
        assert!(error("[camera]\nprojection = \"fish\"").contains("perspective"));
    }

    #[test]
    fn sources_fill_the_systems() {
        let mut scene = Scene::default();
        scene.system[0].radius = Some(2.0);
        scene.system[0].name = "first".into();
        scene.set_sources(&["a".into(), "b".into()]);
        assert_eq!((&*scene.system[1].source, &*scene.system[1].name), ("b", ""));
        assert_eq!(scene.system[1].radius, Some(2.0));
        scene.system.clear();
        scene.set_sources(&["c".into()]);
        assert_eq!(scene.system, [crate::System { source: "c".into(), ..Default::default() }]);
    }

    #[test]
    fn no_text_panics() {
        let text = Scene::documented_toml();
        for (at, _) in text.char_indices().step_by(7) {
            // Whatever is left is a scene or an error that names a line of it.
            if let Err(SceneError::Text { line, .. }) = Scene::from_toml(&text[..at]) {
                assert!(line <= 1 + text[..at].matches('\n').count());
            }
        }
        let deep = "[".repeat(100_000);
        for bad in [format!("system = {deep}"), deep, "image.".repeat(100_000), "\u{0}".into()] {
            assert!(Scene::from_toml(&bad).is_err());
            assert!(Scene::default().set("image", &bad).is_err());
            assert!(Scene::default().set(&bad, "1").is_err());
        }
    }
}
