//! Contract: the MCAP file of a run is read by PyPI's `mcap` with the run's frames, detections, poses and map in it. Skipped
//! where that cannot be had.

#![cfg(feature = "mcap")]
#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;
mod python;

use bench::Bench;
use python::{find_python, run_script, skip};
use std::fs;

#[test]
fn the_mcap_file_of_a_run_holds_what_happened() {
    let bench = Bench::new();
    let args = ["record", "episode.toml", "--time-limit-s", "15", "-o", "seq", "--mcap", "run.mcap"];
    let output = bench.run(&args);
    // Fifteen seconds are not enough to grasp.
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let shown = bench.run(&["map", "show", "seq/map.dsm", "--json"]).stdout;
    fs::write(bench.path().join("shown.json"), shown).unwrap();
    let Some(python) = find_python("mcap-python", &["mcap==1.6.0"]) else {
        return skip("mcap: PyPI's mcap cannot be had");
    };
    let said = run_script(&python, "mcap_file.py", bench.path());
    assert!(said.contains(" frames, "), "{said}");
}
