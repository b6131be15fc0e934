//! `motes scene`: every parameter.

use std::path::PathBuf;

use motes::{Scene, read_scene};

use super::talk::{Failure, print};

const EXAMPLES: &str = "\
Examples:
  motes scene                     every parameter with its default
  motes scene | grep -A1 -i light what there is about light
  motes scene > scene.toml        a file to edit, for: motes render --scene scene.toml
  motes scene picture.png         the scene of a picture that Motes made";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// A scene, or a picture of Motes [default: the default scene]
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let text = match &args.scene {
        Some(path) => read_scene(path)?.to_documented_toml(),
        None => Scene::documented_toml(),
    };
    print(text.as_bytes())
}
