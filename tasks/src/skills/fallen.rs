//! Where a thing that slipped out of the hand lies: the words that named it ("on the bookshelf") name nothing any more.

use super::explore::look_around;
use super::held::Held;
use super::retreat::retreat;
use crate::agent::{Agent, Halt};
use dsm::map::{Map, MapObject, ObjectId};
use dsm::time::Stamp;
use nalgebra::Point2;

/// It rolls so far before it lies, metres.
const ROLLS_M: f64 = 2.0;
/// Nearer than this to where one of its kind was known, it is that one, metres.
const SAME_M: f64 = 0.15;
/// To both sides of the base, radians.
const AROUND_RAD: f64 = 1.6;

/// Backs off from where a thing slipped out of the hand and looks for it around there; its new id in the map.
pub fn find_fallen(agent: &mut Agent, held: &Held) -> Result<Option<ObjectId>, Halt> {
    let before = agent.map().clone();
    let lost_at = agent.now();
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let world_from_tool = agent.world_from_base()? * model.kinematics.root_from_link(&configuration, model.tool);
    retreat(agent)?;
    look_around(agent, AROUND_RAD)?;
    Ok(choose(&before, agent.map(), held, lost_at, &world_from_tool.translation.vector.xy().into()))
}

/// What is new of its kind near where it was lost: the nearest.
fn choose(before: &Map, now: &Map, held: &Held, lost_at: Stamp, near: &Point2<f64>) -> Option<ObjectId> {
    let is_known = |object: &MapObject| {
        let same = before.objects.values().filter(|old| old.id != held.id && old.name() == held.name);
        same.map(|old| old.bounds.center)
            .chain([held.stood_at])
            .any(|place| (place - object.bounds.center).norm() < SAME_M)
    };
    let away_m = |object: &MapObject| (object.bounds.center.xy() - near).norm();
    let new = now.objects.values().filter(|object| object.name() == held.name && object.last_seen >= lost_at);
    let near = new.filter(|object| away_m(object) < ROLLS_M && !is_known(object));
    near.min_by(|a, b| away_m(a).total_cmp(&away_m(b))).map(|object| object.id)
}

#[cfg(test)]
mod tests {
    //! Contract: what fell is the new thing of its kind near by, not one of its kind that was known before, and not what
    //! is still believed to stand where it was taken from.
    use super::super::spots::Load;
    use super::super::target::tests::{map_of, object};
    use super::*;
    use nalgebra::{Point3, UnitQuaternion};

    #[test]
    fn the_ball_on_the_floor_is_the_one_that_fell() {
        let ball = |id: u64, at: [f64; 3]| {
            let mut ball = object(id, at, [0.09, 0.09, 0.09], &[]);
            ball.names.add("ball", 1.0);
            ball
        };
        let held = Held {
            id: ObjectId(1),
            name: "ball".into(),
            stood_at: Point3::new(0.0, 0.0, 0.8),
            load: Load { radius_m: 0.05, height_m: 0.09, half_m: None },
            tool_above_bottom_m: 0.04,
            base_from_tool: UnitQuaternion::identity(),
            base_from_side_rad: 0.0,
            width_m: 0.09,
            balance_in_tool: Point3::origin(),
        };
        let before = map_of(vec![ball(1, [0.0, 0.0, 0.8]), ball(2, [0.3, 0.0, 0.8])]);
        let near = Point2::new(0.5, 0.5);
        let choose = |now: Vec<MapObject>| choose(&before, &map_of(now), &held, Stamp::default(), &near);
        let known = [ball(1, [0.0, 0.0, 0.8]), ball(2, [0.3, 0.0, 0.8])];
        assert_eq!(choose(known.to_vec()), None);
        let with = |more: MapObject| known.iter().cloned().chain([more]).collect();
        assert_eq!(choose(with(ball(7, [0.6, 0.9, 0.045]))), Some(ObjectId(7)));
        assert_eq!(choose(with(ball(7, [5.0, 0.9, 0.045]))), None, "far away it is another one");
        assert_eq!(
            choose(vec![ball(1, [0.6, 0.9, 0.045]), known[1].clone()]),
            Some(ObjectId(1)),
            "tracked to the floor"
        );
    }
}
