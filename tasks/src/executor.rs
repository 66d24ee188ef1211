//! From commands to skills: parse, search, ground, act; one account per step.

mod aside;
mod every;
mod furniture;
mod sequence;
mod taking;

use crate::agent::{Agent, Halt};
use crate::episode::{SkillName, Step};
use crate::skills::Outcome;
use crate::skills::drive::{Drive, DriveOutcome};
use crate::skills::explore::{ExploreOutcome, Explorer, Interest};
use crate::skills::fallen::find_fallen;
use crate::skills::grasp::GraspSettings;
use crate::skills::held::{Held, carry, carrying};
use crate::skills::navigate::{navigate_to_object, navigate_to_room, way_to};
use crate::skills::place::place;
use crate::skills::retreat::retreat;
use crate::skills::search::{LAST_LOOKS, Thoroughness, search};
use crate::skills::wiggle::wiggle;
use crate::summary::{EXPLORE, Failure, PartSummary, Stage, StepOutcome, StepSummary};
use dsm::ground::{Action, Command, Grounder, Grounding, GroundingStatus, RelationWord, parse_command, split_sequence};
use dsm::knowledge::Knowledge;
use dsm::map::ObjectId;
use dsm::time::{Span, Stamp};
use dsm_robot::nav::{NavConfig, Pose2};
use furniture::{Opened, Stowed};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Simulated time that is kept for acting when exploration could go on for ever.
const TIME_TO_ACT: Span = Span(60_000_000_000);

/// With less time left a thing that was lost on the way is not fetched again: to grasp, carry and put it down takes this.
const TIME_TO_FETCH_AGAIN: Span = Span(150_000_000_000);

/// Further time that is kept for putting down what was grasped.
const TIME_TO_PLACE: Span = Span(90_000_000_000);

/// Carries out the steps of an episode.
pub struct Executor {
    nav: NavConfig,
    grasping: GraspSettings,
    grounder: Arc<Grounder>,
    knowledge: Arc<Knowledge>,
    explorer: Explorer,
    held: Option<Held>,
    /// What was opened last and not closed since.
    opened: Option<Opened>,
    /// What lies in drawers that the robot closed.
    stowed: BTreeMap<ObjectId, Stowed>,
    /// Of the sequence that is carried out.
    parts: Vec<PartSummary>,
    /// Time that is kept for what follows in the sequence.
    kept_for_parts: Span,
}

/// The account of all steps, and why the run was cut short if it was.
pub struct Account {
    /// One summary per step.
    pub steps: Vec<StepSummary>,
    /// The first failure.
    pub failure: Option<Failure>,
    /// Why the run was cut short.
    pub halt: Option<Halt>,
}

/// Why a room is not taken.
const NO_ROOM: &str = "a room cannot be grasped";

/// Name of the skill that puts things down.
const PLACE: &str = "place";

struct Done {
    outcome: StepOutcome,
    reason: String,
    skill: &'static str,
    grounding: Option<Grounding>,
    stage: Option<Stage>,
}

impl Executor {
    /// An executor that has been nowhere.
    pub fn new(nav: NavConfig, grasping: GraspSettings, grounder: Arc<Grounder>, knowledge: Arc<Knowledge>) -> Self {
        let explorer = Explorer::new(nav.clone()).through_doors(grasping.clone());
        Self {
            nav,
            grasping,
            grounder,
            knowledge,
            explorer,
            held: None,
            opened: None,
            stowed: BTreeMap::new(),
            parts: Vec::new(),
            kept_for_parts: Span(0),
        }
    }

    /// Runs the steps in order; the first one that fails ends the run.
    pub fn run(&mut self, agent: &mut Agent, steps: &[Step]) -> Account {
        let mut account = Account { steps: Vec::new(), failure: None, halt: None };
        for (index, step) in steps.iter().enumerate() {
            let start = agent.now();
            let command = words_of(step);
            if account.failure.is_some() {
                account.steps.push(StepSummary::skipped(index, command, start.as_s()));
                continue;
            }
            agent.journal.note(start.as_s(), format!("step {index}: {command}"), None);
            let done = self.step(agent, step, steps.len() - 1 - index).unwrap_or_else(|halt| {
                let (stage, reason) = reason_of(&halt);
                account.halt = Some(halt);
                Done { outcome: StepOutcome::Failed, reason, skill: "", grounding: None, stage: Some(stage) }
            });
            let end = agent.now();
            agent.note(format!("step {index} ends: {:?}: {}", done.outcome, done.reason));
            if let Some(stage) = done.stage {
                account.failure = Some(Failure { step: index, stage, reason: done.reason.clone() });
            }
            account.steps.push(StepSummary {
                skill: done.skill.into(),
                outcome: done.outcome,
                reason: done.reason,
                duration_s: (end - start).as_s(),
                grounding: done.grounding,
                parts: std::mem::take(&mut self.parts),
                ..StepSummary::skipped(index, command, start.as_s())
            });
        }
        account
    }

    /// One step, after which so many others follow.
    fn step(&mut self, agent: &mut Agent, step: &Step, others: usize) -> Result<Done, Halt> {
        let command = match (&step.command, step.skill) {
            (None, Some(SkillName::Wiggle)) => return Ok(done("wiggle", wiggle(agent)?, None)),
            (Some(text), _) => {
                let parts = split_sequence(text, &self.knowledge);
                if parts.len() > 1 {
                    return self.sequence(agent, &parts);
                }
                match parse_command(text, &self.knowledge) {
                    Ok(command) => command,
                    Err(unparsed) => return Ok(failed("", Stage::Parsing, unparsed.to_string(), None)),
                }
            }
            (None, skill) => Command {
                action: match skill {
                    Some(SkillName::Navigate) => Action::Navigate,
                    Some(SkillName::Grasp) => Action::Grasp,
                    Some(SkillName::Explore | SkillName::Wiggle) | None => Action::Explore,
                },
                target: step.target.clone().unwrap_or_default(),
                destination: None,
                region: None,
                part: None,
                inside: None,
                back: false,
            },
        };
        self.carry_out(agent, &command, others)
    }

    /// One command, after which so many other steps follow.
    fn carry_out(&mut self, agent: &mut Agent, command: &Command, others: usize) -> Result<Done, Halt> {
        match command.action {
            Action::Explore => {
                let end = Stamp(agent.deadline().0 - others as i64 * TIME_TO_ACT.0 - self.kept_for_parts.0);
                let outcome =
                    self.explorer.run(agent, end, Interest { enough: &mut |_| false, inspect: &|_| Vec::new() })?;
                Ok(done(EXPLORE, format!("exploration ends: {outcome:?}"), None))
            }
            Action::Place | Action::Bring => match every::all_of(command) {
                Some(one) => self.fetch_all(agent, &one),
                None => self.fetch_and_place(agent, command),
            },
            Action::Navigate | Action::Grasp | Action::Find | Action::Open | Action::Close => self.act(agent, command),
        }
    }

    fn act(&mut self, agent: &mut Agent, command: &Command) -> Result<Done, Halt> {
        if let (Action::Grasp, Some(whole)) = (command.action, &command.inside) {
            return self.take_out(agent, command, whole);
        }
        if matches!(command.action, Action::Open | Action::Close) {
            return self.move_part(agent, command);
        }
        let skill = match command.action {
            Action::Grasp => "grasp",
            Action::Navigate => "navigate",
            _ => "find",
        };
        let grounding = match self.find(agent, skill, &command.target, Thoroughness::Enough)? {
            Ok(grounding) => grounding,
            Err(refused) if command.action == Action::Grasp => return self.or_look_inside(agent, command, *refused),
            Err(refused) => return Ok(*refused),
        };
        let outcome = match (command.action, grounding.object_id, grounding.room_id) {
            (Action::Grasp, Some(id), _) => return self.grasp(agent, command, grounding, id),
            (Action::Grasp, None, _) => Outcome::Failed(Stage::Grounding, NO_ROOM.into()),
            (Action::Navigate, Some(id), _) => self.go_to(agent, id, command.region)?,
            (Action::Navigate, None, Some(room)) => navigate_to_room(agent, &self.nav, room)?,
            _ => Outcome::Done("found".into()),
        };
        Ok(settled(skill, outcome, grounding))
    }

    /// What the words mean, or the refusal that answers them.
    fn find(
        &mut self,
        agent: &mut Agent,
        skill: &'static str,
        text: &str,
        thoroughness: Thoroughness,
    ) -> Result<Result<Grounding, Box<Done>>, Halt> {
        let kept = if skill == PLACE { Span(TIME_TO_ACT.0 + TIME_TO_PLACE.0) } else { TIME_TO_ACT };
        let end = Stamp(agent.deadline().0 - kept.0 - self.kept_for_parts.0);
        let grounding = search(agent, &mut self.explorer, &self.grounder, &self.knowledge, text, thoroughness, end)?;
        let now_s = agent.now().as_s();
        agent.journal.note(now_s, format!("`{text}` is {:?}: {}", grounding.status, grounding.decided_by), None);
        let refuse = |outcome, grounding: Grounding| {
            let reason = grounding.decided_by.clone();
            Err(Box::new(Done { outcome, reason, skill, grounding: Some(grounding), stage: None }))
        };
        Ok(match grounding.status {
            GroundingStatus::Absent => refuse(StepOutcome::Absent, grounding),
            GroundingStatus::Ambiguous => refuse(StepOutcome::Ambiguous, grounding),
            GroundingStatus::Unparsed => {
                let reason = grounding.decided_by.clone();
                Err(Box::new(failed(skill, Stage::Parsing, reason, Some(grounding))))
            }
            GroundingStatus::Found => Ok(grounding),
        })
    }

    /// Where a thing goes. The thing itself is still to be found: the last looks are for it.
    fn find_destination(&mut self, agent: &mut Agent, words: &str) -> Result<Result<Grounding, Box<Done>>, Halt> {
        let kept = self.kept_for_parts;
        self.kept_for_parts = Span(kept.0 + LAST_LOOKS.0);
        let found = self.find(agent, PLACE, words, Thoroughness::Enough);
        self.kept_for_parts = kept;
        found
    }

    /// Drives to an object; while no place before it can be reached, the floor on the way to it is still to be seen.
    fn go_to(&mut self, agent: &mut Agent, id: ObjectId, side: Option<RelationWord>) -> Result<Outcome, Halt> {
        let outcome = navigate_to_object(agent, &self.nav, id, side)?;
        let Outcome::Failed(Stage::Planning, reason) = &outcome else { return Ok(outcome) };
        agent.note(format!("explores on: {reason}"));
        let end = Stamp(agent.deadline().0 - TIME_TO_ACT.0);
        let mut opens = way_to(&self.nav, id, Pose2::from_pose(&agent.world_from_base()?).position);
        let interest = Interest { enough: &mut opens, inspect: &|_| Vec::new() };
        match self.explorer.run(agent, end, interest)? {
            ExploreOutcome::Enough => navigate_to_object(agent, &self.nav, id, side),
            ExploreOutcome::Complete | ExploreOutcome::TimeUp => Ok(outcome),
        }
    }

    /// Finds the object and the place, grasps the one and puts it on the other; what was lost on the way is looked for
    /// and fetched once more.
    fn fetch_and_place(&mut self, agent: &mut Agent, command: &Command) -> Result<Done, Halt> {
        let done = self.try_fetch_and_place(agent, command, None)?;
        self.fetch_again(agent, command, done)
    }

    /// As [`Self::fetch_and_place`], for the thing of a grounding.
    fn fetch_this(&mut self, agent: &mut Agent, command: &Command, found: Grounding) -> Result<Done, Halt> {
        let done = self.try_fetch_and_place(agent, command, Some(found))?;
        self.fetch_again(agent, command, done)
    }

    /// What was lost on the way is fetched once more.
    fn fetch_again(&mut self, agent: &mut Agent, command: &Command, done: Done) -> Result<Done, Halt> {
        let held = self.held.take_if(|_| agent.held().is_none());
        let lost = matches!(done.stage, Some(Stage::Hold)) && agent.held().is_none() && !command.target.is_empty();
        let left = Span(agent.deadline().0 - agent.now().0);
        if !lost || left < TIME_TO_FETCH_AGAIN {
            return Ok(done);
        }
        agent.note(format!("fetches it once more: {}", done.reason));
        // Where it fell, what was said of its place does not name it.
        let fallen = match held {
            Some(held) => find_fallen(agent, &held)?,
            None => {
                retreat(agent)?;
                None
            }
        };
        let Some((id, grounding)) = fallen.zip(done.grounding) else {
            return self.try_fetch_and_place(agent, command, None);
        };
        agent.note(format!("it lies there: object {}", id.0));
        self.try_fetch_and_place(agent, command, Some(Grounding { object_id: Some(id), ..grounding }))
    }

    /// `fallen` is the thing, when it is known which: what was lost on the way.
    fn try_fetch_and_place(
        &mut self,
        agent: &mut Agent,
        command: &Command,
        fallen: Option<Grounding>,
    ) -> Result<Done, Halt> {
        if let Some(reason) = beyond_placing(command) {
            return Ok(failed(PLACE, Stage::Planning, reason, None));
        }
        let start = Pose2::from_pose(&agent.world_from_base()?);
        // What the hand holds already is folded away before anything is looked for.
        let carried = match (command.target.is_empty(), self.held.clone()) {
            (true, Some(held)) => Some(carry(agent, &held, &self.grasping)?),
            _ => None,
        };
        // Both are found before the hand is full.
        let destination = match &command.destination {
            Some(words) => match self.find_destination(agent, words)? {
                Ok(grounding) => Some(grounding),
                Err(refused) => return Ok(*refused),
            },
            None => None,
        };
        let mut grounding = None;
        if !command.target.is_empty() {
            let done = self.take(agent, command, fallen)?;
            if done.outcome != StepOutcome::Done {
                return Ok(Done { skill: PLACE, ..done });
            }
            grounding = done.grounding;
        }
        let Some(held) = self.held.clone() else {
            return Ok(failed(PLACE, Stage::Hold, "the hand holds nothing".into(), destination));
        };
        let folded = match carried {
            Some(folded) => folded,
            None => carry(agent, &held, &self.grasping)?,
        };
        let outcome = match folded {
            Outcome::Done(_) => {
                let left =
                    destination.as_ref().and_then(|d| d.object_id).filter(|id| agent.map().find_object(*id).is_none());
                let again = match (left, &command.destination) {
                    // The map knows it as another object by now.
                    (Some(_), Some(words)) => match self.find(agent, PLACE, words, Thoroughness::Enough)? {
                        Ok(again) => Some(again),
                        Err(refused) => return Ok(*refused),
                    },
                    _ => None,
                };
                self.deliver(agent, &held, again.as_ref().or(destination.as_ref()), start)?
            }
            failure => failure,
        };
        Ok(match (outcome, grounding.or(destination)) {
            (Outcome::Done(reason), grounding) => done(PLACE, reason, grounding),
            (Outcome::Failed(stage, reason), grounding) => failed(PLACE, stage, reason, grounding),
        })
    }

    /// Puts what is held on the destination; without one, brings it to where the command was given.
    fn deliver(
        &mut self,
        agent: &mut Agent,
        held: &Held,
        destination: Option<&Grounding>,
        start: Pose2,
    ) -> Result<Outcome, Halt> {
        let Some(destination) = destination else {
            let nav = carrying(agent, &self.nav, &[start.position])?;
            return Ok(match Drive::to_place(&nav, start.position).run(agent)? {
                DriveOutcome::Arrived => Outcome::Done("brought to where the command was given".into()),
                other => Outcome::Failed(Stage::Planning, format!("the way back failed: {other:?}")),
            });
        };
        let Some(surface) = destination.object_id else {
            return Ok(Outcome::Failed(Stage::Grounding, "a room is not a surface; name one in it".into()));
        };
        place(agent, &self.nav, &self.grasping, held, surface)
    }
}

/// Why a command asks for more than the skill of placing can do; nothing is moved then.
fn beyond_placing(command: &Command) -> Option<String> {
    match command.region {
        _ if command.back => Some("where a thing was taken from is not kept; name the surface to put it on".into()),
        Some(region) => {
            Some(format!("things are put on surfaces, not yet {} a thing; name the surface", region.phrase()))
        }
        None => None,
    }
}

fn settled(skill: &'static str, outcome: Outcome, grounding: Grounding) -> Done {
    match outcome {
        Outcome::Done(reason) => done(skill, reason, Some(grounding)),
        Outcome::Failed(stage, reason) => failed(skill, stage, reason, Some(grounding)),
    }
}

fn done(skill: &'static str, reason: String, grounding: Option<Grounding>) -> Done {
    Done { outcome: StepOutcome::Done, reason, skill, grounding, stage: None }
}

fn failed(skill: &'static str, stage: Stage, reason: String, grounding: Option<Grounding>) -> Done {
    Done { outcome: StepOutcome::Failed, reason, skill, grounding, stage: Some(stage) }
}

pub(crate) fn reason_of(halt: &Halt) -> (Stage, String) {
    match halt {
        Halt::TimeUp => (Stage::Time, "the simulated time is up".into()),
        Halt::Interrupted => (Stage::Safety, "interrupted".into()),
        Halt::Stopped(error) => (Stage::Safety, error.to_string()),
        Halt::Failed(error) => (Stage::Safety, error.to_string()),
    }
}

pub(crate) fn words_of(step: &Step) -> String {
    step.command.clone().unwrap_or_else(|| match (step.skill, &step.target) {
        (Some(skill), Some(target)) => format!("{skill:?} {target}").to_lowercase(),
        (Some(skill), None) => format!("{skill:?}").to_lowercase(),
        _ => String::new(),
    })
}
