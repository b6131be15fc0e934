//! Shade: the picture of a field.

use fearless_simd::Level;
use glam::{Vec3, Vec4};
use motes_grid::Clip;
use motes_scene::{Beyond, Sight};
use rayon::prelude::*;

use crate::cut::{Body, Cuts};
use crate::field::Field;
use crate::lanes::LANES;
use crate::paths::{Caster, Desk};
use crate::shadow::Shadow;
use crate::space::Space;
use crate::view::View;

/// Pixels along a tile's edge.
const TILE: usize = 32;
/// Least difference of square roots of light, nearly the eye's scale, that is smoothed.
const SEEN: f32 = 0.03;

/// What the liquid does to light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Index of refraction over that of what is around.
    pub ior: f32,
    /// What is taken from each colour per unit of length.
    pub absorption: Vec3,
    /// Boundaries that a path meets at the most, at least 1.
    pub depth: u32,
}

/// The colours of the liquid.
pub trait Paint: Sync {
    /// Linear colour of the liquid at a point of its surface.
    fn color(&self, point: Vec3) -> Vec3;
}

/// What is around the liquid.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    /// What rays meet outside.
    pub beyond: &'a dyn Beyond,
    /// Whether rays that meet nothing show what is beyond; else the picture is transparent there.
    pub shown: bool,
    /// What keeps the key light away, if it casts shadows.
    pub shadow: Option<&'a Shadow>,
    /// Colours of the liquid, if not one throughout.
    pub paint: Option<&'a dyn Paint>,
}

impl Around<'_> {
    /// What comes from outside along a ray, in shadow where the liquid casts one.
    #[inline]
    pub(crate) fn meet(&self, sight: &Sight) -> Option<(Vec3, f32)> {
        let (light, distance) = self.beyond.meet(sight)?;
        let lit = match self.shadow.filter(|_| distance.is_finite()) {
            Some(shadow) => shadow.lit(sight.origin + sight.direction * distance),
            None => 1.0,
        };
        Some((light * lit, distance))
    }
}

/// A field and what rays can skip in it.
#[derive(Clone, Copy)]
pub struct Liquid<'a> {
    /// The field.
    pub field: &'a Field,
    /// What was found in it.
    pub space: &'a Space,
    /// What cuts leave of it, about the origin of the particles; none: all.
    pub clip: Option<&'a Clip>,
    /// The instruction set.
    pub level: Level,
}

impl Liquid<'_> {
    /// Its cuts, in voxels.
    pub(crate) fn cuts(&self) -> Option<Cuts> {
        self.clip.map(|clip| Cuts::new(clip, &self.field.lattice))
    }

    /// What rays go through, with these cuts.
    pub(crate) fn body<'b>(&'b self, cuts: Option<&'b Cuts>) -> Body<'b> {
        Body { field: self.field, space: self.space, cuts, level: self.level }
    }
}

/// The picture: linear, premultiplied colours, row by row. With `finer` above 1, a pixel that differs from one
/// of the eight around it is the mean of `finer`² samples.
pub fn shade(
    liquid: &Liquid<'_>,
    view: &View,
    (optics, around): (&Optics, &Around<'_>),
    finer: u32,
) -> Vec<[f32; 4]> {
    let cuts = liquid.cuts();
    let body = liquid.body(cuts.as_ref());
    let caster = Caster { body, optics, around };
    let finer = finer.max(1) as usize;
    let artist = Artist { caster, view, finer };
    let width = view.size.0 as usize;
    let mut first = vec![[0.0; 4]; view.pixels()];
    let bands = first.par_chunks_mut((width * TILE).max(1)).enumerate().with_max_len(1);
    bands.for_each_init(Desk::default, |desk, (band, colors)| {
        artist.tiles(band, colors, |pixels, light| {
            artist.sample(pixels, [0], (light, desk));
        });
    });
    if finer == 1 {
        return first;
    }
    let mut color = first.clone();
    let bands = color.par_chunks_mut((width * TILE).max(1)).enumerate().with_max_len(1);
    bands.for_each_init(Desk::default, |desk, (band, colors)| {
        artist.tiles(band, colors, |pixels, light| {
            pixels.retain(|pixel| differs(&first, view.size, *pixel));
            // The first sample of each is known.
            artist.sample(pixels, 1..finer * finer, (light, desk));
            let part = 1.0 / (finer * finer) as f32;
            for (light, pixel) in light.iter_mut().zip(&*pixels) {
                *light = (*light + Vec4::from_array(first[*pixel as usize])) * part;
            }
        });
    });
    color
}

/// Draws a view.
struct Artist<'a> {
    caster: Caster<'a>,
    view: &'a View,
    /// Samples along a pixel's edge.
    finer: usize,
}

impl Artist<'_> {
    /// Goes through the tiles of a band of rows: `draw` is given the pixels of each, may leave some out, and
    /// gives the light of the others.
    fn tiles(
        &self,
        band: usize,
        colors: &mut [[f32; 4]],
        mut draw: impl FnMut(&mut Vec<u32>, &mut Vec<Vec4>),
    ) {
        let width = self.view.size.0 as usize;
        let begin = band * TILE * width;
        let (mut pixels, mut light) = (Vec::new(), Vec::new());
        for left in (0..width).step_by(TILE) {
            let columns = left..(left + TILE).min(width);
            let rows = 0..colors.len() / width;
            pixels.clear();
            for y in rows {
                let row = (begin + y * width) as u32;
                pixels.extend(row + columns.start as u32..row + columns.end as u32);
            }
            draw(&mut pixels, &mut light);
            for (pixel, light) in pixels.iter().zip(&light) {
                colors[*pixel as usize - begin] = light.to_array();
            }
        }
    }

    /// The sum of some samples of each pixel.
    fn sample(
        &self,
        pixels: &[u32],
        samples: impl IntoIterator<Item = usize>,
        (light, desk): (&mut Vec<Vec4>, &mut Desk),
    ) {
        let (width, finer) = (self.view.size.0, self.finer);
        light.clear();
        light.resize(pixels.len(), Vec4::ZERO);
        let room = pixels.len().next_multiple_of(LANES);
        desk.places.iter_mut().for_each(|row| row.resize(room, 0.0));
        for sample in samples {
            let offset = [sample % finer, sample / finer].map(|i| (i as f32 + 0.5) / finer as f32);
            let [xs, ys] = &mut desk.places;
            // Row by row.
            let (mut row, mut end) = (0, 0);
            for ((pixel, x), y) in pixels.iter().zip(xs).zip(ys) {
                if *pixel >= end {
                    row = pixel / width;
                    end = (row + 1) * width;
                }
                *x = (pixel + width - end) as f32 + offset[0];
                *y = row as f32 + offset[1];
            }
            self.caster.trace((&self.view.rays, finer), (light, desk));
        }
    }
}

/// Whether a pixel differs to the eye from one of the eight around it.
fn differs(colors: &[[f32; 4]], (width, height): (u32, u32), pixel: u32) -> bool {
    let (x, y) = (pixel % width, pixel / width);
    let own = colors[pixel as usize];
    let xs = x.saturating_sub(1)..(x + 2).min(width);
    let mut near = (y.saturating_sub(1)..(y + 2).min(height))
        .flat_map(|y| xs.clone().map(move |x| (y * width + x) as usize));
    near.any(|i| {
        let other = colors[i];
        let root = |v: f32| v.clamp(0.0, 1.0).sqrt();
        (0..4).any(|c| (root(own[c]) - root(other[c])).abs() > SEEN)
    })
}
