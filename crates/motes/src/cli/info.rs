//! `motes info`: what a source holds.

use std::fmt::Write as _;

use motes::{Info, PropertyInfo, Range, Watch, info, open};

use super::frames::Frames;
use super::meter::Meter;
use super::talk::{Failure, Talk, print};
use super::values::{count, short};

/// Names shown of a property whose values are names.
const NAMES: usize = 12;

const EXAMPLES: &str = "\
Examples:
  motes info dump.lammpstrj             format, frames, box and properties
  motes info 'out_%04d.vtk' --frame 12  of frame 12 of a series of files
  motes info demo:dam:1e6 --json        for programs";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// A file, a quoted pattern of files, demo:KIND:N or sim:SCENARIO
    source: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// The frame to look at, counted from 0, or last
    #[arg(long, value_name = "N", default_value = "0")]
    frame: Frames,
}

pub(crate) fn run(args: &Args, talk: Talk) -> Result<(), Failure> {
    let mut series = open(&args.source)?;
    let meter = Meter::new(talk);
    let tell = |done, total| _ = meter.progress("read", done, total);
    let frame = match args.frame {
        Frames::One(frame) => frame,
        Frames::Last => series.frames(&tell).map_err(motes::Error::from)?.saturating_sub(1),
        Frames::Range(..) => return Err(Failure::usage("--frame: expected one frame, or last")),
    };
    let found = info(&mut series, frame, &tell)?;
    drop(meter);
    talk.warn(&found.warnings);
    let text = if args.json {
        let json = serde_json::to_string_pretty(&found);
        json.map_err(|e| Failure::data(format!("{}: {e}", args.source)))? + "\n"
    } else {
        summary(&found, &args.source, frame)
    };
    print(text.as_bytes())
}

fn summary(info: &Info, source: &str, frame: usize) -> String {
    let mut out = format!("{source}\n");
    let mut line = |name: &str, value: &str| _ = writeln!(out, "  {name:<10} {value}");
    line("format", &info.format);
    line("frames", &count(info.frames));
    if info.frames > 1 {
        line("frame", &frame.to_string());
    }
    if let Some(time) = info.time {
        line("time", &short(time));
    }
    if let Some(step) = info.step {
        line("step", &step.to_string());
    }
    line("particles", &count(info.particles));
    match &info.sim_box {
        None => line("box", "none"),
        Some(sim_box) => {
            line("box", &format!("from {}", point(&sim_box.origin)));
            for (vector, periodic) in sim_box.vectors.iter().zip(sim_box.periodic) {
                let kind = if periodic { ", periodic" } else { "" };
                line("", &format!("     {}{kind}", point(vector)));
            }
        }
    }
    match &info.bounds {
        None => line("bounds", "none"),
        Some(bounds) => {
            line("bounds", &format!("from {} to {}", point(&bounds.min), point(&bounds.max)));
        }
    }
    out + &table(&info.properties)
}

fn point(p: &[f64; 3]) -> String {
    format!("({})", p.map(short).join(", "))
}

fn table(properties: &[PropertyInfo]) -> String {
    let rows: Vec<[String; 3]> = properties.iter().map(row).collect();
    let width = |column: usize, least: usize| {
        rows.iter().map(|row| row[column].chars().count()).fold(least, usize::max)
    };
    let (name_width, kind_width) = (width(0, 8), width(1, 4));
    let mut out = format!("\n  {:<name_width$}  {:<kind_width$}  range\n", "property", "type");
    for [name, kind, range] in &rows {
        let _ = writeln!(out, "  {name:<name_width$}  {kind:<kind_width$}  {range}");
    }
    out
}

/// Name, type and range of a property.
fn row(property: &PropertyInfo) -> [String; 3] {
    let kind = match property.components {
        1 => property.kind.into(),
        n => format!("{} ×{n}", property.kind),
    };
    let range = match (&property.names, &property.min, &property.max) {
        (Some(names), ..) => {
            let shown: Vec<_> = names.iter().take(NAMES).map(String::as_str).collect();
            let more = names.len() - shown.len();
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            shown.join(" ") + &more
        }
        (None, Range::Scalar(min), Range::Scalar(max)) => ends(*min, *max),
        (None, Range::Vector(min), Range::Vector(max)) => {
            min.iter().zip(max).map(|(a, b)| ends(*a, *b)).collect::<Vec<_>>().join("   ")
        }
        _ => "none".into(),
    };
    [property.name.clone(), kind, range]
}

fn ends(min: Option<f64>, max: Option<f64>) -> String {
    match (min, max) {
        (Some(min), Some(max)) if min == max => short(min),
        (Some(min), Some(max)) => format!("{} … {}", short(min), short(max)),
        _ => "none".into(),
    }
}
