//! Task: little motion, and the less of the base the nearer the goal.
//!
//! ```text
//! cost 1/2 lambda_q f || qdot ||^2 + 1/2 lambda_b / d || (v, omega) ||^2,   d = distance of the tool from its goal
//! ```
//!
//! `f` is the fading of all lighter tasks. Far away the base is cheap and carries the arm; near the goal it is dear and
//! the arm does the rest (the holistic controller of Haviland, Suenderhauf and Corke).

use super::columns::Columns;
use super::config::ControllerConfig;
use nalgebra::DMatrix;

/// Nearest distance that counts, m.
const NEAREST_M: f64 = 0.005;

/// Adds the task to the cost.
pub fn add_effort_task(
    config: &ControllerConfig,
    columns: &Columns,
    (fade, error_m): (f64, f64),
    hessian: &mut DMatrix<f64>,
) {
    let base = columns.find_base().unwrap_or(columns.len());
    for k in 0..base {
        hessian[(k, k)] += config.damping * fade;
    }
    for k in base..columns.len() {
        hessian[(k, k)] += config.base_damping / error_m.clamp(NEAREST_M, 1.0);
    }
}
