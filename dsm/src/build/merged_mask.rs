//! Observations that show two known things as one: merged masks.

use super::draft::Draft;
use super::observation::Observation;
use super::tracks::Tracks;
use crate::map::ObjectState;
use nalgebra::Point3;

/// Observations from which an object can speak against a merged mask.
const KNOWN_FROM: u32 = 5;
/// Distance around a box that still counts as its object, metres: boxes of partly seen things are too small.
const MARGIN_M: f64 = 0.05;
/// Share of the points that must belong to a second object, and to no other, for the mask to be a merged one.
const SECOND_SHARE: f64 = 0.25;
/// Every so many points are looked at.
const STRIDE: usize = 4;

/// Whether the observation shows two known things as one: a quarter of its points lies in the box of one object, outside
/// the box of the object that holds most of them. Such an observation teaches nothing and would grow one thing over the
/// other.
pub(super) fn shows_two(draft: &Draft, tracks: &Tracks, observation: &Observation) -> bool {
    let points: Vec<Point3<f64>> = observation.points.iter().step_by(STRIDE).map(|p| p.position.cast()).collect();
    let known: Vec<Vec<bool>> = tracks
        .find_near(&observation.bounds)
        .into_iter()
        .filter_map(|id| draft.find(id))
        .filter(|object| object.state == ObjectState::Stable && object.observations >= KNOWN_FROM)
        .map(|object| points.iter().map(|p| object.bounds.contains(p, MARGIN_M)).collect())
        .collect();
    let count = |holds: &[bool]| holds.iter().filter(|inside| **inside).count();
    let Some(most) = known.iter().max_by_key(|holds| count(holds)) else { return false };
    let only_second = known
        .iter()
        .map(|holds| holds.iter().zip(most).filter(|(second, first)| **second && !**first).count())
        .max()
        .unwrap_or(0);
    only_second as f64 >= SECOND_SHARE * points.len().max(1) as f64
}
