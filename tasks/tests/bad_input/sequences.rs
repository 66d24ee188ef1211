//! Recording a sequence, and mapping one.

use crate::bench::{Bench, refuse};

const JPEG: &[u8] = include_bytes!("../two_colors.jpg");
const BUILD: [&str; 4] = ["build", "s", "-o", "map.dsm"];

/// 8 x 4 pixels at two metres.
fn depth() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 8, 4);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header().unwrap().write_image_data(&10_000_u16.to_be_bytes().repeat(32)).unwrap();
    bytes
}

/// Two frames in TUM's layout.
fn good() -> Bench {
    Bench::new()
        .file("s/rgb.txt", "0.0 a.jpg\n0.1 b.jpg\n")
        .file("s/depth.txt", "0.0 a.png\n0.1 b.png\n")
        .file("s/groundtruth.txt", "0.0 0 0 1 0.5 -0.5 0.5 -0.5\n0.1 0 0 1 0.5 -0.5 0.5 -0.5\n")
        .file("s/a.jpg", JPEG)
        .file("s/b.jpg", JPEG)
        .file("s/a.png", depth())
        .file("s/b.png", depth())
}

#[test]
fn the_sequence_that_the_cases_break_is_right() {
    let bench = good();
    let output = bench.run(&BUILD);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("from 2 frames"));
}

refuse! {
    sequence_is_missing: Bench::new(), BUILD, ["s: no such folder"];
    sequence_is_a_file: Bench::new().file("s", "frames"), BUILD, ["s: no such folder"];
    sequence_is_something_else: Bench::new().folder("s"), BUILD, ["s: no known sequence", "expected sequence.json"];
    sequence_is_of_another_layout: good(), ["build", "s", "-o", "map.dsm", "--layout", "scannet"],
        ["intrinsic_depth.txt", "No such file"];
    sequence_has_no_poses: good().without("s/groundtruth.txt"), BUILD, ["groundtruth.txt", "No such file"];
    pose_is_short: good().edit("s/groundtruth.txt", "0.0 0 0 1 0.5 -0.5 0.5 -0.5", "0.0 0 0 1 0.5 -0.5 0.5"), BUILD,
        ["groundtruth.txt", "expected `time tx ty tz qx qy qz qw`"];
    pose_is_not_finite: good().edit("s/groundtruth.txt", "0.0 0 0 1", "0.0 0 nan 1"), BUILD,
        ["groundtruth.txt", "a pose is not finite"];
    time_is_a_word: good().edit("s/depth.txt", "0.1 b.png", "soon b.png"), BUILD,
        ["depth.txt:2: expected a time in seconds first"];
    nothing_belongs_together: good().edit("s/depth.txt", "0.0 a.png\n0.1 b.png", "7.0 a.png\n7.1 b.png"), BUILD,
        ["s: the sequence has no frame with colour, depth and pose"];
    /// What was there before stays.
    last_image_is_missing: good().without("s/b.png").file("map.dsm", "the old map"), BUILD, ["b.png", "No such file"];
    last_image_is_cut: good().file("s/b.png", &depth()[..40]), BUILD, ["b.png"];
    last_image_is_something_else: good().file("s/b.jpg", "GIF89a"), BUILD, ["b.jpg"];
    depth_is_in_color: good().file("s/b.png", JPEG), BUILD, ["b.png"];
    map_into_a_missing_folder: good(), ["build", "s", "-o", "nowhere/map.dsm"], ["nowhere/map.dsm", "No such file"];
    map_is_a_folder: good().folder("map.dsm"), BUILD, ["map.dsm", "is a directory"];
    camera_has_three_numbers: good(), ["build", "s", "-o", "map.dsm", "--camera", "525,525,319.5"],
        ["expected four numbers fx,fy,cx,cy"];
    detections_are_not_recorded: good(), ["build", "s", "-o", "map.dsm", "--detections", "recorded"],
        ["s: no detections.jsonl; use --detections pixels"];
    sequence_is_newer: good().file("s/sequence.json",
        "{\"version\": 2, \"source\": \"x\", \"depth_unit_mm\": 1.0, \"exact_depth\": false}"), BUILD,
        ["sequence.json: version 2 of a sequence is not known, expected 1"];
    sequence_folder_is_in_use: Bench::new().file("seq/notes.txt", "mine"), ["record", "episode.toml", "-o", "seq"],
        ["seq: the folder is not empty", "--force"];
}

#[cfg(not(feature = "mcap"))]
refuse! {
    recording_is_not_built_in: Bench::new(), ["record", "episode.toml", "-o", "seq", "--mcap", "run.mcap"],
        ["--mcap is not built in", "--features mcap"];
}

#[cfg(not(feature = "rerun"))]
refuse! {
    rerun_is_not_built_in: Bench::new(), ["record", "episode.toml", "-o", "seq", "--rerun", "run.rrd"],
        ["--rerun is not built in", "--features rerun"];
}

#[cfg(feature = "mcap")]
refuse! {
    recording_into_a_missing_folder: Bench::new(),
        ["record", "episode.toml", "-o", "seq", "--mcap", "nowhere/run.mcap"], ["nowhere/run.mcap", "No such file"];
    recording_is_a_folder: Bench::new().folder("run"), ["record", "episode.toml", "-o", "seq", "--mcap", "run"],
        ["run", "is a directory"];
}
