//! Plugged-in language backends: how their failures travel, and which of them spoke.
//!
//! A backend may read the words ([`QueryReader`](super::QueryReader)), score relations
//! ([`RelationScorer`](super::RelationScorer)) and verify candidates ([`Verifier`](super::Verifier)). Whatever it says, it
//! chooses only among what the words say and what the map itself finds plausible: readings are held against the words,
//! and a score never falls below [`LEAST_FACTOR`], so that a model can prefer but not refuse. When it fails, the embedded
//! one of its kind takes over.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What remains at least of a candidate's score, whatever a plugged-in backend says of it. It lies above the score from
/// which a constraint counts as violated, and far enough below 1 to decide between equals.
pub const LEAST_FACTOR: f32 = 0.4;

/// Why a plugged-in backend gave no answer that can be used.
#[derive(Debug, Error)]
pub enum BackendError {
    /// The backend's own failure.
    #[error("backend `{name}`: {source}")]
    Backend {
        /// The backend.
        name: String,
        /// What went wrong there.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A reading that speaks of what was not said, or that has no sound form.
    #[error("backend `{name}` read what was not said: {what}")]
    Unfounded {
        /// The backend.
        name: String,
        /// The word or the form.
        what: String,
    },
    /// Another number of scores than there are candidates, or scores that are no numbers.
    #[error("backend `{name}` gave {given} sound scores for {candidates} candidates")]
    Scores {
        /// The backend.
        name: String,
        /// Sound scores.
        given: usize,
        /// Candidates.
        candidates: usize,
    },
}

/// A stage of grounding that a backend may take part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GroundingStage {
    /// From words to a query.
    Parse,
    /// Relations of the candidates against those of the query.
    Relations,
    /// The last look at the few best candidates.
    Verify,
}

/// Who spoke at a stage for which a backend is plugged in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Spoken {
    /// The stage.
    pub stage: GroundingStage,
    /// Whose answer counts: the backend's name, or `embedded` when it gave none.
    pub backend: String,
    /// Why the plugged-in backend's answer does not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Spoken {
    /// The plugged-in backend spoke.
    pub(super) fn by(stage: GroundingStage, backend: &str) -> Self {
        Self { stage, backend: backend.to_owned(), reason: None }
    }

    /// The embedded one spoke instead.
    pub(super) fn embedded(stage: GroundingStage, error: &BackendError) -> Self {
        Self { stage, backend: super::verify::EMBEDDED.to_owned(), reason: Some(error.to_string()) }
    }
}
