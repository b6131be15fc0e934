//! What the benches promise: the compared ways see the same, and the tables have the paper's shape.

use fearless_simd::Level;
use glam::Vec3;
use motes_scene::{Primary, Projection, Rays, Scene};

use super::draw::{Culling, Drawn, Shot, SphereCenter, Way, draw};
use super::sets::{Built, SETS, params};
use super::single_ray::SingleRay;
use super::standard_grid::{Insert, Params, Standard, StandardGrid};
use super::*;
use crate::Quiet;

/// Numbers in 0..1 (splitmix64).
fn random(n: usize, seed: u64) -> Vec<f32> {
    let mut state = seed;
    let next = |_| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((z ^ (z >> 27)) >> 40) as f32 / (1u64 << 24) as f32
    };
    (0..n).map(next).collect()
}

fn cloud(n: usize, seed: u64) -> Vec<[f32; 3]> {
    random(3 * n, seed).as_chunks().0.to_vec()
}

const SIZE: (u32, u32) = (90, 70);

fn rays(eye: Vec3, toward: Vec3, projection: Projection) -> Rays {
    let forward = (toward - eye).normalize();
    let right = forward.any_orthonormal_vector();
    Rays {
        origin: eye,
        forward,
        right,
        up: right.cross(forward),
        center: [SIZE.0 as f32 / 2.0, SIZE.1 as f32 / 2.0],
        pixel: 1.0 / SIZE.1 as f32,
        projection,
    }
}

/// From outside, from amid the particles, along an axis, without perspective.
fn views() -> Vec<Rays> {
    let middle = Vec3::splat(0.5);
    vec![
        rays(Vec3::new(1.9, -0.7, 1.1), middle, Projection::Perspective),
        rays(
            Vec3::new(0.4, 0.6, 0.5),
            middle + Vec3::new(-0.3, 0.1, 0.05),
            Projection::Perspective,
        ),
        rays(Vec3::new(0.5, 0.5, 3.0), middle, Projection::Perspective),
        rays(Vec3::new(-2.0, 0.3, 0.4), middle, Projection::Orthographic),
    ]
}

fn standard(positions: &[[f32; 3]], radius: f32) -> StandardGrid {
    let params = Params { insert: Insert::Overlapped, lambda: 1.0, block: 6 };
    StandardGrid::build(positions, radius, params).0
}

/// Draws with each way, in packets of every size.
fn all_ways(positions: &[[f32; 3]], radius: f32, rays: &Rays) -> Vec<Drawn> {
    let level = Level::new();
    let built = Built::new(positions, radius, params(1.0, 6));
    let grid = standard(positions, radius);
    let spheres = built.spheres();
    let ways: [&dyn Way; 4] = [
        &SphereCenter { spheres, level, culling: Culling::On },
        &SphereCenter { spheres, level, culling: Culling::Off },
        &Standard { grid: &grid, level },
        &SingleRay { grid: &grid, level },
    ];
    let shots = [2, 4, 8, 16].map(|packet| Shot { rays, size: SIZE, packet });
    ways.iter().flat_map(|way| shots.map(|shot| draw(shot, *way))).collect()
}

#[test]
fn every_way_and_packet_size_gives_the_same_picture() {
    for (n, radius, seed) in [(1, 0.3, 1), (40, 0.1, 2), (3000, 0.03, 3), (3000, 0.004, 4)] {
        for (v, rays) in views().iter().enumerate() {
            let all = all_ways(&cloud(n, seed), radius, rays);
            let differing = all.iter().filter(|drawn| drawn.pixels != all[0].pixels).count();
            assert_eq!(differing, 0, "{n} spheres, view {v}");
            let hit = all[0].pixels.iter().filter(|p| **p != 0xff20_2020).count();
            assert!(hit > 100 || v > 0, "{n} spheres, view {v}: {hit} pixels hit");
        }
    }
}

#[test]
fn a_standard_grid_refers_to_a_sphere_from_every_cell_it_overlaps() {
    let (positions, radius) = (cloud(500, 7), 0.07);
    let grid = standard(&positions, radius);
    let mut cells_of = vec![0; positions.len()];
    for cell in 0..grid.starts.len() - 1 {
        let references = grid.starts[cell] as usize..grid.starts[cell + 1] as usize;
        let [nx, ny, _] = grid.dims;
        let at = Vec3::new((cell % nx) as f32, (cell / nx % ny) as f32, (cell / nx / ny) as f32);
        let low = grid.low + at * grid.edge;
        let references = &grid.references[references];
        references.iter().for_each(|id| cells_of[*id as usize] += 1);
        for (id, p) in positions.iter().enumerate() {
            let center = Vec3::from_array(*p);
            let distance = center.distance(center.clamp(low, low + grid.edge));
            let held = references.contains(&(id as u32));
            // Between the two lies what is put in against rounding.
            assert!(held || distance >= radius, "cell {cell} misses {id}");
            assert!(!held || distance <= radius + 3e-3 * grid.edge, "cell {cell} holds {id}");
        }
    }
    assert!(cells_of.iter().all(|cells| *cells >= 1));
    let center = Params { insert: Insert::Center, lambda: 1.0, block: 6 };
    let (centers, _) = StandardGrid::build(&positions, radius, center);
    assert_eq!(centers.references.len(), positions.len());
}

fn tables(stages: &[&str]) -> Vec<Table> {
    let options = Tables {
        size: (48, 40),
        frames: 1,
        stages: stages.iter().map(|s| (*s).to_owned()).collect(),
        scale: 2e-4,
        threads: Some(2),
    };
    spheres_tables(&options, &Quiet).unwrap()
}

#[test]
fn the_tables_have_the_papers_rows_and_columns() {
    let all = tables(&[]);
    assert_eq!(all.iter().map(|t| t.stage).collect::<Vec<_>>(), TABLES);
    for table in &all {
        let rows: Vec<_> = table.rows.iter().map(|row| row.dataset).collect();
        let expected: Vec<_> = match table.stage {
            "table7" => vec!["Thunder", "BulletTorso"],
            _ => SETS.map(|set| set.name).into(),
        };
        assert_eq!(rows, expected, "{}", table.stage);
        // One picture in a row, where columns only differ in how it is drawn.
        let pictures = match table.stage {
            "table3" => 2,
            "table8" => 4,
            "build" => 0,
            _ => 1,
        };
        for row in &table.rows {
            assert_eq!(row.values.len(), table.columns.len(), "{}", table.stage);
            assert_eq!(
                row.hashes.len(),
                pictures,
                "{} {}: {:?}",
                table.stage,
                row.dataset,
                row.hashes
            );
        }
        let text = table.to_string();
        assert_eq!(text.lines().count(), table.rows.len() + 2, "{text}");
    }
}

#[test]
fn what_is_counted_and_isolated_is_what_the_paper_counts_and_isolates() {
    let all = tables(&["table5", "table7", "table9"]);
    for row in &all[0].rows {
        let [Cell::Count(potential), Cell::Count(skipped), Cell::Percent(culled)] = row.values[..]
        else {
            panic!("{row:?}")
        };
        assert!(0 < skipped && skipped < potential, "{row:?}");
        assert!((culled - 100.0 * skipped as f64 / potential as f64).abs() < 1e-9);
    }
    let part = |row: &Row| match row.values[0] {
        Cell::Percent(part) => part,
        other => panic!("{other:?}"),
    };
    // Table 7: 43.00 % and 34.17 %; a torso of 7000 particles is a coarse one.
    assert!((part(&all[1].rows[0]) - 43.0).abs() < 0.2);
    assert!((part(&all[1].rows[1]) - 34.17).abs() < 5.0);
    assert!(all[2].rows.iter().all(|row| row.values[2] == Cell::Missing));
}

#[test]
fn unknown_stages_are_refused_by_name() {
    let options = Tables {
        size: (8, 8),
        frames: 1,
        stages: vec!["table1".into()],
        scale: 1e-4,
        threads: None,
    };
    let error = spheres_tables(&options, &Quiet).unwrap_err();
    assert!(error.to_string().contains("'table1'") && error.exit_code() == 2, "{error}");
}

fn line(change: impl FnOnce(&mut Scene)) -> Line {
    let mut scene = Scene::default();
    scene.set_sources(&["demo:packed:3000".into()]);
    (scene.image.width, scene.image.height, scene.image.samples) = (64, 64, 1);
    peer_view(&mut scene);
    change(&mut scene);
    let options = Source { scene, frames: 2, stages: vec![], threads: Some(2) };
    spheres_source(options, &Quiet).unwrap()
}

#[test]
fn a_source_has_all_stages_and_one_picture_whatever_the_packets() {
    let lines: Vec<Line> = [2, 4, 8, 16].map(|p| line(|scene| scene.spheres.packet = p)).into();
    for line in &lines {
        assert_eq!((&line.hash, &line.hashes), (&lines[0].hash, &lines[0].hashes));
        assert!(STAGES.iter().all(|stage| line.ms[stage] > 0.0));
        assert!(line.particles == 3000 && line.threads == 2 && line.counts["tests"] > 0);
        assert!(line.bytes["input"] == 36_000 && line.bytes["data"] == 36_000);
    }
    // Shadows and occlusion are to be seen.
    let [shadow, ao] = ["shadow16", "ao16"].map(|stage| &lines[0].hashes[stage]);
    assert!(shadow != ao && *shadow != lines[0].hash && *ao != lines[0].hash);
    let traced = line(|scene| scene.spheres.primary = Primary::Trace);
    assert_eq!((&traced.hash, &traced.hashes), (&lines[0].hash, &lines[0].hashes));
    assert_eq!((lines[0].primary, traced.primary), (Some("project"), Some("trace")));
    let moved = line(|scene| scene.camera.fov = 30.0);
    assert_ne!(moved.hash, lines[0].hash);
}

#[test]
fn the_peer_view_shades_as_the_peer_does() {
    // One sphere in the middle: the pixel at the picture's centre sees it where it faces the eye.
    let mut scene = Scene::default();
    peer_view(&mut scene);
    (scene.image.width, scene.image.height) = (64, 64);
    let resolved = scene.resolve(None).unwrap();
    let normal = -resolved.view.forward.as_vec3();
    let light = Vec3::new(0.3, -0.5, 0.9).normalize();
    let expected = 0.25 + 0.75 * normal.dot(light);
    let lights = resolved.lights;
    let key = lights.key.color.x * normal.dot(lights.key.direction);
    assert!((key + lights.fill(normal).x - expected).abs() < 1e-5);
    assert!((lights.key.cos_half_angle - (1.0 - 0.0055)).abs() < 1e-5);
    assert_eq!((lights.occlusion_radius, lights.ambient), (0.1, Vec3::ZERO));
}
