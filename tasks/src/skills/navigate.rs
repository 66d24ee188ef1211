//! Navigation to an object or a room of the map.

use super::Outcome;
use super::drive::{Drive, DriveOutcome};
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::geometry::OrientedBox;
use dsm::ground::RelationWord;
use dsm::map::{Map, ObjectId, RoomId};
use dsm::time::{Span, Stamp};
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2, StandPose, find_room_pose, find_view_poses};
use nalgebra::{Point2, Vector2};
use std::sync::Arc;

/// So many standing places are tried.
const MAX_PLACES: usize = 6;
/// Places whose directions from the thing differ by more than this see it from another side, radians.
const OTHER_SIDE_RAD: f64 = 0.9;
/// What is hidden from one place is most likely hidden from those nearer to it than this, metres.
const APART_M: f64 = 0.4;

/// Places within this angle of the asked side count, radians.
const SIDE_RAD: f64 = 1.05;

/// Whether a place lies on the asked side of a thing for a viewer who stands at `eye` and faces it; words that name no
/// side hold everywhere.
fn lies_on_side(side: Option<RelationWord>, eye: &Point2<f64>, thing: &Point2<f64>, place: &Point2<f64>) -> bool {
    let forward = thing - eye;
    let left = Vector2::new(-forward.y, forward.x);
    let wanted = match side {
        Some(RelationWord::LeftOf) => left,
        Some(RelationWord::RightOf) => -left,
        Some(RelationWord::InFrontOf) => -forward,
        Some(RelationWord::Behind) => forward,
        _ => return true,
    };
    (place - thing).angle(&wanted) <= SIDE_RAD
}

/// The best place that is not one of those tried: from another side if there is one, for what hides a thing from one place
/// (a wall, when it stands in a corner) hides it from all of that side.
fn find_next<'a>(places: &'a [StandPose], tried: &[Point2<f64>], thing: &Point2<f64>) -> Option<&'a StandPose> {
    let differs = |place: &&StandPose, from: fn(&Point2<f64>, &Point2<f64>, &Point2<f64>) -> bool| {
        tried.iter().all(|old| from(old, &place.pose.position, thing))
    };
    let aside = |old: &Point2<f64>, new: &Point2<f64>, thing: &Point2<f64>| {
        (old - thing).angle(&(new - thing)) > OTHER_SIDE_RAD
    };
    let apart = |old: &Point2<f64>, new: &Point2<f64>, _: &Point2<f64>| (old - new).norm() >= APART_M;
    places.iter().find(|place| differs(place, aside)).or_else(|| places.iter().find(|place| differs(place, apart)))
}

/// Drives to a place from which the object is seen, and looks at it. With a side, to a place on that side of it, as the
/// robot sees it when it starts.
pub fn navigate_to_object(
    agent: &mut Agent,
    nav: &NavConfig,
    id: ObjectId,
    side: Option<RelationWord>,
) -> Result<Outcome, Halt> {
    let mut reached = false;
    let mut tried: Vec<Point2<f64>> = Vec::new();
    let eye = Pose2::from_pose(&agent.world_from_base()?).position;
    while tried.len() < MAX_PLACES {
        let Some(bounds) = agent.map().find_object(id).map(|o| o.bounds) else {
            return Ok(Outcome::Failed(Stage::Mapping, format!("object {} left the map", id.0)));
        };
        let map = agent.map().clone();
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let config = nav.clone();
        let places = agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &config.costmap);
            let field = Field::from_start(&costmap, &start);
            let mut places = find_view_poses(&map, &costmap, &field, &bounds, &config.goal);
            places.retain(|place| lies_on_side(side, &eye, &bounds.center.xy(), &place.pose.position));
            places
        })?;
        let Some(place) = find_next(&places, &tried, &bounds.center.xy()) else {
            if !tried.is_empty() {
                break;
            }
            let side = side.map_or(String::new(), |side| format!(" {} it", side.phrase()));
            let reason = format!("no place{side} from which the object is seen can be reached");
            return Ok(Outcome::Failed(Stage::Planning, reason));
        };
        tried.push(place.pose.position);
        agent.mark("approaches the object");
        agent.gaze = Gaze::AHEAD;
        if Drive::to_pose(nav, place.pose).run(agent)? == DriveOutcome::Arrived {
            let center = agent.map().find_object(id).map_or(bounds.center, |object| object.bounds.center);
            agent.gaze = Gaze::Point(center);
            agent.await_light()?;
            agent.rest(Span::from_s(1.5))?;
            reached = true;
            if is_seen(agent, id) {
                return Ok(Outcome::Done(format!("stands before object {}", id.0)));
            }
            agent.note(format!("does not see object {} from here", id.0));
        }
    }
    Ok(match reached {
        // The map says that it is here, and no place shows it better.
        true => Outcome::Done(format!("stands before object {}, which is hidden from here", id.0)),
        false => Outcome::Failed(Stage::Planning, format!("{} places were tried and none was reached", tried.len())),
    })
}

/// Says of each new map, at most once a second, whether a place from which the object is seen can be reached from `start`.
pub fn way_to(nav: &NavConfig, id: ObjectId, start: Point2<f64>) -> impl FnMut(&Arc<Map>) -> bool + use<> {
    let goal = nav.goal.clone();
    opens(nav, id, start, move |map, bounds, costmap, field| {
        !find_view_poses(map, costmap, field, bounds, &goal).is_empty()
    })
}

/// Asks of each new map, at most once a second, whether the object's box can be come to from `start`.
pub(super) fn opens<F: Fn(&Map, &OrientedBox, &Costmap, &Field) -> bool>(
    nav: &NavConfig,
    id: ObjectId,
    start: Point2<f64>,
    is_open: F,
) -> impl FnMut(&Arc<Map>) -> bool + use<F> {
    const EVERY: Span = Span(1_000_000_000);
    let costs = nav.costmap.clone();
    let mut asked_at: Option<Stamp> = None;
    move |map| {
        if asked_at.is_some_and(|at| map.stamp - at < EVERY) {
            return false;
        }
        asked_at = Some(map.stamp);
        let Some(object) = map.find_object(id) else { return false };
        let costmap = Costmap::from_free_space(&map.free_space, &costs);
        let field = Field::from_start(&costmap, &start);
        is_open(map, &object.bounds, &costmap, &field)
    }
}

/// Whether the newest head frame shows enough of the object's points where the map has them.
fn is_seen(agent: &Agent, id: ObjectId) -> bool {
    const SAME_M: f64 = 0.06;
    const MIN_POINTS: usize = 12;
    let (Some(seen), Some(object)) = (agent.find_frame("head"), agent.map().find_object(id)) else { return false };
    let frame = &seen.frame;
    let camera_from_world = frame.world_from_camera.inverse();
    let shows = |point: &dsm::map::MapPoint| {
        let p = camera_from_world * point.position.cast::<f64>();
        frame.model.find_pixel(&p).is_some_and(|(column, row)| {
            let depth_m = f64::from(frame.depth_m[(row * frame.model.width + column) as usize]);
            (depth_m - p.z).abs() < SAME_M
        })
    };
    object.points.iter().filter(|point| shows(point)).count() >= MIN_POINTS.min(object.points.len() / 4)
}

/// Drives into a room.
pub fn navigate_to_room(agent: &mut Agent, nav: &NavConfig, id: RoomId) -> Result<Outcome, Halt> {
    let Some(room) = agent.map().find_room(id).cloned() else {
        return Ok(Outcome::Failed(Stage::Mapping, format!("room {} left the map", id.0)));
    };
    let map = agent.map().clone();
    let start = Pose2::from_pose(&agent.world_from_base()?);
    let config = nav.clone();
    let name = room.name.clone();
    let pose = agent.plan(move || {
        let costmap = Costmap::from_free_space(&map.free_space, &config.costmap);
        let field = Field::from_start(&costmap, &start.position);
        find_room_pose(&room, &costmap, &field)
    })?;
    let Some((position, _)) = pose else {
        return Ok(Outcome::Failed(Stage::Planning, format!("no free place in the {name} can be reached")));
    };
    agent.gaze = Gaze::AHEAD;
    match Drive::to_place(nav, position).run(agent)? {
        DriveOutcome::Arrived => Ok(Outcome::Done(format!("stands in the {name}"))),
        other => Ok(Outcome::Failed(Stage::Planning, format!("the way into the {name} failed: {other:?}"))),
    }
}

#[cfg(test)]
mod side_tests {
    //! Contract: sides are those of one who stands where the robot starts and faces the thing.
    use super::*;

    #[test]
    fn sides_are_the_viewers() {
        let (eye, lamp) = (Point2::new(0.0, 0.0), Point2::new(3.0, 0.0));
        let on = |side, x, y| lies_on_side(Some(side), &eye, &lamp, &Point2::new(x, y));
        assert!(on(RelationWord::LeftOf, 3.0, 1.0) && !on(RelationWord::LeftOf, 3.0, -1.0));
        assert!(on(RelationWord::RightOf, 3.2, -1.0) && !on(RelationWord::RightOf, 2.0, 0.0));
        assert!(on(RelationWord::InFrontOf, 2.0, 0.1) && !on(RelationWord::InFrontOf, 4.0, 0.0));
        assert!(on(RelationWord::Behind, 4.0, 0.1) && on(RelationWord::NextTo, 9.0, 9.0));
        assert!(lies_on_side(None, &eye, &lamp, &eye));
    }

    #[test]
    fn what_is_hidden_is_looked_at_from_another_side() {
        let place = |x, y, score| StandPose {
            pose: Pose2 { position: Point2::new(x, y), yaw_rad: 0.0 },
            score,
            path_length_m: 1.0,
            visible_share: 1.0,
        };
        let places = [place(1.0, 0.0, 0.9), place(1.0, 0.5, 0.8), place(0.0, 1.0, 0.7)];
        let thing = Point2::origin();
        let next = |tried: &[Point2<f64>]| find_next(&places, tried, &thing).map(|place| place.score);
        assert_eq!(next(&[]), Some(0.9));
        assert_eq!(next(&[places[0].pose.position]), Some(0.7));
        // When all sides have been tried, the places between them.
        assert_eq!(next(&[places[0].pose.position, places[2].pose.position]), Some(0.8));
        assert_eq!(next(&places.map(|place| place.pose.position)), None);
    }
}
