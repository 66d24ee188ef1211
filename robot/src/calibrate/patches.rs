//! Small planes in a depth image.

use dsm::camera::CameraModel;
use nalgebra::{Matrix3, Point3, Vector3};

/// Pixels between the middles of neighbouring patches.
const EVERY_PX: u32 = 12;
/// Half the side of a patch, pixels.
const HALF_PX: u32 = 14;
/// Every so many pixels of a patch count.
const STEP_PX: usize = 2;
/// A patch whose points lie farther from its plane, at 1 m, is none, metres; noise of depth grows with its square.
const FLAT_M_AT_1_M: f64 = 0.008;
/// Farther away the steps of depth are too wide, metres.
const FARTHEST_M: f64 = 4.0;
/// A plane seen more steeply than this has noisy depth: the cosine of ray and normal.
const LEAST_COSINE: f64 = 0.35;

/// A small plane, in the camera's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Its middle pixel: column and row.
    pub pixel: [u32; 2],
    /// Mean of its points, metres.
    pub center: Point3<f64>,
    /// Unit normal, towards the camera.
    pub normal: Vector3<f64>,
    /// Deviation of its mean along the normal, metres, as far as its points tell.
    pub sigma_m: f64,
}

/// The patches of a depth image (metres along z, 0 without a return), row by row on a grid.
pub fn find_patches(model: &CameraModel, depth_m: &[f32]) -> Vec<Patch> {
    let rows = (HALF_PX..model.height.saturating_sub(HALF_PX)).step_by(EVERY_PX as usize);
    let columns = || (HALF_PX..model.width.saturating_sub(HALF_PX)).step_by(EVERY_PX as usize);
    rows.flat_map(|row| columns().filter_map(move |column| find_patch(model, depth_m, column, row))).collect()
}

fn find_patch(model: &CameraModel, depth_m: &[f32], column: u32, row: u32) -> Option<Patch> {
    let depth_at = |column: u32, row: u32| f64::from(depth_m[(row * model.width + column) as usize]);
    let middle_m = depth_at(column, row);
    if middle_m <= 0.0 || middle_m > FARTHEST_M {
        return None;
    }
    let (mut points, mut asked) = (Vec::new(), 0_usize);
    for y in (row - HALF_PX..=row + HALF_PX).step_by(STEP_PX) {
        for x in (column - HALF_PX..=column + HALF_PX).step_by(STEP_PX) {
            asked += 1;
            let z = depth_at(x, y);
            if z > 0.0 {
                points.push(model.back_project(x, y, z));
            }
        }
    }
    if 10 * points.len() < 9 * asked {
        return None;
    }
    let count = points.len() as f64;
    let mean = points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / count;
    let spread = |sum: Matrix3<f64>, point: &Point3<f64>| {
        let offset = point.coords - mean;
        sum + offset * offset.transpose()
    };
    let eigen = (points.iter().fold(Matrix3::zeros(), spread) / count).symmetric_eigen();
    let (least, variance) = eigen.eigenvalues.argmin();
    let mut normal = eigen.eigenvectors.column(least).into_owned();
    if normal.dot(&mean) > 0.0 {
        normal = -normal;
    }
    let deviation_m = variance.max(0.0).sqrt();
    let cosine = -normal.dot(&mean) / mean.norm();
    if deviation_m > FLAT_M_AT_1_M * (0.5 + middle_m * middle_m) || cosine < LEAST_COSINE {
        return None;
    }
    let sigma_m = deviation_m / count.sqrt() + 5e-4;
    Some(Patch { pixel: [column, row], center: Point3::from(mean), normal, sigma_m })
}
