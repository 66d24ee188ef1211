//! `trajectory_msgs`, `control_msgs`.

use super::geometry::{Transform, Twist};
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

/// Where joints with several degrees of freedom are at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MultiDOFJointTrajectoryPoint {
    /// Poses.
    pub transforms: Vec<Transform>,
    /// Velocities.
    pub velocities: Vec<Twist>,
    /// Accelerations.
    pub accelerations: Vec<Twist>,
    /// When, after the trajectory's start.
    pub time_from_start: Duration,
}

/// A way of joints with several degrees of freedom.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MultiDOFJointTrajectory {
    /// When it starts; 0 for at once.
    pub header: Header,
    /// The joints.
    pub joint_names: Vec<String>,
    /// The points, by rising time.
    pub points: Vec<MultiDOFJointTrajectoryPoint>,
}

/// How far a joint with several degrees of freedom may be off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointComponentTolerance {
    /// The joint.
    pub joint_name: String,
    /// Which of them.
    pub component: u16,
    /// Radians or metres.
    pub position: f64,
    /// Radians or metres per second.
    pub velocity: f64,
    /// Radians or metres per second squared.
    pub acceleration: f64,
}

/// The goal of `control_msgs/action/FollowJointTrajectory`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryGoal {
    /// The way.
    pub trajectory: JointTrajectory,
    /// Of joints with several degrees of freedom.
    pub multi_dof_trajectory: MultiDOFJointTrajectory,
    /// How far joints may be off on the way.
    pub path_tolerance: Vec<JointTolerance>,
    /// The same for joints with several degrees of freedom.
    pub component_path_tolerance: Vec<JointComponentTolerance>,
    /// How far joints may be off at the end.
    pub goal_tolerance: Vec<JointTolerance>,
    /// The same for joints with several degrees of freedom.
    pub component_goal_tolerance: Vec<JointComponentTolerance>,
    /// How late they may be there.
    pub goal_time_tolerance: Duration,
}

/// The result of `control_msgs/action/FollowJointTrajectory`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryResult {
    /// 0 done, -1 no goal, -2 other joints, -4 off on the way, -5 off at the end.
    pub error_code: i32,
    /// In words.
    pub error_string: String,
}

/// The feedback of `control_msgs/action/FollowJointTrajectory`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryFeedback {
    /// When.
    pub header: Header,
    /// The joints.
    pub joint_names: Vec<String>,
    /// Where they are to be.
    pub desired: JointTrajectoryPoint,
    /// Where they are.
    pub actual: JointTrajectoryPoint,
    /// The difference.
    pub error: JointTrajectoryPoint,
    /// Joints with several degrees of freedom.
    pub multi_dof_joint_names: Vec<String>,
    /// Where these are to be.
    pub multi_dof_desired: MultiDOFJointTrajectoryPoint,
    /// Where these are.
    pub multi_dof_actual: MultiDOFJointTrajectoryPoint,
    /// The difference of these.
    pub multi_dof_error: MultiDOFJointTrajectoryPoint,
}

/// The goal of `control_msgs/action/GripperCommand`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GripperCommandGoal {
    /// What it is told.
    pub command: GripperCommand,
}

/// The result, and the feedback, of `control_msgs/action/GripperCommand`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GripperCommandResult {
    /// The gap, metres.
    pub position: f64,
    /// The force, newtons.
    pub effort: f64,
    /// Whether it presses against something.
    pub stalled: bool,
    /// Whether the gap is the one that was asked for.
    pub reached_goal: bool,
}

impl ros2_client::Message for FollowJointTrajectoryGoal {}
impl ros2_client::Message for FollowJointTrajectoryResult {}
impl ros2_client::Message for FollowJointTrajectoryFeedback {}
impl ros2_client::Message for GripperCommandGoal {}
impl ros2_client::Message for GripperCommandResult {}
super::named!("trajectory_msgs": JointTrajectory);
super::named!("control_msgs": GripperCommand);
