//! What annotations change, and what they must not.

use motes_frame::{
    Annotations, Axes, Background, Category, Frame, Ink, Layer, Legend, LegendKeys, Line, LineEnd,
    Lines, Rgba8, ScaleBar, Side,
};

fn plain(width: usize, height: usize, level: f32) -> Frame {
    let mut frame = Frame::new(width, height, vec![[0.0; 4]; width * height]).unwrap();
    Background::Solid([level; 3]).put_behind(&mut frame);
    frame
}

fn scale(range: [f64; 2], colors: Vec<[f32; 3]>) -> Option<Legend> {
    Some(Legend { title: "Speed (m/s)".into(), keys: LegendKeys::Scale { range, colors } })
}

fn categories(count: usize) -> Option<Legend> {
    let entry = |i| Category { name: format!("type {i}"), color: [1.0, 0.0, 0.0] };
    let keys = LegendKeys::Categories((0..count).map(entry).collect());
    Some(Legend { title: "Type".into(), keys })
}

fn everything(legend: Option<Legend>) -> Annotations {
    let line = Line {
        from: LineEnd { pixel: [-50.0, 3.0], distance: 1.0 },
        to: LineEnd { pixel: [900.0, 400.0], distance: 9.0 },
    };
    let lines = Lines { lines: vec![line], focal_px: 500.0, color: None, hidden: 0.2 };
    let directions = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    Annotations {
        ink: Ink::Auto,
        lines: Some(lines),
        legend,
        scale_bar: Some(ScaleBar { pixels_per_unit: 37.0, unit: "Å".into() }),
        caption: Some("t = 1 ps\nsecond line".into()),
        axes: Some(Axes { directions, side: Side::Left }),
        enlarged: 1.0,
    }
}

/// Left, top, right and bottom of the pixels that differ from `level`; the last two exclusive.
fn touched(frame: &Frame, level: f32) -> Option<[usize; 4]> {
    let changed =
        (0..frame.color().len()).filter(|i| frame.color()[*i] != [level, level, level, 1.0]);
    let at = changed.map(|i| (i % frame.width(), i / frame.width()));
    at.fold(None, |bounds, (x, y)| {
        let [l, t, r, b] = bounds.unwrap_or([x, y, x + 1, y + 1]);
        Some([l.min(x), t.min(y), r.max(x + 1), b.max(y + 1)])
    })
}

#[test]
fn no_annotations_change_nothing() {
    let mut frame = plain(64, 48, 0.5);
    Annotations::default().draw(&mut frame);
    assert_eq!(frame, plain(64, 48, 0.5));
}

#[test]
fn no_size_panics() {
    let sizes =
        [(0, 0), (0, 7), (7, 0), (1, 1), (2, 300), (300, 2), (17, 13), (64, 48), (320, 240)];
    for (width, height) in sizes {
        for legend in [scale([0.0, 1.0], vec![[0.2; 3]; 3]), categories(40)] {
            let mut frame = plain(width, height, 1.0);
            everything(legend).draw(&mut frame);
            assert!(frame.color().iter().flatten().all(|c| (0.0..=1.0).contains(c)));
        }
    }
}

#[test]
fn no_number_panics() {
    for odd in [f32::NAN, f32::INFINITY, -f32::INFINITY, 0.0, -1.0, 1e38, 1e-38] {
        let wide = f64::from(odd);
        for colors in [vec![], vec![[odd; 3]], vec![[odd; 3]; 4]] {
            for range in [[wide, 1.0], [0.0, wide], [wide, wide]] {
                everything(scale(range, colors.clone())).draw(&mut plain(160, 120, odd));
            }
        }
        let mut all = everything(None);
        all.scale_bar = Some(ScaleBar { pixels_per_unit: wide, unit: "\u{0}\n".into() });
        all.axes = Some(Axes { directions: [[odd; 3]; 3], side: Side::Right });
        let end = |pixel, distance| LineEnd { pixel, distance };
        for (from, to) in
            [([odd, 0.0], [5.0, 9.0]), ([3.0, odd], [odd, odd]), ([0.0; 2], [9.0, 5.0])]
        {
            let line = Line { from: end(from, odd), to: end(to, 1.0) };
            all.lines = Some(Lines { lines: vec![line], focal_px: odd, color: None, hidden: odd });
            let depth = Layer::Depth(vec![odd; 160 * 120]);
            all.draw(&mut plain(160, 120, 0.5).with(depth).unwrap());
        }
    }
}

#[test]
fn ink_stands_out_from_the_rim() {
    for (background, darker) in [(1.0, true), (0.6, true), (0.05, false), (0.0, false)] {
        let mut frame = plain(640, 480, background);
        let caption = Some("Time".into());
        Annotations { caption, ..Default::default() }.draw(&mut frame);
        let far = frame.color().iter().map(|c| c[0] - background);
        let far = far.fold(0.0, |most: f32, d| if d.abs() > most.abs() { d } else { most });
        assert_eq!(far < 0.0, darker, "on {background}");
        assert!(far.abs() > 0.5, "on {background}");
    }
}

#[test]
fn each_stands_in_its_place() {
    let place = |annotations: Annotations| {
        let mut frame = plain(640, 480, 1.0);
        annotations.draw(&mut frame);
        touched(&frame, 1.0).unwrap()
    };
    let all = everything(scale([0.0, 1.0], vec![[0.0; 3]; 2]));
    let [_, _, right, bottom] = place(Annotations { caption: all.caption, ..Default::default() });
    assert!(right < 160 && bottom < 60);
    let [left, top, right, _] =
        place(Annotations { scale_bar: all.scale_bar.clone(), ..Default::default() });
    assert!(left < 30 && right < 170 && top > 430);
    let [left, top, right, bottom] =
        place(Annotations { legend: all.legend, ..Default::default() });
    assert!(left > 500 && right < 640 && top > 90 && bottom < 380);
    let beside = Annotations { scale_bar: all.scale_bar, axes: all.axes, ..Default::default() };
    let [left, top, ..] = place(beside);
    // The origin of the arrows, from which none points to the left.
    assert!(left < 60 && top > 360, "{left} {top}");
}

#[test]
fn a_scale_bar_is_as_long_as_it_says() {
    let mut frame = plain(1000, 700, 1.0);
    // A fifth of 4:3, 187 pixels, holds 5.05 units, so the bar is 5 units, 185 pixels.
    let scale_bar = Some(ScaleBar { pixels_per_unit: 37.0, unit: "nm".into() });
    Annotations { scale_bar, ..Default::default() }.draw(&mut frame);
    let longest = frame.color().chunks(1000).map(|row| row.iter().filter(|c| c[0] < 0.02).count());
    assert_eq!(longest.max(), Some(185));
}

#[test]
fn the_colours_of_a_legend_run_from_bottom_to_top() {
    let mut frame = plain(640, 480, 1.0);
    let legend = scale([0.0, 1.0], vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
    Annotations { legend, ..Default::default() }.draw(&mut frame);
    // The rows in which some pixel is a pure mixture of red and blue.
    let mixture = |c: &&[f32; 4]| c[1] == 0.0 && (c[0] + c[2] - 1.0).abs() < 1e-5;
    let rows = frame.color().chunks(640);
    let reds: Vec<f32> = rows.filter_map(|row| row.iter().find(mixture)).map(|c| c[0]).collect();
    assert!((195..=205).contains(&reds.len()), "{}", reds.len());
    assert!(reds.is_sorted_by(|above, below| above > below));
    assert!(reds[0] > 0.99 && reds[reds.len() - 1] < 0.01);
}

#[test]
fn of_many_categories_twenty_are_shown() {
    let swatches = |count| {
        let mut frame = plain(1280, 960, 1.0);
        Annotations { legend: categories(count), ..Default::default() }.draw(&mut frame);
        // Runs of rows with pure red in them.
        let red = |row: &[[f32; 4]]| row.contains(&[1.0, 0.0, 0.0, 1.0]);
        let rows: Vec<bool> = frame.color().chunks(1280).map(red).collect();
        rows.windows(2).filter(|pair| pair[1] && !pair[0]).count()
    };
    assert_eq!([1, 5, 20, 21, 1000].map(swatches), [1, 5, 20, 20, 20]);
}

fn line_over(depth: Option<Vec<f32>>, hidden: f32, focal_px: f32) -> Frame {
    let ends = [([0.0, 50.5], 1.0), ([200.0, 50.5], 4.0)];
    let [from, to] = ends.map(|(pixel, distance)| LineEnd { pixel, distance });
    let lines = Lines { lines: vec![Line { from, to }], focal_px, color: Some([0.0; 3]), hidden };
    let mut frame = plain(200, 100, 1.0);
    if let Some(depth) = depth {
        frame = frame.with(Layer::Depth(depth)).unwrap();
    }
    Annotations { lines: Some(lines), ..Default::default() }.draw(&mut frame);
    frame
}

/// How dark each column of the line is.
fn darkness(frame: &Frame) -> Vec<f32> {
    let row = &frame.color()[50 * 200..51 * 200];
    row.iter().map(|c| 1.0 - c[0]).collect()
}

#[test]
fn a_line_is_drawn_along_its_whole_length() {
    let dark = darkness(&line_over(None, 0.0, 300.0));
    assert!(dark.iter().all(|d| *d > 0.99), "{dark:?}");
}

#[test]
fn a_line_disappears_where_it_falls_behind() {
    // Parallel: from 1 to 4 over 200 pixels, so it meets a wall at 2.5 in the middle.
    let dark = darkness(&line_over(Some(vec![2.5; 200 * 100]), 0.25, f32::INFINITY));
    assert!(dark[..98].iter().all(|d| *d > 0.99));
    assert!(dark[102..].iter().all(|d| (*d - 0.25).abs() < 0.01), "{dark:?}");
}

#[test]
fn in_perspective_the_middle_of_the_screen_is_not_the_middle_of_the_line() {
    // Seen from the side: both ends at slant √(1 + ⅓² …); the line meets the plane z = 2 where 1/z is 1/2.
    let focal = 300.0_f32;
    let slant = |x: f32| (1.0 + ((x - 100.0).powi(2) + 0.25) / focal.powi(2)).sqrt();
    // A plane across the view: its distance along the rays grows with their slant.
    let wall = |i: usize| 2.0 * slant((i % 200) as f32 + 0.5);
    let dark = darkness(&line_over(Some((0..200 * 100).map(wall).collect()), 0.0, focal));
    let z = [1.0 / slant(0.0), 4.0 / slant(200.0)];
    let meets = 200.0 * (0.5 - 1.0 / z[0]) / (1.0 / z[1] - 1.0 / z[0]);
    let behind = dark.iter().position(|d| *d < 0.5).unwrap() as f32;
    assert!((behind - meets).abs() <= 1.0, "{behind} instead of {meets}");
}

#[test]
fn everything_scales_with_the_picture() {
    let ink = |factor: usize| {
        let mut frame = plain(640 * factor, 480 * factor, 1.0);
        Annotations { lines: None, ..everything(scale([0.0, 1.0], vec![[0.0; 3]; 2])) }
            .draw(&mut frame);
        let picture = Rgba8::from(&frame);
        let dark = picture.pixels.iter().filter(|p| p[0] < 100).count() as f32;
        dark / (factor * factor) as f32
    };
    let (small, large) = (ink(1), ink(4));
    assert!((small / large - 1.0).abs() < 0.15, "{small} {large}");
}
