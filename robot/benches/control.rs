//! Times of a control tick and of inverse kinematics on porter.
#![allow(missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use dsm::Pose;
use dsm::time::Stamp;
use dsm_robot::control::{Controller, IkRequest, ToolGoal, find_ik};
use dsm_robot::drivers::{JointState, Twist};
use dsm_robot::joints::{JointPositions, JointVelocities};
use dsm_robot::model::{Configuration, Obstacle, RobotModel};
use nalgebra::Vector3;
use std::hint::black_box;
use std::path::Path;

fn control(criterion: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter");
    let model = RobotModel::load(&folder).expect("porter loads");
    let mut start = model.kinematics.zero();
    start.apply(&model.find_posture("ready_front").expect("porter has it"));
    let state = JointState {
        stamp: Stamp(0),
        positions: JointPositions::from_values(&model.arm.joints, model.arm.values_of(&start)).expect("lengths"),
        velocities: JointVelocities::zeros(&model.arm.joints),
    };
    let base_from_tool = model.kinematics.root_from_link(&start, model.tool);
    let near = Pose::translation(0.1, 0.1, 0.05) * base_from_tool;
    // Twenty boxes about the hand, so that rows are near and some of them hold it back.
    let boxes: Vec<Obstacle> = (0..20)
        .map(|k| {
            let angle = f64::from(k) * 0.6;
            let at = Pose::translation(0.02 * f64::from(k % 5), 0.16 * angle.cos(), 0.16 * angle.sin());
            Obstacle::still_box(at * base_from_tool, Vector3::new(0.03, 0.02, 0.03))
        })
        .collect();
    let mut ticks = |name: &str, obstacles: &[Obstacle], goal: Pose| {
        let mut controller = Controller::new(&model, model.settings.control.clone());
        let goal = ToolGoal::from(goal);
        criterion.bench_function(name, |bench| {
            bench.iter(|| {
                // Each tick starts from rest, where the box is tight and the solver has work to do.
                controller.reset();
                black_box(controller.tick(&state, &goal, obstacles, 0.01))
            });
        });
    };
    ticks("tick, free", &[], near);
    ticks("tick, 20 boxes", &boxes, near);
    ticks("tick at the goal", &[], base_from_tool);
    mobile(criterion, &model, &start, near);
    let request = IkRequest { obstacles: &boxes[..4], ..IkRequest::new(&start) };
    let goal = Pose::translation(0.0, 0.3, 0.1) * base_from_tool;
    criterion.bench_function("find_ik", |bench| bench.iter(|| black_box(find_ik(&model, &goal, &request))));
}

/// Base and arm on the move among many boxes: thirty distances and more end up as rows of the program.
fn mobile(criterion: &mut Criterion, model: &RobotModel, start: &Configuration, goal: Pose) {
    let speeds = model.arm.limits.iter().map(|limits| 0.6 * limits.velocity).collect();
    let state = JointState {
        stamp: Stamp(0),
        positions: JointPositions::from_values(&model.arm.joints, model.arm.values_of(start)).expect("lengths"),
        velocities: JointVelocities::from_values(&model.arm.joints, speeds).expect("lengths"),
    };
    let base = Twist { forward_m_per_s: 0.3, turn_rad_per_s: 0.3 };
    let poses = model.kinematics.root_from_links(start);
    let links = model.arm_links();
    let boxes_at = |distance_m: f64| -> Vec<Obstacle> {
        let boxed = |k: u32| {
            let angle = f64::from(k) * 2.4;
            let link = links[(k as usize * 5) % links.len()];
            let aside = Vector3::new(0.5 * (angle * 3.0).sin(), angle.cos(), angle.sin()) * distance_m;
            let at = poses.get(link).translation.vector + aside;
            Obstacle::still_box(Pose::new(at, Vector3::new(angle, 0.3, 0.1)), Vector3::new(0.03, 0.02, 0.03))
        };
        (0..40).map(boxed).collect()
    };
    let mut controller = Controller::with_base(model, model.settings.control.clone());
    let goal = ToolGoal::from(Pose::translation(0.6, 0.2, 0.0) * goal);
    // As near as thirty rows ask for.
    let (boxes, output) = (0..12)
        .map(|k| {
            controller.reset();
            let boxes = boxes_at(0.26 - 0.02 * f64::from(k));
            let output = controller.tick_with_base(&state, base, &goal, &boxes, 0.01);
            (boxes, output)
        })
        .find(|(_, output)| output.rows >= 30)
        .expect("boxes nearby make thirty rows");
    let name = format!("tick with base, {} rows, {:?}", output.rows, output.solved_by);
    criterion.bench_function(&name, |bench| {
        bench.iter(|| {
            controller.reset();
            black_box(controller.tick_with_base(&state, base, &goal, &boxes, 0.01))
        });
    });
}

criterion_group!(benches, control);
criterion_main!(benches);
