//! What kinds of language a query uses, to see where answers go wrong.

use super::data::{QueryLine, SceneLine};
use super::evaluate::{Prediction, Rate, is_right};
use crate::ground::{Entity, Noun, Query};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// A wrong answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failure {
    /// Data set.
    pub dataset: String,
    /// The query.
    pub query_id: String,
    /// Its words.
    pub utterance: String,
    /// What kinds of language it uses.
    pub classes: Vec<String>,
    /// Name of what was answered.
    pub answered: Option<String>,
    /// Name of what was meant, where it is known.
    pub meant: Option<String>,
    /// What was understood.
    pub query: Option<Query>,
}

/// The kinds of language in a query: relations, orders, attributes, and how it is built.
pub(super) fn classes_of(query: Option<&Query>, utterance: &str) -> Vec<String> {
    let Some(query) = query else { return vec!["not understood".to_owned()] };
    let target = &query.target;
    let mut classes = BTreeSet::new();
    for relation in &target.relations {
        let not = if relation.negated { "not " } else { "" };
        classes.insert(format!("relation: {not}{}", relation.word.phrase()));
        if relation.anchors.iter().any(|anchor| anchor.noun == target.noun) {
            classes.insert("built: anchor of the same kind".to_owned());
        }
        if relation.anchors.iter().any(|anchor| !anchor.relations.is_empty()) {
            classes.insert("built: anchor with an anchor".to_owned());
        }
    }
    for selection in &target.selections {
        let order = serde_json::to_value(selection.order).ok();
        let order = order.as_ref().and_then(serde_json::Value::as_str).unwrap_or("").to_owned();
        classes.insert(if selection.rank > 1 {
            "order: number in a row".to_owned()
        } else {
            format!("order: {order}")
        });
    }
    for term in &target.attributes {
        let not = if term.negated { "not " } else { "" };
        let kind = serde_json::to_value(term.kind).ok();
        classes.insert(format!("attribute: {not}{}", kind.as_ref().and_then(serde_json::Value::as_str).unwrap_or("")));
    }
    if let Some(viewpoint) = &query.viewpoint {
        classes.insert(if viewpoint.entering { "viewpoint: entering" } else { "viewpoint: facing" }.to_owned());
    }
    if target.noun == Noun::Anything {
        classes.insert("built: no name".to_owned());
    }
    if says_nothing(target) {
        classes.insert("built: nothing but a name".to_owned());
    }
    let sentences = utterance.split(['.', ';']).filter(|part| part.split_whitespace().count() > 1).count();
    if sentences > 1 {
        classes.insert("built: several sentences".to_owned());
    }
    classes.into_iter().collect()
}

fn says_nothing(target: &Entity) -> bool {
    target.relations.is_empty() && target.selections.is_empty() && target.attributes.is_empty()
}

/// Rates by data set and class.
pub(super) fn rates_by_class(
    scenes: &BTreeMap<String, SceneLine>,
    queries: &[QueryLine],
    predictions: &[Prediction],
) -> BTreeMap<String, Rate> {
    let mut counts: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for (query, prediction) in queries.iter().zip(predictions) {
        let Some(right) = is_right(scenes.get(&query.scene_id), query, prediction) else { continue };
        for class in &prediction.classes {
            let count = counts.entry(format!("{}/{class}", query.dataset)).or_default();
            count[0] += usize::from(right);
            count[1] += 1;
        }
    }
    counts.into_iter().map(|(key, [right, count])| (key, Rate::new(right, count))).collect()
}

/// The wrong answers, in order of the queries.
pub fn list_failures(
    scenes: &BTreeMap<String, SceneLine>,
    queries: &[QueryLine],
    predictions: &[Prediction],
) -> Vec<Failure> {
    let failure = |(query, prediction): (&QueryLine, &Prediction)| {
        let scene = scenes.get(&query.scene_id);
        if is_right(scene, query, prediction)? {
            return None;
        }
        let label = |id: Option<&serde_json::Value>| {
            let object = scene?.objects.iter().find(|object| Some(&object.id) == id)?;
            Some(object.label.clone())
        };
        Some(Failure {
            dataset: query.dataset.clone(),
            query_id: query.query_id.clone(),
            utterance: query.utterance.clone(),
            classes: prediction.classes.clone(),
            answered: label(prediction.predicted_id.as_ref()),
            meant: query.target_id.as_ref().and_then(|id| label(Some(id))),
            query: prediction.query.clone(),
        })
    };
    queries.iter().zip(predictions).filter_map(failure).collect()
}
