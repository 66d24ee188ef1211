//! Stage 3, multi-level verification: the last look at the few best candidates.

use super::color;
use super::query::{AttributeWord, Query};
use crate::knowledge::Knowledge;
use crate::map::{Map, MapObject};
use std::sync::Arc;

/// What a verifier says of one candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Multiplies the candidate's score: 1 confirms, less doubts. Range 0 to 1.
    pub factor: f32,
    /// What was seen, in words.
    pub reason: String,
}

/// Looks at a candidate and its anchors and says whether they fit the query.
pub trait Verifier: Send + Sync {
    /// Name for reports.
    fn name(&self) -> &str;

    /// Judges one candidate; `anchors` are the objects chosen as anchors of its relations.
    fn verify(&self, map: &Map, query: &Query, candidate: &MapObject, anchors: &[&MapObject]) -> Verdict;
}

/// Works from the map's own points, without a model.
pub struct EmbeddedVerifier {
    knowledge: Arc<Knowledge>,
}

impl EmbeddedVerifier {
    /// A verifier that knows colour words from `knowledge`.
    pub fn new(knowledge: Arc<Knowledge>) -> Self {
        Self { knowledge }
    }
}

impl Verifier for EmbeddedVerifier {
    fn name(&self) -> &str {
        "embedded"
    }

    fn verify(&self, _map: &Map, query: &Query, candidate: &MapObject, _anchors: &[&MapObject]) -> Verdict {
        let asked = query.target.attributes.iter().find(|term| term.kind == AttributeWord::Color && !term.negated);
        let Some(asked) = asked.filter(|_| !candidate.points.is_empty()) else {
            return Verdict { factor: 1.0, reason: "nothing to look for in views".to_owned() };
        };
        let fits = |point: &crate::map::MapPoint| {
            color::fit(self.knowledge.words(), &asked.word, point.color.map(f64::from)) > 0.6
        };
        let share = candidate.points.iter().filter(|p| fits(p)).count() as f32 / candidate.points.len() as f32;
        Verdict {
            factor: 0.7 + 0.3 * (share / 0.4).min(1.0),
            reason: format!("{:.0} % of its points look {}", 100.0 * share, asked.word),
        }
    }
}
