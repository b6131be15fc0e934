//! Decompression: gzip, Zstandard and deflate as streams that refuse to grow out of all proportion.
//!
//! A few megabytes can inflate to hundreds of gigabytes. What simulations write shrinks to a tenth or
//! a twentieth, so a stream that has given more than [`FREE_BYTES`] ends in an error once it is more
//! than [`MOST_TIMES`] as long as the compressed data it was made from.

use std::io::{BufRead, BufReader, Error, Read, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

/// So much may come out of any compressed data.
const FREE_BYTES: u64 = 128 << 20;
/// How many times its size compressed data may take beyond that.
const MOST_TIMES: u64 = 250;
/// Size of the blocks that are read of compressed data.
const BUFFER_BYTES: usize = 256 * 1024;

/// The content of a gzip file of any number of members.
pub(super) fn gzip(stored: impl Read + Send + 'static) -> Box<dyn Read + Send> {
    bounded(stored, |stored| Box::new(flate2::bufread::MultiGzDecoder::new(stored)))
}

/// The content of a Zstandard file of any number of frames.
pub(super) fn zstd(stored: impl Read + Send + 'static) -> Box<dyn Read + Send> {
    bounded(stored, |stored| Box::new(ZstdMembers::new(stored)))
}

/// The content of bare deflated data.
pub(super) fn deflate(stored: impl Read + Send + 'static) -> Box<dyn Read + Send> {
    bounded(stored, |stored| Box::new(flate2::bufread::DeflateDecoder::new(stored)))
}

type Stored<R> = BufReader<Counted<R>>;

fn bounded<R: Read + Send + 'static>(
    stored: R,
    decoder: impl FnOnce(Stored<R>) -> Box<dyn Read + Send>,
) -> Box<dyn Read + Send> {
    let taken = Arc::new(AtomicU64::new(0));
    let counted = Counted { stored, taken: Arc::clone(&taken) };
    let content = decoder(BufReader::with_capacity(BUFFER_BYTES, counted));
    Box::new(Bounded { content, given: 0, taken })
}

/// Counts the bytes read.
struct Counted<R> {
    stored: R,
    taken: Arc<AtomicU64>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let bytes = self.stored.read(out)?;
        self.taken.fetch_add(bytes as u64, Ordering::Relaxed);
        Ok(bytes)
    }
}

/// Compares what comes out with what went in.
struct Bounded {
    content: Box<dyn Read + Send>,
    given: u64,
    taken: Arc<AtomicU64>,
}

impl Read for Bounded {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let bytes = self.content.read(out)?;
        self.given += bytes as u64;
        let taken = self.taken.load(Ordering::Relaxed);
        if self.given > FREE_BYTES && self.given / MOST_TIMES > taken {
            return Err(Error::other(format!(
                "{taken} compressed bytes inflate to more than {MOST_TIMES} times as many"
            )));
        }
        Ok(bytes)
    }
}

/// Decodes Zstandard frames one after another; skippable frames are skipped.
struct ZstdMembers<R> {
    stored: R,
    decoder: FrameDecoder,
    inside: bool,
}

impl<R: BufRead> ZstdMembers<R> {
    fn new(stored: R) -> Self {
        Self { stored, decoder: FrameDecoder::new(), inside: false }
    }

    /// Begins the next frame that has content; says whether there is one.
    fn next_frame(&mut self) -> Result<bool> {
        loop {
            if self.stored.fill_buf()?.is_empty() {
                return Ok(false);
            }
            match self.decoder.init(&mut self.stored) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                    length,
                    ..
                })) => {
                    let skipped = &mut self.stored.by_ref().take(u64::from(length));
                    std::io::copy(skipped, &mut std::io::sink())?;
                }
                Err(e) => return Err(Error::other(e)),
            }
        }
    }
}

impl<R: BufRead> Read for ZstdMembers<R> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        loop {
            if !self.inside {
                if !self.next_frame()? {
                    return Ok(0);
                }
                self.inside = true;
            }
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                let one = BlockDecodingStrategy::UptoBlocks(1);
                self.decoder.decode_blocks(&mut self.stored, one).map_err(Error::other)?;
            }
            match self.decoder.read(out)? {
                0 if self.decoder.is_finished() => {
                    self.inside = false;
                    let stored = self.decoder.get_checksum_from_data();
                    if stored.is_some() && stored != self.decoder.get_calculated_checksum() {
                        return Err(Error::other("the checksum does not agree"));
                    }
                }
                n => return Ok(n),
            }
        }
    }
}
