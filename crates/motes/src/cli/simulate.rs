//! `motes simulate`: a liquid's frames, written to files.

use std::io::IsTerminal;
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use motes::{Scene, Simulated, SimulationStats, Watch};
use motes_frame::Unfinished;
use motes_particles::Particles;
use motes_particles::write::Format;

use super::frames::{Frames, numbered};
use super::meter::Meter;
use super::talk::{Failure, Talk, tell};
use super::values::{count, threads};

const EXAMPLES: &str = "\
Examples:
  motes simulate dam-break -o out_%04d.vtk                    4 s of 27,000 particles
  motes simulate 'drop?particles=1e5&seconds=2' -o d_{}.npz   parameters of the scenario
  motes simulate dam-break --frame 50 --set sph.viscosity=0.01 -o out.xyz
  motes simulate dam-break --restart out_0100.vtk --frame 0..50 -o on_%04d.vtk
  motes render sim:dam-break --frame 40 -o picture.png        no file between";

fn help() -> String {
    let scenarios = motes::scenarios();
    format!(
        "Scenarios and their parameters, with defaults:\n{scenarios}
  all: seconds (4), restart (a file), and what is under sph. in `motes scene`\n\n{EXAMPLES}"
    )
}

#[derive(Debug, clap::Args)]
#[command(after_long_help = help(), after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The scenario, with parameters if need be: dam-break, 'drop?particles=1e5' (--help has all)
    scenario: String,
    /// The files: .vtk, .npz or .xyz, with %04d or {} for the number of the frame
    #[arg(short, long, value_name = "FILES")]
    output: String,
    /// Frames to write, counted from 0: 7, 0..99, last
    #[arg(long, value_name = "N|A..B", default_value = "all")]
    frame: Frames,
    /// Go on from the last frame of this file
    #[arg(long, value_name = "FILE")]
    restart: Option<String>,
    /// A parameter of the scene, such as sph.solver=wcsph
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// Threads; default: all cores
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<usize>,
}

pub(crate) fn run(args: &Args, talk: Talk) -> Result<(), Failure> {
    let mut scene = Scene::default();
    for assignment in &args.set {
        scene.set_text(assignment).map_err(motes::Error::from)?;
    }
    let format = Format::of(Path::new(&args.output)).map_err(Failure::usage)?;
    let text = args.scenario.strip_prefix("sim:").unwrap_or(&args.scenario);
    let restart = args.restart.as_ref().map(|file| format!("restart={file}"));
    let joint = if text.contains('?') { "&" } else { "?" };
    let text = restart.map_or(text.to_owned(), |restart| format!("{text}{joint}{restart}"));
    let mut simulated = Simulated::new(&args.scenario, &text, &scene.sph)?;
    let last = simulated.frames() - 1;
    let (first, last) = match args.frame {
        Frames::One(frame) => (frame, frame),
        Frames::Last => (last, last),
        Frames::Range(first, end) => (first, end.unwrap_or(last)),
    };
    if first != last && numbered(&args.output, 0).is_none() {
        let message = format!("{}: expected %04d or {{}} for the number of the frame", args.output);
        return Err(Failure::usage(message));
    }
    let work = Work { format, output: &args.output, talk };
    let pool = args.threads.map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build());
    match pool.transpose().map_err(Failure::usage)? {
        Some(pool) => pool.install(|| work.write(&mut simulated, (first, last))),
        None => work.write(&mut simulated, (first, last)),
    }
}

/// What is done with each frame.
struct Work<'a> {
    format: Format,
    output: &'a str,
    talk: Talk,
}

impl Work<'_> {
    fn write(
        &self,
        simulated: &mut Simulated,
        (first, last): (usize, usize),
    ) -> Result<(), Failure> {
        // Two Ctrl-C end the program; the first one, after the step.
        let meter = Meter::new(Talk { quiet: true, ..self.talk });
        let bar = Bar::new(self.talk, (last - first + 1) as u64);
        let begun = Instant::now();
        let mut latest = SimulationStats::default();
        for frame in first..=last {
            let made = simulated.frame(frame, &mut |stats| {
                bar.tell(stats, begun);
                latest = *stats;
                meter.progress("simulate", 0, 1)
            });
            if !meter.progress("simulate", 0, 1) {
                return Err(motes::Error::Cancelled.into());
            }
            let made = made.map_err(motes::Error::from)?;
            let name = numbered(self.output, frame).unwrap_or_else(|| self.output.to_owned());
            self.save(&made, Path::new(&name))?;
            bar.next();
        }
        drop(bar);
        self.report(&latest, (first, last), begun);
        Ok(())
    }

    fn save(&self, particles: &Particles, path: &Path) -> Result<(), Failure> {
        let failed = |e: &dyn std::fmt::Display| Failure::data(format!("{}: {e}", path.display()));
        let mut file = Unfinished::create(path).map_err(motes::Error::from)?;
        self.format.write(particles, file.out()).map_err(|e| failed(&e))?;
        file.finish().map_err(motes::Error::from)?;
        Ok(())
    }

    fn report(&self, stats: &SimulationStats, (first, last): (usize, usize), begun: Instant) {
        if self.talk.quiet {
            return;
        }
        let secs = begun.elapsed().as_secs_f64();
        let (steps, particles) = (count(stats.steps as usize), count(stats.particles));
        let files = last - first + 1;
        tell(&format!(
            "{}: {files} frames, {particles} particles, {:.2} s in {steps} steps ({secs:.1} s)",
            self.output, stats.time
        ));
        if stats.put_back > 0 {
            let times = count(stats.put_back as usize);
            tell(&format!("motes: warning: {times} times a particle was put back into the tank"));
        }
    }
}

/// The bar: frames, simulated time, steps per second.
struct Bar(Option<ProgressBar>);

impl Bar {
    fn new(talk: Talk, frames: u64) -> Self {
        if talk.quiet || !std::io::stderr().is_terminal() {
            return Self(None);
        }
        let style = ProgressStyle::with_template("simulate [{bar:40}] {pos}/{len}  {msg}  {eta}");
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::new(frames).with_style(style.progress_chars("=> "));
        bar.enable_steady_tick(Duration::from_millis(500));
        Self(Some(bar))
    }

    fn tell(&self, stats: &SimulationStats, begun: Instant) {
        if let Some(bar) = &self.0 {
            let pace = stats.steps as f64 / begun.elapsed().as_secs_f64();
            bar.set_message(format!("{:.3} s, {pace:.0} steps/s", stats.time));
        }
    }

    fn next(&self) {
        if let Some(bar) = &self.0 {
            bar.inc(1);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
