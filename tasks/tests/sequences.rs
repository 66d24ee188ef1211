//! Contract: a recorded run mapped again gives the run's own map, byte for byte, from depth as it was measured and from
//! images in millimetres; sequences in the layouts of others are read with
//! their poses, depths and colours.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its files fails")]

#[path = "bad_input/bench.rs"]
#[allow(dead_code, unused_imports, unused_macros, reason = "shared with the tests of bad input")]
mod bench;

use bench::Bench;
use dsm::store::load_map;
use dsm_tasks::sequence::{Layout, Options, Sequence};
use nalgebra::Point3;
use std::fs;
use std::path::Path;

fn good(bench: &Bench, args: &[&str], code: i32) -> String {
    let output = bench.run(args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_recorded_run_mapped_again_gives_its_own_map() {
    let bench = Bench::new();
    // Eight seconds are not enough to grasp: the run fails, its recording is whole.
    good(&bench, &["record", "episode.toml", "--time-limit-s", "8", "--exact-depth", "-o", "seq"], 1);
    let own = bench.path().join("seq/map.dsm");
    let text = good(&bench, &["build", "seq", "-o", "again.dsm"], 0);
    assert!(text.starts_with("2 objects"), "{text}");
    assert!(fs::read(&own).unwrap() == fs::read(bench.path().join("again.dsm")).unwrap(), "the maps differ");
    // As others would get it: with depth in millimetres alone.
    let frames = bench.path().join("seq/frames.jsonl");
    let lines: Vec<String> = fs::read_to_string(&frames)
        .unwrap()
        .lines()
        .map(|line| {
            let mut frame: serde_json::Value = serde_json::from_str(line).unwrap();
            frame.as_object_mut().unwrap().remove("exact_depth").unwrap();
            frame.to_string()
        })
        .collect();
    assert!(lines.len() > 20, "{} frames", lines.len());
    fs::write(&frames, lines.join("\n") + "\n").unwrap();
    good(&bench, &["build", "seq", "-o", "rounded.dsm"], 0);
    // A camera hands depth out in whole millimetres: nothing is lost.
    assert!(fs::read(&own).unwrap() == fs::read(bench.path().join("rounded.dsm")).unwrap(), "the maps differ");
    // In pixels alone nothing has a name; the free space is the same.
    good(&bench, &["build", "seq", "-o", "pixels.dsm", "--detections", "pixels", "--stride", "4"], 0);
    let pixels = load_map(&bench.path().join("pixels.dsm")).unwrap().map;
    assert!(pixels.free_space.known_cells().count() > 500);
    assert!(pixels.stable_objects().all(|object| object.name() != "apple"));
    // A recording that broke off ends with its last whole line.
    fs::write(&frames, format!("{}\n{}", lines[0], &lines[1][..lines[1].len() / 2])).unwrap();
    let text = good(&bench, &["build", "seq", "-o", "short.dsm"], 0);
    assert!(text.contains("from 1 frames"), "{text}");
    // Broken input names its place.
    fs::write(&frames, "{\"id\": 1}\n").unwrap();
    bench.refuses(&["build", "seq", "-o", "none.dsm"], &["frames.jsonl:1", "missing field"]);
}

/// 16-bit grey.
fn write_depth(path: &Path, width: u32, height: u32, value: u16) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let bytes = value.to_be_bytes().repeat((width * height) as usize);
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

/// Red on the left, blue on the right, 32 x 16.
const JPEG: &[u8] = include_bytes!("two_colors.jpg");
/// Looks along world x from (1, 2, 3): camera z is world x, camera x is world -y, camera y is world -z.
const MATRIX: &str = "0 0 1 1  -1 0 0 2  0 -1 0 3  0 0 0 1\n";

#[test]
fn sequences_of_others_are_read() {
    for layout in [Layout::Tum, Layout::Replica, Layout::Scannet] {
        let mut bench = Bench::new();
        let camera = "8 0 7.5 0  0 8 7.5 0  0 0 1 0  0 0 0 1";
        let (depth, units) = match layout {
            Layout::Tum => {
                bench = bench
                    .file("s/rgb.txt", "# time file\n10.00 rgb/a.jpg\n10.04 rgb/b.jpg\n99 rgb/c.jpg\n")
                    .file("s/depth.txt", "10.01 depth/a.png\n10.05 depth/b.png\n")
                    .file("s/groundtruth.txt", "10.0 1 2 3 0.5 -0.5 0.5 -0.5\n10.04 1 2 3 0.5 -0.5 0.5 -0.5\n")
                    .file("s/rgb/a.jpg", JPEG)
                    .file("s/rgb/b.jpg", JPEG)
                    .folder("s/depth");
                (["depth/a.png", "depth/b.png"], 5000.0)
            }
            Layout::Replica => {
                bench = bench
                    .file("s/traj.txt", MATRIX.repeat(2))
                    .file("cam_params.json", "{\"camera\": {\"w\": 16, \"h\": 16, \"fx\": 8, \"fy\": 8, \"cx\": 7.5, \"cy\": 7.5, \"scale\": 6553.5}}")
                    .file("s/results/frame000000.jpg", JPEG)
                    .file("s/results/frame000001.jpg", JPEG);
                (["results/depth000000.png", "results/depth000001.png"], 6553.5)
            }
            _ => {
                bench = bench
                    .file("s/intrinsic/intrinsic_depth.txt", camera)
                    .file("s/pose/0.txt", MATRIX)
                    .file("s/pose/1.txt", MATRIX)
                    .file("s/pose/2.txt", "-inf ".repeat(16))
                    .file("s/color/0.jpg", JPEG)
                    .file("s/color/1.jpg", JPEG)
                    .folder("s/depth");
                (["depth/0.png", "depth/1.png"], 1000.0)
            }
        };
        let folder = bench.path().join("s");
        depth.iter().for_each(|name| write_depth(&folder.join(name), 16, 16, (2.0 * units) as u16));
        // TUM's files do not tell the camera.
        let options = Options { camera: (layout == Layout::Tum).then_some([8.0, 8.0, 7.5, 7.5]), ..Options::default() };
        let sequence = Sequence::open(&folder, None, options).unwrap();
        assert_eq!((sequence.layout, sequence.len()), (layout, 2));
        let seen = sequence.read(1).unwrap();
        assert!(seen.detections.is_none());
        let frame = seen.frame;
        assert_eq!((frame.model.width, frame.model.height), (16, 16));
        // The middle of the image, 2 m ahead.
        let middle = frame.world_from_camera * frame.model.back_project(7, 7, f64::from(frame.depth_m[7 * 16 + 7]));
        let wanted = Point3::new(3.0, 2.0 + 0.5 / 8.0 * 2.0, 3.0 + 0.5 / 8.0 * 2.0);
        assert!((middle - wanted).norm() < 1e-3, "{layout:?}: {middle}");
        let [left, right] = [frame.color[0], frame.color[15]];
        assert!(left[0] > 180 && left[2] < 60 && right[2] > 190 && right[0] < 50, "{left:?} {right:?}");
        let out = good(&bench, &["build", "s", "-o", "map.dsm", "--camera", "8,8,7.5,7.5"], 0);
        assert!(out.contains("from 2 frames"), "{out}");
    }
    let bench = Bench::new().folder("s");
    bench.refuses(&["build", "s", "-o", "map.dsm"], &["no known sequence", "expected sequence.json"]);
}
