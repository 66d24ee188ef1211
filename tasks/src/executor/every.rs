//! "All apples": one after the other, each grounded anew, until none is left elsewhere.

use super::{Done, Executor, PLACE, TIME_TO_FETCH_AGAIN, done, failed};
use crate::agent::{Agent, Halt};
use crate::skills::search::Thoroughness;
use crate::summary::{Stage, StepOutcome};
use dsm::ground::{Command, Grounding};
use dsm::map::{Map, MapObject, ObjectId};
use std::collections::BTreeSet;

/// So many things are fetched for one command.
const MOST: usize = 8;
/// A thing counts as one of those that are meant when it fits at least so well, and by this share of the best.
const FITS: f32 = 0.4;
const FITS_SHARE: f32 = 0.6;
/// What lies on or in the destination is within its outline grown by this, and no lower below its top than that, metres.
const OVER_M: f64 = 0.05;
/// Nearer to where one was given up it is that one, metres.
const SAME_M: f64 = 0.15;

/// The command for one of them, when it speaks of all that are so.
pub(super) fn all_of(command: &Command) -> Option<Command> {
    const ALL: [&str; 8] = ["all of the ", "all the ", "all ", "every ", "each of the ", "each ", "both the ", "both "];
    command.destination.as_ref()?;
    let one = ALL.iter().find_map(|all| command.target.strip_prefix(all))?;
    Some(Command { target: format!("the {one}"), ..command.clone() })
}

/// How it went with all of them.
#[derive(Clone, Debug, Default, PartialEq)]
struct Tally {
    done: usize,
    /// Why each of the others is not.
    missing: Vec<String>,
    /// Why none was looked for any more, when time ended it.
    ended: Option<String>,
}

impl Tally {
    fn tell(&self, target: &str) -> (StepOutcome, String) {
        let all = self.done + self.missing.len();
        let missing = self.missing.iter().chain(&self.ended).cloned().collect::<Vec<_>>().join("; ");
        match (all, missing.is_empty()) {
            (0, _) => (StepOutcome::Absent, format!("there is none of `{target}` that is not there already")),
            (_, true) => (StepOutcome::Done, format!("all {all} of `{target}` are there")),
            _ => (StepOutcome::Failed, format!("{} of {all} of `{target}` are there; {missing}", self.done)),
        }
    }
}

impl Executor {
    /// Fetches one thing after the other that `one` can mean and puts it where it says.
    pub(super) fn fetch_all(&mut self, agent: &mut Agent, one: &Command) -> Result<Done, Halt> {
        let mut tally = Tally::default();
        let mut given_up: Vec<nalgebra::Point3<f64>> = Vec::new();
        // Who wants all of them wants all to be seen first.
        let mut last = match self.find(agent, PLACE, &one.target, Thoroughness::Everything)? {
            Ok(grounding) => Some(grounding),
            Err(refused) if refused.outcome == StepOutcome::Ambiguous => refused.grounding,
            Err(refused) => return Ok(*refused),
        };
        let Some(words) = &one.destination else { return Ok(failed(PLACE, Stage::Parsing, "no place".into(), last)) };
        let destination = match self.find(agent, PLACE, words, Thoroughness::Enough)? {
            Ok(grounding) => grounding,
            Err(refused) => return Ok(*refused),
        };
        let Some(surface) = destination.object_id else {
            let reason = "a room is not a surface; name one in it".to_owned();
            return Ok(failed(PLACE, Stage::Grounding, reason, Some(destination)));
        };
        for _ in 0..MOST {
            let answer = self.grounder.ground(agent.map(), &one.target, None);
            let Some(id) = next_of(agent.map(), &answer, surface, &given_up) else { break };
            let left = agent.deadline() - agent.now();
            if left.0 < TIME_TO_FETCH_AGAIN.0 + self.kept_for_parts.0 {
                tally.ended = Some("no time is left for the others".into());
                break;
            }
            let stood_at = agent.map().find_object(id).map(|object| object.bounds.center);
            agent.note(format!("the next of `{}` is object {}", one.target, id.0));
            let fetched = self.fetch_this(agent, one, Grounding { object_id: Some(id), ..answer })?;
            agent.note(format!("{:?}: {}", fetched.outcome, fetched.reason));
            match fetched.outcome {
                StepOutcome::Done => tally.done += 1,
                _ => tally.missing.push(format!("object {} is not: {}", id.0, fetched.reason)),
            }
            // What was put down is found again by where it is; where it was taken from stands nothing.
            given_up.extend(stood_at);
            last = fetched.grounding.or(last);
        }
        let (outcome, reason) = tally.tell(&one.target);
        Ok(match outcome {
            StepOutcome::Done => done(PLACE, reason, last),
            StepOutcome::Absent => Done { outcome, reason, skill: PLACE, grounding: last, stage: None },
            _ => failed(PLACE, Stage::Place, reason, last),
        })
    }
}

/// The likeliest of those that are meant that is neither on the destination nor was given up.
fn next_of(map: &Map, answer: &Grounding, surface: ObjectId, given_up: &[nalgebra::Point3<f64>]) -> Option<ObjectId> {
    let best = answer.candidates.iter().map(|candidate| candidate.score).fold(0.0, f32::max);
    let fits = answer.candidates.iter().filter(|c| c.score >= FITS && c.score >= FITS_SHARE * best);
    let mut seen = BTreeSet::new();
    let open = fits.filter_map(|candidate| map.find_object(candidate.object_id?)).filter(|object| {
        let was_there = given_up.iter().any(|place| (place - object.bounds.center).norm() < SAME_M);
        object.id != surface && !was_there && !is_there(map, object, surface) && seen.insert(object.id)
    });
    open.map(|object| object.id).next()
}

/// Whether a thing lies on or in the destination.
fn is_there(map: &Map, thing: &MapObject, surface: ObjectId) -> bool {
    map.find_object(surface).is_some_and(|place| {
        let center = thing.bounds.center;
        let level = nalgebra::Point3::new(center.x, center.y, place.bounds.center.z);
        let foot_m = center.z - 0.5 * thing.bounds.size.z;
        let lowest_m = place.bounds.center.z - 0.5 * place.bounds.size.z - OVER_M;
        place.bounds.contains(&level, OVER_M) && foot_m > lowest_m
    })
}

#[cfg(test)]
mod tests {
    //! Contract: "all apples" speaks of each of them; the account counts what is there and names what is not; what lies there
    //! already, and what was given up, is not fetched.
    use super::*;
    use dsm::geometry::OrientedBox;
    use dsm::ground::{GroundConfig, Grounder, parse_command};
    use dsm::knowledge::Knowledge;
    use dsm::map::{MapChange, MapUpdate, Votes};
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use std::sync::Arc;

    fn thing(id: u64, name: &str, at: [f64; 3], size: [f64; 3]) -> MapChange {
        let mut names = Votes::default();
        names.add(name, 9.0);
        let bounds =
            OrientedBox { center: Point3::from(at), size: Vector3::from(size), rotation: UnitQuaternion::identity() };
        MapChange::Put(Box::new(MapObject { observations: 20, ..MapObject::given(ObjectId(id), names, bounds) }))
    }

    #[test]
    fn each_apple_is_fetched_once() {
        let knowledge = Arc::new(Knowledge::embedded().unwrap());
        let command = parse_command("Put all apples in the bowl", &knowledge).unwrap();
        let one = all_of(&command).unwrap();
        assert_eq!((one.target.as_str(), one.destination.as_deref()), ("the apples", Some("the bowl")));
        let plain = parse_command("Put the apple in the bowl", &knowledge).unwrap();
        assert_eq!(all_of(&plain), None);
        let mut map = Map::new(0.05);
        let changes = vec![
            thing(1, "bowl", [0.0, 0.0, 0.85], [0.3, 0.3, 0.1]),
            thing(2, "apple", [0.02, 0.0, 0.87], [0.07, 0.07, 0.07]),
            thing(3, "apple", [1.0, 0.0, 0.85], [0.07, 0.07, 0.07]),
            thing(4, "apple", [2.0, 0.0, 0.85], [0.07, 0.07, 0.07]),
            thing(5, "mug", [3.0, 0.0, 0.85], [0.08, 0.08, 0.1]),
        ];
        map.apply(MapUpdate { stamp: Default::default(), changes });
        let answer = Grounder::new(GroundConfig::default(), knowledge).unwrap().ground(&map, &one.target, None);
        let mut given_up = Vec::new();
        let mut order = Vec::new();
        while let Some(id) = next_of(&map, &answer, ObjectId(1), &given_up) {
            order.push(id.0);
            given_up.push(map.find_object(id).unwrap().bounds.center);
        }
        order.sort_unstable();
        assert_eq!(order, [3, 4], "{answer:?}");
    }

    #[test]
    fn the_account_is_honest() {
        let tally = |done, missing: &[&str]| Tally {
            done,
            missing: missing.iter().map(|m| (*m).into()).collect(),
            ended: None,
        };
        assert_eq!(tally(2, &[]).tell("the apples").0, StepOutcome::Done);
        let (outcome, reason) = tally(1, &["object 4 is not: it rolled away"]).tell("the apples");
        assert_eq!(outcome, StepOutcome::Failed);
        assert!(reason.starts_with("1 of 2 of `the apples` are there; object 4"), "{reason}");
        assert_eq!(tally(0, &[]).tell("the apples").0, StepOutcome::Absent);
        let ended = Tally { ended: Some("no time".into()), ..tally(2, &[]) };
        assert_eq!(ended.tell("the apples").0, StepOutcome::Failed, "some may be left");
    }
}
