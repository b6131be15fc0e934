//! The pressure that is told: what neighbours pass on to each other, their virial.
//!
//! p_i = 1/(3 V) Σ_j ½ F_ij · d_ij = ρ₀/6 · m C h Σ_j t (P_i + P_j) r²   (Irving & Kirkwood 1950, Clausius 1870)
//!
//! with P = p/ρ² as the solver has it, V = Δ³ the volume of a particle and ρ₀ V its mass. The solver's own
//! p is what holds its *estimate* of the density, which changes 5 % less than the volume of a lattice two
//! spacings to the support, and much less at a surface or in disorder; what bears the weight of the liquid
//! above is this sum, exactly, on any arrangement.

use motes_scene::Solver;

use crate::fluid::Fluid;
use crate::kernel::{Smooth, Wendland};
use crate::passes::Virial;
use crate::simulation::{Around, Physics};

/// Sets `pressure`, pascals, from what stands in [`Fluid::pressure`], p/ρ².
pub(crate) fn transmitted(
    around: Around<'_>,
    fluid: &Fluid,
    physics: &Physics,
    pressure: &mut [f32],
) {
    let (pairs, out) = (around.of(fluid, physics), [&mut *pressure]);
    match physics.sph.solver {
        Solver::Dfsph => {
            pairs.sum(Virial { kernel: Wendland, wall: 2.0 }, [&fluid.pressure], out);
        }
        Solver::Wcsph => pairs.sum(Virial { kernel: Smooth, wall: 1.0 }, [&fluid.pressure], out),
    }
    let scale =
        physics.density / 6.0 * physics.mass * physics.kernel.slope * physics.kernel.support;
    pressure.iter_mut().for_each(|p| *p *= scale);
}
