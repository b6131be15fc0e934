//! Layers: what the ray through each pixel's centre meets first, and how much liquid it passes.

use fearless_simd::dispatch;
use glam::Vec3;
use rayon::prelude::*;

use crate::cut::Body;
use crate::lanes::LANES;
use crate::normals::gradients;
use crate::rays::{Hits, OUTSIDE, Rays};
use crate::shade::Liquid;
use crate::view::View;

/// Most stretches of liquid that are added up along a ray.
const STRETCHES: usize = 64;

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Distance along the ray, world units; +∞ where nothing is.
    pub distance: f32,
    /// Where that is, about the origin of the particles.
    pub point: Vec3,
    /// Unit normal towards the viewer; 0 where nothing is.
    pub normal: Vec3,
    /// The particle, by its place in the input, if it is a drop.
    pub drop: Option<u32>,
    /// Length of liquid along the ray, straight through.
    pub thickness: f32,
}

/// What the rays through the pixels of a view meet, row by row.
pub fn layers(liquid: &Liquid<'_>, view: &View) -> Vec<Seen> {
    let rows = (0..view.size.1).into_par_iter();
    let cuts = liquid.cuts();
    rows.flat_map_iter(|y| row(&liquid.body(cuts.as_ref()), view, y)).collect()
}

fn row(body: &Body<'_>, view: &View, y: u32) -> Vec<Seen> {
    let Body { field, space, cuts, level } = *body;
    let lattice = &field.lattice;
    let (mut rays, mut hits) = (Rays::default(), Hits::default());
    for x in 0..view.size.0 {
        let (origin, direction) = view.rays.ray(x as f32 + 0.5, y as f32 + 0.5);
        let place = lattice.place(origin);
        rays.push(place, direction, body.medium(place));
    }
    let thickness = passed(body, rays.clone());
    body.march(&mut rays, &mut hits);
    let count = rays.len();
    let mut rows = [0, 1, 2].map(|_| vec![0.0; count.next_multiple_of(LANES)]);
    let met = |ray: usize| hits.distance[ray].is_finite();
    let place = |ray: usize| rays.origin(ray) + rays.direction(ray) * hits.distance[ray];
    for ray in (0..count).filter(|ray| met(*ray)) {
        (0..3).for_each(|a| rows[a][ray] = place(ray)[a]);
    }
    dispatch!(level, simd => gradients(simd, field, &mut rows));
    let seen = |ray: usize| {
        let thickness = thickness[ray];
        if !met(ray) {
            let (point, normal) = (Vec3::ZERO, Vec3::ZERO);
            return Seen { distance: f32::INFINITY, point, normal, drop: None, thickness };
        }
        let drop = space.drops.drops.get(hits.surface[ray] as usize);
        let cap = cuts.filter(|_| hits.cap[ray] > 0);
        let out = match (cap, drop) {
            (Some(cuts), _) => -cuts.normal(hits.cap[ray]),
            (_, Some(drop)) => place(ray) - drop.center,
            _ => -Vec3::new(rows[0][ray], rows[1][ray], rows[2][ray]),
        };
        let normal = out.normalize_or(-rays.direction(ray));
        let toward = if normal.dot(rays.direction(ray)) > 0.0 { -normal } else { normal };
        Seen {
            distance: hits.distance[ray] * lattice.voxel,
            point: lattice.point(place(ray)),
            normal: toward,
            drop: drop.map(|drop| drop.index),
            thickness,
        }
    };
    (0..count).map(seen).collect()
}

/// Length of liquid along each ray, world units.
pub(crate) fn passed(body: &Body<'_>, mut rays: Rays) -> Vec<f32> {
    let field = body.field;
    let mut hits = Hits::default();
    let mut sums = vec![0.0; rays.len()];
    let mut which: Vec<usize> = (0..rays.len()).collect();
    for _ in 0..2 * STRETCHES {
        if which.is_empty() {
            break;
        }
        body.march(&mut rays, &mut hits);
        let (mut next, mut going) = (Rays::default(), Vec::new());
        for (ray, pixel) in which.iter().enumerate() {
            let distance = hits.distance[ray];
            if distance.is_finite() {
                let inside = rays.medium[ray] != OUTSIDE;
                if inside {
                    sums[*pixel] += distance * field.lattice.voxel;
                }
                let (origin, direction) = (rays.origin(ray), rays.direction(ray));
                let medium = if inside { OUTSIDE } else { hits.surface[ray] };
                next.push(origin + direction * distance, direction, medium);
                going.push(*pixel);
            }
        }
        (rays, which) = (next, going);
    }
    sums
}
