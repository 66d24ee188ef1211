//! Limit: position, velocity and acceleration of each joint as one interval of velocities that is never empty.
//!
//! ```text
//! acceleration  v - a dt <= qdot <= v + a dt
//! velocity      |qdot| <= v_max
//! position      qdot <= -a dt + sqrt((a dt)^2 + 2 a d),  d = q_max - q    (and mirrored)
//! ```
//!
//! The position bound is the discrete one: after one more step at `qdot` there is still room to brake with `a`. The
//! continuous bound `sqrt(2 a d)` overshoots. Outside of limits the intervals may not meet; then acceleration wins,
//! then velocity, then position, so that the joint comes back without a jump.

use crate::model::JointLimits;

/// Rate at which a joint outside of its position limits comes back, 1/s.
const RETURN_RATE_PER_S: f64 = 4.0;

/// The greatest velocity from which a stop within `distance` is possible after one more step, decelerating with
/// `acceleration`; 0 when there is no distance left.
pub fn braking_bound(distance: f64, acceleration: f64, dt_s: f64) -> f64 {
    let step = acceleration * dt_s;
    let distance = distance.max(0.0);
    (-step + (step * step + 2.0 * acceleration * distance).sqrt()).max(0.0)
}

/// What a joint may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointEnvelope {
    /// Least position.
    pub lower: f64,
    /// Greatest position.
    pub upper: f64,
    /// Greatest speed.
    pub velocity: f64,
    /// Greatest acceleration.
    pub acceleration: f64,
}

impl JointEnvelope {
    /// The URDF's limits, `margin` inside the position limits, with a share of the velocity limit.
    pub fn new(limits: &JointLimits, acceleration: f64, margin: f64, velocity_share: f64) -> Self {
        // A margin never takes more than a tenth of the range, so that short joints keep theirs.
        let margin = margin.min(0.1 * (limits.upper - limits.lower));
        Self {
            lower: limits.lower + margin,
            upper: limits.upper - margin,
            velocity: limits.velocity * velocity_share,
            acceleration,
        }
    }

    /// The interval of velocities for the next `dt_s`, at `position`, coming from `velocity`.
    pub fn allowed(&self, position: f64, velocity: f64, dt_s: f64) -> (f64, f64) {
        let step = self.acceleration * dt_s;
        let interval = (velocity - step, velocity + step);
        let interval = meet(interval, (-self.velocity, self.velocity));
        let towards = |distance: f64| match distance < 0.0 {
            true => RETURN_RATE_PER_S * distance,
            false => braking_bound(distance, self.acceleration, dt_s),
        };
        meet(interval, (-towards(position - self.lower), towards(self.upper - position)))
    }
}

/// The intersection, or the point of `first` nearest to `second` when they do not meet.
fn meet(first: (f64, f64), second: (f64, f64)) -> (f64, f64) {
    let lower = second.0.clamp(first.0, first.1);
    let upper = second.1.clamp(first.0, first.1);
    (lower.min(upper), upper.max(lower))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const JOINT: JointEnvelope = JointEnvelope { lower: -1.0, upper: 1.5, velocity: 2.0, acceleration: 4.0 };

    proptest! {
        /// Always at the greatest allowed velocity, for any step, a joint never passes its limit.
        #[test]
        fn full_speed_towards_a_limit_never_passes_it(
            start in -1.0..1.5f64, dt_s in 0.001..0.05f64, acceleration in 0.5..20.0f64, up: bool,
        ) {
            let joint = JointEnvelope { acceleration, ..JOINT };
            let (mut q, mut v) = (start, 0.0);
            for _ in 0..3000 {
                let (low, high) = joint.allowed(q, v, dt_s);
                let next = if up { high } else { low };
                prop_assert!((next - v).abs() <= acceleration * dt_s + 1e-12);
                prop_assert!(next.abs() <= joint.velocity + 1e-12);
                v = next;
                q += v * dt_s;
                prop_assert!(q <= joint.upper + 1e-9 && q >= joint.lower - 1e-9, "{q}");
            }
            let left = if up { joint.upper - q } else { q - joint.lower };
            prop_assert!(left < 0.01);
        }

        /// From anywhere at any velocity the interval is not empty, keeps the acceleration, and leads back.
        #[test]
        fn from_outside_the_interval_exists_and_leads_back(start in -4.0..4.0f64, speed in -6.0..6.0f64) {
            let (mut q, mut v) = (start, speed);
            for _ in 0..2000 {
                let (low, high) = JOINT.allowed(q, v, 0.01);
                prop_assert!(low <= high);
                let next = 0.0_f64.clamp(low, high);
                prop_assert!((next - v).abs() <= 0.04 + 1e-12);
                v = next;
                q += v * 0.01;
            }
            let near = JOINT.lower - 0.01..=JOINT.upper + 0.01;
            prop_assert!(near.contains(&q), "{q}");
        }
    }
}
