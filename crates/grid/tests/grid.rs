//! The grid against its definition, on easy and on hard inputs.

use glam::Vec3;
use motes_grid::{
    BlockValues, Filter, GROUP_EDGE, Grid, Params, Radii, RadiusClasses, Resolution, Seen,
    Visibility,
};

/// Uniform numbers in 0..1 from a 64-bit mixer (splitmix64): the same in every run.
fn random(n: usize, seed: u64) -> Vec<f32> {
    (0..n as u64)
        .map(|i| {
            let mut z = (i + seed * 0x1_0000_0001).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
        })
        .collect()
}

fn cloud(n: usize, seed: u64) -> Vec<[f32; 3]> {
    random(3 * n, seed).chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

/// Each finite particle lies in exactly one cell, and inside that cell; blocks tell the truth.
fn check(grid: &Grid, positions: &[[f32; 3]]) {
    let mut seen: Vec<u32> = grid.particles.iter().map(|p| p.index).collect();
    seen.sort_unstable();
    let expected: Vec<u32> = (0..positions.len() as u32)
        .filter(|i| positions[*i as usize].iter().all(|v| v.is_finite()))
        .collect();
    assert_eq!(seen, expected);
    assert_eq!(*grid.cell_starts.last().unwrap() as usize, grid.len());
    assert!(grid.cell_starts.is_sorted());
    for b in 0..grid.blocks.len() - 1 {
        let block = grid.blocks[b];
        let [nx, ny, _] = block.cells;
        let slack = 1e-5 * (block.cell_low.abs().max_element() + grid.lattice.edge);
        assert_eq!(grid.is_empty_block(b), grid.particles_of(b).is_empty());
        for c in 0..block.cells.iter().product() {
            let place = (block.first_cell + c) as usize;
            let at = [c % nx, c / nx % ny, c / (nx * ny)];
            for slot in grid.cell_starts[place] as usize..grid.cell_starts[place + 1] as usize {
                let p = grid.center(slot);
                assert_eq!(p.to_array(), positions[grid.index(slot) as usize]);
                assert!(p.cmpge(block.low).all() && p.cmple(block.high).all());
                for axis in 0..3 {
                    let low = block.cell_low[axis] + at[axis] as f32 * block.cell_edge;
                    assert!(p[axis] >= low - slack && p[axis] <= low + block.cell_edge + slack);
                }
            }
        }
    }
}

/// Groups tell of exactly the blocks below them.
fn check_groups(grid: &Grid) {
    let mut seen = Vec::new();
    for group in &grid.groups {
        assert!(group.first_block.iter().all(|f| f % GROUP_EDGE == 0) && group.occupied != 0);
        let blocks: Vec<usize> = group.blocks(&grid.lattice).collect();
        let own = |b: &usize| grid.blocks[*b];
        for b in &blocks {
            let from = grid.lattice.block_at(*b);
            assert!((0..3).all(|i| from[i] / GROUP_EDGE == group.first_block[i] / GROUP_EDGE));
        }
        let low = blocks.iter().map(|b| own(b).low).fold(Vec3::INFINITY, Vec3::min);
        let high = blocks.iter().map(|b| own(b).high).fold(Vec3::NEG_INFINITY, Vec3::max);
        let radius = blocks.iter().map(|b| own(b).greatest_radius).fold(0.0, f32::max);
        let particles: usize = blocks.iter().map(|b| grid.particles_of(*b).len()).sum();
        assert_eq!((group.low, group.high, group.greatest_radius), (low, high, radius));
        assert_eq!(group.particles as usize, particles);
        seen.extend(blocks);
    }
    seen.sort_unstable();
    let occupied: Vec<usize> =
        (0..grid.blocks.len() - 1).filter(|b| !grid.is_empty_block(*b)).collect();
    assert_eq!(seen, occupied);
}

fn build(positions: &[[f32; 3]]) -> Grid {
    let grid = Grid::build(positions, Radii::Uniform(0.001), None, Params::default());
    check(&grid, positions);
    check_groups(&grid);
    grid
}

#[test]
fn random_points_fill_blocks_of_about_six_cells() {
    let grid = build(&cloud(200_000, 1));
    let cells: Vec<u32> = grid.blocks.iter().map(|b| b.cells[0]).filter(|c| *c > 0).collect();
    let mean = cells.iter().sum::<u32>() as f32 / cells.len() as f32;
    assert!((5.5..6.5).contains(&mean), "{mean}");
    assert!(grid.structure_bytes() <= 9 * grid.len(), "{}", grid.structure_bytes());
}

#[test]
fn hard_inputs_are_gridded() {
    assert!(build(&[]).is_empty());
    assert_eq!(build(&[[1.0, 2.0, 3.0]]).len(), 1);
    build(&vec![[0.5; 3]; 10_000]);
    build(&cloud(50_000, 2).into_iter().map(|p| [p[0], p[1], 0.25]).collect::<Vec<_>>());
    build(&cloud(50_000, 3).into_iter().map(|p| [0.0, p[1], 0.0]).collect::<Vec<_>>());
    build(&cloud(5_000, 4).into_iter().map(|p| p.map(|v| v * 1e30)).collect::<Vec<_>>());
    build(&cloud(5_000, 5).into_iter().map(|p| p.map(|v| v * 1e-30)).collect::<Vec<_>>());
}

#[test]
fn positions_that_are_no_numbers_are_left_out() {
    let mut positions = cloud(1000, 6);
    positions[3][1] = f32::NAN;
    positions[500][0] = f32::INFINITY;
    positions[999][2] = f32::NEG_INFINITY;
    assert_eq!(build(&positions).len(), 997);
    let classes = RadiusClasses::build(&positions, Radii::Uniform(0.01), Params::default());
    assert_eq!((classes.len(), classes.left_out), (997, 3));
}

#[test]
fn clusters_a_thousand_times_denser_get_finer_cells_and_stay_small() {
    let mut positions = cloud(20_000, 7);
    for (i, p) in positions.iter_mut().enumerate().filter(|(i, _)| i % 2 == 0) {
        let corner = (i / 2 % 5) as f32 / 5.0;
        *p = p.map(|v| corner + 0.02 * v);
    }
    let grid = build(&positions);
    let finest = grid.blocks.iter().map(|b| b.cells[0]).max().unwrap();
    assert!(finest >= 10, "{finest}");
    // One outlier must not press all others into one cell.
    let mut far = cloud(20_000, 8);
    far[17] = [1e6, 0.0, 0.0];
    let grid = build(&far);
    let fullest = grid.cell_starts.windows(2).map(|w| w[1] - w[0]).max().unwrap();
    assert!(fullest < 64, "{fullest}");
}

#[test]
fn any_number_of_threads_builds_the_same_grid() {
    let positions = cloud(100_000, 9);
    let radii: Vec<f32> = random(100_000, 10).iter().map(|r| 0.001 + 0.002 * r).collect();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let grid =
            pool.install(|| Grid::build(&positions, Radii::Each(&radii), None, Params::default()));
        (grid.particles, grid.cell_starts, grid.blocks, grid.groups, grid.radius)
    };
    let one = with(1);
    assert!(one == with(2) && one == with(3) && one == with(7));
}

#[test]
fn a_grid_in_the_memory_of_another_is_the_same_grid() {
    let radii: Vec<f32> = random(60_000, 30).iter().map(|r| 0.001 + 0.002 * r).collect();
    let mut grid = Grid::empty();
    for (n, seed) in [(60_000, 20), (50_000, 21), (60_000, 22), (10, 23), (0, 24), (40_000, 25)] {
        let positions = cloud(n, seed);
        let radii = Radii::Each(&radii[..n]);
        grid = grid.rebuild(&positions, radii, None, Params::default());
        let anew = Grid::build(positions, radii, None, Params::default());
        assert!(grid.particles == anew.particles && grid.cell_starts == anew.cell_starts);
        assert!(grid.radius == anew.radius && grid.blocks == anew.blocks);
        assert!(grid.groups == anew.groups && grid.low == anew.low && grid.high == anew.high);
    }
}

#[test]
fn particles_of_a_cell_keep_the_order_of_the_file() {
    let positions = cloud(100_000, 26);
    let grid = build(&positions);
    for cell in grid.cell_starts.windows(2) {
        assert!(grid.particles[cell[0] as usize..cell[1] as usize].is_sorted_by_key(|p| p.index));
    }
    // All in one bucket, and more than any cache holds.
    let mut far = cloud(400_000, 27);
    far[9] = [1e7, 0.0, 0.0];
    build(&far);
}

#[test]
fn a_grid_by_cell_length_has_cells_of_that_length() {
    let positions = cloud(10_000, 11);
    let params = Params { resolution: Resolution::CellEdge(0.05), block_cells: 4 };
    let grid = Grid::build(&positions, Radii::Uniform(0.01), None, params);
    check(&grid, &positions);
    assert!((grid.lattice.edge - 0.2).abs() < 1e-5);
    assert!(grid.blocks.iter().all(|b| b.cells == [0; 3] || b.cells == [4; 3]));
    // A length far below the particles' spacing is not allowed to exhaust memory.
    let params = Params { resolution: Resolution::CellEdge(1e-9), block_cells: 4 };
    let grid = Grid::build(&positions, Radii::Uniform(0.01), None, params);
    assert!(grid.structure_bytes() < 100 << 20);
}

#[test]
fn radii_over_six_decades_fall_into_classes() {
    let n = 50_000;
    let positions = cloud(n, 12);
    let mut radii: Vec<f32> = random(n, 13).iter().map(|u| 10f32.powf(-6.0 * u)).collect();
    radii[5] = 0.0;
    radii[6] = -1.0;
    radii[7] = f32::NAN;
    let classes = RadiusClasses::build(&positions, Radii::Each(&radii), Params::default());
    assert_eq!((classes.len(), classes.left_out), (n - 3, 3));
    assert!(classes.grids.len() >= 10);
    for grid in &classes.grids {
        assert!(grid.greatest_radius <= 4.0 * grid.least_radius);
        assert!((0..grid.len()).all(|s| grid.radius_at(s) == radii[grid.index(s) as usize]));
    }
    let equal = vec![0.5; 100];
    let classes = RadiusClasses::build(&positions[..100], Radii::Each(&equal), Params::default());
    assert_eq!(classes.grids.len(), 1);
}

fn seen(grid: &Grid, visibility: &Visibility) -> Vec<u32> {
    let mut all = Vec::new();
    for b in 0..grid.blocks.len() - 1 {
        let slots = grid.particles_of(b);
        match visibility.block(grid, b) {
            Seen::Hidden => {}
            Seen::Shown => all.extend(slots.map(|s| grid.index(s))),
            Seen::Mixed(words) => all.extend(
                slots
                    .enumerate()
                    .filter(|(i, _)| words[i / 64] >> (i % 64) & 1 == 1)
                    .map(|(_, s)| grid.index(s)),
            ),
        }
    }
    all.sort_unstable();
    all
}

#[test]
fn filters_show_what_brute_force_shows() {
    let positions = cloud(30_000, 14);
    let mut values = random(30_000, 15);
    values[100] = f32::NAN;
    let grid = build(&positions);
    let by_x = |i: u32| positions[i as usize][0];
    let by_value = |i: u32| values[i as usize];
    let (x, value) = (BlockValues::of(&grid, by_x), BlockValues::of(&grid, by_value));
    for (low, high) in [(0.0, 1.0), (0.25, 0.75), (0.5, 0.5001), (2.0, 3.0), (0.9, 0.1)] {
        let filters = [
            Filter { values: &x, min: low, max: high },
            Filter { values: &value, min: 0.2, max: 0.9 },
        ];
        let keep = |i: u32| !i.is_multiple_of(7);
        let visibility = Visibility::where_all(&grid, &filters, Some(&keep));
        let expected: Vec<u32> = (0..30_000u32)
            .filter(|i| (low..=high).contains(&by_x(*i)) && (0.2..=0.9).contains(&by_value(*i)))
            .filter(|i| keep(*i))
            .collect();
        assert_eq!(seen(&grid, &visibility), expected);
        assert_eq!(visibility.visible(), expected.len());
        let bits = visibility.without_blocks(&grid);
        assert_eq!((seen(&grid, &bits), bits.visible()), (expected, visibility.visible()));
        let mut blocks = (0..grid.blocks.len() - 1).filter(|b| !grid.is_empty_block(*b));
        assert!(blocks.all(|b| matches!(bits.block(&grid, b), Seen::Mixed(_))));
    }
    let all = Visibility::all(&grid);
    assert_eq!(seen(&grid, &all).len(), 30_000);
    assert_eq!(seen(&grid, &all.without_blocks(&grid)), seen(&grid, &all));
}

#[test]
fn coinciding_spheres_are_seen_once_the_lowest_index_first() {
    let positions = vec![[0.5; 3]; 100_000];
    let grid = build(&positions);
    assert_eq!(seen(&grid, &Visibility::all(&grid)), [0]);
    let odd = Visibility::where_all(&grid, &[], Some(&|i| i % 2 == 1));
    assert_eq!(seen(&grid, &odd), [1]);
    assert_eq!(odd.visible(), 50_000);
}

#[test]
fn nearest_distances_are_those_of_brute_force() {
    let mut positions = cloud(2000, 16);
    // A dense cluster, coinciding particles and an outlier.
    positions.extend(cloud(500, 17).into_iter().map(|p| p.map(|v| 0.3 + 0.01 * v)));
    positions.extend([[0.9; 3]; 10]);
    positions.push([40.0, -7.0, 3.0]);
    let grid = build(&positions);
    for slot in 0..grid.len() {
        let own = grid.center(slot);
        let truth = (0..grid.len())
            .map(|other| grid.center(other).distance(own))
            .filter(|d| *d > 0.0)
            .fold(f32::INFINITY, f32::min);
        assert_eq!(grid.nearest_distance(slot), Some(truth));
    }
    assert_eq!(build(&[[1.0; 3]; 50]).median_spacing(), None);
    assert_eq!(build(&[]).median_spacing(), None);
    let lattice: Vec<[f32; 3]> =
        (0..1000).map(|i| [(i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32]).collect();
    assert_eq!(build(&lattice).median_spacing(), Some(1.0));
    assert!((build(&lattice).share_edge().unwrap() - 1.0).abs() < 0.01);
    // Pairs on the lattice: the nearest is near, but each has half the room of a place.
    let pairs: Vec<[f32; 3]> =
        lattice.iter().flat_map(|p| [*p, [p[0] + 0.3, p[1], p[2]]]).collect();
    let grid = build(&pairs);
    assert!((grid.median_spacing().unwrap() - 0.3).abs() < 1e-5);
    assert!(grid.share_edge().unwrap() > 0.4);
}

#[test]
fn spacing_at_one_point_or_two_is_found_quickly() {
    assert_eq!(build(&vec![[0.3; 3]; 200_000]).median_spacing(), None);
    let mut two = vec![[0.3; 3]; 20_000];
    two.extend(vec![[0.3, 0.3, 0.8]; 20_000]);
    assert_eq!(build(&two).median_spacing(), Some(0.5));
}
