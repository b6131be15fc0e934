//! What is drawn over the picture: projected here, drawn by `frame`.

use glam::DVec3;
use motes_frame::{
    Annotations, Axes, Category, Ink, Legend, LegendKeys, Line, LineEnd, Lines, ScaleBar, Side,
};
use motes_particles::{Particles, SimulationBox};
use motes_scene::{CameraView, Projection, Resolved, Scene, Show};

use crate::paint::Meaning;
use crate::system::Loaded;

/// A box that the particles fill to this part along each axis is worth showing.
const FILLED: f64 = 0.6;
/// Opacity of the box's edges behind particles.
const HIDDEN_EDGE: f32 = 0.12;
/// The scale bar needs a box's edges cut off this far before the eye, as a part of the distance to it.
const NEAR: f64 = 1e-3;

/// What annotations tell about.
#[derive(Clone, Copy)]
pub(crate) struct Annotated<'a> {
    pub systems: &'a [Loaded],
    pub frame: usize,
    /// Whether it is one of several frames.
    pub film: bool,
    /// How many times the picture is enlarged when it is shown.
    pub enlarged: f32,
}

/// All annotations of a picture.
pub(crate) fn annotations(
    scene: &Scene,
    resolved: &Resolved,
    annotated: &Annotated<'_>,
) -> Annotations {
    let overlay = &scene.overlay;
    let view = &resolved.view;
    let on = |show: Show, auto: bool| show == Show::On || (show == Show::Auto && auto);
    Annotations {
        ink: Ink::default(),
        lines: box_lines(annotated.systems, view),
        legend: (overlay.legend != Show::Off).then(|| legend(annotated.systems)).flatten(),
        scale_bar: on(overlay.scale_bar, view.projection == Projection::Orthographic)
            .then(|| scale_bar(view)),
        caption: on(overlay.time, annotated.film || annotated.frame > 0)
            .then(|| caption(annotated.systems, annotated.frame)),
        axes: on(overlay.axes, false).then(|| axes(view)),
        enlarged: annotated.enlarged,
    }
}

/// The box of `particles` if it is drawn, and so framed: where it is asked for, or where the particles
/// fill it.
pub(crate) fn box_shown(particles: &Particles, show: Show) -> Option<SimulationBox> {
    particles.sim_box.filter(|sim_box| match show {
        Show::Off => false,
        Show::On => true,
        Show::Auto => particles.bounds().is_some_and(|(low, high)| fills(sim_box, low, high)),
    })
}

fn fills(sim_box: &SimulationBox, low: [f64; 3], high: [f64; 3]) -> bool {
    let corners = sim_box.corners();
    (0..3).all(|axis| {
        let along = corners.map(|c| c[axis]);
        let least = along.into_iter().fold(f64::INFINITY, f64::min);
        let greatest = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
        high[axis].min(greatest) - low[axis].max(least) >= FILLED * (greatest - least)
    })
}

fn box_lines(systems: &[Loaded], view: &CameraView) -> Option<Lines> {
    let lines: Vec<Line> = systems
        .iter()
        .filter_map(|l| l.sim_box)
        .flat_map(|b| {
            let corners = b.corners().map(DVec3::from_array);
            // An edge joins two corners whose indices differ in one bit.
            let edges = (0..8).flat_map(|i| (0..3).map(move |bit| (i, i | 1 << bit)));
            edges.filter(|(i, j)| i != j).map(move |(i, j)| (corners[i], corners[j]))
        })
        .filter_map(|(a, b)| line(view, a, b))
        .collect();
    let focal_px = match view.projection {
        Projection::Perspective => (0.5 * f64::from(view.height) / view.half_height) as f32,
        Projection::Orthographic => f32::INFINITY,
    };
    let shown = Lines { lines, focal_px, color: None, hidden: HIDDEN_EDGE };
    (!shown.lines.is_empty()).then_some(shown)
}

/// The part of an edge that lies before the eye, projected.
fn line(view: &CameraView, a: DVec3, b: DVec3) -> Option<Line> {
    let depth = |p: DVec3| (p - view.eye).dot(view.forward);
    let near = NEAR * (view.target - view.eye).length();
    let (da, db) = (depth(a), depth(b));
    if da < near && db < near {
        return None;
    }
    let cut = |p: DVec3, dp: f64, q: DVec3, dq: f64| {
        if dp >= near { p } else { p + (q - p) * ((near - dp) / (dq - dp)) * (1.0 + 1e-9) }
    };
    let end = |p: DVec3| {
        let at = view.project(p)?;
        Some(LineEnd { pixel: [at.x as f32, at.y as f32], distance: at.distance as f32 })
    };
    Some(Line { from: end(cut(a, da, b, db))?, to: end(cut(b, db, a, da))? })
}

/// The legend of the first system whose colours mean something.
fn legend(systems: &[Loaded]) -> Option<Legend> {
    systems.iter().find_map(|loaded| match &loaded.paint.meaning {
        Meaning::Nothing => None,
        Meaning::Range { title, range, colors, log } => {
            let (title, range) = if *log {
                (format!("log₁₀ {title}"), range.map(f64::log10))
            } else {
                (title.clone(), *range)
            };
            Some(Legend { title, keys: LegendKeys::Scale { range, colors: colors.clone() } })
        }
        Meaning::Categories { title, entries } => {
            let category = |(name, color): &(String, glam::Vec3)| Category {
                name: name.clone(),
                color: color.to_array(),
            };
            let keys = LegendKeys::Categories(entries.iter().map(category).collect());
            Some(Legend { title: title.clone(), keys })
        }
    })
}

fn scale_bar(view: &CameraView) -> ScaleBar {
    let depth = (view.target - view.eye).dot(view.forward);
    ScaleBar { pixels_per_unit: 1.0 / view.pixel_size(depth), unit: String::new() }
}

fn caption(systems: &[Loaded], frame: usize) -> String {
    let particles = systems.first().map(|l| &l.particles);
    match (particles.and_then(|p| p.time), particles.and_then(|p| p.step)) {
        (Some(time), _) => format!("t = {time}"),
        (None, Some(step)) => format!("step {step}"),
        (None, None) => format!("frame {frame}"),
    }
}

fn axes(view: &CameraView) -> Axes {
    let seen =
        |v: DVec3| [v.dot(view.right) as f32, v.dot(view.up) as f32, -v.dot(view.forward) as f32];
    Axes { directions: [DVec3::X, DVec3::Y, DVec3::Z].map(seen), side: Side::Left }
}
