//! The parameters of the density renderer (Yasuda et al. 2009), under `density.`.

use glam::DVec3;

use crate::error::Result;
use crate::resolve::{need, positive};
use crate::settings::settings;

settings! {
    /// The density renderer: particles as a field of voxels, with rays cast through it.
    pub struct Density {
        /// Voxels along the longest side of what is visible; none: a voxel is as wide as a particle.
        resolution: Option<u32> = None => "64",
        /// How far the density of a particle reaches, in its radii; at least two voxels. More is smoother.
        support: f64 = 5.0,
        /// Density at the surface; deep in a liquid at rest it is 1.
        threshold: f64 = 0.2,
        /// Density from which on voxels are skipped, in thresholds; with 5, as in the paper, liquid at rest is skipped, too, and normals near the surface are a little different.
        saturation: f64 = 10.0,
        /// Whether what is full for certain is found first, from how many particles are in cells, and skipped. Changes the speed, hardly ever the picture.
        rough: bool = true,
        /// Whether densities shrink towards sides that are filled (the paper's particle masks): fewer voxels are written, and the surface is a little lower.
        mask: bool = false,
        /// Radius of a drop, a particle by itself, in radii of its particle: 1.24 has the volume of a cube of two radii.
        drop: f64 = 1.24,
        /// Boundaries that light meets at the most.
        depth: u32 = 4,
        /// Index of refraction, over that of what is around.
        ior: f64 = 1.33,
        /// What the liquid takes of red, green and blue per world unit; none: that of clear water as deep as what is visible is wide.
        absorption: Option<DVec3> = None => "[1.0, 0.4, 0.3]",
        /// What is around: sky (a bright day over a tiled floor), none (the background), or the path of an image of all directions (.hdr, .exr, .png).
        environment: String = "sky".into(),
    }
}

pub(crate) fn check(density: &Density) -> Result<()> {
    let d = density;
    let fits = d.resolution.is_none_or(|n| (4..=1024).contains(&n));
    need("density.resolution", d.resolution, fits, "4 to 1024 voxels")?;
    let fits = (1.0..=32.0).contains(&d.support);
    need("density.support", d.support, fits, "a number in 1 to 32")?;
    let fits = (1e-3..=10.0).contains(&d.threshold);
    need("density.threshold", d.threshold, fits, "a number in 0.001 to 10")?;
    // What is saturated lies inside, and the surface between it and what does not.
    let fits = (1.5..=1e6).contains(&d.saturation);
    need("density.saturation", d.saturation, fits, "a number in 1.5 to 1e6")?;
    need("density.drop", d.drop, positive(d.drop) && d.drop <= 16.0, "above 0, at most 16")?;
    need("density.depth", d.depth, (1..=64).contains(&d.depth), "1 to 64 boundaries")?;
    need("density.ior", d.ior, (0.1..=10.0).contains(&d.ior), "a number in 0.1 to 10")?;
    let fits = d.absorption.is_none_or(|a| a.is_finite() && a.cmpge(DVec3::ZERO).all());
    need("density.absorption", d.absorption, fits, "three numbers, 0 or more")?;
    need("density.environment", &d.environment, !d.environment.is_empty(), "sky, none or a file")
}
