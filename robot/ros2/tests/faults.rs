//! Contract: what breaks at the other end of the wire stops the robot as what breaks at this end does: braking begins as
//! soon, for the right reason, and the world stands when speed over acceleration is over. See `robot/tests/faults.rs`.
//!
//! A message tells less than a driver: a part that does not answer is one that falls silent; joints that change places are
//! found by their names and do no harm.
//!
//! `DSM_WIRE_FAULTS` sets the number of faults, 25 by default: each kind and part once.

#![allow(clippy::unwrap_used, reason = "a test")]

#[path = "../../tests/kinematic/mod.rs"]
#[allow(unreachable_pub, reason = "shared with the tests of drivers")]
mod kinematic;

use dsm::frame::RgbdFrame;
use dsm::perceive::{Detections, Detector};
use dsm::time::Stamp;
use dsm_robot::drivers::{DriverError, Robot, Twist};
use dsm_robot::faults::{Fault, FaultKind, FaultPart, Faulty};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Group, RobotModel};
use dsm_robot::safety::{Cause, Envelope, PERIOD, Part, Safety, SafetyState};
use dsm_ros2::client::{Ros2Robot, connect};
use dsm_ros2::error::Ros2Error;
use dsm_ros2::server::{Host, Server, Weather};
use dsm_ros2::settings::{ClockSource, Ros2Settings};
use kinematic::Kinematic;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Braking begins so soon after the fault, or after the watchdog of a sense that is lost.
const BEGINS_WITHIN_S: f64 = 0.1;
/// A sense that is silent is missed after this.
const WATCHDOG_S: f64 = 0.5;
/// Longest time between two images.
const FRAME_S: f64 = 0.2;
/// Domains that these tests use in turn, so that nobody meets whoever was there before.
const DOMAINS: std::ops::Range<u16> = 100..200;

struct Blind;

impl Detector for Blind {
    fn detect(&mut self, frame: &RgbdFrame) -> Detections {
        Detections { frame: frame.id, items: Vec::new() }
    }
}

struct UntilOver(Arc<AtomicBool>);

impl Host for UntilOver {
    fn goes_on(&mut self, _: Stamp, _: Option<Duration>) -> bool {
        !self.0.load(Ordering::Relaxed)
    }
}

fn settings(domain: u16) -> Ros2Settings {
    let camera_pose = "/camera/NAME/pose".into();
    Ros2Settings { domain, clock: ClockSource::LockStep, camera_pose, timeout_s: 5.0, ..Ros2Settings::default() }
}

/// Every kind with every part, in turn, with figures that the seed draws.
fn draw(number: u64, at_s: f64, rng: &mut ChaCha8Rng) -> Fault {
    let mut all = Vec::new();
    for kind in FaultKind::ALL {
        match kind.parts() {
            [] => all.push((kind, None)),
            parts => all.extend(parts.iter().map(|part| (kind, Some(*part)))),
        }
    }
    let (kind, part) = all[(number % all.len() as u64) as usize];
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let by_s = match kind {
        FaultKind::ClockJump => sign * rng.random_range(0.3..100.0),
        _ => rng.random_range(1.5..5.0),
    };
    Fault { part, by_s, by_m: rng.random_range(0.1..2.0), ..Fault::at(kind, at_s) }
}

/// Whether a cause is the right one.
type Fits = fn(&Cause) -> bool;

/// When braking begins at the latest, and why; `None` for what does no harm.
fn answer_to(fault: &Fault) -> Option<(f64, Fits)> {
    let camera_s = if fault.part == Some(FaultPart::Camera) { FRAME_S } else { 0.0 };
    let (watchdog_s, cause): (f64, Fits) = match fault.kind {
        FaultKind::JointsNan => (0.0, |cause| matches!(cause, Cause::NotFinite { part: Part::Arm | Part::Head })),
        FaultKind::JointsJump => {
            (0.0, |cause| matches!(cause, Cause::MeasurementJump { part: Part::Arm | Part::Head }))
        }
        FaultKind::SensorFrozen => (WATCHDOG_S, |cause| matches!(cause, Cause::Silent { .. })),
        FaultKind::SensorStuck => (WATCHDOG_S, |cause| matches!(cause, Cause::Stuck { .. })),
        FaultKind::PartLost => (WATCHDOG_S, |cause| matches!(cause, Cause::Silent { .. } | Cause::PartFailed { .. })),
        FaultKind::WorldKilled => (0.0, |cause| matches!(cause, Cause::PartFailed { .. })),
        FaultKind::ClockJump => (0.0, |cause| matches!(cause, Cause::TimeJump { .. })),
        FaultKind::FramesLate | FaultKind::FramesLost => {
            (WATCHDOG_S + FRAME_S, |cause| matches!(cause, Cause::Silent { part: Part::Camera }))
        }
        FaultKind::LocalisationJump => (0.0, |cause| matches!(cause, Cause::LocalisationJump { .. })),
        FaultKind::Estop => {
            (0.0, |cause| *cause == Cause::EmergencyStop { reason: "the stop button is pressed".into() })
        }
        FaultKind::FramesDuplicated | FaultKind::JointsSwapped => return None,
    };
    Some((watchdog_s + camera_s + BEGINS_WITHIN_S, cause))
}

fn swing(now_s: f64, phase: f64) -> f64 {
    (2.5 * now_s + phase).sin()
}

fn joints(group: &Group, now_s: f64) -> JointVelocities {
    let mut velocities = JointVelocities::zeros(&group.joints);
    for (k, value) in velocities.values_mut().iter_mut().enumerate() {
        *value = 0.25 * swing(now_s, k as f64) * group.limits[k].velocity;
    }
    velocities
}

/// How long the slowest part takes to stand at these commands.
fn braking_s(model: &RobotModel) -> f64 {
    let of_group = |group: &Group| {
        let times = group.limits.iter().zip(&group.max_accelerations).map(|(limit, a)| 0.25 * limit.velocity / a);
        times.fold(0.0, f64::max)
    };
    let base = &model.settings.base;
    let of_base = (0.6 / base.max_acceleration_m_per_s2).max(0.6 / base.max_turn_acceleration_rad_per_s2);
    of_base.max(of_group(&model.arm)).max(of_group(&model.head))
}

/// One control period of a task that reads its senses.
fn tick(robot: &mut Envelope<Ros2Robot>, now_s: f64, model: &RobotModel) -> Result<(), DriverError> {
    let twist = Twist { forward_m_per_s: 0.4 + 0.2 * swing(now_s, 0.3), turn_rad_per_s: 0.6 * swing(now_s, 1.0) };
    robot.base().command(twist)?;
    robot.arm().command(&joints(&model.arm, now_s))?;
    robot.head().command(&joints(&model.head, now_s))?;
    let next = robot.clock().now() + PERIOD;
    robot.clock().wait_until(next)?;
    robot.cameras().read("head")?;
    robot.arm().state()?;
    Ok(())
}

/// Strikes a robot at work at the other end of the wire.
fn strike(number: u64, model: &Arc<RobotModel>) -> Result<(), Ros2Error> {
    let mut rng = ChaCha8Rng::seed_from_u64(number);
    let at_s = f64::from(rng.random_range(120u32..300)) * 0.01;
    let fault = draw(number, at_s, &mut rng);
    let domain = DOMAINS.start + (number % u64::from(DOMAINS.end - DOMAINS.start)) as u16;
    let over = Arc::new(AtomicBool::new(false));
    let (served, until, breaks) = (model.clone(), UntilOver(over.clone()), fault.clone());
    let alone = matches!(fault.kind, FaultKind::WorldKilled | FaultKind::PartLost);
    let world = std::thread::spawn(move || {
        let mut kinematic = Kinematic::new(&served);
        let camera = &served.settings.camera[0];
        kinematic.cameras.size = (camera.width, camera.height);
        let mut robot = Faulty::new(kinematic, vec![breaks], number);
        let mut until = until;
        let mut server = Server::start(served, settings(domain), Weather::default()).unwrap();
        server.serve_steps(&mut robot, &mut Blind, &mut until).unwrap();
        if alone {
            // Parts whose connection is lost stop by their own watchdog, while the world goes on.
            (0..100).for_each(|_| robot.inner_mut().pass(PERIOD));
        }
        robot.inner().is_still()
    });
    let connection = connect(model.clone(), settings(domain)).inspect_err(|_| over.store(true, Ordering::Relaxed))?;
    let mut robot = Envelope::new(connection.robot, model);
    let (mut begins_s, mut cause) = (None, None);
    // The robot's own clock may break: periods are counted.
    let mut periods = 0;
    while periods < 600 {
        let now_s = f64::from(periods) * PERIOD.as_s();
        if begins_s.is_none() && robot.state() != &SafetyState::Running {
            (begins_s, cause) = (Some(now_s - at_s), robot.state().find_cause().cloned());
        }
        if begins_s.is_some_and(|begins_s| now_s > at_s + begins_s + braking_s(model) + 3.0 * PERIOD.as_s()) {
            break;
        }
        if tick(&mut robot, now_s, model).is_err() {
            // A task that was refused lets time pass, if it passes.
            let next = robot.clock().now() + PERIOD;
            if robot.clock().wait_until(next).is_err() && begins_s.is_some() {
                break;
            }
        }
        periods += 1;
    }
    over.store(true, Ordering::Relaxed);
    let is_still = world.join().unwrap();
    let what = format!("fault {number} {fault:?}: begins {begins_s:?}, {cause:?}");
    match answer_to(&fault) {
        Some((within_s, expected)) => {
            assert!(begins_s.is_some_and(|begins_s| begins_s <= within_s), "{what}");
            assert!(cause.as_ref().is_some_and(expected), "{what}");
            // A pose that jumped settles while the robot brakes, and it goes on.
            assert!(is_still || fault.kind == FaultKind::LocalisationJump, "{what}: it does not stand");
        }
        None => assert!(begins_s.is_none(), "{what}"),
    }
    Ok(())
}

#[test]
fn whatever_breaks_at_the_other_end_stops_the_robot() {
    let count: u64 = std::env::var("DSM_WIRE_FAULTS").ok().and_then(|text| text.parse().ok()).unwrap_or(25);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/porter");
    let model = Arc::new(RobotModel::load(&folder).unwrap());
    for number in 0..count {
        if let Err(error) = strike(number, &model) {
            #[allow(clippy::print_stderr, reason = "who runs the tests is told")]
            {
                eprintln!("skipped: {error}")
            };
            if let Some(log) = std::env::var_os("DSM_SKIP_LOG") {
                use std::io::Write;
                let mut log = std::fs::OpenOptions::new().append(true).create(true).open(log).unwrap();
                writeln!(log, "dsm-ros2 faults: {error}").unwrap();
            }
            assert_eq!(number, 0, "the network goes away: {error}");
            return;
        }
    }
}
