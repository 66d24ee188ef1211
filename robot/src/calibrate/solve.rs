//! Gauss-Newton over pairs of planes.

use super::patches::{Patch, find_patches};
use dsm::Pose;
use dsm::camera::CameraModel;
use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

/// A depth image with where the mount of its camera was.
#[derive(Clone, Debug)]
pub struct View {
    /// `base_from_mount`, from the joints at the moment of the image.
    pub base_from_mount: Pose,
    /// Intrinsics.
    pub model: CameraModel,
    /// Small planes in it, in the frame of the camera.
    pub patches: Vec<Patch>,
}

impl View {
    /// A view of an image of `model`, with depth in metres along z and 0 without a return.
    pub fn new(base_from_mount: Pose, model: CameraModel, depth_m: &[f32]) -> Self {
        Self { base_from_mount, model, patches: find_patches(&model, depth_m) }
    }
}

/// Parameters of the estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateConfig {
    /// Distances from plane to point that are still taken for one surface, metres: the first holds while the estimate is
    /// far off; each for `rounds` iterations. Default 0.2, 0.1, 0.05.
    pub gates_m: [f64; 3],
    /// Iterations with each gate; default 6, range 1 to 100.
    pub rounds: usize,
    /// Normals of one surface differ at most by this, radians; default 0.35, range 0.01 to 1.
    pub normal_gate_rad: f64,
    /// Residuals beyond so many deviations count less (Huber); default 2, range 0.5 to 10.
    pub huber: f64,
    /// Fewer views are refused; default 6, range 3 to 1000.
    pub least_views: usize,
    /// Fewer pairs of planes for a view are refused; default 100, range 10 to 100000.
    pub least_matches_per_view: usize,
    /// The information of a pair about the least known direction (a metre or a radian of it moves a residual by the root of
    /// this, in metres); below it nothing is claimed. Default 0.001, range above 0.
    pub least_information: f64,
}

impl Default for CalibrateConfig {
    fn default() -> Self {
        Self {
            gates_m: [0.2, 0.1, 0.05],
            rounds: 6,
            normal_gate_rad: 0.35,
            huber: 2.0,
            least_views: 6,
            least_matches_per_view: 100,
            least_information: 1e-3,
        }
    }
}

/// An estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// `mount_from_camera`.
    pub mount_from_camera: Pose,
    /// Standard deviations: x, y, z in metres, then about x, y, z in radians, in the frame of the camera. From the scatter of
    /// the residuals, of which those of one plane count once.
    pub sigma: [f64; 6],
    /// Root mean square of the distances between planes before and after, metres.
    pub residual_m: [f64; 2],
    /// Pairs of planes.
    pub matches: usize,
    /// Views.
    pub views: usize,
    /// The information of a pair about the least known direction; see [`CalibrateConfig::least_information`].
    pub information: f64,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub enum CalibrationOutcome {
    /// An estimate.
    Estimated(Calibration),
    /// There are too few views.
    TooFewViews {
        /// So many.
        views: usize,
        /// At least so many are needed.
        required: usize,
    },
    /// The views show too little in common, or too few planes.
    TooFewMatches {
        /// So many pairs.
        matches: usize,
        /// At least so many are needed.
        required: usize,
    },
    /// The motion, or the scene, leaves a direction open.
    Undetermined {
        /// The direction, in the frame of the camera: a shift in metres, then a turn in radians; together of unit length.
        direction: [f64; 6],
        /// What a pair tells of it.
        information: f64,
        /// What is needed.
        required: f64,
    },
    /// The planes lie no closer to each other than before: something moved, or the camera is elsewhere altogether.
    NoBetter {
        /// Root mean square of the distances before and after, metres.
        residual_m: [f64; 2],
    },
}

/// Normal equations over all pairs.
#[derive(Clone, Copy, Default)]
struct Sums {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    weights: f64,
    squares_m2: f64,
    chi_squares: f64,
    matches: usize,
    /// Patches that have a partner.
    patches: usize,
}

/// Estimates `mount_from_camera`, beginning at `guess`. The scene stands still, and the base of the robot, too.
pub fn calibrate(views: &[View], guess: &Pose, config: &CalibrateConfig) -> CalibrationOutcome {
    if views.len() < config.least_views {
        return CalibrationOutcome::TooFewViews { views: views.len(), required: config.least_views };
    }
    let grids: Vec<Grid> = views.iter().map(Grid::new).collect();
    let mut estimate = *guess;
    let required = config.least_matches_per_view * views.len();
    for gate_m in config.gates_m {
        for _ in 0..config.rounds {
            let sums = gather(views, &grids, &estimate, gate_m, config);
            if sums.matches < required {
                return CalibrationOutcome::TooFewMatches { matches: sums.matches, required };
            }
            // An open direction must not run away: it is held where it is.
            let held = sums.information + Matrix6::identity() * (1e-6 * sums.information.trace());
            let Some(solver) = held.cholesky() else { break };
            estimate *= exp(&-solver.solve(&sums.gradient));
        }
    }
    let last_gate_m = config.gates_m[config.gates_m.len() - 1];
    let [before, after] = [guess, &estimate].map(|pose| gather(views, &grids, pose, config.gates_m[0], config));
    let sums = gather(views, &grids, &estimate, last_gate_m, config);
    judge(&estimate, views.len(), [before, after], &sums, config)
}

/// What the last normal equations are worth.
fn judge(estimate: &Pose, views: usize, ends: [Sums; 2], sums: &Sums, config: &CalibrateConfig) -> CalibrationOutcome {
    let required = config.least_matches_per_view * views;
    if sums.matches < required {
        return CalibrationOutcome::TooFewMatches { matches: sums.matches, required };
    }
    // Deviations cancel: what remains is how far a residual moves.
    let eigen = (sums.information / sums.weights).symmetric_eigen();
    let (least, information) = eigen.eigenvalues.argmin();
    if information < config.least_information {
        let direction = eigen.eigenvectors.column(least).into_owned();
        let required = config.least_information;
        return CalibrationOutcome::Undetermined { direction: direction.into(), information, required };
    }
    let residual_m = ends.map(|sums| (sums.squares_m2 / sums.matches.max(1) as f64).sqrt());
    if residual_m[1] > residual_m[0] * (1.0 + 1e-6) {
        return CalibrationOutcome::NoBetter { residual_m };
    }
    let Some(inverse) = sums.information.try_inverse() else {
        let required = config.least_information;
        return CalibrationOutcome::Undetermined { direction: [0.0; 6], information, required };
    };
    // A plane takes part in many pairs, which share its error.
    let scatter = sums.chi_squares / sums.matches as f64;
    let shared = sums.matches as f64 / sums.patches.max(1) as f64;
    let sigma = std::array::from_fn(|k| (inverse[(k, k)] * scatter * shared).max(0.0).sqrt());
    CalibrationOutcome::Estimated(Calibration {
        mount_from_camera: *estimate,
        sigma,
        residual_m,
        matches: sums.matches,
        views,
        information,
    })
}

/// A small motion: shift in metres, then turn in radians.
fn exp(motion: &Vector6<f64>) -> Pose {
    let (shift, turn) = (motion.fixed_rows::<3>(0).into_owned(), motion.fixed_rows::<3>(3).into_owned());
    Pose::from_parts(shift.into(), UnitQuaternion::from_scaled_axis(turn))
}

/// Patches of a view by where they are in the image.
struct Grid {
    columns: usize,
    cells: Vec<Option<usize>>,
}

/// Side of a cell in pixels: not less than the distance between patches.
const CELL_PX: u32 = 12;

impl Grid {
    fn new(view: &View) -> Self {
        let columns = (view.model.width / CELL_PX + 1) as usize;
        let rows = (view.model.height / CELL_PX + 1) as usize;
        let mut cells = vec![None; columns * rows];
        for (index, patch) in view.patches.iter().enumerate() {
            let [column, row] = patch.pixel.map(|pixel| (pixel / CELL_PX) as usize);
            cells[row * columns + column] = Some(index);
        }
        Self { columns, cells }
    }

    fn find(&self, (column, row): (u32, u32)) -> Option<usize> {
        let place = (row / CELL_PX) as usize * self.columns + (column / CELL_PX) as usize;
        self.cells.get(place).copied().flatten()
    }
}

/// Sums over all ordered pairs of views.
fn gather(views: &[View], grids: &[Grid], estimate: &Pose, gate_m: f64, config: &CalibrateConfig) -> Sums {
    let mut sums = Sums::default();
    let base_from_cameras: Vec<Pose> = views.iter().map(|view| view.base_from_mount * estimate).collect();
    for (i, from) in views.iter().enumerate() {
        let mut has_partner = vec![false; from.patches.len()];
        for (j, to) in views.iter().enumerate().filter(|(j, _)| *j != i) {
            let to_from = base_from_cameras[j].inv_mul(&base_from_cameras[i]);
            for (index, patch) in from.patches.iter().enumerate() {
                let seen = to_from * patch.center;
                let found = to.model.find_pixel(&seen).and_then(|pixel| grids[j].find(pixel));
                let Some(other) = found.map(|found| &to.patches[found]) else { continue };
                let offset = seen - other.center;
                let residual_m = other.normal.dot(&offset);
                let cosine = other.normal.dot(&(to_from.rotation * patch.normal));
                if residual_m.abs() > gate_m
                    || offset.norm() > 2.0 * gate_m + 0.1
                    || cosine < config.normal_gate_rad.cos()
                {
                    continue;
                }
                has_partner[index] = true;
                add(&mut sums, &to_from, patch, other, residual_m, config);
            }
        }
        sums.patches += has_partner.iter().filter(|has| **has).count();
    }
    sums
}

/// Adds a pair.
fn add(sums: &mut Sums, to_from: &Pose, patch: &Patch, other: &Patch, residual_m: f64, config: &CalibrateConfig) {
    let rotation = to_from.rotation.to_rotation_matrix();
    let turned_normal: Vector3<f64> = rotation.inverse() * other.normal;
    let seen = (to_from * patch.center).coords;
    // n^T (R - 1) and n^T ([p']x - R [p]x), as columns.
    let shift = turned_normal - other.normal;
    let turn = other.normal.cross(&seen) - turned_normal.cross(&patch.center.coords);
    let row = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    let variance = patch.sigma_m * patch.sigma_m + other.sigma_m * other.sigma_m;
    let deviations = residual_m.abs() / variance.sqrt();
    let huber = if deviations > config.huber { config.huber / deviations } else { 1.0 };
    let weight = huber / variance;
    sums.information += weight * row * row.transpose();
    sums.gradient += weight * residual_m * row;
    sums.weights += weight;
    sums.squares_m2 += residual_m * residual_m;
    sums.chi_squares += huber * deviations * deviations;
    sums.matches += 1;
}

#[cfg(test)]
mod tests {
    //! Contract: the row of a pair is its derivative.
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn the_row_of_a_pair_is_that_of_finite_differences() {
        let pose = |v: [f64; 3], w: [f64; 3]| {
            Pose::from_parts(Vector3::from(v).into(), UnitQuaternion::from_scaled_axis(Vector3::from(w)))
        };
        let (m_i, m_j) = (pose([0.1, 0.2, 1.0], [0.3, -0.2, 0.5]), pose([0.2, 0.1, 1.1], [-0.2, 0.4, 0.1]));
        let estimate = pose([0.02, -0.03, 0.05], [0.1, 0.05, -0.08]);
        let plane = |center: [f64; 3], normal: [f64; 3]| Patch {
            pixel: [0, 0],
            center: Point3::from(center),
            normal: Vector3::from(normal).normalize(),
            sigma_m: 0.5,
        };
        let (patch, other) = (plane([0.3, -0.2, 2.0], [0.1, 0.2, -1.0]), plane([0.2, -0.1, 1.9], [0.3, -0.1, -1.0]));
        let residual = |x: &Pose| {
            let to_from = (m_j * x).inv_mul(&(m_i * x));
            (to_from, other.normal.dot(&(to_from * patch.center - other.center)))
        };
        let (to_from, here) = residual(&estimate);
        let mut sums = Sums::default();
        add(&mut sums, &to_from, &patch, &other, here, &CalibrateConfig { huber: 1e9, ..CalibrateConfig::default() });
        let row = sums.gradient / (sums.weights * here);
        for k in 0..6 {
            let step = |by: f64| residual(&(estimate * exp(&(Vector6::ith(k, by))))).1;
            let slope = (step(1e-6) - step(-1e-6)) / 2e-6;
            assert!((slope - row[k]).abs() < 1e-7, "{k}: {slope} and {}", row[k]);
        }
    }
}
