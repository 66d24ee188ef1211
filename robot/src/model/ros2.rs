//! `[ros2]` of `robot.toml`: names and ways under which a robot speaks ROS 2. Words alone: what speaks is the package
//! `dsm-ros2`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which clock a robot lives by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ClockSource {
    /// The machine's: hardware.
    #[default]
    Wall,
    /// The topic `/clock`: a simulation that runs by itself.
    Topic,
    /// A simulation that waits for us: time passes as far as it is asked to.
    LockStep,
}

/// What takes velocities for joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum JointInterface {
    /// `std_msgs/Float64MultiArray`, velocities in the group's order: `forward_command_controller`.
    #[default]
    Velocities,
    /// `trajectory_msgs/JointTrajectory` with one point a short way ahead: `joint_trajectory_controller`.
    Trajectory,
    /// The action `control_msgs/FollowJointTrajectory`: goals of one point a short way ahead, one after the other. The topic
    /// is the action's name.
    Action,
}

/// What a gripper is told by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GripperInterface {
    /// The topic of `control_msgs/GripperCommand`.
    #[default]
    Topic,
    /// The action `control_msgs/GripperCommand`: a goal for each new width or force. The topic is the action's name.
    Action,
}

/// `[ros2]`: how a robot is reached over ROS 2. Every value has a default; topics are absolute names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ros2Settings {
    /// DDS domain; 0 to 232, default 0.
    #[schemars(range(max = 232))]
    pub domain: u16,
    /// How long to wait for the other side in seconds; (0, 600], default 10.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub timeout_s: f64,
    /// The clock; default `wall`.
    pub clock: ClockSource,
    /// How often a served robot says how it is, while its clock runs by itself, in hertz; [1, 100], default 100.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub state_rate_hz: f64,
    /// `geometry_msgs/TwistStamped` to the base; default `/cmd_vel`.
    pub base_command: String,
    /// `nav_msgs/Odometry`; default `/odom`.
    pub odometry: String,
    /// `geometry_msgs/PoseWithCovarianceStamped` of the base in the map; default `/amcl_pose`.
    pub localisation: String,
    /// `sensor_msgs/JointState` of all joints, fingers included; default `/joint_states`.
    pub joint_states: String,
    /// Commands to the arm; default `/arm_velocity_controller/commands`.
    pub arm_command: String,
    /// What the arm's topic takes; default `velocities`.
    pub arm_interface: JointInterface,
    /// Commands to the head; default `/head_velocity_controller/commands`.
    pub head_command: String,
    /// What the head's topic takes; default `velocities`.
    pub head_interface: JointInterface,
    /// How far ahead the point of a trajectory lies in seconds; [0.02, 1], default 0.1.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub trajectory_ahead_s: f64,
    /// `control_msgs/GripperCommand` to the gripper, the gap and the force; default `/gripper_controller/command`.
    pub gripper_command: String,
    /// What the gripper is told by; default `topic`.
    pub gripper_interface: GripperInterface,
    /// How many goals of `action` joints get in a second; [2, 100], default 20.
    #[schemars(range(min = 2.0, max = 100.0))]
    pub action_rate_hz: f64,
    /// Pictures of the camera NAME come from here, NAME taken from `robot.toml`; default `/camera/NAME/color`.
    pub color: String,
    /// Depth aligned with the colour; 16UC1 in millimetres or 32FC1 in metres; default `/camera/NAME/depth`.
    pub depth: String,
    /// `sensor_msgs/CameraInfo` of the camera NAME; default `/camera/NAME/color/camera_info`.
    pub camera_info: String,
    /// Topics of single cameras by their name in `robot.toml`, where the patterns above do not fit.
    pub camera: BTreeMap<String, CameraTopics>,
    /// `geometry_msgs/PoseStamped` of the camera in the map at each picture's stamp; empty (the default) when it follows
    /// from localisation and joints.
    pub camera_pose: String,
    /// `dsm_msgs/MaskedDetections`; empty (the default) when the detector runs here.
    pub detections: String,
    /// Who detects at the other end, for what the map says of its sources; default `ros2`.
    pub detector: String,
    /// Greatest difference of the stamps of a picture and its depth in seconds; [0, 0.1], default 0.01.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub sync_tolerance_s: f64,
    /// Whether lost pictures are sent again; default false.
    pub reliable_pictures: bool,
    /// `std_msgs/String`: why the robot is stopped, empty when it is not; default `/emergency_stop`.
    pub emergency_stop: String,
}

impl Default for Ros2Settings {
    fn default() -> Self {
        Self {
            domain: 0,
            timeout_s: 10.0,
            clock: ClockSource::default(),
            state_rate_hz: 100.0,
            base_command: "/cmd_vel".into(),
            odometry: "/odom".into(),
            localisation: "/amcl_pose".into(),
            joint_states: "/joint_states".into(),
            arm_command: "/arm_velocity_controller/commands".into(),
            arm_interface: JointInterface::default(),
            head_command: "/head_velocity_controller/commands".into(),
            head_interface: JointInterface::default(),
            trajectory_ahead_s: 0.1,
            gripper_command: "/gripper_controller/command".into(),
            gripper_interface: GripperInterface::default(),
            action_rate_hz: 20.0,
            color: "/camera/NAME/color".into(),
            depth: "/camera/NAME/depth".into(),
            camera_info: "/camera/NAME/color/camera_info".into(),
            camera: BTreeMap::new(),
            camera_pose: String::new(),
            detections: String::new(),
            detector: "ros2".into(),
            sync_tolerance_s: 0.01,
            reliable_pictures: false,
            emergency_stop: "/emergency_stop".into(),
        }
    }
}

/// `[ros2.camera.NAME]`: topics of one camera.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraTopics {
    /// Colour.
    pub color: String,
    /// Depth aligned with it.
    pub depth: String,
    /// Intrinsics.
    pub info: String,
}

impl Ros2Settings {
    /// The topics of a camera: its own, or the patterns with `NAME` replaced.
    pub fn camera_topics(&self, camera: &str) -> CameraTopics {
        let of = |pattern: &str| pattern.replace("NAME", camera);
        let patterns = || CameraTopics { color: of(&self.color), depth: of(&self.depth), info: of(&self.camera_info) };
        self.camera.get(camera).cloned().unwrap_or_else(patterns)
    }

    /// The topic of a camera's pose; `None` when it is not sent.
    pub fn find_pose_topic(&self, camera: &str) -> Option<String> {
        (!self.camera_pose.is_empty()).then(|| self.camera_pose.replace("NAME", camera))
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a camera's topics are its own, or follow from the patterns.
    use super::*;

    #[test]
    fn cameras_have_their_own_topics_or_those_of_the_patterns() {
        let text = "[camera.wrist]\ncolor = \"/a\"\ndepth = \"/b\"\ninfo = \"/c\"\n";
        let settings: Ros2Settings = toml::from_str(text).unwrap();
        assert_eq!(settings.camera_topics("wrist").color, "/a");
        assert_eq!(settings.camera_topics("head").depth, "/camera/head/depth");
        assert_eq!(settings.find_pose_topic("head"), None);
        let settings = Ros2Settings { camera_pose: "/NAME/pose".into(), ..settings };
        assert_eq!(settings.find_pose_topic("head").as_deref(), Some("/head/pose"));
    }
}
