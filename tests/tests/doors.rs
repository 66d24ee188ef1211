//! Contract: a robot that is to go to what stands behind a closed door opens the door, by its handle where it opens towards the
//! robot and by a push where it opens away, presses nothing with more than 60 N, and drives through.

#![allow(clippy::unwrap_used, reason = "a test that cannot prepare its run fails")]

use scenarios::{episode_of, run};

fn passes(episode: &str) {
    let folder = tempfile::tempdir().unwrap();
    let spec = episode_of("two_rooms", episode, 1).unwrap();
    let summary = run(&spec, &folder.path().join("map.dsm")).unwrap().summary;
    assert!(summary.success, "{:?} {:?}", summary.failure, summary.expectations);
    assert_eq!((summary.metrics.collisions, summary.metrics.limit_violations), (0, 0));
}

#[test]
fn a_door_that_opens_towards_the_robot_is_pulled() {
    passes("pull_door");
}

#[test]
fn a_door_that_opens_away_is_pushed() {
    passes("push_door");
}
