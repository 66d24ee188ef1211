//! The gripper as boxes, and its distance to points.

use super::config::GraspConfig;
use dsm::Pose;
use nalgebra::{Point3, Vector3};

/// A box in the tool frame.
struct ToolBox {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl ToolBox {
    /// Distance from a point outside; negative depth inside.
    fn distance_m(&self, p: &Point3<f64>) -> f64 {
        let beyond = (self.low - p.coords).sup(&(p.coords - self.high));
        let outside = beyond.sup(&Vector3::zeros()).norm();
        if outside > 0.0 { outside } else { beyond.max() }
    }
}

/// The space that fingers, palm, wrist and camera sweep from the pregrasp to the grasp.
pub(crate) struct SweptHand {
    fingers: [ToolBox; 2],
    palm: [ToolBox; 2],
}

impl SweptHand {
    /// The hand opened to `opening_m` between the pads.
    pub(crate) fn new(opening_m: f64, config: &GraspConfig) -> Self {
        let hand = &config.hand;
        let half_width = 0.5 * hand.finger_width_m;
        let palm_z = -hand.palm_behind_tool_m;
        let back = palm_z - hand.wrist_length_m - config.pregrasp_m;
        let finger = |low_y: f64, high_y: f64| ToolBox {
            low: Vector3::new(-half_width, low_y, back),
            high: Vector3::new(half_width, high_y, hand.tip_beyond_tool_m),
        };
        let inner = 0.5 * opening_m;
        let outer = inner + hand.finger_thickness_m;
        let palm = |low_x: f64, high_x: f64, half_y: f64| ToolBox {
            low: Vector3::new(low_x, -half_y, back),
            high: Vector3::new(high_x, half_y, palm_z),
        };
        let half_palm = 0.5 * hand.palm_thickness_m;
        Self {
            fingers: [finger(-outer, -inner), finger(inner, outer)],
            palm: [
                palm(-half_palm, half_palm, 0.5 * hand.palm_width_m),
                palm(-half_palm.max(hand.camera_offset_m), half_palm, 0.04),
            ],
        }
    }

    /// Distance from the fingers to a point in the tool frame; negative inside.
    pub(crate) fn finger_distance_m(&self, point_in_tool: &Point3<f64>) -> f64 {
        self.fingers.iter().map(|b| b.distance_m(point_in_tool)).fold(f64::INFINITY, f64::min)
    }

    /// Distance from palm, wrist and camera to a point in the tool frame; negative inside.
    pub(crate) fn palm_distance_m(&self, point_in_tool: &Point3<f64>) -> f64 {
        self.palm.iter().map(|b| b.distance_m(point_in_tool)).fold(f64::INFINITY, f64::min)
    }

    /// Lowest point of the fingers at the grasp itself, world frame, metres.
    pub(crate) fn lowest_finger_z_m(&self, world_from_tool: &Pose, config: &GraspConfig) -> f64 {
        let mut lowest = f64::INFINITY;
        for finger in &self.fingers {
            for corner in 0..8 {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { finger.low[axis] } else { finger.high[axis] };
                let z = pick(2).max(-config.hand.palm_behind_tool_m);
                lowest = lowest.min((world_from_tool * Point3::new(pick(0), pick(1), z)).z);
            }
        }
        lowest
    }
}

#[cfg(test)]
mod tests {
    //! Contract: points between the pads are free, points in the fingers, the palm, the camera and the way in are not.
    use super::*;

    #[test]
    fn boxes_are_where_the_hand_is() {
        let config = GraspConfig::default();
        let hand = SweptHand::new(0.1, &config);
        assert!((hand.finger_distance_m(&Point3::origin()) - 0.05).abs() < 1e-9);
        assert!(hand.finger_distance_m(&Point3::new(0.0, 0.055, 0.0)) < 0.0);
        assert!(hand.finger_distance_m(&Point3::new(0.0, 0.055, -0.2)) < 0.0, "on the way in");
        assert!((hand.finger_distance_m(&Point3::new(0.0, 0.055, 0.025)) - 0.01).abs() < 1e-9);
        assert!(hand.palm_distance_m(&Point3::new(0.0, 0.0, -0.12)) < 0.0);
        assert!(hand.palm_distance_m(&Point3::new(-0.06, 0.0, -0.12)) < 0.0, "the camera");
        assert!(hand.palm_distance_m(&Point3::new(0.06, 0.0, -0.12)) > 0.02);
        let down = Pose::new(Vector3::new(0.0, 0.0, 0.5), Vector3::x() * std::f64::consts::PI);
        assert!((hand.lowest_finger_z_m(&down, &config) - 0.485).abs() < 1e-9);
    }
}
