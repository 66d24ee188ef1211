//! Contract: whatever breaks, everything brakes together at once (a lost sense: after its watchdog), stands within speed
//! over acceleration after that, says the right reason, and no command beyond the limits ever leaves the envelope.
//!
//! Each fault strikes a robot that drives, turns its head and moves its arm, at a moment and with figures that a seed
//! draws. `DSM_FAULTS` sets their number.

mod kinematic;
mod recorder;

use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{DriverError, Robot, Twist};
use dsm_robot::faults::{Fault, FaultKind, FaultPart, Faulty};
use dsm_robot::joints::JointVelocities;
use dsm_robot::model::{Group, RobotModel};
use dsm_robot::safety::{Cause, Envelope, PERIOD, Part, Release, Safety, SafetyState, StopSwitch};
use kinematic::{Kinematic, porter};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recorder::{Recorder, find_violation};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Braking begins so soon after the fault, or after the watchdog of a sense that is lost.
const BEGINS_WITHIN_S: f64 = 0.1;
/// A sense that is silent is missed after this.
const WATCHDOG_S: f64 = 0.5;
/// Longest time between two images.
const FRAME_S: f64 = 0.2;

type Wrapped = Envelope<Recorder<Faulty<Kinematic>>>;

/// What happens to the robot.
#[derive(Clone, Debug)]
enum Strike {
    /// It breaks.
    Robot(Fault),
    /// A program triggers the emergency stop.
    Trigger,
    /// Somebody presses a switch.
    Switch,
    /// Commands are far beyond the limits, and change at random.
    WildCommands,
    /// A command is not finite.
    CommandNan,
    /// Commands cease.
    Hangs,
}

/// What the envelope is to do about it.
#[derive(Clone, Copy, Debug)]
enum Answer {
    /// Braking begins within so many seconds, and the state says a cause of this kind.
    Stop { within_s: f64, cause: fn(&Cause) -> bool, release: Release },
    /// The parts that hear nothing brake; the state stays.
    Silence,
    /// Nothing: it is harmless.
    GoOn,
}

fn answer_to(strike: &Strike) -> Answer {
    let stop = |within_s: f64, cause: fn(&Cause) -> bool| Answer::Stop {
        within_s: within_s + BEGINS_WITHIN_S,
        cause,
        release: Release::Reset,
    };
    let hold = |within_s: f64, cause: fn(&Cause) -> bool| Answer::Stop {
        within_s: within_s + BEGINS_WITHIN_S,
        cause,
        release: Release::Cleared,
    };
    let Strike::Robot(fault) = strike else {
        return match strike {
            Strike::Trigger => stop(0.0, |cause| *cause == Cause::EmergencyStop { reason: "a program".into() }),
            Strike::Switch => stop(0.0, |cause| *cause == Cause::EmergencyStop { reason: "a key".into() }),
            Strike::Hangs => Answer::Silence,
            _ => Answer::GoOn,
        };
    };
    match fault.kind {
        FaultKind::JointsNan => stop(0.0, |cause| matches!(cause, Cause::NotFinite { part: Part::Arm | Part::Head })),
        FaultKind::JointsSwapped => {
            stop(0.0, |cause| matches!(cause, Cause::WrongJoints { part: Part::Arm | Part::Head }))
        }
        FaultKind::JointsJump => {
            stop(0.0, |cause| matches!(cause, Cause::MeasurementJump { part: Part::Arm | Part::Head }))
        }
        FaultKind::SensorFrozen => hold(WATCHDOG_S, |cause| matches!(cause, Cause::Silent { .. })),
        FaultKind::SensorStuck => stop(WATCHDOG_S, |cause| matches!(cause, Cause::Stuck { .. })),
        // A camera fails when it is read.
        FaultKind::PartLost => stop(0.0, |cause| matches!(cause, Cause::PartFailed { .. })),
        FaultKind::WorldKilled => stop(0.0, |cause| matches!(cause, Cause::PartFailed { .. })),
        FaultKind::ClockJump => stop(0.0, |cause| matches!(cause, Cause::TimeJump { .. })),
        FaultKind::FramesLate | FaultKind::FramesLost => {
            hold(WATCHDOG_S, |cause| matches!(cause, Cause::Silent { part: Part::Camera }))
        }
        FaultKind::FramesDuplicated => Answer::GoOn,
        FaultKind::LocalisationJump => hold(0.0, |cause| matches!(cause, Cause::LocalisationJump { .. })),
        FaultKind::Estop => {
            stop(0.0, |cause| *cause == Cause::EmergencyStop { reason: "the stop button is pressed".into() })
        }
    }
}

/// All that may happen, in turn.
fn draw(number: u64, at_s: f64, rng: &mut ChaCha8Rng) -> Strike {
    let mut all: Vec<Strike> =
        vec![Strike::Trigger, Strike::Switch, Strike::WildCommands, Strike::CommandNan, Strike::Hangs];
    for kind in FaultKind::ALL {
        let of_kind = |part| Strike::Robot(Fault { part, ..Fault::at(kind, at_s) });
        match kind.parts() {
            [] => all.push(of_kind(None)),
            parts => all.extend(parts.iter().map(|part| of_kind(Some(*part)))),
        }
    }
    let count = all.len() as u64;
    let mut strike = all.swap_remove((number % count) as usize);
    if let Strike::Robot(fault) = &mut strike {
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        match fault.kind {
            FaultKind::ClockJump => fault.by_s = sign * rng.random_range(0.3..100.0),
            FaultKind::FramesLate => fault.by_s = rng.random_range(1.5..5.0),
            _ => fault.by_m = rng.random_range(0.1..2.0),
        }
    }
    strike
}

/// What a task commands: all parts swing, so that none comes to an end of its way.
struct Commander {
    speeds: Vec<f64>,
    phases: Vec<f64>,
}

impl Commander {
    fn new(rng: &mut ChaCha8Rng, model: &RobotModel) -> Self {
        let count = 2 + model.arm.len() + model.head.len();
        let mut draw = |low: f64, high: f64| (0..count).map(|_| rng.random_range(low..high)).collect::<Vec<f64>>();
        Self { speeds: draw(0.5, 1.0), phases: draw(0.0, std::f64::consts::TAU) }
    }

    fn value(&self, k: usize, now_s: f64) -> f64 {
        self.speeds[k] * (2.5 * now_s + self.phases[k]).sin()
    }

    fn twist(&self, now_s: f64) -> Twist {
        Twist { forward_m_per_s: 0.4 + 0.2 * self.value(0, now_s), turn_rad_per_s: 0.6 * self.value(1, now_s) }
    }

    fn joints(&self, group: &Group, first: usize, now_s: f64) -> JointVelocities {
        let mut velocities = JointVelocities::zeros(&group.joints);
        for (k, value) in velocities.values_mut().iter_mut().enumerate() {
            *value = 0.3 * self.value(first + k, now_s) * group.limits[k].velocity;
        }
        velocities
    }
}

/// The longest time that any part needs to stand, from what was sent to it last.
fn braking_s(robot: &Wrapped, model: &RobotModel) -> f64 {
    let tape = robot.inner().tape();
    let base = &model.settings.base;
    let twist = tape.base.last().map_or(Twist::default(), |(_, twist)| *twist);
    let of_base = (twist.forward_m_per_s.abs() / base.max_acceleration_m_per_s2)
        .max(twist.turn_rad_per_s.abs() / base.max_turn_acceleration_rad_per_s2);
    let of_group = |commands: &[(Stamp, Vec<f64>)], group: &Group| {
        let Some((_, velocities)) = commands.last() else { return 0.0 };
        velocities.iter().zip(&group.max_accelerations).map(|(v, a)| v.abs() / a).fold(0.0, f64::max)
    };
    of_base.max(of_group(&tape.arm, &model.arm)).max(of_group(&tape.head, &model.head))
}

/// What came of a fault.
struct Outcome {
    begins_s: Option<f64>,
    stands_s: Option<f64>,
    /// What v / a allows, from the moment of braking.
    may_take_s: f64,
    cause: Option<Cause>,
}

/// One control period of a task that reads all its senses; the first error ends it.
fn tick(
    robot: &mut Wrapped,
    commander: &Commander,
    strike: Option<&Strike>,
    model: &RobotModel,
) -> Result<(), DriverError> {
    let now_s = robot.inner().true_now().as_s();
    let (mut twist, mut arm) = (commander.twist(now_s), commander.joints(&model.arm, 2, now_s));
    match strike {
        Some(Strike::WildCommands) => {
            let sign = if (now_s * 50.0) as i64 % 2 == 0 { 20.0 } else { -20.0 };
            twist = Twist { forward_m_per_s: sign, turn_rad_per_s: -sign };
            arm.values_mut().iter_mut().for_each(|value| *value = -sign);
            robot.gripper().command(sign, sign * 100.0)?;
        }
        Some(Strike::CommandNan) => {
            let broken = Twist { forward_m_per_s: f64::NAN, ..twist };
            assert!(matches!(robot.base().command(broken), Err(DriverError::NotFinite { .. })));
        }
        _ => {}
    }
    robot.base().command(twist)?;
    robot.arm().command(&arm)?;
    let head = commander.joints(&model.head, 2 + model.arm.len(), now_s);
    robot.head().command(&head)?;
    let next = robot.clock().now() + PERIOD;
    robot.clock().wait_until(next)?;
    robot.cameras().read("head")?;
    robot.arm().state()?;
    Ok(())
}

/// Strikes a robot at work, and follows what it does. The world goes on whatever becomes of the robot's clock.
fn strike_once(number: u64, model: &Arc<RobotModel>) -> (Strike, Outcome, Wrapped) {
    let mut rng = ChaCha8Rng::seed_from_u64(number);
    let at_s = f64::from(rng.random_range(120u32..300)) * 0.01;
    let strike = draw(number, at_s, &mut rng);
    let commander = Commander::new(&mut rng, model);
    let switch = StopSwitch::default();
    let faulty = Faulty::new(Kinematic::new(model), Vec::new(), number);
    let recorder = Recorder::new(faulty, |robot| robot.inner().now());
    let mut robot = Envelope::new(recorder, model).with_stop_switch(switch.clone());
    while robot.inner().true_now().as_s() < at_s - 1e-9 {
        tick(&mut robot, &commander, None, model).expect("nothing is wrong yet");
    }
    assert_eq!(robot.state(), &SafetyState::Running, "{strike:?}");
    let begin_s = robot.inner().true_now().as_s();
    match &strike {
        Strike::Robot(fault) => {
            let fault = Fault { at_s: begin_s, ..fault.clone() };
            robot.inner_mut().inner_mut().add(fault);
        }
        Strike::Trigger => robot.emergency_stop().trigger("a program").expect("triggers"),
        Strike::Switch => switch.press("a key"),
        _ => {}
    }
    let mut outcome = Outcome { begins_s: None, stands_s: None, may_take_s: 0.0, cause: None };
    let mut works = true;
    while robot.inner().true_now().as_s() < begin_s + 2.5 {
        let now_s = robot.inner().true_now().as_s() - begin_s;
        if outcome.begins_s.is_none() && robot.state() != &SafetyState::Running {
            outcome.begins_s = Some(now_s);
            outcome.may_take_s = braking_s(&robot, model);
            outcome.cause = robot.state().find_cause().cloned();
        }
        if outcome.stands_s.is_none() && robot.inner().inner().inner().is_still() && now_s > 0.0 {
            outcome.stands_s = Some(now_s);
        }
        let hangs = matches!(strike, Strike::Hangs);
        if works && !hangs {
            works = tick(&mut robot, &commander, Some(&strike), model).is_ok();
        }
        if (!works || hangs) && robot.inner().true_now().as_s() < begin_s + now_s + 0.005 {
            // A task that was refused lets time pass; where no time passes for it any more, the world goes on alone.
            let next = robot.clock().now() + PERIOD;
            if robot.clock().wait_until(next).is_err() {
                robot.inner_mut().inner_mut().inner_mut().pass(PERIOD);
            }
        }
    }
    (strike, outcome, robot)
}

fn check(number: u64, model: &Arc<RobotModel>) -> String {
    let (strike, outcome, robot) = strike_once(number, model);
    let Outcome { begins_s, stands_s, may_take_s, cause } = outcome;
    let what = format!("fault {number} {strike:?}: begins {begins_s:?}, stands {stands_s:?}, {cause:?}");
    assert_eq!(find_violation(robot.inner().tape(), model), None, "{what}");
    let answer = answer_to(&strike);
    match answer {
        Answer::Stop { within_s, cause: expected, release } => {
            let is_camera = matches!(&strike, Strike::Robot(fault) if fault.part == Some(FaultPart::Camera));
            // What nobody reads cannot be missed before it is due.
            let within_s = within_s + if is_camera { FRAME_S } else { 0.0 };
            let begins_s = begins_s.expect(&what);
            assert!(begins_s <= within_s, "{what}");
            let cause = cause.expect(&what);
            assert!(expected(&cause) && cause.release() == release, "{what}");
            // Parts whose connection is lost stop by their own watchdog.
            let alone =
                matches!(&strike, Strike::Robot(f) if matches!(f.kind, FaultKind::WorldKilled | FaultKind::PartLost));
            let watchdog_s = if alone { WATCHDOG_S } else { 0.0 };
            let jumped = matches!(&strike, Strike::Robot(f) if f.kind == FaultKind::LocalisationJump);
            if jumped {
                // It settles while it brakes, and goes on.
                assert!(robot.state() == &SafetyState::Running && robot.report().holds == 1, "{what}");
            } else {
                let stands_s = stands_s.expect(&what);
                assert!(stands_s <= begins_s + watchdog_s + may_take_s + 3.0 * PERIOD.as_s(), "{what}, {may_take_s}");
                let latched = robot.state().find_latched().is_some();
                assert_eq!(latched, release == Release::Reset, "{what}");
            }
        }
        Answer::Silence => {
            // The command watchdog, and the fastest that the commander drives.
            assert!(stands_s.is_some_and(|stands_s| stands_s < 0.1 + 0.6 / 0.8 + 0.05), "{what}");
            assert!(robot.state().find_latched().is_none() && robot.report().timeouts > 0, "{what}");
        }
        Answer::GoOn => assert!(begins_s.is_none() && robot.report().stops == 0, "{what}"),
    }
    match strike {
        Strike::Robot(fault) => format!("{:?}", fault.kind),
        other => format!("{other:?}"),
    }
}

#[test]
fn whatever_breaks_everything_stops_in_time_for_the_right_reason() {
    let count: u64 = std::env::var("DSM_FAULTS").ok().and_then(|text| text.parse().ok()).unwrap_or(300);
    let model = porter();
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for number in 0..count {
        *counts.entry(check(number, &model)).or_default() += 1;
    }
    if count >= 300 {
        assert_eq!(counts.len(), FaultKind::ALL.len() + 5, "every kind struck: {counts:?}");
    }
}

#[test]
fn a_robot_without_faults_behaves_as_the_robot_inside() {
    let model = porter();
    let drive = |robot: &mut dyn Robot| {
        let mut trace = Vec::new();
        for tick in 0..150 {
            let twist = Twist { forward_m_per_s: 0.3, turn_rad_per_s: 0.002 * f64::from(tick) };
            trace.push(robot.base().command(twist).expect("accepted"));
            let next = robot.clock().now() + Span(10_000_000);
            robot.clock().wait_until(next).expect("runs");
            robot.cameras().read("head").expect("a camera");
        }
        (trace, robot.localisation().world_from_base().expect("a pose"), robot.arm().state().expect("a state"))
    };
    let plain = drive(&mut Kinematic::new(&model));
    assert_eq!(drive(&mut Faulty::new(Kinematic::new(&model), Vec::new(), 1)), plain);
}
