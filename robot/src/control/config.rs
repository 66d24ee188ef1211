//! The parameters of the controller.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[control]` of `robot.toml`: how the arm follows a tool pose. Joints count in rad or m alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerConfig {
    /// Share of the pose error that is driven out per second, 1/s; default 3, range [0.1, 20].
    #[schemars(range(min = 0.1, max = 20.0))]
    pub gain_per_s: f64,
    /// Greatest speed of the tool asked for by the pose task in m/s; default 0.4, range [0.01, 2].
    #[schemars(range(min = 0.01, max = 2.0))]
    pub max_tool_speed_m_per_s: f64,
    /// Greatest turning rate of the tool asked for by the pose task in rad/s; default 1.2, range [0.01, 6].
    #[schemars(range(min = 0.01, max = 6.0))]
    pub max_tool_turn_rad_per_s: f64,
    /// Weight of a rad/s of turning error against a m/s of linear error; default 0.3, range [0, 10].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub turn_weight: f64,
    /// Weight of joint speed, NEO's lambda_q; it damps near singular poses; default 0.001, range [0.000001, 1].
    #[schemars(range(min = 0.000001, max = 1.0))]
    pub damping: f64,
    /// Pull along the gradient of the manipulability; default 0.001, range [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub manipulability: f64,
    /// Weight of the pull towards the preferred posture; default 0.002, range [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub posture_weight: f64,
    /// Share of the posture error that is driven out per second, 1/s; default 1, range [0, 10].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub posture_gain_per_s: f64,
    /// Weight of the base's speed against the arm's while the tool is a metre from its goal; it grows as the distance
    /// falls, so that the base brings the arm near and the arm does the rest; default 0.01, range [0.000001, 10].
    #[schemars(range(min = 0.000001, max = 10.0))]
    pub base_damping: f64,
    /// Weight of turning the base towards the goal; default 0.01, range [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub facing_weight: f64,
    /// Share of the base's bearing error that is driven out per second, 1/s; default 1, range [0, 10].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub facing_gain_per_s: f64,
    /// Weight of keeping a watched point in the middle of a camera's picture; default 0.01, range [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub camera_weight: f64,
    /// Share of the watched point's angle off the picture's middle that is driven out per second, 1/s; default 2, range
    /// [0, 10].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub camera_gain_per_s: f64,
    /// Whether an arm that comes no nearer to a standing goal, held by its own joint limits and not by obstacles, moves
    /// to another posture for the same goal; default true.
    pub recovery: bool,
    /// Distance to obstacles at which approach ends in m; default 0.015, range [0, 0.2].
    #[schemars(range(min = 0.0, max = 0.2))]
    pub obstacle_stop_m: f64,
    /// Distance between own links at which approach ends in m; default 0.01, range [0, 0.2].
    #[schemars(range(min = 0.0, max = 0.2))]
    pub self_stop_m: f64,
    /// Approach speed allowed per metre beyond the stop distance, NEO's xi / (d_i - d_s), 1/s; default 4, range [0.1, 20].
    #[schemars(range(min = 0.1, max = 20.0))]
    pub damper_per_s: f64,
    /// Deceleration that every approach can count on in m/s^2; default 1.5, range [0.05, 20].
    #[schemars(range(min = 0.05, max = 20.0))]
    pub braking_m_per_s2: f64,
    /// Greatest speed at which a link closer than the stop distance is driven away in m/s; default 0.05, range [0, 1].
    #[schemars(range(min = 0.0, max = 1.0))]
    pub retreat_m_per_s: f64,
    /// Distance kept from joint position limits in rad or m; default 0.005, range [0, 0.2].
    #[schemars(range(min = 0.0, max = 0.2))]
    pub limit_margin: f64,
    /// Share of the velocity limits that is used; default 0.9, range [0.05, 1].
    #[schemars(range(min = 0.05, max = 1.0))]
    pub velocity_share: f64,
    /// Position error below which a goal counts as reached, in m; default 0.004, range [0.0001, 0.1].
    #[schemars(range(min = 0.0001, max = 0.1))]
    pub reached_m: f64,
    /// Angle error below which a goal counts as reached, in rad; default 0.02, range [0.0001, 1].
    #[schemars(range(min = 0.0001, max = 1.0))]
    pub reached_rad: f64,
}

impl Default for ControllerConfig {
    fn default() -> Self {
        Self {
            gain_per_s: 3.0,
            max_tool_speed_m_per_s: 0.4,
            max_tool_turn_rad_per_s: 1.2,
            turn_weight: 0.3,
            damping: 0.001,
            manipulability: 0.001,
            posture_weight: 0.002,
            posture_gain_per_s: 1.0,
            base_damping: 0.01,
            facing_weight: 0.01,
            facing_gain_per_s: 1.0,
            camera_weight: 0.01,
            camera_gain_per_s: 2.0,
            recovery: true,
            obstacle_stop_m: 0.015,
            self_stop_m: 0.01,
            damper_per_s: 4.0,
            braking_m_per_s2: 1.5,
            retreat_m_per_s: 0.05,
            limit_margin: 0.005,
            velocity_share: 0.9,
            reached_m: 0.004,
            reached_rad: 0.02,
        }
    }
}
