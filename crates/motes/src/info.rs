//! What a source holds: `motes info`.

use motes_particles::read::{Progress, Wanted, names};
use motes_particles::{Particles, Radius, Series, Values};
use serde::Serialize;

use crate::Result;

/// What `motes info` tells of one frame of a source.
#[derive(Clone, Debug, Serialize)]
pub struct Info {
    /// The format's name.
    pub format: String,
    /// How many whole frames there are.
    pub frames: usize,
    /// Particles in the frame.
    pub particles: usize,
    /// The simulation box, if the file has one.
    #[serde(rename = "box")]
    pub sim_box: Option<BoxInfo>,
    /// The box around all particles' centres; `None` without any.
    pub bounds: Option<BoundsInfo>,
    /// Simulated time, if the file has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// Time step, if the file has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<i64>,
    /// Everything that is known of each particle.
    pub properties: Vec<PropertyInfo>,
    /// What was odd in the file but could be read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// A box around particles, in the file's own coordinates.
#[derive(Clone, Debug, Serialize)]
pub struct BoundsInfo {
    /// Least coordinates.
    pub min: [f64; 3],
    /// Greatest coordinates.
    pub max: [f64; 3],
}

/// A simulation box.
#[derive(Clone, Debug, Serialize)]
pub struct BoxInfo {
    /// The corner the vectors start from.
    pub origin: [f64; 3],
    /// The three edge vectors.
    pub vectors: [[f64; 3]; 3],
    /// Which directions are periodic.
    pub periodic: [bool; 3],
}

/// One property of the particles.
#[derive(Clone, Debug, Serialize)]
pub struct PropertyInfo {
    /// Its standard name, or the file's own.
    pub name: String,
    /// `f32`, `f64`, `i32`, `i64`, `u8` or `names`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Values per particle.
    pub components: usize,
    /// Least value (names count from 1): a number, or one per component; null where there is none.
    pub min: Range,
    /// Greatest value.
    pub max: Range,
    /// The names, where the values are names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub names: Option<Vec<String>>,
}

/// The least or greatest value of a property.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Range {
    /// Of a property with one component.
    Scalar(Option<f64>),
    /// Of each component.
    Vector(Vec<Option<f64>>),
}

impl PropertyInfo {
    fn new(name: &str, kind: &'static str, ranges: &[Option<(f64, f64)>]) -> Self {
        let pick = |end: fn(&(f64, f64)) -> f64| match ranges {
            [one] => Range::Scalar(one.as_ref().map(end)),
            many => Range::Vector(many.iter().map(|r| r.as_ref().map(end)).collect()),
        };
        Self {
            name: name.into(),
            kind,
            components: ranges.len(),
            min: pick(|r| r.0),
            max: pick(|r| r.1),
            names: None,
        }
    }
}

/// Tells what frame `frame` of the series holds.
///
/// # Errors
/// The source cannot be read, or has no such frame.
pub fn info(series: &mut Series, frame: usize, progress: Progress<'_>) -> Result<Info> {
    let frames = series.frames(progress)?;
    let particles = series.frame(frame, &Wanted::All, progress)?;
    let bounds = particles.bounds();
    let mut warnings = series.warnings();
    let lost = particles.positions.iter().filter(|p| p.iter().any(|v| !v.is_finite())).count();
    if lost > 0 {
        warnings.push(format!("{lost} positions are not finite; bounds leave them out"));
    }
    Ok(Info {
        format: series.format().into(),
        frames,
        particles: particles.len(),
        sim_box: particles.sim_box.map(|b| BoxInfo {
            origin: b.origin,
            vectors: b.vectors,
            periodic: b.periodic,
        }),
        bounds: bounds.map(|(min, max)| BoundsInfo { min, max }),
        time: particles.time,
        step: particles.step,
        properties: properties(&particles),
        warnings,
    })
}

pub(crate) fn properties(particles: &Particles) -> Vec<PropertyInfo> {
    let mut properties = Vec::new();
    let bounds = particles.bounds();
    let axes: Vec<_> = (0..3).map(|i| bounds.map(|(low, high)| (low[i], high[i]))).collect();
    properties.push(PropertyInfo::new(names::POSITION, "f32", &axes));
    match &particles.radius {
        Radius::Unknown => {}
        Radius::Uniform(r) => {
            let r = f64::from(*r);
            properties.push(PropertyInfo::new(names::RADIUS, "f32", &[Some((r, r))]));
        }
        Radius::Each(radii) => {
            let finite = radii.iter().map(|r| f64::from(*r)).filter(|r| r.is_finite());
            let range = finite.fold(None, |range, r| match range {
                None => Some((r, r)),
                Some((low, high)) => Some((r.min(low), r.max(high))),
            });
            properties.push(PropertyInfo::new(names::RADIUS, "f32", &[range]));
        }
    }
    for column in &particles.columns {
        let kind = column.values.type_name();
        let mut property = PropertyInfo::new(&column.name, kind, &column.range());
        if let Values::Names { names, .. } = &column.values {
            property.names = Some(names.clone());
        }
        properties.push(property);
    }
    properties
}
