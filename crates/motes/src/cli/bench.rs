//! `motes bench`: the papers' tables, or one line for a source.

use motes::bench::{
    Line, Source, Table, Tables, density_source, density_tables, peer_view, sections_source,
    sections_tables, spheres_source, spheres_tables, surface_defaults, surface_source,
    surface_tables,
};
use motes::{Error, Scene};

use super::meter::Meter;
use super::render::{CameraFlags, set_flags};
use super::talk::{Failure, Talk, print};
use super::values::{short, size, threads, whole};

const EXAMPLES: &str = "\
Examples:
  motes bench spheres                                    the paper's tables: minutes and 4 GB
  motes bench spheres --scale 0.1 --stages table2,table4 some of them, on smaller sets
  motes bench spheres --source demo:dam:1e6 --peer-view --json
  motes bench surface --scale 0.1 --stages table2,fig8   liquids: the paper's views, on smaller sets
  motes bench surface --source demo:dam:1e6 --set surface.mode=translucent --json
  motes bench density --source 'sim:dam-break?particles=27000' --set density.resolution=64
  motes bench sections --scale 0.1                       cuts: frames, and planes that come, move and go";

/// As typed.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, arg_required_else_help = true, args_override_self = true)]
pub(crate) struct Args {
    /// The way of seeing: spheres, surface or density; or sections
    #[arg(value_name = "METHOD", hide_possible_values = true)]
    method: Method,
    /// Measure this source; without it, the paper's sets
    #[arg(long, value_name = "SOURCE")]
    source: Option<String>,
    /// Pixels, or 720p, 1080p, 1440p, 4k, 8k [default: 1024x1024; surface: 1080p; density: 512x512]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Frames of which the median counts
    #[arg(long, value_name = "N", value_parser = whole, default_value = "5")]
    frames: u32,
    /// Tables or stages, with commas [default: all]
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    stages: Vec<String>,
    /// Factor on the particles of the paper's sets
    #[arg(long, value_name = "S", conflicts_with = "source")]
    scale: Option<f64>,
    /// Threads [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<usize>,
    /// The camera and light of the programs compared with
    #[arg(long, requires = "source")]
    peer_view: bool,
    #[command(flatten)]
    camera: CameraFlags,
    /// Any parameter that `motes scene` prints
    #[arg(long, value_name = "PATH=VALUE", requires = "source")]
    set: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Method {
    Spheres,
    Surface,
    Density,
    Sections,
}

impl Method {
    /// Pixels of a picture where nothing is said: the papers' (§5 of both).
    fn size(self) -> [u32; 2] {
        match self {
            Self::Surface => [1920, 1080],
            Self::Density => [512; 2],
            _ => [1024; 2],
        }
    }
}

pub(crate) fn run(args: &Args, talk: Talk) -> Result<(), Failure> {
    if args.frames == 0 {
        return Err(Failure::usage("--frames 0: expected 1 or more"));
    }
    let meter = Meter::new(talk);
    let text = match &args.source {
        Some(source) => {
            let options = Source {
                scene: args.scene(source)?,
                frames: args.frames as usize,
                stages: args.stages.clone(),
                threads: args.threads,
            };
            let line = match args.method {
                Method::Surface => surface_source(options, &meter)?,
                Method::Density => density_source(options, &meter)?,
                Method::Sections => sections_source(options, &meter)?,
                Method::Spheres => spheres_source(options, &meter)?,
            };
            if args.json { json(&line)? } else { one_line(&line) }
        }
        None => {
            let options = args.tables()?;
            let tables = match args.method {
                Method::Surface => surface_tables(&options, &meter)?,
                Method::Density => density_tables(&options, &meter)?,
                Method::Sections => sections_tables(&options, &meter)?,
                Method::Spheres => spheres_tables(&options, &meter)?,
            };
            let text = || tables.iter().map(Table::to_string).collect::<Vec<_>>().join("\n");
            if args.json { json(&tables)? } else { text() }
        }
    };
    drop(meter);
    print(text.as_bytes())
}

impl Args {
    /// What the tables are made with.
    fn tables(&self) -> Result<Tables, Failure> {
        if let Some(flag) = self.camera.first() {
            return Err(Failure::usage(format!(
                "{flag}: needs --source; the tables have own views"
            )));
        }
        let scale = self.scale.unwrap_or(1.0);
        if !(scale > 0.0 && scale <= 10.0) {
            return Err(Failure::usage(format!("--scale {scale}: expected above 0, at most 10")));
        }
        let [width, height] = self.size.unwrap_or(self.method.size());
        // Some tables double it, and no scene has more pixels than it can have.
        let mut scene = Scene::default();
        (scene.image.width, scene.image.height) =
            (width.saturating_mul(2), height.saturating_mul(2));
        scene.check().map_err(|e| Failure::usage(format!("--size, twice: {e}")))?;
        Ok(Tables {
            size: (width, height),
            frames: self.frames as usize,
            stages: self.stages.clone(),
            scale,
            threads: self.threads,
        })
    }

    /// The scene of a source: one sample per pixel, of a liquid no shadows and no occlusion, then what was typed.
    fn scene(&self, source: &str) -> Result<Scene, Failure> {
        let mut scene = Scene::default();
        scene.set_sources(&[source.into()]);
        [scene.image.width, scene.image.height] = self.size.unwrap_or(self.method.size());
        scene.image.samples = 1;
        if matches!(self.method, Method::Surface | Method::Density) {
            surface_defaults(&mut scene);
        }
        if self.peer_view {
            peer_view(&mut scene);
        }
        set_flags(&mut scene, &self.camera.typed())?;
        for assignment in &self.set {
            scene.set_text(assignment).map_err(|e| Failure::usage(format!("--set: {e}")))?;
        }
        scene.check().map_err(Error::from)?;
        Ok(scene)
    }
}

fn json(value: &impl serde::Serialize) -> Result<String, Failure> {
    serde_json::to_string(value).map(|text| text + "\n").map_err(Failure::data)
}

/// A line for people.
fn one_line(line: &Line) -> String {
    let ms: Vec<_> = line.ms.iter().map(|(name, ms)| format!("{name} {} ms", short(*ms))).collect();
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let bytes: Vec<_> =
        line.bytes.iter().map(|(name, bytes)| format!("{name} {:.1} MiB", mib(*bytes))).collect();
    let primary = line.primary.map_or_else(String::new, |primary| format!(", {primary}"));
    format!(
        "{}: {} particles, {} threads, {}{primary}: {}; {}; {}\n",
        line.source,
        line.particles,
        line.threads,
        line.simd,
        ms.join(", "),
        bytes.join(", "),
        line.hash
    )
}
