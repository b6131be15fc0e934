//! The command line from outside: what it prints, what it writes, how it ends.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

/// A folder of the test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("cli-{name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn data(name: &str) -> String {
    format!("{}/../../data/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn motes(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_motes"));
    command.current_dir(folder).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// What it prints when it does what was asked.
fn succeeds(folder: &Path, args: &[&str]) -> String {
    let output = motes(folder, args);
    assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// What it says when it refuses, with exit code `code`.
fn fails(folder: &Path, args: &[&str], code: i32) -> String {
    let output = motes(folder, args);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    assert!(said.starts_with("motes: "), "{args:?}: {said}");
    assert!(output.stdout.is_empty() && !said.contains("panicked"), "{args:?}: {said}");
    said
}

/// Renders at a small size with `--stats`; gives the stats.
fn stats(folder: &Path, args: &[&str]) -> Value {
    let common = ["render", "--size", "64x48", "--samples", "1", "--stats", "stats.json", "-q"];
    succeeds(folder, &[&common, args].concat());
    serde_json::from_slice(&fs::read(folder.join("stats.json")).unwrap()).unwrap()
}

fn hash(folder: &Path, args: &[&str]) -> String {
    stats(folder, args)["hash"].as_str().unwrap().to_owned()
}

fn read_picture(path: PathBuf) -> motes_frame::Rgba8 {
    motes_frame::read_png(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn help_fits_a_screen() {
    let here = folder("help");
    let verbs: [&[&str]; 5] = [
        &["--help"],
        &["info", "--help"],
        &["render", "--help"],
        &["scene", "--help"],
        &["completions", "--help"],
    ];
    for args in verbs {
        let help = succeeds(&here, args);
        assert!(help.lines().count() <= 50, "{args:?}: {} lines", help.lines().count());
        assert!(help.contains("Example"), "{args:?}");
        let widest = help.lines().map(|l| l.chars().count()).max().unwrap();
        assert!(widest <= 100, "{args:?}: {widest} columns");
    }
    let version = succeeds(&here, &["--version"]);
    assert_eq!(version, format!("motes {}\n", env!("CARGO_PKG_VERSION")));
    assert_eq!(motes(&here, &[]).status.code(), Some(2));
}

#[test]
fn info_for_programs() {
    let here = folder("info");
    let source = data("dump_multiframe_5x8.dump");
    let json: Value = serde_json::from_str(&succeeds(&here, &["info", &source, "--json"])).unwrap();
    assert_eq!(json["frames"], 5);
    assert_eq!(json["particles"], 8);
    assert_eq!(json["format"], "LAMMPS dump");
    for key in ["min", "max"] {
        assert_eq!(json["bounds"][key].as_array().unwrap().len(), 3);
    }
    assert!(json["box"]["origin"].is_array());
    let properties = json["properties"].as_array().unwrap();
    let velocity = properties.iter().find(|p| p["name"] == "Velocity").unwrap();
    assert_eq!(velocity["components"], 3);
    assert_eq!(velocity["min"].as_array().unwrap().len(), 3);
    let kind = properties.iter().find(|p| p["name"] == "Particle Type").unwrap();
    assert!(kind["min"].is_number() && kind["type"].is_string());

    let empty = succeeds(&here, &["info", "demo:random:0", "--json"]);
    let empty: Value = serde_json::from_str(&empty).unwrap();
    assert_eq!((&empty["bounds"], &empty["box"]), (&Value::Null, &Value::Null));
}

#[test]
fn info_for_people() {
    let here = folder("summary");
    let summary = succeeds(&here, &["info", &data("1l2y.pdb"), "--frame", "4"]);
    for part in ["format     PDB", "frames     5", "frame      4", "particles  304", "Position"] {
        assert!(summary.contains(part), "{part} in {summary}");
    }
    // A partial last frame is told of, and the whole ones are served.
    let whole = fs::read(data("dump_multiframe_5x8.dump")).unwrap();
    fs::write(here.join("cut.dump"), &whole[..whole.len() - 30]).unwrap();
    let output = motes(&here, &["info", "cut.dump"]);
    assert!(text(&output.stdout).contains("frames     4"));
    assert!(text(&output.stderr).starts_with("motes: warning: cut.dump"), "{output:?}");
    assert!(motes(&here, &["info", "cut.dump", "-q"]).stderr.is_empty());
}

#[test]
fn a_picture_without_any_file() {
    let here = folder("built-in");
    let args = ["render", "-o", "picture.png", "--size", "96x64", "--samples", "1"];
    let output = motes(&here, &args);
    assert!(output.status.success() && output.stdout.is_empty(), "{output:?}");
    let said = text(&output.stderr);
    assert!(said.starts_with("picture.png: 96×64, 12,750 particles, "), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    let picture = read_picture(here.join("picture.png"));
    let mut colors: Vec<_> = picture.pixels.clone();
    colors.sort_unstable();
    colors.dedup();
    assert!(colors.len() > 100, "{} colours", colors.len());
    assert_eq!(fs::read_dir(&here).unwrap().count(), 1);
}

#[test]
fn a_picture_renders_itself_again() {
    let here = folder("again");
    let first = hash(&here, &["demo:random:1000", "--fov", "50", "-o", "a.png"]);
    succeeds(&here, &["render", "a.png", "-o", "b.png", "--stats", "b.json", "-q"]);
    let second: Value = serde_json::from_slice(&fs::read(here.join("b.json")).unwrap()).unwrap();
    assert_eq!(second["hash"], *first);
    assert_eq!(fs::read(here.join("a.png")).unwrap(), fs::read(here.join("b.png")).unwrap());
    // Flags come on top, and the scene can serve another source.
    assert_ne!(hash(&here, &["a.png", "--fov", "20", "-o", "c.png"]), first);
    assert_eq!(hash(&here, &["--scene", "a.png", "demo:random:1e3"]), first);
    assert!(succeeds(&here, &["scene", "a.png"]).contains("\nfov = 50.0\n"));
    // The frame is part of the scene.
    let source = data("dump_multiframe_5x8.dump");
    let third = hash(&here, &[&source, "--frame", "3", "--color-by", "Velocity.X", "-o", "f.png"]);
    assert_eq!(hash(&here, &["f.png"]), third);
    assert_ne!(hash(&here, &["f.png", "--frame", "0"]), third);
}

/// The header of every array in an NPZ archive.
fn arrays(path: PathBuf) -> Vec<(String, String)> {
    use std::io::Read;
    let mut archive = zip::ZipArchive::new(fs::File::open(path).unwrap()).unwrap();
    let header = |i| {
        let mut file = archive.by_index(i).unwrap();
        let mut start = vec![0; 128];
        file.read_exact(&mut start).unwrap();
        (file.name().unwrap().into_owned(), String::from_utf8_lossy(&start).into_owned())
    };
    (0..5).map(header).collect()
}

#[test]
fn layers_and_their_shapes() {
    let here = folder("layers");
    stats(&here, &["demo:packed:500", "-o", "o.npz", "--layers", "l.npz"]);
    stats(&here, &["demo:packed:500", "-o", "o.exr"]);
    assert_eq!(&fs::read(here.join("o.exr")).unwrap()[..4], b"\x76\x2f\x31\x01");
    for file in ["o.npz", "l.npz"] {
        let arrays = arrays(here.join(file));
        for (name, kind, shape) in [
            ("color.npy", "<f4", "(48, 64, 4)"),
            ("depth.npy", "<f4", "(48, 64)"),
            ("normal.npy", "<f4", "(48, 64, 3)"),
            ("id.npy", "<i8", "(48, 64)"),
            ("system.npy", "<u2", "(48, 64)"),
        ] {
            let (_, header) = arrays.iter().find(|(n, _)| n == name).unwrap();
            assert!(header.contains(&format!("'{kind}'")), "{name}: {header}");
            assert!(header.contains(&format!("'shape': {shape}")), "{name}: {header}");
        }
    }
}

#[test]
fn frames_and_their_files() {
    let here = folder("frames");
    let source = data("dump_multiframe_5x8.dump");
    let files = ["-o", "a_%03d.png", "--stats", "a_{}.json", "-q"];
    let args = ["render", &source, "--size", "32x24", "--frame", "1..3"];
    assert!(succeeds(&here, &[&args, &files[..]].concat()).is_empty());
    for frame in 1..=3 {
        assert!(here.join(format!("a_00{frame}.png")).exists());
        assert!(here.join(format!("a_{frame}.json")).exists());
    }
    assert!(!here.join("a_000.png").exists() && !here.join("a_004.png").exists());
    let render = |frame, name| {
        let args = ["render", &source, "--size", "32x24", "--frame", frame, "-o", name];
        text(&motes(&here, &args).stderr)
    };
    assert_eq!(render("all", "all{}.png").lines().count(), 5);
    assert!(render("last", "last_%d.png").starts_with("last_4.png"));
    assert!(render("3..", "end_%d.png").contains("end_4.png"));
    let said = fails(&here, &["render", &source, "--frame", "0..2", "-o", "one.png"], 2);
    assert!(said.contains("%04d"), "{said}");
    let said = fails(&here, &["render", &source, "--frame", "7", "-o", "one.png"], 1);
    assert!(said.contains("frame 7") && said.contains("has 5"), "{said}");
    fails(&here, &["render", &source, "--frame", "2..1", "-o", "%d.png"], 2);
}

#[test]
fn any_number_of_threads_gives_the_same_picture() {
    let here = folder("threads");
    let of = |threads| stats(&here, &["demo:dam:2000", "--samples", "2", "--threads", threads]);
    let one = of("1");
    assert_eq!(one["threads"], 1);
    for threads in ["2", "3"] {
        let more = of(threads);
        assert_eq!(more["hash"], one["hash"], "{threads} threads");
        assert_eq!(more["threads"].to_string(), threads);
    }
}

#[test]
fn transparent_background() {
    let here = folder("transparent");
    let alpha = |args: &[&str]| {
        stats(&here, &[&["demo:packed:100", "--no-legend", "-o", "a.png"], args].concat());
        let picture = read_picture(here.join("a.png"));
        (picture.pixels[0], picture.pixels[24 * 64 + 32][3])
    };
    let (corner, middle) = alpha(&["--transparent"]);
    assert_eq!((corner[3], middle), (0, 255));
    assert_eq!(alpha(&["--background", "#102030"]), ([16, 32, 48, 255], 255));
}

#[test]
fn two_sources_in_one_picture() {
    let here = folder("two");
    let (a, b) = ("demo:random:100", "demo:packed:200");
    let both = stats(&here, &[a, b, "-o", "both.png"]);
    assert_eq!(both["particles"]["read"], 300);
    assert_ne!(both["hash"], stats(&here, &[a])["hash"]);
    let radius = ["--set", "system.1.radius=0.01"];
    assert_ne!(stats(&here, &[&[a, b], &radius[..]].concat())["hash"], both["hash"]);
    assert_eq!(hash(&here, &["both.png"]), both["hash"].as_str().unwrap());
}

#[test]
fn only_what_is_asked_for_is_shown() {
    let here = folder("where");
    let source = data("1l2y.pdb");
    let visible = |args: &[&str]| {
        stats(&here, &[&[source.as_str()], args].concat())["particles"]["visible"].as_u64().unwrap()
    };
    assert_eq!(visible(&[]), 304);
    // The 20 residues have one Cα each.
    assert_eq!(visible(&["--where", "`Atom Name` == \"CA\""]), 20);
    assert_eq!(visible(&["--where", "`Residue Identifier` <= 0"]), 0);
    let said = fails(&here, &["render", &source, "-o", "a.png", "--where", "Occupancy >"], 2);
    assert!(said.contains("column 12"), "{said}");
}

#[test]
fn flags_are_parameters() {
    let here = folder("flags");
    let demo = "demo:random:200";
    let by_flags = hash(
        &here,
        &[
            demo,
            "--camera-position",
            "-3,-2,1.5",
            "--camera-target",
            "0.5,0.5,0.5",
            "--fov",
            "30",
            "--color-by",
            "Position.X",
            "--colormap",
            "magma",
            "--range",
            "-1,1",
            "--radius",
            "0.05",
        ],
    );
    fs::write(
        here.join("s.toml"),
        "[camera]\nposition = [-3, -2, 1.5]\ntarget = [0.5, 0.5, 0.5]\nfov = 30.0\n
         [[system]]\nradius = 0.05\ncolor = { by = \"Position.X\", map = \"magma\" }\n",
    )
    .unwrap();
    let scene = [demo, "--scene", "s.toml", "--set", "system.color.range=[-1, 1]"];
    assert_eq!(hash(&here, &scene), by_flags);
    // A flag beats the scene, and --set beats the flag.
    let said = [&scene[..], &["--fov", "10", "--set", "camera.fov=30"]].concat();
    assert_eq!(hash(&here, &said), by_flags);
    assert_ne!(hash(&here, &[&scene[..], &["--fov", "10"]].concat()), by_flags);
}

#[test]
fn the_scene_documents_itself() {
    let here = folder("scene");
    let scene = succeeds(&here, &["scene"]);
    assert!(scene.contains("[camera]") && scene.contains("# Vertical field of view"), "{scene}");
    fs::write(here.join("s.toml"), &scene).unwrap();
    assert_eq!(succeeds(&here, &["scene", "s.toml"]), scene);
    // What it prints can be rendered as it is.
    stats(&here, &["--scene", "s.toml", "--size", "8x8"]);
    fs::write(here.join("bad.toml"), "[camera]\nfow = 3\n").unwrap();
    let said = fails(&here, &["scene", "bad.toml"], 2);
    assert!(said.contains("bad.toml: line 2: ") && said.contains("`fov`"), "{said}");
}

#[test]
fn completions_for_every_shell() {
    let here = folder("completions");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(succeeds(&here, &["completions", shell]).contains("render"), "{shell}");
    }
}

#[test]
fn bad_usage_names_the_nearest_word() {
    let here = folder("usage");
    let demo = "demo:random:10";
    for (args, part) in [
        (&["rendr"][..], "'render'"),
        (&["render", demo, "-o", "a.png", "--colr-by", "x"], "'--color-by'"),
        (&["render", demo, "-o", "a.png", "--renderer", "sphere"], "spheres, surface, density"),
        (&["render", demo, "-o", "a.png", "--set", "surface.layers=1000000000"], "surface.layers"),
        (&["render", demo, "-o", "a.png", "--colormap", "viridi"], "`viridis`"),
        (&["render", demo, "-o", "a.png", "--color-by", "Positoin"], "`Position`"),
        (&["render", demo, "-o", "a.png", "--color-by", "elemnt"], "`element`"),
        (&["render", demo, "-o", "a.png", "--set", "camera.fow=3"], "`camera.fov`"),
        (&["render", demo, "-o", "a.png", "--fov", "wide"], "--fov: expected a number"),
        (&["render", demo, "-o", "a.png", "--fov", "200"], "camera.fov"),
        (&["render", demo, "-o", "a.png", "--projection", "fish"], "perspective, orthographic"),
        (&["render", demo, "-o", "a.png", "--size", "big"], "WIDTHxHEIGHT"),
        (&["render", demo, "-o", "a.png", "--size", "0x5"], "image.width"),
        (&["render", demo, "-o", "a.png", "--threads", "0"], "1 to 1024"),
        (&["render", demo, "-o", "a.pgn"], ".png"),
        (&["render", demo, "-o", "nowhere/a.png"], "no directory nowhere"),
        (&["render", demo], "--output"),
        (&["render", demo, "-o", "a.png", "--layers", "l.png"], ".npz"),
        (&["info", demo, "-q", "-v"], "cannot be used with"),
        (&["info"], "<SOURCE>"),
    ] {
        let said = fails(&here, args, 2);
        assert!(said.contains(part), "{args:?}: {said}");
    }
    assert_eq!(fs::read_dir(&here).unwrap().count(), 0);
}

#[test]
fn bad_data_is_named() {
    let here = folder("data");
    fs::write(here.join("noise.xyz"), [0u8, 159, 146, 150].repeat(100)).unwrap();
    fs::write(here.join("empty.xyz"), "").unwrap();
    fs::write(here.join("broken.xyz"), "2\n\nC 0 0 0\nC 1 one 1\n").unwrap();
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    png.extend(b"nothing more");
    fs::write(here.join("bare.png"), png).unwrap();
    for (source, part) in [
        ("none.xyz", "none.xyz: no such file"),
        ("none_*.xyz", "no file matches"),
        ("noise.xyz", "noise.xyz: "),
        ("empty.xyz", "empty.xyz: the file is empty"),
        ("broken.xyz", "broken.xyz: line 4: "),
        ("demo:dan:10", "dam"),
        (".", "directory"),
    ] {
        for args in [&["info", source][..], &["render", source, "-o", "a.png"]] {
            let said = fails(&here, args, 1);
            assert!(said.contains(part), "{args:?}: {said}");
            assert_eq!(said.lines().count(), 1, "{said}");
        }
    }
    let said = fails(&here, &["render", "bare.png", "-o", "a.png"], 1);
    assert!(said.contains("bare.png: ") && said.contains("without"), "{said}");
    fails(&here, &["render", "demo:random:1", "--scene", "none.toml", "-o", "a.png"], 1);
    fails(&here, &["render", "bare.png", "demo:random:1", "-o", "a.png"], 2);
    assert!(!here.join("a.png").exists());
}

#[test]
fn nothing_to_see_is_still_a_picture() {
    let here = folder("nothing");
    assert_eq!(stats(&here, &["demo:random:0", "-o", "a.png"])["particles"]["read"], 0);
    assert!(here.join("a.png").exists());
}

#[test]
fn a_closed_pipe_ends_it_quietly() {
    let here = folder("pipe");
    let mut command = Command::new(env!("CARGO_BIN_EXE_motes"));
    command.current_dir(&here).arg("scene").stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // The reader goes before anything can be read.
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[test]
fn properties_go_by_the_files_own_names_and_components_are_checked() {
    let folder = folder("properties");
    let dump = data("dump_multiframe_5x8.dump");
    let render = ["render", &dump, "-o", "x.png", "--size", "32x24", "--samples", "1", "-q"];
    for good in ["Velocity", "vx", "VELOCITY.Y", "Position.Z", "position[0]", "Index"] {
        succeeds(&folder, &[&render[..], &["--color-by", good]].concat());
    }
    for bad in ["Position[7]", "Position.w", "Velocity[3]", "Velocityy", "elemnt"] {
        fails(&folder, &[&render[..], &["--color-by", bad]].concat(), 2);
    }
    let filter = "system.0.filter=[{property=\"Position[9]\",min=1}]";
    fails(&folder, &[&render[..], &["--set", filter]].concat(), 2);
}

#[test]
fn what_is_not_drawn_is_said_and_what_cannot_be_is_refused() {
    let folder = folder("not-drawn");
    fs::write(folder.join("nan.csv"), "x,y,z\n0,0,0\n1,0,0\nnan,0,0\n0,1,0\n").unwrap();
    let render = ["render", "nan.csv", "-o", "x.png", "--size", "32x24", "--samples", "1"];
    let said = text(&motes(&folder, &render).stderr);
    assert!(said.contains("1 of 4 particles are not drawn"), "{said}");
    for bad in [["--radius", "1e300"], ["--radius", "0"], ["--set", "spheres.lambda=1e9"]] {
        let said = fails(&folder, &[&render[..], &bad].concat(), 2);
        assert!(!said.contains("Some("), "{said}");
    }
    fails(&folder, &["render", "", "-o", "x.png"], 2);
    fails(&folder, &["info", "."], 1);
    assert!(fails(&folder, &["info", "/dev/null"], 1).contains("pipe or a device"));
}

#[test]
fn a_picture_is_drawn_again_from_another_directory() {
    let folder = folder("elsewhere");
    fs::copy(data("trajectory.xyz"), folder.join("here.xyz")).unwrap();
    let first = hash(&folder, &["here.xyz", "-o", "a.png"]);
    let other = folder.join("other");
    fs::create_dir(&other).unwrap();
    assert_eq!(first, hash(&other, &["../a.png", "-o", "b.png"]));
}

#[test]
fn a_single_frame_stands_still_beside_a_series() {
    let folder = folder("still");
    let (moving, still) = (data("trajectory.xyz"), data("mdapy_extended.xyz"));
    let args = ["render", &moving, &still, "-o", "t_%d.png", "--frame", "all"];
    succeeds(&folder, &[&args[..], &["--size", "32x24", "--samples", "1"]].concat());
    assert!(folder.join("t_1.png").exists());
}

#[test]
fn bench_prints_one_line_of_json_for_a_source() {
    let folder = folder("bench");
    let line = |more: &[&str]| -> Value {
        let args =
            ["bench", "spheres", "--source", "demo:dam:2000", "--size", "48x32", "--frames", "1"];
        let text = succeeds(&folder, &[&args[..], &["--json"], more].concat());
        assert_eq!(text.lines().count(), 1, "{text}");
        serde_json::from_str(&text).unwrap()
    };
    let whole = line(&["--peer-view"]);
    let stages = ["ao16", "build", "first_image", "frame", "shadow16"];
    assert_eq!(whole["ms"].as_object().unwrap().keys().collect::<Vec<_>>(), stages);
    assert!(stages.iter().all(|stage| whole["ms"][*stage].as_f64().unwrap() > 0.0));
    assert_eq!((&whole["method"], &whole["source"]), (&"spheres".into(), &"demo:dam:2000".into()));
    assert_eq!((&whole["particles"], &whole["bytes"]["input"]), (&2000.into(), &24000.into()));
    assert!(whole["counts"]["tests"].as_u64().unwrap() > 0 && whole["threads"].is_u64());
    assert_eq!(whole["hash"].as_str().unwrap().len(), 16);

    // Packets change no picture, the camera does; only what was asked for is measured.
    let some = ["--peer-view", "--stages", "frame", "--set", "spheres.packet=2"];
    let packets = line(&some);
    assert_eq!(packets["hash"], whole["hash"]);
    assert_eq!(packets["ms"].as_object().unwrap().keys().collect::<Vec<_>>(), ["frame"]);
    assert_ne!(line(&["--peer-view", "--stages", "frame", "--fov", "20"])["hash"], whole["hash"]);
}

#[test]
fn bench_prints_the_papers_tables() {
    let folder = folder("bench-tables");
    let args = ["bench", "spheres", "--size", "32x32", "--frames", "1", "--scale", "1e-4"];
    let text = succeeds(&folder, &[&args[..], &["--stages", "table2,table5"]].concat());
    let names = ["Cylinder", "JP8", "Bullet", "Thunder", "Foam", "BulletTorso"];
    let starts: Vec<_> = text.lines().filter_map(|line| line.split_whitespace().next()).collect();
    let expected =
        [&["table2:", "Dataset"], &names[..], &["table5:", "Dataset"], &names[..]].concat();
    assert_eq!(starts, expected, "{text}");
    let json = succeeds(&folder, &[&args[..], &["--stages", "table2", "--json"]].concat());
    let tables: Value = serde_json::from_str(&json).unwrap();
    let cell = &tables[0]["rows"][5]["values"][3];
    let rate = 1e3 / cell["ms"].as_f64().unwrap();
    assert!((cell["frames_per_second"].as_f64().unwrap() / rate - 1.0).abs() < 1e-9);
    assert_eq!(tables[0]["columns"][3], "16 x 16");
}

#[test]
fn bench_of_a_surface_prints_a_line_and_tables() {
    let folder = folder("bench-surface");
    let size = ["bench", "surface", "--size", "48x32", "--frames", "1"];
    let args = ["--source", "demo:dam:2000", "--json"];
    let line: Value =
        serde_json::from_str(&succeeds(&folder, &[&size[..], &args].concat())).unwrap();
    let stages = [
        "build",
        "compress",
        "connect",
        "filter",
        "first_image",
        "frame",
        "normals",
        "refractive",
        "splat",
        "translucent",
    ];
    assert_eq!(line["ms"].as_object().unwrap().keys().collect::<Vec<_>>(), stages);
    assert_eq!((&line["method"], &line["particles"]), (&"surface".into(), &2000.into()));
    assert_eq!(line["bytes"]["input"], 24_000);
    assert!(line["counts"]["kept"].as_u64().unwrap() > 0 && line.get("primary").is_none());
    let text = succeeds(&folder, &[&size[..], &args[..2]].concat());
    assert!(text.contains("refractive") && text.contains(line["hash"].as_str().unwrap()), "{text}");

    let args = ["--scale", "1e-4", "--stages", "table1,view"];
    let text = succeeds(&folder, &[&size[..], &args].concat());
    let starts: Vec<_> = text.lines().filter_map(|line| line.split_whitespace().next()).collect();
    let tiles = ["table1:", "Dataset", "16", "32", "64", "128", "256", "512"];
    let views = ["view:", "Dataset", "(a)", "(b),", "(b),"];
    assert_eq!(starts, [&tiles[..], &views].concat(), "{text}");
}

#[test]
fn bench_of_a_density_prints_a_line_and_tables() {
    let folder = folder("bench-density");
    let size = ["bench", "density", "--size", "48x32", "--frames", "1"];
    let args = ["--source", "sim:dam-break?particles=1000", "--json"];
    let line: Value =
        serde_json::from_str(&succeeds(&folder, &[&size[..], &args].concat())).unwrap();
    let stages = ["build", "first_image", "frame", "live", "march", "sim1", "sim2", "step"];
    assert_eq!(line["ms"].as_object().unwrap().keys().collect::<Vec<_>>(), stages);
    assert_eq!((&line["method"], &line["particles"]), (&"density".into(), &1000.into()));
    let count = |name: &str| line["counts"][name].as_u64().unwrap();
    assert!(count("sim1_updates") > count("sim2_updates") && count("sim2_updates") > 0);
    let text = succeeds(&folder, &[&size[..], &args[..2]].concat());
    assert!(text.contains("live") && text.contains(line["hash"].as_str().unwrap()), "{text}");
    // What does not move has no live frames.
    let still = ["--source", "demo:dam:2000", "--json"];
    let line: Value =
        serde_json::from_str(&succeeds(&folder, &[&size[..], &still].concat())).unwrap();
    assert!(line["ms"]["live"].is_null() && line["ms"]["sim1"].is_number());

    let text = succeeds(&folder, &[&size[..], &["--scale", "0.01"]].concat());
    let starts: Vec<_> = text.lines().filter_map(|line| line.split_whitespace().next()).collect();
    let table1 = ["table1:", "Dataset", "8,000", "27,000", "64,000", "125,000"];
    let fig5 = ["fig5:", "Dataset", "live", "still"];
    let mask = ["mask:", "Dataset", "27,000", "1,000,000"];
    assert_eq!(starts, [&table1[..], &fig5, &mask].concat(), "{text}");
}

#[test]
fn bench_refuses_what_makes_no_sense() {
    let folder = folder("bench-refusals");
    for (args, word) in [
        (&["spheres", "--stages", "table1"][..], "'table1'"),
        (&["spheres", "--source", "demo:dam:9", "--stages", "table2"], "'table2'"),
        (&["spheres", "--fov", "30"], "--fov"),
        (&["spheres", "--scale", "0"], "--scale"),
        (&["spheres", "--frames", "0"], "--frames"),
        (&["spheres", "--peer-view"], "--source"),
        (&["surface", "--stages", "table3"], "'table3'"),
        (&["surface", "--source", "demo:dam:9", "--stages", "shadow16"], "'shadow16'"),
        (&["surface", "--source", "demo:dam:9", "--set", "surface.gap=-1"], "surface.gap"),
        (&["density", "--stages", "table2"], "'table2'"),
        (&["density", "--source", "demo:dam:9", "--stages", "ao16"], "'ao16'"),
        (&["sections", "--stages", "table2"], "'table2'"),
    ] {
        let said = fails(&folder, &[&["bench"], args].concat(), 2);
        assert!(said.contains(word), "{args:?}: {said}");
    }
}

#[test]
fn a_simulation_is_a_source_and_is_written() {
    let folder = folder("simulate");
    let short = "dam-break?particles=300&seconds=0.12";
    for end in ["vtk", "npz", "xyz"] {
        succeeds(&folder, &["simulate", short, "-o", &format!("out_%02d.{end}"), "-q"]);
        let file = format!("out_03.{end}");
        let info = succeeds(&folder, &["info", &file, "--json"]);
        let info: Value = serde_json::from_str(&info).unwrap();
        assert_eq!(info["particles"], 300, "{end}");
        let names: Vec<_> =
            info["properties"].as_array().unwrap().iter().map(|p| &p["name"]).collect();
        assert!(names.iter().any(|n| *n == "Particle Mask"), "{end}: {names:?}");
        // The file and the simulation itself make the same picture.
        let by = ["--color-by", "Density", "--set", "overlay.time=off", "--set", "overlay.box=off"];
        let of_file = hash(&folder, &[&[file.as_str()][..], &by].concat());
        let source = format!("sim:{short}");
        let of_sim = hash(&folder, &[&[source.as_str(), "--frame", "3"][..], &by].concat());
        // Text has its columns in double precision, and the ends of the colours differ by that.
        assert!(end == "xyz" || of_file == of_sim, "{end}");
        assert!(!folder.join(format!("out_04.{end}")).exists());
    }
    let on = ["simulate", short, "--restart", "out_03.vtk", "--frame", "1", "-o", "on.vtk", "-q"];
    succeeds(&folder, &on);
    let info: Value =
        serde_json::from_str(&succeeds(&folder, &["info", "on.vtk", "--json"])).unwrap();
    assert!((info["time"].as_f64().unwrap() - 0.16).abs() < 1e-9);

    assert!(fails(&folder, &["simulate", "dam-brake", "-o", "o_{}.vtk"], 2).contains("dam-break"));
    assert!(fails(&folder, &["simulate", short, "-o", "o.vtk"], 2).contains("%04d"));
    assert!(fails(&folder, &["simulate", short, "-o", "o_{}.png"], 2).contains(".npz"));
    assert!(fails(&folder, &["info", "sim:column?widht=1"], 2).contains("width"));
    let late = ["simulate", short, "--frame", "9", "-o", "o.vtk"];
    assert!(fails(&folder, &late, 1).contains("0 to 3"));
    assert!(
        fs::read_dir(&folder).unwrap().flatten().all(|f| f
            .file_name()
            .to_string_lossy()
            .starts_with('o')
            || f.file_name() == "stats.json")
    );
}
