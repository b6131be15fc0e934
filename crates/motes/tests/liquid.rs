//! Particles as a liquid, through the front door.

use motes::{Layers, Picture, Quiet, Scene, Session};
use motes_frame::Values;

fn render(assignments: &[&str], threads: usize) -> Picture {
    let mut scene = Scene::default();
    scene.set_sources(&["demo:dam:2e4".into()]);
    let common = ["renderer=surface", "image.width=160", "image.height=120", "image.samples=1"];
    for assignment in common.iter().chain(assignments) {
        scene.set_text(assignment).unwrap();
    }
    let mut session = Session::open(scene, Some(threads)).unwrap();
    session.render(0, Layers::Yes, &Quiet).unwrap()
}

/// The same with a red ball of another system at `at`.
fn with_ball(assignments: &[&str], at: [f64; 3], radius: f64) -> Vec<[f32; 4]> {
    let path = std::env::temp_dir().join(format!(
        "motes-ball-{}-{}.xyz",
        std::process::id(),
        (1e3 * at[1]) as i64
    ));
    let [x, y, z] = at;
    std::fs::write(&path, format!("1\nProperties=species:S:1:pos:R:3\nX {x} {y} {z}\n")).unwrap();
    let mut scene = Scene::default();
    scene.set_sources(&["demo:dam:2e4".into(), path.display().to_string()]);
    let ball = [format!("system.1.radius={radius}"), "system.1.color.uniform=#ff0000".into()];
    let common = [
        "renderer=surface",
        "image.width=160",
        "image.height=120",
        "image.samples=1",
        "system.1.color.by=uniform",
    ];
    for assignment in common.iter().chain(assignments).copied().chain(ball.iter().map(|s| &**s)) {
        scene.set_text(assignment).unwrap();
    }
    let mut session = Session::open(scene, Some(2)).unwrap();
    let picture = session.render(0, Layers::No, &Quiet).unwrap();
    std::fs::remove_file(path).unwrap();
    picture.raw.color().to_vec()
}

/// The values of a layer of numbers.
fn numbers(picture: &Picture, name: &str) -> Vec<f64> {
    let (_, values) = picture.raw.named_values().find(|(n, _)| *n == name).unwrap();
    match values {
        Values::F32(v) => v.iter().map(|v| f64::from(*v)).collect(),
        Values::U32(v) => v.iter().map(|v| f64::from(*v)).collect(),
        Values::I64(v) => v.iter().map(|v| *v as f64).collect(),
        _ => panic!("{name} is not a layer of numbers"),
    }
}

#[test]
fn the_picture_is_the_same_however_it_is_made() {
    for mode in ["surface.mode=front", "surface.mode=translucent", "surface.mode=refractive"] {
        let expected = render(&[mode], 1).raw;
        for (other, threads) in
            [("surface.skip=true", 2), ("surface.skip=false", 3), ("surface.tile=20", 2)]
        {
            assert!(render(&[mode, other], threads).raw == expected, "{mode} {other} {threads}");
        }
    }
}

#[test]
fn finer_pixels_are_means() {
    // A pixel of four is the mean of the four of a picture twice as large, where anything is to be seen.
    let color = |assignments: &[&str]| render(assignments, 2).raw.color().to_vec();
    let fine = color(&["image.width=320", "image.height=240"]);
    let mean = |i: usize| {
        let [x, y] = [2 * (i % 160), 2 * (i / 160)];
        let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
        four.map(|(x, y)| fine[y * 320 + x][0]).iter().sum::<f32>() / 4.0
    };
    let found = color(&["image.samples=4"]);
    let off = (0..160 * 120).filter(|i| (found[*i][0] - mean(*i)).abs() > 0.1).count();
    assert!(off < 160 * 120 / 500, "{off}");
}

#[test]
fn layers_agree_with_each_other() {
    let picture = render(&[], 2);
    let (depth, id) = (numbers(&picture, "depth"), numbers(&picture, "id"));
    let (count, thickness) = (numbers(&picture, "span_count"), numbers(&picture, "thickness"));
    let mut seen = 0;
    for i in 0..depth.len() {
        let liquid = depth[i].is_finite();
        assert_eq!((count[i] > 0.0, thickness[i] > 0.0), (liquid, liquid), "pixel {i}");
        assert!(id[i] < 2e4 && (liquid || id[i] == -1.0), "pixel {i}: {}", id[i]);
        seen += usize::from(liquid);
    }
    assert!(seen > depth.len() / 10, "{seen}");
}

#[test]
fn without_gap_and_smoothing_it_is_the_spheres() {
    let still = [
        "surface.smoothing=0",
        "surface.gap=0",
        "surface.ball=1",
        "surface.drop=1",
        "surface.cull=off",
    ];
    let surface = render(&still, 2);
    let spheres = render(&[&still[..], &["renderer=spheres", "light.preset=flat"]].concat(), 2);
    let (a, b) = (numbers(&surface, "depth"), numbers(&spheres, "depth"));
    let (ids_a, ids_b) = (numbers(&surface, "id"), numbers(&spheres, "id"));
    let mut hits = 0;
    for i in 0..a.len() {
        // At the edge of a ball rounding decides whether the ray meets it.
        if a[i].is_finite() != b[i].is_finite() || (a[i] - b[i]).abs() > 1e-4 {
            continue;
        }
        hits += usize::from(a[i].is_finite() && ids_a[i] == ids_b[i]);
    }
    let all = b.iter().filter(|d| d.is_finite()).count();
    assert!(hits * 1000 > all * 995, "{hits} of {all}");
}

#[test]
fn spray_is_drops_or_left_out() {
    let count = |spray| {
        let picture = render(&[spray], 2);
        let kept = picture.stats.particles["splatted"];
        (kept, numbers(&picture, "thickness").iter().sum::<f64>())
    };
    let (kept, volume) = count("surface.drop=2");
    let (smaller, less) = count("surface.drop=1.24");
    let (fewer, least) = count("surface.spray=drop");
    assert!(kept == smaller && fewer < kept, "{kept} {smaller} {fewer}");
    assert!(least < less && less < volume, "{least} {less} {volume}");
}

#[test]
fn smooth_liquid_has_smooth_normals() {
    let rough = |picture: &Picture| {
        let normals = picture.raw.normal().unwrap();
        let depth = picture.raw.depth().unwrap();
        let (mut sum, mut count) = (0.0, 0);
        // The side that faces the eye, beneath the spray.
        for y in 80..95 {
            for x in 60..90 {
                let [a, b] = [y * 160 + x, y * 160 + x + 1].map(|i| normals[i]);
                if depth[y * 160 + x].is_finite() {
                    sum += (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
                    count += 1;
                }
            }
        }
        sum / f64::from(count)
    };
    let [plain, smooth] = ["surface.smoothing=0", "surface.filter=recursive"]
        .map(|s| rough(&render(&["surface.fit=off", s], 2)));
    // What is left is the shape of the waves.
    assert!(smooth < 0.2 * plain, "{plain} {smooth}");
}

#[test]
fn nothing_visible_is_no_liquid() {
    let picture = render(&["system.where='Position.X > 9'"], 1);
    assert!(numbers(&picture, "depth").iter().all(|d| d.is_infinite()));
}

#[test]
fn a_panorama_that_is_none_is_an_error() {
    let mut scene = Scene::default();
    scene.set_sources(&["demo:dam:1000".into()]);
    for assignment in
        ["renderer=surface", "image.width=8", "image.height=8", "surface.environment=none.hdr"]
    {
        scene.set_text(assignment).unwrap();
    }
    let error = Session::open(scene, Some(1)).unwrap().render(0, Layers::No, &Quiet).unwrap_err();
    assert!(error.to_string().contains("none.hdr"), "{error}");
}

#[test]
fn spheres_of_another_system_stand_before_the_liquid_and_in_it() {
    let camera = [
        "camera.position=[0.5, -2.0, 0.6]",
        "camera.target=[0.5, 0.5, 0.2]",
        "surface.mode=translucent",
    ];
    // How much redder than green a picture is at its middle, which shows the target.
    let red = |picture: &[[f32; 4]]| {
        let middle = picture[60 * 160 + 80];
        middle[0] / middle[1].max(1e-6)
    };
    let water = red(render(&camera, 2).raw.color());
    let before = red(&with_ball(&camera, [0.5, -0.5, 0.36], 0.1));
    let within = red(&with_ball(&camera, [0.5, 0.3, 0.232], 0.1));
    assert!(water < 1.1 && before > 3.0, "{water} {before}");
    // Seen through water that takes most of the red.
    assert!(within > 1.2 * water && within < before, "{water} {within} {before}");
    for mode in ["surface.mode=refractive", "surface.mode=front"] {
        let camera = [camera[0], camera[1], mode];
        let opaque = red(&with_ball(&camera, [0.5, -0.5, 0.36], 0.1));
        assert!(opaque > 3.0, "{mode}: {opaque}");
    }
}

/// A box of water with oil above it, one unit each way, from `y = 0` on; and a third type, if asked for.
fn oil_on_water(assignments: &[&str], name: &str) -> motes::Result<Picture> {
    let path = std::env::temp_dir().join(format!("motes-{name}-{}.xyz", std::process::id()));
    let mut text = format!("{}\nProperties=species:S:1:pos:R:3\n", 16 * 16 * 16);
    for i in 0..16 * 16 * 16 {
        let [x, y, z] = [i % 16, i / 16 % 16, i / 256].map(|i| f64::from(i) / 16.0);
        let species = if z < 0.5 { "water" } else { "oil" };
        text += &format!("{species} {x} {y} {z}\n");
    }
    std::fs::write(&path, text).unwrap();
    let mut scene = Scene::default();
    scene.set_sources(&[path.display().to_string()]);
    let common = [
        "renderer=surface",
        "image.width=120",
        "image.height=120",
        "image.samples=1",
        "overlay.legend=off",
        "camera.direction=[0, 1, 0]",
        "camera.projection=orthographic",
        "system.0.radius=0.03125",
        "surface.environment=none",
        "light.preset=flat",
        "system.0.color.colors.water=#0000ff",
        "system.0.color.colors.oil=#ff0000",
    ];
    for assignment in common.iter().chain(assignments) {
        scene.set_text(assignment).unwrap();
    }
    let picture = Session::open(scene, Some(2)).and_then(|mut s| s.render(0, Layers::No, &Quiet));
    std::fs::remove_file(path).unwrap();
    picture
}

#[test]
fn each_type_may_be_a_liquid() {
    let at = |picture: &Picture, x: usize, y: usize| picture.raw.color()[y * 120 + x];
    for mode in ["surface.mode=front", "surface.mode=translucent"] {
        let picture = oil_on_water(&["surface.media=types", mode], "media").unwrap();
        let [above, below] = [at(&picture, 60, 40), at(&picture, 60, 80)];
        assert!(above[0] > 2.0 * above[2] && below[2] > 2.0 * below[0], "{above:?} {below:?}");
    }
    // A lens of oil bends light more than one of water.
    let sky = ["surface.environment=sky", "camera.direction=[1, 2, -1]", "surface.media=types"];
    let refractive = |iors| oil_on_water(&[&sky[..], &[iors]].concat(), "iors").unwrap();
    let [same, other] = ["surface.iors=[1.33, 1.33]", "surface.iors=[1.33, 1.47]"].map(refractive);
    let differs = |(a, b): (&[f32; 4], &[f32; 4])| (a[0] - b[0]).abs() > 0.02;
    let changed =
        same.raw.color().iter().zip(other.raw.color()).filter(|pair| differs(*pair)).count();
    assert!(changed > 500, "{changed}");
}

#[test]
fn media_need_types() {
    let mut scene = Scene::default();
    scene.set_sources(&["demo:dam:1000".into()]);
    scene.set_text("renderer=surface").unwrap();
    scene.set_text("surface.media=types").unwrap();
    let mut session = Session::open(scene, Some(1)).unwrap();
    let error = session.render(0, Layers::No, &Quiet).unwrap_err();
    assert!(error.to_string().contains("Particle Type"), "{error}");
}
