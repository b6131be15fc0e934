//! Facts about files, from independent readers (`facts.json`), and how a reader is held against them.
//!
//! The files are no part of the repository; without them the tests that need them do nothing.
#![allow(dead_code)] // each test uses its part
#![allow(clippy::print_stderr)] // a test that does nothing says so

use std::path::{Path, PathBuf};

use motes_particles::read::{self, Reader, Wanted, names};
use motes_particles::{Particles, Radius};
use serde_json::Value;

/// The folder of test files outside the repository, if it is there.
pub(crate) fn shared_data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if !folder.join("facts.json").exists() {
        eprintln!("no {}: nothing is checked against it", folder.display());
        return None;
    }
    Some(folder)
}

/// The test files of the repository.
pub(crate) fn own_data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data")
}

/// A folder for the files that a test makes; `name` is the test's own.
pub(crate) fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Reads frame `frame` of `reader` with all its columns.
pub(crate) fn frame(reader: &mut dyn Reader, frame: usize) -> Particles {
    reader.read(frame, &Wanted::All, &|_, _| {}).unwrap_or_else(|e| panic!("{e}"))
}

/// Opens `path` and reads a frame.
pub(crate) fn read(path: &Path, number: usize) -> Particles {
    let (_, mut reader) = read::open(path).unwrap_or_else(|e| panic!("{e}"));
    frame(&mut *reader, number)
}

/// The files that `of_interest` picks by name and that an independent reader could read, with its facts.
pub(crate) fn facts(of_interest: impl Fn(&str) -> bool) -> Vec<(PathBuf, Value)> {
    let Some(folder) = shared_data() else { return Vec::new() };
    let facts = std::fs::read_to_string(folder.join("facts.json")).unwrap();
    let Value::Array(facts) = serde_json::from_str(&facts).unwrap() else { panic!("no list") };
    let path = |fact: &Value| folder.join(fact["file"].as_str().unwrap());
    facts
        .into_iter()
        .filter(|fact| of_interest(fact["file"].as_str().unwrap()) && !fact["reader"].is_null())
        .map(|fact| (path(&fact), fact))
        .collect()
}

/// Holds every file that `of_interest` picks by its name against its facts; gives their number.
pub(crate) fn check_facts(of_interest: impl Fn(&str) -> bool) -> usize {
    check_facts_with(of_interest, Value::clone)
}

/// As [`check_facts`], with the facts' properties made ours by `renamed`.
pub(crate) fn check_facts_with(
    of_interest: impl Fn(&str) -> bool,
    renamed: impl Fn(&Value) -> Value,
) -> usize {
    let facts = facts(of_interest);
    for (path, fact) in &facts {
        let mut fact = fact.clone();
        fact["properties"] = renamed(&fact["properties"]);
        check_file(path, &fact);
    }
    facts.len()
}

fn check_file(path: &Path, fact: &Value) {
    let file = fact["file"].as_str().unwrap();
    let (_, mut reader) = read::open(path).unwrap_or_else(|e| panic!("{e}"));
    let frames = reader.count(&|_, _| {}).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(Some(frames as u64), fact["frames"].as_u64(), "frames of {file}");
    let first = frame(&mut *reader, 0);
    let last = frame(&mut *reader, frames - 1);
    assert_eq!(
        Some(first.len() as u64),
        fact["particles_first_frame"].as_u64(),
        "particles of {file}"
    );
    assert_eq!(
        Some(last.len() as u64),
        fact["particles_last_frame"].as_u64(),
        "last particles of {file}"
    );
    if let (Some(low), Some(high)) = (triple(&fact["bbox_min"]), triple(&fact["bbox_max"])) {
        check_bounds(file, &first, low, high);
    }
    if let (Some(low), Some(high)) =
        (triple(&fact["bbox_last_frame"][0]), triple(&fact["bbox_last_frame"][1]))
    {
        check_bounds(file, &last, low, high);
    }
    check_cell(file, &first, fact);
    check_properties(file, &first, &fact["properties"]);
    check_properties(file, &last, &fact["properties_last_frame"]);
}

fn triple(value: &Value) -> Option<[f64; 3]> {
    let values: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    values?.try_into().ok()
}

/// Facts have six digits; f32 positions are good to 2⁻²³ of the extent.
fn assert_close(what: &str, found: f64, expected: f64, scale: f64) {
    let tolerance = 1e-5 * expected.abs() + 5e-7 * scale;
    assert!((found - expected).abs() <= tolerance, "{what}: found {found}, expected {expected}");
}

fn check_bounds(file: &str, particles: &Particles, low: [f64; 3], high: [f64; 3]) {
    let (found_low, found_high) =
        particles.bounds().unwrap_or_else(|| panic!("no bounds of {file}"));
    let extent = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    for axis in 0..3 {
        assert_close(&format!("{file}: low {axis}"), found_low[axis], low[axis], extent);
        assert_close(&format!("{file}: high {axis}"), found_high[axis], high[axis], extent);
    }
}

/// `cell_vectors_and_origin` has rows x, y, z and columns a, b, c, origin.
fn check_cell(file: &str, particles: &Particles, fact: &Value) {
    let Some(rows) = fact["cell_vectors_and_origin"].as_array() else { return };
    let sim_box = particles.sim_box.unwrap_or_else(|| panic!("{file}: no box"));
    let scale = sim_box.vectors.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (axis, row) in rows.iter().enumerate() {
        for k in 0..4 {
            let expected = row[k].as_f64().unwrap();
            let found = if k == 3 { sim_box.origin[axis] } else { sim_box.vectors[k][axis] };
            assert_close(&format!("{file}: cell {axis} {k}"), found, expected, scale);
        }
    }
    for (axis, flag) in fact["pbc"].as_array().into_iter().flatten().enumerate() {
        assert_eq!(Some(sim_box.periodic[axis]), flag.as_bool(), "{file}: periodic {axis}");
    }
}

fn check_properties(file: &str, particles: &Particles, properties: &Value) {
    for (name, range) in properties.as_object().into_iter().flatten() {
        let (Some(low), Some(high)) = (range["min"].as_f64(), range["max"].as_f64()) else {
            continue;
        };
        let (found_low, found_high) =
            property_range(particles, name).unwrap_or_else(|| panic!("{file}: no {name}"));
        // What may be a position is f32 about an origin.
        let scale = high - low;
        assert_close(&format!("{file}: least {name}"), found_low, low, scale);
        assert_close(&format!("{file}: greatest {name}"), found_high, high, scale);
    }
}

/// The range of a property as a fact names it: `Force[1]`, `Vel:0`, `Velocity Magnitude`, `Mass`.
fn property_range(particles: &Particles, name: &str) -> Option<(f64, f64)> {
    let (stem, index) = match name.split_once(['[', ':']) {
        Some((stem, index)) => match index.trim_end_matches(']').parse::<usize>() {
            Ok(index) => (stem, index),
            Err(_) => (name, 0),
        },
        None => (name, 0),
    };
    let standard = names::standard(stem).unwrap_or(stem);
    if standard == names::POSITION {
        return particles.bounds().map(|(low, high)| (low[index], high[index]));
    }
    // A table's coordinates, by their own names.
    let geographic = ["longitude", "latitude", "altitude"];
    if let Some(axis) = geographic.iter().position(|axis| name.starts_with(axis)) {
        return particles.bounds().map(|(low, high)| (low[axis], high[axis]));
    }
    if standard == names::RADIUS
        && let Radius::Each(radii) = &particles.radius
    {
        return Some((
            f64::from(radii.iter().copied().fold(f32::MAX, f32::min)),
            f64::from(radii.iter().copied().fold(f32::MIN, f32::max)),
        ));
    }
    let column = |name: &str| particles.column(name);
    if let Some(column) = column(name).or_else(|| column(standard)).or_else(|| column(stem)) {
        return column.range().get(index).copied().flatten();
    }
    if let Some((standard, index, _)) = names::component(name) {
        return column(standard)?.range().get(index).copied().flatten();
    }
    let vector =
        column(name.strip_suffix(" Magnitude").or_else(|| name.strip_suffix(":Magnitude"))?)?;
    let lengths = (0..vector.rows()).map(|row| vector.magnitude(row));
    Some(lengths.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v))))
}

/// Reads `bytes`, as a file called `name`, as a user would: nothing may panic or take long.
pub(crate) fn read_damaged(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    let Ok((_, mut reader)) = read::open(&path) else { return };
    let count = reader.count(&|_, _| {}).unwrap_or(1);
    for frame in [0, count.saturating_sub(1), count] {
        drop(reader.read(frame, &Wanted::All, &|_, _| {}));
    }
}

/// Damages a file in `variants` ways, always the same: cut at many places, bytes overwritten, bits
/// flipped, a piece left out.
pub(crate) fn damage(bytes: &[u8], variants: u64, mut use_it: impl FnMut(&[u8])) {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below.max(1) as u64) as usize
    };
    for variant in 0..variants {
        let mut bytes = bytes.to_vec();
        match variant % 4 {
            0 => bytes.truncate(random(bytes.len())),
            1 => (0..3).for_each(|_| {
                let at = random(bytes.len());
                bytes[at] ^= 1 << random(8);
            }),
            2 => (0..2).for_each(|_| {
                // Headers are where damage matters most.
                let at = random(bytes.len().min(400));
                bytes[at] = b"0123456789-. \n\"\xff\0e,"[random(19)];
            }),
            _ => {
                let start = random(bytes.len());
                let end = (start + random(200)).min(bytes.len());
                bytes.drain(start..end);
            }
        }
        use_it(&bytes);
    }
}
