//! Contract: a robot that breaks in the middle of an episode stands, and the episode ends in stage `safety` with the
//! words of what broke; a sense that comes back lets the task go on.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use dsm_robot::faults::{Fault, FaultKind, FaultPart};
use dsm_tasks::summary::{Stage, Summary};
use scenarios::{apartment, run};

fn broken(faults: Vec<Fault>, time_limit_s: f64) -> Summary {
    let folder = tempfile::tempdir().unwrap();
    let mut spec = apartment("fetch_apple", 1).unwrap();
    (spec.episode.faults, spec.time_limit_s) = (faults, time_limit_s);
    run(&spec, &folder.path().join("map.dsm")).unwrap().summary
}

#[test]
fn what_breaks_for_good_ends_the_episode_for_the_right_reason() {
    let cases = [
        (Fault::at(FaultKind::Estop, 3.0), "the stop button is pressed"),
        (Fault::at(FaultKind::JointsNan, 3.0), "a measured value of the arm is not finite"),
        (Fault::at(FaultKind::WorldKilled, 3.0), "the world is dead"),
    ];
    for (fault, words) in cases {
        let summary = broken(vec![fault], 30.0);
        let failure = summary.failure.unwrap();
        assert!(failure.stage == Stage::Safety && failure.reason.contains(words), "{failure:?}");
        assert!(summary.metrics.sim_time_s < 6.0, "{}", summary.metrics.sim_time_s);
    }
}

#[test]
fn a_robot_that_never_sees_says_so_instead_of_calling_things_absent() {
    let failure = broken(vec![Fault::at(FaultKind::FramesLost, 0.0)], 120.0).failure.unwrap();
    assert!(failure.stage == Stage::Safety && failure.reason.contains("camera"), "{failure:?}");
}

#[test]
fn senses_that_come_back_hold_the_task_up_and_no_more() {
    let lost = Fault { for_s: Some(2.0), ..Fault::at(FaultKind::FramesLost, 9.0) };
    let part = Some(FaultPart::Localisation);
    let frozen = Fault { part, for_s: Some(2.0), ..Fault::at(FaultKind::SensorFrozen, 14.0) };
    let jump = Fault { for_s: Some(4.0), ..Fault::at(FaultKind::LocalisationJump, 20.0) };
    let summary = broken(vec![lost, frozen, jump], 240.0);
    assert!(summary.success, "{:?}", summary.failure);
    assert_eq!((summary.metrics.collisions, summary.metrics.limit_violations), (0, 0));
}
