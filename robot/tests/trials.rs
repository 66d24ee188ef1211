//! Contract of [`dsm_robot::conformance`]: a driver that keeps the contract passes every trial, with and without the
//! envelope; each way of breaking it fails the trial that is about it.

mod kinematic;

use dsm::frame::{FrameId, RgbdFrame};
use dsm_robot::conformance::{Report, Scope, check};
use dsm_robot::drivers::Robot;
use dsm_robot::faults::{Fault, FaultKind, FaultPart, Faulty};
use dsm_robot::recorded::{Period, PeriodSource, RecordSink, Recording, Replayed};
use dsm_robot::safety::Envelope;
use kinematic::{Forgets, Kinematic, porter};
use std::sync::mpsc::{Receiver, Sender, channel};

fn world() -> Kinematic {
    let model = porter();
    let mut world = Kinematic::new(&model);
    let camera = &model.settings.camera[0];
    world.cameras.size = (camera.width, camera.height);
    world
}

/// What of the moving trials fails.
fn failures(robot: &mut dyn Robot) -> Vec<&'static str> {
    let report: Report = check(robot, &porter(), Scope::Moving);
    assert_eq!(report.passed, report.findings.iter().all(|finding| finding.passed));
    report.findings.iter().filter(|finding| !finding.passed).map(|finding| finding.behaviour).collect()
}

#[track_caller]
fn assert_fails(robot: &mut dyn Robot, words: &str) {
    let failed = failures(robot);
    assert!(failed.iter().any(|behaviour| behaviour.contains(words)), "{words}: {failed:?}");
}

#[test]
fn a_good_driver_passes_bare_and_within_the_envelope() {
    assert_eq!(failures(&mut world()), Vec::<&str>::new());
    assert_eq!(failures(&mut Envelope::new(world(), &porter())), Vec::<&str>::new());
    let standing = check(&mut world(), &porter(), Scope::ReadingOnly);
    assert!(standing.passed && standing.findings.len() == 6);
}

/// Keeps a recording in memory.
struct Keeper(Sender<(Vec<RgbdFrame>, Period)>, Vec<RgbdFrame>);

impl RecordSink for Keeper {
    fn frame(&mut self, frame: &RgbdFrame) {
        self.1.push(frame.clone());
    }
    fn period(&mut self, period: Period) {
        self.0.send((std::mem::take(&mut self.1), period)).expect("somebody keeps it");
    }
}

/// Gives it again.
struct Kept(Receiver<(Vec<RgbdFrame>, Period)>, Vec<RgbdFrame>);

impl PeriodSource for Kept {
    fn next_period(&mut self) -> Result<Option<Period>, String> {
        let Ok((frames, period)) = self.0.try_recv() else { return Ok(None) };
        self.1 = frames;
        Ok(Some(period))
    }
    fn take_frame(&mut self, id: FrameId) -> Option<RgbdFrame> {
        let place = self.1.iter().position(|frame| frame.id == id)?;
        Some(self.1.swap_remove(place))
    }
}

#[test]
fn a_replayed_robot_behaves_as_the_recorded_one_bare_and_within_the_envelope() {
    fn both<W: Robot, P: Robot>(
        robot: Kinematic,
        live: impl FnOnce(Recording<Kinematic>) -> W,
        again: impl FnOnce(Replayed) -> P,
    ) -> Report {
        let (keep, kept) = channel();
        let mut live = live(Recording::new(robot, &porter(), Box::new(Keeper(keep, Vec::new()))));
        let then = check(&mut live, &porter(), Scope::Moving);
        drop(live);
        let (ended, ends) = channel();
        let mut again = again(Replayed::new(&porter(), Box::new(Kept(kept, Vec::new())), ended));
        assert_eq!(check(&mut again, &porter(), Scope::Moving), then);
        assert_eq!(ends.try_recv().ok(), None, "all was asked as then");
        then
    }
    let bare = both(world(), |robot| robot, |robot| robot);
    let held = both(world(), |robot| Envelope::new(robot, &porter()), |robot| Envelope::new(robot, &porter()));
    assert!(bare.passed && held.passed && bare.findings.len() == 18);
    let mut backwards = world();
    backwards.base.gain = [-1.0, 1.0];
    assert!(!both(backwards, |robot| robot, |robot| robot).passed, "a defect is replayed as well");
}

#[test]
fn wrong_signs_units_and_lies_are_found() {
    let mut backwards = world();
    backwards.base.gain = [-1.0, 1.0];
    assert_fails(&mut backwards, "drives forwards");
    let mut right = world();
    right.base.gain = [1.0, -1.0];
    assert_fails(&mut right, "turns left");
    let mut degrees = world();
    degrees.base.gain = [1.0, std::f64::consts::PI / 180.0];
    assert_fails(&mut degrees, "turns left");
    let mut lies = world();
    lies.base.says = 2.0;
    assert_fails(&mut lies, "drives forwards");
    let mut arm = world();
    arm.arm.gain = -1.0;
    assert_fails(&mut arm, "joint of the arm");
    let mut head = world();
    head.head.gain = 0.5;
    assert_fails(&mut head, "joint of the head");
}

#[test]
fn drivers_that_forget_are_found() {
    let forgetting = |forgets: Forgets| {
        let mut world = world();
        world.forgets = forgets;
        world
    };
    let mut deaf = forgetting(Forgets::Watchdog);
    let failed = failures(&mut deaf);
    assert!(failed.contains(&"a base that hears nothing stands after half a second"), "{failed:?}");
    assert!(failed.contains(&"joints that hear nothing stand after half a second"), "{failed:?}");
    assert_fails(&mut forgetting(Forgets::Stop), "emergency stop");
    assert_fails(&mut forgetting(Forgets::Stamps), "stamped");
}

#[test]
fn broken_senses_are_found() {
    let broken = |kind: FaultKind, part: Option<FaultPart>| {
        Faulty::new(world(), vec![Fault { part, ..Fault::at(kind, 0.0) }], 1)
    };
    assert_fails(&mut broken(FaultKind::JointsSwapped, Some(FaultPart::Arm)), "name the model's joints");
    assert_fails(&mut broken(FaultKind::JointsNan, Some(FaultPart::Head)), "name the model's joints");
    assert_fails(&mut broken(FaultKind::FramesLost, None), "cameras give each image once");
    assert_fails(&mut broken(FaultKind::FramesDuplicated, None), "cameras give each image once");
    assert_fails(&mut broken(FaultKind::FramesLate, None), "cameras give each image once");
    assert_fails(&mut broken(FaultKind::PartLost, Some(FaultPart::Gripper)), "gripper");
    assert_fails(&mut broken(FaultKind::WorldKilled, None), "time pass that was asked for");
}
