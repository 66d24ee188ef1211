//! Contract: networks of a file of models detect and encode in `dsm build` and `dsm run`, each frame's detections are applied
//! to that frame, offline and in lock-step the same on every run; `dsm models check` and `fetch` tell what is missing.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its files fails")]
#![cfg(feature = "onnx")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;

use bench::Bench;
use dsm::store::load_map;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn good(bench: &Bench, args: &[&str], code: i32) -> String {
    let output = bench.run(args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The small networks of `dsm-models`, looked through for apples and tables.
fn write_models(bench: &Bench, extra: &str) {
    let networks = Path::new(env!("CARGO_MANIFEST_DIR")).join("../dsm/models/tests/networks");
    let file = |name: &str| {
        let path = networks.join(name);
        format!("{{ file = {path:?}, source = \"make.py\", licence = \"MIT\" }}")
    };
    let text = format!(
        "version = 1\n[detector]\nnetwork = {}\ntext = {}\ntokenizer = {}\nvocabulary = [\"apple\", \"table\"]\n\
         least_score = 0.2\noverlap = 0.1\nmost = 6\n[segmenter]\nencoder = {}\ndecoder = {}\n[text]\nkind = \"minilm\"\n\
         network = {}\ntokenizer = {}\n[visual]\nkind = \"dinov2\"\nnetwork = {}\n{extra}",
        file("yolo_world.onnx"),
        file("clip_text.onnx"),
        file("clip.tokenizer.json"),
        file("sam2_encoder.onnx"),
        file("sam2_decoder.onnx"),
        file("minilm.onnx"),
        file("minilm.tokenizer.json"),
        file("dinov2.onnx"),
    );
    fs::write(bench.path().join("models.toml"), text).unwrap();
}

#[test]
fn networks_map_a_recorded_run() {
    let bench = Bench::new();
    good(&bench, &["record", "episode.toml", "--time-limit-s", "4", "-o", "seq"], 1);
    write_models(&bench, "[sight]\nevery_s = 1.0\nlatency_s = 0.7\n");
    let build = |out: &str| {
        let args = ["build", "seq", "-o", out, "--backend", "models.toml", "--json"];
        serde_json::from_str::<Value>(&good(&bench, &args, 0)).unwrap()
    };
    let built = build("first.dsm");
    assert_eq!(built["source"], "backend");
    assert!(built["detections"].as_u64().unwrap() > 0, "{built}");
    let map = load_map(&bench.path().join("first.dsm")).unwrap().map;
    assert!(map.free_space.known_cells().count() > 500, "frames that are not looked at tell of free space");
    let names = |object: &dsm::map::MapObject| object.name().to_owned();
    assert!(map.objects.values().all(|object| ["apple", "table"].contains(&names(object).as_str())));
    for object in map.objects.values() {
        assert!(object.provenance.credits().iter().any(|credit| credit.source == "yolo_world+sam2"));
        assert_eq!((object.text_feature.len(), object.visual_feature.len()), (384, 384));
    }
    // Again, the same bytes, however fast the networks were.
    assert_eq!(build("second.dsm"), built);
    assert!(fs::read(bench.path().join("first.dsm")).unwrap() == fs::read(bench.path().join("second.dsm")).unwrap());
    // What was recorded is still there for who asks for it.
    let args = ["build", "seq", "-o", "own.dsm", "--backend", "models.toml", "--detections", "recorded", "--json"];
    assert_eq!(serde_json::from_str::<Value>(&good(&bench, &args, 0)).unwrap()["source"], "recorded");
    bench.refuses(&["build", "seq", "-o", "none.dsm", "--detections", "backend"], &["neither detector nor segmenter"]);
}

#[test]
fn networks_see_for_a_robot_in_lock_step() {
    let bench = Bench::new();
    write_models(&bench, "[sight]\nevery_s = 1.0\nlatency_s = 0.7\npace = \"lockstep\"\n");
    let run = |out: &str| {
        let args = ["run", "episode.toml", "--time-limit-s", "3", "--backend", "models.toml", "--out", out];
        good(&bench, &args, 1);
        ["summary.json", "map.dsm"].map(|file| fs::read(bench.path().join(out).join(file)).unwrap())
    };
    let first = run("a");
    assert!(first == run("b"), "two runs differ");
    let map = load_map(&bench.path().join("a/map.dsm")).unwrap().map;
    let by = |object: &dsm::map::MapObject| {
        object.provenance.credits().iter().any(|credit| credit.source == "yolo_world+sam2")
    };
    assert!(map.objects.values().all(|object| by(object)), "only the networks name things");
}

#[test]
fn a_check_tells_what_is_there_and_what_is_missing() {
    let bench = Bench::new();
    write_models(&bench, "");
    let text = good(&bench, &["models", "check", "models.toml"], 0);
    for fragment in
        ["ok   detector.network", "no checksum to hold it to", "ok   detector: it sees", "features of 384 values"]
    {
        assert!(text.contains(fragment), "{fragment}: {text}");
    }
    let file = bench.path().join("models.toml");
    let broken = fs::read_to_string(&file).unwrap().replace("/minilm.onnx", "/absent.onnx");
    fs::write(&file, broken).unwrap();
    let text = good(&bench, &["models", "check", "models.toml"], 1);
    assert!(
        text.contains("FAIL text.network") && text.contains("FAIL text:") && text.contains("absent.onnx"),
        "{text}"
    );
    let text = good(&bench, &["models", "fetch", "models.toml"], 1);
    assert!(text.contains("FAIL text.network") && text.contains("its source is no address: make.py"), "{text}");
    bench.refuses(&["run", "episode.toml", "--backend", "models.toml"], &["absent.onnx", "make.py"]);
}
