//! The fine field: each particle adds its density to the voxels in its reach.
//!
//! Yasuda et al. 2009, §4.2.2–4.2.4. The density of a particle is W(r/R) ([`crate::kernel`]). Where a mask says
//! that a side is filled, R shrinks towards it,
//!
//! > R₊ₓ = R + (R_min − R)·min(P₊ₓ / P_filled, P±y / P_filled, P±z / P_filled, 1),
//!
//! as far as the sides around it are filled, too: else the density beside an edge would shrink along it, and the
//! surface sink; //! q = Σ (x / R±ₓ)² takes the place of (r/R)²: an eighth of an ellipsoid in each octant. Saturated voxels
//! are skipped. Without both this is the plain field, every particle into every voxel in its reach, by the
//! same code.

use fearless_simd::{f32x8, mask32x8, prelude::*};
use fearless_simd_macros::simd;
use motes_grid::Radii;

use crate::bins::Entry;
use crate::kernel::amplitude;
use crate::lattice::{Lattice, reach};
use crate::params::{Params, Particles};
use crate::rough::Rough;

/// The mask of a side that is filled at rest.
const FILLED: f32 = 0.63;
/// Reach towards a filled side, in voxels: with less, holes open between the voxels of particles.
const LEAST_REACH: f32 = 1.7;
/// Voxels in a vector.
pub(crate) const LANES: usize = 8;
/// Rows along a tile's edge at the most.
pub(crate) const MOST_ROWS: usize = 64;

/// What densities are made from.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub particles: Particles<'a>,
    pub lattice: &'a Lattice,
    pub params: &'a Params,
    pub rough: Option<&'a Rough>,
    /// Reach and amplitude, where all have the same.
    uniform: Option<(f32, f32)>,
}

/// A tile's rows, and where they are.
pub(crate) struct Tile<'a> {
    /// y fastest.
    pub rows: Vec<&'a mut [f32]>,
    /// First row and how many, along y and z.
    pub y: [usize; 2],
    pub z: [usize; 2],
    /// Voxels written.
    pub updates: u64,
    /// Particles that were not skipped as a whole.
    pub visits: u64,
}

/// The density of one particle, in voxels.
struct Bump {
    at: [f32; 3],
    /// Reach to the lower and to the higher side.
    reach: [[f32; 2]; 3],
    amplitude: f32,
}

impl<'a> Source<'a> {
    pub fn new(
        particles: Particles<'a>,
        (lattice, params): (&'a Lattice, &'a Params),
        rough: Option<&'a Rough>,
    ) -> Self {
        let mut source = Self { particles, lattice, params, rough, uniform: None };
        if let Radii::Uniform(radius) = particles.radii {
            source.uniform = Some(source.spread(radius));
        }
        source
    }

    /// Reach and amplitude of a particle of some radius, in voxels.
    #[inline(always)]
    fn spread(&self, radius: f32) -> (f32, f32) {
        let voxel = self.lattice.voxel;
        let far = reach(radius, voxel, self.params) / voxel;
        (far, amplitude(radius / voxel, far))
    }

    #[inline(always)]
    fn bump<const MASKED: bool>(&self, entry: &Entry) -> Bump {
        let index = entry.index as usize;
        let (far, amplitude) = match self.uniform {
            Some(same) => same,
            None => self.spread(self.particles.radius(index)),
        };
        let mut bump = Bump { at: entry.at, reach: [[far; 2]; 3], amplitude };
        if MASKED && let Some(masks) = self.particles.masks {
            let (mask, least) = (&masks[index], LEAST_REACH.min(far));
            let both = |axis: usize| mask[2 * axis].min(mask[2 * axis + 1]);
            let [x, y, z] = [both(0), both(1), both(2)];
            let side = |side: usize, around: f32| {
                let filled = (mask[side].min(around) * (1.0 / FILLED)).clamp(0.0, 1.0);
                far + (least - far) * filled
            };
            bump.reach = [
                [side(1, y.min(z)), side(0, y.min(z))],
                [side(3, z.min(x)), side(2, z.min(x))],
                [side(5, x.min(y)), side(4, x.min(y))],
            ];
        }
        bump
    }
}

/// Adds the densities of particles to a tile.
#[simd]
pub(crate) fn add<S: Simd, const MASKED: bool, const SATURATES: bool, const COUNTED: bool>(
    simd: S,
    source: &Source<'_>,
    entries: &[Entry],
    tile: &mut Tile<'_>,
) {
    for entry in entries {
        if let Some(rough) = source.rough
            && rough.is_core(entry.at)
        {
            continue;
        }
        tile.visits += 1;
        let bump = source.bump::<MASKED>(entry);
        let along = whole(bump.at[0], bump.reach[0], [0, source.lattice.dims[0]]);
        let mut first = along[0];
        while first < along[1] {
            add_columns::<S, MASKED, SATURATES, COUNTED>(simd, source, (&bump, first), tile);
            first += LANES;
        }
    }
}

/// The whole numbers within reach of a place, but for the ends, from the first to before the last, within
/// limits.
#[inline(always)]
fn whole(at: f32, reach: [f32; 2], [from, to]: [usize; 2]) -> [usize; 2] {
    let first = (at - reach[0]).max(0.0) as usize + 1;
    let last = (at + reach[1]).max(0.0) as usize + 1;
    [first.max(from), last.min(to)]
}

/// Adds a density to [`LANES`] columns of a tile from `first` on.
#[inline(always)]
fn add_columns<S: Simd, const MASKED: bool, const SATURATES: bool, const COUNTED: bool>(
    simd: S,
    source: &Source<'_>,
    (bump, first): (&Bump, usize),
    tile: &mut Tile<'_>,
) {
    let saturation = f32x8::splat(simd, source.params.saturation);
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let count = f32x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let x = count + (first as f32 - bump.at[0]);
    let [[low, high], of_y, of_z] = bump.reach.map(|sides| sides.map(|r| 1.0 / r));
    let x = match MASKED {
        true => x * x.simd_lt(zero).select(f32x8::splat(simd, low), f32x8::splat(simd, high)),
        false => x * low,
    };
    // 1 − q of the columns; q of rows is taken from it.
    let left = one - x * x;
    let ys = whole(bump.at[1], bump.reach[1], [tile.y[0], tile.y[0] + tile.y[1]]);
    let zs = whole(bump.at[2], bump.reach[2], [tile.z[0], tile.z[0] + tile.z[1]]);
    if ys[0] >= ys[1] {
        return;
    }
    let mut parts = [0.0; MOST_ROWS];
    for y in ys[0]..ys[1] {
        parts[y - ys[0]] = part(y, bump.at[1], of_y);
    }
    for z in zs[0]..zs[1] {
        let qz = part(z, bump.at[2], of_z);
        let begin = (z - tile.z[0]) * tile.y[1] + ys[0] - tile.y[0];
        let rows = &mut tile.rows[begin..begin + ys[1] - ys[0]];
        for (row, qy) in rows.iter_mut().zip(&parts) {
            // Rows that are hardly met are not worth a test.
            let w = (left - (qz + qy)).max(zero);
            let more = w * w * (w * bump.amplitude);
            let Some(voxels) = row.get_mut(first..first + LANES) else { continue };
            let before = f32x8::from_slice(simd, voxels);
            let after = match SATURATES {
                true => (before + more).min(saturation).max(before),
                false => before + more,
            };
            after.store_slice(voxels);
            if COUNTED {
                let open = if SATURATES { before.simd_lt(saturation) } else { one.simd_gt(zero) };
                let written: mask32x8<S> = open & w.simd_gt(zero);
                tile.updates += u64::from(written.to_bitmask().count_ones());
            }
        }
    }
}

/// The part of q that one axis makes, of which one over the reach to each side is known.
#[inline(always)]
fn part(voxel: usize, at: f32, per_reach: [f32; 2]) -> f32 {
    let d = voxel as f32 - at;
    let d = d * if d < 0.0 { per_reach[0] } else { per_reach[1] };
    d * d
}
