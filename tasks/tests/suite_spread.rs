//! Contract: a suite whose episodes are run one by one elsewhere comes to the bytes of the suite run here; an episode that
//! was lost is told of with its page; what does not belong to the suite is refused.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;

use bench::Bench;
use serde_json::Value;
use std::fs;

const SUITE: [&str; 6] = ["suite", "episode.toml", "--seeds", "3..5", "--time-limit-s", "2"];

/// Standard output of a command that ends with `code`.
fn said(bench: &Bench, words: &[&str], code: i32) -> String {
    let output = bench.run(words);
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{words:?}: {complaint}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn plan(bench: &Bench) -> Value {
    serde_json::from_str(&said(bench, &[&SUITE[..], &["--out", "spread", "--plan"]].concat(), 0)).unwrap()
}

#[test]
fn a_suite_run_elsewhere_comes_to_the_same() {
    let bench = Bench::new();
    let path = |name: &str| bench.path().join(name);
    let read = |name: &str| fs::read(path(name)).unwrap();
    // Two seconds are not enough for anything: the episodes fail, and are rows all the same.
    said(&bench, &[&SUITE[..], &["--out", "here", "--junit", "here.xml"]].concat(), 1);

    let planned = plan(&bench);
    let episodes = planned["episodes"].as_array().unwrap();
    assert_eq!(episodes.iter().map(|e| e["seed"].as_u64().unwrap()).collect::<Vec<_>>(), [3, 4]);
    for episode in episodes {
        assert_eq!(episode["is_done"], Value::Bool(false));
        let (seed, limit) = (episode["seed"].as_u64().unwrap(), episode["time_limit_s"].to_string());
        let one = format!("{seed}..{}", seed + 1);
        let mut words = vec!["suite", episode["file"].as_str().unwrap(), "--seeds", &one, "--time-limit-s", &limit];
        for flag in ["--robot", "--physics", "--perception", "--backend"] {
            words.extend([flag, episode[&flag[2..]].as_str().unwrap()]);
        }
        let out = format!("elsewhere-{seed}");
        words.extend(["--out", &out]);
        said(&bench, &words, 1);
        let own = format!("episode-{seed}");
        fs::rename(path(&out).join(&own), path("spread").join(&own)).unwrap();
    }
    assert!(plan(&bench)["episodes"].as_array().unwrap().iter().all(|e| e["is_done"] == Value::Bool(true)));
    fs::write(path("lines.json"), "[]").unwrap();
    let gather = [&SUITE[..], &["--out", "spread", "--gather", "lines.json", "--junit", "spread.xml"]].concat();
    said(&bench, &gather, 1);
    for (one, other) in [("here/suite.json", "spread/suite.json"), ("here.xml", "spread.xml")] {
        assert!(read(one) == read(other), "{one} differs from {other}");
    }

    // One is lost: its row is what is told of it.
    fs::remove_dir_all(path("spread/episode-4")).unwrap();
    let lost = r#"[{"id": "episode", "seed": 4, "success": false, "failed_stage": "crash", "reason": "its worker died", "metrics": null}]"#;
    fs::write(path("lines.json"), lost).unwrap();
    said(&bench, &gather, 1);
    let suite: Value = serde_json::from_slice(&read("spread/suite.json")).unwrap();
    assert_eq!((&suite["episodes"][1]["reason"], &suite["totals"]["episodes"]), (&"its worker died".into(), &2.into()));
    assert!(String::from_utf8(read("spread/episode-4/failure.html")).unwrap().contains("its worker died"));

    // Another suite's episode.
    fs::write(path("lines.json"), lost.replace("\"seed\": 4", "\"seed\": 7")).unwrap();
    let output = bench.run(&gather);
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{complaint}");
    assert!(complaint.contains("episode with seed 7 is no episode of this suite"), "{complaint}");
}

#[test]
fn two_episodes_of_one_name_are_refused() {
    let bench = Bench::new();
    fs::create_dir(bench.path().join("other")).unwrap();
    let text = fs::read_to_string(bench.path().join("episode.toml")).unwrap();
    fs::write(bench.path().join("other/episode.toml"), text.replace("scene.xml", "../scene.xml")).unwrap();
    let output = bench.run(&["suite", "episode.toml", "other/episode.toml", "--out", "out"]);
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{complaint}");
    assert!(complaint.contains("have one name") && complaint.contains("other/episode.toml"), "{complaint}");
    assert!(!bench.path().join("out").exists(), "nothing is written");
}
