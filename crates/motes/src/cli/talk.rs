//! What is said to the user, and where.

use std::fmt::Display;
use std::io::{ErrorKind, Write};

/// How much is said.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Talk {
    /// Say nothing but errors
    #[arg(short, long, global = true, conflicts_with = "verbose", display_order = 900)]
    pub quiet: bool,
    /// Say more: where the time and the memory go
    #[arg(short, long, global = true, display_order = 901)]
    pub verbose: bool,
}

impl Talk {
    /// Tells of what was odd but could be read.
    pub fn warn(self, warnings: &[String]) {
        if !self.quiet {
            warnings.iter().for_each(|warning| tell(&format!("motes: warning: {warning}")));
        }
    }
}

/// Why nothing came of it, and the exit code: 2 for bad usage, 1 for bad data.
#[derive(Debug)]
pub(crate) struct Failure {
    pub message: String,
    pub code: u8,
}

impl Failure {
    /// The command line makes no sense.
    pub fn usage(message: impl Display) -> Self {
        Self { message: message.to_string(), code: 2 }
    }

    /// Something outside failed.
    pub fn data(message: impl Display) -> Self {
        Self { message: message.to_string(), code: 1 }
    }
}

impl From<motes::Error> for Failure {
    fn from(error: motes::Error) -> Self {
        Self { code: error.exit_code(), message: error.to_string() }
    }
}

/// A line on stderr. Where nobody can hear it, nothing is to be done.
pub(crate) fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Writes to stdout; a reader that has gone has read enough.
pub(crate) fn print(text: &[u8]) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::data(format!("stdout: {e}"))),
        _ => Ok(()),
    }
}
