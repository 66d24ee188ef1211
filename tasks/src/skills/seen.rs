//! Looking whether what was put down is where it was put.

use super::drive::{Drive, DriveOutcome};
use super::held::Held;
use super::spots::Spot;
use crate::agent::{Agent, Gaze, Halt};
use dsm::geometry::OrientedBox;
use dsm::map::{Map, ObjectId};
use dsm::time::Span;
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2, find_view_poses};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};

/// Depth points on the spot from which the object counts as seen there.
const MIN_POINTS_SEEN: usize = 25;

/// Points of the newest head frame over a spot, no higher than the load.
fn count_points_on(agent: &Agent, spot: &Spot, held: &Held) -> usize {
    let Some(seen) = agent.find_frame("head") else { return 0 };
    let frame = &seen.frame;
    let radius_m = held.load.radius_m + 0.04;
    (0..frame.depth_m.len())
        .filter_map(|pixel| Some(frame.world_from_camera * frame.find_point_in_camera(pixel)?))
        .filter(|p| (p.xy() - spot.point.xy()).norm() < radius_m)
        .filter(|p| p.z > spot.point.z + 0.015 && p.z < spot.point.z + held.load.height_m + 0.04)
        .count()
}

/// Points of the newest head frame over the surface, no higher than the load, where the map from before the load was let
/// go holds nothing.
fn count_new_points(agent: &Agent, before: &Map, surface: ObjectId, spot: &Spot, held: &Held) -> usize {
    /// Inside the outline of the surface by this much, metres: a wall behind it is not on it.
    const INSIDE_M: f64 = 0.03;
    /// Nearer to a known point it is known, metres: depth noise, and a pose that wanders by 3 cm.
    const KNOWN_M: f64 = 0.06;
    let (Some(seen), Some(board)) = (agent.find_frame("head"), before.find_object(surface)) else { return 0 };
    let around = board.bounds.aabb();
    let over = |p: &Point3<f64>| {
        let level = Point3::new(p.x, p.y, board.bounds.center.z);
        let z_m = p.z - spot.point.z;
        (0.02..held.load.height_m.max(2.0 * held.load.radius_m) + 0.04).contains(&z_m)
            && board.bounds.contains(&level, -INSIDE_M)
    };
    let known: Vec<Point3<f64>> = before
        .objects
        .values()
        .filter(|object| object.id != held.id)
        .flat_map(|object| object.points.iter().map(|point| point.position.cast::<f64>()))
        .filter(|p| {
            p.z > spot.point.z + 0.02 && around.grown(KNOWN_M).contains(&Point3::new(p.x, p.y, board.bounds.center.z))
        })
        .collect();
    let frame = &seen.frame;
    let points = (0..frame.depth_m.len())
        .step_by(2)
        .filter_map(|pixel| Some(frame.world_from_camera * frame.find_point_in_camera(pixel)?));
    points.filter(over).filter(|p| known.iter().all(|k| (k - p).norm() > KNOWN_M)).count()
}

/// What the newest head frame says about the load on its spot or elsewhere on the surface; `None` when it is not seen.
/// `before` is the map from before it was let go.
pub(super) fn find_put_down(
    agent: &Agent,
    before: &Map,
    surface: ObjectId,
    spot: &Spot,
    held: &Held,
) -> Option<String> {
    let seen = count_points_on(agent, spot, held);
    if seen >= MIN_POINTS_SEEN {
        return Some(format!("put down; {seen} points are seen there"));
    }
    let elsewhere = count_new_points(agent, before, surface, spot, held);
    (elsewhere >= MIN_POINTS_SEEN)
        .then(|| format!("put down; it lies elsewhere on the surface, where {elsewhere} new points are seen"))
}

/// Looks at the spot from another side; whether such a place was reached.
pub(super) fn look_from_aside(agent: &mut Agent, nav: &NavConfig, spot: &Spot, held: &Held) -> Result<bool, Halt> {
    let middle = spot.point + Vector3::new(0.0, 0.0, 0.5 * held.load.height_m);
    let side_m = 2.0 * held.load.radius_m;
    let bounds = OrientedBox {
        center: middle,
        size: Vector3::new(side_m, side_m, held.load.height_m),
        rotation: UnitQuaternion::identity(),
    };
    let (map, nav) = (agent.map().clone(), nav.clone());
    let start = Pose2::from_pose(&agent.world_from_base()?).position;
    let config = nav.clone();
    let place = agent.plan(move || {
        let costmap = Costmap::from_free_space(&map.free_space, &config.costmap);
        let field = Field::from_start(&costmap, &start);
        let places = find_view_poses(&map, &costmap, &field, &bounds, &config.goal);
        places.into_iter().find(|place| is_another_side(&middle, &start, &place.pose.position))
    })?;
    let Some(place) = place else { return Ok(false) };
    agent.note("looks at it from another side");
    agent.gaze = Gaze::AHEAD;
    let arrived = Drive::to_pose(&nav, place.pose).run(agent)? == DriveOutcome::Arrived;
    agent.gaze = Gaze::Point(middle);
    agent.rest(Span::from_s(1.5))?;
    Ok(arrived)
}

fn is_another_side(thing: &Point3<f64>, from: &Point2<f64>, place: &Point2<f64>) -> bool {
    /// What hides a thing from one side is passed by so much of a turn around it.
    const SIDE_RAD: f64 = 0.6;
    (place - thing.xy()).angle(&(from - thing.xy())) >= SIDE_RAD
}

#[cfg(test)]
mod tests {
    //! Contract: another side is one from which the thing is seen past what hid it.
    use super::*;

    #[test]
    fn another_side_lies_around_the_thing() {
        let (thing, from) = (Point3::new(1.0, 0.0, 0.5), Point2::new(0.0, 0.0));
        assert!(!is_another_side(&thing, &from, &Point2::new(0.2, 0.1)), "nearer is no other side");
        assert!(is_another_side(&thing, &from, &Point2::new(1.0, 0.9)));
        assert!(is_another_side(&thing, &from, &Point2::new(2.0, 0.0)));
    }
}
