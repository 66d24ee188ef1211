//! A robot that speaks ROS 2, behind the driver traits.
//!
//! ```text
//! command ──▶ topics ──▶ robot ──▶ topics ──▶ inbox ──wait_until──▶ newest states, whole pictures ──▶ read
//! ```
//!
//! Messages are taken in while time passes and when a part is read; reading never waits. A part whose messages stop
//! coming keeps its last state with its stamp: whoever wraps this robot sees that the stamp stands still.

pub(crate) mod clock;
mod inbox;
pub mod pictures;

use crate::error::Ros2Error;
use crate::link::{Delivery, Link, LinkBuilder, Speaker};
use crate::messages::{
    Duration, Float64MultiArray, GripperCommand, Header, JointTrajectory, JointTrajectoryPoint, MultiArrayLayout, Step,
    Text, Twist as RosTwist, TwistStamped, Vector3,
};
use crate::settings::{ClockSource, JointInterface, Ros2Settings};
use clock::RobotClock;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::Detections;
use dsm::time::Stamp;
use dsm_robot::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use dsm_robot::model::RobotModel;
use inbox::{Inbox, Incoming};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Commands kept for sending again.
const COMMANDS: Delivery = Delivery::Reliable { depth: 64 };

/// A robot behind ROS 2.
pub struct Ros2Robot {
    parts: Arm,
}

/// The arm's view of the core.
struct Arm(Head);

/// The head's view of the core: arm and head are the same kind of part, so each needs a type of its own.
struct Head(Core);

struct Core {
    link: Link<Incoming>,
    inbox: Inbox,
    clock: RobotClock,
    settings: Ros2Settings,
    model: Arc<RobotModel>,
    base: Speaker<TwistStamped>,
    arm: JointSpeaker,
    head: JointSpeaker,
    gripper: Speaker<GripperCommand>,
    stop: Speaker<Text>,
    step: Option<Speaker<Step>>,
    stopped: Option<String>,
    next_frame: u64,
    detections: Option<Sender<Detections>>,
}

/// What commands go out by.
enum JointSpeaker {
    Velocities(Speaker<Float64MultiArray>),
    Trajectory(Speaker<JointTrajectory>),
}

impl JointSpeaker {
    fn new<I: Send + 'static>(
        link: &mut LinkBuilder<I>,
        topic: &str,
        interface: JointInterface,
    ) -> Result<Self, Ros2Error> {
        Ok(match interface {
            JointInterface::Velocities => Self::Velocities(link.speak(topic, COMMANDS)?),
            JointInterface::Trajectory => Self::Trajectory(link.speak(topic, COMMANDS)?),
        })
    }

    fn forget_sent(&mut self) {
        match self {
            Self::Velocities(speaker) => speaker.forget_sent(),
            Self::Trajectory(speaker) => speaker.forget_sent(),
        }
    }

    fn sent(&self) -> (&str, u64) {
        match self {
            Self::Velocities(speaker) => (speaker.topic(), speaker.sent()),
            Self::Trajectory(speaker) => (speaker.topic(), speaker.sent()),
        }
    }
}

/// Connects to the robot of a model: waits until somebody is at the other end of every topic, and until every part has said
/// how it is.
///
/// The receiver gets the detections that come over the wire, if `settings.detections` names a topic.
///
/// # Errors
/// [`Ros2Error`]: no DDS, or nobody there within the time of `settings`.
pub fn connect(
    model: Arc<RobotModel>,
    settings: Ros2Settings,
) -> Result<(Ros2Robot, Option<Receiver<Detections>>), Ros2Error> {
    let mut link = LinkBuilder::new("dsm", settings.domain)?;
    inbox::listen(&mut link, &model, &settings)?;
    let base = link.speak(&settings.base_command, COMMANDS)?;
    let arm = JointSpeaker::new(&mut link, &settings.arm_command, settings.arm_interface)?;
    let head = JointSpeaker::new(&mut link, &settings.head_command, settings.head_interface)?;
    let gripper = link.speak(&settings.gripper_command, COMMANDS)?;
    let stop = link.speak(&settings.emergency_stop, Delivery::Kept)?;
    let step = match settings.clock {
        ClockSource::LockStep => Some(link.speak(clock::ADVANCE_TOPIC, COMMANDS)?),
        ClockSource::Wall | ClockSource::Topic => None,
    };
    let (sender, receiver) = channel();
    let has_detections = !settings.detections.is_empty();
    let mut core = Core {
        link: link.start()?,
        inbox: Inbox::new(&model, &settings),
        clock: RobotClock::new(settings.clock),
        settings,
        model,
        base,
        arm,
        head,
        gripper,
        stop,
        step,
        stopped: None,
        next_frame: 0,
        detections: has_detections.then_some(sender),
    };
    core.meet()?;
    Ok((Ros2Robot { parts: Arm(Head(core)) }, has_detections.then_some(receiver)))
}

fn lost(part: &str, reason: impl Into<String>) -> DriverError {
    DriverError::Lost { part: part.to_owned(), reason: reason.into() }
}

fn finite(value: f64, what: &str) -> Result<f64, DriverError> {
    if value.is_finite() { Ok(value) } else { Err(DriverError::NotFinite { what: what.to_owned() }) }
}

impl Core {
    /// Takes in all messages that are there.
    fn take_in(&mut self) {
        while let Some(message) = self.link.find() {
            self.accept(message);
        }
    }

    fn accept(&mut self, message: Incoming) {
        if let Incoming::Clock(clock) = &message {
            self.clock.hear(clock);
        }
        if let Some(found) = self.inbox.accept(message, &self.clock) {
            self.hand_on(found);
        }
    }

    fn hand_on(&self, found: Detections) {
        if let Some(detections) = &self.detections {
            // Nobody listens any more when the run is over.
            let _ = detections.send(found);
        }
    }

    fn check_stopped(&mut self) -> Result<(), DriverError> {
        self.take_in();
        match self.find_reason() {
            Some(reason) => Err(DriverError::Stopped { reason }),
            None => Ok(()),
        }
    }

    fn find_reason(&self) -> Option<String> {
        self.stopped.clone().or_else(|| self.inbox.stopped.clone())
    }

    fn group_names(&self, group: Which) -> &JointNames {
        match group {
            Which::Arm => &self.model.arm.joints,
            Which::Head => &self.model.head.joints,
        }
    }

    fn command_group(&mut self, group: Which, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.check_stopped()?;
        let names = self.group_names(group);
        if velocities.names()[..] != names[..] {
            let list = |names: &JointNames| names.iter().map(|name| name.to_string()).collect();
            return Err(DriverError::WrongJoints { expected: list(names), got: list(velocities.names()) });
        }
        for (name, velocity) in velocities.iter() {
            finite(velocity, &format!("velocity of {name}"))?;
        }
        let ahead_s = self.settings.trajectory_ahead_s;
        let positions = self.inbox.state_of(self.group_names(group))?.positions;
        let speaker = match group {
            Which::Arm => &mut self.arm,
            Which::Head => &mut self.head,
        };
        let said = match speaker {
            JointSpeaker::Velocities(speaker) => {
                let layout = MultiArrayLayout::default();
                speaker.say(Float64MultiArray { layout, data: velocities.values().to_vec() })
            }
            JointSpeaker::Trajectory(speaker) => speaker.say(trajectory(velocities, positions.values(), ahead_s)),
        };
        said.map_err(|reason| lost(group.name(), reason))?;
        Ok(velocities.clone())
    }

    /// The next whole picture of a camera, as a frame.
    fn read_camera(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        self.take_in();
        let known = || self.model.settings.camera.iter().map(|c| c.name.clone()).collect();
        let Some((settings, link)) = self.model.find_camera(camera) else {
            return Err(DriverError::NoCamera { name: camera.to_owned(), known: known() });
        };
        let name: Arc<str> = settings.name.as_str().into();
        let Some((picture, model)) = self.inbox.take_picture(camera) else { return Ok(None) };
        let world_from_camera = match picture.world_from_camera {
            Some(pose) => pose,
            None => {
                let Some(world_from_base) = self.inbox.find_pose_at(picture.stamp) else { return Ok(None) };
                let mut configuration = self.model.kinematics.zero();
                let Some(joints) = self.inbox.find_joints_at(picture.stamp) else { return Ok(None) };
                configuration.apply(&joints);
                world_from_base * self.model.kinematics.root_from_link(&configuration, link)
            }
        };
        let id = FrameId(self.next_frame);
        self.next_frame += 1;
        self.inbox.note_frame(camera, picture.stamp, id);
        while let Some(found) = self.inbox.find_matched(&self.clock) {
            self.hand_on(found);
        }
        let (stamp, color, depth_m) = (picture.stamp, picture.color, picture.depth_m);
        Ok(Some(RgbdFrame { id, stamp, camera: name, model, world_from_camera, color, depth_m }))
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

/// Which of the two joint groups.
#[derive(Clone, Copy)]
enum Which {
    Arm,
    Head,
}

impl Which {
    fn name(self) -> &'static str {
        match self {
            Self::Arm => "arm",
            Self::Head => "head",
        }
    }
}

impl Base for Core {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.check_stopped()?;
        let forward = finite(twist.forward_m_per_s, "the base's speed")?;
        let turn = finite(twist.turn_rad_per_s, "the base's turning rate")?;
        let header = Header::new(self.clock.on_the_wire(), &self.model.settings.base.link);
        let linear = Vector3 { x: forward, ..Vector3::default() };
        let angular = Vector3 { z: turn, ..Vector3::default() };
        let said = self.base.say(TwistStamped { header, twist: RosTwist { linear, angular } });
        said.map_err(|reason| lost("base", reason))?;
        Ok(twist)
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        self.take_in();
        self.inbox.base_velocity()
    }
}

impl JointGroup for Arm {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.0.command_group(Which::Arm, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.0.take_in();
        self.0.0.inbox.state_of(&self.0.0.model.arm.joints)
    }
}

impl JointGroup for Head {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.command_group(Which::Head, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.take_in();
        self.0.inbox.state_of(&self.0.model.head.joints)
    }
}

impl Gripper for Core {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.check_stopped()?;
        let gripper = &self.model.settings.gripper;
        let position = finite(width_m, "the gripper's width")?.clamp(0.0, gripper.max_aperture_m);
        let max_effort = finite(max_force_n, "the gripper's force")?.clamp(0.0, gripper.max_force_n);
        let said = self.gripper.say(GripperCommand { position, max_effort });
        said.map_err(|reason| lost("gripper", reason))?;
        Ok((position, max_effort))
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        self.take_in();
        self.inbox.gripper_state()
    }
}

impl Cameras for Core {
    fn names(&self) -> Vec<String> {
        self.model.settings.camera.iter().map(|camera| camera.name.clone()).collect()
    }

    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        self.read_camera(camera)
    }
}

impl Localisation for Core {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.take_in();
        self.inbox.world_from_base()
    }

    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.take_in();
        self.inbox.odom_from_base()
    }
}

impl EmergencyStop for Core {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        // The first reason stays: it is what went wrong.
        let reason = self.stopped.get_or_insert_with(|| reason.to_owned()).clone();
        self.stop.say(Text { data: reason }).map_err(|reason| lost("emergency stop", reason))
    }

    fn find_reason(&self) -> Option<String> {
        Core::find_reason(self)
    }

    fn reset(&mut self) -> Result<(), DriverError> {
        self.stop.say(Text::default()).map_err(|reason| lost("emergency stop", reason))?;
        (self.stopped, self.inbox.stopped) = (None, None);
        Ok(())
    }
}

impl Clock for Core {
    fn now(&self) -> Stamp {
        self.clock.now()
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        self.pass_time(stamp)
    }
}

impl Robot for Ros2Robot {
    fn base(&mut self) -> &mut dyn Base {
        &mut self.parts.0.0
    }

    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.parts
    }

    fn gripper(&mut self) -> &mut dyn Gripper {
        &mut self.parts.0.0
    }

    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.parts.0
    }

    fn cameras(&mut self) -> &mut dyn Cameras {
        &mut self.parts.0.0
    }

    fn localisation(&mut self) -> &mut dyn Localisation {
        &mut self.parts.0.0
    }

    fn clock(&mut self) -> &mut dyn Clock {
        &mut self.parts.0.0
    }

    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        &mut self.parts.0.0
    }
}

/// Positions and velocities of joints by their names.
pub(crate) fn joint_state(stamp: Stamp, names: &JointNames, values: &[(f64, f64)]) -> Option<JointState> {
    Some(JointState {
        stamp,
        positions: JointPositions::from_values(names, values.iter().map(|(position, _)| *position).collect())?,
        velocities: JointVelocities::from_values(names, values.iter().map(|(_, velocity)| *velocity).collect())?,
    })
}
