//! One hand: what it holds is put aside while it opens or closes something, and is taken up again.

use super::{Done, Executor, failed, settled};
use crate::agent::{Agent, Halt};
use crate::skills::Outcome;
use crate::skills::fallen::find_fallen;
use crate::skills::held::{Held, carry};
use crate::skills::place::place;
use crate::skills::regrip::grasp;
use crate::skills::spots::{Load, find_spots};
use crate::summary::Stage;
use dsm::ground::Grounding;
use dsm::knowledge::Knowledge;
use dsm::map::{Map, ObjectId};
use nalgebra::Point2;

/// Surfaces that are tried.
const MOST_SURFACES: usize = 3;
/// Levels at which the hand puts things down with ease, metres.
const LEVELS_M: std::ops::Range<f64> = 0.25..1.1;
/// Share of the usual room around the thing that it must have at least.
const SPARE: f64 = 0.55;
const ASIDE: &str = "set_aside";

impl Executor {
    /// Puts what is held on the nearest surface with room for it; where it stands in the map then.
    pub(super) fn set_aside(&mut self, agent: &mut Agent) -> Result<Result<Grounding, Box<Done>>, Halt> {
        let refuse = |stage, reason: String| Ok(Err(Box::new(failed(ASIDE, stage, reason, None))));
        let Some(held) = self.held.clone() else {
            return refuse(Stage::Hold, "the hand holds nothing".into());
        };
        if let Outcome::Failed(stage, reason) = carry(agent, &held, &self.grasping)? {
            return refuse(stage, reason);
        }
        let here = Point2::from(agent.world_from_base()?.translation.vector.xy());
        let opened = self.opened.as_ref().map(|opened| opened.furniture());
        let surfaces = find_surfaces(agent.map(), &self.knowledge, &held, opened, &here);
        let mut last = (Stage::Planning, "no surface has room for what the hand holds".to_owned());
        for surface in surfaces.into_iter().take(MOST_SURFACES) {
            agent.note(format!("puts the {} aside, on object {}", held.name, surface.0));
            match place(agent, &self.nav, &self.grasping, &held, surface)? {
                Outcome::Done(reason) => {
                    self.held = None;
                    let Some(id) = find_fallen(agent, &held)? else {
                        return refuse(Stage::Mapping, format!("{reason}; it is not in the map there"));
                    };
                    let answer = self.grounder.ground(agent.map(), &held.name, None);
                    return Ok(Ok(Grounding { object_id: Some(id), ..answer }));
                }
                Outcome::Failed(stage, reason) => last = (stage, reason),
            }
            if agent.held().is_none() {
                self.held = None;
                break;
            }
        }
        refuse(last.0, format!("what the hand holds cannot be put aside: {}", last.1))
    }

    /// Takes up again what was put aside.
    pub(super) fn take_up(&mut self, agent: &mut Agent, aside: Grounding) -> Result<Done, Halt> {
        let Some(id) = aside.object_id else {
            return Ok(failed(ASIDE, Stage::Mapping, "it is not known where it was put".into(), Some(aside)));
        };
        agent.note(format!("takes object {} up again", id.0));
        let grasped = grasp(agent, &self.nav, &self.grasping, id, None)?;
        let outcome = self.weigh(agent, grasped)?;
        Ok(settled(ASIDE, outcome, aside))
    }
}

/// Surfaces on which the held thing finds room, the nearest first; what stands open is left out, for its drawer or door is
/// in the way.
fn find_surfaces(
    map: &Map,
    knowledge: &Knowledge,
    held: &Held,
    opened: Option<ObjectId>,
    here: &Point2<f64>,
) -> Vec<ObjectId> {
    let has_room = |id: ObjectId, load: &Load| {
        find_spots(map, id, Some(held.id), load, SPARE).iter().any(|spot| LEVELS_M.contains(&spot.point.z))
    };
    let is_furniture = |name: &str| knowledge.find(name).is_some_and(|category| !category.graspable);
    let mut surfaces: Vec<(f64, ObjectId)> = map
        .stable_objects()
        .filter(|object| Some(object.id) != opened && is_furniture(object.name()))
        .filter(|object| LEVELS_M.contains(&object.bounds.top_m()) && has_room(object.id, &held.load))
        .map(|object| ((object.bounds.center.xy() - here).norm(), object.id))
        .collect();
    surfaces.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    surfaces.into_iter().map(|(_, id)| id).collect()
}
