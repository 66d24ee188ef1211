//! Limit: links keep their distance from obstacles, which may move.
//!
//! ```text
//! n' J_a qdot <= damper(d) + n' v_obstacle,   d = distance of the closest points,   n = direction from link to obstacle
//! ```

use super::columns::Columns;
use crate::model::{Kinematics, LinkPoses, Obstacle, PairDistance};
use dsm::Pose;
use nalgebra::DVector;

/// Closing speed of a link on a standing obstacle for a unit of each variable. The base stands at `base`, which is the
/// origin but for looks ahead.
pub fn closing_coefficients(
    columns: &Columns,
    (kinematics, poses): (&Kinematics, &LinkPoses),
    base: &Pose,
    pair: &PairDistance,
) -> DVector<f64> {
    let normal = pair.normal_to_other.into_inner();
    let mut coefficients = DVector::zeros(columns.len());
    columns.add_speed_along((kinematics, poses), (pair.link, &pair.point_on_link), &normal, 1.0, &mut coefficients);
    columns.add_base_speed_along(base, &pair.point_on_link, &normal, &mut coefficients);
    coefficients
}

/// Speed at which the obstacle goes away from the link by itself, m/s.
pub fn receding_m_per_s(pair: &PairDistance, obstacle: &Obstacle) -> f64 {
    pair.normal_to_other.dot(&obstacle.velocity_m_per_s())
}
