//! What every motion of a joint group shares: the box of its joint limits, the rows of its collision limits, braking.

use super::base_limit::base_envelopes;
use super::columns::Columns;
use super::config::ControllerConfig;
use super::damper::Moment;
use super::joint_limit::JointEnvelope;
use super::qp::{Qp, QpFailure, QpSolver, Row, SolvedBy, solve_exactly};
use super::rows::{Ahead, RowSources, Rows, find_rows};
use super::{BrakeReason, ControlOutput, ControlStatus};
use crate::drivers::{JointState, Twist};
use crate::joints::{JointPositions, JointVelocities};
use crate::model::settings::BaseSettings;
use crate::model::{CollisionModel, Configuration, Group, Kinematics, LinkId, LinkPoses, Obstacle};
use dsm::Pose;
use dsm::time::Stamp;
use nalgebra::{DMatrix, DVector, Vector3};
use std::sync::Arc;

/// A state older than this many steps says nothing about what was commanded since, in steps.
const FORGET_AFTER_STEPS: f64 = 5.0;

/// Where on the way of a brake distances are looked at, as parts of the whole way.
const SHARES_AHEAD: [f64; 2] = [0.5, 1.0];

/// The limits of one group of joints, and of the base where it takes part, and the memory of what was commanded last.
pub(super) struct Safety {
    pub(super) kinematics: Kinematics,
    pub(super) group: Group,
    pub(super) config: ControllerConfig,
    pub(super) columns: Columns,
    /// By variable; those of the base come last.
    pub(super) envelopes: Vec<JointEnvelope>,
    pub(super) collision: Arc<CollisionModel>,
    /// Links that move: only these are kept from obstacles.
    moved_links: Vec<LinkId>,
    /// Those of them that must not touch obstacles.
    kept_links: Vec<LinkId>,
    pub(super) rest: Configuration,
    last: Option<(Stamp, DVector<f64>)>,
    solver: QpSolver,
}

/// A robot at one moment, with the velocities that its limits allow for the next step.
pub(super) struct Situation {
    pub(super) poses: LinkPoses,
    /// Of the group's joints.
    pub(super) positions: DVector<f64>,
    /// What was commanded last, or is measured; by variable.
    pub(super) velocities: DVector<f64>,
    pub(super) lower: DVector<f64>,
    pub(super) upper: DVector<f64>,
}

impl Safety {
    pub(super) fn new(
        kinematics: &Kinematics,
        collision: &Arc<CollisionModel>,
        group: &Group,
        base: Option<&BaseSettings>,
        config: ControllerConfig,
        margin: f64,
    ) -> Self {
        let envelope =
            |k: usize| JointEnvelope::new(&group.limits[k], group.max_accelerations[k], margin, config.velocity_share);
        let mut envelopes: Vec<JointEnvelope> = (0..group.len()).map(envelope).collect();
        envelopes.extend(base.into_iter().flat_map(|base| base_envelopes(base, config.velocity_share)));
        let columns = Columns::new(kinematics, group, base.is_some());
        // A base that drives takes every link along.
        let moved_links = match base {
            Some(_) => (0..kinematics.links.len()).map(LinkId).collect(),
            None => kinematics.links_moved_by(group),
        };
        Self {
            kinematics: kinematics.clone(),
            group: group.clone(),
            envelopes,
            collision: collision.clone(),
            kept_links: moved_links.clone(),
            moved_links,
            rest: kinematics.zero(),
            last: None,
            solver: QpSolver::new(columns.len()),
            columns,
            config,
        }
    }

    /// Tells where the joints outside the group are; unknown names are left out.
    pub(super) fn set_other_joints(&mut self, positions: &JointPositions) {
        self.rest.apply(positions);
    }

    /// Links that may touch obstacles from now on.
    pub(super) fn set_touching(&mut self, links: &[LinkId]) {
        self.kept_links = self.moved_links.iter().copied().filter(|link| !links.contains(link)).collect();
    }

    /// Forgets what was commanded last.
    pub(super) fn reset(&mut self) {
        self.last = None;
    }

    /// The robot now; an error when the state cannot be used.
    pub(super) fn situation(&self, state: &JointState, base: Twist, dt_s: f64) -> Result<Situation, BrakeReason> {
        if state.positions.names()[..] != self.group.joints[..] || state.velocities.names()[..] != self.group.joints[..]
        {
            return Err(BrakeReason::WrongJoints);
        }
        let values = state.positions.values().iter().chain(state.velocities.values());
        let finite = values.chain([&base.forward_m_per_s, &base.turn_rad_per_s]).all(|value| value.is_finite());
        if !(finite && dt_s > 0.0 && dt_s.is_finite()) {
            return Err(BrakeReason::NotFinite);
        }
        let mut configuration = self.rest.clone();
        configuration.apply_group(&self.group, state.positions.values());
        let positions = DVector::from_column_slice(state.positions.values());
        let velocities = self.velocities_before(state, base, dt_s);
        let (mut lower, mut upper) = (velocities.clone(), velocities.clone());
        for (k, envelope) in self.envelopes.iter().enumerate() {
            // The base has no position of its own: its limits lie nowhere.
            let position = positions.get(k).copied().unwrap_or(0.0);
            (lower[k], upper[k]) = envelope.allowed(position, velocities[k], dt_s);
        }
        let poses = self.kinematics.root_from_links(&configuration);
        Ok(Situation { poses, positions, velocities, lower, upper })
    }

    /// Acceleration counts from the last command: measured velocities lag behind and would slow every start.
    fn velocities_before(&self, state: &JointState, base: Twist, dt_s: f64) -> DVector<f64> {
        match &self.last {
            Some((stamp, velocities)) if (state.stamp - *stamp).as_s().abs() <= FORGET_AFTER_STEPS * dt_s => {
                velocities.clone()
            }
            _ => {
                let base = [base.forward_m_per_s, base.turn_rad_per_s];
                let all = state.velocities.values().iter().chain(&base).copied();
                DVector::from_iterator(self.columns.len(), all.take(self.columns.len()))
            }
        }
    }

    /// Collision rows that the box does not already hold.
    pub(super) fn rows(&self, now: &Situation, obstacles: &[Obstacle], dt_s: f64) -> Rows {
        let joints = self.group.len();
        let braked = DVector::from_fn(now.velocities.len(), |k, _| {
            let stops_in_s = self.longest_s(k < joints, &|k| now.velocities[k].abs());
            let left = if stops_in_s > dt_s { 1.0 - dt_s / stops_in_s } else { 0.0 };
            (now.velocities[k] * left).clamp(now.lower[k], now.upper[k])
        });
        let greatest = |k: usize| now.lower[k].abs().max(now.upper[k].abs());
        let braking_times_s: Vec<f64> =
            (0..self.columns.len()).map(|k| self.longest_s(k < joints, &greatest)).collect();
        let sources = RowSources {
            config: &self.config,
            columns: &self.columns,
            kinematics: &self.kinematics,
            collision: &self.collision,
            poses: &now.poses,
            ahead: self.ways_ahead(now, dt_s),
            kept: &self.kept_links,
            obstacles,
        };
        let moment = Moment {
            dt_s,
            lower: &now.lower,
            upper: &now.upper,
            velocities: &now.velocities,
            braked: &braked,
            braking_times_s: &braking_times_s,
        };
        find_rows(&sources, &moment)
    }

    /// How long the slowest of the joints, or of the base's variables, takes to stop from its speed.
    fn longest_s(&self, of_joints: bool, speed: &dyn Fn(usize) -> f64) -> f64 {
        let joints = self.group.len();
        let range = if of_joints { 0..joints } else { joints..self.columns.len() };
        range.map(|k| speed(k) / self.envelopes[k].acceleration).fold(0.0, f64::max)
    }

    /// Poses on the way of a brake that begins now.
    fn ways_ahead(&self, now: &Situation, dt_s: f64) -> Vec<Ahead> {
        let speed = |k: usize| now.velocities[k].abs();
        let times_s = [self.longest_s(true, &speed), self.longest_s(false, &speed)];
        let delta = DVector::from_fn(now.velocities.len(), |k, _| {
            0.5 * now.velocities[k] * times_s[usize::from(k >= self.group.len())]
        });
        let shares = if times_s[0].max(times_s[1]) > dt_s { &SHARES_AHEAD[..] } else { &[] };
        shares.iter().map(|share| self.ahead(now, &delta * *share, *share)).collect()
    }

    /// The robot after `delta`, which is a share of the way of the brake.
    fn ahead(&self, now: &Situation, delta: DVector<f64>, share: f64) -> Ahead {
        let mut configuration = self.rest.clone();
        let positions = &now.positions + delta.rows(0, now.positions.len());
        configuration.apply_group(&self.group, positions.as_slice());
        let poses = self.kinematics.root_from_links(&configuration);
        match self.columns.find_base() {
            None => Ahead { poses, base: Pose::identity(), delta, share },
            Some(column) => {
                let half = Pose::rotation(Vector3::z() * (0.5 * delta[column + 1]));
                let base = half * Pose::translation(delta[column], 0.0, 0.0) * half;
                Ahead { poses: poses.seen_from(&base), base, delta, share }
            }
        }
    }

    /// Solves for the velocities and remembers them; brakes when there is no answer.
    pub(super) fn finish(
        &mut self,
        state: &JointState,
        now: Situation,
        (hessian, gradient): (DMatrix<f64>, DVector<f64>),
        found: Rows,
        dt_s: f64,
    ) -> ControlOutput {
        let eased: Vec<(f64, bool)> = found.dampers.iter().map(|damper| (damper.eased, damper.retreats)).collect();
        let rows: Vec<Row> = found.dampers.into_iter().map(|damper| damper.row).collect();
        let mut qp = Qp { hessian, gradient, lower: now.lower, upper: now.upper, rows };
        let mut answer = solve_exactly(&qp);
        // Squeezed from several sides there may be no way out at the speed wished for, or no stop in time.
        for all in [false, true] {
            if answer.is_err() {
                for (row, (eased, retreats)) in qp.rows.iter_mut().zip(&eased) {
                    row.bound = if all || *retreats { *eased } else { row.bound };
                }
                answer = solve_exactly(&qp);
            }
        }
        if answer.is_err() {
            answer = self.solver.solve(&qp);
        }
        let (velocities, status, solved_by) = match answer {
            Ok((velocities, by)) => (velocities, ControlStatus::Tracking, Some(by)),
            Err(failure) => {
                let reason = match failure {
                    QpFailure::Infeasible => BrakeReason::Infeasible,
                    QpFailure::TooManyRows => BrakeReason::TooManyRows,
                    QpFailure::Numerical => BrakeReason::Solver,
                };
                (self.slower(&now.velocities, dt_s), ControlStatus::Braking { reason }, None)
            }
        };
        let active_rows = qp.rows.iter().filter(|row| row.coefficients.dot(&velocities) > row.bound - 1e-4).count();
        let mut output = self.output(velocities, status, state.stamp);
        output.min_distance_m = found.min_distance_m;
        (output.active_rows, output.rows, output.solved_by) = (active_rows, qp.rows.len(), solved_by);
        output
    }

    /// Brakes every variable as hard as its acceleration limit allows.
    pub(super) fn brake(&mut self, state: &JointState, base: Twist, reason: BrakeReason, dt_s: f64) -> ControlOutput {
        let before = match &self.last {
            Some((_, velocities)) => velocities.clone(),
            None => {
                let joints = state.velocities.values();
                let known = joints.len() == self.group.len();
                let base = [base.forward_m_per_s, base.turn_rad_per_s];
                let value = |k: usize| match k.checked_sub(self.group.len()) {
                    Some(of_base) => base[of_base],
                    None => {
                        if known {
                            joints[k]
                        } else {
                            0.0
                        }
                    }
                };
                DVector::from_fn(self.columns.len(), |k, _| value(k)).map(|v| if v.is_finite() { v } else { 0.0 })
            }
        };
        let velocities = self.slower(&before, if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 });
        self.output(velocities, ControlStatus::Braking { reason }, state.stamp)
    }

    fn slower(&self, velocities: &DVector<f64>, dt_s: f64) -> DVector<f64> {
        DVector::from_fn(velocities.len(), |k, _| {
            let step = self.envelopes[k].acceleration * dt_s;
            velocities[k] - velocities[k].clamp(-step, step)
        })
    }

    /// Names the velocities and remembers them.
    fn output(&mut self, all: DVector<f64>, status: ControlStatus, stamp: Stamp) -> ControlOutput {
        let mut velocities = JointVelocities::zeros(&self.group.joints);
        velocities.values_mut().copy_from_slice(&all.as_slice()[..self.group.len()]);
        let base = self
            .columns
            .find_base()
            .map_or_else(Twist::default, |base| Twist { forward_m_per_s: all[base], turn_rad_per_s: all[base + 1] });
        self.last = Some((stamp, all));
        ControlOutput {
            velocities,
            base,
            status,
            error_m: f64::NAN,
            error_rad: f64::NAN,
            min_distance_m: None,
            active_rows: 0,
            rows: 0,
            solved_by: None::<SolvedBy>,
        }
    }
}
