//! Colours of what sections lay open.

use std::sync::Arc;

use glam::Vec3;
use motes_particles::Particles;
use motes_scene::{CapColor, ColorBy, Coloring, Cut, Scene, Section, System};
use motes_spheres::Cap;

use crate::Result;
use crate::paint::Paint;

/// Part of the distance between the lines of a hatched cap that a line takes.
const LINE: f32 = 0.3;
/// What a line leaves of a particle's colour.
const DARKER: f32 = 0.35;
/// Lines across the diagonal of what is visible, where nothing else is said.
pub(crate) const LINES: f64 = 100.0;

/// The colours of the caps of one system, by section.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caps(Vec<(u16, Inside)>);

/// What the inside of particles looks like, if not like their outside.
#[derive(Clone, Debug)]
enum Inside {
    /// Lines a distance apart, across `along`.
    Hatched {
        along: Vec3,
        spacing: f32,
    },
    Color(Vec3),
    Property(Box<Paint>),
}

impl Caps {
    /// Those of the sections that cut the system at place `number`; `diagonal` tells that of what is visible.
    ///
    /// # Errors
    /// A section names a property that is not there.
    pub fn new(
        (scene, number): (&Scene, usize),
        particles: &Arc<Particles>,
        diagonal: impl Fn() -> f64,
    ) -> Result<Self> {
        let system = &scene.system[number];
        let mut caps = Vec::new();
        for (i, section) in scene.sections_of(number).filter(|(_, s)| s.cut == Cut::Caps) {
            let inside = match &section.cap {
                CapColor::Particle => continue,
                CapColor::Hatched => hatched(section, &diagonal),
                CapColor::Color(color) => Inside::Color(Vec3::from(color.linear())),
                CapColor::Property(name) => {
                    let paint = Paint::new(particles, &colored_by(system, name), None)?;
                    Inside::Property(Box::new(paint))
                }
            };
            caps.push((i as u16, inside));
        }
        Ok(Self(caps))
    }

    /// The colour of the inside of particle `index`, whose outside has the colour `outside`.
    pub fn color(&self, index: u32, cap: Cap, outside: impl FnOnce() -> Vec3) -> Option<Vec3> {
        let (_, inside) = self.0.iter().find(|(section, _)| *section == cap.owner)?;
        Some(match inside {
            Inside::Color(color) => *color,
            Inside::Property(paint) => paint.color(index),
            Inside::Hatched { along, spacing } => {
                let place = cap.point.dot(*along) / spacing;
                let on_line = place - place.floor() < LINE;
                outside() * if on_line { DARKER } else { 1.0 }
            }
        })
    }
}

/// Lines at 45° in the plane.
fn hatched(section: &Section, diagonal: impl Fn() -> f64) -> Inside {
    let normal = section.normal.normalize_or(glam::DVec3::Z).as_vec3();
    let (u, v) = normal.any_orthonormal_pair();
    let along = (u + v) * std::f32::consts::FRAC_1_SQRT_2;
    let spacing = section.hatch.unwrap_or_else(|| diagonal() / LINES) as f32;
    Inside::Hatched { along, spacing: spacing.max(f32::MIN_POSITIVE) }
}

/// The system, but coloured by `name`; its range is that of what it is coloured by itself.
fn colored_by(system: &System, name: &str) -> System {
    let by = ColorBy::from(name.to_owned());
    let range = system.color.range.filter(|_| by == system.color.by);
    System { color: Coloring { by, range, ..system.color.clone() }, ..system.clone() }
}
