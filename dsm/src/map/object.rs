//! One object of the map.

use super::attributes::Attributes;
use super::provenance::Provenance;
use super::room::RoomId;
use super::votes::Votes;
use crate::geometry::OrientedBox;
use crate::time::Stamp;
use nalgebra::Point3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Identity of an object within one map; never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
pub struct ObjectId(pub u64);

/// One surface point of an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// Position in the world frame, metres.
    pub position: Point3<f32>,
    /// Colour, sRGB.
    pub color: [u8; 3],
}

/// How sure the map is that the object exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectState {
    /// Seen too few times to count; dies if it is not confirmed.
    Provisional,
    /// Confirmed by several observations.
    Stable,
}

/// An object node of the map: geometry O^g and semantics O^s of the paper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapObject {
    /// Its identity.
    pub id: ObjectId,
    /// Provisional or stable.
    pub state: ObjectState,
    /// Votes for its name (N^i).
    pub names: Votes,
    /// Its surface points P_i, bounded in number.
    pub points: Vec<MapPoint>,
    /// Its box B_i, upright unless its shape says otherwise.
    pub bounds: OrientedBox,
    /// Its attributes A_i.
    pub attributes: Attributes,
    /// Who gave the votes for names and attributes. Map files hold it in records of its own.
    #[serde(skip)]
    pub provenance: Provenance,
    /// Visual feature f_v, unit length.
    pub visual_feature: Vec<f32>,
    /// Feature f_s of its names, unit length.
    pub text_feature: Vec<f32>,
    /// The room it stands in.
    pub room: Option<RoomId>,
    /// Number of frames it was seen in.
    pub observations: u32,
    /// When it was first seen.
    pub first_seen: Stamp,
    /// When it was last seen.
    pub last_seen: Stamp,
}

impl MapObject {
    /// A stable object of which nothing but names and box is known.
    pub fn given(id: ObjectId, names: Votes, bounds: OrientedBox) -> Self {
        Self {
            id,
            state: ObjectState::Stable,
            names,
            points: Vec::new(),
            bounds,
            attributes: Attributes::default(),
            provenance: Provenance::default(),
            visual_feature: Vec::new(),
            text_feature: Vec::new(),
            room: None,
            observations: 1,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        }
    }

    /// Its most voted name; empty only before the first observation.
    pub fn name(&self) -> &str {
        self.names.find_winner().map_or("", |(name, _)| name)
    }

    /// Confidence that it exists as named, 0 to 1: the share of its name times the certainty from its observations n, 1 - 1/(1+n).
    pub fn confidence(&self) -> f32 {
        let share = self.names.find_winner().map_or(0.0, |(_, share)| share);
        share * (1.0 - 1.0 / (1.0 + self.observations as f32))
    }
}
