//! One RGB-D observation.

use crate::Pose;
use crate::camera::CameraModel;
use crate::time::Stamp;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Number of a frame within a run; unique over all cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FrameId(pub u64);

/// Colour and aligned depth of one camera at one moment. It never holds labels.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbdFrame {
    /// Unique number of the frame.
    pub id: FrameId,
    /// When the image was taken.
    pub stamp: Stamp,
    /// Name of the camera, as in `robot.toml`.
    pub camera: Arc<str>,
    /// Intrinsics of both images.
    pub model: CameraModel,
    /// Where the camera was, as far as the robot knows.
    pub world_from_camera: Pose,
    /// Colour, sRGB, row-major, `width * height`.
    pub color: Vec<[u8; 3]>,
    /// Depth along z in metres, row-major; 0 means no return.
    pub depth_m: Vec<f32>,
}

impl RgbdFrame {
    /// The point in the camera frame seen by the pixel with row-major index `pixel`; `None` where there is no return.
    pub fn find_point_in_camera(&self, pixel: usize) -> Option<Point3<f64>> {
        let depth = *self.depth_m.get(pixel)?;
        if depth <= 0.0 {
            return None;
        }
        let width = self.model.width as usize;
        Some(self.model.back_project((pixel % width) as u32, (pixel / width) as u32, f64::from(depth)))
    }

    /// The same point in the world frame.
    pub fn find_point_in_world(&self, pixel: usize) -> Option<Point3<f64>> {
        Some(self.world_from_camera * self.find_point_in_camera(pixel)?)
    }
}
