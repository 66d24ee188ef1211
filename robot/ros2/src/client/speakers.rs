//! How commands to joints and gripper go out: by topics, or as goals of actions.

use crate::error::Ros2Error;
use crate::link::{Delivery, LinkBuilder, Speaker};
use crate::messages::{
    Duration, Float64MultiArray, FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal, FollowJointTrajectoryResult,
    GripperCommand, GripperCommandGoal, GripperCommandResult, Header, JointTrajectory, JointTrajectoryPoint,
    MultiArrayLayout,
};
use crate::settings::{GripperInterface, JointInterface, Ros2Settings};
use dsm::time::{Span, Stamp};
use dsm_robot::joints::JointVelocities;
use ros2_client::ActionClient;

/// Commands kept for sending again.
pub(super) const COMMANDS: Delivery = Delivery::Reliable { depth: 64 };

type Follow = ActionClient<FollowJointTrajectoryGoal, FollowJointTrajectoryResult, FollowJointTrajectoryFeedback>;
type Grip = ActionClient<GripperCommandGoal, GripperCommandResult, GripperCommandResult>;

/// What commands to joints go out by.
#[allow(clippy::large_enum_variant, reason = "there are two")]
pub(super) enum JointSpeaker {
    Velocities(Speaker<Float64MultiArray>),
    Trajectory(Speaker<JointTrajectory>),
    Action(Box<Goals>),
}

/// Goals of one point, one after the other.
pub(super) struct Goals {
    client: Follow,
    name: String,
    every: Span,
    /// When the last goal went out, and whether it was one to move.
    last: Option<(Stamp, bool)>,
}

impl JointSpeaker {
    pub(super) fn new<I: Send + 'static>(
        link: &mut LinkBuilder<I>,
        topic: &str,
        interface: JointInterface,
        settings: &Ros2Settings,
    ) -> Result<Self, Ros2Error> {
        Ok(match interface {
            JointInterface::Velocities => Self::Velocities(link.speak(topic, COMMANDS)?),
            JointInterface::Trajectory => Self::Trajectory(link.speak(topic, COMMANDS)?),
            JointInterface::Action => Self::Action(Box::new(Goals {
                client: link.request(topic, "control_msgs", "FollowJointTrajectory")?,
                name: topic.to_owned(),
                every: Span::from_s(1.0 / settings.action_rate_hz),
                last: None,
            })),
        })
    }

    /// Says velocities at joints that stand at `positions`.
    pub(super) fn say(
        &mut self,
        now: Stamp,
        velocities: &JointVelocities,
        positions: &[f64],
        ahead_s: f64,
    ) -> Result<(), String> {
        match self {
            Self::Velocities(speaker) => {
                let layout = MultiArrayLayout::default();
                speaker.say(Float64MultiArray { layout, data: velocities.values().to_vec() })
            }
            Self::Trajectory(speaker) => speaker.say(trajectory(velocities, positions, ahead_s)),
            Self::Action(goals) => goals.say(now, velocities, positions, ahead_s),
        }
    }

    pub(super) fn forget_sent(&mut self) {
        match self {
            Self::Velocities(speaker) => speaker.forget_sent(),
            Self::Trajectory(speaker) => speaker.forget_sent(),
            Self::Action(_) => {}
        }
    }

    pub(super) fn sent(&self) -> (&str, u64) {
        match self {
            Self::Velocities(speaker) => (speaker.topic(), speaker.sent()),
            Self::Trajectory(speaker) => (speaker.topic(), speaker.sent()),
            Self::Action(goals) => (&goals.name, 0),
        }
    }
}

impl Goals {
    /// A goal for what moves, as often as is set; one goal to hold when it is to stand.
    fn say(&mut self, now: Stamp, velocities: &JointVelocities, positions: &[f64], ahead_s: f64) -> Result<(), String> {
        let moves = velocities.values().iter().any(|velocity| *velocity != 0.0);
        let is_due = match self.last {
            None => true,
            Some((_, false)) if !moves => false,
            Some((_, moved)) if moved != moves => true,
            Some((last, _)) => now - last >= self.every,
        };
        // Nobody here waits for answers: a newer goal takes the place of each.
        while let Ok(Some(_)) = self.client.goal_client().receive_response() {}
        if !is_due {
            return Ok(());
        }
        self.last = Some((now, moves));
        let trajectory = trajectory(velocities, positions, ahead_s);
        let goal = FollowJointTrajectoryGoal { trajectory, ..FollowJointTrajectoryGoal::default() };
        self.client.send_goal(goal).map(drop).map_err(|error| format!("{}: {error}", self.name))
    }
}

/// One point a short way ahead, with the velocity it is passed at.
fn trajectory(velocities: &JointVelocities, positions: &[f64], ahead_s: f64) -> JointTrajectory {
    let ahead = positions.iter().zip(velocities.values()).map(|(at, velocity)| at + ahead_s * velocity);
    let time_from_start = Duration { sec: ahead_s as i32, nanosec: (ahead_s.fract() * 1e9) as u32 };
    let point = JointTrajectoryPoint {
        positions: ahead.collect(),
        velocities: velocities.values().to_vec(),
        time_from_start,
        ..JointTrajectoryPoint::default()
    };
    let joint_names = velocities.names().iter().map(|name| name.to_string()).collect();
    JointTrajectory { header: Header::default(), joint_names, points: vec![point] }
}

/// What commands to the gripper go out by.
#[allow(clippy::large_enum_variant, reason = "there is one")]
pub(super) enum GripperSpeaker {
    Topic(Box<Speaker<GripperCommand>>),
    Action(Box<Grips>),
}

/// A goal for each new gap or force.
pub(super) struct Grips {
    client: Grip,
    name: String,
    last: Option<GripperCommand>,
}

impl GripperSpeaker {
    pub(super) fn new<I: Send + 'static>(
        link: &mut LinkBuilder<I>,
        settings: &Ros2Settings,
    ) -> Result<Self, Ros2Error> {
        let name = settings.gripper_command.clone();
        Ok(match settings.gripper_interface {
            GripperInterface::Topic => Self::Topic(Box::new(link.speak(&name, COMMANDS)?)),
            GripperInterface::Action => {
                let client = link.request(&name, "control_msgs", "GripperCommand")?;
                Self::Action(Box::new(Grips { client, name, last: None }))
            }
        })
    }

    pub(super) fn say(&mut self, command: GripperCommand) -> Result<(), String> {
        match self {
            Self::Topic(speaker) => speaker.say(command),
            Self::Action(grips) => {
                while let Ok(Some(_)) = grips.client.goal_client().receive_response() {}
                if grips.last == Some(command) {
                    return Ok(());
                }
                grips.last = Some(command);
                let sent = grips.client.send_goal(GripperCommandGoal { command });
                sent.map(drop).map_err(|error| format!("{}: {error}", grips.name))
            }
        }
    }

    pub(super) fn forget_sent(&mut self) {
        if let Self::Topic(speaker) = self {
            speaker.forget_sent();
        }
    }

    pub(super) fn sent(&self) -> (&str, u64) {
        match self {
            Self::Topic(speaker) => (speaker.topic(), speaker.sent()),
            Self::Action(grips) => (&grips.name, 0),
        }
    }
}
