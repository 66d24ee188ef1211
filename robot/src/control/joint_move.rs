//! A posture move: joints go to given values on a straight line in joint space, through the same limits.
//!
//! ```text
//! qdot_wanted = s (q_goal - q),   s = min over joints of the speed, braking and acceleration that each allows
//! ```
//!
//! One factor `s` for all joints keeps them on the line, so that a path checked by linear interpolation is the path
//! that is driven.

use super::config::ControllerConfig;
use super::joint_limit::braking_bound;
use super::safety::{Safety, Situation};
use super::{BrakeReason, ControlOutput, ControlStatus};
use crate::drivers::{JointState, Twist};
use crate::joints::JointPositions;
use crate::model::{Group, LinkId, Obstacle, RobotModel};
use nalgebra::{DMatrix, DVector};

/// How near every joint must come, in rad or m.
const REACHED: f64 = 0.005;
/// Share of the acceleration limit that the plan uses; the rest is for what the limits correct.
const PLANNED_SHARE: f64 = 0.8;

/// A move of one group to joint values.
pub struct JointMove {
    safety: Safety,
    goal: Vec<Option<f64>>,
}

impl JointMove {
    /// A move of `group` (of `model`); joints that `goal` does not name stay where they are.
    pub fn new(model: &RobotModel, group: &Group, goal: &JointPositions, config: ControllerConfig) -> Self {
        let safety = Safety::new(&model.kinematics, &model.collision, group, None, config, 0.0);
        Self { goal: group.joints.iter().map(|name| goal.find(name)).collect(), safety }
    }

    /// Where the joints outside the group are, for self-collision.
    pub fn set_other_joints(&mut self, positions: &JointPositions) {
        self.safety.set_other_joints(positions);
    }

    /// Links that may touch obstacles; replaces the list before.
    pub fn set_touching(&mut self, links: &[LinkId]) {
        self.safety.set_touching(links);
    }

    /// A new goal; the last command is remembered, so that way-points can be passed without a jump in velocity.
    pub fn set_goal(&mut self, goal: &JointPositions) {
        self.goal = self.safety.group.joints.iter().map(|name| goal.find(name)).collect();
    }

    /// Velocities for the next `dt_s` seconds; the output's errors are the greatest joint error, in both units.
    pub fn tick(&mut self, state: &JointState, obstacles: &[Obstacle], dt_s: f64) -> ControlOutput {
        if self.goal.iter().flatten().any(|value| !value.is_finite()) {
            return self.safety.brake(state, Twist::default(), BrakeReason::NotFinite, dt_s);
        }
        let now = match self.safety.situation(state, Twist::default(), dt_s) {
            Ok(now) => now,
            Err(reason) => return self.safety.brake(state, Twist::default(), reason, dt_s),
        };
        let n = now.positions.len();
        let error = DVector::from_fn(n, |k, _| self.goal[k].map_or(0.0, |goal| goal - now.positions[k]));
        let wanted = velocities_along(&self.safety, &now, &error, dt_s);
        let hessian = DMatrix::identity(n, n);
        let rows = self.safety.rows(&now, obstacles, dt_s);
        let still = now.velocities.amax() < 0.05;
        let mut output = self.safety.finish(state, now, (hessian, -wanted), rows, dt_s);
        (output.error_m, output.error_rad) = (error.amax(), error.amax());
        if output.status == ControlStatus::Tracking && error.amax() <= REACHED && still {
            output.status = ControlStatus::Reached;
        }
        output
    }
}

/// Velocities along a straight line in joint space, as fast as every joint allows; `error` is what is left of it.
pub(super) fn velocities_along(safety: &Safety, now: &Situation, error: &DVector<f64>, dt_s: f64) -> DVector<f64> {
    let mut rate_per_s = f64::INFINITY;
    for (k, error) in error.iter().enumerate().filter(|(_, error)| error.abs() > 1e-9) {
        let limits = &safety.group.limits[k];
        let acceleration = safety.group.max_accelerations[k] * PLANNED_SHARE;
        let moving = (now.velocities[k] * error.signum()).max(0.0);
        let speed = (limits.velocity * safety.config.velocity_share)
            .min(braking_bound(error.abs(), acceleration, dt_s))
            .min(moving + acceleration * dt_s);
        rate_per_s = rate_per_s.min(speed / error.abs());
    }
    if rate_per_s.is_finite() { error * rate_per_s } else { DVector::zeros(error.len()) }
}
