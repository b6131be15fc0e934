//! Traced packets against the definition, on easy and on adversarial scenes.

mod common;

use fearless_simd::{Level, dispatch};
use glam::{DVec3, Vec3};
use motes_grid::{Params, Radii, RadiusClasses, Resolution, Visibility};
use motes_spheres::{Counts, Packet, Spheres, reference, trace};

use common::Random;

impl Random {
    fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}

struct Scene {
    positions: Vec<[f32; 3]>,
    radii: Vec<f32>,
}

impl Scene {
    fn new(spheres: impl IntoIterator<Item = (Vec3, f32)>) -> Self {
        let (positions, radii) = spheres.into_iter().map(|(p, r)| (p.to_array(), r)).unzip();
        Self { positions, radii }
    }

    fn reference(&self) -> Vec<reference::Sphere> {
        let as_f64 = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        let spheres = self.positions.iter().zip(&self.radii);
        spheres
            .map(|(p, r)| reference::Sphere { center: as_f64(p), radius: f64::from(*r) })
            .collect()
    }
}

/// A square of `n` × `n` rays from `eye` towards `target`, `fov` radians across.
fn rays(eye: Vec3, target: Vec3, fov: f32, n: usize) -> Vec<(Vec3, Vec3)> {
    let forward = (target - eye).normalize();
    let right = forward.any_orthonormal_vector();
    let up = right.cross(forward);
    let scale = 2.0 * (fov / 2.0).tan() / n as f32;
    let at = move |i: usize| (i as f32 + 0.5 - n as f32 / 2.0) * scale;
    (0..n * n).map(|i| (eye, (forward + right * at(i % n) + up * at(i / n)).normalize())).collect()
}

/// Traces the rays in packets of `side`², as neighbours on the picture.
fn traced(
    scene: &Scene,
    params: Params,
    rays: &[(Vec3, Vec3)],
    (side, level): (usize, Level),
) -> Vec<Option<(f32, u32)>> {
    let classes = RadiusClasses::build(&scene.positions, Radii::Each(&scene.radii), params);
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let spheres = [Spheres::new(&classes, &visible)];
    let n = (rays.len() as f64).sqrt() as usize;
    let mut hits = vec![None; rays.len()];
    let mut counts = Counts::default();
    for y in (0..n).step_by(side) {
        for x in (0..n).step_by(side) {
            let places: Vec<usize> = (0..side * side)
                .map(|i| (x + i % side, y + i / side))
                .filter(|(x, y)| *x < n && *y < n)
                .map(|(x, y)| y * n + x)
                .collect();
            let mut packet = Packet::new();
            for place in &places {
                packet.push(rays[*place].0, rays[*place].1);
            }
            dispatch!(level, simd => trace(simd, &mut packet, &spheres, &mut counts));
            for (i, place) in places.iter().enumerate() {
                hits[*place] = packet.hit(i).map(|(t, _, slot)| (t, spheres[0].index(slot)));
            }
        }
    }
    hits
}

/// Compares with the definition: same sphere away from ties, distance within f32's rounding.
fn check(name: &str, scene: &Scene, rays: &[(Vec3, Vec3)]) -> Vec<Option<(f32, u32)>> {
    let spheres = scene.reference();
    let hits = traced(scene, Params::default(), rays, (8, Level::new()));
    let mut met = 0;
    for ((origin, direction), hit) in rays.iter().zip(&hits) {
        let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
        let truth = reference::trace(o, d, &spheres);
        match (truth, hit) {
            (None, None) => {}
            (Some(t), Some((distance, index))) => {
                met += 1;
                let own = spheres[*index as usize];
                let off = (f64::from(*distance) - t.distance).abs();
                let same = t.index == *index as usize;
                // Another sphere is right only if it lies as near within rounding, or if the ray
                // grazes the one that was missed.
                let other = off <= t.tolerance + reference::depth_tolerance(o, d, own)
                    || reference::grazes(o, d, spheres[t.index]);
                assert!(
                    if same { off <= t.tolerance } else { other },
                    "{name}: {t:?} against {hit:?}"
                );
            }
            (Some(t), None) => {
                assert!(reference::grazes(o, d, spheres[t.index]), "{name}: missed {t:?}")
            }
            (None, Some((_, index))) => assert!(
                reference::grazes(o, d, spheres[*index as usize]),
                "{name}: hit {hit:?}, which is not there"
            ),
        }
    }
    assert!(met > 0, "{name}: nothing was hit");
    hits
}

/// Every packet size, grid and instruction set gives the same bits.
fn check_all(name: &str, scene: &Scene, rays: &[(Vec3, Vec3)]) {
    let hits = check(name, scene, rays);
    for (lambda, block_cells) in [(0.2, 6), (1.0, 1), (5.0, 8), (1.0, 6)] {
        let params = Params { resolution: Resolution::CellsPerParticle(lambda), block_cells };
        for side in [1, 2, 4, 8, 16] {
            let same = traced(scene, params, rays, (side, Level::new()));
            assert!(same == hits, "{name}: λ {lambda}, M {block_cells}, packets of {side}²");
        }
    }
    for level in levels() {
        let same = traced(scene, Params::default(), rays, (8, level));
        assert!(same == hits, "{name}: {level:?}");
    }
}

/// Every instruction set this machine has.
fn levels() -> Vec<Level> {
    let best = Level::new();
    let mut levels = vec![Level::baseline(), best];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(best.as_sse4_2().map(Level::Sse4_2));
        levels.extend(best.as_avx2().map(Level::Avx2));
    }
    levels
}

fn random_scene(n: usize, radius: f32, seed: u64) -> Scene {
    let mut random = Random(seed);
    Scene::new((0..n).map(|_| (random.point(), radius * (0.3 + 0.7 * random.unit()))))
}

#[test]
fn a_gas() {
    let scene = random_scene(3000, 0.03, 1);
    check_all("from afar", &scene, &rays(Vec3::new(2.5, 1.5, 1.8), Vec3::splat(0.5), 0.6, 40));
    check_all(
        "from far away",
        &scene,
        &rays(Vec3::new(80.0, -70.0, 60.0), Vec3::splat(0.5), 0.01, 40),
    );
}

#[test]
fn every_axis_and_direction() {
    let scene = random_scene(800, 0.05, 2);
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let mut eye = Vec3::splat(0.5);
            eye[axis] += sign * 3.0;
            check_all("along an axis", &scene, &rays(eye, Vec3::splat(0.5), 0.4, 24));
        }
    }
}

#[test]
fn the_eye_amid_the_spheres() {
    let scene = random_scene(3000, 0.02, 3);
    for target in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(1.0, 1.0, 0.9), -Vec3::ONE] {
        let eye = Vec3::new(0.51, 0.47, 0.52);
        check_all("amid", &scene, &rays(eye, eye + target, 1.2, 32));
    }
}

#[test]
fn the_eye_inside_a_sphere() {
    let mut random = Random(4);
    let eye = Vec3::splat(0.5);
    let around = (0..500).map(|_| (random.point(), 0.02));
    let scene = Scene::new([(eye, 0.3)].into_iter().chain(around));
    check_all("inside", &scene, &rays(eye, Vec3::ONE, 1.5, 32));
    // The inner wall alone.
    let alone = Scene::new([(Vec3::new(0.1, 0.0, 0.0), 2.0)]);
    let hits = check("inner wall", &alone, &rays(Vec3::ZERO, Vec3::X, 0.001, 8));
    assert!(hits.iter().all(|h| h.is_some_and(|(t, _)| (t - 2.1).abs() < 1e-5)));
}

#[test]
fn what_lies_behind_is_not_seen() {
    let mut random = Random(5);
    let behind = (0..200).map(|_| (random.point() - Vec3::new(3.0, 0.0, 0.0), 0.05));
    let scene = Scene::new(behind.chain([(Vec3::new(4.0, 0.5, 0.5), 1.0)]));
    let eye = Vec3::new(0.0, 0.5, 0.5);
    let hits = check("behind", &scene, &rays(eye, eye + Vec3::X, 0.3, 24));
    assert!(hits.iter().flatten().all(|(_, index)| *index == 200));
}

#[test]
fn touching_nested_and_equal_spheres() {
    let lattice = (0..1000)
        .map(|i| (Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) * 0.1, 0.05));
    check_all(
        "touching",
        &Scene::new(lattice),
        &rays(Vec3::new(3.0, 2.0, 2.5), Vec3::splat(0.45), 0.4, 32),
    );
    let nested = (0..300).map(|i| (Vec3::splat(0.5), 0.002 * (i + 1) as f32));
    check_all("nested", &Scene::new(nested), &rays(Vec3::splat(3.0), Vec3::splat(0.5), 0.4, 24));
    let equal = Scene::new((0..5000).map(|_| (Vec3::splat(0.5), 0.2)));
    let hits = check("equal", &equal, &rays(Vec3::splat(3.0), Vec3::splat(0.5), 0.1, 24));
    assert!(hits.iter().flatten().all(|(_, index)| *index == 0));
}

#[test]
fn radii_over_six_decades() {
    let mut random = Random(6);
    let scene =
        Scene::new((0..2000).map(|_| (random.point(), 0.3 * 10f32.powf(-6.0 * random.unit()))));
    check_all("decades", &scene, &rays(Vec3::new(2.5, 1.5, 1.8), Vec3::splat(0.5), 0.6, 40));
}

#[test]
fn grazing_rays() {
    // A row of spheres of which the rays touch the rims.
    let scene = Scene::new((0..200).map(|i| (Vec3::new(i as f32 * 0.01, 0.05, 0.0), 0.05)));
    let along: Vec<_> = (0..24 * 24)
        .map(|i| {
            let y = (i % 24) as f32 * 1e-6;
            (Vec3::new(-1.0, y, (i / 24) as f32 * 1e-5), Vec3::X)
        })
        .collect();
    check_all("grazing", &scene, &along);
}

#[test]
fn hard_shapes() {
    let mut random = Random(7);
    let plane = Scene::new((0..2000).map(|_| (random.point().with_z(0.5), 0.01)));
    check_all("a plane", &plane, &rays(Vec3::new(0.5, -1.0, 1.5), Vec3::splat(0.5), 0.6, 32));
    check_all(
        "a plane on edge",
        &plane,
        &rays(Vec3::new(0.5, -2.0, 0.5), Vec3::splat(0.5), 0.6, 33),
    );
    let clusters =
        (0..3000).map(|i| (Vec3::splat((i % 5) as f32 * 0.2) + random.point() * 0.01, 0.001));
    check_all(
        "clusters",
        &Scene::new(clusters),
        &rays(Vec3::splat(2.0), Vec3::splat(0.4), 0.02, 48),
    );
    let one = Scene::new([(Vec3::splat(1e6), 5.0)]);
    check_all("one", &one, &rays(Vec3::splat(1e6) + Vec3::X * 20.0, Vec3::splat(1e6), 0.6, 16));
    let huge = (0..2000).map(|_| (random.point(), 0.004));
    let huge = Scene::new(huge.chain([(Vec3::new(0.5, 0.5, -50.0), 50.0)]));
    check_all("one huge", &huge, &rays(Vec3::new(0.5, -2.0, 1.5), Vec3::splat(0.5), 0.6, 32));
}

#[test]
fn wide_and_parallel_and_scattered_rays() {
    let scene = random_scene(2000, 0.03, 8);
    // So wide that the rays of one packet share no major axis.
    check_all("wide", &scene, &rays(Vec3::splat(0.5), Vec3::ONE, 3.0, 16));
    let parallel: Vec<_> = (0..32 * 32)
        .map(|i| {
            let (x, y) = ((i % 32) as f32 / 32.0, (i / 32) as f32 / 32.0);
            (Vec3::new(x, y, 3.0), Vec3::new(0.1, -0.2, -1.0).normalize())
        })
        .collect();
    check_all("parallel", &scene, &parallel);
    let mut random = Random(9);
    let scattered: Vec<_> = (0..16 * 16)
        .map(|_| (random.point(), (random.point() - Vec3::splat(0.5)).normalize()))
        .collect();
    check_all("scattered", &scene, &scattered);
}

#[test]
fn culling_spares_tests_and_changes_no_hit() {
    let mut random = Random(77);
    let scene = Scene::new((0..4000).map(|_| (random.point(), 0.01 + 0.02 * random.unit())));
    let classes =
        RadiusClasses::build(&scene.positions, Radii::Each(&scene.radii), Params::default());
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let spheres = [Spheres::new(&classes, &visible)];
    let (mut culling, mut testing) = (Packet::new(), Packet::new());
    testing.test_all();
    for (origin, direction) in rays(Vec3::new(3.0, 2.0, 1.0), Vec3::splat(0.5), 0.1, 8) {
        culling.push(origin, direction);
        testing.push(origin, direction);
    }
    let (mut fewer, mut more) = (Counts::default(), Counts::default());
    let level = Level::new();
    dispatch!(level, simd => trace(simd, &mut culling, &spheres, &mut fewer));
    dispatch!(level, simd => trace(simd, &mut testing, &spheres, &mut more));
    assert!((0..64).all(|i| culling.hit(i) == testing.hit(i)));
    assert!((0..64).any(|i| culling.hit(i).is_some()));
    assert_eq!(more.tested, more.spheres);
    assert_eq!((fewer.tests, more.tests), (64 * fewer.tested, 64 * more.tested));
    assert!(0 < fewer.tested && fewer.tested < fewer.spheres && fewer.spheres <= more.spheres);
}
