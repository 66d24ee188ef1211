//! A robot that cannot be asked for too much: it wraps any robot, implements the same traits, and lets only commands
//! within the limits of `robot.toml` and the URDF through.
//!
//! - velocities, accelerations and joint positions (with the way needed to brake) are clamped; the answer to a command is
//!   what was sent;
//! - values that are not finite and commands to the wrong joints are refused;
//! - a base that hears nothing for 0.5 s and joints that hear nothing for 0.1 s brake at their acceleration limit;
//! - the emergency stop brakes everything at its limit, is latched, and refuses commands until it is reset.
//!
//! Simulation and hardware are limited by this same code. Braking happens while time passes, in `wait_until`.

mod guard;

use crate::control::joint_limit::JointEnvelope;
use crate::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, Twist,
};
use crate::joints::{JointNames, JointVelocities};
use crate::model::RobotModel;
use dsm::time::{Span, Stamp};
use guard::{BaseGuard, GroupGuard, Heard};

/// A base that hears nothing for this long brakes.
pub const BASE_TIMEOUT: Span = Span(500_000_000);
/// Joints that hear nothing for this long brake.
pub const JOINT_TIMEOUT: Span = Span(100_000_000);
/// Step in which braking commands are sent while time passes; also the least time between commands that may change
/// velocities.
const PERIOD: Span = Span(10_000_000);
/// However long ago the last command was, a velocity jumps at most by the acceleration over this time.
const LONGEST_STEP: Span = Span(50_000_000);

/// How often commands had to be corrected or refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitReport {
    /// Base commands beyond a speed limit.
    pub base_speed: u64,
    /// Base commands beyond an acceleration limit.
    pub base_acceleration: u64,
    /// Joint commands beyond a velocity limit.
    pub joint_velocity: u64,
    /// Joint commands beyond an acceleration limit or the room left to brake before a position limit.
    pub joint_acceleration_or_position: u64,
    /// Gripper commands beyond its width or force.
    pub gripper: u64,
    /// Commands refused: not finite, wrong joints, or stopped.
    pub refused: u64,
    /// Times a part braked because it heard nothing.
    pub timeouts: u64,
}

/// A robot within its limits.
pub struct Limited<R: Robot> {
    parts: Arm<R>,
}

/// The arm's view of the core.
struct Arm<R: Robot>(Head<R>);

/// The head's view of the core: arm and head are the same kind of part, so each needs a type of its own.
struct Head<R: Robot>(Core<R>);

struct Core<R: Robot> {
    robot: R,
    /// The present; only `wait_until` moves it.
    now: Stamp,
    base: BaseGuard,
    arm: GroupGuard,
    head: GroupGuard,
    max_width_m: f64,
    max_force_n: f64,
    stopped: Option<String>,
    report: LimitReport,
}

impl<R: Robot> Limited<R> {
    /// Wraps `robot` in the limits of its model. The robot counts as standing still.
    pub fn new(mut robot: R, model: &RobotModel) -> Self {
        let core = Core {
            now: robot.clock().now(),
            robot,
            base: BaseGuard {
                limits: model.settings.base.clone(),
                sent: Twist::default(),
                before: Twist::default(),
                heard: Heard::NEVER,
                commanded: Stamp(0),
            },
            arm: GroupGuard::new(&model.arm),
            head: GroupGuard::new(&model.head),
            max_width_m: model.settings.gripper.max_aperture_m,
            max_force_n: model.settings.gripper.max_force_n,
            stopped: None,
            report: LimitReport::default(),
        };
        Self { parts: Arm(Head(core)) }
    }

    /// How often commands had to be corrected or refused so far.
    pub fn report(&self) -> LimitReport {
        self.core().report
    }

    /// The robot inside.
    pub fn inner(&self) -> &R {
        &self.core().robot
    }

    fn core(&self) -> &Core<R> {
        &self.parts.0.0
    }

    fn core_mut(&mut self) -> &mut Core<R> {
        &mut self.parts.0.0
    }
}

/// Which of the two joint groups.
#[derive(Clone, Copy)]
enum Which {
    Arm,
    Head,
}

impl<R: Robot> Core<R> {
    fn refuse(&mut self, error: DriverError) -> DriverError {
        self.report.refused += 1;
        error
    }

    fn check_stopped(&mut self) -> Result<(), DriverError> {
        match self.stopped.clone().or_else(|| self.robot.emergency_stop().find_reason()) {
            Some(reason) => Err(self.refuse(DriverError::Stopped { reason })),
            None => Ok(()),
        }
    }

    fn group(&mut self, which: Which) -> (&mut GroupGuard, &mut dyn JointGroup) {
        match which {
            Which::Arm => (&mut self.arm, self.robot.arm()),
            Which::Head => (&mut self.head, self.robot.head()),
        }
    }

    fn command_joints(&mut self, which: Which, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.check_stopped()?;
        let now = self.now;
        let mut report = self.report;
        let (guard, _) = self.group(which);
        if velocities.names()[..] != guard.names[..] {
            let names = |names: &JointNames| names.iter().map(|name| name.to_string()).collect();
            let error = DriverError::WrongJoints { expected: names(&guard.names), got: names(velocities.names()) };
            return Err(self.refuse(error));
        }
        if let Some((name, _)) = velocities.iter().find(|(_, value)| !value.is_finite()) {
            let what = format!("the velocity of joint `{name}`");
            return Err(self.refuse(DriverError::NotFinite { what }));
        }
        guard.commanded = now;
        let (_, part) = self.group(which);
        let state = part.state()?;
        let (guard, _) = self.group(which);
        let allowed = guard.clamp(velocities.values(), state.positions.values(), now, &mut report);
        self.report = report;
        self.send_joints(which, allowed)
    }

    fn send_joints(&mut self, which: Which, allowed: Vec<f64>) -> Result<JointVelocities, DriverError> {
        let (guard, part) = self.group(which);
        let mut command = JointVelocities::zeros(&guard.names);
        command.values_mut().copy_from_slice(&allowed);
        let sent = part.command(&command)?;
        guard.sent = sent.values().to_vec();
        Ok(sent)
    }

    /// A braking command that the robot refuses because it has stopped itself: the part counts as standing.
    fn unless_stopped<T>(sent: Result<T, DriverError>, standing: T) -> Result<T, DriverError> {
        match sent {
            Err(DriverError::Stopped { .. }) => Ok(standing),
            other => other,
        }
    }

    /// Sends the next, slower command to every part that is stopped or has heard nothing for too long.
    fn brake_the_silent(&mut self) -> Result<(), DriverError> {
        let now = self.now;
        let stopped = self.stopped.is_some();
        for which in [Which::Arm, Which::Head] {
            let (guard, _) = self.group(which);
            let silent = now - guard.commanded >= JOINT_TIMEOUT;
            if guard.moves() && (silent || stopped) {
                let first = !std::mem::replace(&mut guard.heard.silent, true);
                let step_s = guard.heard.step_s(now).unwrap_or(0.0).min(PERIOD.as_s());
                guard.before.clone_from(&guard.sent);
                guard.heard.at = Some(now);
                let slower = |(velocity, envelope): (&f64, &JointEnvelope)| {
                    let step = envelope.acceleration * step_s;
                    velocity - velocity.clamp(-step, step)
                };
                let allowed = guard.before.iter().zip(&guard.envelopes).map(slower).collect();
                self.report.timeouts += u64::from(first && !stopped);
                let sent = self.send_joints(which, allowed);
                let (guard, _) = self.group(which);
                let standing = JointVelocities::zeros(&guard.names);
                guard.sent = Self::unless_stopped(sent, standing)?.values().to_vec();
            }
        }
        let silent = now - self.base.commanded >= BASE_TIMEOUT;
        if self.base.sent != Twist::default() && (silent || stopped) {
            let first = !std::mem::replace(&mut self.base.heard.silent, true);
            let step_s = self.base.heard.step_s(now).unwrap_or(0.0).min(PERIOD.as_s());
            self.base.before = self.base.sent;
            self.base.heard.at = Some(now);
            let slower = self.base.towards(Twist::default(), step_s);
            self.report.timeouts += u64::from(first && !stopped);
            self.base.sent = Self::unless_stopped(self.robot.base().command(slower), Twist::default())?;
        }
        Ok(())
    }

    fn moves(&self) -> bool {
        self.arm.moves() || self.head.moves() || self.base.sent != Twist::default()
    }
}

impl<R: Robot> Base for Core<R> {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.check_stopped()?;
        if !(twist.forward_m_per_s.is_finite() && twist.turn_rad_per_s.is_finite()) {
            return Err(self.refuse(DriverError::NotFinite { what: "the base's velocity".to_owned() }));
        }
        let now = self.now;
        self.base.commanded = now;
        let allowed = self.base.clamp(twist, now, &mut self.report);
        self.base.sent = self.robot.base().command(allowed)?;
        Ok(self.base.sent)
    }

    fn velocity(&mut self) -> Result<Twist, DriverError> {
        self.robot.base().velocity()
    }
}

impl<R: Robot> JointGroup for Arm<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.0.command_joints(Which::Arm, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.0.robot.arm().state()
    }
}

impl<R: Robot> JointGroup for Head<R> {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.0.command_joints(Which::Head, velocities)
    }

    fn state(&mut self) -> Result<JointState, DriverError> {
        self.0.robot.head().state()
    }
}

impl<R: Robot> Gripper for Core<R> {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.check_stopped()?;
        for (what, value) in [("the gripper's width", width_m), ("the gripper's force", max_force_n)] {
            if !value.is_finite() {
                return Err(self.refuse(DriverError::NotFinite { what: what.to_owned() }));
            }
        }
        let allowed = (width_m.clamp(0.0, self.max_width_m), max_force_n.clamp(0.0, self.max_force_n));
        self.report.gripper += u64::from(allowed != (width_m, max_force_n));
        self.robot.gripper().command(allowed.0, allowed.1)
    }

    fn state(&mut self) -> Result<GripperState, DriverError> {
        self.robot.gripper().state()
    }
}

impl<R: Robot> Clock for Core<R> {
    fn now(&self) -> Stamp {
        self.now
    }

    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        loop {
            let now = self.now;
            if now >= stamp {
                return Ok(());
            }
            let next = if self.moves() { stamp.min(now + PERIOD) } else { stamp };
            self.robot.clock().wait_until(next)?;
            self.now = self.robot.clock().now();
            self.brake_the_silent()?;
        }
    }
}

impl<R: Robot> EmergencyStop for Core<R> {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        self.stopped.get_or_insert_with(|| reason.to_owned());
        // The robot's own stop may be faster than ours; ours does not wait for it.
        let own = self.robot.emergency_stop().trigger(reason);
        self.brake_the_silent()?;
        own
    }

    fn find_reason(&self) -> Option<String> {
        self.stopped.clone()
    }

    fn reset(&mut self) -> Result<(), DriverError> {
        self.robot.emergency_stop().reset()?;
        self.stopped = None;
        Ok(())
    }
}

impl<R: Robot> Robot for Limited<R> {
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
        self.core_mut().robot.cameras()
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self.core_mut().robot.localisation()
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self.core_mut()
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        self.core_mut()
    }
}

#[cfg(test)]
mod tests;
