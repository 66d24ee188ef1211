//! How well the stored relations of candidates fit the described ones (Latent Relation Filtering).

use crate::client::Client;
use crate::question::Question;
use crate::schema::schema_of;
use crate::settings::Use;
use crate::unanswered;
use dsm::ground::{BackendError, Query, RelatedCandidate, RelationScorer};
use dsm::map::{MapObject, RelationKind};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// Scores relations by a model.
pub struct LanguageScorer {
    client: Arc<Client>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Scores {
    /// One entry for each candidate.
    scores: Vec<Score>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Score {
    /// The candidate.
    id: u64,
    /// From 0, contradicts, to 1, fits.
    score: f32,
}

impl LanguageScorer {
    /// A scorer that asks `client`.
    pub fn new(client: Arc<Client>) -> Self {
        Self { client }
    }
}

impl RelationScorer for LanguageScorer {
    fn name(&self) -> &str {
        self.client.name()
    }

    fn score(&self, text: &str, _: &Query, candidates: &[RelatedCandidate<'_>]) -> Result<Vec<f32>, BackendError> {
        let ids: Vec<u64> = candidates.iter().map(|candidate| candidate.object.id.0).collect();
        let listed: Vec<Value> = candidates.iter().map(words_of).collect();
        let data = json!({"text": text, "candidates": listed});
        let schema = schema_of::<Scores>(&[("id", ids.iter().map(|id| json!(id)).collect())]);
        let question = Question::of_words(Use::Score, include_str!("prompts/score.txt"), data, schema);
        let scores = self.client.ask(&question, |Scores { scores }| {
            in_order(&ids, scores.into_iter().map(|entry| (entry.id, entry.score)))
        });
        scores.map_err(|error| unanswered(&self.client, error))
    }
}

/// One number from 0 to 1 for each id, in the order of the ids.
pub(crate) fn in_order(ids: &[u64], said: impl Iterator<Item = (u64, f32)>) -> Result<Vec<f32>, String> {
    let mut numbers = vec![None; ids.len()];
    for (id, number) in said {
        let place = ids.iter().position(|known| *known == id).ok_or_else(|| format!("there is no candidate {id}"))?;
        if numbers[place].replace(number).is_some() {
            return Err(format!("candidate {id} is scored twice"));
        }
        if !(0.0..=1.0).contains(&number) {
            return Err(format!("the score of candidate {id} is not from 0 to 1"));
        }
    }
    let missing = |place: usize| format!("candidate {} has no score", ids[place]);
    numbers.into_iter().enumerate().map(|(place, number)| number.ok_or_else(|| missing(place))).collect()
}

fn words_of(candidate: &RelatedCandidate<'_>) -> Value {
    let relation = |(kind, other): &(RelationKind, &MapObject)| {
        format!("{} {} {}", relation_words(*kind), other.name(), other.id.0)
    };
    let mut value = place_of(candidate.object);
    value["relations"] = candidate.relations.iter().map(relation).collect();
    value["anchors"] = candidate.anchors.iter().map(|anchor| place_of(anchor)).collect();
    value
}

/// A thing with its box, to the centimetre.
pub(crate) fn place_of(object: &MapObject) -> Value {
    let round = |metres: f64| (100.0 * metres).round() / 100.0;
    let bounds = object.bounds.aabb();
    let (center, size) = (bounds.center(), bounds.size());
    json!({
        "id": object.id.0,
        "name": object.name(),
        "center": [round(center.x), round(center.y), round(center.z)],
        "size": [round(size.x), round(size.y), round(size.z)],
    })
}

fn relation_words(kind: RelationKind) -> &'static str {
    match kind {
        RelationKind::On => "on",
        RelationKind::Under => "under",
        RelationKind::Above => "above",
        RelationKind::Below => "below",
        RelationKind::Inside => "inside",
        RelationKind::NextTo => "next to",
        RelationKind::Near => "near",
        RelationKind::Against => "against",
        RelationKind::PartOf => "part of",
        RelationKind::UsedWith => "used with",
        RelationKind::StoredIn => "kept in",
    }
}
