//! Names and ways under which a robot speaks ROS 2.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
}

/// `ros2.toml`. Every value has a default; topics are absolute names.
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
    /// Pictures of the camera NAME come from here, NAME taken from `robot.toml`; default `/camera/NAME/color`.
    pub color: String,
    /// Depth aligned with the colour; 16UC1 in millimetres or 32FC1 in metres; default `/camera/NAME/depth`.
    pub depth: String,
    /// `geometry_msgs/PoseStamped` of the camera in the map at each picture's stamp; empty (the default) when it follows
    /// from localisation and joints.
    pub camera_pose: String,
    /// `dsm_msgs/MaskedDetections`; empty (the default) when the detector runs here.
    pub detections: String,
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
            color: "/camera/NAME/color".into(),
            depth: "/camera/NAME/depth".into(),
            camera_pose: String::new(),
            detections: String::new(),
            sync_tolerance_s: 0.01,
            reliable_pictures: false,
            emergency_stop: "/emergency_stop".into(),
        }
    }
}

impl Ros2Settings {
    /// The topic of a camera: `NAME` stands for its name.
    pub fn of_camera(pattern: &str, camera: &str) -> String {
        pattern.replace("NAME", camera)
    }
}
