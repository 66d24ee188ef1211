//! `[safety]` of `robot.toml`: what the envelope holds a robot to, besides the limits of `[base]`, `[[group]]` and the URDF.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[safety]`: watchdogs, and where and how fast the robot may move near things and people.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SafetySettings {
    /// A part that moves and is not commanded for so long brakes, seconds. Default 0.1, range 0.02 to 1.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub command_timeout_s: f64,
    /// A sense that gives nothing newer for so long stops whatever moves by it, seconds. Default 0.5, range 0.05 to 2.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub sensor_timeout_s: f64,
    /// A frame that is older than this when it arrives shows nothing of now, seconds. Default 1, range 0.1 to 5.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub oldest_frame_s: f64,
    /// Localisation that moves by so much against odometry within 10 ms jumps, metres. Default 0.05, range 0.01 to 1.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub jump_m: f64,
    /// ... or turns by so much, radians. Default 0.035, range 0.005 to 1.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub jump_rad: f64,
    /// After a jump localisation must agree with odometry for so long before the base goes on, seconds. Default 0.5,
    /// range 0.1 to 10.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub settled_after_s: f64,
    /// A clock or stamps that are off by more than this jump, seconds. Default 0.25, range 0.02 to 5.
    #[schemars(range(min = 0.02, max = 5.0))]
    pub time_jump_s: f64,
    /// A hold that lasts longer than this is latched, seconds. Default 10, range 1 to 600.
    #[schemars(range(min = 1.0, max = 600.0))]
    pub longest_hold_s: f64,
    /// Distances from what the cameras measure.
    pub depth: DepthSettings,
    /// Speed near people.
    pub people: PeopleSettings,
    /// Corners of the area that the base's middle stays in, world frame, metres, in order; three or more. Default none: no
    /// bound.
    pub area: Vec<[f64; 2]>,
    /// Lowest height of the tool above the floor, metres. Default none, range 0 to 3.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub tool_lowest_m: Option<f64>,
    /// Greatest height of the tool above the floor, metres. Default none, range 0 to 3.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub tool_highest_m: Option<f64>,
}

impl Default for SafetySettings {
    fn default() -> Self {
        Self {
            command_timeout_s: 0.1,
            sensor_timeout_s: 0.5,
            oldest_frame_s: 1.0,
            jump_m: 0.05,
            jump_rad: 0.035,
            settled_after_s: 0.5,
            time_jump_s: 0.25,
            longest_hold_s: 10.0,
            depth: DepthSettings::default(),
            people: PeopleSettings::default(),
            area: Vec::new(),
            tool_lowest_m: None,
            tool_highest_m: None,
        }
    }
}

/// `[safety.depth]`: the base can always stop before what the cameras measured a moment ago.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DepthSettings {
    /// Share of the base's acceleration limit that braking counts on. Default 0.9, range 0.1 to 1.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub braking_share: f64,
    /// Distance from the footprint that is kept, metres. Default 0.005, range 0 to 0.5.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub margin_m: f64,
    /// Speed at which the base may come as near as it likes, metres per second: what is approached on purpose. Default
    /// 0.1, range 0 to 0.3.
    #[schemars(range(min = 0.0, max = 0.3))]
    pub creep_m_per_s: f64,
    /// Lowest point that counts, metres above the floor. Default 0.06, range 0.01 to 0.5.
    #[schemars(range(min = 0.01, max = 0.5))]
    pub lowest_m: f64,
    /// What was seen last so long ago is forgotten, seconds. Default 1, range 0.2 to 10.
    #[schemars(range(min = 0.2, max = 10.0))]
    pub memory_s: f64,
}

impl Default for DepthSettings {
    fn default() -> Self {
        Self { braking_share: 0.9, margin_m: 0.005, creep_m_per_s: 0.1, lowest_m: 0.06, memory_s: 1.0 }
    }
}

/// `[safety.people]`: speed and separation as ISO/TS 15066 has them. With the distance S, the person's speed v_h, the
/// reaction time T, braking a and the distance C that is kept, the base's speed v fulfils
///
/// ```text
/// S >= v_h (T + v / a) + v T + v^2 / (2 a) + C
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PeopleSettings {
    /// Speed at which people come near (v_h), metres per second. Default 1.6 (ISO 13855), range 0 to 3.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub walking_m_per_s: f64,
    /// Time from a person's step to the first braking (T), seconds. Default 0.25, range 0 to 2.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub reaction_s: f64,
    /// Distance between footprint and person that is kept (C), metres. Default 0.2, range 0 to 2.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub kept_m: f64,
    /// Half the width of a person, metres. Default 0.25, range 0 to 0.6.
    #[schemars(range(min = 0.0, max = 0.6))]
    pub person_radius_m: f64,
    /// Speed that is left however near somebody stands, so that the robot can get out of the way, metres per second.
    /// Default 0.05, range 0 to 0.25 (ISO 10218-1).
    #[schemars(range(min = 0.0, max = 0.25))]
    pub slowest_m_per_s: f64,
    /// Somebody who was seen last so long ago is forgotten, seconds. Default 3, range 0.5 to 60.
    #[schemars(range(min = 0.5, max = 60.0))]
    pub memory_s: f64,
}

impl Default for PeopleSettings {
    fn default() -> Self {
        Self {
            walking_m_per_s: 1.6,
            reaction_s: 0.25,
            kept_m: 0.2,
            person_radius_m: 0.25,
            slowest_m_per_s: 0.05,
            memory_s: 3.0,
        }
    }
}
