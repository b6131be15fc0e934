//! Sets with more surfaces along a ray than a renderer may store (Zirr & Dachsbacher 2015, Fig. 8,
//! §5.4: "24 layers of particles", "a 3D checkerboard pattern"; the paper gives no more than that).
//!
//! The free choices: the layers are single sheets of spheres across x, the main direction of the
//! default view; the checkerboard has 8 blocks along each edge. Radii close every sheet and block
//! without a hole where there are particles enough (about 10⁵), and never close the gaps between.

use rayon::prelude::*;

use super::maths::cube_root;

const LAYERS: usize = 24;
/// Blocks along an edge of the checkerboard, and how many of them are full.
const BLOCKS: usize = 8;
const FULL_BLOCKS: usize = BLOCKS * BLOCKS * BLOCKS / 2;

/// Radius in spacings: more than √2/2 covers a square lattice, more than √3/2 a cubic one.
const COVERS_SQUARE: f64 = 0.75;
const COVERS_CUBE: f64 = 0.87;

/// 24 sheets.
pub(super) fn layers(count: usize) -> (Vec<[f32; 3]>, f32) {
    let sheet = |i: usize| {
        let x = middle(i, LAYERS);
        square(share(count, LAYERS, i)).map(move |[y, z]| [x, y, z].map(|v| v as f32))
    };
    let points = (0..LAYERS).into_par_iter().flat_map_iter(sheet).collect();
    let spacing = 1.0 / (count as f64 / LAYERS as f64).sqrt();
    (points, (COVERS_SQUARE * spacing).min(0.3 / LAYERS as f64) as f32)
}

/// 256 full blocks and as many empty ones.
pub(super) fn checker(count: usize) -> (Vec<[f32; 3]>, f32) {
    let edge = 1.0 / BLOCKS as f64;
    let block = |i: usize| {
        let (y, z) = (i / (BLOCKS / 2) % BLOCKS, i / (BLOCKS * BLOCKS / 2));
        let corner = [2 * (i % (BLOCKS / 2)) + (y + z) % 2, y, z].map(|v| v as f64 * edge);
        cube(share(count, FULL_BLOCKS, i))
            .map(move |p| std::array::from_fn(|axis| (corner[axis] + edge * p[axis]) as f32))
    };
    let points = (0..FULL_BLOCKS).into_par_iter().flat_map_iter(block).collect();
    let spacing = edge / cube_root(count as f64 / FULL_BLOCKS as f64);
    (points, (COVERS_CUBE * spacing).min(0.25 * edge) as f32)
}

/// `count` points spread over the unit cube in even slabs.
fn cube(count: usize) -> impl Iterator<Item = [f64; 3]> {
    let slabs = (cube_root(count.max(1) as f64).round() as usize).max(1);
    (0..slabs).flat_map(move |i| {
        let z = middle(i, slabs);
        square(share(count, slabs, i)).map(move |[x, y]| [x, y, z])
    })
}

/// `count` points spread over the unit square in even rows.
fn square(count: usize) -> impl Iterator<Item = [f64; 2]> {
    let rows = ((count as f64).sqrt().round() as usize).max(1);
    (0..rows).flat_map(move |i| {
        let here = share(count, rows, i);
        (0..here).map(move |j| [middle(i, rows), middle(j, here)])
    })
}

/// The `i`-th of `parts` nearly equal shares of `count`.
fn share(count: usize, parts: usize, i: usize) -> usize {
    let before = |i: usize| (count as u128 * i as u128 / parts as u128) as usize;
    before(i + 1) - before(i)
}

/// The middle of the `i`-th of `parts` equal pieces of 0 … 1.
fn middle(i: usize, parts: usize) -> f64 {
    (i as f64 + 0.5) / parts as f64
}
