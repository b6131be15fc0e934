//! A server with something simple to look at: who is let in, what is refused, and that nothing is lost.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use motes_viewer::{Exhibit, Link, Next, Picture, Request, Server, Step, Stop, View};
use serde_json::{Map, Value, json};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

/// Counts what is asked of it, and draws that number.
#[derive(Default)]
struct Counter {
    asked: AtomicU32,
    running: AtomicU32,
}

struct Gallery(Arc<Mutex<u32>>);

impl Exhibit for Gallery {
    fn open(&self) -> Result<Box<dyn View>, String> {
        *self.0.lock().unwrap() += 1;
        Ok(Box::new(Counter::default()))
    }
}

impl View for Counter {
    fn hello(&self) -> Map<String, Value> {
        Map::from_iter([("count".to_owned(), self.asked.load(Ordering::SeqCst).into())])
    }

    fn ask(
        &self,
        request: &Request,
        tell: &(dyn Fn(Value) + Sync),
    ) -> Result<Map<String, Value>, String> {
        match request.what.as_str() {
            "add" => {
                self.asked.fetch_add(1, Ordering::SeqCst);
                tell(json!({"is": "scene"}));
                Ok(self.hello())
            }
            "run" => {
                self.running.store(1, Ordering::SeqCst);
                Ok(Map::new())
            }
            "burst" => panic!("as was asked"),
            other => Err(format!("no {other}")),
        }
    }

    fn draw(&self, _: Link, _: &(dyn Fn(Value) + Sync)) -> Step {
        let running = self.running.load(Ordering::SeqCst) == 1;
        let picture = Picture {
            size: (4, 2),
            rgb: vec![7; 24],
            exact: !running,
            coarse: running,
            playing: running,
            frame: 0,
            took: Duration::ZERO,
            state: self.asked.load(Ordering::SeqCst),
            hash: 1,
        };
        Step { picture: Some(picture), next: if running { Next::Now } else { Next::Asked } }
    }

    fn save(&self, file: &str, wanted: &BTreeMap<String, String>) -> Result<Vec<u8>, String> {
        match wanted.get("width") {
            Some(width) => Err(format!("{file}: {width} pixels?")),
            None => Ok(b"bytes".to_vec()),
        }
    }

    fn rest(&self) {}

    fn close(&self) {}
}

/// A running server.
struct Running {
    address: SocketAddr,
    token: String,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
    opened: Arc<Mutex<u32>>,
    runtime: tokio::runtime::Runtime,
}

impl Running {
    fn start() -> Self {
        let server = Server::local(0).unwrap();
        let (address, token, stop) =
            (server.address().unwrap(), server.token().to_owned(), server.stop());
        let opened = Arc::new(Mutex::new(0));
        let gallery = Arc::new(Gallery(opened.clone()));
        let thread = Some(std::thread::spawn(move || server.run(gallery).unwrap()));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        Self { address, token, stop, thread, opened, runtime }
    }

    /// The whole answer to a request with these headers.
    fn get(&self, path: &str, headers: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        let host = if headers.contains("Host:") { "" } else { "Host: localhost\r\n" };
        let request = format!("GET {path} HTTP/1.1\r\n{host}{headers}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn connect(&self, query: &str, origin: Option<&str>) -> Result<Client<'_>, u16> {
        let url = format!("ws://{}/ws?{query}", self.address);
        let mut request = url.into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        match self.runtime.block_on(connect_async(request)) {
            Ok((socket, _)) => Ok(Client { socket, running: self }),
            Err(Error::Http(answer)) => Err(answer.status().as_u16()),
            Err(other) => panic!("{other}"),
        }
    }

    fn enter(&self) -> Client<'_> {
        self.connect(&format!("token={}", self.token), None).unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.now();
        self.thread.take().unwrap().join().unwrap();
    }
}

struct Client<'a> {
    socket: WebSocketStream<MaybeTlsStream<tokio::net::TcpStream>>,
    running: &'a Running,
}

impl Client<'_> {
    fn send(&mut self, message: Message) {
        self.running.runtime.block_on(self.socket.send(message)).unwrap();
    }

    fn say(&mut self, value: &Value) {
        self.send(Message::text(value.to_string()));
    }

    /// The next message; none if nothing comes, or the connection has ended.
    fn next(&mut self) -> Option<Message> {
        self.running.runtime.block_on(async {
            let next = tokio::time::timeout(Duration::from_secs(5), self.socket.next());
            next.await.ok()??.ok()
        })
    }

    /// The next text for which something holds.
    fn hear(&mut self, fits: impl Fn(&Value) -> bool) -> Value {
        while let Some(message) = self.next() {
            if let Message::Text(text) = message {
                let value = serde_json::from_str(&text).unwrap();
                if fits(&value) {
                    return value;
                }
            }
        }
        panic!("nothing more came");
    }

    fn frame(&mut self) -> Vec<u8> {
        while let Some(message) = self.next() {
            if let Message::Binary(bytes) = message {
                return bytes.to_vec();
            }
        }
        panic!("no frame came");
    }
}

fn serial(frame: &[u8]) -> u32 {
    u32::from_le_bytes(frame[4..8].try_into().unwrap())
}

#[test]
fn the_page_is_open_and_all_else_needs_the_token() {
    let server = Running::start();
    let page = server.get("/", "");
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<!doctype html>"), "{page}");
    assert!(page.contains("content-security-policy") && page.contains("nosniff"));
    let version = page.lines().find_map(|l| l.strip_prefix("etag: ")).unwrap();
    let again = server.get("/", &format!("If-None-Match: {version}\r\n"));
    assert!(again.starts_with("HTTP/1.1 304"), "{again}");
    assert!(server.get("/page/index.html", "").starts_with("HTTP/1.1 200"));
    for path in ["/page/../Cargo.toml", "/page/%2e%2e/Cargo.toml", "/page//etc/passwd", "/x"] {
        assert!(server.get(path, "").starts_with("HTTP/1.1 404"), "{path}");
    }
    for path in ["/save/picture.png", "/save/picture.png?token=", "/ws", "/ws?token=x&view=y"] {
        assert!(server.get(path, "").starts_with("HTTP/1.1 401"), "{path}");
    }
    assert!(server.get("/ws?token=%ff&token", "").starts_with("HTTP/1.1 40"));
    let token = &server.token;
    assert!(server.get(&format!("/ws?token={token}"), "").starts_with("HTTP/1.1 4"));
    for query in ["", "token=x", &token[1..], &format!("token={}", token.to_uppercase() + "a")] {
        assert_eq!(server.connect(query, None).map(|_| ()), Err(401), "{query}");
    }
    assert_eq!(*server.opened.lock().unwrap(), 0);
}

#[test]
fn pages_and_hosts_from_elsewhere_are_refused() {
    let server = Running::start();
    let token = format!("token={}", server.token);
    let own = format!("http://{}", server.address);
    assert!(server.connect(&token, Some(&own)).is_ok());
    for foreign in ["http://example.org", "null", "http://127.0.0.1:1"] {
        assert_eq!(server.connect(&token, Some(foreign)).map(|_| ()), Err(403), "{foreign}");
    }
    for host in ["example.org", "10.0.0.1", "127.0.0.1.example.org", ""] {
        for path in ["/", &format!("/save/picture.png?{token}")] {
            let answer = server.get(path, &format!("Host: {host}\r\n"));
            assert!(answer.starts_with("HTTP/1.1 403"), "{host}: {answer}");
        }
    }
}

#[test]
fn a_view_is_asked_and_drawn_and_outlives_its_connection() {
    let server = Running::start();
    let mut client = server.enter();
    let hello = client.hear(|_| true);
    assert_eq!((&hello["is"], &hello["count"]), (&json!("hello"), &json!(0)));
    let key = hello["view"].as_str().unwrap().to_owned();
    let frame = client.frame();
    assert_eq!((&frame[..4], frame[8], frame[16]), (&b"MOTE"[..], 1, 2));
    client.say(&json!({"id": 4, "do": "add"}));
    assert_eq!(client.hear(|v| v["re"] == 4)["count"], 1);
    client.say(&json!({"do": "shown", "serial": serial(&frame)}));
    assert_eq!(client.frame()[28], 1);
    client.say(&json!({"id": 5, "do": "burst"}));
    assert!(client.hear(|v| v["re"] == 5)["error"].as_str().unwrap().contains("fault"));
    drop(client);

    let query = format!("token={}&view={key}", server.token);
    let mut again = server.connect(&query, None).unwrap();
    let hello = again.hear(|_| true);
    assert_eq!((&hello["view"], &hello["count"]), (&json!(key), &json!(1)));
    again.frame();
    let mut other = server.connect(&format!("token={}&view=none", server.token), None).unwrap();
    let hello = other.hear(|_| true);
    assert!(hello["view"] != json!(key) && hello["count"] == 0);
    assert_eq!(*server.opened.lock().unwrap(), 2);
    let save = |query: &str| server.get(&format!("/save/{query}&token={}", server.token), "");
    let saved = save(&format!("layers.npz?view={key}"));
    assert!(saved.contains("attachment; filename=\"layers.npz\"") && saved.ends_with("bytes"));
    assert!(save(&format!("layers.npz?view={key}&width=x")).contains("x pixels?"));
    assert!(save(&format!("passwd?view={key}")).starts_with("HTTP/1.1 404"));
    assert!(save("layers.npz?view=none").starts_with("HTTP/1.1 404"));
}

#[test]
fn a_newer_connection_takes_over_from_one_that_hangs() {
    let server = Running::start();
    let mut client = server.enter();
    let key = client.hear(|_| true)["view"].as_str().unwrap().to_owned();
    // It takes nothing of thousands of answers, until no more can be sent.
    server.runtime.block_on(async {
        for id in 0..3000 {
            let text = json!({"id": id, "do": "x".repeat(2000)}).to_string();
            let send = client.socket.feed(Message::text(text));
            if tokio::time::timeout(Duration::from_millis(300), send).await.is_err() {
                break;
            }
        }
    });
    let mut again = server.connect(&format!("token={}&view={key}", server.token), None).unwrap();
    again.say(&json!({"id": 1, "do": "add"}));
    assert!(again.hear(|v| v["re"] == 1 && v.get("error").is_none())["count"].is_number());
}

#[test]
fn two_frames_are_under_way_and_no_more() {
    let server = Running::start();
    let mut client = server.enter();
    client.say(&json!({"id": 1, "do": "run"}));
    let first = client.frame();
    let second = client.frame();
    client.say(&json!({"id": 2, "do": "add"}));
    let silent = |client: &mut Client<'_>| {
        let until = Instant::now() + Duration::from_millis(200);
        while Instant::now() < until {
            let left = until.saturating_duration_since(Instant::now());
            let next = async { tokio::time::timeout(left, client.socket.next()).await };
            match client.running.runtime.block_on(next) {
                Ok(Some(Ok(Message::Binary(_)))) => return false,
                Ok(Some(Ok(_))) | Err(_) => {}
                Ok(other) => panic!("{other:?}"),
            }
        }
        true
    };
    assert!(silent(&mut client));
    client.say(&json!({"do": "shown", "serial": serial(&second)}));
    assert!(serial(&client.frame()) > serial(&first));
    client.frame();
    assert!(silent(&mut client));
    // Of frames that were never sent nothing is believed.
    client.say(&json!({"do": "shown", "serial": 4_000_000}));
    client.say(&json!({"do": "shown", "serial": -1}));
    client.say(&json!({"do": "shown"}));
    assert!(silent(&mut client));
}

#[test]
fn nonsense_is_answered_and_harms_nothing() {
    let server = Running::start();
    let mut client = server.enter();
    let bad = [
        "",
        "[]",
        "null",
        "{",
        "{\"do\": 3}",
        "{\"id\": 1}",
        "\u{0}",
        "{\"do\":\"add\"",
        &"[".repeat(10_000),
    ];
    for text in bad {
        client.send(Message::text(text));
        assert!(client.hear(|v| v.get("re").is_some())["error"].is_string(), "{text}");
    }
    client.send(Message::binary(vec![0; 100]));
    assert!(client.hear(|v| v.get("re").is_some())["error"].is_string());
    client.say(&json!({"id": 9, "do": "what is not"}));
    assert_eq!(client.hear(|v| v["re"] == 9)["error"], "no what is not");
    client.say(&json!({"id": 10, "do": "add"}));
    assert_eq!(client.hear(|v| v["re"] == 10)["count"], 1);
}

#[test]
fn what_is_too_large_ends_the_connection_and_not_the_view() {
    let server = Running::start();
    let mut client = server.enter();
    let key = client.hear(|_| true)["view"].as_str().unwrap().to_owned();
    client.say(&json!({"id": 1, "do": "add"}));
    client.hear(|v| v["re"] == 1);
    let large = Message::text("x".repeat(8 << 20));
    // The other end may hang up in the middle of it.
    let _ = server.runtime.block_on(client.socket.send(large));
    while client.next().is_some() {}
    let mut again = server.connect(&format!("token={}&view={key}", server.token), None).unwrap();
    assert_eq!(again.hear(|_| true)["count"], 1);
}

#[test]
fn a_flood_is_answered_in_order_and_nothing_is_lost() {
    let server = Running::start();
    let mut client = server.enter();
    const MANY: u32 = 1000;
    server.runtime.block_on(async {
        for id in 1..=MANY {
            let text = json!({"id": id, "do": "add"}).to_string();
            client.socket.feed(Message::text(text)).await.unwrap();
            if id % 50 == 0 {
                client.socket.flush().await.unwrap();
            }
        }
    });
    // Another client is served meanwhile.
    let mut other = server.enter();
    other.say(&json!({"id": 1, "do": "add"}));
    assert_eq!(other.hear(|v| v["re"] == 1)["count"], 1);
    for id in 1..=MANY {
        let answer = client.hear(|v| v.get("re").is_some());
        assert_eq!((&answer["re"], &answer["count"]), (&json!(id), &json!(id)));
    }
}

#[test]
fn the_end_is_told() {
    let server = Running::start();
    let mut client = server.enter();
    client.hear(|v| v["is"] == "hello");
    client.frame();
    server.stop.now();
    client.hear(|v| v["is"] == "ended");
    while client.next().is_some() {}
}

#[test]
fn garbage_instead_of_http_harms_nothing() {
    let server = Running::start();
    for bytes in [&b"\x16\x03\x01\x02\0"[..], b"GET", b"GET / HTTP/9.9\r\n\r\n", &[0; 70_000]] {
        let mut stream = TcpStream::connect(server.address).unwrap();
        let _ = stream.write_all(bytes);
    }
    assert!(server.get("/", "").starts_with("HTTP/1.1 200"));
}
