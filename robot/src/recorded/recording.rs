//! A robot whose every exchange is kept.

use super::period::{Exchange, FrameRead, JointReading, JointTalk, JointValues, Period, StopCommand, Waited};
use crate::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use crate::joints::{JointNames, JointVelocities};
use crate::model::RobotModel;
use dsm::frame::RgbdFrame;
use dsm::time::Stamp;

/// Takes in what is recorded. A recording that cannot be written must not stop a robot: it tells so elsewhere.
pub trait RecordSink: Send {
    /// A frame that was read during the period that comes next.
    fn frame(&mut self, frame: &RgbdFrame);

    /// A period that is over.
    fn period(&mut self, period: Period);
}

/// Wraps a robot and keeps all that it is asked and answers. It changes nothing of either.
pub struct Recording<R: Robot> {
    parts: Arm<R>,
}

/// The arm's view of the core.
struct Arm<R: Robot>(Head<R>);

/// The head's view of the core.
struct Head<R: Robot>(Core<R>);

struct Core<R: Robot> {
    robot: R,
    sink: Box<dyn RecordSink>,
    arm_joints: JointNames,
    head_joints: JointNames,
    camera_names: Vec<String>,
    period: Period,
    stop_reason: Option<String>,
}

impl<R: Robot> Recording<R> {
    /// Wraps `robot`, of which `model` is the model. The last period is given when the recording is dropped.
    pub fn new(mut robot: R, model: &RobotModel, sink: Box<dyn RecordSink>) -> Self {
        let period = Period { now: robot.clock().now(), ..Period::default() };
        let (arm_joints, head_joints) = (model.arm.joints.clone(), model.head.joints.clone());
        let camera_names = robot.cameras().names();
        Self {
            parts: Arm(Head(Core { robot, sink, arm_joints, head_joints, camera_names, period, stop_reason: None })),
        }
    }

    fn core_mut(&mut self) -> &mut Core<R> {
        &mut self.parts.0.0
    }
}

impl<R: Robot> Drop for Core<R> {
    fn drop(&mut self) {
        self.sink.period(std::mem::take(&mut self.period));
    }
}

/// Passes a command on to a group of joints.
fn command_joints(
    part: &mut dyn JointGroup,
    own: &JointNames,
    talk: &mut JointTalk,
    velocities: &JointVelocities,
) -> Result<JointVelocities, DriverError> {
    let answer = part.command(velocities);
    let kept = |velocities: &JointVelocities| JointValues::of_velocities(own, velocities);
    talk.commands.push(Exchange { asked: kept(velocities), answer: answer.as_ref().map(kept).map_err(Clone::clone) });
    answer
}

fn read_joints(part: &mut dyn JointGroup, own: &JointNames, talk: &mut JointTalk) -> Result<JointState, DriverError> {
    let answer = part.state();
    talk.state.note(answer.as_ref().map(|state| JointReading::new(own, state)).map_err(Clone::clone));
    answer
}

impl<R: Robot> JointGroup for Arm<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        let core = &mut self.0.0;
        command_joints(core.robot.arm(), &core.arm_joints, &mut core.period.arm, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        let core = &mut self.0.0;
        read_joints(core.robot.arm(), &core.arm_joints, &mut core.period.arm)
    }
}

impl<R: Robot> JointGroup for Head<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        let core = &mut self.0;
        command_joints(core.robot.head(), &core.head_joints, &mut core.period.head, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        let core = &mut self.0;
        read_joints(core.robot.head(), &core.head_joints, &mut core.period.head)
    }
}

impl<R: Robot> Base for Core<R> {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        let answer = self.robot.base().command(twist);
        self.period.base.push(Exchange { asked: twist, answer: answer.clone() });
        answer
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        let answer = self.robot.base().velocity();
        self.period.base_velocity.note(answer.clone());
        answer
    }
}

impl<R: Robot> Gripper for Core<R> {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        let answer = self.robot.gripper().command(width_m, max_force_n);
        self.period.gripper.commands.push(Exchange { asked: (width_m, max_force_n), answer: answer.clone() });
        answer
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        let answer = self.robot.gripper().state();
        self.period.gripper.state.note(answer.clone());
        answer
    }
}

impl<R: Robot> Cameras for Core<R> {
    fn names(&self) -> Vec<String> {
        self.camera_names.clone()
    }

    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        let answer = self.robot.cameras().read(camera);
        if let Ok(Some(frame)) = &answer {
            self.sink.frame(frame);
        }
        let kept = answer.as_ref().map(|frame| frame.as_ref().map(|frame| frame.id)).map_err(Clone::clone);
        self.period.frames.push(FrameRead { camera: camera.to_owned(), answer: kept });
        answer
    }
}

impl<R: Robot> Localisation for Core<R> {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        let answer = self.robot.localisation().world_from_base();
        self.period.world_from_base.note(answer.clone());
        answer
    }

    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        let answer = self.robot.localisation().odom_from_base();
        self.period.odom_from_base.note(answer.clone());
        answer
    }
}

impl<R: Robot> Clock for Core<R> {
    /// The moment of the last wait: a period has one.
    fn now(&self) -> Stamp {
        self.period.now
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        let answer = self.robot.clock().wait_until(stamp);
        self.period.waited = Some(Waited { until: stamp, answer: answer.clone() });
        let next = Period { now: self.robot.clock().now(), ..Period::default() };
        self.sink.period(std::mem::replace(&mut self.period, next));
        answer
    }
}

impl<R: Robot> EmergencyStop for Core<R> {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        let answer = self.robot.emergency_stop().trigger(reason);
        self.period.stop.push((StopCommand::Trigger(reason.to_owned()), answer.clone()));
        self.stop_reason = self.robot.emergency_stop().find_reason();
        answer
    }

    /// The reason when the stop was last turned to.
    fn find_reason(&self) -> Option<String> {
        self.stop_reason.clone()
    }

    fn reset(&mut self) -> Result<(), DriverError> {
        let answer = self.robot.emergency_stop().reset();
        self.period.stop.push((StopCommand::Reset, answer.clone()));
        self.stop_reason = self.robot.emergency_stop().find_reason();
        answer
    }
}

impl<R: Robot> Robot for Recording<R> {
    fn base(&mut self) -> &mut dyn Base {
        self.core_mut()
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.parts
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        self.core_mut()
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.parts.0
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        self.core_mut()
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self.core_mut()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self.core_mut()
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        let core = self.core_mut();
        core.stop_reason = core.robot.emergency_stop().find_reason();
        core.period.stop_reason.note(Ok(core.stop_reason.clone()));
        core
    }
}
