//! One source: construction, the first image, steady frames, frames with shadows and occlusion.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use motes_grid::RadiusClasses;
use motes_particles::Particles;
use motes_scene::{Framing, Primary, RelativeTo, Resolved, Scene};
use motes_spheres::{Counts, Spheres};
use serde::Serialize;

use super::shot::{Shot, Studio};
use super::{chosen, median, pool, timed};
use crate::cut::Visible;
use crate::drawing::instruction_set;
use crate::radius::{self, Spacing};
use crate::reading::wanted;
use crate::system::{Filtered, Loaded, visibility};
use crate::{Error, Result, Watch, peak_memory_bytes};

/// The stages: construction, warm; cold construction and the first frame; frames of a turning camera with
/// one ray per pixel sample, with 16 shadow rays more, with 16 occlusion rays more.
pub const STAGES: [&str; 5] = ["build", "first_image", "frame", "shadow16", "ao16"];

/// Rays of `shadow16` and `ao16`.
const RAYS: u32 = 16;
/// The camera's turn from frame to frame.
const TURN_DEGREES: f64 = 7.0;

/// What to measure.
#[derive(Clone, Debug)]
pub struct Source {
    /// The scene; its first system's source, its camera and lights. Samples are those of its image.
    pub scene: Scene,
    /// Frames, and builds, of which the median counts.
    pub frames: usize,
    /// Names of [`STAGES`], [`crate::bench::SURFACE_STAGES`] or [`crate::bench::DENSITY_STAGES`]; none: all.
    pub stages: Vec<String>,
    /// Threads; none: the machine's.
    pub threads: Option<usize>,
}

/// What was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// `spheres`, `surface` or `density`.
    pub method: &'static str,
    /// The source.
    pub source: String,
    /// Particles drawn.
    pub particles: usize,
    /// Threads.
    pub threads: usize,
    /// Instruction set.
    pub simd: &'static str,
    /// The way to what the eye sees first: `project` or `trace`; of spheres only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub primary: Option<&'static str>,
    /// Hash of the first frame, packed to 8 bits: of spheres, one ray per pixel sample; of a surface, in the
    /// scene's mode.
    pub hash: String,
    /// Hashes of the first frames of `shadow16` and `ao16`, or of the surface's other modes.
    pub hashes: BTreeMap<&'static str, String>,
    /// Milliseconds by stage: medians, but for `first_image`.
    pub ms: BTreeMap<&'static str, f64>,
    /// Bytes: `input` (the source's arrays), `data` (positions and radii in the grid), `grid` (beyond
    /// these), `visibility`, `peak` (of the process). Of a surface, in the order in which they come to be: `cells`
    /// (for extraction only), `boundary`, `items` and `tiles` (for splatting only), `spans`, `links`, `surfaces`.
    pub bytes: BTreeMap<&'static str, u64>,
    /// Counts of the first frame: `tests` (ray–sphere tests), `spheres` (culled or tested), `tested`. Of a
    /// surface: `kept` (particles), `cells` and `inner` ones, `tiles`, `items` splatted, `spans` stored and
    /// `true_spans`, refracted `rays` and the `columns` they looked into. Of a density: `voxels`, `drops`, `sim1_updates`
    /// and `sim2_updates` (voxels written).
    pub counts: BTreeMap<&'static str, u64>,
}

/// Makes a scene's camera and light those of the programs compared with: from 2.9 towards the middle of
/// the unit cube, a quarter of the light from everywhere and the rest from a sun of 6° half angle, occlusion
/// within 0.1.
pub fn peer_view(scene: &mut Scene) {
    let middle = DVec3::splat(0.5);
    scene.camera.position = Some(middle + 2.9 * DVec3::new(1.0, -1.4, 0.8).normalize());
    scene.camera.target = Some(middle);
    scene.camera.up = Some(DVec3::Z);
    scene.camera.fov = 35.0;
    let light = &mut scene.light;
    light.relative_to = RelativeTo::World;
    light.direction = DVec3::new(0.3, -0.5, 0.9);
    light.softness = 2.0 * (1.0 - 0.0055f64).acos().to_degrees();
    light.intensity = 0.75;
    (light.fill, light.ambient) = (0.25, 0.0);
    light.ground = light.sky;
    light.occlusion_radius = Some(0.1);
}

/// Measures one source.
///
/// # Errors
/// The source cannot be read, the scene makes no sense, or a stage is not there.
pub fn spheres_source(options: Source, watch: &dyn Watch) -> Result<Line> {
    let stages = chosen(&options.stages, &STAGES)?;
    let pool = pool(options.threads)?;
    pool.install(|| {
        let mut bench = Bench::open(options, watch)?;
        bench.measure(&stages, watch)?;
        Ok(bench.line)
    })
}

/// A source in memory, what is being measured of it and what was.
struct Bench {
    scene: Scene,
    particles: Arc<Particles>,
    frames: usize,
    studio: Studio,
    line: Line,
}

/// The frame of the first system of a scene.
pub(super) fn read(scene: &Scene, watch: &dyn Watch) -> Result<Arc<Particles>> {
    scene.check()?;
    let system = scene.system.first().filter(|s| !s.source.is_empty());
    let system = system.ok_or_else(|| Error::Usage("no source to measure".into()))?;
    let report = |done, total| _ = watch.progress("read", done, total);
    let mut series = crate::open(&system.source)?;
    Ok(series.frame(scene.image.frame as usize, &wanted(system), &report)?)
}

/// A camera, and the lights it brings, for each frame and one more: the scene's, turned about its target and the
/// way up.
pub(super) fn poses(scene: &Scene, framing: Framing<'_>, frames: usize) -> Result<Vec<Resolved>> {
    let first = scene.resolve_framing(framing)?.view;
    let axis = scene.camera.up_axis.vector();
    let pose = |frame: usize| {
        let turn = DQuat::from_axis_angle(axis, (TURN_DEGREES * frame as f64).to_radians());
        let mut scene = scene.clone();
        scene.camera.target = Some(first.target);
        scene.camera.position = Some(first.target + turn * (first.eye - first.target));
        scene.camera.up = Some(turn * first.up);
        scene.camera.height = Some(2.0 * first.half_height);
        Ok(scene.resolve_framing(framing)?)
    };
    (0..=frames).map(pose).collect()
}

impl Bench {
    fn open(options: Source, watch: &dyn Watch) -> Result<Self> {
        let Source { scene, frames, .. } = options;
        let particles = read(&scene, watch)?;
        let line = Line {
            method: "spheres",
            source: scene.system[0].source.clone(),
            particles: 0,
            threads: rayon::current_num_threads(),
            simd: instruction_set(fearless_simd::Level::new()),
            primary: Some(match scene.spheres.primary {
                Primary::Project => "project",
                Primary::Trace => "trace",
            }),
            hash: String::new(),
            hashes: BTreeMap::new(),
            ms: BTreeMap::new(),
            bytes: BTreeMap::new(),
            counts: BTreeMap::new(),
        };
        let studio = Studio::new((scene.image.width, scene.image.height));
        Ok(Self { scene, particles, frames: frames.max(1), studio, line })
    }

    fn measure(&mut self, stages: &[&'static str], watch: &dyn Watch) -> Result<()> {
        let total = stages.len() as u64 + 1;
        watch.progress("build", 0, total);
        // The first of this process: nothing is warm yet.
        let (first_build, mut loaded) = self.build(RadiusClasses::default())?;
        let boxes = loaded.boxes(self.origin());
        let framing = Framing::new(&boxes, 0.0);
        let poses = poses(&self.scene, framing, self.frames)?;
        let (first_frame, counts) = timed(|| self.draw(&loaded, &poses[0], (0, 0)));
        self.line.hash = self.studio.hash();
        self.count(&loaded, counts);
        for (done, stage) in stages.iter().enumerate() {
            watch.progress(stage, done as u64 + 1, total);
            let ms = match *stage {
                "first_image" => first_build + first_frame,
                "build" => {
                    let mut times = Vec::new();
                    for _ in 0..self.frames {
                        let spare = Arc::try_unwrap(loaded.classes).unwrap_or_default();
                        let built = self.build(spare)?;
                        times.push(built.0);
                        loaded = built.1;
                    }
                    median(times)
                }
                "shadow16" => self.steady(&loaded, &poses, (stage, (RAYS, 0))),
                "ao16" => self.steady(&loaded, &poses, (stage, (0, RAYS))),
                stage => self.steady(&loaded, &poses, (stage, (0, 0))),
            };
            self.line.ms.insert(stage, ms);
        }
        self.line.bytes.extend(peak_memory_bytes().map(|bytes| ("peak", bytes)));
        Ok(())
    }

    /// Builds the grids from the unsorted arrays, and tells how long that took.
    fn build(&self, spare: RadiusClasses) -> Result<(f64, Loaded)> {
        let system = &self.scene.system[0];
        let particles = &self.particles;
        let params = motes_grid::Params {
            resolution: motes_grid::Resolution::CellsPerParticle(self.scene.spheres.lambda as f32),
            block_cells: self.scene.spheres.block,
        };
        let rule = radius::rule(particles, system, Spacing::of(&self.scene, 0));
        let scale = system.radius_scale as f32;
        let (ms, built) = timed(|| {
            let classes = {
                let positions = particles.positions[..].into();
                radius::classes(spare, positions, rule, scale, params)
            };
            let filtered = Filtered::of(particles, &classes, system)?;
            let visible = visibility((particles, &filtered), &classes, system, None)?;
            Ok::<_, Error>((classes, visible))
        });
        let (classes, visible) = built?;
        let visible = Arc::new(Visible::uncut(&classes, visible));
        let classes = Arc::new(classes);
        let paint = Arc::new(crate::paint::Paint::new(particles, system, None)?);
        let particles = Arc::clone(particles);
        let caps = Arc::default();
        Ok((ms, Loaded { number: 0, particles, sim_box: None, classes, visible, paint, caps }))
    }

    fn origin(&self) -> DVec3 {
        DVec3::from_array(self.particles.origin)
    }

    /// Draws a frame with so many shadow and occlusion rays.
    fn draw(&self, loaded: &Loaded, pose: &Resolved, rays: (u32, u32)) -> Counts {
        let mut lights = pose.lights;
        (lights.key.shadow_rays, lights.occlusion_rays) = rays;
        if lights.key.shadow_rays == 0 {
            // Plain Lambert: only shadows show how large a light is.
            lights.key.cos_half_angle = 1.0;
        }
        self.studio.draw(Shot {
            rays: &pose.view.rays(self.origin()),
            spheres: Spheres::new(&loaded.classes, loaded.visible()),
            paint: &Colors(&loaded.paint),
            lights: &lights,
            samples: self.scene.image.samples,
            primary: self.scene.spheres.primary,
            packet: self.scene.spheres.packet,
        })
    }

    /// Median milliseconds of the frames after the first.
    fn steady(
        &mut self,
        loaded: &Loaded,
        poses: &[Resolved],
        (stage, rays): (&'static str, (u32, u32)),
    ) -> f64 {
        self.draw(loaded, &poses[0], rays);
        if rays != (0, 0) {
            self.line.hashes.insert(stage, self.studio.hash());
        }
        let time = |pose: &Resolved| timed(|| self.draw(loaded, pose, rays)).0;
        median(poses.iter().skip(1).map(time).collect())
    }

    fn count(&mut self, loaded: &Loaded, counts: Counts) {
        let grids = &loaded.classes.grids;
        let line = &mut self.line;
        line.particles = loaded.classes.len();
        let bytes = [
            ("input", self.particles.bytes()),
            ("data", grids.iter().map(motes_grid::Grid::data_bytes).sum()),
            ("grid", grids.iter().map(motes_grid::Grid::structure_bytes).sum()),
            ("visibility", loaded.visible.bytes()),
        ];
        line.bytes.extend(bytes.map(|(name, bytes)| (name, bytes as u64)));
        let counted =
            [("tests", counts.tests), ("spheres", counts.spheres), ("tested", counts.tested)];
        line.counts.extend(counted);
    }
}

/// The colours of the one system.
struct Colors<'a>(&'a crate::paint::Paint);

impl motes_spheres::Paint for Colors<'_> {
    fn color(&self, _: u16, index: u32) -> glam::Vec3 {
        self.0.color(index)
    }

    fn uniform(&self, _: u16) -> Option<glam::Vec3> {
        self.0.uniform()
    }
}
