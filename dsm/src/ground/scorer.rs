//! Who scores how well the stored relations of candidates fit the words (paper, Latent Relation Filtering).

use super::backend::BackendError;
use super::query::Query;
use crate::map::{MapObject, RelationKind};

/// One candidate with what the map knows of its place.
#[derive(Clone, Debug)]
pub struct RelatedCandidate<'a> {
    /// The candidate.
    pub object: &'a MapObject,
    /// Its stored relations, those to likely anchors first, then the surest: what it is to which other object.
    pub relations: Vec<(RelationKind, &'a MapObject)>,
    /// Objects that the embedded filter takes for its anchors.
    pub anchors: Vec<&'a MapObject>,
    /// Score by the embedded filter, 0 to 1.
    pub score: f32,
}

/// Scores the relations of candidates. The embedded filter always runs before it.
pub trait RelationScorer: Send + Sync {
    /// Name for reports.
    fn name(&self) -> &str;

    /// How well the relations of each candidate fit those that were described, 0 to 1, one per candidate.
    ///
    /// # Errors
    /// [`BackendError::Backend`] when a plugged-in backend gives no answer; the embedded scores then stand as they are.
    fn score(&self, text: &str, query: &Query, candidates: &[RelatedCandidate<'_>]) -> Result<Vec<f32>, BackendError>;
}
