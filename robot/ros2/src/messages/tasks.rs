//! `dsm_msgs`: words for a map and a task. Their definitions stand in `docs/ros2.md`.

use super::geometry::{Point, Vector3};
use serde::{Deserialize, Serialize};

/// Asks what a text means in the map: the request of `dsm_msgs/srv/GroundText`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroundTextRequest {
    /// Plain English: "the apple on the white shelf".
    pub text: String,
}

/// What a text means: the response of `dsm_msgs/srv/GroundText`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroundTextResponse {
    /// `found`, `ambiguous`, `absent` or `unparsed`. Only what is found may be acted on.
    pub status: String,
    /// The object; -1 for none.
    pub object_id: i32,
    /// The room; -1 for none.
    pub room_id: i32,
    /// How well it fits, 0 to 1.
    pub score: f32,
    /// The middle of what is meant, frame `map`, metres.
    pub center: Point,
    /// Its sides, metres; 0 for a room.
    pub size: Vector3,
    /// What decided, in words.
    pub decided_by: String,
}

/// Orders a task: the goal of `dsm_msgs/action/DoTask`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DoTaskGoal {
    /// Plain English: "Grasp the apple on the white shelf".
    pub command: String,
}

/// What became of a task: the result of `dsm_msgs/action/DoTask`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DoTaskResult {
    /// Whether it is done, as the robot itself knows it.
    pub success: bool,
    /// `done`, `absent`, `ambiguous`, `failed` or `skipped`.
    pub outcome: String,
    /// Why, in words.
    pub reason: String,
}

/// What happens on the way: the feedback of `dsm_msgs/action/DoTask`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DoTaskFeedback {
    /// The event, in words.
    pub event: String,
}

impl ros2_client::Message for GroundTextRequest {}
impl ros2_client::Message for GroundTextResponse {}
impl ros2_client::Message for DoTaskGoal {}
impl ros2_client::Message for DoTaskResult {}
impl ros2_client::Message for DoTaskFeedback {}
