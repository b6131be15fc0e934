//! The viewer's side of the scene: what is drawn at rest is what `motes render` makes, what is asked is
//! answered, and everything can be taken back.

use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use motes::{Gallery, Layers, Quiet, Scene, Session};
use motes_viewer::{Exhibit, Link, Next, Picture, Request, View};
use serde_json::{Map, Value, json};

const SIZE: [u32; 2] = [120, 80];

/// A client, and what it was told unasked.
struct Client {
    view: Box<dyn View>,
    told: Mutex<Vec<Value>>,
}

fn scene(source: &str, assignments: &[&str]) -> Scene {
    let mut scene = Scene::default();
    scene.set_sources(&[source.into()]);
    assignments.iter().for_each(|a| scene.set_text(a).unwrap());
    scene
}

impl Client {
    fn of(scene: Scene) -> Self {
        let view = Gallery::open(scene).unwrap().open().unwrap();
        let client = Self { view, told: Mutex::default() };
        client.ask("resize", json!({"width": SIZE[0], "height": SIZE[1]})).unwrap();
        client
    }

    fn new(source: &str, assignments: &[&str]) -> Self {
        Self::of(scene(source, assignments))
    }

    fn ask(&self, what: &str, fields: Value) -> Result<Map<String, Value>, String> {
        let Value::Object(fields) = fields else { panic!("{fields}") };
        let request = Request { what: what.into(), fields };
        self.view.ask(&request, &|value| self.told.lock().unwrap().push(value))
    }

    fn set(&self, changes: Value) -> Result<Map<String, Value>, String> {
        self.ask("set", json!({"changes": changes}))
    }

    fn draw(&self) -> (Option<Picture>, Next) {
        let link = Link { encoding: Duration::from_millis(5), anew: false };
        let step = self.view.draw(link, &|value| self.told.lock().unwrap().push(value));
        (step.picture, step.next)
    }

    /// The exact picture, after those before it.
    fn settle(&self) -> Picture {
        let until = Instant::now() + Duration::from_secs(60);
        while Instant::now() < until {
            match self.draw() {
                (Some(picture), _) if picture.exact => return picture,
                (_, Next::After(time)) => std::thread::sleep(time),
                (_, Next::Now) => {}
                (picture, Next::Asked) => panic!("at rest before it was exact: {picture:?}"),
            }
        }
        panic!("never at rest");
    }

    /// What was told last under a name.
    fn last(&self, is: &str) -> Value {
        let told = self.told.lock().unwrap();
        told.iter().rev().find(|v| v["is"] == is).cloned().unwrap()
    }

    /// The scene as it stands.
    fn scene(&self) -> Scene {
        let text = self.ask("scene", json!({})).unwrap()["text"].as_str().unwrap().to_owned();
        Scene::from_toml(&text).unwrap()
    }
}

/// The hash of what `motes render` makes of a scene.
fn rendered(scene: Scene) -> String {
    let frame = scene.image.frame as usize;
    let mut session = Session::open(scene, None).unwrap();
    session.render(frame, Layers::No, &Quiet).unwrap().stats.hash
}

#[test]
fn at_rest_it_is_the_picture_of_render() {
    let sources = [
        ("demo:random:3000", &[][..]),
        ("demo:dam:3000", &["renderer=surface", "surface.mode=refractive"]),
        ("demo:dam:3000", &["renderer=density"]),
    ];
    for (source, assignments) in sources {
        let client = Client::new(source, assignments);
        let changes = [
            json!({"camera.fov": 50}),
            json!({"system.0.where": "Position.x > 0.4"}),
            json!({"system.0.color.by": "Position", "system.0.color.component": "z"}),
            json!({"system.0.radius_scale": 1.5}),
            json!({"system.0.opacity": 0.5}),
            json!({"system.0.opacity": 1, "system.0.where": null}),
            json!({"camera.position": [3, 2, 4], "camera.target": [0.5, 0.5, 0.5]}),
        ];
        for change in changes {
            client.set(change.clone()).unwrap();
            let picture = client.settle();
            assert_eq!((picture.size.0 as u32, picture.size.1 as u32), (SIZE[0], SIZE[1]));
            let hash = format!("{:016x}", picture.hash);
            assert_eq!(hash, rendered(client.scene()), "{source} {change}");
            assert_eq!(client.last("stats")["hash"], hash);
        }
    }
}

#[test]
fn the_command_makes_this_very_picture() {
    let client = Client::new("demo:layers:3000", &["light.preset=sun"]);
    client
        .set(json!({
            "camera.position": [3.5, -2, 4],
            "camera.target": [0.5, 0.5, 0.5],
            "system.0.where": "Position.x > 0.25 && Index != 7",
            "system.0.color.colors": {"it's": "red"},
            "system.0.filter": [{"property": "Position", "component": "z", "max": 0.75}],
            "light.softness": 3.5,
            "image.samples": 2,
        }))
        .unwrap();
    let picture = client.settle();
    let command = client.ask("command", json!({})).unwrap();
    let command = command["text"].as_str().unwrap();
    assert!(command.starts_with("motes render demo:layers:3000 -o "), "{command}");
    let folder = std::env::temp_dir().join(format!("motes-view-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let program = env!("CARGO_BIN_EXE_motes");
    let script = format!("{} --stats stats.json -q", command.replacen("motes", program, 1));
    let done = Command::new("sh").args(["-c", &script]).current_dir(&folder).status().unwrap();
    assert!(done.success(), "{script}");
    let stats = std::fs::read_to_string(folder.join("stats.json")).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let stats: Value = serde_json::from_str(&stats).unwrap();
    assert_eq!(stats["hash"], format!("{:016x}", picture.hash), "{command}");
}

#[test]
fn while_something_moves_pictures_are_coarse_and_then_exact() {
    let client = Client::new("demo:random:3000", &[]);
    client.settle();
    let drag = |fov: f64, mark: bool| {
        client.ask("set", json!({"changes": {"camera.fov": fov}, "mark": mark})).unwrap()
    };
    for fov in [40.0, 41.0] {
        drag(fov, false);
        let (picture, next) = client.draw();
        let picture = picture.unwrap();
        assert!(picture.coarse && !picture.exact && matches!(next, Next::After(_)));
    }
    // A look in between forgets nothing.
    assert!(matches!(client.draw(), (None, Next::After(_))));
    // Held still it is drawn whole, and let go it stays.
    let held = client.settle();
    drag(41.0, true);
    assert_eq!(client.settle().hash, held.hash);
    assert_eq!(client.draw().0.map(|p| p.exact), None);
    client.ask("undo", json!({})).unwrap();
    assert_eq!(client.scene().camera.fov, Scene::default().camera.fov);
}

#[test]
fn everything_can_be_taken_back() {
    let client = Client::new("demo:random:500", &[]);
    let first = client.scene();
    let changes = [
        json!({"camera.fov": 50}),
        json!({"system.0.filter": [{"property": "Position", "min": 0.5}]}),
        json!({"light.preset": "sun", "renderer": "surface"}),
        json!({"camera.keyframe": [{"at": 0.5, "fov": 10}]}),
    ];
    let mut scenes = vec![first];
    for change in changes {
        client.set(change).unwrap();
        scenes.push(client.scene());
    }
    client.ask("reset", json!({"path": "light"})).unwrap();
    scenes.push(client.scene());
    client.ask("load", json!({"scene": "[camera]\nfov = 20.0\n[[system]]\n"})).unwrap();
    assert_eq!(client.scene().camera.fov, 20.0);
    scenes.push(client.scene());
    for scene in scenes.iter().rev().skip(1) {
        client.ask("undo", json!({})).unwrap();
        assert_eq!(&client.scene(), scene);
    }
    assert!(client.ask("undo", json!({})).is_err());
    for scene in &scenes[1..] {
        client.ask("redo", json!({})).unwrap();
        assert_eq!(&client.scene(), scene);
    }
    assert!(client.ask("redo", json!({})).is_err());
    let message = client.last("scene");
    assert_eq!((&message["undo"], &message["redo"]), (&json!(6), &json!(0)));
}

#[test]
fn what_makes_no_sense_is_refused_and_changes_nothing() {
    let client = Client::new("demo:random:500", &[]);
    let before = client.scene();
    let refused = [
        ("set", json!({"changes": {"camera.fov": 50, "camera.fow": 1}}), "camera.fov"),
        ("set", json!({"changes": {"camera.fov": 500}}), "degrees"),
        ("set", json!({"changes": {"system.0.source": "/etc/passwd"}}), "sources"),
        ("set", json!({"changes": {"system.1.where": "x"}}), "index"),
        ("set", json!({"changes": []}), "changes"),
        ("set", json!({}), "changes"),
        ("load", json!({"scene": "[[system]]\nsource = \"/etc/passwd\""}), "sources"),
        ("load", json!({"scene": "fov"}), "line 1"),
        ("reset", json!({"path": "nothing"}), "nothing"),
        ("resize", json!({"width": 0, "height": 10}), "width"),
        ("resize", json!({"width": 8000, "height": 8000}), "pixels"),
        ("play", json!({"fps": 0}), "fps"),
        ("live", json!({"action": "run"}), "simulation"),
        ("pick", json!({"x": 2, "y": 0}), "0 to 1"),
        ("select", json!({"box": [0, 0, 1]}), "box"),
        ("histogram", json!({"system": 0, "property": "Mas"}), "Mas"),
        ("histogram", json!({"system": 3, "property": "Position"}), "system"),
        ("histogram", json!({"property": "Position", "bins": 1e9}), "bins"),
        ("check", json!({"system": 0, "where": "Position.x >"}), "column"),
        ("set", json!({"changes": {"system.0.where": "Nothing > 1"}}), "Nothing"),
        ("set", json!({"changes": {"system.0.color.by": "Vellocity"}}), "Vellocity"),
        ("set", json!({"changes": {"system.0.filter": [{"property": "Nothing"}]}}), "Nothing"),
        ("nonsense", json!({}), "nonsense"),
    ];
    for (what, fields, part) in refused {
        let error = client.ask(what, fields.clone()).unwrap_err();
        assert!(error.contains(part), "{what} {fields}: {error}");
        assert_eq!(client.scene(), before, "{what} {fields}");
    }
    assert!(client.settle().exact);
    // What only shows when it is drawn is told, and the next picture is as good as ever.
    client.set(json!({"renderer": "surface", "surface.environment": "/no/such.png"})).unwrap();
    while client.draw().1 != Next::Asked {}
    assert!(client.last("notice")["text"].as_str().unwrap().contains("/no/such.png"));
    client.ask("undo", json!({})).unwrap();
    assert!(client.settle().exact);
}

#[test]
fn what_is_picked_is_what_the_layers_have() {
    for assignments in [&[][..], &["camera.projection=orthographic", "system.where=Index != 0"]] {
        let client = Client::new("demo:random:2000", assignments);
        client.settle();
        let mut session = Session::open(client.scene(), None).unwrap();
        let frame = session.render(0, Layers::Yes, &Quiet).unwrap().raw;
        let (ids, depths) = (frame.id().unwrap(), frame.depth().unwrap());
        let mut found = 0;
        for pixel in (0..ids.len()).step_by(97) {
            let (x, y) = (pixel % SIZE[0] as usize, pixel / SIZE[0] as usize);
            let at = |i: usize, n: u32| (i as f64 + 0.5) / f64::from(n);
            let fields = json!({"x": at(x, SIZE[0]), "y": at(y, SIZE[1])});
            let picked = &client.ask("pick", fields).unwrap()["picked"];
            let id = picked.get("index").and_then(Value::as_i64).unwrap_or(-1);
            assert_eq!(id, ids[pixel], "{x} {y}");
            if id >= 0 {
                let depth = picked["depth"].as_f64().unwrap() as f32;
                assert!((depth - depths[pixel]).abs() <= 1e-5 * depth, "{depth} {}", depths[pixel]);
                found += 1;
            }
        }
        assert!(found > 20, "{found}");
    }
}

#[test]
fn a_line_drawn_on_the_picture_is_a_plane_that_cuts_and_is_taken_back() {
    let client = Client::new("demo:packed:3000", &[]);
    let whole = client.settle();
    let plane = client.ask("drag", json!({"from": [0.4, 0.5], "to": [0.6, 0.5]})).unwrap();
    let section = json!({"point": plane["point"], "normal": plane["normal"], "cut": "caps"});
    client.set(json!({"section": [section]})).unwrap();
    let cut = client.settle();
    assert!(cut.hash != whole.hash);
    assert_eq!(format!("{:016x}", cut.hash), rendered(client.scene()));
    let visible = client.last("stats")["particles"]["visible"].as_u64().unwrap();
    assert!((500..2900).contains(&visible), "{visible}");
    client.ask("undo", json!({})).unwrap();
    assert_eq!(client.settle().hash, whole.hash);
    for (from, to) in
        [([0.5, 0.5], [0.5, 0.5]), ([0.0, 0.0], [0.01, 0.0]), ([2.0, 0.5], [0.5, 0.5])]
    {
        assert!(client.ask("drag", json!({"from": from, "to": to})).is_err(), "{from:?} {to:?}");
    }
}

#[test]
fn particles_are_selected_counted_and_binned() {
    let client = Client::new("demo:random:2000", &[]);
    client.settle();
    let all = client.ask("select", json!({"box": [1, 1, 0, 0]})).unwrap();
    assert_eq!((&all["count"], all["indices"].as_array().unwrap().len()), (&json!(2000), 1000));
    let none = client.ask("select", json!({"box": [0.0, 0.0, 0.001, 0.001]})).unwrap();
    assert_eq!(none["count"], 0);
    let left = client.ask("select", json!({"box": [0, 0, 0.5, 1]})).unwrap();
    let right = client.ask("select", json!({"box": [0.5, 0, 1, 1]})).unwrap();
    let sum = left["count"].as_u64().unwrap() + right["count"].as_u64().unwrap();
    assert_eq!(sum, 2000);
    let check = |text: &str| client.ask("check", json!({"system": 0, "where": text})).unwrap();
    assert_eq!((&check("Index < 10")["count"], &check("")["count"]), (&json!(10), &json!(2000)));
    let fields = json!({"system": 0, "property": "Position", "component": "x", "bins": 10});
    let bins = client.ask("histogram", fields).unwrap();
    let counts = bins["counts"].as_array().unwrap();
    let count: u64 = counts.iter().map(|c| c.as_u64().unwrap()).sum();
    assert_eq!((counts.len(), count, &bins["missing"]), (10, 2000, &json!(0)));
    assert!(bins["min"].as_f64() < bins["max"].as_f64());
}

#[test]
fn a_simulation_plays_steps_and_starts_again() {
    let client = Client::new("sim:dam-break?particles=300&seconds=0.4", &[]);
    let hello = client.view.hello();
    assert_eq!(
        (&hello["systems"][0]["live"], &hello["resolved"]["frames"]),
        (&json!(true), &json!(11))
    );
    client.settle();
    let step = |action: &str| client.ask("live", json!({"action": action})).unwrap();
    step("step");
    assert_eq!(client.settle().frame, 1);
    step("run");
    let (mut frames, mut last) = (Vec::new(), None);
    while client.last("scene")["resolved"]["playing"] == true {
        match client.draw() {
            (Some(picture), _) => {
                frames.push((picture.frame, picture.playing));
                last = Some(picture);
            }
            (None, Next::After(time)) => std::thread::sleep(time),
            (None, _) => {}
        }
    }
    frames.dedup();
    let shown: Vec<u32> = frames.iter().filter(|(_, playing)| *playing).map(|(f, _)| *f).collect();
    assert_eq!(shown, (1..=10).collect::<Vec<_>>());
    // At rest with the last one, which may have been drawn whole at once.
    let last = last.filter(|picture| picture.exact).unwrap_or_else(|| client.settle());
    assert_eq!(last.frame, 10);
    let camera = client.scene().camera;
    assert!(camera.position.is_some());
    step("restart");
    assert_eq!(client.settle().frame, 0);
    client.ask("live", json!({"action": "pause", "particles": 200})).unwrap();
    assert!(client.scene().system[0].source.contains("particles=200&seconds=0.4"));
    assert_eq!(format!("{:016x}", client.settle().hash), rendered(client.scene()));
    client.ask("undo", json!({})).unwrap_err();
}

#[test]
fn files_are_saved() {
    let client = Client::new("demo:random:300", &[]);
    let save = |file: &str, wanted: &[(&str, &str)]| {
        let wanted = wanted.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
        client.view.save(file, &wanted)
    };
    let small = [("width", "48"), ("height", "32")];
    let png = save("picture.png", &small).unwrap();
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(&png[16..24], b"\0\0\0\x30\0\0\0\x20");
    assert_eq!(&save("layers.npz", &small).unwrap()[..2], b"PK");
    assert_eq!(&save("picture.exr", &small).unwrap()[..4], b"\x76\x2f\x31\x01");
    assert_eq!(&save("film.mp4", &small).unwrap()[4..8], b"ftyp");
    let text = String::from_utf8(save("scene.toml", &[]).unwrap()).unwrap();
    assert!(Scene::from_toml(&text).is_ok() && text.contains("demo:random:300"), "{text}");
    assert!(save("picture.png", &[("width", "-1")]).unwrap_err().contains("width"));
    assert!(save("picture.png", &[("width", "99999")]).is_err());
}

#[test]
fn a_growing_file_is_followed() {
    let folder = std::env::temp_dir().join(format!("motes-follow-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("growing.xyz");
    let frames = |n: usize| (0..n).map(|i| format!("1\nframe\nAr {i} 0 0\n")).collect::<String>();
    std::fs::write(&path, frames(2)).unwrap();
    let scene = scene(path.to_str().unwrap(), &["image.frame=1"]);
    let mut gallery = Gallery::open(scene).unwrap();
    gallery.follow(Duration::from_millis(20)).unwrap();
    let view = gallery.open().unwrap();
    let client = Client { view, told: Mutex::default() };
    assert_eq!(client.settle().frame, 1);
    std::fs::write(&path, frames(5)).unwrap();
    let until = Instant::now() + Duration::from_secs(20);
    while client.draw().0.is_none_or(|p| p.frame != 4) {
        assert!(Instant::now() < until, "the new frame never came");
        std::thread::sleep(Duration::from_millis(10));
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Whatever is asked, in whatever order: no panic, and the picture at rest is right.
#[test]
fn a_monkey_does_no_harm() {
    let client = Client::new("demo:checker:2000", &[]);
    let mut seed = 12345_u64;
    let mut random = |n: u64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) % n
    };
    let until = Instant::now() + Duration::from_secs(4);
    let mut done = 0;
    while Instant::now() < until {
        let part = random(100) as f64 / 100.0;
        let mark = random(2) == 0;
        let asked = match random(14) {
            0 => client.ask("undo", json!({})),
            1 => client.ask("redo", json!({})),
            2 => {
                client.ask("resize", json!({"width": 20 + random(100), "height": 20 + random(80)}))
            }
            3 => client.ask("pick", json!({"x": part, "y": part})),
            4 => client.ask("select", json!({"box": [0, 0, part, 1]})),
            5 => client.set(json!({"system.0.where": format!("Position.x > {part}")})),
            6 => client.set(json!({"system.0.where": null, "system.0.filter": []})),
            7 => client.set(json!({"system.0.color.by": "Position"})),
            8 => client.set(json!({"system.0.opacity": part})),
            9 => {
                let renderer = ["spheres", "surface", "density"][random(3) as usize];
                client.set(json!({"renderer": renderer}))
            }
            10 => client.set(json!({"system.0.radius_scale": 0.5 + part})),
            11 => client.ask("play", json!({"on": mark, "fps": 100})),
            12 => client.ask("reset", json!({"path": "system"})),
            _ => {
                let changes = json!({"camera.fov": 20.0 + 30.0 * part});
                client.ask("set", json!({"changes": changes, "mark": mark}))
            }
        };
        // What cannot be undone is an error, and no more.
        let _ = asked;
        if random(3) == 0 {
            client.draw();
        }
        done += 1;
    }
    assert!(done > 50, "{done}");
    client.ask("play", json!({"on": false})).unwrap();
    client.set(json!({"renderer": "spheres", "camera.fov": 30})).unwrap();
    assert_eq!(format!("{:016x}", client.settle().hash), rendered(client.scene()));
}
