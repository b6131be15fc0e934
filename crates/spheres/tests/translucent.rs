//! Translucent spheres: every surface along a ray in exact order, and light through them.

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use motes_grid::{Params, Radii, RadiusClasses, Visibility};
use motes_scene::{Lights, Projection, Rays, Scene};
use motes_spheres::{
    Counts, Finer, Packet, Paint, Picture, Primary, Settings, Sphere, Spheres, Surface, View,
    intersect, render, trace,
};

const SIZE: (u32, u32) = (41, 41);

/// White particles, of which all have one opacity but the first.
struct Glass {
    first: f32,
    others: f32,
}

impl Paint for Glass {
    fn color(&self, _: u16, _: u32) -> Vec3 {
        Vec3::ONE
    }

    fn opacity(&self, _: u16, index: u32) -> f32 {
        if index == 0 { self.first } else { self.others }
    }

    fn translucent(&self) -> bool {
        true
    }
}

/// Number `i` of a deterministic sequence in 0..1.
fn unit(i: u32) -> f32 {
    (i.wrapping_mul(2_654_435_769) >> 8) as f32 / (1 << 24) as f32
}

/// Spheres about the unit cube's middle, every tenth of them twice.
fn heap(n: u32) -> (Vec<[f32; 3]>, Vec<f32>) {
    let sphere = |i: u32| {
        let i = if i % 10 == 9 { i - 1 } else { i };
        ([1, 2, 3].map(|axis| unit(7 * i + axis) - 0.5), 0.02 + 0.2 * unit(7 * i + 4))
    };
    (0..n).map(sphere).unzip()
}

/// All surfaces that a ray meets, in order, each by the arithmetic of a lone sphere.
fn sorted(
    (origin, direction): (Vec3, Vec3),
    (positions, radii): (&[[f32; 3]], &[f32]),
) -> Vec<(f32, u32)> {
    let mut all = Vec::new();
    for (i, (center, radius)) in positions.iter().zip(radii).enumerate() {
        let mut packet = Packet::new();
        packet.push(origin, direction);
        packet.begin_system();
        let sphere = Sphere { center: Vec3::from_array(*center), radius: *radius, slot: 0 };
        dispatch!(Level::new(), simd => intersect(simd, &mut packet, sphere, &|slot| slot));
        packet.end_system(0);
        all.extend(packet.hit(0).map(|(distance, ..)| (distance, i as u32)));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

/// All surfaces that the rays meet, found one after the other in packets of `size` rays.
fn peeled(rays: &[(Vec3, Vec3)], spheres: &[Spheres<'_>], size: usize) -> Vec<Vec<(f32, u32)>> {
    let mut all = vec![Vec::new(); rays.len()];
    for first in (0..rays.len()).step_by(size) {
        let mut active: Vec<usize> = (first..(first + size).min(rays.len())).collect();
        while !active.is_empty() {
            let mut packet = Packet::new();
            packet.clear_for_next();
            for ray in &active {
                let before = Surface { distance: 0.0, system: 0, index: 0 };
                let met = all[*ray].last().map_or(before, |(distance, index)| Surface {
                    distance: *distance,
                    system: 0,
                    index: *index,
                });
                packet.push_after(rays[*ray].0, rays[*ray].1, met);
            }
            let mut counts = Counts::default();
            dispatch!(Level::new(), simd => trace(simd, &mut packet, spheres, &mut counts));
            let mut next = Vec::new();
            for (i, ray) in active.into_iter().enumerate() {
                if let Some((distance, _, slot)) = packet.hit(i) {
                    all[ray].push((distance, spheres[0].index(slot)));
                    next.push(ray);
                }
            }
            active = next;
        }
    }
    all
}

#[test]
fn surfaces_come_in_exact_order() {
    let (positions, radii) = heap(400);
    let mut classes = RadiusClasses::build(&positions, Radii::Each(&radii), Params::default());
    classes.grids.iter_mut().for_each(|grid| grid.crowded.clear());
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let spheres = [Spheres::new(&classes, &visible)];
    // From outside, and from amid the spheres.
    for eye in [Vec3::new(2.0, -1.5, 1.0), Vec3::new(0.05, 0.02, -0.03)] {
        let rays: Vec<(Vec3, Vec3)> = (0..150u32)
            .map(|i| {
                let aside = Vec3::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)) - 0.5;
                (eye, (Vec3::new(-0.9, 0.6, -0.4) * 2.0 + aside).normalize())
            })
            .collect();
        let truth: Vec<_> = rays.iter().map(|ray| sorted(*ray, (&positions, &radii))).collect();
        assert!(truth.iter().any(|surfaces| surfaces.len() > 20));
        let tie = |s: &Vec<(f32, u32)>| s.windows(2).any(|w| w[0].0 == w[1].0);
        assert!(truth.iter().any(tie), "the scene has coincident spheres");
        for size in [1, 4, 64, 256] {
            for (seen, truth) in peeled(&rays, &spheres, size).iter().zip(&truth) {
                assert_eq!(seen, truth, "packets of {size}");
            }
        }
    }
}

/// Looks along −z from z = 10 at a picture 4 units high.
fn rays() -> Rays {
    Rays {
        origin: Vec3::new(0.0, 0.0, 10.0),
        forward: Vec3::NEG_Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [SIZE.0 as f32 / 2.0, SIZE.1 as f32 / 2.0],
        pixel: 4.0 / SIZE.1 as f32,
        projection: Projection::Orthographic,
    }
}

/// No light but what a test adds.
fn lights(change: impl FnOnce(&mut Lights)) -> Lights {
    let mut lights = Scene::default().resolve(None).unwrap().lights;
    (lights.key.color, lights.key.shadow_rays) = (Vec3::ZERO, 0);
    (lights.sky, lights.ground, lights.ambient) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    (lights.occlusion_rays, lights.occlusion_radius) = (0, 2.0);
    change(&mut lights);
    lights
}

fn picture(
    (positions, radii): (&[[f32; 3]], &[f32]),
    paint: &dyn Paint,
    lights: &Lights,
    (primary, packet): (Primary, u32),
) -> Picture {
    let classes = RadiusClasses::build(positions, Radii::Each(radii), Params::default());
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let systems = [Spheres::new(&classes, &visible)];
    let rays = rays();
    let view = View { rays: &rays, systems: &systems, paint, lights, casters: &[] };
    let level = Level::new();
    let finer = Finer::default();
    let settings = Settings { size: SIZE, samples: 4, primary, packet, layers: true, finer, level };
    render(view, settings, &|_, _| true).unwrap()
}

fn middle(picture: &Picture) -> [f32; 4] {
    picture.color[(SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize]
}

#[test]
fn layers_of_glass_hide_as_much_as_their_product() {
    let ambient = lights(|l| l.ambient = Vec3::splat(0.5));
    for n in [1, 2, 5] {
        let positions: Vec<_> = (0..n).map(|i| [0.0, 0.0, i as f32 * 2.5 - 5.0]).collect();
        let glass = Glass { first: 0.25, others: 0.25 };
        let spheres = (&positions[..], &vec![1.0; n][..]);
        let seen = picture(spheres, &glass, &ambient, (Primary::Project, 8));
        let truth = 1.0 - 0.75f32.powi(n as i32);
        let [r, _, _, a] = middle(&seen);
        assert!((a - truth).abs() < 1e-6 && (r - 0.5 * truth).abs() < 1e-6, "{n}: {r} {a}");
        // Layers are of the first surface.
        let center = seen.layers.get((SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize);
        assert_eq!(center.id, n as i64 - 1);
    }
}

#[test]
fn what_is_opaque_is_as_without_glass() {
    struct White;
    impl Paint for White {
        fn color(&self, _: u16, _: u32) -> Vec3 {
            Vec3::ONE
        }
    }
    let (positions, radii) = heap(300);
    let lit = lights(|l| {
        (l.key.color, l.key.shadow_rays) = (Vec3::ONE, 2);
        (l.sky, l.occlusion_rays) = (Vec3::ONE, 4);
    });
    let plain = picture((&positions, &radii), &White, &lit, (Primary::Project, 8));
    let glass = Glass { first: 1.0, others: 1.0 };
    let through = picture((&positions, &radii), &glass, &lit, (Primary::Project, 8));
    assert!(plain.layers == through.layers);
    // The same rays, added up in another order.
    for (a, b) in plain.color.as_flattened().iter().zip(through.color.as_flattened()) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}

#[test]
fn light_goes_through_glass() {
    // The light comes from the left; between it and the middle of the great sphere, three of glass.
    let key = lights(|l| {
        (l.key.direction, l.key.cos_half_angle) = (Vec3::new(-1.0, 0.0, 1.0).normalize(), 1.0);
        (l.key.color, l.key.shadow_rays) = (Vec3::ONE, 1);
    });
    let wall: Vec<[f32; 3]> = (0..3).map(|i| [-2.0 - i as f32, 0.0, 3.0 + i as f32]).collect();
    let positions: Vec<_> = [[0.0; 3]].into_iter().chain(wall).collect();
    let spheres = (&positions[..], &[1.0, 0.5, 0.5, 0.5][..]);
    let of = |others| {
        let glass = Glass { first: 1.0, others };
        middle(&picture(spheres, &glass, &key, (Primary::Project, 8)))[0]
    };
    let open = of(0.0);
    assert!(open > 0.3);
    assert!((of(0.5) / open - 0.125).abs() < 1e-4, "{} of {open}", of(0.5));
    assert_eq!(of(1.0), 0.0);
}

#[test]
fn packets_and_threads_do_not_change_a_picture_of_glass() {
    let (positions, radii) = heap(300);
    let glass = Glass { first: 1.0, others: 0.3 };
    let lit = lights(|l| {
        (l.key.color, l.key.shadow_rays) = (Vec3::ONE, 1);
        (l.sky, l.occlusion_rays) = (Vec3::ONE, 2);
    });
    let seen = |how| picture((&positions, &radii), &glass, &lit, how);
    let first = seen((Primary::Project, 8));
    for packet in [2, 4, 16] {
        assert!(seen((Primary::Trace, packet)).color == first.color, "packets of {packet}");
    }
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| seen((Primary::Project, 8))).color == first.color);
    }
}
