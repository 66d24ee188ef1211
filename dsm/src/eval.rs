//! Truth, as an evaluator sees it, and what a map is worth against it. Nothing in the map or in grounding reads this.

mod attributes;
mod class_file;
mod expressions;
mod faults;
mod labelled_cloud;
mod labeller;
mod matching;
mod nearest;
mod places;
mod referring;
mod relations;
mod rooms;
mod scene;
mod score;
mod segmentation;
mod statistics;

pub use class_file::{LabelClass, LabelClasses};
pub use expressions::{Expression, Meant, make_expressions};
pub use labelled_cloud::{CloudError, LabelledCloud, LabelledPoint};
pub use labeller::{AnsweredLabeller, EmbeddedLabeller, EncodedLabeller, Labeller, LabellerError, Question, describe};
pub use matching::{Matching, Verdict, match_objects};
pub use referring::{Answered, GroundingReport, answer_expressions, compare_answers, pool_answers};
pub use scene::{SurfacePoint, TrueAttributes, TrueScene, TrueThing};
pub use score::{MapScore, score_map};
pub use segmentation::{ClassScore, CloudScore, LabelledObject, score_cloud};
pub use statistics::{Estimate, F1Count, MapReport, Mean, Method, Share, compare, pool};

use crate::Pose;
use crate::geometry::OrientedBox;
use crate::map::FreeSpace;
use crate::time::Stamp;
use nalgebra::Point2;
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
    /// Smallest distance between the robot's base column and fixed or free bodies other than the floor, metres; `None`
    /// when not measured.
    pub clearance_m: Option<f64>,
    /// Bodies with at least 150 label pixels in the newest image of the head camera.
    pub in_view: Vec<String>,
    /// Every joint of the robot.
    pub joints: Vec<TrueJoint>,
    /// Every part of the scene that moves on a joint, in the order of the scene: doors, drawers, lids.
    #[serde(default)]
    pub parts: Vec<TruePart>,
    /// What disturbed the world since the sample before.
    #[serde(default)]
    pub events: Vec<TrueEvent>,
}

/// The true state of a part that moves on a joint against what carries it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TruePart {
    /// The part as an object of its own. Its category is that of the scene's semantics, else a word of its body's name.
    pub object: TrueObject,
    /// Name of the body that carries it.
    pub part_of: String,
    /// Name of the joint in the scene.
    pub joint: String,
    /// Whether it slides (metres) instead of turning (radians).
    pub slides: bool,
    /// Position of the joint.
    pub position: f64,
    /// Mean velocity since the sample before.
    pub velocity: f64,
    /// Least and greatest position; `None` when the joint has no end.
    pub range: Option<[f64; 2]>,
}

/// Something that was done to the world from outside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueEvent {
    /// When.
    pub stamp: Stamp,
    /// What, in words.
    pub what: String,
    /// Bodies that were put elsewhere.
    pub moved: Vec<String>,
}

/// The true state of one robot joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueJoint {
    /// Name in the URDF.
    pub name: String,
    /// Position in radians or metres.
    pub position: f64,
    /// Velocity in radians or metres per second.
    pub velocity: f64,
}

/// A room as the author of the scene drew it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueRoom {
    /// Name.
    pub name: String,
    /// Outline, world frame, metres.
    pub polygon: Vec<Point2<f64>>,
}

/// What does not change during an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueWorld {
    /// Name of the scene.
    pub scene: String,
    /// Rooms.
    pub rooms: Vec<TrueRoom>,
    /// Where the robot's base column could stand at the start, from the collision geometry.
    pub free_space: FreeSpace,
}
