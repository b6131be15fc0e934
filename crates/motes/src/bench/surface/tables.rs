//! Tables 1 and 2 of Zirr & Dachsbacher 2015, memory (§5.2), and what the product compares: refraction with and
//! without skipping, columns as intervals and as bits, another view of what stands still.
//!
//! The paper's data set is not public; `demo:dam:2e7` stands in for it. A cell is the median of some frames of
//! one view, all rows of a table measured in turns. Columns become spans tile by tile, while they are in cache, so
//! that `splat` has what the paper calls compression, too; `compress` puts the spans of all tiles together.

use std::sync::Arc;

use motes_particles::Particles;
use motes_particles::read::Wanted;
use motes_scene::{Scene, surface};
use motes_surface::Mode;

use super::fluid::{Extracted, Fluid};
use super::takes::{Measured, Take, measure};
use super::views::VIEWS;
use super::{figures, surface_defaults};
use crate::bench::table::{Cell, Table};
use crate::bench::{Tables, chosen, median, pool};
use crate::{Result, Watch};

/// The stages: the paper's tables and figures, and more.
pub const STAGES: [&str; 9] =
    ["table1", "table2", "memory", "fig6", "fig7", "fig8", "skip", "representation", "view"];

/// Particles of the dam, of each set of Fig. 8.
const DAM: f64 = 2e7;
pub(super) const SYNTHETIC: f64 = 1e7;

/// Edges of tiles, pixels.
const TILES: [(&str, u32); 6] =
    [("16", 16), ("32", 32), ("64", 64), ("128", 128), ("256", 256), ("512", 512)];

/// Measures the tables.
///
/// # Errors
/// A stage that is not there, or no threads.
pub fn surface_tables(options: &Tables, watch: &dyn Watch) -> Result<Vec<Table>> {
    let stages = chosen(&options.stages, &STAGES)?;
    let pool = pool(options.threads)?;
    pool.install(|| {
        let bench = Bench { options, watch };
        let (mut dam, total) = (None, stages.len() as u64);
        let mut tables = Vec::new();
        for (done, stage) in stages.into_iter().enumerate() {
            watch.progress(stage, done as u64, total);
            let mut table = empty(stage);
            if stage == "fig8" {
                figures::synthetic(&bench, &mut table)?;
            } else {
                let set = match dam.take() {
                    Some(set) => set,
                    None => bench.load("demo:dam", DAM, bench.scene())?,
                };
                bench.rows(&set, &mut table)?;
                dam = Some(set);
            }
            watch.progress(stage, done as u64 + 1, total);
            tables.push(table);
        }
        Ok(tables)
    })
}

/// The table of a stage, without rows.
fn empty(stage: &'static str) -> Table {
    let (title, columns): (_, &[&str]) = match stage {
        "table1" => ("edge of a tile, pixels", &["Splat", "Compress", "# Tiles"]),
        "table2" => (
            "six views; splatted: once for each tile; Σ: without extraction, which is done once for all views",
            &[
                "# Particles",
                "# Splatted",
                "Extraction",
                "Splat",
                "RLE",
                "Connect",
                "Filter",
                "Normals",
                "Translucent",
                "(Σ)",
                "Refract",
                "(Σ)",
            ],
        ),
        "memory" => (
            "view (a), k as in the scene; most at once: beyond input, without threads' own",
            &[
                "Input",
                "Cells",
                "Boundary",
                "Items",
                "Tiles",
                "Spans",
                "Links",
                "Surfaces",
                "Most at once",
            ],
        ),
        "skip" => (
            "refraction column by column, and with blocks of columns skipped",
            &["Rays", "Plain", "Columns", "Blocks", "Columns", "Speed-up"],
        ),
        "representation" => (
            "how columns are held",
            &["Layers", "Splat", "RLE", "Connect", "Filter", "Normals", "Spans"],
        ),
        "view" => (
            "a still scene from another view: with the boundary kept, and extracted anew",
            &["Extraction", "Translucent (Σ)", "Together"],
        ),
        _ => return figures::empty(stage),
    };
    Table::new(stage, title, columns)
}

/// Particles and what has to be drawn of them.
pub(super) struct Set {
    pub fluid: Fluid,
    pub extracted: Extracted,
    /// Milliseconds of extraction.
    pub ms: f64,
}

/// What all measurements share.
pub(super) struct Bench<'a> {
    pub options: &'a Tables,
    watch: &'a dyn Watch,
}

impl Bench<'_> {
    /// The scene of the tables: of the size asked for, otherwise as it comes.
    pub fn scene(&self) -> Scene {
        let mut scene = Scene::default();
        scene.set_sources(&["demo:".into()]);
        (scene.image.width, scene.image.height) = self.options.size;
        surface_defaults(&mut scene);
        scene
    }

    fn frames(&self) -> usize {
        self.options.frames.max(1)
    }

    /// Makes a set of `count` particles, scaled, and extracts its boundary.
    pub fn load(&self, kind: &str, count: f64, mut scene: Scene) -> Result<Set> {
        let count = (count * self.options.scale).round().max(1.0);
        let source = format!("{kind}:{count}");
        let tell = |done, total| _ = self.watch.progress("read", done, total);
        let particles: Arc<Particles> = crate::open(&source)?.frame(0, &Wanted::All, &tell)?;
        scene.set_sources(&[source]);
        let fluid = Fluid::new(particles, &scene)?;
        let (_, mut extracted) = fluid.extract(&scene)?;
        let mut times = Vec::new();
        for _ in 0..self.frames() {
            let (ms, again) = fluid.extract(&scene)?;
            times.push(ms);
            extracted = again;
        }
        Ok(Set { fluid, extracted, ms: median(times) })
    }

    /// Pictures of a set, each of a scene that `change` makes.
    pub fn measure<T>(
        &self,
        set: &Set,
        labels: &[(&'static str, T)],
        change: impl Fn(&T, &mut Scene) -> (Mode, &'static [Mode]),
    ) -> Result<Vec<Measured>> {
        let takes = labels.iter().map(|(label, what)| {
            let mut scene = self.scene();
            let modes = change(what, &mut scene);
            Take::new((*label, &set.fluid), scene, modes)
        });
        let takes = takes.collect::<Result<Vec<_>>>()?;
        measure((&set.fluid, &set.extracted), &takes, self.frames())
    }

    fn rows(&self, set: &Set, table: &mut Table) -> Result<()> {
        match table.stage {
            "table1" => self.tiles(set, table),
            "table2" => self.views(set, table),
            "memory" => self.memory(set, table),
            "skip" => self.skip(set, table),
            "representation" => self.representation(set, table),
            "view" => self.another_view(set, table),
            "fig6" => figures::angles(self, set, table),
            _ => figures::modes(self, set, table),
        }
    }

    /// Table 1.
    fn tiles(&self, set: &Set, table: &mut Table) -> Result<()> {
        let all = self.measure(set, &TILES, |tile, scene| {
            scene.surface.tile = *tile;
            (Mode::Front, &[])
        })?;
        for m in all {
            let cells = vec![m.cell("splat"), m.cell("compress"), Cell::Count(m.count("tiles"))];
            table.push((m.label, set.particles()), cells, m.hashes);
        }
        Ok(())
    }

    /// Table 2.
    fn views(&self, set: &Set, table: &mut Table) -> Result<()> {
        let single = VIEWS.iter().map(|view| (view.name, (view, 1)));
        let double = VIEWS[..2].iter().map(|view| (view.name_double, (view, 2)));
        let labels: Vec<_> = single.chain(double).collect();
        let all = self.measure(set, &labels, |(view, times), scene| {
            view.apply(scene);
            scene.image.width *= times;
            scene.image.height *= times;
            (Mode::Translucent, &[Mode::Refractive])
        })?;
        for m in all {
            let kept = set.extracted.boundary.counts.kept as u64;
            let mut cells =
                vec![Cell::Count(kept), Cell::Count(m.count("items")), Cell::Ms(set.ms)];
            cells.extend(["splat", "compress", "connect", "filter", "normals"].map(|s| m.cell(s)));
            for mode in ["translucent", "refractive"] {
                cells.extend([m.cell(mode), Cell::Ms(m.sum(mode))]);
            }
            table.push((m.label, set.particles()), cells, m.hashes);
        }
        Ok(())
    }

    /// §5.2.
    fn memory(&self, set: &Set, table: &mut Table) -> Result<()> {
        for m in self.measure(set, &[("(a)", ())], |(), _| (Mode::Translucent, &[]))? {
            let names = ["cells", "boundary", "items", "tiles", "spans", "links", "surfaces"];
            let bytes = names.map(|name| m.bytes(name));
            let [cells, boundary, items, tiles, spans, links, surfaces] = bytes;
            // In extraction; in splatting; in putting together; in all that follows.
            let most = boundary
                + cells.max(items + tiles).max(tiles + spans).max(spans + links + surfaces);
            let all = [&[set.fluid.particles.bytes()], &bytes[..], &[most]].concat();
            let cells = all.into_iter().map(Cell::Bytes).collect();
            table.push((m.label, set.particles()), cells, m.hashes);
        }
        Ok(())
    }

    /// Refraction with blocks and without, of the whole and amid the spray.
    fn skip(&self, set: &Set, table: &mut Table) -> Result<()> {
        for view in [&VIEWS[0], &VIEWS[3]] {
            let ways = [(view.name, false), (view.name, true)];
            let all = self.measure(set, &ways, |skip, scene| {
                view.apply(scene);
                scene.surface.skip = *skip;
                (Mode::Refractive, &[])
            })?;
            let mut cells = vec![Cell::Count(all[0].count("rays"))];
            for m in &all {
                cells.extend([m.cell("refractive"), Cell::Count(m.count("columns"))]);
            }
            cells.push(Cell::Factor(all[0].ms("refractive") / all[1].ms("refractive")));
            let hashes = all.into_iter().flat_map(|m| m.hashes);
            table.push((view.name, set.particles()), cells, hashes);
        }
        Ok(())
    }

    fn representation(&self, set: &Set, table: &mut Table) -> Result<()> {
        let ways = [
            ("intervals", surface::Representation::Intervals),
            ("bits", surface::Representation::Bits),
        ];
        let all = self.measure(set, &ways, |way, scene| {
            scene.surface.representation = *way;
            (Mode::Translucent, &[])
        })?;
        for m in all {
            let mut cells = vec![Cell::Count(m.count("layers"))];
            cells.extend(["splat", "compress", "connect", "filter", "normals"].map(|s| m.cell(s)));
            cells.push(Cell::Count(m.count("spans")));
            table.push((m.label, set.particles()), cells, m.hashes);
        }
        Ok(())
    }

    fn another_view(&self, set: &Set, table: &mut Table) -> Result<()> {
        let other = |scene: &mut Scene| {
            VIEWS[1].apply(scene);
            (Mode::Translucent, &[][..])
        };
        let first = self.measure(set, &[("(a)", ())], |(), _| (Mode::Translucent, &[]))?;
        let kept = self.measure(set, &[("(b), kept", ())], |(), scene| other(scene))?;
        let (ms, extracted) = set.fluid.extract(&self.scene())?;
        let take = |label| {
            let mut scene = self.scene();
            let modes = other(&mut scene);
            Take::new((label, &set.fluid), scene, modes)
        };
        let anew = measure((&set.fluid, &extracted), &[take("(b), anew")?], self.frames())?;
        let extractions = [set.ms, 0.0, ms];
        for (m, extraction) in first.iter().chain(&kept).chain(&anew).zip(extractions) {
            let sum = m.sum("translucent");
            let cells = vec![Cell::Ms(extraction), Cell::Ms(sum), Cell::Ms(extraction + sum)];
            table.push((m.label, set.particles()), cells, m.hashes.clone());
        }
        Ok(())
    }
}

impl Set {
    /// How many particles it has.
    pub fn particles(&self) -> usize {
        self.fluid.particles.len()
    }
}
