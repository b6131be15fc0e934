//! The frustum around a packet: four planes that bound its rays along the major axis.
//!
//! Rays step through the grid in slices along K, the axis they mostly follow; U and V are the other
//! two. Along K each ray is a line u(k) = u₀ + k·du. The least u of all rays is a concave function of
//! k, and so lies nowhere below its chord between two values of k; likewise the greatest u nowhere
//! above its own. These chords are the bounding planes: exact for rays with a common origin (Gribble
//! et al. 2007, §2) or a common direction, and valid for any other rays.
//!
//! A sphere of radius r meets no ray unless its centre lies within r·√(1 + du²) of the planes
//! (§4.1, "Constructing the Enlarged Frustum"). The shift is applied with each sphere's own radius,
//! which also settles the case of Fig. 5, right: spheres smaller than r_max that miss the frustum.

use glam::Vec3;

use crate::packet::Packet;

/// The four bounding planes of a packet.
#[derive(Clone, Copy, Debug)]
pub struct Frustum {
    /// The axes K, U, V.
    pub axes: [usize; 3],
    /// +1 where the rays run towards greater k, else −1.
    pub sign: f32,
    /// Where along K the planes start.
    pub k_start: f32,
    /// Where along K they end, in the order of travel.
    pub k_end: f32,
    /// Least u, greatest u, least v, greatest v at `k_start`.
    pub at_start: [f32; 4],
    /// Their change per unit of k.
    pub slope: [f32; 4],
    /// √(1 + du²) and √(1 + dv²) for the steepest ray.
    pub widen: [f32; 2],
    /// What rounding may add to any of these.
    pub pad: f32,
}

/// A ray that runs less than this along K is no ray of a packet.
const LEAST_K: f32 = 1e-2;

/// What a packet's rays may meet.
#[derive(Debug)]
pub enum Bounds {
    /// No sphere with its centre in the box.
    Nothing,
    /// Rays too different to share a major axis.
    Incoherent,
    /// What lies in a frustum.
    Frustum(Frustum),
}

impl Frustum {
    /// The frustum of `packet` for spheres of radii up to `radius` with centres in `low..high`.
    pub fn around(packet: &Packet, low: Vec3, high: Vec3, radius: f32) -> Bounds {
        let first = packet.direction_of(0);
        let k = first.abs().max_position();
        let axes = [k, (k + 1) % 3, (k + 2) % 3];
        let sign = first[k].signum();
        let lanes = packet.lanes();
        let (ok, dk) = (&packet.origin[k][..lanes], &packet.direction[k][..lanes]);
        if dk.iter().any(|d| d * sign < LEAST_K) {
            return Bounds::Incoherent;
        }

        let reach = low.abs().max(high.abs()).max_element()
            + packet.origin_of(0).abs().max_element()
            + radius;
        // Each bound is a handful of roundings away from the truth, each below 2⁻²⁴ of the reach
        // divided by the least slope of a ray along K.
        let pad = reach * 2e-6;
        let (near, far) = if sign > 0.0 { (low[k], high[k]) } else { (high[k], low[k]) };
        let mut nearest_origin = ok.iter().map(|o| o * sign).fold(f32::INFINITY, f32::min) * sign;
        if packet.peels {
            // Nothing before what the rays have met is looked for.
            let met = (0..lanes).map(|i| (ok[i] + packet.after[i] * dk[i]) * sign);
            nearest_origin = met.fold(f32::INFINITY, f32::min) * sign;
        }
        let start = (near * sign).max(nearest_origin * sign) * sign - sign * (radius + pad);
        let end = far + sign * (radius + pad);
        if (end - start) * sign <= 0.0 {
            return Bounds::Nothing;
        }

        let mut frustum = Self {
            axes,
            sign,
            k_start: start,
            k_end: end,
            at_start: [0.0; 4],
            slope: [0.0; 4],
            widen: [1.0; 2],
            pad,
        };
        for side in 0..2 {
            let axis = axes[side + 1];
            let (o, d) = (&packet.origin[axis][..lanes], &packet.direction[axis][..lanes]);
            let mut least = [f32::INFINITY; 2];
            let mut greatest = [f32::NEG_INFINITY; 2];
            let mut steepest = 0f32;
            for i in 0..lanes {
                let slope = d[i] / dk[i];
                steepest = steepest.max(slope.abs());
                for (end, at) in [start, end].into_iter().enumerate() {
                    let u = o[i] + (at - ok[i]) * slope;
                    least[end] = least[end].min(u);
                    greatest[end] = greatest[end].max(u);
                }
            }
            let length = end - start;
            frustum.at_start[2 * side] = least[0];
            frustum.at_start[2 * side + 1] = greatest[0];
            frustum.slope[2 * side] = (least[1] - least[0]) / length;
            frustum.slope[2 * side + 1] = (greatest[1] - greatest[0]) / length;
            frustum.widen[side] = (1.0 + steepest * steepest).sqrt();
        }
        Bounds::Frustum(frustum)
    }

    /// Plane `plane` at `k`.
    pub fn plane(&self, plane: usize, k: f32) -> f32 {
        self.at_start[plane] + (k - self.k_start) * self.slope[plane]
    }

    /// Least and greatest u (side 0) or v (side 1) that the centre of a sphere of radius `radius` can
    /// have with its k in `k0..k1`.
    pub fn span(&self, side: usize, (k0, k1): (f32, f32), radius: f32) -> (f32, f32) {
        let shift = radius * self.widen[side] + self.pad;
        let low = self.plane(2 * side, k0).min(self.plane(2 * side, k1)) - shift;
        let high = self.plane(2 * side + 1, k0).max(self.plane(2 * side + 1, k1)) + shift;
        (low, high)
    }

    /// Whether spheres of radius `radius` with centres in the box can meet a ray.
    #[inline]
    pub fn meets_box(&self, low: Vec3, high: Vec3, radius: f32) -> bool {
        let [k, u, v] = self.axes;
        let ks = (low[k], high[k]);
        let (u0, u1) = self.span(0, ks, radius);
        let (v0, v1) = self.span(1, ks, radius);
        low[u] <= u1 && high[u] >= u0 && low[v] <= v1 && high[v] >= v0
    }
}
