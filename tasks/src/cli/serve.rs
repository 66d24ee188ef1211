//! `dsm serve-map MAP`: answer questions about a map over HTTP on this machine, or as an MCP server over stdio.

use super::output::print;
use super::serve_http::{Answer, Asked, serve};
use crate::error::TaskError;
use crate::map_server::{MapServer, QUESTIONS, Refusal};
use serde_json::{Map, Value, json};
use std::io::{BufRead, Read, Write};
use std::net::{Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::time::Duration;

/// Longest line of an MCP client, bytes.
const LONGEST_LINE: u64 = 64 << 10;
/// The revision of MCP that is spoken.
const PROTOCOL: &str = "2025-06-18";

/// Arguments of `dsm serve-map`.
#[derive(Debug, clap::Args)]
pub struct ServeArgs {
    /// A map file; it is only read.
    map: PathBuf,
    /// Port of this machine (127.0.0.1); 0 takes a free one.
    #[arg(long, default_value_t = 8360)]
    port: u16,
    /// Wall time that a client gets for its request, for the answer to be found, and to take it, seconds, 0.1 to 600.
    #[arg(long, default_value_t = 5.0, value_parser = parse_patience, conflicts_with = "mcp")]
    patience_s: f64,
    /// Speak MCP over stdin and stdout instead: the questions are tools.
    #[arg(long, conflicts_with = "port")]
    mcp: bool,
}

/// Serves until Ctrl-C or the end of stdin.
pub(super) fn run(args: ServeArgs) -> anyhow::Result<u8> {
    let map = MapServer::open(&args.map)?;
    if args.mcp {
        return speak_mcp(&map);
    }
    let refused =
        |why: std::io::Error| TaskError::Usage(format!("--port: 127.0.0.1:{} cannot be used: {why}", args.port));
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, args.port)).map_err(refused)?;
    print(&format!("http://127.0.0.1:{}/", listener.local_addr()?.port()))?;
    serve(&listener, Duration::from_secs_f64(args.patience_s), move |asked| respond(asked, &map))?;
    Ok(0)
}

fn respond(asked: &Asked, map: &MapServer) -> Answer {
    let (path, query) = asked.url.split_once('?').unwrap_or((&asked.url, ""));
    let parameters = if asked.method == "POST" { parse_body(&asked.body) } else { Ok(parse_query(query)) };
    match (parameters, path.trim_matches('/')) {
        (Err(why), _) => (400, json!({"error": why})),
        (Ok(_), "") => (200, describe()),
        (Ok(parameters), question) => match map.answer(question, &parameters) {
            Ok(answer) => (200, answer),
            Err(Refusal::Bad(why)) => (400, json!({"error": why})),
            Err(Refusal::Unknown(why)) => (404, json!({"error": why})),
        },
    }
}

fn parse_body(body: &[u8]) -> Result<Map<String, Value>, String> {
    if body.trim_ascii().is_empty() {
        return Ok(Map::new());
    }
    serde_json::from_slice(body).map_err(|error| format!("expected a JSON object: {error}"))
}

/// `a=b&c=d` with `+` and `%41`.
fn parse_query(query: &str) -> Map<String, Value> {
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    pairs.map(|(key, value)| (decode(key), Value::String(decode(value)))).collect()
}

fn decode(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        rest = after;
        let escaped = || std::str::from_utf8(after.get(..2)?).ok().and_then(|two| u8::from_str_radix(two, 16).ok());
        match (first, escaped()) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            (b'+', _) => bytes.push(b' '),
            (byte, _) => bytes.push(*byte),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn describe() -> Value {
    let one = |question: &crate::map_server::Question| {
        let parameters = |(name, kind, required, about): &(&str, &str, bool, &str)| json!({"name": name, "type": kind, "required": required, "about": about});
        let parameters: Vec<Value> = question.parameters.iter().map(parameters).collect();
        json!({"path": format!("/{}", question.name), "about": question.about, "parameters": parameters})
    };
    json!({"questions": QUESTIONS.iter().map(one).collect::<Vec<_>>()})
}

/// JSON-RPC, one message a line.
fn speak_mcp(map: &MapServer) -> anyhow::Result<u8> {
    let mut input = std::io::stdin().lock();
    let mut output = std::io::stdout().lock();
    loop {
        let mut line = Vec::new();
        if (&mut input).take(LONGEST_LINE).read_until(b'\n', &mut line)? == 0 {
            return Ok(0);
        }
        let too_long = line.len() as u64 == LONGEST_LINE && !line.ends_with(b"\n");
        if too_long {
            input.skip_until(b'\n')?;
        }
        let answer = match serde_json::from_slice::<Value>(&line) {
            _ if too_long => {
                Some(failure(&Value::Null, -32600, &format!("a message has at most {LONGEST_LINE} bytes")))
            }
            Ok(message) => answer_mcp(map, &message),
            Err(_) if line.iter().all(u8::is_ascii_whitespace) => None,
            Err(error) => Some(failure(&Value::Null, -32700, &error.to_string())),
        };
        if let Some(answer) = answer {
            writeln!(output, "{answer}")?;
            output.flush()?;
        }
    }
}

fn failure(id: &Value, code: i32, why: &str) -> Value {
    json!({"jsonrpc": "2.0", "id": id, "error": {"code": code, "message": why}})
}

/// The answer to one message; `None` for a notification.
fn answer_mcp(map: &MapServer, message: &Value) -> Option<Value> {
    let id = message.get("id")?;
    let method = message.get("method").and_then(Value::as_str).unwrap_or_default();
    let parameters = message.get("params").cloned().unwrap_or_default();
    let result = match method {
        "initialize" => json!({"protocolVersion": PROTOCOL, "capabilities": {"tools": {}},
            "serverInfo": {"name": "dsm", "version": env!("CARGO_PKG_VERSION")},
            "instructions": "A map of a place: objects with boxes in metres (z up), attributes, relations and rooms."}),
        "ping" => json!({}),
        "tools/list" => json!({"tools": QUESTIONS.iter().map(tool).collect::<Vec<_>>()}),
        "tools/call" => {
            let name = parameters.get("name").and_then(Value::as_str).unwrap_or_default();
            let arguments = parameters.get("arguments").and_then(Value::as_object).cloned().unwrap_or_default();
            match map.answer(name, &arguments) {
                Ok(answer) => json!({"content": [{"type": "text", "text": answer.to_string()}],
                    "structuredContent": answer, "isError": false}),
                Err(Refusal::Bad(why) | Refusal::Unknown(why)) => {
                    json!({"content": [{"type": "text", "text": why}], "isError": true})
                }
            }
        }
        _ => return Some(failure(id, -32601, &format!("`{method}` is not known"))),
    };
    Some(json!({"jsonrpc": "2.0", "id": id, "result": result}))
}

fn tool(question: &crate::map_server::Question) -> Value {
    let property = |(name, kind, _, about): &(&str, &str, bool, &str)| {
        ((*name).to_owned(), json!({"type": kind, "description": about}))
    };
    let properties: Map<String, Value> = question.parameters.iter().map(property).collect();
    let required: Vec<&str> = question.parameters.iter().filter(|p| p.2).map(|p| p.0).collect();
    json!({"name": question.name, "description": question.about,
        "inputSchema": {"type": "object", "properties": properties, "required": required, "additionalProperties": false},
        "annotations": {"readOnlyHint": true}})
}

fn parse_patience(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    if (0.1..=600.0).contains(&seconds) { Ok(seconds) } else { Err("expected 0.1 to 600 seconds".into()) }
}
