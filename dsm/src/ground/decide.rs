//! The decision among scored candidates: found, ambiguous or absent, and which constraint decided.

use super::answer::{Candidate, Grounding, GroundingStatus, ReferenceFrame};
use super::config::GroundConfig;
use super::filter::Evaluation;
use super::query::Query;
use super::rooms::RoomFactor;
use super::verify::{EMBEDDED, Verdict};
use crate::map::{ObjectId, RoomId};

/// Least score of an attribute that the views show.
const SHOWN: f32 = 0.4;
/// Most candidates that an answer lists.
const MAX_LISTED: usize = 8;

/// A candidate with its constraints.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Index of the item or room.
    pub(super) index: usize,
    /// Product of all constraints.
    pub(super) score: f32,
    /// Constraints in words with their scores, in order of the query.
    pub(super) constraints: Vec<(String, f32)>,
    /// Which of the constraints the map may have misread, so that they cannot refuse; those beyond its end can.
    pub(super) unsure: Vec<bool>,
    /// Items that were chosen as anchors.
    pub(super) anchors: Vec<usize>,
}

/// How a decision ended.
pub(super) struct Settled {
    status: GroundingStatus,
    /// Place of the answer in the list of choices.
    winner: usize,
    decided_by: String,
}

impl Choice {
    /// Adds what the verifier saw. What the views show cannot refuse, though the votes of single frames say otherwise: a
    /// grey countertop with brown doors is brown to most of them.
    pub(super) fn apply_verdict(&mut self, verdict: Verdict) {
        for (_, score) in self.constraints.iter_mut().filter(|(label, _)| verdict.shown.contains(label)) {
            let least = score.max(SHOWN);
            self.score *= least / score.max(f32::MIN_POSITIVE);
            *score = least;
        }
        self.score *= verdict.factor;
        self.constraints.push((verdict.reason, verdict.factor));
    }

    /// Adds what a plugged-in backend said.
    pub(super) fn apply_factor(&mut self, label: String, factor: f32) {
        self.score *= factor;
        self.constraints.push((label, factor));
    }

    fn worst(&self) -> Option<&(String, f32)> {
        self.constraints.iter().min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The worst of the constraints that the map is sure of.
    fn worst_sure(&self) -> Option<&(String, f32)> {
        let sure = |i: usize| !self.unsure.get(i).copied().unwrap_or(false);
        let constraints = self.constraints.iter().enumerate().filter(|(i, _)| sure(*i));
        constraints.map(|(_, constraint)| constraint).min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Best first; ties by index.
pub(super) fn sort(choices: &mut [Choice]) {
    choices.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.index.cmp(&b.index)));
}

/// The best `top_k` objects, and all further ones that score nearly as well as the last of them.
pub(super) fn best_choices(evaluation: &Evaluation, top_k: usize) -> Vec<Choice> {
    let mut order: Vec<usize> = (0..evaluation.total.len()).filter(|i| evaluation.total[*i] > 0.0).collect();
    order.sort_by(|a, b| evaluation.total[*b].total_cmp(&evaluation.total[*a]).then(a.cmp(b)));
    order.truncate(top_k.max(MAX_LISTED));
    let choice = |index: usize| Choice {
        index,
        score: evaluation.total[index],
        constraints: evaluation.factors.iter().map(|f| (f.label.clone(), f.scores[index])).collect(),
        unsure: evaluation.factors.iter().map(|f| f.unsure).collect(),
        anchors: evaluation.factors.iter().filter_map(|f| f.anchors[index]).collect(),
    };
    order.into_iter().map(choice).collect()
}

/// All rooms, best first.
pub(super) fn best_rooms(factors: &[RoomFactor], rooms: usize) -> Vec<Choice> {
    let choice = |index: usize| {
        let constraints: Vec<(String, f32)> = factors.iter().map(|f| (f.label.clone(), f.scores[index])).collect();
        Choice {
            index,
            score: constraints.iter().map(|c| c.1).product(),
            constraints,
            unsure: Vec::new(),
            anchors: Vec::new(),
        }
    };
    let mut choices: Vec<Choice> = (0..rooms).map(choice).collect();
    sort(&mut choices);
    choices.truncate(MAX_LISTED);
    choices
}

/// Decides. `choices` are sorted, best first. When any one will do (`indefinite`), the nearest of equals is taken.
pub(super) fn settle(
    choices: &[Choice],
    indefinite: bool,
    config: &GroundConfig,
    distance_m: impl Fn(&Choice) -> f64,
) -> Settled {
    let absent = |decided_by: String| Settled { status: GroundingStatus::Absent, winner: 0, decided_by };
    let Some(best) = choices.first() else { return absent("nothing in the map has a name like this".to_owned()) };
    let violated_below = if config.presume_present { 0.0 } else { config.violated_below };
    if let Some((label, score)) = best.worst_sure().filter(|(_, score)| *score < violated_below) {
        return absent(format!("no candidate fits: {label} ({score:.2} for the best)"));
    }
    if let Some((label, score)) = best.worst().filter(|(_, score)| *score < violated_below) {
        let decided_by = format!("the best fits in all but what may be misread: {label} ({score:.2})");
        return Settled { status: GroundingStatus::Ambiguous, winner: 0, decided_by };
    }
    let fits = |choice: &&Choice| choice.worst().is_none_or(|(_, score)| *score >= violated_below);
    let rivals = choices.iter().take_while(|c| c.score >= config.rival_share * best.score).filter(fits).count();
    if rivals <= 1 {
        let decided_by = deciding_constraint(best, choices.get(1));
        return Settled { status: GroundingStatus::Found, winner: 0, decided_by };
    }
    if indefinite {
        let equal = choices.iter().enumerate().take_while(|(_, c)| c.score >= config.rival_share * best.score);
        let fitting = equal.filter(|(_, c)| fits(c));
        let nearest = fitting.min_by(|a, b| distance_m(a.1).total_cmp(&distance_m(b.1)));
        let winner = nearest.map_or(0, |(place, _)| place);
        let decided_by = format!("any of {rivals} will do; this is the nearest");
        return Settled { status: GroundingStatus::Found, winner, decided_by };
    }
    let decided_by = format!("{rivals} candidates fit equally well");
    Settled { status: GroundingStatus::Ambiguous, winner: 0, decided_by }
}

/// The constraint that separates the best from its runner-up most.
fn deciding_constraint(best: &Choice, second: Option<&Choice>) -> String {
    let Some(second) = second else {
        return best.constraints.first().map_or(String::new(), |(label, _)| format!("{label}: the only one"));
    };
    let gain = |((label, own), (_, other)): (&(String, f32), &(String, f32))| (own / other.max(1e-3), label.clone());
    let best_gain = best
        .constraints
        .iter()
        .zip(&second.constraints)
        .map(gain)
        .fold((0.0_f32, String::new()), |best, gain| if gain.0 > best.0 { gain } else { best });
    best_gain.1
}

/// Puts the answer together.
pub(super) fn grounding(
    settled: Settled,
    choices: Vec<Choice>,
    identity: impl Fn(&Choice) -> (Option<ObjectId>, Option<RoomId>),
    frame: ReferenceFrame,
    query: Query,
) -> Grounding {
    let answered = settled.status != GroundingStatus::Absent;
    let winner = choices.get(settled.winner).filter(|_| answered);
    let (object_id, room_id) = winner.map_or((None, None), &identity);
    let candidate = |choice: &Choice| {
        let (object_id, room_id) = identity(choice);
        let reasons = choice.constraints.iter().map(|(label, score)| format!("{label}: {score:.2}")).collect();
        Candidate { object_id, room_id, score: choice.score, reasons }
    };
    Grounding {
        status: settled.status,
        object_id,
        room_id,
        score: winner.map_or(0.0, |choice| choice.score),
        candidates: choices.iter().map(candidate).collect(),
        decided_by: settled.decided_by,
        frame,
        backend: EMBEDDED.to_owned(),
        spoken: Vec::new(),
        query: Some(query),
    }
}
