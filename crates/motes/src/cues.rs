//! From the scene's cues to those of a frame.

use fearless_simd::Level;
use glam::DVec3;
use motes_frame::{Background, Cues, Eye, Fade, Frame, Stroke};
use motes_scene::{CameraView, Color, Cue, Projection, Resolved};

use crate::Result;
use crate::system::Loaded;

/// What is farther behind something is another structure, in radii of a typical particle: of atoms that touch,
/// the one behind is no farther than two.
const STRUCTURE: f64 = 4.0;
/// How many particles tell what is typical.
const SAMPLE: usize = 1000;

/// Draws the cues that are on into `shown`, which has the picture's tone, and puts the background behind.
pub(crate) fn draw(
    cue: &Cue,
    resolved: &Resolved,
    systems: &[Loaded],
    (shown, background): (&mut Frame, Background),
) -> Result<()> {
    if !cue.any() {
        background.put_behind(shown);
        return Ok(());
    }
    let stroke = |word: &str, (strength, width): (f64, f64), color: Color| {
        let stroke =
            Stroke { strength: strength as f32, width: width as f32, color: color.linear() };
        cue.has(word).then_some(stroke)
    };
    let fade = || Fade { strength: cue.depth as f32, color: cue.depth_color.map(Color::linear) };
    let structure = cue.structure.unwrap_or_else(|| STRUCTURE * typical_radius(systems));
    let cues = Cues {
        eye: eye(&resolved.view),
        range: cue.depth_range.or(resolved.range).unwrap_or_default().map(|v| v as f32),
        structure: structure as f32,
        edges: stroke("edges", (cue.edges, cue.edges_width), cue.edges_color),
        seam: stroke("seam", (cue.seam, cue.seam_width), cue.seam_color),
        halo: stroke("halo", (cue.halo, cue.halo_width), cue.halo_color),
        rim: stroke("rim", (cue.rim, cue.rim_width), cue.rim_color),
        depth: cue.has("depth").then(fade),
    };
    Ok(cues.draw(shown, background, Level::new())?)
}

fn eye(view: &CameraView) -> Eye {
    let vector = |v: DVec3| v.as_vec3().to_array();
    Eye {
        right: vector(view.right),
        up: vector(view.up),
        forward: vector(view.forward),
        pixel: view.pixel_size(1.0) as f32,
        perspective: view.projection == Projection::Perspective,
    }
}

/// The median radius of some particles, evenly chosen.
fn typical_radius(systems: &[Loaded]) -> f64 {
    let mut radii = Vec::new();
    let all: usize = systems.iter().flat_map(|l| &l.classes.grids).map(|grid| grid.len()).sum();
    for grid in systems.iter().flat_map(|l| &l.classes.grids) {
        radii.extend((0..grid.len()).step_by(all / SAMPLE + 1).map(|slot| grid.radius_at(slot)));
    }
    radii.sort_by(f32::total_cmp);
    radii.get(radii.len() / 2).map_or(1.0, |radius| f64::from(*radius))
}
