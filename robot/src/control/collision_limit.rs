//! Limit: velocity dampers between links, and between links and obstacles.
//!
//! ```text
//! n'(J_p - J_other) qdot <= min(xi (d - d_s), braking(d - d_s)) + n'v_obstacle
//! ```
//!
//! `n` points from the link to the other side and `J_p` is the Jacobian of the closest point, both in the base frame
//! (with the normal in one frame and the Jacobian in another the row restrains retreat). NEO's damper alone can ask
//! for more deceleration than there is, so the braking bound caps it. Closer than `d_s` the bound is negative: retreat,
//! at a bounded speed. What the joints cannot reach within the next step is not asked for.

use super::config::ControllerConfig;
use super::joint_limit::braking_bound;
use super::qp::{Row, greatest_in_box, least_in_box};
use crate::model::{Group, Kinematics, LinkPoses, Obstacle, Other, PairDistance};
use nalgebra::DVector;

/// The greatest closing speed in m/s at a distance, `stop_m` being the distance at which it ends.
pub fn closing_speed_bound(config: &ControllerConfig, distance_m: f64, stop_m: f64, dt_s: f64) -> f64 {
    let spare_m = distance_m - stop_m;
    if spare_m < 0.0 {
        return (config.damper_per_s * spare_m).max(-config.retreat_m_per_s);
    }
    (config.damper_per_s * spare_m).min(braking_bound(spare_m, config.braking_m_per_s2, dt_s))
}

/// The distance from which a row can matter: beyond it no link, however fast, is slowed.
///
/// `d_s + v dt + max(braking distance, v / xi)` for the greatest closing speed `v`.
pub fn influence_m(config: &ControllerConfig, stop_m: f64, closing_m_per_s: f64, dt_s: f64) -> f64 {
    let braking = closing_m_per_s * closing_m_per_s / (2.0 * config.braking_m_per_s2);
    stop_m + closing_m_per_s * dt_s + braking.max(closing_m_per_s / config.damper_per_s)
}

/// Coefficients of the closing speed of a pair over the group's joint velocities.
pub fn closing_coefficients(
    kinematics: &Kinematics,
    poses: &LinkPoses,
    group: &Group,
    pair: &PairDistance,
) -> DVector<f64> {
    let normal = pair.normal_to_other.into_inner();
    let own = kinematics.jacobian(poses, pair.link, &pair.point_on_link, group);
    let mut coefficients = own.rows(0, 3).tr_mul(&normal);
    if let Other::Link(other) = pair.other {
        let other = kinematics.jacobian(poses, other, &pair.point_on_other, group);
        coefficients -= other.rows(0, 3).tr_mul(&normal);
    }
    coefficients
}

/// The row of a pair; `None` when no velocity of the box can violate it.
pub fn find_row(
    config: &ControllerConfig,
    coefficients: DVector<f64>,
    pair: &PairDistance,
    obstacles: &[Obstacle],
    (lower, upper): (&DVector<f64>, &DVector<f64>),
    dt_s: f64,
) -> Option<Row> {
    let (stop_m, retreating_m_per_s) = match pair.other {
        Other::Link(_) => (config.self_stop_m, 0.0),
        Other::Obstacle(index) => {
            (config.obstacle_stop_m, pair.normal_to_other.dot(&obstacles[index].velocity_m_per_s()))
        }
    };
    let bound = closing_speed_bound(config, pair.distance_m, stop_m, dt_s) + retreating_m_per_s;
    if greatest_in_box(&coefficients, lower, upper) <= bound {
        return None;
    }
    let reachable = least_in_box(&coefficients, lower, upper);
    Some(Row { coefficients, bound: bound.max(reachable) })
}
