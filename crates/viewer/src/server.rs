//! The server: the page, the WebSocket, and files to be saved.

use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, Query, Request, State};
use axum::http::header::{self, HeaderMap, HeaderValue};
use axum::http::{StatusCode, Uri};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde_json::Map;
use tokio::sync::{Semaphore, watch};

use crate::Exhibit;
use crate::guard::{self, Names};
use crate::hall::Hall;
use crate::page::asset;
use crate::socket::{MESSAGE_BYTES, serve};

/// WebSockets at once.
const CONNECTIONS: usize = 64;
/// Files made at once.
const SAVING: usize = 2;
/// How often abandoned views are looked for.
const TIDYING: Duration = Duration::from_secs(30);
/// What is said last has so long to arrive.
const FAREWELL: Duration = Duration::from_millis(300);

/// What the page may do: nothing beyond this server.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; \
    base-uri 'none'; form-action 'self'";

/// A server that is bound to its address.
pub struct Server {
    listener: TcpListener,
    token: String,
    names: Names,
    stopped: watch::Sender<bool>,
}

/// Ends a server.
#[derive(Clone, Debug)]
pub struct Stop(watch::Sender<bool>);

impl Stop {
    /// Ends it: clients are told.
    pub fn now(&self) {
        self.0.send_replace(true);
    }
}

impl Server {
    /// A server for this machine alone; port 0 is any free one.
    ///
    /// # Errors
    /// The port is taken.
    pub fn local(port: u16) -> std::io::Result<Self> {
        Self::bind(TcpListener::bind(("127.0.0.1", port))?, Names::local())
    }

    /// A server for whoever reaches `name`, an address or a host's name.
    ///
    /// # Errors
    /// There is no such address here, or the port is taken.
    pub fn open(name: &str, port: u16) -> std::io::Result<Self> {
        Self::bind(TcpListener::bind((name, port))?, Names::open(name))
    }

    fn bind(listener: TcpListener, names: Names) -> std::io::Result<Self> {
        listener.set_nonblocking(true)?;
        let (stopped, _) = watch::channel(false);
        Ok(Self { listener, token: guard::token()?, names, stopped })
    }

    /// The address it listens at.
    ///
    /// # Errors
    /// The system does not say.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// The word that opens everything.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// What ends it.
    pub fn stop(&self) -> Stop {
        Stop(self.stopped.clone())
    }

    /// Serves until it is stopped.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn run(self, exhibit: Arc<dyn Exhibit>) -> std::io::Result<()> {
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        let done = runtime.block_on(self.serve(exhibit));
        // A file that is being made is left.
        runtime.shutdown_timeout(FAREWELL);
        done
    }

    async fn serve(self, exhibit: Arc<dyn Exhibit>) -> std::io::Result<()> {
        let listener = tokio::net::TcpListener::from_std(self.listener)?;
        let house = Arc::new(House {
            token: self.token,
            names: self.names,
            hall: Hall::new(exhibit),
            connections: Arc::new(Semaphore::new(CONNECTIONS)),
            saving: Semaphore::new(SAVING),
        });
        let app = Router::new()
            .route("/", get(|headers: HeaderMap| async move { file("index.html", &headers) }))
            .route("/page/{*name}", get(page))
            .route("/ws", get(connect))
            .route("/save/{file}", get(save))
            .fallback(|| async { refuse(StatusCode::NOT_FOUND, "there is nothing here") })
            .layer(from_fn_with_state(house.clone(), at_the_door))
            .with_state(house.clone());
        let mut stopped = self.stopped.subscribe();
        let tidying = tidy(house.clone());
        tokio::select! {
            served = axum::serve(listener, app).into_future() => served?,
            () = tidying => {}
            _ = stopped.wait_for(|stopped| *stopped) => {}
        }
        let last = Map::from_iter([("is".to_owned(), "ended".into())]);
        house.hall.close(&last);
        tokio::time::sleep(FAREWELL).await;
        Ok(())
    }
}

/// What requests need.
struct House {
    token: String,
    names: Names,
    hall: Hall,
    connections: Arc<Semaphore>,
    saving: Semaphore,
}

async fn tidy(house: Arc<House>) {
    loop {
        tokio::time::sleep(TIDYING).await;
        let house = house.clone();
        let _ = tokio::task::spawn_blocking(move || house.hall.tidy()).await;
    }
}

fn refuse(status: StatusCode, why: &str) -> Response {
    (status, format!("{why}\n")).into_response()
}

/// Refuses foreign hosts and origins, and tells browsers what the page may do.
async fn at_the_door(State(house): State<Arc<House>>, request: Request, next: Next) -> Response {
    if let Some(why) = foreign(&house.names, request.headers()) {
        return refuse(StatusCode::FORBIDDEN, why);
    }
    let mut response = next.run(request).await;
    let fixed = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    for (name, value) in fixed {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Why a request is not from here, if it is not.
fn foreign(names: &Names, headers: &HeaderMap) -> Option<&'static str> {
    // What is no text is no name of ours.
    let word = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    let host = word(header::HOST).unwrap_or_default();
    if !names.has(host) {
        return Some("this host is not served");
    }
    let own = guard::is_own(word(header::ORIGIN), host);
    (!own).then_some("pages from elsewhere are not served")
}

async fn page(Path(name): Path<String>, headers: HeaderMap) -> Response {
    file(&name, &headers)
}

/// A file of the page; where the browser has it already, that.
fn file(name: &str, headers: &HeaderMap) -> Response {
    let Some(asset) = asset(name) else {
        return refuse(StatusCode::NOT_FOUND, "there is nothing here");
    };
    let version = asset.version();
    let known = headers.get(header::IF_NONE_MATCH).is_some_and(|had| had == version.as_str());
    let about = [(header::ETAG, version), (header::CACHE_CONTROL, "no-cache".to_owned())];
    if known {
        return (StatusCode::NOT_MODIFIED, about).into_response();
    }
    (about, [(header::CONTENT_TYPE, asset.media())], &*asset.bytes).into_response()
}

type Words = BTreeMap<String, String>;

/// The query, if it has the token.
fn admitted(house: &House, uri: &Uri) -> Result<Words, (StatusCode, &'static str)> {
    let Ok(Query(words)) = Query::<Words>::try_from_uri(uri) else {
        return Err((StatusCode::BAD_REQUEST, "the query makes no sense"));
    };
    match words.get("token") {
        Some(token) if guard::same(token, &house.token) => Ok(words),
        _ => Err((StatusCode::UNAUTHORIZED, "open the address that `motes view` printed")),
    }
}

async fn connect(
    State(house): State<Arc<House>>,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response {
    let words = match admitted(&house, &uri) {
        Ok(words) => words,
        Err((status, why)) => return refuse(status, why),
    };
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    let Ok(place) = house.connections.clone().try_acquire_owned() else {
        return refuse(StatusCode::SERVICE_UNAVAILABLE, "there are too many connections");
    };
    let entering = house.clone();
    let enter = move || {
        let visit = entering.hall.enter(words.get("view").map(String::as_str))?;
        visit.resize(&words);
        Ok::<_, String>(visit)
    };
    let visit = match tokio::task::spawn_blocking(enter).await {
        Ok(Ok(visit)) => visit,
        Ok(Err(error)) => return refuse(StatusCode::SERVICE_UNAVAILABLE, &error),
        Err(_) => return refuse(StatusCode::INTERNAL_SERVER_ERROR, "this is a fault of Motes"),
    };
    upgrade.max_message_size(MESSAGE_BYTES).max_frame_size(MESSAGE_BYTES).on_upgrade(
        async move |socket| {
            serve(socket, visit).await;
            drop(place);
        },
    )
}

async fn save(State(house): State<Arc<House>>, Path(name): Path<String>, uri: Uri) -> Response {
    let words = match admitted(&house, &uri) {
        Ok(words) => words,
        Err((status, why)) => return refuse(status, why),
    };
    let Some(visit) = words.get("view").and_then(|key| house.hall.find(key)) else {
        return refuse(StatusCode::NOT_FOUND, "there is no such view");
    };
    let Some(media) = media(&name) else {
        return refuse(StatusCode::NOT_FOUND, "there is no such file");
    };
    let Ok(_turn) = house.saving.acquire().await else {
        return refuse(StatusCode::SERVICE_UNAVAILABLE, "the server is ending");
    };
    let file = name.clone();
    let made = tokio::task::spawn_blocking(move || visit.view.save(&file, &words)).await;
    match made {
        Ok(Ok(bytes)) => {
            let attachment = format!("attachment; filename=\"{name}\"");
            let about = [
                (header::CONTENT_TYPE, media.to_owned()),
                (header::CONTENT_DISPOSITION, attachment),
                (header::CACHE_CONTROL, "no-store".to_owned()),
            ];
            (about, bytes).into_response()
        }
        Ok(Err(error)) => refuse(StatusCode::BAD_REQUEST, &error),
        Err(_) => refuse(StatusCode::INTERNAL_SERVER_ERROR, "this is a fault of Motes"),
    }
}

/// The media type of what can be saved.
fn media(name: &str) -> Option<&'static str> {
    Some(match name {
        "picture.png" => "image/png",
        "picture.exr" => "image/x-exr",
        "layers.npz" => "application/zip",
        "film.mp4" => "video/mp4",
        "scene.toml" => "application/toml",
        _ => return None,
    })
}
