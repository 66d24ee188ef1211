//! Contract: the pages of a run, of a suite and of two suites open from their files in a browser without a complaint, ask
//! for nothing from outside, fit the window of a phone and of a desk with text that can be read, and their links lead to
//! files. Skipped where there is no Chromium.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// What `tests/pages_check` ends with where there is no browser.
const NO_BROWSER: i32 = 77;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn check_pages() -> Command {
    let mut command = Command::new("python3");
    command.arg(root().join("tests/pages_check"));
    command
}

fn skip(reason: &str) {
    if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
        let mut log = fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
        writeln!(log, "pages: {reason}").unwrap();
    }
}

/// The code with which `dsm` ends.
fn dsm(arguments: &[&Path]) -> i32 {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dsm"));
    for variable in ["DSM_SEED", "DSM_ROBOT", "DSM_PHYSICS", "DSM_PERCEPTION", "DSM_THREADS", "DSM_LOG"] {
        command.env_remove(variable);
    }
    command.env("DSM_TIME_LIMIT_S", "12").args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().unwrap().code().unwrap()
}

#[test]
fn pages_open_without_complaints_and_fit_small_and_large_windows() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.html");
    let text = "<!doctype html><p style='width:900px;font-size:9px'>x</p><a href='none.html'>y</a>\
                <img src='http://[::1]:9/z'><script>nothing()</script>";
    fs::write(&broken, text).unwrap();
    let checked = check_pages().arg(&broken).args(["--widths", "390"]).output().unwrap();
    if checked.status.code() == Some(NO_BROWSER) {
        return skip("no Chromium on this machine");
    }
    let told = String::from_utf8_lossy(&checked.stdout);
    assert_eq!(checked.status.code(), Some(1), "{told}");
    let troubles =
        ["needs 9", "text of 9.0 px", "link leads nowhere", "picture is not there", "asks for http://[::1]:9/z"];
    for trouble in troubles.into_iter().chain(["console: ", "nothing is not defined"]) {
        assert!(told.contains(trouble), "{trouble} is not told: {told}");
    }

    let suite = folder.path().join("a suite");
    let episode = root().join("scenes/apartment/episodes/fetch_apple.toml");
    let words = ["suite", "--seeds", "2..3", "--out", "suite-page", "suite-compare", "--page"].map(Path::new);
    assert_eq!(dsm(&[words[0], &episode, words[1], words[2], words[3], &suite]), 1, "12 s are too short");
    let index = suite.join("index.html");
    let written = fs::read(&index).unwrap();
    fs::remove_file(&index).unwrap();
    assert_eq!(dsm(&[words[4], &suite]), 0);
    assert_eq!(fs::read(&index).unwrap(), written, "the page follows from what the suite left");
    let compared = folder.path().join("pages/compare.html");
    assert_eq!(dsm(&[words[5], &suite, &suite, words[6], &compared]), 0, "nothing is worse than itself");

    let own = suite.join("fetch_apple-2");
    let pages = [index, own.join("report.html"), own.join("failure.html"), compared];
    let checked = check_pages().args(&pages).output().unwrap();
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stdout));
}
