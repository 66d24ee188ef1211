//! The QP controller: velocities of arm and base that follow a tool pose within limits and away from obstacles.
//!
//! ```text
//! JointState, Twist, ToolGoal, obstacles
//!   ─▶ tasks (pose, effort, posture, manipulability, facing, camera) ─┐
//!      box   (joint limits, base limits) ─────────────────────────────┼─▶ QP ─▶ JointVelocities, Twist
//!      rows  (self-collision, obstacles) ─────────────────────────────┘
//! ```
//!
//! Tasks give way, limits do not: there is slack on the tasks and none on box and rows. Without a solution every joint
//! brakes at its acceleration limit and the status says why. Neither simulator nor map is needed: see the example
//! `follow_pose`.

mod active_set;
pub mod base_limit;
pub mod camera_task;
pub mod columns;
pub mod config;
mod controller;
pub mod damper;
mod descent;
pub mod effort_task;
pub mod facing_task;
mod ik;
pub mod joint_limit;
mod joint_move;
mod joint_path;
pub mod manipulability;
pub mod obstacle_limit;
pub mod pose_task;
pub mod posture_task;
pub mod qp;
mod recovery;
mod rows;
mod safety;
pub mod self_collision_limit;

pub use camera_task::Watch;
pub use config::ControllerConfig;
pub use controller::Controller;
pub use ik::{IkRequest, find_ik};
pub use joint_move::JointMove;
pub use joint_path::{PathRequest, find_joint_path};
pub use pose_task::ToolGoal;
pub use qp::SolvedBy;

use crate::drivers::Twist;
use crate::joints::JointVelocities;

/// Why the joints brake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrakeReason {
    /// The limits contradict each other: no velocity satisfies all of them.
    Infeasible,
    /// More obstacles are near than the solver holds.
    TooManyRows,
    /// The solver gave up.
    Solver,
    /// State or goal hold a value that is not finite, or the step is not positive.
    NotFinite,
    /// The state is of other joints than the group's.
    WrongJoints,
}

/// How a tick ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlStatus {
    /// On the way.
    Tracking,
    /// On the way to another posture for the same goal, because the arm could come no nearer in the present one: the
    /// tool leaves its straight way.
    Reconfiguring,
    /// The goal is reached within the configured errors.
    Reached,
    /// Every joint slows down as hard as it may.
    Braking {
        /// Why.
        reason: BrakeReason,
    },
}

/// The answer of a tick.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlOutput {
    /// Velocities of the group for the next step.
    pub velocities: JointVelocities,
    /// Velocity of the base for the next step; zero for a controller without base.
    pub base: Twist,
    /// How the tick ended.
    pub status: ControlStatus,
    /// Distance of the tool from its goal in m before the step; not a number when the state could not be used.
    pub error_m: f64,
    /// Angle of the tool from its goal in rad before the step.
    pub error_rad: f64,
    /// Least distance of a moved link to another link or an obstacle in m; `None` when nothing is near.
    pub min_distance_m: Option<f64>,
    /// Rows that hold the motion back.
    pub active_rows: usize,
    /// Rows of the program.
    pub rows: usize,
    /// Which stage of the solver gave the answer; `None` when braking.
    pub solved_by: Option<SolvedBy>,
}

#[cfg(test)]
mod tests;
