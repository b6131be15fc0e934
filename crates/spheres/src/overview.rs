//! Where the blocks of the grids lie in the picture: found once for each frame, used by every tile.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::{Grid, Group, Seen, Visibility};
use motes_scene::{Projection, Rays};
use rayon::prelude::*;

use crate::packet::LANES;
use crate::traverse::Spheres;

/// Blocks of a group.
pub(crate) const GROUP: usize = 64;

/// The least distance of something from the eye, and the rectangle of the picture around it, pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub near: f32,
    pub x: (f32, f32),
    pub y: (f32, f32),
}

/// A group of blocks as the picture sees it.
#[repr(align(64))]
#[derive(Debug)]
pub(crate) struct GroupView {
    /// Which grid of its system, and where that grid's slots begin in the system.
    pub class: usize,
    pub first_slot: u32,
    /// All of it.
    pub whole: Extent,
    /// Each block: its place in the lattice, its least distance (+∞ where nothing is seen of it) and its
    /// rectangle: least and greatest x, least and greatest y.
    pub block: [u32; GROUP],
    /// Its particles, from the first to before the end; and whether only some of them are seen.
    pub first: [u32; GROUP],
    pub end: [u32; GROUP],
    pub mixed: u64,
    pub near: [f32; GROUP],
    pub rect: [[f32; GROUP]; 4],
}

/// The camera as constants of projection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    pub rays: Rays,
    /// Pixels for a slope of one, or for a unit of length.
    pub scale: f32,
    /// What rounding may add to lengths: every sphere is taken to be this much larger.
    pub pad: f32,
}

impl Lens {
    pub fn new(rays: &Rays, grid: &Grid) -> Self {
        let reach = grid.low.abs().max(grid.high.abs()).max_element()
            + rays.origin.abs().max_element()
            + grid.greatest_radius;
        Self { rays: *rays, scale: 1.0 / rays.pixel, pad: reach * 2e-6 }
    }
}

/// The groups of a system that may be seen.
pub(crate) fn overview<S: Simd>(simd: S, rays: &Rays, spheres: &Spheres<'_>) -> Vec<GroupView> {
    let mut views = Vec::new();
    let mut first_slot = 0;
    for (class, (grid, visible)) in spheres.classes.grids.iter().zip(spheres.visible).enumerate() {
        let lens = Lens::new(rays, grid);
        let of_class = grid.groups.par_iter().with_min_len(8).filter_map(|group| {
            let view = view_of(simd, &lens, (grid, visible), group)?;
            Some(GroupView { class, first_slot, ..view })
        });
        views.par_extend(of_class);
        first_slot += grid.len() as u32;
    }
    views
}

/// Sixteen boxes: middles, half edges and radii of the spheres in them.
#[repr(align(64))]
struct Boxes {
    middle: [[f32; LANES]; 3],
    half: [[f32; LANES]; 3],
    radius: [f32; LANES],
}

#[simd]
fn view_of<S: Simd>(
    simd: S,
    lens: &Lens,
    (grid, visible): (&Grid, &Visibility),
    group: &Group,
) -> Option<GroupView> {
    let mut view = GroupView {
        class: 0,
        first_slot: 0,
        whole: Extent {
            near: f32::INFINITY,
            x: (f32::INFINITY, f32::NEG_INFINITY),
            y: (f32::INFINITY, f32::NEG_INFINITY),
        },
        block: [0; GROUP],
        first: [0; GROUP],
        end: [0; GROUP],
        mixed: 0,
        near: [f32::INFINITY; GROUP],
        rect: [[0.0; GROUP]; 4],
    };
    let mut count = 0;
    let mut boxes =
        Boxes { middle: [[0.0; LANES]; 3], half: [[0.0; LANES]; 3], radius: [0.0; LANES] };
    for index in group.blocks(&grid.lattice) {
        match visible.block(grid, index) {
            Seen::Hidden => continue,
            Seen::Shown => {}
            Seen::Mixed(_) => view.mixed |= 1 << count,
        }
        let block = &grid.blocks[index];
        view.block[count] = index as u32;
        (view.first[count], view.end[count]) = (block.first, grid.blocks[index + 1].first);
        let lane = count % LANES;
        for axis in 0..3 {
            boxes.middle[axis][lane] = 0.5 * (block.low[axis] + block.high[axis]);
            boxes.half[axis][lane] = 0.5 * (block.high[axis] - block.low[axis]);
        }
        boxes.radius[lane] = block.greatest_radius;
        count += 1;
        if count % LANES == 0 {
            project_boxes(simd, lens, &boxes, (&mut view, count - LANES));
        }
    }
    if count % LANES != 0 {
        project_boxes(simd, lens, &boxes, (&mut view, count / LANES * LANES));
    }
    for block in count..GROUP {
        view.near[block] = f32::INFINITY;
    }
    let whole = &mut view.whole;
    for block in (0..count).filter(|block| view.near[*block] < f32::INFINITY) {
        whole.near = whole.near.min(view.near[block]);
        whole.x = (whole.x.0.min(view.rect[0][block]), whole.x.1.max(view.rect[1][block]));
        whole.y = (whole.y.0.min(view.rect[2][block]), whole.y.1.max(view.rect[3][block]));
    }
    (whole.near < f32::INFINITY).then_some(view)
}

/// Distances and rectangles of sixteen boxes, by the intervals they span along the view axes.
#[simd]
fn project_boxes<S: Simd>(
    simd: S,
    lens: &Lens,
    boxes: &Boxes,
    (view, first): (&mut GroupView, usize),
) {
    let rays = &lens.rays;
    let radius = f32x16::from_slice(simd, &boxes.radius) + lens.pad;
    let mx = f32x16::from_slice(simd, &boxes.middle[0]) - rays.origin.x;
    let my = f32x16::from_slice(simd, &boxes.middle[1]) - rays.origin.y;
    let mz = f32x16::from_slice(simd, &boxes.middle[2]) - rays.origin.z;
    let hx = f32x16::from_slice(simd, &boxes.half[0]);
    let hy = f32x16::from_slice(simd, &boxes.half[1]);
    let hz = f32x16::from_slice(simd, &boxes.half[2]);
    let (x0, x1) = span(rays.right, [mx, my, mz], [hx, hy, hz], radius);
    let (y0, y1) = span(rays.up, [mx, my, mz], [hx, hy, hz], radius);
    let (z0, z1) = span(rays.forward, [mx, my, mz], [hx, hy, hz], radius);
    let zero = f32x16::splat(simd, 0.0);
    let infinity = f32x16::splat(simd, f32::INFINITY);
    let ahead = z1.simd_gt(zero);
    let (near, slopes) = if rays.projection == Projection::Perspective {
        let ax = (mx.abs() - hx).max(zero);
        let ay = (my.abs() - hy).max(zero);
        let az = (mz.abs() - hz).max(zero);
        let near = az.mul_add(az, ay.mul_add(ay, ax * ax)).sqrt() - radius;
        // What the eye's plane cuts ends nowhere on one side.
        let front = z0.simd_gt(zero);
        let inv1 = f32x16::splat(simd, 1.0) / z1;
        let inv0 = front.select(f32x16::splat(simd, 1.0) / z0, infinity);
        let least_x = least(simd, x0, (inv0, inv1));
        let most_x = -least(simd, -x1, (inv0, inv1));
        let least_y = least(simd, y0, (inv0, inv1));
        let most_y = -least(simd, -y1, (inv0, inv1));
        (near, [least_x, most_x, least_y, most_y])
    } else {
        (z0, [x0, x1, y0, y1])
    };
    let [least_x, most_x, least_y, most_y] = slopes;
    let scale = f32x16::splat(simd, lens.scale);
    let lanes = first..first + LANES;
    let low = slack(rays);
    (least_x * scale + (rays.center[0] - low)).store_slice(&mut view.rect[0][lanes.clone()]);
    (most_x * scale + (rays.center[0] + low)).store_slice(&mut view.rect[1][lanes.clone()]);
    // Rows run downward.
    (-most_y * scale + (rays.center[1] - low)).store_slice(&mut view.rect[2][lanes.clone()]);
    (-least_y * scale + (rays.center[1] + low)).store_slice(&mut view.rect[3][lanes.clone()]);
    ahead.select(near, infinity).store_slice(&mut view.near[lanes]);
}

/// The least x/z of z between `1/inv0` and `1/inv1`, the nearer and the farther: −∞ where the nearer is zero and
/// x not positive.
#[inline(always)]
fn least<S: Simd>(simd: S, x: f32x16<S>, (inv0, inv1): (f32x16<S>, f32x16<S>)) -> f32x16<S> {
    let zero = f32x16::splat(simd, 0.0);
    let aside = x.simd_lt(zero).select(x * inv0, x * inv1);
    // Zero times infinity.
    let none = x.simd_eq(zero) & inv0.simd_eq(f32x16::splat(simd, f32::INFINITY));
    none.select(f32x16::splat(simd, f32::NEG_INFINITY), aside)
}

/// What rounding may add to a place in the picture, pixels.
pub(crate) fn slack(rays: &Rays) -> f32 {
    1e-3 + 1e-6 * (rays.center[0] + rays.center[1])
}

/// What boxes span along `axis`, enlarged by `radius`.
#[inline(always)]
fn span<S: Simd>(
    axis: Vec3,
    middle: [f32x16<S>; 3],
    half: [f32x16<S>; 3],
    radius: f32x16<S>,
) -> (f32x16<S>, f32x16<S>) {
    let [mx, my, mz] = middle;
    let [hx, hy, hz] = half;
    let at = mz * axis.z + my * axis.y + mx * axis.x;
    let reach = hz * axis.z.abs() + hy * axis.y.abs() + hx * axis.x.abs() + radius;
    (at - reach, at + reach)
}
