//! From finished pictures to a video: H.264 in MP4, which every browser and player shows.
//!
//! ```no_run
//! # fn next() -> Option<motes_frame::Rgba8> { None }
//! let settings = motes_film::Settings { size: (1280, 720), fps: 25.0, quality: 75 };
//! let mut film = motes_film::Film::create("out.mp4".as_ref(), settings)?;
//! while let Some(picture) = next() {
//!     film.add(picture)?;
//! }
//! film.finish()?;
//! # Ok::<(), motes_film::FilmError>(())
//! ```
//!
//! Invariants: pictures are encoded one by one on a thread of their own, while the next one is made; at
//! most two wait. The file has its name once it is whole, and not before.

mod encode;
mod error;
mod mp4;
mod yuv;

use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use motes_frame::Rgba8;

use encode::Encoding;
pub use error::{FilmError, Result};

/// What a film is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of the pictures, pixels. An odd side is made even: its last column or row of
    /// pixels stands twice.
    pub size: (u32, u32),
    /// Pictures per second.
    pub fps: f64,
    /// 0 (small) to 100 (true).
    pub quality: u32,
}

/// A film in the making. Dropped before [`Film::finish`], it leaves no file.
#[derive(Debug)]
pub struct Film {
    size: (usize, usize),
    work: Option<Work>,
}

#[derive(Debug)]
struct Work {
    pictures: SyncSender<Message>,
    thread: JoinHandle<Result<()>>,
}

#[derive(Debug)]
enum Message {
    Picture(Rgba8),
    /// There are no more, and the film is whole.
    End,
}

impl Film {
    /// Begins the film `path`.
    ///
    /// # Errors
    /// The file cannot be made, or H.264 has no pictures of this size.
    pub fn create(path: &Path, settings: Settings) -> Result<Self> {
        let encoding = Encoding::begin(path, settings)?;
        let (pictures, incoming) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name("film".into())
            .spawn(move || encode(encoding, &incoming))
            .map_err(|e| FilmError::Encoder(format!("no thread for it: {e}")))?;
        let size = (settings.size.0 as usize, settings.size.1 as usize);
        Ok(Self { size, work: Some(Work { pictures, thread }) })
    }

    /// Adds a picture, after those before it are encoded or wait to be.
    ///
    /// # Errors
    /// It has another size, or an earlier one could not be encoded or written.
    pub fn add(&mut self, picture: Rgba8) -> Result<()> {
        let found = (picture.width, picture.height);
        if found != self.size {
            return Err(FilmError::Size { expected: self.size, found });
        }
        self.send(Message::Picture(picture))
    }

    /// Waits for the last picture and gives the file its name.
    ///
    /// # Errors
    /// A picture could not be encoded or written, or there is none.
    pub fn finish(mut self) -> Result<()> {
        self.send(Message::End)?;
        self.work.take().map_or(Ok(()), Work::end)
    }

    fn send(&mut self, message: Message) -> Result<()> {
        let sent = self.work.as_ref().is_some_and(|work| work.pictures.send(message).is_ok());
        // The thread has ended before it was told to: it says why.
        match self.work.take_if(|_| !sent) {
            Some(work) => work.end(),
            None => Ok(()),
        }
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        if let Some(work) = self.work.take() {
            // The unfinished file goes with the thread.
            let _ = work.end();
        }
    }
}

impl Work {
    fn end(self) -> Result<()> {
        drop(self.pictures);
        let fault = |_| Err(FilmError::Encoder("it failed; this is a fault of it".into()));
        self.thread.join().unwrap_or_else(fault)
    }
}

fn encode(mut encoding: Encoding, pictures: &Receiver<Message>) -> Result<()> {
    while let Ok(message) = pictures.recv() {
        match message {
            Message::Picture(picture) => encoding.add(&picture)?,
            Message::End => return encoding.end(),
        }
    }
    Ok(())
}
