//! The loop of the controller: one tick turns a tool pose into joint velocities.

use super::config::ControllerConfig;
use super::manipulability::manipulability;
use super::pose_task::{ToolGoal, add_pose_task, pose_error, wanted_twist};
use super::posture_task::add_posture_task;
use super::safety::Safety;
use super::{ControlOutput, ControlStatus};
use crate::drivers::JointState;
use crate::joints::JointPositions;
use crate::model::{CollisionModel, Group, JointLimits, Kinematics, LinkId, Obstacle, RobotModel};
use nalgebra::{DMatrix, DVector, Point3};
use std::sync::Arc;

/// Follows tool poses with the arm group, within joint limits and away from itself and from obstacles.
///
/// The decision variables are the columns of the tool's Jacobian; today the arm's joints, and a base would be two more.
pub struct Controller {
    safety: Safety,
    tool: LinkId,
    posture: DVector<f64>,
    rank: Vec<usize>,
}

impl Controller {
    /// A controller for the model's arm group and tool frame. The preferred posture is the middle of the joint limits.
    pub fn new(model: &RobotModel, config: ControllerConfig) -> Self {
        Self::for_group(&model.kinematics, &model.collision, &model.arm, model.tool, config)
    }

    /// A controller for any group and any link that it moves.
    pub fn for_group(
        kinematics: &Kinematics,
        collision: &Arc<CollisionModel>,
        group: &Group,
        tool: LinkId,
        config: ControllerConfig,
    ) -> Self {
        let margin = config.limit_margin;
        let safety = Safety::new(kinematics, collision, group, config, margin);
        let middle = |limits: &JointLimits| match limits.lower.is_finite() && limits.upper.is_finite() {
            true => 0.5 * (limits.lower + limits.upper),
            false => 0.0,
        };
        let chain = kinematics.joints_to(tool);
        let place = |name: &str| chain.iter().position(|joint| kinematics.joints[*joint].name == name);
        Self {
            safety,
            tool,
            posture: DVector::from_iterator(group.len(), group.limits.iter().map(middle)),
            rank: group.joints.iter().map(|name| place(name).unwrap_or(chain.len())).collect(),
        }
    }

    /// Joints to prefer where the pose leaves them free; joints not named keep their preference.
    pub fn set_posture(&mut self, preferred: &JointPositions) {
        for (k, name) in self.safety.group.joints.iter().enumerate() {
            if let Some(value) = preferred.find(name) {
                self.posture[k] = value;
            }
        }
    }

    /// Where the joints outside the arm are (head, fingers), for self-collision.
    pub fn set_other_joints(&mut self, positions: &JointPositions) {
        self.safety.set_other_joints(positions);
    }

    /// Links that may touch obstacles, as fingers do when they close; replaces the list before.
    pub fn set_touching(&mut self, links: &[LinkId]) {
        self.safety.set_touching(links);
    }

    /// Forgets the last command, for instance after an emergency stop.
    pub fn reset(&mut self) {
        self.safety.reset();
    }

    /// Velocities for the next `dt_s` seconds. Obstacles are in the base frame.
    pub fn tick(&mut self, state: &JointState, goal: &ToolGoal, obstacles: &[Obstacle], dt_s: f64) -> ControlOutput {
        let goal_finite = goal.base_from_tool.to_homogeneous().iter().all(|v| v.is_finite())
            && goal.linear_m_per_s.iter().chain(&goal.angular_rad_per_s).all(|v| v.is_finite());
        if !goal_finite {
            return self.safety.brake(state, super::BrakeReason::NotFinite, dt_s);
        }
        let now = match self.safety.situation(state, dt_s) {
            Ok(now) => now,
            Err(reason) => return self.safety.brake(state, reason, dt_s),
        };
        let config = &self.safety.config;
        let base_from_tool = now.poses.get(self.tool);
        let error = pose_error(base_from_tool, &goal.base_from_tool);
        let (error_m, error_rad) = (error.fixed_rows::<3>(0).norm(), error.fixed_rows::<3>(3).norm());
        // Secondary tasks fade with the error (NEO's 1/e on the slack), so that they never hold the tool off its goal.
        let fade = error.norm().clamp(1e-3, 1.0);

        let tool_point = Point3::from(base_from_tool.translation.vector);
        let jacobian = self.safety.kinematics.jacobian(&now.poses, self.tool, &tool_point, &self.safety.group);
        let n = jacobian.ncols();
        let mut hessian = DMatrix::identity(n, n) * (config.damping * fade);
        let mut gradient = DVector::zeros(n);
        add_pose_task(config, &jacobian, &wanted_twist(config, &error, goal), &mut hessian, &mut gradient);
        let from_posture = &now.positions - &self.posture;
        let weight = config.posture_weight * fade;
        add_posture_task(weight, config.posture_gain_per_s, &from_posture, &mut hessian, &mut gradient);
        gradient -= manipulability(&jacobian, &self.rank).1 * (config.manipulability * fade);

        let (reached_m, reached_rad) = (config.reached_m, config.reached_rad);
        let rows = self.safety.rows(&now, obstacles, dt_s);
        let mut output = self.safety.finish(state, now, (hessian, gradient), rows, dt_s);
        (output.error_m, output.error_rad) = (error_m, error_rad);
        if output.status == ControlStatus::Tracking && error_m <= reached_m && error_rad <= reached_rad {
            output.status = ControlStatus::Reached;
        }
        output
    }
}
