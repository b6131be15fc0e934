//! Cues of spheres and planes that are known.

use super::*;
use crate::Layer;

const SIZE: [usize; 2] = [200, 150];
const NEAR: f32 = 100.0;

/// A ball: its middle in the picture and its radius, pixels, and the depth of its middle, pixels behind
/// [`NEAR`].
#[derive(Clone, Copy)]
struct Ball([f32; 2], f32, f32);

/// Balls in parallel projection, white, with pixels as world units.
fn picture(balls: &[Ball], size: [usize; 2]) -> Frame {
    let [width, height] = size;
    let (mut depth, mut normal) =
        (vec![f32::INFINITY; width * height], vec![[0.0; 3]; width * height]);
    let (mut id, mut color) = (vec![-1i64; width * height], vec![[0.0; 4]; width * height]);
    for (at, depth) in depth.iter_mut().enumerate() {
        let p = [(at % width) as f32 + 0.5, (at / width) as f32 + 0.5];
        for (number, Ball(middle, radius, z)) in balls.iter().enumerate() {
            let (x, y) = ((p[0] - middle[0]) / radius, (p[1] - middle[1]) / radius);
            let up = (1.0 - x * x - y * y).sqrt();
            let distance = NEAR + z - up * radius;
            if up > 0.0 && distance < *depth {
                (*depth, normal[at], id[at]) = (distance, [x, -y, -up], number as i64);
                color[at] = [1.0; 4];
            }
        }
    }
    framed(size, color, [Layer::Depth(depth), Layer::Normal(normal), Layer::Id(id)])
}

/// A wall whose distance is `distance(x, y)`, a plane of unit normal `normal`.
fn wall(distance: impl Fn(f32, f32) -> f32, normal: [f32; 3]) -> Frame {
    let place = |at: usize| ((at % SIZE[0]) as f32 + 0.5, (at / SIZE[0]) as f32 + 0.5);
    let count = SIZE[0] * SIZE[1];
    let depth = (0..count).map(place).map(|(x, y)| distance(x, y)).collect();
    let layers =
        [Layer::Depth(depth), Layer::Normal(vec![normal; count]), Layer::Id(vec![0; count])];
    framed(SIZE, vec![[1.0; 4]; count], layers)
}

fn framed(size: [usize; 2], color: Vec<[f32; 4]>, layers: [Layer; 3]) -> Frame {
    let frame = Frame::new(size[0], size[1], color).unwrap();
    layers.into_iter().fold(frame, |frame, layer| frame.with(layer).unwrap())
}

fn cues() -> Cues {
    let eye = Eye {
        right: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        forward: [0.0, 0.0, 1.0],
        pixel: 1.0,
        perspective: false,
    };
    Cues { eye, range: [0.0, 400.0], structure: 60.0, ..Cues::default() }
}

/// Black, all of it, `width` pixels wide in a picture of [`SIZE`].
fn stroke(width: f32) -> Option<Stroke> {
    Some(Stroke { strength: 1.0, width: width / SIZE[1] as f32, color: [0.0; 3] })
}

/// How dark each pixel has become, 0 … 1, and where it is from `middle`: the angle and the distance.
fn darkness(cues: &Cues, mut frame: Frame) -> Vec<f32> {
    cues.draw(&mut frame, Background::Transparent, Level::new()).unwrap();
    frame.color().iter().map(|c| if c[3] > 0.0 { 1.0 - c[0] / c[3] } else { 0.0 }).collect()
}

fn at([x, y]: [usize; 2]) -> usize {
    y * SIZE[0] + x
}

/// Sums of `dark` along lines across a ring, and their centres: distance from `middle`, in `count` directions.
fn across_ring(dark: &[f32], middle: [f32; 2], radius: f32, count: usize) -> Vec<[f32; 2]> {
    let directions = (0..count).map(|i| i as f32 / count as f32 * std::f32::consts::TAU);
    let sample = |x: f32, y: f32| {
        let (x, y) = (x - 0.5, y - 0.5);
        let (u, v) = (x.fract(), y.fract());
        let dark = |i: usize, j: usize| dark[at([x as usize + i, y as usize + j])];
        let top = dark(0, 0) * (1.0 - u) + dark(1, 0) * u;
        let bottom = dark(0, 1) * (1.0 - u) + dark(1, 1) * u;
        top * (1.0 - v) + bottom * v
    };
    let line = |angle: f32| {
        let (mut sum, mut moment) = (0.0, 0.0);
        for step in -60..=60 {
            let r = radius + step as f32 * 0.1;
            let dark = sample(middle[0] + r * angle.cos(), middle[1] + r * angle.sin());
            sum += 0.1 * dark;
            moment += 0.1 * dark * r;
        }
        [sum, moment / sum]
    };
    directions.map(line).collect()
}

#[test]
fn a_sphere_has_a_round_outline_without_stairs() {
    let (middle, radius) = ([97.3, 71.8], 50.4);
    let cues = Cues { edges: stroke(2.0), ..cues() };
    let frame = picture(&[Ball(middle, radius, 0.0)], SIZE);
    let before = frame.clone();
    let dark = {
        // Where the line lies on nothing, it has only alpha.
        let mut frame = frame;
        cues.draw(&mut frame, Background::Transparent, Level::new()).unwrap();
        assert_eq!(frame.layers(), before.layers());
        let colors = frame.color().iter().zip(before.color());
        colors.map(|(c, b)| if b[3] > 0.0 { 1.0 - c[0] } else { c[3] }).collect::<Vec<_>>()
    };
    for [width, distance] in across_ring(&dark, middle, radius, 360) {
        assert!((width - 2.0).abs() < 0.2, "{width} pixels wide");
        assert!((distance - radius).abs() < 0.12, "{distance} from the middle");
    }
}

#[test]
fn only_what_is_far_behind_makes_an_outline() {
    // Three balls in a row towards the left, each behind the one before: by less than a structure, by more.
    let balls = [
        Ball([130.0, 75.0], 40.0, 0.0),
        Ball([90.0, 75.0], 40.0, 45.0),
        Ball([50.0, 75.0], 40.0, 250.0),
    ];
    let cues = Cues { edges: stroke(2.0), ..cues() };
    let dark = darkness(&cues, picture(&balls, SIZE));
    let most = |x: usize| (x - 3..x + 3).map(|x| dark[at([x, 75])]).fold(0.0, f32::max);
    assert_eq!(most(90), 0.0, "of the first ball before the second");
    assert!(most(50) > 0.9, "of the second before the third");
    assert!(most(12) > 0.9, "of the third before nothing");
}

#[test]
fn seams_are_where_spheres_intersect() {
    // Two balls, one nearer: they meet in a plane, of which x − 2 z/10 … is found below.
    let (a, b) = (Ball([80.0, 75.0], 45.0, 0.0), Ball([120.0, 75.0], 40.0, 10.0));
    let cues = Cues { seam: stroke(1.0), ..cues() };
    let dark = darkness(&cues, picture(&[a, b], SIZE));
    for y in 55..95 {
        // The curve: where both are equally far along the ray.
        let depth = |Ball(m, r, z): Ball, x: f32| {
            let (dx, dy) = (x - m[0], y as f32 + 0.5 - m[1]);
            z - (r * r - dx * dx - dy * dy).max(0.0).sqrt()
        };
        let mut ends = [85.0f32, 119.0];
        for _ in 0..40 {
            let x = 0.5 * (ends[0] + ends[1]);
            ends[usize::from(depth(a, x) > depth(b, x))] = x;
        }
        let row = (60..140).map(|x| (x as f32 + 0.5, dark[at([x, y])]));
        let sum: f32 = row.clone().map(|(_, dark)| dark).sum();
        let middle = row.map(|(x, dark)| x * dark).sum::<f32>() / sum;
        assert!((middle - ends[0]).abs() < 0.25, "row {y}: {middle} for {}", ends[0]);
        assert!((0.7..1.6).contains(&sum), "row {y}: {sum} pixels");
    }
}

#[test]
fn what_touches_or_is_apart_has_no_seam() {
    let cues = Cues { seam: stroke(1.0), ..cues() };
    let touching = [Ball([60.0, 75.0], 40.0, 0.0), Ball([140.0, 75.0], 40.0, 0.0)];
    let apart = [Ball([80.0, 75.0], 40.0, 0.0), Ball([120.0, 75.0], 40.0, 90.0)];
    let far = [Ball([80.0, 75.0], 40.0, 0.0), Ball([120.0, 75.0], 40.0, 60.0)];
    for balls in [touching, apart, far] {
        let dark = darkness(&cues, picture(&balls, SIZE));
        let drawn = dark.iter().filter(|dark| **dark > 0.0).count();
        assert!(drawn <= 4, "{drawn} pixels");
    }
}

#[test]
fn a_halo_falls_on_what_is_behind_alone() {
    let near = Ball([100.0, 75.0], 40.0, 0.0);
    // A wall behind, as a ball that is as good as flat.
    let wall = Ball([100.0, 75.0], 3000.0, 3250.0);
    let cues = Cues { halo: stroke(16.0), ..cues() };
    let dark = darkness(&cues, picture(&[near, wall], SIZE));
    let from_middle = |at: usize| {
        let (x, y) = ((at % SIZE[0]) as f32 + 0.5 - 100.0, (at / SIZE[0]) as f32 + 0.5 - 75.0);
        x.hypot(y)
    };
    for (at, dark) in dark.iter().enumerate() {
        match from_middle(at) {
            r if r < 39.0 => assert_eq!(*dark, 0.0, "on the ball, {r} from its middle"),
            // The weights of cells are a product, and so not quite round.
            r if r > 65.0 => assert!(*dark < 1e-4, "beyond the halo, {r} from the middle"),
            r if (41.5..43.0).contains(&r) => assert!(*dark > 0.6, "{dark} beside the ball"),
            _ => {}
        }
    }
    // It fades out and never grows.
    let row: Vec<f32> = (141..170).map(|x| dark[at([x, 75])]).collect();
    assert!(row.windows(2).all(|pair| pair[1] <= pair[0] + 1e-3), "{row:?}");
}

#[test]
fn planes_have_no_lines_no_halos_and_no_rims() {
    let all = Cues {
        edges: stroke(2.0),
        seam: stroke(1.0),
        halo: stroke(16.0),
        rim: Some(Stroke { strength: 1.0, width: 0.5, color: [0.0; 3] }),
        ..cues()
    };
    let length = (1.0f32 + 4.0 + 1.0).sqrt();
    let tilted =
        wall(|x, y| 100.0 + x + 2.0 * y * 0.5, [1.0 / length, -2.0 / length, -1.0 / length]);
    for frame in [wall(|_, _| 50.0, [0.0, 0.0, -1.0]), tilted] {
        let dark = darkness(&all, frame);
        let worst = dark.iter().fold(0.0, |a: f32, b| a.max(*b));
        assert!(worst < 1e-3, "{worst}");
    }
}

#[test]
fn depth_fades_into_the_background_or_towards_a_color() {
    let fade = |color| Some(Fade { strength: 0.8, color });
    let faded = |color, distance: f32| {
        let mut frame = wall(|_, _| distance, [0.0, 0.0, -1.0]);
        Cues { depth: fade(color), ..cues() }
            .draw(&mut frame, Background::Transparent, Level::new())
            .unwrap();
        frame.color()[at([30, 40])]
    };
    assert_eq!(faded(None, 0.0), [1.0; 4]);
    assert_eq!(faded(None, 200.0), [0.8; 4]);
    let end = faded(None, 400.0);
    assert!((end[3] - 0.2).abs() < 1e-6 && end == [end[3]; 4]);
    assert_eq!(faded(None, 900.0), end);
    let dark = |distance| faded(Some([0.0; 3]), distance);
    assert!((dark(400.0)[0] - 0.2).abs() < 1e-6 && dark(400.0)[3] == 1.0);
    assert!((dark(200.0)[0] - 0.6).abs() < 1e-6);
    // What is nowhere stays: the surroundings of a liquid.
    assert_eq!(faded(None, f32::INFINITY), [1.0; 4]);
}

#[test]
fn rims_are_dark_at_the_end_of_each_sphere() {
    let middle = [100.0, 75.0];
    let rim = Some(Stroke { strength: 1.0, width: 0.5, color: [0.0; 3] });
    let dark = darkness(&Cues { rim, ..cues() }, picture(&[Ball(middle, 60.0, 0.0)], SIZE));
    for x in 41..159 {
        let q = (x as f32 + 0.5 - middle[0]).abs().hypot(0.5) / 60.0;
        let expected = ((q - 0.5) / 0.5).max(0.0).powi(2);
        assert!((dark[at([x, 75])] - expected).abs() < 0.03, "at {q} of the radius");
    }
    // Of spheres smaller than pixels only the mean is seen: no two pixels differ much.
    let tiny: Vec<_> = (0..400)
        .map(|i| Ball([(i % 20) as f32 * 1.37 + 60.1, (i / 20) as f32 * 1.21 + 50.3], 0.9, 0.0))
        .collect();
    let dark = darkness(&Cues { rim, ..cues() }, picture(&tiny, SIZE));
    let inside = (55..70).flat_map(|y| (65..80).map(move |x| [x, y]));
    let seen: Vec<f32> = inside.map(|place| dark[at(place)]).collect();
    let most = seen.iter().fold(0.0, |a: f32, b| a.max(*b));
    assert!(most < 0.7, "{most}");
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let balls: Vec<_> = (0..60)
        .map(|i| {
            let (x, y) = ((i * 37 % 190) as f32 + 5.3, (i * 53 % 140) as f32 + 5.1);
            Ball([x, y], 12.0, (i * 29 % 200) as f32)
        })
        .collect();
    let all = Cues {
        edges: stroke(2.0),
        seam: stroke(1.0),
        halo: stroke(16.0),
        rim: Some(Stroke { strength: 0.5, width: 0.5, color: [0.1, 0.0, 0.0] }),
        depth: Some(Fade { strength: 0.5, color: None }),
        ..cues()
    };
    let hash = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut frame = picture(&balls, SIZE);
        pool.install(|| all.draw(&mut frame, Background::Transparent, Level::new())).unwrap();
        frame.hash()
    };
    let one = hash(1);
    assert!([2, 3, 7].iter().all(|threads| hash(*threads) == one));
}

#[test]
fn a_picture_twice_as_large_looks_the_same() {
    let ball = |scale: f32| Ball([100.2 * scale, 75.4 * scale], 50.0 * scale, 0.0);
    let cues = Cues { edges: stroke(3.0), structure: 30.0, ..cues() };
    let inked = |scale: usize| {
        let mut frame = picture(&[ball(scale as f32)], SIZE.map(|n| n * scale));
        cues.draw(&mut frame, Background::Transparent, Level::new()).unwrap();
        let dark: f32 = frame.color().iter().map(|c| c[3] - c[0]).sum();
        dark / (scale * scale) as f32
    };
    let [small, large] = [inked(1), inked(2)];
    assert!((small / large - 1.0).abs() < 0.03, "{small} {large}");
}

#[test]
fn without_layers_there_is_an_error_and_without_cues_nothing() {
    let mut frame = Frame::new(1, 1, vec![[1.0; 4]]).unwrap();
    Cues::default().draw(&mut frame, Background::Transparent, Level::new()).unwrap();
    let error = Cues { edges: stroke(2.0), ..cues() }
        .draw(&mut frame, Background::Transparent, Level::new())
        .unwrap_err();
    assert_eq!(error.to_string(), "the frame has no layer `depth`");
    // Pictures of one row, of one column, of one pixel.
    for size in [[1, 1], [7, 1], [1, 7], [2, 2]] {
        let mut frame = picture(&[Ball([0.7, 0.6], 1.5, 0.0)], size);
        let all = Cues { edges: stroke(2.0), seam: stroke(1.0), halo: stroke(3.0), ..cues() };
        all.draw(&mut frame, Background::Transparent, Level::new()).unwrap();
        assert!(frame.color().iter().flatten().all(|c| c.is_finite()));
    }
}
