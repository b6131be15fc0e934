//! Cuts against their definition: every particle and every plane, after any sequence of changes.

use glam::{DVec3, Vec3};
use motes_grid::{
    Clause, Clip, Cut, Face, Grid, Params, Plane, Radii, Resolution, Sections, Visibility, Width,
};

/// Numbers from a 64-bit mixer (splitmix64): the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) - 0.5
    }
}

struct Set {
    grid: Grid,
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
}

/// A cloud, a lattice (whose planes hold many centres) or a sheet, with radii of all sizes up to `radius`.
fn set(random: &mut Random, count: usize) -> Set {
    let shape = random.below(3);
    let positions: Vec<[f32; 3]> = (0..count)
        .map(|i| match shape {
            0 => (random.vector() * 10.0).to_array(),
            1 => [i % 12, i / 12 % 12, i / 144].map(|v| v as f32 * 0.5 - 3.0),
            _ => [random.unit() * 10.0, random.unit() * 10.0, 0.25],
        })
        .collect();
    let equal = random.below(2) == 0;
    let radii: Vec<f32> =
        (0..count).map(|_| if equal { 0.25 } else { 0.1 + 0.3 * random.unit() }).collect();
    let params = Params { resolution: Resolution::CellsPerParticle(1.0), block_cells: 2 };
    let each = if equal { Radii::Uniform(0.25) } else { Radii::Each(&radii[..]) };
    Set { grid: Grid::build(&positions[..], each, None, params), positions, radii }
}

/// A plane: at random; through a centre; through a corner of a block; tangent to a sphere; or outside.
fn plane(random: &mut Random, set: &Set) -> Plane {
    let along = match random.below(3) {
        0 => {
            Vec3::from_array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]][random.below(3)])
        }
        _ => random.vector() + Vec3::splat(1e-3),
    };
    let of = random.below(set.positions.len());
    let center = Vec3::from_array(set.positions[of]);
    let lattice = &set.grid.lattice;
    let point = match random.below(5) {
        0 => random.vector() * 10.0,
        1 => center,
        2 => lattice.corner(lattice.block_at(random.below(lattice.count()))),
        3 => {
            center
                + along.normalize() * set.radii[of] * if random.below(2) == 0 { 1.0 } else { -1.0 }
        }
        _ => along * 1e3 * if random.below(2) == 0 { 1.0 } else { -1.0 },
    };
    Plane::new(point.as_dvec3(), along.as_dvec3()).unwrap()
}

fn clause(random: &mut Random, set: &Set) -> Clause {
    let faces = 1 + random.below(4) / 2;
    let exact = random.below(2) == 0;
    let face = |i| {
        let cut = if exact { [Cut::Caps, Cut::Open][i % 2] } else { Cut::Center };
        Face { plane: plane(random, set), cut, owner: i as u16 }
    };
    Clause { faces: (0..faces).map(face).collect() }
}

/// Whether a particle is seen, by the definition: in f64, and `None` where rounding decides.
fn expected(clip: &Clip, center: [f32; 3], radius: f32) -> Option<bool> {
    let center = DVec3::from(center.map(f64::from));
    let mut all = Some(true);
    for clause in &clip.clauses {
        let mut any = Some(false);
        for face in &clause.faces {
            let plane = face.plane;
            let height = plane.normal.as_dvec3().dot(center) - f64::from(plane.offset);
            let margin = if face.cut == Cut::Center { 0.0 } else { f64::from(radius) };
            let above = height + margin;
            let sure = above.abs() > 1e-5 * (1.0 + f64::from(plane.offset).abs());
            any = match (any, sure, above > 0.0) {
                (Some(true), ..) | (_, true, true) => Some(true),
                (any, true, false) => any,
                (_, false, _) => None,
            };
        }
        all = match (all, any) {
            (Some(false), _) | (_, Some(false)) => Some(false),
            (Some(true), Some(true)) => Some(true),
            _ => None,
        };
    }
    all
}

/// Compares with the definition; gives what is seen, particle by particle in the grid's order.
fn check(sections: &Sections, set: &Set) -> Vec<bool> {
    let Set { grid, positions, radii } = set;
    let mut shown = Vec::new();
    for block in 0..grid.blocks.len() - 1 {
        let (seen, base) =
            (sections.visible()[0].block(grid, block), sections.uncut()[0].block(grid, block));
        for (i, slot) in grid.particles_of(block).enumerate() {
            let index = grid.index(slot) as usize;
            let shows = seen.shows(i);
            let kept = sections.clip().keeps(grid.center(slot), radii[index]);
            assert_eq!(shows, base.shows(i) && kept, "{index} of {:?}", sections.clip());
            if let Some(expected) = expected(sections.clip(), positions[index], radii[index]) {
                assert_eq!(kept, expected, "{index} of {:?}", sections.clip());
            }
            shown.push(shows);
        }
    }
    assert_eq!(sections.visible()[0].visible(), shown.iter().filter(|s| **s).count());
    shown
}

#[test]
fn after_any_changes_what_is_seen_is_what_all_clauses_keep() {
    for seed in 0..60 {
        let random = &mut Random(seed);
        let set = set(random, 700);
        let third = |i: u32| !i.is_multiple_of(3);
        let base = match seed % 2 {
            0 => Visibility::all(&set.grid),
            _ => Visibility::where_all(&set.grid, &[], Some(&third)),
        };
        let widths = [Width::One, Width::Four, Width::Eight];
        let mut all = widths
            .map(|width| Sections::new(std::slice::from_ref(&set.grid), vec![base.clone()], width));
        // All clips so far with what was seen, and which of them is at hand.
        let mut history = vec![(Clip::default(), check(&all[0], &set))];
        let mut at = 0;
        for _ in 0..25 {
            let mut clip = history[at].0.clone();
            let count = clip.clauses.len();
            match random.below(6) {
                // Undo and redo.
                0 => at = at.saturating_sub(1 + random.below(3)),
                1 => at = (at + 1 + random.below(3)).min(history.len() - 1),
                change => {
                    match change {
                        2 if count > 0 => drop(clip.clauses.swap_remove(random.below(count))),
                        3 if count > 0 => clip.clauses[random.below(count)] = clause(random, &set),
                        // One that is there already counts twice.
                        4 if count > 0 => {
                            clip.clauses.push(clip.clauses[random.below(count)].clone())
                        }
                        _ => clip.clauses.push(clause(random, &set)),
                    }
                    all[0].set(std::slice::from_ref(&set.grid), clip.clone());
                    history.truncate(at + 1);
                    history.push((clip, check(&all[0], &set)));
                    at += 1;
                }
            }
            for sections in &mut all {
                sections.set(std::slice::from_ref(&set.grid), history[at].0.clone());
                assert!(check(sections, &set) == history[at].1, "seed {seed}");
            }
        }
        for sections in &mut all {
            sections.set(std::slice::from_ref(&set.grid), Clip::default());
            assert!(check(sections, &set) == history[0].1);
        }
    }
}

#[test]
fn a_small_move_works_on_the_blocks_it_changes() {
    let random = &mut Random(7);
    let positions: Vec<[f32; 3]> = (0..40_000).map(|_| random.vector().to_array()).collect();
    let params = Params { resolution: Resolution::CellsPerParticle(1.0), block_cells: 2 };
    let grid = Grid::build(&positions[..], Radii::Uniform(0.001), None, params);
    let mut sections =
        Sections::new(std::slice::from_ref(&grid), vec![Visibility::all(&grid)], Width::Four);
    let at = |x: f64| {
        let plane = Plane::new(DVec3::new(x, 0.0, 0.0), DVec3::X).unwrap();
        Clause { faces: vec![Face { plane, cut: Cut::Caps, owner: 0 }] }
    };
    let clip = |x: &[f64]| Clip { clauses: x.iter().map(|x| at(*x)).collect() };
    let blocks = grid.blocks.iter().filter(|b| b.cells[0] > 0).count();
    let half = sections.set(std::slice::from_ref(&grid), clip(&[0.0]));
    assert!(half * 5 < blocks * 3, "{half} of {blocks}");
    assert_eq!(sections.set(std::slice::from_ref(&grid), clip(&[0.0])), 0);
    // Where the first plane has cut everything away, the second adds to counters alone.
    let more = sections.set(std::slice::from_ref(&grid), clip(&[0.0, -0.4]));
    assert!(more * 5 < blocks, "{more} of {blocks}");
    assert_eq!(sections.set(std::slice::from_ref(&grid), clip(&[-0.4, 0.0])), 0);
    let outside = sections.set(std::slice::from_ref(&grid), clip(&[-0.4, 0.0, -2.0]));
    assert_eq!(outside, 0);
}

#[test]
fn several_planes_of_a_clause_keep_what_any_of_them_keeps() {
    let positions = [[-1.0, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]];
    let params = Params { resolution: Resolution::CellsPerParticle(1.0), block_cells: 2 };
    let grid = Grid::build(&positions[..], Radii::Uniform(0.2), None, params);
    let mut sections =
        Sections::new(std::slice::from_ref(&grid), vec![Visibility::all(&grid)], Width::One);
    let face = |x: f64, to: f64| {
        let plane = Plane::new(DVec3::new(x, 0.0, 0.0), DVec3::new(to, 0.0, 0.0)).unwrap();
        Face { plane, cut: Cut::Center, owner: 0 }
    };
    let apart = Clause { faces: vec![face(-0.5, -1.0), face(0.5, 1.0)] };
    sections.set(std::slice::from_ref(&grid), Clip { clauses: vec![apart] });
    assert_eq!(sections.visible()[0].visible(), 2);
    let slab = [face(-0.5, 1.0), face(0.5, -1.0)].map(|f| Clause { faces: vec![f] });
    sections.set(std::slice::from_ref(&grid), Clip { clauses: slab.to_vec() });
    assert_eq!(sections.visible()[0].visible(), 1);
}
