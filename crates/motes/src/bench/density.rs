//! Measurements of the density renderer: Table 1 and Fig. 5 of Yasuda et al. 2009, and one line for any source.
//!
//! *Sim1* is every particle into every voxel in its reach; *sim2* has the rough field and the masks; by the
//! same code. What the product does by itself has the rough field alone, see `motes scene`.
//!
//! The sets of Table 1 are dam-breaks of a cubic tank of 2 m, which 64³ voxels fill, after some steps; masks
//! are the simulation's own and take no time here. A live frame is five steps of the simulation (weakly
//! compressible), the field, and the picture.

use std::collections::BTreeMap;

use fearless_simd::Level;
use glam::DVec3;
use motes_density::{Around, Field, Liquid, Mask, Params, Particles, Space, View, shade};
use motes_grid::Radii;
use motes_scene::{Bounds, Environment, Framing, Resolved, Scene, Solver};
use motes_sph::Simulation;

use super::liquid;
use super::shot::pack;
use super::source::{Line, Source, poses, read};
use super::table::{Cell, Table};
use super::{Tables, chosen, hash, median, pool, surface_defaults, timed};
use crate::density::{masks, optics, params};
use crate::drawing::instruction_set;
use crate::environment::environment;
use crate::simulate::Simulated;
use crate::{Error, Result, Watch, peak_memory_bytes};

/// The tables: construction of the field; whole frames; what masks cost; ten seconds of simulation, which is
/// done only where it is asked for.
pub const STAGES: [&str; 4] = ["table1", "fig5", "mask", "endure"];
/// Those that are done where nothing is said.
const SHORT: usize = 3;
/// The stages of a source: the product's field; the first field and picture of the process; both, with the
/// camera turned; a live frame of a simulation, and its step; rays alone; the plain field and that with masks.
pub const SOURCE_STAGES: [&str; 8] =
    ["build", "first_image", "frame", "live", "step", "march", "sim1", "sim2"];

/// Steps of the simulation in a live frame (Fig. 5).
const SUBSTEPS: usize = 5;
/// Steps before anything is measured.
const FIRST_STEPS: usize = 20;
/// Particles of Table 1.
const SETS: [(&str, f64); 4] =
    [("8,000", 8e3), ("27,000", 27e3), ("64,000", 64e3), ("125,000", 125e3)];

/// Particles in memory, and what is drawn of them.
struct Set {
    positions: Vec<[f32; 3]>,
    radii: Radii,
    masks: Vec<Mask>,
    mean_radius: f64,
    /// All that is visible, in world coordinates.
    bounds: Bounds,
    origin: DVec3,
}

/// What a picture is made with, whose memory is kept.
#[derive(Default)]
struct Studio {
    field: Field,
    space: Space,
}

impl Set {
    /// The particles of a running simulation, in its tank.
    fn of(simulation: &mut Simulation) -> Self {
        let [low, high] = simulation.tank().map(|c| DVec3::from_array(c.map(f64::from)));
        let radius = 0.5 * simulation.spacing();
        let frame = simulation.frame();
        Self {
            positions: frame.positions,
            radii: Radii::Uniform(radius),
            masks: frame.masks,
            mean_radius: f64::from(radius),
            bounds: Bounds::new(low, high),
            origin: DVec3::ZERO,
        }
    }

    fn particles(&self) -> Particles<'_> {
        let radii = match &self.radii {
            Radii::Uniform(r) => Radii::Uniform(*r),
            Radii::Each(radii) => Radii::Each(&radii[..]),
        };
        Particles { positions: &self.positions, radii, masks: Some(&self.masks) }
    }

    fn params(&self, scene: &Scene) -> Params {
        let longest = (self.bounds.max - self.bounds.min).max_element();
        params(scene, (self.mean_radius, longest))
    }

    fn framing(&self) -> Framing<'_> {
        Framing::new(std::slice::from_ref(&self.bounds), 0.0)
    }
}

impl Studio {
    /// Makes the field and what rays skip in it.
    fn fill(&mut self, set: &Set, params: &Params) {
        let particles = set.particles();
        self.field.fill(&particles, params, Level::new());
        self.space.fill(&self.field, (&particles, params), Level::new());
    }

    fn draw(&self, set: &Set, (scene, resolved): (&Scene, &Resolved)) -> Result<Vec<[f32; 4]>> {
        let environment: Environment =
            environment(&scene.density.environment, (scene, resolved), (set.bounds, set.origin))?;
        let around = Around {
            beyond: &environment,
            shown: scene.density.environment != "none",
            shadow: None,
            paint: None,
        };
        let size = (scene.image.width, scene.image.height);
        let view = View { rays: resolved.view.rays(set.origin), size };
        let liquid =
            Liquid { field: &self.field, space: &self.space, clip: None, level: Level::new() };
        let finer = f64::from(scene.image.samples).sqrt().floor().max(1.0) as u32;
        Ok(shade(&liquid, &view, (&optics(scene, set.bounds), &around), finer))
    }
}

fn hash_of(scene: &Scene, color: &[[f32; 4]]) -> String {
    let pixels: Vec<u32> = color.iter().map(pack).collect();
    hash((scene.image.width, scene.image.height), &pixels)
}

/// A field in one of the ways that are compared.
fn way(params: &Params, sim2: bool) -> Params {
    Params { rough: sim2, masked: sim2, ..*params }
}

/// Median milliseconds of fields, made in turns; and the voxels written for each.
fn fields(set: &Set, ways: &[Params], frames: usize) -> Vec<(f64, u64)> {
    let (particles, level) = (set.particles(), Level::new());
    let mut field = Field::default();
    let updates: Vec<u64> = ways
        .iter()
        .map(|params| {
            field.fill_counted(&particles, params, level);
            field.counts.updates
        })
        .collect();
    let mut times = vec![Vec::new(); ways.len()];
    for _ in 0..frames {
        for (params, times) in ways.iter().zip(&mut times) {
            times.push(timed(|| field.fill(&particles, params, level)).0);
        }
    }
    times.into_iter().map(median).zip(updates).collect()
}

/// Measures the tables.
///
/// # Errors
/// A stage that is not there, no threads, or a simulation that blows up.
pub fn density_tables(options: &Tables, watch: &dyn Watch) -> Result<Vec<Table>> {
    let mut stages = chosen(&options.stages, &STAGES)?;
    if options.stages.is_empty() {
        stages.truncate(SHORT);
    }
    let pool = pool(options.threads)?;
    pool.install(|| {
        let mut tables = Vec::new();
        for (done, stage) in stages.iter().enumerate() {
            watch.progress(stage, done as u64, stages.len() as u64);
            tables.push(match *stage {
                "table1" => table1(options)?,
                "fig5" => fig5(options)?,
                "mask" => liquid::mask(options)?,
                _ => liquid::endure(options, watch)?,
            });
        }
        Ok(tables)
    })
}

/// A scene of the tables: one sample, no shadow.
pub(super) fn scene(options: &Tables, resolution: u32) -> Scene {
    let mut scene = Scene::default();
    surface_defaults(&mut scene);
    (scene.image.width, scene.image.height) = options.size;
    scene.density.resolution = Some(resolution);
    scene.sph.solver = Solver::Wcsph;
    scene
}

/// A simulation after its first steps.
pub(super) fn simulation(source: &str, scene: &Scene, steps: usize) -> Result<Simulation> {
    let text = source.strip_prefix("sim:").unwrap_or(source);
    let mut simulation = Simulated::new(source, text, &scene.sph)?.begin().map_err(Error::Usage)?;
    advance(&mut simulation, steps)?;
    Ok(simulation)
}

fn advance(simulation: &mut Simulation, steps: usize) -> Result<()> {
    for _ in 0..steps {
        let secs = simulation.longest_step();
        simulation.step(secs).map_err(Error::Usage)?;
    }
    Ok(())
}

pub(super) fn scaled(particles: f64, options: &Tables) -> usize {
    ((particles * options.scale).round() as usize).max(64)
}

/// Table 1.
fn table1(options: &Tables) -> Result<Table> {
    let title = "the density field in 64³ voxels: every particle into every voxel in its reach (Sim1), and \
                 with the rough field and masks (Sim2); the product's own has the rough field";
    let columns = ["Sim1", "Sim2", "Own", "Sim1 voxels", "Sim2 voxels", "Fewer"];
    let mut table = Table::new("table1", title, &columns);
    let scene = scene(options, 64);
    for (name, count) in SETS {
        let count = scaled(count, options);
        let tank = "width=2&length=1&height=0.5&tank_length=2&tank_height=2";
        let source = format!("sim:dam-break?particles={count}&{tank}");
        let set = Set::of(&mut simulation(&source, &scene, FIRST_STEPS)?);
        let own = set.params(&scene);
        let ways = [way(&own, false), way(&own, true), own];
        let made = fields(&set, &ways, options.frames);
        let resolved = scene.resolve_framing(set.framing())?;
        let mut hashes = Vec::new();
        let mut studio = Studio::default();
        for params in &ways {
            studio.fill(&set, params);
            hashes.push(hash_of(&scene, &studio.draw(&set, (&scene, &resolved))?));
        }
        let mut cells: Vec<Cell> = made.iter().map(|(ms, _)| Cell::Ms(*ms)).collect();
        cells.extend(made[..2].iter().map(|(_, updates)| Cell::Count(*updates)));
        cells.push(Cell::Factor(made[0].1 as f64 / made[1].1.max(1) as f64));
        table.push((name, set.positions.len()), cells, hashes);
    }
    Ok(table)
}

/// Fig. 5: frames of a running simulation, and of a still set of a million.
fn fig5(options: &Tables) -> Result<Table> {
    let title = "whole frames; live: five steps of the simulation, field and picture, 64 voxels along \
                 the tank; still: 192 voxels";
    let columns = ["Steps", "Field", "Picture", "Frame", "p95"];
    let mut table = Table::new("fig5", title, &columns);
    let live_scene = scene(options, 64);
    let source = format!("sim:dam-break?particles={}", scaled(27e3, options));
    let mut running = simulation(&source, &live_scene, FIRST_STEPS)?;
    let mut live = Live::new(&mut running, &live_scene)?;
    let count = live.set.positions.len();
    let mut times = Vec::new();
    for _ in 0..options.frames.max(1) {
        times.push(live.frame(&mut running)?);
    }
    let color = live.studio.draw(&live.set, (&live_scene, &live.resolved))?;
    table.push(("live", count), cells(&times), [hash_of(&live_scene, &color)]);

    let still_scene = scene(options, 192);
    let source = format!("sim:dam-break?particles={}", scaled(1e6, options));
    let mut standing = simulation(&source, &still_scene, 1)?;
    let mut still = Live::new(&mut standing, &still_scene)?;
    let mut times = Vec::new();
    for _ in 0..options.frames.max(1) {
        times.push(still.picture()?);
    }
    let color = still.studio.draw(&still.set, (&still_scene, &still.resolved))?;
    let count = still.set.positions.len();
    table.push(("still", count), cells(&times), [hash_of(&still_scene, &color)]);
    Ok(table)
}

/// The medians of steps, field, picture and sum, and the 95th percentile of the sum.
fn cells(times: &[[f64; 3]]) -> Vec<Cell> {
    let mut sums: Vec<f64> = times.iter().map(|t| t.iter().sum()).collect();
    sums.sort_unstable_by(f64::total_cmp);
    let late = sums.get((sums.len() * 95 / 100).min(sums.len() - 1)).copied().unwrap_or(f64::NAN);
    let of = |part: usize| Cell::Ms(median(times.iter().map(|t| t[part]).collect()));
    vec![of(0), of(1), of(2), Cell::Frame(median(sums)), Cell::Ms(late)]
}

/// A simulation that is looked at.
struct Live<'a> {
    scene: &'a Scene,
    resolved: Resolved,
    params: Params,
    set: Set,
    studio: Studio,
}

impl<'a> Live<'a> {
    fn new(simulation: &mut Simulation, scene: &'a Scene) -> Result<Self> {
        let set = Set::of(simulation);
        let resolved = scene.resolve_framing(set.framing())?;
        let params = set.params(scene);
        let mut live = Self { scene, resolved, params, set, studio: Studio::default() };
        // The first of this process: nothing is warm yet.
        live.picture()?;
        Ok(live)
    }

    /// Milliseconds of steps, field and picture.
    fn frame(&mut self, simulation: &mut Simulation) -> Result<[f64; 3]> {
        let (ms, done) = timed(|| {
            advance(simulation, SUBSTEPS)?;
            if self.params.masked {
                self.set.masks = simulation.frame().masks;
            }
            simulation.positions(&mut self.set.positions);
            Ok::<_, Error>(())
        });
        done?;
        let [_, field, picture] = self.picture()?;
        Ok([ms, field, picture])
    }

    /// The same of what stands still.
    fn picture(&mut self) -> Result<[f64; 3]> {
        let (field, ()) = timed(|| self.studio.fill(&self.set, &self.params));
        let (picture, done) =
            timed(|| self.studio.draw(&self.set, (self.scene, &self.resolved)).map(drop));
        done?;
        Ok([0.0, field, picture])
    }
}

/// Measures one source.
///
/// # Errors
/// The source cannot be read, the scene makes no sense, or a stage is not there.
pub fn density_source(options: Source, watch: &dyn Watch) -> Result<Line> {
    let stages = chosen(&options.stages, &SOURCE_STAGES)?;
    let pool = pool(options.threads)?;
    pool.install(|| measure(&options, &stages, watch))
}

fn measure(options: &Source, stages: &[&'static str], watch: &dyn Watch) -> Result<Line> {
    let (scene, frames) = (&options.scene, options.frames.max(1));
    let source = &scene.system[0].source;
    let mut running = match source.starts_with("sim:") {
        true => Some(simulation(source, scene, FIRST_STEPS)?),
        false => None,
    };
    let set = match &mut running {
        Some(simulation) => Set::of(simulation),
        None => read_set(scene, watch)?,
    };
    let poses = poses(scene, set.framing(), frames)?;
    let own = set.params(scene);
    let mut studio = Studio::default();
    watch.progress("first_image", 0, 3);
    let (first_build, ()) = timed(|| studio.fill(&set, &own));
    let (first_frame, color) = timed(|| studio.draw(&set, (scene, &poses[0])));
    let mut line = line(source, (&set, &studio));
    line.hash = hash_of(scene, &color?);
    watch.progress("frame", 1, 3);
    let made = fields(&set, &[way(&own, false), way(&own, true), own], frames);
    line.counts.extend([("sim1_updates", made[0].1), ("sim2_updates", made[1].1)]);
    let mut times = BTreeMap::<&str, Vec<f64>>::new();
    for pose in poses.iter().skip(1) {
        let (fill, ()) = timed(|| studio.fill(&set, &own));
        let (march, drawn) = timed(|| studio.draw(&set, (scene, pose)).map(drop));
        drawn?;
        times.entry("march").or_default().push(march);
        times.entry("frame").or_default().push(fill + march);
    }
    watch.progress("live", 2, 3);
    if let Some(simulation) = &mut running {
        let mut live = Live::new(simulation, scene)?;
        for _ in 0..frames {
            let parts = live.frame(simulation)?;
            times.entry("step").or_default().push(parts[0] / SUBSTEPS as f64);
            times.entry("live").or_default().push(parts.iter().sum());
        }
    }
    for stage in stages {
        let ms = match *stage {
            "first_image" => first_build + first_frame,
            "sim1" => made[0].0,
            "sim2" => made[1].0,
            "build" => made[2].0,
            stage => match times.remove(stage) {
                Some(times) => median(times),
                // What stands still.
                None => continue,
            },
        };
        line.ms.insert(stage, ms);
    }
    line.bytes.extend(peak_memory_bytes().map(|bytes| ("peak", bytes)));
    Ok(line)
}

/// The particles of a file.
fn read_set(scene: &Scene, watch: &dyn Watch) -> Result<Set> {
    let particles = read(scene, watch)?;
    let fluid = super::surface::Fluid::new(particles, scene)?;
    let positions = fluid.particles.positions.clone();
    let (mean_radius, bounds) = (fluid.mean_radius, fluid.bounds);
    let masks = masks(&positions, mean_radius as f32);
    let origin = DVec3::from_array(fluid.particles.origin);
    Ok(Set { positions, radii: fluid.radii, masks, mean_radius, bounds, origin })
}

/// The line without times.
fn line(source: &str, (set, studio): (&Set, &Studio)) -> Line {
    let voxels: usize = studio.field.lattice.dims.iter().product();
    let bytes = [
        ("input", size_of_val(&set.positions[..])),
        ("field", studio.field.bytes()),
        ("space", studio.space.bytes()),
    ];
    Line {
        method: "density",
        source: source.into(),
        particles: studio.field.counts.particles as usize,
        threads: rayon::current_num_threads(),
        simd: instruction_set(Level::new()),
        primary: None,
        hash: String::new(),
        hashes: BTreeMap::new(),
        ms: BTreeMap::new(),
        bytes: bytes.into_iter().map(|(name, bytes)| (name, bytes as u64)).collect(),
        counts: [("voxels", voxels as u64), ("drops", studio.space.drop_count() as u64)].into(),
    }
}
