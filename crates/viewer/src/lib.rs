//! Serves views of something to browsers: a page, a WebSocket, pictures.
//!
//! What is shown is an [`Exhibit`]; each client gets a [`View`] of it, asks things of it and is sent
//! pictures. Nothing here knows a particle, and nothing there knows a socket.
//!
//! ```text
//! browser ──HTTP──► server.rs: guard.rs (token, Host, Origin), page.rs, downloads
//!    ▲  └─WebSocket─► socket.rs: limits of size and rate
//!    │                   │ requests
//!    │                visit.rs: one view, which outlives its connection (hall.rs)
//!    │                   │ two threads: one answers, one draws
//!    └──── frames ── encode.rs: JPEG or PNG, as fast as the client takes them
//! ```
//!
//! # Invariants
//! - No file is read or written here.
//! - A client that is slow, or sends nonsense, or much of it, costs no other client anything but time.
//! - Memory does not grow with use: queues, messages and views have limits.

mod encode;
mod exhibit;
mod guard;
mod hall;
mod page;
mod server;
mod socket;
mod visit;

pub use exhibit::{Exhibit, Link, Next, Picture, Request, Step, View};
pub use server::{Server, Stop};
