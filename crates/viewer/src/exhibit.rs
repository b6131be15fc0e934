//! What is shown, as the server sees it.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Map, Value};

/// Something that can be looked at by several clients, each in its own way.
pub trait Exhibit: Send + Sync {
    /// Opens a view for a client who has come.
    ///
    /// # Errors
    /// What is told to the client.
    fn open(&self) -> Result<Box<dyn View>, String>;
}

/// A request: what `do` says, and the other fields.
#[derive(Clone, Debug)]
pub struct Request {
    /// What is to be done.
    pub what: String,
    /// All fields of the message.
    pub fields: Map<String, Value>,
}

/// One client's view. Requests and drawing go on at once, on two threads.
pub trait View: Send + Sync {
    /// The fields of the `hello` that a client gets when it comes, or comes back.
    fn hello(&self) -> Map<String, Value>;

    /// Answers a request: the fields of the answer. What is said unasked goes to `tell`.
    ///
    /// # Errors
    /// What is told to the client; nothing is changed then.
    fn ask(
        &self,
        request: &Request,
        tell: &(dyn Fn(Value) + Sync),
    ) -> Result<Map<String, Value>, String>;

    /// Draws the newest state. Ends early, without a picture, where a newer one has come.
    fn draw(&self, link: Link, tell: &(dyn Fn(Value) + Sync)) -> Step;

    /// The bytes of a file to be saved, such as `picture.png`; `wanted` is the query.
    ///
    /// # Errors
    /// What is told to the client.
    fn save(&self, file: &str, wanted: &BTreeMap<String, String>) -> Result<Vec<u8>, String>;

    /// Lets go of what can be made again: nobody has been here for a while.
    fn rest(&self);

    /// Ends work that goes on: nobody will ask again.
    fn close(&self);
}

/// How the way to the client is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Link {
    /// How long it takes to encode a million pixels.
    pub encoding: Duration,
    /// Whether the client is new, or back: a picture is wanted even where nothing has changed.
    pub anew: bool,
}

/// What came of drawing.
#[derive(Debug)]
pub struct Step {
    /// The picture, if there is a new one.
    pub picture: Option<Picture>,
    /// What is to be done then.
    pub next: Next,
}

/// When to draw again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// At once.
    Now,
    /// After a while, or after a request.
    After(Duration),
    /// After a request.
    Asked,
}

/// A picture to be sent.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width and height, pixels.
    pub size: (u16, u16),
    /// Red, green and blue of each pixel, row by row from the top.
    pub rgb: Vec<u8>,
    /// Whether it is what the scene says, to the last bit.
    pub exact: bool,
    /// Whether it is less than that because more is to come at once.
    pub coarse: bool,
    /// Whether frame follows frame.
    pub playing: bool,
    /// The frame of the sources.
    pub frame: u32,
    /// How long it took to make.
    pub took: Duration,
    /// Number of the last accepted change it shows.
    pub state: u32,
    /// Hash of an exact picture, else 0.
    pub hash: u64,
}
