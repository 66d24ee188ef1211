//! What a frame measures of surfaces, at half its size: smoothed depth, points, normals, colour.

use crate::frame::RgbdFrame;
use crate::perceive::ColorTable;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Pixels to each side over which depth is smoothed.
const SMOOTH: isize = 2;
/// Pixels to each side over which normals are taken.
const SPAN: usize = 3;

/// CIELAB of every pixel value.
static COLORS: LazyLock<ColorTable> = LazyLock::new(ColorTable::new);

/// Row-major images of one size.
pub(super) struct Surface {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Smoothed depth along the camera's axis, metres; 0 without return.
    pub(super) depth_m: Vec<f32>,
    /// Where, world frame, metres. Meaningless without depth.
    pub(super) points: Vec<Point3<f32>>,
    /// Unit normal towards the camera, world frame; zero where there is none.
    pub(super) normals: Vec<Vector3<f32>>,
    /// CIELAB.
    pub(super) lab: Vec<[f32; 3]>,
    /// The camera, world frame.
    pub(super) eye: Point3<f32>,
}

/// Difference of depth that noise explains at a depth, metres: the quantisation of structured light grows with its
/// square.
pub(super) fn noise_m(depth_m: f32) -> f32 {
    0.006 + 0.004 * depth_m * depth_m
}

impl Surface {
    pub(super) fn new(frame: &RgbdFrame, step: usize) -> Self {
        let width = frame.model.width as usize;
        let (columns, rows) = (width / step, frame.model.height as usize / step);
        let mut lab = vec![[0.0; 3]; columns * rows];
        let mut raw = vec![0.0; columns * rows];
        let lines = lab.par_chunks_mut(columns).zip(raw.par_chunks_mut(columns)).enumerate();
        lines.for_each(|(row, (lab, raw))| {
            for column in 0..columns {
                let first = row * step * width + column * step;
                let block = (0..step * step).map(|i| first + i / step * width + i % step);
                lab[column] = mean_lab(frame, block.clone());
                raw[column] = find_depth(frame, block);
            }
        });
        let depth_m = smooth(&smooth(&raw, columns, 1), columns, columns);
        let (rotation, eye) = (
            frame.world_from_camera.rotation.to_rotation_matrix().into_inner().cast::<f32>(),
            Point3::from(frame.world_from_camera.translation.vector).cast::<f32>(),
        );
        let model = frame.model;
        let (fx, fy, cx, cy) = (model.fx as f32, model.fy as f32, model.cx as f32, model.cy as f32);
        let middle = 0.5 * step as f32;
        let points: Vec<Point3<f32>> = depth_m
            .par_iter()
            .enumerate()
            .map(|(i, &depth)| {
                let x = ((i % columns * step) as f32 + middle - cx) / fx;
                let y = ((i / columns * step) as f32 + middle - cy) / fy;
                eye + rotation * Vector3::new(x * depth, y * depth, depth)
            })
            .collect();
        let normals = find_normals(&points, &depth_m, columns, rows, &eye);
        Self { columns, rows, depth_m, points, normals, lab, eye }
    }

    /// Whether depth was measured there.
    pub(super) fn is_measured(&self, index: usize) -> bool {
        self.depth_m[index] > 0.0
    }
}

fn mean_lab(frame: &RgbdFrame, block: impl Iterator<Item = usize>) -> [f32; 3] {
    let (mut sum, mut count) = ([0u16; 3], 0);
    for pixel in block {
        let color = frame.color[pixel];
        (0..3).for_each(|i| sum[i] += u16::from(color[i]));
        count += 1;
    }
    let color = COLORS.find(sum.map(|channel| (channel / count) as u8));
    [color.lightness, color.a, color.b]
}

/// The lower median of the depths of a block: what is nearer wins at an edge.
fn find_depth(frame: &RgbdFrame, block: impl Iterator<Item = usize>) -> f32 {
    let (mut values, mut count) = ([0.0f32; 4], 0);
    for pixel in block {
        let depth = frame.depth_m[pixel];
        if depth > 0.0 && depth.is_finite() && count < values.len() {
            values[count] = depth;
            count += 1;
        }
    }
    let values = &mut values[..count];
    values.sort_unstable_by(f32::total_cmp);
    if values.is_empty() { 0.0 } else { values[(values.len() - 1) / 2] }
}

/// The mean of the neighbours along one direction (`stride` 1 or the row's length) whose depth is that of the same
/// surface.
fn smooth(depth_m: &[f32], columns: usize, stride: usize) -> Vec<f32> {
    let rows = depth_m.len() / columns;
    let mut smoothed = vec![0.0; depth_m.len()];
    smoothed.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
        for (column, value) in line.iter_mut().enumerate() {
            let center = depth_m[row * columns + column];
            if center <= 0.0 {
                continue;
            }
            let (at, end) = if stride == 1 { (column, columns) } else { (row, rows) };
            let same = 2.5 * noise_m(center);
            let (mut sum, mut count) = (0.0, 0.0);
            for offset in -SMOOTH..=SMOOTH {
                let place = at as isize + offset;
                if place < 0 || place >= end as isize {
                    continue;
                }
                let index = (row * columns + column) as isize + offset * stride as isize;
                let other = depth_m[index as usize];
                if (other - center).abs() < same {
                    sum += other;
                    count += 1.0;
                }
            }
            *value = sum / count;
        }
    });
    smoothed
}

/// Normals from differences across some pixels, then the mean with the neighbours.
fn find_normals(
    points: &[Point3<f32>],
    depth_m: &[f32],
    columns: usize,
    rows: usize,
    eye: &Point3<f32>,
) -> Vec<Vector3<f32>> {
    let mut raw = vec![Vector3::zeros(); points.len()];
    raw.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
        for (column, normal) in line.iter_mut().enumerate() {
            let center = row * columns + column;
            if depth_m[center] <= 0.0 {
                continue;
            }
            let jump = 6.0 * noise_m(depth_m[center]);
            let along = |at: usize, end: usize, stride: usize| -> Option<Vector3<f32>> {
                let same = |index: usize| depth_m[index] > 0.0 && (depth_m[index] - depth_m[center]).abs() < jump;
                let before = (at >= SPAN).then(|| center - SPAN * stride).filter(|i| same(*i));
                let after = (at + SPAN < end).then(|| center + SPAN * stride).filter(|i| same(*i));
                (before.is_some() || after.is_some())
                    .then(|| points[after.unwrap_or(center)] - points[before.unwrap_or(center)])
            };
            let (Some(right), Some(down)) = (along(column, columns, 1), along(row, rows, columns)) else { continue };
            let Some(found) = right.cross(&down).try_normalize(1e-9) else { continue };
            *normal = if found.dot(&(eye - points[center])) < 0.0 { -found } else { found };
        }
    });
    let mut normals = vec![Vector3::zeros(); points.len()];
    normals.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
        for (column, normal) in line.iter_mut().enumerate() {
            let center = raw[row * columns + column];
            if center == Vector3::zeros() {
                continue;
            }
            let mut sum = center;
            for r in row.saturating_sub(1)..(row + 2).min(rows) {
                for c in column.saturating_sub(1)..(column + 2).min(columns) {
                    let other = raw[r * columns + c];
                    // A crease is no place to average over.
                    if other.dot(&center) > 0.8 {
                        sum += other;
                    }
                }
            }
            *normal = sum.normalize();
        }
    });
    normals
}
