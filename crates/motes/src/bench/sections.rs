//! Sections: frames with planes through a set, and what it takes to add, move and undo one (Chaudhari, §5).
//!
//! The planes: one through the middle, across the first view, that opens the set to it; seven more about it, each
//! of which takes a piece. Pictures have one ray per pixel and no secondary rays. What eight planes by centre
//! leave is compared with the same particles alone, in turns.

use std::collections::BTreeMap;

use fearless_simd::Level;
use glam::DVec3;
use motes_grid::{
    Clause, Clip, Cut, Face, Params, Plane, Radii, RadiusClasses, Resolution, Sections, Visibility,
    Width,
};
use motes_scene::{Bounds, Framing, Resolved, Scene};
use motes_spheres::Spheres;

use super::cues::{self, cued};
use super::shot::{Shot, Studio, White};
use super::source::{Line, Source, poses, read};
use super::table::{Cell, Table};
use super::{Tables, chosen, median, pool, timed};
use crate::drawing::instruction_set;
use crate::system::{Filtered, visibility};
use crate::{Error, Result, Watch, radius};

/// The stages: frames with up to 8 planes; adding, moving, undoing one of them; the same by the width of a
/// block's counter (§3.3); whole frames with cues (§4, Fig. 8).
pub const STAGES: [&str; 4] = ["frame", "change", "width", "cues"];

/// Sets like those of the paper: molecules (overlapping spheres), moving particles, and larger ones. Name, demo
/// set, particles, factor on radii.
const SETS: [(&str, &str, f64, f64); 6] = [
    ("10,000 atoms", "packed", 10_000.0, 1.4),
    ("28,000 atoms", "packed", 28_000.0, 1.4),
    ("40,000 atoms", "packed", 40_000.0, 1.4),
    ("6,000 moving", "dam", 6_000.0, 1.0),
    ("10^6 spheres", "dam", 1e6, 1.0),
    ("10^7 spheres", "packed", 1e7, 1.0),
];

/// Pictures: what their times are called, how many planes, how they cut.
const PICTURES: [(&str, usize, Cut); 9] = [
    ("frame", 0, Cut::Center),
    ("centre1", 1, Cut::Center),
    ("centre2", 2, Cut::Center),
    ("centre4", 4, Cut::Center),
    ("centre8", 8, Cut::Center),
    ("caps1", 1, Cut::Caps),
    ("caps2", 2, Cut::Caps),
    ("caps4", 4, Cut::Caps),
    ("caps8", 8, Cut::Caps),
];

/// Planes of the fullest picture, and of those with cues.
const PLANES: usize = 8;
const CUED_PLANES: usize = 4;
/// Where the planes but the first stand, and how far one moves, in half diagonals.
const ASIDE: f64 = 0.45;
const MOVE: f64 = 0.01;

/// Measures one source.
///
/// # Errors
/// The source cannot be read, the scene makes no sense, or a stage is not there.
pub fn sections_source(options: Source, watch: &dyn Watch) -> Result<Line> {
    let stages = chosen(&options.stages, &STAGES)?;
    pool(options.threads)?.install(|| {
        let body = Body::open(&options.scene, options.frames, watch)?;
        let mut line = body.line(options.scene.system[0].source.clone());
        for stage in stages {
            watch.progress(stage, 0, 1);
            let found = body.measure(stage)?;
            line.hashes.extend(found.hashes);
            line.ms.extend(found.ms);
            line.bytes.extend(found.bytes);
        }
        line.hash = line.hashes.get("frame").cloned().unwrap_or_default();
        Ok(line)
    })
}

/// Measures the sets.
///
/// # Errors
/// A stage is not there.
pub fn sections_tables(options: &Tables, watch: &dyn Watch) -> Result<Vec<Table>> {
    let stages = chosen(&options.stages, &STAGES)?;
    let mut tables: Vec<Table> = stages.iter().map(|stage| table(stage)).collect();
    pool(options.threads)?.install(|| {
        for (done, (name, kind, count, scale)) in SETS.into_iter().enumerate() {
            watch.progress("sets", done as u64, SETS.len() as u64);
            let mut scene = Scene::default();
            let count = (count * options.scale).round().max(1.0);
            scene.set_sources(&[format!("demo:{kind}:{count}")]);
            scene.system[0].radius_scale = scale;
            (scene.image.width, scene.image.height) = options.size;
            let body = Body::open(&scene, options.frames, watch)?;
            for table in &mut tables {
                let found = body.measure(table.stage)?;
                let cells = table.columns.iter().map(|column| found.cell(column)).collect();
                table.push((name, body.classes.len()), cells, found.hashes.into_values());
            }
        }
        Ok(tables)
    })
}

fn table(stage: &'static str) -> Table {
    let frames = PICTURES.map(|(name, ..)| name);
    let (title, columns) = match stage {
        "frame" => ("Frames with planes", [&frames[..], &["cropped", "live8"]].concat()),
        "change" => ("A plane more, elsewhere, less", vec!["add", "move", "undo"]),
        "cues" => ("Whole frames with four planes and cues", cues::PICTURES.map(|p| p.0).to_vec()),
        _ => (
            "Bits of a block's counter",
            vec!["undo1", "undo4", "undo8", "counters1", "counters4", "counters8"],
        ),
    };
    Table::new(stage, title, &columns)
}

/// What a stage gave.
#[derive(Default)]
pub(super) struct Found {
    pub ms: BTreeMap<&'static str, f64>,
    pub bytes: BTreeMap<&'static str, u64>,
    pub hashes: BTreeMap<&'static str, String>,
}

impl Found {
    fn cell(&self, column: &str) -> Cell {
        match (self.ms.get(column), self.bytes.get(column)) {
            (Some(ms), _) if self.hashes.contains_key(column) => Cell::Frame(*ms),
            (Some(ms), _) => Cell::Ms(*ms),
            (_, Some(bytes)) => Cell::Bytes(*bytes as usize),
            _ => Cell::Missing,
        }
    }
}

/// A set, what is visible of it, and how it is seen.
struct Body {
    scene: Scene,
    classes: RadiusClasses,
    base: Vec<Visibility>,
    origin: DVec3,
    bounds: Bounds,
    poses: Vec<Resolved>,
    frames: usize,
    studio: Studio,
    packet: u32,
}

impl Body {
    fn open(scene: &Scene, frames: usize, watch: &dyn Watch) -> Result<Self> {
        let particles = read(scene, watch)?;
        let system = &scene.system[0];
        let params = Params {
            resolution: Resolution::CellsPerParticle(scene.spheres.lambda as f32),
            block_cells: scene.spheres.block,
        };
        let rule = radius::rule(&particles, system, radius::Spacing::Nearest);
        let positions = particles.positions[..].into();
        let scale = system.radius_scale as f32;
        let spare = RadiusClasses::default();
        let classes = radius::classes(spare, positions, rule, scale, params);
        let filtered = Filtered::of(&particles, &classes, system)?;
        let base = visibility((&particles, &filtered), &classes, system, None)?;
        let origin = DVec3::from_array(particles.origin);
        let around = |grid: &motes_grid::Grid| {
            let (low, high) = (grid.low - grid.greatest_radius, grid.high + grid.greatest_radius);
            Bounds::new(low.as_dvec3() + origin, high.as_dvec3() + origin)
        };
        let bounds = classes.grids.iter().map(around).reduce(Bounds::union);
        let bounds = bounds.ok_or_else(|| Error::Usage("there is nothing to cut".into()))?;
        let poses = poses(scene, Framing::new(&[bounds], 0.0), frames)?;
        let studio = Studio::new((scene.image.width, scene.image.height));
        let packet = scene.spheres.packet;
        let scene = scene.clone();
        Ok(Self {
            scene,
            classes,
            base,
            origin,
            bounds,
            poses,
            frames: frames.max(1),
            studio,
            packet,
        })
    }

    fn line(&self, source: String) -> Line {
        Line {
            method: "sections",
            source,
            particles: self.classes.len(),
            threads: rayon::current_num_threads(),
            simd: instruction_set(Level::new()),
            primary: Some("project"),
            hash: String::new(),
            hashes: BTreeMap::new(),
            ms: BTreeMap::new(),
            bytes: BTreeMap::new(),
            counts: BTreeMap::new(),
        }
    }

    fn measure(&self, stage: &str) -> Result<Found> {
        Ok(match stage {
            "frame" => self.pictures(),
            "change" => self.changes(),
            "cues" => {
                let clip = self.clip(CUED_PLANES, Cut::Caps, 0.0);
                let planes: Vec<Plane> = clip.faces().map(|face| face.plane).collect();
                cued(&self.scene, (&planes, self.origin), &self.poses)?
            }
            _ => self.widths(),
        })
    }

    /// The first `count` planes, the first of them moved by `shift` half diagonals.
    fn clip(&self, count: usize, cut: Cut, shift: f64) -> Clip {
        let half = 0.5 * self.bounds.diagonal();
        let middle = self.bounds.center() - self.origin;
        let forward = self.poses[0].view.forward;
        let plane = |i: usize| {
            // Directions spread evenly over the sphere.
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / PLANES as f64;
            let (sin, cos) = (i as f64 * 2.399_963).sin_cos();
            let aside = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            let (normal, at) = if i == 0 { (forward, shift) } else { (aside, -ASIDE) };
            Plane::new(middle + normal * (at * half), normal)
        };
        let face = |i: usize| Some(Face { plane: plane(i)?, cut, owner: i as u16 });
        let clause = |face| Clause { faces: vec![face] };
        Clip { clauses: (0..count).filter_map(face).map(clause).collect() }
    }

    fn cut(&self, width: Width, clip: Clip) -> Sections {
        let mut sections = Sections::new(&self.classes.grids, self.base.clone(), width);
        sections.set(&self.classes.grids, clip);
        sections
    }

    fn draw(&self, spheres: Spheres<'_>, pose: &Resolved) {
        let mut lights = pose.lights;
        (lights.key.shadow_rays, lights.occlusion_rays) = (0, 0);
        lights.key.cos_half_angle = 1.0;
        self.studio.draw(Shot {
            rays: &pose.view.rays(self.origin),
            spheres,
            paint: &White,
            lights: &lights,
            samples: 1,
            primary: motes_scene::Primary::Project,
            packet: self.packet,
        });
    }

    /// Frames with planes, and what eight by centre leave against the same particles alone.
    fn pictures(&self) -> Found {
        let mut found = Found::default();
        for (name, planes, cut) in PICTURES {
            let sections = self.cut(Width::default(), self.clip(planes, cut, 0.0));
            let exact = sections.clip().exact();
            let clip = (!exact.is_empty()).then_some(&exact);
            let spheres = Spheres { clip, ..Spheres::new(&self.classes, sections.visible()) };
            self.draw(spheres, &self.poses[0]);
            found.hashes.insert(name, self.studio.hash());
            let poses = self.poses.iter().skip(1);
            let times = poses.map(|pose| timed(|| self.draw(spheres, pose)).0);
            found.ms.insert(name, median(times.collect()));
        }
        self.cropped(&mut found);
        self.live(&mut found);
        found
    }

    /// The particles that are visible, and their radii.
    fn remaining(&self, sections: &Sections) -> (Vec<[f32; 3]>, Vec<f32>) {
        let (mut positions, mut radii) = (Vec::new(), Vec::new());
        for (grid, visible) in self.classes.grids.iter().zip(sections.visible()) {
            for block in 0..grid.blocks.len() - 1 {
                let seen = visible.block(grid, block);
                let shown = grid.particles_of(block).enumerate().filter(|(i, _)| seen.shows(*i));
                for (_, slot) in shown {
                    positions.push(grid.center(slot).to_array());
                    radii.push(grid.radius_at(slot));
                }
            }
        }
        (positions, radii)
    }

    fn cropped(&self, found: &mut Found) {
        let sections = self.cut(Width::default(), self.clip(PLANES, Cut::Center, 0.0));
        let (positions, radii) = self.remaining(&sections);
        let equal = radii.iter().all(|r| *r == radii[0]).then(|| radii.first().copied()).flatten();
        let radii = equal.map_or(Radii::Each(&radii[..]), Radii::Uniform);
        let alone = RadiusClasses::build(&positions[..], radii, Params::default());
        let all: Vec<_> = alone.grids.iter().map(Visibility::all).collect();
        let ways = [Spheres::new(&self.classes, sections.visible()), Spheres::new(&alone, &all)];
        for spheres in ways {
            self.draw(spheres, &self.poses[0]);
        }
        found.hashes.insert("cropped", self.studio.hash());
        let mut times = [Vec::new(), Vec::new()];
        for pose in self.poses.iter().skip(1) {
            for (times, spheres) in times.iter_mut().zip(ways) {
                times.push(timed(|| self.draw(spheres, pose)).0);
            }
        }
        // Both of the same run, so that their ratio holds.
        let [cut, alone] = times.map(median);
        found.ms.insert("centre8", cut);
        found.ms.insert("cropped", alone);
    }

    /// Frames of a set that moves, with eight planes: its grids, what is visible of them, and the picture.
    fn live(&self, found: &mut Found) {
        let whole = Sections::new(&self.classes.grids, self.base.clone(), Width::One);
        let (positions, radii) = self.remaining(&whole);
        let clip = self.clip(PLANES, Cut::Caps, 0.0);
        let mut classes = RadiusClasses::default();
        let mut times = Vec::new();
        for (frame, pose) in self.poses.iter().enumerate() {
            let (ms, built) = timed(|| {
                let spare = std::mem::take(&mut classes);
                let built = spare.rebuild(&positions[..], Radii::Each(&radii), Params::default());
                let base = built.grids.iter().map(Visibility::all).collect();
                let mut sections = Sections::new(&built.grids, base, Width::default());
                sections.set(&built.grids, clip.clone());
                let spheres = Spheres::new(&built, sections.visible());
                self.draw(Spheres { clip: Some(&clip), ..spheres }, pose);
                built
            });
            classes = built;
            // The first fills memory that the others use again.
            if frame > 0 {
                times.push(ms);
            } else {
                found.hashes.insert("live8", self.studio.hash());
            }
        }
        found.ms.insert("live8", median(times));
    }

    /// One plane more beside seven others, moved, and taken back: the first of them, not the last.
    fn changes(&self) -> Found {
        let mut found = Found::default();
        let grids = &self.classes.grids;
        let full = self.clip(PLANES, Cut::Caps, 0.0);
        let less = Clip { clauses: full.clauses[1..].to_vec() };
        let moved = self.clip(PLANES, Cut::Caps, MOVE);
        let mut sections = self.cut(Width::default(), less.clone());
        let steps = [("add", full), ("move", moved), ("undo", less)];
        let mut times: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
        for _ in 0..=self.frames {
            for (name, clip) in &steps {
                let clip = clip.clone();
                times.entry(name).or_default().push(timed(|| sections.set(grids, clip)).0);
            }
        }
        found.ms.extend(times.into_iter().map(|(name, times)| (name, median(times))));
        found.bytes.insert("visibility", sections.bytes() as u64);
        found
    }

    /// Taking back one of eight planes by how wide the counters are.
    fn widths(&self) -> Found {
        let mut found = Found::default();
        let grids = &self.classes.grids;
        let full = self.clip(PLANES, Cut::Caps, 0.0);
        let less = Clip { clauses: full.clauses[1..].to_vec() };
        let widths = [
            (Width::One, "undo1", "counters1"),
            (Width::Four, "undo4", "counters4"),
            (Width::Eight, "undo8", "counters8"),
        ];
        let mut all = widths.map(|(width, ..)| (self.cut(width, full.clone()), Vec::new()));
        for _ in 0..=self.frames {
            for (sections, times) in &mut all {
                times.push(timed(|| sections.set(grids, less.clone())).0);
                sections.set(grids, full.clone());
            }
        }
        for ((sections, times), (_, undo, counters)) in all.into_iter().zip(widths) {
            found.ms.insert(undo, median(times));
            found.bytes.insert(counters, sections.counter_bytes() as u64);
        }
        found
    }
}
