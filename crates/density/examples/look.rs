use fearless_simd::Level;
use glam::Vec3;
use motes_density::*;
use motes_grid::Radii;
use motes_scene::{Bounds, Environment, Floor, Scene, Sky};
use std::time::Instant;

fn arg(name: &str, default: f64) -> f64 {
    std::env::args()
        .find_map(|a| a.strip_prefix(&format!("{name}=")).map(|v| v.parse().unwrap()))
        .unwrap_or(default)
}
fn text(name: &str, default: &str) -> String {
    std::env::args()
        .find_map(|a| a.strip_prefix(&format!("{name}=")).map(|v| v.to_owned()))
        .unwrap_or(default.into())
}

fn particles() -> (Vec<[f32; 3]>, f32) {
    let file = text("file", "");
    if !file.is_empty() {
        let bytes = std::fs::read(&file).unwrap();
        let all: Vec<f32> =
            bytes.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect();
        return (all[1..].chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(), all[0]);
    }
    let n = arg("n", 27000.0) as usize;
    let frame = arg("frame", 20.0) as usize;
    let name = format!("/tmp/density-{}-{n}-{frame}.bin", text("scenario", "dam-break"));
    if let Ok(bytes) = std::fs::read(&name) {
        let all: Vec<f32> =
            bytes.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect();
        return (all[1..].chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(), all[0]);
    }
    let scenario = motes_sph::Scenario::named(&text("scenario", "dam-break")).unwrap();
    let count = n.to_string();
    let mut p: Vec<(&str, &str)> = vec![("particles", &count)];
    if arg("cube", 0.0) > 0.0 {
        p.extend([("width", "2"), ("height", "0.5"), ("tank_length", "2"), ("tank_height", "2")]);
    }
    let setup = scenario.setup(&p).unwrap();
    let mut sim = motes_sph::Simulation::new(setup, &motes_scene::Sph::default());
    for _ in 0..frame {
        sim.advance(&mut |_| true).unwrap();
    }
    let f = sim.frame();
    let r = 0.5 * sim.spacing();
    let mut out = vec![r];
    out.extend(f.positions.iter().flatten());
    std::fs::write(&name, out.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>()).unwrap();
    (f.positions, r)
}

fn main() {
    let level = Level::new();
    let (positions, radius) = particles();
    let mut params = Params::with_voxel(radius * arg("voxel", 2.0) as f32);
    params.support = arg("support", params.support as f64) as f32;
    params.threshold = arg("threshold", params.threshold as f64) as f32;
    params.saturation = 5.0 * params.threshold;
    params.rough = arg("rough", 1.0) > 0.0;
    params.masked = arg("masked", 0.0) > 0.0;
    let masks: Option<Vec<Mask>> = params.masked.then(|| {
        let grid = motes_grid::Grid::build(
            &positions[..],
            Radii::Uniform(radius),
            None,
            motes_grid::Params {
                resolution: motes_grid::Resolution::CellsPerParticle(1.0),
                block_cells: 6,
            },
        );
        let by = motes_sph::masks(&grid, 4.0 * radius);
        let mut m = vec![[0.0; 6]; positions.len()];
        by.iter().enumerate().for_each(|(s, v)| m[grid.index(s) as usize] = *v);
        m
    });
    let p =
        Particles { positions: &positions, radii: Radii::Uniform(radius), masks: masks.as_deref() };
    let (mut field, mut space) = (Field::default(), Space::default());
    field.fill_counted(&p, &params, level);
    println!(
        "{} particles, dims {:?} counts {:?}",
        positions.len(),
        field.lattice.dims,
        field.counts
    );
    let repeat = arg("repeat", 5.0) as usize;
    let best = |f: &mut dyn FnMut()| {
        let mut t = f64::MAX;
        for _ in 0..repeat {
            let s = Instant::now();
            f();
            t = t.min(s.elapsed().as_secs_f64() * 1e3);
        }
        t
    };
    println!("field {:.2} ms", best(&mut || field.fill(&p, &params, level)));
    println!(
        "space {:.2} ms, drops {}",
        best(&mut || space.fill(&field, (&p, &params), level)),
        space.drop_count()
    );
    let mut scene = Scene::default();
    let size = arg("size", 512.0) as u32;
    let wide = arg("wide", size as f64) as u32;
    (scene.image.width, scene.image.height) = (wide, size);
    for a in std::env::args() {
        if let Some(s) = a.strip_prefix("set:") {
            scene.set_text(s).unwrap();
        }
    }
    let up = scene.camera.up_axis.vector();
    let b = Bounds::of_spheres(
        positions.iter().map(|p| (Vec3::from_array(*p).as_dvec3(), radius as f64)),
    )
    .unwrap();
    let resolved = scene.resolve(Some(b)).unwrap();
    let across = b.diagonal();
    let lowest = b.corners().iter().map(|c| c.dot(up)).fold(f64::INFINITY, f64::min);
    let center = b.center();
    let env = Environment {
        sky: Sky::Day { up: up.as_vec3(), sun: resolved.lights.key.direction },
        floor: Some(Floor {
            point: (center + up * (lowest - center.dot(up))).as_vec3(),
            up: up.as_vec3(),
            tile: (across / 8.0) as f32,
            colors: [Vec3::new(0.80, 0.79, 0.76), Vec3::new(0.62, 0.64, 0.66)],
            fade: (3.0 * across) as f32,
        }),
    };
    let absorption = Vec3::new(2.6, 0.75, 0.45) / across as f32 * arg("absorb", 1.0) as f32;
    let optics =
        Optics { ior: arg("ior", 1.33) as f32, absorption, depth: arg("depth", 4.0) as u32 };
    let view = View { rays: resolved.view.rays(glam::DVec3::ZERO), size: (wide, size) };
    let liquid = Liquid { field: &field, space: &space, level };
    let shadow = (arg("shadow", 1.0) > 0.0).then(|| {
        let s = Instant::now();
        let m = Shadow::new(
            &liquid,
            resolved.lights.key.direction,
            (absorption.element_sum() / 3.0, 0.45),
        );
        println!("shadow {:.2} ms", s.elapsed().as_secs_f64() * 1e3);
        m
    });
    let around = Around { beyond: &env, shown: true, shadow: shadow.as_ref(), paint: None };
    let mut picture = Vec::new();
    println!(
        "picture {:.2} ms",
        best(&mut || picture = shade(&liquid, &view, (&optics, &around), arg("finer", 1.0) as u32))
    );
    let h = picture
        .iter()
        .flatten()
        .fold(0u64, |h, v| (h ^ v.to_bits() as u64).wrapping_mul(0x100000001b3));
    println!("hash {h:016x}");
    let out = text("out", "/tmp/density.png");
    let srgb = |v: f32| {
        let v = v.clamp(0.0, 1.0);
        (255.0 * if v < 0.0031308 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 } + 0.5)
            as u8
    };
    let bytes: Vec<u8> =
        picture.iter().flat_map(|c| [srgb(c[0]), srgb(c[1]), srgb(c[2])]).collect();
    let file = std::fs::File::create(out).unwrap();
    let mut enc = png::Encoder::new(file, wide, size);
    enc.set_color(png::ColorType::Rgb);
    enc.write_header().unwrap().write_image_data(&bytes).unwrap();
}
