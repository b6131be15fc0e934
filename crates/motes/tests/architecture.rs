//! ARCHITECTURE.md against what cargo knows: the table of crates says which of them may depend on
//! which, and every third-party dependency has its reason.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Each crate and the crates of ours that it depends on.
type Edges = BTreeMap<String, BTreeSet<String>>;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn text(name: &str) -> String {
    std::fs::read_to_string(Path::new(ROOT).join(name)).unwrap()
}

/// The words in backticks.
fn code(markdown: &str) -> Vec<String> {
    markdown.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The rows of the table under `heading`, without the table's head: the cells of each.
fn table(document: &str, heading: &str) -> Vec<Vec<String>> {
    let (_, section) = document.split_once(&format!("\n## {heading}\n")).unwrap();
    let rows = section.lines().take_while(|line| !line.starts_with("## "));
    let rows = rows.filter_map(|line| line.strip_prefix('|'));
    rows.skip(2).map(|row| row.split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// Crate in the first column, what it may depend on in the second.
fn allowed(document: &str) -> Edges {
    let rows = table(document, "Crates");
    rows.iter().map(|row| (code(&row[0])[0].clone(), code(&row[1]).into_iter().collect())).collect()
}

/// What `cargo metadata --no-deps` says, normal dependencies only.
fn actual(metadata: &Value) -> Edges {
    let packages = metadata["packages"].as_array().unwrap();
    let ours: BTreeSet<_> = packages.iter().map(|p| p["name"].as_str().unwrap()).collect();
    let edges = |package: &Value| -> BTreeSet<String> {
        let all = package["dependencies"].as_array().unwrap().iter();
        let normal = all.filter(|d| d["kind"].is_null()).map(|d| d["name"].as_str().unwrap());
        normal.filter(|name| ours.contains(name)).map(str::to_owned).collect()
    };
    packages.iter().map(|p| (p["name"].as_str().unwrap().to_owned(), edges(p))).collect()
}

/// One line for each edge on one side only; a crate itself counts too.
fn differences(allowed: &Edges, actual: &Edges) -> Vec<String> {
    let flat = |edges: &Edges| -> BTreeSet<String> {
        let pairs = edges.iter().flat_map(|(from, to)| {
            to.iter().map(move |to| format!("{from} -> {to}")).chain([from.clone()])
        });
        pairs.collect()
    };
    let (allowed, actual) = (flat(allowed), flat(actual));
    let extra = actual.difference(&allowed).map(|e| format!("not in ARCHITECTURE.md: {e}"));
    let missing = allowed.difference(&actual).map(|e| format!("only in ARCHITECTURE.md: {e}"));
    extra.chain(missing).collect()
}

#[test]
fn crates_depend_on_each_other_as_the_table_says() {
    let cargo = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version=1", "--no-deps", "--offline"])
        .current_dir(ROOT)
        .output()
        .unwrap();
    assert!(cargo.status.success(), "{}", String::from_utf8_lossy(&cargo.stderr));
    let actual = actual(&serde_json::from_slice(&cargo.stdout).unwrap());
    assert_eq!(differences(&allowed(&text("ARCHITECTURE.md")), &actual), Vec::<String>::new());
}

#[test]
fn every_dependency_has_its_reason() {
    let manifest = text("Cargo.toml");
    let (_, section) = manifest.split_once("[workspace.dependencies]\n").unwrap();
    let section = section.lines().take_while(|line| !line.starts_with('['));
    let declared: BTreeSet<_> = section
        .filter(|line| !line.starts_with('#') && !line.contains("path ="))
        .filter_map(|line| line.split_once('=').map(|(name, _)| name.trim().to_owned()))
        .collect();
    assert!(declared.len() > 10, "the manifest was not understood: {declared:?}");

    let rows = table(&text("ARCHITECTURE.md"), "Dependencies");
    for row in &rows {
        assert!(row[1].len() > 10, "no reason for {}", row[0]);
    }
    let named: BTreeSet<_> = rows.iter().flat_map(|row| code(&row[0])).collect();
    assert_eq!(named, declared, "ARCHITECTURE.md against Cargo.toml");
}

#[test]
fn a_missing_and_an_extra_edge_are_both_found() {
    let document = "# A\n\n## Crates\n\n| crate | on | what |\n|---|---|---|\n\
                    | `top` | `floor`, `wall` | x |\n| `floor` | | y |\n| `wall` | | z |\n\n## B\n";
    let package = |name, on: &[&str]| {
        let on: Vec<_> = on.iter().map(|n| serde_json::json!({"name": n, "kind": null})).collect();
        serde_json::json!({"name": name, "dependencies": on})
    };
    let check = |top: &[&str], floor: &[&str]| {
        let packages = [package("top", top), package("floor", floor), package("wall", &[])];
        differences(&allowed(document), &actual(&serde_json::json!({"packages": packages})))
    };
    assert!(check(&["floor", "wall", "serde"], &[]).is_empty());
    assert_eq!(check(&["floor"], &[]), ["only in ARCHITECTURE.md: top -> wall"]);
    assert_eq!(check(&["floor", "wall"], &["top"]), ["not in ARCHITECTURE.md: floor -> top"]);
}
