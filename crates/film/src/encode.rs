//! Pictures to H.264, and into the file.

use std::path::Path;

use motes_frame::{FrameError, Rgba8, Unfinished};
use rusty_h264_common::YuvPlanes;
use rusty_h264_encoder::{Encoder, EncoderConfig, Preset};

use crate::mp4::{Mp4, Track};
use crate::yuv::Planes;
use crate::{FilmError, Result, Settings};

/// Seconds between pictures that need no other: how exactly a player can jump.
const KEY_SECONDS: f64 = 2.0;

/// Levels (ITU-T H.264, table A-1): ten times the level, blocks of 16 × 16 pixels a second, and in a
/// picture.
const LEVELS: [(u8, f64, usize); 10] = [
    (30, 40_500.0, 1_620),
    (31, 108_000.0, 3_600),
    (40, 245_760.0, 8_192),
    (42, 522_240.0, 8_704),
    (50, 589_824.0, 22_080),
    (51, 983_040.0, 36_864),
    (52, 2_073_600.0, 36_864),
    (60, 4_177_920.0, 139_264),
    (61, 8_355_840.0, 139_264),
    (62, 16_711_680.0, 139_264),
];

/// The most blocks a side of any level: √(8 · 139 264).
const MAX_SIDE_BLOCKS: usize = 1_055;

/// A film whose pictures come one by one.
pub(crate) struct Encoding {
    encoder: Encoder,
    planes: Planes,
    film: Mp4,
    file: Unfinished,
}

impl Encoding {
    pub fn begin(path: &Path, settings: Settings) -> Result<Self> {
        let (width, height) = settings.size;
        let planes = Planes::new(width as usize, height as usize);
        let config = configure(&planes, settings).ok_or(FilmError::TooLarge(settings.size))?;
        let encoder = Encoder::new(config).map_err(|e| FilmError::Encoder(format!("{e:?}")))?;
        let too_large = |_| FilmError::TooLarge(settings.size);
        let track = Track {
            width: u16::try_from(planes.width).map_err(too_large)?,
            height: u16::try_from(planes.height).map_err(too_large)?,
            timescale: (settings.fps * 1000.0).round() as u32,
            ticks: 1000,
        };
        let mut file = Unfinished::create(path)?;
        let film = Mp4::begin(file.out(), track).map_err(|e| failed(path, e))?;
        Ok(Self { encoder, planes, film, file })
    }

    pub fn add(&mut self, picture: &Rgba8) -> Result<()> {
        self.planes.fill(picture);
        let Planes { width, height, y, cb, cr } = &self.planes;
        let planes = YuvPlanes::new(*width, *height, y, cb, cr, *width, *width / 2);
        let planes = planes.ok_or(FilmError::TooLarge((*width as u32, *height as u32)))?;
        // Nothing is looked ahead for: a picture in, a picture out.
        let encoded = self.encoder.encode_planes(&planes);
        let encoded = encoded.map_err(|e| FilmError::Encoder(format!("{e:?}")))?;
        let added = self.film.add(self.file.out(), &encoded);
        added.map_err(|e| failed(self.file.path(), e))
    }

    pub fn end(mut self) -> Result<()> {
        let ended = self.film.end(self.file.out());
        ended.map_err(|e| failed(self.file.path(), e))?;
        Ok(self.file.finish()?)
    }
}

/// A size and speed that no level has gives `None`.
fn configure(planes: &Planes, settings: Settings) -> Option<EncoderConfig> {
    let (across, down) = (planes.width.div_ceil(16), planes.height.div_ceil(16));
    let blocks = across * down;
    let fits = across <= MAX_SIDE_BLOCKS && down <= MAX_SIDE_BLOCKS;
    // A film too fast for the highest level plays where the machine is fast enough.
    let level = LEVELS
        .iter()
        .find(|(_, speed, most)| blocks <= *most && blocks as f64 * settings.fps <= *speed)
        .or(LEVELS.last().filter(|(.., most)| blocks <= *most))
        .filter(|_| fits)?;
    let mut config = EncoderConfig::new(planes.width, planes.height);
    config.level_idc = level.0;
    config.framerate = settings.fps as f32;
    // The quantiser's step doubles with every six; 20 is hard to tell from the original.
    config.qp = 50 - (settings.quality.min(100) * 2 / 5) as u8;
    config.gop_size = (settings.fps * KEY_SECONDS).round().max(1.0) as u32;
    // Measured on films of particles: quick decisions take less than half the time of balanced ones,
    // for files a seventh larger; more pictures to look back at change neither size nor quality.
    config.preset = Preset::Fast;
    config.num_ref_frames = 1;
    config.mbtree = false;
    config.scenecut = 0;
    Some(config)
}

fn failed(path: &Path, source: std::io::Error) -> FilmError {
    FrameError::File { path: path.to_owned(), source }.into()
}
