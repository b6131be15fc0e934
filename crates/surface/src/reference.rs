//! The definition, by brute force in f64: every ray against every sphere. For tests only.
//!
//! Along the ray of a pixel the liquid is the union of the spheres and of the *inner cells*
//! ([`inner_cells`]), between the near and the far plane. Two parts of it between which no more than the
//! gap g is empty, measured in the world, are one span (Zirr & Dachsbacher 2015, §3.2).

use std::collections::HashSet;

use glam::DVec3;

use crate::{Extended, Spans, View};

/// A sphere of the definition.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

/// A cube with edges along the axes.
#[derive(Clone, Copy, Debug)]
pub struct Cube {
    /// Its least corner.
    pub low: DVec3,
    /// Its edge.
    pub edge: f64,
}

/// An end of a stretch of a ray: its depth and its particle.
pub type End = (f64, u32);

/// Where the line `origin` + t·`direction` is in a sphere.
pub fn in_sphere(origin: DVec3, direction: DVec3, sphere: Sphere) -> Option<[f64; 2]> {
    let oc = sphere.center - origin;
    let middle = oc.dot(direction) / direction.length_squared();
    let perpendicular = (oc - direction * middle).length_squared();
    let inside = sphere.radius * sphere.radius - perpendicular;
    let half = (inside >= 0.0).then(|| (inside / direction.length_squared()).sqrt())?;
    Some([middle - half, middle + half])
}

/// Where the line `origin` + t·`direction` is in a cube.
pub fn in_cube(origin: DVec3, direction: DVec3, cube: Cube) -> Option<[f64; 2]> {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (low, high) =
            (cube.low[axis] - origin[axis], cube.low[axis] + cube.edge - origin[axis]);
        if direction[axis] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (low / direction[axis], high / direction[axis]);
        (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    }
    (from <= to).then_some([from, to])
}

/// All spans of pixel (`i`, `j`), front to back, however many.
pub fn column(
    (spheres, inner): (&[Sphere], &[Cube]),
    view: &View,
    (i, j): (u32, u32),
    gap: f64,
) -> Vec<[End; 2]> {
    let (origin, direction) = view.column(i, j);
    let (near, far) = (f64::from(view.near), f64::from(view.far));
    let of_spheres = spheres.iter().enumerate();
    let of_spheres = of_spheres.filter_map(|(index, sphere)| {
        in_sphere(origin, direction, *sphere).map(|stretch| (stretch, index as u32))
    });
    let of_cubes = inner.iter().filter_map(|c| in_cube(origin, direction, *c));
    let of_cubes = of_cubes.map(|stretch| (stretch, Spans::NO_PARTICLE));
    let mut stretches: Vec<[End; 2]> = of_spheres
        .chain(of_cubes)
        .filter(|([from, to], _)| *to > near && *from < far)
        .map(|([from, to], particle)| [(from.max(near), particle), (to.min(far), particle)])
        .collect();
    // At equal depth the lower index comes first.
    let by_end = |a: &End, b: &End| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    stretches.sort_by(|a, b| by_end(&a[0], &b[0]));
    let mut spans: Vec<[End; 2]> = Vec::new();
    for [entry, exit] in stretches {
        match spans.last_mut() {
            Some([_, end]) if (entry.0 - end.0) * direction.length() <= gap => {
                if exit.0 > end.0 || (exit.0 == end.0 && exit.1 < end.1) {
                    *end = exit;
                }
            }
            _ => spans.push([entry, exit]),
        }
    }
    spans
}

/// The spans of all pixels, at most `most` each: the last one stored reaches to the end of the last.
pub fn voxelize(matter: (&[Sphere], &[Cube]), view: &View, gap: f64, most: usize) -> Spans {
    let mut spans = Spans { size: view.size, near: view.near, far: view.far, ..Spans::default() };
    spans.starts.push(0);
    for pixel in 0..view.pixels() as u32 {
        let all = column(matter, view, (pixel % view.size.0, pixel / view.size.0), gap);
        let stored = all.len().min(most);
        for (s, [entry, exit]) in all[..stored].iter().enumerate() {
            let exit = if s + 1 == stored { &all[all.len() - 1][1] } else { exit };
            for end in [entry, exit] {
                spans.depths.push(end.0 as f32);
                spans.particles.push(end.1);
            }
        }
        if all.len() > most {
            let empty: f64 = all[stored - 1..].windows(2).map(|w| w[1][0].0 - w[0][1].0).sum();
            spans.extended.push(Extended { pixel, count: all.len() as u32, empty: empty as f32 });
        }
        spans.starts.push((spans.depths.len() / 2) as u32);
    }
    spans
}

/// The inner cells of a lattice of cubes from `low` on with this edge: cells that, with all 26 around
/// them, hold at least `least` of `centers`.
pub fn inner_cells(centers: &[DVec3], low: DVec3, edge: f64, least: usize) -> Vec<Cube> {
    let mut count = std::collections::HashMap::new();
    for center in centers {
        *count.entry(((*center - low) / edge).floor().as_i64vec3().to_array()).or_insert(0) += 1;
    }
    let full: HashSet<[i64; 3]> =
        count.into_iter().filter(|(_, count)| *count >= least).map(|(cell, _)| cell).collect();
    let around = |[x, y, z]: [i64; 3]| {
        (-1..=1).flat_map(move |dz| {
            (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| [x + dx, y + dy, z + dz]))
        })
    };
    let mut inner: Vec<[i64; 3]> =
        full.iter().copied().filter(|c| around(*c).all(|c| full.contains(&c))).collect();
    inner.sort_unstable();
    let corner = |cell: [i64; 3]| low + DVec3::from_array(cell.map(|c| c as f64)) * edge;
    inner.into_iter().map(|cell| Cube { low: corner(cell), edge }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use motes_scene::{Projection, Rays};

    fn one_pixel() -> View {
        let rays = Rays {
            origin: Vec3::ZERO,
            forward: Vec3::Z,
            right: Vec3::X,
            up: Vec3::Y,
            center: [0.5, 0.5],
            pixel: 0.01,
            projection: Projection::Perspective,
        };
        View { rays, size: (1, 1), near: 0.5, far: 100.0 }
    }

    fn at(z: f64) -> Sphere {
        Sphere { center: DVec3::new(0.0, 0.0, z), radius: 1.0 }
    }

    #[test]
    fn spheres_apart_by_no_more_than_the_gap_are_one_span() {
        let spheres = [at(0.0), at(3.0), at(5.5), at(9.0)];
        let spans = voxelize((&spheres, &[]), &one_pixel(), 0.5, 7);
        assert_eq!(spans.depths, [0.5, 1.0, 2.0, 6.5, 8.0, 10.0]);
        assert_eq!(spans.particles, [0, 0, 1, 2, 3, 3]);
        assert_eq!(voxelize((&spheres, &[]), &one_pixel(), 1.5, 7).depths, [0.5, 10.0]);
    }

    #[test]
    fn the_last_span_keeps_what_is_empty_in_it() {
        let spheres = [at(3.0), at(6.0), at(10.0)];
        let spans = voxelize((&spheres, &[]), &one_pixel(), 0.5, 2);
        assert_eq!(spans.depths, [2.0, 4.0, 5.0, 11.0]);
        assert_eq!(spans.extended, [Extended { pixel: 0, count: 3, empty: 2.0 }]);
        assert_eq!((spans.count(0), spans.of(0)), (3, 0..2));
    }

    #[test]
    fn inner_cells_are_liquid() {
        let centers: Vec<DVec3> = (0..125)
            .map(|i| DVec3::new(f64::from(i % 5), f64::from(i / 5 % 5), f64::from(i / 25)) + 0.5)
            .collect();
        let inner = inner_cells(&centers, DVec3::ZERO, 1.0, 1);
        assert_eq!(inner.len(), 27);
        let view = View {
            rays: Rays { origin: Vec3::new(2.5, 2.5, -2.0), ..one_pixel().rays },
            ..one_pixel()
        };
        // Three cells in a row, each shorter than what a gap may be.
        assert_eq!(voxelize((&[], &inner), &view, 0.5, 7).depths, [3.0, 6.0]);
        assert!(inner_cells(&centers, DVec3::ZERO, 1.0, 2).is_empty());
    }
}
