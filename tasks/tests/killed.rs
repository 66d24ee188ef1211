//! Contract: a run that is killed at any moment leaves a map that opens, behind the run by less than one simulated second,
//! and each later moment's file goes on where an earlier one's ends; its recording replays as far, to the same.
//!
//! Five moments by default; `DSM_KILLS` says how many (`tests/run --full` asks for 50).

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use dsm::store::load_map;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};

/// Latest moment, simulated seconds; the run would go on for longer.
const LATEST_S: f64 = 12.0;

/// What the run says of itself; `None` before it answers.
fn sim_time_s(address: &str) -> Option<f64> {
    let mut stream = TcpStream::connect(address).ok()?;
    write!(stream, "GET /status.json HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    let status: serde_json::Value = serde_json::from_str(answer.split("\r\n\r\n").nth(1)?).ok()?;
    status["sim_time_s"].as_f64()
}

/// Runs with further arguments until the moment and kills; gives the simulated time that the run had reached at least.
fn run_and_kill(out: &Path, moment_s: f64, further: &[&str]) -> f64 {
    let episode = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment/episodes/fetch_apple.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
    for variable in
        ["DSM_SEED", "DSM_ROBOT", "DSM_PHYSICS", "DSM_PERCEPTION", "DSM_THREADS", "DSM_TIME_LIMIT_S", "DSM_LOG"]
    {
        command.env_remove(variable);
    }
    command.arg("run").arg(episode).args(["--view=0", "--out"]).arg(out).args(further);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let line = lines.find(|line| line.as_ref().unwrap().contains("http://127.0.0.1:")).unwrap().unwrap();
    let address = line.split("http://").nth(1).unwrap().split('/').next().unwrap().to_owned();
    let reached_s = loop {
        match sim_time_s(&address) {
            Some(now_s) if now_s >= moment_s => break now_s,
            _ => assert!(child.try_wait().unwrap().is_none(), "the run ended before its {moment_s:.2} s"),
        }
    };
    // On Unix this is SIGKILL: the run has no say in it.
    child.kill().unwrap();
    child.wait().unwrap();
    reached_s
}

#[test]
fn a_killed_run_leaves_all_but_its_last_second() {
    let count = std::env::var("DSM_KILLS").map_or(5, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut files = Vec::new();
    for number in 0..count {
        // The first before anything can have been mapped.
        let moment_s = if number == 0 { 0.01 } else { rng.random_range(0.2..LATEST_S) };
        let out = folder.path().join(number.to_string());
        let reached_s = run_and_kill(&out, moment_s, &[]);
        let loaded = load_map(&out.join("map.dsm")).unwrap();
        assert!(!loaded.finished, "killed at {reached_s} s");
        let stamp_s = loaded.map.stamp.as_s();
        assert!(stamp_s > reached_s - 1.0, "killed at {reached_s} s, the map ends at {stamp_s} s");
        if reached_s > 3.0 {
            assert!(loaded.map.objects.len() >= 3, "{} objects at {reached_s} s", loaded.map.objects.len());
        }
        let mut bytes = fs::read(out.join("map.dsm")).unwrap();
        bytes.truncate(bytes.len() - loaded.lost_bytes as usize);
        files.push(bytes);
    }
    // The run is a function of its seed: what was written is written again, and nothing of it is ever changed.
    files.sort_by_key(Vec::len);
    for pair in files.windows(2) {
        assert!(pair[1].starts_with(&pair[0]), "the logs of one run differ");
    }
}

#[cfg(feature = "mcap")]
#[test]
fn a_killed_recording_replays_up_to_its_last_second() {
    use dsm_tasks::mcap_file::open_run;
    use dsm_tasks::replay::{PlayOptions, play};
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("run.mcap");
    let further = ["--record", recording.to_str().unwrap()];
    let reached_s = run_and_kill(&folder.path().join("out"), 4.3, &further);
    let report = play(&|wanted| open_run(&recording, wanted), PlayOptions::default()).unwrap().report;
    assert!(report.identical && !report.reached_end, "{report:?}");
    assert!(report.sim_time_s > reached_s - 1.0, "killed at {reached_s} s: {report:?}");
    assert!(report.commands > 800 && report.notices.len() == 1, "{report:?}");
}
