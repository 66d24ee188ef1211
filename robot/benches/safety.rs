//! What the envelope costs in a control period: with the robot inside alone, and around it. The world inside has no
//! mechanics, so that the difference is the envelope's.
#![allow(missing_docs)]

#[path = "../tests/kinematic/mod.rs"]
mod kinematic;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use dsm::time::Span;
use dsm_robot::drivers::{Robot, Twist};
use dsm_robot::joints::JointVelocities;
use dsm_robot::safety::Envelope;
use kinematic::{Kinematic, porter};
use std::cell::RefCell;

const PERIOD: Span = Span(10_000_000);

/// A control period as a task has it.
fn tick(robot: &mut dyn Robot, twist: Twist, still: &[JointVelocities; 2]) {
    robot.base().command(twist).expect("accepted");
    robot.arm().command(&still[0]).expect("accepted");
    robot.head().command(&still[1]).expect("accepted");
    robot.gripper().command(0.05, 10.0).expect("accepted");
    let next = robot.clock().now() + PERIOD;
    robot.clock().wait_until(next).expect("runs");
}

fn safety(criterion: &mut Criterion) {
    let model = porter();
    let still = [&model.arm, &model.head].map(|group| JointVelocities::zeros(&group.joints));
    // It drives a circle before a wall, so that what the camera saw is in reach of its braking.
    let twist = Twist { forward_m_per_s: 0.3, turn_rad_per_s: 0.6 };
    let world = || {
        let mut world = Kinematic::new(&model);
        (world.cameras.size, world.cameras.wall_x_m) = ((640, 480), Some(1.2));
        world.head.state.positions.values_mut()[1] = 0.5 * model.head_signs()[1];
        world
    };
    let mut bare = world();
    criterion.bench_function("control period without envelope", |bench| bench.iter(|| tick(&mut bare, twist, &still)));
    let wrapped = RefCell::new(Envelope::new(world(), &model));
    criterion.bench_function("control period with envelope", |bench| {
        bench.iter_batched(
            // Nobody drives blindly: a frame comes in between, and is not counted here.
            || wrapped.borrow_mut().cameras().read("head").expect("a camera"),
            |_| tick(&mut *wrapped.borrow_mut(), twist, &still),
            BatchSize::NumIterations(40),
        );
    });
    criterion.bench_function("frame without envelope", |bench| {
        bench.iter_batched_ref(
            || stepped(world()),
            |robot| robot.cameras().read("head").expect("a camera"),
            BatchSize::LargeInput,
        );
    });
    criterion.bench_function("frame with envelope", |bench| {
        bench.iter_batched_ref(
            || stepped(Envelope::new(world(), &model)),
            |robot| robot.cameras().read("head").expect("a camera"),
            BatchSize::LargeInput,
        );
    });
}

/// The robot after its first control period.
fn stepped<R: Robot>(mut robot: R) -> R {
    robot.clock().wait_until(dsm::time::Stamp(0) + PERIOD).expect("runs");
    robot
}

criterion_group!(benches, safety);
criterion_main!(benches);
