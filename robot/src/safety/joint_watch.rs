//! Whether the measured state of a group of joints can be true.

use super::settings::SafetySettings;
use super::state::{Cause, Part};
use crate::drivers::JointState;
use crate::joints::JointNames;
use crate::model::{Group, JointLimits};
use dsm::time::{Span, Stamp};

/// A joint is never measured to move farther than this beyond twice its speed limit: what is pushed gives way, radians or
/// metres.
const SLACK: f64 = 0.1;
/// A joint that was told to move by so much without one bit of its position changing is not measured, radians or metres.
const STUCK: f64 = 0.05;

/// Watches one group.
pub(super) struct JointWatch {
    part: Part,
    names: JointNames,
    limits: Vec<JointLimits>,
    last: Option<(Stamp, Vec<f64>)>,
    /// When the newest state came.
    news_at: Stamp,
    /// When the positions changed last, and by how much each joint was told to move since.
    changed_at: Stamp,
    told: Vec<f64>,
}

/// A moment on both clocks.
#[derive(Clone, Copy)]
pub(super) struct Moment {
    /// Of the envelope, which never goes back.
    pub(super) now: Stamp,
    /// Of the robot, which stamps what is measured.
    pub(super) clock: Stamp,
}

impl JointWatch {
    pub(super) fn new(part: Part, group: &Group, now: Stamp) -> Self {
        Self {
            part,
            names: group.joints.clone(),
            limits: group.limits.clone(),
            last: None,
            news_at: now,
            changed_at: now,
            told: vec![0.0; group.len()],
        }
    }

    /// Forgets what was measured.
    pub(super) fn restart(&mut self, now: Stamp) {
        (self.last, self.news_at, self.changed_at) = (None, now, now);
        self.told.fill(0.0);
    }

    /// What is wrong with a state by itself.
    pub(super) fn find_flaw(&self, state: &JointState) -> Option<Cause> {
        let part = self.part;
        if state.positions.names()[..] != self.names[..] || state.velocities.names()[..] != self.names[..] {
            return Some(Cause::WrongJoints { part });
        }
        let values = || state.positions.values().iter().chain(state.velocities.values());
        (!values().all(|value| value.is_finite())).then_some(Cause::NotFinite { part })
    }

    /// Takes in the state of this moment; `told` are the velocities that the joints follow. Returns what is wrong for good.
    pub(super) fn note(
        &mut self,
        at: Moment,
        state: &JointState,
        told: &[f64],
        settings: &SafetySettings,
    ) -> Option<Cause> {
        let part = self.part;
        if let Some(flaw) = self.find_flaw(state) {
            return Some(flaw);
        }
        let ahead_s = (state.stamp - at.clock).as_s();
        if ahead_s > settings.time_jump_s {
            return Some(Cause::TimeJump { part, by_s: ahead_s });
        }
        let positions = state.positions.values();
        let Some((stamp, before)) = self.last.as_mut() else {
            self.last = Some((state.stamp, positions.to_vec()));
            (self.news_at, self.changed_at) = (at.now, at.now);
            return None;
        };
        let step_s = (state.stamp - *stamp).as_s();
        if step_s < 0.0 {
            return Some(Cause::TimeJump { part, by_s: step_s });
        }
        if step_s == 0.0 {
            return None;
        }
        let pairs = || positions.iter().zip(before.iter());
        let farthest = |limits: &JointLimits| 2.0 * limits.velocity * step_s + SLACK;
        if pairs().zip(&self.limits).any(|((now, before), limits)| (now - before).abs() > farthest(limits)) {
            return Some(Cause::MeasurementJump { part });
        }
        if pairs().any(|(now, before)| now != before) {
            self.changed_at = at.now;
            self.told.fill(0.0);
        } else {
            self.told.iter_mut().zip(told).for_each(|(sum, velocity)| *sum += velocity.abs() * step_s);
        }
        before.copy_from_slice(positions);
        *stamp = state.stamp;
        self.news_at = at.now;
        let unchanged = at.now - self.changed_at > Span::from_s(settings.sensor_timeout_s);
        (unchanged && self.told.iter().any(|way| *way > STUCK)).then_some(Cause::Stuck { part })
    }

    /// Whether nothing newer came for too long.
    pub(super) fn find_silence(&self, now: Stamp, settings: &SafetySettings) -> Option<Cause> {
        let silent = now - self.news_at > Span::from_s(settings.sensor_timeout_s);
        silent.then_some(Cause::Silent { part: self.part })
    }
}
