//! Following a path with a differential drive.

use super::costmap::Costmap;
use super::grid::{bearing, wrap_angle};
use super::live::SpeedLimits;
use super::planner::{Path, Pose2};
use crate::drivers::Twist;
use dsm::Pose;
use dsm::map::CellState;
use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of [`Follower`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FollowerConfig {
    /// Highest speed, m/s. Default 0.6, range 0.05 to 3.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub max_speed_m_per_s: f64,
    /// Highest turning speed, rad/s. Default 1.2, range 0.1 to 6.
    #[schemars(range(min = 0.1, max = 6.0))]
    pub max_turn_rad_per_s: f64,
    /// Acceleration and braking, m/s^2. Default 0.6, range 0.05 to 5.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub max_acceleration_m_per_s2: f64,
    /// Turning acceleration and braking, rad/s^2. Default 2, range 0.1 to 20.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub max_turn_acceleration_rad_per_s2: f64,
    /// Distance along the path to the point that is steered to, metres. Default 0.4, range 0.1 to 2.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub look_ahead_m: f64,
    /// With a larger heading error the base turns in place first, radians. Default 0.6, range 0.1 to 3.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub turn_in_place_rad: f64,
    /// Clearance beyond the lethal one below which the base slows, metres. Default 0.25, range 0 to 2.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub slow_clearance_m: f64,
    /// Share of the highest speed at the lethal clearance. Default 0.4, range 0.05 to 1.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub slowest_share: f64,
    /// Arrived within this distance, metres. Default 0.05, range 0.005 to 0.5.
    #[schemars(range(min = 0.005, max = 0.5))]
    pub position_tolerance_m: f64,
    /// Arrived within this heading error, radians. Default 0.05, range 0.005 to 0.5.
    #[schemars(range(min = 0.005, max = 0.5))]
    pub yaw_tolerance_rad: f64,
    /// Farther than this from the path it has been lost, metres. Default 0.5, range 0.1 to 3.
    #[schemars(range(min = 0.1, max = 3.0))]
    pub off_path_m: f64,
    /// Commanded motion without measured motion for so long is a stall, seconds. Default 1.5, range 0.2 to 20.
    #[schemars(range(min = 0.2, max = 20.0))]
    pub stall_s: f64,
}

impl Default for FollowerConfig {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 0.6,
            max_turn_rad_per_s: 1.2,
            max_acceleration_m_per_s2: 0.6,
            max_turn_acceleration_rad_per_s2: 2.0,
            look_ahead_m: 0.4,
            turn_in_place_rad: 0.6,
            slow_clearance_m: 0.25,
            slowest_share: 0.4,
            position_tolerance_m: 0.05,
            yaw_tolerance_rad: 0.05,
            off_path_m: 0.5,
            stall_s: 1.5,
        }
    }
}

/// Why the way is blocked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BlockReason {
    /// The costmap shows an obstacle on the path ahead.
    Obstacle {
        /// Where, world frame.
        at: Point2<f64>,
    },
    /// The base does not move although commanded: it touches something that the map does not show.
    Stalled,
}

/// What following a path comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FollowStatus {
    /// On the way.
    Following {
        /// Length of the rest of the path, metres.
        remaining_m: f64,
    },
    /// At the goal with the heading asked for, and at rest.
    Arrived,
    /// The base brakes; plan anew.
    Blocked {
        /// Why.
        reason: BlockReason,
    },
    /// The base brakes, far from the path; plan anew.
    OffPath {
        /// Distance to the path, metres.
        distance_m: f64,
    },
}

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowOutput {
    /// Command for the base.
    pub twist: Twist,
    /// State of the undertaking.
    pub status: FollowStatus,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    TurnToPath,
    Drive,
    AlignAtGoal,
    Arrived,
}

/// Pure pursuit that turns in place at sharp corners, slows near obstacles, keeps within accelerations, brakes for its
/// goal (v <= sqrt(2 a d)) and takes its final heading there.
#[derive(Clone, Debug)]
pub struct Follower {
    config: FollowerConfig,
    path: Path,
    phase: Phase,
    leg: usize,
    command: Twist,
    stalled_s: f64,
    held_s: f64,
}

impl Follower {
    /// A follower at rest at the beginning of `path` (which has at least one point).
    pub fn new(config: FollowerConfig, path: Path) -> Self {
        Self { config, path, phase: Phase::TurnToPath, leg: 0, command: Twist::default(), stalled_s: 0.0, held_s: 0.0 }
    }

    /// Takes another path without stopping.
    pub fn set_path(&mut self, path: Path) {
        self.path = path;
        self.leg = 0;
        self.phase = if self.command.forward_m_per_s > 0.05 { Phase::Drive } else { Phase::TurnToPath };
    }

    /// The path that is followed.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Says what was sent of the last command, when something else held the base back: the next one goes on from there.
    pub fn note_sent(&mut self, sent: Twist) {
        self.command = sent;
    }

    /// The next command, `dt_s` after the last one. `measured` is the velocity of the base, `costmap` the newest one,
    /// `limits` what the cameras showed a moment ago.
    pub fn tick(
        &mut self,
        world_from_base: &Pose,
        measured: Twist,
        costmap: &Costmap,
        limits: &SpeedLimits,
        dt_s: f64,
    ) -> FollowOutput {
        let pose = Pose2::from_pose(world_from_base);
        let Some(&goal) = self.path.points.last() else {
            return self.output(Twist::default(), dt_s, FollowStatus::Arrived);
        };
        let (on_path, off_path_m) = self.project(&pose.position);
        let remaining_m = self.remaining_m(&on_path);
        let goal_distance_m = (goal - pose.position).norm();
        // Stages: judge, choose a phase, command.
        if self.phase != Phase::Arrived {
            let block = self.find_block(&pose, &on_path, measured, costmap, dt_s);
            if let Some(reason) = block.or_else(|| self.find_hold_up(limits, dt_s)) {
                return self.output(Twist::default(), dt_s, FollowStatus::Blocked { reason });
            }
            if off_path_m > self.config.off_path_m {
                return self.output(Twist::default(), dt_s, FollowStatus::OffPath { distance_m: off_path_m });
            }
        }
        self.change_phase(&pose, measured, remaining_m, goal_distance_m);
        let wanted = match self.phase {
            Phase::Arrived => Twist::default(),
            Phase::AlignAtGoal => self.turn(self.goal_yaw_error(&pose)),
            Phase::TurnToPath => {
                let target = self.find_target(&pose, &on_path, costmap);
                self.turn(wrap_angle(bearing(&pose.position, &target) - pose.yaw_rad))
            }
            Phase::Drive => {
                let target = self.find_target(&pose, &on_path, costmap);
                self.drive(&pose, &target, remaining_m.max(goal_distance_m), goal_distance_m, costmap, limits)
            }
        };
        let status = match self.phase {
            Phase::Arrived => FollowStatus::Arrived,
            _ => FollowStatus::Following { remaining_m: remaining_m.max(goal_distance_m) },
        };
        self.output(wanted, dt_s, status)
    }

    /// Sends what the accelerations allow on the way to `wanted`.
    fn output(&mut self, wanted: Twist, dt_s: f64, status: FollowStatus) -> FollowOutput {
        let toward = |from: f64, to: f64, step: f64| from + (to - from).clamp(-step, step);
        let c = &self.config;
        self.command = Twist {
            forward_m_per_s: toward(
                self.command.forward_m_per_s,
                wanted.forward_m_per_s,
                c.max_acceleration_m_per_s2 * dt_s,
            ),
            turn_rad_per_s: toward(
                self.command.turn_rad_per_s,
                wanted.turn_rad_per_s,
                c.max_turn_acceleration_rad_per_s2 * dt_s,
            ),
        };
        FollowOutput { twist: self.command, status }
    }

    /// The nearest point on this leg of the path or one of the next metre, and its distance. Progress never goes back.
    fn project(&mut self, position: &Point2<f64>) -> (Point2<f64>, f64) {
        const WINDOW_M: f64 = 1.0;
        let points = &self.path.points;
        let mut best = (points[points.len() - 1], f64::INFINITY, self.leg);
        let mut ahead = 0.0;
        for leg in self.leg..points.len().saturating_sub(1) {
            let (a, b) = (points[leg], points[leg + 1]);
            let along = (b - a) * ((position - a).dot(&(b - a)) / (b - a).norm_squared().max(1e-12)).clamp(0.0, 1.0);
            let distance = (a + along - position).norm();
            if distance < best.1 - 1e-9 {
                best = (a + along, distance, leg);
            }
            ahead += (b - a).norm();
            if ahead > WINDOW_M + (points[self.leg + 1] - points[self.leg]).norm() {
                break;
            }
        }
        if best.1.is_infinite() {
            best.1 = (best.0 - position).norm();
        }
        self.leg = best.2;
        (best.0, best.1)
    }

    fn remaining_m(&self, on_path: &Point2<f64>) -> f64 {
        let rest = &self.path.points[(self.leg + 1).min(self.path.points.len() - 1)..];
        (rest[0] - on_path).norm() + rest.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum::<f64>()
    }

    /// The point of the path `distance_m` after `on_path`.
    fn point_ahead(&self, on_path: &Point2<f64>, distance_m: f64) -> Point2<f64> {
        let mut at = *on_path;
        let mut left = distance_m;
        for next in &self.path.points[(self.leg + 1).min(self.path.points.len() - 1)..] {
            let leg = (next - at).norm();
            if leg >= left {
                return at + (next - at) * (left / leg.max(1e-12));
            }
            left -= leg;
            at = *next;
        }
        at
    }

    /// The point to steer to: up to the look-ahead along the path, nearer when the straight way there leaves the floor,
    /// so that corners are not cut.
    fn find_target(&self, pose: &Pose2, on_path: &Point2<f64>, costmap: &Costmap) -> Point2<f64> {
        const NEAREST_SHARE: f64 = 0.3;
        let mut share = 1.0;
        loop {
            let target = self.point_ahead(on_path, share * self.config.look_ahead_m);
            if share <= NEAREST_SHARE || costmap.find_segment_cost(&pose.position, &target).is_some() {
                return target;
            }
            share -= 0.1;
        }
    }

    fn goal_yaw_error(&self, pose: &Pose2) -> f64 {
        self.path.goal_yaw_rad.map_or(0.0, |yaw| wrap_angle(yaw - pose.yaw_rad))
    }

    fn change_phase(&mut self, pose: &Pose2, measured: Twist, remaining_m: f64, goal_distance_m: f64) {
        let c = &self.config;
        let at_rest = measured.forward_m_per_s.abs() < 0.02 && measured.turn_rad_per_s.abs() < 0.03;
        let near_end = remaining_m < 2.0 * c.position_tolerance_m;
        match self.phase {
            Phase::TurnToPath | Phase::Drive if near_end && goal_distance_m < 0.5 * c.position_tolerance_m => {
                self.phase = Phase::AlignAtGoal;
            }
            Phase::AlignAtGoal if goal_distance_m > c.position_tolerance_m => self.phase = Phase::TurnToPath,
            Phase::AlignAtGoal if at_rest && self.goal_yaw_error(pose).abs() < 0.6 * c.yaw_tolerance_rad => {
                self.phase = Phase::Arrived;
            }
            _ => {}
        }
    }

    /// Turning in place by an error; leaves [`Phase::TurnToPath`] when done.
    fn turn(&mut self, error_rad: f64) -> Twist {
        const GAIN_PER_S: f64 = 3.0;
        const DONE_RAD: f64 = 0.12;
        let c = &self.config;
        if self.phase == Phase::TurnToPath && error_rad.abs() < DONE_RAD {
            self.phase = Phase::Drive;
        }
        let braking = (2.0 * 0.8 * c.max_turn_acceleration_rad_per_s2 * error_rad.abs()).sqrt();
        let speed = (GAIN_PER_S * error_rad.abs()).min(braking).min(c.max_turn_rad_per_s);
        Twist { forward_m_per_s: 0.0, turn_rad_per_s: speed.copysign(error_rad) }
    }

    fn drive(
        &mut self,
        pose: &Pose2,
        target: &Point2<f64>,
        remaining_m: f64,
        goal_distance_m: f64,
        costmap: &Costmap,
        limits: &SpeedLimits,
    ) -> Twist {
        const REVERSE_WITHIN_M: f64 = 0.25;
        let c = &self.config;
        let mut error = wrap_angle(bearing(&pose.position, target) - pose.yaw_rad);
        let mut direction = 1.0;
        // A goal that was just overshot is reached backwards.
        if goal_distance_m < REVERSE_WITHIN_M && error.abs() > 0.65 * std::f64::consts::PI {
            direction = -1.0;
            error = wrap_angle(error + std::f64::consts::PI);
        }
        if error.abs() > c.turn_in_place_rad {
            self.phase = Phase::TurnToPath;
            return self.turn(wrap_angle(bearing(&pose.position, target) - pose.yaw_rad));
        }
        let distance = (target - pose.position).norm().max(0.05);
        let curvature = 2.0 * error.sin() / distance;
        let spare = (costmap.clearance_at_m(&pose.position) - costmap.lethal_m()).max(0.0);
        let openness = (spare / c.slow_clearance_m.max(1e-9)).min(1.0);
        let share = c.slowest_share + (1.0 - c.slowest_share) * openness;
        let speed = (c.max_speed_m_per_s * share)
            .min((2.0 * 0.8 * c.max_acceleration_m_per_s2 * remaining_m).sqrt())
            .min(c.max_turn_rad_per_s / curvature.abs().max(1e-6))
            .min(c.max_speed_m_per_s * (1.0 - 0.8 * error.abs() / c.turn_in_place_rad).max(0.15));
        let limit = if direction > 0.0 { limits.forward_m_per_s } else { limits.backward_m_per_s };
        if limit < speed && error.abs() > 0.1 {
            // What is ahead may be beside the way: turning clears it.
            let turn = self.turn(error).turn_rad_per_s;
            return Twist { forward_m_per_s: direction * limit, turn_rad_per_s: turn };
        }
        let speed = speed.min(limit);
        // Backwards the sign of the curvature holds for the turned heading.
        Twist { forward_m_per_s: direction * speed, turn_rad_per_s: speed * curvature }
    }

    /// What the cameras show right ahead, when it has kept the base standing for a moment.
    fn find_hold_up(&mut self, limits: &SpeedLimits, dt_s: f64) -> Option<BlockReason> {
        const STANDS_M_PER_S: f64 = 0.03;
        const AFTER_S: f64 = 0.4;
        let stands = self.phase == Phase::Drive
            && limits.forward_m_per_s < STANDS_M_PER_S
            && (0.0..STANDS_M_PER_S).contains(&self.command.forward_m_per_s)
            && self.command.turn_rad_per_s.abs() < 0.1;
        self.held_s = if stands { self.held_s + dt_s } else { 0.0 };
        let at = limits.ahead.filter(|_| self.held_s > AFTER_S)?;
        self.held_s = 0.0;
        Some(BlockReason::Obstacle { at })
    }

    fn find_block(
        &mut self,
        pose: &Pose2,
        on_path: &Point2<f64>,
        measured: Twist,
        costmap: &Costmap,
        dt_s: f64,
    ) -> Option<BlockReason> {
        let c = &self.config;
        // An arm that sticks out beside things is moved slowly: a slow command stalls as well.
        let pushes = self.command.forward_m_per_s.abs() > 0.03
            && measured.forward_m_per_s.abs() < 0.15 * self.command.forward_m_per_s.abs()
            || self.command.turn_rad_per_s.abs() > 0.06
                && measured.turn_rad_per_s.abs() < 0.15 * self.command.turn_rad_per_s.abs();
        self.stalled_s = if pushes { self.stalled_s + dt_s } else { 0.0 };
        if self.stalled_s > c.stall_s {
            return Some(BlockReason::Stalled);
        }
        // An obstacle counts when it is clearly inside the footprint's way, and is not one that the base is leaving.
        const STEP_M: f64 = 0.04;
        let speed = self.command.forward_m_per_s;
        let watched = 0.35 + speed * speed / (2.0 * c.max_acceleration_m_per_s2);
        let here = costmap.clearance_at_m(&pose.position);
        let steps = (watched.min(self.remaining_m(on_path)) / STEP_M).ceil() as usize;
        (0..=steps).find_map(|step| {
            let at = self.point_ahead(on_path, step as f64 * STEP_M);
            let cell = costmap.grid().find_cell(&at)?;
            let clearance = costmap.clearance_m(cell);
            let hits = costmap.state(cell) == CellState::Occupied
                || clearance < costmap.footprint_radius_m() - costmap.grid().resolution_m;
            (hits && clearance < here - 0.02).then_some(BlockReason::Obstacle { at })
        })
    }
}

#[cfg(test)]
mod tests;
