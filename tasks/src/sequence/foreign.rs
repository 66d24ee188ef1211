//! Sequences in the layouts of others. Poses are of the camera in the world, z up, camera optical (z forward, y down).
//!
//! Their principal points count from the middle of the first pixel, ours from its corner: half a pixel is added.

use super::read::{Options, read_json, read_text};
use super::{CarrierLine, FrameLine};
use crate::error::TaskError;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::FrameId;
use dsm::time::Stamp;
use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Stamps of TUM's files belong together when they are closer than this, seconds (as its own `associate.py` has it).
const TOGETHER_S: f64 = 0.02;
/// TUM's default camera (fx, fy, cx, cy) and units of depth in a metre.
const TUM_CAMERA: [f64; 4] = [525.0, 525.0, 319.5, 239.5];
const TUM_DEPTH_SCALE: f64 = 5000.0;
/// Replica as rendered by NICE-SLAM, which ConceptGraphs uses.
const REPLICA_CAMERA: [f64; 4] = [600.0, 600.0, 599.5, 339.5];
const REPLICA_DEPTH_SCALE: f64 = 6553.5;
const SCANNET_DEPTH_SCALE: f64 = 1000.0;
/// Between frames whose files hold no times, nanoseconds: 30 a second.
const PERIOD_NS: i64 = 33_333_333;

type Lines = (Vec<FrameLine>, f64);

fn wrong(path: &Path, why: impl std::fmt::Display) -> TaskError {
    TaskError::Usage(format!("{}: {why}", path.display()))
}

/// Width and height are those of the depth image, which is read later.
fn model([fx, fy, cx, cy]: [f64; 4]) -> CameraModel {
    CameraModel { width: 0, height: 0, fx, fy, cx: cx + 0.5, cy: cy + 0.5 }
}

fn line(number: usize, stamp: Stamp, model: CameraModel, pose: Pose, color: String, depth: String) -> FrameLine {
    FrameLine {
        id: FrameId(number as u64),
        stamp,
        camera: "camera".into(),
        model,
        world_from_camera: pose,
        color,
        depth,
        exact_depth: None,
        carrier: CarrierLine::default(),
    }
}

/// A pose as 16 numbers, row by row; `None` for one that is not known (ScanNet writes `-inf`).
fn parse_matrix(text: &str, path: &Path) -> Result<Option<Pose>, TaskError> {
    let values: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let values = values.map_err(|error| wrong(path, error))?;
    if values.len() != 16 {
        return Err(wrong(path, format!("{} numbers, expected 16 of a pose", values.len())));
    }
    if values.iter().any(|value| !value.is_finite()) {
        return Ok(None);
    }
    let matrix = Matrix4::from_row_slice(&values);
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    if (rotation * rotation.transpose() - Matrix3::identity()).amax() > 1e-2 || rotation.determinant() < 0.0 {
        return Err(wrong(path, "a pose is no rotation and translation"));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Ok(Some(Pose::from_parts(Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]), rotation)))
}

/// Rows of numbers and names after a stamp, in order of the stamp.
fn stamped(path: &Path) -> Result<Vec<(f64, Vec<String>)>, TaskError> {
    let text = read_text(path)?;
    let mut rows = Vec::new();
    for (index, row) in text.lines().enumerate().filter(|(_, row)| !row.trim().is_empty() && !row.starts_with('#')) {
        // Commas are as good as blanks there.
        let words = row.split(|c: char| c.is_whitespace() || c == ',');
        let mut words = words.filter(|word| !word.is_empty()).map(str::to_owned);
        let stamp: Option<f64> =
            words.next().and_then(|word| word.parse().ok()).filter(|stamp: &f64| stamp.is_finite());
        let stamp = stamp.ok_or_else(|| {
            TaskError::Usage(format!("{}:{}: expected a time in seconds first", path.display(), index + 1))
        })?;
        rows.push((stamp, words.collect()));
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(rows)
}

/// The row closest to a stamp, when it is close enough.
fn closest(rows: &[(f64, Vec<String>)], stamp: f64) -> Option<&(f64, Vec<String>)> {
    let after = rows.partition_point(|row| row.0 < stamp);
    let around = rows[after.saturating_sub(1)..(after + 1).min(rows.len())].iter();
    let best = around.min_by(|a, b| (a.0 - stamp).abs().total_cmp(&(b.0 - stamp).abs()))?;
    ((best.0 - stamp).abs() < TOGETHER_S).then_some(best)
}

/// Pairs of places in two lists of stamps in order: the closest first, none twice. So TUM's `associate.py` joins images.
fn associate(first: &[f64], second: &[f64]) -> Vec<(usize, usize)> {
    let near = |(i, a): (usize, &f64)| {
        let begin = second.partition_point(|b| *b <= a - TOGETHER_S);
        let rest = second[begin..].iter().enumerate().take_while(move |(_, b)| **b < a + TOGETHER_S);
        rest.map(|(j, b)| ((a - b).abs(), i, begin + j)).collect::<Vec<_>>()
    };
    let mut candidates: Vec<(f64, usize, usize)> = first.iter().enumerate().flat_map(near).collect();
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut partner, mut free) = (vec![None; first.len()], vec![true; second.len()]);
    for (_, i, j) in candidates {
        if partner[i].is_none() && free[j] {
            (partner[i], free[j]) = (Some(j), false);
        }
    }
    partner.into_iter().enumerate().filter_map(|(i, j)| Some((i, j?))).collect()
}

pub(super) fn tum(folder: &Path, options: Options) -> Result<Lines, TaskError> {
    let [rgb, depth, truth] = ["rgb.txt", "depth.txt", "groundtruth.txt"].map(|name| stamped(&folder.join(name)));
    let (rgb, depth, truth) = (rgb?, depth?, truth?);
    let begin = rgb.first().map_or(0.0, |row| row.0);
    let model = model(options.camera.unwrap_or(TUM_CAMERA));
    let stamps = |rows: &[(f64, Vec<String>)]| rows.iter().map(|row| row.0).collect::<Vec<_>>();
    let mut lines = Vec::new();
    for (color, depth) in associate(&stamps(&rgb), &stamps(&depth)).into_iter().map(|(i, j)| (&rgb[i], &depth[j])) {
        let Some((_, pose)) = closest(&truth, color.0) else { continue };
        let path = folder.join("groundtruth.txt");
        let values: Vec<f64> = pose.iter().map_while(|word| word.parse().ok()).collect();
        let [x, y, z, i, j, k, w] = values[..] else {
            return Err(wrong(&path, "expected `time tx ty tz qx qy qz qw`"));
        };
        if !values.iter().all(|value| value.is_finite()) {
            return Err(wrong(&path, "a pose is not finite"));
        }
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6);
        let rotation = rotation.ok_or_else(|| wrong(&path, "a quaternion has no length"))?;
        let pose = Pose::from_parts(Translation3::new(x, y, z), rotation);
        let at = Stamp::from_s(color.0 - begin);
        let [Some(color), Some(depth)] = [color, depth].map(|row| row.1.first()) else {
            return Err(wrong(&folder.join("rgb.txt"), "expected `time file`, as in depth.txt"));
        };
        lines.push(line(lines.len(), at, model, pose, color.clone(), depth.clone()));
    }
    Ok((lines, 1e3 / options.depth_scale.unwrap_or(TUM_DEPTH_SCALE)))
}

#[derive(Deserialize)]
struct CameraParameters {
    camera: Intrinsics,
}

#[derive(Deserialize)]
struct Intrinsics {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    scale: Option<f64>,
}

pub(super) fn replica(folder: &Path, options: Options) -> Result<Lines, TaskError> {
    // One file stands beside all scenes.
    let found = [folder.join("cam_params.json"), folder.join("../cam_params.json")].into_iter().find(|p| p.exists());
    let known = found.map(|path| read_json::<CameraParameters>(&path)).transpose()?.map(|parameters| parameters.camera);
    let camera = known.as_ref().map_or(REPLICA_CAMERA, |c| [c.fx, c.fy, c.cx, c.cy]);
    let scale = known.and_then(|c| c.scale).unwrap_or(REPLICA_DEPTH_SCALE);
    let model = model(options.camera.unwrap_or(camera));
    let path = folder.join("traj.txt");
    let results = folder.join("results");
    let colors = numbered(&results, "frame")?;
    let depths = numbered(&results, "depth")?;
    let mut lines = Vec::new();
    for (number, row) in read_text(&path)?.lines().filter(|row| !row.trim().is_empty()).enumerate() {
        let (Some(color), Some(depth)) = (colors.get(&number), depths.get(&number)) else { continue };
        let Some(pose) = parse_matrix(row, &path)? else { continue };
        let stamp = Stamp(number as i64 * PERIOD_NS);
        lines.push(line(number, stamp, model, pose, format!("results/{color}"), format!("results/{depth}")));
    }
    Ok((lines, 1e3 / options.depth_scale.unwrap_or(scale)))
}

pub(super) fn scannet(folder: &Path, options: Options) -> Result<Lines, TaskError> {
    let camera = match options.camera {
        Some(camera) => camera,
        None => {
            let files = ["intrinsic/intrinsic_depth.txt", "intrinsic_depth.txt"].map(|name| folder.join(name));
            let path = files.iter().find(|path| path.exists()).unwrap_or(&files[0]);
            let values: Vec<f64> = read_text(path)?.split_whitespace().map_while(|word| word.parse().ok()).collect();
            match values[..] {
                [fx, _, cx, _, _, fy, cy, _, ..] if values.len() == 16 => [fx, fy, cx, cy],
                _ => return Err(wrong(path, format!("{} numbers, expected 16 of a camera matrix", values.len()))),
            }
        }
    };
    let model = model(camera);
    let [colors, depths, poses] = ["color", "depth", "pose"].map(|name| numbered(&folder.join(name), ""));
    let (colors, depths, poses) = (colors?, depths?, poses?);
    let mut lines = Vec::new();
    for (number, pose) in &poses {
        let (Some(color), Some(depth)) = (colors.get(number), depths.get(number)) else { continue };
        let path = folder.join("pose").join(pose);
        let Some(pose) = parse_matrix(&read_text(&path)?, &path)? else { continue };
        let stamp = Stamp(*number as i64 * PERIOD_NS);
        lines.push(line(*number, stamp, model, pose, format!("color/{color}"), format!("depth/{depth}")));
    }
    Ok((lines, 1e3 / options.depth_scale.unwrap_or(SCANNET_DEPTH_SCALE)))
}

/// Files of a folder whose names are `prefix`, a number and an ending, by their number.
fn numbered(folder: &Path, prefix: &str) -> Result<BTreeMap<usize, String>, TaskError> {
    let entries = std::fs::read_dir(folder).map_err(|source| TaskError::Read { path: folder.to_owned(), source })?;
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let number = |name: String| {
        let digits = name.strip_prefix(prefix)?.split('.').next()?.parse().ok()?;
        Some((digits, name))
    };
    Ok(names.filter_map(number).collect())
}

#[cfg(test)]
mod tests {
    //! Contract: images are joined as TUM's own tool joins them.
    use super::*;

    #[test]
    fn the_closest_are_joined_first_and_none_twice() {
        // Two colour images want the depth image at 10.011; the closer one has it.
        assert_eq!(associate(&[10.0, 10.01, 10.05], &[10.011, 10.069]), [(1, 0), (2, 1)]);
        // The other takes the next one within reach.
        assert_eq!(associate(&[10.0, 10.01], &[9.985, 10.009]), [(0, 0), (1, 1)]);
        // As far as the tolerance is too far.
        assert_eq!(associate(&[1.0], &[1.0 + TOGETHER_S]), []);
        assert_eq!(associate(&[], &[1.0]), []);
    }
}
