//! Limit: velocity and acceleration of the base, as one interval for each of forward speed and turning rate.
//!
//! ```text
//! acceleration  v - a dt <= v' <= v + a dt,   velocity  |v'| <= v_max      (no position limits; acceleration wins)
//! ```

use super::joint_limit::JointEnvelope;
use crate::model::settings::BaseSettings;

/// Envelopes of forward speed and turning rate.
pub fn base_envelopes(settings: &BaseSettings, velocity_share: f64) -> [JointEnvelope; 2] {
    let endless = |velocity: f64, acceleration: f64| JointEnvelope {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: velocity * velocity_share,
        acceleration,
    };
    [
        endless(settings.max_speed_m_per_s, settings.max_acceleration_m_per_s2),
        endless(settings.max_turn_rate_rad_per_s, settings.max_turn_acceleration_rad_per_s2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_base_gains_speed_by_its_acceleration_up_to_its_limit_and_comes_back_from_beyond() {
        let forward =
            JointEnvelope { lower: f64::NEG_INFINITY, upper: f64::INFINITY, velocity: 0.7, acceleration: 0.8 };
        let at = |v: f64| forward.allowed(0.0, v, 0.1);
        let (low, high) = at(0.0);
        assert!((low + 0.08).abs() < 1e-12 && (high - 0.08).abs() < 1e-12);
        assert_eq!(at(0.68).1, 0.7);
        let (low, high) = at(1.5);
        assert!((high - 1.42).abs() < 1e-12 && low == high, "beyond its speed it brakes at its acceleration");
    }
}
