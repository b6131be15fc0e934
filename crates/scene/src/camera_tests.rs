use super::*;

/// The view that frames one box, or nothing.
fn look(camera: &Camera, bounds: Option<Bounds>, size: (u32, u32)) -> CameraView {
    CameraView::new(camera, Framing::new(bounds.as_slice(), 0.0), size)
}

use crate::scene::Scene;

const SIZE: (u32, u32) = (640, 480);

fn camera(settings: &[(&str, &str)]) -> Camera {
    let mut scene = Scene::default();
    settings.iter().for_each(|(path, value)| scene.set(&format!("camera.{path}"), value).unwrap());
    scene.camera
}

fn box_of(a: [f64; 3], b: [f64; 3]) -> Option<Bounds> {
    Some(Bounds::new(a.into(), b.into()))
}

fn close(a: Vec3, b: Vec3) -> bool {
    a.abs_diff_eq(b, 1e-6)
}

#[test]
fn rays_known_answers() {
    // From −y looking along +y, z up: right is +x.
    let camera = camera(&[("position", "0,-5,0"), ("target", "0,0,0"), ("fov", "90")]);
    let view = look(&camera, None, SIZE);
    assert_eq!((view.right, view.up, view.forward), (DVec3::X, DVec3::Z, DVec3::Y));
    let rays = view.rays(DVec3::new(0.0, -4.0, 1.0));
    let (origin, middle) = rays.ray(320.0, 240.0);
    assert_eq!((origin, middle), (Vec3::new(0.0, -1.0, -1.0), Vec3::Y));
    // A field of view of 90° reaches 45° at the edges; row 0 is the top; 4:3 is wider.
    assert!(close(rays.ray(320.0, 0.0).1, Vec3::new(0.0, 1.0, 1.0).normalize()));
    assert!(close(rays.ray(320.0, 480.0).1, Vec3::new(0.0, 1.0, -1.0).normalize()));
    assert!(close(rays.ray(640.0, 240.0).1, Vec3::new(4.0 / 3.0, 1.0, 0.0).normalize()));
    assert!(close(rays.ray(0.0, 0.0).1, Vec3::new(-4.0 / 3.0, 1.0, 1.0).normalize()));
    // A pixel: at distance 3, 480 of them are 6 high.
    assert!((view.pixel_size(3.0) - 6.0 / 480.0).abs() < 1e-12);
}

#[test]
fn orthographic_known_answers() {
    let settings = [
        ("position", "0,-5,0"),
        ("target", "0,0,0"),
        ("projection", "orthographic"),
        ("height", "4.8"),
    ];
    let view = look(&camera(&settings), None, SIZE);
    let rays = view.rays(DVec3::ZERO);
    let (origin, direction) = rays.ray(640.0, 0.0);
    assert!(close(origin, Vec3::new(3.2, -5.0, 2.4)), "{origin}");
    assert_eq!(direction, Vec3::Y);
    assert!((view.pixel_size(1.0) - 0.01).abs() < 1e-15);
}

#[test]
fn the_axes_are_right_handed() {
    for settings in [&[][..], &[("up_axis", "y")], &[("up_axis", "x")], &[("direction", "0,0,-1")]]
    {
        let v = look(&camera(settings), None, SIZE);
        assert!(v.right.cross(v.up).abs_diff_eq(-v.forward, 1e-12), "{settings:?}");
        for axis in [v.right, v.up, v.forward] {
            assert!((axis.length() - 1.0).abs() < 1e-12, "{settings:?}");
        }
    }
}

#[test]
fn the_default_direction_turns_with_up() {
    let direction = |up| look(&camera(&[("up_axis", up)]), None, SIZE).forward;
    let turned = |x, y, z| DVec3::new(x, y, z) / 6f64.sqrt();
    assert!(direction("z").abs_diff_eq(turned(2.0, 1.0, -1.0), 1e-12));
    assert!(direction("y").abs_diff_eq(turned(2.0, -1.0, -1.0), 1e-12));
    assert!(direction("x").abs_diff_eq(turned(-1.0, 1.0, -2.0), 1e-12));
    // A quarter turn: z goes to the axis, and lengths and handedness stay.
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        assert_eq!(axis.turn(DVec3::Z), axis.vector());
        assert_eq!(axis.turn(DVec3::X).cross(axis.turn(DVec3::Y)), axis.vector());
    }
}

#[test]
fn an_up_along_the_view_gives_way() {
    let top = look(&camera(&[("direction", "0,0,-1")]), None, SIZE);
    assert_eq!((top.up, top.right), (DVec3::Y, DVec3::X));
    let side = look(&camera(&[("direction", "0,3,0"), ("up", "0,-2,0")]), None, SIZE);
    assert_eq!(side.up, DVec3::Z);
}

#[test]
fn project_undoes_ray() {
    for projection in ["perspective", "orthographic"] {
        let view = look(
            &camera(&[("projection", projection)]),
            box_of([1e4, -3.0, 2.0], [1e4 + 7.0, 5.0, 3.0]),
            SIZE,
        );
        let origin = view.target;
        let rays = view.rays(origin);
        for (x, y, t) in [(0.5, 0.5, 3.0), (320.0, 240.0, 8.0), (639.5, 100.25, 20.0)] {
            let (from, direction) = rays.ray(x, y);
            let p = view.project(origin + (from + direction * t).as_dvec3()).unwrap();
            let off = (p.x - f64::from(x)).abs().max((p.y - f64::from(y)).abs());
            // f32 rays a few tens of units long: 1e-6 of the picture's width.
            assert!(off < 1e-3 && (p.distance - f64::from(t)).abs() < 1e-4, "{projection}: {p:?}");
        }
        assert_eq!(view.project(view.eye - view.forward), None);
    }
}

/// The eight corners' greatest part of half the picture, across and upward.
fn reach(view: &CameraView, bounds: &Bounds) -> (f64, f64) {
    let (w, h) = (f64::from(view.width) / 2.0, f64::from(view.height) / 2.0);
    bounds.corners().iter().fold((0.0, 0.0), |(x, y): (f64, f64), corner| {
        let p = view.project(*corner).expect("every corner is before the eye");
        (x.max((p.x - w).abs() / w), y.max((p.y - h).abs() / h))
    })
}

#[test]
fn framing_holds_every_corner_and_touches_the_margin() {
    let boxes = [
        ([0.0; 3], [1.0; 3]),
        ([-1e5, 1e5, 0.0], [-1e5 + 3.0, 1e5 + 1.0, 20.0]),
        ([0.0; 3], [10.0, 10.0, 0.0]),
        ([0.0; 3], [0.0, 0.0, 10.0]),
        ([1e-9; 3], [3e-9, 2e-9, 2e-9]),
    ];
    for (a, b) in boxes {
        for projection in ["perspective", "orthographic"] {
            for size in [SIZE, (200, 900)] {
                let bounds = box_of(a, b);
                let view = look(&camera(&[("projection", projection)]), bounds, size);
                let (x, y) = reach(&view, &bounds.unwrap());
                assert!((x.max(y) - 0.95).abs() < 1e-6, "{a:?} {projection} {size:?}: {x} {y}");
                assert!(x <= 0.95 + 1e-6 && y <= 0.95 + 1e-6);
            }
        }
    }
}

#[test]
fn framing_about_a_target_keeps_it_in_the_middle() {
    for projection in ["perspective", "orthographic"] {
        let settings = [("projection", projection), ("target", "1,0,0")];
        let bounds = box_of([0.0; 3], [4.0, 1.0, 1.0]);
        let view = look(&camera(&settings), bounds, SIZE);
        let middle = view.project(DVec3::X).unwrap();
        assert!((middle.x - 320.0).abs() < 1e-9 && (middle.y - 240.0).abs() < 1e-9);
        let (x, y) = reach(&view, &bounds.unwrap());
        assert!((x.max(y) - 0.95).abs() < 1e-9, "{x} {y}");
    }
}

#[test]
fn anything_can_be_framed() {
    let far = 1e7;
    for bounds in [
        None,
        box_of([5.0; 3], [5.0; 3]),
        box_of([far; 3], [far; 3]),
        // A line along the view, seen end on.
        box_of([0.0; 3], [0.0, 8.0, 0.0]),
        Some(Bounds { min: DVec3::NAN, max: DVec3::NAN }),
        Some(Bounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY }),
    ] {
        for projection in ["perspective", "orthographic"] {
            let camera = camera(&[("projection", projection), ("direction", "0,1,0")]);
            let view = look(&camera, bounds, SIZE);
            assert!(view.eye.is_finite() && view.half_height > 0.0, "{bounds:?}");
            if let Some(b) = bounds.filter(|b| b.min.is_finite() && b.max.is_finite()) {
                let (x, y) = reach(&view, &b);
                assert!(x < 1.0 && y < 1.0, "{bounds:?} {projection}");
            }
        }
    }
}

#[test]
fn a_position_alone_looks_at_what_is_visible() {
    let bounds = box_of([0.0; 3], [2.0; 3]);
    let view = look(&camera(&[("position", "1,-9,1")]), bounds, SIZE);
    assert_eq!((view.eye, view.forward), (DVec3::new(1.0, -9.0, 1.0), DVec3::Y));
    assert_eq!(view.target, DVec3::ONE);
    // From the very middle there is still a direction.
    let inside = look(&camera(&[("position", "1,1,1")]), bounds, SIZE);
    assert!(inside.forward.is_finite() && inside.target != inside.eye);
}

#[test]
fn many_boxes_fit_closer_and_a_legend_has_its_room() {
    // A row of boxes from corner to corner: their common box is far larger.
    let boxes: Vec<Bounds> = (0..20)
        .map(|i| Bounds::new(DVec3::splat(f64::from(i)), DVec3::splat(f64::from(i) + 1.0)))
        .collect();
    for projection in ["perspective", "orthographic"] {
        let camera = camera(&[("projection", projection)]);
        for free_right in [0.0, 0.2] {
            let view = CameraView::new(&camera, Framing::new(&boxes, free_right), SIZE);
            let corners = boxes.iter().flat_map(Bounds::corners);
            let seen: Vec<_> = corners.map(|c| view.project(c).unwrap()).collect();
            let most = |f: fn(&Projected) -> f64| seen.iter().map(f).fold(f64::MIN, f64::max);
            let (left, right) = (-most(|p| -p.x), most(|p| p.x));
            let (top, bottom) = (-most(|p| -p.y), most(|p| p.y));
            let (width, height) = (f64::from(SIZE.0), f64::from(SIZE.1));
            assert!(left >= 0.0 && top >= 0.0 && bottom <= height, "{projection}");
            assert!(right <= width * (1.0 - free_right) + 1e-6, "{projection}: {right}");
            // It fits: one pair of sides is touched, but for the margin.
            let rim = 0.5 * camera.margin;
            let touches = |low: f64, high: f64, size: f64| {
                (low - rim * size).abs() < 1e-6 && (high - (1.0 - rim) * size).abs() < 1e-6
            };
            let fits = touches(left, right, width) || touches(top, bottom, height);
            assert!(fits || free_right > 0.0, "{projection}: {left} {right} {top} {bottom}");
        }
    }
    assert_ne!(
        CameraView::new(&Camera::default(), Framing::new(&boxes, 0.0), SIZE),
        look(&Camera::default(), boxes.iter().copied().reduce(Bounds::union), SIZE)
    );
}
