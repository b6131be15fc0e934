//! A scene with its sources open: frames on demand.

use std::sync::{Arc, Mutex};
use std::time::Instant;

use glam::DVec3;
use motes_frame::{Background, Curve, Frame, Tone};
use motes_particles::read::{Wanted, names};
use motes_particles::{Series, SimulationBox};
use motes_scene::{Bounds, CapColor, Framing, Renderer, Resolved, Scene, Section, Show};

use crate::ahead::{Ahead, All};
use crate::annotate::{Annotated, annotations};
use crate::cut::Visible;
use crate::drawing::{Drawing, Kept};
use crate::grids::SharedGrids;
use crate::memo::Same;
use crate::paint::Meaning;
use crate::picture::Picture;
use crate::reading::{After, RangeKey, Reading, lock, series_range, wanted};
use crate::shot::Shot;
use crate::stages::Stages;
use crate::stats::{Stats, peak_memory_bytes};
use crate::system::{Loaded, asks_for_ages};
use crate::{Error, Result};

/// Whether a picture carries depth, normal, id and system besides colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layers {
    /// Colour only.
    No,
    /// All of them.
    Yes,
}

/// Room for a legend, in heights of its text.
const LEGEND_EMS: f64 = 8.0;
/// What is told of several frames ends at some point.
const MOST_NOTES: usize = 100;

/// Is told of long work, from any thread.
pub trait Watch: Sync {
    /// `done` of `total` of the work called `stage` are done (bytes read, tiles drawn). `false` cancels
    /// what can be cancelled.
    fn progress(&self, stage: &'static str, done: u64, total: u64) -> bool;
}

/// Watches nothing.
#[derive(Clone, Copy, Debug)]
pub struct Quiet;

impl Watch for Quiet {
    fn progress(&self, _: &'static str, _: u64, _: u64) -> bool {
        true
    }
}

/// A scene whose sources are open.
pub struct Session {
    scene: Scene,
    series: Vec<Arc<Mutex<Series>>>,
    pool: Option<rayon::ThreadPool>,
    /// The frame that was read last.
    last: Option<(Reading, All)>,
    ahead: Ahead<Reading>,
    /// What was made of each system's last frame.
    stages: Vec<Stages>,
    /// Grids of each system that sessions share who share sources.
    grids: Vec<Arc<SharedGrids>>,
    /// Boxes around what is to be framed, and what they are around.
    framed: Option<(Vec<Framed>, Arc<Boxes>)>,
    kept: Kept,
    /// Whether the view was held for several frames.
    film: bool,
    /// Colour range per system over its whole series, once it was asked for, and of what.
    ranges: Vec<Option<(RangeKey, Option<[f64; 2]>)>>,
    /// Whether columns are read that the scene does not need.
    all_columns: bool,
    /// What could not be drawn.
    notes: Vec<String>,
}

impl Session {
    /// Opens the sources of the scene's systems; `threads` defaults to the machine's.
    ///
    /// # Errors
    /// The scene makes no sense, names no source, or a source cannot be opened.
    pub fn open(scene: Scene, threads: Option<usize>) -> Result<Self> {
        scene.check()?;
        let pool = threads.map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build());
        let pool = pool.transpose().map_err(|e| Error::Usage(format!("threads: {e}")))?;
        let open = |source: &str| match source {
            "" => Err(Error::Usage("no source: name a file, a pattern or demo:…".into())),
            _ => crate::open_with(source, &scene.sph),
        };
        let mut series =
            scene.system.iter().map(|s| open(&s.source)).collect::<Result<Vec<_>>>()?;
        let aged = series.iter_mut().zip(&scene.system).filter(|(_, s)| asks_for_ages(s));
        aged.for_each(|(series, _)| series.add_ages());
        let series = series.into_iter().map(|series| Arc::new(Mutex::new(series))).collect();
        Ok(Self { pool, ..Self::of(scene, series) })
    }

    fn of(scene: Scene, series: Vec<Arc<Mutex<Series>>>) -> Self {
        Self {
            scene,
            pool: None,
            last: None,
            ahead: Ahead::default(),
            stages: series.iter().map(|_| Stages::default()).collect(),
            grids: series.iter().map(|_| Arc::default()).collect(),
            framed: None,
            kept: Kept::default(),
            film: false,
            ranges: vec![None; series.len()],
            all_columns: false,
            notes: Vec::new(),
            series,
        }
    }

    /// Another session with the same open sources and, to begin with, the same scene. Frames are read
    /// once for both, with every column, and grids built once.
    pub fn share(&self) -> Self {
        let stages = self.grids.iter().map(|grids| Stages::beside(grids.clone())).collect();
        let own = Self::of(self.scene.clone(), self.series.clone());
        Self { all_columns: true, stages, grids: self.grids.clone(), ..own }
    }

    /// Goes on with another scene of the same sources; what does not depend on the change is not made
    /// again.
    ///
    /// # Errors
    /// The scene makes no sense, or has other sources.
    pub fn set_scene(&mut self, scene: Scene) -> Result<()> {
        scene.check()?;
        if !same_sources(&scene, &self.scene) {
            return Err(Error::Usage(
                "the scene has other sources than those that are open".into(),
            ));
        }
        let before = std::mem::replace(&mut self.scene, scene);
        for (i, system) in self.scene.system.iter().enumerate() {
            if asks_for_ages(system) && !asks_for_ages(&before.system[i]) {
                lock(&self.series[i]).add_ages();
                // What was read before has none.
                self.last = None;
            }
        }
        Ok(())
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Opens the sources again, for all who share them, as files may have grown; gives how many frames
    /// there are.
    ///
    /// # Errors
    /// A source cannot be read; it is then as it was.
    pub(crate) fn refresh(&self) -> Result<usize> {
        let mut most = 0;
        for (system, series) in self.scene.system.iter().zip(&self.series) {
            if crate::open::is_made(&system.source) {
                continue;
            }
            let mut anew = crate::open_with(&system.source, &self.scene.sph)?;
            most = most.max(anew.frames(&|_, _| {})?);
            *lock(series) = anew;
        }
        Ok(most)
    }

    /// How many frames there are: those of the longest series.
    ///
    /// # Errors
    /// A source cannot be read.
    pub fn frames(&mut self, watch: &dyn Watch) -> Result<usize> {
        let report = |done, total| _ = watch.progress("count", done, total);
        let counts = self.series.iter().map(|s| lock(s).frames(&report));
        Ok(counts.collect::<motes_particles::Result<Vec<_>>>()?.into_iter().max().unwrap_or(0))
    }

    /// What was odd in the sources but could be read, and what could not be drawn.
    pub fn warnings(&self) -> Vec<String> {
        let of_series = self.series.iter().flat_map(|s| lock(s).warnings());
        of_series.chain(self.notes.iter().cloned()).collect()
    }

    /// Renders a frame, or a picture of a film (for which [`Session::hold_view`] has been called).
    ///
    /// # Errors
    /// The frame cannot be read, a property is not there, or the watch cancels.
    pub fn render(
        &mut self,
        shot: impl Into<Shot>,
        layers: Layers,
        watch: &dyn Watch,
    ) -> Result<Picture> {
        let shot = shot.into();
        self.in_pool(|session| session.render_here((shot, After::Kept), layers, watch))
    }

    /// As [`Session::render`], in less memory, for a frame that will not be asked for again.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub fn render_once(
        &mut self,
        shot: impl Into<Shot>,
        layers: Layers,
        watch: &dyn Watch,
    ) -> Result<Picture> {
        let shot = shot.into();
        self.in_pool(|session| session.render_here((shot, After::LetGo), layers, watch))
    }

    /// Works on the session's own threads, if it was given a number of them.
    fn in_pool<T: Send>(&mut self, work: impl FnOnce(&mut Self) -> T + Send) -> T {
        // The pool is taken out for the call, as the work needs all of the session.
        match self.pool.take() {
            Some(pool) => {
                let done = pool.install(|| work(self));
                self.pool = Some(pool);
                done
            }
            None => work(self),
        }
    }

    fn render_here(
        &mut self,
        (shot, after): (Shot, After),
        layers: Layers,
        watch: &dyn Watch,
    ) -> Result<Picture> {
        let drawn = self.draw((shot, after), layers, watch)?;
        let mut stats = drawn.stats;
        let start = Instant::now();
        let annotated =
            Annotated { systems: &drawn.loaded, frame: shot.frame, film: self.film, enlarged: 1.0 };
        let shown = self.finish(drawn.raw.clone(), &drawn.resolved, &annotated)?;
        stats.ms.insert("finish", milliseconds(start));
        stats.hash = format!("{:016x}", drawn.raw.hash());
        stats.peak_memory = peak_memory_bytes();
        Ok(Picture {
            raw: drawn.raw,
            shown,
            stats,
            scene: drawn.scene.to_toml(),
            view: drawn.resolved.view,
            transparent: self.scene.image.transparent,
        })
    }

    /// A picture as it is shown, and what it is of; of a passing one without its hash, and with lines before
    /// what a liquid would hide of them. It is `enlarged` so many times when it is shown.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub(crate) fn look(
        &mut self,
        frame: usize,
        (hashed, enlarged): (bool, f32),
        watch: &dyn Watch,
    ) -> Result<Look> {
        let after = if hashed { After::Kept } else { After::Moves };
        let drawn = self.draw((frame.into(), after), Layers::No, watch)?;
        let Drawn { raw, mut stats, loaded, resolved, boxes, origin, .. } = drawn;
        let hash = if hashed { raw.hash() } else { 0 };
        let start = Instant::now();
        let annotated = Annotated { systems: &loaded, frame, film: self.film, enlarged };
        let shown = self.finish(raw, &resolved, &annotated)?;
        stats.ms.insert("finish", milliseconds(start));
        Ok(Look { shown, hash, stats, seen: Seen { loaded, resolved, boxes, origin } })
    }

    /// Takes the memory of a picture that nobody looks at any more, for the next one.
    pub(crate) fn recycle(&self, shown: Frame) {
        self.kept.recycle(shown);
    }

    /// What there is to be seen of the scene's frame, before anything is drawn.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub(crate) fn survey(&mut self, watch: &dyn Watch) -> Result<Seen> {
        let frame = self.scene.image.frame as usize;
        let particles = self.read(frame, After::Kept, watch)?;
        let (loaded, origin) = self.load(particles)?;
        let boxes = self.framed(&loaded, origin);
        let resolved = self.scene.resolve_framing(boxes.framing(&self.scene, &loaded))?;
        Ok(Seen { loaded, resolved, boxes, origin })
    }

    /// The picture without tone and what is drawn over it.
    fn draw(
        &mut self,
        (shot, after): (Shot, After),
        layers: Layers,
        watch: &dyn Watch,
    ) -> Result<Drawn> {
        let mut stats = Stats { threads: rayon::current_num_threads(), ..Stats::default() };
        let start = Instant::now();
        let particles = self.read(shot.frame, after, watch)?;
        stats.ms.insert("read", milliseconds(start));
        let input = particles.iter().flatten().map(|p| p.bytes()).sum();
        stats.bytes.insert("input", input);

        let start = Instant::now();
        let (loaded, origin) = self.load(particles)?;
        let boxes = self.framed(&loaded, origin);
        stats.ms.insert("build", milliseconds(start));
        self.note_left_out(&loaded, shot.frame);
        self.note_unknown(&loaded);
        if !loaded.is_empty() && loaded.iter().all(|l| l.particles.is_empty()) {
            self.note(format!("frame {} has no particles", shot.frame));
        }

        let scene = self.scene_of(shot);
        let resolved = scene.resolve_framing(boxes.framing(&self.scene, &loaded))?;
        // Lines in space are hidden by depth, and cues come from all layers.
        let lines = loaded.iter().any(|l| l.sim_box.is_some());
        let quick = after == After::Moves && self.scene.renderer != Renderer::Spheres;
        let layers = layers == Layers::Yes || scene.cue.any() || (lines && !quick);
        let start = Instant::now();
        let drawing = Drawing {
            scene: &self.scene,
            loaded: &loaded,
            resolved: &resolved,
            origin,
            bounds: boxes.whole,
            kept: &self.kept,
        };
        let raw = drawing.draw(layers, (&mut stats, watch))?;
        stats.ms.insert("trace", milliseconds(start));
        count(&mut stats, &loaded);
        Ok(Drawn { raw, stats, scene, resolved, loaded, boxes, origin })
    }

    fn note_left_out(&mut self, loaded: &[Loaded], frame: usize) {
        for l in loaded.iter().filter(|l| l.classes.left_out > 0) {
            let note = format!(
                "{}: frame {frame}: {} of {} particles are not drawn: their position is not finite, \
                 or their radius not above zero",
                self.scene.system[l.number as usize].source,
                l.classes.left_out,
                l.particles.len()
            );
            self.note(note);
        }
    }

    /// Keeps something that is to be told, once.
    fn note(&mut self, note: String) {
        if self.notes.len() < MOST_NOTES && !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Tells of types that sections name and no particle has: a section that cuts nothing looks like one that
    /// does not work.
    fn note_unknown(&mut self, loaded: &[Loaded]) {
        for (section, name) in loaded.iter().flat_map(|l| l.visible.unknown()) {
            let cuts = |l: &&Loaded| {
                self.scene.sections_of(usize::from(l.number)).any(|(i, _)| i == *section)
            };
            let lacks =
                |l: &Loaded| l.visible.unknown().iter().any(|u| u == &(*section, name.clone()));
            if loaded.iter().filter(cuts).all(lacks) {
                self.note(format!("section.{section}.types: no particle is of type '{name}'"));
            }
        }
    }

    /// The scene of one picture, which shows it again: its camera stands.
    fn scene_of(&self, shot: Shot) -> Scene {
        let mut scene = self.scene.clone();
        if let Some(moment) = shot.moment {
            scene.camera = scene.camera.at(moment);
        }
        scene.system.iter_mut().for_each(|system| make_absolute(&mut system.source));
        scene.image.frame = u32::try_from(shot.frame).unwrap_or(u32::MAX);
        scene
    }

    /// Fixes for a film what would change with what is visible: what is so in the first, the middle and
    /// the last of `frames` is framed; how far things occlude, and radii that are measured, become those
    /// of the first. What the scene says itself stays.
    ///
    /// # Errors
    /// As [`Session::render`].
    pub fn hold_view(
        &mut self,
        frames: std::ops::RangeInclusive<usize>,
        watch: &dyn Watch,
    ) -> Result<()> {
        self.in_pool(|session| session.hold_view_here(frames, watch))
    }

    fn hold_view_here(
        &mut self,
        frames: std::ops::RangeInclusive<usize>,
        watch: &dyn Watch,
    ) -> Result<()> {
        let (first, last) = (*frames.start(), *frames.end());
        let mut looks = vec![first, first + last.saturating_sub(first) / 2, last];
        looks.dedup();
        let (mut boxes, mut last) = (Vec::new(), Vec::new());
        for frame in looks {
            // Grids that nobody looks at lend their memory to the next.
            last.clear();
            let particles = self.read(frame, After::Kept, watch)?;
            let (loaded, origin) = self.load(particles)?;
            loaded.iter().for_each(|l| l.hold_radius(&mut self.scene));
            boxes.extend_from_slice(&self.framed(&loaded, origin).all);
            last = loaded;
        }
        let framing = Framing::new(&boxes, free_right(&self.scene, &last));
        self.scene.hold(framing)?;
        self.film |= frames.start() < frames.end();
        Ok(())
    }

    /// Builds the grids and colours of what was read, about the returned origin.
    fn load(&mut self, particles: All) -> Result<(Vec<Loaded>, DVec3)> {
        let origin = particles.iter().flatten().next().map_or([0.0; 3], |p| p.origin).into();
        let mut loaded = Vec::new();
        for (i, particles) in particles.into_iter().enumerate() {
            let Some(particles) = particles else { continue };
            let of = (&self.scene, &self.scene.system[i]);
            let range = self.ranges[i].as_ref().and_then(|(_, range)| *range);
            loaded.push(self.stages[i].load(particles, of, (i as u16, origin), range)?);
        }
        Ok((loaded, origin))
    }

    /// Boxes around all that is to be framed.
    fn framed(&mut self, loaded: &[Loaded], origin: DVec3) -> Arc<Boxes> {
        let key: Vec<_> = loaded.iter().map(|l| Framed::of(l, origin)).collect();
        if let Some((_, boxes)) = self.framed.as_ref().filter(|(had, _)| *had == key) {
            return boxes.clone();
        }
        let of_box = |l: &Loaded| {
            let corners = l.sim_box?.corners();
            Bounds::of_spheres(corners.map(|c| (DVec3::from_array(c), 0.0)))
        };
        let boxes = loaded.iter().flat_map(|l| l.boxes(origin).into_iter().chain(of_box(l)));
        let all: Vec<_> = boxes.collect();
        let whole = all.iter().copied().reduce(Bounds::union);
        let boxes = Arc::new(Boxes { all, whole });
        self.framed = Some((key, boxes.clone()));
        boxes
    }

    /// Reads the frame of every visible system; `None` for hidden ones.
    fn read(&mut self, frame: usize, after: After, watch: &dyn Watch) -> Result<All> {
        let key = self.reading(frame);
        self.find_ranges(&key, watch)?;
        if let Some((_, all)) = self.last.as_ref().filter(|(had, _)| *had == key) {
            return Ok(all.clone());
        }
        // No two frames need be in memory, but for the memory of grids.
        self.last = None;
        self.stages.iter_mut().for_each(Stages::forget);
        let all = match self.ahead.take(&key) {
            Some(all) => all,
            None => key.read(&self.series, after, watch)?,
        };
        if after != After::LetGo {
            self.last = Some((key, all.clone()));
        }
        Ok(all)
    }

    /// Begins to read a frame, while others are drawn.
    pub(crate) fn read_ahead(&self, frame: usize) {
        let (key, series) = (self.reading(frame), self.series.clone());
        let own = key.clone();
        self.ahead.begin(key, move || own.read(&series, After::Kept, &Quiet).ok());
    }

    /// The frame that has been read so.
    pub(crate) fn is_ahead(&self) -> Option<usize> {
        self.ahead.ready().map(|key| key.frame)
    }

    /// What is to be read for a frame.
    fn reading(&self, frame: usize) -> Reading {
        let of = |(i, system): (usize, &motes_scene::System)| {
            system.visible.then(|| (system.frame_offset, self.wanted(i, system)))
        };
        Reading { frame, systems: self.scene.system.iter().enumerate().map(of).collect() }
    }

    /// The columns that a system needs.
    fn wanted(&self, i: usize, system: &motes_scene::System) -> Wanted {
        let by_property = |s: &Section| matches!(s.cap, CapColor::Property(_));
        if self.all_columns || self.scene.sections_of(i).any(|(_, s)| by_property(s)) {
            return Wanted::All;
        }
        let mut wanted = wanted(system);
        let masked = self.scene.renderer == Renderer::Density && self.scene.density.mask;
        if masked && let Wanted::Only(columns) = &mut wanted {
            columns.push(names::PARTICLE_MASK.into());
        }
        wanted
    }

    /// Finds the ranges of colours over whole series, where they are asked for.
    fn find_ranges(&mut self, key: &Reading, watch: &dyn Watch) -> Result<()> {
        for (i, system) in self.scene.system.iter().enumerate() {
            let Some((_, wanted)) = &key.systems[i] else { continue };
            let of = RangeKey::of(system);
            if self.ranges[i].as_ref().map(|(had, _)| had) == of.as_ref() {
                continue;
            }
            self.ranges[i] = None;
            if let Some(of) = of {
                let range = series_range(&mut lock(&self.series[i]), system, wanted, watch)?;
                self.ranges[i] = Some((of, range));
            }
        }
        Ok(())
    }

    /// Tone, cues, background and annotations.
    fn finish(&self, raw: Frame, resolved: &Resolved, annotated: &Annotated<'_>) -> Result<Frame> {
        let image = &self.scene.image;
        let mut shown = raw;
        let curve = match image.tone {
            motes_scene::Tone::None => Curve::Standard,
            motes_scene::Tone::Filmic => Curve::Filmic,
        };
        Tone { exposure: image.exposure as f32, curve }.apply(&mut shown);
        let background = match (image.transparent, image.background_bottom) {
            (true, _) => Background::Transparent,
            (false, None) => Background::Solid(resolved.background.top.to_array()),
            (false, Some(_)) => Background::Gradient {
                top: resolved.background.top.to_array(),
                bottom: resolved.background.bottom.to_array(),
            },
        };
        let systems = annotated.systems;
        crate::cues::draw(&self.scene.cue, resolved, systems, (&mut shown, background))?;
        annotations(&self.scene, resolved, annotated).draw(&mut shown);
        Ok(shown)
    }
}

/// Part of the picture's width that is kept free for a legend.
fn free_right(scene: &Scene, loaded: &[Loaded]) -> f64 {
    let image = &scene.image;
    let legend = scene.overlay.legend != Show::Off
        && loaded.iter().any(|l| !matches!(l.paint.meaning, Meaning::Nothing));
    let text = scene.overlay.text_size * f64::from(image.height) / f64::from(image.width);
    if legend { LEGEND_EMS * text } else { 0.0 }
}

/// Boxes around all that is to be framed, and the one around all of them.
pub(crate) struct Boxes {
    all: Vec<Bounds>,
    pub whole: Option<Bounds>,
}

impl Boxes {
    /// What a camera shows: all of them, beside the legend where there is one.
    fn framing(&self, scene: &Scene, loaded: &[Loaded]) -> Framing<'_> {
        let free_right = free_right(scene, loaded);
        Framing { boxes: &self.all, whole: self.whole, free_right }
    }
}

/// A picture before it is finished, and what it is of.
struct Drawn {
    raw: Frame,
    stats: Stats,
    scene: Scene,
    resolved: Resolved,
    loaded: Vec<Loaded>,
    boxes: Arc<Boxes>,
    origin: DVec3,
}

/// A finished picture, and what it is of.
pub(crate) struct Look {
    pub shown: Frame,
    /// The hash of the picture before annotations; 0 if none was asked for.
    pub hash: u64,
    pub stats: Stats,
    pub seen: Seen,
}

/// What a picture is of.
#[derive(Clone)]
pub(crate) struct Seen {
    pub loaded: Vec<Loaded>,
    pub resolved: Resolved,
    pub boxes: Arc<Boxes>,
    /// The point that positions in grids are about.
    pub origin: DVec3,
}

impl Seen {
    /// What the camera of `scene` shows.
    pub fn framing(&self, scene: &Scene) -> Framing<'_> {
        self.boxes.framing(scene, &self.loaded)
    }
}

/// Whether two scenes have the same sources, one by one.
pub(crate) fn same_sources(a: &Scene, b: &Scene) -> bool {
    a.system.iter().map(|system| &system.source).eq(b.system.iter().map(|system| &system.source))
}

/// What boxes are made around.
#[derive(PartialEq)]
struct Framed(Same<Visible>, Option<SimulationBox>, DVec3);

impl Framed {
    fn of(loaded: &Loaded, origin: DVec3) -> Self {
        Self(Same(loaded.visible.clone()), loaded.sim_box, origin)
    }
}

/// Makes a path absolute, so that a picture can be drawn again from any directory.
pub(crate) fn make_absolute(source: &mut String) {
    if !crate::open::is_made(source)
        && let Ok(path) = std::path::absolute(&*source)
    {
        *source = path.to_string_lossy().into_owned();
    }
}

pub(crate) fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

fn count(stats: &mut Stats, loaded: &[Loaded]) {
    let sum = |f: &dyn Fn(&Loaded) -> usize| loaded.iter().map(f).sum::<usize>();
    let grids = |f: &dyn Fn(&motes_grid::Grid) -> usize| {
        sum(&|l| l.classes.grids.iter().map(f).sum::<usize>())
    };
    stats.particles.insert("read", sum(&|l| l.particles.len()));
    stats.particles.insert("visible", sum(&|l| l.count_visible()));
    stats.particles.insert("left_out", sum(&|l| l.classes.left_out));
    stats.bytes.insert("data", grids(&|g| g.data_bytes()));
    stats.bytes.insert("grid", grids(&|g| g.structure_bytes()));
    stats.bytes.insert("visibility", sum(&|l| l.visible.bytes()));
}
