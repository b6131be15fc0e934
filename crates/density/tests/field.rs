//! The field against its definition, and with parts left out against the whole.

mod common;

use common::{Random, cloud, dam};
use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_density::{Field, Mask, Params, Particles, Space, reference};
use motes_grid::Radii;

fn field(particles: &Particles<'_>, params: &Params) -> Field {
    let mut field = Field::default();
    field.fill_counted(particles, params, Level::new());
    field
}

fn plain(voxel: f32) -> Params {
    Params { rough: false, masked: false, ..Params::with_voxel(voxel) }
}

#[test]
fn the_plain_field_is_the_definition() {
    let (positions, radii) = cloud(400, 3);
    let each = Particles { positions: &positions, radii: Radii::Each(&radii), masks: None };
    for voxel in [0.03, 0.11, 0.4] {
        let params = plain(voxel);
        let found = field(&each, &params);
        let expected = reference::field(&each, &found.lattice, &params);
        let [nx, ny, nz] = found.lattice.dims;
        let mut updates = 0;
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let want = expected[(z * ny + y) * nx + x];
                    let got = f64::from(found.values[found.index([x, y, z])]);
                    // Sums of up to some hundred numbers of single precision.
                    assert!((got - want).abs() <= 2e-5 * want.max(0.1), "{got} {want}");
                    updates += u64::from(want > 0.0);
                }
            }
        }
        assert!(found.counts.updates >= updates);
    }
}

#[test]
fn radii_of_all_sizes_are_added_up_in_a_cell() {
    // A large one among many small ones, more than are added up together.
    let mut positions = vec![[0.507, 0.503, 0.509]; 1500];
    let mut radii = vec![0.004; 1500];
    for (i, radius) in [0.006, 0.012, 0.03, 0.06].into_iter().enumerate() {
        positions[i * 400] = [0.505, 0.505, 0.504];
        radii[i * 400] = radius;
    }
    let each = Particles { positions: &positions, radii: Radii::Each(&radii), masks: None };
    let params = plain(0.015);
    let found = field(&each, &params);
    let expected = reference::field(&each, &found.lattice, &params);
    let [nx, ny, nz] = found.lattice.dims;
    for (i, want) in expected.iter().enumerate() {
        let got = f64::from(found.values[found.index([i % nx, i / nx % ny, i / nx / ny])]);
        assert!((got - want).abs() <= 2e-5 * want.max(0.1), "{got} {want}");
    }
    assert_eq!(expected.len(), nx * ny * nz);
}

#[test]
fn what_is_out_of_all_proportion_ends() {
    let positions = [[0.0; 3], [1.0, 0.0, 0.0]];
    for radius in [1e35, 1e38, f32::MAX] {
        let radii = [radius, 0.5];
        let each = Particles { positions: &positions, radii: Radii::Each(&radii), masks: None };
        for voxel in [3e34, 1e38, f32::INFINITY] {
            let found = field(&each, &plain(voxel));
            let number = if radius < 1e36 { 2 } else { 1 };
            assert_eq!(found.counts.particles, number, "{radius} {voxel}");
            assert!(found.values.iter().all(|v| v.is_finite()), "{radius} {voxel}");
        }
    }
}

#[test]
fn a_liquid_at_rest_has_a_density_of_one() {
    let positions: Vec<[f32; 3]> =
        (0..20 * 20 * 20).map(|i| [i % 20, i / 20 % 20, i / 400].map(|v| v as f32 * 0.1)).collect();
    let particles = Particles { positions: &positions, radii: Radii::Uniform(0.05), masks: None };
    let found = field(&particles, &plain(0.1));
    let middle = found.lattice.place(Vec3::splat(0.95));
    let density = found.at(middle);
    assert!((density - 1.0).abs() < 0.01, "{density}");
}

#[test]
fn all_of_a_particle_is_in_the_field() {
    // The sum over voxels of what one adds is its volume, wherever it is.
    let mut random = Random(9);
    for _ in 0..20 {
        let positions = [[random.next(), random.next(), random.next()]];
        let particles =
            Particles { positions: &positions, radii: Radii::Uniform(0.5), masks: None };
        let voxel = 0.3;
        let found = field(&particles, &plain(voxel));
        let stride = found.stride();
        let rows = found.values.chunks_exact(stride).map(|row| &row[..found.lattice.dims[0]]);
        let sum: f64 = rows.flatten().map(|v| f64::from(*v)).sum();
        assert!((sum * f64::from(voxel).powi(3) - 1.0).abs() < 0.01, "{sum}");
    }
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let (positions, radius) = dam(30);
    let masks: Vec<Mask> = positions.iter().map(|p| [p[0], 0.3, p[1], 0.0, 0.6, p[2]]).collect();
    let particles =
        Particles { positions: &positions, radii: Radii::Uniform(radius), masks: Some(&masks) };
    for masked in [false, true] {
        let params = Params { masked, ..Params::with_voxel(2.0 * radius) };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.map(|pool| pool.install(|| field(&particles, &params)))
        };
        let one = with(1).unwrap_or_default();
        assert!(one.counts.updates > 1000);
        for threads in [2, 3, 7] {
            let found = with(threads).unwrap_or_default();
            assert!(found.values == one.values && found.counts == one.counts, "{threads} threads");
        }
    }
}

#[test]
fn what_the_rough_field_leaves_out_is_deep_inside() {
    let (positions, radius) = dam(36);
    let particles = Particles { positions: &positions, radii: Radii::Uniform(radius), masks: None };
    let params = Params::with_voxel(2.0 * radius);
    let whole = field(&particles, &Params { rough: false, ..params });
    let skipped = field(&particles, &params);
    assert!(2 * skipped.counts.updates < whole.counts.updates, "{:?}", skipped.counts);
    // Where it differs, all is liquid for two voxels around.
    let [nx, ny, nz] = whole.lattice.dims;
    let mut differ = 0;
    for z in 2..nz - 2 {
        for y in 2..ny - 2 {
            for x in 2..nx - 2 {
                let at = whole.index([x, y, z]);
                if whole.values[at] == skipped.values[at] {
                    continue;
                }
                differ += 1;
                for k in 0..125 {
                    let near = whole.index([x + k % 5 - 2, y + k / 5 % 5 - 2, z + k / 25 - 2]);
                    assert!(whole.values[near] > params.threshold, "{x} {y} {z}");
                }
            }
        }
    }
    assert!(differ > 1000, "{differ}");
}

#[test]
fn every_particle_is_in_the_liquid_or_a_drop() {
    let (positions, radii) = cloud(600, 5);
    let particles = Particles { positions: &positions, radii: Radii::Each(&radii), masks: None };
    for voxel in [0.05, 0.2, 1.0] {
        let params = Params::with_voxel(voxel);
        let found = field(&particles, &params);
        let mut space = Space::default();
        space.fill(&found, (&particles, &params), Level::new());
        let alone = |p: &&[f32; 3]| {
            let place = found.lattice.place((**p).into());
            reference::density(&found, DVec3::from(place)) < f64::from(params.threshold)
        };
        let expected = positions.iter().filter(alone).count();
        assert_eq!(space.drop_count(), expected, "{voxel}");
    }
}

#[test]
fn nothing_and_nonsense_make_an_empty_field() {
    let positions = [[f32::NAN, 0.0, 0.0], [0.0; 3], [1.0; 3]];
    let radii = [1.0, 0.0, f32::INFINITY];
    let params = Params::with_voxel(1.0);
    for count in [0, 3] {
        let particles = Particles {
            positions: &positions[..count],
            radii: Radii::Each(&radii[..count]),
            masks: None,
        };
        let found = field(&particles, &params);
        let mut space = Space::default();
        space.fill(&found, (&particles, &params), Level::new());
        assert!(found.values.iter().all(|v| *v == 0.0) && space.drop_count() == 0);
    }
}

#[test]
fn far_particles_take_no_more_memory() {
    let positions = [[-1e6, 0.0, 3.0], [0.0; 3], [2e6, 5e5, -1e6]];
    let particles = Particles { positions: &positions, radii: Radii::Uniform(0.5), masks: None };
    let found = field(&particles, &Params::with_voxel(1.0));
    assert!(found.values.len() < 1 << 28);
}
