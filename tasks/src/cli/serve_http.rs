//! HTTP for `dsm serve-map`: one request a connection, and an end to everything that a client decides on: how long it takes,
//! how much it sends, how many of it there are.

use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 16 << 10;
/// Longest body of a request, bytes.
const LONGEST_BODY: usize = 16 << 10;
/// Most headers of a request.
const MOST_HEADERS: usize = 64;
/// Connections at a time; more are turned away.
const MOST_CONNECTIONS: usize = 32;
/// Questions that are worked on at a time.
const WORKERS: usize = 2;
/// What a refused client still sends is taken in so far, so that it hears why.
const MOST_IGNORED: usize = 1 << 20;

/// A request that came in whole.
pub(super) struct Asked {
    pub(super) method: String,
    pub(super) url: String,
    pub(super) body: Vec<u8>,
}

/// Code and JSON of an answer.
pub(super) type Answer = (u16, Value);

struct Job {
    asked: Asked,
    reply: SyncSender<Answer>,
}

/// Serves until the process ends. A client gets `patience` for its request, as much for the answer to be found, and as much
/// to take it.
pub(super) fn serve(
    listener: &TcpListener,
    patience: Duration,
    answer: impl Fn(&Asked) -> Answer + Send + Sync + 'static,
) -> std::io::Result<()> {
    let answer = Arc::new(answer);
    let mut workers = Vec::new();
    for _ in 0..WORKERS {
        // One place waits at each worker; which of them is asked goes in turn.
        let (jobs, inbox) = sync_channel::<Job>(MOST_CONNECTIONS);
        let answer = Arc::clone(&answer);
        std::thread::Builder::new().spawn(move || work(&inbox, &*answer))?;
        workers.push(jobs);
    }
    let seats = Arc::new(());
    for (turn, stream) in listener.incoming().enumerate() {
        let Ok(mut stream) = stream else { continue };
        // This thread alone hands seats out.
        if Arc::strong_count(&seats) > MOST_CONNECTIONS {
            let _ = stream.set_nonblocking(true);
            let _ = stream.write_all(&encode(503, &json!({"error": "too many connections"}), false));
            continue;
        }
        let (seat, jobs) = (Arc::clone(&seats), workers[turn % WORKERS].clone());
        let talk = move || {
            talk(&mut stream, patience, &jobs);
            drop(seat);
        };
        // Without a thread the client is let go.
        let _ = std::thread::Builder::new().spawn(talk);
    }
    Ok(())
}

fn work(inbox: &Receiver<Job>, answer: &dyn Fn(&Asked) -> Answer) {
    while let Ok(job) = inbox.recv() {
        // Whoever waited too long is gone.
        let _ = job.reply.send(answer(&job.asked));
    }
}

/// One connection. A client that went away is no trouble.
fn talk(stream: &mut TcpStream, patience: Duration, jobs: &SyncSender<Job>) {
    let asked = match read_request(stream, now() + patience) {
        Ok(Some(asked)) => asked,
        Ok(None) => return,
        Err((code, why)) => return refuse(stream, patience, code, why),
    };
    let is_head = asked.method == "HEAD";
    let (reply, answers) = sync_channel(1);
    if jobs.try_send(Job { asked, reply }).is_err() {
        return refuse(stream, patience, 503, "too many questions");
    }
    match answers.recv_timeout(patience) {
        Ok((code, body)) => give(stream, patience, &encode(code, &body, is_head)),
        Err(_) => refuse(stream, patience, 503, "no answer in time"),
    }
}

fn refuse(stream: &mut TcpStream, patience: Duration, code: u16, why: &str) {
    give(stream, patience, &encode(code, &json!({"error": why}), false));
}

/// Sends an answer and closes. What the client still sends is read first: closing before would take the answer back.
fn give(stream: &mut TcpStream, patience: Duration, mut bytes: &[u8]) {
    let until = now() + patience;
    while !bytes.is_empty() {
        let sent = left(until).and_then(|left| {
            stream.set_write_timeout(Some(left))?;
            stream.write(bytes)
        });
        match sent {
            Ok(count) if count > 0 => bytes = &bytes[count..],
            _ => return,
        }
    }
    if stream.shutdown(Shutdown::Write).is_err() {
        return;
    }
    let mut ignored = Vec::new();
    while ignored.len() < MOST_IGNORED && matches!(read_more(stream, until, &mut ignored), Ok(count) if count > 0) {}
}

/// A whole request; `None` when the client went away, the code and why when it is refused.
fn read_request(stream: &mut TcpStream, until: Instant) -> Result<Option<Asked>, (u16, &'static str)> {
    let mut bytes = Vec::new();
    loop {
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut head = httparse::Request::new(&mut headers);
        match head.parse(&bytes) {
            Ok(httparse::Status::Complete(length)) => {
                let (method, url, body) = check(&head)?;
                if !read_until(stream, until, &mut bytes, length + body)? {
                    return Ok(None);
                }
                return Ok(Some(Asked { method, url, body: bytes[length..length + body].to_vec() }));
            }
            Ok(httparse::Status::Partial) if bytes.len() >= LONGEST_HEAD => return Err((431, "the head is too long")),
            Ok(httparse::Status::Partial) => {
                let known = bytes.len();
                if !read_until(stream, until, &mut bytes, known + 1)? {
                    return Ok(None);
                }
            }
            Err(httparse::Error::TooManyHeaders) => return Err((431, "too many headers")),
            Err(_) => return Err((400, "not HTTP")),
        }
    }
}

/// Method, path and length of the body.
fn check(head: &httparse::Request<'_, '_>) -> Result<(String, String, usize), (u16, &'static str)> {
    let find = |name: &str| {
        let header = head.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
        header.map(|header| String::from_utf8_lossy(header.value).trim().to_owned())
    };
    // A page of the web that has its own name point here is not asked by this machine's user.
    if let Some(host) = find("Host") {
        let name = host.rsplit_once(':').map_or(host.as_str(), |(name, _)| name);
        if !matches!(name, "127.0.0.1" | "localhost") {
            return Err((403, "only 127.0.0.1 and localhost are served"));
        }
    }
    let (method, url) = (head.method.unwrap_or_default(), head.path.unwrap_or_default());
    if !matches!(method, "GET" | "HEAD" | "POST") {
        return Err((405, "only GET, HEAD and POST; nothing can be changed"));
    }
    if find("Transfer-Encoding").is_some() {
        return Err((411, "a body has a Content-Length"));
    }
    let body = match find("Content-Length").map(|length| length.parse::<u64>()) {
        None => 0,
        Some(Ok(length)) if length <= LONGEST_BODY as u64 => length as usize,
        Some(Ok(_)) => return Err((413, "a body has at most 16384 bytes")),
        Some(Err(_)) => return Err((400, "Content-Length is no number")),
    };
    Ok((method.to_owned(), url.to_owned(), body))
}

/// Reads until there are so many bytes; false when the client went away before.
fn read_until(
    stream: &mut TcpStream,
    until: Instant,
    bytes: &mut Vec<u8>,
    wanted: usize,
) -> Result<bool, (u16, &'static str)> {
    while bytes.len() < wanted {
        match read_more(stream, until, bytes) {
            Ok(0) => return Ok(false),
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                return Err((408, "the request took too long"));
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return Ok(false),
        }
    }
    Ok(true)
}

fn read_more(stream: &mut TcpStream, until: Instant, bytes: &mut Vec<u8>) -> std::io::Result<usize> {
    stream.set_read_timeout(Some(left(until)?))?;
    let mut part = [0; 4096];
    let count = stream.read(&mut part)?;
    bytes.extend_from_slice(&part[..count]);
    Ok(count)
}

fn left(until: Instant) -> std::io::Result<Duration> {
    let left = until.saturating_duration_since(now());
    if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
}

/// Clients live in wall time.
#[expect(clippy::disallowed_methods)]
fn now() -> Instant {
    Instant::now()
}

fn encode(code: u16, body: &Value, is_head: bool) -> Vec<u8> {
    let reason = match code {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        411 => "Length Required",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        _ => "Service Unavailable",
    };
    let body = format!("{body}\n");
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {code} {reason}\r\nContent-Type: application/json\r\nCache-Control: no-store\r\nConnection: close\r\n\
         Content-Length: {length}\r\n\r\n"
    );
    if is_head { head.into_bytes() } else { [head, body].concat().into_bytes() }
}
