//! The localiser's error over time: a filter that knows how much of it each object of the map inherited.
//!
//! What is seen first enters the map with the error of that moment. A frame laid onto it (see [`super::align`]) tells
//! where the frame stands beside the map, not beside the world. But the localiser's error has no bias and comes and goes
//! within seconds: over a drive its mean tells where the map stands. So the error e = (x, y, heading) of now and the
//! displacement l_i = (x, y) of every object are estimated together, by an extended Kalman filter (simultaneous
//! localisation and mapping with objects as landmarks):
//!
//! ```text
//! e decays as an Ornstein-Uhlenbeck process, l_i stays
//! a new object:    l_i = J(p_i) e
//! a frame shows:   l_i - J(p_i) e + noise,    J(p) = [1 0 -(p - eye).y; 0 1 (p - eye).x]
//! ```
//!
//! Height and tilt need no filter: the floor in view tells them.

use crate::map::ObjectId;
use crate::time::Stamp;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Point3, Vector2, Vector3};

/// Deviation of the localiser's error that is expected before anything is seen: position along each axis in metres,
/// heading in radians.
const LOCALISER: (f64, f64) = (0.02, 0.007);
/// What of it changes from frame to frame: metres and radians.
const JITTER: (f64, f64) = (0.005, 0.002);
/// Time for which that expectation counts against what is seen, seconds.
const EXPECTED_S: f64 = 20.0;
/// Time in which the localiser's error forgets itself, seconds.
const FORGETS_S: f64 = 10.0;
/// Deviation of what an object's first views err by beside the localiser, metres.
const FIRST_VIEW_M: f64 = 0.005;
/// Deviation of the place of an object that was there before the filter, metres.
const KNOWN_BEFORE_M: f64 = 0.015;
/// Deviation of one look's measure of an object against the map, metres.
const LOOK_M: f64 = 0.010;
/// Matches with which a look is twice as sure as with none besides.
const LOOK_MATCHES: f64 = 10.0;
/// Looks within this time err alike, seconds.
const LOOK_S: f64 = 1.0;
/// How far an object's place wanders while new views of it push older ones out, metres per root of a second.
const RENEWED_M: f64 = 0.001;
/// Innovations beyond this many deviations are of something that has moved.
const GATE: f64 = 3.0;
/// Objects that are estimated at a time; those seen longest ago keep their place.
const MOST: usize = 96;
/// Displacement from which an object is moved, metres.
const WORTH_M: f64 = 0.002;

/// What one frame says of one object.
#[derive(Clone, Debug)]
pub(super) struct Look {
    pub(super) id: ObjectId,
    /// Middle of the matched points, world frame.
    pub(super) center: Point3<f64>,
    /// Where the map has the object, from where the frame as the localiser placed it shows it: metres.
    pub(super) offset: Vector2<f64>,
    /// Matched points.
    pub(super) matches: usize,
}

/// The filter's state: e, then the displacements of the objects.
#[derive(Debug)]
pub(super) struct Drift {
    stamp: Option<Stamp>,
    /// Time since the last frame, seconds.
    step_s: f64,
    /// Variance of the localiser's error as far as it has shown, and the time behind it, seconds.
    variance: Vector3<f64>,
    seen_s: f64,
    /// Correction that the frame was given.
    taken: Vector3<f64>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// In the order of the state, with the time of the last look.
    objects: Vec<(ObjectId, Stamp)>,
}

impl Default for Drift {
    fn default() -> Self {
        let variance = Vector3::new(LOCALISER.0, LOCALISER.0, LOCALISER.1).map(|d| d * d);
        Self {
            stamp: None,
            step_s: LOOK_S,
            variance,
            seen_s: EXPECTED_S,
            taken: Vector3::zeros(),
            mean: DVector::zeros(3),
            covariance: DMatrix::from_diagonal(&DVector::from_column_slice(variance.as_slice())),
            objects: Vec::new(),
        }
    }
}

/// How a point moves with the error of a frame taken from `eye`.
pub(super) fn lever(point: &Point3<f64>, eye: &Point3<f64>) -> Matrix2x3<f64> {
    let arm = point - eye;
    Matrix2x3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x)
}

impl Drift {
    /// Goes on to the time of a frame.
    pub(super) fn advance(&mut self, stamp: Stamp) {
        let dt_s = self.stamp.map_or(f64::INFINITY, |last| (stamp - last).as_s().max(0.0));
        // A frame whose detections came late lies before others that were seen without any.
        self.stamp = Some(self.stamp.map_or(stamp, |last| last.max(stamp)));
        self.step_s = dt_s;
        let kept = (-dt_s / FORGETS_S).exp();
        self.mean.rows_mut(0, 3).scale_mut(kept);
        self.covariance.rows_mut(0, 3).scale_mut(kept);
        self.covariance.columns_mut(0, 3).scale_mut(kept);
        for i in 0..3 {
            self.covariance[(i, i)] += (1.0 - kept * kept) * self.variance[i];
        }
    }

    /// Estimate of the error of the frame: shift in metres and heading in radians, believed from true.
    pub(super) fn error(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(0).into()
    }

    /// How sure [`Self::error`] is, one deviation.
    pub(super) fn deviation(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| (self.covariance[(i, i)].max(0.0) + [JITTER.0, JITTER.0, JITTER.1][i].powi(2)).sqrt())
    }

    fn find(&self, id: ObjectId) -> Option<usize> {
        self.objects.iter().position(|(known, _)| *known == id)
    }

    /// Takes up an object that is new and was made from frames like the last one, which was taken from `eye`.
    pub(super) fn start(&mut self, id: ObjectId, center: &Point3<f64>, eye: &Point3<f64>) {
        if self.find(id).is_some() {
            return;
        }
        let jacobian = lever(center, eye);
        let n = self.mean.len();
        let shared = jacobian * self.covariance.rows(0, 3);
        let own = jacobian * self.covariance.fixed_view::<3, 3>(0, 0) * jacobian.transpose()
            + Matrix2::identity() * FIRST_VIEW_M.powi(2);
        let displacement = jacobian * (self.error() + self.taken);
        self.grow(id);
        self.mean.rows_mut(n, 2).copy_from(&displacement);
        self.covariance.view_mut((n, 0), (2, n)).copy_from(&shared);
        self.covariance.view_mut((0, n), (n, 2)).copy_from(&shared.transpose());
        self.covariance.fixed_view_mut::<2, 2>(n, n).copy_from(&own);
    }

    /// Takes up an object of which nothing is known but that it was in the map; returns its place.
    fn start_known(&mut self, id: ObjectId) -> usize {
        let n = self.mean.len();
        self.grow(id);
        self.covariance.fixed_view_mut::<2, 2>(n, n).fill_diagonal(KNOWN_BEFORE_M.powi(2));
        self.objects.len() - 1
    }

    fn grow(&mut self, id: ObjectId) {
        let n = self.mean.len();
        self.mean.resize_vertically_mut(n + 2, 0.0);
        self.covariance.resize_mut(n + 2, n + 2, 0.0);
        self.objects.push((id, self.stamp.unwrap_or_default()));
    }

    /// Takes in what a frame from `eye` shows that was moved by `taken` before it entered the map. Objects that are new
    /// to the filter were in the map before it.
    pub(super) fn update(&mut self, looks: &[Look], eye: &Point3<f64>, taken: &Vector3<f64>) {
        self.taken = *taken;
        let alike = (LOOK_S / self.step_s.max(1e-3)).max(1.0);
        for look in looks {
            let index = self.find(look.id).unwrap_or_else(|| self.start_known(look.id));
            let place = 3 + 2 * index;
            let renewed = RENEWED_M * RENEWED_M * self.step_s.min(LOOK_S);
            (place..place + 2).for_each(|i| self.covariance[(i, i)] += renewed);
            let jacobian = lever(&look.center, eye);
            let noise = LOOK_M * LOOK_M * alike * (1.0 + LOOK_MATCHES / look.matches.max(1) as f64);
            // Both axes are looked at before either is believed.
            let innovation = |state: &Self, axis: usize| {
                let believed = state.mean[place + axis] - (jacobian.row(axis) * state.mean.rows(0, 3))[0];
                let column = state.covariance.column(place + axis)
                    - state.covariance.columns(0, 3) * jacobian.row(axis).transpose();
                let variance = column[place + axis] - (jacobian.row(axis) * column.rows(0, 3))[0] + noise;
                (look.offset[axis] - believed, variance, column)
            };
            let is_far = |axis: usize| {
                let (difference, variance, _) = innovation(self, axis);
                difference * difference > GATE * GATE * variance
            };
            if is_far(0) || is_far(1) {
                continue;
            }
            for axis in 0..2 {
                let (difference, variance, column) = innovation(self, axis);
                self.mean.axpy(difference / variance, &column, 1.0);
                self.covariance.ger(-1.0 / variance, &column, &column, 1.0);
            }
            self.objects[index].1 = self.stamp.unwrap_or_default();
        }
        self.learn();
    }

    /// How far the localiser errs as a rule: the mean of the error's square under the filter's own estimate (the
    /// maximisation step of expectation maximisation), the same along x and y.
    fn learn(&mut self) {
        if !self.step_s.is_finite() {
            return;
        }
        self.seen_s += self.step_s;
        let part = self.step_s / self.seen_s;
        let square = Vector3::from_fn(|i, _| self.mean[i].powi(2) + self.covariance[(i, i)]);
        let along = 0.5 * (square.x + square.y);
        self.variance += (Vector3::new(along, along, square.z) - self.variance) * part;
    }

    /// The displacements that are worth taking out, now counted as taken out.
    pub(super) fn take_displacements(&mut self) -> Vec<(ObjectId, Vector2<f64>)> {
        let mut taken = Vec::new();
        for (index, (id, _)) in self.objects.iter().enumerate() {
            let place = 3 + 2 * index;
            let displacement = Vector2::new(self.mean[place], self.mean[place + 1]);
            if displacement.norm() >= WORTH_M {
                taken.push((*id, displacement));
                self.mean.rows_mut(place, 2).fill(0.0);
            }
        }
        taken
    }

    /// Drops objects that are gone and, of too many, those seen longest ago.
    pub(super) fn retain(&mut self, is_there: impl Fn(ObjectId) -> bool) {
        let mut oldest: Vec<(Stamp, ObjectId)> = self.objects.iter().map(|(id, stamp)| (*stamp, *id)).collect();
        oldest.sort_unstable();
        let surplus: Vec<ObjectId> =
            oldest.iter().take(self.objects.len().saturating_sub(MOST)).map(|(_, id)| *id).collect();
        for index in (0..self.objects.len()).rev() {
            let id = self.objects[index].0;
            if !is_there(id) || surplus.contains(&id) {
                self.objects.remove(index);
                let place = 3 + 2 * index;
                self.mean = std::mem::replace(&mut self.mean, DVector::zeros(0)).remove_rows(place, 2);
                let covariance = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
                self.covariance = covariance.remove_rows(place, 2).remove_columns(place, 2);
            }
        }
    }

    /// Bytes of its state.
    pub(super) fn bytes(&self) -> usize {
        self.covariance.len() * size_of::<f64>()
    }
}

#[cfg(test)]
mod tests {
    //! Contract: over a drive the mean of the localiser's error is taken out of the map; what moved is left out; objects
    //! come and go.
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn localiser() -> Vector3<f64> {
        Vector3::new(0.02, 0.02, 0.007)
    }

    /// Drives along a row of objects and back: what is left of the displacements, and what they began with, both rms.
    fn drive(seed: u64, seconds: usize) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut drift = Drift::default();
        let places: Vec<Point3<f64>> = (0..12).map(|i| Point3::new(f64::from(i), f64::from(i % 3), 0.5)).collect();
        let mut map: Vec<Option<Vector2<f64>>> = vec![None; places.len()];
        let mut first = map.clone();
        let mut error = localiser().map(|d| d * normal());
        for tick in 0..seconds * 5 {
            let kept = (-0.2f64 / FORGETS_S).exp();
            error = localiser().zip_map(&error, |d, e| e * kept + (1.0 - kept * kept).sqrt() * d * normal());
            let along = (tick as f64 * 0.2 * 0.3 + 11.0) % 22.0 - 11.0;
            let eye = Point3::new(along.abs(), -1.5, 1.2);
            drift.advance(Stamp::from_s(tick as f64 * 0.2));
            let seen: Vec<usize> = (0..places.len()).filter(|i| (places[*i] - eye).norm() < 3.5).collect();
            let looks: Vec<Look> = seen
                .iter()
                .filter_map(|i| {
                    let noise = Vector2::new(normal(), normal()) * LOOK_M;
                    let offset = map[*i]? - lever(&places[*i], &eye) * error + noise;
                    Some(Look { id: ObjectId(*i as u64), center: places[*i], offset, matches: 40 })
                })
                .collect();
            drift.update(&looks, &eye, &-drift.error());
            for (id, displacement) in drift.take_displacements() {
                *map[id.0 as usize].as_mut().unwrap() -= displacement;
            }
            for i in seen {
                if map[i].is_none() {
                    map[i] = Some(lever(&places[i], &eye) * (error + drift.taken));
                    first[i] = Some(lever(&places[i], &eye) * error);
                    drift.start(ObjectId(i as u64), &places[i], &eye);
                }
            }
        }
        let rms = |all: &[Option<Vector2<f64>>]| {
            (all.iter().flatten().map(|d| d.norm_squared()).sum::<f64>() / all.len() as f64).sqrt()
        };
        (rms(&map), rms(&first))
    }

    #[test]
    fn the_mean_of_the_error_is_taken_out() {
        let results: Vec<(f64, f64)> = (0..20).map(|seed| drive(seed, 200)).collect();
        let rms = |pick: fn(&(f64, f64)) -> f64| {
            (results.iter().map(|r| pick(r).powi(2)).sum::<f64>() / results.len() as f64).sqrt()
        };
        let (left, began) = (rms(|r| r.0), rms(|r| r.1));
        assert!(began > 0.02 && left < 0.55 * began, "{left} of {began}");
    }

    #[test]
    fn what_moved_is_left_out() {
        let mut drift = Drift::default();
        let (eye, place) = (Point3::new(0.0, 0.0, 1.2), Point3::new(2.0, 0.0, 0.5));
        drift.advance(Stamp::from_s(0.0));
        drift.start(ObjectId(7), &place, &eye);
        drift.advance(Stamp::from_s(0.2));
        let look = Look { id: ObjectId(7), center: place, offset: Vector2::new(0.4, 0.0), matches: 40 };
        drift.update(&[look], &eye, &Vector3::zeros());
        assert_eq!(drift.error(), Vector3::zeros());
        assert!(drift.take_displacements().is_empty());
    }

    #[test]
    fn objects_come_and_go() {
        let mut drift = Drift::default();
        let eye = Point3::new(0.0, 0.0, 1.2);
        for i in 0..MOST as u64 + 4 {
            drift.advance(Stamp::from_s(i as f64));
            drift.start(ObjectId(i), &Point3::new(1.0, 0.0, 0.5), &eye);
        }
        drift.retain(|id| id != ObjectId(50));
        assert!(
            drift.find(ObjectId(3)).is_none()
                && drift.find(ObjectId(50)).is_none()
                && drift.find(ObjectId(4)).is_some()
        );
        assert_eq!(drift.mean.len(), 3 + 2 * (MOST - 1));
        assert_eq!(drift.covariance.shape(), (drift.mean.len(), drift.mean.len()));
    }
}
