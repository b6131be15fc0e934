use motes_scene::{Scene, surface};

use super::*;
use crate::bench::{Cell, Line, Source, Table, Tables};
use crate::{Layers, Quiet, Session};

fn tables(stages: &[&str], scale: f64) -> Vec<Table> {
    let options = Tables {
        size: (64, 48),
        frames: 1,
        stages: stages.iter().map(|s| (*s).to_owned()).collect(),
        scale,
        threads: Some(2),
    };
    surface_tables(&options, &Quiet).unwrap()
}

fn table(stage: &str, scale: f64) -> Table {
    tables(&[stage], scale).remove(0)
}

/// A value that is a number of any kind.
fn number(cell: &Cell) -> f64 {
    match *cell {
        Cell::Frame(x) | Cell::Ms(x) | Cell::Factor(x) | Cell::Percent(x) | Cell::Degrees(x) => x,
        Cell::Count(n) => n as f64,
        Cell::Bytes(n) => n as f64,
        Cell::Missing => panic!("missing"),
    }
}

#[test]
fn the_tables_have_their_rows_and_columns() {
    let all = tables(&[], 1e-3);
    assert_eq!(all.iter().map(|t| t.stage).collect::<Vec<_>>(), STAGES);
    for table in &all {
        let rows: Vec<_> = table.rows.iter().map(|row| row.dataset).collect();
        let expected: &[&str] = match table.stage {
            "table1" => &["16", "32", "64", "128", "256", "512"],
            "table2" => &["(a)", "(b)", "(c)", "(d)", "(e)", "(f)", "(a) doubled", "(b) doubled"],
            "memory" => &["(a)"],
            "fig6" => &["1°", "3.5°", "7°", "14°", "28°", "exact"],
            "fig7" => &["translucent", "refractive, depth 2", "refractive, depth 4"],
            "fig8" => &["24 layers", "checkerboard"],
            "skip" => &["(a)", "(d)"],
            "representation" => &["intervals", "bits"],
            _ => &["(a)", "(b), kept", "(b), anew"],
        };
        assert_eq!(rows, expected, "{}", table.stage);
        // One picture in a row, but where it is drawn in two modes.
        let pictures = if ["table2", "fig8"].contains(&table.stage) { 2 } else { 1 };
        for row in &table.rows {
            assert_eq!(row.values.len(), table.columns.len(), "{} {row:?}", table.stage);
            assert_eq!(row.hashes.len(), pictures, "{} {row:?}", table.stage);
            assert!(row.values.iter().all(|v| number(v).is_finite()), "{} {row:?}", table.stage);
        }
        assert_eq!(table.to_string().lines().count(), table.rows.len() + 2);
    }
    let views: Vec<_> = all[1].rows.iter().flat_map(|row| &row.hashes).collect();
    let different: std::collections::BTreeSet<_> = views.iter().collect();
    assert_eq!(views.len(), different.len(), "{views:?}");
}

#[test]
fn tiles_and_skipping_change_no_picture_and_skipping_visits_less() {
    let tiles = table("table1", 1e-3);
    assert!(tiles.rows.iter().all(|row| row.hashes == tiles.rows[0].hashes));
    // 4 × 3 tiles of 16 pixels, one of 64 and more.
    assert_eq!(tiles.rows[0].values[2], Cell::Count(12));
    assert_eq!(tiles.rows[5].values[2], Cell::Count(1));
    for row in &table("skip", 1e-3).rows {
        let [rays, _, plain, _, blocks, _] = [0, 1, 2, 3, 4, 5].map(|i| number(&row.values[i]));
        assert!(row.hashes.len() == 1 && rays > 0.0 && rays < blocks && blocks < plain, "{row:?}");
    }
}

#[test]
fn another_view_of_what_stands_still_needs_no_extraction() {
    let rows = table("view", 1e-3).rows;
    assert_eq!(rows[1].hashes, rows[2].hashes);
    assert_ne!(rows[0].hashes, rows[1].hashes);
    assert!(rows[1].values[0] == Cell::Ms(0.0) && number(&rows[2].values[0]) > 0.0);
}

#[test]
fn finer_layers_have_normals_nearer_to_the_exact_ones() {
    let rows = table("fig6", 1e-3).rows;
    let layers: Vec<f64> = rows.iter().map(|row| number(&row.values[0])).collect();
    let angles: Vec<f64> = rows.iter().map(|row| number(&row.values[3])).collect();
    assert!(layers[..5].is_sorted_by(|a, b| a > b) && layers[5] == 0.0, "{layers:?}");
    assert!(angles[..5].is_sorted_by(|a, b| a < b) && angles[5] == 0.0, "{angles:?}");
}

#[test]
fn more_layers_than_are_stored_keep_their_thickness() {
    // With fewer particles the sheets have holes.
    let rows = table("fig8", 1e-2).rows;
    for row in &rows {
        let [seen, stored, most, off] = [0, 1, 2, 3].map(|i| number(&row.values[i]));
        assert!(stored <= 7.0 && stored < seen && most > 7.0, "{row:?}");
        // Percent; depths and what is empty in the last span are f32.
        assert!(off < 1e-3, "{row:?}");
    }
    // A slanted ray may leave a sheet between two of its spheres and enter it once more.
    let most = number(&rows[0].values[2]);
    assert!((24.0..48.0).contains(&most), "{most}");
}

#[test]
fn memory_is_told_of_every_structure() {
    let row = &table("memory", 1e-3).rows[0];
    assert!(row.values.iter().all(|v| number(v) > 0.0), "{row:?}");
    // 20,000 particles of three numbers.
    assert_eq!(row.values[0], Cell::Bytes(240_000));
    let all: Vec<f64> = row.values.iter().map(number).collect();
    assert!(all[8] < all[1..8].iter().sum(), "{row:?}");
}

fn scene() -> Scene {
    let mut scene = Scene::default();
    scene.set_sources(&["demo:dam:5000".into()]);
    (scene.image.width, scene.image.height) = (64, 48);
    surface_defaults(&mut scene);
    // Where the default camera stands goes by more than a box.
    scene.camera.position = Some(glam::DVec3::new(-0.8, -1.2, 1.1));
    scene.camera.target = Some(glam::DVec3::new(0.5, 0.5, 0.25));
    scene
}

fn line(scene: Scene, stages: &[&str]) -> Line {
    let stages = stages.iter().map(|s| (*s).to_owned()).collect();
    surface_source(Source { scene, frames: 2, stages, threads: Some(2) }, &Quiet).unwrap()
}

#[test]
fn a_source_has_all_stages_and_the_pictures_of_the_product() {
    let whole = line(scene(), &[]);
    assert!(SOURCE_STAGES.iter().all(|stage| whole.ms[stage] > 0.0), "{:?}", whole.ms);
    assert!(whole.method == "surface" && whole.particles == 5000 && whole.threads == 2);
    assert!(whole.bytes["input"] == 60_000 && whole.counts["kept"] <= 5000);
    assert!(whole.counts["columns"] > whole.counts["rays"] && whole.counts["spans"] > 0);
    for (mode, hash) in [
        (surface::Mode::Refractive, &whole.hash),
        (surface::Mode::Translucent, &whole.hashes["translucent"]),
    ] {
        let mut scene = scene();
        scene.surface.mode = mode;
        scene.renderer = motes_scene::Renderer::Surface;
        let picture = Session::open(scene.clone(), Some(1)).unwrap();
        let picture = { picture }.render(0, Layers::No, &Quiet).unwrap();
        let pixels: Vec<u32> = picture.raw.color().iter().map(crate::bench::shot::pack).collect();
        assert_eq!(*hash, crate::bench::hash((64, 48), &pixels), "{mode:?}");
        // The mode is that of the line's own picture.
        let own = line(scene, &["frame"]);
        assert_eq!((&own.hash, own.ms.len()), (hash, 1));
    }
}

#[test]
fn radii_that_nothing_tells_are_measured() {
    let mut unknown = scene();
    let folder = std::env::temp_dir().join(format!("motes-bench-surface-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("points.xyz");
    let points: Vec<String> = (0..1000)
        .map(|i| format!("{} {} {}", i % 10, i / 10 % 10, i / 100))
        .map(|p| format!("Q {p}\n"))
        .collect();
    std::fs::write(&path, format!("1000\n\n{}", points.concat())).unwrap();
    unknown.set_sources(&[path.to_string_lossy().into_owned()]);
    (unknown.camera.position, unknown.camera.target) = (None, None);
    let mut known = unknown.clone();
    let points: Vec<[f32; 3]> =
        (0..1000).map(|i| [i % 10, i / 10 % 10, i / 100].map(|n| n as f32)).collect();
    let classes = crate::radius::classes(
        motes_grid::RadiusClasses::default(),
        points.into(),
        crate::radius::Rule::HalfSpacing(crate::radius::Spacing::Share),
        1.0,
        motes_grid::Params::default(),
    );
    let measured = f64::from(classes.grids[0].radius_at(0));
    assert!((measured - 0.5).abs() < 0.005, "{measured}");
    known.system[0].radius = Some(measured);
    assert_eq!(line(unknown, &["frame"]).hash, line(known, &["frame"]).hash);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let refused = |scene: Scene, stages: Vec<String>| {
        let options = Source { scene, frames: 1, stages, threads: Some(1) };
        let error = surface_source(options, &Quiet).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    };
    assert!(refused(scene(), vec!["table1".into()]).contains("'table1'"));
    let mut some = scene();
    some.system[0].r#where = "Position.X > 0.5".into();
    assert!(refused(some, vec![]).contains("where"));
    let mut none = scene();
    none.set_sources(&["demo:dam:0".into()]);
    none.system[0].radius = Some(1.0);
    let said = refused(none, vec![]);
    assert!(said.contains("demo:dam:0"), "{said}");
}
