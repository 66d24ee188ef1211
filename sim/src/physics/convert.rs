//! Between our f64 nalgebra types and rapier's f32 glam types.

use dsm::Pose;
use nalgebra::{Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d::math::{Pose as RapierPose, Rotation, Vector};

/// To rapier's vector.
pub(super) fn to_vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x as f32, v.y as f32, v.z as f32)
}

/// From rapier's vector.
pub(crate) fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// To rapier's pose.
pub(crate) fn to_pose(pose: &Pose) -> RapierPose {
    let q = pose.rotation;
    RapierPose::from_parts(
        to_vector(&pose.translation.vector),
        Rotation::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32),
    )
}

/// From rapier's pose.
pub(super) fn from_pose(pose: &RapierPose) -> Pose {
    let q = pose.rotation;
    let rotation = Quaternion::new(f64::from(q.w), f64::from(q.x), f64::from(q.y), f64::from(q.z));
    Pose::from_parts(Translation3::from(from_vector(pose.translation)), UnitQuaternion::new_normalize(rotation))
}

/// From rapier's vector, as a point.
pub(super) fn from_point(v: Vector) -> Point3<f64> {
    Point3::from(from_vector(v))
}
