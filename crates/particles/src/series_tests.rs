//! The series with readers that live in memory.

use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use super::*;
use crate::Radius;

/// What a fake file did, seen from outside.
#[derive(Default)]
struct Seen {
    opened: AtomicUsize,
    counted: AtomicUsize,
    read: AtomicUsize,
    alive: AtomicUsize,
}

/// A file whose frame `i` holds `first + i` particles; frame `broken` fails.
struct Fake {
    path: PathBuf,
    first: usize,
    frames: usize,
    broken: Option<usize>,
    seen: Arc<Seen>,
}

impl Reader for Fake {
    fn count(&mut self, _: Progress<'_>) -> Result<usize> {
        self.seen.counted.fetch_add(1, SeqCst);
        Ok(self.frames)
    }

    fn read(&mut self, frame: usize, wanted: &Wanted, _: Progress<'_>) -> Result<Particles> {
        self.seen.read.fetch_add(1, SeqCst);
        if frame >= self.frames || self.broken == Some(frame) {
            return Err(ReadError::new(&self.path, Place::Frame(frame), "broken"));
        }
        // Readers work in rayon's pool.
        let count = self.first + frame;
        let positions = (0..count).into_par_iter().map(|i| [i as f32; 3]).collect();
        let values = crate::Values::I32(vec![frame as i32; count]);
        let mut columns = match wanted.wants("Mass") {
            true => vec![crate::Column::new("Mass", 1, values)],
            false => vec![],
        };
        if let Wanted::Only(_) = wanted
            && wanted.wants(names::PARTICLE_IDENTIFIER)
        {
            let ids = crate::Values::I64((0..count as i64).collect());
            columns.push(crate::Column::new(names::PARTICLE_IDENTIFIER, 1, ids));
        }
        Ok(Particles { positions, columns, ..Particles::default() })
    }

    fn warnings(&self) -> Vec<String> {
        vec!["the last frame is incomplete".into()]
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.seen.alive.fetch_sub(1, SeqCst);
    }
}

/// Files `0`, `1`, … with so many frames each; file `i` holds 100 i + frame particles; a file of
/// no frames cannot be opened.
fn series(frames: &'static [usize], broken: Option<usize>) -> (Series, Arc<Seen>) {
    let seen = Arc::new(Seen::default());
    let inside = seen.clone();
    let opener = move |path: &Path| -> Result<(&'static str, Box<dyn Reader>)> {
        let file: usize = path.to_string_lossy().parse().unwrap_or(0);
        inside.opened.fetch_add(1, SeqCst);
        if frames[file] == 0 {
            return Err(ReadError::new(path, Place::Whole, "the file is empty"));
        }
        inside.alive.fetch_add(1, SeqCst);
        let (first, frames, seen) = (100 * file, frames[file], inside.clone());
        Ok(("fake", Box::new(Fake { path: path.into(), first, frames, broken, seen })))
    };
    let paths = (0..frames.len()).map(|i| PathBuf::from(i.to_string())).collect();
    match Series::of_files("{}", paths, Box::new(opener)) {
        Ok(series) => (series, seen),
        Err(e) => panic!("{e}"),
    }
}

fn particles(series: &mut Series, frame: usize) -> std::result::Result<usize, String> {
    let frame = series.frame(frame, &Wanted::All, &|_, _| {});
    frame.map(|p| p.len()).map_err(|e| e.to_string())
}

/// Waits until nothing is being read ahead.
fn settle(series: &Series, seen: &Seen, reads: usize) {
    for _ in 0..2000 {
        if seen.read.load(SeqCst) >= reads {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    drop(lock(&series.shared.core));
}

#[test]
fn frames_of_several_files_follow_each_other() {
    let (mut series, _) = series(&[2, 1, 3], None);
    let all: Vec<_> = (0..6).map(|n| particles(&mut series, n)).collect();
    assert_eq!(all, [Ok(0), Ok(1), Ok(100), Ok(200), Ok(201), Ok(202)]);
    assert_eq!(series.frames(&|_, _| {}), Ok(6));
    assert_eq!((series.format(), series.source()), ("fake", "{}"));
    let error = particles(&mut series, 6);
    assert_eq!(error, Err("2: there is no frame 6; the frames are 0 to 5".into()));
}

#[test]
fn any_order_gives_the_same_frames() {
    let (mut series, _) = series(&[2, 1, 3], None);
    for (n, count) in [(5, 202), (0, 0), (3, 200), (2, 100), (1, 1), (4, 201), (5, 202)] {
        assert_eq!(particles(&mut series, n), Ok(count));
    }
}

#[test]
fn the_first_frame_counts_nothing() {
    let (mut series, seen) = series(&[5, 5], None);
    assert_eq!(particles(&mut series, 0), Ok(0));
    assert_eq!(seen.counted.load(SeqCst), 0);
    assert_eq!((seen.opened.load(SeqCst), seen.read.load(SeqCst)), (1, 1));
}

#[test]
fn a_single_file_is_never_counted_to_read_a_frame() {
    let (mut series, seen) = series(&[5], None);
    assert_eq!(particles(&mut series, 3), Ok(3));
    assert!(particles(&mut series, 9).is_err());
    assert_eq!(seen.counted.load(SeqCst), 0);
}

#[test]
fn the_next_frame_is_read_ahead_once_two_came_in_order() {
    let (mut series, seen) = series(&[9], None);
    assert_eq!(particles(&mut series, 0), Ok(0));
    assert_eq!(particles(&mut series, 1), Ok(1));
    settle(&series, &seen, 3);
    assert_eq!(seen.read.load(SeqCst), 3);
    assert_eq!(particles(&mut series, 2), Ok(2));
    settle(&series, &seen, 4);
    // Going back is served from memory and reads nothing.
    assert_eq!(particles(&mut series, 1), Ok(1));
    assert_eq!(seen.read.load(SeqCst), 4);
}

#[test]
fn an_error_ahead_waits_until_it_is_asked_for() {
    let (mut series, seen) = series(&[9], Some(2));
    assert_eq!(particles(&mut series, 0), Ok(0));
    assert_eq!(particles(&mut series, 1), Ok(1));
    settle(&series, &seen, 3);
    assert_eq!(particles(&mut series, 1), Ok(1));
    assert_eq!(particles(&mut series, 2), Err("0: frame 2: broken".into()));
    assert_eq!(particles(&mut series, 3), Ok(3));
}

#[test]
fn dropping_the_series_ends_its_thread_and_closes_its_files() {
    let (mut series, seen) = series(&[4, 4, 4], None);
    for n in 0..12 {
        assert!(particles(&mut series, n).is_ok());
        assert!(seen.alive.load(SeqCst) <= OPEN_FILES + 1);
    }
    assert!(series.ahead.is_some());
    let shared = Arc::downgrade(&series.shared);
    drop(series);
    assert_eq!(shared.strong_count(), 0);
    assert_eq!(seen.alive.load(SeqCst), 0);
}

#[test]
fn asking_from_inside_the_pool_does_not_lock_up() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let run = || {
        let (mut series, _) = series(&[40], None);
        assert!((0..40).all(|n| particles(&mut series, n) == Ok(n)));
    };
    // In the pool that the read-ahead thread uses, on every thread of it, and in a pool of its own.
    (0..8).into_par_iter().for_each(|_| run());
    pool.map(|pool| pool.install(run)).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn columns_left_out_are_read_when_wanted_later() {
    let (mut series, seen) = series(&[2], None);
    let only = |name: &str| Wanted::Only(vec![name.into()]);
    let mut columns = |wanted| series.frame(1, &wanted, &|_, _| {}).map(|p| p.columns.len());
    assert_eq!(columns(only("Charge")), Ok(0));
    assert_eq!(columns(only("Charge")), Ok(0));
    assert_eq!(seen.read.load(SeqCst), 1);
    assert_eq!(columns(Wanted::All), Ok(1));
    assert_eq!(columns(only("Mass")), Ok(1));
    assert_eq!(seen.read.load(SeqCst), 2);
}

#[test]
fn a_last_file_that_is_broken_is_left_out_with_a_warning() {
    let (mut series, _) = series(&[2, 2, 0], None);
    assert_eq!(series.frames(&|_, _| {}), Ok(4));
    assert_eq!(particles(&mut series, 3), Ok(101));
    let warnings = series.warnings();
    assert!(warnings.contains(&"left out: 2: the file is empty".into()), "{warnings:?}");
    assert!(warnings.contains(&"1: the last frame is incomplete".into()), "{warnings:?}");
    assert_eq!(warnings.len(), 3);
    assert!(particles(&mut series, 4).is_err_and(|e| e.contains("no frame 4")));
}

#[test]
fn a_broken_file_in_the_middle_is_an_error() {
    let (mut series, _) = series(&[2, 0, 2], None);
    assert!(series.frames(&|_, _| {}).is_err_and(|e| e.to_string() == "1: the file is empty"));
    assert_eq!(particles(&mut series, 1), Ok(1));
    assert!(particles(&mut series, 2).is_err_and(|e| e.contains("empty")));
}

#[test]
fn the_cache_is_bounded_by_bytes() {
    let (series, _) = series(&[1], None);
    let mut core = lock(&series.shared.core);
    for frame in 0..10 {
        let positions = vec![[0.0; 3]; CACHE_BYTES / 12 / 4];
        let particles = Arc::new(Particles { positions, ..Particles::default() });
        core.cache.push_back(Cached { frame, wanted: Wanted::All, particles });
        core.make_room();
        assert!(core.cache.len() <= 5);
    }
    assert_eq!(core.cache.front().map(|c| c.frame), Some(5));
}

#[test]
fn a_reader_that_is_no_file_is_a_series_too() {
    let seen = Arc::new(Seen { alive: AtomicUsize::new(1), ..Seen::default() });
    let fake = Fake { path: "sim".into(), first: 7, frames: 3, broken: None, seen };
    let mut series = Series::from_reader("simulation", Box::new(fake));
    assert_eq!(particles(&mut series, 2), Ok(9));
    assert_eq!(series.frames(&|_, _| {}), Ok(3));
    assert_eq!(series.warnings(), ["the last frame is incomplete"]);
}

#[test]
fn a_frame_that_is_taken_is_not_kept() {
    let (mut series, seen) = series(&[3], None);
    let mut particles = series.take(1, &Wanted::All, &|_, _| {}).unwrap();
    assert_eq!((particles.len(), seen.read.load(SeqCst)), (1, 1));
    // What is kept already is not read again, nor lost to who holds it.
    let held = series.frame(1, &Wanted::All, &|_, _| {}).unwrap();
    assert_eq!(series.take(1, &Wanted::All, &|_, _| {}).unwrap(), *held);
    assert_eq!(seen.read.load(SeqCst), 2);
    series.take(1, &Wanted::All, &|_, _| {}).unwrap();
    assert_eq!(seen.read.load(SeqCst), 3);

    assert_eq!(particles.take_positions(), held.positions);
    assert_eq!((particles.len(), particles.positions.len()), (1, 0));
    assert_eq!(particles.columns, held.columns);
}

#[test]
fn equal_radii_are_one_radius() {
    let simplified = |radii: &[f32]| Radius::Each(radii.to_vec()).simplified();
    assert_eq!(simplified(&[0.5, 0.5, 0.5]), Radius::Uniform(0.5));
    assert_eq!(simplified(&[0.5, 0.5, 0.25]), Radius::Each(vec![0.5, 0.5, 0.25]));
    assert_eq!(simplified(&[]), Radius::Each(vec![]));
    assert_eq!(Radius::Unknown.simplified(), Radius::Unknown);
}

#[test]
fn ages_are_known_over_files_and_only_where_they_are_wanted() {
    let (mut series, seen) = series(&[3, 2], None);
    let only = |name: &str| Wanted::Only(vec![name.into()]);
    series.add_ages();
    assert_eq!(series.frame(4, &only("Mass"), &|_, _| {}).map(|p| p.columns.len()), Ok(1));
    assert_eq!(seen.read.load(SeqCst), 1);
    let mut ages = |frame| {
        let particles = series.frame(frame, &only("age"), &|_, _| {}).unwrap();
        let column = particles.column(names::AGE).unwrap();
        (0..column.rows()).map(|row| column.number(row, 0)).collect::<Vec<_>>()
    };
    // Frames 0, 1, 2 hold the particles below 0, 1, 2; frames 3 and 4 those below 100 and 101.
    let last = ages(4);
    assert_eq!(
        (last.len(), &last[..3], last[99], last[100]),
        (101, &[3.0, 2.0, 1.0][..], 1.0, 0.0)
    );
    assert_eq!(ages(2), [1.0, 0.0]);
}
