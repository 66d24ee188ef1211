//! What every motion of a joint group shares: the box of its joint limits, the rows of its collision limits, braking.

use super::collision_limit::{closing_coefficients, find_row, influence_m};
use super::config::ControllerConfig;
use super::joint_limit::JointEnvelope;
use super::qp::{Qp, QpFailure, QpSolver, Row};
use super::{BrakeReason, ControlOutput, ControlStatus};
use crate::drivers::JointState;
use crate::joints::{JointPositions, JointVelocities};
use crate::model::{CollisionModel, Configuration, Group, Kinematics, LinkId, LinkPoses, Obstacle, PairDistance};
use dsm::time::Stamp;
use nalgebra::DVector;
use std::sync::Arc;

/// A state older than this many steps says nothing about what was commanded since, in steps.
const FORGET_AFTER_STEPS: f64 = 5.0;

/// The limits of one group of joints, and the memory of what was commanded last.
pub(super) struct Safety {
    pub(super) kinematics: Kinematics,
    pub(super) group: Group,
    pub(super) config: ControllerConfig,
    envelopes: Vec<JointEnvelope>,
    collision: Arc<CollisionModel>,
    /// Links that the group moves: only these are kept from obstacles.
    moved_links: Vec<LinkId>,
    /// Links that may touch obstacles.
    touching: Vec<LinkId>,
    rest: Configuration,
    last: Option<(Stamp, DVector<f64>)>,
    solver: QpSolver,
}

/// A group at one moment, with the velocities that its joints allow for the next step.
pub(super) struct Situation {
    pub(super) poses: LinkPoses,
    pub(super) positions: DVector<f64>,
    /// What was commanded last, or is measured.
    pub(super) velocities: DVector<f64>,
    pub(super) lower: DVector<f64>,
    pub(super) upper: DVector<f64>,
}

/// Rows of a situation.
pub(super) struct Rows {
    pub(super) rows: Vec<Row>,
    pub(super) min_distance_m: Option<f64>,
}

impl Safety {
    pub(super) fn new(
        kinematics: &Kinematics,
        collision: &Arc<CollisionModel>,
        group: &Group,
        config: ControllerConfig,
        margin: f64,
    ) -> Self {
        let envelope =
            |k: usize| JointEnvelope::new(&group.limits[k], group.max_accelerations[k], margin, config.velocity_share);
        Self {
            kinematics: kinematics.clone(),
            group: group.clone(),
            envelopes: (0..group.len()).map(envelope).collect(),
            collision: collision.clone(),
            moved_links: kinematics.links_moved_by(group),
            touching: Vec::new(),
            rest: kinematics.zero(),
            last: None,
            solver: QpSolver::new(group.len()),
            config,
        }
    }

    /// Tells where the joints outside the group are; unknown names are left out.
    pub(super) fn set_other_joints(&mut self, positions: &JointPositions) {
        self.rest.apply(positions);
    }

    /// Links that may touch obstacles from now on.
    pub(super) fn set_touching(&mut self, links: &[LinkId]) {
        self.touching = links.to_vec();
    }

    /// Forgets what was commanded last.
    pub(super) fn reset(&mut self) {
        self.last = None;
    }

    /// The group now; an error when the state cannot be used.
    pub(super) fn situation(&self, state: &JointState, dt_s: f64) -> Result<Situation, BrakeReason> {
        if state.positions.names()[..] != self.group.joints[..] || state.velocities.names()[..] != self.group.joints[..]
        {
            return Err(BrakeReason::WrongJoints);
        }
        let finite = state.positions.values().iter().chain(state.velocities.values()).all(|value| value.is_finite());
        if !(finite && dt_s > 0.0 && dt_s.is_finite()) {
            return Err(BrakeReason::NotFinite);
        }
        let mut configuration = self.rest.clone();
        configuration.apply_group(&self.group, state.positions.values());
        let positions = DVector::from_column_slice(state.positions.values());
        let velocities = self.velocities_before(state, dt_s);
        let (mut lower, mut upper) = (positions.clone(), positions.clone());
        for (k, envelope) in self.envelopes.iter().enumerate() {
            (lower[k], upper[k]) = envelope.allowed(positions[k], velocities[k], dt_s);
        }
        let poses = self.kinematics.root_from_links(&configuration);
        Ok(Situation { poses, positions, velocities, lower, upper })
    }

    /// Acceleration counts from the last command: measured velocities lag behind and would slow every start.
    fn velocities_before(&self, state: &JointState, dt_s: f64) -> DVector<f64> {
        match &self.last {
            Some((stamp, velocities)) if (state.stamp - *stamp).as_s().abs() <= FORGET_AFTER_STEPS * dt_s => {
                velocities.clone()
            }
            _ => DVector::from_column_slice(state.velocities.values()),
        }
    }

    /// Collision rows that the box does not already hold.
    pub(super) fn rows(&self, now: &Situation, obstacles: &[Obstacle], dt_s: f64) -> Rows {
        let config = &self.config;
        let reach = |stop_m: f64| influence_m(config, stop_m, config.max_closing_m_per_s, dt_s);
        let mut pairs = self.collision.self_distances(&now.poses, reach(config.self_stop_m));
        let kept: Vec<LinkId> = self.moved_links.iter().copied().filter(|link| !self.touching.contains(link)).collect();
        // An empty list would mean every link.
        if !kept.is_empty() && !obstacles.is_empty() {
            let reach_m = reach(config.obstacle_stop_m);
            let found = self.collision.obstacle_distances(&now.poses, obstacles, &kept, reach_m);
            pairs.extend(nearest_of_each_link(found));
        }
        let mut found = Rows { rows: Vec::new(), min_distance_m: None };
        for pair in &pairs {
            let coefficients = closing_coefficients(&self.kinematics, &now.poses, &self.group, pair);
            // A pair that the group does not move is not the group's to keep apart.
            if coefficients.amax() < 1e-9 {
                continue;
            }
            found.min_distance_m = Some(found.min_distance_m.map_or(pair.distance_m, |m| m.min(pair.distance_m)));
            found.rows.extend(find_row(config, coefficients, pair, obstacles, (&now.lower, &now.upper), dt_s));
        }
        found
    }

    /// Solves for the group's velocities and remembers them; brakes when there is no answer.
    pub(super) fn finish(
        &mut self,
        state: &JointState,
        now: Situation,
        (hessian, gradient): (nalgebra::DMatrix<f64>, DVector<f64>),
        rows: Rows,
        dt_s: f64,
    ) -> ControlOutput {
        let qp = Qp { hessian, gradient, lower: now.lower, upper: now.upper, rows: rows.rows };
        let (velocities, status) = match self.solver.solve(&qp) {
            Ok(velocities) => (velocities, ControlStatus::Tracking),
            Err(failure) => {
                let reason = match failure {
                    QpFailure::Infeasible => BrakeReason::Infeasible,
                    QpFailure::TooManyRows => BrakeReason::TooManyRows,
                    QpFailure::Numerical => BrakeReason::Solver,
                };
                (self.slower(&now.velocities, dt_s), ControlStatus::Braking { reason })
            }
        };
        let active_rows = qp.rows.iter().filter(|row| row.coefficients.dot(&velocities) > row.bound - 1e-4).count();
        self.remember(state.stamp, velocities.clone());
        ControlOutput {
            velocities: self.named(velocities),
            status,
            error_m: f64::NAN,
            error_rad: f64::NAN,
            min_distance_m: rows.min_distance_m,
            active_rows,
            rows: qp.rows.len(),
        }
    }

    /// Brakes every joint as hard as its acceleration limit allows.
    pub(super) fn brake(&mut self, state: &JointState, reason: BrakeReason, dt_s: f64) -> ControlOutput {
        let before = match &self.last {
            Some((_, velocities)) => velocities.clone(),
            None if state.velocities.values().len() == self.group.len() => {
                DVector::from_column_slice(state.velocities.values()).map(|v| if v.is_finite() { v } else { 0.0 })
            }
            None => DVector::zeros(self.group.len()),
        };
        let velocities = self.slower(&before, if dt_s.is_finite() { dt_s } else { 0.0 });
        self.remember(state.stamp, velocities.clone());
        ControlOutput {
            velocities: self.named(velocities),
            status: ControlStatus::Braking { reason },
            error_m: f64::NAN,
            error_rad: f64::NAN,
            min_distance_m: None,
            active_rows: 0,
            rows: 0,
        }
    }

    fn slower(&self, velocities: &DVector<f64>, dt_s: f64) -> DVector<f64> {
        DVector::from_fn(velocities.len(), |k, _| {
            let step = self.envelopes[k].acceleration * dt_s;
            velocities[k] - velocities[k].clamp(-step, step)
        })
    }

    fn remember(&mut self, stamp: Stamp, velocities: DVector<f64>) {
        self.last = Some((stamp, velocities));
    }

    fn named(&self, velocities: DVector<f64>) -> JointVelocities {
        let mut named = JointVelocities::zeros(&self.group.joints);
        named.values_mut().copy_from_slice(velocities.as_slice());
        named
    }
}

/// The obstacles nearest to each link. A cloud of points gives a link dozens of them, which press the same way; those
/// farther off get their turn in the next tick, when they are the nearest.
fn nearest_of_each_link(mut pairs: Vec<PairDistance>) -> Vec<PairDistance> {
    const KEPT: usize = 5;
    pairs.sort_by(|a, b| a.link.cmp(&b.link).then(a.distance_m.total_cmp(&b.distance_m)));
    let mut kept: Vec<PairDistance> = Vec::new();
    let mut count = 0;
    for pair in pairs {
        count = if kept.last().is_some_and(|last| last.link == pair.link) { count + 1 } else { 1 };
        if count <= KEPT {
            kept.push(pair);
        }
    }
    kept
}
