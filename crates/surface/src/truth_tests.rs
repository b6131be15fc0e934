//! Spans against their definition, and against themselves by other ways.

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_grid::{Grid, Radii, Visibility};
use motes_scene::{Projection, Rays};

use crate::reference::{self, Cube, End, Sphere};
use crate::{Bits, Boundary, Cull, Input, Marks, Params, Particles, Representation};
use crate::{Spans, View, voxelize};

/// Numbers from 0 to 1, the same every time.
pub(crate) struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    pub fn point(&mut self) -> [f32; 3] {
        [self.next(), self.next(), self.next()]
    }
}

/// A liquid and how it is seen.
pub(crate) struct Case {
    pub name: &'static str,
    pub positions: Vec<[f32; 3]>,
    pub radii: Radii,
    pub view: View,
    pub params: Params,
}

impl Case {
    pub fn input(&self) -> Input<'_> {
        let radii = match &self.radii {
            Radii::Uniform(r) => Radii::Uniform(*r),
            Radii::Each(radii) => Radii::Each(&radii[..]),
        };
        Input { particles: Particles::Unsorted(&self.positions, radii), radius_scale: 1.0 }
    }

    fn radius(&self, i: usize) -> f32 {
        match &self.radii {
            Radii::Uniform(r) => *r,
            Radii::Each(radii) => radii[i],
        }
    }

    pub fn boundary(&self) -> Boundary {
        Boundary::extract(&self.input(), &self.params, Level::new())
    }

    pub fn spans(&self) -> Spans {
        voxelize(&self.boundary(), &self.view, &self.params, Level::new()).0
    }

    /// The spheres of the definition, all of them, and its inner cells.
    pub fn matter(&self) -> (Vec<Sphere>, Vec<Cube>) {
        let center = |p: &[f32; 3]| Vec3::from_array(*p).as_dvec3();
        let spheres = self
            .positions
            .iter()
            .enumerate()
            .map(|(i, p)| Sphere { center: center(p), radius: f64::from(self.radius(i)) });
        let cubes = self.boundary().lattice().map(|(low, edge)| {
            let centers: Vec<DVec3> = self.positions.iter().map(center).collect();
            let least = if let Cull::Count(n) = self.params.cull { n as usize } else { 1 };
            reference::inner_cells(&centers, low.as_dvec3(), f64::from(edge), least)
        });
        (spheres.collect(), cubes.unwrap_or_default())
    }

    /// What f32 arithmetic may move a surface along the perpendicular: lengths are rounded to 2⁻²⁴, a
    /// dozen times.
    pub fn delta(&self) -> f64 {
        let eye = self.view.rays.origin;
        let reach = self.positions.iter().map(|p| (Vec3::from_array(*p) - eye).length());
        let coordinates = self.positions.iter().map(|p| Vec3::from_array(*p).abs().max_element());
        let size = reach.chain(coordinates).fold(eye.abs().max_element(), f32::max);
        f64::from(f32::EPSILON) * 6.0 * f64::from(size)
    }
}

pub(crate) fn rays(size: (u32, u32), fov: f32) -> Rays {
    Rays {
        origin: Vec3::new(0.5, 0.5, -2.0),
        forward: Vec3::Z,
        right: Vec3::X,
        up: Vec3::Y,
        center: [size.0 as f32 / 2.0, size.1 as f32 / 2.0],
        pixel: 2.0 * (fov.to_radians() / 2.0).tan() / size.1 as f32,
        projection: Projection::Perspective,
    }
}

/// A view from `eye` towards `target`.
pub(crate) fn look(eye: Vec3, target: Vec3, size: (u32, u32)) -> View {
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let rays = Rays { origin: eye, forward, right, up: right.cross(forward), ..rays(size, 35.0) };
    View { rays, size, near: 0.3, far: 6.0 }
}

/// A box of liquid, as a lattice with jitter, and some spray; spacing 1/n.
pub(crate) fn dam(n: usize) -> Vec<[f32; 3]> {
    let (mut numbers, spacing) = (Numbers(7), 1.0 / n as f32);
    let mut positions = Vec::new();
    for z in 0..n {
        for y in 0..2 * n / 3 {
            for x in 0..n {
                let jitter = numbers.point().map(|v| 0.2 * (v - 0.5));
                let at = [x as f32 + jitter[0], y as f32 + jitter[1], z as f32 + jitter[2]];
                positions.push(at.map(|v| v * spacing));
            }
        }
    }
    positions.extend((0..n * n / 4).map(|_| numbers.point()));
    positions
}

pub(crate) fn cases() -> Vec<Case> {
    let size = (44, 30);
    let view = look(Vec3::new(1.9, 1.3, -1.2), Vec3::splat(0.5), size);
    let mut numbers = Numbers(1);
    let random: Vec<[f32; 3]> = (0..800).map(|_| numbers.point()).collect();
    let several = (0..800).map(|_| 0.004 + 0.1 * numbers.next().powi(6)).collect();
    let dam = dam(16);
    let params = Params { gap: 0.02, ..Params::default() };
    let liquid = Params { gap: 2.0 / 32.0, ..params };
    let case = |name, positions: &Vec<[f32; 3]>, radius, view, params| Case {
        name,
        positions: positions.clone(),
        radii: Radii::Uniform(radius),
        view,
        params,
    };
    let through = View { rays: Rays { up: Vec3::X, right: -Vec3::Y, ..rays(size, 60.0) }, ..view };
    let inside = |eye: Vec3| {
        let view = look(eye, Vec3::new(0.9, 0.31, 0.7), size);
        View { near: 0.05, far: 2.0, ..view }
    };
    let flat = Rays { projection: Projection::Orthographic, pixel: 0.05, ..view.rays };
    let square = Rays { projection: Projection::Orthographic, pixel: 1.0 / 32.0, ..through.rays };
    let row: Vec<[f32; 3]> = (0..3000).map(|i| [0.5, 0.5, i as f32 * 0.003]).collect();
    let narrow = View { rays: Rays { pixel: 5e-5, ..square }, near: 1.0, far: 12.0, ..view };
    let mut cases = vec![
        case("sparse", &random, 0.02, view, params),
        case("dense", &random, 0.12, view, params),
        case("no gap bridged", &random, 0.05, view, Params { gap: 0.0, ..params }),
        case("all bridged", &random, 0.03, view, Params { gap: 5.0, ..params }),
        case("dam", &dam, 0.0406, view, liquid),
        case("dam along its lattice", &dam, 0.0406, through, liquid),
        case("dam, spheres alone", &dam, 0.0406, view, Params { cull: Cull::Off, ..liquid }),
        case("dam, counted", &dam, 0.0406, view, Params { cull: Cull::Count(2), ..liquid }),
        case("eye inside", &dam, 0.0406, inside(Vec3::new(0.5, 0.3, 0.5)), liquid),
        case("eye in spray", &dam, 0.0406, inside(Vec3::new(0.3, 0.8, 0.3)), liquid),
        case("eye at the surface", &dam, 0.0406, inside(Vec3::new(0.2, 0.66, 0.1)), liquid),
        case("near plane", &dam, 0.0406, View { near: 1.7, far: 2.3, ..view }, liquid),
        case("orthographic", &dam, 0.0406, View { rays: flat, ..view }, liquid),
        case("along the faces of cells", &dam, 0.0406, View { rays: square, ..view }, liquid),
        case("thousands of layers", &row, 0.001, narrow, Params { gap: 1e-4, ..params }),
        case("huge spheres", &random[..20].to_vec(), 0.7, view, params),
    ];
    cases.push(Case { radii: Radii::Each(several), ..case("radii", &random, 0.0, view, params) });
    cases
}

/// The spans of a pixel with everything enlarged by `delta`, and what is bridged too.
fn enlarged(
    case: &Case,
    matter: &(Vec<Sphere>, Vec<Cube>),
    at: (u32, u32),
    delta: f64,
) -> Vec<[End; 2]> {
    let ball = |s: &Sphere| Sphere { radius: (s.radius + delta).max(0.0), ..*s };
    let cube = |c: &Cube| Cube { low: c.low - delta, edge: c.edge + 2.0 * delta };
    let spheres: Vec<Sphere> = matter.0.iter().map(ball).collect();
    let cubes: Vec<Cube> = matter.1.iter().map(cube).collect();
    let gap = f64::from(case.params.gap) + 4.0 * delta;
    reference::column((&spheres, &cubes), &case.view, at, gap)
}

#[test]
fn spans_are_those_of_the_definition() {
    for case in cases() {
        let params = Params { spans: 10_000, ..case.params };
        let spans = voxelize(&case.boundary(), &case.view, &params, Level::new()).0;
        let (matter, delta) = (case.matter(), case.delta());
        let (mut doubtful, mut compared) = (0, 0);
        for pixel in 0..case.view.pixels() {
            let at = (pixel as u32 % case.view.size.0, pixel as u32 / case.view.size.0);
            // All that f32 makes of the liquid lies between these two.
            let (more, less) =
                (enlarged(&case, &matter, at, delta), enlarged(&case, &matter, at, -delta));
            if more.len() != less.len() {
                doubtful += 1;
                continue;
            }
            let found = &spans.depths[2 * spans.of(pixel).start..2 * spans.of(pixel).end];
            assert_eq!(
                found.len(),
                2 * more.len(),
                "{} at {at:?}: {found:?}, not {more:?}",
                case.name
            );
            for (found, (more, less)) in found.chunks(2).zip(more.iter().zip(&less)) {
                let [entry, exit] = [f64::from(found[0]), f64::from(found[1])];
                let right = more[0].0 - delta <= entry
                    && entry <= less[0].0 + delta
                    && less[1].0 - delta <= exit
                    && exit <= more[1].0 + delta;
                assert!(right, "{} at {at:?}: {found:?}, not {more:?} to {less:?}", case.name);
                compared += 1;
            }
        }
        assert!(compared > 100, "{}: only {compared} spans", case.name);
        assert!(doubtful * 25 <= case.view.pixels(), "{}: {doubtful} in doubt", case.name);
    }
}

#[test]
fn what_is_left_out_changes_nothing() {
    let mut left_out = 0;
    for case in
        cases().into_iter().filter(|c| c.name.starts_with("dam") || c.name.starts_with("eye"))
    {
        let culled = case.boundary();
        left_out += culled.counts.particles - culled.counts.kept;
        let whole = Params { cull: Cull::Off, ..case.params };
        let parts = Boundary::extract(&case.input(), &whole, Level::new()).parts;
        let spans = voxelize(&culled, &case.view, &case.params, Level::new()).0;
        let all = Boundary { parts, ..culled };
        assert!(!spans.is_empty(), "{}", case.name);
        let expected = voxelize(&all, &case.view, &case.params, Level::new()).0;
        assert_eq!(spans, expected, "{}", case.name);
    }
    assert!(left_out > 1000, "only {left_out} left out");
}

#[test]
fn bits_are_within_a_layer_of_the_definition() {
    for case in cases() {
        let bits = Bits { angle: 0.1, layers: 1 << 16, ..Bits::default() };
        let bits_of = |marks, tile| {
            let representation = Representation::Bits(Bits { marks, ..bits });
            let params = Params { spans: 10_000, representation, tile, ..case.params };
            voxelize(&case.boundary(), &case.view, &params, Level::new())
        };
        let (spans, stats) = bits_of(Marks::Whole, 64);
        assert_eq!(bits_of(Marks::Surface, 64).0, spans, "{}: surfaces alone", case.name);
        assert_eq!(bits_of(Marks::Whole, 16).0, spans, "{}: small tiles", case.name);
        // The thickest layer, and what f32 may move besides.
        let perspective = case.view.rays.projection == Projection::Perspective;
        let depth = if perspective { case.view.far } else { 1.0 };
        let layer = f64::from(stats.layer_step * depth) * 1.001 + case.delta();
        let matter = case.matter();
        let (mut compared, mut doubtful) = (0, 0);
        for pixel in 0..case.view.pixels() {
            let at = (pixel as u32 % case.view.size.0, pixel as u32 / case.view.size.0);
            let direction = case.view.column(at.0, at.1).1.length();
            let of_gap = |layers: f64| {
                let gap = f64::from(case.params.gap) + layers * layer * direction;
                reference::column((&matter.0, &matter.1), &case.view, at, gap)
            };
            let delta = case.delta();
            let (more, less) =
                (enlarged(&case, &matter, at, delta), enlarged(&case, &matter, at, -delta));
            if of_gap(2.0).len() != of_gap(-2.0).len() || more.len() != less.len() {
                doubtful += 1;
                continue;
            }
            let found = &spans.depths[2 * spans.of(pixel).start..2 * spans.of(pixel).end];
            assert_eq!(found.len(), 2 * more.len(), "{} at {at:?}", case.name);
            let expected = more.as_flattened().iter().zip(less.as_flattened());
            for (found, (more, less)) in found.iter().zip(expected) {
                let found = f64::from(*found);
                let right =
                    more.0.min(less.0) - layer <= found && found <= more.0.max(less.0) + layer;
                assert!(right, "{} at {at:?}: {found}, not {}", case.name, more.0);
                compared += 1;
            }
        }
        assert!(compared > 50, "{}: only {compared} surfaces", case.name);
        assert!(doubtful * 2 < case.view.pixels(), "{}: {doubtful} in doubt", case.name);
    }
}

fn levels() -> Vec<Level> {
    let mut levels = vec![Level::baseline(), Level::new()];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(Level::new().as_avx2().map(Level::Avx2));
        levels.extend(Level::new().as_sse4_2().map(Level::Sse4_2));
    }
    levels
}

#[test]
fn tiles_threads_and_instructions_change_nothing() {
    for case in cases() {
        let expected = case.spans();
        for level in levels() {
            let boundary = Boundary::extract(&case.input(), &case.params, level);
            let found = voxelize(&boundary, &case.view, &case.params, level).0;
            assert_eq!(found, expected, "{} with {level:?}", case.name);
        }
        for tile in [4, 12, 32, 1024] {
            let params = Params { tile, ..case.params };
            let found = voxelize(&case.boundary(), &case.view, &params, Level::new()).0;
            assert_eq!(found, expected, "{} in tiles of {tile}", case.name);
        }
        for threads in 1..=4 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| case.spans()), expected, "{}, {threads}", case.name);
        }
        let mut reversed = Case { positions: case.positions.clone(), ..case };
        reversed.positions.reverse();
        if let Radii::Each(radii) = &mut reversed.radii {
            radii.reverse();
        }
        assert_eq!(reversed.spans(), expected, "{} in reverse", reversed.name);
    }
}

#[test]
fn surfaces_know_their_particles() {
    for mut case in cases() {
        case.params = Params { ids: true, spans: 10_000, ..case.params };
        let spans = case.spans();
        let plain = Params { ids: false, ..case.params };
        let expected = voxelize(&case.boundary(), &case.view, &plain, Level::new()).0;
        assert_eq!(spans.depths, expected.depths, "{}", case.name);
        assert_eq!(spans.particles.len(), spans.depths.len(), "{}", case.name);
        let delta = 100.0 * case.delta();
        for pixel in 0..case.view.pixels() {
            let at = (pixel as u32 % case.view.size.0, pixel as u32 / case.view.size.0);
            let (origin, direction) = case.view.column(at.0, at.1);
            for surface in 2 * spans.of(pixel).start..2 * spans.of(pixel).end {
                let depth = spans.depths[surface];
                let Some(position) = case.positions.get(spans.particles[surface] as usize) else {
                    assert_eq!(spans.particles[surface], Spans::NO_PARTICLE);
                    continue;
                };
                if depth == case.view.near || depth == case.view.far {
                    continue;
                }
                let point = origin + direction * f64::from(depth);
                let away = (point - Vec3::from_array(*position).as_dvec3()).length();
                let radius = f64::from(case.radius(spans.particles[surface] as usize));
                // Where a ray grazes, the depth is less certain.
                let off = (away - radius).abs();
                assert!(off <= delta + delta.sqrt() * radius, "{} at {at:?}: {off}", case.name);
            }
        }
    }
}

#[test]
fn the_last_span_stored_reaches_to_the_end() {
    for case in cases() {
        let all = voxelize(
            &case.boundary(),
            &case.view,
            &Params { spans: 60_000, ..case.params },
            Level::new(),
        )
        .0;
        let few = voxelize(
            &case.boundary(),
            &case.view,
            &Params { spans: 2, ..case.params },
            Level::new(),
        )
        .0;
        for pixel in 0..case.view.pixels() {
            let (all_of, few_of) = (all.of(pixel), few.of(pixel));
            assert_eq!(few.count(pixel) as usize, all_of.len());
            assert_eq!(few_of.len(), all_of.len().min(2));
            let all_of = &all.depths[2 * all_of.start..2 * all_of.end];
            let few_of = &few.depths[2 * few_of.start..2 * few_of.end];
            assert_eq!(few_of.first(), all_of.first());
            assert_eq!(few_of.last(), all_of.last());
            let length = |spans: &[f32]| -> f32 { spans.chunks(2).map(|s| s[1] - s[0]).sum() };
            let empty = few.extended(pixel).map_or(0.0, |e| e.empty);
            assert!((length(few_of) - empty - length(all_of)).abs() < 1e-4, "{}", case.name);
        }
    }
}

#[test]
fn grids_and_arrays_give_the_same() {
    let case = &cases()[4];
    let params = motes_grid::Params::default();
    let grid = Grid::build(&case.positions, Radii::Uniform(0.0406), None, params);
    let keep = |index: u32| !index.is_multiple_of(5);
    let seen = Visibility::where_all(&grid, &[], Some(&keep));
    let (grids, seen) = ([grid], [seen]);
    let input = Input { particles: Particles::Grids(&grids, &seen), radius_scale: 1.0 };
    let boundary = Boundary::extract(&input, &case.params, Level::new());
    let kept = case.positions.iter().enumerate().filter(|(i, _)| keep(*i as u32)).map(|(_, p)| *p);
    let some = Case { positions: kept.collect(), radii: Radii::Uniform(0.0406), ..*case };
    assert_eq!(voxelize(&boundary, &case.view, &case.params, Level::new()).0, some.spans());
}

#[test]
fn a_particle_far_away_changes_nothing_near() {
    let case = &cases()[6];
    let mut positions = case.positions.clone();
    positions.push([1e6, 1e6, 1e6]);
    let stray = Case { positions, radii: Radii::Uniform(0.0406), ..*case };
    let stray = Case { params: Params { cull: Cull::Occupancy, ..case.params }, ..stray };
    assert_eq!(stray.boundary().lattice(), None);
    assert_eq!(stray.spans(), case.spans());
}

#[test]
fn planes_in_the_wrong_order_show_nothing() {
    let case = &cases()[0];
    for representation in [Representation::Intervals, Representation::Bits(Bits::default())] {
        let params = Params { representation, ..case.params };
        let view = View { near: 6.0, far: 0.3, ..case.view };
        assert!(voxelize(&case.boundary(), &view, &params, Level::new()).0.is_empty());
    }
}

#[test]
fn nothing_gives_nothing() {
    let case = &cases()[0];
    let nothing = Case { positions: vec![], radii: Radii::Uniform(1.0), ..*case };
    let spans = nothing.spans();
    assert!(spans.is_empty() && spans.starts == vec![0; case.view.pixels() + 1]);
    let nan = vec![[f32::NAN, 0.5, 0.5], [0.5, f32::INFINITY, 0.5], [0.5, 0.5, 0.5]];
    let one = Case { positions: vec![nan[2]], radii: Radii::Uniform(0.2), ..*case }.spans();
    let with = Case { positions: nan, radii: Radii::Uniform(0.2), ..*case };
    assert_eq!(with.spans(), one);
    assert!(!one.is_empty());
    let zero = Case { radii: Radii::Uniform(0.0), ..with };
    assert!(zero.spans().is_empty());
}
