//! Parameters of grasp planning.

use crate::model::settings::GripperSettings;
use crate::nav::RangeError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Shape of a parallel gripper, seen from the tool frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HandConfig {
    /// Largest free distance between the pads, metres. Default 0.13, range 0.02 to 0.5.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub max_aperture_m: f64,
    /// How far the pads reach beyond the tool frame, metres. Default 0.015, range 0 to 0.1.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub tip_beyond_tool_m: f64,
    /// How far behind the tool frame the palm begins, metres. Default 0.10, range 0.02 to 0.3.
    #[schemars(range(min = 0.02, max = 0.3))]
    pub palm_behind_tool_m: f64,
    /// Width of a finger along the tool's x, metres. Default 0.028, range 0.005 to 0.1.
    #[schemars(range(min = 0.005, max = 0.1))]
    pub finger_width_m: f64,
    /// Thickness of a finger along the closing direction, metres. Default 0.014, range 0.003 to 0.1.
    #[schemars(range(min = 0.003, max = 0.1))]
    pub finger_thickness_m: f64,
    /// Width of the palm along the closing direction, metres. Default 0.17, range 0.02 to 0.4.
    #[schemars(range(min = 0.02, max = 0.4))]
    pub palm_width_m: f64,
    /// Thickness of the palm along the tool's x, metres. Default 0.06, range 0.01 to 0.3.
    #[schemars(range(min = 0.01, max = 0.3))]
    pub palm_thickness_m: f64,
    /// Length of palm and wrist behind the palm's beginning, metres. Default 0.15, range 0.02 to 0.5.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub wrist_length_m: f64,
    /// How far the wrist camera stands out of the palm along the tool's -x, metres from the tool's axis. Default 0.07,
    /// range 0 to 0.2; 0 without a camera.
    #[schemars(range(min = 0.0, max = 0.2))]
    pub camera_offset_m: f64,
}

impl Default for HandConfig {
    fn default() -> Self {
        Self {
            max_aperture_m: 0.13,
            tip_beyond_tool_m: 0.015,
            palm_behind_tool_m: 0.10,
            finger_width_m: 0.028,
            finger_thickness_m: 0.014,
            palm_width_m: 0.17,
            palm_thickness_m: 0.06,
            wrist_length_m: 0.15,
            camera_offset_m: 0.07,
        }
    }
}

impl HandConfig {
    /// The hand that `robot.toml` describes.
    pub fn from_settings(gripper: &GripperSettings) -> Self {
        Self {
            max_aperture_m: gripper.max_aperture_m,
            tip_beyond_tool_m: gripper.tip_beyond_tool_m,
            palm_behind_tool_m: gripper.palm_behind_tool_m,
            finger_width_m: gripper.finger_width_m,
            finger_thickness_m: gripper.finger_thickness_m,
            palm_width_m: gripper.palm_width_m,
            palm_thickness_m: gripper.palm_thickness_m,
            wrist_length_m: gripper.wrist_length_m,
            camera_offset_m: gripper.camera_offset_m,
        }
    }
}

/// Parameters of [`super::plan_grasps`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GraspConfig {
    /// The gripper.
    pub hand: HandConfig,
    /// The aperture must exceed the object's width as the map has it by this, metres: the wrist looks again. Default 0.01,
    /// range 0 to 0.1.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub aperture_margin_m: f64,
    /// How much wider than the object the hand opens for its approach, metres. Default 0.045, range 0.005 to 0.1.
    #[schemars(range(min = 0.005, max = 0.1))]
    pub opening_margin_m: f64,
    /// Distance that fingers and palm keep from known points, metres. Default 0.004, range 0 to 0.05.
    #[schemars(range(min = 0.0, max = 0.05))]
    pub clearance_m: f64,
    /// Height of the finger tips above the support, metres. Default 0.008, range 0 to 0.05.
    #[schemars(range(min = 0.0, max = 0.05))]
    pub support_clearance_m: f64,
    /// How far above the object's middle the pads may hold it, as a share of half its height. Default 0.45, range 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_raise_share: f64,
    /// Half angle of the friction cone for pairs of points, radians. Default 0.35, range 0.05 to 0.8.
    #[schemars(range(min = 0.05, max = 0.8))]
    pub friction_cone_rad: f64,
    /// Pitch angles of approaches from the side, radians below the horizontal. Default 0, 0.35, 0.7, 1.05.
    pub frontal_pitches_rad: Vec<f64>,
    /// Retreat of the pregrasp along the approach, metres. Default 0.11, range 0.02 to 0.3.
    #[schemars(range(min = 0.02, max = 0.3))]
    pub pregrasp_m: f64,
    /// Height of the lift, metres. Default 0.14, range 0.02 to 0.5.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub lift_m: f64,
    /// Largest number of candidates returned. Default 24, range 1 to 500.
    #[schemars(range(min = 1, max = 500))]
    pub max_candidates: usize,
    /// Largest number of reachability tests. Default 80, range 1 to 2000.
    #[schemars(range(min = 1, max = 2000))]
    pub max_reach_tests: usize,
}

impl Default for GraspConfig {
    fn default() -> Self {
        Self {
            hand: HandConfig::default(),
            aperture_margin_m: 0.01,
            opening_margin_m: 0.045,
            clearance_m: 0.004,
            support_clearance_m: 0.008,
            max_raise_share: 0.45,
            friction_cone_rad: 0.35,
            frontal_pitches_rad: vec![0.0, 0.35, 0.7, 1.05],
            pregrasp_m: 0.11,
            lift_m: 0.14,
            max_candidates: 24,
            max_reach_tests: 80,
        }
    }
}

impl GraspConfig {
    /// Checks the ranges of all parameters.
    ///
    /// # Errors
    /// The first parameter that lies outside its range.
    pub fn validate(&self) -> Result<(), RangeError> {
        let check = crate::nav::check_range;
        let h = &self.hand;
        check("hand.max_aperture_m", h.max_aperture_m, 0.02, 0.5)?;
        check("hand.tip_beyond_tool_m", h.tip_beyond_tool_m, 0.0, 0.1)?;
        check("hand.palm_behind_tool_m", h.palm_behind_tool_m, 0.02, 0.3)?;
        check("hand.finger_width_m", h.finger_width_m, 0.005, 0.1)?;
        check("hand.finger_thickness_m", h.finger_thickness_m, 0.003, 0.1)?;
        check("hand.palm_width_m", h.palm_width_m, 0.02, 0.4)?;
        check("hand.palm_thickness_m", h.palm_thickness_m, 0.01, 0.3)?;
        check("hand.wrist_length_m", h.wrist_length_m, 0.02, 0.5)?;
        check("hand.camera_offset_m", h.camera_offset_m, 0.0, 0.2)?;
        check("aperture_margin_m", self.aperture_margin_m, 0.0, 0.1)?;
        check("opening_margin_m", self.opening_margin_m, 0.005, 0.1)?;
        check("clearance_m", self.clearance_m, 0.0, 0.05)?;
        check("support_clearance_m", self.support_clearance_m, 0.0, 0.05)?;
        check("max_raise_share", self.max_raise_share, 0.0, 1.0)?;
        check("friction_cone_rad", self.friction_cone_rad, 0.05, 0.8)?;
        for &pitch in &self.frontal_pitches_rad {
            check("frontal_pitches_rad", pitch, -0.5, 1.3)?;
        }
        check("pregrasp_m", self.pregrasp_m, 0.02, 0.3)?;
        check("lift_m", self.lift_m, 0.02, 0.5)?;
        check("max_candidates", self.max_candidates as f64, 1.0, 500.0)?;
        check("max_reach_tests", self.max_reach_tests as f64, 1.0, 2000.0)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: defaults are valid; a value outside its range is named.
    use super::*;

    #[test]
    fn ranges_hold() {
        assert_eq!(GraspConfig::default().validate(), Ok(()));
        let mut config = GraspConfig::default();
        config.hand.max_aperture_m = -1.0;
        assert_eq!(config.validate().unwrap_err().key, "hand.max_aperture_m");
    }
}
