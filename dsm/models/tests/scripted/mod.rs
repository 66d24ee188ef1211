//! A server on this machine that does as a script says: one act per request, the last one again and again.

pub(crate) mod cases;
pub(crate) mod transport_cases;
pub(crate) mod word_cases;

use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// Longest time that a connection is kept, in turns of [`TURN`]: a guard against tests that hang.
const MOST_TURNS: usize = 1500;
/// How long a thread of the server waits for something to happen before it looks whether it is over.
const TURN: Duration = Duration::from_millis(20);

/// What the server does with one request.
#[derive(Clone, Debug)]
pub(crate) enum Act {
    /// Sends these bytes and closes.
    Raw(Vec<u8>),
    /// Closes without reading.
    Close,
    /// Reads the request and closes.
    ReadAndClose,
    /// Neither reads nor answers.
    Deaf,
    /// Reads, sends these bytes, and then nothing more, but keeps the connection.
    Stall(Vec<u8>),
    /// Reads, sends the first bytes, and then single bytes for ever.
    Drip(Vec<u8>),
    /// Reads, sends the first bytes, and then these again and again, so many times.
    Flood(Vec<u8>, Vec<u8>, usize),
}

/// A running server. It ends when this is dropped.
pub(crate) struct Scripted {
    /// Where its API begins.
    pub(crate) url: String,
    /// The requests so far, heads and bodies.
    pub(crate) requests: Arc<Mutex<Vec<String>>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Scripted {
    /// Starts a server with a script.
    pub(crate) fn start(script: Vec<Act>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/v1", listener.local_addr().unwrap());
        let (requests, over) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let (kept, ended) = (requests.clone(), over.clone());
        let next = Arc::new(AtomicUsize::new(0));
        let thread = std::thread::spawn(move || {
            for stream in listener.incoming() {
                if ended.load(Ordering::SeqCst) {
                    return;
                }
                let Ok(stream) = stream else { continue };
                let act = script[next.fetch_add(1, Ordering::SeqCst).min(script.len() - 1)].clone();
                let (kept, ended) = (kept.clone(), ended.clone());
                std::thread::spawn(move || serve(stream, act, &kept, &ended));
            }
        });
        Self { url, requests, over, thread: Some(thread) }
    }
}

impl Drop for Scripted {
    fn drop(&mut self) {
        self.over.store(true, Ordering::SeqCst);
        // Wakes the listener.
        let address = self.url.trim_start_matches("http://").trim_end_matches("/v1").to_owned();
        let _ = TcpStream::connect(address);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

fn serve(mut stream: TcpStream, act: Act, requests: &Mutex<Vec<String>>, over: &AtomicBool) {
    stream.set_read_timeout(Some(TURN)).unwrap();
    stream.set_write_timeout(Some(Duration::from_secs(5))).unwrap();
    if matches!(act, Act::Close | Act::Deaf) {
        requests.lock().unwrap().push(String::new());
    }
    match act {
        Act::Close => {}
        Act::Deaf => wait(over, || Turn::Idle),
        Act::Raw(bytes) => {
            read_request(&mut stream, requests, over);
            let _ = stream.write_all(&bytes);
        }
        Act::ReadAndClose => read_request(&mut stream, requests, over),
        Act::Stall(bytes) => {
            read_request(&mut stream, requests, over);
            let _ = stream.write_all(&bytes);
            wait(over, || pass(&mut stream));
        }
        Act::Drip(bytes) => {
            read_request(&mut stream, requests, over);
            let _ = stream.write_all(&bytes);
            wait(over, || match stream.write_all(b" ") {
                Ok(()) => pass(&mut stream),
                Err(_) => Turn::Over,
            });
        }
        Act::Flood(first, again, times) => {
            read_request(&mut stream, requests, over);
            let _ = stream.write_all(&first);
            for _ in 0..times {
                if over.load(Ordering::SeqCst) || stream.write_all(&again).is_err() {
                    break;
                }
            }
        }
    }
}

enum Turn {
    Idle,
    Over,
}

/// Lets one turn pass, or less when the client hangs up.
fn pass(stream: &mut TcpStream) -> Turn {
    let mut byte = [0; 64];
    match stream.read(&mut byte) {
        Ok(0) => Turn::Over,
        Err(error) if !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Turn::Over,
        _ => Turn::Idle,
    }
}

fn wait(over: &AtomicBool, mut turn: impl FnMut() -> Turn) {
    for _ in 0..MOST_TURNS {
        if over.load(Ordering::SeqCst) || matches!(turn(), Turn::Over) {
            return;
        }
        std::thread::park_timeout(TURN);
    }
}

fn read_request(stream: &mut TcpStream, requests: &Mutex<Vec<String>>, over: &AtomicBool) {
    let mut bytes = Vec::new();
    let mut part = [0; 16 * 1024];
    for _ in 0..MOST_TURNS {
        if over.load(Ordering::SeqCst) || is_whole(&bytes) {
            break;
        }
        match stream.read(&mut part) {
            Ok(0) => break,
            Ok(count) => bytes.extend_from_slice(&part[..count]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => break,
        }
    }
    requests.lock().unwrap().push(String::from_utf8_lossy(&bytes).into_owned());
}

fn is_whole(bytes: &[u8]) -> bool {
    let Some(end) = bytes.windows(4).position(|four| four == b"\r\n\r\n") else { return false };
    let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
    let length = head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok());
    bytes.len() >= end + 4 + length.unwrap_or(0)
}

/// A reply with a right length.
pub(crate) fn reply(status: u16, headers: &str, body: impl AsRef<[u8]>) -> Act {
    let body = body.as_ref();
    let head = format!(
        "HTTP/1.1 {status} X\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n{headers}\r\n",
        body.len()
    );
    Act::Raw([head.as_bytes(), body].concat())
}

/// A completion with this text.
pub(crate) fn says(text: &str) -> Act {
    reply(200, "", completion(text).to_string())
}

/// A completion with this answer in the form that is asked for.
pub(crate) fn answers(answer: Value) -> Act {
    says(&json!({"thought": "because", "answer": answer}).to_string())
}

/// The body of a completion.
pub(crate) fn completion(text: &str) -> Value {
    json!({
        "choices": [{"index": 0, "message": {"role": "assistant", "content": text}, "finish_reason": "stop"}],
        "usage": {"prompt_tokens": 100, "completion_tokens": 10},
    })
}
