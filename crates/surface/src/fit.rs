//! Balls at the surface, fitted to it, so that outlines are smooth, too.
//!
//! Smoothing in the picture (§3.4 of the paper) makes smooth what is seen from the front, but an outline
//! shows the union of balls as it is: bumps of an eighth of a ball, and more where particles lie unevenly.
//! Here each ball at the surface is first moved along the surface's normal to where its neighbours in the surface
//! lie in the mean, and is then exchanged for a larger one that touches the same place from inside. With
//! neighbours j within the reach H of particle i, weights w = 1 − |xⱼ − xᵢ|/H:
//!
//! > gᵢ = −Σ w (xⱼ − xᵢ)/H, smoothed once over the neighbours;  nᵢ = gᵢ/|gᵢ|
//! >
//! > sᵢ = how far |gᵢ|/Σ w is from that of a particle inside to that of one in a flat surface, 0 to 1
//! >
//! > xᵢ ← xᵢ + 0.7 sᵢ nᵢ · Σ w sⱼ (nᵢ·nⱼ)₊ (xⱼ − xᵢ)·nᵢ / Σ w sⱼ (nᵢ·nⱼ)₊, a few times
//!
//! A ball of radius R + D about xᵢ − D nᵢ reaches D (1 − nᵢ·nⱼ) farther along a neighbour's normal than one of
//! radius R about xᵢ. It may grow as long as it stays below the surface at the neighbour, or no more than ε farther:
//!
//! > D (1 − nᵢ·nⱼ) ≤ ε + ((xⱼ − xᵢ)·nⱼ)₊
//!
//! which lets it grow where the surface is flat, and not at edges, and in sheets no farther than half through.
//! Sheets and drops of a few particles have no clear normal and are left as they are.

use glam::Vec3;
use rayon::prelude::*;

use crate::boundary::Part;
use crate::cull::Cells;

/// |g|/Σw of a particle inside the liquid, at the most, and of one in its surface, at the least.
const INSIDE: f32 = 0.05;
const SURFACE: f32 = 0.11;
/// Fewer neighbours make no surface: within 1.8 spacings an edge has eleven of them, a sheet of one layer eight.
const FEWEST: usize = 10;
/// How often, and how far each time, balls are moved towards the mean of their neighbours.
const MOVES: usize = 5;
const PART: f32 = 0.7;
/// The greatest D and the ε, in radii.
const GROWTH: f32 = 0.9;
const ABOVE: f32 = 0.1;
/// Particles done by a thread at a time.
const CHUNK: usize = 4096;

/// A ball that is kept, in the order of cells.
#[derive(Clone, Copy)]
struct Ball {
    cell: u32,
    /// Its part, and its place there.
    home: (u32, u32),
    at: Vec3,
    radius: f32,
    /// Whether all its neighbours are here, and it may be changed.
    whole: bool,
}

/// What is known of the surface at a ball.
#[derive(Clone, Copy, Default)]
struct Facet {
    normal: Vec3,
    /// From 0, inside, to 1.
    share: f32,
}

/// Neighbours of each ball, those of the first ball first.
struct Neighbours {
    starts: Vec<u32>,
    all: Vec<u32>,
}

impl Neighbours {
    fn of(&self, ball: usize) -> &[u32] {
        &self.all[self.starts[ball] as usize..self.starts[ball + 1] as usize]
    }
}

/// Fits the balls of `parts`, of which only such are missing whose cells are deep.
pub(crate) fn fit(parts: &mut [Part], cells: &Cells) {
    let mut balls = in_order(parts, cells);
    let reach = cells.edge;
    let near = neighbours(&balls, reach, cells.dims);
    let weight = |a: Vec3, b: Vec3| (1.0 - a.distance(b) / reach).max(0.0);

    let slopes: Vec<(Vec3, f32)> = each(&balls, |i| {
        near.of(i).iter().fold((Vec3::ZERO, 0.0), |(slope, sum), j| {
            let (from, to) = (balls[i].at, balls[*j as usize].at);
            let w = weight(from, to);
            (slope + (from - to) * (w / reach), sum + w)
        })
    });
    let facets: Vec<Facet> = each(&balls, |i| {
        let (own, sum) = slopes[i];
        if near.of(i).len() < FEWEST || !balls[i].whole {
            return Facet::default();
        }
        let slope = near.of(i).iter().fold(own, |slope, j| {
            slope + slopes[*j as usize].0 * weight(balls[i].at, balls[*j as usize].at)
        }) / (1.0 + sum);
        let share = (slope.length() / sum.max(f32::MIN_POSITIVE) - INSIDE) / (SURFACE - INSIDE);
        Facet { normal: slope.normalize_or_zero(), share: share.clamp(0.0, 1.0) }
    });
    drop(slopes);

    for _ in 0..MOVES {
        let moved: Vec<Vec3> = each(&balls, |i| {
            let (at, Facet { normal, share }) = (balls[i].at, facets[i]);
            if share == 0.0 {
                return at;
            }
            let (mut above, mut sum) = (0.0, f32::MIN_POSITIVE);
            for j in near.of(i) {
                let (to, other) = (balls[*j as usize].at, facets[*j as usize]);
                let w = weight(at, to) * other.share * normal.dot(other.normal).max(0.0);
                above += w * (to - at).dot(normal);
                sum += w;
            }
            at + normal * (PART * share * above / sum)
        });
        balls.par_iter_mut().zip(moved).for_each(|(ball, at)| ball.at = at);
    }

    let growth: Vec<f32> = each(&balls, |i| {
        let (ball, facet) = (balls[i], facets[i]);
        let most = GROWTH * ball.radius * facet.share;
        near.of(i).iter().fold(most, |growth, j| {
            let (to, other) = (balls[*j as usize].at, facets[*j as usize]);
            let room = ABOVE * ball.radius + (to - ball.at).dot(other.normal).max(0.0);
            let turned = 1.0 - facet.normal.dot(other.normal);
            if other.share == 0.0 || growth * turned <= room { growth } else { room / turned }
        })
    });
    for (i, ball) in balls.iter().enumerate() {
        let center = ball.at - facets[i].normal * growth[i];
        let (part, place) = ball.home;
        parts[part as usize].spheres[place as usize] =
            [center.x, center.y, center.z, ball.radius + growth[i]];
    }
}

/// `of` each ball.
fn each<T: Send>(balls: &[Ball], of: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    (0..balls.len()).into_par_iter().with_min_len(CHUNK).map(of).collect()
}

/// All balls in the order of their cells.
fn in_order(parts: &[Part], cells: &Cells) -> Vec<Ball> {
    let of_part = |(part, of): (usize, &Part)| {
        let ball = move |(place, sphere): (usize, &[f32; 4])| {
            let [x, y, z, radius] = *sphere;
            let cell = cells.cell([x, y, z]);
            Ball {
                cell,
                home: (part as u32, place as u32),
                at: Vec3::new(x, y, z),
                radius,
                whole: !cells.is_among(cell) && !cells.is_sparse(cell),
            }
        };
        of.spheres.iter().enumerate().map(ball).collect::<Vec<_>>()
    };
    let mut balls: Vec<Ball> = parts.par_iter().enumerate().flat_map_iter(of_part).collect();
    // By place within a cell, so that sums do not depend on the order of particles.
    balls.par_sort_unstable_by(|a, b| {
        let by = |axis: usize| a.at[axis].total_cmp(&b.at[axis]);
        let by_place = a.cell.cmp(&b.cell).then(by(0)).then(by(1)).then(by(2));
        by_place.then(a.home.cmp(&b.home))
    });
    balls
}

/// The balls within `reach`, which is a cell's edge, of each that is whole. The border of the lattice of `dims` cells is empty, so that
/// the cells around a ball's have the numbers around its number.
fn neighbours(balls: &[Ball], reach: f32, dims: [u32; 3]) -> Neighbours {
    let (row, plane) = (i64::from(dims[0]), i64::from(dims[0]) * i64::from(dims[1]));
    let rows: [i64; 9] = std::array::from_fn(|k| {
        let (y, z) = (k as i64 % 3 - 1, k as i64 / 3 - 1);
        y * row + z * plane - 1
    });
    let from = |cell: i64| balls.partition_point(|ball| i64::from(ball.cell) < cell);
    let chunks: Vec<(Vec<u32>, Vec<u32>)> = balls
        .par_chunks(CHUNK)
        .map(|chunk| {
            let (mut counts, mut all) = (Vec::with_capacity(chunk.len()), Vec::new());
            // Where three cells side by side begin; cells come in order, and so do these.
            let mut begins = rows.map(|row| from(i64::from(chunk[0].cell) + row));
            for ball in chunk {
                let before = all.len();
                for (begin, row) in begins.iter_mut().zip(&rows) {
                    let first = i64::from(ball.cell) + row;
                    while *begin < balls.len() && i64::from(balls[*begin].cell) < first {
                        *begin += 1;
                    }
                    let of_row = balls[*begin..].iter().enumerate();
                    let of_row = of_row.take_while(|(_, b)| i64::from(b.cell) <= first + 2);
                    for (i, other) in of_row.filter(|_| ball.whole) {
                        let square = ball.at.distance_squared(other.at);
                        if square < reach * reach && other.home != ball.home {
                            all.push((*begin + i) as u32);
                        }
                    }
                }
                counts.push((all.len() - before) as u32);
            }
            (counts, all)
        })
        .collect();
    let mut starts = vec![0];
    let mut sum = 0;
    for count in chunks.iter().flat_map(|(counts, _)| counts) {
        sum += count;
        starts.push(sum);
    }
    Neighbours { starts, all: chunks.into_iter().flat_map(|(_, all)| all).collect() }
}

#[cfg(test)]
mod tests {
    use crate::{Boundary, Input, Params, Particles};
    use fearless_simd::Level;
    use motes_grid::Radii;

    /// Balls of radius 1 about the particles, whose spacing is 1, fitted or not.
    fn balls(particles: &[[f32; 3]], fit: bool) -> Vec<[f32; 4]> {
        let params = Params { cell: 1.8, fit, ..Params::default() };
        let particles = Particles::Unsorted(particles, Radii::Uniform(1.0));
        let input = Input { particles, radius_scale: 1.0 };
        let boundary = Boundary::extract(&input, &params, Level::new());
        boundary.parts.iter().flat_map(|p| p.spheres.clone()).collect()
    }

    /// A block of particles on a lattice, each up to 0.25 off its place.
    fn block([nx, ny, nz]: [u32; 3]) -> Vec<[f32; 3]> {
        let mut seed = 1_u64;
        let mut off = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((seed >> 40) as f32 / (1 << 24) as f32 - 0.5) * 0.5
        };
        let places = (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / nx / ny]);
        places.map(|p| p.map(|p| p as f32 + off())).collect()
    }

    /// Mean and standard deviation of the highest points of the balls over an area.
    fn height(balls: &[[f32; 4]], middle: f32, half: f32) -> (f32, f32) {
        let at = |i: i32| middle + half * i as f32 / 20.0;
        let points = (-20..=20).flat_map(|i| (-20..=20).map(move |j| (at(i), at(j))));
        let top = |(x, y): (f32, f32)| {
            let over = balls.iter().map(|[cx, cy, cz, r]| {
                let square = r * r - (x - cx).powi(2) - (y - cy).powi(2);
                if square < 0.0 { f32::NEG_INFINITY } else { cz + square.sqrt() }
            });
            over.fold(f32::NEG_INFINITY, f32::max)
        };
        let all: Vec<f32> = points.map(top).collect();
        let mean = all.iter().sum::<f32>() / all.len() as f32;
        let square = all.iter().map(|h| (h - mean).powi(2)).sum::<f32>() / all.len() as f32;
        (mean, square.sqrt())
    }

    #[test]
    fn a_flat_surface_becomes_flatter_and_stays_where_it_is() {
        let particles = block([16, 16, 10]);
        let (mean, rough) = height(&balls(&particles, false), 7.5, 4.0);
        let (fitted, smooth) = height(&balls(&particles, true), 7.5, 4.0);
        assert!(smooth < 0.5 * rough, "{rough} → {smooth}");
        assert!((mean - fitted).abs() < 0.15, "{mean} → {fitted}");
    }

    #[test]
    fn edges_do_not_swell() {
        let fitted = balls(&block([16, 16, 10]), true);
        let beyond = |v: f32, r: f32, last: f32| (v + r - last).max(r - v) - 1.25;
        for [x, y, z, r] in fitted {
            let most = beyond(x, r, 15.0).max(beyond(y, r, 15.0)).max(beyond(z, r, 9.0));
            assert!(most <= 0.15, "a ball of {r} at {x} {y} {z} stands out {most}");
        }
    }

    #[test]
    fn a_sheet_and_a_few_particles_are_left_as_they_are() {
        for particles in [block([24, 24, 1]), block([2, 2, 2])] {
            let (mut fitted, mut plain) = (balls(&particles, true), balls(&particles, false));
            let order = |a: &[f32; 4], b: &[f32; 4]| a.partial_cmp(b).unwrap();
            fitted.sort_by(order);
            plain.sort_by(order);
            assert_eq!(fitted, plain);
        }
    }

    #[test]
    fn what_is_left_out_deep_inside_changes_nothing() {
        let particles = block([16, 16, 16]);
        let all = Params { cell: 1.8, fit: true, cull: crate::Cull::Off, ..Params::default() };
        let all = Params { spray: crate::Spray::Drops(1.0), ..all };
        let of = Particles::Unsorted(&particles, Radii::Uniform(1.0));
        let input = Input { particles: of, radius_scale: 1.0 };
        let boundary = Boundary::extract(&input, &all, Level::new());
        let all: Vec<[f32; 4]> = boundary.parts.iter().flat_map(|p| p.spheres.clone()).collect();
        assert_eq!(all.len(), particles.len());
        let few = balls(&particles, true);
        assert!(few.len() < all.len());
        assert!(few.iter().all(|ball| all.contains(ball)));
    }
}
