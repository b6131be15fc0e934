//! Measurements of the surface renderer: the tables and figures of Zirr & Dachsbacher 2015, §5, and one line
//! for any source.
//!
//! A frame is made by the product's own `Liquid`, which tells what each stage took; particles come from
//! unsorted arrays.
//!
//! - [`surface_source`]: one source, frames of a turning camera (`source`)
//! - [`surface_tables`]: Tables 1 and 2, memory, and what the product compares (`tables`); Figs. 6–8
//!   (`figures`)
//! - `fluid`: particles in memory; `takes`: pictures measured in turns; `views`: the six views

mod figures;
mod fluid;
mod source;
mod tables;
mod takes;
#[cfg(test)]
mod tests;
mod views;

use motes_scene::Scene;

pub(super) use fluid::Fluid;
pub use source::{SOURCE_STAGES, surface_source};
pub use tables::{STAGES, surface_tables};

/// What a scene is measured with where nothing else is said: one sample per pixel, and no light but what is seen
/// along the paths of the paper.
pub fn surface_defaults(scene: &mut Scene) {
    scene.image.samples = 1;
    (scene.light.shadow_rays, scene.light.occlusion_rays) = (0, 0);
}
