//! Measurements of the simulation by itself: what masks cost, and whether it stays bounded.

use motes_scene::Solver;
use motes_sph::Simulation;

use super::density::{scaled, scene, simulation};
use super::table::{Cell, Table};
use super::{Tables, hash, median, timed};
use crate::{Error, Result, Watch};

/// Particles of [`mask`], and of [`endure`].
const MASKED: [(&str, f64); 2] = [("27,000", 27e3), ("1,000,000", 1e6)];
const ENDURING: f64 = 1e5;
/// How long that is, simulated seconds.
const SECS: f64 = 10.0;

/// Neighbours and densities, with and without masks, in turns.
pub(super) fn mask(options: &Tables) -> Result<Table> {
    let title = "neighbours and densities, without masks and with them; a step of wcsph";
    let columns = ["Density", "Density, mask", "Factor", "Step"];
    let mut table = Table::new("mask", title, &columns);
    let scene = scene(options, 64);
    for (name, count) in MASKED {
        let source = format!("sim:dam-break?particles={}", scaled(count, options));
        let mut liquid = simulation(&source, &scene, 3)?;
        let mut times = [vec![], vec![], vec![]];
        for _ in 0..options.frames.max(1) {
            times[0].push(timed(|| liquid.find_densities()).0);
            times[1].push(timed(|| liquid.find_masks()).0);
            let secs = liquid.longest_step();
            let (ms, done) = timed(|| liquid.step(secs));
            done.map_err(Error::Usage)?;
            times[2].push(ms);
        }
        let [plain, masked, step] = times.map(median);
        let cells =
            vec![Cell::Ms(plain), Cell::Ms(masked), Cell::Factor(masked / plain), Cell::Ms(step)];
        table.push((name, liquid.stats().particles), cells, [hash_of(&liquid)]);
    }
    Ok(table)
}

/// Ten seconds of a liquid that two columns fall into, by both solvers.
pub(super) fn endure(options: &Tables, watch: &dyn Watch) -> Result<Table> {
    let title = "ten simulated seconds: the greatest speed (m/s), mean compression, and energy over \
                 that of the start";
    let columns = ["Time", "Steps", "Speed", "Compression", "Energy", "Put back"];
    let mut table = Table::new("endure", title, &columns);
    let source = format!("sim:double-dam-break?particles={}", scaled(ENDURING, options));
    for (name, solver) in [("dfsph", Solver::Dfsph), ("wcsph", Solver::Wcsph)] {
        let mut scene = scene(options, 64);
        scene.sph.solver = solver;
        let mut liquid = simulation(&source, &scene, 0)?;
        let start = liquid.energy();
        let total = (SECS * 1e3) as u64;
        let mut go_on = |s: &motes_sph::Stats| watch.progress(name, (s.time * 1e3) as u64, total);
        let (ms, most) = timed(|| liquid.endure(SECS, &mut go_on));
        let most = most.map_err(Error::Usage)?;
        let stats = liquid.stats();
        let cells = vec![
            Cell::Ms(ms),
            Cell::Count(stats.steps),
            Cell::Factor(most.speed),
            Cell::Percent(100.0 * most.compression),
            Cell::Percent(100.0 * (most.energy / start - 1.0)),
            Cell::Count(stats.put_back),
        ];
        table.push((name, stats.particles), cells, [hash_of(&liquid)]);
    }
    Ok(table)
}

/// Where the particles are.
fn hash_of(liquid: &Simulation) -> String {
    let mut positions = Vec::new();
    liquid.positions(&mut positions);
    let words: Vec<u32> = positions.iter().flatten().map(|v| v.to_bits()).collect();
    hash((positions.len() as u32, 3), &words)
}
