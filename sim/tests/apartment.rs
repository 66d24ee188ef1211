//! Contract: the flat that ships is sound, every seed draws a world in which nothing falls, and a world hands out frames,
//! detections and truth that fit each other.

use dsm::perceive::Detector;
use dsm::time::Stamp;
use dsm_robot::drivers::Robot;
use dsm_robot::model::RobotModel;
use dsm_sim::scene::{BodyMotion, RobotSize, SceneModel, Semantics, check_scene, scene_file};
use dsm_sim::world::{LabelIds, Perception, StartPose, World, WorldConfig, WorldError};
use std::path::PathBuf;
use std::sync::Arc;

fn repository(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

fn porter() -> Arc<RobotModel> {
    Arc::new(RobotModel::load(&repository("robot/models/porter")).expect("the robot loads"))
}

fn world(config: WorldConfig) -> World {
    World::load(&repository("scenes/apartment"), porter(), config).expect("the world loads")
}

#[test]
fn the_flat_is_sound() {
    let checked = check_scene(&repository("scenes/apartment"), RobotSize::default()).expect("loads");
    assert!(checked.findings.is_empty(), "{:#?}", checked.findings);
    assert!(checked.bodies >= 60 && checked.categories >= 25 && checked.free_bodies >= 20);
}

#[test]
fn every_body_of_the_flat_has_a_category_and_a_real_size() {
    let folder = repository("scenes/apartment");
    let scene = SceneModel::load(&folder).expect("loads");
    let semantics = Semantics::load(&scene_file(&folder), &scene).expect("loads");
    for body in scene.bodies.iter().skip(1) {
        assert!(semantics.find_object(&body.name).is_some(), "{}", body.name);
        if body.motion == BodyMotion::Free {
            assert!((0.01..=5.0).contains(&body.mass_kg), "{} weighs {} kg", body.name, body.mass_kg);
            let frictions = body.geoms.iter().filter(|geom| geom.collides).map(|geom| geom.friction);
            assert!(frictions.into_iter().all(|f| (0.3..=0.8).contains(&f)), "{}", body.name);
        }
    }
}

#[test]
fn a_world_hands_out_frames_detections_and_truth_that_fit() {
    let parts = world(WorldConfig { seed: 3, perception: Perception::Oracle, ..WorldConfig::default() }).into_parts();
    let (mut robot, mut detector, truth) = (parts.robot, parts.detector, parts.truth);
    assert_eq!(robot.clock().now(), Stamp(0));
    let mut seen = Vec::new();
    for tick in 1..=100 {
        robot.clock().wait_until(Stamp(tick * 10_000_000)).expect("time passes");
        if let Some(frame) = robot.cameras().read("head").expect("there is a head camera") {
            let detections = detector.detect(&frame);
            assert_eq!(detections.frame, frame.id);
            seen.push(detections);
        }
    }
    assert!(seen.len() >= 5 && seen.iter().all(|d| !d.items.is_empty()));
    let samples: Vec<_> = truth.try_iter().collect();
    assert!((19..=22).contains(&samples.len()), "{}", samples.len());
    let last = samples.last().expect("sampled");
    let first = &samples[0];
    assert!(!last.in_view.is_empty() && last.joints.iter().any(|j| j.name == "lift_joint"));
    // The floor does not count: what is near is farther than the gap under the column.
    let clearances: Vec<f64> = samples.iter().filter_map(|sample| sample.clearance_m).collect();
    assert!(clearances.iter().all(|clearance| *clearance > 0.04), "{clearances:?}");
    for (before, after) in first.objects.iter().zip(&last.objects) {
        let moved = (before.world_from_body.translation.vector - after.world_from_body.translation.vector).norm();
        assert!(moved < 0.005, "{} moved {moved} m while nobody touched it", before.body);
    }
    for name in &last.in_view {
        let category = &last.objects.iter().find(|o| o.body == *name).expect("an object").category;
        let named = seen.last().is_some_and(|d| d.items.iter().any(|item| item.name == *category));
        assert!(named, "{name} is in view but no {category} was detected");
    }
}

#[test]
fn the_seed_draws_start_and_placement_and_a_world_repeats() {
    let start = |seed| {
        let parts = world(WorldConfig { seed, ..WorldConfig::default() }).into_parts();
        parts.truth.try_iter().next().expect("a first sample")
    };
    let (first, again, other) = (start(1), start(1), start(2));
    assert_eq!(first, again);
    assert!((first.world_from_base.translation.vector - other.world_from_base.translation.vector).norm() > 0.05);
    let moved =
        first.objects.iter().zip(&other.objects).filter(|(a, b)| {
            (a.world_from_body.translation.vector - b.world_from_body.translation.vector).norm() > 0.005
        });
    assert!(moved.count() > 20);
}

#[test]
fn label_ids_make_no_difference_to_what_is_detected() {
    let detect = |label_ids| {
        let parts = world(WorldConfig { seed: 4, label_ids, ..WorldConfig::default() }).into_parts();
        let (mut robot, mut detector) = (parts.robot, parts.detector);
        robot.clock().wait_until(Stamp(300_000_000)).expect("time passes");
        let frame = robot.cameras().read("head").expect("a camera").expect("a frame");
        (detector.detect(&frame), frame)
    };
    assert_eq!(detect(LabelIds::Stable), detect(LabelIds::PermutedPerFrame));
}

#[test]
fn a_start_inside_furniture_is_refused_with_its_name() {
    let start = Some(StartPose { x_m: 5.05, y_m: 0.0, yaw_rad: 0.0 });
    let error = World::load(&repository("scenes/apartment"), porter(), WorldConfig { start, ..WorldConfig::default() });
    assert!(matches!(error, Err(WorldError::StartBlocked { .. })));
}

#[test]
fn free_floor_is_free_and_walls_are_not() {
    let world = world(WorldConfig::default());
    let truth = world.truth_at_start();
    assert!(truth.rooms.len() >= 4 && world.room_names().len() == truth.rooms.len());
    let free = truth.free_space.known_cells().filter(|(_, state)| *state == dsm::map::CellState::Free).count();
    let occupied = truth.free_space.known_cells().count() - free;
    // 90 square metres in cells of 25 square centimetres.
    assert!((15_000..40_000).contains(&free) && occupied > 4_000, "{free} {occupied}");
}
