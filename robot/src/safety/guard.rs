//! What a part was sent last, and what it may be sent next.

use super::{LONGEST_STEP, LimitReport, PERIOD};
use crate::control::joint_limit::JointEnvelope;
use crate::drivers::Twist;
use crate::joints::JointNames;
use crate::model::Group;
use crate::model::settings::BaseSettings;
use dsm::time::Stamp;

/// When a part was last commanded, and what it was allowed to change since.
pub(super) struct Heard {
    /// Stamp of the last command that reached the part.
    pub(super) at: Option<Stamp>,
    /// Whether the silence since then was already counted.
    pub(super) silent: bool,
}

impl Heard {
    pub(super) const NEVER: Self = Self { at: None, silent: false };

    /// Time over which a velocity may change until `now`; `None` when a command came at this very moment.
    pub(super) fn step_s(&self, now: Stamp) -> Option<f64> {
        match self.at {
            None => Some(PERIOD.as_s()),
            Some(at) if now <= at => None,
            Some(at) => Some((now - at).min(LONGEST_STEP).as_s()),
        }
    }
}

pub(super) struct BaseGuard {
    pub(super) limits: BaseSettings,
    pub(super) sent: Twist,
    pub(super) before: Twist,
    pub(super) heard: Heard,
    pub(super) commanded: Stamp,
    /// Whether the last command asks for motion.
    pub(super) wanted: bool,
}

pub(super) struct GroupGuard {
    pub(super) names: JointNames,
    pub(super) envelopes: Vec<JointEnvelope>,
    pub(super) sent: Vec<f64>,
    pub(super) before: Vec<f64>,
    step_s: f64,
    pub(super) heard: Heard,
    pub(super) commanded: Stamp,
    /// Whether the last command asks for motion.
    pub(super) wanted: bool,
}

impl GroupGuard {
    pub(super) fn new(group: &Group) -> Self {
        let envelope = |k: usize| JointEnvelope::new(&group.limits[k], group.max_accelerations[k], 0.0, 1.0);
        Self {
            names: group.joints.clone(),
            envelopes: (0..group.len()).map(envelope).collect(),
            sent: vec![0.0; group.len()],
            before: vec![0.0; group.len()],
            step_s: PERIOD.as_s(),
            heard: Heard::NEVER,
            commanded: Stamp(0),
            wanted: false,
        }
    }

    /// Clamps a command; several commands at the same moment all start from what was sent before that moment.
    pub(super) fn clamp(
        &mut self,
        wanted: &[f64],
        positions: &[f64],
        now: Stamp,
        report: &mut LimitReport,
    ) -> Vec<f64> {
        if let Some(step_s) = self.heard.step_s(now) {
            self.before.clone_from(&self.sent);
            self.step_s = step_s;
        }
        self.heard = Heard { at: Some(now), silent: false };
        let (mut fast, mut sudden) = (false, false);
        let allowed: Vec<f64> = (0..wanted.len())
            .map(|k| {
                let envelope = &self.envelopes[k];
                let slow = wanted[k].clamp(-envelope.velocity, envelope.velocity);
                let (lower, upper) = envelope.allowed(positions[k], self.before[k], self.step_s);
                let sent = slow.clamp(lower, upper);
                fast |= (slow - wanted[k]).abs() > 1e-9;
                sudden |= (sent - slow).abs() > 1e-9;
                sent
            })
            .collect();
        report.joint_velocity += u64::from(fast);
        report.joint_acceleration_or_position += u64::from(sudden);
        allowed
    }

    pub(super) fn moves(&self) -> bool {
        self.sent.iter().any(|v| *v != 0.0)
    }

    /// The next, slower velocities of a part that brakes.
    pub(super) fn braked(&mut self, now: Stamp) -> Vec<f64> {
        let step_s = self.heard.step_s(now).unwrap_or(0.0).min(PERIOD.as_s());
        self.before.clone_from(&self.sent);
        self.heard.at = Some(now);
        let slower = |(velocity, envelope): (&f64, &JointEnvelope)| {
            let step = envelope.acceleration * step_s;
            velocity - velocity.clamp(-step, step)
        };
        self.before.iter().zip(&self.envelopes).map(slower).collect()
    }
}

impl BaseGuard {
    pub(super) fn new(limits: BaseSettings) -> Self {
        Self {
            limits,
            sent: Twist::default(),
            before: Twist::default(),
            heard: Heard::NEVER,
            commanded: Stamp(0),
            wanted: false,
        }
    }

    pub(super) fn moves(&self) -> bool {
        self.sent != Twist::default()
    }

    /// The next, slower twist of a base that brakes.
    pub(super) fn braked(&mut self, now: Stamp) -> Twist {
        let step_s = self.heard.step_s(now).unwrap_or(0.0).min(PERIOD.as_s());
        self.before = self.sent;
        self.heard.at = Some(now);
        self.towards(Twist::default(), step_s)
    }

    pub(super) fn clamp(&mut self, wanted: Twist, now: Stamp, report: &mut LimitReport) -> Twist {
        let step_s = match self.heard.step_s(now) {
            Some(step_s) => {
                self.before = self.sent;
                step_s
            }
            None => PERIOD.as_s(),
        };
        self.heard = Heard { at: Some(now), silent: false };
        let (speed, turn) = (self.limits.max_speed_m_per_s, self.limits.max_turn_rate_rad_per_s);
        let slow = Twist {
            forward_m_per_s: wanted.forward_m_per_s.clamp(-speed, speed),
            turn_rad_per_s: wanted.turn_rad_per_s.clamp(-turn, turn),
        };
        let sent = self.towards(slow, step_s);
        let differs = |a: Twist, b: Twist| {
            (a.forward_m_per_s - b.forward_m_per_s).abs() > 1e-9 || (a.turn_rad_per_s - b.turn_rad_per_s).abs() > 1e-9
        };
        report.base_speed += u64::from(differs(slow, wanted));
        report.base_acceleration += u64::from(differs(sent, slow));
        sent
    }

    /// The twist nearest to `wanted` that the accelerations allow after `step_s`.
    pub(super) fn towards(&self, wanted: Twist, step_s: f64) -> Twist {
        let near =
            |wanted: f64, before: f64, limit: f64| wanted.clamp(before - limit * step_s, before + limit * step_s);
        let (forward, turn) = (self.limits.max_acceleration_m_per_s2, self.limits.max_turn_acceleration_rad_per_s2);
        Twist {
            forward_m_per_s: near(wanted.forward_m_per_s, self.before.forward_m_per_s, forward),
            turn_rad_per_s: near(wanted.turn_rad_per_s, self.before.turn_rad_per_s, turn),
        }
    }
}
