//! Packet: what many rays meet, sixteen at a time.
//!
//! The walk of [`crate::march`] over blocks of columns, with the same hits, as steps of sixteen rays at once: each is in a
//! block or a column of its own, and where one has met something or left the picture the next takes its place. What is in
//! blocks and columns is fetched for each by itself; so is what is met in a column that is not plainly passed by.

use std::hint::black_box;

use fearless_simd::{Simd, dispatch, f32x16, i32x16, mask32x16, prelude::*, u16x16};
use fearless_simd_macros::simd;

use crate::Surfaces;
use crate::blocks::{Blocks, ENDS, LEVELS, Many, Places};
use crate::march::{Hit, Line, Ray, Walk};

const LANES: usize = 16;
const ALL: u32 = 0xffff;

type Floats = [f32; LANES];
type Ints = [i32; LANES];

/// A line of each of sixteen rays along one axis of the picture, see `march.rs`, and the pixel that it is in.
#[derive(Default)]
struct Axes {
    start: Floats,
    change: Floats,
    per_pixel: Floats,
    never: Floats,
    up: Ints,
    pixel: Ints,
    /// The one before.
    before: Ints,
}

/// Sixteen rays on their way.
#[derive(Default)]
struct Lanes {
    /// Which of the rays each is.
    ray: [u32; LANES],
    x: Axes,
    y: Axes,
    /// Nearness at the line's start, and its change to its end.
    start: Floats,
    change: Floats,
    /// How far along the line it is.
    u: Floats,
    /// Twice the level of the block that it is in; 0 in a column.
    shift: Ints,
    /// Those that are on their way, and those of them in their first column.
    active: u32,
    first: u32,
    step: Step,
}

/// What is found for one step.
#[derive(Default)]
struct Step {
    /// Where along the line the next wall is, and where the ray leaves its block or column.
    wall: Floats,
    end: Floats,
    /// Between what whole numbers its nearness is.
    low: Ints,
    high: Ints,
    /// The second words of records.
    second: Ints,
    /// Those in columns, those that pass by what is there, and those in a column with many surfaces of which that is to be found.
    in_column: u32,
    passes: u32,
    many: u32,
    /// Those that have met something.
    gone: u32,
}

/// Packets that go in step, so that what they fetch is fetched together.
const PACKETS: usize = 4;

/// What each of `rays` meets first, into `hits`; gives the number of columns that they went through.
pub fn march_together(
    (surfaces, blocks): (&Surfaces, &Blocks),
    rays: &[Ray],
    hits: &mut Vec<Option<Hit>>,
) -> u64 {
    hits.clear();
    hits.resize(rays.len(), None);
    let (mut lines, mut order) = (Vec::with_capacity(rays.len()), Vec::with_capacity(rays.len()));
    let mut columns = 0;
    for inside in [true, false] {
        lines.clear();
        order.clear();
        for (i, ray) in rays.iter().enumerate().filter(|(_, ray)| ray.inside == inside) {
            if let Some(line) = Line::new(surfaces, ray) {
                lines.push(line);
                order.push(i as u32);
            }
        }
        let of = Queue { surfaces, blocks, rays, lines: &lines, order: &order };
        columns += match inside {
            true => dispatch!(blocks.level, simd => walk_inside(simd, &of, hits)),
            false => dispatch!(blocks.level, simd => walk_outside(simd, &of, hits)),
        };
    }
    columns
}

/// Rays that are all inside or all outside.
struct Queue<'a> {
    surfaces: &'a Surfaces,
    blocks: &'a Blocks,
    rays: &'a [Ray],
    lines: &'a [Line],
    /// The ray of each line.
    order: &'a [u32],
}

#[simd]
fn walk_inside<S: Simd>(simd: S, of: &Queue<'_>, hits: &mut [Option<Hit>]) -> u64 {
    walk::<S, true>(simd, of, hits)
}

#[simd]
fn walk_outside<S: Simd>(simd: S, of: &Queue<'_>, hits: &mut [Option<Hit>]) -> u64 {
    walk::<S, false>(simd, of, hits)
}

#[inline(always)]
fn walk<S: Simd, const INSIDE: bool>(simd: S, of: &Queue<'_>, hits: &mut [Option<Hit>]) -> u64 {
    let mut packets: [Lanes; PACKETS] = Default::default();
    let (mut next, mut columns) = (0, 0);
    loop {
        let mut active = 0;
        for lanes in &mut packets {
            while lanes.active != ALL && next < of.lines.len() {
                lanes.put(of, next);
                next += 1;
            }
            active |= lanes.active;
        }
        if active == 0 {
            return columns;
        }
        for lanes in packets.iter_mut().filter(|lanes| lanes.active != 0) {
            look::<S, INSIDE>(simd, lanes, of);
            columns += u64::from(lanes.step.in_column.count_ones());
        }
        for lanes in packets.iter_mut().filter(|lanes| lanes.active != 0) {
            lanes.look_at_many::<S, INSIDE>(simd, of.blocks);
        }
        meet::<INSIDE>(&mut packets, of, hits);
        for lanes in packets.iter_mut().filter(|lanes| lanes.active != 0) {
            go_on(simd, lanes, of.surfaces.view.size);
        }
    }
}

#[inline(always)]
fn lane_of(bits: u32) -> usize {
    bits.trailing_zeros() as usize % LANES
}

impl Axes {
    #[inline(always)]
    fn go<S: Simd>(
        &mut self,
        simd: S,
        moving: mask32x16<S>,
        (before, next): (i32x16<S>, i32x16<S>),
    ) {
        moving.select(before, i32x16::from_slice(simd, &self.before)).store_slice(&mut self.before);
        moving.select(next, i32x16::from_slice(simd, &self.pixel)).store_slice(&mut self.pixel);
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, axis: &crate::march::Axis, most: i32) {
        self.start[lane] = axis.start;
        self.change[lane] = axis.change;
        self.per_pixel[lane] = axis.per_pixel;
        self.never[lane] = axis.never;
        self.up[lane] = axis.up;
        self.pixel[lane] = (axis.start as i32).clamp(0, most - 1);
    }
}

impl Lanes {
    /// Line number `i` of a queue takes the first free place.
    #[inline(always)]
    fn put(&mut self, of: &Queue<'_>, i: usize) {
        let lane = lane_of(!self.active);
        let line = &of.lines[i];
        let [width, height] = [of.surfaces.view.size.0 as i32, of.surfaces.view.size.1 as i32];
        self.ray[lane] = i as u32;
        self.x.put(lane, &line.x, width);
        self.y.put(lane, &line.y, height);
        self.start[lane] = line.start;
        self.change[lane] = line.change;
        self.u[lane] = 0.0;
        self.shift[lane] = 0;
        self.active |= 1 << lane;
        self.first |= 1 << lane;
    }
}

/// An axis of sixteen rays.
struct Axis16<S: Simd> {
    start: f32x16<S>,
    change: f32x16<S>,
    per_pixel: f32x16<S>,
    never: f32x16<S>,
    up: i32x16<S>,
    pixel: i32x16<S>,
    border: i32x16<S>,
}

impl<S: Simd> Axis16<S> {
    #[inline(always)]
    fn load(simd: S, of: &Axes, shift: i32x16<S>) -> Self {
        let pixel = i32x16::from_slice(simd, &of.pixel);
        let up = i32x16::from_slice(simd, &of.up);
        Self {
            start: f32x16::from_slice(simd, &of.start),
            change: f32x16::from_slice(simd, &of.change),
            per_pixel: f32x16::from_slice(simd, &of.per_pixel),
            never: f32x16::from_slice(simd, &of.never),
            up,
            pixel,
            border: ((pixel >> shift) + up) << shift,
        }
    }

    #[inline(always)]
    fn select(simd: S, mask: mask32x16<S>, a: &Self, b: &Self) -> Self {
        let _ = simd;
        Self {
            start: mask.select(a.start, b.start),
            change: mask.select(a.change, b.change),
            per_pixel: mask.select(a.per_pixel, b.per_pixel),
            never: mask.select(a.never, b.never),
            up: mask.select(a.up, b.up),
            pixel: mask.select(a.pixel, b.pixel),
            border: mask.select(a.border, b.border),
        }
    }

    #[inline(always)]
    fn reaches(&self, place: i32x16<S>) -> f32x16<S> {
        let place: f32x16<S> = place.to_float();
        (place - self.start) * self.per_pixel + self.never
    }

    /// As `Axis::last_pixel`, for those of `going`.
    #[inline(always)]
    fn last_pixel(
        &self,
        simd: S,
        (wall, shift): (f32x16<S>, i32x16<S>),
        (first, going): (mask32x16<S>, mask32x16<S>),
    ) -> i32x16<S> {
        let [zero, one] = [i32x16::splat(simd, 0), i32x16::splat(simd, 1)];
        let step = self.up + self.up - one;
        let edge = one << shift;
        let low = (self.pixel >> shift) << shift;
        let high = low + edge - one;
        let end = self.border - self.up;
        let margin = f32x16::splat(simd, 4.0);
        let (low_f, high_f): (f32x16<S>, f32x16<S>) = (low.to_float(), high.to_float());
        let at = (self.start + self.change * wall).max(low_f - margin).min(high_f + margin);
        let at: i32x16<S> = at.to_int();
        let guess = (at - step - step).max(low).min(high);
        let ahead = ((guess - self.pixel) * step).simd_gt(zero);
        let mut last = ahead.select(guess, self.pixel);
        // The guess is two pixels short: four at once are mostly all.
        let mut place = last + self.up;
        let mut crossed = zero;
        let mut all = going;
        for _ in 0..4 {
            let next = self.reaches(place);
            all = next.simd_lt(wall) | (first & next.simd_eq(wall));
            crossed += all.select(one, zero);
            place += step;
        }
        last = (last + crossed * step).max(low).min(high);
        let mut going = going & all & !last.simd_eq(end);
        while going.any_true() {
            let next = self.reaches(last + self.up);
            going &= next.simd_lt(wall) | (first & next.simd_eq(wall));
            last = going.select(last + step, last);
            going &= !last.simd_eq(end);
        }
        last
    }
}

/// Finds which rays pass by what is in their blocks and columns.
#[inline(always)]
fn look<S: Simd, const INSIDE: bool>(simd: S, lanes: &mut Lanes, of: &Queue<'_>) {
    let [zero, one] = [i32x16::splat(simd, 0), i32x16::splat(simd, 1)];
    let shift = i32x16::from_slice(simd, &lanes.shift);
    let x = Axis16::load(simd, &lanes.x, shift);
    let y = Axis16::load(simd, &lanes.y, shift);
    let wall = x.reaches(x.border).min(y.reaches(y.border));
    let u = f32x16::from_slice(simd, &lanes.u);
    let start = f32x16::from_slice(simd, &lanes.start);
    let change = f32x16::from_slice(simd, &lanes.change);
    let end = wall.max(u).min(f32x16::splat(simd, 1.0));
    let (q, q_end) = (start + change * u, start + change * end);
    let low = whole(simd, q.min(q_end), of.blocks.scale);
    let high = whole(simd, q.max(q_end), of.blocks.scale);
    let at = place(simd, &of.blocks.places[usize::from(INSIDE)], (x.pixel, y.pixel, shift));
    let at = mask32x16::from_bitmask(simd, u64::from(lanes.active)).select(at, zero);
    let [first, second] = fetch(simd, &of.blocks.records, at);
    let half = i32x16::splat(simd, 0xffff);
    let [a, b] = [first & half, second & half];
    let [d, c] = [(first >> 16_u32) & half, (second >> 16_u32) & half];
    let few = (d & one).simd_eq(zero);
    let passes = match INSIDE {
        true => {
            let back = (d + one).simd_lt(low) & high.simd_lt(c);
            ((b.simd_lt(low) & high.simd_lt(a)) | back) & few
        }
        false => a.simd_lt(low) | high.simd_lt(d) | (c.simd_lt(low) & high.simd_lt(b) & few),
    };
    let going = lanes.active & !lanes.first;
    let step = &mut lanes.step;
    step.in_column = shift.simd_eq(zero).to_bitmask() as u32 & lanes.active;
    step.passes = passes.to_bitmask() as u32 & going;
    step.many = step.in_column & going & !step.passes & !(few.to_bitmask() as u32);
    wall.store_slice(&mut step.wall);
    end.store_slice(&mut step.end);
    low.store_slice(&mut step.low);
    high.store_slice(&mut step.high);
    second.store_slice(&mut step.second);
}

impl Lanes {
    /// Finds the same of columns with many surfaces.
    #[inline(always)]
    fn look_at_many<S: Simd, const INSIDE: bool>(&mut self, simd: S, blocks: &Blocks) {
        let step = &mut self.step;
        while step.many != 0 {
            let lane = lane_of(step.many);
            step.many &= step.many - 1;
            let all = &blocks.many[(self.y.pixel[lane] >> 2) as usize];
            if let Some(all) = all.get(step.second[lane] as u32 as usize) {
                let range = [step.low[lane] as u16, step.high[lane] as u16];
                step.passes |= u32::from(passes_many::<S, INSIDE>(simd, all, range)) << lane;
            }
        }
    }
}

/// Finds what is met in columns that are not passed by.
#[inline(always)]
fn meet<const INSIDE: bool>(
    packets: &mut [Lanes; PACKETS],
    of: &Queue<'_>,
    hits: &mut [Option<Hit>],
) {
    let width = of.surfaces.view.size.0 as usize;
    let mut first = [0; PACKETS * LANES];
    let mut count = 0;
    for lanes in &*packets {
        let mut met = lanes.active & lanes.step.in_column & !lanes.step.passes;
        while met != 0 {
            let lane = lane_of(met);
            met &= met - 1;
            let column = lanes.y.pixel[lane] as usize * width + lanes.x.pixel[lane] as usize;
            first[count % (PACKETS * LANES)] = of.surfaces.of(column).start;
            count += 1;
        }
    }
    // So that waiting for memory is done for all together.
    for first in &first[..count] {
        let nearness = of.surfaces.nearness.get(*first).map_or(0, |n| n.to_bits());
        black_box(nearness ^ of.surfaces.normals.get(*first).copied().unwrap_or(0));
    }
    for lanes in packets {
        let mut met = lanes.active & lanes.step.in_column & !lanes.step.passes;
        lanes.step.gone = 0;
        while met != 0 {
            let lane = lane_of(met);
            met &= met - 1;
            let i = lanes.ray[lane] as usize;
            let ray = of.order[i] as usize;
            let walk = Walk { surfaces: of.surfaces, ray: &of.rays[ray], line: of.lines[i] };
            let hit = lanes.hit::<INSIDE>(lane, &walk);
            if hit.is_some() {
                hits[ray] = hit;
                lanes.step.gone |= 1 << lane;
            }
        }
        lanes.first = 0;
    }
}

impl Lanes {
    /// What is met in a ray's column.
    #[inline(always)]
    fn hit<const INSIDE: bool>(&self, lane: usize, walk: &Walk<'_>) -> Option<Hit> {
        let first = self.first >> lane & 1 == 1;
        let before = (!first).then(|| [self.x.before[lane], self.y.before[lane]]);
        let pixel = [self.x.pixel[lane], self.y.pixel[lane]];
        walk.look_into::<INSIDE>(pixel, ([self.u[lane], self.step.end[lane]], before), first)
    }
}

/// Goes on to the next columns and blocks, or to what is smaller where something may be met.
#[inline(always)]
fn go_on<S: Simd>(simd: S, lanes: &mut Lanes, (width, height): (u32, u32)) {
    let [zero, one] = [i32x16::splat(simd, 0), i32x16::splat(simd, 1)];
    let two = one + one;
    let shift = i32x16::from_slice(simd, &lanes.shift);
    let x = Axis16::load(simd, &lanes.x, shift);
    let y = Axis16::load(simd, &lanes.y, shift);
    let wall = f32x16::from_slice(simd, &lanes.step.wall);
    let down = y.reaches(y.border).simd_lt(x.reaches(x.border));
    let Step { in_column, passes, mut gone, .. } = lanes.step;
    let moving = (passes | in_column) & !gone;
    let over = wall.simd_ge(f32x16::splat(simd, 1.0));
    gone |= over.to_bitmask() as u32 & moving;
    let moving = mask32x16::from_bitmask(simd, u64::from(moving & !gone));
    // Along the one axis to the wall, along the other as far as it comes until then.
    let along = Axis16::select(simd, down, &x, &y);
    let last = along.last_pixel(simd, (wall, shift), (down, moving));
    let before_x = down.select(last, x.border - x.up);
    let before_y = down.select(y.border - y.up, last);
    let next_x = down.select(before_x, before_x + x.up + x.up - one);
    let next_y = down.select(before_y + y.up + y.up - one, before_y);
    let left = next_x.simd_lt(zero)
        | next_y.simd_lt(zero)
        | next_x.simd_ge(i32x16::splat(simd, width as i32))
        | next_y.simd_ge(i32x16::splat(simd, height as i32));
    gone |= (left & moving).to_bitmask() as u32;
    let crossed = down.select(next_y + one - y.up, next_x + one - x.up);
    let wider = (one << (shift + two)) - one;
    let enters =
        (crossed & wider).simd_eq(zero) & shift.simd_lt(i32x16::splat(simd, 2 * LEVELS as i32));
    let wider = enters.select(shift + two, shift);
    moving.select(wider, (shift - two).max(zero)).store_slice(&mut lanes.shift);
    let end = f32x16::from_slice(simd, &lanes.step.end);
    moving.select(end, f32x16::from_slice(simd, &lanes.u)).store_slice(&mut lanes.u);
    lanes.x.go(simd, moving, (before_x, next_x));
    lanes.y.go(simd, moving, (before_y, next_y));
    lanes.active &= !gone;
}

/// Whether a ray in a range of nearness meets none of a column's surfaces.
#[inline(always)]
fn passes_many<S: Simd, const INSIDE: bool>(simd: S, all: &Many, [low, high]: [u16; 2]) -> bool {
    let all = u16x16::from_slice(simd, all);
    let before = all.simd_gt(u16x16::splat(simd, high)).to_bitmask() as u32;
    let behind = all.simd_lt(u16x16::splat(simd, low)).to_bitmask() as u32;
    before | behind == ALL && (before.count_ones() % 2 == 1) == INSIDE
}

/// Nearness as in records.
#[inline(always)]
fn whole<S: Simd>(simd: S, nearness: f32x16<S>, [zero, per_unit]: [f32; 2]) -> i32x16<S> {
    let [least, most] = ENDS;
    let scaled = (nearness - f32x16::splat(simd, zero)) * f32x16::splat(simd, per_unit);
    let scaled = scaled.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, most as f32));
    let whole: i32x16<S> = scaled.to_int();
    (whole + i32x16::splat(simd, least)).min(i32x16::splat(simd, most))
}

/// The places of the records of columns or blocks.
#[inline(always)]
fn place<S: Simd>(
    simd: S,
    places: &Places,
    (x, y, shift): (i32x16<S>, i32x16<S>, i32x16<S>),
) -> i32x16<S> {
    let mut first = i32x16::splat(simd, places.first[0]);
    let mut across = i32x16::splat(simd, places.across[0]);
    for level in 1..=LEVELS as usize {
        let is = shift.simd_eq(i32x16::splat(simd, 2 * level as i32));
        first = is.select(i32x16::splat(simd, places.first[level]), first);
        across = is.select(i32x16::splat(simd, places.across[level]), across);
    }
    let (x, y) = (x >> shift, y >> shift);
    let three = i32x16::splat(simd, 3);
    let block = (y >> 2_u32) * across + (x >> 2_u32);
    first + (block << 4_u32) + ((y & three) << 2_u32) + (x & three)
}

/// The words of the records at some places.
#[inline(always)]
fn fetch<S: Simd>(simd: S, records: &[[u32; 2]], at: i32x16<S>) -> [i32x16<S>; 2] {
    let mut places = [0; LANES];
    at.store_slice(&mut places);
    let mut words = [[0; LANES]; 2];
    for lane in 0..LANES {
        let [first, second] = records[places[lane] as usize];
        (words[0][lane], words[1][lane]) = (first as i32, second as i32);
    }
    [i32x16::from_slice(simd, &words[0]), i32x16::from_slice(simd, &words[1])]
}
