//! What a picture cost: `--stats`.

use std::collections::BTreeMap;

use serde::Serialize;

/// What a picture cost.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Stats {
    /// Wall milliseconds per stage: `read`, `build`, `trace`, `finish`.
    pub ms: BTreeMap<&'static str, f64>,
    /// Particle counts: `read`, `visible`, `left_out`.
    pub particles: BTreeMap<&'static str, usize>,
    /// Bytes per structure: `data` (positions and radii in the grid), `grid` (beyond these),
    /// `visibility`, `columns`.
    pub bytes: BTreeMap<&'static str, usize>,
    /// Counts of work: `tests` (ray–sphere tests), `spheres` (spheres culled or tested).
    pub counts: BTreeMap<&'static str, u64>,
    /// Most memory the process held, bytes; none where the system does not tell.
    pub peak_memory: Option<u64>,
    /// Threads.
    pub threads: usize,
    /// Instruction set.
    pub simd: String,
    /// Hash of the picture, before annotations.
    pub hash: String,
}

/// Most memory the process has held so far, bytes; `None` where the system does not tell.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}
