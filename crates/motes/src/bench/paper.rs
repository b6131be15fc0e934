//! Tables 2–9 of Gribble et al. 2007, in their own rows and columns.
//!
//! The paper's machine had 16 cores; "all threads" are here those of the machine or those asked for. A
//! cell is the median of some frames of one view, all columns of a row measured in turns.

use fearless_simd::Level;
use motes_scene::{Lights, Primary, Rays, RelativeTo, Scene};
use motes_spheres::Spheres;

use super::draw::{self, Culling, Drawn, SphereCenter, Way};
use super::sets::{BLOCK, Built, LAMBDA, Loaded, SETS, params};
use super::shot::{Shot, Studio, White};
use super::single_ray::SingleRay;
use super::standard_grid::{self, Insert, Standard, StandardGrid};
use super::table::{Cell, Table};
use super::{chosen, hash, median, pool, sweeps, timed};
use crate::{Result, Watch};

/// The stages: the paper's tables, the sweeps, construction.
pub const STAGES: [&str; 11] = [
    "table2", "table3", "table4", "table5", "table6", "table7", "table8", "table9", "lambda",
    "block", "build",
];

/// What to measure.
#[derive(Clone, Debug)]
pub struct Tables {
    /// Width and height of the pictures, pixels; some tables also double them.
    pub size: (u32, u32),
    /// Frames of which the median counts.
    pub frames: usize,
    /// Names of [`STAGES`] or [`crate::bench::SURFACE_TABLES`]; none: all.
    pub stages: Vec<String>,
    /// Factor on the numbers of particles; 1 for the paper's.
    pub scale: f64,
    /// Threads where the paper used all; none: the machine's.
    pub threads: Option<usize>,
}

/// Measures the tables.
///
/// # Errors
/// A stage that is not there, or no threads.
pub fn spheres_tables(options: &Tables, watch: &dyn Watch) -> Result<Vec<Table>> {
    let stages = chosen(&options.stages, &STAGES)?;
    let mut tables: Vec<Table> = stages.iter().map(|stage| empty(stage)).collect();
    let bench = Bench {
        size: options.size,
        frames: options.frames.max(1),
        level: Level::new(),
        one: pool(Some(1))?,
        all: pool(options.threads)?,
    };
    let total = (SETS.len() * tables.len()) as u64;
    for (i, set) in SETS.into_iter().enumerate() {
        let done = (i * tables.len()) as u64;
        watch.progress(set.name, done, total);
        let loaded = bench.all.install(|| set.load(options.scale))?;
        let rays = loaded.rays(options.size)?;
        let paper = || Built::new(&loaded.positions, loaded.radius, params(LAMBDA, BLOCK));
        let built = bench.all.install(paper);
        for (j, table) in tables.iter_mut().enumerate() {
            bench.row(&Scenery { loaded: &loaded, built: &built, rays: &rays }, table)?;
            watch.progress(set.name, done + j as u64 + 1, total);
        }
    }
    Ok(tables)
}

/// The table of a stage, without rows.
fn empty(stage: &'static str) -> Table {
    let (title, columns): (_, &[&str]) = match stage {
        "table2" => ("packet size, one thread, frames/s", &["2 x 2", "4 x 4", "8 x 8", "16 x 16"]),
        "table3" => (
            "image resolution, one thread, frames/s; ratio of the best of each",
            &["4 x 4", "8 x 8", "doubled 8 x 8", "doubled 16 x 16", "Ratio"],
        ),
        "table4" => (
            "sphere-center method, one thread, frames/s",
            &["Standard", "Sphere-Center", "Speed-up"],
        ),
        "table5" => (
            "sphere/frustum culling, pairs of packet and sphere",
            &["Potential tests", "# skipped", "Culled"],
        ),
        "table6" => (
            "sphere/frustum culling, all threads, frames/s",
            &["No culling", "Culling", "Speed-up"],
        ),
        "table7" => (
            "parameter range culling, all threads, frames/s; Motes' own way; time to change the range",
            &[
                "% total",
                "PR cull (no mcells)",
                "PR cull",
                "Pre-crop",
                "Slow-down",
                "Motes",
                "Motes, pre-crop",
                "Slow-down",
                "Change",
            ],
        ),
        "table8" => (
            "soft shadows, all threads, frames/s; the light has 5 % of the area of the bounding box",
            &["No shadows", "2 x 2", "4 x 4", "8 x 8"],
        ),
        "table9" => (
            "other methods, all threads, frames/s",
            &["Our CGT", "Single ray", "GPU-based", "Motes"],
        ),
        _ => return sweeps::empty(stage),
    };
    Table::new(stage, title, columns)
}

/// What all measurements share.
pub(super) struct Bench {
    pub size: (u32, u32),
    pub frames: usize,
    pub level: Level,
    /// One thread.
    pub one: rayon::ThreadPool,
    /// All threads.
    pub all: rayon::ThreadPool,
}

/// A set with the paper's grid over it and the view of it.
pub(super) struct Scenery<'a> {
    pub loaded: &'a Loaded,
    pub built: &'a Built,
    pub rays: &'a Rays,
}

/// The paper's packets (§5).
const PACKET: u32 = 8;

/// Milliseconds and what was drawn.
pub(super) type Measured = (f64, Drawn);

impl Bench {
    fn row(&self, scenery: &Scenery<'_>, table: &mut Table) -> Result<()> {
        match table.stage {
            "table2" => self.packets(scenery, table),
            "table3" => self.resolutions(scenery, table)?,
            "table4" => self.methods(scenery, table),
            "table5" => self.culled(scenery, table),
            "table6" => self.culling(scenery, table),
            "table7" => self.ranges(scenery, table)?,
            "table8" => self.shadows(scenery, table)?,
            "table9" => self.others(scenery, table)?,
            _ => sweeps::row(self, scenery, table),
        }
        Ok(())
    }

    /// Measures every way in turns, after one frame each that does not count.
    pub fn measure(
        &self,
        pool: &rayon::ThreadPool,
        ways: &[(draw::Shot<'_>, &dyn Way)],
    ) -> Vec<Measured> {
        let draw =
            |(shot, way): &(draw::Shot<'_>, &dyn Way)| pool.install(|| draw::draw(*shot, *way));
        let drawn: Vec<Drawn> = ways.iter().map(draw).collect();
        let mut times = vec![Vec::new(); ways.len()];
        for _ in 0..self.frames {
            for (way, times) in ways.iter().zip(&mut times) {
                times.push(timed(|| draw(way)).0);
            }
        }
        times.into_iter().map(median).zip(drawn).collect()
    }

    pub fn shot<'a>(&self, rays: &'a Rays, packet: u32) -> draw::Shot<'a> {
        draw::Shot { rays, size: self.size, packet }
    }

    pub fn sphere_center<'a>(&self, spheres: Spheres<'a>) -> SphereCenter<'a> {
        SphereCenter { spheres, level: self.level, culling: Culling::On }
    }

    pub fn hashes<'a>(&self, all: &'a [Measured]) -> impl Iterator<Item = String> + use<'a> {
        let size = self.size;
        all.iter().map(move |(_, drawn)| hash(size, &drawn.pixels))
    }

    /// Table 2.
    fn packets(&self, scenery: &Scenery<'_>, table: &mut Table) {
        let way = self.sphere_center(scenery.built.spheres());
        let ways = [2, 4, 8, 16].map(|side| (self.shot(scenery.rays, side), &way as &dyn Way));
        let all = self.measure(&self.one, &ways);
        let cells = all.iter().map(|(ms, _)| Cell::Frame(*ms)).collect();
        table.push(scenery.loaded.label(), cells, self.hashes(&all));
    }

    /// Table 3.
    fn resolutions(&self, scenery: &Scenery<'_>, table: &mut Table) -> Result<()> {
        let double = (2 * self.size.0, 2 * self.size.1);
        let rays = scenery.loaded.rays(double)?;
        let way = self.sphere_center(scenery.built.spheres());
        let doubled = |packet| draw::Shot { rays: &rays, size: double, packet };
        let shots =
            [self.shot(scenery.rays, 4), self.shot(scenery.rays, 8), doubled(8), doubled(16)];
        let all = self.measure(&self.one, &shots.map(|shot| (shot, &way as &dyn Way)));
        let best = |some: &[Measured]| some.iter().map(|(ms, _)| *ms).fold(f64::INFINITY, f64::min);
        let mut cells: Vec<Cell> = all.iter().map(|(ms, _)| Cell::Frame(*ms)).collect();
        cells.push(Cell::Factor(best(&all[..2]) / best(&all[2..])));
        let hashes = shots.iter().zip(&all).map(|(shot, (_, drawn))| shot.hash(drawn));
        table.push(scenery.loaded.label(), cells, hashes);
        Ok(())
    }

    fn standard(&self, scenery: &Scenery<'_>) -> StandardGrid {
        let params = standard_grid::Params {
            insert: Insert::Overlapped,
            lambda: f64::from(LAMBDA),
            block: BLOCK as usize,
        };
        StandardGrid::build(&scenery.loaded.positions, scenery.loaded.radius, params).0
    }

    /// Table 4.
    fn methods(&self, scenery: &Scenery<'_>, table: &mut Table) {
        let grid = self.standard(scenery);
        let standard = Standard { grid: &grid, level: self.level };
        let center = self.sphere_center(scenery.built.spheres());
        self.compare(scenery, &self.one, [&standard, &center], table);
    }

    /// A row of two ways and how much faster the second is.
    fn compare(
        &self,
        scenery: &Scenery<'_>,
        pool: &rayon::ThreadPool,
        ways: [&dyn Way; 2],
        table: &mut Table,
    ) {
        let all = self.measure(pool, &ways.map(|way| (self.shot(scenery.rays, PACKET), way)));
        let mut cells: Vec<Cell> = all.iter().map(|(ms, _)| Cell::Frame(*ms)).collect();
        cells.push(Cell::Factor(all[0].0 / all[1].0));
        table.push(scenery.loaded.label(), cells, self.hashes(&all));
    }

    /// Table 5.
    fn culled(&self, scenery: &Scenery<'_>, table: &mut Table) {
        let way = self.sphere_center(scenery.built.spheres());
        let shot = self.shot(scenery.rays, PACKET);
        let drawn = self.all.install(|| draw::draw(shot, &way));
        let (potential, tested) = (drawn.counts.spheres, drawn.counts.tested);
        let skipped = potential - tested;
        let percent = 100.0 * skipped as f64 / potential.max(1) as f64;
        let cells = vec![Cell::Count(potential), Cell::Count(skipped), Cell::Percent(percent)];
        table.push(scenery.loaded.label(), cells, [shot.hash(&drawn)]);
    }

    /// Table 6.
    fn culling(&self, scenery: &Scenery<'_>, table: &mut Table) {
        let on = self.sphere_center(scenery.built.spheres());
        let off =
            SphereCenter { culling: Culling::Off, ..self.sphere_center(scenery.built.spheres()) };
        self.compare(scenery, &self.all, [&off, &on], table);
    }

    /// Table 7, for the sets that the paper has there.
    fn ranges(&self, scenery: &Scenery<'_>, table: &mut Table) -> Result<()> {
        let Scenery { loaded, built, rays } = scenery;
        let Some(range) = loaded.set.isolated else { return Ok(()) };
        let (change, visible) = self.all.install(|| loaded.within(built, range));
        let grids = built.classes.grids.iter();
        let bits: Vec<_> = grids.zip(&visible).map(|(g, v)| v.without_blocks(g)).collect();
        let positions = loaded.cropped(range);
        let cropped =
            self.all.install(|| Built::new(&positions, loaded.radius, params(LAMBDA, BLOCK)));
        let of = |visible| self.sphere_center(Spheres::new(&built.classes, visible));
        let ways = [of(&bits), of(&visible), self.sphere_center(cropped.spheres())];
        let ways: Vec<_> =
            ways.iter().map(|way| (self.shot(rays, PACKET), way as &dyn Way)).collect();
        let all = self.measure(&self.all, &ways);
        let part = positions.len() as f64 / loaded.positions.len() as f64;
        let mut cells = vec![Cell::Percent(100.0 * part)];
        cells.extend(all.iter().map(|(ms, _)| Cell::Frame(*ms)));
        cells.push(Cell::Factor(all[1].0 / all[2].0));
        let light = (&large_light(loaded)?, 0);
        let spheres = Spheres::new(&built.classes, &visible);
        let motes = |spheres| self.measure_product((rays, spheres), light, Primary::Project).0;
        let (culled, pre_crop) = (motes(spheres), motes(cropped.spheres()));
        cells.extend([Cell::Frame(culled), Cell::Frame(pre_crop)]);
        cells.extend([Cell::Factor(culled / pre_crop), Cell::Ms(change)]);
        table.push(loaded.label(), cells, self.hashes(&all));
        Ok(())
    }

    /// Median milliseconds and hash of the renderer's own picture with so many shadow rays.
    fn measure_product(
        &self,
        (rays, spheres): (&Rays, Spheres<'_>),
        (lights, shadow_rays): (&Lights, u32),
        primary: Primary,
    ) -> (f64, String) {
        let mut lights = *lights;
        lights.key.shadow_rays = shadow_rays;
        let shot = Shot {
            rays,
            spheres,
            paint: &White,
            lights: &lights,
            samples: 1,
            primary,
            packet: PACKET,
        };
        let studio = Studio::new(self.size);
        let draw = || self.all.install(|| studio.draw(shot));
        draw();
        let times = (0..self.frames).map(|_| timed(draw).0).collect();
        (median(times), studio.hash())
    }

    /// Table 8.
    fn shadows(&self, scenery: &Scenery<'_>, table: &mut Table) -> Result<()> {
        let lights = large_light(scenery.loaded)?;
        let seen = (scenery.rays, scenery.built.spheres());
        let all: Vec<_> = [0, 4, 16, 64]
            .map(|rays| self.measure_product(seen, (&lights, rays), Primary::Trace))
            .into();
        let cells = all.iter().map(|(ms, _)| Cell::Frame(*ms)).collect();
        table.push(scenery.loaded.label(), cells, all.into_iter().map(|(_, hash)| hash));
        Ok(())
    }

    /// Table 9, and the renderer as it is.
    fn others(&self, scenery: &Scenery<'_>, table: &mut Table) -> Result<()> {
        let grid = self.standard(scenery);
        let center = self.sphere_center(scenery.built.spheres());
        let single = SingleRay { grid: &grid, level: self.level };
        let shot = self.shot(scenery.rays, PACKET);
        let all = self.measure(&self.all, &[(shot, &center), (shot, &single)]);
        let light = large_light(scenery.loaded)?;
        let seen = (scenery.rays, scenery.built.spheres());
        let (motes, _) = self.measure_product(seen, (&light, 0), Primary::Project);
        let [cgt, single] = [Cell::Frame(all[0].0), Cell::Frame(all[1].0)];
        let cells = vec![cgt, single, Cell::Missing, Cell::Frame(motes)];
        table.push(scenery.loaded.label(), cells, self.hashes(&all));
        Ok(())
    }
}

/// Part of the bounding box's area that the light has (Table 8).
const LIGHT_PART: f64 = 0.05;

/// A light of 5 % of the area of the bounding box, seen from a diagonal away.
fn large_light(loaded: &Loaded) -> Result<Lights> {
    let bounds = loaded.bounds();
    let (area, diagonal) = bounds.map_or((6.0, 3f64.sqrt()), |b| {
        let d = b.max - b.min;
        (2.0 * (d.x * d.y + d.y * d.z + d.z * d.x), b.diagonal())
    });
    let radius = (LIGHT_PART * area / std::f64::consts::PI).sqrt();
    let mut scene = Scene::default();
    scene.light.relative_to = RelativeTo::Camera;
    scene.light.softness = 2.0 * (radius / diagonal).atan().to_degrees();
    scene.light.occlusion_rays = 0;
    Ok(scene.resolve(bounds)?.lights)
}
