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

use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_scene::Projection;

use crate::Surfaces;
use crate::blocks::{Blocks, LEVELS, edge};

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

/// A ray as a line over the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub x: Axis,
    pub y: Axis,
    /// Nearness at its start, and its change to its end.
    pub start: f32,
    pub change: f32,
}

/// A line along one axis of the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    /// Its place at its start, and its change to its end.
    pub start: f32,
    pub change: f32,
    /// What the way along the line grows by over a pixel; 0 if it stays in its pixel.
    pub per_pixel: f32,
    /// Then infinite, else 0.
    pub never: f32,
    /// 1 if pixels go up, else 0.
    pub up: i32,
}

/// Lines shorter than this many pixels stay in their column.
const SHORT: f32 = 1e-4;

impl Axis {
    fn new(start: f32, end: f32) -> Self {
        let change = end - start;
        let short = change.abs() < SHORT;
        Self {
            start,
            change,
            per_pixel: if short { 0.0 } else { 1.0 / change },
            never: if short { f32::INFINITY } else { 0.0 },
            up: i32::from(change > 0.0),
        }
    }

    #[inline(always)]
    fn at(&self, u: f32) -> f32 {
        self.start + self.change * u
    }

    /// Where along the line it comes to the wall before pixel `place`.
    #[inline(always)]
    fn reaches(&self, place: i32) -> f32 {
        (place as f32 - self.start) * self.per_pixel + self.never
    }

    /// The wall at which it leaves the cell of the level that `pixel` is in.
    #[inline(always)]
    fn border(&self, pixel: i32, level: u32) -> i32 {
        ((pixel >> (2 * level)) + self.up) << (2 * level)
    }

    /// +1 or −1.
    #[inline(always)]
    fn step(&self) -> i32 {
        2 * self.up - 1
    }

    /// Whether a pixel that it steps to is the first one of a cell of the level.
    #[inline(always)]
    fn enters(&self, pixel: i32, level: u32) -> bool {
        (pixel + 1 - self.up) & (edge(level) - 1) == 0
    }

    /// The last pixel, before the line leaves a cell of the level through a wall of the other axis at `wall`: the
    /// one that a walk from column to column comes to. `pixel` is one before. Of two walls at one place the
    /// first axis is crossed first, so that `first` says whether this one is.
    #[inline(always)]
    fn last_pixel(&self, pixel: i32, (wall, level): (f32, u32), first: bool) -> i32 {
        let step = self.step();
        let border = self.border(pixel, level);
        let end = border - self.up;
        // Near to it by arithmetic, then exactly.
        let least = border - self.up * edge(level);
        let guess = (self.at(wall) as i32 - 2 * step).clamp(least, least + edge(level) - 1);
        let mut last = if (guess - pixel) * step > 0 { guess } else { pixel };
        while last != end {
            let next = self.reaches(last + self.up);
            let crossed = if first { next <= wall } else { next < wall };
            if !crossed {
                break;
            }
            last += step;
        }
        last
    }
}

impl Line {
    /// The part of `ray` between the near and the far plane.
    #[inline(always)]
    pub fn new(surfaces: &Surfaces, ray: &Ray) -> Option<Self> {
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
                Vec3::new(rays.center[0] + v.x * q, rays.center[1] + v.y * q, q)
            }
            Projection::Orthographic => Vec3::new(rays.center[0] + v.x, rays.center[1] + v.y, -v.z),
        };
        if reach.is_nan() || reach <= 0.0 {
            return None;
        }
        let (start, end) = (on_picture(p), on_picture(p + d * reach));
        (start.is_finite() && end.is_finite()).then(|| Self {
            x: Axis::new(start.x, end.x),
            y: Axis::new(start.y, end.y),
            start: start.z,
            change: end.z - start.z,
        })
    }

    #[inline(always)]
    fn nearness(&self, u: f32) -> f32 {
        self.start + self.change * u
    }
}

/// The first surface that `ray` meets, and the number of columns it went through.
pub fn march(surfaces: &Surfaces, ray: &Ray) -> (Option<Hit>, u32) {
    march_over((surfaces, None), ray)
}

/// As [`march`], with the same result, over the columns that cannot be skipped.
pub fn march_blocks((surfaces, blocks): (&Surfaces, &Blocks), ray: &Ray) -> (Option<Hit>, u32) {
    dispatch!(blocks.level, simd => march_with(simd, (surfaces, blocks), ray))
}

/// One ray needs no vectors, but is faster with the instructions that come with them.
#[simd]
fn march_with<S: Simd>(
    simd: S,
    (surfaces, blocks): (&Surfaces, &Blocks),
    ray: &Ray,
) -> (Option<Hit>, u32) {
    let _ = simd;
    march_over((surfaces, Some(blocks)), ray)
}

#[inline(always)]
fn march_over(of: (&Surfaces, Option<&Blocks>), ray: &Ray) -> (Option<Hit>, u32) {
    match Line::new(of.0, ray) {
        Some(line) if ray.inside => walk::<true>(of, ray, line),
        Some(line) => walk::<false>(of, ray, line),
        None => (None, 0),
    }
}

#[inline(always)]
fn walk<const INSIDE: bool>(
    (surfaces, blocks): (&Surfaces, Option<&Blocks>),
    ray: &Ray,
    line: Line,
) -> (Option<Hit>, u32) {
    let [width, height] = [surfaces.view.size.0 as i32, surfaces.view.size.1 as i32];
    let Line { x: across, y: down, .. } = line;
    // A start on the wall between two columns may be rounded to the other one.
    let mut x = (across.start as i32).clamp(0, width - 1);
    let mut y = (down.start as i32).clamp(0, height - 1);
    let walk = Walk { surfaces, ray, line };
    let (mut u, mut q, mut count, mut level) = (0.0_f32, line.start, 0, 0);
    let mut before = None;
    loop {
        let wall_x = across.reaches(across.border(x, level));
        let wall_y = down.reaches(down.border(y, level));
        let wall = lesser(wall_y, wall_x);
        let end = lesser(greater(wall, u), 1.0);
        let q_end = line.nearness(end);
        let range = [lesser(q, q_end), greater(q, q_end)];
        if level > 0 {
            let skips = blocks.is_some_and(|blocks| blocks.skips::<INSIDE>(level, [x, y], range));
            if !skips {
                level -= 1;
                continue;
            }
            // The wall is one of both.
            if wall_y < wall_x {
                x = across.last_pixel(x, (wall, level), true);
                y = down.border(y, level) - down.up;
            } else {
                y = down.last_pixel(y, (wall, level), false);
                x = across.border(x, level) - across.up;
            }
        } else {
            count += 1;
            let hit = walk.look_into::<INSIDE>([x, y], ([u, end], before), count == 1);
            if hit.is_some() {
                return (hit, count);
            }
        }
        if wall >= 1.0 {
            return (None, count);
        }
        before = Some([x, y]);
        (u, q) = (end, q_end);
        let enters = if wall_y < wall_x {
            y += down.step();
            down.enters(y, level + 1)
        } else {
            x += across.step();
            across.enters(x, level + 1)
        };
        if x < 0 || y < 0 || x >= width || y >= height {
            return (None, count);
        }
        if enters && level < LEVELS && blocks.is_some() {
            level += 1;
        }
    }
}

/// As `min` and `max`, without the care for what is no number.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

pub(crate) struct Walk<'a> {
    pub surfaces: &'a Surfaces,
    pub ray: &'a Ray,
    pub line: Line,
}

/// The surfaces of a column: the first one's number, and their nearness.
type Column<'a> = (usize, &'a [f32]);

impl<'a> Walk<'a> {
    /// Whether it is plain that nothing is met in a column in a range of nearness, low and high.
    #[inline(always)]
    fn passes_by<const INSIDE: bool>(&self, pixel: [i32; 2], [low, high]: [f32; 2]) -> bool {
        for span in self.surfaces_of(pixel).1.chunks_exact(2) {
            let [entry, exit] = [span[0], span[1]];
            if INSIDE && exit < low {
                return high < entry;
            }
            if !INSIDE && exit <= high {
                return entry < low;
            }
        }
        !INSIDE
    }

    /// As `column`, unless it is plain that there is nothing.
    #[inline(always)]
    pub fn look_into<const INSIDE: bool>(
        &self,
        pixel: [i32; 2],
        (way, before): ([f32; 2], Option<[i32; 2]>),
        first: bool,
    ) -> Option<Hit> {
        let [a, b] = way.map(|u| self.line.nearness(u));
        if !first && self.passes_by::<INSIDE>(pixel, [lesser(a, b), greater(a, b)]) {
            return None;
        }
        self.column(pixel, (way, before), first)
    }

    /// What is met in a column, between two places of the line. The column `before` is the last one.
    fn column(
        &self,
        pixel: [i32; 2],
        ([from, to], before): ([f32; 2], Option<[i32; 2]>),
        first: bool,
    ) -> Option<Hit> {
        let (start, list) = self.surfaces_of(pixel);
        let [q, end] = [self.line.nearness(from), self.line.nearness(to)];
        // How many surfaces lie before the ray's place: inside, if they are odd.
        let mut count = count_before(list, q);
        let own = self.ray.from.filter(|own| first && (start..start + list.len()).contains(own));
        if let Some(own) = own {
            // Of its own surface the ray is on the side that it goes to.
            count = own - start + usize::from(end < q);
        } else if !first && (count % 2 == 1) != self.ray.inside {
            let hit = self.wall((start, list), count, (before, from));
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
                let u = (list[next] - self.line.start) / self.line.change;
                let hit = self.hit(start + next, u);
                if hit.is_some() {
                    return hit;
                }
            }
        }
    }

    #[inline(always)]
    fn surfaces_of(&self, [x, y]: [i32; 2]) -> Column<'a> {
        let of = self.surfaces.of(y as usize * self.surfaces.view.size.0 as usize + x as usize);
        (of.start, &self.surfaces.nearness[of])
    }

    /// The wall of a column that is met at `u`: with the normal of the nearest surface in this column or
    /// the one before.
    fn wall(
        &self,
        (start, list): Column<'_>,
        count: usize,
        (before, u): (Option<[i32; 2]>, f32),
    ) -> Option<Hit> {
        let q = self.line.nearness(u);
        let here = nearest(list, count, q).map(|i| start + i);
        let there = before.and_then(|pixel| {
            let (start, list) = self.surfaces_of(pixel);
            nearest(list, count_before(list, q), q).map(|i| start + i)
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
        let Line { x, y, .. } = &self.line;
        let point = self.surfaces.view.point([x.at(u), y.at(u)], self.line.nearness(u));
        let distance = point.distance(self.ray.origin);
        Some(Hit { point, surface, normal: towards, distance })
    }
}

/// How many surfaces of a column lie before a nearness.
#[inline]
fn count_before(list: &[f32], q: f32) -> usize {
    list.iter().take_while(|n| **n > q).count()
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
