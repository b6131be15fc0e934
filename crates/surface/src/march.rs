//! March: what a ray meets, column by column.
//!
//! Zirr & Dachsbacher 2015, §3.5, Fig. 4 and Listing 2. A line in the world is a line in the picture, and
//! along it nearness (see [`crate::filter::nearness`]) is linear, too, so that in a column the ray passes
//! the surfaces whose nearness lies between its own where it enters and where it leaves. Where it is on
//! another side of the surface when it enters a column than it was before, it went through the wall between
//! the columns.
//!
//! Columns are steps where the surface is smooth. A ray that leaves a surface, or goes along it, would hit
//! the next step; so what is met must be met from the right side of its normal, or it is passed over.

use glam::Vec3;
use motes_scene::Projection;

use crate::Surfaces;
use crate::blocks::{Blocks, EDGE};

/// A ray, where it starts from and whether that is in the liquid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Whether it starts inside the liquid.
    pub inside: bool,
    /// The surface it starts from, which it does not meet again.
    pub from: Option<usize>,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The point.
    pub point: Vec3,
    /// The surface.
    pub surface: usize,
    /// Its unit normal, towards where the ray comes from.
    pub normal: Vec3,
    /// Distance from the ray's start.
    pub distance: f32,
}

/// A ray as a line over the picture: place and nearness at its start and their change to its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    start: [f32; 3],
    change: [f32; 3],
    /// What the way along the line grows by over a pixel, for both axes of the picture.
    per_pixel: [f32; 2],
}

/// Lines shorter than this many pixels stay in their column.
const SHORT: f32 = 1e-4;

impl Line {
    /// The part of `ray` between the near and the far plane.
    fn new(surfaces: &Surfaces, ray: &Ray) -> Option<Self> {
        let view = &surfaces.view;
        let rays = &view.rays;
        let scale = 1.0 / rays.pixel;
        let from = ray.origin - rays.origin;
        let along = |v: Vec3| {
            Vec3::new(v.dot(rays.right) * scale, -v.dot(rays.up) * scale, v.dot(rays.forward))
        };
        let (p, d) = (along(from), along(ray.direction));
        // The near plane may be touched by what was clipped there.
        let reach = if d.z > 0.0 { (view.far - p.z) / d.z } else { (view.near - p.z) / d.z };
        let whole = 2.0 * (view.far + from.length());
        let reach = if d.z == 0.0 { whole } else { reach.min(whole) };
        let on_picture = |v: Vec3| match rays.projection {
            Projection::Perspective => {
                let q = 1.0 / v.z;
                [rays.center[0] + v.x * q, rays.center[1] + v.y * q, q]
            }
            Projection::Orthographic => [rays.center[0] + v.x, rays.center[1] + v.y, -v.z],
        };
        if reach.is_nan() || reach <= 0.0 {
            return None;
        }
        let (start, end) = (on_picture(p), on_picture(p + d * reach));
        let finite = start.iter().chain(&end).all(|x| x.is_finite());
        finite.then(|| {
            let change = [0, 1, 2].map(|i| end[i] - start[i]);
            Self { start, change, per_pixel: [0, 1].map(|i| 1.0 / change[i]) }
        })
    }

    #[inline]
    fn at(&self, u: f32) -> [f32; 3] {
        [0, 1, 2].map(|i| self.start[i] + self.change[i] * u)
    }

    /// Where along the line it comes to `place` of an axis of the picture.
    #[inline]
    fn reaches(&self, axis: usize, place: f32) -> f32 {
        if self.change[axis].abs() < SHORT {
            return f32::INFINITY;
        }
        (place - self.start[axis]) * self.per_pixel[axis]
    }
}

/// Where the surfaces of a column are looked up.
trait Columns {
    /// The nearness of the surfaces of the column (x, y).
    fn column(&self, pixel: [usize; 2]) -> &[f32];
    /// Blocks to skip.
    fn blocks(&self) -> Option<&Blocks>;
}

impl Columns for Surfaces {
    #[inline]
    fn column(&self, [x, y]: [usize; 2]) -> &[f32] {
        &self.nearness[self.of(y * self.view.size.0 as usize + x)]
    }

    fn blocks(&self) -> Option<&Blocks> {
        None
    }
}

impl Columns for Blocks {
    #[inline]
    fn column(&self, pixel: [usize; 2]) -> &[f32] {
        self.column(pixel)
    }

    fn blocks(&self) -> Option<&Blocks> {
        Some(self)
    }
}

/// The first surface that `ray` meets, and the number of columns it went through.
pub fn march(surfaces: &Surfaces, ray: &Ray) -> (Option<Hit>, u32) {
    march_over((surfaces, surfaces), ray)
}

/// As [`march`], with the same result, over the columns that cannot be skipped.
pub fn march_blocks((surfaces, blocks): (&Surfaces, &Blocks), ray: &Ray) -> (Option<Hit>, u32) {
    march_over((surfaces, blocks), ray)
}

fn march_over<C: Columns>((surfaces, columns): (&Surfaces, &C), ray: &Ray) -> (Option<Hit>, u32) {
    let Some(line) = Line::new(surfaces, ray) else { return (None, 0) };
    let size = [surfaces.view.size.0 as i32, surfaces.view.size.1 as i32];
    let at = [line.start[0].floor() as i32, line.start[1].floor() as i32];
    // A start on the wall between two columns may be rounded to the other one.
    let mut pixel = [0, 1].map(|i| at[i].clamp(0, size[i] - 1));
    let step = [0, 1].map(|i| if line.change[i] > 0.0 { 1 } else { -1 });
    let mut walk = Walk { surfaces, columns, ray, line, before: None };
    let (mut u, mut count, mut tried) = (0.0_f32, 0, [[-1; 2]; 2]);
    loop {
        if let Some(blocks) = columns.blocks().filter(|_| count > 0) {
            match line.skip((blocks, ray.inside), (pixel, u), (size, &mut tried)) {
                Skip::Not => {}
                Skip::Out => return (None, count),
                Skip::To { last, next, at } => {
                    walk.before = Some(last);
                    (pixel, u) = (next, at);
                    continue;
                }
            }
        }
        let next = [0, 1].map(|i| line.reaches(i, (pixel[i] + step[i].max(0)) as f32));
        let axis = usize::from(next[1] < next[0]);
        let end = next[axis].clamp(u, 1.0);
        count += 1;
        if let Some(hit) = walk.column(pixel, [u, end], count == 1) {
            return (Some(hit), count);
        }
        pixel[axis] += step[axis];
        if next[axis] >= 1.0 || pixel[axis] < 0 || pixel[axis] >= size[axis] {
            return (None, count);
        }
        u = end;
    }
}

/// Whether the rest of a block is skipped.
enum Skip {
    Not,
    /// The line ends in it, or the picture behind it.
    Out,
    /// Up to `at`, where the line goes from the pixel `last` to `next`.
    To {
        last: [i32; 2],
        next: [i32; 2],
        at: f32,
    },
}

impl Line {
    /// Whether the line meets nothing between `u`, where it is in `pixel`, and the end of that block: the
    /// largest that was not `tried` before.
    #[inline]
    fn skip(
        &self,
        of: (&Blocks, bool),
        from: ([i32; 2], f32),
        (size, tried): ([i32; 2], &mut [[i32; 2]; 2]),
    ) -> Skip {
        for level in [1, 0] {
            let edge = (EDGE as i32).pow(level as u32 + 1);
            let block = from.0.map(|p| p / edge);
            if tried[level] != block {
                tried[level] = block;
                match self.skip_block(of, from, (size, level)) {
                    Skip::Not => {}
                    skip => return skip,
                }
            }
        }
        Skip::Not
    }

    fn skip_block(
        &self,
        (blocks, inside): (&Blocks, bool),
        (pixel, u): ([i32; 2], f32),
        (size, level): ([i32; 2], usize),
    ) -> Skip {
        let edge = (EDGE as i32).pow(level as u32 + 1);
        let block = pixel.map(|p| p / edge);
        let step = [0, 1].map(|i| if self.change[i] > 0.0 { 1 } else { -1 });
        let border = [0, 1].map(|i| (block[i] + step[i].max(0)) * edge);
        let next = [0, 1].map(|i| self.reaches(i, border[i] as f32));
        let axis = usize::from(next[1] < next[0]);
        let at = next[axis].clamp(u, 1.0);
        let range = [u, at].map(|u| self.start[2] + self.change[2] * u);
        if !blocks.skips(level, block.map(|b| b as usize), (range, inside)) {
            return Skip::Not;
        }
        // The pixel on the other axis is the one that a walk from column to column comes to.
        let across = 1 - axis;
        let mut last = pixel;
        last[axis] = border[axis] - step[axis].max(0);
        // Near to it by arithmetic, then exactly.
        let guess = self.start[across] + self.change[across] * at;
        let guess = (guess.floor() as i32 - step[across] * 2)
            .clamp(block[across] * edge, block[across] * edge + edge - 1);
        if (guess - last[across]) * step[across] > 0 {
            last[across] = guess;
        }
        while last[across] != border[across] - step[across].max(0) {
            let wall = self.reaches(across, (last[across] + step[across].max(0)) as f32);
            // Of two walls at one place the first axis is crossed first.
            let crossed = if across == 0 { wall <= next[axis] } else { wall < next[axis] };
            if !crossed {
                break;
            }
            last[across] += step[across];
        }
        let mut next_pixel = last;
        next_pixel[axis] += step[axis];
        // A block at the picture's edge may reach beyond it, on both axes.
        let left = (0..2).any(|i| next_pixel[i] < 0 || next_pixel[i] >= size[i]);
        if next[axis] >= 1.0 || left {
            return Skip::Out;
        }
        Skip::To { last, next: next_pixel, at }
    }
}

struct Walk<'a, C> {
    surfaces: &'a Surfaces,
    columns: &'a C,
    ray: &'a Ray,
    line: Line,
    /// The last column.
    before: Option<[i32; 2]>,
}

impl<C: Columns> Walk<'_, C> {
    /// What is met in a column, between two places of the line.
    #[inline]
    fn column(&mut self, pixel: [i32; 2], [from, to]: [f32; 2], first: bool) -> Option<Hit> {
        let list = self.columns.column(pixel.map(|p| p as usize));
        let before = self.before.replace(pixel);
        if list.is_empty() && !self.ray.inside {
            return None;
        }
        let [q, end] = [from, to].map(|u| self.line.start[2] + self.line.change[2] * u);
        // How many surfaces lie before the ray's place: inside, if they are odd.
        let mut count = list.iter().take_while(|n| **n > q).count();
        let own = self.ray.from.filter(|_| first).and_then(|own| {
            let of = self.surfaces.of(self.index(pixel));
            of.contains(&own).then(|| own - of.start)
        });
        if let Some(own) = own {
            // Of its own surface the ray is on the side that it goes to.
            count = own + usize::from(end < q);
        } else if !first && (count % 2 == 1) != self.ray.inside {
            let hit = self.wall(pixel, (list, count), (before, from));
            if hit.is_some() {
                return hit;
            }
        }
        let away = end < q;
        loop {
            let next = if away { Some(count) } else { count.checked_sub(1) };
            let next = next.filter(|n| list.get(*n).is_some_and(|n| passes(*n, end, away)))?;
            count = if away { count + 1 } else { count - 1 };
            if (count % 2 == 1) != self.ray.inside {
                let u = (list[next] - self.line.start[2]) / self.line.change[2];
                let hit = self.hit(self.surfaces.of(self.index(pixel)).start + next, u);
                if hit.is_some() {
                    return hit;
                }
            }
        }
    }

    fn index(&self, pixel: [i32; 2]) -> usize {
        pixel[1] as usize * self.surfaces.view.size.0 as usize + pixel[0] as usize
    }

    /// The wall of a column that is met at `u`: with the normal of the nearest surface in this column or
    /// the one before.
    fn wall(
        &self,
        pixel: [i32; 2],
        (list, count): (&[f32], usize),
        (before, u): (Option<[i32; 2]>, f32),
    ) -> Option<Hit> {
        let q = self.line.start[2] + self.line.change[2] * u;
        let first = |pixel| self.surfaces.of(self.index(pixel)).start;
        let here = nearest(list, count, q).map(|i| first(pixel) + i);
        let there = before.and_then(|pixel| {
            let list = self.columns.column(pixel.map(|p| p as usize));
            let count = list.iter().take_while(|n| **n > q).count();
            nearest(list, count, q).map(|i| first(pixel) + i)
        });
        here.into_iter().chain(there).find_map(|surface| self.hit(surface, u))
    }

    /// The surface met at `u`, if it is met from its right side.
    fn hit(&self, surface: usize, u: f32) -> Option<Hit> {
        let normal = self.surfaces.normal(surface);
        let towards = if self.ray.inside { -normal } else { normal };
        if self.ray.direction.dot(towards) >= 0.0 {
            return None;
        }
        let [x, y, q] = self.line.at(u);
        let point = self.surfaces.view.point([x, y], q);
        let distance = point.distance(self.ray.origin);
        Some(Hit { point, surface, normal: towards, distance })
    }
}

#[inline]
fn passes(surface: f32, end: f32, away: bool) -> bool {
    if away { surface >= end } else { surface <= end }
}

/// The place in `list` of the surface nearest to `q`, before which there are `count`.
#[inline]
fn nearest(list: &[f32], count: usize, q: f32) -> Option<usize> {
    let before = count.checked_sub(1);
    let behind = Some(count).filter(|i| *i < list.len());
    match (before, behind) {
        (Some(a), Some(b)) => Some(if list[a] - q <= q - list[b] { a } else { b }),
        (a, b) => a.or(b),
    }
}
