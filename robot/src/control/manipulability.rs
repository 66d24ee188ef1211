//! Task: away from singular poses, along the gradient of the manipulability.
//!
//! ```text
//! m = sqrt(det(J J')),   dm/dq_i = m trace((J J')^-1 (dJ/dq_i) J')
//! ```
//!
//! `dJ/dq_i` of a geometric Jacobian is made of cross products of its own columns (v linear, w angular part):
//! column j at or after i in the chain turns with joint i, (w_i x v_j, w_i x w_j); before it, its point moves, (w_j x v_i, 0).

use nalgebra::{DMatrix, DVector, Vector3};

/// The manipulability and its gradient. `rank` gives each column's place in the chain from the base outwards; columns
/// that the chain does not hold are zero and stay so.
pub fn manipulability(jacobian: &DMatrix<f64>, rank: &[usize]) -> (f64, DVector<f64>) {
    let n = jacobian.ncols();
    let mut gradient = DVector::zeros(n);
    let square = jacobian * jacobian.transpose();
    let determinant = square.determinant();
    let Some(inverse) = square.try_inverse().filter(|_| determinant > 1e-14) else {
        // At a singular pose there is no gradient.
        return (0.0, gradient);
    };
    let value = determinant.sqrt();
    // trace((JJ')^-1 dJ J') = sum over columns of (dJ)_j . (J'(JJ')^-1)_j
    let pseudo = jacobian.tr_mul(&inverse);
    let linear = |k: usize| -> Vector3<f64> { jacobian.fixed_view::<3, 1>(0, k).into_owned() };
    let angular = |k: usize| -> Vector3<f64> { jacobian.fixed_view::<3, 1>(3, k).into_owned() };
    for i in 0..n {
        let mut trace = 0.0;
        for j in 0..n {
            let (first, second) = match rank[j] >= rank[i] {
                true => (angular(i).cross(&linear(j)), angular(i).cross(&angular(j))),
                false => (angular(j).cross(&linear(i)), Vector3::zeros()),
            };
            for row in 0..3 {
                trace += first[row] * pseudo[(j, row)] + second[row] * pseudo[(j, row + 3)];
            }
        }
        gradient[i] = value * trace;
    }
    (value, gradient)
}
