//! `geometry_msgs`, `nav_msgs`, `tf2_msgs`.

use super::standard::Header;
use dsm::Pose as Isometry;
use nalgebra::{Quaternion as NalgebraQuaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// A vector; metres, metres per second or radians per second by where it stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Forward.
    pub x: f64,
    /// To the left.
    pub y: f64,
    /// Up.
    pub z: f64,
}

/// A point in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Forward.
    pub x: f64,
    /// To the left.
    pub y: f64,
    /// Up.
    pub z: f64,
}

/// A rotation; the real part stands last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// i.
    pub x: f64,
    /// j.
    pub y: f64,
    /// k.
    pub z: f64,
    /// The real part.
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// A pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Where.
    pub position: Point,
    /// How it is turned.
    pub orientation: Quaternion,
}

/// A transform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Shift in metres.
    pub translation: Vector3,
    /// Turn.
    pub rotation: Quaternion,
}

fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    Quaternion { x: rotation.i, y: rotation.j, z: rotation.k, w: rotation.w }
}

/// The pose that a message means; `None` when a part is not finite or the quaternion is none (its length not within a
/// hundredth of 1).
fn find_isometry(position: [f64; 3], turn: &Quaternion) -> Option<Isometry> {
    let rotation = NalgebraQuaternion::new(turn.w, turn.x, turn.y, turn.z);
    let off = (rotation.norm() - 1.0).abs();
    if !(position.iter().all(|value| value.is_finite()) && off <= 0.01) {
        return None;
    }
    // What has unit length stays what it is, to the last bit.
    let turn =
        if off < 1e-9 { UnitQuaternion::new_unchecked(rotation) } else { UnitQuaternion::from_quaternion(rotation) };
    Some(Isometry::from_parts(Translation3::from(position), turn))
}

impl From<&Isometry> for Pose {
    fn from(pose: &Isometry) -> Self {
        let [x, y, z] = pose.translation.vector.into();
        Self { position: Point { x, y, z }, orientation: quaternion(&pose.rotation) }
    }
}

impl From<&Isometry> for Transform {
    fn from(pose: &Isometry) -> Self {
        let [x, y, z] = pose.translation.vector.into();
        Self { translation: Vector3 { x, y, z }, rotation: quaternion(&pose.rotation) }
    }
}

impl Pose {
    /// What it means; `None` when it means nothing.
    pub fn find_isometry(&self) -> Option<Isometry> {
        find_isometry([self.position.x, self.position.y, self.position.z], &self.orientation)
    }
}

impl Transform {
    /// What it means; `None` when it means nothing.
    pub fn find_isometry(&self) -> Option<Isometry> {
        find_isometry([self.translation.x, self.translation.y, self.translation.z], &self.rotation)
    }
}

/// A pose at a moment in a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// When, and in which frame.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
}

/// A transform at a moment: the pose of the child in the header's frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// When, and the parent's frame.
    pub header: Header,
    /// The child's frame.
    pub child_frame_id: String,
    /// `parent_from_child`.
    pub transform: Transform,
}

/// Transforms.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage {
    /// The transforms.
    pub transforms: Vec<TransformStamped>,
}

/// A velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Metres per second.
    pub linear: Vector3,
    /// Radians per second.
    pub angular: Vector3,
}

/// A velocity at a moment, in the header's frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistStamped {
    /// When, and in which frame.
    pub header: Header,
    /// The velocity.
    pub twist: Twist,
}

/// A pose with its covariance (x, y, z, turns about x, y, z; by rows).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// Its covariance.
    pub covariance: [[f64; 6]; 6],
}

/// A pose with its covariance at a moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    /// When, and in which frame.
    pub header: Header,
    /// The pose.
    pub pose: PoseWithCovariance,
}

/// A velocity with its covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// The velocity.
    pub twist: Twist,
    /// Its covariance.
    pub covariance: [[f64; 6]; 6],
}

/// Where a base is by its wheels, and how it moves in its own frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// When, and the frame of the pose (`odom`).
    pub header: Header,
    /// The frame of the velocity (`base_link`).
    pub child_frame_id: String,
    /// Where it is.
    pub pose: PoseWithCovariance,
    /// How it moves.
    pub twist: TwistWithCovariance,
}

super::named!("geometry_msgs": PoseStamped, PoseWithCovarianceStamped, TwistStamped, TransformStamped);
super::named!("nav_msgs": Odometry);
super::named!("tf2_msgs": TFMessage);

#[cfg(test)]
mod tests {
    //! Contract: a pose survives the way through a message, and one that means nothing is none.
    use super::*;
    use nalgebra::Vector3 as V;

    #[test]
    fn a_pose_comes_back_as_it_was() {
        let pose = Isometry::new(V::new(1.0, -2.0, 0.5), V::new(0.3, -0.2, 2.0));
        for back in [Pose::from(&pose).find_isometry(), Transform::from(&pose).find_isometry()] {
            let back = back.unwrap();
            assert_eq!(back, pose);
        }
    }

    #[test]
    fn what_is_no_pose_is_none() {
        let mut pose = Pose::default();
        pose.position.x = f64::NAN;
        assert_eq!(pose.find_isometry(), None);
        let mut pose = Pose::default();
        pose.orientation.w = 0.0;
        assert_eq!(pose.find_isometry(), None);
        pose.orientation.w = f64::INFINITY;
        assert_eq!(pose.find_isometry(), None);
    }
}
