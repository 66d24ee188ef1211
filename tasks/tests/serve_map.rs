//! Contract: a map answers over HTTP and as an MCP server over stdio, the same either way; what is asked is bounded, and
//! nothing can be changed.

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
