//! From the scene as typed to the scene as meant: nonsense is refused, relative becomes absolute.

use glam::{DVec3, Vec3};

use crate::bounds::Bounds;
use crate::camera::{CameraView, Framing};
use crate::colormap::ColorMap;
use crate::error::{Result, SceneError};
use crate::light::Lights;
use crate::scene::{
    Camera, Film, Image, Light, Overlay, Preset, Projection, Scene, Sph, Spheres, System,
};

/// Most pixels of a picture: 16 384 × 16 384, some 20 GB while it is made.
const MAX_PIXELS: u64 = 1 << 28;

/// A scene that can be drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Resolved {
    /// The camera, standing.
    pub view: CameraView,
    /// The lights, in world coordinates and linear light.
    pub lights: Lights,
    /// The background, in linear light.
    pub background: Background,
    /// Distances from the eye between which what is framed lies, world units, if a cue asks for them.
    pub range: Option<[f64; 2]>,
}

/// The background in linear light; both alike where it is one colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Background {
    /// At the top of the picture.
    pub top: Vec3,
    /// At the bottom.
    pub bottom: Vec3,
}

impl Scene {
    /// Checks every parameter and places camera and lights, framing `bounds`, the box around what is
    /// visible (with radii; `None` if nothing is).
    ///
    /// # Errors
    /// As [`Scene::check`].
    pub fn resolve(&self, bounds: Option<Bounds>) -> Result<Resolved> {
        self.resolve_framing(Framing::new(bounds.as_slice(), 0.0))
    }

    /// As [`Scene::resolve`], framing boxes around parts of what is visible (with radii).
    ///
    /// # Errors
    /// As [`Scene::check`].
    pub fn resolve_framing(&self, framing: Framing<'_>) -> Result<Resolved> {
        self.check()?;
        let view = CameraView::new(&self.camera, framing, (self.image.width, self.image.height));
        let diagonal = framing.whole.map_or(1.0, |b| b.diagonal());
        // Sprites are not lit.
        let light = if self.cue.has("sprite") { &Light::of(Preset::Flat) } else { &self.light };
        let lights = Lights::new(light, &self.camera, &view, diagonal);
        let bottom = self.image.background_bottom.unwrap_or(self.image.background);
        let background = Background {
            top: Vec3::from(self.image.background.linear()),
            bottom: Vec3::from(bottom.linear()),
        };
        let range = || {
            framing.boxes.iter().fold([f64::INFINITY, 0.0], |[near, far], b| {
                let [a, z] = view.distances(b);
                [a.min(near), z.max(far)]
            })
        };
        let range = (self.cue.has("depth") && self.cue.depth_range.is_none()).then(range);
        Ok(Resolved { view, lights, background, range })
    }

    /// Refuses parameters that make no sense.
    ///
    /// # Errors
    /// The parameter's path, what it can be and what it is.
    pub fn check(&self) -> Result<()> {
        self.system.iter().enumerate().try_for_each(|(i, s)| check_system(s, i))?;
        check_camera(&self.camera)?;
        check_image(&self.image)?;
        check_light(&self.light)?;
        check_film(&self.film)?;
        check_spheres(&self.spheres)?;
        crate::surface::check(&self.surface)?;
        crate::density::check(&self.density)?;
        crate::cue::check(&self.cue)?;
        self.sph.check()?;
        crate::section::check(self)?;
        check_overlay(&self.overlay)
    }
}

/// `value` at `path` must be what `fits` says, in words `expected`.
pub(crate) fn need<T: std::fmt::Debug>(
    path: &str,
    value: T,
    fits: bool,
    expected: &str,
) -> Result<()> {
    if fits {
        return Ok(());
    }
    let found = format!("{value:?}");
    let inner = found.strip_prefix("Some(").and_then(|found| found.strip_suffix(')'));
    Err(SceneError::value(path, expected, inner.unwrap_or(&found).to_owned()))
}

pub(crate) fn need_vector(path: &str, v: Option<DVec3>) -> Result<()> {
    let fits = v.is_none_or(|v| v.is_finite() && v.normalize_or_zero() != DVec3::ZERO);
    need(path, v.map(|v| v.to_array()), fits, "a finite vector with a length")
}

/// Above zero and finite, in single precision too.
pub(crate) fn positive(v: f64) -> bool {
    v as f32 > 0.0 && (v as f32).is_finite()
}

pub(crate) fn not_negative(v: f64) -> bool {
    v >= 0.0 && v.is_finite()
}

fn check_system(system: &System, index: usize) -> Result<()> {
    let at = |name: &str| format!("system.{index}.{name}");
    let (scale, radius) = (system.radius_scale, system.radius);
    need(&at("radius_scale"), scale, positive(scale), "a number above 0")?;
    need(&at("radius"), radius, radius.is_none_or(positive), "a number above 0")?;
    let opacity = system.opacity;
    need(&at("opacity"), opacity, (0.0..=1.0).contains(&opacity), "a number in 0 to 1")?;
    for (name, r) in &system.radii {
        need(&at(&format!("radii.{name}")), r, positive(*r), "a number above 0")?;
    }
    for (i, f) in system.filter.iter().enumerate() {
        let at = |name: &str| at(&format!("filter.{i}.{name}"));
        need(&at("property"), &f.property, !f.property.is_empty(), "the name of a property")?;
        let numbers = ![f.min, f.max].iter().flatten().any(|v| v.is_nan());
        need(&at("min"), (f.min, f.max), numbers, "numbers for min and max")?;
    }
    ColorMap::by_name(&system.color.map)?;
    if let Some([a, b]) = system.color.range {
        let fits = a.is_finite() && b.is_finite();
        need(&at("color.range"), [a, b], fits, "two finite numbers")?;
        let fits = !system.color.log || (a > 0.0 && b > 0.0);
        need(&at("color.range"), [a, b], fits, "two numbers above 0, as color.log is true")?;
    }
    Ok(())
}

fn check_camera(camera: &Camera) -> Result<()> {
    let (fov, height, margin) = (camera.fov, camera.height, camera.margin);
    need("camera.fov", fov, fov > 0.0 && fov < 180.0, "degrees above 0 and below 180")?;
    need("camera.height", height, height.is_none_or(positive), "a number above 0")?;
    let (aperture, focus) = (camera.aperture, camera.focus);
    let fits = aperture == 0.0 || positive(aperture);
    need("camera.aperture", aperture, fits, "a number, 0 or more")?;
    let fits = aperture == 0.0 || camera.projection == Projection::Perspective;
    need("camera.aperture", aperture, fits, "0, as camera.projection is orthographic")?;
    need("camera.focus", focus, focus.is_none_or(positive), "a number above 0")?;
    need("camera.margin", margin, (0.0..=0.9).contains(&margin), "a number in 0 to 0.9")?;
    for (path, v) in [("camera.position", camera.position), ("camera.target", camera.target)] {
        let fits = v.is_none_or(|v| v.is_finite());
        need(path, v.map(|v| v.to_array()), fits, "finite coordinates")?;
    }
    need_vector("camera.direction", camera.direction)?;
    need_vector("camera.up", camera.up)?;
    if let (Some(position), Some(target)) = (camera.position, camera.target) {
        let apart = (target - position).normalize_or_zero() != DVec3::ZERO;
        need("camera.position", position.to_array(), apart, "a point apart from camera.target")?;
    }
    need("camera.turn", camera.turn, camera.turn.is_finite(), "degrees")?;
    check_keyframes(camera)
}

fn check_keyframes(camera: &Camera) -> Result<()> {
    let mut before = None;
    for (i, key) in camera.keyframe.iter().enumerate() {
        let path = |name: &str| format!("camera.keyframe.{i}.{name}");
        let fits = (0.0..=1.0).contains(&key.at) && before.is_none_or(|t| t < key.at);
        need(&path("at"), key.at, fits, "a number in 0 to 1, greater than the one before")?;
        before = Some(key.at);
        for (name, v) in [("position", key.position), ("target", key.target)] {
            let fits = v.is_none_or(|v| v.is_finite());
            need(&path(name), v.map(|v| v.to_array()), fits, "finite coordinates")?;
        }
        need_vector(&path("up"), key.up)?;
        let fits = key.fov.is_none_or(|fov| fov > 0.0 && fov < 180.0);
        need(&path("fov"), key.fov, fits, "degrees above 0 and below 180")?;
        let fits = key.height.is_none_or(positive);
        need(&path("height"), key.height, fits, "a number above 0")?;
        let ends = key.position.or(camera.position).zip(key.target.or(camera.target));
        let apart = ends.is_none_or(|(p, t)| (t - p).normalize_or_zero() != DVec3::ZERO);
        let found = ends.map(|(position, _)| position.to_array());
        need(&path("position"), found, apart, "a point apart from the target")?;
    }
    Ok(())
}

fn check_film(film: &Film) -> Result<()> {
    let (frames, fps, quality) = (film.frames, film.fps, film.quality);
    let fits = frames.is_none_or(|n| (1..=1_000_000).contains(&n));
    need("film.frames", frames, fits, "1 to 1000000 pictures")?;
    need("film.fps", fps, (0.1..=1000.0).contains(&fps), "0.1 to 1000 pictures per second")?;
    need("film.quality", quality, quality <= 100, "a number in 0 to 100")
}

fn check_image(image: &Image) -> Result<()> {
    for (path, size) in [("image.width", image.width), ("image.height", image.height)] {
        need(path, size, (1..=65_535).contains(&size), "1 to 65535 pixels")?;
    }
    let pixels = u64::from(image.width) * u64::from(image.height);
    need("image.width × height", pixels, pixels <= MAX_PIXELS, "at most 2^28 pixels in all")?;
    let samples = image.samples;
    need("image.samples", samples, (1..=1024).contains(&samples), "1 to 1024 rays per pixel")?;
    let most = image.max_samples;
    need("image.max_samples", most, (1..=1024).contains(&most), "1 to 1024 rays per pixel")?;
    need("image.noise", image.noise, not_negative(image.noise), "a number, 0 or more")?;
    let e = image.exposure;
    need("image.exposure", e, (-30.0..=30.0).contains(&e), "a number in -30 to 30")
}

fn check_light(light: &Light) -> Result<()> {
    need_vector("light.direction", Some(light.direction))?;
    let position = light.position;
    let fits = position.is_none_or(|p| p.is_finite());
    need("light.position", position.map(|p| p.to_array()), fits, "finite coordinates")?;
    let numbers = [
        ("light.size", light.size),
        ("light.intensity", light.intensity),
        ("light.fill", light.fill),
        ("light.ambient", light.ambient),
    ];
    for (path, v) in numbers {
        need(path, v, not_negative(v), "a number, 0 or more")?;
    }
    let rays = [
        ("light.shadow_rays", light.shadow_rays),
        ("light.occlusion_rays", light.occlusion_rays),
        ("light.bounce_rays", light.bounce_rays),
    ];
    for (path, rays) in rays {
        need(path, rays, rays <= 4096, "0 to 4096 rays")?;
    }
    let radius = light.occlusion_radius;
    need("light.occlusion_radius", radius, radius.is_none_or(positive), "a number above 0")?;
    let angle = light.softness;
    need("light.softness", angle, (0.0..=180.0).contains(&angle), "degrees in 0 to 180")
}

fn check_spheres(spheres: &Spheres) -> Result<()> {
    let (packet, lambda, block) = (spheres.packet, spheres.lambda, spheres.block);
    need("spheres.packet", packet, [2, 4, 8, 16].contains(&packet), "2, 4, 8 or 16")?;
    need("spheres.lambda", lambda, (0.001..=20.0).contains(&lambda), "a number in 0.001 to 20")?;
    need("spheres.block", block, (1..=64).contains(&block), "1 to 64 cells")
}

impl Sph {
    /// Refuses parameters that make no sense.
    ///
    /// # Errors
    /// The parameter's path, what it can be and what it is.
    pub fn check(&self) -> Result<()> {
        let (fps, steps, cfl) = (self.fps, self.substeps, self.cfl);
        need("sph.fps", fps, (1e-3..=1e6).contains(&fps), "0.001 to 1e6 frames per second")?;
        need("sph.substeps", steps, (1..=10_000).contains(&steps), "1 to 10000 steps")?;
        need("sph.cfl", cfl, (0.01..=2.0).contains(&cfl), "a number in 0.01 to 2")?;
        let density = self.density;
        need("sph.density", density, (1e-3..=1e6).contains(&density), "0.001 to 1e6 kg/m³")?;
        let numbers = [
            ("sph.viscosity", self.viscosity),
            ("sph.smoothing", self.smoothing),
            ("sph.surface_tension", self.surface_tension),
        ];
        for (path, v) in numbers {
            need(path, v, (0.0..=1e6).contains(&v), "a number in 0 to 1e6")?;
        }
        let gravity = self.gravity;
        let fits = gravity.abs().max_element() <= 1e6 && gravity.is_finite();
        need("sph.gravity", gravity.to_array(), fits, "components of at most 1e6 m/s²")?;
        let sound = self.sound_speed;
        let fits = sound.is_none_or(|c| (1e-3..=1e6).contains(&c));
        need("sph.sound_speed", sound, fits, "0.001 to 1e6 m/s")?;
        let tolerance = self.tolerance;
        let fits = (1e-6..=1.0).contains(&tolerance);
        need("sph.tolerance", tolerance, fits, "a number in 1e-6 to 1")?;
        let most = self.iterations;
        need("sph.iterations", most, (1..=10_000).contains(&most), "1 to 10000 iterations")
    }
}

fn check_overlay(overlay: &Overlay) -> Result<()> {
    let size = overlay.text_size;
    need("overlay.text_size", size, size > 0.0 && size <= 0.5, "a number above 0, at most 0.5")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_scene_resolves() {
        let resolved = Scene::default().resolve(None).unwrap();
        assert!((resolved.lights.key.direction.length() - 1.0).abs() < 1e-6);
        assert!((resolved.lights.key.cos_half_angle - 6f32.to_radians().cos()).abs() < 1e-6);
        assert_eq!(resolved.background.top, resolved.background.bottom);
    }

    #[test]
    fn nonsense_is_refused_with_its_path() {
        for (assignments, path) in [
            (&["camera.fov=0"][..], "camera.fov"),
            (&["camera.fov=180"], "camera.fov"),
            (&["image.width=65535", "image.height=65535"], "image.width × height"),
            (&["camera.fov=nan"], "camera.fov"),
            (&["camera.up=0,0,0"], "camera.up"),
            (&["camera.position=1,2,inf"], "camera.position"),
            (&["camera.position=1,2,3", "camera.target=1,2,3"], "camera.position"),
            (&["camera.height=-1"], "camera.height"),
            (&["camera.margin=1"], "camera.margin"),
            (&["image.samples=0"], "image.samples"),
            (&["image.samples=1025"], "image.samples"),
            (&["image.max_samples=0"], "image.max_samples"),
            (&["image.noise=-1"], "image.noise"),
            (&["camera.aperture=-1"], "camera.aperture"),
            (&["camera.aperture=1", "camera.projection=orthographic"], "camera.aperture"),
            (&["camera.focus=0"], "camera.focus"),
            (&["light.bounce_rays=5000"], "light.bounce_rays"),
            (&["image.width=0"], "image.width"),
            (&["image.height=65536"], "image.height"),
            (&["image.exposure=nan"], "image.exposure"),
            (&["spheres.packet=5"], "spheres.packet"),
            (&["spheres.lambda=0"], "spheres.lambda"),
            (&["spheres.block=0"], "spheres.block"),
            (&["surface.ball=0"], "surface.ball"),
            (&["surface.gap=-1"], "surface.gap"),
            (&["surface.spans=0"], "surface.spans"),
            (&["surface.layers=1000000000"], "surface.layers"),
            (&["surface.angle=90"], "surface.angle"),
            (&["surface.tile=6"], "surface.tile"),
            (&["surface.ior=0"], "surface.ior"),
            (&["surface.absorption=1,-1,0"], "surface.absorption"),
            (&["surface.depth=65"], "surface.depth"),
            (&["density.resolution=3"], "density.resolution"),
            (&["density.support=0.5"], "density.support"),
            (&["density.threshold=0"], "density.threshold"),
            (&["density.saturation=1"], "density.saturation"),
            (&["density.drop=-1"], "density.drop"),
            (&["density.depth=0"], "density.depth"),
            (&["density.ior=inf"], "density.ior"),
            (&["density.absorption=1,nan,0"], "density.absorption"),
            (&["density.environment=''"], "density.environment"),
            (&["sph.fps=0"], "sph.fps"),
            (&["sph.cfl=3"], "sph.cfl"),
            (&["sph.density=-1"], "sph.density"),
            (&["sph.viscosity=nan"], "sph.viscosity"),
            (&["sph.gravity=0,0,inf"], "sph.gravity"),
            (&["sph.sound_speed=0"], "sph.sound_speed"),
            (&["sph.tolerance=0"], "sph.tolerance"),
            (&["sph.iterations=0"], "sph.iterations"),
            (&["sph.substeps=0"], "sph.substeps"),
            (&["light.direction=0,0,0"], "light.direction"),
            (&["light.softness=-1"], "light.softness"),
            (&["light.position=nan,0,0"], "light.position"),
            (&["light.size=-1"], "light.size"),
            (&["camera.turn=inf"], "camera.turn"),
            (&["camera.keyframe=[{at=1.5}]"], "camera.keyframe.0.at"),
            (&["camera.keyframe=[{at=0.5}, {at=0.5}]"], "camera.keyframe.1.at"),
            (&["camera.keyframe=[{fov=180}]"], "camera.keyframe.0.fov"),
            (&["camera.keyframe=[{up=[0,0,0]}]"], "camera.keyframe.0.up"),
            (&["camera.keyframe=[{height=0}]"], "camera.keyframe.0.height"),
            (&["camera.keyframe=[{target=[nan,0,0]}]"], "camera.keyframe.0.target"),
            (
                &["camera.keyframe=[{position=[1,2,3]}]", "camera.target=1,2,3"],
                "camera.keyframe.0.position",
            ),
            (&["film.frames=0"], "film.frames"),
            (&["film.fps=0"], "film.fps"),
            (&["film.quality=101"], "film.quality"),
            (&["system.radius=0"], "system.0.radius"),
            (&["system.opacity=1.5"], "system.0.opacity"),
            (&["system.radius_scale=inf"], "system.0.radius_scale"),
            (&["system.radii.Na=-1"], "system.0.radii.Na"),
            (&["system.color.range=0,1", "system.color.log=true"], "system.0.color.range"),
            (&["system.filter=[{property=''}]"], "system.0.filter.0.property"),
            (&["overlay.text_size=0"], "overlay.text_size"),
        ] {
            let mut scene = Scene::default();
            for a in assignments {
                scene.set_text(a).unwrap();
            }
            let error = scene.resolve(None).unwrap_err();
            let named = matches!(&error, SceneError::Value { path: p, .. } if p == path);
            assert!(named, "{assignments:?}: {error}");
        }
    }

    #[test]
    fn an_unknown_color_map_is_refused() {
        let mut scene = Scene::default();
        scene.set("system.color.map", "mgama").unwrap();
        let error = scene.check().unwrap_err().to_string();
        assert_eq!(error, "no colour map `mgama`; did you mean `magma`?");
    }
}
