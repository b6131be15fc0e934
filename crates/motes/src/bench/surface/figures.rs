//! Figs. 6–8 of Zirr & Dachsbacher 2015, in numbers.

use motes_scene::{Scene, surface};
use motes_surface::{Mode, Surfaces};

use super::fluid::Drawn;
use super::tables::{Bench, SYNTHETIC, Set};
use super::takes::{Measured, Take};
use crate::Result;
use crate::bench::table::{Cell, Table};

/// Angle resolutions, degrees; exact intervals to compare with.
const ANGLES: [(&str, Option<f64>); 6] = [
    ("1°", Some(1.0)),
    ("3.5°", Some(3.5)),
    ("7°", Some(7.0)),
    ("14°", Some(14.0)),
    ("28°", Some(28.0)),
    ("exact", None),
];

/// As many layers as there can be.
const MOST_LAYERS: u32 = 1 << 20;
/// As many spans as there can be: more than the sets of Fig. 8 have.
const MOST_SPANS: u32 = 126;

/// The table of a stage, without rows.
pub(super) fn empty(stage: &'static str) -> Table {
    let (title, columns): (_, &[&str]) = match stage {
        "fig6" => (
            "angle resolution of bits, no smoothing; angle between normals and those of exact spans",
            &["Layers", "Splat", "RLE", "Mean angle", "Largest angle"],
        ),
        "fig7" => (
            "translucency and refraction; depth: boundaries after the first",
            &["Rays", "Columns", "Shading", "(Σ)"],
        ),
        _ => (
            "more layers than are stored, as spheres (ball 1, no gap); per pixel that shows any; off: 7 spans \
             against all, not smoothed",
            &[
                "True spans",
                "Stored",
                "Most",
                "Thickness off",
                "Picture off",
                "Translucent (Σ)",
                "Refract (Σ)",
            ],
        ),
    };
    Table::new(stage, title, columns)
}

/// Makes the scene of a row of Fig. 6.
fn with_angle(angle: Option<f64>, scene: &mut Scene) {
    scene.surface.smoothing = Some(0.0);
    if let Some(angle) = angle {
        scene.surface.representation = surface::Representation::Bits;
        (scene.surface.angle, scene.surface.layers) = (angle, MOST_LAYERS);
    }
}

/// Fig. 6.
pub(super) fn angles(bench: &Bench<'_>, set: &Set, table: &mut Table) -> Result<()> {
    let all = bench.measure(set, &ANGLES, |angle, scene| {
        with_angle(*angle, scene);
        (Mode::Front, &[])
    })?;
    let draw = |angle| {
        let mut scene = bench.scene();
        with_angle(angle, &mut scene);
        let take = Take::new(("", &set.fluid), scene, (Mode::Front, &[]))?;
        Ok::<_, crate::Error>(take.draw((&set.fluid, &set.extracted))?.surfaces)
    };
    let exact = draw(None)?;
    for (m, (_, angle)) in all.into_iter().zip(ANGLES) {
        let (mean, largest) = turned(&draw(angle)?, &exact);
        let cells = vec![
            Cell::Count(m.count("layers")),
            m.cell("splat"),
            m.cell("compress"),
            Cell::Degrees(mean),
            Cell::Degrees(largest),
        ];
        table.push((m.label, set.particles()), cells, m.hashes);
    }
    Ok(())
}

/// The mean and the largest angle, degrees, between the normals of what two pictures show first.
fn turned(a: &Surfaces, b: &Surfaces) -> (f64, f64) {
    let (mut sum, mut count, mut largest) = (0.0, 0, 0.0_f64);
    for pixel in 0..a.view.pixels() {
        let (of_a, of_b) = (a.of(pixel), b.of(pixel));
        if !of_a.is_empty() && !of_b.is_empty() {
            let [a, b] = [a.normal(of_a.start), b.normal(of_b.start)].map(|n| n.as_dvec3());
            // Of small angles the cosine says little.
            let angle = a.cross(b).length().atan2(a.dot(b)).to_degrees();
            (sum, count, largest) = (sum + angle, count + 1, largest.max(angle));
        }
    }
    (sum / f64::from(count.max(1)), largest)
}

/// Fig. 7.
pub(super) fn modes(bench: &Bench<'_>, set: &Set, table: &mut Table) -> Result<()> {
    let rows = [
        ("translucent", (Mode::Translucent, 0)),
        ("refractive, depth 2", (Mode::Refractive, 2)),
        ("refractive, depth 4", (Mode::Refractive, 4)),
    ];
    let all = bench.measure(set, &rows, |(mode, depth), scene| {
        scene.surface.depth = *depth;
        (*mode, &[])
    })?;
    for (m, (_, (mode, _))) in all.into_iter().zip(rows) {
        let stage = if mode == Mode::Translucent { "translucent" } else { "refractive" };
        let mut cells = vec![Cell::Count(m.count("rays")), Cell::Count(m.count("columns"))];
        cells.extend([m.cell(stage), Cell::Ms(m.sum(stage))]);
        table.push((m.label, set.particles()), cells, m.hashes);
    }
    Ok(())
}

/// The spheres of Fig. 8 as they are: they are made so that they leave no holes.
fn as_spheres(scene: &mut Scene) {
    (scene.surface.ball, scene.surface.gap) = (1.0, Some(0.0));
}

/// Fig. 8.
pub(super) fn synthetic(bench: &Bench<'_>, table: &mut Table) -> Result<()> {
    for (kind, label) in [("demo:layers", "24 layers"), ("demo:checker", "checkerboard")] {
        let mut scene = bench.scene();
        as_spheres(&mut scene);
        let set = bench.load(kind, SYNTHETIC, scene)?;
        let measured = bench.measure(&set, &[(label, ())], |(), scene| {
            as_spheres(scene);
            (Mode::Translucent, &[Mode::Refractive])
        })?;
        let draw = |spans: Option<u32>| {
            let mut scene = bench.scene();
            as_spheres(&mut scene);
            scene.surface.smoothing = Some(0.0);
            scene.surface.spans = spans.unwrap_or(scene.surface.spans);
            Take::new((label, &set.fluid), scene, (Mode::Translucent, &[]))?
                .draw((&set.fluid, &set.extracted))
        };
        let (some, all) = (draw(None)?, draw(Some(MOST_SPANS))?);
        for m in measured {
            table.push((label, set.particles()), cells(&m, &some, &all), m.hashes.clone());
        }
    }
    Ok(())
}

/// A row of Fig. 8.
fn cells(m: &Measured, some: &Drawn, all: &Drawn) -> Vec<Cell> {
    let surfaces = &some.surfaces;
    let seen: Vec<usize> =
        (0..surfaces.view.pixels()).filter(|p| !surfaces.of(*p).is_empty()).collect();
    let pixels = seen.len().max(1) as f64;
    let counts = seen.iter().map(|p| surfaces.count(*p));
    let stored: usize = seen.iter().map(|p| surfaces.of(*p).len() / 2).sum();
    let thickness = |of: &Surfaces, p: usize| f64::from(of.thickness(p));
    let (mut off, mut whole) = (0.0, 0.0);
    for p in &seen {
        let right = thickness(&all.surfaces, *p);
        off += (thickness(surfaces, *p) - right).abs();
        whole += right;
    }
    let picture = some.color.iter().zip(&all.color).flat_map(|(a, b)| {
        let [a, b] = [a, b].map(|c| [c[0], c[1], c[2]].map(|v| f64::from(v.clamp(0.0, 1.0))));
        [0, 1, 2].map(|i| (a[i] - b[i]).powi(2))
    });
    let picture = (picture.sum::<f64>() / (3.0 * pixels)).sqrt();
    vec![
        Cell::Factor(counts.clone().map(f64::from).sum::<f64>() / pixels),
        Cell::Factor(stored as f64 / pixels),
        Cell::Count(counts.max().unwrap_or(0).into()),
        Cell::Percent(100.0 * off / f64::max(whole, f64::MIN_POSITIVE)),
        Cell::Percent(100.0 * picture),
        Cell::Ms(m.sum("translucent")),
        Cell::Ms(m.sum("refractive")),
    ]
}
