//! Contract: a task over ROS 2 in lock step, in a process of its own, comes to what it comes to without ROS 2, bit for bit:
//! its map, and all that the judge says. A task that goes away ends the service with a verdict.
//!
//! Needs a network with multicast, as every machine's loopback has; a machine without it skips with a message.

#![cfg(feature = "ros2")]
#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

fn episode() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/apartment/episodes/fetch_apple.toml")
}

fn dsm(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
    command.current_dir(folder).args(args).arg("--seed").arg("1").env_remove("ROS_DOMAIN_ID");
    command
}

/// A process that ends with the test.
struct Ended(Option<Child>);

impl Ended {
    fn start(mut command: Command) -> Self {
        Self(Some(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()))
    }

    fn wait(mut self) -> Output {
        self.0.take().unwrap().wait_with_output().unwrap()
    }
}

impl Drop for Ended {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }
}

/// Whether two processes cannot find each other on this machine; then a message says so.
fn is_skipped(run: &Output) -> bool {
    let said = String::from_utf8_lossy(&run.stderr);
    let skipped = said.contains("nobody answers on");
    if skipped {
        #[allow(clippy::print_stderr, reason = "who runs the tests is told")]
        {
            eprintln!("skipped: {said}");
        }
        if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
            use std::io::Write;
            let mut log = fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
            writeln!(log, "dsm-tasks ros2: no multicast").unwrap();
        }
    }
    skipped
}

fn read(folder: &Path, file: &str) -> Vec<u8> {
    fs::read(folder.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

fn json(folder: &Path, file: &str) -> Value {
    serde_json::from_slice(&read(folder, file)).unwrap()
}

#[test]
fn a_task_in_another_process_comes_to_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, episode) = (folder.path(), episode());
    let episode = episode.to_str().unwrap();
    let plain = dsm(folder, &["run", episode, "--out", "plain"]).output().unwrap();
    assert_eq!(plain.status.code(), Some(0), "{}", String::from_utf8_lossy(&plain.stderr));
    let serve = ["serve", "--episode", episode, "--clock", "lock-step", "--domain", "73", "--out", "served"];
    let served = Ended::start(dsm(folder, &serve));
    let run = ["run", episode, "--drivers", "ros2", "--clock", "lock-step", "--domain", "73", "--out", "wire"];
    let run = dsm(folder, &run).output().unwrap();
    if is_skipped(&run) {
        return;
    }
    assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stderr));
    let served = served.wait();
    assert_eq!(served.status.code(), Some(0), "{}", String::from_utf8_lossy(&served.stderr));
    assert!(read(folder, "plain/map.dsm") == read(folder, "wire/map.dsm"), "the map of the task");
    assert!(read(folder, "plain/map.dsm") == read(folder, "served/map.dsm"), "the map as it was told");
    let (plain, wire, served) =
        (json(folder, "plain/summary.json"), json(folder, "wire/summary.json"), json(folder, "served/summary.json"));
    assert_eq!(plain, served, "the judge");
    // Whoever acts knows no truth.
    assert_eq!(wire["expectations"], Value::Array(Vec::new()));
    assert_eq!(wire["truth"]["target_pose_start"], Value::Array(Vec::new()));
    assert_eq!(plain["steps"][0]["grounding"], wire["steps"][0]["grounding"]);
}

#[test]
fn a_task_that_goes_away_is_judged() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, episode) = (folder.path(), episode());
    let episode = episode.to_str().unwrap();
    let serve = ["serve", "--episode", episode, "--domain", "74", "--patience-s", "1", "--out", "served"];
    let served = Ended::start(dsm(folder, &serve));
    // Looking is all that is done, so no account is told.
    let check = ["drivers", "check", "--drivers", "ros2", "--freedom", "stand", "--domain", "74"];
    let check = dsm(folder, &check).output().unwrap();
    if is_skipped(&check) {
        return;
    }
    let served = served.wait();
    assert_eq!(served.status.code(), Some(1), "{}", String::from_utf8_lossy(&served.stderr));
    let summary = json(folder, "served/summary.json");
    assert_eq!(summary["failure"]["reason"], "the task is silent and has told no account");
    assert_eq!(summary["expectations"][0]["passed"], false);
}
