//! Pictures that are measured in turns.

use std::collections::BTreeMap;

use motes_scene::{Resolved, Scene};
use motes_surface::Mode;

use super::fluid::{Drawn, Extracted, Fluid};
use crate::bench::median;
use crate::bench::table::Cell;
use crate::{Result, Stats};

/// What comes before shading.
const MAKING: [&str; 5] = ["splat", "compress", "connect", "filter", "normals"];

/// A picture to measure.
pub(super) struct Take {
    /// The row's name.
    pub label: &'static str,
    scene: Scene,
    resolved: Resolved,
    mode: Mode,
    others: &'static [Mode],
}

/// What was measured of it.
pub(super) struct Measured {
    pub label: &'static str,
    /// Medians.
    ms: BTreeMap<&'static str, f64>,
    /// Counts and bytes.
    pub stats: Stats,
    pub hashes: Vec<String>,
}

impl Take {
    /// # Errors
    /// The scene makes no sense.
    pub fn new(
        (label, fluid): (&'static str, &Fluid),
        scene: Scene,
        (mode, others): (Mode, &'static [Mode]),
    ) -> Result<Self> {
        let resolved = scene.resolve_framing(fluid.framing())?;
        Ok(Self { label, scene, resolved, mode, others })
    }

    pub fn draw(&self, (fluid, extracted): (&Fluid, &Extracted)) -> Result<Drawn> {
        fluid.draw(extracted, (&self.scene, &self.resolved), (self.mode, self.others))
    }
}

/// Draws every take in turns, after one frame each that does not count.
pub(super) fn measure(
    of: (&Fluid, &Extracted),
    takes: &[Take],
    frames: usize,
) -> Result<Vec<Measured>> {
    let mut all = Vec::new();
    for take in takes {
        let Drawn { stats, hashes, .. } = take.draw(of)?;
        all.push((BTreeMap::<&'static str, Vec<f64>>::new(), stats, hashes));
    }
    for _ in 0..frames {
        for (take, (times, ..)) in takes.iter().zip(&mut all) {
            for (stage, ms) in take.draw(of)?.stats.ms {
                times.entry(stage).or_default().push(ms);
            }
        }
    }
    let measured = takes.iter().zip(all).map(|(take, (times, stats, hashes))| {
        let ms = times.into_iter().map(|(stage, times)| (stage, median(times))).collect();
        Measured { label: take.label, ms, stats, hashes }
    });
    Ok(measured.collect())
}

impl Measured {
    /// Milliseconds of a stage.
    pub fn ms(&self, stage: &str) -> f64 {
        self.ms.get(stage).copied().unwrap_or(f64::NAN)
    }

    /// The same, for a table.
    pub fn cell(&self, stage: &str) -> Cell {
        Cell::Ms(self.ms(stage))
    }

    /// The sum of all stages up to a picture in one mode: the paper's Σ.
    pub fn sum(&self, shading: &str) -> f64 {
        MAKING.iter().map(|stage| self.ms(stage)).sum::<f64>() + self.ms(shading)
    }

    pub fn count(&self, name: &str) -> u64 {
        self.stats.counts.get(name).copied().unwrap_or(0)
    }

    pub fn bytes(&self, name: &str) -> usize {
        self.stats.bytes.get(name).copied().unwrap_or(0)
    }
}
