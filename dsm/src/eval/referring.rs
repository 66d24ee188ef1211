//! Grounding of expressions in a map, judged by the truth.

use super::expressions::{Expression, Meant};
use super::matching::{Matching, match_objects};
use super::scene::TrueScene;
use super::score::MapScore;
use super::statistics::{Estimate, Share, compare, pool};
use crate::ground::{Grounder, GroundingStatus};
use crate::map::Map;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How one expression was answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answered {
    /// The expression.
    pub expression: Expression,
    /// How grounding ended.
    pub status: GroundingStatus,
    /// Whether the best guess is an object of the thing that is meant: assigned to it, or a fragment of it.
    pub right: bool,
    /// Overlap of the guessed object's box with the true one, 0 without a guess.
    pub iou: f64,
    /// Whether the thing that is meant has an object in the map at all.
    pub mapped: bool,
    /// What decided.
    pub decided_by: String,
}

/// Rates over all answers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GroundingReport {
    /// Rates with intervals by name: `right`, `acc_25`, `acc_50` with `/unique`, `/multiple`, `/KIND`; `absent_refused`,
    /// `present_refused`, `ambiguous_said`, and `mapped`, the share of the meant things that have an object; `_of_mapped`
    /// for those alone.
    pub estimates: BTreeMap<String, Estimate>,
}

/// Grounds all expressions of a scene in a map of it.
pub fn answer_expressions(
    map: &Map,
    truth: &TrueScene,
    expressions: &[Expression],
    grounder: &Grounder,
) -> Vec<Answered> {
    let matching = match_objects(map, truth);
    expressions.iter().map(|expression| answer(map, truth, &matching, expression, grounder)).collect()
}

fn answer(map: &Map, truth: &TrueScene, matching: &Matching, expression: &Expression, grounder: &Grounder) -> Answered {
    let grounding = grounder.ground(map, &expression.text, None);
    let (mut right, mut iou, mut mapped) = (false, 0.0, false);
    if let Meant::Thing(thing) = expression.meant {
        mapped = matching.object_of[thing].is_some();
        if let Some(object) = grounding.object_id.and_then(|id| map.find_object(id)) {
            right = matching.find_shown(object.id) == Some(thing);
            iou = object.bounds.aabb().iou(&truth.objects[thing].bounds.aabb());
        }
    }
    Answered {
        expression: expression.clone(),
        status: grounding.status,
        right,
        iou,
        mapped,
        decided_by: grounding.decided_by,
    }
}

/// Rates over the answers of several runs, each with the name of its scene. Intervals take the scenes, not the
/// expressions in them, for independent.
pub fn pool_answers(runs: &[(&str, &[Answered])]) -> GroundingReport {
    let scores = count(runs);
    GroundingReport { estimates: pool(&with_names(runs, &scores)).estimates }
}

/// How much larger each rate is with the first answers than with the second ones, which are to the same expressions.
pub fn compare_answers(runs: &[(&str, &[Answered])], others: &[(&str, &[Answered])]) -> GroundingReport {
    let (scores, other_scores) = (count(runs), count(others));
    GroundingReport { estimates: compare(&with_names(runs, &scores), &with_names(others, &other_scores)) }
}

fn with_names<'a>(runs: &[(&'a str, &[Answered])], scores: &'a [MapScore]) -> Vec<(&'a str, &'a MapScore)> {
    runs.iter().zip(scores).map(|((scene, _), score)| (*scene, score)).collect()
}

fn count(runs: &[(&str, &[Answered])]) -> Vec<MapScore> {
    let one = |(_, answers): &(&str, &[Answered])| MapScore { shares: count_answers(answers), ..MapScore::default() };
    runs.iter().map(one).collect()
}

fn count_answers(answers: &[Answered]) -> BTreeMap<String, Share> {
    let mut shares: BTreeMap<String, Share> = BTreeMap::new();
    let mut add = |name: String, hit: bool| shares.entry(name).or_default().add(hit);
    for answered in answers {
        let refused = matches!(answered.status, GroundingStatus::Absent | GroundingStatus::Unparsed);
        let expression = &answered.expression;
        match expression.meant {
            Meant::Absent => add("absent_refused".into(), refused),
            Meant::Ambiguous => add("ambiguous_said".into(), answered.status == GroundingStatus::Ambiguous),
            Meant::Thing(_) => {
                add("present_refused".into(), refused);
                add("mapped".into(), answered.mapped);
                add("certain".into(), answered.status == GroundingStatus::Found);
                let split = if expression.multiple { "multiple" } else { "unique" };
                let rates =
                    [("right", answered.right), ("acc_25", answered.iou >= 0.25), ("acc_50", answered.iou >= 0.5)];
                for (name, hit) in rates {
                    add(name.to_owned(), hit);
                    add(format!("{name}/{split}"), hit);
                }
                add(format!("right/{}", expression.kind), answered.right);
                if answered.mapped {
                    add("right_of_mapped".into(), answered.right);
                    add("present_refused_of_mapped".into(), refused);
                }
            }
        }
    }
    shares
}
