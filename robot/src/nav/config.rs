//! All parameters of navigation.

use super::{CostmapConfig, CoverageConfig, FollowerConfig, FrontierConfig, GoalConfig, LiveConfig};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Parameters of navigation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NavConfig {
    /// Cost of cells.
    pub costmap: CostmapConfig,
    /// Frontiers of the known floor.
    pub frontier: FrontierConfig,
    /// Looking at furniture from near.
    pub coverage: CoverageConfig,
    /// Following a path.
    pub follower: FollowerConfig,
    /// What the cameras measured a moment ago.
    pub live: LiveConfig,
    /// Standing places.
    pub goal: GoalConfig,
}

/// A parameter outside its range.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("`{key}` is {value}, expected {min} to {max}")]
pub struct RangeError {
    /// Name of the parameter.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// Lowest valid value.
    pub min: f64,
    /// Highest valid value.
    pub max: f64,
}

/// Checks one value; NaN is outside every range.
pub(crate) fn check(key: &'static str, value: f64, min: f64, max: f64) -> Result<(), RangeError> {
    if (min..=max).contains(&value) { Ok(()) } else { Err(RangeError { key, value, min, max }) }
}

impl NavConfig {
    /// Checks the ranges of all parameters.
    ///
    /// # Errors
    /// The first parameter that lies outside its range.
    pub fn validate(&self) -> Result<(), RangeError> {
        let c = &self.costmap;
        check("costmap.footprint_radius_m", c.footprint_radius_m, 0.05, 1.0)?;
        check("costmap.margin_m", c.margin_m, 0.0, 0.5)?;
        check("costmap.inflation_m", c.inflation_m, 0.0, 2.0)?;
        check("costmap.obstacle_weight", c.obstacle_weight, 0.0, 100.0)?;
        check("costmap.escape_radius_m", c.escape_radius_m, 0.0, 3.0)?;
        let f = &self.frontier;
        check("frontier.min_size_m", f.min_size_m, 0.05, 5.0)?;
        check("frontier.max_size_m", f.max_size_m, f.min_size_m, 10.0)?;
        check("frontier.min_gain_m2", f.min_gain_m2, 0.0, 20.0)?;
        check("frontier.max_gain_m2", f.max_gain_m2, f.min_gain_m2, 100.0)?;
        check("frontier.sensor_range_m", f.sensor_range_m, 0.5, 10.0)?;
        check("frontier.stand_min_m", f.stand_min_m, 0.0, 3.0)?;
        check("frontier.stand_max_m", f.stand_max_m, f.stand_min_m, 5.0)?;
        check("frontier.base_cost_m", f.base_cost_m, 0.1, 50.0)?;
        check("frontier.repeat_radius_m", f.repeat_radius_m, 0.05, 5.0)?;
        check("frontier.max_attempts", f64::from(f.max_attempts), 1.0, 20.0)?;
        check("frontier.min_hole_m2", f.min_hole_m2, 0.0, 10.0)?;
        let v = &self.coverage;
        check("coverage.close_m", v.close_m, 0.5, 6.0)?;
        check("coverage.near_m", v.near_m, 0.0, v.close_m)?;
        check("coverage.field_of_view_rad", v.field_of_view_rad, 0.2, 3.0)?;
        check("coverage.min_gain_m", v.min_gain_m, 0.05, 10.0)?;
        check("coverage.spacing_m", v.spacing_m, 0.1, 2.0)?;
        check("coverage.base_cost_m", v.base_cost_m, 0.1, 50.0)?;
        check("coverage.min_footprint_m2", v.min_footprint_m2, 0.0, 4.0)?;
        let w = &self.follower;
        check("follower.max_speed_m_per_s", w.max_speed_m_per_s, 0.05, 3.0)?;
        check("follower.max_turn_rad_per_s", w.max_turn_rad_per_s, 0.1, 6.0)?;
        check("follower.max_acceleration_m_per_s2", w.max_acceleration_m_per_s2, 0.05, 5.0)?;
        check("follower.max_turn_acceleration_rad_per_s2", w.max_turn_acceleration_rad_per_s2, 0.1, 20.0)?;
        check("follower.look_ahead_m", w.look_ahead_m, 0.1, 2.0)?;
        check("follower.turn_in_place_rad", w.turn_in_place_rad, 0.1, 3.0)?;
        check("follower.slow_clearance_m", w.slow_clearance_m, 0.0, 2.0)?;
        check("follower.slowest_share", w.slowest_share, 0.05, 1.0)?;
        check("follower.position_tolerance_m", w.position_tolerance_m, 0.005, 0.5)?;
        check("follower.yaw_tolerance_rad", w.yaw_tolerance_rad, 0.005, 0.5)?;
        check("follower.off_path_m", w.off_path_m, 0.1, 3.0)?;
        check("follower.stall_s", w.stall_s, 0.2, 20.0)?;
        let l = &self.live;
        check("live.range_m", l.range_m, 0.5, 6.0)?;
        check("live.lowest_m", l.lowest_m, 0.01, 0.5)?;
        check("live.highest_m", l.highest_m, 0.1, 3.0)?;
        check("live.min_points", f64::from(l.min_points), 1.0, 50.0)?;
        check("live.memory_s", l.memory_s, 0.2, 30.0)?;
        check("live.braking_m_per_s2", l.braking_m_per_s2, 0.05, 5.0)?;
        check("live.margin_m", l.margin_m, 0.0, 0.3)?;
        let g = &self.goal;
        for (range, min, preferred, max) in [
            (&g.view, "goal.view.min_m", "goal.view.preferred_m", "goal.view.max_m"),
            (&g.reach, "goal.reach.min_m", "goal.reach.preferred_m", "goal.reach.max_m"),
        ] {
            check(max, range.max_m, 0.0, 5.0)?;
            check(min, range.min_m, 0.0, range.max_m)?;
            check(preferred, range.preferred_m, range.min_m, range.max_m)?;
        }
        check("goal.camera_height_m", g.camera_height_m, 0.1, 2.5)?;
        check("goal.distance_weight", g.distance_weight, 0.0, 100.0)?;
        check("goal.hidden_weight_m", g.hidden_weight_m, 0.0, 100.0)?;
        check("goal.spacing_m", g.spacing_m, 0.05, 2.0)?;
        check("goal.max_places", g.max_places as f64, 1.0, 200.0)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: defaults are valid, values outside their range are named, misspelt keys are errors.
    use super::*;

    #[test]
    fn ranges_hold() {
        assert_eq!(NavConfig::default().validate(), Ok(()));
        let mut config = NavConfig::default();
        config.follower.look_ahead_m = f64::NAN;
        assert_eq!(config.validate().unwrap_err().key, "follower.look_ahead_m");
        assert!(toml::from_str::<NavConfig>("[costmap]\nmargin = 0.1").is_err());
        let read: NavConfig = toml::from_str("[costmap]\nmargin_m = 0.1").unwrap();
        assert_eq!(read.costmap.margin_m, 0.1);
    }
}
