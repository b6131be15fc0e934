//! Writes a picture with every annotation: `cargo run --example annotations -- out.png [WIDTH HEIGHT [dark]]`.

use std::path::Path;

use motes_frame::{
    Annotations, Axes, Background, Category, Frame, Layer, Legend, LegendKeys, Line, LineEnd,
    Lines, PngOptions, ScaleBar, Side, linear_from_srgb, save, write_png,
};

type Vec3 = [f32; 3];

/// Eye, and unit vectors to the right, up and forward.
struct Camera {
    eye: Vec3,
    axes: [Vec3; 3],
    focal_px: f32,
    size: [usize; 2],
}

const RADIUS: f32 = 0.62;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.first().ok_or("expected the name of a PNG file")?;
    let number = |i: usize, default| arguments.get(i).map_or(Ok(default), |a| a.parse::<usize>());
    let size = [number(1, 1280)?, number(2, 960)?];
    let style = arguments.get(3).map(String::as_str);

    let camera = Camera::new([14.0, -20.0, 13.0], size);
    let mut frame = spheres(&camera)?;
    background(style).put_behind(&mut frame);
    annotations(&camera, style).draw(&mut frame);
    save(Path::new(path), |out| write_png(&frame, PngOptions::default(), out))?;
    Ok(())
}

fn background(style: Option<&str>) -> Background {
    match style {
        Some("dark") => {
            Background::Gradient { top: [0.005, 0.008, 0.02], bottom: [0.06, 0.07, 0.1] }
        }
        _ => Background::Solid([1.0; 3]),
    }
}

fn annotations(camera: &Camera, style: Option<&str>) -> Annotations {
    let range = [-4.2e-6, 3.6e-6];
    let keys = match style {
        Some("dark") => LegendKeys::Categories(categories()),
        _ => {
            LegendKeys::Scale { range, colors: (0..256).map(|i| color(i as f32 / 255.0)).collect() }
        }
    };
    let title = if style == Some("dark") { "Element" } else { "Charge density (e/Å³)" };
    let [right, up, forward] = camera.axes;
    let directions = std::array::from_fn(|axis| [right[axis], up[axis], -forward[axis]]);
    Annotations {
        lines: Some(Lines {
            lines: edges(camera),
            focal_px: camera.focal_px,
            color: None,
            hidden: 0.15,
        }),
        legend: Some(Legend { title: title.into(), keys }),
        scale_bar: Some(ScaleBar {
            pixels_per_unit: f64::from(camera.focal_px / length(camera.eye)),
            unit: "Å".into(),
        }),
        caption: Some("t = 12.50 ps".into()),
        axes: Some(Axes { directions, side: Side::Right }),
        ..Annotations::default()
    }
}

fn categories() -> Vec<Category> {
    let names = ["Cu", "Zr", "Al (interstitial)", "O", "vacancy"];
    let entry = |(i, name): (usize, &&str)| Category {
        name: (*name).into(),
        color: color(i as f32 / (names.len() - 1) as f32),
    };
    names.iter().enumerate().map(entry).collect()
}

/// The edges of a cube of side 10 around the origin.
fn edges(camera: &Camera) -> Vec<Line> {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -5.0 } else { 5.0 });
    let pairs = (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i ^ bit))).filter(|(i, j)| i < j);
    pairs.map(|(i, j)| Line { from: camera.end(corner(i)), to: camera.end(corner(j)) }).collect()
}

/// A heap of spheres in a corner of the cube, lit from the upper left.
fn spheres(camera: &Camera) -> motes_frame::Result<Frame> {
    let centers: Vec<Vec3> = (0..1000)
        .map(|i| [i % 10, i / 10 % 10, i / 100].map(|n| n as f32 - 4.5))
        .filter(|c| c[2] < 2.0 * (c[0] * 0.9).sin() * (c[1] * 0.5).cos() - 1.0)
        .collect();
    let [width, height] = camera.size;
    let (mut colors, mut depth) = (Vec::new(), Vec::new());
    for i in 0..width * height {
        let seen = |sub: f32| {
            let ray = camera.ray([(i % width) as f32 + 0.5 + sub, (i / width) as f32 + 0.5 + sub]);
            nearest(camera.eye, ray, &centers)
        };
        depth.push(seen(0.0).0);
        let samples = [seen(-0.25).1, seen(0.0).1, seen(0.25).1];
        colors.push(std::array::from_fn(|c| samples.iter().map(|s| s[c]).sum::<f32>() / 3.0));
    }
    Frame::new(width, height, colors)?.with(Layer::Depth(depth))
}

fn nearest(eye: Vec3, ray: Vec3, centers: &[Vec3]) -> (f32, [f32; 4]) {
    let mut best = (f32::INFINITY, [0.0; 4]);
    for center in centers {
        let to = sub(*center, eye);
        let along = dot(to, ray);
        let behind = dot(to, to) - along * along;
        let distance = along - (RADIUS * RADIUS - behind).max(0.0).sqrt();
        if behind < RADIUS * RADIUS && distance < best.0 {
            let normal = sub(std::array::from_fn(|i| ray[i] * distance), to).map(|c| c / RADIUS);
            let light = 0.25 + 0.75 * dot(normal, unit([-0.3, -0.6, 0.8])).max(0.0);
            let [r, g, b] =
                color((center[2] + 5.0) / 8.0 + 0.05 * center[0].sin()).map(|c| c * light);
            best = (distance, [r, g, b, 1.0]);
        }
    }
    best
}

/// Blue over pale to red, linear.
fn color(t: f32) -> Vec3 {
    let stops = [[0.23, 0.30, 0.75], [0.87, 0.87, 0.87], [0.71, 0.02, 0.15]];
    let t = t.clamp(0.0, 1.0) * 2.0;
    let i = (t as usize).min(1);
    let mix = |c: usize| stops[i][c] + (stops[i + 1][c] - stops[i][c]) * (t - i as f32);
    [mix(0), mix(1), mix(2)].map(linear_from_srgb)
}

impl Camera {
    /// Looks at the origin with z up.
    fn new(eye: Vec3, size: [usize; 2]) -> Camera {
        let forward = unit(eye.map(|c| -c));
        let right = unit(cross(forward, [0.0, 0.0, 1.0]));
        let side = size[1].min(size[0]) as f32;
        let focal_px = side / 2.0 / 22.5_f32.to_radians().tan();
        Camera { eye, axes: [right, cross(right, forward), forward], focal_px, size }
    }

    fn ray(&self, [x, y]: [f32; 2]) -> Vec3 {
        let [right, up, forward] = self.axes;
        let (x, y) = (x - self.size[0] as f32 / 2.0, self.size[1] as f32 / 2.0 - y);
        unit(std::array::from_fn(|i| right[i] * x + up[i] * y + forward[i] * self.focal_px))
    }

    fn end(&self, point: Vec3) -> LineEnd {
        let to = sub(point, self.eye);
        let [x, y, z] = self.axes.map(|axis| dot(axis, to));
        let [width, height] = self.size.map(|side| side as f32 / 2.0);
        let pixel = [width + x / z * self.focal_px, height - y / z * self.focal_px];
        LineEnd { pixel, distance: length(to) }
    }
}

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(a: Vec3) -> f32 {
    dot(a, a).sqrt()
}

fn unit(a: Vec3) -> Vec3 {
    a.map(|c| c / length(a))
}
