//! What is read of the sources for a frame.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motes_particles::Series;
use motes_particles::read::{Wanted, names};
use motes_scene::{ColorBy, Component, RangeOver};

use crate::ahead::All;
use crate::opacity::ALPHA;
use crate::paint::find_property;
use crate::{Error, Result, Watch};

/// What becomes of a frame that was rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum After {
    /// It may be asked for again.
    Kept,
    LetGo,
    /// It is one of many that pass by: as Kept, but what a liquid hides of lines is not found out.
    Moves,
}

/// What is read for a frame: of each visible system its offset, and which columns.
#[derive(Clone, PartialEq)]
pub(crate) struct Reading {
    pub frame: usize,
    pub systems: Vec<Option<(i64, Wanted)>>,
}

impl Reading {
    /// Reads it.
    ///
    /// # Errors
    /// A frame is not there, or cannot be read.
    pub fn read(&self, all: &[Arc<Mutex<Series>>], after: After, watch: &dyn Watch) -> Result<All> {
        let (frame, report) = (self.frame, |done, total| _ = watch.progress("read", done, total));
        let of = |(series, system): (&Arc<Mutex<Series>>, &Option<(i64, Wanted)>)| {
            let Some((offset, wanted)) = system else { return Ok(None) };
            let own = i64::try_from(frame).unwrap_or(i64::MAX).saturating_add(*offset);
            let own = usize::try_from(own).map_err(|_| {
                Error::Usage(format!("frame {frame}: frame_offset leads before the first frame"))
            })?;
            // Beside a series, what has one frame stands still.
            let mut series = lock(series);
            let still = own > 0 && all.len() > 1 && series.frames(&report)? == 1;
            let own = if still { 0 } else { own };
            Ok(Some(match after {
                After::Kept | After::Moves => series.frame(own, wanted, &report)?,
                After::LetGo => Arc::new(series.take(own, wanted, &report)?),
            }))
        };
        all.iter().zip(&self.systems).map(of).collect()
    }
}

/// Locks a series, which is whole whoever held it.
pub(crate) fn lock(series: &Mutex<Series>) -> MutexGuard<'_, Series> {
    series.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The columns that colours and radii need; all, where a property's name or an expression may mean any.
pub(crate) fn wanted(system: &motes_scene::System) -> Wanted {
    let by = match &system.color.by {
        ColorBy::Auto => vec![names::COLOR, ALPHA],
        ColorBy::Chain => vec![names::CHAIN, names::MOLECULE_IDENTIFIER],
        ColorBy::Residue => vec![names::RESIDUE_NAME],
        ColorBy::Uniform | ColorBy::Element | ColorBy::Type => vec![],
        ColorBy::Property(_) => return Wanted::All,
    };
    if !system.r#where.trim().is_empty() || !system.filter.is_empty() {
        return Wanted::All;
    }
    Wanted::Only(
        by.into_iter()
            .chain([names::PARTICLE_TYPE, names::TRANSPARENCY])
            .map(str::to_owned)
            .collect(),
    )
}

/// What the range of colours over a series is of; none where it is the frame's.
#[derive(Clone, PartialEq)]
pub(crate) struct RangeKey(ColorBy, Component, bool);

impl RangeKey {
    pub fn of(system: &motes_scene::System) -> Option<Self> {
        let color = &system.color;
        let series = color.range_over == RangeOver::Series;
        series.then(|| Self(color.by.clone(), color.component, color.log))
    }
}

/// The range of the colouring property over all frames.
pub(crate) fn series_range(
    series: &mut Series,
    system: &motes_scene::System,
    wanted: &Wanted,
    watch: &dyn Watch,
) -> Result<Option<[f64; 2]>> {
    let ColorBy::Property(name) = &system.color.by else { return Ok(None) };
    let quiet = |_, _| {};
    let frames = series.frames(&quiet)?;
    let mut range: Option<[f64; 2]> = None;
    for frame in 0..frames {
        if !watch.progress("range", frame as u64, frames as u64) {
            return Err(Error::Cancelled);
        }
        let particles = series.frame(frame, wanted, &quiet)?;
        // Frames without particles may come without columns.
        if particles.is_empty() {
            continue;
        }
        let property = find_property(&particles, name, system.color.component)?;
        if let Some([low, high]) = property.range(&particles, system.color.log) {
            let [a, b] = range.unwrap_or([low, high]);
            range = Some([a.min(low), b.max(high)]);
        }
    }
    Ok(range)
}
