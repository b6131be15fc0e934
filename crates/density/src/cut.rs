//! Sections: the liquid cut open by planes.
//!
//! The field is that of the whole liquid, and rays are cut: what a clip leaves out of a ray is empty, whatever the field
//! says. Where it begins or ends in the liquid there is a cap, a surface with the plane's normal. An open cut has
//! no surface there: light goes straight through it.

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use motes_grid::{Clip, Cut, Face, Plane, Stretch};

use crate::field::Field;
use crate::lattice::Lattice;
use crate::march;
use crate::rays::{Hits, LIQUID, OUTSIDE, Rays};
use crate::space::Space;

/// What rays set out from lies less than so many voxels behind them.
const NEAR: f32 = 0.01;

/// Cuts, in voxels.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cuts {
    clip: Clip,
    faces: Vec<Face>,
}

/// A ray that goes on, from a distance on, in one of its stretches.
struct Going {
    ray: usize,
    from: f32,
    stretch: usize,
    last: usize,
}

/// What fields are cut by, and where.
#[derive(Clone, Copy)]
pub(crate) struct Body<'a> {
    pub field: &'a Field,
    pub space: &'a Space,
    pub cuts: Option<&'a Cuts>,
    pub level: Level,
}

impl Cuts {
    /// A clip given about the origin of the particles, for a field with this lattice.
    pub fn new(clip: &Clip, lattice: &Lattice) -> Self {
        let in_voxels = |face: &mut Face| {
            let Plane { normal, offset } = face.plane;
            face.plane.offset = (offset - normal.dot(lattice.low)) / lattice.voxel;
        };
        let mut clip = clip.clone();
        clip.clauses.iter_mut().flat_map(|c| &mut c.faces).for_each(in_voxels);
        let faces = clip.faces().copied().collect();
        Self { clip, faces }
    }

    /// The number of a face, counted from 1.
    fn number(&self, face: Option<Face>) -> u32 {
        let place = face.and_then(|face| self.faces.iter().position(|own| *own == face));
        place.map_or(0, |place| place as u32 + 1)
    }

    /// The normal of a face, by its number.
    pub fn normal(&self, number: u32) -> Vec3 {
        self.faces[number as usize - 1].plane.normal
    }

    /// Whether a face, by its number, is open.
    pub fn is_open(&self, number: u32) -> bool {
        self.faces[number as usize - 1].cut == Cut::Open
    }
}

impl Body<'_> {
    /// The medium at a place, in voxels.
    pub fn medium(&self, place: Vec3) -> u32 {
        let kept = self.cuts.is_none_or(|cuts| cuts.clip.keeps(place, 0.0));
        let wet = kept && self.field.at(place) >= self.space.threshold;
        if wet { LIQUID } else { OUTSIDE }
    }

    /// What of the whole liquid holds a place; `None`: nothing.
    fn holds(&self, place: Vec3) -> Option<u32> {
        if self.field.at(place) >= self.space.threshold {
            return Some(LIQUID);
        }
        let cells = self.space.cells;
        let cell = place.floor();
        let inside = (0..3).all(|a| cell[a] >= 0.0 && (cell[a] as usize) < cells[a]);
        let cell = inside.then(|| cell.to_array().map(|c| c as usize))?;
        self.space.drops.around(cell, place, LIQUID)
    }

    /// Finds what all rays meet.
    pub fn march(&self, rays: &mut Rays, hits: &mut Hits) {
        let within = (self.field, self.space);
        match self.cuts {
            None => dispatch!(self.level, simd => march::march(simd, within, rays, hits)),
            Some(cuts) => self.march_cut(cuts, rays, hits),
        }
    }

    fn march_cut(&self, cuts: &Cuts, rays: &Rays, hits: &mut Hits) {
        hits.clear(rays.len());
        let (mut stretches, mut own) = (Vec::new(), Vec::new());
        let mut going = Vec::new();
        for ray in 0..rays.len() {
            let line = (rays.origin(ray), rays.direction(ray));
            cuts.clip.stretches(line, (0.0, f32::INFINITY), &mut own);
            own.retain(|stretch: &Stretch| stretch.end > NEAR);
            let first = stretches.len();
            stretches.append(&mut own);
            let go = Going { ray, from: 0.0, stretch: first, last: stretches.len() };
            let begins = stretches.get(first).map_or(f32::INFINITY, |s| s.begin);
            if rays.medium[ray] != OUTSIDE || begins <= NEAR {
                going.push(go);
            } else {
                going.extend(self.enter(cuts, (line, &stretches), go, hits));
            }
        }
        let (mut some, mut found) = (Rays::default(), Hits::default());
        while !going.is_empty() {
            some.clear();
            for Going { ray, from, .. } in &going {
                let (origin, direction) = (rays.origin(*ray), rays.direction(*ray));
                some.push(origin + direction * *from, direction, rays.medium[*ray]);
            }
            let within = (self.field, self.space);
            dispatch!(self.level, simd => march::march(simd, within, &mut some, &mut found));
            let mut next = Vec::new();
            for (i, go) in going.into_iter().enumerate() {
                let (ray, distance) = (go.ray, go.from + found.distance[i]);
                let stretch = stretches.get(go.stretch).filter(|_| go.stretch < go.last);
                let end = stretch.map_or(f32::INFINITY, |s| s.end);
                if distance <= end {
                    hits.distance[ray] = distance;
                    hits.surface[ray] = found.surface[i];
                } else if rays.medium[ray] != OUTSIDE {
                    hits.distance[ray] = end;
                    hits.cap[ray] = cuts.number(stretch.and_then(|s| s.leaves));
                } else {
                    let line = (rays.origin(ray), rays.direction(ray));
                    let go = Going { stretch: go.stretch + 1, ..go };
                    next.extend(self.enter(cuts, (line, &stretches), go, hits));
                }
            }
            going = next;
        }
    }

    /// A ray from outside comes into a stretch: it meets a cap there, or goes on.
    fn enter(
        &self,
        cuts: &Cuts,
        ((origin, direction), stretches): ((Vec3, Vec3), &[Stretch]),
        go: Going,
        hits: &mut Hits,
    ) -> Option<Going> {
        let stretch = stretches.get(go.stretch).filter(|_| go.stretch < go.last)?;
        let Some(surface) = self.holds(origin + direction * stretch.begin) else {
            return Some(Going { from: stretch.begin, ..go });
        };
        hits.distance[go.ray] = stretch.begin;
        hits.surface[go.ray] = surface;
        hits.cap[go.ray] = cuts.number(stretch.enters);
        None
    }
}
