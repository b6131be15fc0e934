//! Six views like those of Table 2 (Figs. 1 and 5): the paper's own are not told.

use glam::DVec3;
use motes_scene::Scene;

/// A view of the dam, which fills the unit cube to a third: name, eye and target.
pub(super) struct View {
    pub name: &'static str,
    /// The name at twice the resolution.
    pub name_double: &'static str,
    /// None: the default camera, which frames all.
    eye_target: Option<[[f64; 3]; 2]>,
}

/// The whole, closer, grazing over the surface, in the spray, close up, from below the surface.
pub(super) const VIEWS: [View; 6] = [
    View { name: "(a)", name_double: "(a) doubled", eye_target: None },
    View {
        name: "(b)",
        name_double: "(b) doubled",
        eye_target: Some([[-0.35, -0.6, 0.85], [0.5, 0.5, 0.25]]),
    },
    View {
        name: "(c)",
        name_double: "(c) doubled",
        eye_target: Some([[-0.25, 0.35, 0.52], [1.0, 0.6, 0.36]]),
    },
    View {
        name: "(d)",
        name_double: "(d) doubled",
        eye_target: Some([[0.25, 0.3, 0.55], [0.9, 0.8, 0.35]]),
    },
    View {
        name: "(e)",
        name_double: "(e) doubled",
        eye_target: Some([[0.35, -0.3, 0.55], [0.5, 0.1, 0.33]]),
    },
    View {
        name: "(f)",
        name_double: "(f) doubled",
        eye_target: Some([[0.3, 0.4, 0.06], [0.75, 0.7, 0.4]]),
    },
];

impl View {
    /// Turns the camera of `scene` to it.
    pub fn apply(&self, scene: &mut Scene) {
        let [eye, target] = match self.eye_target {
            Some(points) => points.map(|p| Some(DVec3::from_array(p))),
            None => [None; 2],
        };
        (scene.camera.position, scene.camera.target) = (eye, target);
    }
}
