//! Taking out the pose error of a frame: its observations are laid onto the objects that they show.
//!
//! A localiser's error wanders slowly by centimetres and parts of a degree and is common to all that one frame shows. It
//! would smear shapes and put small things beside themselves. A few steps of iterative closest points over all associated
//! objects, with what is known of the error as prior, estimate the error of this frame relative to the map. The floor
//! in view tells height and tilt by itself, without the map: so neither drifts, and heights are true. What of the error
//! the map has taken over is for [`super::drift`] to tell.

use super::observation::Observation;
use crate::Pose;
use crate::map::MapObject;
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

/// Points of one observation that are matched.
const OBSERVED: usize = 40;
/// Points of one object that they are matched with.
const KNOWN: usize = 400;
/// Matches below which a frame is taken as it is.
const LEAST_MATCHES: usize = 80;
/// Most iterations.
const ITERATIONS: usize = 10;
/// Step (metres and radians) below which the estimate has settled.
const SETTLED: f64 = 1e-3;
/// Farthest match in the first iterations and in all later ones, metres.
const REACH_M: [f64; 4] = [0.16, 0.12, 0.10, 0.07];
/// Residual from which a match counts only linearly, metres.
const HUBER_M: f64 = 0.03;
/// Information of one match, 1/m^2: 5 cm, lowered since neighbouring points err alike.
const MATCH_INFORMATION: f64 = 1.0 / (0.05 * 0.05 * 8.0);
/// Height from which a floor point is something else, in the first and in later iterations, metres.
const FLOOR_REACH_M: [f64; 2] = [0.15, 0.04];
/// Height from which a floor point counts only linearly, metres.
const FLOOR_HUBER_M: f64 = 0.01;
/// Information of one floor point, 1/m^2: 2 cm, lowered since neighbouring points err alike.
const FLOOR_INFORMATION: f64 = 1.0 / (0.02 * 0.02 * 8.0);
/// Accuracy of the localiser in height, metres, and of roll and pitch, radians.
const PRIOR: (f64, f64) = (0.03, 0.01);
/// Largest correction that is believed: position in metres, attitude in radians.
const LARGEST: (f64, f64) = (0.20, 0.07);

/// A frame laid onto the map.
pub(super) struct Fit {
    /// Shift and rotation vector about the camera, in the map's frame.
    pub(super) motion: Vector6<f64>,
    /// Of each pair that has matches.
    pub(super) left: Vec<Left>,
}

/// What a pair still differs by when its frame is laid onto the map.
pub(super) struct Left {
    /// Its place among the pairs.
    pub(super) pair: usize,
    /// Middle of the matched points of the observation, world frame.
    pub(super) center: Point3<f64>,
    /// From there to the object's points, on average.
    pub(super) offset: Vector3<f64>,
    /// Matched points.
    pub(super) matches: usize,
}

/// The correction for observations paired with the objects that they show and for points of the floor; `None` when there
/// is too little to go by or the result is not credible. `deviation` is that of what is left of the error: along x and y
/// in metres and of the heading in radians.
pub(super) fn find_correction(
    pairs: &[(&Observation, &MapObject)],
    floor: &[Point3<f64>],
    eye: &Point3<f64>,
    deviation: &Vector3<f64>,
) -> Option<Fit> {
    let prior = prior_information(deviation);
    let thin = |count: usize, wanted: usize| count.div_ceil(wanted).max(1);
    let sets: Vec<_> = pairs
        .iter()
        .map(|(observation, object)| {
            let observed = observation.points.iter().step_by(thin(observation.points.len(), OBSERVED));
            let known = object.points.iter().step_by(thin(object.points.len(), KNOWN));
            let observed: Vec<Point3<f64>> = observed.map(|p| p.position.cast()).collect();
            let known: Vec<Point3<f32>> = known.map(|p| p.position).collect();
            (observed, known)
        })
        .collect();
    let mut correction = Isometry3::identity();
    let mut found = Vector6::zeros();
    let mut left = Vec::with_capacity(sets.len());
    for iteration in 0..ITERATIONS {
        let reach = REACH_M[iteration.min(REACH_M.len() - 1)];
        let mut information = Matrix6::from_diagonal(&prior);
        let mut pull = -prior.component_mul(&found);
        let mut matches = 0;
        left.clear();
        for (index, (observed, known)) in sets.iter().enumerate() {
            let (mut count, mut middle, mut rest) = (0, Vector3::zeros(), Vector3::zeros());
            for point in observed {
                let point = correction * point;
                let Some(error) = find_closest_offset(&point, known).filter(|e| e.norm() <= reach) else { continue };
                matches += 1;
                count += 1;
                middle += point.coords;
                rest += error;
                let weight = MATCH_INFORMATION * (HUBER_M / error.norm().max(HUBER_M));
                // d(point) = translation + rotation x arm = translation - [arm]x rotation
                let arm = (point - eye).cross_matrix();
                let (cross, square): (Matrix3<f64>, Matrix3<f64>) = (-arm, arm.transpose() * arm);
                let mut top = information.fixed_view_mut::<3, 3>(0, 0);
                top += Matrix3::identity() * weight;
                let mut side = information.fixed_view_mut::<3, 3>(0, 3);
                side += cross * weight;
                let mut below = information.fixed_view_mut::<3, 3>(3, 0);
                below += cross.transpose() * weight;
                let mut bottom = information.fixed_view_mut::<3, 3>(3, 3);
                bottom += square * weight;
                let mut force = pull.fixed_rows_mut::<3>(0);
                force += error * weight;
                let mut torque = pull.fixed_rows_mut::<3>(3);
                torque += cross.transpose() * error * weight;
            }
            if count > 0 {
                let share = 1.0 / f64::from(count as u32);
                left.push(Left {
                    pair: index,
                    center: Point3::from(middle * share),
                    offset: rest * share,
                    matches: count,
                });
            }
        }
        for point in floor {
            let point = correction * point;
            if point.z.abs() > FLOOR_REACH_M[iteration.min(1)] {
                continue;
            }
            matches += 1;
            let weight = FLOOR_INFORMATION * (FLOOR_HUBER_M / point.z.abs().max(FLOOR_HUBER_M));
            let row = height_row(&(point - eye));
            information += row * row.transpose() * weight;
            pull -= row * (point.z * weight);
        }
        if matches < LEAST_MATCHES {
            return None;
        }
        let step = information.cholesky()?.solve(&pull);
        found += step;
        correction = about(eye, &found);
        if step.norm() < SETTLED && iteration > 0 {
            break;
        }
    }
    let (shift, turn) = (found.fixed_rows::<3>(0).norm(), found.fixed_rows::<3>(3).norm());
    (shift <= LARGEST.0 && turn <= LARGEST.1).then_some(Fit { motion: found, left })
}

fn prior_information(deviation: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(deviation.x, deviation.y, PRIOR.0, PRIOR.1, PRIOR.1, deviation.z).map(|d| d.max(1e-4).powi(-2))
}

/// How the height of the point at the end of `arm` changes with the motion: d(z) = t_z + (rotation x arm)_z.
fn height_row(arm: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, 1.0, arm.y, -arm.x, 0.0)
}

/// The motion (translation, rotation vector) with its centre of rotation at the camera.
pub(super) fn about(eye: &Point3<f64>, motion: &Vector6<f64>) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(motion.fixed_rows::<3>(3).into_owned());
    let center = Translation3::from(eye.coords);
    Translation3::from(motion.fixed_rows::<3>(0).into_owned()) * center * turn * center.inverse()
}

fn find_closest_offset(point: &Point3<f64>, known: &[Point3<f32>]) -> Option<Vector3<f64>> {
    let point: Point3<f32> = point.cast();
    let mut best = (f32::INFINITY, Vector3::zeros());
    for other in known {
        let offset = other - point;
        let square = offset.norm_squared();
        if square < best.0 {
            best = (square, offset);
        }
    }
    best.0.is_finite().then(|| best.1.cast())
}

#[cfg(test)]
mod tests {
    //! Contract: the motion that is added to the found one matches finite differences, and identity is identity; the floor
    //! alone tells height and tilt.
    use super::*;

    #[test]
    fn motion_turns_about_the_camera() {
        let eye = Point3::new(1.0, 2.0, 1.2);
        let motion = Vector6::new(0.01, -0.02, 0.005, 1e-4, -2e-4, 3e-4);
        let point = Point3::new(3.0, 1.0, 0.4);
        let linear = point.coords + motion.fixed_rows::<3>(0) + motion.fixed_rows::<3>(3).cross(&(point - eye));
        assert!((about(&eye, &motion) * point - Point3::from(linear)).norm() < 1e-6);
        assert!((about(&eye, &Vector6::zeros()) * point - point).norm() < 1e-12);
    }

    #[test]
    fn the_row_of_a_height_matches_finite_differences() {
        let (eye, point) = (Point3::new(1.0, 2.0, 1.2), Point3::new(3.0, 1.0, 0.02));
        let row = height_row(&(point - eye));
        for axis in 0..6 {
            let mut motion = Vector6::zeros();
            motion[axis] = 1e-6;
            let moved = (about(&eye, &motion) * point).z - point.z;
            assert!((moved / 1e-6 - row[axis]).abs() < 1e-4, "axis {axis}: {moved}");
        }
    }

    #[test]
    fn the_floor_tells_height_and_tilt() {
        let eye = Point3::new(0.0, 0.0, 1.2);
        let error = about(&eye, &Vector6::new(0.02, -0.01, 0.04, 0.012, -0.008, 0.01));
        let truth = (0..400).map(|i| Point3::new(0.8 + 0.1 * f64::from(i % 20), -1.0 + 0.1 * f64::from(i / 20), 0.0));
        // A few points of a box that stands on the floor.
        let box_points = (0..30).map(|i| Point3::new(1.5, 0.01 * f64::from(i), 0.03));
        let believed: Vec<Point3<f64>> = truth.clone().chain(box_points).map(|p| error * p).collect();
        let deviation = Vector3::new(0.03, 0.03, 0.01);
        let fit = find_correction(&[], &believed, &(error * eye), &deviation).unwrap();
        let correction = about(&(error * eye), &fit.motion);
        let worst = truth.map(|p| (correction * error * p).z.abs()).fold(0.0, f64::max);
        assert!(worst < 0.004, "{worst}");
        assert!(find_correction(&[], &believed[..40], &eye, &deviation).is_none(), "forty points are too few");
    }
}
