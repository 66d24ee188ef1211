//! Furniture that opens: opening and closing it, and taking things out of it.

use super::{Done, Executor, done, failed, settled};
use crate::agent::{Agent, Halt};
use crate::skills::Outcome;
use crate::skills::close::close;
use crate::skills::explore::{ExploreOutcome, Interest};
use crate::skills::front_places::way_to_front;
use crate::skills::inside::OpenDrawer;
use crate::skills::open::open;
use crate::skills::place::raise;
use crate::skills::regrip::grasp_standing_on;
use crate::skills::search::Thoroughness;
use crate::summary::{Stage, StepOutcome};
use dsm::ground::{Action, Command, Grounding, GroundingStatus, Part, PartKind};
use dsm::knowledge::Knowledge;
use dsm::map::{Map, ObjectId};
use dsm::time::{Span, Stamp};
use dsm_robot::nav::Pose2;
use std::collections::BTreeSet;

/// Name of the skill that takes things out of furniture.
const TAKE_OUT: &str = "take_out";

/// So many pieces of furniture are looked into, and so much time must be left for one, to take out and to carry.
const MOST_DRAWERS: usize = 3;
const TIME_TO_OPEN: Span = Span(150_000_000_000);
/// What is taken out passes so far above the front of its drawer, metres.
const OVER_RIM_M: f64 = 0.04;
/// The drawer of furniture whose words say nothing more.
const DRAWER: Part = Part { kind: Some(PartKind::Drawer), place: None };

/// What the robot opened.
#[derive(Clone, Debug)]
pub(super) struct Opened {
    /// The furniture.
    id: ObjectId,
    /// What of it.
    part: Part,
    /// How it stands, when it is a drawer.
    drawer: Option<OpenDrawer>,
}

impl Opened {
    /// The furniture.
    pub(super) fn furniture(&self) -> ObjectId {
        self.id
    }
}

/// In what a thing lies that cannot be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stowed {
    /// The furniture.
    whole: ObjectId,
    /// What of it.
    part: Part,
}

impl Executor {
    /// Opens or closes what the words name; "it" is what was opened last.
    pub(super) fn move_part(&mut self, agent: &mut Agent, command: &Command) -> Result<Done, Halt> {
        let skill = if command.action == Action::Open { "open" } else { "close" };
        let part = command.part.unwrap_or_default();
        let (id, part, grounding) = if command.target.is_empty() {
            match &self.opened {
                Some(opened) => (opened.id, opened.part, None),
                None => return Ok(failed(skill, Stage::Grounding, "nothing was opened before".into(), None)),
            }
        } else {
            let grounding = match self.find(agent, skill, &command.target, Thoroughness::Enough)? {
                Ok(grounding) => grounding,
                Err(refused) => return Ok(*refused),
            };
            match grounding.object_id {
                Some(id) => (id, part, Some(grounding)),
                None => {
                    return Ok(failed(
                        skill,
                        Stage::Grounding,
                        "a room has nothing to open or close".to_owned(),
                        Some(grounding),
                    ));
                }
            }
        };
        let outcome = match command.action {
            Action::Open => self.open_part(agent, id, part)?.0,
            _ => self.close_part(agent, id, part)?,
        };
        Ok(match outcome {
            Outcome::Done(reason) => done(skill, reason, grounding),
            Outcome::Failed(stage, reason) => failed(skill, stage, reason, grounding),
        })
    }

    /// Opens a part and remembers it; the drawer, if it is one.
    fn open_part(
        &mut self,
        agent: &mut Agent,
        id: ObjectId,
        part: Part,
    ) -> Result<(Outcome, Option<OpenDrawer>), Halt> {
        let (mut outcome, mut drawer) = open(agent, &self.nav, &self.grasping, id, part)?;
        if matches!(outcome, Outcome::Failed(Stage::Planning, _)) && self.explore_to_front(agent, id)? {
            (outcome, drawer) = open(agent, &self.nav, &self.grasping, id, part)?;
        }
        if matches!(outcome, Outcome::Done(_)) {
            self.opened = Some(Opened { id, part, drawer });
        }
        // What lies in it comes out with it.
        let stowed = Stowed { whole: id, part };
        let inside = self.stowed.extract_if(.., |_, lies_in| drawer.is_some() && *lies_in == stowed);
        if let Some(drawer) = drawer {
            let by = drawer.handle.normal * drawer.out_m;
            agent.moved.extend(inside.map(|(thing, _)| (thing, by)));
        }
        Ok((outcome, drawer))
    }

    /// Explores until there is a way before the front of furniture that was seen from afar; whether there is one.
    fn explore_to_front(&mut self, agent: &mut Agent, id: ObjectId) -> Result<bool, Halt> {
        agent.note("explores on for a way before its front");
        let end = Stamp(agent.deadline().0 - TIME_TO_OPEN.0);
        let mut opens = way_to_front(&self.nav, id, Pose2::from_pose(&agent.world_from_base()?).position);
        let interest = Interest { enough: &mut opens, inspect: &|_| Vec::new() };
        Ok(self.explorer.run(agent, end, interest)? == ExploreOutcome::Enough)
    }

    /// Closes a part, and remembers what lies in it.
    fn close_part(&mut self, agent: &mut Agent, id: ObjectId, part: Part) -> Result<Outcome, Halt> {
        let mut inside = BTreeSet::new();
        let mut outcome = close(agent, &self.nav, &self.grasping, id, part, &mut inside)?;
        if matches!(outcome, Outcome::Failed(Stage::Planning, _)) && self.explore_to_front(agent, id)? {
            outcome = close(agent, &self.nav, &self.grasping, id, part, &mut inside)?;
        }
        if matches!(outcome, Outcome::Done(_)) {
            self.opened.take_if(|opened| opened.id == id);
            if !inside.is_empty() {
                let things: Vec<String> = inside.iter().map(|thing| thing.0.to_string()).collect();
                agent.note(format!("in it lie objects {}", things.join(", ")));
            }
            self.stowed.extend(inside.into_iter().map(|thing| (thing, Stowed { whole: id, part })));
        }
        Ok(outcome)
    }

    /// Opens what the target is said to lie in and takes it out. Words that do not name the furniture mean that in which it
    /// was seen, or what stands open.
    pub(super) fn take_out(&mut self, agent: &mut Agent, command: &Command, whole: &str) -> Result<Done, Halt> {
        if whole.is_empty() {
            return match self.find_stowed(agent, &command.target) {
                Some((stowed, grounding)) => self.take_out_of(agent, command, &stowed, grounding),
                None => self.look_into_drawers(agent, command),
            };
        }
        let furniture = match self.find(agent, TAKE_OUT, whole, Thoroughness::Enough)? {
            Ok(grounding) => grounding,
            Err(refused) => return Ok(*refused),
        };
        let Some(id) = furniture.object_id else {
            let reason = "a room cannot be opened".to_owned();
            return Ok(failed(TAKE_OUT, Stage::Grounding, reason, Some(furniture)));
        };
        let stowed = Stowed { whole: id, part: command.part.unwrap_or_default() };
        self.take_out_of(agent, command, &stowed, furniture)
    }

    /// Where the target was seen in a drawer: what was closed over it, or what stands open.
    fn find_stowed(&self, agent: &Agent, target: &str) -> Option<(Stowed, Grounding)> {
        let mut known = Map::clone(agent.map());
        known.objects.retain(|id, _| self.stowed.contains_key(id));
        let answer = self.grounder.ground(&known, target, None);
        let is_there = matches!(answer.status, GroundingStatus::Found | GroundingStatus::Ambiguous);
        let stowed = answer.object_id.filter(|_| is_there).and_then(|id| self.stowed.get(&id).cloned());
        let opened = || self.opened.as_ref().map(|opened| Stowed { whole: opened.id, part: opened.part });
        stowed.or_else(opened).map(|stowed| (stowed, answer))
    }

    /// Opens what the target lies in, unless that stands open since it was opened, looks inside and grasps it.
    pub(super) fn take_out_of(
        &mut self,
        agent: &mut Agent,
        command: &Command,
        lies_in: &Stowed,
        furniture: Grounding,
    ) -> Result<Done, Halt> {
        let fail = |stage: Stage, reason: &str, furniture: Grounding| {
            Ok(failed(TAKE_OUT, stage, reason.to_owned(), Some(furniture)))
        };
        let &Stowed { whole: id, part } = lies_in;
        let known = self.opened.as_ref().filter(|opened| opened.id == id && opened.part == part);
        let drawer = match known.and_then(|opened| opened.drawer) {
            Some(drawer) => Some(drawer),
            None => match self.open_part(agent, id, part)? {
                (Outcome::Failed(stage, reason), _) => return fail(stage, &reason, furniture),
                (Outcome::Done(_), drawer) => drawer,
            },
        };
        let Some(drawer) = drawer else {
            return fail(Stage::Planning, "only drawers are looked into yet", furniture);
        };
        let Some(heights) = drawer.look(agent, &self.nav)? else {
            return fail(Stage::Planning, "no way before the open drawer", furniture);
        };
        let mut inside = drawer.find(agent, &self.grounder, &command.target);
        for is_left in [true, false] {
            if inside.is_none() && drawer.look_from_beside(agent, &self.nav, is_left)? {
                inside = drawer.find(agent, &self.grounder, &command.target);
            }
        }
        let Some((id, inside)) = inside.and_then(|inside| inside.object_id.zip(Some(inside))) else {
            return fail(Stage::Mapping, &format!("no {} is seen in the drawer", command.target), furniture);
        };
        agent.note(format!("it is object {}", id.0));
        let grasped = grasp_standing_on(agent, &self.nav, &self.grasping, id, heights.floor_m)?;
        let outcome = self.weigh(agent, grasped)?;
        if let (Outcome::Done(_), Some(held)) = (&outcome, self.held.clone()) {
            // The fold may begin with a way down or aside: over the front first.
            let lifted_m = heights.floor_m + self.grasping.planner.lift_m;
            raise(agent, &self.grasping, &held, (heights.rim_m + OVER_RIM_M - lifted_m).max(0.0))?;
        }
        Ok(settled(TAKE_OUT, outcome, inside))
    }

    /// A thing that nobody sees and that is kept in drawers is looked for there before it is said to be absent.
    pub(super) fn or_look_inside(&mut self, agent: &mut Agent, command: &Command, refused: Done) -> Result<Done, Halt> {
        let query = refused.grounding.as_ref().and_then(|grounding| grounding.query.as_ref());
        let says_where = query.is_none_or(|query| !query.target.relations.is_empty());
        if refused.outcome != StepOutcome::Absent || says_where || !is_kept_in_drawers(&self.knowledge, &command.target)
        {
            return Ok(refused);
        }
        let inside = self.look_into_drawers(agent, command)?;
        if inside.outcome == StepOutcome::Done {
            return Ok(inside);
        }
        Ok(Done { reason: format!("{}; {}", refused.reason, inside.reason), ..refused })
    }

    /// Looks into one drawer after the other, the likeliest furniture first, until the target is found.
    pub(super) fn look_into_drawers(&mut self, agent: &mut Agent, command: &Command) -> Result<Done, Halt> {
        let end = Stamp(agent.deadline().0 - TIME_TO_OPEN.0 - self.kept_for_parts.0);
        if !self.explorer.is_complete() {
            let interest = Interest { enough: &mut |_| false, inspect: &|_| Vec::new() };
            self.explorer.run(agent, end, interest)?;
        }
        let mut tried = Vec::new();
        let likely = find_likely_drawers(agent.map(), &self.knowledge, &command.target);
        for (id, reason) in likely.into_iter().take(MOST_DRAWERS) {
            if agent.now() >= end {
                break;
            }
            let name = agent.map().find_object(id).map_or("furniture", |object| object.name()).to_owned();
            agent.note(format!("looks into object {} ({name}): {reason}", id.0));
            let stowed = Stowed { whole: id, part: command.part.unwrap_or(DRAWER) };
            let answer = self.grounder.ground(agent.map(), &command.target, None);
            let done = self.take_out_of(agent, command, &stowed, answer)?;
            if done.outcome == StepOutcome::Done || !matches!(done.stage, Some(Stage::Mapping | Stage::Planning)) {
                return Ok(done);
            }
            tried.push(format!("{name}: {}", done.reason));
        }
        let reason = match tried.is_empty() {
            true => "no furniture with drawers is known".to_owned(),
            false => format!("{} drawers were looked into; {}", tried.len(), tried.join("; ")),
        };
        Ok(Done { outcome: StepOutcome::Absent, reason, skill: TAKE_OUT, grounding: None, stage: None })
    }
}

/// Whether drawers are where a thing is kept as a rule.
fn is_kept_in_drawers(knowledge: &Knowledge, target: &str) -> bool {
    knowledge.find(target).is_some_and(|thing| thing.stored_in.iter().any(|place| place == "drawer"))
}

/// Furniture that has drawers as a rule, the likeliest for the thing first, with why.
fn find_likely_drawers(map: &Map, knowledge: &Knowledge, target: &str) -> Vec<(ObjectId, String)> {
    let thing = knowledge.find(target);
    let mut likely: Vec<(f32, ObjectId, String)> = map
        .stable_objects()
        .filter_map(|object| {
            let furniture = knowledge.find(object.name()).filter(|category| knowledge.has_drawers(category))?;
            let room = object.room.and_then(|id| map.find_room(id)).map(|room| room.name.as_str());
            let (chance, reason) = match thing {
                Some(thing) => {
                    let place = knowledge.find_chance(thing, furniture, room);
                    (place.chance, place.reason)
                }
                None => (0.0, "it has drawers".to_owned()),
            };
            Some((chance, object.id, reason))
        })
        .collect();
    likely.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    likely.into_iter().map(|(_, id, reason)| (id, reason)).collect()
}

#[cfg(test)]
mod tests {
    //! Contract: furniture with drawers is looked into, and only for what is kept there.
    use super::*;
    use dsm::geometry::OrientedBox;
    use dsm::map::{MapChange, MapObject, MapUpdate, Votes};
    use nalgebra::{Point3, UnitQuaternion, Vector3};

    #[test]
    fn a_pencil_is_looked_for_where_drawers_are() {
        let knowledge = Knowledge::embedded().unwrap();
        let furniture = |id: u64, name: &str| {
            let mut names = Votes::default();
            names.add(name, 9.0);
            let (center, size) = (Point3::new(id as f64, 0.0, 0.4), Vector3::new(0.8, 0.5, 0.8));
            let bounds = OrientedBox { center, size, rotation: UnitQuaternion::identity() };
            MapChange::Put(Box::new(MapObject::given(ObjectId(id), names, bounds)))
        };
        let mut map = Map::new(0.05);
        let changes = vec![furniture(1, "nightstand"), furniture(2, "desk"), furniture(3, "bed")];
        map.apply(MapUpdate { stamp: Default::default(), changes });
        let likely: Vec<u64> = find_likely_drawers(&map, &knowledge, "the pencil").iter().map(|(id, _)| id.0).collect();
        assert_eq!(likely, [1, 2], "a bed has none");
        assert!(is_kept_in_drawers(&knowledge, "the pencil") && !is_kept_in_drawers(&knowledge, "the apple"));
    }
}
