//! Contract: `--view` serves the camera, the map and the state of a run to this machine while it goes on, ends with it,
//! and changes nothing about it.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// `dsm run` of fifteen simulated seconds in the apartment.
fn command(out: &Path, more: &[&str]) -> Command {
    let episode = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment/episodes/fetch_apple.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
    for variable in
        ["DSM_SEED", "DSM_ROBOT", "DSM_PHYSICS", "DSM_PERCEPTION", "DSM_THREADS", "DSM_TIME_LIMIT_S", "DSM_LOG"]
    {
        command.env_remove(variable);
    }
    command.arg("run").arg(episode).args(["--time-limit-s", "15", "--out"]).arg(out).args(more);
    command
}

/// Code, head and body of an answer; `None` when nobody answers.
fn get(address: &str, path: &str) -> Option<(u16, String, Vec<u8>)> {
    let mut stream = TcpStream::connect(address).ok()?;
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").ok()?;
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).ok()?;
    let end = bytes.windows(4).position(|four| four == b"\r\n\r\n")?;
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let code = head.split(' ').nth(1)?.parse().ok()?;
    Some((code, head, bytes[end + 4..].to_vec()))
}

/// Asks until the run has something to show.
fn get_when_there(address: &str, path: &str) -> (String, Vec<u8>) {
    loop {
        match get(address, path) {
            Some((200, head, body)) => return (head, body),
            Some((503, _, _)) => {}
            other => panic!("{path}: {other:?}"),
        }
    }
}

#[test]
fn a_run_can_be_watched_and_is_the_same_as_one_that_nobody_watches() {
    let folder = tempfile::tempdir().unwrap();
    let outs: [PathBuf; 2] = ["watched", "alone"].map(|name| folder.path().join(name));

    let mut child = command(&outs[0], &["--view=0"]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let line = lines.find(|line| line.as_ref().unwrap().contains("http://127.0.0.1:")).unwrap().unwrap();
    let address = line.split("http://").nth(1).unwrap().split('/').next().unwrap().to_owned();
    let (head, page) = get_when_there(&address, "/");
    assert!(head.contains("text/html"), "{head}");
    assert!(String::from_utf8(page).unwrap().contains("camera.png"));
    for picture in ["/camera.png", "/depth.png", "/map.png?3"] {
        let (head, body) = get_when_there(&address, picture);
        assert!(head.contains("image/png") && body.starts_with(PNG), "{picture}: {head}");
    }
    let (_, map) = get_when_there(&address, "/map.svg");
    assert!(map.starts_with(b"<svg "));
    let (_, status) = get_when_there(&address, "/status.json");
    let status: serde_json::Value = serde_json::from_slice(&status).unwrap();
    assert_eq!((status["episode"].as_str(), status["time_limit_s"].as_f64()), (Some("fetch_apple"), Some(15.0)));
    assert!(status["frames"].as_u64().unwrap() > 0 && status["sim_time_s"].as_f64().unwrap() > 0.0, "{status}");
    assert_eq!(get(&address, "/etc/passwd").unwrap().0, 404);
    let watched = child.wait().unwrap();
    assert!(get(&address, "/").is_none(), "the page outlives the run");

    let alone = command(&outs[1], &[]).output().unwrap().status;
    assert_eq!((watched.code(), alone.code()), (Some(1), Some(1)), "the time is up in both");
    for file in ["summary.json", "map.dsm"] {
        assert_eq!(fs::read(outs[0].join(file)).unwrap(), fs::read(outs[1].join(file)).unwrap(), "{file} differs");
    }
}
