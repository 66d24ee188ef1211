//! Navigation to an object or a room of the map.

use super::Outcome;
use super::drive::{Drive, DriveOutcome};
use crate::agent::{Agent, Gaze, Halt};
use crate::summary::Stage;
use dsm::map::{ObjectId, RoomId};
use dsm::time::Span;
use dsm_robot::nav::{Costmap, Field, NavConfig, Pose2, find_room_pose, find_view_poses};

/// So many standing places are tried.
const MAX_PLACES: usize = 4;

/// Drives to a place from which the object is seen, and looks at it.
pub fn navigate_to_object(agent: &mut Agent, nav: &NavConfig, id: ObjectId) -> Result<Outcome, Halt> {
    for attempt in 0..MAX_PLACES {
        let Some(bounds) = agent.map().find_object(id).map(|o| o.bounds) else {
            return Ok(Outcome::Failed(Stage::Mapping, format!("object {} left the map", id.0)));
        };
        let map = agent.map().clone();
        let start = Pose2::from_pose(&agent.world_from_base()?).position;
        let config = nav.clone();
        let places = agent.plan(move || {
            let costmap = Costmap::from_free_space(&map.free_space, &config.costmap);
            let field = Field::from_start(&costmap, &start);
            find_view_poses(&map, &costmap, &field, &bounds, &config.goal)
        })?;
        let Some(place) = places.get(attempt.min(places.len().saturating_sub(1))) else {
            return Ok(Outcome::Failed(
                Stage::Planning,
                "no place from which the object is seen can be reached".into(),
            ));
        };
        agent.gaze = Gaze::AHEAD;
        if Drive::to_pose(nav, place.pose).run(agent)? == DriveOutcome::Arrived {
            agent.gaze = Gaze::Point(bounds.center);
            agent.rest(Span::from_s(1.5))?;
            return Ok(Outcome::Done(format!("stands before object {}", id.0)));
        }
    }
    Ok(Outcome::Failed(Stage::Planning, format!("{MAX_PLACES} places were tried and none was reached")))
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
