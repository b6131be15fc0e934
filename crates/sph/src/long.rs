//! Long runs, and what they went through: whether a simulation stays bounded.

use crate::{Simulation, Stats};

/// The most there was at the ends of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extremes {
    /// The greatest speed of a particle, m/s.
    pub speed: f64,
    /// The greatest mean compression, as a part of the density at rest.
    pub compression: f64,
    /// The greatest density of a particle, kg/m³.
    pub density: f64,
    /// The greatest energy ([`Simulation::energy`]), joules, the start's among them.
    pub energy: f64,
}

impl Simulation {
    /// Goes on for `secs` simulated seconds, in whole frames; `watch` as in [`Simulation::advance`].
    ///
    /// # Errors
    /// As [`Simulation::advance`].
    pub fn endure(
        &mut self,
        secs: f64,
        watch: &mut dyn FnMut(&Stats) -> bool,
    ) -> Result<Extremes, String> {
        let end = self.stats().time + secs;
        let mut most = Extremes { energy: self.energy(), ..Extremes::default() };
        while self.stats().time < end - 1e-9 {
            self.advance(watch)?;
            let frame = self.frame();
            let rest = f64::from(self.physics.density);
            let densities = || frame.density.iter().map(|d| f64::from(*d));
            let excess: f64 = densities().map(|d| (d / rest - 1.0).max(0.0)).sum();
            let squares =
                frame.velocities.iter().map(|v| v.iter().map(|v| f64::from(v * v)).sum::<f64>());
            most.speed = most.speed.max(squares.fold(0.0, f64::max).sqrt());
            most.density = densities().fold(most.density, f64::max);
            most.compression = most.compression.max(excess / frame.density.len().max(1) as f64);
            most.energy = most.energy.max(self.energy());
        }
        Ok(most)
    }
}
