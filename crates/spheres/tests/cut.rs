//! Exact cuts against the analytic intersection of spheres and half-spaces: id, depth and normal.

mod common;

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_grid::{
    Clause, Clip, Cut, Face, Params, Plane, Radii, RadiusClasses, Sections, Visibility, Width,
};
use motes_scene::{Lights, Projection, Rays, Scene};
use motes_spheres::{
    Cap, Center, Finer, Paint, Picture, Primary, Settings, Spheres, View, reference, render,
};

use common::Random;

const SIZE: (u32, u32) = (64, 64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f32) as usize
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

struct White;

impl Paint for White {
    fn color(&self, _: u16, _: u32) -> Vec3 {
        Vec3::ONE
    }

    fn cap(&self, _: u16, _: u32, _: Cap) -> Option<Vec3> {
        Some(Vec3::new(1.0, 0.0, 0.0))
    }
}

/// Spheres, and for each kind of them what cuts it.
struct Cuts {
    spheres: Vec<([f32; 3], f32)>,
    clips: Vec<Clip>,
}

impl Cuts {
    fn new(spheres: Vec<([f32; 3], f32)>, clip: Clip) -> Self {
        Self { spheres, clips: vec![clip] }
    }

    fn kind(&self, index: usize) -> usize {
        index % self.clips.len()
    }

    fn render(&self, rays: &Rays, lights: &Lights, settings: Settings) -> Picture {
        let positions: Vec<[f32; 3]> = self.spheres.iter().map(|s| s.0).collect();
        let radii: Vec<f32> = self.spheres.iter().map(|s| s.1).collect();
        let classes = RadiusClasses::build(&positions, Radii::Each(&radii), Params::default());
        let parts: Vec<(Vec<Visibility>, Clip)> = (0..self.clips.len())
            .map(|kind| {
                let keep = |i: u32| self.kind(i as usize) == kind;
                let base = classes.grids.iter();
                let base = base.map(|g| Visibility::where_all(g, &[], Some(&keep))).collect();
                let mut sections = Sections::new(&classes.grids, base, Width::Four);
                sections.set(&classes.grids, self.clips[kind].clone());
                (sections.visible().to_vec(), self.clips[kind].exact())
            })
            .collect();
        let mut systems = Vec::new();
        for (i, (visible, clip)) in parts.iter().enumerate() {
            let clip = (!clip.is_empty()).then_some(clip);
            let spheres = Spheres::new(&classes, visible);
            systems.push(Spheres { clip, continues: i > 0, ..spheres });
        }
        let view = View { rays, systems: &systems, paint: &White, lights, casters: &[] };
        render(view, settings, &|_, _| true).unwrap()
    }

    /// What a ray meets first, with planes and spheres off by as much as rounding may make of them.
    fn truth(&self, ray: (DVec3, DVec3), shift: f64, grown: f64) -> Option<(f64, usize, DVec3)> {
        let mut nearest: Option<(f64, usize, DVec3)> = None;
        for (index, (center, radius)) in self.spheres.iter().enumerate() {
            let clip = &self.clips[self.kind(index)];
            let center = Vec3::from_array(*center);
            let by_center = |clause: &&Clause| !clause.is_exact();
            if !clip.clauses.iter().filter(by_center).all(|clause| clause.keeps(center, *radius)) {
                continue;
            }
            let face = |f: &Face| reference::Face {
                normal: f.plane.normal.as_dvec3(),
                offset: f64::from(f.plane.offset) - shift,
                caps: f.cut == Cut::Caps,
            };
            let clauses: Vec<Vec<_>> = clip
                .exact()
                .clauses
                .iter()
                .map(|clause| clause.faces.iter().map(face).collect())
                .collect();
            let center = center.as_dvec3();
            let sphere = reference::Sphere { center, radius: f64::from(*radius) + grown };
            let Some((t, cap)) = reference::surfaces(ray, sphere, &clauses).first().copied() else {
                continue;
            };
            if nearest.is_none_or(|(n, ..)| t < n) {
                let direction = ray.1.normalize();
                let outward = cap.unwrap_or((ray.0 + direction * t - center).normalize());
                let normal = if outward.dot(direction) < 0.0 { outward } else { -outward };
                nearest = Some((t, index, normal));
            }
        }
        nearest
    }
}

/// Whether a hit is what a ray meets, up to rounding.
fn agrees(hit: &Center, truth: Option<(f64, usize, DVec3)>, slack: f64) -> bool {
    match truth {
        None => hit.id < 0,
        Some((t, index, normal)) => {
            let own = Vec3::from_array(hit.normal).as_dvec3();
            // Towards a sphere's rim the depth, and with it the normal, is ever less certain.
            let facing = normal.z.abs().max(0.02);
            hit.id == index as i64
                && (f64::from(hit.depth) - t).abs() < slack * (1.0 + t) / facing
                && own.distance(normal) < 100.0 * slack / facing
        }
    }
}

fn rays(projection: Projection, origin: Vec3) -> Rays {
    Rays {
        origin,
        forward: Vec3::NEG_Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [SIZE.0 as f32 / 2.0, SIZE.1 as f32 / 2.0],
        pixel: match projection {
            Projection::Perspective => 0.6 / SIZE.1 as f32,
            Projection::Orthographic => 3.0 / SIZE.1 as f32,
        },
        projection,
    }
}

fn settings(primary: Primary) -> Settings {
    Settings {
        size: SIZE,
        samples: 1,
        primary,
        packet: 8,
        layers: true,
        finer: Finer::default(),
        level: Level::new(),
    }
}

fn lights() -> Lights {
    let mut lights = Scene::default().resolve(None).unwrap().lights;
    lights.occlusion_radius = 1.0;
    lights
}

/// Both ways to find what the eye sees first, against the definition. Gives how many rays met a cap.
fn check(name: &str, cuts: &Cuts, rays: &Rays) -> usize {
    let lights = lights();
    let projected = cuts.render(rays, &lights, settings(Primary::Project));
    let traced = cuts.render(rays, &lights, settings(Primary::Trace));
    for (i, both) in projected.layers.iter().zip(traced.layers.iter()).enumerate() {
        assert_eq!(both.0, both.1, "{name}: pixel {i}");
    }
    assert!(projected.color == traced.color, "{name}: light");
    let (mut caps, mut doubts) = (0, 0);
    for (i, hit) in projected.layers.iter().enumerate() {
        let (x, y) = (i as u32 % SIZE.0, i as u32 / SIZE.0);
        let (origin, direction) = rays.ray(x as f32 + 0.5, y as f32 + 0.5);
        let ray = (origin.as_dvec3(), direction.as_dvec3().normalize());
        let slack = 1e-5;
        let truth = cuts.truth(ray, 0.0, 0.0);
        if agrees(&hit, truth, slack) {
            let faces = cuts.clips.iter().flat_map(Clip::faces);
            let normals: Vec<DVec3> = faces.map(|f| f.plane.normal.as_dvec3()).collect();
            let on_cap = |n: DVec3| normals.iter().any(|face| face.dot(n).abs() > 1.0 - 1e-12);
            caps += usize::from(truth.is_some_and(|(.., n)| on_cap(n)));
            continue;
        }
        doubts += 1;
        let near = [-slack, 0.0, slack];
        let variants = near.iter().flat_map(|s| near.iter().map(move |g| (*s, *g)));
        let mut variants = variants.map(|(shift, grown)| cuts.truth(ray, shift, grown));
        let some = variants.any(|truth| agrees(&hit, truth, slack));
        assert!(some, "{name}: ray {x}, {y}: {hit:?} against {truth:?}");
    }
    assert!(doubts * 20 < projected.color.len(), "{name}: {doubts} rays are in doubt");
    caps
}

fn face(point: [f32; 3], normal: [f32; 3], cut: Cut) -> Face {
    let (point, normal) = (Vec3::from(point).as_dvec3(), Vec3::from(normal).as_dvec3());
    Face { plane: Plane::new(point, normal).unwrap(), cut, owner: 3 }
}

fn clip(clauses: &[&[Face]]) -> Clip {
    Clip { clauses: clauses.iter().map(|faces| Clause { faces: faces.to_vec() }).collect() }
}

fn heap(random: &mut Random, count: usize) -> Vec<([f32; 3], f32)> {
    (0..count).map(|_| ((random.vector() * 1.2).to_array(), 0.1 + 0.25 * random.unit())).collect()
}

/// Overlapping spheres in rows, as in a crystal: planes go through many centres at once.
fn lattice() -> Vec<([f32; 3], f32)> {
    let at = |i: usize| [i % 7, i / 7 % 7, i / 49].map(|v| v as f32 * 0.25 - 0.75);
    (0..343).map(|i| (at(i), 0.14)).collect()
}

#[test]
fn random_cuts_are_the_analytic_ones() {
    let random = &mut Random(5);
    let mut caps = 0;
    for round in 0..24 {
        let spheres = heap(random, 150);
        let clause = |random: &mut Random| {
            let by_center = random.unit() < 0.2;
            let faces = 1 + random.below(3) / 2 + random.below(5) / 4;
            let face = |random: &mut Random| {
                let cut = match by_center {
                    true => Cut::Center,
                    false if random.unit() < 0.7 => Cut::Caps,
                    false => Cut::Open,
                };
                face((random.vector() * 0.7).to_array(), random.vector().to_array(), cut)
            };
            Clause { faces: (0..faces).map(|_| face(random)).collect() }
        };
        let one = |random: &mut Random| Clip {
            clauses: (0..1 + round % 3).map(|_| clause(random)).collect(),
        };
        // Kinds of spheres that different planes cut are one system still.
        let clips = (0..1 + round % 2 * 2).map(|_| one(random)).collect();
        let projection =
            if round % 4 == 3 { Projection::Orthographic } else { Projection::Perspective };
        // Before, and amid them.
        let eye = if round % 5 == 4 { random.vector() * 0.5 } else { Vec3::new(0.1, 0.2, 4.0) };
        caps += check(&format!("round {round}"), &Cuts { spheres, clips }, &rays(projection, eye));
    }
    // Enough of them to have tested anything.
    assert!(caps > 4000, "{caps}");
}

#[test]
fn planes_through_centres_and_along_rays_and_spheres_are_cut_alike() {
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]);
    let slab = [face([0.0, 0.0, 0.25], z, Cut::Caps), face([0.0; 3], [0.0, 0.0, 1.0], Cut::Caps)];
    let apart =
        [face([-0.25, 0.0, 0.0], [-1.0, 0.0, 0.0], Cut::Caps), face([0.25; 3], x, Cut::Caps)];
    let all = [
        ("through centres", clip(&[&[face([0.0, 0.0, 0.25], z, Cut::Caps)]])),
        ("open", clip(&[&[face([0.0, 0.0, 0.25], z, Cut::Open)]])),
        ("tangent", clip(&[&[face([0.0, 0.0, 0.25 + 0.14], z, Cut::Caps)]])),
        ("tangent on the other side", clip(&[&[face([0.0, 0.0, 0.25 - 0.14], z, Cut::Caps)]])),
        ("along the rays", clip(&[&[face([0.0; 3], x, Cut::Caps)]])),
        ("a corner", clip(&[&[face([0.0; 3], x, Cut::Caps)], &[face([0.0; 3], y, Cut::Caps)]])),
        ("a slab", clip(&[&slab[..1], &slab[1..]])),
        ("a notch", clip(&[&[face([0.0; 3], x, Cut::Caps), face([0.0; 3], z, Cut::Caps)]])),
        ("two halves apart", clip(&[&apart])),
        ("two halves apart, thinned", clip(&[&apart, &slab[..1]])),
        ("outside", clip(&[&[face([9.0; 3], [-1.0, -1.0, -1.0], Cut::Caps)]])),
        ("twice", clip(&[&slab[..1], &slab[..1]])),
        ("beside the eye", clip(&[&[face([0.0, 0.0, 3.0], z, Cut::Caps)]])),
        ("an open notch", clip(&[&[face([0.0; 3], x, Cut::Open), face([0.0; 3], z, Cut::Caps)]])),
    ];
    for (name, clip) in all {
        for projection in [Projection::Orthographic, Projection::Perspective] {
            let cuts = Cuts::new(lattice(), clip.clone());
            // An eye on the planes' lines, and one beside them.
            for eye in [Vec3::new(0.0, 0.0, 3.0), Vec3::new(0.01, -0.02, 3.1)] {
                check(name, &cuts, &rays(projection, eye));
            }
        }
    }
}

#[test]
fn an_eye_in_a_sphere_sees_what_is_left_of_its_inside() {
    let one = vec![([0.0; 3], 2.0)];
    let eye = Vec3::new(0.1, 0.0, 0.5);
    for cut in [Cut::Caps, Cut::Open] {
        for (point, normal) in [([0.0; 3], [0.0, 0.3, 1.0]), ([0.0, 0.0, 1.0], [0.1, 0.0, -1.0])] {
            let cuts = Cuts::new(one.clone(), clip(&[&[face(point, normal, cut)]]));
            check("within", &cuts, &rays(Projection::Perspective, eye));
        }
    }
}

#[test]
fn everything_taken_away_leaves_nothing() {
    let all = clip(&[&[face([0.0, 0.0, 9.0], [0.0, 0.0, 1.0], Cut::Caps)]]);
    let picture = Cuts::new(lattice(), all).render(
        &rays(Projection::Perspective, Vec3::new(0.0, 0.0, 3.0)),
        &lights(),
        settings(Primary::Project),
    );
    assert_eq!(picture.counts.spheres + picture.counts.tests, 0);
    assert!(picture.layers.iter().all(|c| c.id < 0));
}

#[test]
fn caps_lie_in_full_light_and_have_the_colour_of_the_inside() {
    // A light from the eye, shadows, occlusion: on a flat cap nothing keeps any of it away.
    let mut lights = lights();
    lights.key.direction = Vec3::Z;
    lights.key.shadow_rays = 4;
    lights.occlusion_rays = 8;
    let rays = rays(Projection::Orthographic, Vec3::new(0.0, 0.0, 3.0));
    let half = clip(&[&[face([0.0, 0.0, 0.05], [0.0, 0.0, -1.0], Cut::Caps)]]);
    let picture = Cuts::new(lattice(), half).render(&rays, &lights, settings(Primary::Project));
    let caps = picture.layers.iter().zip(&picture.color);
    let caps: Vec<_> = caps.filter(|(c, _)| c.normal == [0.0, 0.0, 1.0]).map(|c| *c.1).collect();
    assert!(caps.len() > 1000, "{}", caps.len());
    assert!(caps.iter().all(|color| *color == caps[0] && color[0] > 0.5 && color[1] == 0.0));
}

#[test]
fn what_keeps_light_away_may_be_more_than_what_is_seen() {
    // The upper of two spheres is taken away; its shadow stays, if that is asked.
    let positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let classes = RadiusClasses::build(&positions[..], Radii::Uniform(0.4), Params::default());
    let all: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    let mut sections = Sections::new(&classes.grids, all.clone(), Width::One);
    let lower = clip(&[&[face([0.0, 0.0, 0.5], [0.0, 0.0, -1.0], Cut::Center)]]);
    sections.set(&classes.grids, lower);
    let mut lights = lights();
    (lights.key.direction, lights.key.shadow_rays) = (Vec3::Z, 1);
    let rays = rays(Projection::Orthographic, Vec3::new(0.0, 0.0, 3.0));
    let systems = [Spheres::new(&classes, sections.visible())];
    let uncut = [Spheres::new(&classes, &all)];
    let light = |casters| {
        let view = View { rays: &rays, systems: &systems, paint: &White, lights: &lights, casters };
        let picture = render(view, settings(Primary::Project), &|_, _| true).unwrap();
        picture.color[(32 * SIZE.0 + 32) as usize][0]
    };
    assert!(light(&uncut) < 0.7 * light(&[]));
}

#[test]
fn what_a_cut_lays_open_is_lit_where_light_is_as_before_the_cut() {
    let positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let classes = RadiusClasses::build(&positions[..], Radii::Uniform(0.4), Params::default());
    let all: Vec<Visibility> = classes.grids.iter().map(Visibility::all).collect();
    // The lower sphere is halved, the upper one is gone.
    let clip = clip(&[&[face([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], Cut::Caps)]]);
    let mut sections = Sections::new(&classes.grids, all.clone(), Width::One);
    sections.set(&classes.grids, clip.clone());
    let mut lights = lights();
    (lights.key.direction, lights.key.shadow_rays, lights.occlusion_rays) = (Vec3::Z, 4, 4);
    let rays = rays(Projection::Orthographic, Vec3::new(0.0, 0.0, 3.0));
    let systems = [Spheres { clip: Some(&clip), ..Spheres::new(&classes, sections.visible()) }];
    let uncut = [Spheres::new(&classes, &all)];
    let light = |casters| {
        let view = View { rays: &rays, systems: &systems, paint: &White, lights: &lights, casters };
        let picture = render(view, settings(Primary::Project), &|_, _| true).unwrap();
        picture.color[(32 * SIZE.0 + 32) as usize][0]
    };
    assert!((light(&uncut) - light(&[])).abs() < 1e-3 && light(&[]) > 0.5);
}
