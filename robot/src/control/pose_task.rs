//! Task: the tool follows a pose.
//!
//! ```text
//! cost 1/2 || W (J qdot - nu) ||^2,   nu = feed-forward + k e,   W = diag(1, 1, 1, w, w, w)
//! ```
//!
//! `e` is the position error and the rotation vector from the tool to the goal, both in the base frame. NEO carries the
//! difference `nu - J qdot` as slack; substituted, it is this cost.

use super::config::ControllerConfig;
use dsm::Pose;
use nalgebra::{DMatrix, DVector, Vector3, Vector6};

/// Where the tool shall be, and how it shall move there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolGoal {
    /// The pose.
    pub base_from_tool: Pose,
    /// Linear velocity of the goal in the base frame, m/s.
    pub linear_m_per_s: Vector3<f64>,
    /// Angular velocity of the goal in the base frame, rad/s.
    pub angular_rad_per_s: Vector3<f64>,
}

impl From<Pose> for ToolGoal {
    /// A goal that stands still.
    fn from(base_from_tool: Pose) -> Self {
        Self { base_from_tool, linear_m_per_s: Vector3::zeros(), angular_rad_per_s: Vector3::zeros() }
    }
}

/// From the tool to the goal: position in metres, then rotation vector in radians, in the base frame.
pub fn pose_error(base_from_tool: &Pose, base_from_goal: &Pose) -> Vector6<f64> {
    let linear = base_from_goal.translation.vector - base_from_tool.translation.vector;
    let angular = (base_from_goal.rotation * base_from_tool.rotation.inverse()).scaled_axis();
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// The twist `nu` asked for at this error.
pub fn wanted_twist(config: &ControllerConfig, error: &Vector6<f64>, goal: &ToolGoal) -> Vector6<f64> {
    let mut linear = error.fixed_rows::<3>(0) * config.gain_per_s;
    let mut angular = error.fixed_rows::<3>(3) * config.gain_per_s;
    // One factor for both keeps them arriving together.
    let factor = (config.max_tool_speed_m_per_s / linear.norm().max(1e-12))
        .min(config.max_tool_turn_rad_per_s / angular.norm().max(1e-12))
        .min(1.0);
    linear = linear * factor + goal.linear_m_per_s;
    angular = angular * factor + goal.angular_rad_per_s;
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// Adds the task to the cost.
pub fn add_pose_task(
    config: &ControllerConfig,
    jacobian: &DMatrix<f64>,
    twist: &Vector6<f64>,
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    let mut weighted = jacobian.clone();
    let mut wanted = *twist;
    for row in 3..6 {
        weighted.row_mut(row).scale_mut(config.turn_weight);
        wanted[row] *= config.turn_weight;
    }
    hessian.gemm_tr(1.0, &weighted, &weighted, 1.0);
    gradient.gemv_tr(-1.0, &weighted, &wanted, 1.0);
}
