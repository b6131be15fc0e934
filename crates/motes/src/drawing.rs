//! The picture of what was loaded, by the scene's way of seeing.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fearless_simd::Level;
use glam::{DVec3, Vec3};
use motes_frame::{Frame, Layer};
use motes_scene::{Bounds, Renderer, Resolved, Scene};
use motes_spheres::{Adaptive, Finer, Picture, Primary, Settings, View};
use motes_surface::MOST_MEDIA;
use rayon::prelude::*;

use crate::cut::Visible;
use crate::density::{Cast, Fields};
use crate::entries::Entries;
use crate::liquid::{Boundaries, Liquid, Matter, Opened};
use crate::memo::{Memo, Same};
use crate::nearest::Nearest;
use crate::scenery::Others;
use crate::stats::Stats;
use crate::system::Loaded;
use crate::{Error, Result, Watch};

/// What is drawn.
#[derive(Clone, Copy)]
pub(crate) struct Drawing<'a> {
    pub scene: &'a Scene,
    pub loaded: &'a [Loaded],
    pub resolved: &'a Resolved,
    /// The point that positions are about.
    pub origin: DVec3,
    /// All that is visible, in world coordinates.
    pub bounds: Option<Bounds>,
    pub kept: &'a Kept,
}

/// What is kept from one picture to the next.
pub(crate) struct Kept {
    /// The renderer of spheres, with its memory.
    renderer: motes_spheres::Renderer,
    /// Memory for its next picture.
    spare: Mutex<Picture>,
    boundaries: Boundaries,
    fields: Fields,
    media: Memo<Same<Visible>, Vec<(usize, Arc<Visible>)>>,
}

impl Default for Kept {
    fn default() -> Self {
        Self {
            renderer: motes_spheres::Renderer::new(),
            spare: Mutex::default(),
            // Several liquids, and all of them as one.
            boundaries: Memo::new(MOST_MEDIA + 1),
            fields: Fields::default(),
            media: Memo::new(1),
        }
    }
}

impl Drawing<'_> {
    /// The picture, with `layers` or without.
    ///
    /// # Errors
    /// The surroundings cannot be read, or the watch cancels.
    pub fn draw(&self, layers: bool, watched: (&mut Stats, &dyn Watch)) -> Result<Frame> {
        match self.scene.renderer {
            Renderer::Spheres => self.trace(layers, watched),
            Renderer::Surface | Renderer::Density => self.flow(layers, watched),
        }
    }

    /// The first system as a liquid, the others as spheres before it and in it.
    fn flow(&self, layers: bool, (stats, watch): (&mut Stats, &dyn Watch)) -> Result<Frame> {
        let Self { scene, loaded, resolved, origin, bounds, .. } = *self;
        let [system, others @ ..] = loaded else {
            let name = if scene.renderer == Renderer::Density { "density" } else { "surface" };
            return Err(Error::Usage(format!("renderer {name}: no system is visible")));
        };
        if let [_, _, ..] = system.visible.passes()
            && system.visible.passes().iter().any(|pass| pass.clip().is_some())
        {
            return Err(Error::Usage(
                "section.types: a liquid is cut as a whole; expected no types, or cut = \"centre\""
                    .into(),
            ));
        }
        let level = Level::new();
        stats.simd = instruction_set(level).into();
        let entries = Entries::new(others, &scene.light);
        let boxes = others.iter().flat_map(|l| l.boxes(origin));
        let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let corners = boxes.fold(nothing, |[low, high], b| {
            [low.min((b.min - origin).as_vec3()), high.max((b.max - origin).as_vec3())]
        });
        let others = Others { systems: &entries.spheres, paint: &entries, bounds: corners };
        let others = (!entries.spheres.is_empty()).then_some(others);
        if scene.renderer == Renderer::Density {
            let fields = &self.kept.fields;
            let cast = Cast { scene, system, resolved, bounds, origin, level, others, fields };
            return cast.draw(layers, (stats, watch));
        }
        let matter = Matter::of(system);
        let types = match scene.surface.media {
            motes_scene::surface::Media::One => Arc::default(),
            motes_scene::surface::Media::Types => {
                self.kept.media.get(Same(system.visible.clone()), || system.visible_by_type())?
            }
        };
        if types.len() > MOST_MEDIA {
            return Err(Error::Usage(format!(
                "surface.media = types: {} types are visible, expected at most {MOST_MEDIA}",
                types.len()
            )));
        }
        let media: Vec<_> = types.iter().map(|(i, of)| (*i, matter.only(system, of))).collect();
        let media = &media[..];
        let nearest = system.clip().map(|_| Nearest::new(system));
        let liquid = Liquid {
            scene,
            matter,
            media,
            resolved,
            bounds,
            origin,
            level,
            others,
            opened: Opened::of(system, &nearest),
            boundaries: Some(&self.kept.boundaries),
        };
        liquid.draw(layers, (stats, watch))
    }

    fn trace(&self, layers: bool, (stats, watch): (&mut Stats, &dyn Watch)) -> Result<Frame> {
        let Self { loaded, resolved, origin, .. } = *self;
        let level = Level::new();
        stats.simd = instruction_set(level).into();
        let entries = Entries::new(loaded, &self.scene.light);
        let rays = resolved.view.rays(origin);
        let lights = resolved.lights.about(origin);
        let systems = &entries.spheres;
        let casters = &entries.casters;
        let view = View { rays: &rays, systems, paint: &entries, lights: &lights, casters };
        let image = &self.scene.image;
        let settings = Settings {
            size: (image.width, image.height),
            samples: image.samples,
            primary: match self.scene.spheres.primary {
                motes_scene::Primary::Project => Primary::Project,
                motes_scene::Primary::Trace => Primary::Trace,
            },
            packet: self.scene.spheres.packet,
            layers,
            finer: Finer {
                adaptive: Some(Adaptive {
                    most: image.max_samples,
                    noise: image.noise as f32,
                    exposure: image.exposure.exp2() as f32,
                }),
                lens: resolved.view.lens,
            },
            level,
        };
        let tell = |done, total| watch.progress("render", done, total);
        let mut picture = std::mem::take(&mut *self.kept.spare());
        let drawn = self.kept.renderer.picture(view, settings, &mut picture, &tell);
        if !drawn {
            *self.kept.spare() = picture;
            return Err(Error::Cancelled);
        }
        stats.counts.insert("tests", picture.counts.tests);
        stats.counts.insert("spheres", picture.counts.spheres);
        let Picture { color, layers: seen, .. } = picture;
        let frame = Frame::new(image.width as usize, image.height as usize, color)?;
        if layers { with_layers(frame, seen, &entries) } else { Ok(frame) }
    }
}

impl Kept {
    fn spare(&self) -> MutexGuard<'_, Picture> {
        // Whatever it holds is drawn over.
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the memory of a frame that nobody looks at any more, for the next one.
    pub fn recycle(&self, frame: Frame) {
        let (color, layers) = frame.into_parts();
        let mut picture = Picture { color, ..Picture::default() };
        for layer in layers {
            match layer {
                Layer::Depth(depth) => picture.layers.depth = depth,
                Layer::Normal(normal) => picture.layers.normal = normal,
                Layer::Id(id) => picture.layers.id = id,
                Layer::System(system) => picture.layers.system = system,
                Layer::SpanCount(_) | Layer::Thickness(_) => {}
            }
        }
        *self.spare() = picture;
    }
}

fn with_layers(
    frame: Frame,
    mut seen: motes_spheres::Layers,
    entries: &Entries<'_>,
) -> Result<Frame> {
    if !entries.are_systems() {
        // Where nothing is, the system is 0.
        let number = |(system, id): (&mut u16, &i64)| {
            *system = if *id < 0 { 0 } else { entries.system(*system).number };
        };
        seen.system.par_iter_mut().with_min_len(1 << 14).zip(&seen.id).for_each(number);
    }
    Ok(frame
        .with(Layer::Depth(seen.depth))?
        .with(Layer::Normal(seen.normal))?
        .with(Layer::Id(seen.id))?
        .with(Layer::System(seen.system))?)
}

/// The name of an instruction set.
pub(crate) fn instruction_set(level: Level) -> &'static str {
    match level {
        #[cfg(target_arch = "x86_64")]
        Level::Avx512(_) => "AVX-512",
        #[cfg(target_arch = "x86_64")]
        Level::Avx2(_) => "AVX2",
        // Nothing is compiled for SSE4.2 alone.
        #[cfg(target_arch = "x86_64")]
        Level::Sse4_2(_) | Level::Sse2(_) => "SSE2",
        #[cfg(target_arch = "aarch64")]
        Level::Neon(_) => "NEON",
        _ => "scalar",
    }
}
