//! Taking things: what the words mean, looked at again from near, and another one where that was only what stood there before.

use super::{Done, Executor, NO_ROOM, PLACE, failed, settled};
use crate::agent::{Agent, Halt};
use crate::skills::Outcome;
use crate::skills::meaning::{FITS, FITS_POORLY, Fit, KEPT_SHARE, Meaning, find_rivals};
use crate::skills::navigate::navigate_to_object;
use crate::skills::regrip::grasp;
use crate::skills::search::Thoroughness;
use crate::summary::{Stage, StepOutcome};
use dsm::ground::{Command, Grounding};
use dsm::map::ObjectId;

/// So many others of its name are looked at from near when a thing is no longer what was meant.
const MOST_RIVALS: usize = 3;

impl Executor {
    /// Grasps; when no place to grasp from is known, looks at the object from near, and then explores the rest of the
    /// flat and reads the words again.
    pub(super) fn grasp(
        &mut self,
        agent: &mut Agent,
        command: &Command,
        grounding: Grounding,
        id: ObjectId,
    ) -> Result<Done, Halt> {
        if let Some(stowed) = self.stowed.get(&id).cloned() {
            agent.note(format!("object {} lies in furniture that was closed", id.0));
            return self.take_out_of(agent, command, &stowed, grounding);
        }
        let text = command.target.as_str();
        let mut outcome = self.grasp_and_weigh(agent, id, text)?;
        if matches!(outcome, Outcome::Failed(Stage::Planning, _))
            && matches!(self.go_to(agent, id, None)?, Outcome::Done(_))
        {
            // From near, the floor before it and what stands around it are known better.
            outcome = self.grasp_and_weigh(agent, id, text)?;
        }
        let thoroughness = match &outcome {
            Outcome::Failed(Stage::Planning, reason) => {
                agent.note(format!("explores on, because the grasp failed: {reason}"));
                Some(Thoroughness::Everything)
            }
            // The map knows it as another object by now.
            Outcome::Failed(Stage::Mapping, _) => Some(Thoroughness::Enough),
            Outcome::Failed(Stage::Grounding, _) => return self.grasp_another(agent, text, (grounding, id), outcome),
            _ => None,
        };
        let (outcome, grounding) = match thoroughness {
            Some(thoroughness) => {
                let grounding = match self.find(agent, "grasp", text, thoroughness)? {
                    Ok(again) if again.score < (KEPT_SHARE * grounding.score).max(FITS_POORLY).min(grounding.score) => {
                        return Ok(no_longer_there(again));
                    }
                    Ok(again) => again,
                    Err(refused) => return Ok(*refused),
                };
                match grounding.object_id {
                    Some(id) => match self.grasp_and_weigh(agent, id, text)? {
                        other @ Outcome::Failed(Stage::Grounding, _) => {
                            return self.grasp_another(agent, text, (grounding, id), other);
                        }
                        outcome => (outcome, grounding),
                    },
                    None => (Outcome::Failed(Stage::Grounding, NO_ROOM.into()), grounding),
                }
            }
            None => (outcome, grounding),
        };
        Ok(settled("grasp", outcome, grounding))
    }

    /// Looks at others of the name, when the one that was meant is another one by now, and takes the one that fits.
    fn grasp_another(
        &mut self,
        agent: &mut Agent,
        text: &str,
        (grounding, id): (Grounding, ObjectId),
        outcome: Outcome,
    ) -> Result<Done, Halt> {
        agent.note("looks for what was meant among the others of its name");
        let meaning = Meaning::new(&self.grounder, &self.knowledge, text);
        let mut best: Option<(Fit, ObjectId)> = None;
        // The hand's own shadow may have deceived: first what stood there, from a step back.
        let mut looked = Vec::new();
        let mut next = vec![id];
        for is_last in [false, true] {
            next.extend(self.find_unseen_rivals(agent, id, &looked)?);
            for other in std::mem::take(&mut next) {
                if looked.contains(&other) {
                    continue;
                }
                looked.push(other);
                if !matches!(navigate_to_object(agent, &self.nav, other, None)?, Outcome::Done(_)) {
                    continue;
                }
                let Some(fit) = meaning.find_fit(agent, "head", other)? else { continue };
                agent.note(format!("object {} fits by {:.2} as it looks now", other.0, fit.rank()));
                if best.is_none_or(|(most, _)| fit.rank() > most.rank()) {
                    best = Some((fit, other));
                }
                if fit.rank() >= FITS {
                    break;
                }
            }
            if is_last || self.explorer.is_complete() || best.is_some_and(|(most, _)| most.rank() >= FITS) {
                break;
            }
            // It may stand where nobody has looked yet.
            agent.note("explores on: none of them is it");
            if let Ok(Grounding { object_id: Some(found), .. }) =
                self.find(agent, "grasp", text, Thoroughness::Everything)?
            {
                next.push(found);
            }
        }
        // The best of them, if it is not plainly another one.
        let Some((Fit { score, .. }, best)) = best else { return Ok(settled("grasp", outcome, grounding)) };
        if score < FITS_POORLY {
            return Ok(no_longer_there(Grounding { score, ..grounding }));
        }
        agent.note(format!("object {} fits best", best.0));
        // What was looked at from near needs no other look.
        let grasped = grasp(agent, &self.nav, &self.grasping, best, None)?;
        let outcome = self.weigh(agent, grasped)?;
        Ok(settled("grasp", outcome, Grounding { object_id: Some(best), score, ..grounding }))
    }

    /// Others of its name that were not looked at, the nearest first.
    fn find_unseen_rivals(&self, agent: &mut Agent, id: ObjectId, looked: &[ObjectId]) -> Result<Vec<ObjectId>, Halt> {
        let here = agent.world_from_base()?.translation.vector.xy();
        let map = agent.map().clone();
        let away_m = |other: &ObjectId| {
            map.find_object(*other).map_or(f64::INFINITY, |object| (object.bounds.center.coords.xy() - here).norm())
        };
        let mut rivals = find_rivals(&map, id);
        rivals.retain(|other| !looked.contains(other));
        rivals.sort_by(|a, b| away_m(a).total_cmp(&away_m(b)).then(a.cmp(b)));
        rivals.truncate(MOST_RIVALS);
        Ok(rivals)
    }

    fn grasp_and_weigh(&mut self, agent: &mut Agent, id: ObjectId, text: &str) -> Result<Outcome, Halt> {
        let meaning = Meaning::new(&self.grounder, &self.knowledge, text);
        let grasped = grasp(agent, &self.nav, &self.grasping, id, Some(&meaning))?;
        self.weigh(agent, grasped)
    }

    /// Remembers what the hand holds.
    pub(super) fn weigh(
        &mut self,
        agent: &mut Agent,
        grasped: crate::skills::regrip::Grasped,
    ) -> Result<Outcome, Halt> {
        if let (Outcome::Done(_), Some(standing)) = (&grasped.outcome, grasped.standing) {
            self.held = Some(standing.lifted(agent, &self.grasping)?);
        }
        Ok(grasped.outcome)
    }

    /// Grasps what is to be carried: what `fallen` says, what lies in furniture, or what the words mean.
    pub(super) fn take(
        &mut self,
        agent: &mut Agent,
        command: &Command,
        fallen: Option<Grounding>,
    ) -> Result<Done, Halt> {
        let found = match (fallen, &command.inside) {
            (Some(found), _) => found,
            (None, Some(whole)) => return self.take_out(agent, command, whole),
            (None, None) => match self.find(agent, PLACE, &command.target, Thoroughness::Enough)? {
                Ok(found) => found,
                Err(refused) => return self.or_look_inside(agent, command, *refused),
            },
        };
        match found.object_id {
            Some(id) => self.grasp(agent, command, found, id),
            None => Ok(failed(PLACE, Stage::Grounding, NO_ROOM.into(), Some(found))),
        }
    }
}

/// What was meant was seen before, and what is left fits the words too poorly to be taken in its place.
fn no_longer_there(left: Grounding) -> Done {
    let reason = format!("what was meant is not there any more: the best of its name fits by {:.2}", left.score);
    let grounding = Some(Grounding { object_id: None, ..left });
    Done { outcome: StepOutcome::Absent, reason, skill: "grasp", grounding, stage: None }
}
