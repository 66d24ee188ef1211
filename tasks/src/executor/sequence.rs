//! Sequences: several commands in one sentence, with checks between them, and an account that says what was done and what
//! was not.
//!
//! ```text
//! part ──check: what it speaks of is in the hand, or the hand is empty──▶ carry out ──failed?──▶ once more ──▶ next part
//! ```
//!
//! A part that fails does not end the sequence: what does not need it is still done.

use super::{Done, Executor, TIME_TO_ACT, TIME_TO_FETCH_AGAIN, failed};
use crate::agent::{Agent, Halt};
use crate::skills::Outcome;
use crate::skills::held::carry;
use crate::summary::{PartSummary, Stage, StepOutcome};
use dsm::ground::{Action, Command, Grounding, parse_command};
use dsm::time::Span;

/// A part is begun at most so often.
const MAX_ATTEMPTS: u32 = 2;
/// Name of a sequence among the skills.
const SEQUENCE: &str = "sequence";

/// What a part must find in the hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hand {
    /// Nothing: it takes something.
    Empty,
    /// What an earlier part took: it speaks of "it".
    Full,
    /// Whatever there is.
    Any,
}

impl Executor {
    /// Carries out the commands in order.
    pub(super) fn sequence(&mut self, agent: &mut Agent, texts: &[String]) -> Result<Done, Halt> {
        let outcome = self.carry_out_parts(agent, texts);
        self.kept_for_parts = Span(0);
        if outcome.is_err() {
            // What was under way when the run was cut short is not done, and what follows was never begun.
            let begun = self.parts.len();
            self.parts.extend(texts[begun..].iter().map(|text| PartSummary::skipped(text, agent.now().as_s())));
        }
        let grounding = outcome?;
        Ok(account(&self.parts, grounding))
    }

    fn carry_out_parts(&mut self, agent: &mut Agent, texts: &[String]) -> Result<Option<Grounding>, Halt> {
        let mut grounding = None;
        // The part that filled the hand, to be done again when the hand loses it.
        let mut taken: Option<Command> = None;
        for (index, text) in texts.iter().enumerate() {
            self.kept_for_parts = Span((texts.len() - 1 - index) as i64 * TIME_TO_ACT.0);
            let start_s = agent.now().as_s();
            agent.mark(format!("part {index}: {text}"));
            self.parts.push(PartSummary { attempts: 1, ..PartSummary::skipped(text, start_s) });
            let part = index_of_last(&self.parts);
            self.parts[part].outcome = StepOutcome::Failed;
            self.parts[part].reason = "cut short".into();
            let done = match parse_command(text, &self.knowledge) {
                Ok(command) => {
                    let done = self.attempt(agent, &command, &mut taken, part)?;
                    if command.action == Action::Grasp {
                        taken = (done.outcome == StepOutcome::Done).then_some(command);
                    }
                    done
                }
                Err(unparsed) => failed("", Stage::Parsing, unparsed.to_string(), None),
            };
            agent.note(format!("part {index} ends: {:?}: {}", done.outcome, done.reason));
            let summary = &mut self.parts[part];
            (summary.outcome, summary.reason, summary.skill) = (done.outcome, done.reason, done.skill.into());
            summary.duration_s = agent.now().as_s() - start_s;
            grounding = done.grounding.or(grounding);
        }
        Ok(grounding)
    }

    /// Carries out a part, once more when it fails and there is time.
    fn attempt(
        &mut self,
        agent: &mut Agent,
        command: &Command,
        taken: &mut Option<Command>,
        part: usize,
    ) -> Result<Done, Halt> {
        let mut command = command.clone();
        loop {
            let done = match self.prepare(agent, &command, taken)? {
                Ok(aside) => {
                    let done = self.carry_out(agent, &command, 0)?;
                    match aside {
                        Some(aside) => both(done, self.take_up(agent, aside)?),
                        None => done,
                    }
                }
                Err(unready) => *unready,
            };
            let left = agent.deadline() - agent.now();
            let again = matches!(done.stage, Some(stage) if stage != Stage::Parsing)
                && self.parts[part].attempts < MAX_ATTEMPTS
                && left.0 > TIME_TO_FETCH_AGAIN.0 + self.kept_for_parts.0;
            if !again {
                return Ok(done);
            }
            self.parts[part].attempts += 1;
            agent.note(format!("tries it again: {}", done.reason));
            if self.still_holds(agent)? && command.destination.is_some() {
                // It has what it is to put down.
                command.target = String::new();
            }
        }
    }

    /// Checks the hand before a part, and brings about what it needs if that can be had; what it put aside for that.
    fn prepare(
        &mut self,
        agent: &mut Agent,
        command: &Command,
        taken: &Option<Command>,
    ) -> Result<Result<Option<Grounding>, Box<Done>>, Halt> {
        let holds = self.still_holds(agent)?;
        let refuse = |reason: &str| Ok(Err(Box::new(failed("", Stage::Hold, reason.to_owned(), None))));
        match (hand_for(command), holds) {
            (Hand::Full, false) => {
                let Some(taken) = taken.clone() else { return refuse("the hand holds nothing, and nothing was taken") };
                agent.note("the hand is empty: takes it again");
                let done = self.carry_out(agent, &taken, 0)?;
                if done.outcome == StepOutcome::Done { Ok(Ok(None)) } else { Ok(Err(Box::new(done))) }
            }
            (Hand::Empty, true) if matches!(command.action, Action::Open | Action::Close) => {
                Ok(self.set_aside(agent)?.map(Some))
            }
            (Hand::Empty, true) => refuse("the hand is full; what it holds is to be put down first"),
            (Hand::Any, true) if command.action == Action::Navigate => {
                // With the arm folded around what it holds.
                let Some(held) = self.held.clone() else { return Ok(Ok(None)) };
                match carry(agent, &held, &self.grasping)? {
                    Outcome::Done(_) => Ok(Ok(None)),
                    Outcome::Failed(stage, reason) => Ok(Err(Box::new(failed("", stage, reason, None)))),
                }
            }
            _ => Ok(Ok(None)),
        }
    }

    /// Whether the hand holds what it is believed to hold, by the width between its fingers; forgets it otherwise.
    fn still_holds(&mut self, agent: &mut Agent) -> Result<bool, Halt> {
        if agent.held().is_none() {
            self.held = None;
        } else if agent.grip_state()?.width_m < self.grasping.min_width_m {
            agent.hold(None);
            self.held = None;
        }
        Ok(self.held.is_some())
    }
}

fn index_of_last(parts: &[PartSummary]) -> usize {
    parts.len().saturating_sub(1)
}

/// What was done, and the taking up of what had been put aside for it; done is what both did.
fn both(done: Done, taken_up: Done) -> Done {
    match taken_up.outcome {
        StepOutcome::Done => done,
        _ if done.outcome != StepOutcome::Done => done,
        _ => Done { reason: format!("{}, but what was put aside: {}", done.reason, taken_up.reason), ..taken_up },
    }
}

fn hand_for(command: &Command) -> Hand {
    match command.action {
        Action::Place | Action::Bring if command.target.is_empty() => Hand::Full,
        Action::Place | Action::Bring | Action::Grasp | Action::Open | Action::Close => Hand::Empty,
        Action::Navigate | Action::Find | Action::Explore => Hand::Any,
    }
}

/// What a sequence came to: all of it, or how much, and what is missing and why.
fn account(parts: &[PartSummary], grounding: Option<Grounding>) -> Done {
    let done = parts.iter().filter(|part| part.outcome == StepOutcome::Done).count();
    let missing: Vec<String> = parts
        .iter()
        .filter(|part| part.outcome != StepOutcome::Done)
        .map(|part| format!("`{}` is not: {}", part.command, part.reason))
        .collect();
    let reason = match missing.as_slice() {
        [] => format!("all {done} parts are done"),
        missing => format!("{done} of {} parts are done; {}", parts.len(), missing.join("; ")),
    };
    let stage = (!missing.is_empty()).then_some(Stage::Sequence);
    let outcome = if missing.is_empty() { StepOutcome::Done } else { StepOutcome::Failed };
    Done { outcome, reason, skill: SEQUENCE, grounding, stage }
}

#[cfg(test)]
mod tests {
    //! Contract: the account counts what is done and names what is not; what speaks of "it" needs a full hand, what takes
    //! something an empty one.
    use super::*;
    use dsm::knowledge::Knowledge;

    fn part(command: &str, outcome: StepOutcome) -> PartSummary {
        PartSummary { outcome, reason: "so it was".into(), ..PartSummary::skipped(command, 0.0) }
    }

    #[test]
    fn the_account_names_what_is_missing() {
        let all = account(&[part("a", StepOutcome::Done), part("b", StepOutcome::Done)], None);
        assert_eq!((all.outcome, all.stage), (StepOutcome::Done, None));
        let some = account(
            &[part("a", StepOutcome::Done), part("take b", StepOutcome::Absent), part("c", StepOutcome::Skipped)],
            None,
        );
        assert_eq!((some.outcome, some.stage), (StepOutcome::Failed, Some(Stage::Sequence)));
        assert!(some.reason.starts_with("1 of 3 parts are done; `take b` is not: so it was; `c`"), "{}", some.reason);
    }

    #[test]
    fn what_a_part_needs_in_the_hand() {
        let knowledge = Knowledge::embedded().unwrap();
        let hand = |text: &str| hand_for(&parse_command(text, &knowledge).unwrap());
        assert_eq!(hand("put it on the table"), Hand::Full);
        assert_eq!(hand("bring it to the desk"), Hand::Full);
        assert_eq!(hand("put the mug on the table"), Hand::Empty);
        assert_eq!(hand("take the mug"), Hand::Empty);
        assert_eq!(hand("go to the table"), Hand::Any);
    }
}
