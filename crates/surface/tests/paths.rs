//! Rays through the liquid: against the exact ball lens, and with blocks against without.

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_scene::{Beyond, Lights, Projection, Rays, Scene, Sight, optics};
use motes_surface::march::{Ray, march, march_blocks};
use motes_surface::packet::march_together;
use motes_surface::reference::{Sphere, voxelize};
use motes_surface::{Around, Blocks, Medium, Mode, Optics, Smoothing, Surfaces, View, shade};

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

fn view(size: (u32, u32), projection: Projection) -> View {
    let pixel = match projection {
        Projection::Perspective => 0.7 / size.1 as f32,
        Projection::Orthographic => 4.0 / size.1 as f32,
    };
    let rays = Rays {
        origin: Vec3::new(0.0, 0.0, -5.0),
        forward: Vec3::Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [size.0 as f32 / 2.0, size.1 as f32 / 2.0],
        pixel,
        projection,
    };
    View { rays, size, near: 0.5, far: 12.0 }
}

fn lights() -> Lights {
    Scene::default().resolve(None).map(|r| r.lights).unwrap_or_else(|e| panic!("{e}"))
}

/// That sky around liquid of a `color`, which nothing shades.
fn around(lights: &Lights, color: Vec3) -> Around<'_> {
    Around {
        level: Level::new(),
        lights,
        beyond: &Hues,
        shown: true,
        shadow: None,
        occlusion: None,
        paint: None,
        color,
    }
}

/// What an eye sees of a clear ball: reflected, and refracted twice, each with the part that goes there.
fn lens(origin: Vec3, direction: Vec3, radius: f32) -> Option<Vec3> {
    let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
    let b = o.dot(d);
    let inside = b * b - o.length_squared() + f64::from(radius).powi(2);
    let point = (o + d * (-b - (inside >= 0.0).then(|| inside.sqrt())?)).as_vec3();
    let normal = point / radius;
    let first = optics::split(direction, normal, 1.0 / WATER);
    let through = first.refracted?;
    let out = point + through * (-2.0 * point.dot(through));
    let second = optics::split(through, -out / radius, WATER);
    let refracted = Hues::light(second.refracted?);
    let reflected = Hues::light(first.reflected);
    Some(reflected * first.reflectance + refracted * (1.0 - first.reflectance))
}

#[test]
fn a_ball_is_a_lens() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let view = view((320, 240), projection);
        let ball = [Sphere { center: DVec3::ZERO, radius: 1.2 }];
        let spans = voxelize((&ball, &[]), &view, 0.0, 7);
        let surfaces = Surfaces::new(spans, view, Smoothing::NONE, Level::new());
        let optics = Optics {
            mode: Mode::Refractive,
            absorption: Vec3::ZERO,
            scattering: Vec3::ZERO,
            depth: 4,
            skip: true,
        };
        let lights = lights();
        let around = around(&lights, Vec3::ONE);
        let picture = shade(&[Medium { surfaces: &surfaces, ior: WATER }], &optics, &around);
        let mut error = 0.0;
        for (i, found) in picture.iter().enumerate() {
            let (x, y) = (i % 320, i / 320);
            let (origin, direction) = view.rays.ray(x as f32 + 0.5, y as f32 + 0.5);
            let expected =
                lens(origin, direction, 1.2).unwrap_or_else(|| Hues::light(direction)).to_array();
            error += (0..3).map(|c| f64::from(found[c] - expected[c]).powi(2)).sum::<f64>();
        }
        let psnr = -10.0 * (error / (3 * 320 * 240) as f64).log10();
        assert!(psnr >= 35.0, "{projection:?}: {psnr} dB");
    }
}

/// Balls here and there, the same each time.
fn drops(count: u32) -> Vec<Sphere> {
    let mut random = 11_u64;
    let mut next = || {
        random =
            random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let drop = |_| Sphere {
        center: DVec3::new(3.0 * next() - 1.5, 2.0 * next() - 1.0, 3.0 * next() - 1.5),
        radius: 0.02 + 0.3 * next() * next(),
    };
    (0..count).map(drop).collect()
}

#[test]
fn blocks_change_no_hit() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let view = view((203, 149), projection);
        let spans = voxelize((&drops(120), &[]), &view, 0.02, 7);
        let surfaces =
            Surfaces::new(spans, view, Smoothing { radius: 0.01, ..Smoothing::NONE }, Level::new());
        let blocks = Blocks::new(Level::new(), &surfaces);
        let (mut hits, mut plain, mut skipped) = (0, 0, 0);
        let (mut rays, mut expected) = (Vec::new(), Vec::new());
        for i in 0..40_000_u32 {
            let pixel = (i * 7919) as usize % view.pixels();
            let of = surfaces.of(pixel);
            if of.is_empty() {
                continue;
            }
            let from = of.start + i as usize % of.len();
            let place = [(pixel % 203) as f32 + 0.5, (pixel / 203) as f32 + 0.5];
            let origin = view.point(place, surfaces.nearness[from]);
            let turn = |k: u32| (f64::from(i * k) * 0.618_033_988_749_895).fract() as f32 - 0.5;
            let Some(direction) = Vec3::new(turn(3), turn(5), turn(7)).try_normalize() else {
                continue;
            };
            let inside = direction.dot(surfaces.normal(from)) < 0.0;
            let ray = Ray { origin, direction, inside, from: Some(from) };
            let ((a, all), (b, some)) =
                (march(&surfaces, &ray), march_blocks((&surfaces, &blocks), &ray));
            assert_eq!(a, b, "{projection:?}: {ray:?}");
            rays.push(ray);
            expected.push(a);
            (hits, plain, skipped) =
                (hits + u32::from(a.is_some()), plain + all, skipped + all - some.min(all));
        }
        assert!(hits > 3000 && skipped > plain / 4, "{hits} hits, {skipped} of {plain} skipped");
        let mut found = Vec::new();
        for count in [1, 15, 700, rays.len()] {
            march_together((&surfaces, &blocks), &rays[..count], &mut found);
            for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
                assert_eq!(found, expected, "{projection:?}, {count}: {:?}", rays[i]);
            }
            assert_eq!(found.len(), count);
        }
    }
}

#[test]
fn thickness_is_what_the_ray_passes() {
    let view = view((64, 48), Projection::Perspective);
    let balls =
        [2.0, 5.0, 8.0].map(|z| Sphere { center: DVec3::new(0.0, 0.0, z - 5.0), radius: 1.0 });
    // Two spans are stored of three; the last counts without what is empty in it.
    let surfaces =
        Surfaces::new(voxelize((&balls, &[]), &view, 0.1, 2), view, Smoothing::NONE, Level::new());
    let middle = 24 * 64 + 32;
    assert!((surfaces.thickness(middle) - 6.0).abs() < 0.02, "{}", surfaces.thickness(middle));
}

#[test]
fn translucent_pixels_are_what_one_works_out_for_each() {
    let lights = lights();
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let view = view((101, 77), projection);
        let spans = voxelize((&drops(40), &[]), &view, 0.0, 2);
        let surfaces = Surfaces::new(spans, view, Smoothing::NONE, Level::new());
        let optics = Optics {
            mode: Mode::Translucent,
            absorption: Vec3::new(1.0, 0.4, 0.1),
            scattering: Vec3::new(0.1, 0.3, 0.2),
            depth: 2,
            skip: true,
        };
        let color = Vec3::new(0.2, 0.4, 0.9);
        let around = around(&lights, color);
        let picture = shade(&[Medium { surfaces: &surfaces, ior: WATER }], &optics, &around);
        let mut most = 0;
        for (i, found) in picture.iter().enumerate() {
            let [x, y] = [i % 101, i / 101].map(|i| i as f32 + 0.5);
            let (_, direction) = view.rays.ray(x, y);
            let of = surfaces.of(i);
            most = most.max(of.len());
            let (mut light, mut left) = (Vec3::ZERO, Vec3::ONE);
            for entry in of.clone().step_by(2) {
                let last = if entry + 2 == of.end { surfaces.empty(i) } else { 0.0 };
                let depth = surfaces.depth(entry + 1) - surfaces.depth(entry) - last;
                let length = depth.max(0.0) / direction.dot(view.rays.forward);
                let extinction = optics.absorption + optics.scattering;
                let through = optics::transmitted(extinction, length);
                let normal = surfaces.normal(entry);
                let key = lights.key.color * normal.dot(lights.key.direction).max(0.0);
                let lit = key + lights.fill(normal) + lights.ambient;
                let scattered = optics.scattering / extinction * color * lit;
                light += left * (Vec3::ONE - through) * scattered;
                left *= through;
            }
            let mut expected = light + left * Hues::light(direction);
            if !of.is_empty() {
                let split = optics::split(direction, surfaces.normal(of.start), 1.0 / WATER);
                expected = expected.lerp(Hues::light(split.reflected), split.reflectance);
            }
            let error = (Vec3::new(found[0], found[1], found[2]) - expected).abs().max_element();
            // Depths near 5 are good to 1e-6, lengths and light to some of these.
            assert!(error < 5e-5 && found[3] == 1.0, "{i}: {found:?} {expected}");
        }
        assert!(most == 4, "{most}");
    }
}

/// What an eye sees of a ball of oil in the middle of a ball of water.
fn lens_in_lens(origin: Vec3, direction: Vec3, radii: [f32; 2], iors: [f32; 2]) -> Option<Vec3> {
    let [inner, outer] = radii;
    // Where a ray from `o` along `d` comes next to the sphere of radius r: the near or the far point.
    let meet = |o: Vec3, d: Vec3, r: f32, far: bool| {
        let b = o.dot(d);
        let inside = b * b - o.length_squared() + r * r;
        let root = (inside > 0.0).then(|| inside.sqrt())?;
        Some(o + d * (-b + if far { root } else { -root }))
    };
    let point = meet(origin, direction, outer, false)?;
    let first = optics::split(direction, point / outer, 1.0 / iors[1]);
    let mut way = (point, first.refracted?);
    if let Some(point) = meet(way.0, way.1, inner, false) {
        let split = optics::split(way.1, point / inner, iors[1] / iors[0]);
        // Along its edge a little goes a long way.
        let into = split.refracted.filter(|_| split.reflectance < 0.03)?;
        let out = meet(point, into, inner, true)?;
        way = (out, optics::split(into, -out / inner, iors[0] / iors[1]).refracted?);
    }
    let out = meet(way.0, way.1, outer, true)?;
    let last = optics::split(way.1, -out / outer, iors[1]).refracted?;
    let reflected = Hues::light(first.reflected) * first.reflectance;
    Some(reflected + Hues::light(last) * (1.0 - first.reflectance))
}

#[test]
fn a_ball_in_a_ball_of_another_liquid_is_a_lens_in_a_lens() {
    // Light is bent four times, at columns that are steps: more of them than for one ball.
    let (radii, iors) = ([0.7, 1.2], [1.6, WATER]);
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let view = view((960, 720), projection);
        let of = |radius: f32| {
            let ball = [Sphere { center: DVec3::ZERO, radius: f64::from(radius) }];
            let spans = voxelize((&ball, &[]), &view, 0.0, 7);
            Surfaces::new(spans, view, Smoothing::NONE, Level::new())
        };
        let surfaces = radii.map(of);
        let media = [0, 1].map(|m| Medium { surfaces: &surfaces[m], ior: iors[m] });
        let optics = Optics {
            mode: Mode::Refractive,
            absorption: Vec3::ZERO,
            scattering: Vec3::ZERO,
            depth: 6,
            skip: true,
        };
        let lights = lights();
        let around = around(&lights, Vec3::ONE);
        let picture = shade(&media, &optics, &around);
        let (mut error, mut count, mut bent) = (0.0_f64, 0, 0);
        for (i, found) in picture.iter().enumerate() {
            let [x, y] = [i % 960, i / 960].map(|i| i as f32 + 0.5);
            let (origin, direction) = view.rays.ray(x, y);
            let plain = lens(origin, direction, 1.2);
            let expected = match plain {
                Some(_) => lens_in_lens(origin, direction, radii, iors),
                None => Some(Hues::light(direction)),
            };
            let Some(expected) = expected else { continue };
            let found = Vec3::new(found[0], found[1], found[2]);
            error += f64::from(found.distance_squared(expected)) / 3.0;
            count += 1;
            bent += usize::from(plain.is_some_and(|p| p.distance(expected) > 0.1));
        }
        let psnr = -10.0 * (error / f64::from(count)).log10();
        assert!(psnr > 35.0, "{projection:?}: {psnr} dB");
        assert!(bent > 10_000, "{projection:?}: the inner ball does something to {bent} pixels");
    }
}

#[test]
fn media_that_are_alike_are_one_liquid() {
    let lights = lights();
    let around = around(&lights, Vec3::new(0.2, 0.4, 0.9));
    let view = view((203, 149), Projection::Perspective);
    let all = drops(30);
    let of = |drops: &[Sphere]| {
        let spans = voxelize((drops, &[]), &view, 0.0, 30);
        Surfaces::new(spans, view, Smoothing::NONE, Level::new())
    };
    let [one, two, both] = [of(&all[..15]), of(&all[15..]), of(&all)];
    for mode in [Mode::Front, Mode::Translucent, Mode::Refractive] {
        let optics = Optics {
            mode,
            absorption: Vec3::new(1.0, 0.4, 0.1),
            scattering: Vec3::splat(0.2),
            depth: 2,
            skip: true,
        };
        let medium = |surfaces| Medium { surfaces, ior: WATER };
        let expected = shade(&[medium(&both)], &optics, &around);
        let found = shade(&[medium(&one), medium(&two)], &optics, &around);
        let off = |(a, b): (&[f32; 4], &[f32; 4])| (0..4).any(|i| (a[i] - b[i]).abs() > 0.02);
        let off = expected.iter().zip(&found).filter(|pair| off(*pair)).count();
        // Normals differ along the seams, by which neighbours they are taken from.
        assert!(off < 203 * 149 / 50, "{mode:?}: {off}");
    }
}
