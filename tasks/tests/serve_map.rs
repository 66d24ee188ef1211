//! Contract: a map answers over HTTP and as an MCP server over stdio, the same either way; what is asked is bounded,
//! nothing can be changed, and no client keeps others from their answers.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its map fails")]

use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// A room with a table and an apple.
fn map() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../dsm/tests/kept_maps/1.1-whole.dsm")
}

fn serve(args: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
    command.arg("serve-map").arg(map()).args(args);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
}

/// Code and body of an answer.
fn ask(address: &str, method: &str, path: &str, body: &str) -> (u16, Value) {
    let mut stream = TcpStream::connect(address).unwrap();
    let length = body.len();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{body}"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), serde_json::from_str(body).unwrap())
}

#[test]
fn a_map_answers_over_http() {
    let before = fs::read(map()).unwrap();
    let mut server = serve(&["--port", "0"]);
    let mut line = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().trim_start_matches("http://").trim_end_matches('/').to_owned();
    assert!(address.starts_with("127.0.0.1:"), "{line}");
    let get = |path: &str| ask(&address, "GET", path, "");
    let (code, start) = get("/");
    assert_eq!((code, start["questions"].as_array().unwrap().len()), (200, 6));
    let (_, summary) = get("/summary");
    assert_eq!(
        (summary["objects"].as_u64(), summary["relations"].as_u64(), summary["rooms"].as_u64()),
        (Some(2), Some(2), Some(2))
    );
    let (_, apple) = get("/ground?text=the+red%20apple");
    assert_eq!((apple["status"].as_str(), apple["object_id"].as_u64()), (Some("found"), Some(1)), "{apple}");
    assert_eq!(ask(&address, "POST", "/ground", "{\"text\": \"the red apple\"}").1, apple);
    let (_, tables) = get("/objects?name=table");
    assert_eq!((tables["total"].as_u64(), tables["objects"][0]["name"].as_str()), (Some(1), Some("table")));
    let (_, near) = get("/objects?x=1.47&y=0&z=0.44&radius=0.1");
    assert_eq!((near["total"].as_u64(), near["objects"][0]["name"].as_str()), (Some(1), Some("apple")));
    assert_eq!(get("/objects?limit=1&offset=1").1["objects"][0]["id"].as_u64(), Some(1));
    let (_, one) = get("/object?id=1");
    assert!(one["points"].as_u64().unwrap() > 50 && one["relations"].as_array().unwrap().len() == 2, "{one}");
    assert_eq!(get("/free?x=1.5&y=0").1["state"].as_str(), Some("occupied"));
    assert_eq!(get("/rooms").1["rooms"].as_array().unwrap().len(), 2);
    // Bounds.
    let long = "a".repeat(600);
    let much = format!("{{\"text\": \"{}\"}}", "a".repeat(20_000));
    for (method, path, body, code) in [
        ("GET", "/ground", "", 400),
        ("GET", &format!("/ground?text={long}"), "", 400),
        ("GET", "/objects?limit=100000", "", 400),
        ("GET", "/objects?x=1", "", 400),
        ("GET", "/free?x=nan&y=0", "", 400),
        ("GET", "/ground?txt=apple", "", 400),
        ("GET", "/object?id=77", "", 404),
        ("GET", "/../etc/passwd", "", 404),
        ("POST", "/ground", "[1", 400),
        ("POST", "/ground", &much, 413),
        ("PUT", "/objects", "{}", 405),
        ("DELETE", "/object?id=1", "", 405),
    ] {
        let (found, answer) = ask(&address, method, path, body);
        assert!(found == code && answer["error"].is_string(), "{method} {path}: {found} {answer}");
    }
    server.kill().unwrap();
    server.wait().unwrap();
    assert!(before == fs::read(map()).unwrap(), "the map was changed");
}

/// What comes back for these bytes, until the server closes.
fn say(address: &str, bytes: &[u8]) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    // The server may close before it has all.
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

/// `tiny_http`, which served maps at first, waited for the rest of a request for ever: one client that sent half of it
/// kept all others from their answers.
#[test]
fn hostile_clients_keep_nobody_from_an_answer() {
    let mut server = serve(&["--port", "0", "--patience-s", "3"]);
    let mut line = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().trim_start_matches("http://").trim_end_matches('/').to_owned();
    let slow = |half: &str| {
        let mut stream = TcpStream::connect(&address).unwrap();
        stream.write_all(half.as_bytes()).unwrap();
        stream
    };
    // Half a head, a body that never comes, nothing at all.
    let waiting = ["GET /summary HT", "POST /ground HTTP/1.1\r\nContent-Length: 100\r\n\r\n{", ""].map(slow);
    assert_eq!(ask(&address, "GET", "/summary", "").0, 200);
    for mut stream in waiting {
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
    }
    // More clients than there are seats: the last ones are told, and the seats become free again.
    let crowd: Vec<TcpStream> = (0..40).map(|_| TcpStream::connect(&address).unwrap()).collect();
    let answers = crowd.into_iter().map(|mut stream| {
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        answer
    });
    let codes: Vec<String> = answers.map(|answer| answer.chars().skip(9).take(3).collect()).collect();
    let count = |code: &str| codes.iter().filter(|found| *found == code).count();
    // The seat of the last question may be free a moment later than its answer.
    assert!((30..=32).contains(&count("408")) && count("408") + count("503") == 40, "{codes:?}");
    assert_eq!(ask(&address, "GET", "/summary", "").0, 200);
    // What is no request, too long, or not meant for this machine.
    let post = |headers: &str, body: &str| format!("POST /ground HTTP/1.1\r\n{headers}\r\n\r\n{body}");
    let deep = "[".repeat(16_000);
    for (bytes, code) in [
        ("\u{1}\u{2}nonsense\r\n\r\n".to_owned(), 400),
        (format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(100_000)), 431),
        (format!("GET / HTTP/1.1\r\n{}\r\n", "A: b\r\n".repeat(100)), 431),
        (post("Content-Length: 1000000000000", ""), 413),
        (post("Content-Length: 99999999999999999999999", ""), 400),
        (post("Content-Length: -1", ""), 400),
        (post("Transfer-Encoding: chunked", "5\r\nhello\r\n0\r\n\r\n"), 411),
        (post("Content-Length: 16000", &deep), 400),
        (post("Content-Length: 4", "\u{fffd}\u{fffd}"), 400),
        ("GET /summary HTTP/1.1\r\nHost: map.example.com\r\n\r\n".to_owned(), 403),
        ("BREW /summary HTTP/1.1\r\n\r\n".to_owned(), 405),
    ] {
        let answer = say(&address, bytes.as_bytes());
        let shown: String = bytes.chars().take(60).collect();
        assert!(answer.starts_with(&format!("HTTP/1.1 {code} ")), "{shown:?}: {answer}");
    }
    let head = say(&address, b"HEAD /summary HTTP/1.1\r\n\r\n");
    assert!(head.starts_with("HTTP/1.1 200 ") && head.ends_with("\r\n\r\n"), "{head}");
    server.kill().unwrap();
    server.wait().unwrap();
}

#[test]
fn a_map_is_a_tool_server() {
    let mut server = serve(&["--mcp"]);
    let mut input = server.stdin.take().unwrap();
    let mut output = BufReader::new(server.stdout.take().unwrap()).lines();
    let mut send = |message: &str| writeln!(input, "{message}").unwrap();
    let mut receive = || -> Value { serde_json::from_str(&output.next().unwrap().unwrap()).unwrap() };
    let request = |id: u64, method: &str, params: Value| {
        json!({"jsonrpc": "2.0", "id": id, "method": method, "params": params}).to_string()
    };
    send(&request(1, "initialize", json!({"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {}})));
    let hello = receive();
    assert_eq!((hello["id"].as_u64(), hello["result"]["serverInfo"]["name"].as_str()), (Some(1), Some("dsm")));
    // A notification has no answer.
    send("{\"jsonrpc\": \"2.0\", \"method\": \"notifications/initialized\"}");
    send(&request(2, "tools/list", json!({})));
    let tools = receive();
    let names: Vec<&str> =
        tools["result"]["tools"].as_array().unwrap().iter().map(|tool| tool["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["summary", "ground", "objects", "object", "rooms", "free"]);
    assert_eq!(tools["result"]["tools"][1]["inputSchema"]["required"], json!(["text"]));
    send(&request(3, "tools/call", json!({"name": "ground", "arguments": {"text": "the apple"}})));
    let found = receive();
    assert_eq!((found["id"].as_u64(), found["result"]["structuredContent"]["object_id"].as_u64()), (Some(3), Some(1)));
    send(&request(4, "tools/call", json!({"name": "forget", "arguments": {}})));
    assert_eq!(receive()["result"]["isError"], json!(true));
    send("{nonsense");
    assert_eq!(receive()["error"]["code"], json!(-32700));
    send(&format!("\"{}\"", "a".repeat(100_000)));
    assert_eq!(receive()["error"]["code"], json!(-32600));
    send(&request(5, "resources/list", json!({})));
    assert_eq!(receive()["error"]["code"], json!(-32601));
    drop(input);
    assert_eq!(server.wait().unwrap().code(), Some(0));
}
