//! `motes render`: as typed, then resolved to a scene, frames and files, then done.

use std::path::{Path, PathBuf};
use std::time::Instant;

use motes::{
    Film, FilmSettings, Layers, Picture, Scene, SceneError, Section, Session, Shot, built_in_scene,
    is_picture, read_scene,
};

use super::frames::{Frames, numbered};
use super::meter::Meter;
use super::talk::{Failure, Talk, tell};
use super::values::{count, size, threads, whole};

const EXAMPLES: &str = "\
Examples:
  motes render dump.lammpstrj -o out.png --color-by Velocity --colormap magma
  motes render 'out_*.vtk' --video film.mp4 --size 1080p";

/// As typed.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, arg_required_else_help = true, args_override_self = true)]
pub(crate) struct Args {
    #[command(flatten)]
    given: SceneFlags,
    /// Picture: .png, .exr or .npz; %04d for the frame
    #[arg(short, long, value_name = "FILE", required_unless_present_any = ["video", "layers", "stats"])]
    output: Option<String>,
    /// Film of all frames, or of --frame: .mp4
    #[arg(long, value_name = "FILE")]
    video: Option<String>,
    /// Frame from 0, frames A..B, all or last
    #[arg(long, value_name = "N|A..B", allow_hyphen_values = true)]
    frame: Option<Frames>,
    /// Go around the target in a film
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    turn: Option<String>,
    /// Threads [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<usize>,
    /// Also colour, depth, normal, id: .npz or .exr
    #[arg(long, value_name = "FILE")]
    layers: Option<String>,
    /// Also times, counts and bytes: .json
    #[arg(long, value_name = "FILE")]
    stats: Option<String>,
}

/// What is seen and how: sources, and what becomes parameters of the scene.
#[derive(Debug, clap::Args)]
pub(super) struct SceneFlags {
    /// Files, quoted patterns, demo:KIND:N, or a picture to draw again
    #[arg(value_name = "SOURCE")]
    sources: Vec<String>,
    /// Pixels, or 720p, 1080p, 1440p, 4k, 8k
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// The way of seeing: spheres, surface or density
    #[arg(long, value_name = "NAME")]
    renderer: Option<String>,
    /// Rays per pixel [default: 4]
    #[arg(long, value_name = "N", value_parser = whole)]
    samples: Option<u32>,
    /// Leave the background out
    #[arg(long)]
    transparent: bool,
    #[command(flatten)]
    look: Look,
    #[command(flatten)]
    overlay: Overlay,
    /// Scene to start from, or a picture of Motes
    #[arg(long, value_name = "TOML")]
    scene: Option<PathBuf>,
    /// Any parameter that `motes scene` prints
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
}

/// What becomes a parameter of the scene as it is; the scene knows what each can be.
#[derive(Debug, clap::Args)]
struct Look {
    /// A colour: "white", "#fafbfc"
    #[arg(long, value_name = "COLOR")]
    background: Option<String>,
    #[command(flatten)]
    camera: CameraFlags,
    /// edges,depth,halo,rim,seam, or sprite
    #[arg(long, value_name = "NAMES")]
    cue: Option<String>,
    /// studio, soft, sun, overcast, side, …
    #[arg(long, value_name = "NAME")]
    light: Option<String>,
    /// One radius for all particles
    #[arg(long, value_name = "R", allow_hyphen_values = true)]
    radius: Option<String>,
    /// Factor on every radius
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    radius_scale: Option<String>,
    /// Property, or element, type, chain, residue, …
    #[arg(long, value_name = "NAME")]
    color_by: Option<String>,
    /// viridis, magma, turbo, batlow, coolwarm, …
    #[arg(long, value_name = "NAME")]
    colormap: Option<String>,
    /// Values at the ends of the colours
    #[arg(long, value_name = "A,B", allow_hyphen_values = true)]
    range: Option<String>,
    /// Show only particles such as 'Mass > 2'
    #[arg(long, value_name = "EXPR", allow_hyphen_values = true)]
    r#where: Option<String>,
    /// Cut: a point, and a normal to what is kept
    #[arg(long, value_name = "PX,PY,PZ,NX,NY,NZ", allow_hyphen_values = true)]
    section: Vec<String>,
    /// How sections cut: caps, open or centre [default: caps]
    #[arg(long, value_name = "HOW")]
    cut: Option<String>,
}

/// Where the camera stands and how it looks.
#[derive(Debug, clap::Args)]
pub(super) struct CameraFlags {
    /// Where the camera stands
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    camera_position: Option<String>,
    /// The point it looks at
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    camera_target: Option<String>,
    /// What is up in the picture
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    camera_up: Option<String>,
    /// Vertical field of view, degrees [default: 35]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    fov: Option<String>,
    /// perspective or orthographic
    #[arg(long, value_name = "KIND")]
    projection: Option<String>,
    /// The world's upward axis: z, y or x [default: z]
    #[arg(long, value_name = "AXIS")]
    up: Option<String>,
}

/// A flag, the path of its parameter, and its value if it was typed.
pub(super) type Typed<'a> = (&'static str, &'static str, &'a Option<String>);

impl CameraFlags {
    /// Each flag and its parameter.
    pub fn typed(&self) -> [Typed<'_>; 6] {
        [
            ("--camera-position", "camera.position", &self.camera_position),
            ("--camera-target", "camera.target", &self.camera_target),
            ("--camera-up", "camera.up", &self.camera_up),
            ("--fov", "camera.fov", &self.fov),
            ("--projection", "camera.projection", &self.projection),
            ("--up", "camera.up_axis", &self.up),
        ]
    }

    /// The first flag that was typed.
    pub fn first(&self) -> Option<&'static str> {
        self.typed().into_iter().find(|(_, _, value)| value.is_some()).map(|(flag, ..)| flag)
    }
}

/// Sets the parameters of the flags that were typed.
pub(super) fn set_flags(scene: &mut Scene, typed: &[Typed<'_>]) -> Result<(), Failure> {
    for (flag, path, value) in typed {
        if let Some(value) = value {
            scene.set(path, value).map_err(|e| of_flag(flag, e))?;
        }
    }
    Ok(())
}

/// What is drawn over the picture; each has its opposite.
#[derive(Debug, clap::Args)]
struct Overlay {
    /// Draw the legend; --no-legend: not (and so on)
    #[arg(long, overrides_with = "no_legend")]
    legend: bool,
    #[arg(long, hide = true, overrides_with = "legend")]
    no_legend: bool,
    /// Draw a scale bar
    #[arg(long, overrides_with = "no_scale_bar")]
    scale_bar: bool,
    #[arg(long, hide = true, overrides_with = "scale_bar")]
    no_scale_bar: bool,
    /// Draw the axes
    #[arg(long, overrides_with = "no_axes")]
    axes: bool,
    #[arg(long, hide = true, overrides_with = "axes")]
    no_axes: bool,
    /// Draw the simulation box
    #[arg(long, overrides_with = "no_box")]
    r#box: bool,
    #[arg(long, hide = true, overrides_with = "box")]
    no_box: bool,
    /// Write the time
    #[arg(long, overrides_with = "no_time")]
    time: bool,
    #[arg(long, hide = true, overrides_with = "time")]
    no_time: bool,
}

/// As meant.
struct Plan {
    scene: Scene,
    frames: Frames,
    /// Whether several pictures are made, where there are several.
    film: bool,
    files: Files,
    threads: Option<usize>,
}

/// The files of each frame, by their names before the frame's number is put in.
struct Files {
    picture: Option<String>,
    video: Option<String>,
    layers: Option<String>,
    stats: Option<String>,
}

pub(crate) fn run(args: &Args, talk: Talk) -> Result<(), Failure> {
    let plan = args.resolve()?;
    let mut session = Session::open(plan.scene, plan.threads)?;
    let meter = Meter::new(talk);
    let (first, last) = match plan.frames {
        Frames::One(frame) => (frame, frame),
        Frames::Range(first, Some(last)) => (first, last),
        Frames::Range(first, None) => (first, session.frames(&meter)?.max(first + 1) - 1),
        Frames::Last => {
            let last = session.frames(&meter)?.saturating_sub(1);
            (last, last)
        }
    };
    let shots = match plan.film {
        true => Shot::film(session.scene(), first..=last),
        false => vec![first.into()],
    };
    if shots.len() > 1 {
        session.hold_view(first..=last, &meter)?;
    }
    let mut film = plan.files.begin_film(session.scene())?;
    let begun = Instant::now();
    for (i, shot) in shots.iter().enumerate() {
        meter.picture(i, shots.len());
        let start = Instant::now();
        let layers = plan.files.layers_wanted();
        let picture = match shots.len() {
            1 => session.render_once(*shot, layers, &meter)?,
            _ => session.render(*shot, layers, &meter)?,
        };
        // One picture for each frame has its number; else they are counted.
        let number = if shots.len() == last - first + 1 { shot.frame } else { i };
        let written = plan.files.write(&picture, number)?;
        if !written.is_empty() {
            meter.clear();
            report(talk, &picture, &written, start);
        }
        if let Some(film) = &mut film {
            film.add(picture.shown_8bit()).map_err(motes::Error::from)?;
        }
    }
    if let (Some(film), Some(name)) = (film, &plan.files.video) {
        film.finish().map_err(motes::Error::from)?;
        meter.clear();
        report_film(talk, (name, session.scene()), shots.len(), begun);
    }
    talk.warn(&session.warnings());
    Ok(())
}

impl Args {
    /// Refuses nonsense and makes one scene of everything that was typed.
    fn resolve(&self) -> Result<Plan, Failure> {
        let mut scene = self.given.scene(&[("--turn", "camera.turn", &self.turn)])?;
        let film = self.is_film(&scene)?;
        let frames = self.frame.unwrap_or(match film {
            true => Frames::Range(0, None),
            false => Frames::One(scene.image.frame as usize),
        });
        if film {
            // The same colour means the same value all through a film.
            scene.set("system.color.range_over", "series").map_err(motes::Error::from)?;
        }
        let files = Files {
            picture: self.output.clone(),
            video: self.video.clone(),
            layers: self.layers.clone(),
            stats: self.stats.clone(),
        };
        files.check(film)?;
        Ok(Plan { scene, frames, film, files, threads: self.threads })
    }

    /// Whether a film is made: a video, a range of frames, or numbered pictures of what the scene has in
    /// motion.
    fn is_film(&self, scene: &Scene) -> Result<bool, Failure> {
        if self.video.is_some() && scene.image.transparent {
            return Err(Failure::usage(
                "--video: a film has no transparency; leave --transparent out",
            ));
        }
        if self.video.is_some() || matches!(self.frame, Some(Frames::Range(..))) {
            return Ok(true);
        }
        let moves = scene.camera.moves() || scene.film.frames.is_some();
        let films = moves && self.output.as_ref().is_some_and(|name| numbered(name, 0).is_some());
        if self.turn.is_some() && !films {
            let message = "--turn: a film needs --video, or %04d in the name of --output";
            return Err(Failure::usage(message));
        }
        Ok(films)
    }
}

impl SceneFlags {
    /// One scene of everything that was typed; `more` are flags of one verb alone.
    pub fn scene(&self, more: &[Typed<'_>]) -> Result<Scene, Failure> {
        let mut scene = self.base()?;
        self.edit(&mut scene, more)?;
        Ok(scene)
    }

    /// Whether a size was typed.
    pub fn has_size(&self) -> bool {
        self.size.is_some()
    }

    /// The scene before flags: a file's, a picture's, or the default with the sources in it.
    fn base(&self) -> Result<Scene, Failure> {
        if self.sources.iter().any(|source| source.trim().is_empty()) {
            return Err(Failure::usage("SOURCE is empty: expected a file, a pattern or demo:…"));
        }
        if let Some(picture) = self.sources.iter().find(|source| is_picture(source)) {
            if self.scene.is_some() || self.sources.len() > 1 {
                let message = format!("{picture}: a picture brings its own scene and sources");
                return Err(Failure::usage(message + "; name it alone, or as --scene"));
            }
            return Ok(read_scene(Path::new(picture))?);
        }
        let mut scene = match &self.scene {
            Some(path) => read_scene(path)?,
            None if self.sources.is_empty() => return Ok(built_in_scene()),
            None => Scene::default(),
        };
        scene.set_sources(&self.sources);
        if scene.system.iter().all(|system| system.source.is_empty()) {
            scene.set_sources(&[motes::BUILT_IN.into()]);
        }
        Ok(scene)
    }

    /// The one place where flags become parameters: what each flag sets, then `--set` in order.
    fn edit(&self, scene: &mut Scene, more: &[Typed<'_>]) -> Result<(), Failure> {
        let look = &self.look;
        let [width, height] = match self.size {
            Some([width, height]) => [Some(width.to_string()), Some(height.to_string())],
            None => [None, None],
        };
        let samples = self.samples.map(|n| n.to_string());
        let transparent = self.transparent.then(|| "true".to_owned());
        let typed = [
            ("--renderer", "renderer", &self.renderer),
            ("--size", "image.width", &width),
            ("--size", "image.height", &height),
            ("--samples", "image.samples", &samples),
            ("--transparent", "image.transparent", &transparent),
            ("--background", "image.background", &look.background),
            ("--cue", "cue.on", &look.cue),
            ("--light", "light.preset", &look.light),
            ("--radius", "system.radius", &look.radius),
            ("--radius-scale", "system.radius_scale", &look.radius_scale),
            ("--color-by", "system.color.by", &look.color_by),
            ("--colormap", "system.color.map", &look.colormap),
            ("--range", "system.color.range", &look.range),
            ("--where", "system.where", &look.r#where),
        ];
        set_flags(scene, &typed)?;
        set_flags(scene, more)?;
        set_flags(scene, &look.camera.typed())?;
        self.overlay.edit(scene)?;
        for section in &look.section {
            scene.section.push(plane(section)?);
        }
        if look.cut.is_some() && scene.section.is_empty() {
            return Err(Failure::usage(
                "--cut: there is nothing to cut with; --section is a plane",
            ));
        }
        set_flags(scene, &[("--cut", "section.cut", &look.cut)])?;
        for assignment in &self.set {
            scene.set_text(assignment).map_err(|e| Failure::usage(format!("--set: {e}")))?;
        }
        Ok(())
    }
}

/// A section from a point and a normal.
fn plane(text: &str) -> Result<Section, Failure> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([px, py, pz, nx, ny, nz]) => Ok(Section {
            point: [*px, *py, *pz].into(),
            normal: [*nx, *ny, *nz].into(),
            ..Section::default()
        }),
        _ => Err(Failure::usage(format!(
            "--section: expected a point and a normal, PX,PY,PZ,NX,NY,NZ, found {text}"
        ))),
    }
}

/// What is wrong with a flag's value, by the name the user gave it.
fn of_flag(flag: &str, error: SceneError) -> Failure {
    Failure::usage(match error {
        SceneError::Value { expected, found, .. } => {
            format!("{flag}: expected {expected}, found {found}")
        }
        other => format!("{flag}: {other}"),
    })
}

impl Overlay {
    fn edit(&self, scene: &mut Scene) -> Result<(), Failure> {
        let typed = [
            ("overlay.legend", self.legend, self.no_legend),
            ("overlay.scale_bar", self.scale_bar, self.no_scale_bar),
            ("overlay.axes", self.axes, self.no_axes),
            ("overlay.box", self.r#box, self.no_box),
            ("overlay.time", self.time, self.no_time),
        ];
        for (path, on, off) in typed {
            if on || off {
                let value = if on { "on" } else { "off" };
                scene.set(path, value).map_err(Failure::usage)?;
            }
        }
        Ok(())
    }
}

impl Files {
    /// Refuses names that say no format, would be written twice, or lie in no directory, before
    /// there is any work to lose.
    fn check(&self, film: bool) -> Result<(), Failure> {
        let named = [
            ("--output", &self.picture, &["png", "exr", "npz"][..]),
            ("--video", &self.video, &["mp4"]),
            ("--layers", &self.layers, &["npz", "exr"]),
            ("--stats", &self.stats, &["json"]),
        ];
        for (flag, name, formats) in named {
            let Some(name) = name else { continue };
            if !formats.iter().any(|format| has_extension(name, format)) {
                let formats: Vec<_> = formats.iter().map(|f| format!(".{f}")).collect();
                let message = format!("{flag} {name}: expected a name in {}", formats.join(", "));
                return Err(Failure::usage(message));
            }
            if film && flag != "--video" && numbered(name, 0).is_none() {
                let message = "expected %04d or {} in the name, for the number of the frame";
                return Err(Failure::usage(format!("{flag} {name}: {message}")));
            }
            let name = numbered(name, 0).filter(|_| flag != "--video").unwrap_or(name.clone());
            let folder = Path::new(&name).parent().filter(|f| !f.as_os_str().is_empty());
            if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
                let message = format!("there is no directory {}", folder.display());
                return Err(Failure::usage(format!("{flag} {name}: {message}")));
            }
        }
        Ok(())
    }

    /// Begins the video, if there is to be one.
    fn begin_film(&self, scene: &Scene) -> Result<Option<Film>, Failure> {
        let Some(name) = &self.video else { return Ok(None) };
        let settings = FilmSettings {
            size: (scene.image.width, scene.image.height),
            fps: scene.film.fps,
            quality: scene.film.quality,
        };
        let film = Film::create(Path::new(name), settings).map_err(motes::Error::from)?;
        Ok(Some(film))
    }

    /// Layers are rendered only if some file holds them.
    fn layers_wanted(&self) -> Layers {
        let held = |name: &String| !has_extension(name, "png");
        match self.layers.is_some() || self.picture.as_ref().is_some_and(held) {
            true => Layers::Yes,
            false => Layers::No,
        }
    }

    /// Writes the files of one frame and gives their names.
    fn write(&self, picture: &Picture, frame: usize) -> Result<Vec<String>, Failure> {
        let mut written = Vec::new();
        let mut path = |name: &String| {
            let name = numbered(name, frame).unwrap_or_else(|| name.clone());
            written.push(name.clone());
            PathBuf::from(name)
        };
        for name in [&self.picture, &self.layers].into_iter().flatten() {
            picture.save(&path(name))?;
        }
        if let Some(name) = &self.stats {
            let path = path(name);
            let json = serde_json::to_string_pretty(&picture.stats).map_err(Failure::data)?;
            std::fs::write(&path, json + "\n")
                .map_err(|e| Failure::data(format!("{}: {e}", path.display())))?;
        }
        Ok(written)
    }
}

fn has_extension(name: &str, extension: &str) -> bool {
    Path::new(name).extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// One line: what was written, size, particles, time; with `--verbose`, where time and memory went.
fn report(talk: Talk, picture: &Picture, written: &[String], start: Instant) {
    if talk.quiet {
        return;
    }
    let stats = &picture.stats;
    let visible = stats.particles.get("visible").copied().unwrap_or(0);
    tell(&format!(
        "{}: {}×{}, {} particles, {} ms",
        written.join(", "),
        picture.raw.width(),
        picture.raw.height(),
        count(visible),
        start.elapsed().as_millis()
    ));
    if talk.verbose {
        let times: Vec<_> = stats.ms.iter().map(|(stage, ms)| format!("{stage} {ms:.1}")).collect();
        let bytes = stats.bytes.iter().map(|(of, n)| format!("{of} {:.1}", *n as f64 / 1e6));
        let bytes: Vec<_> = bytes.collect();
        tell(&format!("  ms: {}", times.join(", ")));
        tell(&format!("  MB: {}", bytes.join(", ")));
        tell(&format!("  {} threads, {}, hash {}", stats.threads, stats.simd, stats.hash));
    }
}

/// One line: what was written, pictures, size, length, and how long it took.
fn report_film(talk: Talk, (name, scene): (&str, &Scene), pictures: usize, begun: Instant) {
    if talk.quiet {
        return;
    }
    let bytes = std::fs::metadata(name).map_or(0, |file| file.len());
    tell(&format!(
        "{name}: {} pictures, {}×{}, {:.1} s, {:.1} MB, in {:.1} s",
        count(pictures),
        scene.image.width,
        scene.image.height,
        pictures as f64 / scene.film.fps,
        bytes as f64 / 1e6,
        begun.elapsed().as_secs_f64()
    ));
}
