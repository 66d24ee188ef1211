//! The live view of a run: a page on this machine alone that shows the camera, the map and the state.
//!
//! The run hands over what it saw last and never waits; pictures are drawn when a browser asks for them, on a thread of
//! their own. Nothing flows back.

use crate::error::TaskError;
use crate::journal::Moment;
use crate::picture::{color_png, depth_png, map_png, map_svg};
use crate::run::Progress;
use dsm::frame::RgbdFrame;
use dsm::map::Map;
use nalgebra::Point2;
use serde::Serialize;
use std::io::Cursor;
use std::net::Ipv4Addr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use tiny_http::{Header, Method, Request, Response, Server};

/// Where the page is when no port is given.
pub(super) const DEFAULT_PORT: &str = "8350";
/// Size of the map picture.
const PIXELS_PER_M: f64 = 60.0;
/// The camera that is shown.
const WATCHED_CAMERA: &str = "head";
const PAGE: &str = include_str!("view.html");

/// What was seen last.
#[derive(Clone, Default)]
struct Latest {
    status: Status,
    frame: Option<Arc<RgbdFrame>>,
    map: Option<Arc<Map>>,
    path: Vec<Point2<f64>>,
}

/// The line below the pictures.
#[derive(Clone, Debug, Default, Serialize)]
struct Status {
    episode: String,
    seed: u64,
    time_limit_s: f64,
    sim_time_s: f64,
    frames: usize,
    objects: usize,
    rooms: usize,
    event: String,
}

/// A page that is served while it lives.
pub(super) struct View {
    server: Arc<Server>,
    latest: Arc<Mutex<Latest>>,
    thread: Option<JoinHandle<()>>,
    /// Where it is.
    pub(super) address: String,
}

impl View {
    /// Serves the page at a port of this machine; 0 takes a free one.
    pub(super) fn open(port: u16, episode: &str, seed: u64, time_limit_s: f64) -> Result<Self, TaskError> {
        let refused =
            |why: &dyn std::fmt::Display| TaskError::Usage(format!("--view: 127.0.0.1:{port} cannot be used: {why}"));
        let server = Server::http((Ipv4Addr::LOCALHOST, port)).map_err(|e| refused(&e))?;
        let port = server.server_addr().to_ip().ok_or_else(|| refused(&"it has no address"))?.port();
        let status = Status { episode: episode.into(), seed, time_limit_s, ..Status::default() };
        let (server, latest) = (Arc::new(server), Arc::new(Mutex::new(Latest { status, ..Latest::default() })));
        let (serving, shown) = (server.clone(), latest.clone());
        let thread = std::thread::spawn(move || {
            // `unblock` ends the loop.
            while let Ok(request) = serving.recv() {
                let latest = shown.lock().unwrap_or_else(PoisonError::into_inner).clone();
                answer(request, &latest);
            }
        });
        Ok(Self { server, latest, thread: Some(thread), address: format!("http://127.0.0.1:{port}/") })
    }

    /// Shows what a run tells, and passes it on.
    pub(super) fn watch(&self, next: Box<dyn Progress>) -> Box<dyn Progress> {
        Box::new(Watched { latest: self.latest.clone(), next })
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.server.unblock();
        if let Some(thread) = self.thread.take() {
            // It has nothing to say; a panic in it has been printed.
            let _ = thread.join();
        }
    }
}

struct Watched {
    latest: Arc<Mutex<Latest>>,
    next: Box<dyn Progress>,
}

impl Progress for Watched {
    fn at(&mut self, sim_time_s: f64) {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner).status.sim_time_s = sim_time_s;
        self.next.at(sim_time_s);
    }

    fn sees(&mut self, moment: &Moment<'_>) {
        self.next.sees(moment);
        if &*moment.frame.camera != WATCHED_CAMERA {
            return;
        }
        let mut latest = self.latest.lock().unwrap_or_else(PoisonError::into_inner);
        let Latest { status, frame, map, path } = &mut *latest;
        status.frames += 1;
        status.objects = moment.map.stable_objects().count();
        status.rooms = moment.map.rooms.len();
        if let Some(event) = moment.journal.events.last() {
            status.event.clone_from(&event.what);
        }
        *frame = Some(moment.frame.clone());
        *map = Some(moment.map.clone());
        // The path only grows.
        path.extend(moment.journal.path.iter().skip(path.len()).copied());
    }
}

/// Answers one request. A browser that went away is no trouble.
fn answer(request: Request, latest: &Latest) {
    let path = request.url().split('?').next().unwrap_or_default().to_owned();
    let (code, kind, body) = match request.method() {
        Method::Get | Method::Head => page(&path, latest),
        _ => (405, TEXT, b"only GET and HEAD\n".to_vec()),
    };
    let length = body.len();
    let response = Response::new(code.into(), headers(kind), Cursor::new(body), Some(length), None);
    // With its length and not in chunks: a picture is there as a whole.
    let _ = request.respond(response.with_chunked_threshold(usize::MAX));
}

const TEXT: &str = "text/plain; charset=utf-8";

/// Code, kind and bytes of a page.
fn page(path: &str, latest: &Latest) -> (u16, &'static str, Vec<u8>) {
    let frame = |draw: fn(&RgbdFrame) -> Vec<u8>| latest.frame.as_ref().map(|frame| ("image/png", draw(frame)));
    let found = match path {
        "/" => Some(("text/html; charset=utf-8", PAGE.into())),
        "/status.json" => serde_json::to_vec(&latest.status).ok().map(|json| ("application/json", json)),
        "/camera.png" => frame(color_png),
        "/depth.png" => frame(depth_png),
        "/map.svg" => {
            map(latest).and_then(|map| map_svg(map, &latest.path, None)).map(|svg| ("image/svg+xml", svg.into()))
        }
        "/map.png" => {
            map(latest).and_then(|map| map_png(map, &latest.path, None, PIXELS_PER_M)).map(|png| ("image/png", png))
        }
        _ => {
            return (
                404,
                TEXT,
                b"there are /, /status.json, /camera.png, /depth.png, /map.svg and /map.png\n".to_vec(),
            );
        }
    };
    match found {
        Some((kind, body)) => (200, kind, body),
        None => (503, TEXT, b"nothing was seen yet\n".to_vec()),
    }
}

fn map(latest: &Latest) -> Option<&Map> {
    latest.map.as_deref()
}

fn headers(kind: &str) -> Vec<Header> {
    let header = |name: &str, value: &str| Header::from_bytes(name, value).ok();
    [header("Content-Type", kind), header("Cache-Control", "no-store")].into_iter().flatten().collect()
}
