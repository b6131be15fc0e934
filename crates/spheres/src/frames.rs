//! Where spheres lie on a tile, sixteen at a time.
//!
//! With the eye at the origin, view axes x, y, z (z forward) and slopes a = x/z, a sphere of radius r at c
//! spans
//!
//! > a = (cx·cz ± r·√(cx² + cz² − r²)) / (cz² − r²)
//!
//! of which √(cx² + cz² − r²) ≤ |c| gives an upper bound that needs one root for both axes. Of a sphere that
//! the eye's plane cuts, a > (cx − r)/(cz + r) where cx > r, and likewise at the other side.

use fearless_simd::{f32x16, prelude::*, u32x16};
use motes_grid::Grid;

use crate::intersect::{radii_at, sixteen_centers};
use crate::overview::{Extent, Lens, slack};
use crate::packet::LANES;
use crate::tile::{Pattern, SIDE_BLOCKS};

/// Rows of sixteen that are framed before any of them is drawn.
pub(crate) const BATCH: usize = 4;
/// Spheres of a batch.
pub(crate) const FRAMES: usize = BATCH * LANES;
/// Where no block is, among the blocks of a tile.
const NOWHERE: u32 = (SIDE_BLOCKS * SIDE_BLOCKS) as u32;
/// Set where a sphere shows in more than two blocks along x or y.
const LARGE: u32 = 1 << 16;

/// A rectangle of blocks of a tile: first and last along x and y.
pub(crate) type Area = [usize; 4];

/// A tile's window on what a camera sees.
pub(crate) struct Window {
    pub lens: Lens,
    pub pattern: Pattern,
    /// The tile's first pixel.
    pub corner: (f32, f32),
}

impl Window {
    /// The blocks of the tile that have a ray in the rectangle, if any.
    #[inline(always)]
    pub fn area_of(&self, extent: Extent) -> Option<Area> {
        let [x, y] = self.pattern.inset;
        let side = self.pattern.side as f32;
        let most = side * SIDE_BLOCKS as f32 - 1.0;
        let (x0, x1) = whole_pixels(extent.x, self.corner.0, x);
        let (y0, y1) = whole_pixels(extent.y, self.corner.1, y);
        if x0 > x1 || y0 > y1 || x1 < 0.0 || y1 < 0.0 || x0 > most || y0 > most {
            return None;
        }
        let block = |pixel: f32| (pixel.clamp(0.0, most) / side) as usize;
        Some([block(x0), block(x1), block(y0), block(y1)])
    }

    /// Frames the sixteen spheres from `slot` on, in a row of `frames`; gives which of them may show, nearer
    /// than `reach`.
    #[inline(always)]
    pub fn frame<S: Simd, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        (grid, slot): (&Grid, usize),
        reach: f32,
        (frames, row): (&mut Frames, usize),
    ) -> u64 {
        let rays = &self.lens.rays;
        let [cx, cy, cz] = sixteen_centers(simd, grid, slot);
        let own_radius = radii_at(simd, grid, slot);
        let radius = own_radius + self.lens.pad;
        let ox = cx - rays.origin.x;
        let oy = cy - rays.origin.y;
        let oz = cz - rays.origin.z;
        let x = along(simd, rays.right, [ox, oy, oz]);
        let y = along(simd, rays.up, [ox, oy, oz]);
        let z = along(simd, rays.forward, [ox, oy, oz]);
        let scale = f32x16::splat(simd, self.lens.scale);
        let zero = f32x16::splat(simd, 0.0);
        let ahead = (z + radius).simd_gt(zero);
        let margin = slack(rays);
        // Least and greatest place along x and, upward, along y, from the middle of the picture.
        let (near, [mut left, mut right, mut low, mut high]) = if PERSPECTIVE {
            let distance = z.mul_add(z, y.mul_add(y, x * x)).sqrt();
            let square = z.mul_add(z, -(radius * radius));
            let part = scale / square;
            let (zp, half) = (z * part, radius * distance * part + margin);
            let (mx, my) = (x * zp, y * zp);
            (distance - radius, [mx - half, mx + half, my - half, my + half])
        } else {
            let half = radius * scale + margin;
            let (mx, my) = (x * scale, y * scale);
            (z - radius, [mx - half, mx + half, my - half, my + half])
        };
        // What the eye's plane cuts ends nowhere on one side.
        let cut = z.simd_le(radius * 1.001);
        if PERSPECTIVE && cut.any_true() {
            let part = scale / (z + radius);
            let none = f32x16::splat(simd, f32::INFINITY);
            let (x0, x1) = (x - radius, x + radius);
            let (y0, y1) = (y - radius, y + radius);
            left = cut.select(x0.simd_gt(zero).select(x0 * part - margin, -none), left);
            right = cut.select(x1.simd_lt(zero).select(x1 * part + margin, none), right);
            low = cut.select(y0.simd_gt(zero).select(y0 * part - margin, -none), low);
            high = cut.select(y1.simd_lt(zero).select(y1 * part + margin, none), high);
        }
        let side = self.pattern.side as f32;
        let most = side * SIDE_BLOCKS as f32 - 1.0;
        let [inset_x, inset_y] = self.pattern.inset;
        let at_x = rays.center[0] - self.corner.0;
        let at_y = rays.center[1] - self.corner.1;
        let x0 = (left + (at_x - inset_x.1)).ceil();
        let x1 = (right + (at_x - inset_x.0)).floor();
        // Rows run downward.
        let y0 = (-high + (at_y - inset_y.1)).ceil();
        let y1 = (-low + (at_y - inset_y.0)).floor();
        let most = f32x16::splat(simd, most);
        let meets = x0.simd_le(x1)
            & y0.simd_le(y1)
            & x1.simd_ge(zero)
            & y1.simd_ge(zero)
            & x0.simd_le(most)
            & y0.simd_le(most);
        let shows = meets & ahead & near.simd_lt(f32x16::splat(simd, reach));
        let may = shows.to_bitmask();
        if may == 0 {
            return 0;
        }
        let per_side = f32x16::splat(simd, 1.0 / side);
        let (x0, x1) = (x0.max(zero) * per_side, x1.min(most) * per_side);
        let (y0, y1) = (y0.max(zero) * per_side, y1.min(most) * per_side);
        let row = row * LANES..(row + 1) * LANES;
        near.store_slice(&mut frames.near[row.clone()]);
        (own_radius * own_radius).store_slice(&mut frames.r2[row.clone()]);
        // From where the rays start, if they all start there.
        let [cx, cy, cz] = if PERSPECTIVE { [ox, oy, oz] } else { [cx, cy, cz] };
        cx.store_slice(&mut frames.center[0][row.clone()]);
        cy.store_slice(&mut frames.center[1][row.clone()]);
        cz.store_slice(&mut frames.center[2][row.clone()]);
        let (x0, x1) = (u32x16::truncate_from(x0), u32x16::truncate_from(x1));
        let (y0, y1) = (u32x16::truncate_from(y0), u32x16::truncate_from(y1));
        let one = u32x16::splat(simd, 1);
        let nowhere = u32x16::splat(simd, NOWHERE);
        let (right, below) = (x1.simd_gt(x0), y1.simd_gt(y0));
        let large = (x1 - x0).simd_gt(one) | (y1 - y0).simd_gt(one);
        let area = x0 | x1 << 4 | y0 << 8 | y1 << 12 | u32x16::splat(simd, LARGE);
        let (y0, y1) = (y0 << 4, y1 << 4);
        let [first, second, third, fourth] = &mut frames.corner;
        large.select(area, y0 | x0).store_slice(&mut first[row.clone()]);
        right.select(y0 | x1, nowhere).store_slice(&mut second[row.clone()]);
        below.select(y1 | x0, nowhere).store_slice(&mut third[row.clone()]);
        (right & below).select(y1 | x1, nowhere).store_slice(&mut fourth[row]);
        may
    }
}

/// A sphere to be drawn: its centre, from where the rays start if they all start at one point, and the
/// square of its radius.
pub(crate) struct Drawn<S: Simd> {
    pub center: [f32x16<S>; 3],
    pub r2: f32x16<S>,
}

/// A batch of spheres, and where they lie on the tile.
#[repr(align(64))]
pub(crate) struct Frames {
    /// Where each row of sixteen begins among the slots of its system.
    pub first_slot: [u32; BATCH],
    /// Least distances.
    pub near: [f32; FRAMES],
    /// The blocks of the tile that the sphere may show in: at most four, each once; the others are beyond
    /// those of a tile. A large sphere has its area instead.
    pub corner: [[u32; FRAMES]; 4],
    center: [[f32; FRAMES]; 3],
    r2: [f32; FRAMES],
}

impl Frames {
    pub fn new() -> Self {
        Self {
            first_slot: [0; BATCH],
            near: [0.0; FRAMES],
            corner: [[0; FRAMES]; 4],
            center: [[0.0; FRAMES]; 3],
            r2: [0.0; FRAMES],
        }
    }

    /// The area of a sphere that shows in more than two blocks along x or y.
    #[inline(always)]
    pub fn large(&self, lane: usize) -> Option<Area> {
        let area = self.corner[0][lane];
        let side = |shift: u32| (area >> shift & 15) as usize;
        (area & LARGE != 0).then(|| [side(0), side(4), side(8), side(12)])
    }

    #[inline(always)]
    pub fn slot(&self, lane: usize) -> u32 {
        self.first_slot[lane / LANES] + (lane % LANES) as u32
    }

    #[inline(always)]
    pub fn sphere<S: Simd>(&self, simd: S, lane: usize) -> Drawn<S> {
        let [x, y, z] = &self.center;
        let center = [
            f32x16::splat(simd, x[lane]),
            f32x16::splat(simd, y[lane]),
            f32x16::splat(simd, z[lane]),
        ];
        Drawn { center, r2: f32x16::splat(simd, self.r2[lane]) }
    }
}

/// The first and last pixel from `corner` on whose samples, which lie in `inset` of each pixel, can lie
/// in `span`.
#[inline(always)]
fn whole_pixels(span: (f32, f32), corner: f32, inset: (f32, f32)) -> (f32, f32) {
    ((span.0 - corner - inset.1).ceil(), (span.1 - corner - inset.0).floor())
}

#[inline(always)]
fn along<S: Simd>(simd: S, axis: glam::Vec3, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
    let y = y.mul_add(f32x16::splat(simd, axis.y), x * axis.x);
    z.mul_add(f32x16::splat(simd, axis.z), y)
}
