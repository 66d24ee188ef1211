//! The layout of `robot.toml`: what a URDF cannot say. SI units, radians; joints and frames by their URDF names.

use super::ros2::Ros2Settings;
use crate::control::ControllerConfig;
use crate::safety::settings::SafetySettings;
use dsm::Pose;
use nalgebra::{UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Postures that the skills ask for, and what for.
pub(super) const POSTURES: [(&str, &str); 3] = [
    ("carry", "the arm folded for driving"),
    ("ready_down", "the arm unfolded, the tool pointing down"),
    ("ready_front", "the arm unfolded, the tool pointing forward"),
];
/// The path that unfolds the arm.
pub(super) const UNFOLDING: (&str, &str) = ("carry_to_ready_down", "from the fold to the unfolded arm");
/// Cameras that the skills look through.
pub(super) const CAMERAS: [(&str, &str); 2] =
    [("head", "maps and grasps come from it"), ("wrist", "it centres the hand over what it grasps")];

/// One robot, `robot.toml`. Values without a stated default are required.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotSettings {
    /// Version of this layout; 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Name of the robot.
    #[schemars(length(min = 1))]
    pub name: String,
    /// The URDF file, relative to this file.
    #[schemars(length(min = 1))]
    pub urdf: String,
    /// Further URDF files, relative to this file, whose joints may hang on links of the first: a gripper or a camera that
    /// it lacks. Default none.
    #[serde(default)]
    pub attachments: Vec<String>,
    /// Joints that are held at 0 as if they were fixed: wheels, whose motion `[base]` stands for. Default none.
    #[serde(default)]
    pub locked_joints: Vec<String>,
    /// The mobile base.
    pub base: BaseSettings,
    /// Groups of joints that are commanded as one: `arm` (the lift first), `head` (pan, then tilt) and `gripper` must
    /// exist.
    pub group: Vec<GroupSettings>,
    /// The frame that grasps.
    pub tool: ToolSettings,
    /// The gripper.
    pub gripper: GripperSettings,
    /// The cameras: `head` and `wrist` must exist.
    #[serde(default)]
    pub camera: Vec<CameraSettings>,
    /// How late measurements are heard of; default: not at all.
    #[serde(default)]
    pub latency: LatencySettings,
    /// Named joint values; joints left out stay where they are. `carry` (folded for driving), `ready_down` and
    /// `ready_front` (unfolded, the tool pointing down and forward) must exist.
    #[serde(default)]
    pub postures: BTreeMap<String, BTreeMap<String, f64>>,
    /// Named sequences of postures that are free of self-collision when interpolated linearly. `carry_to_ready_down` must
    /// exist, of two postures or more.
    #[serde(default)]
    pub paths: BTreeMap<String, Vec<String>>,
    /// Self-collision.
    #[serde(default)]
    pub collision: CollisionSettings,
    /// The arm controller; default: see each of its values.
    #[serde(default)]
    pub control: ControllerConfig,
    /// The safety envelope; default: see each of its values.
    #[serde(default)]
    pub safety: SafetySettings,
    /// How the robot is reached over ROS 2; default: see each of its values.
    #[serde(default)]
    pub ros2: Ros2Settings,
}

/// How the base moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BaseKind {
    /// Two driven wheels: forward speed and turning rate.
    DiffDrive,
}

/// `[base]`: the mobile base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaseSettings {
    /// How it moves.
    pub kind: BaseKind,
    /// The base frame; must be the URDF's root link, on the floor, x forward, z up.
    pub link: String,
    /// Radius of the round footprint about the base frame in metres; (0, 1].
    #[schemars(range(min = 0.01, max = 1.0))]
    pub footprint_radius_m: f64,
    /// Height of the whole robot in its driving posture in metres; (0, 3].
    #[schemars(range(min = 0.01, max = 3.0))]
    pub height_m: f64,
    /// Greatest forward or backward speed in m/s; (0, 3].
    #[schemars(range(min = 0.01, max = 3.0))]
    pub max_speed_m_per_s: f64,
    /// Greatest turning rate in rad/s; (0, 10].
    #[schemars(range(min = 0.01, max = 10.0))]
    pub max_turn_rate_rad_per_s: f64,
    /// Greatest change of speed in m/s^2; (0, 20].
    #[schemars(range(min = 0.01, max = 20.0))]
    pub max_acceleration_m_per_s2: f64,
    /// Greatest change of turning rate in rad/s^2; (0, 50].
    #[schemars(range(min = 0.01, max = 50.0))]
    pub max_turn_acceleration_rad_per_s2: f64,
    /// What the wheels can push along any direction in the floor plane in newtons; (0, 5000].
    #[schemars(range(min = 1.0, max = 5000.0))]
    pub max_drive_force_n: f64,
    /// What the wheels can turn about z in newton metres; (0, 5000].
    #[schemars(range(min = 0.1, max = 5000.0))]
    pub max_turn_torque_nm: f64,
}

/// `[[group]]`: joints commanded as one. Position, velocity and effort limits stand in the URDF.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroupSettings {
    /// Name of the group.
    pub name: String,
    /// Its joints, in the order of commands.
    #[schemars(length(min = 1))]
    pub joints: Vec<String>,
    /// Greatest acceleration of each joint in m/s^2 or rad/s^2; (0, 100].
    #[schemars(length(min = 1), inner(range(min = 0.01, max = 100.0)))]
    pub max_accelerations: Vec<f64>,
}

/// `[tool]`: the frame that grasps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolSettings {
    /// A URDF link midway between the finger tips; +z along the approach, +y along the closing direction.
    pub frame: String,
}

/// `[gripper]`: a parallel gripper.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GripperSettings {
    /// Finger joints; each value is the distance of that finger's inner face from the middle, in metres.
    #[schemars(length(min = 1))]
    pub joints: Vec<String>,
    /// Links of the fingers.
    #[schemars(length(min = 1))]
    pub finger_links: Vec<String>,
    /// Greatest free distance between the pads in metres; (0, 0.5].
    #[schemars(range(min = 0.01, max = 0.5))]
    pub max_aperture_m: f64,
    /// Greatest grip force in newtons; (0, 200].
    #[schemars(range(min = 0.1, max = 200.0))]
    pub max_force_n: f64,
    /// Friction coefficient of the pads; (0, 1].
    #[schemars(range(min = 0.01, max = 1.0))]
    pub finger_friction: f64,
    /// How far the pads reach beyond the tool frame in metres; [0, 0.2].
    #[schemars(range(min = 0.0, max = 0.2))]
    pub tip_beyond_tool_m: f64,
    /// How far behind the tool frame the palm begins in metres; [0, 0.5].
    #[schemars(range(min = 0.0, max = 0.5))]
    pub palm_behind_tool_m: f64,
    /// Width of a finger across the closing direction in metres; (0, 0.2].
    #[schemars(range(min = 0.001, max = 0.2))]
    pub finger_width_m: f64,
    /// Thickness of a finger along the closing direction in metres; (0, 0.2].
    #[schemars(range(min = 0.001, max = 0.2))]
    pub finger_thickness_m: f64,
    /// Width of the palm along the closing direction in metres; (0, 0.5].
    #[schemars(range(min = 0.001, max = 0.5))]
    pub palm_width_m: f64,
    /// Thickness of the palm in metres; (0, 0.5].
    #[schemars(range(min = 0.001, max = 0.5))]
    pub palm_thickness_m: f64,
    /// Length of palm and wrist behind the palm's beginning in metres; [0.02, 0.5], default 0.15.
    #[serde(default = "default_wrist_length_m")]
    #[schemars(range(min = 0.02, max = 0.5))]
    pub wrist_length_m: f64,
    /// How far a camera stands out of the palm along the tool's -x, from the tool's axis, in metres; [0, 0.2], default
    /// 0.07; 0 without one.
    #[serde(default = "default_camera_offset_m")]
    #[schemars(range(min = 0.0, max = 0.2))]
    pub camera_offset_m: f64,
}

/// `[[camera]]`: a colour and depth camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraSettings {
    /// Name of the camera.
    pub name: String,
    /// A URDF link: +z forward, x right, y down.
    pub frame: String,
    /// Width of the image in pixels; 16 to 4096.
    #[schemars(range(min = 16, max = 4096))]
    pub width: u32,
    /// Height of the image in pixels; 16 to 4096.
    #[schemars(range(min = 16, max = 4096))]
    pub height: u32,
    /// Opening angle from the top to the bottom edge in radians; [0.1, 2.5].
    #[schemars(range(min = 0.1, max = 2.5))]
    pub vertical_fov_rad: f64,
    /// Frames per second; [0.1, 120].
    #[schemars(range(min = 0.1, max = 120.0))]
    pub rate_hz: f64,
    /// Nearest depth that the camera measures in metres; [0, 2], default 0.2.
    #[serde(default = "default_nearest_m")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub nearest_m: f64,
    /// How long after its exposure a frame is handed out, in seconds; [0, 0.4], default 0. Its stamp is the exposure.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.4))]
    pub latency_s: f64,
    /// Where the camera really is, seen from `frame`, in metres along the frame's x, y and z; [-0.5, 0.5] each, default 0.
    /// `dsm calibrate` estimates it.
    #[serde(default)]
    #[schemars(inner(range(min = -0.5, max = 0.5)))]
    pub offset_xyz_m: [f64; 3],
    /// How the camera is turned, seen from `frame`, as roll, pitch and yaw about the frame's x, y and z (applied in this
    /// order, as in a URDF) in radians; [-0.5, 0.5] each, default 0.
    #[serde(default)]
    #[schemars(inner(range(min = -0.5, max = 0.5)))]
    pub offset_rpy_rad: [f64; 3],
}

impl CameraSettings {
    /// `frame_from_camera`: identity unless the camera was calibrated.
    pub fn frame_from_camera(&self) -> Pose {
        let [roll, pitch, yaw] = self.offset_rpy_rad;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Pose::from_parts(Vector3::from(self.offset_xyz_m).into(), rotation)
    }
}

/// `[latency]`: how late measurements are heard of. Their stamps say when they were true.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatencySettings {
    /// Joint states, in seconds; [0, 0.4], default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.4))]
    pub joints_s: f64,
    /// Poses of localisation and odometry, in seconds; [0, 0.4], default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.4))]
    pub localisation_s: f64,
}

impl RobotSettings {
    /// Whether anything is heard of late, so that frames need the pose of their own moment.
    pub fn has_latency(&self) -> bool {
        self.latency != LatencySettings::default() || self.camera.iter().any(|camera| camera.latency_s > 0.0)
    }
}

fn default_wrist_length_m() -> f64 {
    0.15
}

fn default_camera_offset_m() -> f64 {
    0.07
}

fn default_nearest_m() -> f64 {
    0.2
}

/// `[collision]`: self-collision.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CollisionSettings {
    /// Pairs of links that are never checked against each other, besides links joined by one joint. Default none.
    #[serde(default)]
    pub ignored_pairs: Vec<[String; 2]>,
    /// Links whose collision shapes do not count at all: wheels and castors, which touch the floor. Default none.
    #[serde(default)]
    pub ignored_links: Vec<String>,
}
