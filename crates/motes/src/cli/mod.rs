//! The verbs, and how the command line speaks: results on stdout, everything else on stderr.

mod bench;
mod frames;
mod info;
mod meter;
mod render;
mod scene;
mod section;
mod simulate;
mod talk;
mod values;
mod view;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use talk::{Failure, Talk, print};

const EXAMPLES: &str = "\
Examples:
  motes render -o picture.png                       a picture, without any file
  motes info dump.lammpstrj                         what a file holds
  motes view dump.lammpstrj                         walk through it in the browser
  motes render dump.lammpstrj -o out.png            a picture of it
  motes render picture.png --size 4k -o large.png   the same picture, larger
  motes scene                                       every parameter there is";

/// Turns particle files into ray-traced pictures
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = EXAMPLES,
    arg_required_else_help = true,
    disable_help_subcommand = true,
    subcommand_value_name = "VERB",
    subcommand_help_heading = "Verbs"
)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    talk: Talk,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Tell what a source holds: format, frames, particles, box, properties
    Info(info::Args),
    /// Render a picture of one or more sources
    Render(Box<render::Args>),
    /// Look at one or more sources in the browser
    View(Box<view::Args>),
    /// Print the scene: every parameter, its default and its meaning
    Scene(scene::Args),
    /// Cut along a line drawn on the picture
    Section(section::Args),
    /// Simulate a liquid and write its frames
    Simulate(simulate::Args),
    /// Measure: the papers' tables, or one source
    Bench(Box<bench::Args>),
    /// Print a completion script for a shell
    #[command(
        after_help = "Example:\n  motes completions bash > ~/.local/share/bash-completion/completions/motes"
    )]
    Completions {
        /// The shell
        #[arg(value_name = "SHELL")]
        shell: clap_complete::Shell,
    },
}

/// Does what the command line says; gives the exit code.
pub(crate) fn main() -> ExitCode {
    std::panic::set_hook(Box::new(|panic| {
        talk::tell(&format!("motes: this should not happen and is a fault of Motes: {panic}"));
    }));
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            talk::tell(&format!("motes: {}", failure.message));
            ExitCode::from(failure.code)
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    match cli.verb {
        Verb::Info(args) => info::run(&args, cli.talk),
        Verb::Render(args) => render::run(&args, cli.talk),
        Verb::View(args) => view::run(&args, cli.talk),
        Verb::Scene(args) => scene::run(&args),
        Verb::Section(args) => section::run(&args, cli.talk),
        Verb::Simulate(args) => simulate::run(&args, cli.talk),
        Verb::Bench(args) => bench::run(&args, cli.talk),
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "motes", &mut script);
            print(&script)
        }
    }
}

/// Help and version go to stdout; what could not be understood is told like every other error.
fn refuse(error: &clap::Error) -> ExitCode {
    use clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
    if !error.use_stderr() || error.kind() == DisplayHelpOnMissingArgumentOrSubcommand {
        // A reader of the help who has gone needs no more of it.
        let _ = error.print();
    } else {
        let text = error.to_string();
        talk::tell(&format!("motes: {}", text.strip_prefix("error: ").unwrap_or(&text).trim_end()));
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}
