//! Where a thing that slipped out of the hand lies: the words that named it ("on the bookshelf") name nothing any more.

use super::held::Held;
use super::looks::look_around;
use super::retreat::retreat;
use super::target::Target;
use crate::agent::{Agent, Halt};
use dsm::map::{Map, MapObject, ObjectId};
use dsm::time::Stamp;
use nalgebra::{Point2, Point3};

/// It rolls so far before it lies, metres.
const ROLLS_M: f64 = 2.0;
/// Nearer than this to where one of its kind was known, it is that one, metres.
const SAME_M: f64 = 0.15;
/// To both sides of the base, radians.
const AROUND_RAD: f64 = 1.6;

/// What the hand lost, as the map knew it before.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lost {
    id: ObjectId,
    name: String,
    /// Where it stood before it was taken.
    stood_at: Point3<f64>,
}

impl Lost {
    /// What a grasp was after.
    pub(super) fn of(target: &Target) -> Self {
        let object = target.object();
        Self { id: object.id, name: object.name().to_owned(), stood_at: object.bounds.center }
    }
}

/// Backs off from where a thing slipped out of the hand and looks for it around there; its new id in the map.
pub fn find_fallen(agent: &mut Agent, held: &Held) -> Result<Option<ObjectId>, Halt> {
    let lost = Lost { id: held.id, name: held.name.clone(), stood_at: held.stood_at };
    Ok(look_for(agent, &lost)?.filter(|found| found.is_new).map(|found| found.id))
}

/// As [`find_fallen`], for a thing that was lost while it was lifted: it may lie where it stood.
pub(super) fn find_lost(agent: &mut Agent, lost: &Lost) -> Result<Option<ObjectId>, Halt> {
    Ok(look_for(agent, lost)?.map(|found| found.id))
}

struct Found {
    id: ObjectId,
    /// It lies where nothing of its kind was known.
    is_new: bool,
}

fn look_for(agent: &mut Agent, lost: &Lost) -> Result<Option<Found>, Halt> {
    let before = agent.map().clone();
    let lost_at = agent.now();
    let (model, configuration) = (agent.model().clone(), agent.configuration()?);
    let world_from_tool = agent.world_from_base()? * model.kinematics.root_from_link(&configuration, model.tool);
    retreat(agent)?;
    look_around(agent, AROUND_RAD)?;
    let near = world_from_tool.translation.vector.xy().into();
    let new = choose(&before, agent.map(), lost, lost_at, &near).map(|id| Found { id, is_new: true });
    Ok(new.or_else(|| still_there(agent.map(), lost, lost_at).map(|id| Found { id, is_new: false })))
}

/// The thing itself when it was seen since it was lost.
fn still_there(now: &Map, lost: &Lost, lost_at: Stamp) -> Option<ObjectId> {
    now.find_object(lost.id).filter(|object| object.last_seen > lost_at).map(|object| object.id)
}

/// What is new of its kind near where it was lost: the nearest.
fn choose(before: &Map, now: &Map, lost: &Lost, lost_at: Stamp, near: &Point2<f64>) -> Option<ObjectId> {
    let is_known = |object: &MapObject| {
        let same = before.objects.values().filter(|old| old.id != lost.id && old.name() == lost.name);
        same.map(|old| old.bounds.center)
            .chain([lost.stood_at])
            .any(|place| (place - object.bounds.center).norm() < SAME_M)
    };
    let away_m = |object: &MapObject| (object.bounds.center.xy() - near).norm();
    let new = now.objects.values().filter(|object| object.name() == lost.name && object.last_seen >= lost_at);
    let near = new.filter(|object| away_m(object) < ROLLS_M && !is_known(object));
    near.min_by(|a, b| away_m(a).total_cmp(&away_m(b))).map(|object| object.id)
}

#[cfg(test)]
mod tests {
    //! Contract: what fell is the new thing of its kind near by, not one of its kind that was known before, and not what
    //! is still believed to stand where it was taken from.
    use super::super::target::tests::{map_of, object};
    use super::*;

    #[test]
    fn the_ball_on_the_floor_is_the_one_that_fell() {
        let ball = |id: u64, at: [f64; 3]| {
            let mut ball = object(id, at, [0.09, 0.09, 0.09], &[]);
            ball.names.add("ball", 1.0);
            ball
        };
        let lost = Lost { id: ObjectId(1), name: "ball".into(), stood_at: Point3::new(0.0, 0.0, 0.8) };
        let before = map_of(vec![ball(1, [0.0, 0.0, 0.8]), ball(2, [0.3, 0.0, 0.8])]);
        let near = Point2::new(0.5, 0.5);
        let choose = |now: Vec<MapObject>| choose(&before, &map_of(now), &lost, Stamp::default(), &near);
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

    #[test]
    fn what_fell_back_to_where_it_stood_is_taken_there() {
        let stood = Point3::new(0.0, 0.0, 0.8);
        let lost = Lost { id: ObjectId(1), name: "ball".into(), stood_at: stood };
        let seen = |stamp| {
            let mut ball = object(1, [0.02, 0.0, 0.8], [0.09, 0.09, 0.09], &[]);
            ball.last_seen = stamp;
            map_of(vec![ball])
        };
        assert_eq!(still_there(&seen(Stamp(7)), &lost, Stamp(5)), Some(ObjectId(1)));
        assert_eq!(still_there(&seen(Stamp(4)), &lost, Stamp(5)), None, "nobody saw it since");
        assert_eq!(still_there(&map_of(Vec::new()), &lost, Stamp(5)), None);
    }
}
