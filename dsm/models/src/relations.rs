//! Semantic relations R^s between marked things.

use crate::attributes::Marked;
use crate::client::Client;
use crate::error::ModelError;
use crate::picture::Picture;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::{Answers, Use};
use dsm::map::RelationKind;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};

/// Most relations that one picture brings.
const MAX_RELATIONS: usize = 60;
/// Confidence from which a relation is taken.
const LEAST_CONFIDENCE: f32 = 0.5;

/// A relation between two marks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Related {
    pub(crate) from: u32,
    pub(crate) to: u32,
    pub(crate) kind: RelationKind,
    pub(crate) confidence: f32,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Relations {
    /// What holds between two marked things; may be empty.
    relations: Vec<Stated>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Stated {
    /// Mark of the thing that is described.
    from: u32,
    /// What it is to the other.
    kind: Kind,
    /// Mark of the other.
    to: u32,
    /// From 0 to 1.
    confidence: f32,
}

#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Kind {
    PartOf,
    UsedWith,
    StoredIn,
}

/// Asks for semantic relations between the marked things in a picture.
pub(crate) fn relate(
    client: &Client,
    answers: Answers,
    picture: &Picture,
    marks: &[Marked],
) -> Result<Vec<Related>, ModelError> {
    let listed = |marked: &Marked| json!({"mark": marked.mark, "name": marked.name});
    let data = json!({"marks": marks.iter().map(listed).collect::<Vec<Value>>()});
    let numbers: Vec<Value> = marks.iter().map(|marked| json!(marked.mark)).collect();
    let schema = schema_of::<Relations>(&[("from", numbers.clone()), ("to", numbers)]);
    let question = Question {
        pictures: vec![picture.clone()],
        ..Question::of_words(Use::Relations, include_str!("prompts/relations.txt"), data, schema)
    };
    client.ask_from(answers, &question, |Relations { relations }| {
        if relations.len() > MAX_RELATIONS {
            return Err(format!("there are more than {MAX_RELATIONS} relations"));
        }
        let known = |mark: u32| marks.iter().any(|marked| marked.mark == mark);
        if let Some(stated) = relations.iter().find(|stated| !known(stated.from) || !known(stated.to)) {
            return Err(format!("there are no marks {} and {}", stated.from, stated.to));
        }
        Ok(relations.into_iter().filter_map(taken).collect())
    })
}

fn taken(stated: Stated) -> Option<Related> {
    let kind = match stated.kind {
        Kind::PartOf => RelationKind::PartOf,
        Kind::UsedWith => RelationKind::UsedWith,
        Kind::StoredIn => RelationKind::StoredIn,
    };
    let sure = stated.confidence >= LEAST_CONFIDENCE && stated.from != stated.to;
    let confidence = stated.confidence.min(1.0);
    sure.then_some(Related { from: stated.from, to: stated.to, kind, confidence })
}
