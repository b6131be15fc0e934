//! Rays against spheres, sixteen at a time.
//!
//! With oc = c − o, b = oc·d and the perpendicular p = oc − b·d from the ray to the centre, a sphere of
//! radius r is hit where r² − p² ≥ 0, at t = b − √(r² − p²), or, with the origin inside, at
//! t = b + √(r² − p²). Going by p instead of b² − oc² + r² keeps f32 accurate far from the sphere.
//!
//! Fused multiply-adds are exact ones on every instruction set, so that all give the same bits.

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use motes_grid::Grid;

use crate::frustum::Frustum;
use crate::packet::{BLOCKED, LANES, NO_SLOT, Packet};

/// A sphere, and where it lies.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
    /// Slot in the system's grids, or whatever else tells it from the others.
    pub slot: u32,
}

/// Where sixteen rays meet spheres of squared radius `r2`, whose centres lie at `oc` from where the rays
/// start: distances, and which rays meet theirs at all.
#[inline(always)]
pub(crate) fn meet<S: Simd>(
    simd: S,
    oc: [f32x16<S>; 3],
    direction: [f32x16<S>; 3],
    r2: f32x16<S>,
) -> (f32x16<S>, mask32x16<S>) {
    let zero = f32x16::splat(simd, 0.0);
    let (b, half, meets) = chord(simd, oc, direction, r2);
    let entry = b - half;
    let distance = entry.simd_gt(zero).select(entry, b + half);
    (distance, meets & distance.simd_gt(zero))
}

/// b, √(r² − p²), and which rays meet their spheres, as for [`meet`], before or behind where they start.
#[inline(always)]
pub(crate) fn chord<S: Simd>(
    simd: S,
    oc: [f32x16<S>; 3],
    direction: [f32x16<S>; 3],
    r2: f32x16<S>,
) -> (f32x16<S>, f32x16<S>, mask32x16<S>) {
    let ([ox, oy, oz], [dx, dy, dz]) = (oc, direction);
    let zero = f32x16::splat(simd, 0.0);
    let b = oz.mul_add_precise(dz, oy.mul_add_precise(dy, ox * dx));
    let minus_b = -b;
    let px = minus_b.mul_add_precise(dx, ox);
    let py = minus_b.mul_add_precise(dy, oy);
    let pz = minus_b.mul_add_precise(dz, oz);
    let inside = r2 - pz.mul_add_precise(pz, py.mul_add_precise(py, px * px));
    (b, inside.max(zero).sqrt(), inside.simd_ge(zero))
}

/// Tests all rays of the packet against one sphere and keeps nearer hits. Gives whether there were
/// any. At equal distance the lower index in the file wins, and an earlier system before a later.
#[simd]
pub fn intersect<S: Simd>(
    simd: S,
    packet: &mut Packet,
    sphere: Sphere,
    index_of: &dyn Fn(u32) -> u32,
) -> bool {
    // What is not cut pays nothing for what is.
    match packet.clipped {
        false => intersect_rays::<S, false>(simd, packet, sphere, index_of),
        true => intersect_rays::<S, true>(simd, packet, sphere, index_of),
    }
}

#[inline(always)]
fn intersect_rays<S: Simd, const CLIPPED: bool>(
    simd: S,
    packet: &mut Packet,
    sphere: Sphere,
    index_of: &dyn Fn(u32) -> u32,
) -> bool {
    let center = sphere.center;
    let cx = f32x16::splat(simd, center.x);
    let cy = f32x16::splat(simd, center.y);
    let cz = f32x16::splat(simd, center.z);
    let r2 = f32x16::splat(simd, sphere.radius * sphere.radius);
    let zero = f32x16::splat(simd, 0.0);
    let mut any = false;
    for first in (0..packet.lanes()).step_by(LANES) {
        let before = load(simd, &packet.distance, first);
        if packet.any_hit && !before.simd_gt(zero).any_true() {
            continue;
        }
        let dx = load(simd, &packet.direction[0], first);
        let dy = load(simd, &packet.direction[1], first);
        let dz = load(simd, &packet.direction[2], first);
        let ox = cx - load(simd, &packet.origin[0], first);
        let oy = cy - load(simd, &packet.origin[1], first);
        let oz = cz - load(simd, &packet.origin[2], first);
        let (oc, direction) = ([ox, oy, oz], [dx, dy, dz]);
        let (distance, mut hit) = match CLIPPED {
            false => meet(simd, oc, direction, r2),
            true => packet.stretches.meet(simd, first / LANES, (oc, direction), r2),
        };
        if packet.peels {
            let after = load(simd, &packet.after, first);
            let at_it = (hit & distance.simd_eq(after)).to_bitmask();
            let follow = following(packet, sphere.slot, (first, at_it), index_of);
            let follow = mask32x16::from_bitmask(simd, follow);
            hit &= distance.simd_gt(after) | follow;
        }
        let nearer = hit & distance.simd_lt(before);
        let ties = (hit & distance.simd_eq(before)).to_bitmask();
        if packet.any_hit {
            if nearer.any_true() {
                any = true;
                let blocked = nearer.select(splat(simd, BLOCKED), before);
                blocked.store_slice(&mut packet.distance[first..first + LANES]);
            }
            continue;
        }
        if nearer.any_true() {
            any = true;
            let at = first..first + LANES;
            nearer.select(distance, before).store_slice(&mut packet.distance[at.clone()]);
            let slots = u32x16::from_slice(simd, &packet.slot[at.clone()]);
            let slot = u32x16::splat(simd, sphere.slot);
            nearer.select(slot, slots).store_slice(&mut packet.slot[at]);
        }
        if ties != 0 {
            break_ties(packet, sphere.slot, (first, ties), index_of);
        }
    }
    any
}

/// Which of the rays that meet the sphere just where they met another come to it after that one.
fn following(
    packet: &Packet,
    slot: u32,
    (first, at_it): (usize, u64),
    index_of: &dyn Fn(u32) -> u32,
) -> u64 {
    let mut follow = 0;
    for lane in (0..LANES).filter(|lane| at_it >> lane & 1 == 1) {
        let later = (packet.system, index_of(slot)) > packet.after_sphere[first + lane];
        follow |= u64::from(later) << lane;
    }
    follow
}

/// What lets less than e⁻⁹ ≈ 1/8000 of the light through is dark.
const DARK: u32 = 9 << 16;

/// The optical depth −ln(1 − opacity), in parts of 2¹⁶: whole numbers, whose sum is the same in any order.
pub(crate) fn optical_depth(opacity: f32) -> u32 {
    // `as` saturates: what is opaque has the greatest depth.
    (-(1.0 - opacity.clamp(0.0, 1.0)).ln() * 65536.0).round().min(DARK as f32) as u32
}

/// The part of light that an optical depth lets through.
pub(crate) fn transmittance(optical: u32) -> f32 {
    if optical >= DARK { 0.0 } else { (-(optical as f32) / 65536.0).exp() }
}

/// Adds the optical depth of a sphere to all rays of the packet that meet it within their reach. Gives
/// whether any went dark.
#[simd]
pub(crate) fn dim<S: Simd>(
    simd: S,
    packet: &mut Packet,
    sphere: Sphere,
    depth_of: &dyn Fn(u32) -> u32,
) -> bool {
    match packet.clipped {
        false => dim_rays::<S, false>(simd, packet, sphere, depth_of),
        true => dim_rays::<S, true>(simd, packet, sphere, depth_of),
    }
}

#[inline(always)]
fn dim_rays<S: Simd, const CLIPPED: bool>(
    simd: S,
    packet: &mut Packet,
    sphere: Sphere,
    depth_of: &dyn Fn(u32) -> u32,
) -> bool {
    let center = sphere.center;
    let cx = f32x16::splat(simd, center.x);
    let cy = f32x16::splat(simd, center.y);
    let cz = f32x16::splat(simd, center.z);
    let r2 = f32x16::splat(simd, sphere.radius * sphere.radius);
    let mut depth = None;
    let mut any = false;
    for first in (0..packet.lanes()).step_by(LANES) {
        let reach = load(simd, &packet.distance, first);
        let dx = load(simd, &packet.direction[0], first);
        let dy = load(simd, &packet.direction[1], first);
        let dz = load(simd, &packet.direction[2], first);
        let ox = cx - load(simd, &packet.origin[0], first);
        let oy = cy - load(simd, &packet.origin[1], first);
        let oz = cz - load(simd, &packet.origin[2], first);
        let (oc, direction) = ([ox, oy, oz], [dx, dy, dz]);
        let (distance, hit) = match CLIPPED {
            false => meet(simd, oc, direction, r2),
            true => packet.stretches.meet(simd, first / LANES, (oc, direction), r2),
        };
        let mut met = (hit & distance.simd_lt(reach)).to_bitmask();
        while met != 0 {
            let ray = first + met.trailing_zeros() as usize;
            met &= met - 1;
            let depth = *depth.get_or_insert_with(|| depth_of(sphere.slot));
            packet.optical[ray] = packet.optical[ray].saturating_add(depth);
            if packet.optical[ray] >= DARK {
                packet.distance[ray] = BLOCKED;
                any = true;
            }
        }
    }
    any
}

fn break_ties(
    packet: &mut Packet,
    slot: u32,
    (first, ties): (usize, u64),
    index_of: &dyn Fn(u32) -> u32,
) {
    for lane in (0..LANES).filter(|lane| ties >> lane & 1 == 1) {
        let held = &mut packet.slot[first + lane];
        if *held != NO_SLOT && *held != slot && index_of(slot) < index_of(*held) {
            *held = slot;
        }
    }
}

/// How far along K the packet's rays still look: the greatest k·sign of any ray's nearest hit.
#[simd]
pub fn farthest<S: Simd>(simd: S, packet: &Packet, frustum: &Frustum) -> f32 {
    let k = frustum.axes[0];
    let sign = f32x16::splat(simd, frustum.sign);
    let mut farthest = f32x16::splat(simd, f32::NEG_INFINITY);
    for first in (0..packet.lanes()).step_by(LANES) {
        let d = load(simd, &packet.direction[k], first);
        let o = load(simd, &packet.origin[k], first);
        let reach = load(simd, &packet.distance, first).mul_add(d, o);
        farthest = farthest.max(reach * sign);
    }
    farthest.reduce_max()
}

/// The frustum as sixteen-lane constants, to cull sixteen spheres at a time.
#[derive(Clone, Copy)]
pub(crate) struct Cull<S: Simd> {
    at_start: [f32x16<S>; 4],
    slope: [f32x16<S>; 4],
    widen: [f32x16<S>; 2],
    pad: f32x16<S>,
    sign: f32x16<S>,
}

impl<S: Simd> Cull<S> {
    #[inline(always)]
    pub fn new(simd: S, frustum: &Frustum) -> Self {
        let [a0, a1, a2, a3] = frustum.at_start;
        let [s0, s1, s2, s3] = frustum.slope;
        let [w0, w1] = frustum.widen;
        Self {
            at_start: [splat(simd, a0), splat(simd, a1), splat(simd, a2), splat(simd, a3)],
            slope: [splat(simd, s0), splat(simd, s1), splat(simd, s2), splat(simd, s3)],
            widen: [splat(simd, w0), splat(simd, w1)],
            pad: splat(simd, frustum.pad),
            sign: splat(simd, frustum.sign),
        }
    }
}

/// Which of the sixteen spheres from `slot` on may be met: bit i for sphere `slot + i`.
///
/// A sphere goes if its centre lies farther than its radius from a plane (Gribble et al. 2007, §4.3,
/// "SIMD Sphere/Frustum Culling"), if it lies wholly beyond `reach` (every ray has hit something
/// nearer), or wholly behind the start.
#[simd]
pub(crate) fn cull<S: Simd>(
    simd: S,
    planes: &Cull<S>,
    frustum: &Frustum,
    (grid, slot): (&Grid, usize),
    reach: f32,
) -> u64 {
    let centers = sixteen_centers(simd, grid, slot);
    let [k, u, v] = frustum.axes;
    let (k, u, v) = (centers[k], centers[u], centers[v]);
    let radius = radii_at(simd, grid, slot);
    let along = k - f32x16::splat(simd, frustum.k_start);
    let u_shift = radius.mul_add(planes.widen[0], planes.pad);
    let v_shift = radius.mul_add(planes.widen[1], planes.pad);
    let u_low = planes.slope[0].mul_add(along, planes.at_start[0]);
    let u_high = planes.slope[1].mul_add(along, planes.at_start[1]);
    let v_low = planes.slope[2].mul_add(along, planes.at_start[2]);
    let v_high = planes.slope[3].mul_add(along, planes.at_start[3]);
    let in_u = (u + u_shift).simd_ge(u_low) & (u - u_shift).simd_le(u_high);
    let in_v = (v + v_shift).simd_ge(v_low) & (v - v_shift).simd_le(v_high);
    let ahead = (along * planes.sign + radius + planes.pad).simd_ge(f32x16::splat(simd, 0.0));
    let near = (k * planes.sign - radius - planes.pad).simd_le(f32x16::splat(simd, reach));
    (in_u & in_v & ahead & near).to_bitmask()
}

// Closures and `array::map` would leave the instruction set of their surroundings.

#[inline(always)]
fn load<S: Simd>(simd: S, from: &[f32], first: usize) -> f32x16<S> {
    f32x16::from_slice(simd, &from[first..first + LANES])
}

#[inline(always)]
fn splat<S: Simd>(simd: S, value: f32) -> f32x16<S> {
    f32x16::splat(simd, value)
}

/// x, y and z of sixteen particles from `at` on; past the end the last one repeats.
#[inline(always)]
pub(crate) fn sixteen_centers<S: Simd>(simd: S, grid: &Grid, at: usize) -> [f32x16<S>; 3] {
    let from = &grid.particles[..];
    match from.get(at..at + LANES) {
        Some(particles) => transposed(simd, bytemuck::cast_slice(particles)),
        None => {
            let mut padded = [from[from.len() - 1]; LANES];
            let rest = &from[at..];
            padded[..rest.len()].copy_from_slice(rest);
            transposed(simd, bytemuck::cast_slice(&padded))
        }
    }
}

/// x, y and z of sixteen particles, four numbers each.
#[inline(always)]
pub(crate) fn transposed<S: Simd>(simd: S, numbers: &[f32]) -> [f32x16<S>; 3] {
    let [x, y, z, _] = columns([
        load(simd, numbers, 0),
        load(simd, numbers, LANES),
        load(simd, numbers, 2 * LANES),
        load(simd, numbers, 3 * LANES),
    ]);
    [x, y, z]
}

/// The four numbers of sixteen particles, of which four are in each vector.
#[inline(always)]
pub(crate) fn columns<S: Simd>(fours: [f32x16<S>; 4]) -> [f32x16<S>; 4] {
    // xyzi xyzi … becomes xzxz … and yiyi …, and these x …, z …, y … and i ….
    let (xz0, yi0) = fours[0].deinterleave(fours[1]);
    let (xz1, yi1) = fours[2].deinterleave(fours[3]);
    let (x, z) = xz0.deinterleave(xz1);
    let (y, i) = yi0.deinterleave(yi1);
    [x, y, z, i]
}

/// Sixteen values from `at` on; past the end the last one repeats.
#[inline(always)]
fn sixteen<S: Simd>(simd: S, from: &[f32], at: usize) -> f32x16<S> {
    match from.get(at..at + LANES) {
        Some(values) => f32x16::from_slice(simd, values),
        None => f32x16::from_fn(simd, |i| from[(at + i).min(from.len() - 1)]),
    }
}

/// Radii of the sixteen particles from `slot` on; past the end the last one repeats.
#[inline(always)]
pub(crate) fn radii_at<S: Simd>(simd: S, grid: &Grid, slot: usize) -> f32x16<S> {
    match &grid.radius {
        motes_grid::Radii::Uniform(r) => f32x16::splat(simd, *r),
        motes_grid::Radii::Each(radii) => sixteen(simd, radii, slot),
    }
}

/// Sixteen bits of `words` from bit `at` on.
#[inline(always)]
pub(crate) fn bits(words: &[u64], at: usize) -> u64 {
    let (word, shift) = (at / 64, at % 64);
    let low = words[word] >> shift;
    match words.get(word + 1) {
        Some(next) if shift > 0 => low | next << (64 - shift),
        _ => low,
    }
}
