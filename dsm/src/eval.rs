//! Truth, as an evaluator sees it. Nothing in the map or in grounding reads this.

use crate::Pose;
use crate::geometry::OrientedBox;
use crate::time::Stamp;
use serde::{Deserialize, Serialize};

/// The true state of one object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueObject {
    /// Name of its body in the scene.
    pub body: String,
    /// Category from the scene's semantics.
    pub category: String,
    /// Pose of the body in the world frame.
    pub world_from_body: Pose,
    /// Box around its visible geometry.
    pub bounds: OrientedBox,
    /// Whether it can move freely.
    pub free: bool,
}

/// A contact between two bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueContact {
    /// First body (robot links as `robot/<link>`).
    pub first: String,
    /// Second body.
    pub second: String,
    /// Normal force in newtons.
    pub force_n: f64,
    /// Closing speed of the contact points along the normal when it began, metres per second.
    pub approach_speed_m_per_s: f64,
}

/// The true state of the world at one moment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// When.
    pub stamp: Stamp,
    /// Every object of the scene's semantics, in the order of the scene.
    pub objects: Vec<TrueObject>,
    /// Pose of the robot's base.
    pub world_from_base: Pose,
    /// Contacts between the robot and the world, and of free objects with each other and their supports.
    pub contacts: Vec<TrueContact>,
    /// Smallest distance between the robot and what it is not meant to touch, metres; `None` when not measured.
    pub clearance_m: Option<f64>,
}
