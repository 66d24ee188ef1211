//! Edges between objects.

use super::object::ObjectId;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What one object is to another: `from` is *kind* `to`, for example the apple (`from`) is on the table (`to`).
///
/// Left, right, front and behind need a viewer and are computed when asked for; they are not stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RelationKind {
    /// Rests on it: footprints overlap and the lower face meets an upper face of it.
    On,
    /// Has it on top (the inverse of `on`).
    Under,
    /// Higher, with overlapping footprint and a gap.
    Above,
    /// Lower, with overlapping footprint and a gap.
    Below,
    /// Inside its box.
    Inside,
    /// Beside it with little gap and overlapping height.
    NextTo,
    /// Close to it.
    Near,
    /// Touches it from the side.
    Against,
    /// A part of it (semantic).
    PartOf,
    /// Used together with it (semantic).
    UsedWith,
    /// Kept in or on it (semantic).
    StoredIn,
}

/// A directed edge R_ij.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Relation {
    /// The object that is described.
    pub from: ObjectId,
    /// The anchor.
    pub to: ObjectId,
    /// The relation.
    pub kind: RelationKind,
    /// Confidence, 0 to 1.
    pub confidence: f32,
}
