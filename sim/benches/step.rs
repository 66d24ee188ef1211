//! Times of the apartment: one step of physics with the robot in it, and one frame of the head camera, drawn and sensed.
#![allow(missing_docs, reason = "the macros of criterion write undocumented functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::time::{Span, Stamp};
use dsm_robot::drivers::{Robot, Twist};
use dsm_robot::model::RobotModel;
use dsm_sim::physics::PhysicsConfig;
use dsm_sim::world::{World, WorldConfig};
use std::path::Path;
use std::sync::Arc;

/// The robot turns on the spot at this rate while times are taken.
const TURN_RAD_PER_S: f64 = 0.5;

fn bench(criterion: &mut Criterion) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let porter = Arc::new(RobotModel::load(&root.join("robot/models/porter")).expect("porter loads"));
    let load = || {
        let world = World::load(&root.join("scenes/apartment"), porter.clone(), WorldConfig::default());
        world.expect("the world loads").into_parts()
    };
    let turn = Twist { forward_m_per_s: 0.0, turn_rad_per_s: TURN_RAD_PER_S };

    let step = PhysicsConfig::default().step;
    let mut parts = load();
    criterion.bench_function("physics_step_apartment", |bencher| {
        bencher.iter(|| {
            let robot: &mut dyn Robot = &mut parts.robot;
            robot.base().command(turn).expect("the base takes commands");
            let end = robot.clock().now() + step;
            robot.clock().wait_until(end).expect("time passes");
        });
        // What nobody reads piles up otherwise.
        parts.truth.try_iter().for_each(drop);
    });

    let mut parts = load();
    let next_frame = |now: Stamp| now + Span::from_s(0.2);
    criterion.bench_function("camera_frame_with_its_steps_apartment", |bencher| {
        bencher.iter(|| {
            let robot: &mut dyn Robot = &mut parts.robot;
            robot.base().command(turn).expect("the base takes commands");
            let end = next_frame(robot.clock().now());
            robot.clock().wait_until(end).expect("time passes");
            robot.cameras().read("head").expect("the camera works").expect("a frame is due")
        });
        parts.truth.try_iter().for_each(drop);
    });
}

criterion_group! {
    name = step;
    config = Criterion::default().sample_size(30);
    targets = bench
}
criterion_main!(step);
