//! Light: the set-ups that have a name, and the lights as kernels see them.
//!
//! Gribble et al. 2007, §4.3, "Soft Shadows": the user has both the size and the position of the light.
//! A lamp is a ball: a point at distance d from the middle of a ball of radius R sees it as a disk of
//! directions with the half angle asin(R/d) about its middle.

use glam::{DVec3, Vec3};

use crate::camera::CameraView;
use crate::color::Color;
use crate::scene::{Camera, Light, Preset, RelativeTo};

/// The lights in world coordinates and linear light: a surface of albedo ρ and normal n that sees them
/// all has the light ρ·(key·max(0, n·d) + fill(n)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lights {
    /// The key light.
    pub key: KeyLight,
    /// The upward axis of the fill, a unit vector.
    pub up: Vec3,
    /// Fill light on a surface that faces up.
    pub sky: Vec3,
    /// Fill light on a surface that faces down.
    pub ground: Vec3,
    /// Light on every surface alike.
    pub ambient: Vec3,
    /// Directions in which the fill is looked for, for each sample; 0 for none.
    pub occlusion_rays: u32,
    /// How far away something keeps the fill from a surface.
    pub occlusion_radius: f32,
    /// Directions in which light from other surfaces is looked for, for each sample; 0 for none.
    pub bounce_rays: u32,
}

/// The key light: a lamp, or round and so far away that it is the same for every point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyLight {
    /// Unit vector towards its middle; of a lamp, from the point looked at.
    pub direction: Vec3,
    /// Its light on a surface that faces it, however far it is.
    pub color: Vec3,
    /// Cosine of half the angle across it, 1 for a point; of a lamp, see [`KeyLight::seen_from`].
    pub cos_half_angle: f32,
    /// Rays towards it for each sample; 0 if it casts no shadows.
    pub shadow_rays: u32,
    /// Where it stands, if it is near.
    pub lamp: Option<Lamp>,
}

/// A ball of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lamp {
    /// Its middle: in the world, or about an origin, see [`Lights::about`].
    pub center: DVec3,
    /// Its radius, world units.
    pub radius: f32,
}

/// The key light as one point sees it: a disk of directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Toward {
    /// Unit vector towards its middle.
    pub direction: Vec3,
    /// Cosine of half the angle across it.
    pub cos_half_angle: f32,
    /// Distance to its middle; +∞ if it is far away.
    pub distance: f32,
    /// Its radius; 0 if it is far away.
    pub radius: f32,
}

/// By default things occlude up to this part of the diagonal of what is visible.
const OCCLUSION_PART: f64 = 6.0;

impl Lights {
    /// Fill light on an unoccluded surface of unit normal `n`: half of each hemisphere's weight at the
    /// horizon.
    pub fn fill(&self, n: Vec3) -> Vec3 {
        self.ground.lerp(self.sky, 0.5 + 0.5 * n.dot(self.up))
    }

    /// The same lights about `origin`, a point of the world near the particles.
    pub fn about(mut self, origin: DVec3) -> Self {
        if let Some(lamp) = &mut self.key.lamp {
            lamp.center -= origin;
        }
        self
    }

    pub(crate) fn new(light: &Light, camera: &Camera, view: &CameraView, diagonal: f64) -> Self {
        let d = light.direction;
        let direction = match (light.position, light.relative_to) {
            (Some(position), _) => (position - view.target).normalize_or(-view.forward),
            (None, RelativeTo::World) => d,
            (None, RelativeTo::Camera) => view.right * d.x + view.up * d.y - view.forward * d.z,
        };
        let lamp = |center| Lamp { center, radius: 0.5 * light.size as f32 };
        Self {
            key: KeyLight {
                direction: direction.normalize().as_vec3(),
                color: Vec3::from(light.color.linear()) * light.intensity as f32,
                cos_half_angle: (light.softness.to_radians() / 2.0).cos() as f32,
                shadow_rays: light.shadow_rays,
                lamp: light.position.map(lamp),
            },
            up: camera.up_axis.vector().as_vec3(),
            sky: Vec3::from(light.sky.linear()) * light.fill as f32,
            ground: Vec3::from(light.ground.linear()) * light.fill as f32,
            ambient: Vec3::splat(light.ambient as f32),
            occlusion_rays: light.occlusion_rays,
            occlusion_radius: light.occlusion_radius.unwrap_or(diagonal / OCCLUSION_PART) as f32,
            bounce_rays: light.bounce_rays,
        }
    }
}

impl KeyLight {
    /// The light as `point` sees it, about the origin of [`Lights::about`].
    #[inline]
    pub fn seen_from(&self, point: Vec3) -> Toward {
        let Some(lamp) = self.lamp else {
            let (direction, cos_half_angle) = (self.direction, self.cos_half_angle);
            return Toward { direction, cos_half_angle, distance: f32::INFINITY, radius: 0.0 };
        };
        let way = lamp.center.as_vec3() - point;
        let distance = way.length();
        // From inside the ball, half of all directions lead to it.
        let sine = if distance > lamp.radius { lamp.radius / distance } else { 1.0 };
        Toward {
            direction: way.normalize_or(self.direction),
            cos_half_angle: (1.0 - sine * sine).sqrt(),
            distance,
            radius: lamp.radius,
        }
    }
}

impl Toward {
    /// How far a ray goes until it is in the light, for the cosine between it and [`Self::direction`]:
    /// what is farther casts no shadow. +∞ if the light is far away.
    #[inline]
    pub fn reach(&self, cosine: f32) -> f32 {
        if self.distance == f32::INFINITY {
            return f32::INFINITY;
        }
        let aside = self.distance * self.distance * (1.0 - cosine * cosine);
        let inside = (self.radius * self.radius - aside).max(0.0).sqrt();
        (self.distance * cosine - inside).max(0.0)
    }
}

impl Light {
    /// The light of a name.
    pub fn of(preset: Preset) -> Self {
        let studio = Self { preset, ..Self::default() };
        match preset {
            Preset::Studio => studio,
            Preset::Soft => Self {
                direction: DVec3::new(-0.4, 0.9, 0.5),
                intensity: 0.6,
                softness: 70.0,
                shadow_rays: 2,
                fill: 0.5,
                ..studio
            },
            Preset::Sun => Self {
                direction: DVec3::new(-0.8, 0.8, 0.5),
                color: Color::hex(0xfff0d0),
                intensity: 1.15,
                softness: 1.0,
                sky: Color::hex(0xbcd4ff),
                ground: Color::hex(0xc8b49a),
                fill: 0.45,
                ..studio
            },
            Preset::Overcast => Self {
                direction: DVec3::Y,
                intensity: 0.0,
                shadow_rays: 0,
                sky: Color::hex(0xffffff),
                ground: Color::hex(0x9a9a9a),
                fill: 1.1,
                occlusion_rays: 8,
                ..studio
            },
            Preset::Side => Self {
                direction: DVec3::new(-1.0, 0.35, 0.25),
                intensity: 1.0,
                softness: 8.0,
                fill: 0.12,
                ..studio
            },
            Preset::Headlight => Self {
                direction: DVec3::Z,
                intensity: 0.8,
                softness: 0.0,
                shadow_rays: 0,
                fill: 0.2,
                ..studio
            },
            Preset::Flat => Self {
                intensity: 0.0,
                shadow_rays: 0,
                fill: 0.0,
                occlusion_rays: 0,
                ambient: 1.0,
                ..studio
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    fn lights(assignments: &[&str]) -> Lights {
        let mut scene = Scene::default();
        for a in ["camera.position=0,-10,0", "camera.target=0,0,0"].iter().chain(assignments) {
            scene.set_text(a).unwrap();
        }
        scene.resolve(None).unwrap().lights
    }

    #[test]
    fn light_follows_the_camera_or_stays() {
        // Towards the viewer: back to where the camera stands.
        let key = lights(&["light.direction=0,0,1"]).key;
        assert!(key.direction.abs_diff_eq(Vec3::NEG_Y, 1e-6));
        let lights = lights(&["light.direction=0,0,1", "light.relative_to=world"]);
        assert_eq!(lights.key.direction, Vec3::Z);
        // Fill: the sky from above, the ground from below, half and half at the horizon.
        assert_eq!(lights.fill(Vec3::Z), lights.sky);
        assert_eq!(lights.fill(Vec3::NEG_Z), lights.ground);
        assert!(lights.fill(Vec3::X).abs_diff_eq((lights.sky + lights.ground) / 2.0, 1e-6));
    }

    #[test]
    fn a_far_light_is_the_same_for_every_point() {
        let key = lights(&["light.softness=60"]).key;
        let [a, b] = [Vec3::ZERO, Vec3::splat(1e6)].map(|p| key.seen_from(p));
        assert_eq!(a, b);
        assert!((a.cos_half_angle - 30f32.to_radians().cos()).abs() < 1e-6);
        assert_eq!(a.reach(1.0), f32::INFINITY);
    }

    #[test]
    fn a_lamp_is_seen_as_geometry_says() {
        let lights = lights(&["light.position=1003,4,0", "light.size=5"]);
        assert!((lights.key.direction.x - 1.0).abs() < 1e-4);
        let key = lights.about(DVec3::new(1000.0, 0.0, 0.0)).key;
        // A 3-4-5 triangle; half the size is the sine of the half angle times the distance.
        let seen = key.seen_from(Vec3::ZERO);
        assert!(seen.direction.abs_diff_eq(Vec3::new(0.6, 0.8, 0.0), 1e-6));
        assert!((seen.distance - 5.0).abs() < 1e-6);
        assert!((seen.cos_half_angle - 30f32.to_radians().cos()).abs() < 1e-6);
        // Straight at the middle the ball begins at 2.5; at its rim the ray touches it.
        assert!((seen.reach(1.0) - 2.5).abs() < 1e-6);
        let touch = 5.0 * 30f32.to_radians().cos();
        assert!((seen.reach(seen.cos_half_angle) - touch).abs() < 1e-2);
        // From inside there is nothing between.
        let inside = key.seen_from(Vec3::new(3.0, 3.0, 0.0));
        assert_eq!((inside.cos_half_angle, inside.reach(1.0)), (0.0, 0.0));
        let middle = key.seen_from(Vec3::new(3.0, 4.0, 0.0));
        assert!(middle.direction.is_normalized() && middle.reach(0.0) == 0.0);
    }

    #[test]
    fn a_preset_sets_all_and_what_is_said_overrides_it() {
        let text = "[light]\nsoftness = 3.0\npreset = \"sun\"\n";
        let read = Scene::from_toml(text).unwrap();
        let expected = Light { softness: 3.0, ..Light::of(Preset::Sun) };
        assert_eq!(read.light, expected);

        let mut scene = Scene::default();
        scene.set("light.fill", "0.9").unwrap();
        scene.set("light.preset", "sun").unwrap();
        assert_eq!(scene.light, Light::of(Preset::Sun));
        scene.set("light.softness", "3").unwrap();
        assert_eq!(scene.light, expected);
        scene.set("light", "{ preset = \"sun\", softness = 3.0 }").unwrap();
        assert_eq!(scene.light, expected);
        // A scene that is written down needs no preset to be read again.
        assert_eq!(Scene::from_toml(&scene.to_toml()).unwrap(), scene);

        let error = scene.set("light.preset", "moon").unwrap_err().to_string();
        assert!(error.contains("light.preset") && error.contains("overcast"), "{error}");
        let error = Scene::from_toml("[light]\npreset = \"moon\"").unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("overcast"), "{error}");
        assert_eq!(scene.light, expected);
    }

    #[test]
    fn every_preset_resolves_and_is_like_no_other() {
        let all: Vec<Light> = Preset::WORDS
            .iter()
            .map(|word| {
                let mut scene = Scene::default();
                scene.set("light.preset", word).unwrap();
                scene.resolve(None).unwrap();
                scene.light
            })
            .collect();
        assert_eq!(all[0], Light::default());
        for (i, a) in all.iter().enumerate() {
            let same = |b: &Light| Light { preset: a.preset, ..b.clone() } == *a;
            assert!(!all[..i].iter().any(same), "{a:?}");
        }
    }
}
