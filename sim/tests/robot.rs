//! Contract of [`dsm_sim::robot::SimRobot`]: only `wait_until` lets time pass; commands return what is sent and hold
//! until the next; the base stops when it hears nothing; the emergency stop latches; cameras give each frame once, as
//! the world was at its capture; the robot lifts and carries by its drivers alone.

#![allow(clippy::unwrap_used, reason = "a failing step fails the test")]

mod blocks;

use blocks::{add_free, add_table, floor, porter, porter_model, start};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, Robot, Twist};
use dsm_robot::joints::JointVelocities;
use dsm_sim::physics::{Physics, PhysicsConfig, RapierPhysics};
use dsm_sim::robot::{
    CONTROL_PERIOD, CaptureRequest, Imager, LocalisationConfig, LocalisationNoise, SensorImage, SimRobot,
};
use dsm_sim::scene::{SceneModel, SceneShape};
use std::sync::mpsc::channel;

/// An image that encodes the height of body 1 in its depth.
struct Probe;

impl Imager for Probe {
    fn take_image(&mut self, request: &CaptureRequest<'_>) -> SensorImage {
        let height = request.world_from_bodies.get(1).map_or(0.0, |pose| pose.translation.z);
        let pixels = request.model.pixel_count();
        SensorImage { color: vec![[0; 3]; pixels], depth_m: vec![height as f32; pixels] }
    }
}

fn robot_in(scene: &SceneModel, posture: &str, lift_m: f64) -> SimRobot {
    let physics = RapierPhysics::new(scene, &porter(), &start(posture, lift_m), PhysicsConfig::default()).unwrap();
    let localisation = LocalisationConfig { seed: 1, noise: LocalisationNoise::Noisy };
    SimRobot::new(Box::new(physics), &porter_model(), Box::new(Probe), localisation).unwrap()
}

/// Passes time in control periods and calls `each` before every one.
fn run(robot: &mut SimRobot, seconds: f64, mut each: impl FnMut(&mut SimRobot)) {
    let end = robot.clock().now() + Span::from_s(seconds);
    while robot.clock().now() < end {
        each(robot);
        let next = robot.clock().now() + CONTROL_PERIOD;
        robot.clock().wait_until(next).unwrap();
    }
}

fn forward(speed: f64) -> Twist {
    Twist { forward_m_per_s: speed, turn_rad_per_s: 0.0 }
}

fn lift_command(robot: &mut SimRobot, velocity: f64) -> JointVelocities {
    let names = robot.arm().state().unwrap().positions.names().clone();
    let mut velocities = JointVelocities::zeros(&names);
    velocities.values_mut()[0] = velocity;
    robot.arm().command(&velocities).unwrap()
}

#[test]
fn only_waiting_lets_time_pass() {
    let mut robot = robot_in(&floor(), "carry", 0.08);
    robot.base().command(forward(0.3)).unwrap();
    for _ in 0..5 {
        robot.arm().state().unwrap();
        robot.localisation().world_from_base().unwrap();
        robot.cameras().read("head").unwrap();
    }
    assert_eq!(robot.clock().now(), Stamp(0));
    robot.clock().wait_until(Stamp::from_s(0.1)).unwrap();
    assert_eq!(robot.clock().now(), Stamp::from_s(0.1));
    assert_eq!(robot.arm().state().unwrap().stamp, Stamp::from_s(0.1));
}

#[test]
fn commands_return_what_is_sent() {
    let mut robot = robot_in(&floor(), "carry", 0.08);
    let sent = robot.base().command(Twist { forward_m_per_s: 9.0, turn_rad_per_s: -9.0 }).unwrap();
    assert_eq!(sent, Twist { forward_m_per_s: 0.7, turn_rad_per_s: -1.5 });
    assert_eq!(lift_command(&mut robot, 5.0).values()[0], 0.2);
    assert_eq!(robot.gripper().command(1.0, 500.0).unwrap(), (0.13, 40.0));
    assert!(matches!(robot.base().command(forward(f64::NAN)), Err(DriverError::NotFinite { .. })));
    let head = robot.head().state().unwrap().velocities;
    assert!(matches!(robot.arm().command(&head), Err(DriverError::WrongJoints { .. })));
}

#[test]
fn a_base_that_hears_nothing_stops() {
    let mut robot = robot_in(&floor(), "carry", 0.08);
    robot.base().command(forward(0.5)).unwrap();
    robot.clock().wait_until(Stamp::from_s(0.5)).unwrap();
    assert!(robot.base().velocity().unwrap().forward_m_per_s > 0.45);
    robot.clock().wait_until(Stamp::from_s(2.0)).unwrap();
    assert!(robot.base().velocity().unwrap().forward_m_per_s.abs() < 1e-3);
    let driven = robot.physics().world_from_base().translation.x;
    assert!((0.2..0.3).contains(&driven), "{driven} m");
}

#[test]
fn joints_that_hear_nothing_stop() {
    let mut robot = robot_in(&floor(), "carry", 0.08);
    lift_command(&mut robot, 0.1);
    robot.clock().wait_until(Stamp::from_s(0.4)).unwrap();
    assert!(robot.arm().state().unwrap().velocities.values()[0] > 0.09);
    robot.clock().wait_until(Stamp::from_s(2.0)).unwrap();
    let state = robot.arm().state().unwrap();
    assert!(state.velocities.values()[0].abs() < 1e-3, "{state:?}");
    assert!((0.12..0.15).contains(&state.positions.values()[0]), "{state:?}");
}

#[test]
fn the_emergency_stop_latches_until_reset() {
    let mut robot = robot_in(&floor(), "carry", 0.08);
    run(&mut robot, 1.0, |robot| {
        robot.base().command(forward(0.5)).unwrap();
    });
    robot.emergency_stop().trigger("a test").unwrap();
    robot.emergency_stop().trigger("another").unwrap();
    let refused = robot.base().command(forward(0.5));
    assert_eq!(refused, Err(DriverError::Stopped { reason: "a test".into() }));
    assert!(robot.gripper().command(0.0, 10.0).is_err());
    run(&mut robot, 0.5, |_| {});
    assert!(robot.base().velocity().unwrap().forward_m_per_s.abs() < 0.01);
    robot.emergency_stop().reset().unwrap();
    assert!(robot.base().command(forward(0.5)).is_ok());
}

#[test]
fn cameras_give_each_frame_once_as_the_world_was() {
    let mut scene = floor();
    add_free(&mut scene, [3.0, 0.0, 2.0], 0.2, SceneShape::Sphere { radius_m: 0.05 }, 0.5);
    let mut robot = robot_in(&scene, "carry", 0.08);
    let mut ids = Vec::new();
    run(&mut robot, 1.0, |robot| {
        if let Some(frame) = robot.cameras().read("head").unwrap() {
            // It fell freely until the capture, not until the reading.
            let t = frame.stamp.as_s();
            let fallen = f64::from(2.0 - frame.depth_m[0]);
            let expected = if t < 0.6 { 0.5 * 9.80665 * t * t } else { fallen };
            assert!((fallen - expected).abs() < 0.03, "{fallen} m after {t} s");
            ids.push(frame.id);
        }
        assert_eq!(robot.cameras().read("head").unwrap(), None);
    });
    assert_eq!(ids.len(), 5, "5 Hz");
    assert!(ids.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(robot.cameras().read("wrist").unwrap().is_some());
    assert!(matches!(robot.cameras().read("tail"), Err(DriverError::NoCamera { .. })));
}

#[test]
fn the_head_camera_sees_the_floor_ahead() {
    let mut robot = robot_in(&floor(), "carry", 0.08);
    robot.clock().wait_until(Stamp::from_s(0.3)).unwrap();
    let frame = robot.cameras().read("head").unwrap().unwrap();
    let camera = frame.world_from_camera;
    assert!((camera.translation.z - 1.25).abs() < 0.01);
    let forward = camera.rotation * nalgebra::Vector3::z();
    assert!(forward.x > 0.99, "level and ahead: {forward:?}");
}

#[test]
fn drivers_alone_lift_and_hold_an_apple() {
    let mut scene = floor();
    add_table(&mut scene, 0.71, 0.0, 1.2, 0.563);
    let apple = add_free(&mut scene, [0.519, 0.0, 0.598], 0.18, SceneShape::Sphere { radius_m: 0.035 }, 0.5);
    let mut robot = robot_in(&scene, "ready_down", 0.25);
    assert!((robot.gripper().state().unwrap().width_m - 0.13).abs() < 1e-3);
    run(&mut robot, 1.0, |robot| {
        lift_command(robot, -0.1);
    });
    lift_command(&mut robot, 0.0);
    robot.gripper().command(0.0, 25.0).unwrap();
    run(&mut robot, 0.5, |_| {});
    assert!(robot.gripper().state().unwrap().moving);
    run(&mut robot, 1.5, |_| {});
    let state = robot.gripper().state().unwrap();
    assert!(!state.moving && (state.width_m - 0.07).abs() < 0.004 && (state.force_n - 25.0).abs() < 1.0, "{state:?}");
    run(&mut robot, 1.5, |robot| {
        lift_command(robot, 0.1);
    });
    lift_command(&mut robot, 0.0);
    run(&mut robot, 2.0, |_| {});
    assert!(robot.physics().world_from_body(apple).translation.z > 0.598 + 0.1);
}

#[test]
fn the_observer_sees_every_tick() {
    let (sender, receiver) = channel();
    let mut robot = robot_in(&floor(), "carry", 0.08).with_observer(Box::new(move |physics: &dyn Physics| {
        sender.send(physics.now()).unwrap();
    }));
    robot.clock().wait_until(Stamp::from_s(0.1)).unwrap();
    let seen: Vec<Stamp> = receiver.try_iter().collect();
    assert_eq!(seen, (1..=10).map(|i| Stamp(i * 10_000_000)).collect::<Vec<_>>());
}
