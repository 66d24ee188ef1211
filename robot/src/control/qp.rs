//! The quadratic program, and the only place that knows the solver.
//!
//! ```text
//! min 1/2 x'Hx + g'x    s.t.  lower <= x <= upper,  row'x <= bound for every row
//! ```
//!
//! The minimum without constraints is computed first: when it satisfies all of them it is the answer. Otherwise an exact
//! active-set search is made. When that cannot tell, or finds the constraints contradictory, clarabel's interior-point
//! solver has the last word; it was set up once for 8, 16, 32 or 64 rows and is updated in place; unused rows read
//! `0 x <= 1`.

use super::active_set;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use nalgebra::{DMatrix, DVector};

/// One inequality `coefficients' x <= bound`.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// One coefficient for each variable.
    pub coefficients: DVector<f64>,
    /// Right-hand side.
    pub bound: f64,
}

/// A convex program over a handful of variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Qp {
    /// Symmetric, positive definite.
    pub hessian: DMatrix<f64>,
    /// Linear cost.
    pub gradient: DVector<f64>,
    /// Least value of each variable, `<= upper`.
    pub lower: DVector<f64>,
    /// Greatest value of each variable.
    pub upper: DVector<f64>,
    /// Inequalities.
    pub rows: Vec<Row>,
}

/// Why there is no solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpFailure {
    /// No point satisfies all constraints.
    Infeasible,
    /// More rows matter at once than the largest solver holds.
    TooManyRows,
    /// The solver gave up, or the numbers were not finite.
    Numerical,
}

/// Which stage gave an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SolvedBy {
    /// The minimum without constraints satisfies all of them.
    Unconstrained,
    /// The exact active-set search.
    ActiveSet,
    /// The interior-point solver clarabel.
    Clarabel,
}

/// How far a row may be exceeded by rounding, in its own unit per second.
const ROW_TOLERANCE: f64 = 1e-6;
/// Rows that the cached solvers hold.
const SIZES: [usize; 4] = [8, 16, 32, 64];

impl Qp {
    /// Whether `x` satisfies box and rows, up to rounding.
    pub fn admits(&self, x: &DVector<f64>) -> bool {
        let inside = (0..x.len()).all(|k| x[k] >= self.lower[k] && x[k] <= self.upper[k]);
        inside && self.rows_hold(x)
    }

    fn rows_hold(&self, x: &DVector<f64>) -> bool {
        self.rows.iter().all(|row| row.coefficients.dot(x) <= row.bound + ROW_TOLERANCE)
    }

    /// Rounding leaves the box by a hair at most.
    fn clamp(&self, x: &mut DVector<f64>) {
        for k in 0..x.len() {
            x[k] = x[k].clamp(self.lower[k], self.upper[k]);
        }
    }

    /// The greatest value that `row'x` can take within the box.
    pub fn greatest(&self, coefficients: &DVector<f64>) -> f64 {
        greatest_in_box(coefficients, &self.lower, &self.upper)
    }
}

/// The greatest value of `coefficients' x` for `lower <= x <= upper`.
pub fn greatest_in_box(coefficients: &DVector<f64>, lower: &DVector<f64>, upper: &DVector<f64>) -> f64 {
    (0..coefficients.len()).map(|k| (coefficients[k] * lower[k]).max(coefficients[k] * upper[k])).sum()
}

/// The least value of `coefficients' x` for `lower <= x <= upper`.
pub fn least_in_box(coefficients: &DVector<f64>, lower: &DVector<f64>, upper: &DVector<f64>) -> f64 {
    -greatest_in_box(&-coefficients, lower, upper)
}

/// Solvers for a fixed number of variables, set up once and updated in place.
pub struct QpSolver {
    variables: usize,
    cached: [Option<Cached>; SIZES.len()],
}

struct Cached {
    solver: DefaultSolver<f64>,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
    matrix: Vec<f64>,
    bounds: Vec<f64>,
}

impl QpSolver {
    /// A solver for programs of `variables` variables.
    pub fn new(variables: usize) -> Self {
        Self { variables, cached: [const { None }; SIZES.len()] }
    }

    /// The minimum, within the box exactly and within the rows up to rounding, by the first stage that has it.
    pub fn solve(&mut self, qp: &Qp) -> Result<(DVector<f64>, SolvedBy), QpFailure> {
        match solve_exactly(qp) {
            Ok(answer) => return Ok(answer),
            Err(QpFailure::Numerical) => return Err(QpFailure::Numerical),
            Err(_) => {}
        }
        let mut rows = binding_rows(qp);
        let largest = SIZES[SIZES.len() - 1];
        if rows.len() > largest {
            rows.sort_by(|a, b| a.0.total_cmp(&b.0));
            rows.truncate(largest);
        }
        let size = SIZES.iter().position(|size| *size >= rows.len()).ok_or(QpFailure::TooManyRows)?;
        let mut x = self.solve_sized(qp, &rows, size)?;
        qp.clamp(&mut x);
        match qp.rows_hold(&x) {
            true => Ok((x, SolvedBy::Clarabel)),
            false if qp.rows.len() > largest => Err(QpFailure::TooManyRows),
            false => Err(QpFailure::Numerical),
        }
    }

    fn solve_sized(&mut self, qp: &Qp, rows: &[(f64, &Row)], size: usize) -> Result<DVector<f64>, QpFailure> {
        let n = self.variables;
        let slot = &mut self.cached[size];
        let cached = match slot {
            Some(cached) => cached,
            None => slot.insert(Cached::new(n, SIZES[size]).ok_or(QpFailure::Numerical)?),
        };
        // An interior point needs an interior: the box is a hair wider here, the caller clamps.
        const HAIR: f64 = 1e-8;
        let per_column = 2 + SIZES[size];
        for column in 0..n {
            cached.bounds[column] = qp.upper[column] + HAIR;
            cached.bounds[n + column] = -qp.lower[column] + HAIR;
            for (k, value) in cached.matrix[column * per_column + 2..(column + 1) * per_column].iter_mut().enumerate() {
                *value = rows.get(k).map_or(0.0, |(_, row)| row.coefficients[column]);
            }
        }
        for (k, bound) in cached.bounds[2 * n..].iter_mut().enumerate() {
            // A hair below, so that the answer holds the row itself.
            *bound = rows.get(k).map_or(1.0, |(_, row)| row.bound - 0.1 * ROW_TOLERANCE);
        }
        // The scale of the cost does not move the minimum, but the solver's tolerances are absolute.
        let scale = 1.0 / qp.hessian.diagonal().max().max(f64::MIN_POSITIVE);
        for column in 0..n {
            for row in 0..=column {
                cached.hessian[column * (column + 1) / 2 + row] = qp.hessian[(row, column)] * scale;
            }
            cached.gradient[column] = qp.gradient[column] * scale;
        }
        cached.solve().map(DVector::from_vec)
    }
}

/// The minimum without the interior-point solver. `Infeasible` also when the search could not tell; `Numerical` when
/// there is no program.
pub fn solve_exactly(qp: &Qp) -> Result<(DVector<f64>, SolvedBy), QpFailure> {
    let finite = qp.hessian.iter().chain(&qp.gradient).chain(&qp.lower).chain(&qp.upper).all(|v| v.is_finite());
    if !finite || qp.rows.iter().any(|row| !row.bound.is_finite() || row.coefficients.iter().any(|c| c.is_nan())) {
        return Err(QpFailure::Numerical);
    }
    let factor = qp.hessian.clone().cholesky().ok_or(QpFailure::Numerical)?;
    let free = factor.solve(&-&qp.gradient);
    if qp.admits(&free) {
        return Ok((free, SolvedBy::Unconstrained));
    }
    let mut x = active_set::solve(qp, &binding_rows(qp), factor.l_dirty(), &free).map_err(|_| QpFailure::Infeasible)?;
    qp.clamp(&mut x);
    if qp.rows_hold(&x) { Ok((x, SolvedBy::ActiveSet)) } else { Err(QpFailure::Infeasible) }
}

/// Rows that some point of the box violates, with their spare room (negative) within the box: others are no constraint.
fn binding_rows(qp: &Qp) -> Vec<(f64, &Row)> {
    let spare = |row: &Row| row.bound - qp.greatest(&row.coefficients);
    qp.rows.iter().map(|row| (spare(row), row)).filter(|(spare, _)| *spare < 0.0).collect()
}

impl Cached {
    /// `None` when the solver refuses the set-up.
    fn new(n: usize, rows: usize) -> Option<Self> {
        let hessian_columns: Vec<usize> = (0..=n).map(|column| column * (column + 1) / 2).collect();
        let hessian_rows: Vec<usize> = (0..n).flat_map(|column| 0..=column).collect();
        let mut hessian = CscMatrix::new(n, n, hessian_columns, hessian_rows, vec![0.0; n * (n + 1) / 2]);
        for column in 0..n {
            hessian.nzval[(column + 1) * (column + 2) / 2 - 1] = 1.0;
        }
        let per_column = 2 + rows;
        let matrix_columns: Vec<usize> = (0..=n).map(|column| column * per_column).collect();
        let mut matrix_rows = Vec::with_capacity(n * per_column);
        let mut matrix = Vec::with_capacity(n * per_column);
        for column in 0..n {
            matrix_rows.extend([column, n + column]);
            matrix.extend([1.0, -1.0]);
            matrix_rows.extend(2 * n..2 * n + rows);
            matrix.resize(matrix.len() + rows, 0.0);
        }
        let bounds = vec![1.0; 2 * n + rows];
        let constraints = CscMatrix::new(2 * n + rows, n, matrix_columns, matrix_rows, matrix.clone());
        let settings: DefaultSettings<f64> = DefaultSettingsBuilder::default()
            .verbose(false)
            .max_threads(1)
            .max_iter(60)
            // In-place updates need the sparsity and the rows as they are, and a scaling that does not depend on
            // the zeros of the set-up.
            .presolve_enable(false)
            .equilibrate_enable(false)
            .tol_gap_abs(1e-8)
            .tol_gap_rel(1e-8)
            .tol_feas(1e-8)
            .build()
            .ok()?;
        let cones = [SupportedConeT::NonnegativeConeT(2 * n + rows)];
        let solver = DefaultSolver::new(&hessian, &vec![0.0; n], &constraints, &bounds, &cones, settings).ok()?;
        Some(Self { solver, hessian: hessian.nzval, gradient: vec![0.0; n], matrix, bounds })
    }

    fn solve(&mut self) -> Result<Vec<f64>, QpFailure> {
        let updated = self.solver.update_P(&self.hessian).is_ok()
            && self.solver.update_q(&self.gradient).is_ok()
            && self.solver.update_A(&self.matrix).is_ok()
            && self.solver.update_b(&self.bounds).is_ok();
        if !updated {
            return Err(QpFailure::Numerical);
        }
        self.solver.solve();
        match self.solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Ok(self.solver.solution.x.clone()),
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Err(QpFailure::Infeasible),
            _ => Err(QpFailure::Numerical),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn program(n: usize, rows: usize, numbers: &[f64]) -> Qp {
        let mut next = numbers.iter().cycle();
        let mut draw = || *next.next().expect("cycle");
        let root = DMatrix::from_fn(n, n, |_, _| draw());
        Qp {
            hessian: &root * root.transpose() + DMatrix::identity(n, n) * 0.01,
            gradient: DVector::from_fn(n, |_, _| 3.0 * draw()),
            lower: DVector::from_fn(n, |_, _| -0.5 - 0.4 * draw()),
            upper: DVector::from_fn(n, |_, _| 0.5 + 0.4 * draw()),
            // Zero satisfies all rows, so that there is a solution.
            rows: (0..rows)
                .map(|_| Row { coefficients: DVector::from_fn(n, |_, _| draw()), bound: 0.1 + 0.1 * draw().abs() })
                .collect(),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// The answer satisfies every constraint, and no feasible point nearby is cheaper.
        #[test]
        fn the_answer_is_feasible_and_no_neighbour_is_cheaper(
            numbers in prop::collection::vec(-1.0..1.0f64, 400),
            rows in 0usize..40,
            towards in prop::collection::vec(-1.0..1.0f64, 8),
        ) {
            let qp = program(8, rows, &numbers);
            let (x, by) = QpSolver::new(8).solve(&qp).expect("zero is feasible");
            prop_assert!(qp.admits(&x));
            prop_assert!(by != SolvedBy::Clarabel);
            // The interior-point solver agrees.
            let all: Vec<(f64, &Row)> = qp.rows.iter().map(|row| (0.0, row)).collect();
            let other = QpSolver::new(8).solve_sized(&qp, &all, 3).expect("zero is feasible");
            prop_assert!((&x - &other).amax() < 1e-4, "{x} {other}");
            let cost = |x: &DVector<f64>| 0.5 * x.dot(&(&qp.hessian * x)) + qp.gradient.dot(x);
            for size in [1.0, 0.1, 0.01] {
                let other = &x + DVector::from_vec(towards.clone()) * size;
                if qp.admits(&other) {
                    prop_assert!(cost(&x) <= cost(&other) + 1e-5, "{} {}", cost(&x), cost(&other));
                }
            }
        }
    }

    #[test]
    fn a_solver_used_before_gives_the_same_answer_as_a_fresh_one() {
        let numbers: Vec<f64> = (0..400).map(|k| (f64::from(k) * 1.7).sin()).collect();
        let other: Vec<f64> = (0..400).map(|k| (f64::from(k) * 2.3).cos()).collect();
        let (qp, first) = (program(8, 12, &numbers), program(8, 10, &other));
        let mut used = QpSolver::new(8);
        used.solve(&first).expect("feasible");
        let (fresh, again) = (QpSolver::new(8).solve(&qp), used.solve(&qp));
        assert_eq!(fresh, again);
    }

    #[test]
    fn contradicting_rows_are_infeasible_and_not_a_number_is_refused() {
        let mut qp = program(2, 0, &[0.3, -0.7, 0.9]);
        let row = |sign: f64, bound: f64| Row { coefficients: DVector::from_vec(vec![sign, 0.0]), bound };
        qp.rows = vec![row(1.0, -0.2), row(-1.0, -0.2)];
        assert_eq!(QpSolver::new(2).solve(&qp), Err(QpFailure::Infeasible));
        qp.rows = vec![row(1.0, f64::NAN)];
        assert_eq!(QpSolver::new(2).solve(&qp), Err(QpFailure::Numerical));
    }
}
