//! The floor that a frame shows: it lies at height zero, wherever the localiser believes the camera to be.

use super::carrier::Carrier;
use crate::frame::RgbdFrame;
use crate::geometry::BoxUnion;
use crate::perceive::Mask;
use nalgebra::Point3;

/// Every n-th row and column is looked at.
const STRIDE: u32 = 12;
/// Farther floor says little: the error of depth grows with its square, metres.
const REACH_M: f64 = 3.5;
/// Height up to which a point may be floor that a pose error has moved, metres; and what a metre of distance adds.
const HEIGHT_M: (f64, f64) = (0.10, 0.02);
/// Points that are kept at most.
const MOST: usize = 500;

/// Points of the frame that may be floor, in the believed world frame. What lies in a mask is something else.
pub(super) fn find_floor<'a>(
    frame: &RgbdFrame,
    masks: impl Iterator<Item = &'a Mask>,
    carrier: &Carrier,
) -> Vec<Point3<f64>> {
    let (width, height) = (frame.model.width, frame.model.height);
    let (columns, rows) = (width.div_ceil(STRIDE), height.div_ceil(STRIDE));
    let mut covered = vec![false; (columns * rows) as usize];
    for run in masks.filter(|mask| mask.image_width == width).flat_map(|mask| &mask.runs) {
        let (row, column) = (run.start / width, run.start % width);
        if row.is_multiple_of(STRIDE) && row < height {
            let (first, last) = (column.div_ceil(STRIDE), (column + run.length).div_ceil(STRIDE).min(columns));
            (first..last).for_each(|c| covered[(row / STRIDE * columns + c) as usize] = true);
        }
    }
    let bodies = BoxUnion::new(&carrier.bodies, 0.03);
    let points = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))).filter_map(|(row, column)| {
        let pixel = (row * STRIDE * width + column * STRIDE) as usize;
        let depth = f64::from(frame.depth_m[pixel]);
        if covered[(row * columns + column) as usize] || !(depth > 0.0 && depth <= REACH_M) {
            return None;
        }
        let point = frame.find_point_in_world(pixel)?;
        (point.z.abs() <= HEIGHT_M.0 + HEIGHT_M.1 * depth && !bodies.contains(&point)).then_some(point)
    });
    let points: Vec<Point3<f64>> = points.collect();
    let step = points.len().div_ceil(MOST).max(1);
    points.into_iter().step_by(step).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: floor is found where the frame shows it, and neither under masks nor on what stands on it.
    use super::*;
    use crate::Pose;
    use crate::camera::CameraModel;
    use crate::frame::FrameId;
    use crate::time::Stamp;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    #[test]
    fn floor_without_masks_and_things() {
        let model = CameraModel::from_vertical_fov(640, 480, 0.8);
        // From 1 m above the floor straight down: the left half shows a table top at half the depth.
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let frame = RgbdFrame {
            id: FrameId(0),
            stamp: Stamp::default(),
            camera: "head".into(),
            model,
            world_from_camera: Pose::from_parts(Translation3::new(0.0, 0.0, 1.0), down),
            color: vec![[0; 3]; 640 * 480],
            depth_m: (0..640 * 480).map(|pixel| if pixel % 640 < 320 { 0.5 } else { 1.0 }).collect(),
        };
        let all = find_floor(&frame, std::iter::empty(), &Carrier::default());
        assert!(all.len() > 250 && all.iter().all(|p| p.z.abs() < 1e-6 && p.x > -0.01), "{}", all.len());
        let right = Mask::from_sorted_pixels(640, (0..640 * 480).filter(|pixel| pixel % 640 >= 330));
        let beside = find_floor(&frame, [&right].into_iter(), &Carrier::default());
        assert!(beside.len() < all.len() / 5, "{}", beside.len());
    }
}
