//! What grasp planning needs to know of the surroundings of a target.

use super::cloud::{Cells, main_part, quantile, thin};
use dsm::map::{Map, ObjectId};
use nalgebra::{Point2, Point3};

/// From where the arm comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ApproachFrom {
    /// From a base that stands here; world frame, metres.
    Base(Point2<f64>),
    /// From anywhere: for choosing where the base should stand.
    Anywhere,
}

/// A target among its neighbours. World frame, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspScene {
    /// Surface points of the target, thinned.
    pub target: Vec<Point3<f64>>,
    /// Surface points of everything else near it, thinned; what carries the target belongs to it.
    pub obstacles: Vec<Point3<f64>>,
    /// Height of the surface that carries the target.
    pub support_z_m: f64,
    /// From where the arm comes.
    pub from: ApproachFrom,
}

/// Side of the cells in which points are averaged, metres: about the spacing of fused clouds.
const THIN_M: f64 = 0.005;
/// Largest step between points of one object, metres.
const JOIN_M: f64 = 0.03;

impl GraspScene {
    /// The surroundings of an object of the map; `None` when the map does not hold it or it has no points.
    pub fn from_map(map: &Map, target: ObjectId, from: ApproachFrom) -> Option<Self> {
        const AROUND_M: f64 = 0.5;
        let object = map.find_object(target)?;
        let points: Vec<Point3<f64>> = object.points.iter().map(|p| p.position.cast()).collect();
        let around = object.bounds.aabb().grown(AROUND_M);
        let inside = |o: &dsm::map::MapObject| {
            // A second node for the same thing (not merged yet) must not block every grasp of it.
            let within = o.points.iter().filter(|p| object.bounds.contains(&p.position.cast(), 0.01)).count();
            2 * within > o.points.len()
        };
        let obstacles: Vec<Point3<f64>> = map
            .objects
            .values()
            .filter(|o| o.id != target && !inside(o))
            .flat_map(|o| o.points.iter().map(|p| p.position.cast::<f64>()))
            .filter(|p| around.contains(p))
            .collect();
        Self::from_points(&points, &obstacles, from)
    }

    /// From the points of the target and of everything else; `None` without points of the target.
    pub fn from_points(target: &[Point3<f64>], obstacles: &[Point3<f64>], from: ApproachFrom) -> Option<Self> {
        let target = main_part(&thin(target, THIN_M), JOIN_M);
        let bottom = quantile(target.iter().map(|p| p.z), 0.02)?;
        let obstacles = drop_bleeding(&target, thin(obstacles, THIN_M), bottom);
        let support_z_m = find_support(&target, &obstacles, bottom);
        Some(Self { target, obstacles, support_z_m, from })
    }

    /// Height of the target's centre of mass above what carries it, metres, as if it were of one stuff and round: each
    /// slice weighs as the square of its width. The neck of a bottle is half of its height and a tenth of its weight.
    pub fn balance_m(&self) -> f64 {
        const SLICE_M: f64 = 0.01;
        /// Directions in which a slice is measured; from one side only the one across the view shows its width.
        const DIRECTIONS: usize = 8;
        let top_m = quantile(self.target.iter().map(|p| p.z), 0.98).unwrap_or(self.support_z_m) - self.support_z_m;
        let slices = (top_m / SLICE_M).ceil().max(1.0) as usize;
        let slice_of = |p: &Point3<f64>| (((p.z - self.support_z_m) / SLICE_M).max(0.0) as usize).min(slices - 1);
        let mut extents = vec![[(f64::MAX, f64::MIN); DIRECTIONS]; slices];
        for point in &self.target {
            for (k, extent) in extents[slice_of(point)].iter_mut().enumerate() {
                let (sin, cos) = (k as f64 * std::f64::consts::PI / DIRECTIONS as f64).sin_cos();
                let along = point.x * cos + point.y * sin;
                *extent = (extent.0.min(along), extent.1.max(along));
            }
        }
        let width = |slice: &[(f64, f64); DIRECTIONS]| slice.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        // What is not seen, as from above, is as wide as what is seen over it.
        let (mut last, mut weight, mut moment) = (0.0, 0.0, 0.0);
        for (i, slice) in extents.iter().enumerate().rev() {
            let seen = width(slice);
            last = if seen > 0.0 { seen } else { last };
            weight += last * last;
            moment += last * last * (i as f64 + 0.5) * SLICE_M;
        }
        if weight > 0.0 { (moment / weight).min(top_m) } else { 0.5 * top_m }
    }
}

/// Drops points of others that lie on the target's own surface: borders of masks bleed onto neighbours. Points at the
/// height of the support stay.
fn drop_bleeding(target: &[Point3<f64>], obstacles: Vec<Point3<f64>>, bottom_m: f64) -> Vec<Point3<f64>> {
    const BLEED_M: f64 = 0.008;
    let cells = Cells::new(target, BLEED_M);
    obstacles.into_iter().filter(|p| p.z < bottom_m + 0.01 || cells.near(p).is_empty()).collect()
}

/// Height of the surface below the target: the median of what lies below and around it close to its lowest points, else
/// the floor, when that is close, or the lowest points themselves.
fn find_support(target: &[Point3<f64>], obstacles: &[Point3<f64>], bottom_m: f64) -> f64 {
    const AROUND_M: f64 = 0.08;
    const MIN_POINTS: usize = 5;
    // The lowest points of things seen from above may lie well over the support.
    let reach = (-0.05, 0.012);
    let low = target.iter().fold(Point2::new(f64::MAX, f64::MAX), |a, p| a.inf(&p.xy()));
    let high = target.iter().fold(Point2::new(f64::MIN, f64::MIN), |a, p| a.sup(&p.xy()));
    let near = |p: &&Point3<f64>| {
        let over = p.z - bottom_m;
        let inside = (0..2).all(|i| p[i] > low[i] - AROUND_M && p[i] < high[i] + AROUND_M);
        inside && over > reach.0 && over < reach.1
    };
    let heights: Vec<f64> = obstacles.iter().filter(near).map(|p| p.z).collect();
    if heights.len() < MIN_POINTS {
        // The floor is no object of a map: what fell down lies on it.
        return if bottom_m < -reach.0 { bottom_m.min(0.0) } else { bottom_m };
    }
    quantile(heights, 0.5).unwrap_or(bottom_m).min(bottom_m + 0.005)
}

#[cfg(test)]
mod tests {
    //! Contract: what lies on the floor stands on it, however little of its lower half was seen.
    use super::*;

    #[test]
    fn an_apple_seen_from_above_lies_on_the_floor() {
        let cap = |bottom_m: f64| -> Vec<Point3<f64>> {
            let ring = |i: i32| (f64::from(i % 12) * 0.52, 0.036 * (1.0 - f64::from(i / 12) / 8.0));
            (0..96)
                .map(|i| (ring(i), i))
                .map(|((turn, r), i)| {
                    Point3::new(1.0 + r * turn.cos(), r * turn.sin(), bottom_m + 0.004 * f64::from(i / 12))
                })
                .collect()
        };
        let support =
            |bottom_m: f64| GraspScene::from_points(&cap(bottom_m), &[], ApproachFrom::Anywhere).unwrap().support_z_m;
        assert_eq!(support(0.035), 0.0);
        assert!((support(0.3) - 0.3).abs() < 0.01, "on a shelf that was not seen its lowest points count");
    }
}
