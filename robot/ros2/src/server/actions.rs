//! Actions of joints and gripper: goals that take their time, carried out period by period.

use super::follow::{Next, Way};
use super::goals::{Ended, Goals, Wanted};
use crate::error::Ros2Error;
use crate::link::LinkBuilder;
use crate::messages::{
    FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal, FollowJointTrajectoryResult, GripperCommandGoal,
    GripperCommandResult,
};
use crate::settings::{GripperInterface, JointInterface, Ros2Settings};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, Gripper, JointGroup, Robot};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Group, RobotModel};

/// Codes of `FollowJointTrajectory`.
const INVALID_GOAL: i32 = -1;
const GOAL_TOLERANCE_VIOLATED: i32 = -5;
/// The gap is the one that was asked for, metres.
const SAME_GAP_M: f64 = 0.003;
/// Fingers get so long to begin to move, and so long to end.
const BEGIN: Span = Span(300_000_000);
const END: Span = Span(5_000_000_000);

/// All actions that a robot offers.
#[derive(Default)]
pub(super) struct Actions {
    arm: Option<Follower>,
    head: Option<Follower>,
    gripper: Option<Gripping>,
}

impl Actions {
    /// Offers what the settings name.
    pub(super) fn offer<I: Send + 'static>(
        link: &mut LinkBuilder<I>,
        settings: &Ros2Settings,
    ) -> Result<Self, Ros2Error> {
        let mut actions = Self::default();
        if settings.arm_interface == JointInterface::Action {
            actions.arm = Some(Follower::offer(link, &settings.arm_command)?);
        }
        if settings.head_interface == JointInterface::Action {
            actions.head = Some(Follower::offer(link, &settings.head_command)?);
        }
        if settings.gripper_interface == GripperInterface::Action {
            let goals = Goals::offer(link, &settings.gripper_command, "control_msgs", "GripperCommand")?;
            actions.gripper = Some(Gripping { goals, wanted: None });
        }
        Ok(actions)
    }

    /// One period of all that is under way.
    pub(super) fn advance(&mut self, robot: &mut dyn Robot, model: &RobotModel) {
        let now = robot.clock().now();
        if let Some(arm) = &mut self.arm {
            arm.advance(robot.arm(), &model.arm, now);
        }
        if let Some(head) = &mut self.head {
            head.advance(robot.head(), &model.head, now);
        }
        if let Some(gripper) = &mut self.gripper {
            gripper.advance(robot.gripper(), now);
        }
    }
}

/// A group that follows trajectories.
struct Follower {
    goals: Goals<FollowJointTrajectoryGoal, FollowJointTrajectoryResult, FollowJointTrajectoryFeedback>,
    way: Option<Way>,
}

fn failed(error_code: i32, why: impl Into<String>) -> FollowJointTrajectoryResult {
    FollowJointTrajectoryResult { error_code, error_string: why.into() }
}

impl Follower {
    fn offer<I: Send + 'static>(link: &mut LinkBuilder<I>, name: &str) -> Result<Self, Ros2Error> {
        Ok(Self { goals: Goals::offer(link, name, "control_msgs", "FollowJointTrajectory")?, way: None })
    }

    fn advance(&mut self, part: &mut dyn JointGroup, group: &Group, now: Stamp) {
        while let Some(wanted) = self.goals.find_wanted() {
            match wanted {
                Wanted::Goal(goal) => match begin(part, group, &goal, now) {
                    Ok(way) => self.way = Some(way),
                    Err(why) => self.end(part, group, Ended::Aborted, failed(INVALID_GOAL, why)),
                },
                Wanted::Cancel => self.end(part, group, Ended::Cancelled, FollowJointTrajectoryResult::default()),
            }
        }
        let Some(way) = &self.way else { return };
        let moved = part.state().map(|state| way.next(now, state.positions.values()));
        let sent = match moved {
            Ok(Next::Move(velocities)) => send(part, group, velocities),
            Ok(Next::Reached) => {
                return self.end(part, group, Ended::Done, FollowJointTrajectoryResult::default());
            }
            Ok(Next::Missed(joint, by)) => {
                let why = format!("{} is off by {by:.4} at the end", group.joints[joint]);
                return self.end(part, group, Ended::Aborted, failed(GOAL_TOLERANCE_VIOLATED, why));
            }
            Err(error) => Err(error),
        };
        if let Err(error) = sent {
            self.end(part, group, Ended::Aborted, failed(INVALID_GOAL, error.to_string()));
        }
    }

    /// Stands, and says how it ended.
    fn end(&mut self, part: &mut dyn JointGroup, group: &Group, ended: Ended, result: FollowJointTrajectoryResult) {
        self.way = None;
        if let Err(error) = send(part, group, vec![0.0; group.len()]) {
            tracing::debug!("{error}");
        }
        self.goals.end(ended, result);
    }
}

/// The way of a goal, from where the joints are.
fn begin(
    part: &mut dyn JointGroup,
    group: &Group,
    goal: &FollowJointTrajectoryGoal,
    now: Stamp,
) -> Result<Way, String> {
    let state = part.state().map_err(|error| error.to_string())?;
    let tolerances = goal.goal_tolerance.iter().map(|tolerance| tolerance.position).filter(|position| *position > 0.0);
    let tolerance = tolerances.reduce(f64::min);
    let grace = goal.goal_time_tolerance;
    Way::new(&group.joints, &goal.trajectory, now, state.positions.values(), tolerance, grace)
}

/// Commands velocities within the limits of the joints.
fn send(part: &mut dyn JointGroup, group: &Group, mut velocities: Vec<f64>) -> Result<(), DriverError> {
    for (velocity, limit) in velocities.iter_mut().zip(&group.limits) {
        *velocity = velocity.clamp(-limit.velocity, limit.velocity);
    }
    match JointVelocities::from_values(&group.joints, velocities) {
        Some(velocities) => part.command(&velocities).map(drop),
        None => Ok(()),
    }
}

/// A gripper that takes goals.
struct Gripping {
    goals: Goals<GripperCommandGoal, GripperCommandResult, GripperCommandResult>,
    /// The gap that is wanted, and since when.
    wanted: Option<(f64, Stamp)>,
}

impl Gripping {
    fn advance(&mut self, gripper: &mut dyn Gripper, now: Stamp) {
        while let Some(wanted) = self.goals.find_wanted() {
            match wanted {
                Wanted::Goal(GripperCommandGoal { command }) => {
                    match gripper.command(command.position, command.max_effort) {
                        Ok((gap_m, _)) => self.wanted = Some((gap_m, now)),
                        Err(error) => {
                            tracing::debug!("{error}");
                            self.wanted = None;
                            self.goals.end(Ended::Aborted, GripperCommandResult::default());
                        }
                    }
                }
                Wanted::Cancel => {
                    self.wanted = None;
                    self.goals.end(Ended::Cancelled, GripperCommandResult::default());
                }
            }
        }
        let Some((gap_m, since)) = self.wanted else { return };
        let Ok(state) = gripper.state() else { return };
        let reached_goal = (state.width_m - gap_m).abs() < SAME_GAP_M;
        let stalled = !state.moving && now - since > BEGIN && !reached_goal;
        let is_late = now - since > END;
        if reached_goal || stalled || is_late {
            self.wanted = None;
            let result = GripperCommandResult { position: state.width_m, effort: state.force_n, stalled, reached_goal };
            self.goals.end(if is_late { Ended::Aborted } else { Ended::Done }, result);
        }
    }
}
