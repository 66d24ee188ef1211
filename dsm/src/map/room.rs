//! Rooms.

use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Identity of a room within one map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
pub struct RoomId(pub u32);

/// A room found in free space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Room {
    /// Its identity.
    pub id: RoomId,
    /// Name from what it holds, for example `kitchen`; `room` when nothing tells.
    pub name: String,
    /// Outline in the world frame, metres, counter-clockwise.
    pub polygon: Vec<Point2<f64>>,
    /// A free point inside it, far from its walls.
    pub center: Point2<f64>,
    /// Floor area in square metres.
    pub area_m2: f64,
    /// Rooms reached through a door.
    pub neighbours: Vec<RoomId>,
}
