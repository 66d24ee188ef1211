//! `trajectory_msgs`, `control_msgs`.

use super::standard::{Duration, Header};
use serde::{Deserialize, Serialize};

/// Where joints are at one moment of a trajectory. A list is as long as the trajectory's joints, or empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTrajectoryPoint {
    /// Radians or metres.
    pub positions: Vec<f64>,
    /// Radians or metres per second.
    pub velocities: Vec<f64>,
    /// Radians or metres per second squared.
    pub accelerations: Vec<f64>,
    /// Newton metres or newtons.
    pub effort: Vec<f64>,
    /// When, after the trajectory's start.
    pub time_from_start: Duration,
}

/// A way of joints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTrajectory {
    /// When it starts; 0 for at once.
    pub header: Header,
    /// The joints.
    pub joint_names: Vec<String>,
    /// The points, by rising time.
    pub points: Vec<JointTrajectoryPoint>,
}

/// How far a joint may be off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTolerance {
    /// The joint.
    pub name: String,
    /// Radians or metres; 0 for the controller's own, -1 for any.
    pub position: f64,
    /// Radians or metres per second.
    pub velocity: f64,
    /// Radians or metres per second squared.
    pub acceleration: f64,
}

/// What a gripper is told: the gap between its fingers, and how hard it may press.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GripperCommand {
    /// Metres.
    pub position: f64,
    /// Newtons; 0 or less for the controller's own.
    pub max_effort: f64,
}

super::named!("trajectory_msgs": JointTrajectory);
super::named!("control_msgs": GripperCommand);
