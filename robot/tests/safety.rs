//! Contract of [`dsm_robot::safety::Envelope`]: whatever is commanded, at whatever rhythm, what leaves is within the
//! limits of `robot.toml` and the URDF, and the answer is what left; who is silent brakes; the emergency stop is latched;
//! the base stops before what the cameras measure, is slow near people and stays in its area.

mod kinematic;
mod recorder;

use dsm::time::Span;
use dsm_robot::drivers::{DriverError, Robot, Twist};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Group, RobotModel};
use dsm_robot::safety::{Cause, Envelope, PERIOD, Part, Safety, SafetyState, StopSwitch};
use kinematic::{Kinematic, porter};
use nalgebra::Point3;
use proptest::prelude::*;
use recorder::{Recorder, find_violation};
use std::sync::Arc;

type Wrapped = Envelope<Recorder<Kinematic>>;

fn wrapped(model: &Arc<RobotModel>) -> Wrapped {
    Envelope::new(Recorder::new(Kinematic::new(model), Kinematic::now), model)
}

fn world(robot: &Wrapped) -> &Kinematic {
    robot.inner().inner()
}

fn velocities(group: &Group, value: impl Fn(usize) -> f64) -> JointVelocities {
    JointVelocities::from_values(&group.joints, (0..group.len()).map(value).collect()).expect("lengths")
}

fn forward(forward_m_per_s: f64) -> Twist {
    Twist { forward_m_per_s, turn_rad_per_s: 0.0 }
}

fn wait(robot: &mut Wrapped, span: Span) {
    let until = robot.clock().now() + span;
    robot.clock().wait_until(until).expect("the clock runs");
}

/// One control period as a task has it: command, wait, look.
fn tick(robot: &mut Wrapped, twist: Twist) -> Result<Twist, DriverError> {
    let sent = robot.base().command(twist)?;
    wait(robot, PERIOD);
    robot.cameras().read("head")?;
    Ok(sent)
}

fn sent_to_base(robot: &Wrapped) -> Twist {
    robot.inner().tape().base.last().map_or(Twist::default(), |(_, twist)| *twist)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn what_leaves_is_within_the_envelope(
        commands in prop::collection::vec((-9.0..9.0f64, -9.0..9.0f64, -9.0..9.0f64, 2i64..60, any::<bool>()), 1..80),
    ) {
        let model = porter();
        let mut robot = wrapped(&model);
        for (forward, turn, joint, pause_ms, twice) in commands {
            let twist = Twist { forward_m_per_s: forward, turn_rad_per_s: turn };
            let wanted = velocities(&model.arm, |k| if k % 2 == 0 { joint } else { -joint });
            for _ in 0..if twice { 2 } else { 1 } {
                prop_assert_eq!(robot.base().command(twist).expect("accepted"), sent_to_base(&robot));
                let sent = robot.arm().command(&wanted).expect("accepted");
                prop_assert_eq!(sent.values(), &robot.inner().tape().arm.last().expect("sent").1[..]);
            }
            wait(&mut robot, Span(pause_ms * 1_000_000));
            robot.cameras().read("head").expect("a camera");
        }
        prop_assert_eq!(find_violation(robot.inner().tape(), &model), None);
    }

    #[test]
    fn at_the_control_rate_positions_hold(value in -9.0..9.0f64, turn_after in 1usize..200) {
        let model = porter();
        // A world without end stops.
        let mut robot = wrapped(&model);
        for tick in 0..300 {
            let sign = if tick % turn_after == 0 { -1.0 } else { 1.0 };
            robot.arm().command(&velocities(&model.arm, |_| sign * value)).expect("accepted");
            let before = world(&robot).arm.state.positions.clone();
            let sent = robot.inner().tape().arm.last().expect("sent").1.clone();
            for (k, velocity) in sent.iter().enumerate() {
                let (limits, next) = (&model.arm.limits[k], before.values()[k] + velocity * PERIOD.as_s());
                prop_assert!(next >= limits.lower - 1e-9 && next <= limits.upper + 1e-9, "{k} {next}");
            }
            wait(&mut robot, PERIOD);
        }
    }
}

#[test]
fn the_emergency_stop_brings_everything_to_rest_within_speed_over_acceleration_and_stays() {
    let model = porter();
    let mut robot = wrapped(&model);
    let nod = velocities(&model.head, |k| if k == 0 { 1.0 } else { 0.1 });
    for _ in 0..60 {
        robot.head().command(&nod).expect("accepted");
        tick(&mut robot, forward(9.0)).expect("accepted");
    }
    assert!(sent_to_base(&robot).forward_m_per_s > 0.4);
    let pressed_s = robot.clock().now().as_s();
    robot.emergency_stop().trigger("a person").expect("triggers");
    assert_eq!(robot.base().command(Twist::default()), Err(DriverError::Stopped { reason: "a person".into() }));
    assert!(robot.gripper().command(0.1, 10.0).is_err());
    assert!(robot.emergency_stop().reset().is_err(), "it still moves");
    let needed_s = 0.7 / model.settings.base.max_acceleration_m_per_s2;
    while robot.clock().now().as_s() < pressed_s + needed_s + 0.02 {
        wait(&mut robot, PERIOD);
    }
    assert!(world(&robot).is_still());
    assert_eq!(robot.state(), &SafetyState::Stopped { cause: Cause::EmergencyStop { reason: "a person".into() } });
    assert_eq!(find_violation(robot.inner().tape(), &model), None);
    robot.emergency_stop().reset().expect("resets at standstill");
    assert!(tick(&mut robot, forward(0.1)).is_ok());
}

#[test]
fn silent_parts_brake_after_a_tenth_of_a_second_in_one_long_wait() {
    let model = porter();
    let mut robot = wrapped(&model);
    let nod = velocities(&model.head, |k| if k == 0 { 1.0 } else { 0.0 });
    for _ in 0..60 {
        robot.head().command(&nod).expect("accepted");
        tick(&mut robot, forward(9.0)).expect("accepted");
    }
    let speed = sent_to_base(&robot).forward_m_per_s;
    wait(&mut robot, Span(80_000_000));
    assert_eq!(sent_to_base(&robot).forward_m_per_s, speed, "its time is not over");
    wait(&mut robot, Span(40_000_000));
    assert!(sent_to_base(&robot).forward_m_per_s < speed);
    wait(&mut robot, Span(2_000_000_000));
    assert!(world(&robot).is_still());
    assert_eq!(robot.report().timeouts, 2);
    // Nobody has looked ahead since, so it waits for that; who was silent may speak again.
    assert_eq!(robot.state(), &SafetyState::Held { cause: Cause::Silent { part: Part::Camera } });
    robot.cameras().read("head").expect("a camera");
    wait(&mut robot, PERIOD);
    assert_eq!(robot.state(), &SafetyState::Running);
}

#[test]
fn what_is_not_finite_or_for_other_joints_is_refused_and_nothing_is_sent() {
    let model = porter();
    let mut robot = wrapped(&model);
    assert!(matches!(robot.base().command(forward(f64::NAN)), Err(DriverError::NotFinite { .. })));
    let broken = velocities(&model.arm, |k| if k == 3 { f64::INFINITY } else { 0.0 });
    let error = robot.arm().command(&broken).expect_err("not finite").to_string();
    assert!(error.contains("arm_3_joint"), "{error}");
    let head = velocities(&model.head, |_| 0.0);
    assert!(matches!(robot.arm().command(&head), Err(DriverError::WrongJoints { .. })));
    assert!(robot.gripper().command(f64::NAN, 1.0).is_err());
    assert!(robot.inner().tape().base.is_empty() && robot.inner().tape().arm.is_empty());
    assert_eq!(robot.report().refused, 4);
}

#[test]
fn the_gripper_is_clamped_to_its_aperture_and_force() {
    let model = porter();
    let mut robot = wrapped(&model);
    let gripper = &model.settings.gripper;
    let sent = robot.gripper().command(9.0, 900.0).expect("accepted");
    assert_eq!(sent, (gripper.max_aperture_m, gripper.max_force_n));
    assert_eq!(robot.gripper().command(-1.0, -1.0).expect("accepted"), (0.0, 0.0));
    assert_eq!(robot.report().gripper, 2);
}

#[test]
fn a_base_that_nobody_looks_ahead_for_stops_and_goes_on_when_somebody_does() {
    let model = porter();
    let mut robot = wrapped(&model);
    while robot.clock().now().as_s() < 2.0 {
        robot.base().command(forward(0.4)).expect("a hold refuses nothing");
        wait(&mut robot, PERIOD);
    }
    assert_eq!(robot.state(), &SafetyState::Held { cause: Cause::Silent { part: Part::Camera } });
    let driven_m = world(&robot).place.world_from_base.translation.x;
    assert!(driven_m < 0.4 * 0.52 + 0.4 * 0.4 / (2.0 * 0.8) + 0.01, "{driven_m} m");
    for _ in 0..40 {
        tick(&mut robot, forward(0.4)).expect("accepted");
    }
    assert_eq!(robot.state(), &SafetyState::Running);
    assert!(sent_to_base(&robot).forward_m_per_s > 0.25);
    assert_eq!(robot.report().holds, 1);
}

#[test]
fn a_hold_that_does_not_end_is_latched() {
    let model = porter();
    let mut robot = wrapped(&model);
    let ended = (0..2000).find_map(|_| {
        wait(&mut robot, PERIOD);
        robot.base().command(forward(0.2)).err()
    });
    assert_eq!(ended, Some(DriverError::Stopped { reason: "the head camera is silent".into() }));
    assert!((10.5..10.8).contains(&robot.clock().now().as_s()));
}

#[test]
fn the_base_stops_before_a_wall_that_only_the_camera_knows() {
    let model = porter();
    for speed in [0.3, 0.7] {
        let mut inner = Kinematic::new(&model);
        (inner.cameras.size, inner.cameras.wall_x_m) = ((320, 240), Some(2.0));
        // The head looks down a little, so that the lower wall is in view to the end.
        inner.head.state.positions.values_mut()[1] = 0.5 * model.head_signs()[1];
        let mut robot = Envelope::new(Recorder::new(inner, Kinematic::now), &model);
        let mut fastest_at_touch: f64 = 0.0;
        for _ in 0..1200 {
            tick(&mut robot, forward(speed)).expect("accepted");
            let gap_m =
                2.0 - model.settings.base.footprint_radius_m - world(&robot).place.world_from_base.translation.x;
            if gap_m < 0.0 {
                // The wall of this world does not hold anybody up.
                fastest_at_touch = fastest_at_touch.max(world(&robot).base.moves.forward_m_per_s);
                break;
            }
            let braking = 0.9 * model.settings.base.max_acceleration_m_per_s2;
            let moves = world(&robot).base.moves.forward_m_per_s;
            // A cell of 2.5 cm, and a creep that is let through.
            assert!(moves * moves <= 2.0 * braking * (gap_m + 0.03).max(0.0) + 0.0101, "{moves} m/s, {gap_m} m");
        }
        assert!(fastest_at_touch <= 0.1 + 1e-9, "{fastest_at_touch} m/s");
        assert!(robot.report().near_things > 0);
    }
}

#[test]
fn base_and_arm_are_slow_near_people() {
    let model = porter();
    let mut robot = wrapped(&model);
    let lift = velocities(&model.arm, |k| if k == 0 { 0.2 } else { 0.0 });
    let mut speed_with = |people: &[Point3<f64>]| {
        for _ in 0..100 {
            let now = robot.clock().now();
            robot.safety().expect("an envelope").note_people(now, people);
            robot.arm().command(&lift).expect("accepted");
            tick(&mut robot, forward(0.6)).expect("accepted");
        }
        (sent_to_base(&robot).forward_m_per_s, robot.inner().tape().arm.last().expect("sent").1[0])
    };
    let alone = speed_with(&[]);
    let near = speed_with(&[Point3::new(1.2, 0.3, 1.0)]);
    assert!(alone.0 > 0.55, "{alone:?}");
    assert!(near.0 < 0.15 && near.0 > 0.0, "{near:?}");
    assert!(near.1 < 0.25 * 0.2, "{near:?}");
}

#[test]
fn the_base_stays_in_its_area() {
    let mut model = (*porter()).clone();
    model.settings.safety.area = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut robot = wrapped(&Arc::new(model));
    for _ in 0..600 {
        tick(&mut robot, forward(0.7)).expect("accepted");
        assert!(world(&robot).place.world_from_base.translation.x <= 1.0);
    }
    assert!(world(&robot).place.world_from_base.translation.x > 0.9);
}

#[test]
fn the_tool_stays_above_its_lowest_height() {
    let mut model = (*porter()).clone();
    let height_m = |model: &RobotModel, robot: &Wrapped| {
        let mut configuration = model.kinematics.zero();
        configuration.apply(&world(robot).arm.state.positions);
        model.kinematics.root_from_link(&configuration, model.tool).translation.z
    };
    let start_m = height_m(&model, &wrapped(&Arc::new(model.clone())));
    model.settings.safety.tool_lowest_m = Some(start_m - 0.03);
    let model = Arc::new(model);
    let mut robot = wrapped(&model);
    let down = velocities(&model.arm, |k| if k == 0 { -0.2 } else { 0.0 });
    for _ in 0..300 {
        robot.arm().command(&down).expect("accepted");
        wait(&mut robot, PERIOD);
        assert!(height_m(&model, &robot) >= start_m - 0.03 - 1e-9);
    }
    assert!(height_m(&model, &robot) < start_m - 0.02);
}

#[test]
fn a_switch_pressed_from_elsewhere_stops_the_robot_and_cannot_be_reset_away() {
    let model = porter();
    let switch = StopSwitch::default();
    let mut robot = wrapped(&model).with_stop_switch(switch.clone());
    for _ in 0..50 {
        tick(&mut robot, forward(0.5)).expect("accepted");
    }
    switch.press("a key");
    switch.press("another key");
    wait(&mut robot, Span(1_500_000_000));
    assert!(world(&robot).is_still());
    assert_eq!(tick(&mut robot, forward(0.5)), Err(DriverError::Stopped { reason: "a key".into() }));
    robot.emergency_stop().reset().expect("at standstill");
    assert!(tick(&mut robot, forward(0.5)).is_err(), "the button is still in");
}
