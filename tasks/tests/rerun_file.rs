//! Contract: the Rerun recording of a run is read by PyPI's `rerun-sdk` with the run's frames, detections, poses and map in
//! it, and the same run gives the same chunks. Reading is skipped where that library cannot be had.

#![cfg(feature = "rerun")]
#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;
mod python;

use bench::Bench;
use python::{find_python, run_script, skip};
use std::fs;

#[test]
fn the_rerun_recording_of_a_run_holds_what_happened() {
    let bench = Bench::new();
    let record = |folder: &str, file: &str| {
        let args = ["record", "episode.toml", "--time-limit-s", "15", "-o", folder, "--rerun", file];
        let output = bench.run(&args);
        // Fifteen seconds are not enough to grasp.
        assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    };
    record("seq", "run.rrd");
    record("again", "again.rrd");
    let shown = bench.run(&["map", "show", "seq/map.dsm", "--json"]).stdout;
    fs::write(bench.path().join("shown.json"), shown).unwrap();
    let Some(python) = find_python("rerun-python", &["rerun-sdk==0.41.0"]) else {
        return skip("rerun: PyPI's rerun-sdk cannot be had");
    };
    let said = run_script(&python, "rerun_file.py", bench.path());
    assert!(said.contains(" frames, "), "{said}");
}
