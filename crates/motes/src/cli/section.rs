//! `motes section`: a cut from a line drawn on the picture.

use std::path::{Path, PathBuf};

use motes::{Layers, Scene, Section, Session, is_picture, read_scene};

use super::meter::Meter;
use super::talk::{Failure, Talk, print};

const EXAMPLES: &str = "\
Examples:
  motes section scene.toml --drag 960,200,960,700         cut downward: the plane, and into the scene
  motes section picture.png --drag 300,540,800,540 -o cut.toml
  motes render --scene cut.toml -o cut.png";

/// As typed.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, arg_required_else_help = true)]
pub(crate) struct Args {
    /// A scene, or a picture of Motes
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// From where on the picture to where, in pixels: the plane goes through the first point, and keeps
    /// what lies towards the second
    #[arg(long, value_name = "X1,Y1,X2,Y2", allow_hyphen_values = true)]
    drag: String,
    /// Write the scene here, not back
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// How it cuts: caps, open or centre [default: caps]
    #[arg(long, value_name = "HOW")]
    cut: Option<String>,
}

pub(crate) fn run(args: &Args, talk: Talk) -> Result<(), Failure> {
    let [x1, y1, x2, y2] = numbers(&args.drag)?;
    let scene = read_scene(&args.scene)?;
    if args.output.is_none() && is_picture(&args.scene.to_string_lossy()) {
        let message = format!("{}: a picture is not changed", args.scene.display());
        return Err(Failure::usage(message + "; name a scene with --output"));
    }
    let mut session = Session::open(scene.clone(), None)?;
    let meter = Meter::new(talk);
    let picture = session.render(scene.image.frame as usize, Layers::Yes, &meter)?;
    drop(meter);
    let found = picture.section_of_drag([x1, y1], [x2, y2]);
    let section = found.map_err(|e| Failure::usage(format!("--{e}")))?;
    let mut cut = scene.clone();
    cut.section.push(section.clone());
    if let Some(how) = &args.cut {
        let last = format!("section.{}.cut", scene.section.len());
        cut.set(&last, how).map_err(|e| Failure::usage(format!("--cut: {e}")))?;
    }
    match &args.output {
        Some(path) => write(path, &cut.to_documented_toml())?,
        None => write(&args.scene, &appended(&args.scene, &cut)?)?,
    }
    let Section { point, normal, .. } = section;
    let numbers = [point.to_array(), normal.to_array()].concat();
    let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
    print(format!("{}\n", numbers.join(",")).as_bytes())
}

/// The text of a scene as it stands, and its new section after it.
fn appended(path: &Path, cut: &Scene) -> Result<String, Failure> {
    let told = |e: &dyn std::fmt::Display| Failure::data(format!("{}: {e}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|e| told(&e))?;
    let section = cut.section.last().map_or_else(String::new, Section::to_toml);
    let text = format!("{}\n\n{section}", text.trim_end());
    match Scene::from_toml(&text) {
        Ok(same) if same == *cut => Ok(text),
        _ => Err(told(&"its sections cannot be added to as they are written; use --output")),
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|e| Failure::data(format!("{}: {e}", path.display())))
}

fn numbers(text: &str) -> Result<[f64; 4], Failure> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| {
        Failure::usage(format!("--drag: expected two points, X1,Y1,X2,Y2, found {text}"))
    })
}
