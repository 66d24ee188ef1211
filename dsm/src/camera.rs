//! The pinhole camera model.

use nalgebra::{Point2, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A pinhole camera without distortion. Pixels; the centre of the first pixel is at (0.5, 0.5).
///
/// Optical frame: +z forward, x right, y down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CameraModel {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Principal point x in pixels.
    pub cx: f64,
    /// Principal point y in pixels.
    pub cy: f64,
}

impl CameraModel {
    /// A camera with square pixels and a centred principal point; `vertical_fov_rad` is the full angle.
    pub fn from_vertical_fov(width: u32, height: u32, vertical_fov_rad: f64) -> Self {
        let focal = 0.5 * f64::from(height) / (0.5 * vertical_fov_rad).tan();
        Self { width, height, fx: focal, fy: focal, cx: 0.5 * f64::from(width), cy: 0.5 * f64::from(height) }
    }

    /// Number of pixels.
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Image coordinates in pixels of a point in front of the camera, also outside the image; `None` behind it.
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Point2<f64>> {
        (point_in_camera.z > 1e-6).then(|| {
            Point2::new(
                self.fx * point_in_camera.x / point_in_camera.z + self.cx,
                self.fy * point_in_camera.y / point_in_camera.z + self.cy,
            )
        })
    }

    /// The pixel (column, row) that sees the point, if it is inside the image.
    pub fn find_pixel(&self, point_in_camera: &Point3<f64>) -> Option<(u32, u32)> {
        let p = self.project(point_in_camera)?;
        let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < f64::from(self.width) && p.y < f64::from(self.height);
        inside.then_some((p.x as u32, p.y as u32))
    }

    /// The point in the camera frame at the centre of pixel (`column`, `row`) with depth `depth_m` along z.
    pub fn back_project(&self, column: u32, row: u32, depth_m: f64) -> Point3<f64> {
        Point3::new(
            (f64::from(column) + 0.5 - self.cx) / self.fx * depth_m,
            (f64::from(row) + 0.5 - self.cy) / self.fy * depth_m,
            depth_m,
        )
    }
}

#[cfg(test)]
mod tests {
    //! Contract: projecting a back-projected pixel gives that pixel.
    use super::*;

    #[test]
    fn projection_inverts_back_projection() {
        let camera = CameraModel::from_vertical_fov(640, 480, 1.0);
        for (column, row) in [(0, 0), (639, 479), (320, 100)] {
            let point = camera.back_project(column, row, 2.5);
            assert_eq!(camera.find_pixel(&point), Some((column, row)));
        }
        assert_eq!(camera.find_pixel(&Point3::new(0.0, 0.0, -1.0)), None);
    }
}
