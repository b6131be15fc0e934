//! Whole frames with cuts and cues: Chaudhari's Figure 8 (plain, edges, depth, both, intersections), and all of
//! them. As the product draws them while one looks: layers, cues, tone and background, without secondary rays.

use glam::DVec3;
use motes_grid::Plane;
use motes_scene::{Cut, Resolved, Scene, Section};

use super::sections::Found;
use super::{median, timed};
use crate::view::simple;
use crate::{Layers, Quiet, Result, Session};

/// What pictures are called, and their cues; all are cut by four planes with caps but the first, which is whole.
pub(super) const PICTURES: [(&str, &str); 7] = [
    ("whole", ""),
    ("plain", ""),
    ("edges", "edges"),
    ("depth", "depth"),
    ("both", "edges,depth"),
    ("seams", "edges,depth,seam"),
    ("all", "edges,depth,halo,rim,seam"),
];

/// Hashes of the first frames and median milliseconds of the others, picture by picture. `planes` are given about
/// `origin`; `poses` are where the camera stands.
///
/// # Errors
/// The source cannot be read.
pub(super) fn cued(
    scene: &Scene,
    (planes, origin): (&[Plane], DVec3),
    poses: &[Resolved],
) -> Result<Found> {
    let section = |plane: &Plane| Section {
        point: origin + plane.normal.as_dvec3() * f64::from(plane.offset),
        normal: plane.normal.as_dvec3(),
        cut: Cut::Caps,
        ..Section::default()
    };
    let sections: Vec<Section> = planes.iter().map(section).collect();
    let mut session = Session::open(simple(scene), None)?;
    let mut found = Found::default();
    for (name, on) in PICTURES {
        let mut all = Vec::new();
        for (frame, pose) in poses.iter().enumerate() {
            let mut scene = simple(scene);
            scene.section = if name == "whole" { Vec::new() } else { sections.clone() };
            scene.cue.on = on.into();
            let camera = &mut scene.camera;
            camera.position = Some(pose.view.eye);
            camera.target = Some(pose.view.target);
            camera.up = Some(pose.view.up);
            camera.height = Some(2.0 * pose.view.half_height);
            session.set_scene(scene)?;
            if frame == 0 {
                let picture = session.render(0, Layers::No, &Quiet)?;
                found.hashes.insert(name, format!("{:016x}", picture.shown.hash()));
            } else {
                let (ms, look) = timed(|| session.look(0, (false, 1.0), &Quiet));
                session.recycle(look?.shown);
                all.push(ms);
            }
        }
        found.ms.insert(name, median(all));
    }
    Ok(found)
}
