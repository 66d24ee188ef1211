//! What a served robot is told.

use super::{Host, Server};
use crate::account::{ACCOUNT_TOPIC, LOG_TOPIC, OWN_NAME};
use crate::client::clock::ADVANCE_TOPIC;
use crate::error::Ros2Error;
use crate::link::{Delivery, LinkBuilder};
use crate::messages::{
    Account, Bool, Float64MultiArray, GripperCommand, JointTrajectory, Log, Step, Text, Twist as RosTwist, TwistStamped,
};
use crate::settings::{ClockSource, GripperInterface, JointInterface, Ros2Settings};
use crate::wall::instant;
use dsm_robot::drivers::{DriverError, JointGroup, Robot, Twist};
use dsm_robot::joints::{JointNames, JointVelocities};

/// A message to the robot, or to whoever serves it.
pub(super) enum Command {
    Base(TwistStamped),
    Arm(Float64MultiArray),
    Head(Float64MultiArray),
    ArmTrajectory(JointTrajectory),
    HeadTrajectory(JointTrajectory),
    Gripper(GripperCommand),
    Stop(Text),
    Advance(Step),
    Log(Log),
    Account(Account),
}

/// Listens on all topics of commands.
pub(super) fn listen(link: &mut LinkBuilder<Command>, settings: &Ros2Settings) -> Result<(), Ros2Error> {
    let commands = Delivery::Reliable { depth: 64 };
    link.listen(&settings.base_command, commands, Command::Base)?;
    match settings.arm_interface {
        JointInterface::Velocities => link.listen(&settings.arm_command, commands, Command::Arm)?,
        JointInterface::Trajectory => link.listen(&settings.arm_command, commands, Command::ArmTrajectory)?,
        JointInterface::Action => {}
    }
    match settings.head_interface {
        JointInterface::Velocities => link.listen(&settings.head_command, commands, Command::Head)?,
        JointInterface::Trajectory => link.listen(&settings.head_command, commands, Command::HeadTrajectory)?,
        JointInterface::Action => {}
    }
    if settings.gripper_interface == GripperInterface::Topic {
        link.listen(&settings.gripper_command, commands, Command::Gripper)?;
    }
    link.listen(&settings.emergency_stop, Delivery::Kept, Command::Stop)?;
    link.listen(LOG_TOPIC, commands, Command::Log)?;
    link.listen(ACCOUNT_TOPIC, commands, Command::Account)?;
    match settings.clock {
        ClockSource::LockStep => link.listen(ADVANCE_TOPIC, commands, Command::Advance),
        ClockSource::Wall | ClockSource::Topic => Ok(()),
    }
}

impl Server {
    /// Passes a command on. What the robot refuses, it refuses: the log says so.
    pub(super) fn carry_out(&mut self, robot: &mut dyn Robot, command: Command, host: &mut dyn Host) {
        self.heard = Some(instant());
        let done = match command {
            Command::Base(said) => {
                let RosTwist { linear, angular } = said.twist;
                robot.base().command(Twist { forward_m_per_s: linear.x, turn_rad_per_s: angular.z }).map(drop)
            }
            Command::Arm(said) => {
                let names = &self.model.arm.joints;
                command_group(robot.arm(), names, JointVelocities::from_values(names, said.data))
            }
            Command::Head(said) => {
                let names = &self.model.head.joints;
                command_group(robot.head(), names, JointVelocities::from_values(names, said.data))
            }
            Command::ArmTrajectory(said) => {
                let names = &self.model.arm.joints;
                command_group(robot.arm(), names, velocities_of(names, &said))
            }
            Command::HeadTrajectory(said) => {
                let names = &self.model.head.joints;
                command_group(robot.head(), names, velocities_of(names, &said))
            }
            Command::Gripper(said) => robot.gripper().command(said.position, said.max_effort).map(drop),
            Command::Stop(why) if why.data.is_empty() => robot.emergency_stop().reset(),
            Command::Stop(why) => robot.emergency_stop().trigger(&why.data),
            Command::Log(line) => {
                if line.name == OWN_NAME {
                    host.hear(line.msg);
                }
                Ok(())
            }
            Command::Account(account) => {
                host.take_account(account);
                // Whoever told it waits for this word; without it they wait a little longer.
                self.mouth.taken.say(Bool { data: true }).unwrap_or_else(|error| tracing::warn!("{error}"));
                Ok(())
            }
            Command::Advance(_) => Ok(()),
        };
        if let Err(error) = done {
            tracing::debug!("a command is refused: {error}");
        }
    }
}

/// Commands a group; velocities of other joints are refused.
fn command_group(
    part: &mut dyn JointGroup,
    names: &JointNames,
    velocities: Option<JointVelocities>,
) -> Result<(), DriverError> {
    let expected = || names.iter().map(|name| name.to_string()).collect();
    let velocities = velocities.ok_or_else(|| DriverError::WrongJoints { expected: expected(), got: Vec::new() })?;
    part.command(&velocities).map(drop)
}

/// The velocities of a trajectory's first point, in the order of the group.
fn velocities_of(names: &JointNames, said: &JointTrajectory) -> Option<JointVelocities> {
    let point = said.points.first()?;
    let value = |name: &str| {
        let index = said.joint_names.iter().position(|known| known == name)?;
        point.velocities.get(index).copied()
    };
    JointVelocities::from_values(names, names.iter().map(|name| value(name)).collect::<Option<Vec<f64>>>()?)
}
