//! A connection: messages in, with limits of size and rate; messages and frames out.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::SplitSink;
use futures_util::{SinkExt, StreamExt};
use serde_json::{Map, Value};
use tokio::sync::{mpsc, watch};

use crate::Request;
use crate::visit::{Visit, answer_to, text};

/// The longest message: a scene with many planes and colours is far shorter.
pub(crate) const MESSAGE_BYTES: usize = 1 << 20;
/// Messages that wait to be sent.
const OUTBOX: usize = 32;
/// Messages a second, on the average and at once; who sends more has to wait.
const RATE: f64 = 400.0;
const BURST: f64 = 800.0;
/// A client that takes nothing for so long has gone.
const STALLED: Duration = Duration::from_secs(60);
/// So often a client is asked whether it is there, if nothing else is said; and if it does not answer for so
/// long, it is not.
const PING: Duration = Duration::from_secs(20);
const SILENT: Duration = Duration::from_secs(90);

/// Serves a connection to a view until it ends.
pub(crate) async fn serve(socket: WebSocket, visit: Arc<Visit>) {
    let (sink, mut stream) = socket.split();
    let (outbox, messages) = mpsc::channel(OUTBOX);
    let replies = outbox.downgrade();
    let (connection, replaced) = visit.attach(outbox);
    let writer = tokio::spawn(write(sink, messages, replaced.clone()));
    let mut pace = Pace::new(Instant::now());
    loop {
        let next = tokio::time::timeout(SILENT, stream.next());
        let next = tokio::select! {
            next = next => next,
            () = is_replaced(replaced.clone()) => break,
        };
        let Ok(Some(Ok(message))) = next else { break };
        tokio::time::sleep(pace.wait(Instant::now())).await;
        let message = match message {
            Message::Text(text) => understand(&text),
            Message::Binary(_) => Err((Value::Null, "expected text".into())),
            Message::Ping(_) | Message::Pong(_) => continue,
            Message::Close(_) => break,
        };
        match message {
            Ok((_, request)) if request.what == "shown" => {
                let serial = request.fields.get("serial").and_then(Value::as_u64);
                serial.and_then(|n| u32::try_from(n).ok()).iter().for_each(|n| visit.shown(*n));
            }
            Ok(asked) => {
                // While many wait, nothing more is read.
                let Some(requests) = visit.requests() else { break };
                if requests.send(asked).await.is_err() {
                    break;
                }
            }
            Err((id, error)) => {
                let Some(outbox) = replies.upgrade() else { break };
                let _ = outbox.send(text(answer_to(id, Err(error)))).await;
            }
        }
    }
    visit.detach(connection);
    // Without a sender the writer ends.
    let _ = writer.await;
}

async fn write(
    mut sink: SplitSink<WebSocket, Message>,
    mut messages: mpsc::Receiver<Message>,
    replaced: watch::Receiver<bool>,
) {
    loop {
        let message = match tokio::time::timeout(PING, messages.recv()).await {
            Ok(Some(message)) => message,
            Ok(None) => break,
            Err(_) => Message::Ping(Default::default()),
        };
        let sent = tokio::time::timeout(STALLED, sink.send(message));
        let sent = tokio::select! {
            sent = sent => sent,
            () = is_replaced(replaced.clone()) => break,
        };
        if !matches!(sent, Ok(Ok(()))) {
            break;
        }
    }
    let _ = tokio::time::timeout(Duration::from_secs(1), sink.close()).await;
}

/// Ends when there is a newer connection to the view, and only then.
async fn is_replaced(mut replaced: watch::Receiver<bool>) {
    if replaced.wait_for(|replaced| *replaced).await.is_err() {
        std::future::pending().await
    }
}

/// A message's number and request, or its number and what is wrong with it.
fn understand(text: &str) -> Result<(Value, Request), (Value, String)> {
    let wrong = |error: &str| (Value::Null, error.to_owned());
    let value = serde_json::from_str(text).map_err(|e| wrong(&format!("not JSON: {e}")))?;
    let Value::Object(fields) = value else { return Err(wrong("expected a JSON object")) };
    let id = id_of(&fields);
    match fields.get("do") {
        Some(Value::String(what)) => Ok((id, Request { what: what.clone(), fields })),
        _ => Err((id, "expected a field `do` with a word".into())),
    }
}

/// The number of a message; anything else is not repeated.
fn id_of(fields: &Map<String, Value>) -> Value {
    fields.get("id").filter(|id| id.is_number()).cloned().unwrap_or(Value::Null)
}

/// Holds back who is too fast: a bucket of messages that fills with time.
struct Pace {
    left: f64,
    since: Instant,
}

impl Pace {
    fn new(now: Instant) -> Self {
        Self { left: BURST, since: now }
    }

    /// How long to wait before one more message.
    fn wait(&mut self, now: Instant) -> Duration {
        let passed = now.saturating_duration_since(self.since).as_secs_f64();
        self.since = now;
        self.left = (self.left + RATE * passed).min(BURST) - 1.0;
        Duration::from_secs_f64((-self.left / RATE).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_understood_or_answered() {
        let (id, request) = understand(r#"{"id": 3, "do": "undo", "x": 1}"#).unwrap();
        assert_eq!((id, &*request.what, &request.fields["x"]), (3.into(), "undo", &1.into()));
        for (bad, part) in [
            ("", "not JSON"),
            ("[1]", "object"),
            ("{}", "`do`"),
            (r#"{"do": 1}"#, "`do`"),
            ("{\"do\"", "not JSON"),
            (&"[".repeat(100_000), "not JSON"),
        ] {
            let (id, error) = understand(bad).unwrap_err();
            assert!(id.is_null() && error.contains(part), "{error}");
        }
        assert_eq!(understand(r#"{"id": 4}"#).unwrap_err().0, 4);
        assert_eq!(understand(r#"{"id": "x", "do": "undo"}"#).unwrap().0, Value::Null);
    }

    #[test]
    fn a_flood_is_slowed_and_a_pause_forgives() {
        let start = Instant::now();
        let mut pace = Pace::new(start);
        let waits: Vec<_> = (0..BURST as usize + 100).map(|_| pace.wait(start)).collect();
        assert_eq!(waits[BURST as usize - 1], Duration::ZERO);
        assert!((waits[waits.len() - 1].as_secs_f64() - 100.0 / RATE).abs() < 1e-6);
        assert_eq!(pace.wait(start + Duration::from_secs(1)), Duration::ZERO);
    }
}
