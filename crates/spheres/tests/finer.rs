//! What makes pictures finer: more samples where they differ, a lens, one bounce of light.

use fearless_simd::Level;
use glam::Vec3;
use motes_grid::{Params, Radii, RadiusClasses, Visibility};
use motes_scene::{Lens, Lights, Projection, Rays, Scene};
use motes_spheres::{Adaptive, Finer, Paint, Picture, Primary, Settings, Spheres, View, render};

const SIZE: (u32, u32) = (80, 72);
const MIDDLE: usize = (SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize;

/// All particles of one gray.
struct Gray(f32);

impl Paint for Gray {
    fn color(&self, _: u16, _: u32) -> Vec3 {
        Vec3::splat(self.0)
    }
}

/// Looks along −z from `z` at a picture 4 units high at a distance of 10.
fn rays(z: f32, projection: Projection) -> Rays {
    let pixel = 4.0 / SIZE.1 as f32;
    Rays {
        origin: Vec3::new(0.0, 0.0, z),
        forward: Vec3::NEG_Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [SIZE.0 as f32 / 2.0, SIZE.1 as f32 / 2.0],
        pixel: if projection == Projection::Perspective { pixel / 10.0 } else { pixel },
        projection,
    }
}

/// Fill light alone, from everywhere alike, and what a test adds.
fn lights(change: impl FnOnce(&mut Lights)) -> Lights {
    let mut lights = Scene::default().resolve(None).unwrap().lights;
    (lights.key.color, lights.key.shadow_rays) = (Vec3::ZERO, 0);
    (lights.sky, lights.ground, lights.ambient) = (Vec3::ONE, Vec3::ONE, Vec3::ZERO);
    (lights.occlusion_rays, lights.occlusion_radius) = (0, 2.0);
    change(&mut lights);
    lights
}

fn settings(samples: u32, finer: Finer) -> Settings {
    Settings {
        size: SIZE,
        samples,
        primary: Primary::Project,
        packet: 8,
        layers: true,
        finer,
        level: Level::new(),
    }
}

fn adaptive(most: u32, noise: f32) -> Finer {
    Finer { adaptive: Some(Adaptive { most, noise, exposure: 1.0 }), lens: None }
}

fn picture(
    spheres: &[([f32; 3], f32)],
    gray: f32,
    (lights, rays): (&Lights, &Rays),
    settings: Settings,
) -> Picture {
    let positions: Vec<[f32; 3]> = spheres.iter().map(|s| s.0).collect();
    let radii: Vec<f32> = spheres.iter().map(|s| s.1).collect();
    let classes = RadiusClasses::build(&positions, Radii::Each(&radii), Params::default());
    let visible: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let systems = [Spheres::new(&classes, &visible)];
    let view = View { rays, systems: &systems, paint: &Gray(gray), lights, casters: &[] };
    render(view, settings, &|_, _| true).unwrap()
}

/// Many spheres, most smaller than a pixel.
fn dust() -> Vec<([f32; 3], f32)> {
    let unit = |i: u32| (i.wrapping_mul(2_654_435_769) >> 8) as f32 / (1 << 24) as f32;
    let at = |i: u32| [1, 2, 3].map(|axis| 3.0 * unit(5 * i + axis) - 1.5);
    (0..3000u32).map(|i| (at(i), 0.01 + 0.02 * unit(5 * i + 4))).collect()
}

/// Root of the mean squared difference from `truth` where the samples of `few` differ.
fn error(seen: &Picture, truth: &Picture, few: &Picture) -> f32 {
    let (mut sum, mut count) = (0.0, 0);
    for i in (0..few.color.len()).filter(|i| few.color[*i][3] > 0.0 && few.color[*i][3] < 1.0) {
        let squares = seen.color[i].iter().zip(&truth.color[i]).map(|(a, b)| (a - b) * (a - b));
        sum += squares.sum::<f32>();
        count += 1;
    }
    assert!(count > 50);
    (sum / count as f32).sqrt()
}

#[test]
fn pixels_with_equal_samples_get_no_more() {
    // A sphere of one colour: inside and outside nothing differs, at the rim it does.
    let (flat, rays) = (lights(|_| {}), rays(10.0, Projection::Orthographic));
    let of =
        |samples, finer| picture(&[([0.0; 3], 1.5)], 0.5, (&flat, &rays), settings(samples, finer));
    let (few, more, truth) =
        (of(4, Finer::default()), of(4, adaptive(64, 0.02)), of(256, Finer::default()));
    assert!(few.layers == more.layers);
    for (few, more) in few.color.iter().zip(&more.color) {
        let differs = few[3] > 0.0 && few[3] < 1.0;
        assert!(differs || few == more, "{few:?} {more:?}");
    }
    let (before, after) = (error(&few, &truth, &few), error(&more, &truth, &few));
    assert!(after < 0.4 * before, "{after} of {before}");
    // What asks for nothing changes nothing.
    for off in [adaptive(64, 0.0), adaptive(4, 0.01), adaptive(64, 10.0)] {
        assert!(of(4, off).color == few.color, "{off:?}");
    }
}

#[test]
fn dust_comes_nearer_the_truth_and_stays_so_when_it_moves() {
    let lit = lights(|l| (l.key.color, l.key.shadow_rays) = (Vec3::splat(0.5), 1));
    let here = rays(10.0, Projection::Perspective);
    // Half a pixel aside.
    let there = Rays { center: [here.center[0] + 0.5, here.center[1]], ..here };
    let of = |rays, samples, finer| picture(&dust(), 0.8, (&lit, rays), settings(samples, finer));
    for rays in [&here, &there] {
        let truth = of(rays, 256, Finer::default());
        let few = of(rays, 4, Finer::default());
        let more = of(rays, 4, adaptive(32, 0.01));
        let (before, after) = (error(&few, &truth, &few), error(&more, &truth, &few));
        assert!(after < 0.5 * before, "{after} of {before}");
        // A pixel has the one number of samples or the other.
        let all = of(rays, 32, Finer::default());
        let either = |i: usize| more.color[i] == few.color[i] || more.color[i] == all.color[i];
        assert!((0..more.color.len()).all(either));
    }
}

#[test]
fn threads_and_packets_do_not_change_a_finer_picture() {
    let lit = lights(|l| {
        (l.key.color, l.key.shadow_rays) = (Vec3::splat(0.5), 1);
        (l.occlusion_rays, l.bounce_rays) = (2, 2);
    });
    let rays = rays(10.0, Projection::Perspective);
    let lens = Some(Lens { radius: 0.3, focus: 10.0 });
    for finer in [adaptive(16, 0.02), Finer { lens, ..adaptive(16, 0.02) }] {
        let of = |primary, packet| {
            let settings = Settings { primary, packet, ..settings(4, finer) };
            picture(&dust(), 0.8, (&lit, &rays), settings)
        };
        let first = of(Primary::Project, 8);
        for packet in [2, 16] {
            assert!(of(Primary::Trace, packet).color == first.color, "packets of {packet}");
        }
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| of(Primary::Project, 8)).color == first.color);
        }
    }
}

#[test]
fn what_is_in_focus_is_sharp_and_what_is_not_is_blurred() {
    let flat = lights(|_| {});
    let rays = rays(10.0, Projection::Perspective);
    let of = |z: f32, radius: f32, lens| {
        let finer = Finer { adaptive: None, lens };
        picture(&[([0.0, 0.0, z], radius)], 1.0, (&flat, &rays), settings(256, finer))
    };
    let cover = |seen: &Picture| seen.color.iter().map(|c| c[3]).sum::<f32>();
    // Pixels that a picture reaches.
    let wide = |seen: &Picture| seen.color.iter().filter(|c| c[3] > 0.0).count() as f32;
    let lens = Some(Lens { radius: 0.5, focus: 10.0 });
    let (sharp, through) = (of(0.0, 0.02, None), of(0.0, 0.02, lens));
    assert!(sharp.layers == through.layers);
    assert!((wide(&through) - wide(&sharp)).abs() <= 4.0);
    assert!((cover(&through) / cover(&sharp) - 1.0).abs() < 0.05);
    // At twice the distance of focus a point spreads, as seen at the focus, over a disc of half the
    // lens's radius; the sphere itself is seen there at half its own.
    let blurred = of(-10.0, 0.2, lens);
    let radius = (0.5 * 0.5 + 0.5 * 0.2) / (4.0 / SIZE.1 as f32);
    let truth = std::f32::consts::PI * radius * radius;
    assert!((wide(&blurred) / truth - 1.0).abs() < 0.2, "{} of {truth}", wide(&blurred));
    // No light is lost.
    assert!((cover(&blurred) / cover(&of(-10.0, 0.2, None)) - 1.0).abs() < 0.05);
}

#[test]
fn the_inside_of_a_sphere_lights_itself() {
    // Every direction meets the wall, which sends ρ of the light: ρ + ρ² in all.
    let rays = rays(0.3, Projection::Perspective);
    for gray in [0.25, 0.5, 1.0] {
        let lit = lights(|l| l.bounce_rays = 3);
        let seen = picture(&[([0.0; 3], 1.0)], gray, (&lit, &rays), settings(4, Finer::default()));
        for color in &seen.color {
            assert!((color[0] - gray * (1.0 + gray)).abs() < 1e-5, "{gray}: {color:?}");
        }
    }
}

#[test]
fn a_ball_lights_the_floor_by_its_form_factor() {
    // Seen from a floor straight below, a sphere of radius r at height h fills (r/h)² of the
    // cosine-weighted sky. The eye stands between the two.
    let rays = rays(0.5, Projection::Orthographic);
    let lit = lights(|l| l.bounce_rays = 256);
    let scene = [([0.0, 0.0, -20.0], 20.0), ([0.0, 0.0, 2.0], 1.0)];
    let small = Rays { pixel: 1e-4, ..rays };
    let seen = picture(&scene, 0.5, (&lit, &small), settings(4, Finer::default()));
    // Rays start a thousandth of the floor's radius above it.
    let truth = 0.5 * (1.0 + 0.5 / (2.0f32 - 0.02).powi(2));
    assert!((seen.color[MIDDLE][0] - truth).abs() < 2e-3, "{:?}", seen.color[MIDDLE]);
    // The key light bounces too, and is kept away by what lies between: here, under the ball.
    let key = |rays| {
        lights(|l| {
            (l.sky, l.ground) = (Vec3::ZERO, Vec3::ZERO);
            (l.key.color, l.key.direction) = (Vec3::ONE, Vec3::Z);
            (l.key.shadow_rays, l.bounce_rays) = (1, rays);
        })
    };
    // Straight below the ball its shadow is dark, and all it sees of the ball is its dark side.
    let dark = picture(&scene, 0.5, (&key(64), &small), settings(4, Finer::default()));
    assert_eq!(dark.color[MIDDLE], [0.0, 0.0, 0.0, 1.0]);
}
