//! The viewer in a real browser: `crates/viewer/tests/browser`, by Node, Chromium and playwright-core.
//!
//! `MOTES_BROWSER` names a folder whose `node_modules` has playwright-core. What is missing is said, and the
//! tests are left out; with `MOTES_BROWSER_TESTS=1` it is an error.

#![allow(clippy::disallowed_methods)] // what a machine has is found in its environment

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

const TESTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../viewer/tests/browser");

/// Names that Chromium goes by.
const CHROMIUM: &[&str] = &["chromium", "chromium-browser", "google-chrome", "chrome"];

/// A program of `PATH`.
fn program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file())
}

/// What is needed: Node, Chromium, and the folder with playwright-core.
fn tools() -> Result<(PathBuf, PathBuf, PathBuf), &'static str> {
    let node = program("node").ok_or("there is no node")?;
    let chromium = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let chromium = chromium.or_else(|| CHROMIUM.iter().copied().find_map(program));
    let chromium = chromium.ok_or("there is no chromium")?;
    let folder = std::env::var_os("MOTES_BROWSER").map(PathBuf::from);
    let folder = folder.filter(|f| f.join("node_modules/playwright-core").is_dir());
    let folder = folder.ok_or("MOTES_BROWSER names no folder with playwright-core")?;
    Ok((node, chromium, folder))
}

#[test]
fn the_viewer_in_a_browser() {
    let (node, chromium, folder) = match tools() {
        Ok(tools) => tools,
        Err(missing) => {
            let required = std::env::var_os("MOTES_BROWSER_TESTS").is_some_and(|v| v == "1");
            assert!(!required, "{missing}");
            // Around the harness, which shows nothing of a test that passes.
            let _ = writeln!(std::io::stderr(), "BROWSER TESTS LEFT OUT: {missing}");
            return;
        }
    };
    let mut tests: Vec<PathBuf> = Path::new(TESTS)
        .read_dir()
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_str().is_some_and(|p| p.ends_with(".test.mjs")))
        .collect();
    tests.sort();
    assert!(!tests.is_empty());
    let run = Command::new(node)
        .args(["--test", "--test-reporter=spec", "--test-concurrency=1"])
        // What a server has let go may keep Node waiting, and no test takes minutes.
        .args(["--test-force-exit", "--test-timeout=300000"])
        .args(tests)
        .env("MOTES", env!("CARGO_BIN_EXE_motes"))
        .env("MOTES_BROWSER", folder)
        .env("MOTES_PATIENCE_MS", "90000")
        .env("CHROMIUM", chromium)
        .output()
        .unwrap();
    let [said, wrong] = [run.stdout, run.stderr].map(|s| String::from_utf8_lossy(&s).into_owned());
    assert!(run.status.success(), "{said}\n{wrong}");
}
