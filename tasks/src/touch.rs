//! Feeling that something holds up the base or the arm, before they push with all that the motors have.
//!
//! ```text
//! lag += (v_sent - v_measured) dt - lag dt / T;     touched: |lag| > bound
//! ```
//!
//! A motor that follows its velocity gives its effort for what the joint lags behind, so the lag is the effort against
//! the model's, as an encoder tells it. What is asked for respects the acceleration limits a, and a drive that answers
//! within t lags by at most a t T; a bound well beyond that is only passed when something is in the way.

use dsm_robot::drivers::Twist;
use dsm_robot::joints::JointVelocities;

/// Lag of the base that is no acceleration: 0.8 m/s^2 answered within 0.015 s are 4 mm. At the rim turning counts alike.
const BASE_M: f64 = 0.007;
const BASE_RAD: f64 = 0.025;
/// Lag of a joint that is no acceleration: 8 rad/s^2 answered within 0.015 s are 0.036 rad; of the lift, metres.
const JOINT_RAD: f64 = 0.06;
const LIFT_M: f64 = 0.012;
/// What was lagged so long ago is forgotten, seconds: slow creep under a load is no touch.
const FORGOTTEN_S: f64 = 0.3;

/// Velocities of base and arm, sent or measured.
pub(crate) struct Motion {
    /// The base.
    pub base: Twist,
    /// The arm group, the lift first.
    pub arm: JointVelocities,
}

/// What base and arm lag behind what was sent to them.
#[derive(Default)]
pub(crate) struct Touch {
    forward_m: f64,
    turn_rad: f64,
    joints: Vec<f64>,
    touched: bool,
}

impl Touch {
    /// Notes one period.
    pub(crate) fn note(&mut self, sent: &Motion, measured: &Motion, period_s: f64) {
        let lagged = |lag: f64, sent: f64, measured: f64| {
            // Only what is pushed for counts: a part that is pushed back or overshoots is not held up.
            let lag = lag + (sent - measured) * period_s - lag * period_s / FORGOTTEN_S;
            if lag * sent > 0.0 { lag } else { 0.0 }
        };
        self.forward_m = lagged(self.forward_m, sent.base.forward_m_per_s, measured.base.forward_m_per_s);
        self.turn_rad = lagged(self.turn_rad, sent.base.turn_rad_per_s, measured.base.turn_rad_per_s);
        self.joints.resize(sent.arm.values().len(), 0.0);
        let velocities = sent.arm.values().iter().zip(measured.arm.values());
        for (lag, (sent, measured)) in self.joints.iter_mut().zip(velocities) {
            *lag = lagged(*lag, *sent, *measured);
        }
        let bounds = std::iter::once(LIFT_M).chain(std::iter::repeat(JOINT_RAD));
        self.touched |= self.forward_m.abs() > BASE_M
            || self.turn_rad.abs() > BASE_RAD
            || self.joints.iter().zip(bounds).any(|(lag, bound)| lag.abs() > bound);
    }

    /// What the joints of the arm lag behind now, radians or metres; empty before the first note.
    pub(crate) fn joint_lags(&self) -> &[f64] {
        &self.joints
    }

    /// Whether something was touched since this was last asked.
    pub(crate) fn take(&mut self) -> bool {
        let touched = self.touched;
        if touched {
            *self = Self::default();
        }
        touched
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a base or a joint that is held up is felt within a tenth of a second; one that keeps up with its limits,
    //! or stands, is not.
    use super::*;
    use dsm_robot::joints::JointNames;

    const PERIOD_S: f64 = 0.01;

    fn motion(forward_m_per_s: f64, joint_rad_per_s: f64) -> Motion {
        let names: JointNames = vec!["lift_joint".into(), "arm_1_joint".into()].into();
        let mut arm = JointVelocities::zeros(&names);
        arm.values_mut()[1] = joint_rad_per_s;
        Motion { base: Twist { forward_m_per_s, turn_rad_per_s: 0.0 }, arm }
    }

    /// Seconds until a touch is felt, of a part that answers within 0.015 s and stops at `held_at_s`.
    fn felt_after_s(speed: f64, acceleration: f64, joint: bool, held_at_s: f64) -> Option<f64> {
        let mut touch = Touch::default();
        let (mut sent, mut measured) = (0.0, 0.0);
        (0..300).find_map(|i| {
            let now_s = f64::from(i) * PERIOD_S;
            sent = f64::min(sent + acceleration * PERIOD_S, speed);
            measured += (sent - measured) * PERIOD_S / 0.015;
            if now_s >= held_at_s {
                measured = 0.0;
            }
            let of = |value: f64| if joint { motion(0.0, value) } else { motion(value, 0.0) };
            touch.note(&of(sent), &of(measured), PERIOD_S);
            touch.take().then_some(now_s - held_at_s)
        })
    }

    #[test]
    fn what_holds_up_is_felt() {
        assert!(felt_after_s(0.13, 0.8, false, 1.0).is_some_and(|s| (0.0..0.1).contains(&s)));
        assert!(felt_after_s(1.0, 8.0, true, 1.0).is_some_and(|s| (0.0..0.1).contains(&s)));
        assert_eq!(felt_after_s(0.7, 0.8, false, 9.0), None, "speeding up is no touch");
        assert_eq!(felt_after_s(1.5, 8.0, true, 9.0), None, "speeding up is no touch");
        assert_eq!(felt_after_s(0.0, 0.8, false, 0.0), None);
    }
}
