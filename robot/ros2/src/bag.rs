//! What a recorded run holds, as messages of a ROS 2 bag.

use crate::account::{LOG_TOPIC, OWN_NAME};
use crate::messages::{
    CompressedImage, Header, JointState, Log, Odometry, PoseWithCovariance, PoseWithCovarianceStamped, RosMessage,
    TFMessage, TransformStamped, Twist as RosTwist, TwistStamped, TwistWithCovariance, Vector3, find_definition,
};
use byteorder::LittleEndian;
use dsm::Pose;
use dsm::time::Stamp;
use dsm_robot::drivers::{JointState as Joints, StampedPose, Twist};

/// Stands before a message's fields: little-endian CDR.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// One message of a bag.
pub struct BagMessage {
    /// The topic.
    pub topic: String,
    /// `sensor_msgs/msg/JointState`.
    pub kind: String,
    /// Its definition, `ros2msg`.
    pub definition: String,
    /// CDR with its encapsulation.
    pub bytes: Vec<u8>,
}

fn packed<M: RosMessage>(topic: &str, message: &M) -> Result<BagMessage, String> {
    let name = format!("{}/{}", M::PACKAGE, M::NAME);
    let fields = cdr_encoding::to_vec::<M, LittleEndian>(message).map_err(|error| format!("{topic}: {error}"))?;
    Ok(BagMessage {
        topic: topic.to_owned(),
        kind: format!("{}/msg/{}", M::PACKAGE, M::NAME),
        definition: find_definition(&name).ok_or_else(|| format!("{topic}: {name} has no definition"))?,
        bytes: [&ENCAPSULATION[..], &fields].concat(),
    })
}

fn ros_twist(twist: Twist) -> RosTwist {
    RosTwist {
        linear: Vector3 { x: twist.forward_m_per_s, ..Vector3::default() },
        angular: Vector3 { z: twist.turn_rad_per_s, ..Vector3::default() },
    }
}

/// `/joint_states`.
///
/// # Errors
/// A message that cannot be packed, in words; so for all of these.
pub fn joint_states(state: &Joints) -> Result<BagMessage, String> {
    let message = JointState {
        header: Header::new(state.stamp, ""),
        name: state.positions.names().iter().map(|name| name.to_string()).collect(),
        position: state.positions.values().to_vec(),
        velocity: state.velocities.values().to_vec(),
        effort: Vec::new(),
    };
    packed("/joint_states", &message)
}

/// `/odom`.
///
/// # Errors
/// As [`joint_states`].
pub fn odometry(odom_from_base: &StampedPose, twist: Twist, base_frame: &str) -> Result<BagMessage, String> {
    let message = Odometry {
        header: Header::new(odom_from_base.stamp, "odom"),
        child_frame_id: base_frame.to_owned(),
        pose: PoseWithCovariance { pose: (&odom_from_base.pose).into(), ..PoseWithCovariance::default() },
        twist: TwistWithCovariance { twist: ros_twist(twist), ..TwistWithCovariance::default() },
    };
    packed("/odom", &message)
}

/// `/amcl_pose`.
///
/// # Errors
/// As [`joint_states`].
pub fn localisation(world_from_base: &StampedPose) -> Result<BagMessage, String> {
    let pose = PoseWithCovariance { pose: (&world_from_base.pose).into(), ..PoseWithCovariance::default() };
    packed("/amcl_pose", &PoseWithCovarianceStamped { header: Header::new(world_from_base.stamp, "map"), pose })
}

/// `/tf` of one frame in another.
///
/// # Errors
/// As [`joint_states`].
pub fn transform(stamp: Stamp, parent: &str, child: &str, parent_from_child: &Pose) -> Result<BagMessage, String> {
    let header = Header::new(stamp, parent);
    let transform = TransformStamped { header, child_frame_id: child.to_owned(), transform: parent_from_child.into() };
    packed("/tf", &TFMessage { transforms: vec![transform] })
}

/// `/cmd_vel`.
///
/// # Errors
/// As [`joint_states`].
pub fn base_command(stamp: Stamp, twist: Twist, base_frame: &str) -> Result<BagMessage, String> {
    packed("/cmd_vel", &TwistStamped { header: Header::new(stamp, base_frame), twist: ros_twist(twist) })
}

/// `/rosout`.
///
/// # Errors
/// As [`joint_states`].
pub fn log(stamp: Stamp, line: &str) -> Result<BagMessage, String> {
    let stamp = stamp.into();
    packed(LOG_TOPIC, &Log { stamp, level: 20, name: OWN_NAME.into(), msg: line.into(), ..Log::default() })
}

/// A PNG image of a topic; `frame` is the camera's optical frame.
///
/// # Errors
/// As [`joint_states`].
pub fn image(topic: &str, stamp: Stamp, frame: &str, png: Vec<u8>) -> Result<BagMessage, String> {
    packed(topic, &CompressedImage { header: Header::new(stamp, frame), format: "png".into(), data: png })
}
