//! The answer of a grounding.

use super::backend::Spoken;
use super::query::Query;
use super::verify::EMBEDDED;
use crate::map::{ObjectId, RoomId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a grounding ended. A robot acts on `found` only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GroundingStatus {
    /// One thing fits clearly best.
    Found,
    /// Several fit about equally well, or the best fits in all but what the map may have misread.
    Ambiguous,
    /// Nothing in the map fits.
    Absent,
    /// The words do not name anything.
    Unparsed,
}

/// In whose frame left, right, front and behind were read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceFrame {
    /// Nothing in the query depends on a viewer.
    None,
    /// The given viewer, facing the anchor (or the candidates when there is no anchor).
    Viewer,
    /// No viewer was given, and the anchor has open floor on one side: a viewer who stands there and faces it.
    OpenSide,
    /// No viewer was given (or it stands in the anchor): one who stands at the centre of the map's objects and faces the anchor.
    SceneCenter,
}

/// One thing that may be meant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Candidate {
    /// The object; `None` for a room.
    pub object_id: Option<ObjectId>,
    /// The room; `None` for an object.
    pub room_id: Option<RoomId>,
    /// How well it fits, 0 to 1.
    pub score: f32,
    /// What speaks for and against it, one line per constraint.
    pub reasons: Vec<String>,
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Grounding {
    /// How it ended.
    pub status: GroundingStatus,
    /// The object that is meant (the best guess also when ambiguous).
    pub object_id: Option<ObjectId>,
    /// The room that is meant (the best guess also when ambiguous).
    pub room_id: Option<RoomId>,
    /// How well it fits, 0 to 1.
    pub score: f32,
    /// The best candidates, best first, also those that were refused.
    pub candidates: Vec<Candidate>,
    /// The constraint that decided, in words.
    pub decided_by: String,
    /// The frame of view-dependent words.
    pub frame: ReferenceFrame,
    /// Who answered: `embedded`, or the plugged-in backend that spoke last.
    pub backend: String,
    /// Who spoke at the stages for which a backend is plugged in, and why where it was not that backend.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spoken: Vec<Spoken>,
    /// What was understood; `None` when unparsed.
    pub query: Option<Query>,
}

impl Grounding {
    /// The answer to words that name nothing.
    pub(super) fn unparsed(reason: impl Into<String>) -> Self {
        Self {
            status: GroundingStatus::Unparsed,
            object_id: None,
            room_id: None,
            score: 0.0,
            candidates: Vec::new(),
            decided_by: reason.into(),
            frame: ReferenceFrame::None,
            backend: EMBEDDED.to_owned(),
            spoken: Vec::new(),
            query: None,
        }
    }

    /// The same answer with who spoke.
    pub(super) fn told_by(mut self, spoken: Vec<Spoken>) -> Self {
        if let Some(last) = spoken.iter().rev().find(|spoken| spoken.reason.is_none()) {
            self.backend = last.backend.clone();
        }
        self.spoken = spoken;
        self
    }
}
