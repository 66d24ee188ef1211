//! Task: a camera keeps a point in the middle of its picture.
//!
//! ```text
//! cost w/2 || e' + k e ||^2,   e = a x u   (a optical axis, u direction to the point, both in the base frame)
//! e' = (w x a) x u + a x u',   u' = -(1 - u u') c' / r      (w turning and c' velocity of the camera, r its distance)
//! ```
//!
//! `e` is zero when the camera looks at the point, and as long as the sine of the angle between them otherwise.

use super::columns::Columns;
use crate::model::{Kinematics, LinkId, LinkPoses};
use nalgebra::{DMatrix, DVector, Point3, Vector3};

/// What a camera shall look at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch {
    /// The camera's optical frame: +z looks forward.
    pub camera: LinkId,
    /// The point, standing on the floor, in the base frame of the present tick.
    pub point_in_base: Point3<f64>,
}

/// Nearest distance of the point that counts, m.
const NEAREST_M: f64 = 0.02;

/// The error `e` and its rate for a unit of each variable, 3 x variables.
pub fn watch_error(
    columns: &Columns,
    (kinematics, poses): (&Kinematics, &LinkPoses),
    watch: &Watch,
) -> (Vector3<f64>, DMatrix<f64>) {
    let camera = poses.get(watch.camera);
    let center = Point3::from(camera.translation.vector);
    let axis = camera.rotation * Vector3::z();
    let between = watch.point_in_base - center;
    let distance_m = between.norm().max(NEAREST_M);
    let towards = between / distance_m;
    let jacobian = columns.jacobian(kinematics, poses, watch.camera, &center);
    let mut rates = DMatrix::zeros(3, columns.len());
    for (k, column) in jacobian.column_iter().enumerate() {
        let (linear, angular) = (column.fixed_rows::<3>(0).into_owned(), column.fixed_rows::<3>(3).into_owned());
        let drift = -(linear - towards * towards.dot(&linear)) / distance_m;
        rates.fixed_view_mut::<3, 1>(0, k).copy_from(&(angular.cross(&axis).cross(&towards) + axis.cross(&drift)));
    }
    (axis.cross(&towards), rates)
}

/// Adds the task to the cost.
pub fn add_camera_task(
    (weight, gain_per_s): (f64, f64),
    (error, rates): &(Vector3<f64>, DMatrix<f64>),
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    hessian.gemm_tr(weight, rates, rates, 1.0);
    gradient.gemv_tr(weight * gain_per_s, rates, error, 1.0);
}
