//! Frames written to bytes and read back.

use std::io::Cursor;
use std::process::Command;

use motes_frame::{
    Background, Frame, FrameError, Layer, PngOptions, Rgba8, Transparency, compare, read_png, save,
    scene_in_png, write_exr, write_npz, write_png,
};

const WIDTH: usize = 5;
const HEIGHT: usize = 3;

/// Every value tells its place, so that a swapped axis or component shows.
fn frame() -> Frame {
    let n = WIDTH * HEIGHT;
    let each = |f: fn(usize) -> f32| (0..n).map(f).collect::<Vec<f32>>();
    let color = (0..n).map(|i| [i as f32 / 20.0, 0.25, 0.5, 1.0]).collect();
    Frame::new(WIDTH, HEIGHT, color)
        .and_then(|f| f.with(Layer::Depth(each(|i| if i == 0 { f32::INFINITY } else { i as f32 }))))
        .and_then(|f| f.with(Layer::Normal((0..n).map(|i| [0.0, 1.0, i as f32]).collect())))
        .and_then(|f| f.with(Layer::Id((0..n as i64).map(|i| i - 1).collect())))
        .and_then(|f| f.with(Layer::System((0..n as u16).collect())))
        .and_then(|f| f.with(Layer::SpanCount((0..n as u32).map(|i| i * 7).collect())))
        .and_then(|f| f.with(Layer::Thickness(each(|i| 0.5 * i as f32))))
        .unwrap()
}

fn png(frame: &Frame, options: PngOptions<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_png(frame, options, &mut bytes).unwrap();
    bytes
}

#[test]
fn a_png_comes_back_as_it_was_encoded() {
    let picture = read_png(&png(&frame(), PngOptions::default())).unwrap();
    assert_eq!(compare(&picture, &Rgba8::from(&frame())).unwrap().pixels, 0);
}

#[test]
fn alpha_is_kept_when_asked() {
    let glass = Frame::new(1, 1, vec![[0.25, 0.0, 0.0, 0.5]]).unwrap();
    let keep = PngOptions { transparency: Transparency::Keep, scene: None };
    // 0.25 / 0.5 is 188 in sRGB; dropped, it is the picture over black, 0.25 → 137.
    assert_eq!(read_png(&png(&glass, keep)).unwrap().pixels, [[188, 0, 0, 128]]);
    assert_eq!(read_png(&png(&glass, PngOptions::default())).unwrap().pixels, [[137, 0, 0, 255]]);
}

#[test]
fn a_png_says_that_it_is_srgb() {
    let bytes = png(&frame(), PngOptions::default());
    assert!(bytes.windows(4).any(|window| window == b"sRGB"));
}

#[test]
fn a_png_remembers_its_scene() {
    let scene = "[camera]\nname = \"Ångström — µm²\"\n";
    let bytes = png(&frame(), PngOptions { scene: Some(scene), ..Default::default() });
    assert_eq!(scene_in_png(&bytes).as_deref(), Some(scene));
    assert_eq!(scene_in_png(&png(&frame(), PngOptions::default())), None);
}

#[test]
fn broken_pngs_are_refused_wherever_they_break() {
    let bytes = png(&frame(), PngOptions { scene: Some("a = 1"), ..Default::default() });
    // The last chunk, IEND, holds nothing that is needed.
    for cut in 0..bytes.len() - 12 {
        assert!(read_png(&bytes[..cut]).is_err(), "cut at {cut}");
    }
    assert_eq!(scene_in_png(&bytes[..20]), None);
    assert_eq!(scene_in_png(b"not a picture"), None);
}

#[test]
fn pictures_without_pixels_are_refused_by_name() {
    let empty = Frame::new(0, 0, Vec::new()).unwrap();
    let error = write_png(&empty, PngOptions::default(), Vec::new()).unwrap_err();
    assert_eq!(error.to_string(), "PNG cannot hold a picture of 0×0 pixels");
    assert!(write_exr(&empty, Cursor::new(Vec::new())).is_err());
    write_npz(&empty, Cursor::new(Vec::new())).unwrap();
    let mut nothing = empty;
    Background::Solid([1.0; 3]).put_behind(&mut nothing);
}

type Channels = Vec<(String, Vec<f64>)>;

fn exr_parts(frame: &Frame) -> Vec<(String, Channels)> {
    use exr::prelude::*;
    let mut file = Cursor::new(Vec::new());
    write_exr(frame, &mut file).unwrap();
    file.set_position(0);
    let reader = read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.all_layers().all_attributes().from_buffered(file).unwrap();
    let part = |layer: &exr::image::Layer<AnyChannels<FlatSamples>>| {
        assert_eq!((layer.size.width(), layer.size.height()), (WIDTH, HEIGHT));
        let channels = layer.channel_data.list.iter().map(|c| {
            let values = match &c.sample_data {
                FlatSamples::F32(v) => v.iter().map(|&x| f64::from(x)).collect(),
                FlatSamples::U32(v) => v.iter().map(|&x| f64::from(x)).collect(),
                FlatSamples::F16(_) => panic!("no half floats are written"),
            };
            (c.name.to_string(), values)
        });
        (layer.attributes.layer_name.as_ref().unwrap().to_string(), channels.collect())
    };
    image.layer_data.iter().map(part).collect()
}

#[test]
fn an_exr_comes_back_part_by_part() {
    let parts = exr_parts(&frame());
    let names: Vec<&str> = parts.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["color", "depth", "normal", "id", "system", "span_count", "thickness"]);
    let channel = |part: &str, channel: &str| {
        let (_, channels) = parts.iter().find(|(name, _)| name == part).unwrap();
        channels.iter().find(|(name, _)| name == channel).unwrap().1.clone()
    };
    let count = |f: fn(f64) -> f64| (0..WIDTH * HEIGHT).map(|i| f(i as f64)).collect::<Vec<f64>>();
    let red: Vec<f64> = frame().color().iter().map(|c| f64::from(c[0])).collect();
    assert_eq!(channel("color", "R"), red);
    assert_eq!(channel("color", "A"), count(|_| 1.0));
    assert_eq!(channel("depth", "Z"), count(|i| if i == 0.0 { f64::INFINITY } else { i }));
    assert_eq!(channel("normal", "Z"), count(|i| i));
    assert_eq!(channel("id", "id"), count(|i| if i == 0.0 { 4_294_967_295.0 } else { i - 1.0 }));
    assert_eq!(channel("system", "system"), count(|i| i));
    assert_eq!(channel("span_count", "span_count"), count(|i| 7.0 * i));
    assert_eq!(channel("thickness", "Z"), count(|i| 0.5 * i));
}

#[test]
fn an_exr_keeps_the_high_half_of_large_ids() {
    let mut ids = vec![-1; WIDTH * HEIGHT];
    ids[1] = 5_000_000_000;
    let large = frame().with(Layer::Id(ids)).unwrap();
    let parts = exr_parts(&large);
    let (_, channels) = parts.iter().find(|(name, _)| name == "id").unwrap();
    let [(low_name, low), (high_name, high)] = &channels[..] else { panic!("two halves") };
    assert_eq!((low_name.as_str(), high_name.as_str()), ("id", "id.high"));
    let id = |i: usize| ((high[i] as u64) << 32 | low[i] as u64) as i64;
    assert_eq!((id(0), id(1)), (-1, 5_000_000_000));
}

#[test]
fn an_npz_holds_every_array_byte_for_byte() {
    let mut archive = Cursor::new(Vec::new());
    write_npz(&frame(), &mut archive).unwrap();
    let mut archive = zip::ZipArchive::new(archive).unwrap();
    let expected = [
        ("color", "'<f4', 'fortran_order': False, 'shape': (3, 5, 4)", 4 * 4),
        ("depth", "'<f4', 'fortran_order': False, 'shape': (3, 5)", 4),
        ("normal", "'<f4', 'fortran_order': False, 'shape': (3, 5, 3)", 3 * 4),
        ("id", "'<i8', 'fortran_order': False, 'shape': (3, 5)", 8),
        ("system", "'<u2', 'fortran_order': False, 'shape': (3, 5)", 2),
        ("span_count", "'<u4', 'fortran_order': False, 'shape': (3, 5)", 4),
        ("thickness", "'<f4', 'fortran_order': False, 'shape': (3, 5)", 4),
    ];
    assert_eq!(archive.len(), expected.len());
    for (name, described, pixel_bytes) in expected {
        let mut bytes = Vec::new();
        let mut file = archive.by_name(&format!("{name}.npy")).unwrap();
        std::io::Read::read_to_end(&mut file, &mut bytes).unwrap();
        let header = String::from_utf8_lossy(&bytes[10..128]);
        assert!(header.contains(described), "{name}: {header}");
        assert_eq!(bytes.len(), 128 + WIDTH * HEIGHT * pixel_bytes);
        if name == "id" {
            assert_eq!(&bytes[128..144], bytemuck::bytes_of(&[(-1_i64).to_le(), 0]));
        }
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "a test that checks nothing says so")]
fn numpy_reads_the_npz() {
    let directory = tempdir("numpy");
    let path = directory.join("layers.npz");
    save(&path, |out| write_npz(&frame(), out)).unwrap();
    let script = "import sys, numpy as np\n\
        a = np.load(sys.argv[1])\n\
        assert a['color'].shape == (3, 5, 4) and a['color'].dtype == np.float32\n\
        assert a['color'][1, 2, 0] == np.float32(7 / 20), a['color'][1, 2]\n\
        assert np.isinf(a['depth'][0, 0]) and a['depth'][2, 4] == 14\n\
        assert tuple(a['normal'][2, 0]) == (0, 1, 10)\n\
        assert a['id'].dtype == np.int64 and a['id'][0, 0] == -1 and a['id'][1, 0] == 4\n\
        assert a['system'].dtype == np.uint16 and a['system'][1, 1] == 6\n\
        assert a['span_count'].dtype == np.uint32 and a['span_count'][0, 2] == 14\n\
        assert a['thickness'][0, 1] == 0.5\n";
    let has_numpy = Command::new("python3").args(["-c", "import numpy"]).output();
    if has_numpy.is_ok_and(|output| output.status.success()) {
        let output = Command::new("python3").args(["-c", script]).arg(&path).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    } else {
        // The byte-for-byte test stands by itself.
        println!("python3 with numpy is not here");
    }
    std::fs::remove_dir_all(directory).unwrap();
}

fn tempdir(name: &str) -> std::path::PathBuf {
    let path = std::env::temp_dir().join(format!("motes-frame-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    path
}

#[test]
fn a_failed_save_keeps_the_old_file_and_leaves_nothing() {
    let directory = tempdir("save");
    let path = directory.join("picture.png");
    save(&path, |out| write_png(&frame(), PngOptions::default(), out)).unwrap();
    let before = std::fs::read(&path).unwrap();
    let empty = Frame::new(0, 0, Vec::new()).unwrap();
    let error = save(&path, |out| write_png(&empty, PngOptions::default(), out)).unwrap_err();
    assert!(matches!(error, FrameError::Content { .. }));
    assert!(error.to_string().starts_with(&path.display().to_string()));
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 1);
    std::fs::remove_dir_all(directory).unwrap();
}

#[test]
fn errors_of_the_file_system_name_the_file() {
    let path = std::path::Path::new("no-such-directory/picture.png");
    let error = save(path, |_| Ok(())).unwrap_err();
    assert!(matches!(error, FrameError::File { .. }));
    assert!(error.to_string().starts_with("no-such-directory/picture.png: "));
    assert!(save(std::path::Path::new("/"), |_| Ok(())).is_err());
}
