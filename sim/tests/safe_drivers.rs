//! Contract: what the envelope promises holds on simulated physics, too: faults that strike a robot at work, one after the
//! other in one world, make it brake in time, for the right reason, and it stands; the drivers behave as drivers have to.

#![allow(clippy::unwrap_used, reason = "a failing step fails the test")]

mod blocks;
mod drivers;
#[path = "../../robot/tests/recorder/mod.rs"]
mod recorder;

use blocks::{floor, porter, porter_model, start};
use drivers::{robot_on, trials};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, Robot, Twist};
use dsm_robot::faults::{Fault, FaultKind, FaultPart, Faulty};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::RobotModel;
use dsm_robot::safety::{Cause, Envelope, PERIOD, Safety, SafetyState};
use dsm_sim::physics::{PhysicsConfig, RapierPhysics};
use dsm_sim::robot::SimRobot;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::{Recorder, find_violation};
use std::sync::Arc;

type Wrapped = Envelope<Recorder<Faulty<SimRobot>>>;

fn robot() -> SimRobot {
    let physics = RapierPhysics::new(&floor(), &porter(), &start("carry", 0.08), PhysicsConfig::default()).unwrap();
    robot_on(Box::new(physics), &porter_model())
}

#[test]
fn the_drivers_of_rapier_behave_bare_and_within_the_envelope() {
    trials(&mut robot(), &porter_model());
    let model = Arc::new(porter_model());
    trials(&mut Envelope::new(robot(), &model), &model);
}

/// What strikes, when braking has to begin, and why.
#[allow(clippy::type_complexity, reason = "a table")]
fn faults() -> Vec<(FaultKind, Option<FaultPart>, f64, fn(&Cause) -> bool)> {
    let arm = Some(FaultPart::Arm);
    vec![
        (FaultKind::JointsNan, arm, 0.1, |cause| matches!(cause, Cause::NotFinite { .. })),
        (FaultKind::JointsSwapped, arm, 0.1, |cause| matches!(cause, Cause::WrongJoints { .. })),
        (FaultKind::JointsJump, arm, 0.1, |cause| matches!(cause, Cause::MeasurementJump { .. })),
        (FaultKind::SensorFrozen, arm, 0.6, |cause| matches!(cause, Cause::Silent { .. })),
        (FaultKind::SensorFrozen, Some(FaultPart::Localisation), 0.6, |cause| matches!(cause, Cause::Silent { .. })),
        (FaultKind::SensorStuck, Some(FaultPart::Localisation), 0.6, |cause| matches!(cause, Cause::Stuck { .. })),
        (FaultKind::FramesLost, None, 0.6, |cause| matches!(cause, Cause::Silent { .. })),
        (FaultKind::PartLost, arm, 0.1, |cause| matches!(cause, Cause::PartFailed { .. })),
        (FaultKind::LocalisationJump, None, 0.1, |cause| matches!(cause, Cause::LocalisationJump { .. })),
        (FaultKind::Estop, None, 0.1, |cause| matches!(cause, Cause::EmergencyStop { .. })),
    ]
}

/// One control period at work; the first error ends it.
fn work(robot: &mut Wrapped, model: &RobotModel, twist: Twist) -> Result<(), DriverError> {
    robot.base().command(twist)?;
    let swing = 0.1 * (2.0 * robot.inner().true_now().as_s()).sin();
    let mut lift = JointVelocities::zeros(&model.arm.joints);
    lift.values_mut()[0] = swing;
    robot.arm().command(&lift)?;
    wait(robot);
    robot.cameras().read("head")?;
    Ok(())
}

fn wait(robot: &mut Wrapped) {
    let next = robot.clock().now() + PERIOD;
    robot.clock().wait_until(next).unwrap();
}

fn speed(robot: &Wrapped) -> f64 {
    let twist = robot.inner().inner().inner().physics().base_velocity();
    twist.forward_m_per_s.abs().max(twist.turn_rad_per_s.abs())
}

fn since(robot: &Wrapped, begin: Stamp) -> f64 {
    (robot.inner().true_now() - begin).as_s()
}

#[test]
fn thirty_faults_in_a_row_stop_a_robot_of_mass_and_motors() {
    let model = Arc::new(porter_model());
    let faulty = Faulty::new(robot(), Vec::new(), 1);
    let mut robot = Envelope::new(Recorder::new(faulty, |robot| robot.inner().physics().now()), &model);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for number in 0..30 {
        let (kind, part, within_s, expected) = faults()[number % faults().len()];
        let twist = Twist {
            forward_m_per_s: rng.random_range(0.3..0.6),
            turn_rad_per_s: if number % 2 == 0 { 0.8 } else { -0.8 },
        };
        for _ in 0..rng.random_range(90..160) {
            work(&mut robot, &model, twist).unwrap();
        }
        assert_eq!(robot.state(), &SafetyState::Running, "{number} {kind:?}");
        let begin = robot.inner().true_now();
        robot.inner_mut().inner_mut().add(Fault { part, ..Fault::at(kind, begin.as_s()) });
        let (mut begins_s, mut stands_s, mut cause, mut works) = (None, None, None, true);
        while since(&robot, begin) < 2.4 {
            works = works && work(&mut robot, &model, twist).is_ok();
            if !works {
                wait(&mut robot);
            }
            if begins_s.is_none() && robot.state() != &SafetyState::Running {
                (begins_s, cause) = (Some(since(&robot, begin)), robot.state().find_cause().cloned());
            }
            if stands_s.is_none() && speed(&robot) < 0.03 {
                stands_s = Some(since(&robot, begin));
            }
        }
        let what = format!("{number} {kind:?}: begins {begins_s:?}, stands {stands_s:?}, {cause:?}");
        assert!(begins_s.expect(&what) <= within_s && expected(&cause.expect(&what)), "{what}");
        // What may settle goes on; wheels and mass take a little longer than the command.
        if kind != FaultKind::LocalisationJump {
            let may_take_s = twist.forward_m_per_s / model.settings.base.max_acceleration_m_per_s2 + 0.2;
            assert!(stands_s.expect(&what) <= begins_s.unwrap() + may_take_s, "{what}");
        }
        assert_eq!(find_violation(robot.inner().tape(), &model), None, "{what}");
        if kind == FaultKind::Estop {
            // It stopped itself, and begins anew from rest.
            robot.inner_mut().rewind();
        }
        robot.inner_mut().inner_mut().clear();
        wait(&mut robot);
        robot.emergency_stop().reset().unwrap();
        let settled = robot.clock().now() + Span::from_s(0.3);
        while robot.clock().now() < settled {
            work(&mut robot, &model, Twist::default()).unwrap();
        }
    }
}
