//! An arm follows a pose, without simulator and without map: a circle in the air, by the QP controller alone.
//!
//! ```text
//! cargo run --release -p dsm-robot --example follow_pose                      # porter's arm
//! cargo run --release -p dsm-robot --example follow_pose -- panda.urdf panda_hand_tcp
//! ```
//!
//! With a URDF of an arm (a Panda, say) all of its joints that carry the tip are controlled. Joints start in the middle of
//! their range; the tip's frame then goes round a circle of 10 cm radius, keeping its orientation.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "printing is what an example does")]

use dsm::Pose;
use dsm::time::{Span, Stamp};
use dsm_robot::control::{ControlStatus, Controller, ControllerConfig, ToolGoal};
use dsm_robot::drivers::JointState;
use dsm_robot::joints::{JointNames, JointPositions, JointVelocities};
use dsm_robot::model::{CollisionModel, Drive, Group, Kinematics, LinkId, RobotModel};
use nalgebra::Vector3;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

const DT_S: f64 = 0.01;
const RADIUS_M: f64 = 0.1;
const ROUND_S: f64 = 6.0;
/// A URDF says nothing about accelerations, rad/s^2 or m/s^2.
const ACCELERATION: f64 = 7.5;

/// What the controller needs of a robot.
struct Arm {
    kinematics: Kinematics,
    collision: Arc<CollisionModel>,
    group: Group,
    tip: LinkId,
    start: Vec<f64>,
}

fn porter() -> Result<Arm, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/porter");
    let model = RobotModel::load(&folder).map_err(|error| error.to_string())?;
    let mut configuration = model.kinematics.zero();
    configuration.apply(&model.find_posture("ready_front").ok_or("porter has no posture `ready_front`")?);
    let start = model.arm.values_of(&configuration);
    Ok(Arm { kinematics: model.kinematics, collision: model.collision, group: model.arm, tip: model.tool, start })
}

fn from_urdf(file: &str, tip: &str) -> Result<Arm, String> {
    let kinematics = Kinematics::load_urdf(Path::new(file)).map_err(|error| error.to_string())?;
    let tip = kinematics.find_link(tip).ok_or_else(|| {
        let links: Vec<&str> = kinematics.links.iter().map(|link| link.name.as_str()).collect();
        format!("{file}: there is no link `{tip}`; valid: {}", links.join(", "))
    })?;
    let mut group = Group {
        name: "arm".to_owned(),
        joints: JointNames::from([]),
        variables: Vec::new(),
        limits: Vec::new(),
        max_accelerations: Vec::new(),
    };
    let mut names = Vec::new();
    for joint in kinematics.joints_to(tip).into_iter().map(|index| &kinematics.joints[index]) {
        let Drive::Variable { variable, .. } = joint.drive else { continue };
        if !group.variables.contains(&variable) && joint.limits.velocity.is_finite() {
            names.push(kinematics.variables[variable].clone());
            group.variables.push(variable);
            group.limits.push(joint.limits);
            group.max_accelerations.push(ACCELERATION);
        }
    }
    if names.is_empty() {
        return Err(format!("{file}: no joint with a velocity limit carries that link"));
    }
    group.joints = names.into();
    let middle = |lower: f64, upper: f64| if (upper - lower).is_finite() { 0.5 * (lower + upper) } else { 0.0 };
    let start: Vec<f64> = group.limits.iter().map(|limits| middle(limits.lower, limits.upper)).collect();
    // Links that touch in the first posture touch by design.
    let mut configuration = kinematics.zero();
    configuration.apply_group(&group, &start);
    let model = CollisionModel::new(&kinematics, &[]);
    let touching = model.self_distances(&kinematics.root_from_links(&configuration), 0.02);
    let ignored: Vec<(LinkId, LinkId)> = touching
        .iter()
        .filter_map(|pair| match pair.other {
            dsm_robot::model::Other::Link(other) => Some((pair.link, other)),
            dsm_robot::model::Other::Obstacle(_) => None,
        })
        .collect();
    Ok(Arm { collision: Arc::new(model.ignoring(&ignored)), kinematics, group, tip, start })
}

fn follow(arm: &Arm) {
    let config = ControllerConfig { gain_per_s: 8.0, ..ControllerConfig::default() };
    let mut controller = Controller::for_group(&arm.kinematics, &arm.collision, &arm.group, arm.tip, config);
    let mut state = JointState {
        stamp: Stamp(0),
        positions: JointPositions::from_values(&arm.group.joints, arm.start.clone())
            .unwrap_or_else(|| JointPositions::zeros(&arm.group.joints)),
        velocities: JointVelocities::zeros(&arm.group.joints),
    };
    let mut configuration = arm.kinematics.zero();
    configuration.apply_group(&arm.group, &arm.start);
    let first = arm.kinematics.root_from_link(&configuration, arm.tip);
    println!("{} joints, tip at {:.3?} m", arm.group.len(), first.translation.vector.as_slice());
    println!("  time s   distance mm   angle mrad   rows   status");
    let mut worst_m = 0.0_f64;
    for step in 0..(2.0 * ROUND_S / DT_S) as usize {
        let time_s = step as f64 * DT_S;
        // The circle begins where the tip is, and is entered gently.
        let rate = std::f64::consts::TAU / ROUND_S * (time_s / 2.0).min(1.0);
        let angle = if time_s < 2.0 { 0.5 * rate * time_s } else { rate * (time_s - 1.0) };
        let (sin, cos) = angle.sin_cos();
        let mut goal = ToolGoal::from(Pose::translation(RADIUS_M * (cos - 1.0), RADIUS_M * sin, 0.0) * first);
        goal.linear_m_per_s = Vector3::new(-sin, cos, 0.0) * (RADIUS_M * rate);
        let output = controller.tick(&state, &goal, &[], DT_S);
        if step % 100 == 0 {
            let (mm, mrad) = (output.error_m * 1e3, output.error_rad * 1e3);
            println!("{time_s:8.2} {mm:13.2} {mrad:12.2} {:6}   {:?}", output.rows, output.status);
        }
        if matches!(output.status, ControlStatus::Braking { .. }) {
            println!("{time_s:8.2} braking: {:?}", output.status);
        }
        worst_m = worst_m.max(output.error_m);
        for (position, velocity) in state.positions.values_mut().iter_mut().zip(output.velocities.values()) {
            *position += velocity * DT_S;
        }
        state.velocities = output.velocities;
        state.stamp = state.stamp + Span::from_s(DT_S);
    }
    println!("greatest distance {:.2} mm", worst_m * 1e3);
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arm = match arguments.as_slice() {
        [] => porter(),
        [file, tip] => from_urdf(file, tip),
        _ => Err("usage: follow_pose [URDF TIP_LINK]".to_owned()),
    };
    match arm {
        Ok(arm) => {
            follow(&arm);
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}
