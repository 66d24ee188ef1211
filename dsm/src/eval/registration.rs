//! Where the parts of a map lie on the truth.
//!
//! A map is made in the frame that the localiser believed, which wanders: at 5 cm a lemon lies in the board that carries it.
//! That is an error of place, and boxes and point errors are measured with it. What is one thing, what is two and what is
//! nothing is asked after each neighbourhood was laid onto the truth, as the path of a localiser is before its drift is told.

use super::matching::pick;
use super::nearest::PointGrid;
use super::scene::TrueScene;
use crate::map::MapObject;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Objects whose middles are closer than this move together, metres: what one view shows of a room.
const NEIGHBOURHOOD_M: f64 = 1.5;
/// Neighbours, with the object itself, that can tell a shift: one alone may be misplaced by itself.
const LEAST_OBJECTS: usize = 3;
/// Points of one object: a table tells no more than a mug.
const POINTS: usize = 8;
/// Farthest true surface of a point in the first and in later steps, metres.
const REACH_M: [f32; 3] = [0.15, 0.12, 0.08];
/// Steps of closest points.
const STEPS: usize = 8;
/// Step at which the shift has settled, metres.
const SETTLED_M: f32 = 1e-3;
/// Largest shift, metres: three deviations of the largest error that maps are measured at.
const LARGEST_M: f32 = 0.15;

/// For each object, the shift that lays it and its neighbours onto the true surfaces, metres; none where too few stand.
pub(super) fn find_shifts(objects: &[&MapObject], truth: &TrueScene) -> Vec<Vector3<f32>> {
    let places: Vec<Point3<f32>> = truth.objects.iter().flat_map(|t| t.points.iter().map(|p| p.position)).collect();
    let surface = PointGrid::new(0.05, places.iter().copied().zip(0u32..));
    let samples: Vec<Vec<Point3<f32>>> =
        objects.iter().map(|object| pick(&object.points, POINTS).map(|p| p.position).collect()).collect();
    let shift = |object: &&MapObject| {
        let distance_m = |other: &MapObject| (other.bounds.center - object.bounds.center).norm();
        let near = objects.iter().zip(&samples).filter(|(other, _)| distance_m(other) <= NEIGHBOURHOOD_M);
        let near: Vec<&[Point3<f32>]> = near.map(|(_, points)| points.as_slice()).collect();
        if near.len() < LEAST_OBJECTS { Vector3::zeros() } else { find_shift(&near, &surface, &places) }
    };
    objects.par_iter().map(shift).collect()
}

fn find_shift(near: &[&[Point3<f32>]], surface: &PointGrid, places: &[Point3<f32>]) -> Vector3<f32> {
    let mut shift = Vector3::zeros();
    for step in 0..STEPS {
        let reach = REACH_M[step.min(REACH_M.len() - 1)];
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for point in near.iter().copied().flatten().map(|point| point + shift) {
            if let Some((number, _)) = surface.find(&point, reach) {
                sum += places[number as usize] - point;
                count += 1.0;
            }
        }
        let change: Vector3<f32> = sum / f32::max(count, 1.0);
        shift += change;
        if change.norm() < SETTLED_M {
            break;
        }
    }
    if shift.norm() <= LARGEST_M { shift } else { Vector3::zeros() }
}
