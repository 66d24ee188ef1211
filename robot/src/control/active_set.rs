//! A dual active-set method for small dense programs (Goldfarb and Idnani, 1983).
//!
//! It starts at the minimum without constraints and takes in the most violated constraint, one after the other, along
//! `z = J2 J2' n` in the primal and `r = R^-1 J1' n` in the dual, where `H = L L'`, `J = L^-T Q` and `N = L Q [R; 0]`
//! for the active normals `N`; a constraint whose multiplier would become negative is dropped on the way. The answer
//! is exact: it is checked against the conditions of Karush, Kuhn and Tucker before it is given.

use super::qp::{Qp, Row};
use nalgebra::DVector;

/// Most variables that this solver takes.
pub(super) const MAX_VARIABLES: usize = 16;
/// Exchanges after which it gives up; a program of this size needs a handful.
const MAX_EXCHANGES: usize = 120;
/// How far a constraint may be exceeded, in its own unit per second.
const TOLERANCE: f64 = 1e-9;
/// Error of the stationarity condition, relative to the cost.
const STATIONARY: f64 = 1e-7;

type Square = [[f64; MAX_VARIABLES]; MAX_VARIABLES];
type Line = [f64; MAX_VARIABLES];

/// How a search ended without an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unsolved {
    /// The constraints contradict each other.
    Infeasible,
    /// It cannot tell: too many variables, rounding, or too many exchanges.
    Unknown,
}

/// One side of the box or one row, as `a'x <= b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Constraint {
    Upper(usize),
    Lower(usize),
    Row(usize),
}

/// The state of one search. Matrices are kept by columns.
struct Search<'a> {
    n: usize,
    qp: &'a Qp,
    rows: &'a [(f64, &'a Row)],
    x: Line,
    /// Columns of `J`.
    j: Square,
    /// Columns of the upper triangular `R`.
    r: Square,
    active: [Constraint; MAX_VARIABLES],
    multipliers: Line,
    count: usize,
}

/// The minimum of `qp` within its box and `rows` (of which the first parts are ignored). `factor` is the lower Cholesky
/// factor of the Hessian and `free` the minimum without constraints.
pub(super) fn solve(
    qp: &Qp,
    rows: &[(f64, &Row)],
    factor: &nalgebra::DMatrix<f64>,
    free: &DVector<f64>,
) -> Result<DVector<f64>, Unsolved> {
    let n = free.len();
    if n > MAX_VARIABLES {
        return Err(Unsolved::Unknown);
    }
    let mut search = Search {
        n,
        qp,
        rows,
        x: [0.0; MAX_VARIABLES],
        j: inverse_transposed(factor),
        r: [[0.0; MAX_VARIABLES]; MAX_VARIABLES],
        active: [Constraint::Upper(0); MAX_VARIABLES],
        multipliers: [0.0; MAX_VARIABLES],
        count: 0,
    };
    search.x[..n].copy_from_slice(free.as_slice());
    let mut exchanges = 0;
    while let Some(constraint) = search.most_violated() {
        search.take_in(constraint, &mut exchanges)?;
    }
    match search.is_stationary() {
        true => Ok(DVector::from_column_slice(&search.x[..n])),
        false => Err(Unsolved::Unknown),
    }
}

/// Columns of `L^-T`.
fn inverse_transposed(factor: &nalgebra::DMatrix<f64>) -> Square {
    let n = factor.nrows();
    let mut columns = [[0.0; MAX_VARIABLES]; MAX_VARIABLES];
    // Row k of L^-T is column k of L^-1: forward substitution with the unit vector k.
    for k in 0..n {
        let mut inverse = [0.0; MAX_VARIABLES];
        for row in k..n {
            let mut sum = if row == k { 1.0 } else { 0.0 };
            for column in k..row {
                sum -= factor[(row, column)] * inverse[column];
            }
            inverse[row] = sum / factor[(row, row)];
        }
        for (column, value) in columns.iter_mut().zip(&inverse).skip(k) {
            column[k] = *value;
        }
    }
    columns
}

impl Search<'_> {
    /// How much room `x` leaves: negative when the constraint is violated.
    fn room(&self, constraint: Constraint) -> f64 {
        match constraint {
            Constraint::Upper(k) => self.qp.upper[k] - self.x[k],
            Constraint::Lower(k) => self.x[k] - self.qp.lower[k],
            Constraint::Row(k) => {
                let row = self.rows[k].1;
                row.bound - (0..self.n).map(|i| row.coefficients[i] * self.x[i]).sum::<f64>()
            }
        }
    }

    /// The normal that points into the feasible side.
    fn inward(&self, constraint: Constraint) -> Line {
        let mut normal = [0.0; MAX_VARIABLES];
        match constraint {
            Constraint::Upper(k) => normal[k] = -1.0,
            Constraint::Lower(k) => normal[k] = 1.0,
            Constraint::Row(k) => {
                for (value, coefficient) in normal.iter_mut().zip(self.rows[k].1.coefficients.iter()) {
                    *value = -coefficient;
                }
            }
        }
        normal
    }

    fn most_violated(&self) -> Option<Constraint> {
        let sides = (0..self.n).flat_map(|k| [Constraint::Upper(k), Constraint::Lower(k)]);
        let mut worst = (-TOLERANCE, None);
        for constraint in sides.chain((0..self.rows.len()).map(Constraint::Row)) {
            let room = self.room(constraint);
            if room < worst.0 {
                worst = (room, Some(constraint));
            }
        }
        worst.1
    }

    /// Moves along the dual until `constraint` holds; drops others on the way.
    fn take_in(&mut self, constraint: Constraint, exchanges: &mut usize) -> Result<(), Unsolved> {
        let (n, normal) = (self.n, self.inward(constraint));
        let mut multiplier = 0.0;
        loop {
            *exchanges += 1;
            if *exchanges > MAX_EXCHANGES {
                return Err(Unsolved::Unknown);
            }
            let mut d = [0.0; MAX_VARIABLES];
            for (value, column) in d.iter_mut().zip(&self.j[..n]) {
                *value = (0..n).map(|i| column[i] * normal[i]).sum();
            }
            // Step of the multipliers: R r = d1.
            let mut r = [0.0; MAX_VARIABLES];
            for k in (0..self.count).rev() {
                let sum: f64 = (k + 1..self.count).map(|c| self.r[c][k] * r[c]).sum();
                r[k] = (d[k] - sum) / self.r[k][k];
            }
            let (mut dual_step, mut drops) = (f64::INFINITY, 0);
            for (k, rate) in r[..self.count].iter().enumerate() {
                if *rate > 1e-13 && self.multipliers[k] / rate < dual_step {
                    (dual_step, drops) = (self.multipliers[k] / rate, k);
                }
            }
            let whole: f64 = d[..n].iter().map(|v| v * v).sum();
            let across: f64 = d[self.count..n].iter().map(|v| v * v).sum();
            let room = self.room(constraint);
            let primal_step = if across > 1e-14 * whole { (-room / across).max(0.0) } else { f64::INFINITY };
            let step = dual_step.min(primal_step);
            if step == f64::INFINITY {
                return Err(Unsolved::Infeasible);
            }
            for (value, rate) in self.multipliers.iter_mut().zip(&r[..self.count]) {
                *value = (*value - step * rate).max(0.0);
            }
            multiplier += step;
            if primal_step.is_finite() {
                for (column, along) in self.j[self.count..n].iter().zip(&d[self.count..n]) {
                    for (value, part) in self.x[..n].iter_mut().zip(column) {
                        *value += step * along * part;
                    }
                }
            }
            if step == primal_step {
                self.add(constraint, multiplier, d);
                return Ok(());
            }
            self.drop_at(drops);
        }
    }

    /// Adds an active constraint; `d` is `J'n`.
    fn add(&mut self, constraint: Constraint, multiplier: f64, mut d: Line) {
        for k in (self.count + 1..self.n).rev() {
            let (cos, sin, length) = rotation(d[k - 1], d[k]);
            (d[k - 1], d[k]) = (length, 0.0);
            self.rotate_columns(k - 1, k, cos, sin);
        }
        self.r[self.count] = d;
        self.active[self.count] = constraint;
        self.multipliers[self.count] = multiplier;
        self.count += 1;
    }

    fn drop_at(&mut self, at: usize) {
        for k in at..self.count - 1 {
            self.r[k] = self.r[k + 1];
            self.active[k] = self.active[k + 1];
            self.multipliers[k] = self.multipliers[k + 1];
        }
        self.count -= 1;
        for k in at..self.count {
            let (cos, sin, length) = rotation(self.r[k][k], self.r[k][k + 1]);
            (self.r[k][k], self.r[k][k + 1]) = (length, 0.0);
            for column in &mut self.r[k + 1..self.count] {
                let (above, below) = (column[k], column[k + 1]);
                column[k] = cos * above + sin * below;
                column[k + 1] = cos * below - sin * above;
            }
            self.rotate_columns(k, k + 1, cos, sin);
        }
    }

    fn rotate_columns(&mut self, first: usize, second: usize, cos: f64, sin: f64) {
        for i in 0..self.n {
            let (a, b) = (self.j[first][i], self.j[second][i]);
            self.j[first][i] = cos * a + sin * b;
            self.j[second][i] = cos * b - sin * a;
        }
    }

    /// Whether `H x + g` is a sum of the active normals with weights that are not negative.
    fn is_stationary(&self) -> bool {
        let n = self.n;
        let mut left = [0.0; MAX_VARIABLES];
        let mut scale = 1e-9_f64;
        for (i, value) in left[..n].iter_mut().enumerate() {
            let slope: f64 = (0..n).map(|k| self.qp.hessian[(i, k)] * self.x[k]).sum();
            *value = slope + self.qp.gradient[i];
            scale = scale.max(slope.abs()).max(self.qp.gradient[i].abs());
        }
        for k in 0..self.count {
            let normal = self.inward(self.active[k]);
            for (value, part) in left[..n].iter_mut().zip(&normal) {
                *value -= self.multipliers[k] * part;
            }
        }
        left[..n].iter().all(|v| v.abs() <= STATIONARY * scale)
    }
}

/// Cosine, sine and length with `cos a + sin b = length` and `cos b - sin a = 0`.
fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    let length = a.hypot(b);
    if length > 0.0 { (a / length, b / length, length) } else { (1.0, 0.0, 0.0) }
}
