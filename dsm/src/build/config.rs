//! Parameters of map construction.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A parameter outside its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("map construction: `{key}` is {value}, allowed is {low} to {high}")]
pub struct BuildConfigError {
    /// Name of the parameter.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// Lowest allowed value.
    pub low: f64,
    /// Highest allowed value.
    pub high: f64,
}

macro_rules! parameters {
    ($($(#[doc = $doc:literal])* $name:ident: $kind:ty = $default:literal in [$low:literal, $high:literal];)*) => {
        /// Parameters of map construction; every one with its unit, default and range.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct BuildConfig {
            $(
                $(#[doc = $doc])*
                #[doc = concat!(" Default ", stringify!($default), ", range ", stringify!($low), " to ", stringify!($high), ".")]
                pub $name: $kind,
            )*
            /// Whether the pose error of each frame is taken out by laying its observations onto the known objects.
            /// Default true.
            pub align: bool,
            /// Whether shapes are voted on by the views of the sliding window; else all points that were ever fused stay.
            /// Default true.
            pub window: bool,
        }

        impl Default for BuildConfig {
            fn default() -> Self {
                Self { $($name: $default,)* align: true, window: true }
            }
        }

        impl BuildConfig {
            /// Checks every range.
            ///
            /// # Errors
            /// The first parameter outside its range.
            pub fn validate(&self) -> Result<(), BuildConfigError> {
                $(
                    let value = self.$name as f64;
                    if !($low as f64..=$high as f64).contains(&value) {
                        return Err(BuildConfigError { key: stringify!($name), value, low: $low as f64, high: $high as f64 });
                    }
                )*
                Ok(())
            }
        }
    };
}

parameters! {
    /// Detections with a lower score are ignored.
    min_score: f32 = 0.25 in [0.0, 1.0];
    /// Masks with fewer pixels are ignored.
    min_mask_pixels: usize = 80 in [16, 100_000];
    /// Detections with fewer clean points are ignored.
    min_points: usize = 16 in [4, 10_000];
    /// Points sampled from one mask at most.
    samples_per_mask: usize = 1000 in [100, 20_000];
    /// Depth beyond which objects are not measured, metres. The error of structured-light depth grows with its square.
    max_object_depth_m: f64 = 5.0 in [0.5, 20.0];
    /// Visual threshold t_v of the paper: a lower cosine adds nothing to the score.
    visual_threshold: f32 = 0.4 in [0.0, 1.0];
    /// Text threshold t_x of the paper.
    text_threshold: f32 = 0.8 in [0.0, 1.0];
    /// Geometric threshold t_g of the paper.
    geometric_threshold: f64 = 0.3 in [0.0, 1.0];
    /// Geometric score s_g0 when one box lies inside the other. Low enough that s_v + s_g0 alone stays below the total
    /// threshold: a thing does not become part of its container because their colours agree.
    containment_score: f64 = 0.49 in [0.0, 1.0];
    /// Total threshold T of the paper on S = s_v + s_g + s_c.
    total_threshold: f64 = 1.5 in [0.0, 3.0];
    /// How far the pose may be off, metres: boxes are grown by it before they are compared.
    pose_tolerance_m: f64 = 0.03 in [0.0, 0.3];
    /// Things whose largest side is below this are compared by the distance of their centres as well, metres.
    small_object_m: f64 = 0.35 in [0.0, 1.0];
    /// Views kept per object in the geometry window.
    window_views: usize = 16 in [3, 64];
    /// Share of the views that could see a voxel and must agree with it.
    vote_share: f64 = 0.4 in [0.0, 1.0];
    /// Points kept per object at most.
    max_points: usize = 2000 in [100, 20_000];
    /// Observations after which an object is stable.
    stable_observations: u32 = 3 in [1, 50];
    /// Time without an observation after which a provisional object dies, seconds.
    provisional_life_s: f64 = 15.0 in [0.5, 600.0];
    /// Frames in a row whose rays pass through an object before it is absent.
    absent_frames: u32 = 3 in [1, 50];
    /// Depth behind a large object's surface from which a ray has passed through it, metres; half the largest side for
    /// smaller ones, since behind a mug stands the table at a hand's breadth.
    absent_depth_m: f64 = 0.3 in [0.05, 1.0];
    /// Height up to which a point belongs to the floor, metres.
    floor_height_m: f64 = 0.05 in [0.0, 0.2];
    /// Height from which a point is an obstacle, metres.
    obstacle_height_m: f64 = 0.06 in [0.01, 0.5];
    /// Height above which nothing hinders, metres.
    headroom_m: f64 = 1.6 in [0.2, 3.0];
    /// Range of depth used for the free space, metres.
    max_floor_depth_m: f64 = 4.5 in [0.5, 20.0];
    /// Time between two segmentations into rooms, seconds.
    room_interval_s: f64 = 2.0 in [0.1, 600.0];
    /// Widest opening that divides two rooms, metres.
    doorway_m: f64 = 1.0 in [0.5, 3.0];
    /// Smallest room, square metres.
    min_room_m2: f64 = 2.5 in [0.1, 100.0];
    /// Distance between boxes up to which objects are near each other, metres.
    near_m: f64 = 1.0 in [0.1, 5.0];
}

#[cfg(test)]
mod tests {
    //! Contract: defaults are valid, a value out of range names its key.
    use super::*;

    #[test]
    fn ranges_are_checked() {
        assert_eq!(BuildConfig::default().validate(), Ok(()));
        let wrong = BuildConfig { vote_share: 1.5, ..BuildConfig::default() };
        assert_eq!(wrong.validate().unwrap_err().key, "vote_share");
        assert!(BuildConfig { near_m: f64::NAN, ..BuildConfig::default() }.validate().is_err());
    }
}
