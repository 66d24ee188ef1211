//! Damped least squares from one start, a step at a time, within joint limits.
//!
//! ```text
//! dq = J' (J J' + lambda^2 I)^-1 e
//! ```

use super::pose_task::pose_error;
use crate::model::{Configuration, Drive, Group, JointKind, Kinematics, LinkId};
use dsm::Pose;
use nalgebra::{Matrix6, Translation3, Unit, UnitQuaternion, Vector3, Vector6};

/// Position error of an answer in m.
const WITHIN_M: f64 = 2e-4;
/// Angle error of an answer in rad.
const WITHIN_RAD: f64 = 2e-3;
/// Damping lambda.
const DAMPING: f64 = 0.02;
/// Error below which the damping falls, m and rad.
const UNDAMPED_FROM: f64 = 0.05;
/// Greatest change of a joint in one step, in rad or m.
const MAX_STEP: f64 = 0.4;

/// The joints between the base and the tool, as few as the group has.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    segments: Vec<Segment>,
    /// From the last moving joint to the tool.
    last: Pose,
    /// Least and greatest value of each joint of the group, finite for endless joints.
    pub(super) ranges: Vec<(f64, f64)>,
}

#[derive(Clone, Debug)]
struct Segment {
    before: Pose,
    axis: Unit<Vector3<f64>>,
    slides: bool,
    column: usize,
    multiplier: f64,
    offset: f64,
}

impl Chain {
    /// The chain to `tool`; joints outside the group stand as in `rest`. Searches keep `margin` (rad or m) from joint limits.
    pub(super) fn new(kinematics: &Kinematics, group: &Group, tool: LinkId, rest: &Configuration, margin: f64) -> Self {
        let mut segments = Vec::new();
        let mut before = Pose::identity();
        for joint in kinematics.joints_to(tool).into_iter().map(|index| &kinematics.joints[index]) {
            before *= joint.parent_from_joint;
            let Drive::Variable { variable, multiplier, offset } = joint.drive else { continue };
            let slides = joint.kind == JointKind::Prismatic;
            match group.variables.iter().position(|v| *v == variable) {
                Some(column) => {
                    segments.push(Segment { before, axis: joint.axis, slides, column, multiplier, offset });
                    before = Pose::identity();
                }
                None => before *= motion(&joint.axis, slides, multiplier * rest.value(variable) + offset),
            }
        }
        let range = |k: usize| {
            let limits = &group.limits[k];
            let margin = margin.min(0.1 * (limits.upper - limits.lower));
            ((limits.lower + margin).max(-std::f64::consts::PI), (limits.upper - margin).min(std::f64::consts::PI))
        };
        Self { segments, last: before, ranges: (0..group.len()).map(range).collect() }
    }

    /// Pose of the tool and, into `columns`, its Jacobian by columns.
    fn evaluate(&self, values: &[f64], columns: &mut [Vector6<f64>]) -> Pose {
        columns.fill(Vector6::zeros());
        let mut pose = Pose::identity();
        let mut screws = [(Vector3::zeros(), Vector3::zeros()); 24];
        for (segment, screw) in self.segments.iter().zip(&mut screws) {
            pose *= segment.before;
            *screw = (pose.rotation * segment.axis.into_inner() * segment.multiplier, pose.translation.vector);
            pose *= motion(&segment.axis, segment.slides, segment.multiplier * values[segment.column] + segment.offset);
        }
        pose *= self.last;
        for (segment, (axis, origin)) in self.segments.iter().zip(&screws) {
            let (linear, angular) = match segment.slides {
                true => (*axis, Vector3::zeros()),
                false => (axis.cross(&(pose.translation.vector - origin)), *axis),
            };
            columns[segment.column] += Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
        }
        pose
    }

    /// Whether the chain is short enough for a search.
    pub(super) fn is_searchable(&self) -> bool {
        self.segments.len() <= 24
    }
}

fn motion(axis: &Unit<Vector3<f64>>, slides: bool, position: f64) -> Pose {
    match slides {
        true => Pose::from_parts(Translation3::from(axis.into_inner() * position), UnitQuaternion::identity()),
        false => Pose::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(axis, position)),
    }
}

/// One search.
#[derive(Clone, Debug)]
pub(super) struct Descent {
    /// Where it is.
    pub(super) values: Vec<f64>,
    /// Distance (m) and angle (rad) from the goal before the last step.
    pub(super) error: (f64, f64),
    columns: Vec<Vector6<f64>>,
}

impl Descent {
    /// A search from `start`, brought within the limits.
    pub(super) fn new(chain: &Chain, mut start: Vec<f64>) -> Self {
        for (value, (lower, upper)) in start.iter_mut().zip(&chain.ranges) {
            *value = value.clamp(*lower, *upper);
        }
        Self { error: (f64::INFINITY, f64::INFINITY), columns: vec![Vector6::zeros(); start.len()], values: start }
    }

    /// One step; whether the values before it reach the goal (then nothing moves). `None` when there is no step.
    pub(super) fn step(&mut self, chain: &Chain, goal: &Pose) -> Option<bool> {
        let pose = chain.evaluate(&self.values, &mut self.columns);
        let mut error = pose_error(&pose, goal);
        let (error_m, error_rad) = (error.fixed_rows::<3>(0).norm(), error.fixed_rows::<3>(3).norm());
        self.error = (error_m, error_rad);
        if error_m < WITHIN_M && error_rad < WITHIN_RAD {
            return Some(true);
        }
        // Less damping near the goal: there steps are short anyway, and near singular postures it would stop them.
        let damped = (error.norm() / UNDAMPED_FROM).min(1.0);
        // Far goals are approached in bounded steps: the Jacobian only holds nearby.
        error /= (error_m / 0.3).max(error_rad / 0.8).max(1.0);
        // Joints that stand at a limit and would be pushed beyond it are taken out and the step is computed again.
        for round in 0..3 {
            let mut square = Matrix6::identity() * (DAMPING * DAMPING * damped);
            for column in &self.columns {
                square.ger(1.0, column, column, 1.0);
            }
            let weights = square.cholesky()?.solve(&error);
            let greatest = self.columns.iter().map(|column| column.dot(&weights).abs()).fold(1e-12, f64::max);
            let factor = (MAX_STEP / greatest).min(1.0);
            let pushed = |k: usize| {
                let wanted = self.values[k] + self.columns[k].dot(&weights) * factor;
                (wanted, wanted.clamp(chain.ranges[k].0, chain.ranges[k].1))
            };
            let stuck = |k: usize| matches!(pushed(k), (wanted, next) if next != wanted && next == self.values[k]);
            let out: Vec<usize> = (0..self.values.len()).filter(|k| stuck(*k)).collect();
            if out.is_empty() || round == 2 {
                self.values = (0..self.values.len()).map(|k| pushed(k).1).collect();
                break;
            }
            for k in out {
                self.columns[k].fill(0.0);
            }
        }
        Some(false)
    }
}
