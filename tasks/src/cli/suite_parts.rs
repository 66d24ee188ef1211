//! Sequences of a suite: how many were carried out, and whether what was said of each part is true.

use super::suite_result::{Share, SuiteEpisode, share};
use crate::summary::{StepOutcome, Summary};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parts of an episode's sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct Parts {
    /// Parts.
    pub parts: usize,
    /// Parts that are done, by the truth.
    pub done: usize,
    /// Parts that are said to be done and are not, or the other way round.
    pub untrue: usize,
}

/// What the sequences of a suite came to.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub(super) struct Sequences {
    /// Sequences of which all parts are done.
    pub complete: Share,
    /// Parts done, of all.
    pub parts: Share,
    /// Sequences of which the account is true of each part.
    pub truthful: Share,
}

/// The parts of an episode with one sequence and one expectation for each of its parts, in their order.
pub(super) fn find_parts(summary: &Summary) -> Option<Parts> {
    let parts = &summary.steps.last()?.parts;
    if parts.is_empty() || parts.len() != summary.expectations.len() {
        return None;
    }
    let told = parts.iter().map(|part| part.outcome == StepOutcome::Done);
    let untrue = told.zip(&summary.expectations).filter(|(told, expectation)| *told != expectation.passed).count();
    let done = summary.expectations.iter().filter(|expectation| expectation.passed).count();
    Some(Parts { parts: parts.len(), done, untrue })
}

/// Sums over the episodes; `None` without sequences.
pub(super) fn sum_up(episodes: &[SuiteEpisode]) -> Option<Sequences> {
    let all: Vec<&Parts> = episodes.iter().filter_map(|episode| episode.parts.as_ref()).collect();
    if all.is_empty() {
        return None;
    }
    Some(Sequences {
        complete: share(all.iter().filter(|p| p.done == p.parts).count(), all.len()),
        parts: share(all.iter().map(|p| p.done).sum(), all.iter().map(|p| p.parts).sum()),
        truthful: share(all.iter().filter(|p| p.untrue == 0).count(), all.len()),
    })
}
