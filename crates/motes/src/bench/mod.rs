//! Measurements: the tables of Gribble et al. 2007 on sets of like size and structure, those of Zirr &
//! Dachsbacher 2015 and of the others, and one line for any source.
//!
//! Every time stands beside a hash of its picture, so that a faster wrong picture shows, and what is
//! compared is measured in turns, so that a busy machine slows all of it alike.
//!
//! - [`spheres_tables`]: Tables 2–9, the sweeps over λ and M, construction (`paper`, `sweeps`)
//! - [`spheres_source`]: one source, frames of a turning camera (`source`)
//! - [`surface_tables`], [`surface_source`]: the same for liquids (`surface`)
//! - [`density_tables`], [`density_source`]: Yasuda et al. 2009 (`density`)
//! - [`sections_tables`], [`sections_source`]: Chaudhari's cuts and cues (`sections`, `cues`)
//! - `liquid`: the simulation by itself
//! - `draw`: one loop over packets for every way of finding what a ray hits first
//! - `standard_grid`, `single_ray`: what the paper compares with; they live here only

mod cues;
mod density;
mod draw;
mod liquid;
mod paper;
mod sections;
mod sets;
mod shot;
mod single_ray;
mod source;
mod standard_grid;
mod surface;
mod sweeps;
mod table;
#[cfg(test)]
mod tests;

use std::time::Instant;

use crate::{Error, Result};

pub use density::{
    SOURCE_STAGES as DENSITY_STAGES, STAGES as DENSITY_TABLES, density_source, density_tables,
};
pub use paper::{STAGES as TABLES, Tables, spheres_tables};
pub use sections::{STAGES as SECTION_STAGES, sections_source, sections_tables};
pub use source::{Line, STAGES, Source, peer_view, spheres_source};
pub use surface::{
    SOURCE_STAGES as SURFACE_STAGES, STAGES as SURFACE_TABLES, surface_defaults, surface_source,
    surface_tables,
};
pub use table::{Cell, Row, Table};

/// Wall milliseconds of `work`, and what came of it.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let done = work();
    (start.elapsed().as_secs_f64() * 1e3, done)
}

/// The middle of `times`; the later of two middles.
fn median(mut times: Vec<f64>) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A number of threads, or the machine's.
fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool> {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0));
    builder.build().map_err(|e| Error::Usage(format!("threads: {e}")))
}

/// XXH3-64 of a picture's size and its packed pixels.
fn hash((width, height): (u32, u32), pixels: &[u32]) -> String {
    use std::hash::Hasher;
    let mut hasher = twox_hash::XxHash3_64::with_seed(0);
    [width, height].iter().chain(pixels).for_each(|word| hasher.write(&word.to_le_bytes()));
    format!("{:016x}", hasher.finish())
}

/// Refuses names that are not among `known`; gives all where none is named.
fn chosen(names: &[String], known: &[&'static str]) -> Result<Vec<&'static str>> {
    if names.is_empty() {
        return Ok(known.to_vec());
    }
    let find = |name: &String| {
        let found = known.iter().copied().find(|k| k.eq_ignore_ascii_case(name.trim()));
        found.ok_or_else(|| {
            let known = known.join(", ");
            Error::Usage(format!("there is no stage '{name}'; there are {known}"))
        })
    };
    names.iter().map(find).collect()
}
