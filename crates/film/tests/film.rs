//! A film from outside: what is written is what was shown, and there is a file only when it is whole.

use std::fs;
use std::path::{Path, PathBuf};

use motes_film::{Film, FilmError, Settings};
use motes_frame::Rgba8;
use rusty_h264_decoder::Decoder;

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("film-{name}"));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

const SIZE: (usize, usize) = (96, 64);

fn settings(quality: u32) -> Settings {
    Settings { size: (SIZE.0 as u32, SIZE.1 as u32), fps: 25.0, quality }
}

/// A disk that goes to the right over a ramp of grey.
fn picture(number: usize, (width, height): (usize, usize)) -> Rgba8 {
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let (dx, dy) = (x as f32 - 20.0 - 2.0 * number as f32, y as f32 - 30.0);
        let grey = (255 * y / height) as u8;
        if dx * dx + dy * dy < 200.0 { [220, 60, 30, 255] } else { [grey, grey, grey, 255] }
    };
    Rgba8 { width, height, pixels: (0..width * height).map(pixel).collect() }
}

fn record(path: &Path, settings: Settings, count: usize) -> Result<(), FilmError> {
    let mut film = Film::create(path, settings)?;
    for number in 0..count {
        film.add(picture(number, (settings.size.0 as usize, settings.size.1 as usize)))?;
    }
    film.finish()
}

/// The luma planes of a film, decoded: its data has a length before each unit, and its parameter sets
/// stand in the box `avcC`.
fn decode(path: &Path) -> Vec<Vec<u8>> {
    let bytes = fs::read(path).unwrap();
    let find = |name: &[u8]| bytes.windows(4).position(|w| w == name).unwrap() + 4;
    let number = |at: usize, n: usize| {
        bytes[at..at + n].iter().fold(0, |v, byte| v << 8 | usize::from(*byte))
    };
    let mut stream = Vec::new();
    let mut add = |unit: &[u8]| {
        stream.extend([0, 0, 0, 1]);
        stream.extend(unit);
    };
    let avcc = find(b"avcC");
    let sps = number(avcc + 6, 2);
    add(&bytes[avcc + 8..avcc + 8 + sps]);
    let pps = number(avcc + 9 + sps, 2);
    add(&bytes[avcc + 11 + sps..avcc + 11 + sps + pps]);
    let data = find(b"mdat");
    let (mut at, end) = (data + 8, data - 8 + number(data, 8));
    while at < end {
        let length = number(at, 4);
        add(&bytes[at + 4..at + 4 + length]);
        at += 4 + length;
    }
    let mut decoder = Decoder::new();
    let frames = decoder.decode_stream(&stream).unwrap();
    frames.into_iter().map(|frame| frame.y).collect()
}

fn luma([r, g, b, _]: [u8; 4]) -> f64 {
    16.0 + (0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)) * 219.0 / 255.0
}

/// Mean squared error of the luma of each picture.
fn errors(path: &Path, size: (usize, usize)) -> Vec<f64> {
    let decoded = decode(path);
    let error = |(number, plane): (usize, &Vec<u8>)| {
        let shown = picture(number, size);
        let pairs = shown.pixels.iter().zip(plane);
        let sum: f64 = pairs.map(|(p, y)| (luma(*p) - f64::from(*y)).powi(2)).sum();
        sum / shown.pixels.len() as f64
    };
    decoded.iter().enumerate().map(error).collect()
}

#[test]
fn what_is_decoded_is_what_was_shown() {
    let path = folder("truth").join("a.mp4");
    let mut before = f64::INFINITY;
    for quality in [25, 75, 100] {
        record(&path, settings(quality), 60).unwrap();
        let errors = errors(&path, SIZE);
        assert_eq!(errors.len(), 60);
        let worst = errors.iter().copied().fold(0.0, f64::max);
        assert!(worst < before, "quality {quality}: {worst} is no better than {before}");
        before = worst;
        // In the order of the quality: 29 dB, 39 dB, 47 dB.
        let most = match quality {
            25 => 80.0,
            75 => 8.0,
            _ => 1.3,
        };
        assert!(worst < most, "quality {quality}: {worst}");
    }
}

/// Pictures that share nothing with those before: noise, and full black after full white.
#[test]
fn pictures_that_cannot_be_foreseen_come_out_too() {
    let here = folder("hostile");
    let (width, height) = (70, 50);
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let v = (state >> 24) as u8;
        [v, v, v, 255]
    };
    let pictures: Vec<Rgba8> = (0..12)
        .map(|number| {
            let pixels: Vec<[u8; 4]> = match number % 3 {
                0 => (0..width * height).map(|_| noise()).collect(),
                1 => vec![[255; 4]; width * height],
                _ => vec![[0, 0, 0, 255]; width * height],
            };
            Rgba8 { width, height, pixels }
        })
        .collect();
    // Mean squared errors of a quantiser's step of 2^((QP − 4)/6), about its square over 12, doubled
    // for what quick decisions lose.
    for (quality, most) in [(0, 6000.0), (50, 60.0), (100, 2.0)] {
        let path = here.join(format!("{quality}.mp4"));
        let size = (width as u32, height as u32);
        let mut film = Film::create(&path, Settings { size, fps: 25.0, quality }).unwrap();
        pictures.iter().for_each(|picture| film.add(picture.clone()).unwrap());
        film.finish().unwrap();
        let decoded = decode(&path);
        assert_eq!(decoded.len(), pictures.len());
        for (number, (picture, plane)) in pictures.iter().zip(&decoded).enumerate() {
            let pairs = picture.pixels.iter().zip(plane);
            let sum: f64 = pairs.map(|(p, y)| (luma(*p) - f64::from(*y)).powi(2)).sum();
            let error = sum / plane.len() as f64;
            assert!(error < most, "quality {quality}, picture {number}: {error}");
        }
    }
}

#[test]
fn the_same_pictures_make_the_same_film() {
    let here = folder("same");
    for name in ["a.mp4", "b.mp4"] {
        record(&here.join(name), settings(60), 5).unwrap();
    }
    assert_eq!(fs::read(here.join("a.mp4")).unwrap(), fs::read(here.join("b.mp4")).unwrap());
}

#[test]
fn odd_sides_are_one_longer() {
    let here = folder("odd");
    for size in [(33, 47), (1, 1), (2, 16)] {
        let path = here.join(format!("{}x{}.mp4", size.0, size.1));
        record(&path, Settings { size, fps: 29.97, quality: 75 }, 3).unwrap();
        let even = |n: u32| n.next_multiple_of(2) as usize;
        let pixels = even(size.0) * even(size.1);
        assert!(decode(&path).iter().all(|plane| plane.len() == pixels), "{size:?}");
    }
}

#[test]
fn there_is_a_file_only_when_it_is_whole() {
    let here = folder("whole");
    let path = here.join("a.mp4");
    let left = || fs::read_dir(&here).unwrap().count();
    let mut film = Film::create(&path, settings(50)).unwrap();
    film.add(picture(0, SIZE)).unwrap();
    assert!(!path.exists() && left() == 1);
    drop(film);
    assert_eq!(left(), 0);

    // A picture of another size, and no picture at all.
    let mut film = Film::create(&path, settings(50)).unwrap();
    let error = film.add(picture(0, (96, 66))).unwrap_err().to_string();
    assert_eq!(error, "expected a picture of 96×64 pixels, found 96×66");
    assert!(film.finish().is_err());
    assert_eq!(left(), 0);

    record(&path, settings(50), 2).unwrap();
    let film = fs::read(&path).unwrap();
    drop(Film::create(&path, settings(90)).unwrap());
    assert_eq!((fs::read(&path).unwrap(), left()), (film, 1));
}

#[test]
fn sizes_beyond_the_standard_are_refused() {
    let here = folder("large");
    for size in [(16_900, 16), (8_000, 5_000), (70_000, 2)] {
        let made = Film::create(&here.join("a.mp4"), Settings { size, fps: 25.0, quality: 75 });
        let error = made.unwrap_err().to_string();
        assert!(error.contains(&format!("{}×{}", size.0, size.1)), "{error}");
    }
    let nowhere = Film::create(&here.join("none/a.mp4"), settings(75)).unwrap_err().to_string();
    assert!(nowhere.contains("a.mp4"), "{nowhere}");
    assert_eq!(fs::read_dir(&here).unwrap().count(), 0);
}
