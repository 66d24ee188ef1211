//! Contract: every message goes over the wire as the bytes that another implementation makes of it (`make_cdr.py`), and is
//! read back from them whole.

#![allow(clippy::unwrap_used, reason = "a test")]

use byteorder::LittleEndian;
use dsm_ros2::messages::*;
use std::collections::BTreeMap;
use std::fmt::Debug;

/// The type's hash and its bytes behind the encapsulation's four, by the type's name.
fn known() -> BTreeMap<&'static str, Vec<u8>> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    let line = |line: &'static str| {
        let parts: Vec<&str> = line.split(' ').collect();
        assert!(parts[1].starts_with("RIHS01_"), "{line}");
        let bytes: Vec<u8> = parts[2].as_bytes().chunks(2).map(byte).collect();
        assert_eq!(bytes[..4], [0, 1, 0, 0], "little endian, plain CDR");
        (parts[0], bytes[4..].to_vec())
    };
    include_str!("cdr.txt").lines().map(line).collect()
}

fn check<M: RosMessage + PartialEq + Debug>(message: M) {
    let name = format!("{}/msg/{}", M::PACKAGE, M::NAME);
    let known = known();
    let expected = known.get(name.as_str()).unwrap_or_else(|| panic!("cdr.txt lacks {name}"));
    let bytes = cdr_encoding::to_vec::<M, LittleEndian>(&message).unwrap();
    assert_eq!(&bytes, expected, "{name}");
    let (back, read) = cdr_encoding::from_bytes::<M, LittleEndian>(expected).unwrap();
    assert_eq!(back, message, "{name}");
    assert_eq!(read, expected.len(), "{name}");
}

fn header(frame_id: &str) -> Header {
    Header { stamp: Time { sec: 12, nanosec: 345_000_000 }, frame_id: frame_id.into() }
}

fn vector(x: f64, y: f64, z: f64) -> Vector3 {
    Vector3 { x, y, z }
}

fn pose() -> Pose {
    let orientation = Quaternion { x: 0.5, y: -0.5, z: 0.5, w: 0.5 };
    Pose { position: Point { x: 1.5, y: -2.0, z: 0.25 }, orientation }
}

fn transform() -> TransformStamped {
    let transform = Transform { translation: vector(1.5, -2.0, 0.25), rotation: pose().orientation };
    TransformStamped { header: header("map"), child_frame_id: "odom".into(), transform }
}

fn covariance() -> [[f64; 6]; 6] {
    std::array::from_fn(|row| std::array::from_fn(|column| (6 * row + column) as f64))
}

fn posed() -> PoseWithCovariance {
    PoseWithCovariance { pose: pose(), covariance: covariance() }
}

fn twist() -> Twist {
    Twist { linear: vector(0.25, 0.0, 0.0), angular: vector(0.0, 0.0, -0.5) }
}

fn names() -> Vec<String> {
    vec!["lift".into(), "arm_1".into()]
}

fn hypothesis() -> ObjectHypothesisWithPose {
    let hypothesis = ObjectHypothesis { class_id: "mug".into(), score: 0.75 };
    ObjectHypothesisWithPose { hypothesis, pose: posed() }
}

fn color() -> ColorRGBA {
    ColorRGBA { r: 0.25, g: 0.5, b: 0.75, a: 1.0 }
}

#[test]
fn standard_messages() {
    check(Bool { data: true });
    check(Text { data: "the red mug".into() });
    let dim = vec![MultiArrayDimension { label: "j".into(), size: 3, stride: 3 }];
    check(Float64MultiArray { layout: MultiArrayLayout { dim, data_offset: 0 }, data: vec![0.1, -0.2, 0.3] });
    check(Clock { clock: header("").stamp });
    let values = vec![KeyValue { key: "celsius".into(), value: "71".into() }];
    let (name, message, hardware_id) = ("arm".into(), "hot".into(), "a1".into());
    let status = vec![DiagnosticStatus { level: 2, name, message, hardware_id, values }];
    check(DiagnosticArray { header: header("base"), status });
}

#[test]
fn messages_of_motion() {
    check(PoseStamped { header: header("map"), pose: pose() });
    check(PoseWithCovarianceStamped { header: header("map"), pose: posed() });
    check(TwistStamped { header: header("base_link"), twist: twist() });
    check(transform());
    check(TFMessage { transforms: vec![transform()] });
    let twist = TwistWithCovariance { twist: twist(), covariance: covariance() };
    check(Odometry { header: header("odom"), child_frame_id: "base_link".into(), pose: posed(), twist });
    let (positions, velocities) = (vec![0.3, -1.25], vec![0.0, 0.5]);
    check(JointState {
        header: header(""),
        name: names(),
        position: positions.clone(),
        velocity: velocities.clone(),
        effort: vec![],
    });
    let time_from_start = Duration { sec: 1, nanosec: 500_000_000 };
    let point = JointTrajectoryPoint { positions, velocities, time_from_start, ..JointTrajectoryPoint::default() };
    check(JointTrajectory { header: header(""), joint_names: names(), points: vec![point] });
    check(GripperCommand { position: 0.08, max_effort: 30.0 });
}

#[test]
fn pictures() {
    check(Image {
        header: header("head"),
        height: 2,
        width: 2,
        encoding: "16UC1".into(),
        is_bigendian: 0,
        step: 4,
        data: (0..8).collect(),
    });
    check(CameraInfo {
        header: header("head"),
        height: 480,
        width: 640,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: [500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [500.0, 0.0, 319.5, 0.0, 0.0, 500.0, 239.5, 0.0, 0.0, 0.0, 1.0, 0.0],
        binning_x: 1,
        binning_y: 1,
        roi: RegionOfInterest::default(),
    });
}

#[test]
fn things_seen_and_drawn() {
    let center = Pose2D { position: Point2D { x: 320.5, y: 240.0 }, theta: 0.0 };
    let bbox = BoundingBox2D { center, size_x: 20.0, size_y: 30.0 };
    let seen = Detection2D { header: header("head"), results: vec![hypothesis()], bbox, id: "1".into() };
    check(Detection2DArray { header: header("head"), detections: vec![seen] });
    let bbox = BoundingBox3D { center: pose(), size: vector(0.1, 0.2, 0.3) };
    let mapped = Detection3D { header: header("map"), results: vec![hypothesis()], bbox, id: "object 7".into() };
    check(Detection3DArray { header: header("map"), detections: vec![mapped] });
    let marker = Marker {
        header: header("map"),
        ns: "objects".into(),
        id: 7,
        kind: 1,
        pose: pose(),
        scale: vector(0.1, 0.2, 0.3),
        color: color(),
        lifetime: Duration { sec: 1, nanosec: 500_000_000 },
        frame_locked: true,
        points: vec![Point { x: 1.0, y: 2.0, z: 3.0 }],
        colors: vec![color()],
        texture: CompressedImage { header: header(""), ..CompressedImage::default() },
        uv_coordinates: vec![UVCoordinate { u: 0.5, v: 0.25 }],
        text: "mug".into(),
        mesh_file: MeshFile { filename: "a".into(), data: vec![1, 2, 3] },
        ..Marker::default()
    };
    check(MarkerArray { markers: vec![marker] });
}
