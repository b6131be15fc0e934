//! The scene as typed: every parameter of Motes, with its default, unit and line of meaning.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::color::Color;
use crate::cue::Cue;
use crate::density::Density;
use crate::section::Section;
use crate::settings::{Setting, Shape, settings, words};
use crate::surface::Surface;

settings! {
    /// All of it: what is seen, from where, in which light, and how the picture is made.
    pub struct Scene {
        /// The way of seeing: spheres (ray traced), surface (particles as a liquid) or density (a liquid as a field of voxels).
        renderer: Renderer = Renderer::Spheres,
        /// What is seen: one entry per set of particles.
        system: Vec<System> = vec![System::default()],
        /// From where.
        camera: Camera = Camera::default(),
        /// The picture itself.
        image: Image = Image::default(),
        /// Lights: one key light with soft shadows, and a fill from sky and ground.
        light: Light = Light::default(),
        /// Films: how many pictures, how fast, how good.
        film: Film = Film::default(),
        /// The spheres renderer.
        spheres: Spheres = Spheres::default(),
        /// The surface renderer.
        surface: Surface = Surface::default(),
        /// The density renderer.
        density: Density = Density::default(),
        /// The simulation of liquids, for sim: sources.
        sph: Sph = Sph::default(),
        /// Planes that cut what is seen open.
        section: Vec<Section> = Vec::new(),
        /// Cues of depth and structure, drawn into the picture.
        cue: Cue = Cue::default(),
        /// What is drawn over the picture.
        overlay: Overlay = Overlay::default(),
    }
}

settings! {
    /// One set of particles: its source, its size on the screen and its colours.
    pub struct System {
        /// Name, for the legend and for messages; empty: the file's name.
        name: String = String::new(),
        /// A path, a quoted pattern, demo:… or sim:…; empty: the source on the command line.
        source: String = String::new(),
        /// Frames added to the frame that is asked for: this system's own place in time.
        frame_offset: i64 = 0,
        /// Whether it is drawn.
        visible: bool = true,
        /// One radius for all particles, in the file's unit of length; none: the file's, else the element's, else half the nearest distance (of a liquid: half the edge of the cube that each has for itself).
        radius: Option<f64> = None => "0.5",
        /// Factor on every radius, wherever it comes from.
        radius_scale: f64 = 1.0,
        /// Radius per particle type or element, in the file's unit of length; before the file's, after `radius`.
        radii: BTreeMap<String, f64> = BTreeMap::new() => "{ Na = 1.02, 2 = 0.5 }",
        /// Shown particles as an expression over properties; empty: all.
        r#where: String = String::new(),
        /// Shown particles by property: what every filter lets through.
        filter: Vec<Filter> = Vec::new(),
        /// How the particles are coloured.
        color: Coloring = Coloring::default(),
        /// Factor on every opacity, 0 (unseen) to 1: 1 − the file's transparency, times the alpha of its colours where they are shown.
        opacity: f64 = 1.0,
    }
}

settings! {
    /// A filter: lets through particles whose property lies in min to max, both included.
    pub struct Filter {
        /// Name of the property.
        property: String = "Position".into(),
        /// Which component of a vector property.
        component: Component = Component::Magnitude,
        /// Least value let through, in the property's unit; none: no limit.
        min: Option<f64> = None => "0.0",
        /// Greatest value let through, in the property's unit; none: no limit.
        max: Option<f64> = None => "1.0",
    }
}

settings! {
    /// How particles get their colours.
    pub struct Coloring {
        /// auto (the file's colours, else element, else type, else uniform), uniform, element, type, chain, residue, or the name of a property.
        by: ColorBy = ColorBy::Auto,
        /// Which component of a vector property.
        component: Component = Component::Magnitude,
        /// Colour map of a property's values, such as viridis, cividis, magma, turbo, batlow, vik, coolwarm, gray; with _r, backwards.
        map: String = "viridis".into(),
        /// Values at the two ends of the map, in the property's unit; none: the least and greatest.
        range: Option<[f64; 2]> = None => "[0.0, 1.0]",
        /// Over what the least and greatest are taken: frame, or series (the same colours in every frame).
        range_over: RangeOver = RangeOver::Frame,
        /// Runs the map backwards.
        reverse: bool = false,
        /// Maps the logarithm of the value; values of 0 and less take the colour of the lower end.
        log: bool = false,
        /// Colour of particles whose value is missing (NaN).
        missing: Color = Color::hex(0xb0b0b0),
        /// The colour for uniform.
        uniform: Color = Color::hex(0x5b8ec4),
        /// Colours of types and chains: tableau or okabe-ito (fewer, for every eye).
        palette: Palette = Palette::Tableau,
        /// Colour per type, element or chain, before the palette's.
        colors: BTreeMap<String, Color> = BTreeMap::new() => "{ Na = \"#ab5cf2\", 2 = \"orange\" }",
    }
}

settings! {
    /// The camera: a right-handed world, row 0 of the picture at the top.
    pub struct Camera {
        /// perspective or orthographic.
        projection: Projection = Projection::Perspective,
        /// Where the camera stands, in world coordinates; none: where everything visible is framed.
        position: Option<DVec3> = None => "[30.0, -20.0, 15.0]",
        /// The point looked at, in world coordinates; none: what is visible.
        target: Option<DVec3> = None => "[0.0, 0.0, 0.0]",
        /// The direction looked along while position or target is not given; none: (2, 1, -1) turned to the up axis.
        direction: Option<DVec3> = None => "[2.0, 1.0, -1.0]",
        /// What is up in the picture; none: up_axis.
        up: Option<DVec3> = None => "[0.0, 0.0, 1.0]",
        /// The world's upward axis: z, or y as in graphics data, or x.
        up_axis: Axis = Axis::Z,
        /// Vertical field of view of the perspective, degrees.
        fov: f64 = 35.0,
        /// Height of the picture in world units, for orthographic; none: fits what is visible.
        height: Option<f64> = None => "10.0",
        /// Diameter of the lens, in world units: what lies off the focus is blurred; 0: a pinhole. Perspective only.
        aperture: f64 = 0.0,
        /// Distance along the view at which the picture is sharp, in world units; none: the target's.
        focus: Option<f64> = None => "40.0",
        /// Free space around what is framed, as a part of half the picture.
        margin: f64 = 0.05,
        /// Degrees the camera goes around the target in a film, about the up axis, to the right: 360 ends where it began.
        turn: f64 = 0.0,
        /// Where the camera is at times of a film; between them it moves smoothly.
        keyframe: Vec<Keyframe> = Vec::new(),
    }
}

settings! {
    /// The camera at a time of a film; what is none is as in the camera.
    pub struct Keyframe {
        /// When: 0 is the first picture of the film, 1 the last.
        at: f64 = 0.0,
        /// Where the camera stands, in world coordinates.
        position: Option<DVec3> = None => "[30.0, -20.0, 15.0]",
        /// The point looked at, in world coordinates.
        target: Option<DVec3> = None => "[0.0, 0.0, 0.0]",
        /// What is up in the picture.
        up: Option<DVec3> = None => "[0.0, 0.0, 1.0]",
        /// Vertical field of view of the perspective, degrees.
        fov: Option<f64> = None => "20.0",
        /// Height of the picture in world units, for orthographic.
        height: Option<f64> = None => "10.0",
    }
}

settings! {
    /// A film: several frames, or a camera that moves.
    pub struct Film {
        /// How many pictures; none: one for each frame, or 8 seconds of a single frame that the camera moves about.
        frames: Option<u32> = None => "200",
        /// Pictures per second.
        fps: f64 = 25.0,
        /// 0 (a small file) to 100 (a true one).
        quality: u32 = 75,
    }
}

settings! {
    /// The picture: its size, its samples and how light becomes colour.
    pub struct Image {
        /// Width, pixels.
        width: u32 = 1920,
        /// Height, pixels.
        height: u32 = 1080,
        /// Which frame of the sources is shown, counted from 0.
        frame: u32 = 0,
        /// Rays per pixel, at the least.
        samples: u32 = 4,
        /// Rays per pixel where they differ, which then share the secondary rays of `samples`; no more than samples: none differ.
        max_samples: u32 = 4,
        /// How much the mean of a pixel's rays may still vary, as a standard error of what is shown, white being 1; 0, or with one sample: nothing is asked.
        noise: f64 = 0.02,
        /// Leaves the background out: alpha 0 where nothing is.
        transparent: bool = false,
        /// Background colour; at the top, if background_bottom differs.
        background: Color = Color::hex(0xfafbfc),
        /// Background colour at the bottom; none: one colour throughout.
        background_bottom: Option<Color> = None => "\"#dfe4ea\"",
        /// Exposure: light is multiplied by 2 to this power.
        exposure: f64 = 0.0,
        /// From light to colour: none (cut at white: colours as in the colour map) or filmic (a soft shoulder).
        tone: Tone = Tone::None,
    }
}

settings! {
    /// Light: a key light that casts soft shadows and a fill from sky and ground.
    pub struct Light {
        /// What all of the light is like, as far as nothing else is said: studio, soft, sun, overcast, side, headlight or flat. Setting it sets the whole light.
        preset: Preset = Preset::Studio,
        /// The way to the key light: x right, y up, z towards the viewer if relative to the camera; else world coordinates.
        direction: DVec3 = DVec3::new(-0.5, 0.8, 0.6),
        /// What direction is relative to: camera (it follows) or world.
        relative_to: RelativeTo = RelativeTo::Camera,
        /// Where the key light stands, in world coordinates; none: far away, at direction.
        position: Option<DVec3> = None => "[10.0, 0.0, 20.0]",
        /// Diameter of a key light that has a position, in world units: 0 casts hard shadows.
        size: f64 = 0.0,
        /// Colour of the key light.
        color: Color = Color::hex(0xffffff),
        /// Strength of the key light; 1 lights a white surface that faces it to white, however far it is.
        intensity: f64 = 0.7,
        /// Angle across a key light that is far away, degrees: 0 casts hard shadows, 20 soft ones.
        softness: f64 = 12.0,
        /// Rays to the key light for each sample of a pixel: more make soft shadows smoother; 0: it casts none.
        shadow_rays: u32 = 1,
        /// Colour of the fill from above (the up axis).
        sky: Color = Color::hex(0xffffff),
        /// Colour of the fill from below.
        ground: Color = Color::hex(0xd8d4cf),
        /// Strength of the fill; with the key light's it adds to about 1.
        fill: f64 = 0.45,
        /// Directions in which the fill is looked for, for each sample of a pixel: crevices are darker; 0: everywhere is open.
        occlusion_rays: u32 = 4,
        /// How far something may be to keep fill light away, in world units; none: a sixth of the diagonal of what is visible.
        occlusion_radius: Option<f64> = None => "1.0",
        /// Directions in which light from other surfaces is looked for (one diffuse bounce), for each sample of a pixel; 0: none.
        bounce_rays: u32 = 0,
        /// Whether particles still keep light away where sections have cut them: light as before the cut; the caps are lit.
        uncut: bool = false,
        /// Light from everywhere alike, which no shape shows.
        ambient: f64 = 0.0,
    }
}

settings! {
    /// The spheres renderer.
    pub struct Spheres {
        /// How what the eye sees first is found: project (blocks of the grid, front to back) or trace (packets of rays, the paper's way). Changes the speed, never the picture.
        primary: Primary = Primary::Project,
        /// Side of a packet of rays, pixels: 2, 4, 8 or 16 (the paper's packets). Changes the speed, never the picture.
        packet: u32 = 8,
        /// Grid density: cells for each particle (the paper's λ). Changes the speed, never the picture.
        lambda: f64 = 1.0,
        /// Cells along a block's side (the paper's macrocell M). Changes the speed, never the picture.
        block: u32 = 6,
    }
}

settings! {
    /// The simulation of liquids by smoothed particle hydrodynamics, in SI units.
    pub struct Sph {
        /// dfsph (divergence-free, incompressible: large steps) or wcsph (weakly compressible: small and cheap steps).
        solver: Solver = Solver::Dfsph,
        /// Frames per simulated second.
        fps: f64 = 25.0,
        /// Time steps per frame, at the least.
        substeps: u32 = 1,
        /// How far in a step the fastest particle may go (wcsph: sound as well), in particle spacings.
        cfl: f64 = 0.4,
        /// Density at rest, kg/m³.
        density: f64 = 1000.0,
        /// Kinematic viscosity, m²/s; water has 1e-6.
        viscosity: f64 = 1e-6,
        /// Numerical viscosity, as Monaghan's α with sound_speed (dfsph too): smooths what the particles cannot resolve.
        smoothing: f64 = 0.05,
        /// Gravity, m/s².
        gravity: DVec3 = DVec3::new(0.0, 0.0, -9.81),
        /// Speed of sound of wcsph, m/s; none: ten times that of a free fall through the liquid.
        sound_speed: Option<f64> = None => "44.0",
        /// dfsph: mean compression at which iterations end, as a part of the density.
        tolerance: f64 = 0.001,
        /// dfsph: iterations at the most, for each of its two solvers and time steps.
        iterations: u32 = 50,
        /// Surface tension, N/m; of real use where drops are small: water has 0.072.
        surface_tension: f64 = 0.0,
    }
}

settings! {
    /// What is drawn over the picture. auto: where it says something.
    pub struct Overlay {
        /// Legend of the colours; auto: when colours mean something.
        legend: Show = Show::Auto,
        /// Scale bar; auto: in orthographic pictures.
        scale_bar: Show = Show::Auto,
        /// Time, or frame number; auto: in films and for a frame of a series.
        time: Show = Show::Auto,
        /// Arrows of the axes; auto: off.
        axes: Show = Show::Auto,
        /// Edges of the simulation box; auto: when the file has one.
        r#box: Show = Show::Auto,
        /// Height of the text, as a part of the picture's height.
        text_size: f64 = 0.022,
    }
}

words! {
    /// How the world is put on the picture.
    pub enum Projection {
        /// Farther is smaller.
        Perspective = "perspective",
        /// Farther is as large.
        Orthographic = "orthographic",
    }
}

words! {
    /// The way of seeing.
    pub enum Renderer {
        /// Every particle a ball, ray traced.
        Spheres = "spheres",
        /// Particles as a liquid with a smooth surface.
        Surface = "surface",
        /// Particles as a liquid, by a field of voxels.
        Density = "density",
    }
}

words! {
    /// An axis of the world.
    pub enum Axis {
        /// (1, 0, 0).
        X = "x",
        /// (0, 1, 0).
        Y = "y",
        /// (0, 0, 1).
        Z = "z",
    }
}

words! {
    /// One number from a vector property.
    pub enum Component {
        /// The first.
        X = "x",
        /// The second.
        Y = "y",
        /// The third.
        Z = "z",
        /// The length; of a scalar, the scalar itself.
        Magnitude = "magnitude",
    }
}

words! {
    /// What the automatic range of colours is taken over.
    pub enum RangeOver {
        /// The frame shown.
        Frame = "frame",
        /// Every frame of the series.
        Series = "series",
    }
}

words! {
    /// A set of distinct colours, see [`Palette::color`].
    pub enum Palette {
        /// Tableau 10.
        Tableau = "tableau",
        /// Okabe and Ito's colours.
        OkabeIto = "okabe-ito",
    }
}

words! {
    /// How first hits are found.
    pub enum Primary {
        /// By projection.
        Project = "project",
        /// By tracing packets.
        Trace = "trace",
    }
}

words! {
    /// How a liquid's pressure is found.
    pub enum Solver {
        /// Bender & Koschier 2015.
        Dfsph = "dfsph",
        /// From the density, by an equation of state.
        Wcsph = "wcsph",
    }
}

words! {
    /// From light to colour.
    pub enum Tone {
        /// Cut at white.
        None = "none",
        /// A soft shoulder.
        Filmic = "filmic",
    }
}

words! {
    /// A light that was set up before, see [`Light::of`].
    pub enum Preset {
        /// A large lamp above on the left, and a bright room.
        Studio = "studio",
        /// A very large lamp: shadows without edges.
        Soft = "soft",
        /// A small warm light and a blue sky: sharp shadows.
        Sun = "sun",
        /// Light from the whole sky: shape by crevices only.
        Overcast = "overcast",
        /// A lamp low at the side, and hardly any fill.
        Side = "side",
        /// A lamp at the eye: no shadows to be seen.
        Headlight = "headlight",
        /// No light and no shadow: colours as in the colour map.
        Flat = "flat",
    }
}

words! {
    /// What a direction is relative to.
    pub enum RelativeTo {
        /// x right, y up, z towards the viewer.
        Camera = "camera",
        /// World coordinates.
        World = "world",
    }
}

words! {
    /// Whether something is drawn.
    pub enum Show {
        /// Where it says something.
        Auto = "auto",
        /// Always.
        On = "on",
        /// Never.
        Off = "off",
    }
}

/// What decides a particle's colour.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum ColorBy {
    /// The file's own colours, else element, else type, else uniform.
    Auto,
    /// One colour.
    Uniform,
    /// The element (Jmol's colours).
    Element,
    /// The particle type (the palette).
    Type,
    /// The chain or molecule (the palette).
    Chain,
    /// The residue's name (RasMol's colours of amino acids and nucleotides, else the palette).
    Residue,
    /// The property of this name, through the colour map.
    Property(String),
}

impl From<String> for ColorBy {
    fn from(word: String) -> Self {
        match word.as_str() {
            "auto" => Self::Auto,
            "uniform" => Self::Uniform,
            "element" => Self::Element,
            "type" => Self::Type,
            "chain" => Self::Chain,
            "residue" => Self::Residue,
            _ => Self::Property(word),
        }
    }
}

impl From<ColorBy> for String {
    fn from(by: ColorBy) -> Self {
        match by {
            ColorBy::Auto => "auto".into(),
            ColorBy::Uniform => "uniform".into(),
            ColorBy::Element => "element".into(),
            ColorBy::Type => "type".into(),
            ColorBy::Chain => "chain".into(),
            ColorBy::Residue => "residue".into(),
            ColorBy::Property(name) => name,
        }
    }
}

impl Setting for ColorBy {
    fn shape() -> Shape {
        Shape::Value(
            "auto, uniform, element, type, chain, residue, or the name of a property".into(),
        )
    }
}

impl Scene {
    /// Puts the sources of the command line into the systems, in order; a source beyond the systems
    /// there are gets a copy of the last one, under its own name.
    pub fn set_sources(&mut self, sources: &[String]) {
        for (i, source) in sources.iter().enumerate() {
            if i == self.system.len() {
                let last = self.system.last().cloned().unwrap_or_default();
                self.system.push(System { name: String::new(), ..last });
            }
            self.system[i].source.clone_from(source);
        }
    }
}
