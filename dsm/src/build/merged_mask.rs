//! Observations that show two known things as one: merged masks.

use super::draft::Draft;
use super::observation::Observation;
use super::tracks::Tracks;
use crate::geometry::OrientedBox;
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

/// What carries a thing is larger than it by this factor.
const LARGER: f64 = 3.0;
/// Above its foot by so much a thing is told from what it stands on, metres.
const ABOVE_FOOT_M: f64 = 0.01;

/// Whether the observation shows two known things as one: a quarter of its points lies in the box of one object, outside
/// the box of the object that holds most of them; or a quarter is of a thing and another of what it stands on, whose box
/// with its margin may hold all of a low thing. Such an observation teaches nothing and would grow one thing over the other.
pub(super) fn shows_two(draft: &Draft, tracks: &Tracks, observation: &Observation) -> bool {
    let points: Vec<Point3<f64>> = observation.points.iter().step_by(STRIDE).map(|p| p.position.cast()).collect();
    let known: Vec<OrientedBox> = tracks
        .find_near(&observation.bounds)
        .into_iter()
        .filter_map(|id| draft.find(id))
        .filter(|object| object.state == ObjectState::Stable && object.observations >= KNOWN_FROM)
        .map(|object| object.bounds)
        .collect();
    are_two(&points, &known)
}

fn are_two(points: &[Point3<f64>], known: &[OrientedBox]) -> bool {
    let least = SECOND_SHARE * points.len().max(1) as f64;
    let within = |bounds: &OrientedBox| points.iter().map(|p| bounds.contains(p, MARGIN_M)).collect::<Vec<bool>>();
    let known: Vec<(&OrientedBox, Vec<bool>)> = known.iter().map(|bounds| (bounds, within(bounds))).collect();
    let count = |holds: &[bool]| holds.iter().filter(|inside| **inside).count();
    let Some((_, most)) = known.iter().max_by_key(|(_, holds)| count(holds)) else { return false };
    let outside = |holds: &[bool], of: &[bool]| holds.iter().zip(of).filter(|(inside, of)| **inside && !**of).count();
    if known.iter().any(|(_, holds)| outside(holds, most) as f64 >= least) {
        return true;
    }
    let is_upper = |(bounds, holds): &&(&OrientedBox, Vec<bool>)| {
        let foot_m = bounds.bottom_m() + ABOVE_FOOT_M;
        let own = points.iter().zip(holds).filter(|(p, inside)| **inside && p.z > foot_m).count();
        own as f64 >= least
    };
    known.iter().filter(is_upper).any(|(upper, own)| {
        let carriers = known.iter().filter(|(lower, _)| carries(lower, upper));
        carriers.map(|(_, holds)| outside(holds, own)).any(|rest| rest as f64 >= least)
    })
}

/// Whether one stands on the other, or in it: things side by side have margins that overlap.
fn carries(lower: &OrientedBox, upper: &OrientedBox) -> bool {
    let at = Point3::new(upper.center.x, upper.center.y, lower.center.z);
    lower.volume_m3() > LARGER * upper.volume_m3() && lower.contains(&at, 0.0)
}

#[cfg(test)]
mod tests {
    //! Contract: a mask over a low thing and what it stands on shows two; a mask of either shows one.
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    fn upright(center: [f64; 3], size: [f64; 3]) -> OrientedBox {
        OrientedBox { center: center.into(), size: size.into(), rotation: UnitQuaternion::identity() }
    }

    /// Points of a level square.
    fn level(center: [f64; 3], side_m: f64) -> Vec<Point3<f64>> {
        let steps = || (-10..=10).map(|i| 0.05 * f64::from(i) * side_m);
        steps().flat_map(|x| steps().map(move |y| Point3::from(center) + Vector3::new(x, y, 0.0))).collect()
    }

    #[test]
    fn a_block_and_its_shelf_are_two() {
        let known = [upright([0.0, 0.0, 0.42], [0.8, 0.4, 0.84]), upright([0.0, 0.0, 0.873], [0.066, 0.066, 0.066])];
        let (block, shelf) = (level([0.0, 0.0, 0.9], 0.066), level([0.15, 0.0, 0.84], 0.2));
        let both: Vec<Point3<f64>> = block.iter().chain(&shelf).copied().collect();
        assert!(are_two(&both, &known));
        assert!(!are_two(&block, &known) && !are_two(&shelf, &known));
        // What is seen of the shelf around the foot of the block is not of the block.
        assert!(!are_two(&level([0.0, 0.0, 0.84], 0.15), &known));
        assert!(!are_two(&both, &known[..1]), "nothing else is known");
        let beside = [known[1], upright([0.08, 0.0, 0.88], [0.08, 0.08, 0.08])];
        assert!(!are_two(&level([0.08, 0.0, 0.92], 0.08), &beside), "they stand side by side");
    }
}
