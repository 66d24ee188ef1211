//! What a robot measures and sees, as messages. A part that does not answer says nothing: whoever listens sees its stamp
//! stand still.

use super::mouth::Saying;
use crate::messages::{
    CameraInfo, DiagnosticArray, DiagnosticStatus, Header, Image, JointState, MaskedDetection, MaskedDetections,
    Odometry, PixelRun, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, TFMessage, TransformStamped, Twist,
    TwistWithCovariance, Vector3,
};
use dsm::frame::RgbdFrame;
use dsm::perceive::Detections;
use dsm::time::Stamp;
use dsm_robot::drivers::{DriverError, Robot};
use dsm_robot::model::kinematics::Joint;
use dsm_robot::model::{Configuration, JointKind, RobotModel};

/// Frame of the map on the wire.
pub(super) const MAP_FRAME: &str = "map";
/// Frame of the odometry on the wire.
const ODOM_FRAME: &str = "odom";

/// What a part answers, if it does.
pub(super) fn answered<T>(answer: Result<T, DriverError>) -> Option<T> {
    answer.inspect_err(|error| tracing::debug!("{error}")).ok()
}

/// A message of joints under one stamp.
fn joints_of(saying: &mut Vec<JointState>, stamp: Stamp) -> &mut JointState {
    let stamped = Header::new(stamp, "");
    if let Some(index) = saying.iter().position(|said| said.header == stamped) {
        return &mut saying[index];
    }
    saying.push(JointState { header: stamped, ..JointState::default() });
    let last = saying.len() - 1;
    &mut saying[last]
}

/// All joints; those that were measured at one moment in one message.
pub(super) fn joints(robot: &mut dyn Robot, model: &RobotModel) -> Vec<Saying> {
    let mut saying = Vec::new();
    for state in [answered(robot.arm().state()), answered(robot.head().state())].into_iter().flatten() {
        let said = joints_of(&mut saying, state.stamp);
        said.name.extend(state.positions.names().iter().map(|name| name.to_string()));
        said.position.extend(state.positions.values());
        said.velocity.extend(state.velocities.values());
        said.effort.resize(said.name.len(), f64::NAN);
    }
    if let Some(gripper) = answered(robot.gripper().state()) {
        let said = joints_of(&mut saying, gripper.stamp);
        let fingers = &model.settings.gripper.joints;
        // Only whether they move is known here.
        let speed = if gripper.moving { 1.0 } else { 0.0 };
        for finger in fingers {
            said.name.push(finger.clone());
            said.position.push(gripper.width_m / fingers.len() as f64);
            said.velocity.push(speed);
            said.effort.push(gripper.force_n);
        }
    }
    saying.into_iter().map(Saying::Joints).collect()
}

/// Odometry, localisation, and the transforms that follow.
pub(super) fn poses(robot: &mut dyn Robot, model: &RobotModel) -> Vec<Saying> {
    let base_frame = &model.settings.base.link;
    let odom = answered(robot.localisation().odom_from_base());
    let believed = answered(robot.localisation().world_from_base());
    let velocity = answered(robot.base().velocity());
    let mut saying = Vec::new();
    if let (Some(odom), Some(velocity)) = (&odom, velocity) {
        let twist = Twist {
            linear: Vector3 { x: velocity.forward_m_per_s, ..Vector3::default() },
            angular: Vector3 { z: velocity.turn_rad_per_s, ..Vector3::default() },
        };
        saying.push(Saying::Odometry(Box::new(Odometry {
            header: Header::new(odom.stamp, ODOM_FRAME),
            child_frame_id: base_frame.clone(),
            pose: PoseWithCovariance { pose: (&odom.pose).into(), ..PoseWithCovariance::default() },
            twist: TwistWithCovariance { twist, ..TwistWithCovariance::default() },
        })));
    }
    if let Some(believed) = &believed {
        let pose = PoseWithCovariance { pose: (&believed.pose).into(), ..PoseWithCovariance::default() };
        let header = Header::new(believed.stamp, MAP_FRAME);
        saying.push(Saying::Localisation(Box::new(PoseWithCovarianceStamped { header, pose })));
    }
    if let (Some(odom), Some(believed)) = (odom, believed) {
        let transform = |stamp: Stamp, parent: &str, child: &str, pose: &dsm::Pose| TransformStamped {
            header: Header::new(stamp, parent),
            child_frame_id: child.to_owned(),
            transform: pose.into(),
        };
        let map_from_odom = believed.pose * odom.pose.inverse();
        let transforms = vec![
            transform(believed.stamp, MAP_FRAME, ODOM_FRAME, &map_from_odom),
            transform(odom.stamp, ODOM_FRAME, base_frame, &odom.pose),
        ];
        saying.push(Saying::Transforms(TFMessage { transforms }));
    }
    saying
}

/// The transforms of joints of a kind at a configuration, each from parent to child.
fn transforms(model: &RobotModel, stamp: Stamp, configuration: &Configuration, fixed: bool) -> Vec<TransformStamped> {
    let kinematics = &model.kinematics;
    let joints = kinematics.joints.iter().filter(|joint| (joint.kind == JointKind::Fixed) == fixed);
    let poses = kinematics.root_from_links(configuration);
    let transform = |joint: &Joint| TransformStamped {
        header: Header::new(stamp, &kinematics.links[joint.parent.0].name),
        child_frame_id: kinematics.links[joint.child.0].name.clone(),
        transform: (&poses.get(joint.parent).inv_mul(poses.get(joint.child))).into(),
    };
    joints.map(transform).collect()
}

/// Where links stand that never move against each other.
pub(super) fn fixed_links(model: &RobotModel, stamp: Stamp) -> TFMessage {
    TFMessage { transforms: transforms(model, stamp, &model.kinematics.zero(), true) }
}

/// Where links stand that joints move.
pub(super) fn links(robot: &mut dyn Robot, model: &RobotModel) -> Saying {
    let mut configuration = model.kinematics.zero();
    for state in [answered(robot.arm().state()), answered(robot.head().state())].into_iter().flatten() {
        configuration.apply(&state.positions);
    }
    if let Some(gripper) = answered(robot.gripper().state()) {
        configuration = model.with_gripper_width(configuration, gripper.width_m);
    }
    let now = robot.clock().now();
    Saying::Transforms(TFMessage { transforms: transforms(model, now, &configuration, false) })
}

/// Which parts answer.
pub(super) fn diagnostics(robot: &mut dyn Robot, now: Stamp) -> DiagnosticArray {
    let part = |name: &str, state: Result<(), String>| DiagnosticStatus {
        level: if state.is_ok() { 0 } else { 2 },
        name: name.to_owned(),
        message: state.err().unwrap_or_else(|| "answers".to_owned()),
        ..DiagnosticStatus::default()
    };
    fn said<T>(answer: Result<T, DriverError>) -> Result<(), String> {
        answer.map(drop).map_err(|error| error.to_string())
    }
    let stopped = robot.emergency_stop().find_reason().map_or(Ok(()), Err);
    let status = vec![
        part("base", said(robot.base().velocity())),
        part("arm", said(robot.arm().state())),
        part("head", said(robot.head().state())),
        part("gripper", said(robot.gripper().state())),
        part("localisation", said(robot.localisation().world_from_base())),
        part("emergency stop", stopped),
    ];
    DiagnosticArray { header: Header::new(now, ""), status }
}

/// A frame of a camera, its intrinsics and its pose.
pub(super) fn picture(camera: usize, frame: &RgbdFrame) -> [Saying; 4] {
    let header = Header::new(frame.stamp, &frame.camera);
    let (width, height) = (frame.model.width, frame.model.height);
    let image = |encoding: &str, bytes: u32, data: Vec<u8>| Image {
        header: header.clone(),
        height,
        width,
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: width * bytes,
        data,
    };
    let color = image("rgb8", 3, frame.color.as_flattened().to_vec());
    let pose = PoseStamped { header: Header::new(frame.stamp, MAP_FRAME), pose: (&frame.world_from_camera).into() };
    [
        Saying::Color(camera, color),
        Saying::Depth(camera, depth_image(frame, &image)),
        Saying::Info(camera, Box::new(camera_info(frame, header.clone()))),
        Saying::CameraPose(camera, pose),
    ]
}

/// What a detector found in a frame.
pub(super) fn detections(frame: &RgbdFrame, detector: &str, found: Detections) -> Saying {
    let items = found.items.into_iter().map(|item| {
        let runs = item.mask.runs.iter().map(|run| PixelRun { start: run.start, length: run.length });
        MaskedDetection { name: item.name, score: item.score, runs: runs.collect() }
    });
    Saying::Detections(MaskedDetections {
        header: Header::new(frame.stamp, &frame.camera),
        frame: frame.id.0,
        detector: detector.to_owned(),
        width: frame.model.width,
        detections: items.collect(),
    })
}

/// Depth in whole millimetres; in metres when that would lose something.
fn depth_image(frame: &RgbdFrame, image: &dyn Fn(&str, u32, Vec<u8>) -> Image) -> Image {
    let mut data = Vec::with_capacity(2 * frame.depth_m.len());
    for depth_m in &frame.depth_m {
        let millimetres = (depth_m * 1000.0).round().clamp(0.0, f32::from(u16::MAX)) as u16;
        if f32::from(millimetres) / 1000.0 != *depth_m {
            return image("32FC1", 4, frame.depth_m.iter().flat_map(|depth_m| depth_m.to_le_bytes()).collect());
        }
        data.extend(millimetres.to_le_bytes());
    }
    image("16UC1", 2, data)
}

fn camera_info(frame: &RgbdFrame, header: Header) -> CameraInfo {
    let model = &frame.model;
    // ROS counts pixels from the middle of the first.
    let (fx, fy, cx, cy) = (model.fx, model.fy, model.cx - 0.5, model.cy - 0.5);
    CameraInfo {
        header,
        height: model.height,
        width: model.width,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}
