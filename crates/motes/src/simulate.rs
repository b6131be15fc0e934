//! Simulations as sources: `sim:NAME?parameter=value&…`, frames made when they are asked for.
//!
//! The parameters are the scenario's ([`scenarios`]), `seconds` (how long it runs), `restart` (a file to go
//! on from), and, by their own names, the scene's under `sph.`. Frame 0 is the start.

use std::fmt::Write as _;

use motes_particles::read::{Progress, Reader, Wanted, names};
use motes_particles::{Column, Particles, Place, Radius, ReadError, Series, SimulationBox, Values};
use motes_scene::{Scene, Sph};
use motes_sph::{Frame, SCENARIOS, Scenario, Setup, Simulation, Stats};

use crate::{Error, Result};

/// How long a simulation runs, where nothing is said, seconds.
const SECONDS: f64 = 4.0;
/// Frames that were made are kept up to so many bytes; going back beyond them starts again.
const KEPT_BYTES: usize = 512 << 20;

/// A simulation that gives frames.
pub struct Simulated {
    source: String,
    setup: Setup,
    sph: Sph,
    restart: Option<Start>,
    running: Option<Simulation>,
    /// Frame 0 and those after it, as far as they are kept.
    kept: Vec<Particles>,
    frames: usize,
}

/// Where a simulation goes on from.
#[derive(Clone)]
struct Start {
    at: (f64, u64),
    positions: Vec<[f32; 3]>,
    velocities: Vec<[f32; 3]>,
}

impl Simulated {
    /// Understands `source`, which is `sim:` and `text`, or a scenario's name and parameters alone.
    ///
    /// # Errors
    /// An unknown scenario or parameter, a value that makes no sense, a restart file that cannot be read.
    pub fn new(source: &str, text: &str, sph: &Sph) -> Result<Self> {
        let usage = |message: String| Error::Usage(format!("{source}: {message}"));
        let (name, query) = text.split_once('?').unwrap_or((text, ""));
        let scenario = Scenario::named(name).map_err(usage)?;
        let mut scene = Scene { sph: sph.clone(), ..Scene::default() };
        let (mut own, mut seconds, mut restart) = (vec![], SECONDS, None);
        for part in query.split('&').filter(|part| !part.is_empty()) {
            let Some((key, value)) = part.split_once('=') else {
                return Err(usage(format!("expected parameter=value, found '{part}'")));
            };
            let path = key.strip_prefix("sph.").unwrap_or(key);
            if scenario.parameters.iter().any(|p| p.name == key) {
                own.push((key, value));
            } else if key == "seconds" {
                let number = value.parse().ok().filter(|s| (0.0..=1e6).contains(s));
                let wrong = || usage(format!("seconds: expected 0 to 1e6, found '{value}'"));
                seconds = number.ok_or_else(wrong)?;
            } else if key == "restart" {
                restart = Some(start_of(value)?);
            } else if scene.set_text(&format!("sph.{path}={value}")).is_err() {
                let known: Vec<_> = scenario.parameters.iter().map(|p| p.name).collect();
                let known = known.join(", ");
                return Err(usage(format!(
                    "'{part}' is no parameter of {name} ({known}, seconds, restart) or of sph"
                )));
            }
        }
        scene.sph.check()?;
        let setup = scenario.setup(&own).map_err(usage)?;
        let frames = (seconds * scene.sph.fps + 1e-6).floor() as usize + 1;
        let source = source.to_owned();
        Ok(Self { source, setup, sph: scene.sph, restart, running: None, kept: vec![], frames })
    }

    pub(crate) fn series(source: &str, text: &str, sph: &Sph) -> Result<Series> {
        let simulated = Self::new(source, text, sph)?;
        Ok(Series::from_reader("simulation", Box::new(simulated)))
    }

    /// How many frames there are, the start included.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Frame `frame`; `watch` is told after each step, and ends it by `false`.
    ///
    /// # Errors
    /// There is no such frame, or the simulation blew up, or was ended.
    pub fn frame(
        &mut self,
        frame: usize,
        watch: &mut dyn FnMut(&Stats) -> bool,
    ) -> std::result::Result<Particles, ReadError> {
        let error = |message: String| ReadError::new(&self.source, Place::Frame(frame), message);
        if frame >= self.frames {
            let last = self.frames - 1;
            return Err(error(format!(
                "the frames are 0 to {last}; there are more with seconds=…"
            )));
        }
        if let Some(kept) = self.kept.get(frame) {
            return Ok(kept.clone());
        }
        let first = self.restart.as_ref().map_or(0, |s| (s.at.0 * self.sph.fps).round() as u64);
        let mut simulation = match self.running.take() {
            Some(running) if running.frames() <= first + frame as u64 => running,
            _ => self.begin().map_err(error)?,
        };
        loop {
            let done = (simulation.frames() - first) as usize;
            if done == self.kept.len() && self.room() {
                let particles = particles(&mut simulation);
                self.kept.push(particles);
            }
            if done >= frame {
                break;
            }
            simulation.advance(watch).map_err(error)?;
        }
        let made = self.kept.get(frame).cloned();
        let made = made.unwrap_or_else(|| particles(&mut simulation));
        self.running = Some(simulation);
        Ok(made)
    }

    /// Whether another frame is to be kept.
    fn room(&self) -> bool {
        let each = self.kept.iter().map(Particles::bytes).max().unwrap_or(0);
        (self.kept.len() + 1) * each <= KEPT_BYTES
    }

    pub(crate) fn begin(&self) -> std::result::Result<Simulation, String> {
        let mut simulation = Simulation::new(self.setup.clone(), &self.sph);
        if let Some(Start { at, positions, velocities }) = &self.restart {
            simulation.restart(*at, positions, velocities)?;
        }
        Ok(simulation)
    }
}

impl Reader for Simulated {
    fn count(&mut self, _: Progress<'_>) -> motes_particles::Result<usize> {
        Ok(self.frames)
    }

    fn read(
        &mut self,
        frame: usize,
        _: &Wanted,
        progress: Progress<'_>,
    ) -> motes_particles::Result<Particles> {
        let end = frame as f64 / self.sph.fps;
        let parts = |secs: f64| (secs * 1e6) as u64;
        self.frame(frame, &mut |stats| {
            progress(parts(stats.time.min(end)), parts(end).max(1));
            true
        })
    }
}

/// The frame as it stands, under the standard names.
fn particles(simulation: &mut Simulation) -> Particles {
    let [low, high] = simulation.tank().map(|corner| corner.map(f64::from));
    let radius = Radius::Uniform(0.5 * simulation.spacing());
    let Frame { time, step, positions, velocities, density, pressure, masks } = simulation.frame();
    let ids = (1..=positions.len() as i64).collect();
    let column =
        |name: &str, components, values| Column::new(name, components, Values::F32(values));
    Particles {
        columns: vec![
            column(names::VELOCITY, 3, velocities.into_flattened()),
            column("Density", 1, density),
            column("Pressure", 1, pressure),
            column(names::PARTICLE_MASK, 6, masks.into_flattened()),
            Column::new(names::PARTICLE_IDENTIFIER, 1, Values::I64(ids)),
        ],
        positions,
        radius,
        sim_box: Some(SimulationBox::axis_aligned(low, high, [false; 3])),
        time: Some(time),
        step: Some(step as i64),
        ..Particles::default()
    }
}

/// The last frame of a file, in the order of its particles' numbers.
fn start_of(source: &str) -> Result<Start> {
    let mut series = Series::open(source)?;
    let last = series.frames(&|_, _| {})?.saturating_sub(1);
    let frame = series.frame(last, &Wanted::All, &|_, _| {})?;
    let mut order: Vec<usize> = (0..frame.len()).collect();
    if let Some(ids) = frame.column(names::PARTICLE_IDENTIFIER) {
        order.sort_by(|a, b| ids.number(*a, 0).total_cmp(&ids.number(*b, 0)));
    }
    let place = |i: &usize| {
        std::array::from_fn(|a| (frame.origin[a] + f64::from(frame.positions[*i][a])) as f32)
    };
    let velocity = frame.column(names::VELOCITY).filter(|v| v.components == 3);
    let speed = |i: &usize| match velocity {
        Some(column) => [0, 1, 2].map(|a| column.number(*i, a) as f32),
        None => [0.0; 3],
    };
    let time = frame.time.filter(|t| (0.0..=1e9).contains(t)).unwrap_or(0.0);
    let step = frame.step.and_then(|step| u64::try_from(step).ok()).unwrap_or(0);
    Ok(Start {
        at: (time, step),
        positions: order.iter().map(place).collect(),
        velocities: order.iter().map(speed).collect(),
    })
}

/// All scenarios and their parameters, as text.
pub fn scenarios() -> String {
    let mut text = String::new();
    for scenario in SCENARIOS {
        let _ = writeln!(text, "  {}: {}", scenario.name, scenario.meaning);
        for p in scenario.parameters {
            let _ = writeln!(text, "    {:<12} {:<8} {}", p.name, p.default, p.meaning);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simulated(text: &str) -> Result<Simulated> {
        Simulated::new(&format!("sim:{text}"), text, &Sph::default())
    }

    fn frame(simulated: &mut Simulated, frame: usize) -> Particles {
        simulated.frame(frame, &mut |_| true).unwrap()
    }

    #[test]
    fn frames_are_made_in_any_order() {
        let mut one = simulated("dam-break?particles=300&seconds=0.2").unwrap();
        assert_eq!(one.frames(), 6);
        let third = frame(&mut one, 3);
        let first = frame(&mut one, 1);
        let mut steps = 0;
        let again = one
            .frame(3, &mut |_| {
                steps += 1;
                true
            })
            .unwrap();
        assert!(again == third && steps == 0);
        let mut two = simulated("dam-break?particles=300&seconds=0.2").unwrap();
        assert!(frame(&mut two, 1) == first && frame(&mut two, 3) == third);
        assert!((third.time.unwrap() - 3.0 / 25.0).abs() < 1e-12);
        assert!(one.frame(6, &mut |_| true).unwrap_err().to_string().contains("0 to 5"));
        // Beyond what is kept.
        one.kept.truncate(1);
        assert!(frame(&mut one, 3) == third && frame(&mut one, 1) == first);
        assert!(two.frame(5, &mut |_| false).is_err());
    }

    #[test]
    fn settings_are_the_scenes_and_the_sources() {
        let sph = Sph { fps: 10.0, ..Sph::default() };
        let text = "column?particles=100&sph.viscosity=0.5&cfl=0.3";
        let made = Simulated::new(text, text, &sph).unwrap();
        assert_eq!((made.sph.fps, made.sph.viscosity, made.sph.cfl), (10.0, 0.5, 0.3));
        assert_eq!(made.frames(), 41);
        for (bad, part) in [
            ("dam-brake", "dam-break"),
            ("column?particles", "parameter=value"),
            ("column?ball=1", "width"),
            ("column?cfl=9", "sph.cfl"),
            ("column?seconds=-1", "seconds"),
            ("column?restart=none.vtk", "no such file"),
        ] {
            let message = simulated(bad).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
