//! A system of particles seen as a liquid: from the scene's parameters to the surface renderer's, and from its
//! picture to a frame.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Instant;

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_frame::{Frame, Layer};
use motes_grid::{Clip, Visibility};
use motes_scene::surface::{self, Culling, Filtering};
use motes_scene::{Beyond, Bounds, CameraView, Environment, Lights, Resolved, Scene};
use motes_spheres::Cap;
use motes_surface::{
    Around, Bits, Boundary, Cull, Filter, Input, Marks, Medium, Mode, Occlusion, Optics, Paint,
    Params, Particles, Representation, Shadow, Smoothing, Spans, Spray, Surfaces, View, compress,
    connect, filter, normals, shade_finer, splat, voxelize,
};

use crate::caps::Caps;
use crate::cut::Visible;
use crate::environment::{FLOOR_FILL, WATER, environment};
use crate::memo::{Memo, Same};
use crate::nearest::Nearest;
use crate::paint;
use crate::scenery::{Others, Scenery};
use crate::session::milliseconds;
use crate::stats::Stats;
use crate::system::Loaded;
use crate::{Error, Result, Watch};

/// Up to so many particles, balls are fitted to the surface by themselves: of more, each is but a few pixels wide.
const FIT_AUTO: usize = 500_000;
/// The least edge of cells to fit by, in radii of the balls.
const FIT_CELL: f64 = 1.8;
/// Rows of the light's own view.
const SHADOW_ROWS: u32 = 1024;

/// What a liquid is made of.
#[derive(Clone, Copy)]
pub(crate) struct Matter<'a> {
    pub particles: Particles<'a>,
    /// What they are of; none where they are not of a system's grids.
    pub identity: Option<&'a Arc<Visible>>,
    /// How many of them are visible.
    pub visible: usize,
    pub mean_radius: f64,
    pub greatest_radius: f64,
    pub paint: &'a paint::Paint,
    /// The system's place in the scene.
    pub system: u16,
}

impl<'a> Matter<'a> {
    /// The particles of a system, in its grids.
    pub fn of(system: &'a Loaded) -> Self {
        let grids = &system.classes.grids;
        let (sum, count) = grids.iter().fold((0.0, 0), |(sum, count), grid| {
            let mean = f64::from(grid.least_radius + grid.greatest_radius) / 2.0;
            (sum + mean * grid.len() as f64, count + grid.len())
        });
        let greatest = grids.iter().map(|g| g.greatest_radius).fold(0.0, f32::max);
        Self {
            particles: Particles::Grids(grids, system.visible()),
            identity: Some(&system.visible),
            visible: system.count_visible(),
            mean_radius: sum / count.max(1) as f64,
            greatest_radius: f64::from(greatest),
            paint: &system.paint,
            system: system.number,
        }
    }
}

impl<'a> Matter<'a> {
    /// The same of fewer particles of its system.
    pub fn only(self, system: &'a Loaded, visible: &'a Arc<Visible>) -> Self {
        let particles = Particles::Grids(&system.classes.grids, visible.all());
        let identity = Some(visible);
        let visible = visible.all().iter().map(Visibility::visible).sum();
        Self { particles, identity, visible, ..self }
    }
}

/// What is around a liquid, and what it casts on it.
pub(crate) struct Setting {
    environment: Environment,
    lights: Lights,
    shadow: Option<Shadow>,
}

/// Boundaries of liquids from one picture to the next, by what is visible and how spans are made.
pub(crate) type Boundaries = Memo<(Same<Visible>, Params, f64), Boundary>;

/// What a liquid is drawn from.
#[derive(Clone, Copy)]
pub(crate) struct Liquid<'a> {
    pub scene: &'a Scene,
    pub matter: Matter<'a>,
    /// The liquids that it is of, if several, with their places among all types.
    pub media: &'a [(usize, Matter<'a>)],
    pub resolved: &'a Resolved,
    /// All that is visible, in world coordinates.
    pub bounds: Option<Bounds>,
    /// The point that positions are about.
    pub origin: DVec3,
    pub level: Level,
    /// What stands before it and in it.
    pub others: Option<Others<'a>>,
    /// Where it is cut open.
    pub opened: Option<Opened<'a>>,
    pub boundaries: Option<&'a Boundaries>,
}

/// Cuts of a liquid, and where its particles are.
#[derive(Clone, Copy)]
pub(crate) struct Opened<'a> {
    clip: &'a Clip,
    nearest: &'a Nearest<'a>,
    caps: &'a Caps,
}

impl<'a> Opened<'a> {
    /// The cuts of a liquid, if there are any.
    pub fn of(system: &'a Loaded, nearest: &'a Option<Nearest<'a>>) -> Option<Self> {
        let cuts = system.clip().zip(nearest.as_ref());
        cuts.map(|(clip, nearest)| Self { clip, nearest, caps: &system.caps })
    }
}

impl Liquid<'_> {
    /// The picture, with `layers` or without.
    ///
    /// # Errors
    /// The environment cannot be read.
    pub fn draw(&self, layers: bool, (stats, watch): (&mut Stats, &dyn Watch)) -> Result<Frame> {
        let image = &self.scene.image;
        let size = (image.width, image.height);
        let finer = self.finer();
        let Some(bounds) = self.bounds.filter(|_| self.matter.visible > 0) else {
            return self.nothing(layers);
        };
        let go_on = |done: u64| match watch.progress("surface", done, 4) {
            true => Ok(()),
            false => Err(Error::Cancelled),
        };
        go_on(0)?;
        let params = self.params(layers || self.painted() || self.opened.is_some());
        let boundary = self.boundary(&params, stats);
        go_on(1)?;
        let optics = self.optics(bounds);
        let setting = self.setting(bounds, (&boundary, &optics), stats)?;
        let view = self.view(bounds, finer);
        let mut media = Vec::new();
        for (kind, matter) in self.media {
            let ior = self.scene.surface.iors.get(*kind).map_or(self.ior(), |ior| *ior as f32);
            let boundary = Liquid { matter: *matter, ..*self }.boundary(&params, stats);
            media.push((self.surfaces((&boundary, &params), view, stats), ior));
        }
        if media.is_empty() {
            media.push((self.surfaces((&boundary, &params), view, stats), self.ior()));
        }
        go_on(2)?;
        let color = self.shade(&media, (&optics, &setting), stats);
        let frame = Frame::new(size.0 as usize, size.1 as usize, color)?;
        if !layers {
            return Ok(frame);
        }
        go_on(3)?;
        // Of the whole liquid, along a pixel's own ray, which is through its centre.
        let centers = match (&mut media[..], finer) {
            ([_], 1) => media.remove(0).0,
            _ => self.surfaces((&boundary, &params), self.view(bounds, 1), &mut Stats::default()),
        };
        with_layers(frame, &centers, self.matter.system)
    }

    /// Index of refraction.
    pub fn ior(&self) -> f32 {
        self.scene.surface.ior as f32
    }

    /// Samples along a pixel's edge.
    pub fn finer(&self) -> u32 {
        (f64::from(self.scene.image.samples).sqrt().floor() as u32).max(1)
    }

    /// What has to be drawn, whatever the view.
    pub fn boundary(&self, params: &Params, stats: &mut Stats) -> Arc<Boundary> {
        let start = Instant::now();
        let ball = self.scene.surface.ball;
        let input = Input { particles: self.matter.particles, radius_scale: ball as f32 };
        let extract = || Ok(Boundary::extract(&input, params, self.level));
        let boundary: std::result::Result<_, Infallible> =
            match (self.boundaries, self.matter.identity) {
                (Some(kept), Some(of)) => kept.get((Same(of.clone()), *params, ball), extract),
                _ => extract().map(Arc::new),
            };
        let Ok(boundary) = boundary;
        stats.ms.insert("boundary", milliseconds(start));
        let counts = boundary.counts;
        stats.particles.insert("splatted", counts.kept);
        stats.bytes.extend([("boundary", counts.bytes), ("cells", counts.cell_bytes)]);
        boundary
    }

    /// What is around it.
    ///
    /// # Errors
    /// The environment cannot be read.
    pub fn setting(
        &self,
        bounds: Bounds,
        (boundary, optics): (&Boundary, &Optics),
        stats: &mut Stats,
    ) -> Result<Setting> {
        let name = &self.scene.surface.environment;
        let environment = environment(name, (self.scene, self.resolved), (bounds, self.origin))?;
        let lights = self.resolved.lights.about(self.origin);
        let start = Instant::now();
        let shadow = (lights.key.shadow_rays > 0).then(|| self.shadow(boundary, bounds, optics));
        stats.ms.insert("shadow", milliseconds(start));
        Ok(Setting { environment, lights, shadow })
    }

    /// The picture of the surfaces of each liquid, with their indices of refraction; [`Self::finer`]² make a pixel.
    pub fn shade(
        &self,
        media: &[(Surfaces, f32)],
        (optics, setting): (&Optics, &Setting),
        stats: &mut Stats,
    ) -> Vec<[f32; 4]> {
        let Setting { environment, lights, shadow } = setting;
        let start = Instant::now();
        let occlusion = (lights.occlusion_rays > 0 && optics.mode != Mode::Refractive)
            .then(|| Occlusion::new(4 * lights.occlusion_rays, self.occlusion_radius(lights)));
        let scenery = self.others.map(|o| Scenery::new(environment, o, (lights, self.level)));
        let around = Around {
            level: self.level,
            lights,
            beyond: scenery.as_ref().map_or(environment as &dyn Beyond, |s| s),
            shown: self.scene.surface.environment != "none" && !self.scene.image.transparent,
            shadow: shadow.as_ref(),
            occlusion: occlusion.as_ref(),
            paint: (self.painted() || self.opened.is_some()).then_some(self as &dyn Paint),
            color: Vec3::from(self.scene.surface.color.linear()),
        };
        let media = media.iter().map(|(surfaces, ior)| Medium { surfaces, ior: *ior });
        let media: Vec<_> = media.collect();
        let (color, work) = shade_finer(&media, optics, &around, self.finer());
        let stage = match optics.mode {
            Mode::Front => "front",
            Mode::Translucent => "translucent",
            Mode::Refractive => "refractive",
        };
        stats.ms.insert(stage, milliseconds(start));
        if optics.mode == Mode::Refractive {
            stats.counts.extend([("rays", work.rays), ("columns", work.columns)]);
        }
        color
    }

    /// Without particles: the surroundings alone.
    fn nothing(&self, layers: bool) -> Result<Frame> {
        let image = &self.scene.image;
        let view = View {
            rays: self.resolved.view.rays(self.origin),
            size: (image.width, image.height),
            near: 1.0,
            far: 2.0,
        };
        let spans =
            Spans { size: view.size, starts: vec![0; view.pixels() + 1], ..Spans::default() };
        let surfaces = Surfaces::new(spans, view, Smoothing::NONE, self.level);
        let (width, height) = (image.width as usize, image.height as usize);
        let frame = Frame::new(width, height, vec![[0.0; 4]; width * height])?;
        if layers { with_layers(frame, &surfaces, self.matter.system) } else { Ok(frame) }
    }

    /// Whether particles have colours of their own.
    pub fn painted(&self) -> bool {
        self.matter.paint.uniform().is_none()
    }

    /// The mean radius of the particles.
    fn radius(&self) -> f64 {
        self.matter.mean_radius
    }

    /// How spans are made; with `ids`, surfaces know their particles.
    pub fn params(&self, ids: bool) -> Params {
        let s = &self.scene.surface;
        let fit = match s.fit {
            surface::Fit::Auto => self.matter.visible <= FIT_AUTO,
            surface::Fit::On => true,
            surface::Fit::Off => false,
        };
        Params {
            gap: s.gap.unwrap_or(5.0 * self.radius()) as f32,
            spans: s.spans,
            cull: match s.cull {
                Culling::Occupancy => Cull::Occupancy,
                Culling::Count => Cull::Count(s.cull_count),
                Culling::Off => Cull::Off,
            },
            // What is fitted to the surface looks at all neighbours within a cell.
            cell: s.cull_cell.max(if fit { FIT_CELL } else { 0.0 }) as f32,
            fit,
            spray: match s.spray {
                surface::Spray::Keep if s.drop == s.ball => Spray::Liquid,
                surface::Spray::Keep => Spray::Drops((s.drop / s.ball) as f32),
                surface::Spray::Drop => Spray::Dropped,
            },
            representation: match s.representation {
                surface::Representation::Intervals => Representation::Intervals,
                surface::Representation::Bits => Representation::Bits(Bits {
                    angle: s.angle as f32,
                    layers: s.layers,
                    marks: Marks::Surface,
                }),
            },
            tile: s.tile,
            ids,
        }
    }

    /// What the liquid does to light.
    pub fn optics(&self, bounds: Bounds) -> Optics {
        let s = &self.scene.surface;
        let absorption = s.absorption.unwrap_or(WATER / bounds.diagonal()).as_vec3();
        Optics {
            mode: match s.mode {
                surface::Mode::Front => Mode::Front,
                surface::Mode::Translucent => Mode::Translucent,
                surface::Mode::Refractive => Mode::Refractive,
            },
            absorption,
            scattering: Vec3::splat(s.scattering.map_or(absorption.x, |v| v as f32)),
            depth: s.depth,
            skip: s.skip,
        }
    }

    fn occlusion_radius(&self, lights: &Lights) -> f32 {
        // Crevices are a few particles wide; the spheres' default would reach over whole waves.
        lights.occlusion_radius.min(12.0 * self.radius() as f32)
    }

    /// The camera's view, `finer` times as many pixels along each side, from what is nearest to what is
    /// farthest.
    pub fn view(&self, bounds: Bounds, finer: u32) -> View {
        let camera = &self.resolved.view;
        let size = (camera.width * finer, camera.height * finer);
        let whole = CameraView { width: size.0, height: size.1, ..*camera };
        fitted(&whole, size, (bounds, self.ball()), self.origin)
    }

    /// Radius of the greatest ball.
    fn ball(&self) -> f64 {
        self.scene.surface.ball * self.matter.greatest_radius
    }

    /// The surfaces that a view shows: as [`voxelize`] and [`Surfaces::new`] make them, stage by stage.
    pub fn surfaces(
        &self,
        (boundary, params): (&Boundary, &Params),
        view: View,
        stats: &mut Stats,
    ) -> Surfaces {
        let mut timed = Laps::new(&mut stats.ms);
        let splatted = splat(boundary, &view, params, self.level);
        timed.lap("splat");
        let (spans, made) = compress(&splatted);
        drop(splatted);
        timed.lap("compress");
        let links = connect::connect(&spans, self.level);
        timed.lap("connect");
        let mut nearness = filter::nearness(&spans, view.rays.projection);
        self.smoothing().apply(&mut nearness, (&spans, &links), (&view, self.level));
        timed.lap("filter");
        let normals = normals::normals(&nearness, (&spans, &links), &view, self.level);
        timed.lap("normals");
        let bytes = [
            ("items", made.item_bytes),
            ("tiles", made.tile_bytes),
            ("spans", made.span_bytes),
            ("links", size_of_val(&links[..])),
        ];
        stats.bytes.extend(bytes);
        let counts = [("tiles", made.tiles), ("items", made.items), ("spans", spans.len())];
        stats.counts.extend(counts.map(|(name, count)| (name, count as u64)));
        if made.layers > 0 {
            stats.counts.insert("layers", made.layers as u64);
            stats.counts.insert("layers_coarsened", u64::from(made.coarsened));
        }
        let mut surfaces = Surfaces::of_spans(spans, view, (nearness, normals));
        if let Some(Opened { clip, nearest, .. }) = self.opened {
            let particle = |point| nearest.particle(point).unwrap_or(Spans::NO_PARTICLE);
            surfaces = surfaces.cut(clip, &particle);
            timed.lap("cut");
        }
        stats.bytes.insert("surfaces", surfaces.bytes());
        surfaces
    }

    fn smoothing(&self) -> Smoothing {
        let s = &self.scene.surface;
        let radius = s.smoothing.unwrap_or(2.0 * self.radius()) as f32;
        let filter = match s.filter {
            Filtering::Recursive => Filter::Recursive,
            Filtering::Iterated => Filter::Iterated(s.iterations),
            Filtering::Curvature => Filter::Curvature(s.iterations),
        };
        Smoothing { radius, drop: (2.0 * s.ball * self.radius()) as f32, filter }
    }

    /// The liquid as the key light sees it.
    fn shadow(&self, boundary: &Boundary, bounds: Bounds, optics: &Optics) -> Shadow {
        let mut camera = self.scene.camera.clone();
        let key = &self.resolved.lights.key;
        camera.projection = motes_scene::Projection::Orthographic;
        (camera.position, camera.target, camera.height) = (None, None, None);
        camera.direction = Some(-key.direction.as_dvec3());
        camera.margin = 0.02;
        let size = (SHADOW_ROWS, SHADOW_ROWS);
        let boxes = [bounds];
        let framing = motes_scene::Framing::new(&boxes, 0.0);
        let light = CameraView::new(&camera, framing, size);
        let view = fitted(&light, size, (bounds, self.ball()), self.origin);
        let params = Params { ids: false, ..self.params(false) };
        let (mut spans, _) = voxelize(boundary, &view, &params, self.level);
        if let Some(Opened { clip, .. }) = self.opened {
            spans = spans.cut(clip, &view);
        }
        let mean = optics.absorption.element_sum() / 3.0;
        // What is opaque lets nothing through that is thicker than a ball.
        let extinction = match optics.mode {
            Mode::Front => 4.0 / self.ball() as f32,
            Mode::Translucent => mean + optics.scattering.element_sum() / 3.0,
            Mode::Refractive => mean,
        };
        Shadow { view, spans, extinction, offset: 2.0 * self.ball() as f32, fill: FLOOR_FILL }
    }
}

/// Tells how long each of several stages takes, one after the other.
struct Laps<'a> {
    ms: &'a mut BTreeMap<&'static str, f64>,
    start: Instant,
}

impl<'a> Laps<'a> {
    fn new(ms: &'a mut BTreeMap<&'static str, f64>) -> Self {
        Self { ms, start: Instant::now() }
    }

    /// Ends a stage; the next one begins.
    fn lap(&mut self, stage: &'static str) {
        self.ms.insert(stage, milliseconds(self.start));
        self.start = Instant::now();
    }
}

impl Paint for Liquid<'_> {
    fn color(&self, particle: u32) -> Option<Vec3> {
        self.painted().then(|| self.matter.paint.color(particle))
    }

    fn cap(&self, owner: u16, point: Vec3, particle: Option<u32>) -> Option<Vec3> {
        let particle = particle?;
        let outside = || match self.painted() {
            true => self.matter.paint.color(particle),
            false => Vec3::from(self.scene.surface.color.linear()),
        };
        self.opened?.caps.color(particle, Cap { owner, point }, outside)
    }
}

/// The view of a camera, from what is nearest of `bounds` with balls of a radius about it to what is
/// farthest.
fn fitted(
    camera: &CameraView,
    size: (u32, u32),
    (bounds, ball): (Bounds, f64),
    origin: DVec3,
) -> View {
    let depths = bounds.corners().map(|c| (c - camera.eye).dot(camera.forward));
    let nearest = depths.iter().copied().fold(f64::INFINITY, f64::min) - ball;
    let farthest = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max) + ball;
    let far = farthest.max(1e-6 * bounds.diagonal());
    let near = nearest.max(1e-4 * far);
    View { rays: camera.rays(origin), size, near: near as f32, far: (far * 1.000_001) as f32 }
}

/// Adds what is known of each pixel besides its colour.
fn with_layers(frame: Frame, surfaces: &Surfaces, system: u16) -> Result<Frame> {
    let view = &surfaces.view;
    let width = view.size.0 as usize;
    let pixels = 0..view.pixels();
    let first =
        |pixel: usize| Some(surfaces.of(pixel).start).filter(|_| !surfaces.of(pixel).is_empty());
    // World units per unit of depth.
    let slant = |pixel: usize| {
        let [x, y] = [pixel % width, pixel / width].map(|i| i as f32 + 0.5);
        1.0 / view.rays.ray(x, y).1.dot(view.rays.forward)
    };
    let depth = |p| first(p).map_or(f32::INFINITY, |s| surfaces.depth(s) * slant(p));
    let id = |p| {
        let of = first(p).and_then(|s| surfaces.particles.get(s));
        of.filter(|id| **id != Spans::NO_PARTICLE).map_or(-1, |id| i64::from(*id))
    };
    let normal = |p| first(p).map_or([0.0; 3], |s| surfaces.normal(s).to_array());
    let frame = frame
        .with(Layer::Depth(pixels.clone().map(depth).collect()))?
        .with(Layer::Normal(pixels.clone().map(normal).collect()))?
        .with(Layer::Id(pixels.clone().map(id).collect()))?
        .with(Layer::System(pixels.clone().map(|_| system).collect()))?
        .with(Layer::SpanCount(pixels.clone().map(|p| surfaces.count(p)).collect()))?
        .with(Layer::Thickness(pixels.map(|p| surfaces.thickness(p) * slant(p)).collect()))?;
    Ok(frame)
}
