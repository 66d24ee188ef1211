//! Contract: each disturbance does to the world, or to the robot's senses, what its kind says, when it is to begin; the same
//! seed does the same again; a world without any is as it was.

use dsm::eval::Truth;
use dsm::time::Stamp;
use dsm_robot::drivers::{Clock, Robot, Twist};
use dsm_robot::model::RobotModel;
use dsm_sim::disturb::{Disturbance, DisturbanceError, DisturbanceKind};
use dsm_sim::world::{StartPose, World, WorldConfig, WorldError, WorldParts};
use std::path::Path;
use std::sync::Arc;

const TEXT: &str = r#"<mujoco><worldbody><geom type="plane" size="0 0 1"/>
    <geom type="box" size=".05 4 1" pos="4 0 1"/><geom type="box" size=".05 4 1" pos="-4 0 1"/>
    <geom type="box" size="4 .05 1" pos="0 4 1"/><geom type="box" size="4 .05 1" pos="0 -4 1"/>
    <body name="table" pos="2.5 2.5 .35"><geom type="box" size=".5 .5 .35"/></body>
    <body name="mug" pos="2.5 2.5 .7505"><freejoint/><geom type="cylinder" size=".04 .05" mass=".3"/></body>
    <body name="can" pos="2.2 2.5 .7605"><freejoint/><geom type="cylinder" size=".03 .06" mass=".3"/></body>
    </worldbody></mujoco>"#;

fn load(disturbances: Vec<Disturbance>) -> Result<WorldParts, WorldError> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("scene.xml"), TEXT).expect("written");
    let semantics = "version = 1\nname = \"room\"\n[[object]]\nbody = \"mug\"\ncategory = \"mug\"\n[[object]]\nbody = \"can\"\ncategory = \"can\"\n";
    std::fs::write(folder.path().join("semantics.toml"), semantics).expect("written");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../robot/models/porter");
    let robot = Arc::new(RobotModel::load(&model).expect("the robot"));
    let start = Some(StartPose { x_m: -1.0, y_m: 0.0, yaw_rad: 0.0 });
    let config = WorldConfig { seed: 3, start, disturbances, ..WorldConfig::default() };
    World::load(folder.path(), robot, config).map(World::into_parts)
}

/// Drives at `forward_m_per_s` until `end_s`; the truth meanwhile.
fn drive(parts: &mut WorldParts, end_s: f64, forward_m_per_s: f64) -> Vec<Truth> {
    let mut samples = Vec::new();
    while parts.robot.now().as_s() < end_s - 1e-9 {
        let twist = Twist { forward_m_per_s, turn_rad_per_s: 0.0 };
        parts.robot.base().command(twist).expect("it drives");
        let next = parts.robot.now() + dsm::time::Span(10_000_000);
        parts.robot.wait_until(next).expect("time passes");
        samples.extend(parts.truth.try_iter());
    }
    samples
}

fn about(kind: DisturbanceKind, at_s: f64) -> Disturbance {
    Disturbance { object: Some("mug".into()), ..Disturbance::at(kind, at_s) }
}

fn place(truth: &Truth, body: &str) -> nalgebra::Vector3<f64> {
    truth.objects.iter().find(|o| o.body == body).expect("it is there").world_from_body.translation.vector
}

#[test]
fn things_are_moved_on_what_carries_them_swapped_and_taken_away() {
    let run = |disturbance| {
        let mut parts = load(vec![disturbance]).expect("a world");
        let samples = drive(&mut parts, 1.5, 0.0);
        (samples[0].clone(), samples.last().expect("sampled").clone(), samples)
    };
    let (first, last, samples) = run(about(DisturbanceKind::ObjectMoved, 0.5));
    let moved = place(&last, "mug") - place(&first, "mug");
    assert!((0.05..=0.26).contains(&moved.xy().norm()) && moved.z.abs() < 0.01, "{moved}");
    let events: Vec<_> = samples.iter().flat_map(|truth| &truth.events).collect();
    assert_eq!(events.len(), 1, "{events:?}");
    assert!(events[0].moved == ["mug"] && (events[0].stamp.as_s() - 0.5).abs() < 0.02, "{events:?}");
    assert_eq!(run(about(DisturbanceKind::ObjectMoved, 0.5)).2, samples, "the same again");
    let swap = Disturbance { with: Some("can".into()), ..about(DisturbanceKind::Swapped, 0.5) };
    let (first, last, _) = run(swap);
    assert!((place(&last, "mug") - place(&first, "can")).xy().norm() < 0.01);
    assert!((place(&last, "can") - place(&first, "mug")).xy().norm() < 0.01);
    assert!((place(&last, "mug").z - place(&first, "mug").z).abs() < 0.01, "each stands on its own foot");
    let (_, last, _) = run(about(DisturbanceKind::ObjectRemoved, 0.5));
    assert!(place(&last, "mug").z < -100.0);
}

#[test]
fn words_of_the_log_and_the_base_begin_a_disturbance() {
    let on = Disturbance { at_s: None, on: Some("approaches".into()), ..about(DisturbanceKind::ObjectRemoved, 0.0) };
    let mut parts = load(vec![on]).expect("a world");
    assert!(place(drive(&mut parts, 0.5, 0.0).last().unwrap(), "mug").z > 0.0);
    parts.words.send("explores".into()).unwrap();
    parts.words.send("approaches the object".into()).unwrap();
    assert!(place(drive(&mut parts, 1.0, 0.0).last().unwrap(), "mug").z < 0.0);
    let near = Disturbance { at_s: None, within_m: Some(4.0), ..about(DisturbanceKind::ObjectRemoved, 0.0) };
    let mut parts = load(vec![near]).expect("a world");
    assert!(place(drive(&mut parts, 0.5, 0.5).last().unwrap(), "mug").z > 0.0);
    assert!(place(drive(&mut parts, 2.5, 0.5).last().unwrap(), "mug").z < 0.0);
}

#[test]
fn a_box_stands_in_the_way_of_a_base_that_drives_and_is_seen() {
    let mut parts = load(vec![Disturbance::at(DisturbanceKind::PathBlocked, 0.5)]).expect("a world");
    let standing = drive(&mut parts, 1.0, 0.0);
    assert!(standing.iter().all(|truth| truth.events.is_empty()), "nobody is in the way of one that stands");
    let before = standing.last().unwrap().clearance_m;
    let driving = drive(&mut parts, 2.0, 0.3);
    assert_eq!(driving.iter().map(|truth| truth.events.len()).sum::<usize>(), 1);
    assert!(before.is_none_or(|m| m > 0.9) && driving.last().unwrap().clearance_m.is_some_and(|m| m < 0.9));
    // Whoever drives on runs into it: it is there for the base as well as for the eye.
    let hit = drive(&mut parts, 6.0, 0.3);
    let touches = |truth: &&Truth| truth.contacts.iter().any(|c| c.first.starts_with("disturb/box"));
    assert!(hit.iter().any(|truth| touches(&truth)));
    assert!(hit.last().unwrap().world_from_base.translation.x < 0.8);
}

#[test]
fn a_person_walks_through_the_way_and_stops_short_of_a_robot_that_stands() {
    let person = Disturbance { for_s: Some(25.0), ..Disturbance::at(DisturbanceKind::Person, 0.5) };
    let mut parts = load(vec![person]).expect("a world");
    let samples = drive(&mut parts, 45.0, 0.0);
    assert!(samples.iter().all(|truth| truth.contacts.iter().all(|c| !c.first.starts_with("disturb/"))));
    let nearest_m = samples.iter().filter_map(|truth| truth.clearance_m).fold(f64::INFINITY, f64::min);
    assert!((0.1..1.5).contains(&nearest_m), "{nearest_m}");
    let told: Vec<&str> = samples.iter().flat_map(|truth| &truth.events).map(|event| event.what.as_str()).collect();
    assert_eq!(told, ["person begins", "person ends"]);
}

#[test]
fn frames_are_lost_and_late() {
    let count = |disturbances| {
        let mut parts = load(disturbances).expect("a world");
        let (mut read, mut latest) = (0, 0.0_f64);
        for tick in 1..=1000 {
            parts.robot.wait_until(Stamp(tick * 10_000_000)).expect("time passes");
            if let Some(frame) = parts.robot.cameras().read("head").expect("a camera") {
                read += 1;
                latest = latest.max((parts.robot.now() - frame.stamp).as_s());
            }
        }
        (read, latest)
    };
    let (all, on_time) = count(Vec::new());
    let frames = Disturbance { for_s: Some(100.0), ..Disturbance::at(DisturbanceKind::Frames, 0.0) };
    let (some, late) = count(vec![frames]);
    assert!((0.45..0.75).contains(&(f64::from(some) / f64::from(all))), "{some} of {all}");
    assert!(on_time < 0.02 && (late - 0.3).abs() < 0.02, "{on_time} {late}");
}

#[test]
fn wheels_slip_and_localisation_jumps_and_comes_back() {
    let slip = Disturbance { for_s: Some(2.0), share: 0.5, ..Disturbance::at(DisturbanceKind::WheelSlip, 1.0) };
    let mut parts = load(vec![slip]).expect("a world");
    drive(&mut parts, 1.0, 0.3);
    let (true_x, odom_x) =
        (true_x(&mut parts), parts.robot.localisation().odom_from_base().unwrap().pose.translation.x);
    let truth = drive(&mut parts, 3.0, 0.3).last().unwrap().clone();
    let moved_m = truth.world_from_base.translation.x - true_x;
    let counted_m = parts.robot.localisation().odom_from_base().unwrap().pose.translation.x - odom_x;
    assert!((0.25..0.4).contains(&moved_m) && (1.8..2.2).contains(&(counted_m / moved_m)), "{moved_m} {counted_m}");
    let jump = Disturbance { for_s: Some(2.0), ..Disturbance::at(DisturbanceKind::LocalisationJump, 1.0) };
    let mut parts = load(vec![jump]).expect("a world");
    let mut error_m = |end_s: f64| {
        let truth = drive(&mut parts, end_s, 0.0).last().unwrap().world_from_base;
        (parts.robot.localisation().world_from_base().unwrap().pose.translation.vector - truth.translation.vector)
            .norm()
    };
    let errors = [error_m(0.9), error_m(1.5), error_m(3.5)];
    assert!(errors[0] < 0.04 && (0.2..0.3).contains(&errors[1]) && errors[2] < 0.04, "{errors:?}");
}

fn true_x(parts: &mut WorldParts) -> f64 {
    let end_s = parts.robot.now().as_s() + 0.06;
    drive(parts, end_s, 0.3).last().map_or(f64::NAN, |truth| truth.world_from_base.translation.x)
}

#[test]
fn it_is_dark_while_the_light_is_off() {
    let off = Disturbance { for_s: Some(1.0), ..Disturbance::at(DisturbanceKind::LightOff, 0.5) };
    let mut parts = load(vec![off]).expect("a world");
    let mut brightness = |end_s: f64| {
        drive(&mut parts, end_s, 0.0);
        let frame = parts.robot.cameras().read("head").unwrap().expect("a frame");
        let sum: u64 = frame.color.iter().map(|[_, green, _]| u64::from(*green)).sum();
        (sum / frame.color.len() as u64, frame.depth_m.iter().filter(|depth| **depth > 0.0).count())
    };
    let [before, dark, after] = [brightness(0.4), brightness(1.2), brightness(2.2)];
    assert!(before.0 > 60 && dark.0 < 20 && after.0 > 60, "{before:?} {dark:?} {after:?}");
    assert!(dark.1 * 10 > before.1 * 9, "depth brings its own light");
}

#[test]
fn bodies_that_cannot_be_moved_are_refused() {
    for name in ["table", "nothing"] {
        let wrong = Disturbance { object: Some(name.into()), ..Disturbance::at(DisturbanceKind::ObjectMoved, 1.0) };
        let Err(WorldError::Disturbance(error)) = load(vec![wrong]) else { panic!("{name} was taken") };
        let DisturbanceError::NoFreeBody { kind, body, known } = error else { panic!("{error}") };
        assert_eq!((kind, body.as_str(), known), ("object_moved", name, vec!["mug".to_owned(), "can".to_owned()]));
    }
}
