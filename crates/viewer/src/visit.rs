//! One client's view while it is here, and for some minutes after: a thread that answers, one that
//! draws whenever something has changed and the client has taken what was sent before, and one that encodes
//! a picture while the next is drawn.

use std::collections::{BTreeMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::ws::Message;
use serde_json::{Map, Value, json};
use tokio::sync::{mpsc, watch};

use crate::encode::{Codec, frame};
use crate::{Link, Next, Picture, Request, View};

/// Frames that may be under way to a client.
const UNDER_WAY: usize = 2;
/// Requests that wait to be answered; beyond these none is read.
const WAITING: usize = 64;
/// What the quality of a JPEG may be; it falls while frames take long to be shown.
const QUALITY: std::ops::RangeInclusive<u8> = 35..=82;
/// Frames of a good link are shown after this.
const PROMPT: Duration = Duration::from_millis(90);
/// A slow link is no place for pictures without loss.
const LOSSLESS_FROM: u8 = 65;
/// Quality of an exact picture over a slow link.
const NEARLY_LOSSLESS: u8 = 92;
/// Larger exact pictures are not sent without loss: their encoding would take too long.
const LOSSLESS_PIXELS: usize = 3 << 20;

/// A request and the number its answer is to have.
pub(crate) type Asked = (Value, Request);

/// One client's view.
pub(crate) struct Visit {
    /// The word by which the client finds it again.
    pub key: String,
    pub view: Box<dyn View>,
    gate: Mutex<Gate>,
    wake: Condvar,
    requests: Mutex<Option<mpsc::Sender<Asked>>>,
}

/// What decides whether to draw.
struct Gate {
    /// The connection, if there is one, and its number.
    outbox: Option<mpsc::Sender<Message>>,
    connection: u64,
    /// Tells that connection that there is a newer one.
    replaced: watch::Sender<bool>,
    /// Serials of frames that are under way, and when they were drawn.
    under_way: VecDeque<(u32, Instant)>,
    serial: u32,
    /// Something has changed.
    woken: bool,
    /// The client is new.
    anew: bool,
    /// When to draw even if nothing is asked.
    due: Option<Instant>,
    /// When the last client went.
    left: Instant,
    encoding: Duration,
    quality: u8,
    /// Whether the view has let go of what can be made again.
    rested: bool,
    closed: bool,
}

impl Visit {
    /// Begins a visit.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn begin(key: String, view: Box<dyn View>) -> std::io::Result<Arc<Self>> {
        let (requests, asked) = mpsc::channel(WAITING);
        let gate = Gate {
            outbox: None,
            connection: 0,
            replaced: watch::channel(false).0,
            under_way: VecDeque::new(),
            serial: 0,
            woken: true,
            anew: true,
            due: None,
            left: Instant::now(),
            encoding: Duration::ZERO,
            quality: *QUALITY.end(),
            rested: false,
            closed: false,
        };
        let (gate, wake) = (Mutex::new(gate), Condvar::new());
        let visit = Arc::new(Self { key, view, gate, wake, requests: Mutex::new(Some(requests)) });
        let thread = |name: &str| std::thread::Builder::new().name(name.into());
        let own = visit.clone();
        thread("answers").spawn(move || own.answer_all(asked))?;
        let (pictures, drawn) = sync_channel(0);
        let own = visit.clone();
        thread("pictures").spawn(move || own.draw_all(&pictures))?;
        let own = visit.clone();
        thread("frames").spawn(move || drawn.iter().for_each(|drawn| own.send(&drawn)))?;
        Ok(visit)
    }

    /// Tells the view how large its pictures are to be, if `words` have a `width` and a `height`: the first
    /// picture then has that size.
    pub fn resize(&self, words: &BTreeMap<String, String>) {
        let number = |name| Some((name, words.get(name)?.parse::<u64>().ok()?));
        let Some(size) = number("width").zip(number("height")) else { return };
        let fields = [size.0, size.1].map(|(name, value)| (name.to_owned(), value.into()));
        let request = Request { what: "resize".into(), fields: fields.into_iter().collect() };
        // A size that makes no sense is as none.
        let _ = self.view.ask(&request, &|_| ());
    }

    /// Connects a client: it is greeted, and gets a picture. A former connection ends. Gives the
    /// connection's number, and what will tell it that there is a newer one.
    pub fn attach(&self, outbox: mpsc::Sender<Message>) -> (u64, watch::Receiver<bool>) {
        let mut hello = self.view.hello();
        hello.insert("is".into(), "hello".into());
        hello.insert("view".into(), self.key.clone().into());
        // There is room in a new outbox.
        let _ = outbox.try_send(text(hello));
        let mut gate = self.gate();
        gate.outbox = Some(outbox);
        gate.connection += 1;
        let (replaced, is_replaced) = watch::channel(false);
        std::mem::replace(&mut gate.replaced, replaced).send_replace(true);
        gate.rested = false;
        gate.under_way.clear();
        (gate.woken, gate.anew) = (true, true);
        self.wake.notify_all();
        (gate.connection, is_replaced)
    }

    /// Ends a connection, if it is still the one.
    pub fn detach(&self, connection: u64) {
        let mut gate = self.gate();
        if gate.connection == connection {
            (gate.outbox, gate.left) = (None, Instant::now());
        }
    }

    /// Lets go of what can be made again, once, if nobody has been here for a while.
    pub fn rest(&self, after: Duration) {
        let mut gate = self.gate();
        let rests = gate.outbox.is_none() && !gate.rested && gate.left.elapsed() > after;
        gate.rested |= rests;
        drop(gate);
        if rests {
            self.view.rest();
        }
    }

    /// For how long nobody has been here; `None` while somebody is.
    pub fn empty_for(&self) -> Option<Duration> {
        let gate = self.gate();
        gate.outbox.is_none().then(|| gate.left.elapsed())
    }

    /// Where requests are put.
    pub fn requests(&self) -> Option<mpsc::Sender<Asked>> {
        self.requests.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The client has drawn frame `serial`, and with it all before it.
    pub fn shown(&self, serial: u32) {
        let mut gate = self.gate();
        let Some(at) = gate.under_way.iter().position(|(sent, _)| *sent == serial) else { return };
        let (_, sent) = gate.under_way[at];
        gate.under_way.drain(..=at);
        let quality = match sent.elapsed() {
            time if time > 2 * PROMPT => gate.quality.saturating_sub(12),
            time if time > PROMPT => gate.quality.saturating_sub(4),
            _ => gate.quality.saturating_add(2),
        };
        gate.quality = quality.clamp(*QUALITY.start(), *QUALITY.end());
        self.wake.notify_all();
    }

    /// Sends the client a message, if there is one; waits while its queue is full. Not for async code.
    pub fn tell(&self, message: Map<String, Value>) {
        let outbox = self.gate().outbox.clone();
        if let Some(outbox) = outbox {
            let _ = outbox.blocking_send(text(message));
        }
    }

    /// Sends the client a last message, if it can be sent at once, and ends the visit.
    pub fn close(&self, last: Option<Map<String, Value>>) {
        let mut gate = self.gate();
        gate.closed = true;
        if let (Some(outbox), Some(last)) = (gate.outbox.take(), last) {
            let _ = outbox.try_send(text(last));
        }
        drop(gate);
        self.requests.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.view.close();
        self.wake.notify_all();
    }

    fn gate(&self) -> MutexGuard<'_, Gate> {
        // Every change of a gate is whole before its lock is let go.
        self.gate.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn answer_all(&self, mut asked: mpsc::Receiver<Asked>) {
        while let Some((id, request)) = asked.blocking_recv() {
            let tell = |value| self.tell_value(value);
            let answer = catch_unwind(AssertUnwindSafe(|| self.view.ask(&request, &tell)))
                .unwrap_or_else(|_| Err("this went wrong and is a fault of Motes".into()));
            self.tell(answer_to(id, answer));
            self.gate().woken = true;
            self.wake.notify_all();
        }
    }

    fn tell_value(&self, value: Value) {
        if let Value::Object(message) = value {
            self.tell(message);
        }
    }

    fn draw_all(&self, pictures: &SyncSender<Drawn>) {
        while let Some(link) = self.wait() {
            let tell = |value| self.tell_value(value);
            let drawn = catch_unwind(AssertUnwindSafe(|| self.view.draw(link, &tell)));
            let next = match drawn {
                Ok(step) => {
                    let drawn = step.picture.map(|picture| self.under_way(picture));
                    if drawn.is_some_and(|drawn| pictures.send(drawn).is_err()) {
                        return;
                    }
                    step.next
                }
                Err(_) => {
                    let text = "this picture went wrong, by a fault of Motes";
                    tell(json!({"is": "notice", "severity": "error", "text": text}));
                    Next::Asked
                }
            };
            let mut gate = self.gate();
            gate.due = match next {
                Next::Now => Some(Instant::now()),
                Next::After(time) => Instant::now().checked_add(time),
                Next::Asked => None,
            };
        }
    }

    /// Waits until a picture is wanted, and can be sent. `None` when the visit is over.
    fn wait(&self) -> Option<Link> {
        let mut gate = self.gate();
        loop {
            if gate.closed {
                return None;
            }
            let mut patience = None;
            if gate.outbox.is_some() && gate.under_way.len() < UNDER_WAY {
                let now = Instant::now();
                if gate.woken || gate.due.is_some_and(|due| due <= now) {
                    gate.due = None;
                    gate.woken = false;
                    let anew = std::mem::take(&mut gate.anew);
                    return Some(Link { encoding: gate.encoding, anew });
                }
                patience = gate.due.map(|due| due - now);
            }
            gate = match patience {
                Some(time) => {
                    let waited = self.wake.wait_timeout(gate, time);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.wake.wait(gate).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Counts a picture among the frames that are under way.
    fn under_way(&self, picture: Picture) -> Drawn {
        let mut gate = self.gate();
        gate.serial = gate.serial.wrapping_add(1);
        let serial = gate.serial;
        gate.under_way.push_back((serial, Instant::now()));
        Drawn { picture, serial, quality: gate.quality, connection: gate.connection }
    }

    /// Encodes a picture and sends it, if the client for whom it was drawn is still there.
    fn send(&self, drawn: &Drawn) {
        let Drawn { picture, serial, quality, connection } = drawn;
        let pixels = usize::from(picture.size.0) * usize::from(picture.size.1);
        let codec = match picture.exact && !picture.playing {
            true if *quality >= LOSSLESS_FROM && pixels <= LOSSLESS_PIXELS => Codec::Png,
            true => Codec::Jpeg(NEARLY_LOSSLESS),
            false => Codec::Jpeg(*quality),
        };
        let start = Instant::now();
        let bytes = match frame(picture, *serial, codec) {
            Ok(bytes) => bytes,
            Err(error) => {
                let notice = json!({"is": "notice", "severity": "error", "text": error});
                return self.tell_value(notice);
            }
        };
        let took = start.elapsed();
        let mut gate = self.gate();
        if codec == Codec::Jpeg(*quality) {
            gate.encoding = took.mul_f64(1e6 / pixels as f64);
        }
        let outbox = gate.outbox.clone().filter(|_| gate.connection == *connection);
        drop(gate);
        if let Some(outbox) = outbox {
            let _ = outbox.blocking_send(Message::Binary(bytes.into()));
        }
    }
}

/// A picture that is to be sent.
struct Drawn {
    picture: Picture,
    serial: u32,
    quality: u8,
    /// The connection that it was drawn for.
    connection: u64,
}

/// The answer to request `id`.
pub(crate) fn answer_to(
    id: Value,
    answer: Result<Map<String, Value>, String>,
) -> Map<String, Value> {
    let mut message = answer.unwrap_or_else(|error| {
        let mut failed = Map::new();
        failed.insert("error".into(), error.into());
        failed
    });
    message.insert("re".into(), id);
    message
}

pub(crate) fn text(message: Map<String, Value>) -> Message {
    Message::Text(Value::Object(message).to_string().into())
}
