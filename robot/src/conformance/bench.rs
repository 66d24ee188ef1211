//! What trials share: a robot, its model, and time in control periods.

use crate::drivers::{DriverError, Robot, Twist};
use crate::joints::{JointPositions, JointVelocities};
use crate::model::{Group, RobotModel};
use dsm::Pose;
use dsm::time::{Span, Stamp};

/// Commands are sent this often.
pub(super) const PERIOD: Span = Span(10_000_000);
/// Slower than this a base stands, metres or radians per second.
pub(super) const STANDS: f64 = 0.01;

/// One of the joint groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limb {
    Arm,
    Head,
}

/// What a motion came to, and what the driver said that it sent.
pub(super) struct Driven {
    /// `before_from_after` by odometry, and by localisation.
    pub(super) odom: Pose,
    pub(super) world: Pose,
    /// Sum of what was sent: metres and radians.
    pub(super) sent: Twist,
    /// Mean of the velocities measured in the second half.
    pub(super) measured: Twist,
    /// Mean of the velocities sent in the second half.
    pub(super) told: Twist,
}

pub(super) struct Bench<'a> {
    pub(super) robot: &'a mut dyn Robot,
    pub(super) model: &'a RobotModel,
}

impl<'a> Bench<'a> {
    pub(super) fn new(robot: &'a mut dyn Robot, model: &'a RobotModel) -> Self {
        Self { robot, model }
    }

    pub(super) fn now(&mut self) -> Stamp {
        self.robot.clock().now()
    }

    /// Lets time pass, and looks ahead meanwhile: nobody drives blindly.
    pub(super) fn wait(&mut self, span: Span) -> Result<(), DriverError> {
        let until = self.now() + span;
        self.robot.clock().wait_until(until)?;
        self.robot.cameras().read("head").map(|_| ())
    }

    /// Everything stands, as far as it answers.
    pub(super) fn rest(&mut self) {
        let still = [&self.model.arm, &self.model.head].map(|group| JointVelocities::zeros(&group.joints));
        for _ in 0..100 {
            // Trials say what does not answer.
            let _ = self.robot.base().command(Twist::default());
            let _ = self.robot.arm().command(&still[0]);
            let _ = self.robot.head().command(&still[1]);
            let _ = self.wait(PERIOD);
        }
    }

    pub(super) fn group(&self, limb: Limb) -> &'a Group {
        match limb {
            Limb::Arm => &self.model.arm,
            Limb::Head => &self.model.head,
        }
    }

    pub(super) fn positions(&mut self, limb: Limb) -> Result<JointPositions, DriverError> {
        let part = match limb {
            Limb::Arm => self.robot.arm(),
            Limb::Head => self.robot.head(),
        };
        Ok(part.state()?.positions)
    }

    pub(super) fn command(&mut self, limb: Limb, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        match limb {
            Limb::Arm => self.robot.arm().command(velocities),
            Limb::Head => self.robot.head().command(velocities),
        }
    }

    /// Drives for some seconds, and stands again.
    pub(super) fn drive(&mut self, twist: Twist, seconds: f64) -> Result<Driven, DriverError> {
        let odom = self.robot.localisation().odom_from_base()?.pose;
        let world = self.robot.localisation().world_from_base()?.pose;
        let ticks = (seconds / PERIOD.as_s()) as usize;
        let (mut sent, mut measured, mut told) = (Twist::default(), Twist::default(), Twist::default());
        for tick in 0..ticks + 100 {
            let wanted = if tick < ticks { twist } else { Twist::default() };
            let before = self.now();
            let answer = self.robot.base().command(wanted)?;
            self.wait(PERIOD)?;
            add(&mut sent, answer, (self.now() - before).as_s());
            if tick < ticks && tick >= ticks / 2 {
                let share = 1.0 / (ticks - ticks / 2) as f64;
                add(&mut measured, self.robot.base().velocity()?, share);
                add(&mut told, answer, share);
            }
        }
        let odom = odom.inv_mul(&self.robot.localisation().odom_from_base()?.pose);
        let world = world.inv_mul(&self.robot.localisation().world_from_base()?.pose);
        Ok(Driven { odom, world, sent, measured, told })
    }
}

fn add(sum: &mut Twist, twist: Twist, by: f64) {
    sum.forward_m_per_s += by * twist.forward_m_per_s;
    sum.turn_rad_per_s += by * twist.turn_rad_per_s;
}
