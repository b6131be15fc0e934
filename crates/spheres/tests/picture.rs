//! Whole pictures: known answers, and the same bits however the work is cut.

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_grid::{Params, Radii, RadiusClasses, Visibility};
use motes_scene::{Lamp, Lights, Projection, Rays, Scene};
use motes_spheres::{Finer, Paint, Picture, Primary, Settings, Spheres, View, render};

const SIZE: (u32, u32) = (96, 80);

struct White;

impl Paint for White {
    fn color(&self, _: u16, _: u32) -> Vec3 {
        Vec3::ONE
    }
}

/// Looks along −z from z = 10 at a picture 4 units high.
fn rays(projection: Projection) -> Rays {
    Rays {
        origin: Vec3::new(0.0, 0.0, 10.0),
        forward: Vec3::NEG_Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [SIZE.0 as f32 / 2.0, SIZE.1 as f32 / 2.0],
        pixel: match projection {
            Projection::Perspective => 4.0 / SIZE.1 as f32 / 10.0,
            Projection::Orthographic => 4.0 / SIZE.1 as f32,
        },
        projection,
    }
}

/// The default lights, and what a test changes of them.
fn lights(change: impl FnOnce(&mut Lights)) -> Lights {
    let mut lights = Scene::default().resolve(None).unwrap().lights;
    lights.occlusion_radius = 2.0;
    change(&mut lights);
    lights
}

fn settings(samples: u32) -> Settings {
    Settings {
        size: SIZE,
        samples,
        primary: Primary::Project,
        packet: 8,
        layers: true,
        finer: Finer::default(),
        level: Level::new(),
    }
}

fn picture(
    spheres: &[([f32; 3], f32)],
    lights: &Lights,
    rays: &Rays,
    settings: Settings,
) -> Picture {
    let positions: Vec<[f32; 3]> = spheres.iter().map(|s| s.0).collect();
    let radii: Vec<f32> = spheres.iter().map(|s| s.1).collect();
    let classes = RadiusClasses::build(&positions, Radii::Each(&radii), Params::default());
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let systems = [Spheres::new(&classes, &visible)];
    let view = View { rays, systems: &systems, paint: &White, lights, casters: &[] };
    render(view, settings, &|_, _| true).unwrap()
}

fn heap() -> Vec<([f32; 3], f32)> {
    let unit = |i: u32| (i.wrapping_mul(2_654_435_769) >> 8) as f32 / (1 << 24) as f32;
    (0..600u32)
        .map(|i| {
            let at = [0, 1, 2].map(|axis| 4.0 * unit(3 * i + axis + 1) - 2.0);
            (at, 0.05 + 0.2 * unit(i + 7))
        })
        .collect()
}

/// What the eye's plane cuts is not before the eye, but where it is near.
#[test]
fn spheres_beside_the_eye_are_not_drawn() {
    let beside: Vec<([f32; 3], f32)> = (0..64u32)
        .map(|i| std::f32::consts::TAU * i as f32 / 64.0)
        .map(|around| ([3.0 * around.cos(), 3.0 * around.sin(), 10.0 - 0.04], 0.1))
        .collect();
    let lights = lights(|_| {});
    let seen = picture(&beside, &lights, &rays(Projection::Perspective), settings(1));
    assert_eq!(seen.counts.tests, 0);
    assert!(seen.layers.iter().all(|center| center.id < 0));

    // One that the plane cuts, too, but that reaches into the view.
    let mut near = beside;
    near.push(([0.3, 0.0, 9.98], 0.29));
    let rays = rays(Projection::Perspective);
    let seen = picture(&near, &lights, &rays, settings(1));
    let traced = Settings { primary: Primary::Trace, ..settings(1) };
    assert!(seen.layers.iter().any(|center| center.id == 64));
    assert_eq!(seen.layers, picture(&near, &lights, &rays, traced).layers);
}

fn center_of(picture: &Picture) -> [f32; 4] {
    picture.color[(SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize]
}

#[test]
fn packets_threads_and_tiles_do_not_change_a_picture() {
    let (spheres, lights) = (heap(), lights(|_| {}));
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let rays = rays(projection);
        for samples in [1, 3, 4, 300] {
            let small = Settings { size: (40, 24), ..settings(samples) };
            let first = picture(&spheres, &lights, &rays, small);
            for packet in [2, 4, 8, 16] {
                let traced = Settings { primary: Primary::Trace, packet, ..small };
                let other = picture(&spheres, &lights, &rays, traced);
                assert!(other.color == first.color, "{samples} samples, packets of {packet}");
                assert!(other.layers == first.layers);
            }
            if samples == 300 {
                continue;
            }
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let other = pool.install(|| picture(&spheres, &lights, &rays, small));
                assert!(other.color == first.color, "{threads} threads");
            }
        }
    }
}

#[test]
fn a_silhouette_covers_what_geometry_says() {
    let dark = lights(|l| (l.key.shadow_rays, l.occlusion_rays) = (0, 0));
    let seen = picture(&[([0.0; 3], 1.5)], &dark, &rays(Projection::Orthographic), settings(64));
    let pixel = 4.0 / SIZE.1 as f32;
    let area: f32 = seen.color.iter().map(|c| c[3]).sum::<f32>() * pixel * pixel;
    let truth = std::f32::consts::PI * 1.5 * 1.5;
    assert!((area / truth - 1.0).abs() < 1e-3, "{area} against {truth}");
    // In perspective the cone that touches the sphere: tan² = r²/(d² − r²).
    let seen = picture(&[([0.0; 3], 1.5)], &dark, &rays(Projection::Perspective), settings(64));
    let pixel = pixel / 10.0;
    let area: f32 = seen.color.iter().map(|c| c[3]).sum::<f32>() * pixel * pixel;
    let truth = std::f32::consts::PI * 1.5 * 1.5 / (100.0 - 1.5 * 1.5);
    assert!((area / truth - 1.0).abs() < 1e-3, "{area} against {truth}");
}

#[test]
fn a_surface_that_faces_the_light_has_its_color() {
    let plain = lights(|l| {
        (l.key.shadow_rays, l.occlusion_rays) = (0, 0);
        (l.sky, l.ground, l.ambient) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        (l.key.direction, l.key.color) = (Vec3::Z, Vec3::new(0.5, 0.25, 1.0));
    });
    let seen = picture(&[([0.0; 3], 1.9)], &plain, &rays(Projection::Orthographic), settings(1));
    let [r, g, b, a] = center_of(&seen);
    assert!(
        (r - 0.5).abs() < 1e-3 && (g - 0.25).abs() < 1e-3 && (b - 1.0).abs() < 1e-3 && a == 1.0
    );
    // Ambient light alone is flat.
    let flat = lights(|l| {
        (l.key.color, l.sky, l.ground) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        l.ambient = Vec3::splat(0.5);
    });
    let seen = picture(&[([0.0; 3], 1.9)], &flat, &rays(Projection::Orthographic), settings(1));
    assert!(seen.color.iter().all(|c| *c == [0.0; 4] || *c == [0.5, 0.5, 0.5, 1.0]));
}

#[test]
fn a_lone_sphere_occludes_nothing_of_itself() {
    let open = lights(|l| (l.key.shadow_rays, l.occlusion_rays) = (4, 0));
    let occluded = lights(|l| (l.key.shadow_rays, l.occlusion_rays) = (4, 8));
    let rays = rays(Projection::Perspective);
    let sphere = [([0.0; 3], 1.5)];
    let first = picture(&sphere, &open, &rays, settings(4));
    assert!(first.color == picture(&sphere, &occluded, &rays, settings(4)).color);
}

#[test]
fn what_stands_before_the_light_casts_a_shadow() {
    // The light comes from the left; a sphere between it and the middle of the great one.
    let only_key = |rays| {
        lights(|l| {
            (l.sky, l.ground, l.ambient) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
            l.key.direction = Vec3::new(-1.0, 0.0, 1.0).normalize();
            (l.key.shadow_rays, l.occlusion_rays) = (rays, 0);
        })
    };
    let rays = rays(Projection::Orthographic);
    let blocked = [([0.0; 3], 1.0), ([-2.0, 0.0, 3.0], 0.5)];
    let dark = picture(&blocked, &only_key(4), &rays, settings(1));
    assert_eq!(center_of(&dark), [0.0, 0.0, 0.0, 1.0]);
    let lit = picture(&blocked, &only_key(0), &rays, settings(1));
    assert!(center_of(&lit)[0] > 0.3);
}

#[test]
fn a_crevice_is_darker_than_the_open() {
    let fill = |rays| {
        lights(|l| {
            (l.key.color, l.key.shadow_rays) = (Vec3::ZERO, 0);
            l.occlusion_rays = rays;
        })
    };
    // A floor of one huge sphere, and a wall of small ones around its middle.
    let wall = (0..24).map(|i| {
        let turn = i as f32 / 24.0 * std::f32::consts::TAU;
        ([0.6 * turn.cos(), 0.6 * turn.sin(), 0.2], 0.2)
    });
    let spheres: Vec<_> = wall.chain([([0.0, 0.0, -100.0], 100.0)]).collect();
    let rays = rays(Projection::Orthographic);
    let open = center_of(&picture(&spheres, &fill(0), &rays, settings(4)))[0];
    let walled = center_of(&picture(&spheres, &fill(64), &rays, settings(4)))[0];
    // The wall hides the sky up to 33°–45° above the horizon: sin² of that, weighted by the cosine.
    assert!(walled < 0.8 * open && walled > 0.4 * open, "{walled} against {open}");
}

#[test]
fn the_middle_ray_tells_depth_normal_and_particle() {
    let spheres = [([0.0, 0.0, -3.0], 1.0), ([0.0, 0.0, 2.0], 1.0)];
    let odd = Settings { size: (41, 41), ..settings(4) };
    let rays = Rays { center: [20.5, 20.5], ..rays(Projection::Perspective) };
    let seen = picture(&spheres, &lights(|_| {}), &rays, odd);
    let middle = seen.layers.get(20 * 41 + 20);
    assert_eq!((middle.id, middle.system), (1, 0));
    assert!((middle.depth - 7.0).abs() < 1e-5);
    assert!(Vec3::from_array(middle.normal).distance(Vec3::Z) < 1e-4);
    let corner = seen.layers.get(0);
    assert_eq!((corner.id, corner.depth, corner.normal), (-1, f32::INFINITY, [0.0; 3]));
}

#[test]
fn a_watch_can_cancel() {
    let (spheres, lights, rays) = (heap(), lights(|_| {}), rays(Projection::Perspective));
    let positions: Vec<[f32; 3]> = spheres.iter().map(|s| s.0).collect();
    let classes = RadiusClasses::build(&positions, Radii::Uniform(0.1), Params::default());
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let systems = [Spheres::new(&classes, &visible)];
    let view =
        View { rays: &rays, systems: &systems, paint: &White, lights: &lights, casters: &[] };
    assert!(render(view, settings(1), &|_, _| false).is_none());
}

#[test]
fn the_world_can_be_far_from_its_origin() {
    // The same spheres seen from a camera that was resolved about another origin.
    let scene = Scene::default();
    let far = DVec3::new(4e6, -3e6, 1e5);
    let bounds = |at: DVec3| motes_scene::Bounds::of_spheres([(at, 1.0)]);
    let near = scene.resolve(bounds(DVec3::ZERO)).unwrap().view.rays(DVec3::ZERO);
    let away = scene.resolve(bounds(far)).unwrap().view.rays(far);
    assert!(near.origin.distance(away.origin) < 1e-6 * near.origin.length());
}

#[test]
fn a_lamp_lights_and_shadows_from_where_it_is() {
    // A lamp above the middle sphere, and another sphere half way to it.
    let lamp = |radius: f32| {
        lights(|l| {
            l.key.lamp = Some(Lamp { center: DVec3::new(0.0, 0.0, 6.0), radius });
            l.key.shadow_rays = 64;
            l.occlusion_rays = 0;
        })
    };
    let view = rays(Projection::Orthographic);
    let ball = ([0.0; 3], 1.0);
    let free = picture(&[ball], &lamp(0.1), &view, settings(1));
    let middle = center_of(&free)[1];
    assert!(middle > 0.5, "{middle}");
    // What stands beyond the lamp takes nothing from it.
    let beyond = picture(&[ball, ([0.0, 1.9, 7.5], 0.3)], &lamp(0.1), &view, settings(1));
    assert_eq!(center_of(&beyond), center_of(&free));
    // A sphere off the line of sight between lamp and ball shadows where the line through it leads: from
    // (0, 0, 6) through (0, 0.3, 3.5) to the ball at about y = 0.62.
    let before = picture(&[ball, ([0.0, 0.3, 3.5], 0.1)], &lamp(0.01), &view, settings(1));
    let row = |picture: &Picture, y: f32| {
        let row = (SIZE.1 as f32 / 2.0 - y * SIZE.1 as f32 / 4.0) as u32;
        picture.color[(row * SIZE.0 + SIZE.0 / 2) as usize][1]
    };
    assert!(row(&before, 0.62) < 0.7 * row(&free, 0.62));
    assert!((row(&before, -0.62) - row(&free, -0.62)).abs() < 1e-6);
}

#[test]
fn light_from_everywhere_and_from_one_point_agrees_with_the_open() {
    // Lights so wide that their rays share no axis.
    for half_angle in [0.0f32, 30.0, 80.0, 179.0] {
        for shadow_rays in [1, 16, 17] {
            let wide = |shadows: u32| {
                lights(|l| {
                    l.key.cos_half_angle = half_angle.to_radians().cos();
                    (l.key.shadow_rays, l.occlusion_rays) = (shadows, 0);
                })
            };
            let view = rays(Projection::Perspective);
            let alone = |shadows| picture(&[([0.0; 3], 1.5)], &wide(shadows), &view, settings(1));
            // Nothing is in the way of a sphere's own light.
            assert!(alone(shadow_rays).color == alone(0).color, "{half_angle}°, {shadow_rays}");
            let covered = [([0.0; 3], 1.0), ([0.0, 0.0, 1.2], 1.9)];
            let seen = picture(&covered, &wide(shadow_rays), &view, settings(1));
            assert!(seen.color.iter().all(|c| c.iter().all(|v| v.is_finite())));
        }
    }
}
