//! The rays of a tile, sixteen to a block of 4 × 4 pixels, and where they meet spheres and cubes.
//!
//! In view axes the ray of a pixel with slopes a, b is t·(a, b, 1), t being the depth; it is nearest to a
//! sphere's centre v, and in the sphere, at
//!
//! > tₘ = (a·x + b·y + z)/q,  tₘ ± √((r² − |v − tₘ·(a, b, 1)|²)/q),  q = 1 + a² + b²
//!
//! and orthographic, where a and b are lengths, at z ± √(r² − (x − a)² − (y − b)²); q is 1. A cube is met
//! between the last of the three faces where the ray enters and the first where it leaves.

use fearless_simd::{Simd, f32x16, prelude::*};
use motes_scene::Projection;

use crate::View;
use crate::boundary::Cubes;
use crate::items::{BLOCK, Item, LANES, Tiles};

/// A number for each ray of a block.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes(pub [f32; LANES]);

impl Lanes {
    #[inline(always)]
    pub fn load<S: Simd>(&self, simd: S) -> f32x16<S> {
        f32x16::from_slice(simd, &self.0)
    }
}

/// Rays of a tile.
#[derive(Debug, Default)]
pub(crate) struct TileRays {
    /// Blocks along the edge.
    pub side: usize,
    /// The first pixel.
    pub corner: (u32, u32),
    /// Pixels of the picture in the tile, along the width and the height.
    pub pixels: (u32, u32),
    /// a of each column of blocks.
    a: Vec<Lanes>,
    /// b of each row of blocks.
    b: Vec<Lanes>,
    /// 1/q of each block.
    pub inverse_q: Vec<Lanes>,
    /// One over the direction of each block's rays, along x, y, z of the world; for cubes.
    inverse: Vec<[Lanes; 3]>,
    near: f32,
    far: f32,
}

/// Where sixteen rays are in something.
pub(crate) struct Stretch<S: Simd> {
    pub hit: <f32x16<S> as SimdBase<S>>::Mask,
    pub entry: f32x16<S>,
    pub exit: f32x16<S>,
}

/// A sphere, spread out over sixteen lanes.
pub(crate) struct Ball<S: Simd> {
    x: f32x16<S>,
    y: f32x16<S>,
    z: f32x16<S>,
    r2: f32x16<S>,
}

/// The faces of a cube.
pub(crate) struct Faces {
    low: [f32; 3],
    high: [f32; 3],
}

impl TileRays {
    /// Turns to tile number `tile`.
    pub fn turn(&mut self, view: &View, tiles: &Tiles, tile: usize) {
        let (tx, ty) = (tile as u32 % tiles.across, tile as u32 / tiles.across);
        let pixels = tiles.side * BLOCK;
        self.side = tiles.side as usize;
        self.corner = (tx * pixels, ty * pixels);
        self.pixels =
            (pixels.min(view.size.0 - self.corner.0), pixels.min(view.size.1 - self.corner.1));
        (self.near, self.far) = (view.near, view.far);
        let rays = &view.rays;
        self.a.clear();
        self.b.clear();
        self.inverse_q.clear();
        self.inverse.clear();
        for block in 0..tiles.side {
            let lanes = |lane: usize| (lane as u32 % BLOCK, lane as u32 / BLOCK);
            let a = std::array::from_fn(|lane| {
                let column = self.corner.0 + block * BLOCK + lanes(lane).0;
                (column as f32 + 0.5 - rays.center[0]) * rays.pixel
            });
            let b = std::array::from_fn(|lane| {
                let row = self.corner.1 + block * BLOCK + lanes(lane).1;
                (rays.center[1] - row as f32 - 0.5) * rays.pixel
            });
            self.a.push(Lanes(a));
            self.b.push(Lanes(b));
        }
    }

    /// Takes what depends on both slopes.
    #[inline(always)]
    pub fn square<S: Simd>(&mut self, simd: S, projection: Projection) {
        let one = f32x16::splat(simd, 1.0);
        for block in 0..self.side * self.side {
            let mut lanes = Lanes([1.0; LANES]);
            if projection == Projection::Perspective {
                let a = self.a[block % self.side].load(simd);
                let b = self.b[block / self.side].load(simd);
                let q = a.mul_add_precise(a, b.mul_add_precise(b, one));
                (one / q).store_slice(&mut lanes.0);
            }
            self.inverse_q.push(lanes);
        }
    }

    /// Takes what cubes need.
    #[inline(always)]
    pub fn invert<S: Simd>(&mut self, simd: S, view: &View) {
        let rays = &view.rays;
        let one = f32x16::splat(simd, 1.0);
        let least = f32x16::splat(simd, 1e-30);
        for block in 0..self.side * self.side {
            let a = self.a[block % self.side].load(simd);
            let b = self.b[block / self.side].load(simd);
            let mut inverse = [Lanes([0.0; LANES]); 3];
            for (axis, inverse) in inverse.iter_mut().enumerate() {
                let mut along = f32x16::splat(simd, rays.forward[axis]);
                if rays.projection == Projection::Perspective {
                    let up = f32x16::splat(simd, rays.up[axis]);
                    let right = f32x16::splat(simd, rays.right[axis]);
                    along = a.mul_add_precise(right, b.mul_add_precise(up, along));
                }
                // A ray along a face is a little askew: no division by zero.
                let along = along.abs().simd_lt(least).select(least, along);
                (one / along).store_slice(&mut inverse.0);
            }
            self.inverse.push(inverse);
        }
    }

    #[inline(always)]
    pub fn ball<S: Simd>(simd: S, item: &Item) -> Ball<S> {
        let [x, y, z] = item.at;
        Ball {
            x: f32x16::splat(simd, x),
            y: f32x16::splat(simd, y),
            z: f32x16::splat(simd, z),
            r2: f32x16::splat(simd, item.size * item.size),
        }
    }

    /// The faces of a cube, from the rays' origin. Cubes that share a face give the same number for it.
    #[inline(always)]
    pub fn faces(view: &View, cubes: &Cubes, item: &Item) -> Faces {
        let mut faces = Faces { low: [0.0; 3], high: [0.0; 3] };
        for axis in 0..3 {
            let origin = view.rays.origin[axis];
            faces.low[axis] = item.at[axis] * cubes.edge + cubes.low[axis] - origin;
            faces.high[axis] = (item.at[axis] + item.size) * cubes.edge + cubes.low[axis] - origin;
        }
        faces
    }

    /// Where the rays of a block are in a sphere.
    #[inline(always)]
    pub fn meet_ball<S: Simd, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        (column, row): (usize, usize),
        ball: &Ball<S>,
    ) -> Stretch<S> {
        let a = self.a[column].load(simd);
        let b = self.b[row].load(simd);
        let zero = f32x16::splat(simd, 0.0);
        let (middle, inside) = if PERSPECTIVE {
            let inverse_q = self.inverse_q[row * self.side + column].load(simd);
            let yz = b.mul_add_precise(ball.y, ball.z);
            let middle = a.mul_add_precise(ball.x, yz) * inverse_q;
            let dx = middle.mul_sub_precise(a, ball.x);
            let dy = middle.mul_sub_precise(b, ball.y);
            let dz = middle - ball.z;
            let away = dx.mul_add_precise(dx, dy.mul_add_precise(dy, dz * dz));
            (middle, (ball.r2 - away) * inverse_q)
        } else {
            let (dx, dy) = (a - ball.x, b - ball.y);
            (ball.z, ball.r2 - dx.mul_add_precise(dx, dy * dy))
        };
        let half = inside.max(zero).sqrt();
        self.clip(simd, inside.simd_ge(zero), (middle - half, middle + half))
    }

    /// Where the rays of a block are in a cube.
    #[inline(always)]
    pub fn meet_cube<S: Simd, const PERSPECTIVE: bool>(
        &self,
        simd: S,
        (column, row): (usize, usize),
        (faces, rays): (&Faces, &motes_scene::Rays),
    ) -> Stretch<S> {
        let inverse = &self.inverse[row * self.side + column];
        let mut entry = f32x16::splat(simd, f32::NEG_INFINITY);
        let mut exit = f32x16::splat(simd, f32::INFINITY);
        for axis in 0..3 {
            let mut low = f32x16::splat(simd, faces.low[axis]);
            let mut high = f32x16::splat(simd, faces.high[axis]);
            if !PERSPECTIVE {
                let (right, up) = (rays.right[axis], rays.up[axis]);
                let a = self.a[column].load(simd) * f32x16::splat(simd, right);
                let across = self.b[row].load(simd).mul_add_precise(f32x16::splat(simd, up), a);
                (low, high) = (low - across, high - across);
            }
            let inverse = inverse[axis].load(simd);
            let (low, high) = (low * inverse, high * inverse);
            entry = entry.max(low.min(high));
            exit = exit.min(low.max(high));
        }
        self.clip(simd, entry.simd_le(exit), (entry, exit))
    }

    /// What of a stretch lies between near and far.
    #[inline(always)]
    fn clip<S: Simd>(
        &self,
        simd: S,
        hit: <f32x16<S> as SimdBase<S>>::Mask,
        (entry, exit): (f32x16<S>, f32x16<S>),
    ) -> Stretch<S> {
        let entry = entry.max(f32x16::splat(simd, self.near));
        let exit = exit.min(f32x16::splat(simd, self.far));
        Stretch { hit: hit & entry.simd_lt(exit), entry, exit }
    }
}
