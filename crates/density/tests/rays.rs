//! Rays through the field: against the definition, against the exact ball, and pictures against each other.

mod common;

use common::{Random, dam};
use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_density::{
    Around, Field, Liquid, Mask, Optics, Params, Particles, Shadow, Space, View, layers, reference,
    shade,
};
use motes_grid::{Clause, Clip, Cut, Face, Plane, Radii};
use motes_scene::{Beyond, Projection, Rays, Sight, optics};

const WATER: f32 = 1.33;

/// A sky that is different in every direction, and smooth.
struct Hues;

impl Hues {
    fn light(direction: Vec3) -> Vec3 {
        let of = |axis: Vec3| 0.5 + 0.4 * (3.0 * direction.dot(axis)).sin();
        Vec3::new(of(Vec3::new(0.9, 0.3, 0.2)), of(Vec3::Y), of(Vec3::new(-0.3, 0.2, 0.9)))
    }
}

impl Beyond for Hues {
    fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)> {
        (sight.reach == f32::INFINITY).then(|| (Self::light(sight.direction), sight.reach))
    }
}

const AROUND: Around<'static> = Around { beyond: &Hues, shown: true, shadow: None, paint: None };
const CLEAR: Optics = Optics { ior: WATER, absorption: Vec3::ZERO, depth: 4 };

/// A view of `target` from `distance`, of so wide a part.
fn view(target: Vec3, distance: f32, wide: f32, size: (u32, u32)) -> View {
    let forward = Vec3::new(0.6, 0.64, -0.48).normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let rays = Rays {
        origin: target - forward * distance,
        forward,
        right,
        up: right.cross(forward),
        center: [size.0 as f32 / 2.0, size.1 as f32 / 2.0],
        pixel: wide / distance / size.1 as f32,
        projection: Projection::Perspective,
    };
    View { rays, size }
}

fn made(particles: &Particles<'_>, params: &Params) -> (Field, Space) {
    let (mut field, mut space) = (Field::default(), Space::default());
    field.fill(particles, params, Level::new());
    space.fill(&field, (particles, params), Level::new());
    (field, space)
}

#[test]
fn rays_meet_the_surface_where_the_definition_says() {
    let (positions, radius) = dam(16);
    let particles = Particles { positions: &positions, radii: Radii::Uniform(radius), masks: None };
    let params = Params { rough: false, ..Params::with_voxel(2.0 * radius) };
    let (field, space) = made(&particles, &params);
    let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
    let view = view(Vec3::new(0.5, 0.5, 0.3), 4.0, 1.9, (40, 30));
    let lattice = &field.lattice;
    let (mut hits, mut misses, mut missed) = (0, 0, 0);
    for (i, seen) in layers(&liquid, &view).iter().enumerate() {
        let (x, y) = ((i % 40) as f32 + 0.5, (i / 40) as f32 + 0.5);
        let (origin, direction) = view.rays.ray(x, y);
        let ray = (lattice.place(origin).as_dvec3(), DVec3::from(direction));
        let threshold = f64::from(params.threshold);
        let found = reference::crossing(&field, ray, (false, threshold), 160.0);
        match found {
            // Drops are met before the field, or where it is not.
            _ if seen.drop.is_some() => {}
            Some(distance) => {
                // A ray that grazes a crest may be found on the one side only.
                let off = (f64::from(seen.distance / lattice.voxel) - distance).abs();
                missed += u32::from(off.is_nan() || off > 0.01);
                hits += 1;
            }
            None => {
                missed += u32::from(seen.distance.is_finite());
                misses += 1;
            }
        }
    }
    assert!(hits > 200 && misses > 100 && missed <= 3, "{hits} {misses} {missed}");
}

/// The first place where the ray is in kept liquid, by small steps, and whether it comes to it across `plane`.
fn first_kept(
    field: &Field,
    threshold: f32,
    plane: &Plane,
    ray: (Vec3, Vec3),
) -> Option<(f32, bool)> {
    const STEP: f32 = 0.001;
    let lattice = &field.lattice;
    let liquid = |t: f32| field.at(lattice.place(ray.0 + ray.1 * t)) >= threshold;
    let kept = |t: f32| plane.height(ray.0 + ray.1 * t) >= 0.0;
    let at = (0..8000).map(|i| i as f32 * STEP).find(|t| liquid(*t) && kept(*t))?;
    Some((at, !kept(at - STEP)))
}

#[test]
fn cut_liquid_begins_at_the_plane_with_its_normal() {
    let (positions, radius) = dam(16);
    let particles = Particles { positions: &positions, radii: Radii::Uniform(radius), masks: None };
    let params = Params { rough: false, ..Params::with_voxel(2.0 * radius) };
    let (field, space) = made(&particles, &params);
    let view = view(Vec3::new(0.5, 0.5, 0.3), 4.0, 1.9, (40, 30));
    // Away from the eye, so that the plane opens the liquid to it.
    let normal = DVec3::new(0.5, 0.8, -0.2);
    let plane = Plane::new(DVec3::new(0.4, 0.3, 0.25), normal).unwrap();
    for cut in [Cut::Caps, Cut::Open] {
        let face = Face { plane, cut, owner: 0 };
        let clip = Clip { clauses: vec![Clause { faces: vec![face] }] };
        let whole = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
        let open = Liquid { clip: Some(&clip), ..whole };
        let (mut caps, mut own, mut wrong, mut thinner) = (0, 0, 0, 0);
        let both = layers(&open, &view).into_iter().zip(layers(&whole, &view));
        for (i, (seen, before)) in both.enumerate() {
            let ray = view.rays.ray((i % 40) as f32 + 0.5, (i / 40) as f32 + 0.5);
            if seen.drop.is_some() || before.drop.is_some() {
                continue;
            }
            let found = first_kept(&field, params.threshold, &plane, ray);
            let near = |t: f32| (seen.distance - t).abs() < 0.003;
            match found {
                Some((t, true)) => {
                    caps += 1;
                    // Open cuts bend no light, but are where the liquid begins, too.
                    let is_cap = near(t) && (seen.normal + plane.normal).length() < 1e-6;
                    wrong += u32::from(!is_cap);
                }
                Some((t, false)) => {
                    own += 1;
                    wrong += u32::from(!near(t) || (seen.normal + plane.normal).length() < 1e-6);
                }
                None => wrong += u32::from(seen.distance.is_finite()),
            }
            let (less, more) = (seen.thickness, before.thickness);
            assert!(less <= more + 0.02 * field.lattice.voxel, "{i}: {less} of {more}");
            thinner += u32::from(seen.thickness < before.thickness - 0.01);
        }
        assert!(caps > 80 && own > 20 && thinner > 80, "{caps} {own} {thinner}");
        assert!(wrong <= 4, "{cut:?}: {wrong} of {caps} + {own}");
    }
}

/// What an eye sees of a clear ball: reflected, and refracted twice, each with the part that goes there.
fn lens(origin: Vec3, direction: Vec3, (center, radius): (Vec3, f32)) -> Option<Vec3> {
    let (o, d) = ((origin - center).as_dvec3(), direction.as_dvec3());
    let b = o.dot(d);
    let inside = b * b - o.length_squared() + f64::from(radius).powi(2);
    let point = (o + d * (-b - (inside >= 0.0).then(|| inside.sqrt())?)).as_vec3();
    let first = optics::split(direction, point / radius, 1.0 / WATER);
    // Where most is thrown back, paths go that way inside, too.
    let through = first.refracted.filter(|_| first.reflectance < 0.5)?;
    let out = point + through * (-2.0 * point.dot(through));
    let second = optics::split(through, -out / radius, WATER);
    let refracted = Hues::light(second.refracted?);
    let reflected = Hues::light(first.reflected);
    Some(reflected * first.reflectance + refracted * (1.0 - first.reflectance))
}

#[test]
fn a_lone_particle_is_seen_as_a_ball_of_glass() {
    let center = Vec3::new(3.2, -1.1, 7.7);
    let positions = [center.to_array()];
    let particles = Particles { positions: &positions, radii: Radii::Uniform(0.5), masks: None };
    // A voxel is much larger than the particle, or much smaller.
    for voxel in [20.0, 1.0, 0.26] {
        let params = Params::with_voxel(voxel);
        let (field, space) = made(&particles, &params);
        assert_eq!(space.drop_count(), 1);
        let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
        let view = view(center, 6.0, 2.0, (64, 48));
        let picture = shade(&liquid, &view, (&CLEAR, &AROUND), 1);
        let (mut worst, mut seen) = (0.0_f32, 0);
        for (i, found) in picture.iter().enumerate() {
            let (origin, direction) = view.rays.ray((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5);
            let ball = lens(origin, direction, (center, 0.62));
            seen += usize::from(ball.is_some());
            let aside = (center - origin).reject_from_normalized(direction).length();
            // At the very edge little is known of where light goes.
            if ball.is_none() && aside < 0.63 {
                continue;
            }
            let expected = ball.unwrap_or_else(|| Hues::light(direction));
            worst = worst.max((Vec3::from_slice(found) - expected).abs().max_element());
        }
        assert!(seen > 500 && worst < 0.05, "{voxel}: {seen} {worst}");
    }
}

#[test]
fn a_ball_of_liquid_is_a_lens() {
    let mut positions = Vec::new();
    let spacing = 0.05;
    let steps = 22;
    for i in 0..(2 * steps + 1_i32).pow(3) {
        let n = 2 * steps + 1;
        let p = [i % n, i / n % n, i / (n * n)].map(|v| (v - steps) as f32 * spacing);
        if Vec3::from_array(p).length() < 1.0 {
            positions.push(p);
        }
    }
    let particles =
        Particles { positions: &positions, radii: Radii::Uniform(0.5 * spacing), masks: None };
    // Near half of the density: where the liquid ends.
    let params = Params { support: 8.0, threshold: 0.35, ..Params::with_voxel(spacing) };
    let (field, space) = made(&particles, &params);
    let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
    let view = view(Vec3::ZERO, 5.0, 2.6, (96, 72));
    let seen = layers(&liquid, &view);
    // Its radius is as that of the density.
    let middle = seen[36 * 96 + 48].distance;
    let radius = 5.0 - middle;
    assert!((radius - 1.0).abs() < 0.05, "{radius}");
    let mut error = 0.0;
    let picture = shade(&liquid, &view, (&CLEAR, &AROUND), 1);
    for (i, found) in picture.iter().enumerate() {
        let (origin, direction) = view.rays.ray((i % 96) as f32 + 0.5, (i / 96) as f32 + 0.5);
        let expected =
            lens(origin, direction, (Vec3::ZERO, radius)).unwrap_or_else(|| Hues::light(direction));
        error += f64::from((Vec3::from_slice(found) - expected).length_squared());
        let seen = &seen[i];
        // Corners of the lattice are drops.
        if seen.distance.is_finite() && seen.drop.is_none() {
            let point = origin + direction * seen.distance;
            let b = -origin.dot(direction);
            let off = (origin + direction * b).length();
            if off < 0.9 {
                let chord = 2.0 * (radius * radius - off * off).sqrt();
                assert!((seen.thickness - chord).abs() < 0.05, "{} {chord}", seen.thickness);
                // The lattice shows through the surface.
                assert!(seen.normal.dot(point.normalize()) > 0.97, "{}", seen.normal);
            }
        }
    }
    let psnr = -10.0 * (error / (3 * 96 * 72) as f64).log10();
    // The lattice shows through the surface.
    assert!(psnr >= 25.0, "{psnr} dB");
}

#[test]
fn absorption_and_shadow_are_those_of_the_length() {
    let center = Vec3::new(0.5, 0.5, 0.5);
    let positions = [center.to_array()];
    let particles = Particles { positions: &positions, radii: Radii::Uniform(0.5), masks: None };
    let (field, space) = made(&particles, &Params::with_voxel(1.0));
    let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
    // Of the index of what is around, light goes straight on.
    let absorption = Vec3::new(0.2, 0.7, 3.0);
    let straight = Optics { ior: 1.0, absorption, depth: 4 };
    let view = view(center, 4.0, 1.6, (33, 33));
    let picture = shade(&liquid, &view, (&straight, &AROUND), 1);
    let seen = layers(&liquid, &view);
    let middle = 16 * 33 + 16;
    assert!((seen[middle].thickness - 1.24).abs() < 1e-3, "{:?}", seen[middle]);
    for (i, found) in picture.iter().enumerate() {
        let (_, direction) = view.rays.ray((i % 33) as f32 + 0.5, (i / 33) as f32 + 0.5);
        let left = optics::transmitted(absorption, seen[i].thickness);
        let expected = Hues::light(direction) * left;
        assert!((Vec3::from_slice(found) - expected).abs().max_element() < 2e-3, "pixel {i}");
    }
    struct Floor;
    impl Beyond for Floor {
        fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)> {
            let distance = (sight.origin.z + 1.0) / -sight.direction.z;
            (distance > 0.0 && distance <= sight.reach).then_some((Vec3::ONE, distance))
        }
    }
    let shadow = Shadow::new(&liquid, Vec3::Z, (1.5, 0.25));
    let around = Around { beyond: &Floor, shadow: Some(&shadow), ..AROUND };
    let down = Rays {
        origin: Vec3::new(0.5, 0.5, -0.5),
        forward: -Vec3::Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [0.5, 0.5],
        pixel: 1e-3,
        projection: Projection::Perspective,
    };
    let picture = shade(&liquid, &View { rays: down, size: (1, 1) }, (&CLEAR, &around), 1);
    let expected = 0.25 + 0.75 * (-1.5_f32 * 1.24).exp();
    assert!((picture[0][0] - expected).abs() < 0.01, "{:?} {expected}", picture[0]);
}

/// Depths and colours of a dam.
fn picture(params: &Params, masks: Option<&[Mask]>) -> (Vec<f32>, Vec<[f32; 4]>, u64) {
    let (positions, radius) = dam(36);
    let particles = Particles { positions: &positions, radii: Radii::Uniform(radius), masks };
    let (mut field, mut space) = (Field::default(), Space::default());
    field.fill_counted(&particles, params, Level::new());
    space.fill(&field, (&particles, params), Level::new());
    let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
    let view = view(Vec3::new(0.5, 0.5, 0.4), 4.0, 1.8, (120, 90));
    let depths = layers(&liquid, &view).iter().map(|s| s.distance / field.lattice.voxel).collect();
    (depths, shade(&liquid, &view, (&CLEAR, &AROUND), 1), field.counts.updates)
}

#[test]
fn the_rough_field_changes_no_pixel() {
    let params = Params::with_voxel(1.0 / 36.0);
    let plain = picture(&Params { rough: false, ..params }, None);
    let rough = picture(&params, None);
    assert!(plain.0 == rough.0 && plain.1 == rough.1);
    assert!(plain.2 > 2 * rough.2, "{} {}", plain.2, rough.2);
}

/// Masks by their definition, see `motes_sph::masks`.
fn masks() -> Vec<Mask> {
    let (positions, radius) = dam(36);
    let support = 4.0 * radius;
    let cell = |p: &[f32; 3]| p.map(|v| (v / support).floor() as i32);
    let mut cells = std::collections::HashMap::<[i32; 3], Vec<usize>>::new();
    positions.iter().enumerate().for_each(|(i, p)| cells.entry(cell(p)).or_default().push(i));
    let mask = |p: &[f32; 3]| {
        let mut sides = [0.0; 6];
        let [x, y, z] = cell(p);
        for k in 0..27 {
            let near = cells.get(&[x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
            for other in near.into_iter().flatten() {
                let way = Vec3::from_array(positions[*other]) - Vec3::from_array(*p);
                let (r, near) = (way.length(), 1.0 - way.length() / support);
                for axis in (0..3).filter(|_| r > 0.0 && near > 0.0) {
                    let side = 2 * axis + usize::from(way[axis] < 0.0);
                    sides[side] += way[axis] * way[axis] / (r * r) * near;
                }
            }
        }
        sides.map(|sum: f32| (0.5 * sum).min(1.0))
    };
    positions.iter().map(mask).collect()
}

#[test]
fn masks_move_the_surface_by_less_than_a_voxel() {
    let params = Params::with_voxel(1.0 / 36.0);
    let (depths, colors, all) = picture(&Params { rough: false, ..params }, None);
    let (masked, tinted, written) = picture(&Params { masked: true, ..params }, Some(&masks()));
    assert!(all > 3 * written, "{all} {written}");
    let (mut shifts, mut tints, mut one) = (Vec::new(), Vec::new(), 0);
    for i in 0..depths.len() {
        tints.push((0..3).map(|c| (colors[i][c] - tinted[i][c]).abs()).sum::<f32>() / 3.0);
        match (depths[i].is_finite(), masked[i].is_finite()) {
            (true, true) => {
                let shift = (depths[i] - masked[i]).abs();
                // Behind an edge that moves, another surface is seen.
                one += usize::from(shift >= 3.0);
                shifts.push(shift);
            }
            (false, false) => {}
            _ => one += 1,
        }
    }
    let both = shifts.len();
    let spread = |mut all: Vec<f32>| {
        all.sort_by(f32::total_cmp);
        let mean = all.iter().sum::<f32>() / all.len() as f32;
        [mean, all[all.len() * 98 / 100], all[all.len() - 1]]
    };
    let ([shift, most_shift, far], [tint, most_tint, worst]) = (spread(shifts), spread(tints));
    let found = format!("{shift} {most_shift} {far}, {tint} {most_tint} {worst}, {one} of {both}");
    // Voxels, and light.
    assert!(both > 3000 && one < both / 50, "{found}");
    assert!(shift < 0.25 && most_shift < 1.0, "{found}");
    assert!(tint < 0.02 && most_tint < 0.3, "{found}");
}

#[test]
fn the_same_picture_for_any_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let params = Params::with_voxel(1.0 / 36.0);
        pool.map(|pool| pool.install(|| picture(&params, None))).ok()
    };
    let one = with(1);
    assert!(one.is_some() && one == with(2) && one == with(5));
}

#[test]
fn finer_pixels_are_means() {
    let (positions, radius) = dam(12);
    let particles = Particles { positions: &positions, radii: Radii::Uniform(radius), masks: None };
    let (field, space) = made(&particles, &Params::with_voxel(2.0 * radius));
    let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
    let at = |size, finer| {
        let view = view(Vec3::new(0.5, 0.5, 0.4), 4.0, 1.8, size);
        shade(&liquid, &view, (&CLEAR, &AROUND), finer)
    };
    let (fine, found) = (at((160, 120), 1), at((80, 60), 2));
    let mut off = 0;
    for (i, pixel) in found.iter().enumerate() {
        let [x, y] = [2 * (i % 80), 2 * (i / 80)];
        let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
        let mean = four.map(|(x, y)| fine[y * 160 + x][0]).iter().sum::<f32>() / 4.0;
        off += usize::from((pixel[0] - mean).abs() > 0.1);
    }
    assert!(off < found.len() / 100, "{off}");
}

#[test]
fn rays_from_anywhere_end() {
    let (positions, radius) = dam(10);
    let particles = Particles { positions: &positions, radii: Radii::Uniform(radius), masks: None };
    let (field, space) = made(&particles, &Params::with_voxel(2.0 * radius));
    let liquid = Liquid { field: &field, space: &space, clip: None, level: Level::new() };
    let mut random = Random(3);
    for _ in 0..40 {
        let mut eye = view(Vec3::splat(0.5), 1.0, 3.0, (16, 16));
        // In the liquid, in the air, on a node.
        eye.rays.origin = Vec3::new(random.next(), random.next(), 1.5 * random.next());
        eye.rays.forward =
            [Vec3::X, -Vec3::Y, Vec3::Z, Vec3::ONE.normalize()][(random.0 >> 62) as usize];
        let picture = shade(&liquid, &eye, (&CLEAR, &AROUND), 1);
        assert!(picture.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    }
}
