//! The parameters of the surface renderer (Zirr & Dachsbacher 2015), under `surface.`.

use glam::DVec3;

use crate::color::Color;
use crate::error::Result;
use crate::resolve::{need, not_negative, positive};
use crate::settings::{settings, words};

settings! {
    /// The surface renderer: particles as a liquid.
    pub struct Surface {
        /// front (its first surface, opaque), translucent (light goes straight through) or refractive (light is bent and mirrored).
        mode: Mode = Mode::Refractive,
        /// Radius of the balls that the liquid is made of, in radii of its particles.
        ball: f64 = 2.0,
        /// Whether balls at the surface are fitted to it, so that outlines are smooth: on, off or auto (on up to 500,000 particles).
        fit: Fit = Fit::Auto,
        /// The longest empty stretch of a ray that is no gap, in world units; none: 5 radii.
        gap: Option<f64> = None => "0.1",
        /// How far the surface is smoothed, as a standard deviation in world units; 0: not at all; none: 2 radii.
        smoothing: Option<f64> = None => "0.1",
        /// How it is smoothed: recursive (one cost for every radius), iterated (the paper's 3 × 3 kernel) or curvature (curvature flow).
        filter: Filtering = Filtering::Recursive,
        /// Most repetitions of iterated and curvature.
        iterations: u32 = 20,
        /// Stretches of liquid that a pixel stores (the paper's k); of what lies behind, only the length is kept.
        spans: u32 = 7,
        /// Which particles deep inside are left out: occupancy (cells that all hold particles), count (cells with at least cull_count) or off.
        cull: Culling = Culling::Occupancy,
        /// Edge of the cells that tell what is inside and what is spray, in radii of the balls.
        cull_cell: f64 = 1.5,
        /// Particles that make a cell full, for cull = count.
        cull_count: u32 = 4,
        /// Spray, particles that are nearly alone: keep (as drops) or drop (left out).
        spray: Spray = Spray::Keep,
        /// Radius of a drop of spray, in radii of its particle: 1.24 has the volume of a cube of two radii.
        drop: f64 = 1.24,
        /// How columns are held while they are made: intervals (exact) or bits (the paper's grid of layers).
        representation: Representation = Representation::Intervals,
        /// Most layers of the bit grid.
        layers: u32 = 16384,
        /// The least angle between surfaces that differ by a layer from pixel to pixel, degrees: more layers where it is smaller.
        angle: f64 = 14.0,
        /// Edge of a tile of the picture, pixels: a multiple of 4. Changes the speed, never the picture.
        tile: u32 = 64,
        /// Index of refraction, over that of what is around.
        ior: f64 = 1.33,
        /// What is one liquid: one (all particles) or types (the particles of each type, with boundaries between them).
        media: Media = Media::One,
        /// Indices of refraction of the types, in the order of the legend, for media = types; of those without, ior.
        iors: Vec<f64> = Vec::new(),
        /// What the liquid takes of red, green and blue per world unit; none: that of clear water as deep as what is visible is wide.
        absorption: Option<DVec3> = None => "[1.0, 0.4, 0.3]",
        /// What it scatters per world unit, in translucent mode; none: as much as it absorbs of red.
        scattering: Option<f64> = None => "1.0",
        /// Colour of the liquid where it is opaque or scatters, unless particles have colours.
        color: Color = Color::hex(0x3f86b8),
        /// Boundaries that light goes on from after the first, in refractive mode.
        depth: u32 = 2,
        /// Whether rays skip what blocks of columns have in common. Changes the speed, never the picture.
        skip: bool = true,
        /// What is around: sky (a bright day over a tiled floor), none (the background), or the path of an image of all directions (.hdr, .exr, .png).
        environment: String = "sky".into(),
    }
}

words! {
    /// How a liquid is shown.
    pub enum Mode {
        /// Its first surface, opaque.
        Front = "front",
        /// Light goes straight through.
        Translucent = "translucent",
        /// Light is bent and mirrored.
        Refractive = "refractive",
    }
}

words! {
    /// Whether balls are fitted to the surface.
    pub enum Fit {
        /// Where they are few, and so large in the picture.
        Auto = "auto",
        /// They are.
        On = "on",
        /// They are not.
        Off = "off",
    }
}

words! {
    /// What is one liquid.
    pub enum Media {
        /// All particles.
        One = "one",
        /// The particles of a type.
        Types = "types",
    }
}

words! {
    /// How a surface is smoothed.
    pub enum Filtering {
        /// By recursion.
        Recursive = "recursive",
        /// By the paper's kernel.
        Iterated = "iterated",
        /// By curvature flow.
        Curvature = "curvature",
    }
}

words! {
    /// Which particles are left out.
    pub enum Culling {
        /// Those in cells among cells that hold particles.
        Occupancy = "occupancy",
        /// Those in cells among cells that hold many.
        Count = "count",
        /// None.
        Off = "off",
    }
}

words! {
    /// What becomes of particles that are alone.
    pub enum Spray {
        /// They are drops.
        Keep = "keep",
        /// They are left out.
        Drop = "drop",
    }
}

words! {
    /// How columns are held while they are made.
    pub enum Representation {
        /// As stretches.
        Intervals = "intervals",
        /// As bits.
        Bits = "bits",
    }
}

pub(crate) fn check(surface: &Surface) -> Result<()> {
    let s = surface;
    need("surface.ball", s.ball, positive(s.ball), "a number above 0")?;
    need("surface.drop", s.drop, positive(s.drop), "a number above 0")?;
    let or_more = |v: Option<f64>| v.is_none_or(not_negative);
    need("surface.gap", s.gap, or_more(s.gap), "a number, 0 or more")?;
    need("surface.smoothing", s.smoothing, or_more(s.smoothing), "a number, 0 or more")?;
    need("surface.scattering", s.scattering, or_more(s.scattering), "a number, 0 or more")?;
    need("surface.iterations", s.iterations, s.iterations <= 1000, "at most 1000")?;
    need("surface.spans", s.spans, (1..=126).contains(&s.spans), "1 to 126")?;
    let fits = (1.0..=100.0).contains(&s.cull_cell);
    need("surface.cull_cell", s.cull_cell, fits, "a number in 1 to 100")?;
    need("surface.cull_count", s.cull_count, (1..=255).contains(&s.cull_count), "1 to 255")?;
    need("surface.layers", s.layers, (1..=1 << 20).contains(&s.layers), "1 to 1048576")?;
    need(
        "surface.angle",
        s.angle,
        s.angle > 0.0 && s.angle < 90.0,
        "degrees above 0 and below 90",
    )?;
    let fits = (4..=1024).contains(&s.tile) && s.tile.is_multiple_of(4);
    need("surface.tile", s.tile, fits, "a multiple of 4 in 4 to 1024")?;
    let optical = |ior: &f64| (0.1..=10.0).contains(ior);
    need("surface.ior", s.ior, optical(&s.ior), "a number in 0.1 to 10")?;
    let all = format!("{:?}", s.iors);
    need("surface.iors", all, s.iors.iter().all(optical), "numbers in 0.1 to 10")?;
    let fits = s.absorption.is_none_or(|a| a.is_finite() && a.cmpge(DVec3::ZERO).all());
    need("surface.absorption", s.absorption, fits, "three numbers, 0 or more")?;
    need("surface.depth", s.depth, s.depth <= 64, "at most 64")?;
    need("surface.environment", &s.environment, !s.environment.is_empty(), "sky, none or a file")
}
