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
mod joints;
pub mod pictures;
mod speakers;

use crate::account::{LOG_TOPIC, OWN_NAME};
use crate::error::Ros2Error;
use crate::link::{Delivery, Link, LinkBuilder, Speaker};
use crate::messages::{GripperCommand, Header, Log, Step, Text, Twist as RosTwist, TwistStamped, Vector3};
use crate::settings::{ClockSource, Ros2Settings};
use clock::RobotClock;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::Detections;
use dsm::time::Stamp;
use dsm_robot::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use dsm_robot::joints::{JointNames, JointVelocities};
use dsm_robot::model::RobotModel;
use inbox::{Inbox, Incoming};
use speakers::{COMMANDS, GripperSpeaker, JointSpeaker};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

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
    gripper: GripperSpeaker,
    stop: Speaker<Text>,
    log: Speaker<Log>,
    step: Option<Speaker<Step>>,
    stopped: Option<String>,
    next_frame: u64,
    detections: Option<Sender<Detections>>,
    lines: Receiver<String>,
}

/// A robot that was reached.
pub struct Connection {
    /// The robot.
    pub robot: Ros2Robot,
    /// The detections that come over the wire, if the settings name a topic for them.
    pub detections: Option<Receiver<Detections>>,
    /// Takes lines of the task's log; they go out on `/rosout` when time passes.
    pub log: Sender<String>,
}

/// Connects to the robot of a model: waits until somebody is at the other end of every topic, and until every part has said
/// how it is.
//////
/// # Errors
/// [`Ros2Error`]: no DDS, or nobody there within the time of `settings`.
pub fn connect(model: Arc<RobotModel>, settings: Ros2Settings) -> Result<Connection, Ros2Error> {
    let mut link = LinkBuilder::new("dsm", settings.domain)?;
    inbox::listen(&mut link, &model, &settings)?;
    let base = link.speak(&settings.base_command, COMMANDS)?;
    let arm = JointSpeaker::new(&mut link, &settings.arm_command, settings.arm_interface, &settings)?;
    let head = JointSpeaker::new(&mut link, &settings.head_command, settings.head_interface, &settings)?;
    let gripper = GripperSpeaker::new(&mut link, &settings)?;
    let stop = link.speak(&settings.emergency_stop, Delivery::Kept)?;
    let step = match settings.clock {
        ClockSource::LockStep => Some(link.speak(clock::ADVANCE_TOPIC, COMMANDS)?),
        ClockSource::Wall | ClockSource::Topic => None,
    };
    let log = match settings.clock {
        // What belongs to a step must be heard.
        ClockSource::LockStep => link.speak(LOG_TOPIC, COMMANDS)?,
        ClockSource::Wall | ClockSource::Topic => link.speak_aside(LOG_TOPIC, COMMANDS)?,
    };
    let ((sender, receiver), (lines, said)) = (channel(), channel());
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
        log,
        step,
        stopped: None,
        next_frame: 0,
        detections: has_detections.then_some(sender),
        lines: said,
    };
    core.meet()?;
    let robot = Ros2Robot { parts: Arm(Head(core)) };
    Ok(Connection { robot, detections: has_detections.then_some(receiver), log: lines })
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
        let limits = match group {
            Which::Arm => &self.model.arm.limits,
            Which::Head => &self.model.head.limits,
        };
        let within = velocities.values().iter().zip(limits).map(|(v, limit)| v.clamp(-limit.velocity, limit.velocity));
        let within: Vec<f64> = within.collect();
        let ahead_s = self.settings.trajectory_ahead_s;
        let positions = self.inbox.joints.state_of(self.group_names(group))?.positions;
        let speaker = match group {
            Which::Arm => &mut self.arm,
            Which::Head => &mut self.head,
        };
        let mut sent = velocities.clone();
        sent.values_mut().copy_from_slice(&within);
        let said = speaker.say(self.clock.now(), &sent, positions.values(), ahead_s);
        said.map_err(|reason| lost(group.name(), reason))?;
        Ok(sent)
    }

    /// Says the lines of the log that came up.
    fn say_log(&mut self) -> Result<(), DriverError> {
        let stamp = self.clock.on_the_wire().into();
        for msg in self.lines.try_iter() {
            let line = Log { stamp, level: 20, name: OWN_NAME.into(), msg, ..Log::default() };
            match (self.log.say(line), self.settings.clock) {
                // What belongs to a step must be heard.
                (Err(reason), ClockSource::LockStep) => return Err(lost("log", reason)),
                (Err(reason), ClockSource::Wall | ClockSource::Topic) => tracing::warn!("a line of the log: {reason}"),
                (Ok(()), _) => {}
            }
        }
        Ok(())
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
                let Some(joints) = self.inbox.joints.find_at(picture.stamp, &self.model) else { return Ok(None) };
                configuration.apply(&joints);
                world_from_base * self.model.kinematics.root_from_link(&configuration, link)
            }
        };
        // In lock step the detections are there already, and with them the robot's own number.
        let number = match self.settings.clock {
            ClockSource::LockStep => self.inbox.find_number(camera, picture.stamp, &self.clock),
            ClockSource::Wall | ClockSource::Topic => None,
        };
        let id = number.unwrap_or(FrameId(self.next_frame));
        self.next_frame = self.next_frame.max(id.0) + 1;
        self.inbox.note_frame(camera, picture.stamp, id);
        while let Some(found) = self.inbox.find_matched(&self.clock) {
            self.hand_on(found);
        }
        let (stamp, color, depth_m) = (picture.stamp, picture.color, picture.depth_m);
        Ok(Some(RgbdFrame { id, stamp, camera: name, model, world_from_camera, color, depth_m }))
    }
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
        let (speed, rate) =
            (self.model.settings.base.max_speed_m_per_s, self.model.settings.base.max_turn_rate_rad_per_s);
        let forward = finite(twist.forward_m_per_s, "the base's speed")?.clamp(-speed, speed);
        let turn = finite(twist.turn_rad_per_s, "the base's turning rate")?.clamp(-rate, rate);
        let header = Header::new(self.clock.on_the_wire(), &self.model.settings.base.link);
        let linear = Vector3 { x: forward, ..Vector3::default() };
        let angular = Vector3 { z: turn, ..Vector3::default() };
        let said = self.base.say(TwistStamped { header, twist: RosTwist { linear, angular } });
        said.map_err(|reason| lost("base", reason))?;
        Ok(Twist { forward_m_per_s: forward, turn_rad_per_s: turn })
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
        self.0.0.inbox.joints.state_of(&self.0.0.model.arm.joints)
    }
}

impl JointGroup for Head {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.command_group(Which::Head, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.take_in();
        self.0.inbox.joints.state_of(&self.0.model.head.joints)
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
        self.inbox.gripper_state(&self.model)
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
