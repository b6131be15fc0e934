//! What the sets promise: exact counts, their shapes, the same bits for any number of threads.

use super::*;

fn demo(text: &str) -> Particles {
    Demo::parse(text).map(Demo::particles).unwrap_or_else(|e| panic!("{e}"))
}

fn radius(particles: &Particles) -> f32 {
    match particles.radius {
        Radius::Uniform(radius) => radius,
        ref other => panic!("{other:?}"),
    }
}

#[test]
fn counts_are_exact() {
    for (kind, _) in KINDS {
        for n in [0, 1, 2, 3, 7, 24, 100, 255, 257, 1000, 12345] {
            let particles = demo(&format!("{kind}:{n}"));
            assert_eq!(particles.len(), n, "{kind}");
            assert!(radius(&particles).is_finite() && (n == 0 || radius(&particles) > 0.0));
        }
    }
}

#[test]
fn numbers_are_written_as_people_write_them() {
    let count = |text| Demo::parse(text).map(|demo| demo.count);
    assert_eq!(count("dam:1e7"), Ok(10_000_000));
    assert_eq!(count("dam:2.5e5"), Ok(250_000));
    assert_eq!(count("dam:250000"), Ok(250_000));
    for (text, message) in [
        ("dam", "demo:KIND:N"),
        ("dan:1", "'dan'"),
        ("dam:", "whole number"),
        ("dam:1.5", "whole number"),
        ("dam:-1", "whole number"),
        ("dam:nan", "whole number"),
        ("dam:inf", "whole number"),
        ("dam:5e9", "too many"),
    ] {
        assert!(count(text).is_err_and(|e| e.contains(message)), "{text}");
    }
}

#[test]
fn more_than_memory_holds_is_an_error() {
    let reader =
        |n| DemoReader::new(Demo { kind: Kind::Dam, count: n }).read(0, &Wanted::All, &|_, _| {});
    assert!(reader(usize::MAX / 2).is_err_and(|e| e.to_string().contains("do not fit")));
    assert!(reader(10).is_ok());
}

/// FNV-1a over the bits of the positions and the radius.
fn hash(particles: &Particles) -> u64 {
    let words = particles.positions.iter().flatten().copied().chain([radius(particles)]);
    words.flat_map(|v| v.to_bits().to_le_bytes()).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// These are part of what users rely on: pictures of demo sets in documents and benches.
#[test]
fn bits_never_change() {
    let hashes = KINDS.map(|(kind, _)| format!("{:016x}", hash(&demo(&format!("{kind}:20000")))));
    let expected = [
        "ce2222fed2c522d6",
        "b3d0e3f8f0760ecb",
        "0be421d6291fc179",
        "3ac5634957e9687b",
        "936fd6ce885feacd",
        "85393364cc4a8e5e",
        "f89a7719567b44fd",
        "53a6bc7d1bebe6c7",
        "a681e89392aeb9fb",
        "9385e6609f2d5a16",
        "3bdfae49153d81ec",
    ];
    assert_eq!(hashes, expected);
}

#[test]
fn bits_are_the_same_for_any_number_of_threads() {
    for (kind, _) in KINDS {
        let text = format!("{kind}:30000");
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let particles = pool.map(|pool| pool.install(|| demo(&text)));
            assert_eq!(particles.ok(), Some(demo(&text)), "{kind}");
        }
    }
}

#[test]
fn random_fills_the_cube_evenly() {
    let particles = demo("random:80000");
    let mut octants = [0; 8];
    for p in &particles.positions {
        assert!(p.iter().all(|v| (0.0..1.0).contains(v)));
        let at = |axis: usize| usize::from(p[axis] >= 0.5) << axis;
        octants[at(0) | at(1) | at(2)] += 1;
    }
    // 10 000 each, within five standard deviations of the binomial distribution.
    assert!(octants.iter().all(|n| (n - 10_000i32).abs() < 470), "{octants:?}");
    assert!((radius(&particles) - 0.3 / 80000f32.cbrt()).abs() < 1e-8);
}

#[test]
fn packed_is_a_ball_of_touching_spheres() {
    let particles = demo("packed:50000");
    let distance = |p: &[f32; 3]| p.iter().map(|v| (v - 0.5).powi(2)).sum::<f32>().sqrt();
    let farthest = particles.positions.iter().map(distance).fold(0.0, f32::max);
    assert!((0.39..0.4).contains(&farthest), "{farthest}");
    // The close packing fills π/√18 of the ball.
    let filled = 50_000.0 * (radius(&particles) / farthest).powi(3);
    assert!((filled - 0.7405).abs() < 0.01, "{filled}");
}

#[test]
fn dam_is_a_slab_with_spray_in_no_order() {
    let particles = demo("dam:40000");
    let high = |p: &&[f32; 3]| p[2] > 0.5;
    let spray = particles.positions.iter().filter(high).count();
    // 2000 drops, of which more than exp(−(0.5 − 0.25)/0.12) and less than exp(−0.05/0.12) are above 0.5.
    assert!((250..1320).contains(&spray), "{spray}");
    assert!(particles.positions.iter().all(|p| p[2] <= 1.0 && p[0] < 1.01 && p[1] > -0.01));
    let first_half = particles.positions[..20_000].iter().filter(high).count();
    assert!((first_half as f64 / spray as f64 - 0.5).abs() < 0.1, "{first_half} of {spray}");
}

#[test]
fn layers_are_24_sheets_apart() {
    let particles = demo("layers:240000");
    let mut planes: Vec<f32> = particles.positions.iter().map(|p| p[0]).collect();
    planes.sort_unstable_by(f32::total_cmp);
    planes.dedup();
    assert_eq!(planes.len(), 24);
    let gap = planes[1] - planes[0] - 2.0 * radius(&particles);
    assert!(gap > 0.4 / 24.0, "{gap}");
    // No hole: 100 × 100 spheres a sheet, whose half diagonal is within a radius.
    assert!(radius(&particles) > 0.01 / 2f32.sqrt());
}

#[test]
fn checker_leaves_every_other_block_empty() {
    let particles = demo("checker:256000");
    let mut blocks = [0u32; 512];
    for p in &particles.positions {
        let [x, y, z] = p.map(|v| (v * 8.0) as usize);
        blocks[x + 8 * y + 64 * z] += 1;
    }
    for (i, count) in blocks.iter().enumerate() {
        let full = (i + i / 8 + i / 64).is_multiple_of(2);
        assert_eq!(*count, if full { 1000 } else { 0 }, "block {i}");
    }
    assert!(radius(&particles) > 0.0125 * 0.75f32.sqrt());
}

/// The part of the particles with a value in `range`.
fn part(particles: &Particles, range: std::ops::Range<f64>) -> f64 {
    let column = particles.column("Value").unwrap_or_else(|| panic!("no values"));
    let all = particles.len();
    (0..all).filter(|i| range.contains(&column.number(*i, 0))).count() as f64 / all as f64
}

#[test]
fn simulations_have_the_parts_of_the_papers_table_7() {
    let (thunder, torso) = (demo("thunder:30000"), demo("torso:200000"));
    assert!((part(&thunder, 0.0..1.0) - 0.43).abs() < 1e-4);
    let inner = part(&torso, 1.0..4.0);
    assert!((inner - 0.3417).abs() < 0.01, "{inner}");
    let bone = part(&torso, 2.0..4.0);
    assert!(bone > 0.02 && bone < 0.5 * inner, "{bone}");
}

#[test]
fn simulations_are_solids_of_touching_spheres_with_voids() {
    for (kind, least, most) in
        [("cylinder", 0.58, 0.7), ("jp8", 0.2, 0.4), ("foam", 0.15, 0.4), ("torso", 0.4, 0.75)]
    {
        let particles = demo(&format!("{kind}:50000"));
        let (low, high) = particles.bounds().unwrap_or_else(|| panic!("{kind}: empty"));
        let space: f64 = (0..3).map(|i| high[i] - low[i]).product();
        let one = 4.0 / 3.0 * std::f64::consts::PI * f64::from(radius(&particles)).powi(3);
        // The close packing fills 0.74 of the solid.
        let filled = 50_000.0 * one / 0.7405 / space;
        assert!((least..most).contains(&filled), "{kind}: {filled}");
        let values = particles.column("Value").map(|c| c.range());
        assert!(
            values.is_some_and(|v| v[0].is_some_and(|(a, b)| a >= 0.0 && b > a + 0.3)),
            "{kind}"
        );
    }
}
