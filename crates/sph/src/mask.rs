//! The particle mask: how much of a particle's surroundings is filled, in six directions.
//!
//! Yasuda, Harada & Kawaguchi 2009, §4.2.2–4.2.3. Their Eq. (1) is printed as
//! P₊ₓ = Σ_j k / ([r]_x / ([r]_y)²), where neither the unit nor the limit at [r]_y = 0 makes sense; a
//! neighbour straight ahead would count nothing. What the text asks of it is a sum over the neighbours on
//! the +x side, greatest where all of that side is filled, nothing where it is empty. Read here as
//!
//! P₊ₓ = min(κ Σ over j on the +x side of x² (1 − r²)², 1),  κ = 1.4
//!
//! with x the component and r the length of the way to j, in supports: x² is how far j lies ahead, (1 − r²)²,
//! the square of the w of [`crate::kernel`], how near it is. For particles at rest on a lattice, h/2 apart, a
//! filled side gives 0.63; compressed liquid up to 1.
//!
//! The pass adds up S = Σ x² w² and D = Σ x|x| w², both sides at once; then P₊ = κ (S + D)/2 and
//! P₋ = κ (S − D)/2.

use motes_grid::Grid;
use rayon::prelude::*;

/// +x, −x, +y, −y, +z, −z, each 0 to 1.
pub type Mask = [f32; 6];

/// κ.
const FULL: f32 = 1.4;

/// The mask from its sums; `d` points from the neighbours to the particle.
pub(crate) fn from_sums(s: [f32; 3], d: [f32; 3]) -> Mask {
    let side = |axis: usize, sign: f32| (0.5 * FULL * (s[axis] - sign * d[axis])).clamp(0.0, 1.0);
    [side(0, 1.0), side(0, -1.0), side(1, 1.0), side(1, -1.0), side(2, 1.0), side(2, -1.0)]
}

/// The masks of particles that bring none, in cell order of `grid`, with neighbours within `support`
/// (for particles of a liquid about four radii, in the grid's unit).
pub fn masks(grid: &Grid, support: f32) -> Vec<Mask> {
    (0..grid.len()).into_par_iter().map(|slot| mask_at(grid, support, slot)).collect()
}

fn mask_at(grid: &Grid, support: f32, slot: usize) -> Mask {
    let here = grid.center(slot);
    let mut sides = [0.0f32; 6];
    grid.visit_near(here, support, |other| {
        let way = (grid.center(other) - here).to_array();
        let square = way.iter().map(|v| v * v).sum::<f32>();
        let near = 1.0 - square / (support * support);
        if near > 0.0 {
            for (axis, along) in way.iter().enumerate() {
                let side = 2 * axis + usize::from(*along < 0.0);
                sides[side] += along * along * near * near;
            }
        }
    });
    sides.map(|sum| (FULL / (support * support) * sum).min(1.0))
}
