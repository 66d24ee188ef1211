//! Contract: `--backend FILE` has a model speak, and when its server is away the embedded backend answers and says so;
//! `dsm models check` tells what a server can do.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its map fails")]
#![cfg(feature = "models")]

use dsm::geometry::OrientedBox;
use dsm::map::{Map, MapChange, MapObject, MapUpdate, ObjectId, Votes};
use dsm::store::save_map;
use dsm::time::Stamp;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const TEXT: &str = "the mug on the table";

fn object(id: u64, name: &str, center: [f64; 3], size: [f64; 3]) -> MapObject {
    let mut names = Votes::default();
    names.add(name, 5.0);
    let (center, size) = (Point3::from(center), Vector3::from(size));
    let bounds = OrientedBox { center, size, rotation: UnitQuaternion::identity() };
    MapObject { observations: 9, ..MapObject::given(ObjectId(id), names, bounds) }
}

/// Two mugs alike on one table.
fn write_map(folder: &Path) -> PathBuf {
    let objects = [
        object(1, "table", [2.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
        object(2, "mug", [1.8, 0.1, 0.8], [0.08, 0.08, 0.1]),
        object(3, "mug", [2.2, 0.1, 0.8], [0.08, 0.08, 0.1]),
    ];
    let mut map = Map::new(0.05);
    let changes = objects.into_iter().map(|object| MapChange::Put(Box::new(object))).collect();
    map.apply(MapUpdate { stamp: Stamp::default(), changes });
    let file = folder.join("map.dsm");
    save_map(&file, &map).unwrap();
    file
}

fn write_models(folder: &Path, url: &str, uses: &str) -> PathBuf {
    let file = folder.join("models.toml");
    let text = format!(
        "version = 1\n[language]\nurl = \"{url}\"\nmodel = \"scripted\"\nuses = {uses}\nvision = false\nretries = 0\n\
         cache = \"cache\"\nrecord = \"record.jsonl\"\n"
    );
    std::fs::write(&file, text).unwrap();
    file
}

/// Answers every question of a program that runs as long as this process, in the form that its schema is for.
fn serve() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/v1", listener.local_addr().unwrap());
    std::thread::spawn(move || listener.incoming().flatten().for_each(answer));
    url
}

fn answer(mut stream: TcpStream) {
    let mut request = Vec::new();
    let mut part = [0; 65_536];
    while let Ok(count @ 1..) = stream.read(&mut part) {
        request.extend_from_slice(&part[..count]);
        let text = String::from_utf8_lossy(&request).into_owned();
        let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
        let length =
            head.to_lowercase().lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse().ok());
        if length.is_some_and(|length: usize| body.len() >= length) {
            let said = answer_to(&serde_json::from_str(body).unwrap());
            let content = json!({"thought": "", "answer": said}).to_string();
            let body = json!({"choices": [{"message": {"content": content}}]}).to_string();
            let head = format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\nConnection: close\r\n\r\n", body.len());
            let _ = stream.write_all((head + &body).as_bytes());
            return;
        }
    }
}

fn answer_to(request: &Value) -> Value {
    let schema = request["response_format"]["json_schema"]["schema"].to_string();
    let thing = |id: &str, noun: &str| json!({"id": id, "kind": "thing", "noun": noun, "any": false, "attributes": [], "relations": [], "selections": []});
    match () {
        () if schema.contains("scores") => json!({"scores": [{"id": 2, "score": 0.0}, {"id": 3, "score": 1.0}]}),
        () if schema.contains("things") => json!({"things": [thing("t", "apple")], "target": "t"}),
        () => json!({"class": "apple"}),
    }
}

fn dsm(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dsm")).args(arguments).env_remove("DSM_BACKEND").output().unwrap()
}

fn json_of(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}

#[test]
fn a_model_decides_between_equals_and_is_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let map = write_map(folder.path());
    let models = write_models(folder.path(), &serve(), "[\"score\"]");
    let (map, models) = (map.to_str().unwrap(), models.to_str().unwrap());
    let plain = dsm(&["ground", map, TEXT, "--json"]);
    assert_eq!((plain.status.code(), &json_of(&plain)["status"]), (Some(1), &json!("ambiguous")));
    assert!(json_of(&plain).get("spoken").is_none());
    let asked = dsm(&["ground", map, TEXT, "--backend", models, "--json"]);
    let found = json_of(&asked);
    assert_eq!((asked.status.code(), &found["object_id"]), (Some(0), &json!(3)), "{found}");
    assert_eq!(found["backend"], json!("language:scripted"));
    // The server goes away: what was asked before is still known, the rest is left to the embedded backend.
    let models = write_models(folder.path(), "http://127.0.0.1:9/v1", "[\"score\"]");
    let models = models.to_str().unwrap();
    assert_eq!(json_of(&dsm(&["ground", map, TEXT, "--backend", models, "--json"])), found);
    let other = dsm(&["ground", map, "the mug near the table", "--backend", models, "--json"]);
    let other = json_of(&other);
    assert_eq!(
        (&other["backend"], &other["spoken"][0]["backend"]),
        (&json!("embedded"), &json!("embedded")),
        "{other}"
    );
    assert!(other["spoken"][0]["reason"].as_str().unwrap().contains("cannot be reached"), "{other}");
    let record = std::fs::read_to_string(folder.path().join("record.jsonl")).unwrap();
    let endings: Vec<Value> =
        record.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["ending"].clone()).collect();
    assert_eq!(endings, [json!("answered"), json!("cached"), json!("failed")]);
}

#[test]
fn a_server_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let models = write_models(folder.path(), &serve(), "[\"parse\", \"labels\"]");
    let checked = dsm(&["models", "check", models.to_str().unwrap(), "--json"]);
    let found = json_of(&checked);
    assert_eq!(
        (checked.status.code(), &found["passed"], &found["schema"]),
        (Some(0), &json!(true), &json!("json_schema"))
    );
    assert_eq!(found["checks"].as_array().map(Vec::len), Some(2), "{found}");
    let models = write_models(folder.path(), "http://127.0.0.1:9/v1", "[\"score\"]");
    let away = dsm(&["models", "check", models.to_str().unwrap()]);
    assert_eq!(away.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&away.stdout).contains("FAIL"));
}

#[test]
fn a_wrong_file_is_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    let map = write_map(folder.path());
    let file = folder.path().join("wrong.toml");
    std::fs::write(&file, "version = 1\n[language]\nurl = \"http://127.0.0.1:9/v1\"\nmodell = \"m\"\n").unwrap();
    let refused = dsm(&["ground", map.to_str().unwrap(), TEXT, "--backend", file.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(2));
    assert!(said.contains("wrong.toml:4") && said.contains("did you mean `model`?"), "{said}");
}
