//! Films from outside: what is made of frames, of cameras that move, and of both.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const SERIES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/dump_multiframe_5x8.dump");

/// A folder of the test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("films-{name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_motes"));
    command.current_dir(folder).args(args);
    command
}

/// Renders small and quickly; gives what was said.
fn render(folder: &Path, args: &[&str]) -> String {
    let common = ["render", "--size", "48x32", "--samples", "1"];
    let output = command(folder, &[&common, args].concat()).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{args:?}: {said}");
    said
}

fn refused(folder: &Path, args: &[&str], code: i32) -> String {
    let Output { status, stderr, .. } = command(folder, args).output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(code), "{args:?}: {said}");
    said
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// How many pictures a film has, by its table of sizes.
fn pictures(film: &Path) -> u32 {
    let bytes = fs::read(film).unwrap();
    let at = bytes.windows(4).position(|w| w == b"stsz").unwrap() + 12;
    u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// The line of a parameter in a picture's scene.
fn parameter(picture: &Path, name: &str) -> String {
    let output = command(Path::new("."), &["scene", picture.to_str().unwrap()]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let line = text.lines().find(|line| line.starts_with(&format!("{name} =")));
    line.unwrap_or_else(|| panic!("{name} in {text}")).to_owned()
}

#[test]
fn a_series_is_a_film() {
    let here = folder("series");
    let said = render(&here, &[SERIES, "--video", "a.mp4", "--set", "film.fps=10"]);
    assert!(said.starts_with("a.mp4: 5 pictures, 48×32, 0.5 s, "), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert_eq!((names(&here), pictures(&here.join("a.mp4"))), (vec!["a.mp4".to_owned()], 5));

    render(&here, &[SERIES, "--video", "b.mp4", "--frame", "1..3", "-o", "b_%d.png"]);
    assert_eq!(pictures(&here.join("b.mp4")), 3);
    assert_eq!(names(&here), ["a.mp4", "b.mp4", "b_1.png", "b_2.png", "b_3.png"]);
    // What is measured in the first frame holds in all.
    for name in ["radius", "occlusion_radius", "position", "target"] {
        let of = |picture| parameter(&here.join(picture), name);
        assert_eq!(of("b_1.png"), of("b_3.png"));
    }
}

#[test]
fn a_film_has_as_many_pictures_as_it_is_told() {
    let here = folder("count");
    render(&here, &[SERIES, "-o", "%02d.png", "--set", "film.frames=8"]);
    let frames: Vec<String> =
        names(&here).iter().map(|name| parameter(&here.join(name), "frame")).collect();
    let expected = [0, 0, 1, 1, 2, 3, 3, 4].map(|frame| format!("frame = {frame}"));
    assert_eq!(frames, expected);
    // A single frame that nothing moves about is one picture; a camera takes 8 seconds to go around.
    render(&here, &["demo:random:100", "--video", "one.mp4"]);
    assert_eq!(pictures(&here.join("one.mp4")), 1);
    let args = ["demo:random:100", "--video", "turn.mp4", "--turn", "90", "--set", "film.fps=2"];
    render(&here, &args);
    assert_eq!(pictures(&here.join("turn.mp4")), 16);
}

#[test]
fn a_turn_ends_where_it_began_and_each_picture_can_be_drawn_again() {
    let here = folder("turn");
    let args = ["demo:random:500", "--turn", "360", "--set", "film.frames=4"];
    render(&here, &[&args[..], &["-o", "a%d.png", "--video", "a.mp4"]].concat());
    assert_eq!(names(&here).len(), 5);
    let position = |n| parameter(&here.join(format!("a{n}.png")), "position");
    let numbers = |n| -> Vec<f64> {
        let line = position(n);
        let list = line.split_once('[').unwrap().1.trim_end_matches(']');
        list.split(',').map(|v| v.trim().parse().unwrap()).collect()
    };
    let target = {
        let line = parameter(&here.join("a0.png"), "target");
        let list = line.split_once('[').unwrap().1.trim_end_matches(']').to_owned();
        list.split(',').map(|v| v.trim().parse::<f64>().unwrap()).collect::<Vec<_>>()
    };
    let (first, opposite) = (numbers(0), numbers(2));
    for axis in 0..2 {
        let middle = f64::midpoint(first[axis], opposite[axis]);
        assert!((middle - target[axis]).abs() < 1e-9, "{first:?} {opposite:?} {target:?}");
    }
    assert!((first[2] - opposite[2]).abs() < 1e-12);
    render(&here, &["a3.png", "-o", "again.png"]);
    assert_eq!(fs::read(here.join("a3.png")).unwrap(), fs::read(here.join("again.png")).unwrap());
}

#[test]
fn keyframes_of_a_scene_are_met() {
    let here = folder("keys");
    let keys = "[camera]\nposition = [9.0, 0.0, 0.0]\ntarget = [0.5, 0.5, 0.5]\n\
                [[camera.keyframe]]\nat = 0.0\n\
                [[camera.keyframe]]\nat = 1.0\nposition = [0.0, 5.0, 1.0]\nfov = 50.0\n\
                [film]\nframes = 3\n";
    fs::write(here.join("scene.toml"), keys).unwrap();
    render(&here, &["demo:random:100", "--scene", "scene.toml", "-o", "%d.png"]);
    let of = |n, name| parameter(&here.join(format!("{n}.png")), name);
    assert_eq!(of(0, "position"), "position = [9.0, 0.0, 0.0]");
    assert_eq!(of(2, "position"), "position = [0.0, 5.0, 1.0]");
    assert_eq!((of(0, "fov"), of(1, "fov"), of(2, "fov")), {
        ("fov = 35.0".into(), "fov = 42.5".into(), "fov = 50.0".into())
    });
    // A picture without a number is one, before the camera as it stands.
    render(&here, &["demo:random:100", "--scene", "scene.toml", "-o", "one.png"]);
    assert_eq!(parameter(&here.join("one.png"), "position"), "position = [9.0, 0.0, 0.0]");
}

#[test]
fn what_cannot_be_a_film_is_refused_before_there_is_work() {
    let here = folder("refused");
    let demo = "demo:random:10";
    for (args, part) in [
        (&["render", demo, "--video", "a.avi"][..], ".mp4"),
        (&["render", demo, "--video", "none/a.mp4"], "no directory none"),
        (&["render", demo, "--video", "a.mp4", "--transparent"], "transparency"),
        (&["render", demo, "--video", "a.mp4", "-o", "a.png"], "%04d"),
        (&["render", demo, "-o", "a.png", "--turn", "90"], "--video"),
        (&["render", demo, "--video", "a.mp4", "--turn", "around"], "--turn: expected a number"),
        (&["render", demo, "--video", "a.mp4", "--light", "moon"], "overcast"),
        (&["render", demo, "--video", "a.mp4", "--set", "film.quality=200"], "film.quality"),
        (&["render", demo, "--video", "a.mp4", "--size", "20000x16"], "20000×16"),
    ] {
        let said = refused(&here, args, 2);
        assert!(said.contains(part), "{args:?}: {said}");
    }
    let said = refused(&here, &["render", SERIES, "--video", "a.mp4", "--frame", "3..9"], 1);
    assert!(said.contains("the file has 5"), "{said}");
    assert_eq!(names(&here), Vec::<String>::new());
}

#[cfg(unix)]
#[test]
fn what_is_cancelled_leaves_nothing() {
    let here = folder("cancelled");
    let args = ["render", "demo:random:2000", "--size", "64x48", "--video", "a.mp4", "--turn", "9"];
    let args = [&args[..], &["--set", "film.frames=1000000"]].concat();
    let mut child = command(&here, &args).stderr(std::process::Stdio::null()).spawn().unwrap();
    // The unfinished film is there once the handler is.
    while names(&here).is_empty() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(names(&here)[0].starts_with(".a.mp4."));
    let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupt.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(names(&here), Vec::<String>::new());
}
