//! Braking at the acceleration limits, part by part.

use super::core::{Core, Which};
use super::state::{Event, Part, SafetyState};
use crate::drivers::{DriverError, Robot, Twist};
use crate::joints::JointVelocities;
use dsm::time::Span;

impl<R: Robot> Core<R> {
    /// Sends the next, slower command to every part that is to stop or has heard nothing for too long.
    pub(super) fn brake(&mut self) {
        let stops = self.state != SafetyState::Running;
        let timeout = Span::from_s(self.settings.command_timeout_s);
        for which in [Which::Arm, Which::Head] {
            let now = self.now;
            let (guard, _) = self.group(which);
            let silent = now - guard.commanded >= timeout;
            if guard.moves() && (silent || stops) {
                let first = !std::mem::replace(&mut guard.heard.silent, true);
                self.report.timeouts += u64::from(first && !stops);
                self.brake_joints(which);
            }
        }
        if self.base.moves() && (stops || self.now - self.base.commanded >= timeout) {
            let first = !std::mem::replace(&mut self.base.heard.silent, true);
            self.report.timeouts += u64::from(first && !stops);
            let slower = self.base.braked(self.now);
            let sent = self.robot.base().command(slower);
            self.base.sent = self.settle(Part::Base, sent, slower, Twist::default());
        }
        if stops && !self.moves() && !self.rolls {
            self.state = std::mem::take(&mut self.state).next(Event::Standstill);
        }
    }

    fn brake_joints(&mut self, which: Which) {
        let now = self.now;
        let (guard, part) = self.group(which);
        let (mut slower, standing) = (JointVelocities::zeros(&guard.names), JointVelocities::zeros(&guard.names));
        slower.values_mut().copy_from_slice(&guard.braked(now));
        let sent = part.command(&slower);
        let sent = self.settle(which.part(), sent, slower, standing);
        self.group(which).0.sent.copy_from_slice(sent.values());
    }

    /// What a part does after a braking command: what it says; what it was told when it does not answer, so that braking
    /// comes to its end; and nothing when it has stopped itself.
    fn settle<T>(&mut self, part: Part, sent: Result<T, DriverError>, told: T, standing: T) -> T {
        match sent {
            Ok(sent) => sent,
            Err(DriverError::Stopped { .. }) => standing,
            Err(error) => {
                self.fault(super::Cause::PartFailed { part, reason: error.to_string() });
                told
            }
        }
    }
}
