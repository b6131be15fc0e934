//! Where particles and scenes come from.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::DVec3;
use motes_frame::scene_in_png;
use motes_particles::read::{Input, open_input};
use motes_particles::{Place, ReadError, Series};
use motes_scene::{ColorBy, Scene, Sph};

use crate::simulate::Simulated;
use crate::{Error, Result};

/// The source that needs no file: an antibody, PDB entry 1IGY.
pub const BUILT_IN: &str = "demo:antibody";

const ANTIBODY: &[u8] = include_bytes!("../../../data/1igy.pdb.gz");
const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// No scene is longer, and a picture's scene stands before its pixels.
const SCENE_BYTES: u64 = 32 << 20;

/// Opens a source: a path, a quoted pattern, `demo:…`, `sim:…` ([`crate::Simulated`]), or [`BUILT_IN`].
///
/// # Errors
/// As [`Series::open`]; an unknown scenario or parameter of it.
pub fn open(source: &str) -> Result<Series> {
    open_with(source, &Sph::default())
}

/// Opens a source as [`open`] does; simulations with these settings.
///
/// # Errors
/// As [`open`].
pub fn open_with(source: &str, sph: &Sph) -> Result<Series> {
    if let Some(text) = source.strip_prefix("sim:") {
        return Simulated::series(source, text, sph);
    }
    if source != BUILT_IN {
        return Ok(Series::open(source)?);
    }
    let (format, reader) = open_input(Input::of_bytes("1igy.pdb.gz", ANTIBODY)?)?;
    Ok(Series::from_reader(format, reader))
}

/// Whether a source is made up here, and no file.
pub(crate) fn is_made(source: &str) -> bool {
    source.starts_with("demo:") || source.starts_with("sim:")
}

/// The scene of [`BUILT_IN`]: an antibody upright, its arms spread before the eye, its chains told
/// apart by colour.
pub fn built_in_scene() -> Scene {
    let mut scene = Scene::default();
    scene.set_sources(&[BUILT_IN.into()]);
    // Along the direction of least spread; up is from the stem to the arms.
    scene.camera.direction = Some(DVec3::new(0.94, -0.33, -0.07));
    scene.camera.up = Some(DVec3::new(-0.32, -0.93, 0.19));
    scene.system.iter_mut().for_each(|system| system.color.by = ColorBy::Chain);
    scene
}

/// Reads a scene from its TOML, or from a PNG picture that Motes made of it.
///
/// # Errors
/// The file cannot be read, is a picture without a scene, or holds a scene that makes no sense.
pub fn read_scene(path: &Path) -> Result<Scene> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(SCENE_BYTES).read_to_end(&mut bytes))
        .map_err(|e| ReadError::io(path, &e))?;
    let wrong = |message: &str| ReadError::new(path, Place::Whole, message);
    let text = if bytes.starts_with(PNG_SIGNATURE) {
        let expected =
            "expected a picture with its scene in it, as Motes writes; found one without";
        scene_in_png(&bytes).ok_or_else(|| wrong(expected))?
    } else {
        let expected = "expected a scene in TOML or a PNG picture; found bytes that are no text";
        String::from_utf8(bytes).map_err(|_| wrong(expected))?
    };
    Scene::from_toml(&text).map_err(|error| Error::SceneFile { path: path.into(), error })
}

/// Whether `source` is a PNG picture, which is no source of particles but may hold a scene.
pub fn is_picture(source: &str) -> bool {
    // A pipe may never begin.
    if !std::fs::metadata(source).is_ok_and(|m| m.is_file()) {
        return false;
    }
    let mut start = [0; PNG_SIGNATURE.len()];
    let read = File::open(source).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == *PNG_SIGNATURE
}
