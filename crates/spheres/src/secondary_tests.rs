//! Shafts and beams against brute force.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use glam::{DVec3, Vec3};
use motes_grid::{
    Clause, Clip, Cut, Face, Params, Plane, Radii, RadiusClasses, Sections, Visibility, Width,
};

use crate::beam::Beam;
use crate::near::{Near, Shelves};
use crate::packet::LANES;
use crate::reference;
use crate::shaft::{Bundle, Cone};
use crate::traverse::{Counts, Spheres};

struct Random(u32);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.0 >> ((self.0 >> 28) + 4)) ^ self.0).wrapping_mul(277_803_737);
        ((word >> 22 ^ word) >> 8) as f32 / (1 << 24) as f32
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }

    fn direction(&mut self) -> Vec3 {
        (self.point() * 2.0 - 1.0).normalize_or(Vec3::X)
    }
}

/// A ray that is to be judged.
#[derive(Clone, Copy)]
struct Ray {
    origin: Vec3,
    direction: Vec3,
    reach: f32,
}

/// Whether a solid sphere reaches into the ray; `None` where f32 may see it either way.
fn blocked(ray: Ray, spheres: &[reference::Sphere]) -> Option<bool> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
    let mut doubt = false;
    for sphere in spheres {
        let oc = sphere.center - o;
        let along = oc.dot(d);
        let inside = sphere.radius.powi(2) - (oc - d * along).length_squared();
        let slack = 1e-5;
        let chord = |inside: f64, slack: f64| {
            inside >= 0.0
                && along + inside.sqrt() > slack
                && along - inside.sqrt() < f64::from(ray.reach) - slack
        };
        if chord(inside - slack * sphere.radius, slack) {
            return Some(true);
        }
        doubt |= chord(inside + slack * sphere.radius, -slack);
    }
    (!doubt).then_some(false)
}

/// Faces of a clip, moved outward by `shift`.
fn faces(clip: &Clip, shift: f64) -> Vec<Vec<reference::Face>> {
    let face = |f: &Face| reference::Face {
        normal: f.plane.normal.as_dvec3(),
        offset: f64::from(f.plane.offset) - shift,
        caps: f.cut == Cut::Caps,
    };
    clip.clauses.iter().map(|c| c.faces.iter().map(face).collect()).collect()
}

/// As [`blocked`], by what a clip leaves.
fn blocked_by_rest(ray: Ray, spheres: &[reference::Sphere], clip: &Clip) -> Option<bool> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
    let solid = clip.faces().all(|face| face.cut == Cut::Caps);
    let judge = |sphere: &reference::Sphere, clauses: &[Vec<reference::Face>], more: f64| {
        let starts_in = o.distance(sphere.center) < sphere.radius && reference::keeps(clauses, o);
        let within = |(t, _): &(f64, _)| *t < f64::from(ray.reach) + more;
        (solid && starts_in) || reference::surfaces((o, d), *sphere, clauses).iter().any(within)
    };
    let slack = 1e-5;
    let variants: Vec<_> = [-slack, 0.0, slack].iter().map(|s| faces(clip, *s)).collect();
    let mut doubt = false;
    for sphere in spheres {
        let mut all = Vec::new();
        for clauses in &variants {
            for grown in [-slack, 0.0, slack] {
                let sphere = reference::Sphere { radius: sphere.radius + grown, ..*sphere };
                all.push(judge(&sphere, clauses, grown));
            }
        }
        if all.iter().all(|blocked| *blocked) {
            return Some(true);
        }
        doubt |= all.iter().any(|blocked| *blocked);
    }
    (!doubt).then_some(false)
}

fn random_clip(random: &mut Random, round: usize) -> Clip {
    let clause = |random: &mut Random| {
        let face = |random: &mut Random| Face {
            plane: Plane::new(random.point().as_dvec3(), random.direction().as_dvec3()).unwrap(),
            cut: if round % 2 == 0 || random.unit() < 0.5 { Cut::Caps } else { Cut::Open },
            owner: 0,
        };
        let faces = 1 + usize::from(random.unit() < 0.4) + usize::from(random.unit() < 0.2);
        Clause { faces: (0..faces).map(|_| face(random)).collect() }
    };
    Clip { clauses: (0..1 + round % 3).map(|_| clause(random)).collect() }
}

struct Scene {
    spheres: Vec<reference::Sphere>,
    classes: RadiusClasses,
    visible: Vec<Visibility>,
    clip: Clip,
}

impl Scene {
    fn new(random: &mut Random, count: usize, radii: (f32, f32)) -> Self {
        let positions: Vec<[f32; 3]> = (0..count).map(|_| random.point().to_array()).collect();
        let radii: Vec<f32> =
            (0..count).map(|_| radii.0 + (radii.1 - radii.0) * random.unit()).collect();
        let spheres = positions.iter().zip(&radii).map(|(p, r)| reference::Sphere {
            center: DVec3::from_array(p.map(f64::from)),
            radius: f64::from(*r),
        });
        let spheres = spheres.collect();
        let classes = RadiusClasses::build(&positions, Radii::Each(&radii), Params::default());
        let visible = classes.grids.iter().map(Visibility::all).collect();
        Self { spheres, classes, visible, clip: Clip::default() }
    }

    fn cut(mut self, clip: Clip) -> Self {
        let mut sections = Sections::new(&self.classes.grids, self.visible, Width::Four);
        sections.set(&self.classes.grids, clip.clone());
        self.visible = sections.visible().to_vec();
        Self { clip, ..self }
    }

    fn systems(&self) -> [Spheres<'_>; 1] {
        let clip = (!self.clip.is_empty()).then_some(&self.clip);
        [Spheres { clip, ..Spheres::new(&self.classes, &self.visible) }]
    }

    /// Compares, and gives how many rays were blocked and how many open.
    fn judge(&self, name: &str, rays: &[Ray], open: &[bool]) -> [usize; 2] {
        let mut counts = [0; 2];
        for (ray, open) in rays.iter().zip(open) {
            let blocked = match self.clip.is_empty() {
                true => blocked(*ray, &self.spheres),
                false => blocked_by_rest(*ray, &self.spheres, &self.clip),
            };
            if let Some(blocked) = blocked {
                assert_eq!(blocked, !open, "{name}: from {} to {}", ray.origin, ray.direction);
                counts[usize::from(*open)] += 1;
            }
        }
        counts
    }
}

fn shaft<S: Simd>(simd: S, rays: &[Ray], systems: &[Spheres<'_>]) -> Vec<bool> {
    let directions: Vec<Vec3> = rays.iter().map(|r| r.direction).collect();
    let cone = Cone::around(&directions).expect("the rays share an axis");
    let mut bundle = Bundle::new();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for sixteen in rays.chunks_exact(LANES) {
        let row = |of: &dyn Fn(&Ray) -> f32| f32x16::from_fn(simd, |lane| of(&sixteen[lane]));
        let rows = |of: &dyn Fn(&Ray) -> Vec3| [0, 1, 2].map(|axis| row(&|r| of(r)[axis]));
        let origins = sixteen.iter().map(|r| r.origin);
        let (l, h) =
            origins.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), o| (l.min(o), h.max(o)));
        (low, high) = (low.min(l), high.max(h));
        let around = (0.5 * (l + h), 0.5 * (h - l).length() * (1.0 + 1e-5));
        bundle.push(rows(&|r| r.origin), rows(&|r| r.direction), row(&|r| r.reach), around);
    }
    let reach = rays.iter().map(|r| r.reach).fold(0.0, f32::max);
    bundle.block(simd, (&cone, (low, high), reach), systems, &mut Counts::default());
    (0..rays.len()).map(|ray| bundle.is_open(ray)).collect()
}

/// Spheres of one size or of many; in every other group of rounds, cut.
fn scene(random: &mut Random, round: usize) -> Scene {
    let radii = if round % 2 == 0 { (0.01, 0.02) } else { (0.002, 0.08) };
    let scene = Scene::new(random, 400, radii);
    match round / 3 % 2 {
        0 => scene,
        _ => scene.cut(random_clip(random, round)),
    }
}

#[test]
fn shafts_find_what_brute_force_finds() {
    let mut random = Random(7);
    let mut seen = [0; 2];
    for round in 0..150 {
        let scene = scene(&mut random, round);
        let systems = scene.systems();
        let axis = if round < 6 {
            [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z][round]
        } else {
            random.direction()
        };
        let (spread, width) = (0.5 * random.unit(), 0.2 * random.unit());
        let start = random.point() * 2.0 - 0.5;
        let reach = if round % 3 == 0 { 0.3 } else { f32::INFINITY };
        let rays: Vec<Ray> = (0..LANES * [1, 3, 40][round % 3])
            .map(|_| Ray {
                origin: start + random.point() * width,
                direction: (axis + random.direction() * spread).normalize(),
                reach,
            })
            .collect();
        let open = dispatch!(Level::new(), simd => shaft(simd, &rays, &systems));
        let counts = scene.judge("shaft", &rays, &open);
        seen = [seen[0] + counts[0], seen[1] + counts[1]];
    }
    assert!(seen.iter().all(|n| *n > 1000), "{seen:?}");
}

#[test]
fn beams_find_what_brute_force_finds() {
    let mut random = Random(11);
    let mut seen = [0; 2];
    for round in 0..80 {
        let scene = scene(&mut random, round);
        let systems = scene.systems();
        let direction = if round < 6 {
            [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z][round]
        } else {
            random.direction()
        };
        let (width, reach) = (0.3 * random.unit(), 0.05 + 0.6 * random.unit());
        let start = random.point();
        let rays: Vec<Ray> = (0..1 + round * 3)
            .map(|_| Ray { origin: start + random.point() * width, direction, reach })
            .collect();
        let mut beam = Beam::new();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (i, ray) in rays.iter().enumerate() {
            for axis in 0..3 {
                beam.origin[axis][i] = ray.origin[axis];
            }
            (low, high) = (low.min(ray.origin), high.max(ray.origin));
        }
        beam.rays = rays.len();
        let shelves = Shelves::new(&systems);
        let mut near = Near::default();
        let open: Vec<bool> = dispatch!(Level::new(), simd => {
            near.find(simd, &shelves, (low, high), reach);
            let mut counts = Counts::default();
            beam.block(simd, (direction, reach), (&near, &shelves), (&systems, &mut counts));
            let bit = |ray: usize| beam.open(simd, ray / LANES * LANES).to_bitmask() >> (ray % LANES) & 1;
            (0..rays.len()).map(|ray| bit(ray) == 1).collect()
        });
        let counts = scene.judge("beam", &rays, &open);
        seen = [seen[0] + counts[0], seen[1] + counts[1]];
    }
    assert!(seen.iter().all(|n| *n > 1000), "{seen:?}");
}
