//! Limit: links keep their distance from each other.
//!
//! ```text
//! n'(J_a - J_b) qdot <= damper(d),   d = distance of the closest points a and b,   n = direction from a to b
//! ```
//!
//! Normal and Jacobians are in one frame: with the normal in another the row restrains retreat. The base moves both
//! sides alike and has no part in it.

use super::columns::Columns;
use crate::model::{Kinematics, LinkPoses, Other, PairDistance};
use nalgebra::DVector;

/// Closing speed of two links for a unit of each variable; `None` for a pair with an obstacle.
pub fn closing_coefficients(
    columns: &Columns,
    tree: (&Kinematics, &LinkPoses),
    pair: &PairDistance,
) -> Option<DVector<f64>> {
    let Other::Link(other) = pair.other else { return None };
    let normal = pair.normal_to_other.into_inner();
    let mut coefficients = DVector::zeros(columns.len());
    columns.add_speed_along(tree, (pair.link, &pair.point_on_link), &normal, 1.0, &mut coefficients);
    columns.add_speed_along(tree, (other, &pair.point_on_other), &normal, -1.0, &mut coefficients);
    Some(coefficients)
}
