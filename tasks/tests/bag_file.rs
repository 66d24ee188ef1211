//! Contract: a recorded run becomes a ROS 2 bag that PyPI's `rosbags` opens and reads by the definitions in it. Skipped
//! where that cannot be had.

#![cfg(all(feature = "mcap", feature = "ros2"))]
#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;
mod python;

use bench::Bench;
use python::{find_python, run_script, skip};

#[test]
fn a_recorded_run_opens_as_a_ros_2_bag() {
    let bench = Bench::new();
    let run = ["run", "episode.toml", "--time-limit-s", "3", "--out", "run", "--record", "run.mcap"];
    let output = bench.run(&run);
    // Three seconds are not enough to grasp.
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let output = bench.run(&["replay", "run.mcap", "--as-bag", "run.bag.mcap"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let Some(python) = find_python("rosbags-python", &["rosbags==0.11.9"]) else {
        return skip("bag_file: PyPI's rosbags cannot be had");
    };
    let counted = run_script(&python, "bag_file.py", bench.path());
    let number = |text: &str| text.split(' ').next().unwrap().parse::<u32>().unwrap();
    assert_eq!(number(&counted), number(&said), "{counted} {said}");
}
