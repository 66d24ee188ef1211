//! Task: the base faces the goal of its tool.
//!
//! ```text
//! cost w/2 ( b' + k b )^2,   b = atan2(y, x) of the goal in the base frame,   b' = y / (x^2 + y^2) v - omega
//! ```

use super::columns::Columns;
use nalgebra::{DMatrix, DVector, Point3};

/// Horizontal distance of the goal below which its bearing says nothing, m.
const NEAREST_M: f64 = 0.05;

/// Bearing of a point that stands on the floor, rad, and its rate for a unit of the base's speed and turning rate.
pub fn bearing(goal: &Point3<f64>) -> (f64, [f64; 2]) {
    let squared = (goal.x * goal.x + goal.y * goal.y).max(NEAREST_M * NEAREST_M);
    (goal.y.atan2(goal.x), [goal.y / squared, -1.0])
}

/// Adds the task to the cost; nothing when the base stands or is at the goal.
pub fn add_facing_task(
    columns: &Columns,
    (weight, gain_per_s): (f64, f64),
    goal: &Point3<f64>,
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    let Some(base) = columns.find_base().filter(|_| goal.x.hypot(goal.y) > NEAREST_M) else { return };
    let (angle, rates) = bearing(goal);
    for (i, first) in rates.iter().enumerate() {
        for (k, second) in rates.iter().enumerate() {
            hessian[(base + i, base + k)] += weight * first * second;
        }
        gradient[base + i] += weight * gain_per_s * angle * first;
    }
}
