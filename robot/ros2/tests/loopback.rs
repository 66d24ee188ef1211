//! Contract: over the wire, in lock step, a robot is what it is without: the same states, pictures and detections, tick by
//! tick, after the same commands; a stop is latched on both sides; nobody at the other end is an error that names topics.
//!
//! Needs a network with multicast, as every machine's loopback has; a machine without it skips with a message.

#![allow(clippy::unwrap_used, reason = "a test")]

use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::perceive::{Detection, Detections, Detector, Mask};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{
    Base, Cameras, Clock, DriverError, EmergencyStop, Gripper, GripperState, JointGroup, JointState, Localisation,
    Robot, StampedPose, Twist,
};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{Group, RobotModel};
use dsm_ros2::client::{Connection, connect};
use dsm_ros2::error::Ros2Error;
use dsm_ros2::server::{Host, Server, Weather};
use dsm_ros2::settings::{ClockSource, Ros2Settings};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const PERIOD: Span = Span(10_000_000);

/// A robot that does exactly what it is told.
struct Puppet {
    base: PuppetBase,
    arm: PuppetGroup,
    head: PuppetGroup,
    gripper: PuppetGripper,
    cameras: PuppetCameras,
    stop: PuppetStop,
    now: Stamp,
}

struct PuppetBase {
    twist: Twist,
    world_from_base: Pose,
    now: Stamp,
}

struct PuppetGroup {
    state: JointState,
    commanded: JointVelocities,
}

struct PuppetGripper(GripperState);

struct PuppetCameras {
    names: Vec<String>,
    model: CameraModel,
    frames: Vec<Option<RgbdFrame>>,
    next: u64,
}

#[derive(Default)]
struct PuppetStop(Option<String>);

impl PuppetGroup {
    fn new(group: &Group) -> Self {
        let (positions, velocities) = (JointPositions::zeros(&group.joints), JointVelocities::zeros(&group.joints));
        Self { commanded: velocities.clone(), state: JointState { stamp: Stamp(0), positions, velocities } }
    }

    fn step(&mut self, now: Stamp, step_s: f64) {
        self.state.stamp = now;
        self.state.velocities = self.commanded.clone();
        for (position, velocity) in self.state.positions.values_mut().iter_mut().zip(self.commanded.values()) {
            *position += step_s * velocity;
        }
    }
}

impl Puppet {
    fn new(model: &RobotModel) -> Self {
        let camera = &model.settings.camera[0];
        let names: Vec<String> = model.settings.camera.iter().map(|camera| camera.name.clone()).collect();
        let state = GripperState { stamp: Stamp(0), width_m: 0.05, force_n: 0.0, moving: false };
        Self {
            base: PuppetBase { twist: Twist::default(), world_from_base: Pose::identity(), now: Stamp(0) },
            arm: PuppetGroup::new(&model.arm),
            head: PuppetGroup::new(&model.head),
            gripper: PuppetGripper(state),
            cameras: PuppetCameras {
                frames: vec![None; names.len()],
                names,
                model: CameraModel::from_vertical_fov(camera.width, camera.height, camera.vertical_fov_rad),
                next: 0,
            },
            stop: PuppetStop::default(),
            now: Stamp(0),
        }
    }
}

impl Base for PuppetBase {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.twist = twist;
        Ok(twist)
    }
    fn velocity(&mut self) -> Result<Twist, DriverError> {
        Ok(self.twist)
    }
}

impl Localisation for PuppetBase {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        Ok(StampedPose { stamp: self.now, pose: self.world_from_base })
    }
    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.world_from_base()
    }
}

impl JointGroup for PuppetGroup {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.commanded = velocities.clone();
        Ok(velocities.clone())
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        Ok(self.state.clone())
    }
}

impl Gripper for PuppetGripper {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.0.width_m = width_m;
        Ok((width_m, max_force_n))
    }
    fn state(&mut self) -> Result<GripperState, DriverError> {
        Ok(self.0)
    }
}

impl Cameras for PuppetCameras {
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }
    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        Ok(self.names.iter().position(|name| name == camera).and_then(|index| self.frames[index].take()))
    }
}

impl EmergencyStop for PuppetStop {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        self.0.get_or_insert_with(|| reason.to_owned());
        Ok(())
    }
    fn find_reason(&self) -> Option<String> {
        self.0.clone()
    }
    fn reset(&mut self) -> Result<(), DriverError> {
        self.0 = None;
        Ok(())
    }
}

impl Clock for Puppet {
    fn now(&self) -> Stamp {
        self.now
    }
    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        while self.now < stamp {
            self.now = self.now + PERIOD;
            let Twist { forward_m_per_s, turn_rad_per_s } = self.base.twist;
            let step_s = PERIOD.as_s();
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), step_s * turn_rad_per_s);
            let step = Pose::from_parts(Translation3::new(step_s * forward_m_per_s, 0.0, 0.0), turn);
            self.base.world_from_base *= step;
            self.base.now = self.now;
            self.arm.step(self.now, step_s);
            self.head.step(self.now, step_s);
            self.gripper.0.stamp = self.now;
            if self.now.0 % 200_000_000 == 0 {
                for index in 0..self.cameras.names.len() {
                    let (id, pixels) = (self.cameras.next, self.cameras.model.pixel_count());
                    self.cameras.next += 1;
                    let color = |pixel: usize| [(pixel % 251) as u8, id as u8, (self.now.0 / 7_000_000) as u8];
                    let depth = |pixel: usize| f32::from((pixel % 4000) as u16 + id as u16) / 1000.0;
                    self.cameras.frames[index] = Some(RgbdFrame {
                        id: FrameId(id),
                        stamp: self.now,
                        camera: self.cameras.names[index].as_str().into(),
                        model: self.cameras.model,
                        world_from_camera: self.base.world_from_base * Pose::translation(0.1, 0.0, 1.0),
                        color: (0..pixels).map(color).collect(),
                        depth_m: (0..pixels).map(depth).collect(),
                    });
                }
            }
        }
        Ok(())
    }
}

impl Robot for Puppet {
    fn base(&mut self) -> &mut dyn Base {
        &mut self.base
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        &mut self.arm
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        &mut self.gripper
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        &mut self.head
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        &mut self.cameras
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        &mut self.base
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        &mut self.stop
    }
}

/// Sees one thing in each picture, named by the picture's corner.
struct CornerDetector;

impl Detector for CornerDetector {
    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        let mask = Mask::from_sorted_pixels(frame.model.width, [0, 1, 2, 640, 641]);
        let name = format!("thing {}", frame.color[0][2]);
        Detections { frame: frame.id, items: vec![Detection { mask, name, score: 0.5 }] }
    }
}

/// Serves until it is told that it is over, and keeps the lines of the log.
struct Listener {
    over: Arc<AtomicBool>,
    lines: Vec<String>,
}

impl Host for Listener {
    fn goes_on(&mut self, _: Stamp, _: Option<std::time::Duration>) -> bool {
        !self.over.load(Ordering::Relaxed)
    }
    fn hear(&mut self, line: String) {
        self.lines.push(line);
    }
}

fn model() -> Arc<RobotModel> {
    Arc::new(RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/porter")).unwrap())
}

fn settings(domain: u16) -> Ros2Settings {
    Ros2Settings {
        domain,
        clock: ClockSource::LockStep,
        camera_pose: "/camera/NAME/pose".into(),
        detections: "/detections".into(),
        timeout_s: 20.0,
        ..Ros2Settings::default()
    }
}

/// What a robot answers after each tick of a fixed list of commands.
#[derive(Debug, PartialEq)]
struct Trace {
    poses: Vec<StampedPose>,
    twists: Vec<Twist>,
    joints: Vec<JointState>,
    widths: Vec<f64>,
    frames: Vec<RgbdFrame>,
}

fn drive(robot: &mut dyn Robot, model: &RobotModel) -> Trace {
    let mut trace =
        Trace { poses: Vec::new(), twists: Vec::new(), joints: Vec::new(), widths: Vec::new(), frames: Vec::new() };
    for tick in 0..100 {
        let phase = f64::from(tick);
        let twist = Twist { forward_m_per_s: 0.3 * (0.1 * phase).sin(), turn_rad_per_s: 0.5 * (0.07 * phase).cos() };
        robot.base().command(twist).unwrap();
        for (group, arm) in [(&model.arm, true), (&model.head, false)] {
            let values = (0..group.len()).map(|joint| 0.1 * (0.2 * phase + joint as f64).sin()).collect();
            let velocities = JointVelocities::from_values(&group.joints, values).unwrap();
            let part = if arm { robot.arm() } else { robot.head() };
            part.command(&velocities).unwrap();
        }
        robot.gripper().command(0.1 * (0.03 * phase).sin().abs(), 20.0).unwrap();
        let next = robot.clock().now() + PERIOD;
        robot.clock().wait_until(next).unwrap();
        assert_eq!(robot.clock().now(), next);
        trace.poses.push(robot.localisation().world_from_base().unwrap());
        trace.twists.push(robot.base().velocity().unwrap());
        trace.joints.push(robot.arm().state().unwrap());
        trace.joints.push(robot.head().state().unwrap());
        trace.widths.push(robot.gripper().state().unwrap().width_m);
        for camera in robot.cameras().names() {
            if let Some(frame) = robot.cameras().read(&camera).unwrap() {
                trace.frames.push(frame);
            }
        }
    }
    trace
}

/// Skips with a message where no two participants find each other.
fn skip_without_multicast(error: &Ros2Error) {
    #[allow(clippy::print_stderr, reason = "who runs the tests is told")]
    {
        eprintln!("skipped: {error}")
    };
    if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
        use std::io::Write;
        let mut log = std::fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
        writeln!(log, "dsm-ros2 loopback: {error}").unwrap();
    }
}

#[test]
fn a_robot_is_the_same_over_the_wire() {
    let model = model();
    let expected = drive(&mut Puppet::new(&model), &model);
    assert!(expected.frames.len() >= 8);
    let over = Arc::new(AtomicBool::new(false));
    let (served, ended) = (model.clone(), over.clone());
    let server = std::thread::spawn(move || {
        let mut robot = Puppet::new(&served);
        let mut server = Server::start(served, settings(71), Weather::default()).unwrap();
        let mut host = Listener { over: ended, lines: Vec::new() };
        server.serve_steps(&mut robot, &mut CornerDetector, &mut host).unwrap();
        (robot.stop.0, host.lines)
    });
    let connected = connect(model.clone(), settings(71));
    let Connection { mut robot, detections, log } = match connected {
        Ok(connected) => connected,
        Err(error) => {
            over.store(true, Ordering::Relaxed);
            server.join().unwrap();
            return skip_without_multicast(&error);
        }
    };
    log.send("step 0: drive about".into()).unwrap();
    let found = drive(&mut robot, &model);
    assert_eq!(found.poses, expected.poses);
    assert_eq!(found.twists, expected.twists);
    assert_eq!(found.joints, expected.joints);
    assert_eq!(found.widths, expected.widths);
    assert_eq!(found.frames.len(), expected.frames.len());
    for (found, expected) in found.frames.iter().zip(&expected.frames) {
        assert!(found == expected, "{} at {:?}", expected.camera, expected.stamp);
    }
    let seen: Vec<Detections> = detections.unwrap().try_iter().collect();
    assert_eq!(seen.len(), expected.frames.len());
    for (seen, frame) in seen.iter().zip(&expected.frames) {
        assert_eq!(*seen, CornerDetector.detect(frame));
    }
    robot.emergency_stop().trigger("a hand in the way").unwrap();
    robot.emergency_stop().trigger("another reason").unwrap();
    let next = robot.clock().now() + PERIOD;
    robot.clock().wait_until(next).unwrap();
    let refused = robot.base().command(Twist::default());
    assert_eq!(refused, Err(DriverError::Stopped { reason: "a hand in the way".into() }));
    over.store(true, Ordering::Relaxed);
    let (stopped, lines) = server.join().unwrap();
    assert_eq!(stopped.as_deref(), Some("a hand in the way"));
    assert_eq!(lines, ["step 0: drive about"]);
}

#[test]
fn nobody_at_the_other_end_is_an_error_that_names_topics() {
    let settings = Ros2Settings { timeout_s: 0.5, ..settings(72) };
    match connect(model(), settings) {
        Err(Ros2Error::Silent { topics, domain: 72, .. }) => {
            assert!(topics.contains(&"/joint_states".to_owned()) && topics.contains(&"/cmd_vel".to_owned()));
        }
        Err(error) => skip_without_multicast(&error),
        Ok(_) => panic!("there is nobody"),
    }
}
