//! `dsm_msgs`: what ROS 2 has no message for. Their definitions stand in `docs/ros2.md`.

use super::standard::{Header, Time};
use serde::{Deserialize, Serialize};

/// Asks a simulated robot to let time pass, or says that it has passed. Topics have no order among each other: the counts
/// tell how many messages belong to it, so that either side waits until it has them all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// Until when time is to pass, or the moment that was reached.
    pub until: Time,
    /// Number of this step; 0 begins a run: no time passes, and both sides count from here.
    pub number: u64,
    /// Topics.
    pub topics: Vec<String>,
    /// Messages sent on each of them since step 0 was asked for.
    pub counts: Vec<u64>,
}

/// A run of pixels in row-major order; it never crosses the end of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PixelRun {
    /// Row-major index of the first.
    pub start: u32,
    /// How many.
    pub length: u32,
}

/// One thing seen in a picture, without an identity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MaskedDetection {
    /// Its name.
    pub name: String,
    /// How sure, 0 to 1.
    pub score: f32,
    /// Its pixels.
    pub runs: Vec<PixelRun>,
}

/// All things seen in the picture of the same stamp and frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MaskedDetections {
    /// Those of the picture.
    pub header: Header,
    /// Number of the picture among all that the robot took.
    pub frame: u64,
    /// Who saw them.
    pub detector: String,
    /// Columns of the picture.
    pub width: u32,
    /// The things.
    pub detections: Vec<MaskedDetection>,
}

/// What a run came to, as the robot's own task has it. Whoever judges needs it for what was grounded and refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// Name of the episode.
    pub episode: String,
    /// Accounts of the steps, JSON as in `summary.json`.
    pub steps: String,
    /// The first failure that the task knows of, JSON; `null` without one.
    pub failure: String,
    /// The map at the end, the bytes of `map.dsm`.
    pub map: Vec<u8>,
}

super::named!("dsm_msgs": Step, MaskedDetections, Account);
