//! Sets that are built like the simulations of Gribble et al. 2007, Table 1: solids of touching
//! particles with what breaks out of them, and a value per particle to choose by.
//!
//! | set | particles | value |
//! |---|---|---|
//! | `cylinder` | a cylinder that bulges and buckles under a load | 0–1, highest where it bulges |
//! | `jp8` | a can, fuel in it, drops above the fuel | below 1 the can, above the fuel, 2 and more the drops |
//! | `bullet` | half a block with a bullet in its channel, splinters behind | below 1 the block, 1–2 the bullet, 2–3 splinters |
//! | `thunder` | a can burst into pieces (43 %), and gas | below 1 the pieces, above the gas, by distance |
//! | `foam` | walls of cells | 0–1 from cell to cell |
//! | `torso` | a body with ribs, spine, organs, lungs and a channel through it | below 1 flesh, 1–2 organs, 2–3 bone |

use std::f64::consts::TAU;

use super::lattice::{Lattice, least};
use super::maths::{bits, cosine, cube_root, exponential, normal, sine, uniform};

/// Positions in the unit cube, one radius, a value each.
pub(super) struct Simulation {
    pub positions: Vec<[f32; 3]>,
    pub radius: f32,
    pub values: Vec<f32>,
}

/// A point, in the arithmetic shapes are made of.
type P = [f64; 3];

const WHOLE: P = [1.0; 3];
const HALF: f64 = 0.5;

pub(super) fn cylinder(count: usize) -> Simulation {
    let bulge = |z: f64| 4.0 * (z - 0.1) * (0.9 - z) / 0.64;
    let surface = |z: f64| 0.24 + 0.1 * bulge(z) + 0.012 * sine(40.0 * z);
    let shape = |p: P| (across(p) - surface(p[2])).max(0.1 - p[2]).max(p[2] - 0.9);
    let (positions, radius) = solid(count, WHOLE, 1, &shape);
    let value = |p: P| 0.9 * bulge(p[2]).clamp(0.0, 1.0) + 0.1 * across(p) / 0.35;
    Simulation { values: valued(&positions, value), positions, radius }
}

pub(super) fn jp8(count: usize) -> Simulation {
    const WALL: f64 = 0.03;
    let level = |p: P| 0.42 + 0.02 * sine(14.0 * p[0]) * cosine(11.0 * p[1]);
    let can = |p: P| {
        let whole = (across(p) - 0.35).max(0.1 - p[2]).max(p[2] - 0.8);
        let hollow = (across(p) - 0.35 + WALL).max(0.1 + WALL - p[2]);
        whole.max(-hollow)
    };
    let fuel = |p: P| {
        (across(p) - 0.35 + WALL).max(0.1 + WALL - p[2]).max(p[2] - level(p)).max(p[2] - 0.8)
    };
    let drops = count / 25;
    let (mut positions, radius) = solid(count - drops, WHOLE, 2, &|p| can(p).min(fuel(p)));
    let mut values =
        valued(&positions, |p| if can(p) < 0.0 { p[2] } else { 1.0 + 0.9 * p[2] / 0.5 });
    for i in 0..drops as u64 {
        let at = in_disc(22, i, 0.32);
        let height = 0.1 * exponential(23, i);
        let z = level([at[0], at[1], 0.0]) + height;
        positions.push([at[0], at[1], z.min(0.99)].map(|v| v as f32));
        values.push(2.0 + height as f32);
    }
    Simulation { positions, radius, values }
}

pub(super) fn bullet(count: usize) -> Simulation {
    const TIP: f64 = 0.7;
    let from_axis = |p: P| length([0.0, p[1] - HALF, p[2] - HALF]);
    let slug = |p: P| {
        length([(p[0] - TIP + 0.08) / 0.08, (p[1] - HALF) / 0.04, (p[2] - HALF) / 0.04]) - 1.0
    };
    let channel = |p: P| {
        let along = ((p[0] - 0.15) / (TIP - 0.15)).clamp(0.0, 1.0);
        let wide = 0.045 + 0.1 * sine(0.5 * TAU * along) * (1.0 + 0.15 * sine(50.0 * p[0]));
        (from_axis(p) - wide).max(p[0] - TIP)
    };
    let block = |p: P| {
        let low = [0.15, HALF, 0.1];
        let high = [0.95, 0.95, 0.9];
        let whole =
            (0..3).map(|i| (low[i] - p[i]).max(p[i] - high[i])).fold(f64::NEG_INFINITY, f64::max);
        whole.max(-channel(p))
    };
    let splinters = count / 25;
    let (mut positions, radius) = solid(count - splinters, WHOLE, 3, &|p| slug(p).min(block(p)));
    let mut values = valued(&positions, |p| match slug(p) < 0.0 {
        true => 1.0 + p[0],
        false => 1.0 / (1.0 + 10.0 * from_axis(p)),
    });
    for i in 0..splinters as u64 {
        let back = 0.04 * exponential(32, i);
        let at = in_disc(33, i, 0.05 + 0.8 * back);
        positions.push([(0.15 - back).max(0.0), at[0], at[1]].map(|v| v as f32));
        values.push(2.0 + back.min(0.9) as f32);
    }
    Simulation { positions, radius, values }
}

pub(super) fn thunder(count: usize) -> Simulation {
    let can = |p: P| {
        let outside = (across(p) - 0.4).max((p[2] - HALF).abs() - 0.45);
        let inside = (across(p) - 0.32).max((p[2] - HALF).abs() - 0.37);
        let cracked = 0.02 - walls(p, 6.0, 41).0 / 6.0;
        outside.max(-inside).max(cracked)
    };
    // 43.00 % are the container (Table 7).
    let pieces = (0.43 * count as f64) as usize;
    let (mut positions, radius) = solid(pieces, WHOLE, 4, &can);
    let mut values = valued(&positions, |p| p[2]);
    for i in 0..(count - pieces) as u64 {
        let off: P = std::array::from_fn(|axis| 0.14 * normal(42, 3 * i + axis as u64));
        // Gas that has left through the cracks runs ahead.
        let ahead = 1.0 + 0.15 * exponential(43, i);
        let at = off.map(|v| (HALF + ahead * v).clamp(0.0, 1.0));
        positions.push(at.map(|v| v as f32));
        values.push(1.0 + length(off) as f32);
    }
    Simulation { positions, radius, values }
}

pub(super) fn foam(count: usize) -> Simulation {
    const CELLS: f64 = 9.0;
    let shape = |p: P| walls(p, CELLS, 51).0 - 0.13;
    let (positions, radius) = solid(count, WHOLE, 5, &shape);
    let values = valued(&positions, |p| walls(p, CELLS, 51).1);
    Simulation { positions, radius, values }
}

pub(super) fn torso(count: usize) -> Simulation {
    // The box of the paper's BulletTorso: its grid has 420 × 198 × 432 cells.
    const SIZE: P = [420.0 / 432.0, 198.0 / 432.0, 1.0];
    let from_middle = |p: P| [p[0] - 0.5 * SIZE[0], p[1] - 0.5 * SIZE[1]];
    // 1 at the skin, 0 in the middle; the shoulders slope.
    let depth = |p: P| {
        let up = ((p[2] - 0.75).max(0.0) / 0.25).min(1.0);
        let shoulder = (1.0 - 0.6 * up * up).sqrt();
        let [x, y] = from_middle(p);
        length([x / (0.5 * SIZE[0] * shoulder), y / (0.5 * SIZE[1] * shoulder), 0.0])
    };
    let lung = |p: P| {
        let [x, y] = from_middle(p);
        length([(x.abs() - 0.13) / 0.09, y / 0.09, (p[2] - 0.62) / 0.16]) - 1.0
    };
    let channel = |p: P| {
        let [x, _] = from_middle(p);
        length([x - 0.05, 0.0, p[2] - 0.55]) - 0.02 - 0.08 * p[1]
    };
    let ribbed = |p: P| (0.35..0.85).contains(&p[2]) && sine(12.0 * TAU * p[2] + 6.0 * p[1]) > 0.2;
    let spine = |p: P| {
        let [x, y] = from_middle(p);
        length([x, y - 0.16, 0.0]) < 0.025
    };
    let value = |p: P| match depth(p) {
        d if spine(p) || ((0.66..0.72).contains(&d) && ribbed(p)) => 2.0 + p[2],
        d if d < 0.581 => 1.0 + d,
        d => d - 0.5,
    };
    let empty = |p: P| lung(p).min(channel(p));
    let (positions, radius) = solid(count, SIZE, 6, &|p| (depth(p) - 1.0).max(-empty(p)));
    Simulation { values: valued(&positions, value), positions, radius }
}

/// `count` touching particles where `shape` is below zero, the outermost left out, and their radius.
fn solid(
    count: usize,
    extent: P,
    seed: u64,
    shape: &(impl Fn(P) -> f64 + Sync),
) -> (Vec<[f32; 3]>, f32) {
    let of = |p: &[f32; 3]| shape(p.map(f64::from));
    let edge = cube_root(4.0 * volume(extent, shape) / (count.max(1) as f64 * 1.01));
    let lattice = Lattice { edge, low: 0.0, extent, jitter: 0.05, seed };
    let (points, radius) = lattice.at_least(count, &|p| of(p) < 0.0);
    (least(points, count, &of), radius)
}

/// The volume where `shape` is below zero, by trial.
fn volume(extent: P, shape: &impl Fn(P) -> f64) -> f64 {
    const TRIALS: usize = 64;
    let place = |i: usize| (i as f64 + HALF) / TRIALS as f64;
    let inside = (0..TRIALS * TRIALS * TRIALS).filter(|i| {
        let at = [i % TRIALS, i / TRIALS % TRIALS, i / TRIALS / TRIALS].map(place);
        shape(std::array::from_fn(|axis| at[axis] * extent[axis])) < 0.0
    });
    inside.count().max(1) as f64 / (TRIALS * TRIALS * TRIALS) as f64
        * extent.iter().product::<f64>()
}

fn valued(positions: &[[f32; 3]], value: impl Fn(P) -> f64) -> Vec<f32> {
    positions.iter().map(|p| value(p.map(f64::from)) as f32).collect()
}

fn length(v: P) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Distance from the upright axis through the middle of the cube.
fn across(p: P) -> f64 {
    length([p[0] - HALF, p[1] - HALF, 0.0])
}

/// A point of the disc of `radius` around (½, ½).
fn in_disc(seed: u64, i: u64, radius: f64) -> [f64; 2] {
    let (out, turn) = (uniform(seed, 2 * i).sqrt() * radius, TAU * uniform(seed, 2 * i + 1));
    [HALF + out * cosine(turn), HALF + out * sine(turn)]
}

/// How far `p` is from the wall between cells, in cells, and a number in 0..1 of its cell: the distances to
/// the nearest two of random points, one in each cube of a lattice of `cells` (Worley 1996).
fn walls(p: P, cells: f64, seed: u64) -> (f64, f64) {
    let at = p.map(|v| v * cells);
    let (mut nearest, mut second, mut cell) = (f64::INFINITY, f64::INFINITY, 0);
    for neighbor in 0..27u64 {
        let step = [neighbor % 3, neighbor / 3 % 3, neighbor / 9];
        let cube: [i64; 3] = std::array::from_fn(|i| at[i].floor() as i64 + step[i] as i64 - 1);
        let key = cube.iter().fold(0, |key, c| bits(seed ^ key, *c as u64));
        let place: P = std::array::from_fn(|i| cube[i] as f64 + uniform(key, i as u64) - at[i]);
        let distance = length(place);
        if distance < nearest {
            (second, nearest, cell) = (nearest, distance, key);
        } else {
            second = second.min(distance);
        }
    }
    (second - nearest, uniform(cell, 3))
}
