//! Files to be saved: pictures of any size, layers, films, the scene.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::str::FromStr;

use motes_frame::{PngOptions, Transparency, write_exr, write_npz, write_png};
use motes_scene::Scene;

use crate::{Error, Film, FilmSettings, Layers, Picture, Result, Session, Shot, Watch};

/// Pictures of a film, at most.
const PICTURES: usize = 20_000;

/// What is wanted of a file, as in a query.
pub(super) type Wanted = BTreeMap<String, String>;

/// The number called `name`, if there is one.
fn number<T: FromStr>(wanted: &Wanted, name: &str) -> Result<Option<T>> {
    let wrong = |text: &String| Error::Usage(format!("{name}: expected a number, found '{text}'"));
    wanted.get(name).map(|text| text.parse().map_err(|_| wrong(text))).transpose()
}

/// The scene of a file: that which is shown, as large and fine as wanted.
pub(super) fn scene_of(mut scene: Scene, wanted: &Wanted) -> Result<Scene> {
    let image = &mut scene.image;
    image.width = number(wanted, "width")?.unwrap_or(image.width);
    image.height = number(wanted, "height")?.unwrap_or(image.height);
    if let Some(samples) = number(wanted, "samples")? {
        image.samples = samples;
        image.max_samples = image.max_samples.max(samples);
    }
    scene.film.fps = number(wanted, "fps")?.unwrap_or(scene.film.fps);
    scene.check()?;
    Ok(scene)
}

/// A picture in the format of the file's name.
pub(super) fn picture(session: &mut Session, file: &str, watch: &dyn Watch) -> Result<Vec<u8>> {
    let frame = session.scene().image.frame as usize;
    let layers = if file == "picture.png" { Layers::No } else { Layers::Yes };
    let picture = session.render(frame, layers, watch)?;
    let mut out = Cursor::new(Vec::new());
    match file {
        "picture.exr" => write_exr(&picture.raw, &mut out)?,
        "layers.npz" => write_npz(&picture.raw, &mut out)?,
        _ => png(&picture, &mut out)?,
    }
    Ok(out.into_inner())
}

fn png(picture: &Picture, out: &mut Cursor<Vec<u8>>) -> Result<()> {
    let transparency = if picture.transparent { Transparency::Keep } else { Transparency::Drop };
    let options = PngOptions { transparency, scene: Some(&picture.scene) };
    Ok(write_png(&picture.shown, options, out)?)
}

/// A film of the frames `first` to `last`, both included.
pub(super) fn film(mut session: Session, wanted: &Wanted, watch: &dyn Watch) -> Result<Vec<u8>> {
    let end = session.frames(watch)?.max(1) - 1;
    let first = number(wanted, "first")?.unwrap_or(0).min(end);
    let last = number(wanted, "last")?.unwrap_or(end).clamp(first, end);
    let shots = Shot::film(session.scene(), first..=last);
    if shots.len() > PICTURES {
        return Err(Error::Usage(format!("a film has at most {PICTURES} pictures")));
    }
    // The same colour means the same value all through a film.
    let mut scene = session.scene().clone();
    scene.set("system.color.range_over", "series")?;
    session.set_scene(scene)?;
    if shots.len() > 1 {
        session.hold_view(first..=last, watch)?;
    }
    let image = &session.scene().image;
    let settings = FilmSettings {
        size: (image.width, image.height),
        fps: session.scene().film.fps,
        quality: session.scene().film.quality,
    };
    let place = Scratch::new()?;
    let mut film = Film::create(&place.0, settings)?;
    for (i, shot) in shots.iter().enumerate() {
        if !watch.progress("film", i as u64, shots.len() as u64) {
            return Err(Error::Cancelled);
        }
        film.add(session.render(*shot, Layers::No, watch)?.shown_8bit())?;
    }
    film.finish()?;
    std::fs::read(&place.0).map_err(|e| Error::Usage(format!("the film: {e}")))
}

/// A file while a film is made, which needs to go back in it.
struct Scratch(std::path::PathBuf);

impl Scratch {
    fn new() -> Result<Self> {
        use std::hash::{BuildHasher, RandomState};
        let word = RandomState::new().hash_one(std::process::id());
        Ok(Self(std::env::temp_dir().join(format!("motes-{word:016x}.mp4"))))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
