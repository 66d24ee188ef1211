//! Single view parsing: from a mask to clean points in the world frame.

use super::carrier::Carrier;
use super::config::BuildConfig;
use super::view::View;
use crate::Pose;
use crate::frame::RgbdFrame;
use crate::geometry::{Aabb, BoxUnion};
use crate::knowledge::Category;
use crate::map::MapPoint;
use crate::perceive::{AttributeVote, Describer, Detection, ObjectView, TextEncoder, VisualEncoder};
use nalgebra::{Point3, Vector3};
use std::sync::Arc;

/// Noise of a depth reading at `depth_m` (about three sigma of a structured-light sensor: quantisation z^2/281 plus
/// jitter), metres.
pub(super) fn depth_noise_m(depth_m: f64) -> f64 {
    0.02 + 0.008 * depth_m * depth_m
}

/// How far the middle of a cluster may lie beside the outline of the largest one to be above or below it, metres.
const STACKED_M: f64 = 0.03;
/// Heights closer than this are one, metres.
const LEVEL_M: f64 = 0.05;
/// Rows of pixels that a pole spans at least.
const POLE_ROWS: usize = 8;
/// Points of such a cluster over those of the largest one, at least.
const STACKED_SHARE: f64 = 0.05;

/// One detection with its geometry and features; lives for one frame.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    /// Its detection's place in the frame's list.
    pub(super) detection: usize,
    pub(super) name: String,
    pub(super) named_by: Arc<str>,
    /// Detector score, lowered with distance and at the image border: the weight of its votes.
    pub(super) weight: f32,
    pub(super) points: Vec<MapPoint>,
    pub(super) bounds: Aabb,
    /// Mean depth, metres.
    pub(super) distance_m: f64,
    /// Usual extent from front to back of things of its name, metres.
    pub(super) depth_m: Option<f64>,
    pub(super) visual_feature: Vec<f32>,
    pub(super) text_feature: Vec<f32>,
    pub(super) attributes: Vec<AttributeVote>,
    pub(super) described_by: Arc<str>,
    pub(super) view: View,
}

impl Observation {
    /// Moves it by a correction of the frame's pose.
    pub(super) fn transform(&mut self, correction: &Pose) {
        let motion = correction.cast::<f32>();
        self.points.iter_mut().for_each(|point| point.position = motion * point.position);
        if let Some(bounds) = robust_aabb(&self.points) {
            self.bounds = bounds;
        }
        self.view.transform(&motion);
    }
}

/// Encoders used on every view.
pub(super) struct Encoders {
    pub(super) visual: Box<dyn VisualEncoder>,
    pub(super) text: Box<dyn TextEncoder>,
    pub(super) describer: Box<dyn Describer>,
    /// Who gives names, and who gives attributes.
    pub(super) detector_name: Arc<str>,
    pub(super) describer_name: Arc<str>,
}

/// A detection as an observation; `None` when too little of it is measured.
pub(super) fn find_observation(
    config: &BuildConfig,
    encoders: &Encoders,
    frame: &RgbdFrame,
    (place, detection): (usize, &Detection),
    carrier: &Carrier,
    category: Option<&Category>,
) -> Option<Observation> {
    let mask = MaskBitmap::find(detection, frame, config)?;
    let (pixels, points) = sample_points(config, frame, &mask, carrier);
    let kept = largest_cluster(&points, &pixels, frame, &mask);
    if kept.len() < config.min_points {
        return None;
    }
    let pixels: Vec<u32> = kept.iter().map(|&i| pixels[i]).collect();
    let points: Vec<MapPoint> = kept.iter().map(|&i| points[i]).collect();
    let bounds = robust_aabb(&points)?;
    let depth = mean_depth_m(frame, &pixels);
    let object_view = ObjectView { frame, pixels: &pixels, name: &detection.name, extent_m: bounds.size() };
    let nearness = 1.0 / (1.0 + (depth / 3.0).powi(2)) as f32;
    Some(Observation {
        detection: place,
        name: category.map_or(&detection.name, |category| &category.name).clone(),
        weight: detection.score.clamp(0.0, 1.0) * nearness * if mask.truncated { 0.5 } else { 1.0 },
        visual_feature: encoders.visual.encode(&object_view),
        text_feature: encoders.text.encode(&detection.name),
        attributes: encoders.describer.describe(&object_view),
        named_by: encoders.detector_name.clone(),
        described_by: encoders.describer_name.clone(),
        view: View::new(frame, &mask, depth),
        points,
        bounds,
        distance_m: depth,
        depth_m: category.and_then(|category| category.depth_m),
    })
}

fn mean_depth_m(frame: &RgbdFrame, pixels: &[u32]) -> f64 {
    pixels.iter().map(|&p| f64::from(frame.depth_m[p as usize])).sum::<f64>() / pixels.len().max(1) as f64
}

/// A mask as a bitmap over its bounding rectangle.
pub(super) struct MaskBitmap {
    pub(super) first_column: usize,
    pub(super) first_row: usize,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) truncated: bool,
    area: usize,
    bits: Vec<bool>,
}

impl MaskBitmap {
    fn find(detection: &Detection, frame: &RgbdFrame, config: &BuildConfig) -> Option<Self> {
        let mask = &detection.mask;
        let area = mask.area();
        let (width, height) = (frame.model.width, frame.model.height);
        if mask.image_width != width || area < config.min_mask_pixels || detection.score < config.min_score {
            return None;
        }
        let (c0, r0, c1, r1) = mask.find_bounds()?;
        if r1 >= height || c1 >= width {
            return None;
        }
        let (columns, rows) = ((c1 - c0 + 1) as usize, (r1 - r0 + 1) as usize);
        let mut bits = vec![false; columns * rows];
        for run in &mask.runs {
            let row = (run.start / width - r0) as usize;
            let column = (run.start % width - c0) as usize;
            let start = row * columns + column;
            bits[start..start + run.length as usize].fill(true);
        }
        let truncated = c0 == 0 || r0 == 0 || c1 + 1 == width || r1 + 1 == height;
        Some(Self { first_column: c0 as usize, first_row: r0 as usize, columns, rows, truncated, area, bits })
    }

    /// Whether the mask holds the pixel, given in image coordinates (also outside the image).
    pub(super) fn contains(&self, column: isize, row: isize) -> bool {
        let (column, row) = (column - self.first_column as isize, row - self.first_row as isize);
        column >= 0
            && row >= 0
            && (column as usize) < self.columns
            && (row as usize) < self.rows
            && self.bits[row as usize * self.columns + column as usize]
    }

    /// Whether the mask is narrow all the way from one row to another (excluded).
    fn has_pole(&self, from: usize, to: usize) -> bool {
        let width = |row: usize| {
            let start = (row - self.first_row) * self.columns;
            self.bits[start..start + self.columns].iter().filter(|inside| **inside).count()
        };
        let narrow = |row: usize| row >= self.first_row && (1..=self.columns / 4).contains(&width(row));
        to >= from + POLE_ROWS && to <= self.first_row + self.rows && {
            let count = (from..to).filter(|row| narrow(*row)).count();
            10 * count >= 8 * (to - from)
        }
    }

    /// Pixels to leave out at the border, where masks and depth mix two surfaces.
    pub(super) fn erosion(&self) -> isize {
        match self.area {
            0..400 => 1,
            _ => 2,
        }
    }
}

/// Every n-th pixel of the eroded mask with a sound depth, and its point in the world frame.
fn sample_points(
    config: &BuildConfig,
    frame: &RgbdFrame,
    mask: &MaskBitmap,
    carrier: &Carrier,
) -> (Vec<u32>, Vec<MapPoint>) {
    let stride = ((mask.area as f64 / config.samples_per_mask as f64).sqrt().ceil() as usize).max(1);
    let (erosion, width) = (mask.erosion(), frame.model.width as usize);
    let bodies = BoxUnion::new(&carrier.bodies, 0.02);
    let mut pixels = Vec::with_capacity(config.samples_per_mask);
    let mut points = Vec::with_capacity(config.samples_per_mask);
    for row in (mask.first_row..mask.first_row + mask.rows).step_by(stride) {
        for column in (mask.first_column..mask.first_column + mask.columns).step_by(stride) {
            let (c, r) = (column as isize, row as isize);
            let inner = [(0, 0), (erosion, 0), (-erosion, 0), (0, erosion), (0, -erosion)]
                .into_iter()
                .all(|(dc, dr)| mask.contains(c + dc, r + dr));
            let pixel = row * width + column;
            if !inner || !is_sound(frame, pixel, config.max_object_depth_m) {
                continue;
            }
            let Some(point) = frame.find_point_in_world(pixel) else { continue };
            if bodies.contains(&point) {
                continue;
            }
            pixels.push(pixel as u32);
            points.push(MapPoint { position: point.cast(), color: frame.color[pixel] });
        }
    }
    (pixels, points)
}

/// Whether the depth is in range and continuous with both horizontal neighbours; the mask's erosion keeps them inside
/// the image.
fn is_sound(frame: &RgbdFrame, pixel: usize, max_depth_m: f64) -> bool {
    let depth = f64::from(frame.depth_m[pixel]);
    if !(depth > 0.0 && depth <= max_depth_m) {
        return false;
    }
    let jump = 0.03 + 0.015 * depth * depth;
    [pixel.wrapping_sub(1), pixel + 1]
        .into_iter()
        .all(|neighbour| frame.depth_m.get(neighbour).is_some_and(|&d| d > 0.0 && (f64::from(d) - depth).abs() < jump))
}

/// Indices of the points in the largest connected cluster, rising, with those of clusters within its outline at its height,
/// between which something else stands, and of clusters right above or below it that a pole joins to it: the pole of a lamp
/// is too thin to be measured. Points are binned into cells; cells that touch are
/// one cluster (DBSCAN's density reachability with one point per cell). The cell grows with the depth noise.
fn largest_cluster(points: &[MapPoint], pixels: &[u32], frame: &RgbdFrame, mask: &MaskBitmap) -> Vec<usize> {
    let depth_m = mean_depth_m(frame, pixels);
    let cell_m = (0.05 + depth_noise_m(depth_m)) as f32;
    let key = |p: &MapPoint| [p.position.x, p.position.y, p.position.z].map(|c| (c / cell_m).floor() as i32);
    let mut order: Vec<([i32; 3], usize)> = points.iter().enumerate().map(|(i, p)| (key(p), i)).collect();
    order.sort_unstable();
    let mut cells: Vec<([i32; 3], usize, usize)> = Vec::new();
    for (position, (key, _)) in order.iter().enumerate() {
        match cells.last_mut() {
            Some(cell) if cell.0 == *key => cell.2 = position + 1,
            _ => cells.push((*key, position, position + 1)),
        }
    }
    let mut cluster = vec![usize::MAX; cells.len()];
    let mut best: (usize, usize) = (0, 0);
    for seed in 0..cells.len() {
        if cluster[seed] != usize::MAX {
            continue;
        }
        cluster[seed] = seed;
        let (mut open, mut size) = (vec![seed], 0);
        while let Some(current) = open.pop() {
            size += cells[current].2 - cells[current].1;
            let [x, y, z] = cells[current].0;
            for dx in -1..=1 {
                for dy in -1..=1 {
                    // The three cells above each other are neighbours in the sorted order.
                    let from = cells.partition_point(|c| c.0 < [x + dx, y + dy, z - 1]);
                    for next in from..cells.len().min(from + 3) {
                        let k = cells[next].0;
                        if k[0] == x + dx && k[1] == y + dy && k[2] <= z + 1 && cluster[next] == usize::MAX {
                            cluster[next] = seed;
                            open.push(next);
                        }
                    }
                }
            }
        }
        if size > best.0 {
            best = (size, seed);
        }
    }
    let members = |wanted: usize| {
        let own = cells.iter().zip(&cluster).filter(move |(_, c)| **c == wanted);
        own.flat_map(|(cell, _)| order[cell.1..cell.2].iter().map(|(_, i)| *i))
    };
    let outline = |wanted: usize| {
        let places: Vec<Point3<f64>> = members(wanted).map(|i| points[i].position.cast()).collect();
        Aabb::from_points(&places)
    };
    let mut kept: Vec<usize> = members(best.1).collect();
    let mut others: Vec<usize> = cluster.iter().copied().filter(|c| *c != best.1).collect();
    others.sort_unstable();
    others.dedup();
    if !others.is_empty()
        && let Some(main) = outline(best.1)
    {
        let is_stacked = |other: &Aabb| {
            let middle = other.center();
            (0..2).all(|i| (main.min[i] - STACKED_M..=main.max[i] + STACKED_M).contains(&middle[i]))
        };
        for other in others {
            let count = members(other).count();
            let large = count as f64 >= STACKED_SHARE * best.0 as f64;
            let rows = |of: usize| members(of).map(|i| (pixels[i] / frame.model.width) as usize);
            let joined = |own: usize| {
                let range = |of: usize| Some((rows(of).min()?, rows(of).max()?));
                range(own).zip(range(other)).is_some_and(|(a, b)| mask.has_pole(a.1.min(b.1) + 1, a.0.max(b.0)))
            };
            let Some(bounds) = outline(other).filter(|o| large && is_stacked(o)) else { continue };
            let level = bounds.min.z <= main.max.z + LEVEL_M && main.min.z <= bounds.max.z + LEVEL_M;
            if level || joined(best.1) {
                kept.extend(members(other));
            }
        }
    }
    kept.sort_unstable();
    kept
}

/// Box between the 1st and the 99th percentile along each world axis.
pub(super) fn robust_aabb(points: &[MapPoint]) -> Option<Aabb> {
    let mut low = Vector3::zeros();
    let mut high = Vector3::zeros();
    let mut values: Vec<f32> = Vec::with_capacity(points.len());
    for axis in 0..3 {
        values.clear();
        values.extend(points.iter().map(|p| p.position[axis]));
        let (a, b) = find_percentiles(&mut values)?;
        low[axis] = a;
        high[axis] = b;
    }
    Some(Aabb { min: Point3::from(low), max: Point3::from(high) })
}

/// The 1st and the 99th percentile; reorders the values.
pub(super) fn find_percentiles(values: &mut [f32]) -> Option<(f64, f64)> {
    let cut = values.len() / 100;
    let last = values.len().checked_sub(1 + cut)?;
    let low = *values.select_nth_unstable_by(cut, f32::total_cmp).1;
    let high = *values.select_nth_unstable_by(last, f32::total_cmp).1;
    Some((f64::from(low), f64::from(high)))
}
