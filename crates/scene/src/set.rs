//! `path=value` into a scene, as `--set` and the viewer do.

use toml::{Table, Value};

use crate::error::{Result, SceneError, likeness, quoted};
use crate::scene::Scene;
use crate::settings::{Setting, Shape};
use crate::text::{fill_in_preset, join};

impl Scene {
    /// Sets a parameter from `path=value`, as [`Scene::set`] does.
    ///
    /// # Errors
    /// As [`Scene::set`]; or there is no `=`.
    pub fn set_text(&mut self, assignment: &str) -> Result<()> {
        let (path, value) = assignment
            .split_once('=')
            .ok_or_else(|| SceneError::value(assignment, "path=value", "no `=`"))?;
        self.set(path.trim(), value.trim())
    }

    /// Sets the parameter at `path`, such as `camera.fov` or `system.0.color.map`; without its index
    /// (`system.color.map`), in every system.
    ///
    /// `value` is TOML; a bare word is text, and `1,2,3` is `[1,2,3]`.
    ///
    /// # Errors
    /// No such path (the nearest is named) or a value of the wrong type (what was expected is named);
    /// the scene is then as it was.
    pub fn set(&mut self, path: &str, value: &str) -> Result<()> {
        let shape = Self::shape();
        let names: Vec<&str> = path.split('.').collect();
        let leaf = find(&shape, &names).ok_or_else(|| unknown_path(&shape, path))?;
        let wrong = || SceneError::value(path, leaf.expected(), format!("`{}`", quoted(value)));
        for reading in readings(value) {
            if let Some(scene) = self.with((&shape, &names), Some(&reading))? {
                *self = scene;
                return Ok(());
            }
        }
        Err(wrong())
    }

    /// Sets the parameter at `path`, as [`Scene::set`] finds it, to a value; `None` is its default.
    ///
    /// # Errors
    /// As [`Scene::set`].
    pub fn put(&mut self, path: &str, value: Option<&Value>) -> Result<()> {
        let shape = Self::shape();
        let names: Vec<&str> = path.split('.').collect();
        let leaf = find(&shape, &names).ok_or_else(|| unknown_path(&shape, path))?;
        let found = || value.map_or("nothing".into(), |v| quoted(&v.to_string()));
        let wrong = || SceneError::value(path, leaf.expected(), found());
        *self = self.with((&shape, &names), value)?.ok_or_else(wrong)?;
        Ok(())
    }

    /// The scene with another value at a path that is known to be one of `shape`'s; none if the value is
    /// of the wrong type.
    fn with(
        &self,
        (shape, names): (&Shape, &[&str]),
        value: Option<&Value>,
    ) -> Result<Option<Self>> {
        let Ok(tree) = Table::try_from(self) else { return Ok(None) };
        let mut tree = Value::Table(tree);
        // A preset is no value beside others: it stands for all of them.
        if let (["light", "preset"], Value::Table(tree)) = (names, &mut tree) {
            tree.insert("light".into(), Value::Table(Table::new()));
        }
        assign(shape, &mut tree, Target { names, path: "" }, value)?;
        if let Value::Table(tree) = &mut tree {
            fill_in_preset(tree);
        }
        Ok(tree.try_into().ok())
    }
}

/// What `text` can mean, the first that fits wins: TOML; a list without its brackets; numbers as people write
/// them, such as `.5` or `2.`; a bare word.
fn readings(text: &str) -> Vec<Value> {
    let toml = |text: String| -> Option<Value> {
        let mut table: Table = toml::from_str(&format!("v = {text}")).ok()?;
        if table.len() == 1 { table.remove("v") } else { None }
    };
    let mut readings: Vec<Value> = toml(text.into()).into_iter().collect();
    if text.contains(',') {
        readings.extend(toml(format!("[{text}]")));
    }
    let number = |item: &str| {
        let plain = item.trim().bytes().all(|b| b"+-.0123456789eE".contains(&b));
        item.trim().parse().ok().filter(|_| plain).map(Value::Float)
    };
    let items = text.trim().trim_start_matches('[').trim_end_matches(']').split(',');
    let numbers: Option<Vec<_>> = items.map(number).collect();
    match numbers {
        Some(mut one) if one.len() == 1 => readings.extend(one.pop()),
        Some(several) => readings.push(Value::Array(several)),
        None => {}
    }
    readings.push(Value::String(text.into()));
    readings
}

/// What stands at `names` below `shape`; an index of a list may be left out.
fn find<'a>(shape: &'a Shape, names: &[&str]) -> Option<&'a Shape> {
    let Some((name, rest)) = names.split_first() else { return Some(shape) };
    match shape {
        Shape::Value(_) => None,
        Shape::Map(of) => find(of, rest),
        Shape::List(of, _) if name.parse::<usize>().is_ok() => find(of, rest),
        Shape::List(of, _) => find(of, names),
        Shape::Table(fields) => find(&fields.iter().find(|f| f.name == *name)?.shape, rest),
    }
}

/// The names still to go, and the path gone so far.
#[derive(Clone, Copy)]
struct Target<'a> {
    names: &'a [&'a str],
    path: &'a str,
}

/// Puts `new` where `target` points below `value`, or takes away what is there; the path is known to be
/// one of `shape`'s.
fn assign(shape: &Shape, value: &mut Value, target: Target<'_>, new: Option<&Value>) -> Result<()> {
    let Some((name, rest)) = target.names.split_first() else {
        if let Some(new) = new {
            *value = new.clone();
        }
        return Ok(());
    };
    let path = join(target.path, name);
    let next = Target { names: rest, path: &path };
    match (shape, value) {
        (Shape::List(of, _), Value::Array(items)) => match name.parse::<usize>() {
            Ok(index) => {
                let count = items.len();
                let item = items.get_mut(index).ok_or_else(|| {
                    let expected = format!("an index below {count} (they count from 0)");
                    SceneError::value(target.path, expected, index)
                })?;
                if let (Shape::List(_, defaults), None, []) = (shape, new, rest) {
                    *item = Value::Table(defaults.clone());
                }
                assign(of, item, next, new)
            }
            Err(_) => items.iter_mut().try_for_each(|item| assign(of, item, target, new)),
        },
        (Shape::Map(_), Value::Table(table)) | (Shape::Table(_), Value::Table(table))
            if new.is_none() && rest.is_empty() =>
        {
            table.remove(*name);
            Ok(())
        }
        (Shape::Map(of), Value::Table(table)) => {
            assign(of, table.entry(*name).or_insert(Value::Boolean(false)), next, new)
        }
        (Shape::Table(fields), Value::Table(table)) => {
            match fields.iter().find(|f| f.name == *name) {
                Some(field) => {
                    let entry = table.entry(field.name).or_insert(Value::Boolean(false));
                    assign(&field.shape, entry, next, new)
                }
                None => Ok(()),
            }
        }
        _ => Ok(()),
    }
}

/// Names the parameter most like `path`, by its whole path or by its last word.
fn unknown_path(shape: &Shape, path: &str) -> SceneError {
    let mut known = Vec::new();
    paths(shape, "", &mut known);
    let typed: Vec<_> = path.split('.').filter(|w| w.parse::<usize>().is_err()).collect();
    let (whole, last) = (typed.join("."), typed.last().copied().unwrap_or_default());
    let score = |known: &str| {
        let known_last = known.rsplit('.').next().unwrap_or(known);
        let by_last = likeness(last, known_last);
        // The whole path breaks ties between parameters of one name, and then the one higher up wins.
        let depth = known.matches('.').count() as f64;
        by_last.max(likeness(&whole, known)) + 0.01 * likeness(&whole, known) - 0.005 * depth
    };
    let nearest = known.iter().map(|k| (score(k), k)).max_by(|a, b| a.0.total_cmp(&b.0));
    let hint = match nearest {
        Some((score, known)) if score > 0.75 => format!("; did you mean `{known}`?"),
        _ => "; `motes scene` prints them all".into(),
    };
    SceneError::UnknownPath { path: quoted(path), hint }
}

/// Every parameter's path, without indices.
fn paths(shape: &Shape, path: &str, out: &mut Vec<String>) {
    match shape {
        Shape::Table(fields) => {
            fields.iter().for_each(|f| paths(&f.shape, &join(path, f.name), out));
        }
        Shape::List(of, _) => paths(of, path, out),
        Shape::Value(_) | Shape::Map(_) => out.push(path.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Color;
    use crate::scene::{ColorBy, Projection, System};
    use glam::DVec3;

    fn with(assignments: &[&str]) -> Scene {
        let mut scene = Scene::default();
        scene.system.push(System::default());
        for a in assignments {
            scene.set_text(a).unwrap_or_else(|e| panic!("{a}: {e}"));
        }
        scene
    }

    #[test]
    fn values_of_every_kind() {
        let scene = with(&[
            "image.samples=16",
            "camera.fov = 40",
            "camera.position=1,2,3",
            "camera.projection=orthographic",
            "system.radius=2",
            "system.1.radius=1",
            "system.color.map=magma",
            "system.color.by=Particle Type",
            "system.color.range=0,1.5",
            "system.0.color.colors.Na=red",
            "system.where=x > 1 && y = 2",
            "system.1.filter=[{property=\"Mass\", min=1}]",
            "system.1.filter.0.max=3",
            "image.background=#ff0000",
        ]);
        assert_eq!((scene.image.samples, scene.camera.fov), (16, 40.0));
        assert_eq!(scene.camera.position, Some(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(scene.camera.projection, Projection::Orthographic);
        assert_eq!([scene.system[0].radius, scene.system[1].radius], [Some(2.0), Some(1.0)]);
        assert_eq!(scene.system[1].color.map, "magma");
        assert_eq!(scene.system[1].color.by, ColorBy::Property("Particle Type".into()));
        assert_eq!(scene.system[0].color.range, Some([0.0, 1.5]));
        assert_eq!(scene.system[0].color.colors["Na"], Color::hex(0xff0000));
        assert_eq!(scene.system[0].r#where, "x > 1 && y = 2");
        assert_eq!(scene.system[1].filter[0].max, Some(3.0));
        assert_eq!(scene.image.background, Color::hex(0xff0000));
    }

    #[test]
    fn values_are_put_and_taken_away() {
        let mut scene = with(&["system.color.colors.Na=red", "light.preset=sun", "camera.fov=4"]);
        let put =
            |scene: &mut Scene, path: &str, value: Option<Value>| scene.put(path, value.as_ref());
        put(&mut scene, "camera.fov", Some(Value::Integer(50))).unwrap();
        put(&mut scene, "camera.position", Some(vec![1.0, 2.0, 3.0].into())).unwrap();
        put(&mut scene, "system.0.where", Some("Mass > 1".into())).unwrap();
        put(&mut scene, "light.softness", Some(Value::Float(1.5))).unwrap();
        assert_eq!((scene.camera.fov, scene.light.softness), (50.0, 1.5));
        assert_eq!(scene.camera.position, Some(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!((&*scene.system[0].r#where, &*scene.system[1].r#where), ("Mass > 1", ""));
        for path in ["camera", "system.0.where", "system.1.color.colors.Na", "light.softness"] {
            put(&mut scene, path, None).unwrap();
        }
        assert_eq!(scene.camera, Scene::default().camera);
        assert_eq!(scene.light, with(&["light.preset=sun"]).light);
        assert!(scene.system[0].color.colors.contains_key("Na"));
        assert!(scene.system[1].color.colors.is_empty());
        put(&mut scene, "system.0", None).unwrap();
        assert_eq!(scene.system[0], System::default());
        let before = scene.clone();
        let error = put(&mut scene, "camera.fov", Some("wide".into())).unwrap_err().to_string();
        assert!(error.starts_with("camera.fov: expected a number"), "{error}");
        assert!(
            put(&mut scene, "camera.fow", None).unwrap_err().to_string().contains("camera.fov")
        );
        assert!(put(&mut scene, "system.7.where", None).is_err());
        assert_eq!(scene, before);
    }

    #[test]
    fn numbers_are_read_as_people_write_them() {
        let scene =
            with(&["camera.position=.5, -1.,2", "camera.target=[0,.5,1e-1]", "camera.fov=4."]);
        assert_eq!(scene.camera.position, Some(glam::DVec3::new(0.5, -1.0, 2.0)));
        assert_eq!(scene.camera.target, Some(glam::DVec3::new(0.0, 0.5, 0.1)));
        assert_eq!(scene.camera.fov, 4.0);
    }

    #[test]
    fn text_that_looks_like_another_type_stays_text() {
        let scene = with(&["system.name=12", "system.source=true", "system.0.name=1,2"]);
        assert_eq!(scene.system[0].name, "1,2");
        assert_eq!((&*scene.system[1].name, &*scene.system[1].source), ("12", "true"));
    }

    #[test]
    fn errors_say_what_was_meant() {
        let error = |a: &str| Scene::default().set_text(a).unwrap_err().to_string();
        for (typed, named) in [
            ("image.sampels=4", "`image.samples`"),
            ("samples=4", "`image.samples`"),
            ("fov=4", "`camera.fov`"),
            ("system.0.colour.map=magma", "`system.color.map`"),
            ("camera.fov.x=1", "`camera.fov`"),
            ("qqqqq=1", "`motes scene`"),
        ] {
            assert!(error(typed).contains(named), "{typed}: {}", error(typed));
        }
        assert_eq!(
            error("image.samples=many"),
            "image.samples: expected a whole number, 0 or more, found `many`"
        );
        assert!(error("image.samples=-1").contains("found `-1`"));
        assert!(error("camera.projection=fish").contains("perspective, orthographic"));
        assert!(error("system.7.radius=1").contains("an index below 1"));
        assert!(error("fov").contains("path=value"));
        assert!(error("camera.fov=1\nimage = 3").contains("a number"));
    }
}
