//! Contract: a recorded robot is the robot; its replay gives every answer again, bit for bit, and tells the first command
//! that differs, is left out or is one too many, and a part that was not asked then.

use super::*;
use crate::drivers::*;
use crate::joints::{JointNames, JointPositions, JointVelocities};
use crate::model::RobotModel;
use dsm::Pose;
use dsm::camera::CameraModel;
use dsm::frame::{FrameId, RgbdFrame};
use dsm::time::{Span, Stamp};
use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};

const PERIOD: Span = Span(10_000_000);

/// A robot whose answers tell when and how often it was asked.
struct Fake {
    now: Stamp,
    names: JointNames,
    asked: f64,
    reason: Option<String>,
}

impl Fake {
    fn number(&mut self) -> f64 {
        self.asked += 1.0 / 3.0;
        self.asked
    }
}

impl Base for Fake {
    fn command(&mut self, twist: Twist) -> Result<Twist, DriverError> {
        Ok(Twist { turn_rad_per_s: 0.0, ..twist })
    }
    fn velocity(&mut self) -> Result<Twist, DriverError> {
        Ok(Twist { forward_m_per_s: self.number(), turn_rad_per_s: f64::MIN_POSITIVE })
    }
}

impl JointGroup for Fake {
    fn command(&mut self, velocities: &JointVelocities) -> Result<JointVelocities, DriverError> {
        Ok(velocities.clone())
    }
    fn state(&mut self) -> Result<JointState, DriverError> {
        let mut positions = JointPositions::zeros(&self.names);
        positions.values_mut()[0] = self.now.as_s();
        Ok(JointState { stamp: self.now, positions, velocities: JointVelocities::zeros(&self.names) })
    }
}

impl Gripper for Fake {
    fn command(&mut self, _: f64, _: f64) -> Result<(f64, f64), DriverError> {
        Err(DriverError::Lost { part: "gripper".into(), reason: "no cable".into() })
    }
    fn state(&mut self) -> Result<GripperState, DriverError> {
        Ok(GripperState { stamp: self.now, width_m: 0.1, force_n: 0.0, moving: false })
    }
}

impl Cameras for Fake {
    fn names(&self) -> Vec<String> {
        vec!["head".into(), "wrist".into()]
    }
    fn read(&mut self, camera: &str) -> Result<Option<RgbdFrame>, DriverError> {
        let id = FrameId(self.now.0 as u64 / 10_000_000);
        Ok(id.0.is_multiple_of(2).then(|| RgbdFrame {
            id,
            stamp: self.now,
            camera: camera.into(),
            model: CameraModel::from_vertical_fov(1, 1, 1.0),
            world_from_camera: Pose::translation(0.1, 0.2, 0.3),
            color: vec![[1, 2, 3]],
            depth_m: vec![0.123],
        }))
    }
}

impl Localisation for Fake {
    fn world_from_base(&mut self) -> Result<StampedPose, DriverError> {
        Ok(StampedPose { stamp: self.now, pose: Pose::translation(0.1 * self.now.as_s(), 0.0, 0.0) })
    }
    fn odom_from_base(&mut self) -> Result<StampedPose, DriverError> {
        self.world_from_base()
    }
}

impl Clock for Fake {
    fn now(&self) -> Stamp {
        self.now
    }
    fn wait_until(&mut self, stamp: Stamp) -> Result<(), DriverError> {
        self.now = stamp;
        Ok(())
    }
}

impl EmergencyStop for Fake {
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

impl Robot for Fake {
    fn base(&mut self) -> &mut dyn Base {
        self
    }
    fn arm(&mut self) -> &mut dyn JointGroup {
        self
    }
    fn gripper(&mut self) -> &mut dyn Gripper {
        self
    }
    fn head(&mut self) -> &mut dyn JointGroup {
        self
    }
    fn cameras(&mut self) -> &mut dyn Cameras {
        self
    }
    fn localisation(&mut self) -> &mut dyn Localisation {
        self
    }
    fn clock(&mut self) -> &mut dyn Clock {
        self
    }
    fn emergency_stop(&mut self) -> &mut dyn EmergencyStop {
        self
    }
}

#[allow(clippy::large_enum_variant, reason = "a test")]
enum Kept {
    Frame(RgbdFrame),
    Period(Period),
}

struct Keeper(Sender<Kept>);

impl RecordSink for Keeper {
    fn frame(&mut self, frame: &RgbdFrame) {
        self.0.send(Kept::Frame(frame.clone())).unwrap();
    }
    fn period(&mut self, period: Period) {
        self.0.send(Kept::Period(period)).unwrap();
    }
}

struct Kepts {
    periods: VecDeque<Period>,
    frames: BTreeMap<FrameId, RgbdFrame>,
}

impl PeriodSource for Kepts {
    fn next_period(&mut self) -> Result<Option<Period>, String> {
        Ok(self.periods.pop_front())
    }
    fn take_frame(&mut self, id: FrameId) -> Option<RgbdFrame> {
        self.frames.remove(&id)
    }
}

fn porter() -> RobotModel {
    RobotModel::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter")).unwrap()
}

/// What differs from the run that was recorded.
#[derive(Clone, Copy, PartialEq)]
enum Change {
    Nothing,
    OtherSpeed,
    NoHead,
    TwoArms,
    ReadsWrist,
    LongerPeriod,
    ReadsMoreOften,
    GoesOn,
}

/// Four periods in the hands of a program; gives all that it was answered, as text.
fn drive(robot: &mut dyn Robot, model: &RobotModel, change: Change) -> Result<String, DriverError> {
    let mut told = String::new();
    let mut tell = |what: String| told.push_str(&(what + "\n"));
    for tick in 0..if change == Change::GoesOn { 5 } else { 4 } {
        let now = robot.clock().now();
        let changed = tick == 2;
        let forward_m_per_s = if changed && change == Change::OtherSpeed { 0.301 } else { 0.3 };
        let twist = Twist { forward_m_per_s, turn_rad_per_s: 0.1 * now.as_s() };
        let mut arm = JointVelocities::zeros(&model.arm.joints);
        arm.values_mut()[3] = 1.0 / 3.0;
        tell(format!("{:?}", robot.base().command(twist)?));
        for _ in 0..if changed && change == Change::TwoArms { 2 } else { 1 } {
            tell(format!("{:?}", robot.arm().command(&arm)?));
        }
        if !(changed && change == Change::NoHead) {
            tell(format!("{:?}", robot.head().command(&JointVelocities::zeros(&model.head.joints))?));
        }
        tell(format!("{:?}", robot.gripper().command(0.1, 5.0).unwrap_err()));
        tell(format!("{:?} {:?}", robot.base().velocity()?, robot.base().velocity()?));
        tell(format!("{:?} {:?}", robot.arm().state()?, robot.gripper().state()?));
        tell(format!("{:?} {:?}", robot.localisation().world_from_base()?, robot.cameras().read("head")?));
        if changed && change == Change::ReadsWrist {
            robot.cameras().read("wrist")?;
        }
        if changed && change == Change::ReadsMoreOften {
            robot.localisation().world_from_base()?;
            assert_eq!(robot.cameras().read("head")?, None);
        }
        tell(format!("{:?}", robot.emergency_stop().find_reason()));
        let span = if changed && change == Change::LongerPeriod { Span(PERIOD.0 + 1) } else { PERIOD };
        robot.clock().wait_until(now + span)?;
    }
    robot.emergency_stop().trigger("enough")?;
    tell(format!("{:?}", robot.emergency_stop().find_reason()));
    Ok(told)
}

fn record(model: &RobotModel) -> (String, Kepts) {
    let fake = || Fake { now: Stamp(0), names: model.arm.joints.clone(), asked: 0.0, reason: None };
    let (sender, receiver) = channel();
    let mut recording = Recording::new(fake(), model, Box::new(Keeper(sender)));
    let told = drive(&mut recording, model, Change::Nothing).unwrap();
    drop(recording);
    assert_eq!(told, drive(&mut fake(), model, Change::Nothing).unwrap(), "recording changes nothing");
    let mut kepts = Kepts { periods: VecDeque::new(), frames: BTreeMap::new() };
    for kept in receiver.iter() {
        match kept {
            Kept::Frame(frame) => drop(kepts.frames.insert(frame.id, frame)),
            Kept::Period(period) => kepts.periods.push_back(period),
        }
    }
    (told, kepts)
}

fn replay(change: Change) -> (Result<String, DriverError>, Receiver<ReplayEnd>, String) {
    let model = porter();
    let (told, kepts) = record(&model);
    assert_eq!((kepts.periods.len(), kepts.frames.len()), (5, 2));
    let (ends, end) = channel();
    let mut replayed = Replayed::new(&model, Box::new(kepts), ends);
    (drive(&mut replayed, &model, change), end, told)
}

#[test]
fn a_replay_answers_as_the_robot_did() {
    for change in [Change::Nothing, Change::ReadsMoreOften] {
        let (again, end, told) = replay(change);
        assert_eq!(again.unwrap(), told);
        assert!(end.try_recv().is_err());
    }
}

#[test]
fn the_first_difference_is_told_with_its_part_and_its_moment() {
    let at = Stamp(2 * PERIOD.0);
    let cases = [
        (Change::OtherSpeed, "base", "0.3,", "0.301"),
        (Change::NoHead, "head", "0.0", "no further command"),
        (Change::TwoArms, "arm", "no further command", "0.333"),
        (Change::ReadsWrist, "cameras", "`wrist` is not read", "`wrist` is read"),
        (Change::LongerPeriod, "clock", "0.03", "0.03000000"),
    ];
    for (change, part, expected, got) in cases {
        let (again, end, _) = replay(change);
        assert!(matches!(again, Err(DriverError::Lost { .. })));
        let Ok(ReplayEnd::Differs(found)) = end.try_recv() else { panic!("{part} differs") };
        assert_eq!((found.part, found.stamp), (part, at));
        assert!(found.expected.contains(expected) && found.got.contains(got), "{found:?}");
        assert!(end.try_recv().is_err(), "only the first is told");
    }
}

#[test]
fn whoever_goes_on_hears_that_the_recording_is_over() {
    let (again, end, _) = replay(Change::GoesOn);
    assert!(matches!(again, Err(DriverError::Lost { .. })));
    // The recorded program stopped the robot where this one drives on.
    assert!(matches!(end.try_recv(), Ok(ReplayEnd::Differs(Difference { part: "base", .. }))));
}

#[test]
fn answers_are_kept_by_their_number() {
    let mut answers = Answers::default();
    assert_eq!(answers.find(0), None);
    for value in [1, 1, 2] {
        answers.note(Ok(value));
    }
    let found: Vec<_> = (0..5).map(|number| answers.find(number).cloned().unwrap().unwrap()).collect();
    assert_eq!(found, [1, 1, 2, 2, 2]);
}
