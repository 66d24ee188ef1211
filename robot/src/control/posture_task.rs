//! Task: joints drift to a preferred posture where the pose task leaves them free.
//!
//! ```text
//! cost w/2 || qdot - k (q_preferred - q) ||^2
//! ```

use nalgebra::{DMatrix, DVector};

/// Adds the task to the cost.
pub fn add_posture_task(
    weight: f64,
    gain_per_s: f64,
    from_posture: &DVector<f64>,
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    for k in 0..from_posture.len() {
        hessian[(k, k)] += weight;
        gradient[k] += weight * gain_per_s * from_posture[k];
    }
}
