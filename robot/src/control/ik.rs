//! Joint values for a tool pose: damped least squares with restarts, within limits and clear of collisions.
//!
//! ```text
//! dq = J' (J J' + lambda^2 I)^-1 e
//! ```

use super::pose_task::pose_error;
use crate::joints::JointPositions;
use crate::model::{Configuration, Obstacle, RobotModel};
use dsm::Pose;
use nalgebra::{DVector, Matrix6, Point3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What to look for, and how hard.
#[derive(Clone, Debug)]
pub struct IkRequest<'a> {
    /// Where every joint is; the search starts here, and joints outside the arm stay.
    pub start: &'a Configuration,
    /// Further starts, tried after `start` in their order.
    pub seeds: &'a [JointPositions],
    /// Obstacles in the base frame.
    pub obstacles: &'a [Obstacle],
    /// Distance to keep from obstacles in m; default 0.01.
    pub margin_m: f64,
    /// Random starts after the others; default 12.
    pub restarts: usize,
    /// Steps for each start; default 60.
    pub steps: usize,
    /// Seed of the random starts; default 0.
    pub seed: u64,
}

impl<'a> IkRequest<'a> {
    /// A request with the defaults.
    pub fn new(start: &'a Configuration) -> Self {
        Self { start, seeds: &[], obstacles: &[], margin_m: 0.01, restarts: 12, steps: 60, seed: 0 }
    }
}

/// Position error of an answer in m.
const WITHIN_M: f64 = 2e-4;
/// Angle error of an answer in rad.
const WITHIN_RAD: f64 = 2e-3;
/// Distance kept from own links in m.
const SELF_MARGIN_M: f64 = 0.005;
/// Damping lambda.
const DAMPING: f64 = 0.02;
/// Greatest change of a joint in one step, in rad or m.
const MAX_STEP: f64 = 0.4;
/// Distance kept from joint limits, in rad or m.
const LIMIT_MARGIN: f64 = 0.01;

/// Joint values of the arm group that bring the tool to `base_from_tool`: the first found that collides with nothing.
///
/// `None` after the bounded search; that proves nothing about the pose.
pub fn find_ik(model: &RobotModel, base_from_tool: &Pose, request: &IkRequest<'_>) -> Option<JointPositions> {
    let mut rng = ChaCha8Rng::seed_from_u64(request.seed);
    let arm = &model.arm;
    let from_start = arm.values_of(request.start);
    let seeded = request.seeds.iter().map(|seed| {
        let value = |k: usize| seed.find(&arm.joints[k]).unwrap_or(from_start[k]);
        (0..arm.len()).map(value).collect::<Vec<f64>>()
    });
    let mut starts: Vec<Vec<f64>> = std::iter::once(from_start.clone()).chain(seeded).collect();
    for _ in 0..request.restarts {
        let draw = |k: usize, rng: &mut ChaCha8Rng| {
            let (lower, upper) = range(model, k);
            rng.random_range(lower..=upper)
        };
        starts.push((0..arm.len()).map(|k| draw(k, &mut rng)).collect());
    }
    starts.into_iter().find_map(|start| {
        let values = descend(model, base_from_tool, request, start)?;
        let mut configuration = request.start.clone();
        configuration.apply_group(arm, &values);
        let poses = model.kinematics.root_from_links(&configuration);
        let moved = model.arm_links();
        let clear = !model.collision.collides(&poses, request.obstacles, &moved, request.margin_m, SELF_MARGIN_M);
        if clear { JointPositions::from_values(&arm.joints, values) } else { None }
    })
}

/// Limits of an arm joint with the margin, finite for endless joints.
fn range(model: &RobotModel, k: usize) -> (f64, f64) {
    let limits = &model.arm.limits[k];
    let margin = LIMIT_MARGIN.min(0.1 * (limits.upper - limits.lower));
    ((limits.lower + margin).max(-std::f64::consts::PI), (limits.upper - margin).min(std::f64::consts::PI))
}

/// Newton-like steps from one start; `None` when they do not arrive.
fn descend(model: &RobotModel, goal: &Pose, request: &IkRequest<'_>, start: Vec<f64>) -> Option<Vec<f64>> {
    let arm = &model.arm;
    let mut configuration = request.start.clone();
    let mut values = start;
    for (k, value) in values.iter_mut().enumerate() {
        let (lower, upper) = range(model, k);
        *value = value.clamp(lower, upper);
    }
    for _ in 0..request.steps {
        configuration.apply_group(arm, &values);
        let poses = model.kinematics.root_from_links(&configuration);
        let base_from_tool = poses.get(model.tool);
        let mut error = pose_error(base_from_tool, goal);
        if error.fixed_rows::<3>(0).norm() < WITHIN_M && error.fixed_rows::<3>(3).norm() < WITHIN_RAD {
            return Some(values);
        }
        // Far goals are approached in bounded steps: the Jacobian only holds nearby.
        let far = (error.fixed_rows::<3>(0).norm() / 0.3).max(error.fixed_rows::<3>(3).norm() / 0.8).max(1.0);
        error /= far;
        let tool_point = Point3::from(base_from_tool.translation.vector);
        let mut jacobian = model.kinematics.jacobian(&poses, model.tool, &tool_point, arm);
        // Joints that stand at a limit and would be pushed beyond it are taken out and the step is computed again.
        for round in 0..3 {
            let square = &jacobian * jacobian.transpose();
            let square = Matrix6::from_iterator(square.iter().copied()) + Matrix6::identity() * (DAMPING * DAMPING);
            let step: DVector<f64> = jacobian.tr_mul(&square.cholesky()?.solve(&error));
            let factor = (MAX_STEP / step.amax().max(1e-12)).min(1.0);
            let mut next = values.clone();
            let mut stuck = false;
            for k in 0..values.len() {
                let (lower, upper) = range(model, k);
                let wanted = values[k] + step[k] * factor;
                next[k] = wanted.clamp(lower, upper);
                if next[k] != wanted && next[k] == values[k] {
                    jacobian.column_mut(k).fill(0.0);
                    stuck = true;
                }
            }
            if !stuck || round == 2 {
                values = next;
                break;
            }
        }
    }
    None
}
