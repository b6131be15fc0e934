//! One source: boundary extraction, the first image, steady frames and their stages.

use std::collections::BTreeMap;

use motes_scene::{Resolved, surface};
use motes_surface::Mode;

use super::fluid::{Drawn, Extracted, Fluid};
use crate::bench::source::{Line, Source, poses, read};
use crate::bench::{chosen, median, pool};
use crate::drawing::instruction_set;
use crate::{Result, Watch, peak_memory_bytes};

/// The stages: boundary extraction, warm; cold extraction and the first frame; frames of a turning camera,
/// and what each stage of these takes.
pub const SOURCE_STAGES: [&str; 10] = [
    "build",
    "first_image",
    "frame",
    "splat",
    "compress",
    "connect",
    "filter",
    "normals",
    "translucent",
    "refractive",
];

/// Measures one source as a liquid. Its picture is in the mode of the scene; `translucent` and `refractive`
/// are shaded in either case.
///
/// # Errors
/// The source cannot be read, the scene makes no sense, or a stage is not there.
pub fn surface_source(options: Source, watch: &dyn Watch) -> Result<Line> {
    let stages = chosen(&options.stages, &SOURCE_STAGES)?;
    let pool = pool(options.threads)?;
    pool.install(|| measure(options, &stages, watch))
}

fn measure(options: Source, stages: &[&'static str], watch: &dyn Watch) -> Result<Line> {
    let Source { scene, frames, .. } = options;
    let (frames, total) = (frames.max(1), 3);
    let particles = read(&scene, watch)?;
    let fluid = Fluid::new(particles, &scene)?;
    let poses = poses(&scene, fluid.framing(), frames)?;
    let mode = mode(scene.surface.mode);
    let others: Vec<Mode> = [Mode::Translucent, Mode::Refractive]
        .into_iter()
        .filter(|other| *other != mode && stages.contains(&name(*other)))
        .collect();
    let draw = |extracted: &Extracted, pose: &Resolved| {
        fluid.draw(extracted, (&scene, pose), (mode, &others))
    };

    watch.progress("first_image", 0, total);
    // The first of this process: nothing is warm yet.
    let (first_build, extracted) = fluid.extract(&scene)?;
    let first = draw(&extracted, &poses[0])?;
    let mut line = line(&scene.system[0].source, &fluid, (&extracted, &first));
    let hashes = first.hashes.iter().skip(1).cloned();
    line.hashes = others.iter().map(|mode| name(*mode)).zip(hashes).collect();
    let first_frame = first.stats.ms.get("frame").copied().unwrap_or(f64::NAN);
    drop(first);

    watch.progress("build", 1, total);
    let mut builds = Vec::new();
    for _ in 0..if stages.contains(&"build") { frames } else { 0 } {
        builds.push(fluid.extract(&scene)?.0);
    }
    watch.progress("frame", 2, total);
    let mut times = BTreeMap::<&'static str, Vec<f64>>::new();
    for pose in poses.iter().skip(1) {
        for (stage, ms) in draw(&extracted, pose)?.stats.ms {
            times.entry(stage).or_default().push(ms);
        }
    }
    for stage in stages {
        let ms = match *stage {
            "first_image" => first_build + first_frame,
            "build" => median(std::mem::take(&mut builds)),
            stage => median(times.remove(stage).unwrap_or_default()),
        };
        line.ms.insert(stage, ms);
    }
    line.bytes.extend(peak_memory_bytes().map(|bytes| ("peak", bytes)));
    Ok(line)
}

/// The scene's mode.
fn mode(mode: surface::Mode) -> Mode {
    match mode {
        surface::Mode::Front => Mode::Front,
        surface::Mode::Translucent => Mode::Translucent,
        surface::Mode::Refractive => Mode::Refractive,
    }
}

fn name(mode: Mode) -> &'static str {
    match mode {
        Mode::Front => "front",
        Mode::Translucent => "translucent",
        Mode::Refractive => "refractive",
    }
}

/// The line without times.
fn line(source: &str, fluid: &Fluid, (extracted, first): (&Extracted, &Drawn)) -> Line {
    let found = extracted.boundary.counts;
    let mut counts = first.stats.counts.clone();
    let more = [("kept", found.kept), ("cells", found.cells), ("inner", found.inner)];
    counts.extend(more.map(|(name, count)| (name, count as u64)));
    let surfaces = &first.surfaces;
    let seen = (0..surfaces.view.pixels()).map(|p| u64::from(surfaces.count(p))).sum();
    counts.insert("true_spans", seen);
    let stored = first.stats.bytes.iter().map(|(name, bytes)| (*name, *bytes as u64));
    let mut bytes: BTreeMap<_, _> = stored.collect();
    bytes.insert("input", fluid.particles.bytes() as u64);
    Line {
        method: "surface",
        source: source.into(),
        particles: found.particles,
        threads: rayon::current_num_threads(),
        simd: instruction_set(fearless_simd::Level::new()),
        primary: None,
        hash: first.hashes.first().cloned().unwrap_or_default(),
        hashes: BTreeMap::new(),
        ms: BTreeMap::new(),
        bytes,
        counts,
    }
}
