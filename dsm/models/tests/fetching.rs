//! Contract: a file of a network appears whole and right or not at all; one that is there is not fetched again, and one that
//! cannot be fetched says where it is from.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its server fails")]

use dsm_models::{FetchError, NetworkFile, fetch};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::thread::JoinHandle;

/// SHA-256 of nothing that is served here.
const SUM: &str = "2eae2b8d4a2f5b6b5a3a9e8f3a4c4b8d0c9b7a6e5f4d3c2b1a09f8e7d6c5b4a3";

fn wanted(folder: &Path, source: &str, sha256: Option<&str>) -> NetworkFile {
    let file = folder.join("deep/network.onnx");
    NetworkFile { file, sha256: sha256.map(str::to_owned), source: source.to_owned(), licence: "MIT".to_owned() }
}

/// Answers one request with these bytes; gives the address.
fn serve(reply: Vec<u8>) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/network.onnx", listener.local_addr().unwrap());
    let thread = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut head = Vec::new();
        let mut part = [0; 1024];
        while !head.windows(4).any(|four| four == b"\r\n\r\n") {
            match stream.read(&mut part).unwrap() {
                0 => return,
                count => head.extend_from_slice(&part[..count]),
            }
        }
        stream.write_all(&reply).unwrap();
    });
    (address, thread)
}

fn reply(status: u16, body: &str) -> Vec<u8> {
    format!("HTTP/1.1 {status} X\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}", body.len()).into()
}

fn is_empty(folder: &Path) -> bool {
    let deep = folder.join("deep");
    !deep.exists() || std::fs::read_dir(deep).unwrap().next().is_none()
}

#[test]
fn a_file_is_fetched_once_and_held_to_its_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let (address, server) = serve(reply(200, "network"));
    let first = fetch(&wanted(folder.path(), &address, None)).unwrap();
    server.join().unwrap();
    assert!(first.is_new && !first.is_checked);
    assert_eq!(std::fs::read(&first.file).unwrap(), b"network");
    // Nobody listens any more.
    let again = fetch(&wanted(folder.path(), &address, Some(&first.sha256))).unwrap();
    assert!(!again.is_new && again.is_checked);
    // What is there is not what the file of models says.
    let error = fetch(&wanted(folder.path(), &address, Some(SUM))).unwrap_err();
    assert!(matches!(error, FetchError::Checksum { came: false, .. }), "{error}");
    assert!(first.file.exists(), "what was there stays");
}

#[test]
fn what_is_wrong_is_not_kept() {
    for (name, bytes) in [
        ("another file", reply(200, "something else")),
        ("an error", reply(404, "no such file")),
        ("nothing", reply(200, "")),
        ("half of it", b"HTTP/1.1 200 X\r\nContent-Length: 100\r\n\r\nnetwo".to_vec()),
        ("no reply", Vec::new()),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (address, server) = serve(bytes);
        let error = fetch(&wanted(folder.path(), &address, Some(SUM))).unwrap_err();
        server.join().unwrap();
        assert!(
            matches!(error, FetchError::Checksum { came: true, .. } | FetchError::Download { .. }),
            "{name}: {error}"
        );
        assert!(is_empty(folder.path()), "{name}");
    }
}

#[test]
fn words_are_no_address() {
    let folder = tempfile::tempdir().unwrap();
    let error = fetch(&wanted(folder.path(), "export it with the authors' script", None)).unwrap_err();
    assert!(error.to_string().contains("export it with the authors' script"), "{error}");
    assert!(is_empty(folder.path()));
}
