//! A scene with its sources open: frames on demand.

use std::sync::Arc;
use std::time::Instant;

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_frame::{Background, Curve, Frame, Layer, Tone};
use motes_grid::RadiusClasses;
use motes_particles::read::{Wanted, names};
use motes_particles::{Particles, Series};
use motes_scene::{
    Bounds, CapColor, ColorBy, Framing, Moment, RangeOver, Renderer, Resolved, Scene, Section, Show,
};
use motes_spheres::{Adaptive, Center, Finer, Primary, Settings, View};
use motes_surface::MOST_MEDIA;

use crate::annotate::{Annotated, annotations};
use crate::density::Cast;
use crate::entries::Entries;
use crate::liquid::{Liquid, Matter};
use crate::opacity::ALPHA;
use crate::paint::{Meaning, find_property};
use crate::picture::Picture;
use crate::scenery::Others;
use crate::stats::{Stats, peak_memory_bytes};
use crate::system::Loaded;
use crate::{Error, Result};

/// Whether a picture carries depth, normal, id and system besides colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layers {
    /// Colour only.
    No,
    /// All of them.
    Yes,
}

/// What a picture is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// The frame of the sources.
    pub frame: usize,
    /// When in a film, for a camera that moves in one; none: it stands.
    pub moment: Option<Moment>,
}

impl From<usize> for Shot {
    /// A frame, before a camera that stands.
    fn from(frame: usize) -> Self {
        Self { frame, moment: None }
    }
}

/// Room for a legend, in heights of its text.
const LEGEND_EMS: f64 = 8.0;

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

/// What becomes of a frame that was rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum After {
    /// It may be asked for again.
    Kept,
    LetGo,
}

/// A scene whose sources are open.
pub struct Session {
    scene: Scene,
    series: Vec<Series>,
    pool: Option<rayon::ThreadPool>,
    /// The grids of each system's last frame, for the memory they have.
    spare: Vec<RadiusClasses>,
    /// Whether the view was held for several frames.
    film: bool,
    /// Colour range per system over its whole series, once it was asked for.
    ranges: Vec<Option<[f64; 2]>>,
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
        let series = scene.system.iter().map(|s| open(&s.source)).collect::<Result<Vec<_>>>()?;
        let ranges = vec![None; series.len()];
        let spare = series.iter().map(|_| RadiusClasses::default()).collect();
        Ok(Self { scene, series, pool, spare, film: false, ranges, notes: Vec::new() })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// How many frames there are: those of the longest series.
    ///
    /// # Errors
    /// A source cannot be read.
    pub fn frames(&mut self, watch: &dyn Watch) -> Result<usize> {
        let report = |done, total| _ = watch.progress("count", done, total);
        let counts = self.series.iter_mut().map(|s| s.frames(&report));
        Ok(counts.collect::<motes_particles::Result<Vec<_>>>()?.into_iter().max().unwrap_or(0))
    }

    /// What was odd in the sources but could be read, and what could not be drawn.
    pub fn warnings(&self) -> Vec<String> {
        let of_series = self.series.iter().flat_map(Series::warnings);
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
        let frame = shot.frame;
        let mut stats = Stats { threads: rayon::current_num_threads(), ..Stats::default() };
        let start = Instant::now();
        let particles = self.read(frame, after, watch)?;
        stats.ms.insert("read", milliseconds(start));
        let input = particles.iter().flatten().map(|p| p.bytes()).sum();
        stats.bytes.insert("input", input);

        let start = Instant::now();
        let (loaded, origin) = self.load(particles)?;
        stats.ms.insert("build", milliseconds(start));
        for l in loaded.iter().filter(|l| l.classes.left_out > 0) {
            self.notes.push(format!(
                "{}: frame {frame}: {} of {} particles are not drawn: their position is not finite, \
                 or their radius not above zero",
                self.scene.system[l.number as usize].source,
                l.classes.left_out,
                l.particles.len()
            ));
        }

        let liquid = self.scene.renderer != Renderer::Spheres;
        if liquid && loaded.first().is_some_and(|l| l.clip().is_some()) {
            self.notes.push("sections: a liquid is cut by centre only; set section.cut".into());
        }
        let boxes = framed(&loaded, origin);
        let scene = self.scene_of(shot);
        let resolved = scene.resolve_framing(self.framing(&loaded, &boxes))?;
        // Lines in space are hidden by depth.
        let layers = layers == Layers::Yes || loaded.iter().any(|l| l.sim_box.is_some());
        let start = Instant::now();
        let raw = match self.scene.renderer {
            Renderer::Spheres => {
                self.trace(&loaded, (&resolved, origin), layers, (&mut stats, watch))?
            }
            Renderer::Surface | Renderer::Density => {
                let bounds = boxes.iter().copied().reduce(Bounds::union);
                self.flow(&loaded, (&resolved, origin, bounds), layers, (&mut stats, watch))?
            }
        };
        stats.ms.insert("trace", milliseconds(start));

        let start = Instant::now();
        let annotated = Annotated { systems: &loaded, frame, film: self.film };
        let shown = self.finish(&raw, &resolved, &annotated);
        stats.ms.insert("finish", milliseconds(start));
        count(&mut stats, &loaded);
        stats.hash = format!("{:016x}", raw.hash());
        stats.peak_memory = peak_memory_bytes();
        loaded.into_iter().for_each(|l| self.spare[l.number as usize] = l.classes);
        Ok(Picture {
            raw,
            shown,
            stats,
            scene: scene.to_toml(),
            view: resolved.view,
            transparent: self.scene.image.transparent,
        })
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
            let particles = self.read(frame, After::Kept, watch)?;
            let (loaded, origin) = self.load(particles)?;
            loaded.iter().for_each(|l| l.hold_radius(&mut self.scene));
            boxes.extend(framed(&loaded, origin));
            last = loaded;
        }
        let framing = self.framing(&last, &boxes);
        self.scene.hold(framing)?;
        self.film |= frames.start() < frames.end();
        Ok(())
    }

    /// What the camera shows: all of `boxes`, beside the legend where there is one.
    fn framing<'a>(&self, loaded: &[Loaded], boxes: &'a [Bounds]) -> Framing<'a> {
        let image = &self.scene.image;
        let legend = self.scene.overlay.legend != Show::Off
            && loaded.iter().any(|l| !matches!(l.paint.meaning, Meaning::Nothing));
        let text = self.scene.overlay.text_size * f64::from(image.height) / f64::from(image.width);
        Framing { boxes, free_right: if legend { LEGEND_EMS * text } else { 0.0 } }
    }

    /// Builds the grids and colours of what was read, about the returned origin.
    fn load(&mut self, particles: Vec<Option<Arc<Particles>>>) -> Result<(Vec<Loaded>, DVec3)> {
        let origin = particles.iter().flatten().next().map_or([0.0; 3], |p| p.origin).into();
        let mut loaded = Vec::new();
        for (i, particles) in particles.into_iter().enumerate() {
            let Some(particles) = particles else { continue };
            let spare = std::mem::take(&mut self.spare[i]);
            let of = (&self.scene, &self.scene.system[i]);
            loaded.push(Loaded::new((particles, spare), of, (i as u16, origin), self.ranges[i])?);
        }
        Ok((loaded, origin))
    }

    /// Reads the frame of every visible system; `None` for hidden ones.
    fn read(
        &mut self,
        frame: usize,
        after: After,
        watch: &dyn Watch,
    ) -> Result<Vec<Option<Arc<Particles>>>> {
        let report = |done, total| _ = watch.progress("read", done, total);
        let mut all = Vec::new();
        for i in 0..self.series.len() {
            let system = &self.scene.system[i];
            if !system.visible {
                all.push(None);
                continue;
            }
            let own = i64::try_from(frame).unwrap_or(i64::MAX).saturating_add(system.frame_offset);
            let own = usize::try_from(own).map_err(|_| {
                Error::Usage(format!("frame {frame}: frame_offset leads before the first frame"))
            })?;
            // Beside a series, what has one frame stands still.
            let still = own > 0 && self.series.len() > 1 && self.series[i].frames(&report)? == 1;
            let own = if still { 0 } else { own };
            let mut wanted = wanted(system);
            let by_property = |s: &Section| matches!(s.cap, CapColor::Property(_));
            if self.scene.sections_of(i).any(|(_, section)| by_property(section)) {
                wanted = Wanted::All;
            }
            let masked = self.scene.renderer == Renderer::Density && self.scene.density.mask;
            if masked && let Wanted::Only(columns) = &mut wanted {
                columns.push(names::PARTICLE_MASK.into());
            }
            if self.ranges[i].is_none() && system.color.range_over == RangeOver::Series {
                self.ranges[i] = series_range(&mut self.series[i], system, &wanted, watch)?;
            }
            let series = &mut self.series[i];
            all.push(Some(match after {
                After::Kept => series.frame(own, &wanted, &report)?,
                After::LetGo => Arc::new(series.take(own, &wanted, &report)?),
            }));
        }
        Ok(all)
    }

    /// The first system as a liquid, the others as spheres before it and in it.
    fn flow(
        &self,
        loaded: &[Loaded],
        (resolved, origin, bounds): (&Resolved, DVec3, Option<Bounds>),
        layers: bool,
        (stats, watch): (&mut Stats, &dyn Watch),
    ) -> Result<Frame> {
        let [system, others @ ..] = loaded else {
            let name = if self.scene.renderer == Renderer::Density { "density" } else { "surface" };
            return Err(Error::Usage(format!("renderer {name}: no system is visible")));
        };
        let level = Level::new();
        stats.simd = instruction_set(level).into();
        let entries = Entries::new(others, &self.scene.light);
        let boxes = others.iter().flat_map(|l| l.boxes(origin));
        let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let corners = boxes.fold(nothing, |[low, high], b| {
            [low.min((b.min - origin).as_vec3()), high.max((b.max - origin).as_vec3())]
        });
        let others = Others { systems: &entries.spheres, paint: &entries, bounds: corners };
        let others = (!entries.spheres.is_empty()).then_some(others);
        let scene = &self.scene;
        if scene.renderer == Renderer::Density {
            let cast = Cast { scene, system, resolved, bounds, origin, level, others };
            return cast.draw(layers, (stats, watch));
        }
        let matter = Matter::of(system);
        let types = match scene.surface.media {
            motes_scene::surface::Media::One => Vec::new(),
            motes_scene::surface::Media::Types => system.visible_by_type()?,
        };
        if types.len() > MOST_MEDIA {
            return Err(Error::Usage(format!(
                "surface.media = types: {} types are visible, expected at most {MOST_MEDIA}",
                types.len()
            )));
        }
        let media: Vec<_> = types.iter().map(|(i, of)| (*i, matter.only(system, of))).collect();
        let media = &media[..];
        Liquid { scene, matter, media, resolved, bounds, origin, level, others }.draw(layers, stats)
    }

    fn trace(
        &self,
        loaded: &[Loaded],
        (resolved, origin): (&Resolved, DVec3),
        layers: bool,
        (stats, watch): (&mut Stats, &dyn Watch),
    ) -> Result<Frame> {
        let level = Level::new();
        stats.simd = instruction_set(level).into();
        let entries = Entries::new(loaded, &self.scene.light);
        let rays = resolved.view.rays(origin);
        let lights = resolved.lights.about(origin);
        let systems = &entries.spheres;
        let view = View {
            rays: &rays,
            systems,
            paint: &entries,
            lights: &lights,
            casters: &entries.casters,
        };
        let image = &self.scene.image;
        let settings = Settings {
            size: (image.width, image.height),
            samples: image.samples,
            primary: match self.scene.spheres.primary {
                motes_scene::Primary::Project => Primary::Project,
                motes_scene::Primary::Trace => Primary::Trace,
            },
            packet: self.scene.spheres.packet,
            layers,
            finer: Finer {
                adaptive: Some(Adaptive {
                    most: image.max_samples,
                    noise: image.noise as f32,
                    exposure: image.exposure.exp2() as f32,
                }),
                lens: resolved.view.lens,
            },
            level,
        };
        let tell = |done, total| watch.progress("render", done, total);
        let traced = motes_spheres::render(view, settings, &tell).ok_or(Error::Cancelled)?;
        stats.counts.insert("tests", traced.counts.tests);
        stats.counts.insert("spheres", traced.counts.spheres);
        let frame = Frame::new(image.width as usize, image.height as usize, traced.color)?;
        if layers { with_layers(frame, &traced.center, &entries) } else { Ok(frame) }
    }

    /// Tone, background and annotations.
    fn finish(&self, raw: &Frame, resolved: &Resolved, annotated: &Annotated<'_>) -> Frame {
        let image = &self.scene.image;
        let mut shown = raw.clone();
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
        background.put_behind(&mut shown);
        annotations(&self.scene, resolved, annotated).draw(&mut shown);
        shown
    }
}

/// Makes a path absolute, so that a picture can be drawn again from any directory.
fn make_absolute(source: &mut String) {
    let is_path = !source.starts_with("demo:") && !source.starts_with("sim:");
    if is_path && let Ok(path) = std::path::absolute(&*source) {
        *source = path.to_string_lossy().into_owned();
    }
}

pub(crate) fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

/// The columns that colours and radii need; all, where a property's name or an expression may mean any.
pub(crate) fn wanted(system: &motes_scene::System) -> Wanted {
    let by = match &system.color.by {
        ColorBy::Auto => vec![names::COLOR, ALPHA],
        ColorBy::Chain => vec![names::CHAIN, names::MOLECULE_IDENTIFIER],
        ColorBy::Uniform | ColorBy::Element | ColorBy::Type => vec![],
        ColorBy::Property(_) => return Wanted::All,
    };
    if !system.r#where.trim().is_empty() || !system.filter.is_empty() {
        return Wanted::All;
    }
    Wanted::Only(
        by.into_iter()
            .chain([names::PARTICLE_TYPE, names::TRANSPARENCY])
            .map(str::to_owned)
            .collect(),
    )
}

/// The range of the colouring property over all frames.
fn series_range(
    series: &mut Series,
    system: &motes_scene::System,
    wanted: &Wanted,
    watch: &dyn Watch,
) -> Result<Option<[f64; 2]>> {
    let ColorBy::Property(name) = &system.color.by else { return Ok(None) };
    let quiet = |_, _| {};
    let frames = series.frames(&quiet)?;
    let mut range: Option<[f64; 2]> = None;
    for frame in 0..frames {
        if !watch.progress("range", frame as u64, frames as u64) {
            return Err(Error::Cancelled);
        }
        let particles = series.frame(frame, wanted, &quiet)?;
        // Frames without particles may come without columns.
        if particles.is_empty() {
            continue;
        }
        let property = find_property(&particles, name, system.color.component)?;
        if let Some([low, high]) = property.range(&particles, system.color.log) {
            let [a, b] = range.unwrap_or([low, high]);
            range = Some([a.min(low), b.max(high)]);
        }
    }
    Ok(range)
}

/// Boxes around all that is to be framed.
fn framed(loaded: &[Loaded], origin: DVec3) -> Vec<Bounds> {
    let of_box = |l: &Loaded| {
        let corners = l.sim_box?.corners();
        Bounds::of_spheres(corners.map(|c| (DVec3::from_array(c), 0.0)))
    };
    loaded.iter().flat_map(|l| l.boxes(origin).into_iter().chain(of_box(l))).collect()
}

fn with_layers(frame: Frame, center: &[Center], entries: &Entries<'_>) -> Result<Frame> {
    // Where nothing is, the system is 0.
    let system = |c: &Center| if c.id < 0 { 0 } else { entries.system(c.system).number };
    Ok(frame
        .with(Layer::Depth(center.iter().map(|c| c.depth).collect()))?
        .with(Layer::Normal(center.iter().map(|c| c.normal).collect()))?
        .with(Layer::Id(center.iter().map(|c| c.id).collect()))?
        .with(Layer::System(center.iter().map(system).collect()))?)
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
    stats.bytes.insert("visibility", sum(&Loaded::visibility_bytes));
}

/// The name of an instruction set.
pub(crate) fn instruction_set(level: Level) -> &'static str {
    match level {
        #[cfg(target_arch = "x86_64")]
        Level::Avx512(_) => "AVX-512",
        #[cfg(target_arch = "x86_64")]
        Level::Avx2(_) => "AVX2",
        // Nothing is compiled for SSE4.2 alone.
        #[cfg(target_arch = "x86_64")]
        Level::Sse4_2(_) | Level::Sse2(_) => "SSE2",
        #[cfg(target_arch = "aarch64")]
        Level::Neon(_) => "NEON",
        _ => "scalar",
    }
}
