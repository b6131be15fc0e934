//! How much of the key light and of the fill reaches a surface: shadow and occlusion rays.
//!
//! Gribble et al. 2007, §4.3, "Soft Shadows": from every hit, rays to samples of an area light, all
//! any-hit. Hits are first sorted by place, so that those of one group lie together in space (packets by
//! pixels alone would tear at every edge), and each group sends one bundle towards the light
//! ([`crate::shaft`]). The light's samples are parts of equal area along a spiral, which neighbouring
//! pixels turn differently, so that no bands appear.
//!
//! Ambient occlusion goes along directions that cut the sphere into parts of equal area, of which those
//! above the surface count with the cosine. All rays of a bundle share one direction, so that it stays
//! as narrow as its points lie together, however far it goes. On all but small spheres, neighbouring
//! pixels, two by two, have directions of their own (interleaved sampling, Keller and Heidrich 2001); hits on the same sphere
//! within such a square share what they see.

use fearless_simd::{f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::{KeyLight, Projection, Toward};

use crate::aims::{Aims, TURNS};
use crate::beam::{Beam, MOST};
use crate::hits::Hits;
use crate::near::{Near, Shelves};
use crate::packet::{LANES, Packet};
use crate::render::View;
use crate::shade::Reaching;
use crate::shaft::{Bundle, Cone, LOST};
use crate::tile::{RayTile, TILE_RAYS};
use crate::traverse::Counts;

/// Edge of the cells that hits are sorted by, pixels at the least distance in the tile.
const CELL_PIXELS: f32 = 4.0;
/// Greatest edge of the box around a group, pixels at that distance, and most hits of it for each sample
/// of a pixel: for shadows and for occlusion.
const SHADOW_GROUP: (f32, usize) = (16.0, 128);
const OCCLUSION_GROUP: (f32, usize) = (32.0, 1024);

/// Spheres of a lesser radius, in pixels, all look in the same directions.
const SMALL_SPHERE: f32 = 5.0;

/// The hits of a tile, and what they look at.
#[derive(Clone, Copy)]
pub(crate) struct Work<'a> {
    pub rays: &'a RayTile,
    pub hits: &'a Hits,
    pub view: View<'a>,
    pub aims: &'a Aims,
    /// The tile's first pixel.
    pub corner: (u32, u32),
    /// Which of a pixel's samples are the tile's: those from here on.
    pub first_sample: u32,
    /// Where the blocks of the grids lie.
    pub shelves: &'a Shelves,
}

impl Work<'_> {
    /// The turn of the light's samples in a pixel of the tile.
    pub fn key_turn(&self, (x, y): (u32, u32)) -> u32 {
        turn(self.corner.0 + x, self.corner.1 + y)
    }

    /// Direction and reach of the shadow ray of a place, where the light is seen as `toward`.
    #[inline(always)]
    pub fn shadow_ray(&self, place: usize, toward: Toward) -> (Vec3, f32) {
        let direction = match self.view.lights.key.lamp {
            Some(_) => self.aims.toward(place, toward),
            None => self.aims.key_direction(place),
        };
        (direction, toward.reach(direction.dot(toward.direction)))
    }

    /// Where the directions of the shadow rays of a hit begin.
    #[inline(always)]
    pub fn key_set(&self, ray: usize) -> usize {
        let turn = self.key_turn(self.rays.pattern.pixel_of(ray));
        self.aims.key_set(turn, self.first_sample + self.rays.pattern.sample(ray))
    }

    /// Which of the four sets of occlusion directions the hit of a ray has: by its place in a square of
    /// two by two pixels, but on a sphere so small that no bands can show on it, and in a pixel with many
    /// samples, always the first. One set for all keeps beams full.
    #[inline(always)]
    pub fn quarter(&self, ray: usize) -> u32 {
        let pixel = match self.view.rays.projection {
            Projection::Perspective => self.view.rays.pixel * self.rays.distance[ray],
            Projection::Orthographic => self.view.rays.pixel,
        };
        if self.rays.pattern.side == 1 || self.hits.radius[ray] < SMALL_SPHERE * pixel {
            return 0;
        }
        let (x, y) = self.rays.pattern.pixel_of(ray);
        x % 2 + y % 2 * 2
    }
}

/// Finds what reaches the hits of a tile, and keeps its buffers from one to the next.
#[derive(Debug)]
pub(crate) struct Occluder {
    pub reaching: Reaching,
    pub(crate) packet: Box<Packet>,
    bundle: Bundle,
    beam: Beam,
    near: Near,
    /// The hits by place: a key of their cell, and their ray.
    order: Vec<(u32, u32)>,
    points: Points,
    /// Cosines of the rays of a bundle.
    cosine: Vec<f32>,
    /// Sums over each hit's rays, of visible · cosine and of cosine.
    pub(crate) key: Sums,
    pub(crate) fill: Sums,
}

/// Per ray of a tile, visible cosines and all cosines.
#[derive(Debug)]
pub(crate) struct Sums {
    pub visible: Vec<f32>,
    pub all: Vec<f32>,
}

impl Sums {
    fn new() -> Self {
        Self { visible: vec![0.0; TILE_RAYS], all: vec![0.0; TILE_RAYS] }
    }
}

impl Occluder {
    pub fn new() -> Self {
        Self {
            reaching: Reaching::new(),
            packet: Box::new(Packet::new()),
            bundle: Bundle::new(),
            beam: Beam::new(),
            near: Near::default(),
            order: Vec::new(),
            points: Points::default(),
            cosine: Vec::new(),
            key: Sums::new(),
            fill: Sums::new(),
        }
    }

    /// Finds what reaches the hits.
    #[simd]
    pub fn reach<S: Simd>(&mut self, simd: S, work: Work<'_>, counts: &mut Counts) {
        self.open(simd, work.hits, &work.view.lights.key);
        let (shadows, occlusion) = (work.aims.key_rays > 0, work.aims.fill_rays > 0);
        if !shadows && !occlusion {
            return;
        }
        let pixel = self.sort(work);
        let mut rest = 0;
        while shadows && rest < self.order.len() {
            let (from, to) = (rest, self.group(work, rest, (pixel, SHADOW_GROUP)));
            self.shadow(simd, work, (from, to), counts);
            rest = to;
        }
        let mut rest = 0;
        while occlusion && rest < self.order.len() {
            let (from, to) = (rest, self.group(work, rest, (pixel, OCCLUSION_GROUP)));
            self.occlude(simd, work, (from, to), counts);
            rest = to;
        }
        if shadows {
            share(work, &self.key, &mut self.reaching.key, true);
        }
        if occlusion {
            share(work, &self.fill, &mut self.reaching.fill, false);
        }
    }

    /// What reaches the hits in the open.
    ///
    /// While the whole round light is above the horizon this is the cosine; while it sets, over ±sin α
    /// of the cosine, the quadratic that meets the cosine above and zero below with equal slopes.
    #[inline(always)]
    pub(crate) fn open<S: Simd>(&mut self, simd: S, hits: &Hits, light: &KeyLight) {
        let sine = (1.0 - light.cos_half_angle * light.cos_half_angle).max(1e-12).sqrt();
        let d = light.direction;
        let one = f32x16::splat(simd, 1.0);
        for block in (0..TILE_RAYS / LANES).filter(|block| hits.mask[*block] != 0) {
            let lanes = block * LANES..(block + 1) * LANES;
            let nx = f32x16::from_slice(simd, &hits.normal[0][lanes.clone()]);
            let ny = f32x16::from_slice(simd, &hits.normal[1][lanes.clone()]);
            let nz = f32x16::from_slice(simd, &hits.normal[2][lanes.clone()]);
            if light.lamp.is_some() {
                self.open_to_lamp(simd, hits, light, block);
                one.store_slice(&mut self.reaching.fill[lanes]);
                continue;
            }
            let cosine = nz * d.z + ny * d.y + nx * d.x;
            lit(simd, cosine, f32x16::splat(simd, sine))
                .store_slice(&mut self.reaching.key[lanes.clone()]);
            one.store_slice(&mut self.reaching.fill[lanes]);
        }
    }

    /// What reaches the hits of a block from a lamp, which each of them sees elsewhere.
    #[cold]
    fn open_to_lamp<S: Simd>(&mut self, simd: S, hits: &Hits, light: &KeyLight, block: usize) {
        let mut left = hits.mask[block];
        while left != 0 {
            let ray = block * LANES + left.trailing_zeros() as usize;
            left &= left - 1;
            let toward = light.seen_from(hits.position_of(ray));
            let cosine = f32x16::splat(simd, hits.normal_of(ray).dot(toward.direction));
            let sine = (1.0 - toward.cos_half_angle * toward.cos_half_angle).max(1e-12).sqrt();
            self.reaching.key[ray] = lit(simd, cosine, f32x16::splat(simd, sine))[0];
        }
    }

    /// Sorts the hits from which light is kept away by place. Gives the size of a pixel at the least distance.
    fn sort(&mut self, work: Work<'_>) -> f32 {
        let Work { rays, hits, view, .. } = work;
        self.order.clear();
        let (mut low, mut depth) = (Vec3::INFINITY, f32::INFINITY);
        for block in 0..TILE_RAYS / LANES {
            let mut left = hits.mask[block];
            while left != 0 {
                let ray = block * LANES + left.trailing_zeros() as usize;
                left &= left - 1;
                // Before the cut, what it lays open was in the dark: nothing is kept from it.
                if hits.capped && hits.cap[ray] > 0 && !view.casters.is_empty() {
                    for sums in [&mut self.key, &mut self.fill] {
                        (sums.visible[ray], sums.all[ray]) = (1.0, 1.0);
                    }
                    continue;
                }
                low = low.min(hits.position_of(ray));
                depth = depth.min(rays.distance[ray]);
                self.order.push((0, ray as u32));
            }
        }
        let pixel = match view.rays.projection {
            Projection::Perspective => view.rays.pixel * depth,
            Projection::Orthographic => view.rays.pixel,
        };
        let per_cell = 1.0 / (pixel * CELL_PIXELS);
        for (key, ray) in &mut self.order {
            // 10 bits an axis; farther cells share the last. `as` saturates.
            let at = (hits.position_of(*ray as usize) - low) * per_cell;
            let [x, y, z] = at.to_array().map(|v| spread((v as u32).min(1023)));
            *key = x | y << 1 | z << 2;
        }
        self.order.sort_unstable();
        pixel
    }

    /// Where the group ends that begins at `from`: before its box grows longer than `most`, and before
    /// it has too many points.
    #[inline(always)]
    fn group(
        &self,
        work: Work<'_>,
        from: usize,
        (pixel, (edge, points)): (f32, (f32, usize)),
    ) -> usize {
        let points = points * work.rays.pattern.samples as usize;
        let most = edge * pixel;
        let end = self.order.len().min(from + points);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (at, (_, ray)) in self.order[from..end].iter().enumerate() {
            let position = work.hits.position_of(*ray as usize);
            (low, high) = (low.min(position), high.max(position));
            if (high - low).max_element() > most && at > 0 {
                return from + at;
            }
        }
        end
    }

    /// Shadow rays from the points of a group: one bundle towards the whole light.
    #[inline(always)]
    fn shadow<S: Simd>(
        &mut self,
        simd: S,
        work: Work<'_>,
        (from, to): (usize, usize),
        counts: &mut Counts,
    ) {
        self.points.clear();
        for (_, ray) in &self.order[from..to] {
            self.points.push(work, *ray);
        }
        self.points.pad();
        self.points.clear_sums();
        match &work.aims.key_cone {
            Some(cone) if work.aims.key_whole() => self.shoot_sixteens(simd, work, cone, counts),
            _ => self.shoot(simd, work, (0, self.points.count), counts),
        }
        for point in 0..self.points.count {
            let ray = self.points.ray[point] as usize;
            self.key.visible[ray] = self.points.visible[point];
            self.key.all[ray] = self.points.all[point];
        }
    }

    /// Shadow rays in whole vectors towards a far light.
    #[inline(always)]
    fn shoot_sixteens<S: Simd>(
        &mut self,
        simd: S,
        work: Work<'_>,
        cone: &Cone,
        counts: &mut Counts,
    ) {
        let rays = work.aims.key_rays;
        self.bundle.clear();
        self.cosine.clear();
        for point in 0..self.points.count {
            let at = self.points.get(point);
            let first = work.key_set(self.points.ray[point] as usize);
            for first in (first..first + rays).step_by(LANES) {
                self.send(simd, at, work.aims.key_sixteen(simd, first));
            }
        }
        let bounds = self.points.bounds(0, self.points.count);
        self.bundle.block(simd, (cone, bounds, f32::INFINITY), work.view.casting(), counts);
        let vectors = rays / LANES;
        for point in 0..self.points.count {
            for vector in point * vectors..(point + 1) * vectors {
                let lanes = vector * LANES..(vector + 1) * LANES;
                let cosine = f32x16::from_slice(simd, &self.cosine[lanes]);
                let zero = f32x16::splat(simd, 0.0);
                self.points.all[point] += cosine.reduce_sum();
                let open = self.bundle.open(simd, vector).select(cosine, zero);
                self.points.visible[point] += open.reduce_sum();
            }
        }
    }

    /// Shadow rays of the points `from..to` towards any light, however many, in bundles as large as the
    /// rays have an axis to follow.
    fn shoot<S: Simd>(
        &mut self,
        simd: S,
        work: Work<'_>,
        (from, to): (usize, usize),
        counts: &mut Counts,
    ) {
        let light = &work.view.lights.key;
        self.bundle.clear();
        let mut staged = Staged::default();
        for point in from..to {
            let (origin, normal) = self.points.get(point);
            let first = work.key_set(self.points.ray[point] as usize);
            let toward = light.seen_from(origin);
            for place in first..first + work.aims.key_rays {
                let (direction, reach) = work.shadow_ray(place, toward);
                let cosine = direction.dot(normal);
                if cosine > 0.0 {
                    staged.push(origin, (direction, reach), (cosine, point));
                }
            }
        }
        if staged.own.is_empty() {
            return;
        }
        let known = work.aims.key_cone;
        let Some(cone) = known.or_else(|| Cone::around(&staged.direction)) else {
            let middle = from.midpoint(to);
            if to - from > 1 {
                self.shoot(simd, work, (from, middle), counts);
                self.shoot(simd, work, (middle, to), counts);
            } else {
                self.shoot_singly(simd, work, &staged, counts);
            }
            return;
        };
        let reach = staged.fill(simd, &mut self.bundle);
        let bounds = self.points.bounds(from, to);
        self.bundle.block(simd, (&cone, bounds, reach), work.view.casting(), counts);
        for (ray, (cosine, point)) in staged.own.iter().enumerate() {
            self.points.all[*point as usize] += cosine;
            if self.bundle.is_open(ray) {
                self.points.visible[*point as usize] += cosine;
            }
        }
    }

    /// Shadow rays of one point that go all ways, each for itself.
    fn shoot_singly<S: Simd>(
        &mut self,
        simd: S,
        work: Work<'_>,
        staged: &Staged,
        counts: &mut Counts,
    ) {
        for ray in 0..staged.own.len() {
            let one = staged.single(ray);
            self.bundle.clear();
            let reach = one.fill(simd, &mut self.bundle);
            let origin = one.origin[0];
            if let Some(cone) = Cone::around(&one.direction) {
                let bounds = (origin, origin);
                self.bundle.block(simd, (&cone, bounds, reach), work.view.casting(), counts);
            }
            let (cosine, point) = one.own[0];
            self.points.all[point as usize] += cosine;
            if self.bundle.is_open(0) {
                self.points.visible[point as usize] += cosine;
            }
        }
    }

    /// Sends sixteen rays of one point towards the light; those below its surface are none.
    #[inline(always)]
    fn send<S: Simd>(&mut self, simd: S, (origin, normal): (Vec3, Vec3), toward: [f32x16<S>; 3]) {
        let [dx, dy, dz] = toward;
        let zero = f32x16::splat(simd, 0.0);
        let cosine = (dz * normal.z + dy * normal.y + dx * normal.x).max(zero);
        let at = self.cosine.len();
        self.cosine.resize(at + LANES, 0.0);
        cosine.store_slice(&mut self.cosine[at..]);
        let above = cosine.simd_gt(zero);
        let reach = above.select(f32x16::splat(simd, f32::INFINITY), f32x16::splat(simd, LOST));
        let from = [
            f32x16::splat(simd, origin.x),
            f32x16::splat(simd, origin.y),
            f32x16::splat(simd, origin.z),
        ];
        // A vector without rays meets nothing.
        let spread = if above.any_true() { 0.0 } else { LOST };
        self.bundle.push(from, toward, reach, (origin, spread));
    }

    /// Occlusion rays from the points of a group: a beam for each direction.
    #[inline(always)]
    fn occlude<S: Simd>(
        &mut self,
        simd: S,
        work: Work<'_>,
        (from, to): (usize, usize),
        counts: &mut Counts,
    ) {
        let (pattern, aims) = (work.rays.pattern, work.aims);
        let classes = 4 * pattern.samples;
        let class_of =
            |ray: u32| work.quarter(ray as usize) * pattern.samples + pattern.sample(ray as usize);
        let systems = work.view.casting();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (_, ray) in &self.order[from..to] {
            let position = work.hits.position_of(*ray as usize);
            let lift = Vec3::splat(lift(work, *ray as usize));
            (low, high) = (low.min(position - lift), high.max(position + lift));
        }
        self.near.find(simd, work.shelves, (low, high), aims.reach);
        for class in 0..classes {
            self.points.clear();
            for (_, ray) in self.order[from..to].iter().filter(|(_, ray)| class_of(*ray) == class) {
                self.points.push(work, *ray);
            }
            if self.points.count == 0 {
                continue;
            }
            let (quarter, sample) = (class / pattern.samples, class % pattern.samples);
            let directions = aims.fill_set(quarter, work.first_sample + sample);
            self.points.pad();
            self.points.clear_sums();
            for direction in directions {
                self.points.aim(simd, *direction, &mut self.beam);
                if self.beam.rays > 0 {
                    let near = (&self.near, work.shelves);
                    self.beam.block(simd, (*direction, aims.reach), near, (systems, counts));
                    self.points.gather(simd, &self.beam);
                }
            }
            for point in 0..self.points.count {
                let ray = self.points.ray[point] as usize;
                self.fill.visible[ray] = self.points.visible[point];
                self.fill.all[ray] = self.points.all[point];
            }
        }
    }
}

/// Rays on their way into a bundle, and whose they are.
#[derive(Debug, Default)]
struct Staged {
    origin: Vec<Vec3>,
    direction: Vec<Vec3>,
    reach: Vec<f32>,
    /// Cosine and point.
    own: Vec<(f32, u32)>,
}

impl Staged {
    #[inline(always)]
    fn push(
        &mut self,
        origin: Vec3,
        (direction, reach): (Vec3, f32),
        (cosine, point): (f32, usize),
    ) {
        self.origin.push(origin);
        self.direction.push(direction);
        self.reach.push(reach);
        self.own.push((cosine, point as u32));
    }

    /// Ray `ray` alone.
    fn single(&self, ray: usize) -> Self {
        Self {
            origin: vec![self.origin[ray]],
            direction: vec![self.direction[ray]],
            reach: vec![self.reach[ray]],
            own: vec![self.own[ray]],
        }
    }

    /// Puts the rays into the bundle. Gives the greatest reach.
    #[inline(always)]
    fn fill<S: Simd>(&self, simd: S, bundle: &mut Bundle) -> f32 {
        let mut most = 0f32;
        for first in (0..self.own.len()).step_by(LANES) {
            let rays = LANES.min(self.own.len() - first);
            let mut reach = [LOST; LANES];
            let (mut origin, mut direction) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            for lane in 0..rays {
                let (o, d) = (self.origin[first + lane], self.direction[first + lane]);
                for axis in 0..3 {
                    (origin[axis][lane], direction[axis][lane]) = (o[axis], d[axis]);
                }
                reach[lane] = self.reach[first + lane];
                most = most.max(reach[lane]);
                (low, high) = (low.min(o), high.max(o));
            }
            let around = (0.5 * (low + high), 0.5 * (high - low).length() * (1.0 + 1e-5));
            let rows = |rows: &[[f32; LANES]; 3]| {
                [
                    f32x16::from_slice(simd, &rows[0]),
                    f32x16::from_slice(simd, &rows[1]),
                    f32x16::from_slice(simd, &rows[2]),
                ]
            };
            let reach = f32x16::from_slice(simd, &reach);
            bundle.push(rows(&origin), rows(&direction), reach, around);
        }
        most
    }
}

/// The points of a group where secondary rays start, coordinate by coordinate.
#[derive(Debug, Default)]
struct Points {
    count: usize,
    origin: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    /// Whose they are.
    ray: Vec<u32>,
    /// Sums over the rays of each point.
    visible: Vec<f32>,
    all: Vec<f32>,
    /// Of each ray of the beam at hand, its cosine and its point.
    cosine: Vec<f32>,
    own: Vec<u32>,
}

impl Points {
    fn clear(&mut self) {
        self.count = 0;
        self.ray.clear();
        for axis in 0..3 {
            self.origin[axis].clear();
            self.normal[axis].clear();
        }
    }

    /// Adds the hit of a ray, lifted off its surface so that its rays do not meet it by rounding.
    #[inline(always)]
    fn push(&mut self, work: Work<'_>, ray: u32) {
        let at = ray as usize;
        let (position, normal) = (work.hits.position_of(at), work.hits.normal_of(at));
        let origin = position + normal * lift(work, at);
        for axis in 0..3 {
            self.origin[axis].push(origin[axis]);
            self.normal[axis].push(normal[axis]);
        }
        self.ray.push(ray);
        self.count += 1;
    }

    fn get(&self, point: usize) -> (Vec3, Vec3) {
        let at = |v: &[Vec<f32>; 3]| Vec3::new(v[0][point], v[1][point], v[2][point]);
        (at(&self.origin), at(&self.normal))
    }

    /// The box around the origins of points `from..to`.
    fn bounds(&self, from: usize, to: usize) -> (Vec3, Vec3) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for axis in 0..3 {
            for v in &self.origin[axis][from..to] {
                low[axis] = low[axis].min(*v);
                high[axis] = high[axis].max(*v);
            }
        }
        (low, high)
    }

    /// Fills the last vector with points that face nowhere.
    fn pad(&mut self) {
        let lanes = self.count.next_multiple_of(LANES);
        for axis in 0..3 {
            self.origin[axis].resize(lanes, 0.0);
            self.normal[axis].resize(lanes, 0.0);
        }
    }

    fn clear_sums(&mut self) {
        let lanes = self.count.next_multiple_of(LANES);
        for sums in [&mut self.visible, &mut self.all] {
            sums.clear();
            sums.resize(lanes, 0.0);
        }
        self.cosine.resize(MOST + LANES, 0.0);
        self.own.resize(MOST + LANES, 0);
    }

    /// Makes the beam of the rays of all points along `direction`, where it lies above the surface.
    #[inline(always)]
    fn aim<S: Simd>(&mut self, simd: S, direction: Vec3, beam: &mut Beam) {
        beam.rays = 0;
        let zero = f32x16::splat(simd, 0.0);
        let [nx, ny, nz] = &self.normal;
        let [ox, oy, oz] = &self.origin;
        for first in (0..self.count).step_by(LANES) {
            let lanes = first..first + LANES;
            let nx = f32x16::from_slice(simd, &nx[lanes.clone()]);
            let ny = f32x16::from_slice(simd, &ny[lanes.clone()]);
            let nz = f32x16::from_slice(simd, &nz[lanes.clone()]);
            let cosine = nz * direction.z + ny * direction.y + nx * direction.x;
            let above = cosine.simd_gt(zero);
            let count = above.to_bitmask().count_ones() as usize;
            if count == 0 {
                continue;
            }
            let to = beam.rays..beam.rays + LANES;
            let x = f32x16::from_slice(simd, &ox[lanes.clone()]);
            let y = f32x16::from_slice(simd, &oy[lanes.clone()]);
            let z = f32x16::from_slice(simd, &oz[lanes]);
            x.compress(above).store_slice(&mut beam.origin[0][to.clone()]);
            y.compress(above).store_slice(&mut beam.origin[1][to.clone()]);
            z.compress(above).store_slice(&mut beam.origin[2][to.clone()]);
            cosine.compress(above).store_slice(&mut self.cosine[to.clone()]);
            let own = u32x16::from_fn(simd, |lane| (first + lane) as u32);
            own.compress(above).store_slice(&mut self.own[to]);
            beam.rays += count;
        }
    }

    /// Adds what the rays of the beam saw to the sums of their points.
    #[inline(always)]
    fn gather<S: Simd>(&mut self, simd: S, beam: &Beam) {
        for first in (0..beam.rays).step_by(LANES) {
            let open = beam.open(simd, first).to_bitmask();
            for lane in 0..LANES.min(beam.rays - first) {
                let (point, cosine) = (self.own[first + lane] as usize, self.cosine[first + lane]);
                self.all[point] += cosine;
                self.visible[point] += if open >> lane & 1 == 1 { cosine } else { 0.0 };
            }
        }
    }
}

/// How far from its surface the rays of a hit start: a thousandth of the radius, and what rounding of
/// the coordinates may add to it.
#[inline(always)]
pub(crate) fn lift(work: Work<'_>, ray: usize) -> f32 {
    let size = work.hits.position_of(ray).abs().max_element() + work.rays.distance[ray];
    1e-3 * work.hits.radius[ray] + 1e-6 * size
}

/// Turns sums into visible parts, which the hits of a square of two by two pixels (of a pixel, if it
/// fills a block) on the same sphere share. `times` what is there already, or instead of it.
pub(crate) fn share(work: Work<'_>, sums: &Sums, reaching: &mut [f32], times: bool) {
    let (hits, rays) = (work.hits, work.rays);
    let squares: &[u16] = match rays.pattern.side {
        4 => &[0x0033, 0x00cc, 0x3300, 0xcc00],
        _ => &[0xffff],
    };
    for block in (0..TILE_RAYS / LANES).filter(|block| hits.mask[*block] != 0) {
        for square in squares {
            let mut left = hits.mask[block] & square;
            while left != 0 {
                let sphere = |lane: usize| {
                    let ray = block * LANES + lane;
                    (hits.index[ray], rays.hit_system[ray], hits.cap[ray])
                };
                let first = sphere(left.trailing_zeros() as usize);
                let (mut same, mut visible, mut all) = (0u16, 0.0, 0.0);
                for lane in (0..LANES).filter(|lane| left >> lane & 1 == 1) {
                    if sphere(lane) == first {
                        same |= 1 << lane;
                        visible += sums.visible[block * LANES + lane];
                        all += sums.all[block * LANES + lane];
                    }
                }
                left &= !same;
                // No direction above the surface says nothing: open.
                let part = if all > 0.0 { visible / all } else { 1.0 };
                for lane in (0..LANES).filter(|lane| same >> lane & 1 == 1) {
                    let reaching = &mut reaching[block * LANES + lane];
                    *reaching = if times { *reaching * part } else { part };
                }
            }
        }
    }
}

/// Which turn of the light's samples a pixel has: neighbours lie far apart (Roberts' R₂ sequence).
pub(crate) fn turn(x: u32, y: u32) -> u32 {
    let at = x.wrapping_mul(0xc13f_a9a9).wrapping_add(y.wrapping_mul(0x91e1_0da5));
    at >> (32 - TURNS.ilog2())
}

/// The ten bits of `v`, two zeros between each.
fn spread(v: u32) -> u32 {
    let v = (v | v << 16) & 0x0300_00ff;
    let v = (v | v << 8) & 0x0300_f00f;
    let v = (v | v << 4) & 0x030c_30c3;
    (v | v << 2) & 0x0924_9249
}

/// The part of a round light's strength that falls on a surface at cosine `cosine` from its middle.
#[inline(always)]
fn lit<S: Simd>(simd: S, cosine: f32x16<S>, sin_half_angle: f32x16<S>) -> f32x16<S> {
    let rising = (cosine + sin_half_angle).max(f32x16::splat(simd, 0.0));
    let setting = rising * rising * 0.25 / sin_half_angle;
    cosine.simd_ge(sin_half_angle).select(cosine, setting)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_sets_smoothly() {
        let all = |cosine: f32, sine: f32| {
            let level = fearless_simd::Level::new();
            fearless_simd::dispatch!(level, simd => {
                lit(simd, f32x16::splat(simd, cosine), f32x16::splat(simd, sine))[3]
            })
        };
        let s = 0.2;
        assert_eq!(all(1.0, s), 1.0);
        assert_eq!(all(-0.3, s), 0.0);
        assert!((all(0.2 - 1e-6, s) - 0.2).abs() < 1e-5);
        assert!((all(0.0, s) - 0.05).abs() < 1e-7);
        assert_eq!(all(0.3, 1e-6), 0.3);
        assert_eq!(all(-0.3, 1e-6), 0.0);
    }
}
