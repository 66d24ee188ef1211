//! From commands to skills: parse, search, ground, act; one account per step.

use crate::agent::{Agent, Halt};
use crate::episode::{SkillName, Step};
use crate::skills::Outcome;
use crate::skills::explore::{Explorer, Interest};
use crate::skills::grasp::{GraspSettings, grasp};
use crate::skills::navigate::{navigate_to_object, navigate_to_room};
use crate::skills::search::search;
use crate::summary::{Failure, Stage, StepOutcome, StepSummary};
use dsm::ground::{Action, Command, Grounder, Grounding, GroundingStatus, parse_command};
use dsm::knowledge::Knowledge;
use dsm::time::{Span, Stamp};
use dsm_robot::nav::NavConfig;
use std::sync::Arc;

/// Simulated time that is kept for acting when exploration could go on for ever.
const TIME_TO_ACT: Span = Span(60_000_000_000);

/// Carries out the steps of an episode.
pub struct Executor {
    nav: NavConfig,
    grasping: GraspSettings,
    grounder: Arc<Grounder>,
    knowledge: Arc<Knowledge>,
    explorer: Explorer,
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
        let explorer = Explorer::new(nav.clone());
        Self { nav, grasping, grounder, knowledge, explorer }
    }

    /// Runs the steps in order; the first one that fails ends the run.
    pub fn run(&mut self, agent: &mut Agent, steps: &[Step]) -> Account {
        let mut account = Account { steps: Vec::new(), failure: None, halt: None };
        for (index, step) in steps.iter().enumerate() {
            let start = agent.now();
            let command = words_of(step);
            if account.failure.is_some() {
                account.steps.push(StepSummary {
                    index,
                    command,
                    skill: String::new(),
                    outcome: StepOutcome::Skipped,
                    reason: "an earlier step failed".into(),
                    start_s: start.as_s(),
                    duration_s: 0.0,
                    grounding: None,
                });
                continue;
            }
            agent.journal.note(start.as_s(), format!("step {index}: {command}"), None);
            let done = self.step(agent, step).unwrap_or_else(|halt| {
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
                index,
                command,
                skill: done.skill.into(),
                outcome: done.outcome,
                reason: done.reason,
                start_s: start.as_s(),
                duration_s: (end - start).as_s(),
                grounding: done.grounding,
            });
        }
        account
    }

    fn step(&mut self, agent: &mut Agent, step: &Step) -> Result<Done, Halt> {
        let command = match (&step.command, step.skill) {
            (Some(text), _) => match parse_command(text, &self.knowledge) {
                Ok(command) => command,
                Err(unparsed) => return Ok(failed("", Stage::Parsing, unparsed.to_string(), None)),
            },
            (None, skill) => Command {
                action: match skill {
                    Some(SkillName::Navigate) => Action::Navigate,
                    Some(SkillName::Grasp) => Action::Grasp,
                    Some(SkillName::Explore) | None => Action::Explore,
                },
                target: step.target.clone().unwrap_or_default(),
                destination: None,
            },
        };
        match command.action {
            Action::Explore => {
                let end = agent.deadline();
                let outcome =
                    self.explorer.run(agent, end, Interest { enough: &mut |_| false, inspect: &|_| Vec::new() })?;
                Ok(done("explore", format!("exploration ends: {outcome:?}"), None))
            }
            Action::Place | Action::Bring => {
                Ok(failed("", Stage::Parsing, format!("{:?} is not supported yet", command.action), None))
            }
            Action::Navigate | Action::Grasp | Action::Find => self.act(agent, &command),
        }
    }

    fn act(&mut self, agent: &mut Agent, command: &Command) -> Result<Done, Halt> {
        let skill = match command.action {
            Action::Grasp => "grasp",
            Action::Navigate => "navigate",
            _ => "find",
        };
        let end = Stamp(agent.deadline().0 - TIME_TO_ACT.0);
        let grounding = search(agent, &mut self.explorer, &self.grounder, &self.knowledge, &command.target, end)?;
        let now_s = agent.now().as_s();
        agent.journal.note(
            now_s,
            format!("`{}` is {:?}: {}", command.target, grounding.status, grounding.decided_by),
            None,
        );
        let refuse = |outcome, grounding: Grounding| Done {
            outcome,
            reason: grounding.decided_by.clone(),
            skill,
            grounding: Some(grounding),
            stage: None,
        };
        let outcome = match grounding.status {
            GroundingStatus::Absent => return Ok(refuse(StepOutcome::Absent, grounding)),
            GroundingStatus::Ambiguous => return Ok(refuse(StepOutcome::Ambiguous, grounding)),
            GroundingStatus::Unparsed => {
                return Ok(failed(skill, Stage::Parsing, grounding.decided_by.clone(), Some(grounding)));
            }
            GroundingStatus::Found => match (command.action, grounding.object_id, grounding.room_id) {
                (Action::Grasp, Some(id), _) => grasp(agent, &self.nav, &self.grasping, id)?,
                (Action::Navigate, Some(id), _) => navigate_to_object(agent, &self.nav, id)?,
                (Action::Navigate, None, Some(room)) => navigate_to_room(agent, &self.nav, room)?,
                (Action::Grasp, None, _) => Outcome::Failed(Stage::Grounding, "a room cannot be grasped".into()),
                _ => Outcome::Done("found".into()),
            },
        };
        Ok(match outcome {
            Outcome::Done(reason) => done(skill, reason, Some(grounding)),
            Outcome::Failed(stage, reason) => failed(skill, stage, reason, Some(grounding)),
        })
    }
}

fn done(skill: &'static str, reason: String, grounding: Option<Grounding>) -> Done {
    Done { outcome: StepOutcome::Done, reason, skill, grounding, stage: None }
}

fn failed(skill: &'static str, stage: Stage, reason: String, grounding: Option<Grounding>) -> Done {
    Done { outcome: StepOutcome::Failed, reason, skill, grounding, stage: Some(stage) }
}

fn reason_of(halt: &Halt) -> (Stage, String) {
    match halt {
        Halt::TimeUp => (Stage::Time, "the simulated time is up".into()),
        Halt::Interrupted => (Stage::Safety, "interrupted".into()),
        Halt::Stopped(error) => (Stage::Safety, error.to_string()),
        Halt::Failed(error) => (Stage::Safety, error.to_string()),
    }
}

fn words_of(step: &Step) -> String {
    step.command.clone().unwrap_or_else(|| match (step.skill, &step.target) {
        (Some(skill), Some(target)) => format!("{skill:?} {target}").to_lowercase(),
        (Some(skill), None) => format!("{skill:?}").to_lowercase(),
        _ => String::new(),
    })
}
