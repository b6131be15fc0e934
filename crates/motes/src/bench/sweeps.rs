//! What the paper tells in passing: λ and M (Gribble et al. 2007, §5, "Impact of Grid and Packet
//! Resolution"), construction and references per particle ("Impact of the Sphere-Center Method").

use super::draw::Way;
use super::paper::{Bench, Scenery};
use super::sets::{BLOCK, Built, LAMBDA, params};
use super::standard_grid::{Insert, Params, StandardGrid};
use super::table::{Cell, Table};

/// "several values in the range [0.2, 5]".
const LAMBDAS: [f32; 6] = [0.2, 0.5, 1.0, 2.0, 3.0, 5.0];
/// Cells along a macrocell's edge.
const BLOCKS: [u32; 6] = [2, 4, 6, 8, 12, 16];
/// The paper's packets (§5).
const PACKET: u32 = 8;

/// The table of a stage, without rows.
pub(super) fn empty(stage: &'static str) -> Table {
    match stage {
        "lambda" => {
            let columns = LAMBDAS.map(|lambda| lambda.to_string());
            let columns = columns.each_ref().map(String::as_str);
            Table::new(stage, "cells per particle, all threads, frames/s", &columns)
        }
        "block" => {
            let columns = BLOCKS.map(|m| m.to_string());
            let columns = columns.each_ref().map(String::as_str);
            Table::new(stage, "cells along a macrocell's edge, all threads, frames/s", &columns)
        }
        _ => Table::new(
            stage,
            "construction: standard grid, the same by centers, Motes; one thread but for the last",
            &[
                "Refs/particle",
                "Standard",
                "insertion",
                "Centers",
                "insertion",
                "Motes",
                "Motes, all threads",
                "Standard structure",
                "Motes structure",
            ],
        ),
    }
}

/// A row of the stage's table.
pub(super) fn row(bench: &Bench, scenery: &Scenery<'_>, table: &mut Table) {
    match table.stage {
        "lambda" => sweep(bench, scenery, &LAMBDAS.map(|lambda| params(lambda, BLOCK)), table),
        "block" => sweep(bench, scenery, &BLOCKS.map(|m| params(LAMBDA, m)), table),
        _ => construction(bench, scenery, table),
    }
}

/// One grid at a time, as many may not fit into memory.
fn sweep(bench: &Bench, scenery: &Scenery<'_>, grids: &[motes_grid::Params], table: &mut Table) {
    let loaded = scenery.loaded;
    let mut all = Vec::new();
    for params in grids {
        let built = bench.all.install(|| Built::new(&loaded.positions, loaded.radius, *params));
        let way = bench.sphere_center(built.spheres());
        let shot = bench.shot(scenery.rays, PACKET);
        all.extend(bench.measure(&bench.all, &[(shot, &way as &dyn Way)]));
    }
    let cells = all.iter().map(|(ms, _)| Cell::Frame(*ms)).collect();
    table.push(loaded.label(), cells, bench.hashes(&all));
}

fn construction(bench: &Bench, scenery: &Scenery<'_>, table: &mut Table) {
    let loaded = scenery.loaded;
    let (positions, radius) = (&loaded.positions, loaded.radius);
    let standard = |insert| {
        let lambda = f64::from(LAMBDA);
        StandardGrid::build(positions, radius, Params { insert, lambda, block: BLOCK as usize })
    };
    let motes = |pool: &rayon::ThreadPool| {
        // The first touches fresh memory.
        let build = || Built::new(positions, radius, params(LAMBDA, BLOCK));
        let times = (0..=bench.frames).map(|_| pool.install(build).ms).skip(1);
        super::median(times.collect())
    };
    let (grid, overlapped) = standard(Insert::Overlapped);
    let references = grid.references.len() as f64 / positions.len().max(1) as f64;
    let bytes = grid.structure_bytes();
    drop(grid);
    let (_, centers) = standard(Insert::Center);
    let cells = vec![
        Cell::Factor(references),
        Cell::Ms(overlapped.all),
        Cell::Ms(overlapped.insertion),
        Cell::Ms(centers.all),
        Cell::Ms(centers.insertion),
        Cell::Ms(motes(&bench.one)),
        Cell::Ms(motes(&bench.all)),
        Cell::Bytes(bytes),
        Cell::Bytes(scenery.built.structure_bytes()),
    ];
    table.push(loaded.label(), cells, []);
}
