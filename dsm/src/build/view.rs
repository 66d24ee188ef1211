//! What one frame can testify about an object: its viewing frustum with a coarse copy of mask and depth.

use super::observation::{MaskBitmap, depth_noise_m};
use crate::camera::CameraModel;
use crate::frame::{FrameId, RgbdFrame};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// Cells along the longer side of the copy.
const CELLS: usize = 40;

/// What a view says about a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Evidence {
    /// The object's surface was measured there.
    Agrees,
    /// The ray went on behind it, or hit something else there.
    Denies,
    /// Outside the frustum, hidden, or no return.
    Silent,
}

/// A view of one object. Kept in the object's window; its size is bounded whatever the mask's size.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub(super) frame: FrameId,
    /// Position of the camera, world frame.
    pub(super) eye: Point3<f32>,
    /// What the eroded border of the mask is worth at the object, metres.
    pub(super) lost_m: f32,
    /// Whether the mask ends at the upper edge of the image.
    pub(super) cut_above: bool,
    camera_from_world: Matrix3<f32>,
    translation: Vector3<f32>,
    model: CameraModel,
    first_column: isize,
    first_row: isize,
    stride: usize,
    columns: usize,
    rows: usize,
    /// Depth in metres, negated where the pixel is outside the mask; 0 without return.
    cells: Vec<f32>,
}

impl View {
    /// Copies mask and depth around the mask, with a margin of a quarter of its size, where misplaced points show.
    pub(super) fn new(frame: &RgbdFrame, mask: &MaskBitmap, depth_m: f64) -> Self {
        let (width, height) = (frame.model.width as isize, frame.model.height as isize);
        let margin = (mask.columns.max(mask.rows) / 4 + 4) as isize;
        let c0 = (mask.first_column as isize - margin).max(0);
        let r0 = (mask.first_row as isize - margin).max(0);
        let c1 = ((mask.first_column + mask.columns) as isize + margin).min(width);
        let r1 = ((mask.first_row + mask.rows) as isize + margin).min(height);
        let stride = ((c1 - c0).max(r1 - r0) as usize).div_ceil(CELLS).max(1);
        let (columns, rows) = (((c1 - c0) as usize).div_ceil(stride), ((r1 - r0) as usize).div_ceil(stride));
        let mut cells = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            let r = (r0 + (row * stride + stride / 2) as isize).min(r1 - 1);
            for column in 0..columns {
                let c = (c0 + (column * stride + stride / 2) as isize).min(c1 - 1);
                // `max` also turns a NaN into "no return".
                let depth = frame.depth_m[(r * width + c) as usize].max(0.0);
                cells.push(if mask.contains(c, r) { depth } else { -depth });
            }
        }
        let camera_from_world = frame.world_from_camera.inverse().cast::<f32>();
        Self {
            frame: frame.id,
            eye: Point3::from(frame.world_from_camera.translation.vector).cast(),
            lost_m: (mask.erosion() as f64 * depth_m / frame.model.fx) as f32,
            cut_above: mask.first_row == 0,
            camera_from_world: camera_from_world.rotation.to_rotation_matrix().into_inner(),
            translation: camera_from_world.translation.vector,
            model: frame.model,
            first_column: c0,
            first_row: r0,
            stride,
            columns,
            rows,
            cells,
        }
    }

    /// Bytes of its copy of mask and depth.
    pub(super) fn cell_bytes(&self) -> usize {
        self.cells.capacity() * size_of::<f32>()
    }

    /// Moves the camera by a correction of its pose.
    pub(super) fn transform(&mut self, correction: &Isometry3<f32>) {
        let inverse = correction.inverse();
        self.eye = correction * self.eye;
        self.translation += self.camera_from_world * inverse.translation.vector;
        self.camera_from_world *= inverse.rotation.to_rotation_matrix().into_inner();
    }

    /// What the view says about a surface at `point` in the world frame, known to `tolerance_m`.
    pub(super) fn testify(&self, point: &Point3<f32>, tolerance_m: f32) -> Evidence {
        let p = self.camera_from_world * point.coords + self.translation;
        if p.z < 0.05 {
            return Evidence::Silent;
        }
        let column = (self.model.fx as f32 * p.x / p.z + self.model.cx as f32) as isize - self.first_column;
        let row = (self.model.fy as f32 * p.y / p.z + self.model.cy as f32) as isize - self.first_row;
        if column < 0 || row < 0 {
            return Evidence::Silent;
        }
        let (column, row) = (column as usize / self.stride, row as usize / self.stride);
        if column >= self.columns || row >= self.rows {
            return Evidence::Silent;
        }
        let cell = self.cells[row * self.columns + column];
        let depth = cell.abs();
        let tolerance = tolerance_m + 0.6 * depth_noise_m(f64::from(p.z)) as f32;
        if depth == 0.0 || depth < p.z - tolerance {
            Evidence::Silent
        } else if cell > 0.0 && depth <= p.z + tolerance {
            Evidence::Agrees
        } else {
            Evidence::Denies
        }
    }

    /// Sector of 30 degrees from which a thing at `center` is seen, and whether from less than a metre and a half.
    pub(super) fn sector(&self, center: &Point3<f64>) -> (u8, bool) {
        let from = self.eye.cast::<f64>() - center;
        let angle = from.y.atan2(from.x).rem_euclid(std::f64::consts::TAU);
        ((angle / std::f64::consts::TAU * 12.0) as u8 % 12, from.norm() < 1.5)
    }
}
