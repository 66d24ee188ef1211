//! Contract: the layouts of others are read as their own tools read them: which images and poses belong together, units of
//! depth, order of a quaternion, direction of a pose. Skipped where PyPI's `evo` cannot be had.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its files fails")]

mod python;

use dsm_tasks::sequence::{Options, Sequence};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use python::{find_python, run_script, skip};
use std::fmt::Write;
use std::fs;
use std::path::Path;

const SIZE: (u32, u32) = (32, 16);
const JPEG: &[u8] = include_bytes!("two_colors.jpg");

/// No two images and no two rows are alike; some pixels have no return.
fn write_images(color: &Path, depth: &Path, number: u32) {
    fs::write(color, JPEG).unwrap();
    let unit = |i: u32| {
        if (i + number).is_multiple_of(7) {
            0
        } else {
            900 + 3001 * number as u16 + 61 * (i / SIZE.0 + i % SIZE.0) as u16
        }
    };
    let bytes: Vec<u8> = (0..SIZE.0 * SIZE.1).flat_map(|i| unit(i).to_be_bytes()).collect();
    let mut encoder = png::Encoder::new(fs::File::create(depth).unwrap(), SIZE.0, SIZE.1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

/// A camera that turns about all axes on its way.
fn pose(at: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
    (
        Vector3::new(1.0 + at, 2.0 - 3.0 * at, 0.3 * at),
        UnitQuaternion::from_euler_angles(0.4 + at, -0.9, 2.0 + 2.0 * at),
    )
}

fn matrix(at: f64) -> String {
    let (place, rotation) = pose(at);
    let m = rotation.to_rotation_matrix();
    let row = |i: usize| format!("{} {} {} {}", m[(i, 0)], m[(i, 1)], m[(i, 2)], place[i]);
    format!("{} {} {} 0 0 0 1\n", row(0), row(1), row(2))
}

fn folders(path: &Path, names: &[&str]) {
    names.iter().for_each(|name| fs::create_dir_all(path.join(name)).unwrap());
}

fn write_tum(path: &Path) {
    folders(path, &["rgb", "depth"]);
    // Colour comes twice as often as depth, late and early; the last has no pose.
    let (mut rgb, mut depth, mut truth) =
        ("# color\n".to_owned(), "# depth\n".to_owned(), "# time tx ...\n".to_owned());
    for number in 0..8 {
        writeln!(rgb, "{:.6} rgb/{number}.jpg", 1_305_031_102.175 + 0.0167 * f64::from(number)).unwrap();
        writeln!(depth, "{:.6},depth/{number}.png", 1_305_031_102.168 + 0.033 * f64::from(number)).unwrap();
        write_images(&path.join(format!("rgb/{number}.jpg")), &path.join(format!("depth/{number}.png")), number);
    }
    for step in 0..8 {
        let at = 0.0101 * f64::from(step);
        let (p, q) = pose(at);
        let stamp = 1_305_031_102.17 + at;
        writeln!(truth, "{stamp:.4} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.i, q.j, q.k, q.w).unwrap();
    }
    [("rgb.txt", rgb), ("depth.txt", depth), ("groundtruth.txt", truth)]
        .iter()
        .for_each(|(name, text)| fs::write(path.join(name), text).unwrap());
}

fn write_replica(path: &Path) {
    folders(path, &["results"]);
    let camera = r#"{"camera": {"w": 32, "h": 16, "fx": 21.5, "fy": 23.25, "cx": 14.75, "cy": 8.5, "scale": 6553.5}}"#;
    fs::write(path.join("cam_params.json"), camera).unwrap();
    fs::write(path.join("traj.txt"), (0..3).map(|i| matrix(f64::from(i))).collect::<String>()).unwrap();
    let file = |number, name: &str| {
        path.join("results").join(format!("{name}{number:06}.{}", if name == "depth" { "png" } else { "jpg" }))
    };
    (0..3).for_each(|number| write_images(&file(number, "frame"), &file(number, "depth"), number));
}

fn write_scannet(path: &Path) {
    folders(path, &["color", "depth", "pose", "intrinsic"]);
    fs::write(path.join("intrinsic/intrinsic_depth.txt"), "27.5 0 15.25 0\n0 26 7.75 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    for number in 0..3 {
        // Tracking was lost once.
        let text = if number == 1 { "-inf -inf -inf -inf\n".repeat(4) } else { matrix(f64::from(number)) };
        let rows: Vec<&str> = text.split_whitespace().collect();
        let text: String = rows.chunks(4).map(|row| row.join(" ") + "\n").collect();
        fs::write(path.join(format!("pose/{number}.txt")), text).unwrap();
        let [color, depth] = [format!("color/{number}.jpg"), format!("depth/{number}.png")].map(|name| path.join(name));
        write_images(&color, &depth, number);
    }
}

/// Where the middles of all pixels with depth are in the world, frame by frame.
fn places(path: &Path) -> Vec<Vec<Point3<f64>>> {
    let sequence = Sequence::open(path, None, Options::default()).unwrap();
    let places_in = |index: usize| {
        let frame = sequence.read(index).unwrap().frame;
        let (width, depth_m) = (frame.model.width as usize, &frame.depth_m);
        let seen = (0..depth_m.len()).filter(|i| depth_m[*i] > 0.0);
        let place = |i: usize| {
            let depth_m = f64::from(depth_m[i]);
            frame.world_from_camera * frame.model.back_project((i % width) as u32, (i / width) as u32, depth_m)
        };
        seen.map(place).collect()
    };
    (0..sequence.len()).map(places_in).collect()
}

#[test]
fn sequences_are_read_as_their_own_tools_read_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for (layout, write) in [("tum", write_tum as fn(&Path)), ("replica", write_replica), ("scannet", write_scannet)] {
        write(&path.join(layout));
        let places = serde_json::to_string(&places(&path.join(layout))).unwrap();
        fs::write(path.join(format!("{layout}.json")), places).unwrap();
    }
    let Some(python) = find_python("loaders-python", &["evo==1.38.1"]) else {
        return skip("loaders: PyPI's evo cannot be had");
    };
    let said = run_script(&python, "loaders.py", path);
    assert!(said.contains("replica: 3 frames\nscannet: 2 frames"), "{said}");
}
