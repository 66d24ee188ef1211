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
    /// Rests on it: the common footprint is more than 30 % of the smaller one, the anchor reaches lower, and the lower face
    /// is within 8 cm of an upward face of the anchor (its top, or a board or seat found in its height histogram).
    On,
    /// Carries it (the inverse of `on`).
    Under,
    /// Higher without resting on it: common footprint more than 30 % of the smaller one, gap 6 cm to 2.5 m.
    Above,
    /// Lower (the inverse of `above`).
    Below,
    /// At least 70 % of its volume lies in the anchor's box, and its volume is less than 70 % of the anchor's.
    Inside,
    /// Beside it: heights overlap by more than 30 % of the lower one, footprints are apart by at most half the mean
    /// diagonal of both (15 to 60 cm), and neither rests on or holds the other.
    NextTo,
    /// Boxes at most 1 m apart (`near_m`) in one room, neither resting on nor holding the other; stored for the closest
    /// eight.
    Near,
    /// Touches it from the side: as `next_to` with a gap of at most 6 cm.
    Against,
    /// A part of it (semantic): the knowledge table says so and the boxes are at most 10 cm apart.
    PartOf,
    /// Used together with it (semantic): the knowledge table says so and the boxes are at most 1.5 m apart.
    UsedWith,
    /// Kept in or on it (semantic): the knowledge table says so and it is in or on it.
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
