//! `motes view`: a server for the browser, and the browser opened.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use motes::Gallery;
use motes_viewer::Server;

use super::render::SceneFlags;
use super::talk::{Failure, Talk, print, tell};
use super::values::{threads, whole};

const EXAMPLES: &str = "\
Examples:
  motes view                              without any file
  motes view dump.lammpstrj               opens the browser
  motes view 'out_*.vtk' --no-open        prints the address alone
  ssh -L 8765:localhost:8765 cluster motes view --no-open --port 8765 dump.lammpstrj";

/// The port that is tried first, so that bookmarks and tunnels stay.
const PORT: u16 = 8765;

/// How often new frames are looked for.
const FOLLOWING: Duration = Duration::from_secs(1);

/// As typed.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, args_override_self = true)]
pub(crate) struct Args {
    #[command(flatten)]
    given: SceneFlags,
    /// Frame to begin with, from 0
    #[arg(long, value_name = "N", value_parser = whole)]
    frame: Option<u32>,
    /// Look for new frames of files that are still being written
    #[arg(long)]
    follow: bool,
    /// Threads [default: all]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<usize>,
    /// Port; 0: any [default: 8765, or any if that is taken]
    #[arg(long, value_name = "N", help_heading = "Server")]
    port: Option<u16>,
    /// Open no browser
    #[arg(long, help_heading = "Server")]
    no_open: bool,
    /// Serve other machines too, by this address or name of this one
    #[arg(long, value_name = "ADDRESS", help_heading = "Server")]
    listen: Option<String>,
}

pub(crate) fn run(args: &Args, talk: Talk) -> Result<(), Failure> {
    let frame = args.frame.map(|n| n.to_string());
    let mut scene = args.given.scene(&[("--frame", "image.frame", &frame)])?;
    if !args.given.has_size() {
        // Until the page says how large it is.
        (scene.image.width, scene.image.height) = (1280, 720);
    }
    let server = args.bind()?;
    let stop = server.stop();
    let asked = AtomicBool::new(false);
    // Without a handler the system ends it, and clients are not told.
    let _ = ctrlc::set_handler(move || {
        if asked.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        stop.now();
    });
    if let Some(threads) = args.threads {
        motes::set_threads(threads)?;
    }
    let mut gallery = Gallery::open(scene)?;
    if args.follow {
        gallery.follow(FOLLOWING).map_err(Failure::data)?;
    }
    let address = server.address().map_err(Failure::data)?;
    let host = match &args.listen {
        Some(name) if name.contains(':') => format!("[{name}]"),
        Some(name) => name.clone(),
        None => address.ip().to_string(),
    };
    let url = format!("http://{host}:{}/?token={}", address.port(), server.token());
    print(format!("{url}\n").as_bytes())?;
    if let Some(name) = &args.listen {
        tell(&format!(
            "motes: warning: served at {name} without encryption: whoever can read the traffic can \
             look at these files; a tunnel (ssh -L) is safer"
        ));
    }
    if !args.no_open && !open_browser(&url) && !talk.quiet {
        tell("motes: open this address in a browser; Ctrl-C ends");
    }
    server.run(Arc::new(gallery)).map_err(Failure::data)
}

impl Args {
    fn bind(&self) -> Result<Server, Failure> {
        let at = |port| match &self.listen {
            Some(name) => Server::open(name, port),
            None => Server::local(port),
        };
        let bound = match self.port {
            Some(port) => at(port),
            None => at(PORT).or_else(|_| at(0)),
        };
        let name = self.listen.as_deref().unwrap_or("127.0.0.1");
        let port = self.port.unwrap_or(PORT);
        bound.map_err(|e| Failure::data(format!("{name}:{port}: {e}")))
    }
}

/// Opens the browser, where there is a way to.
fn open_browser(url: &str) -> bool {
    let (program, before): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(target_os = "windows") {
        ("rundll32", &["url.dll,FileProtocolHandler"])
    } else {
        ("xdg-open", &[])
    };
    let mut command = Command::new(program);
    command.args(before).arg(url);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().is_ok()
}
