use super::*;
use crate::drivers::StampedPose;
use crate::joints::JointPositions;
use crate::model::Group;
use dsm::Pose;
use dsm::frame::RgbdFrame;
use proptest::prelude::*;
use std::path::Path;

/// A robot that does exactly what it is told and writes down what it was told.
struct Obedient {
    now: Stamp,
    base: ObedientBase,
    arm: ObedientJoints,
    head: ObedientJoints,
    gripper: ObedientGripper,
    rest: Rest,
}

struct ObedientBase {
    sent: Twist,
}

struct ObedientJoints {
    state: JointState,
    sent: JointVelocities,
}

struct ObedientGripper {
    sent: (f64, f64),
}

/// Parts that the limits only pass on, and an emergency stop that stops nothing by itself.
#[derive(Default)]
struct Rest {
    reason: Option<String>,
}

impl Base for ObedientBase {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        self.sent = twist;
        Ok(twist)
    }
    fn velocity(&mut self) -> Result<Twist, DriverError> {
        Ok(self.sent)
    }
}

impl JointGroup for ObedientJoints {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        self.sent = velocities.clone();
        Ok(velocities.clone())
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        Ok(self.state.clone())
    }
}

impl Gripper for ObedientGripper {
    fn command(&mut self, width_m: f64, max_force_n: f64) -> Result<(f64, f64), DriverError> {
        self.sent = (width_m, max_force_n);
        Ok(self.sent)
    }
    fn state(&mut self) -> Result<GripperState, DriverError> {
        Ok(GripperState { stamp: Stamp(0), width_m: self.sent.0, force_n: 0.0, moving: false })
    }
}

impl Cameras for Rest {
    fn names(&self) -> Vec<String> {
        Vec::new()
    }
    fn read(&mut self, _: &str) -> Result<Option<RgbdFrame>, DriverError> {
        Ok(None)
    }
}

impl Localisation for Rest {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        Ok(StampedPose { stamp: Stamp(0), pose: Pose::identity() })
    }
    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.world_from_base()
    }
}

impl EmergencyStop for Rest {
    fn trigger(&mut self, reason: &str) -> Result<(), DriverError> {
        self.reason = Some(reason.to_owned());
        Ok(())
    }
    fn find_reason(&self) -> Option<String> {
        self.reason.clone()
    }
    fn reset(&mut self) -> Result<(), DriverError> {
        self.reason = None;
        Ok(())
    }
}

impl Clock for Obedient {
    fn now(&self) -> Stamp {
        self.now
    }
    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        let step_s = (stamp - self.now).as_s();
        for joints in [&mut self.arm, &mut self.head] {
            let sent = joints.sent.values().to_vec();
            for (position, velocity) in joints.state.positions.values_mut().iter_mut().zip(sent) {
                *position += velocity * step_s;
            }
            joints.state.velocities = joints.sent.clone();
            joints.state.stamp = stamp;
        }
        self.now = stamp;
        Ok(())
    }
}

impl Robot for Obedient {
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
        &mut self.rest
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        &mut self.rest
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        &mut self.rest
    }
}

fn joints(group: &Group, at: f64) -> ObedientJoints {
    let value = |k: usize| {
        let limits = &group.limits[k];
        limits.lower + at * (limits.upper - limits.lower)
    };
    let positions = JointPositions::from_values(&group.joints, (0..group.len()).map(value).collect()).expect("lengths");
    let velocities = JointVelocities::zeros(&group.joints);
    ObedientJoints {
        state: JointState { stamp: Stamp(0), positions, velocities: velocities.clone() },
        sent: velocities,
    }
}

fn robot(at: f64) -> (Limited<Obedient>, RobotModel) {
    let model = RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter")).expect("porter loads");
    let inner = Obedient {
        now: Stamp(0),
        base: ObedientBase { sent: Twist::default() },
        arm: joints(&model.arm, at),
        head: joints(&model.head, at),
        gripper: ObedientGripper { sent: (0.0, 0.0) },
        rest: Rest::default(),
    };
    (Limited::new(inner, &model), model)
}

fn velocities(group: &Group, value: impl Fn(usize) -> f64) -> JointVelocities {
    JointVelocities::from_values(&group.joints, (0..group.len()).map(value).collect()).expect("lengths")
}

fn wait(robot: &mut Limited<Obedient>, span: Span) {
    let until = robot.clock().now() + span;
    robot.clock().wait_until(until).expect("the clock runs");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Whatever is commanded, at whatever rhythm, what leaves is within velocity, acceleration and position limits, and
    /// the answer is what left.
    #[test]
    fn what_leaves_is_within_the_envelope(
        at in 0.0..1.0f64,
        commands in prop::collection::vec((-9.0..9.0f64, -9.0..9.0f64, -9.0..9.0f64, 2i64..60, any::<bool>()), 1..80),
    ) {
        let (mut robot, model) = robot(at);
        let base = model.settings.base.clone();
        let (mut was_base, mut was_arm) = (Twist::default(), vec![0.0; model.arm.len()]);
        for (forward, turn, joint, pause_ms, twice) in commands {
            let twist = Twist { forward_m_per_s: forward, turn_rad_per_s: turn };
            let wanted = velocities(&model.arm, |k| if k % 2 == 0 { joint } else { -joint });
            for _ in 0..if twice { 2 } else { 1 } {
                prop_assert_eq!(robot.base().command(twist).expect("accepted"), robot.inner().base.sent);
                prop_assert_eq!(&robot.arm().command(&wanted).expect("accepted"), &robot.inner().arm.sent);
            }
            let sent = robot.inner().base.sent;
            prop_assert!(sent.forward_m_per_s.abs() <= base.max_speed_m_per_s + 1e-12);
            prop_assert!(sent.turn_rad_per_s.abs() <= base.max_turn_rate_rad_per_s + 1e-12);
            let change = (sent.forward_m_per_s - was_base.forward_m_per_s).abs();
            prop_assert!(change <= base.max_acceleration_m_per_s2 * LONGEST_STEP.as_s() + 1e-12);
            for (k, velocity) in robot.inner().arm.sent.values().iter().enumerate() {
                prop_assert!(velocity.abs() <= model.arm.limits[k].velocity + 1e-12);
                let most = model.arm.max_accelerations[k] * LONGEST_STEP.as_s();
                prop_assert!((velocity - was_arm[k]).abs() <= most + 1e-12);
            }
            wait(&mut robot, Span(pause_ms * 1_000_000));
            was_base = robot.inner().base.sent;
            was_arm = robot.inner().arm.sent.values().to_vec();
            for (k, position) in robot.inner().arm.state.positions.values().iter().enumerate() {
                let limits = &model.arm.limits[k];
                // Between commands up to 60 ms apart the room to brake shrinks unseen, by what one pause can drive.
                let slip = limits.velocity * 0.06;
                prop_assert!(*position >= limits.lower - slip && *position <= limits.upper + slip);
            }
        }
    }

    /// At the control rate no joint passes its position limits.
    #[test]
    fn at_the_control_rate_positions_hold(at in 0.0..1.0f64, value in -9.0..9.0f64, turn_after in 1usize..200) {
        let (mut robot, model) = robot(at);
        for tick in 0..300 {
            let sign = if tick % turn_after == 0 { -1.0 } else { 1.0 };
            robot.arm().command(&velocities(&model.arm, |_| sign * value)).expect("accepted");
            wait(&mut robot, PERIOD);
            for (k, position) in robot.inner().arm.state.positions.values().iter().enumerate() {
                let limits = &model.arm.limits[k];
                prop_assert!(*position >= limits.lower - 1e-9 && *position <= limits.upper + 1e-9, "{k} {position}");
            }
        }
    }
}

/// Runs every part up to speed.
fn at_speed(robot: &mut Limited<Obedient>, model: &RobotModel) {
    for _ in 0..60 {
        robot.base().command(Twist { forward_m_per_s: 9.0, turn_rad_per_s: 9.0 }).expect("accepted");
        robot.head().command(&velocities(&model.head, |k| if k == 0 { 1.0 } else { 0.1 })).expect("accepted");
        wait(robot, PERIOD);
    }
}

#[test]
fn the_emergency_stop_brings_everything_to_rest_within_speed_over_acceleration_and_stays() {
    let (mut robot, model) = robot(0.3);
    at_speed(&mut robot, &model);
    let base = &model.settings.base;
    let speed = robot.inner().base.sent.forward_m_per_s;
    assert!(speed > 0.4);
    let turning = robot.inner().base.sent.turn_rad_per_s;
    robot.emergency_stop().trigger("a person").expect("triggers");
    let needed_s = (speed / base.max_acceleration_m_per_s2)
        .max(turning / base.max_turn_acceleration_rad_per_s2)
        .max(2.0 / model.head.max_accelerations[0]);
    let mut last = robot.inner().base.sent.forward_m_per_s;
    assert!(last < speed, "it brakes at once");
    while robot.clock().now().as_s() < 0.6 + needed_s + 2.0 * PERIOD.as_s() {
        wait(&mut robot, PERIOD);
        let now = robot.inner().base.sent.forward_m_per_s;
        assert!(last - now <= base.max_acceleration_m_per_s2 * PERIOD.as_s() + 1e-12);
        last = now;
    }
    assert_eq!(robot.inner().base.sent, Twist::default());
    assert!(robot.inner().head.sent.values().iter().all(|v| *v == 0.0));
    let refused = robot.base().command(Twist::default());
    assert_eq!(refused, Err(DriverError::Stopped { reason: "a person".to_owned() }));
    assert!(robot.gripper().command(0.1, 10.0).is_err());
    robot.emergency_stop().reset().expect("resets");
    assert!(robot.base().command(Twist::default()).is_ok());
}

#[test]
fn silent_parts_brake_after_their_timeout_in_one_long_wait() {
    let (mut robot, model) = robot(0.3);
    at_speed(&mut robot, &model);
    wait(&mut robot, Span(80_000_000));
    assert!(robot.inner().head.sent.values()[0] > 0.9, "the head's time is not yet over");
    wait(&mut robot, Span(200_000_000));
    assert_eq!(robot.inner().head.sent.values()[0], 0.0);
    assert!(robot.inner().base.sent.forward_m_per_s > 0.4, "the base's time is not yet over");
    wait(&mut robot, Span(2_000_000_000));
    assert_eq!(robot.inner().base.sent, Twist::default());
    assert_eq!(robot.report().timeouts, 2);
}

#[test]
fn what_is_not_finite_or_for_other_joints_is_refused_and_nothing_is_sent() {
    let (mut robot, model) = robot(0.3);
    let twist = Twist { forward_m_per_s: f64::NAN, turn_rad_per_s: 0.0 };
    assert!(matches!(robot.base().command(twist), Err(DriverError::NotFinite { .. })));
    let broken = velocities(&model.arm, |k| if k == 3 { f64::INFINITY } else { 0.0 });
    let error = robot.arm().command(&broken).expect_err("not finite").to_string();
    assert!(error.contains("arm_3_joint"), "{error}");
    let head = velocities(&model.head, |_| 0.0);
    assert!(matches!(robot.arm().command(&head), Err(DriverError::WrongJoints { .. })));
    assert!(robot.gripper().command(f64::NAN, 1.0).is_err());
    assert_eq!(robot.inner().base.sent, Twist::default());
    assert_eq!(robot.report().refused, 4);
}

#[test]
fn the_gripper_is_clamped_to_its_aperture_and_force() {
    let (mut robot, model) = robot(0.3);
    let gripper = &model.settings.gripper;
    let sent = robot.gripper().command(9.0, 900.0).expect("accepted");
    assert_eq!(sent, (gripper.max_aperture_m, gripper.max_force_n));
    assert_eq!(robot.gripper().command(-1.0, -1.0).expect("accepted"), (0.0, 0.0));
    assert_eq!(robot.report().gripper, 2);
}
