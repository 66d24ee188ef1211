//! Measures the robot on rapier: steps per second among 60 bodies, honest grasps, tool error, base tracking and
//! penetration, for several step lengths and solver iterations. Prints one table; times are CPU time of one thread.
//!
//! `cargo run --release -p dsm-sim --example spike`

#![allow(clippy::print_stdout, reason = "a measuring program")]

#[path = "../tests/blocks/mod.rs"]
mod blocks;

use blocks::{add_free, add_table, cuboid, floor, porter, posture, start};
use dsm::time::Span;
use dsm_robot::drivers::Twist;
use dsm_sim::physics::{JointTarget, Physics, PhysicsConfig, RapierPhysics};
use dsm_sim::scene::{SceneModel, SceneShape};

/// Control period in seconds.
const CONTROL_S: f64 = 0.01;

fn main() {
    println!(
        "{:>5} {:>7} | {:>8} {:>8} {:>6} | {:<17} {:>6} {:>6} {:>7} {:>6} {:>6} {:>4} {:>7} {:>6} | {:>7} {:>7} {:>7}",
        "dt ms",
        "it x sw",
        "us/rest",
        "us/grasp",
        "x real",
        "object",
        "held",
        "slip",
        "creep/s",
        "turn",
        "turn/s",
        "grip",
        "depth",
        "tool",
        "v err",
        "w err",
        "side"
    );
    println!(
        "{:>5} {:>7} | {:>8} {:>8} {:>6} | {:<17} {:>6} {:>6} {:>7} {:>6} {:>6} {:>4} {:>7} {:>6} | {:>7} {:>7} {:>7}",
        "", "", "", "", "", "", "", "mm", "mm/s", "deg", "deg/s", "N", "mm", "mm", "mm/s", "mrad/s", "mm"
    );
    for (step_ns, iterations, sweeps) in [
        (2_000_000, 4, 1),
        (2_500_000, 4, 1),
        (5_000_000, 2, 1),
        (5_000_000, 4, 1),
        (5_000_000, 4, 2),
        (5_000_000, 4, 4),
        (5_000_000, 4, 8),
        (5_000_000, 8, 1),
        (5_000_000, 12, 1),
    ] {
        let config = PhysicsConfig { step: Span(step_ns), solver_iterations: iterations, sweeps };
        let base = measure_base(config);
        for object in OBJECTS {
            let (rest_us, grasp) = measure_grasp(config, &object);
            println!(
                "{:>5.1} {:>7} | {:>8.0} {:>8.0} {:>6.1} | {:<17} {:>6} {:>6.1} {:>7.2} {:>6.1} {:>6.2} {:>4.0} {:>7.2} {:>6.1} | {:>7.1} {:>7.1} {:>7.1}",
                step_ns as f64 * 1e-6,
                format!("{iterations}x{sweeps}"),
                rest_us,
                grasp.step_us,
                step_ns as f64 * 1e-3 / grasp.step_us,
                object.name,
                if grasp.held { "yes" } else { "NO" },
                grasp.slip_mm,
                grasp.creep_mm_per_s,
                grasp.turn_deg,
                grasp.turn_deg_per_s,
                grasp.gripped_n,
                grasp.depth_mm,
                grasp.tool_error_mm,
                base.forward_error_mm_per_s,
                base.turn_error_mrad_per_s,
                base.side_mm,
            );
        }
    }
}

struct Object {
    name: &'static str,
    shape: SceneShape,
    mass_kg: f64,
    friction: f64,
    height_m: f64,
    /// How far above its middle it is held, metres.
    above_m: f64,
}

const OBJECTS: [Object; 6] = [
    Object {
        name: "box",
        shape: SceneShape::Box { half_m: nalgebra::Vector3::new(0.03, 0.03, 0.05) },
        mass_kg: 0.2,
        friction: 0.5,
        height_m: 0.1,
        above_m: 0.0,
    },
    Object {
        name: "apple",
        shape: SceneShape::Sphere { radius_m: 0.035 },
        mass_kg: 0.18,
        friction: 0.5,
        height_m: 0.07,
        above_m: 0.0,
    },
    Object {
        name: "mug",
        shape: SceneShape::Cylinder { radius_m: 0.04, half_length_m: 0.045 },
        mass_kg: 0.35,
        friction: 0.4,
        height_m: 0.09,
        above_m: 0.0,
    },
    Object {
        name: "bottle",
        shape: SceneShape::Cylinder { radius_m: 0.038, half_length_m: 0.1 },
        mass_kg: 0.33,
        friction: 0.45,
        height_m: 0.2,
        above_m: -0.01,
    },
    Object {
        name: "bottle, held high",
        shape: SceneShape::Cylinder { radius_m: 0.038, half_length_m: 0.1 },
        mass_kg: 0.33,
        friction: 0.45,
        height_m: 0.2,
        above_m: 0.05,
    },
    Object {
        name: "slick box",
        shape: SceneShape::Box { half_m: nalgebra::Vector3::new(0.03, 0.03, 0.05) },
        mass_kg: 0.5,
        friction: 0.3,
        height_m: 0.1,
        above_m: 0.0,
    },
];

/// Lift height and tool height of the grasp: `ready_down` puts the tool 0.448 m above the floor with the lift down.
const GRASP_LIFT_M: f64 = 0.15;
const TOOL_X_M: f64 = 0.519;
const TOOL_Z_M: f64 = 0.448 + GRASP_LIFT_M;

/// A table with the object below the gripper and 60 bodies around.
fn world(object: &Object) -> (SceneModel, usize) {
    let mut scene = floor();
    let middle_z_m = TOOL_Z_M - object.above_m;
    let top = middle_z_m - 0.5 * object.height_m;
    add_table(&mut scene, 0.71, 0.0, 1.2, top);
    let target =
        add_free(&mut scene, [TOOL_X_M, 0.0, middle_z_m], object.mass_kg, object.shape.clone(), object.friction);
    for side in [-1.0, 1.0] {
        for table in 0..2 {
            let y = side * (1.8 + 1.3 * f64::from(table));
            add_table(&mut scene, 0.7, y, 1.0, 0.7);
            for item in 0..14 {
                let (x, y) = (0.45 + 0.1 * f64::from(item % 7), y - 0.3 + 0.5 * f64::from(item / 7));
                let shape = match item % 3 {
                    0 => cuboid(0.06, 0.06, 0.1),
                    1 => SceneShape::Cylinder { radius_m: 0.035, half_length_m: 0.05 },
                    _ => SceneShape::Sphere { radius_m: 0.04 },
                };
                let z = if item % 3 == 2 { 0.74 } else { 0.75 };
                add_free(&mut scene, [x, y, z], 0.2, shape, 0.5);
            }
        }
    }
    (scene, target)
}

/// CPU time of this thread: a loaded machine does not spoil it as it spoils wall time.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds: f64 = text.split_whitespace().next().and_then(|n| n.parse().ok()).expect("a number");
    nanoseconds * 1e-9
}

struct Rig {
    physics: RapierPhysics,
    seconds: f64,
    steps: usize,
    max_depth_m: f64,
}

impl Rig {
    fn new(scene: &SceneModel, posture: &str, lift_m: f64, config: PhysicsConfig) -> Self {
        let physics = RapierPhysics::new(scene, &porter(), &start(posture, lift_m), config).expect("a valid world");
        Self { physics, seconds: 0.0, steps: 0, max_depth_m: 0.0 }
    }

    fn run(&mut self, seconds: f64, mut control: impl FnMut(&mut RapierPhysics)) {
        let steps = (CONTROL_S / self.physics.step_length().as_s()).round() as usize;
        for _ in 0..(seconds / CONTROL_S).round() as usize {
            control(&mut self.physics);
            let before = cpu_s();
            for _ in 0..steps {
                self.physics.step();
            }
            self.seconds += cpu_s() - before;
            self.steps += steps;
        }
    }

    fn move_to(&mut self, targets: &[(String, f64)], seconds: f64) {
        self.run(seconds, |physics| servo(physics, targets));
    }

    fn note_depth(&mut self) {
        let deepest = self.physics.contacts().iter().map(|c| c.depth_m).fold(0.0, f64::max);
        self.max_depth_m = self.max_depth_m.max(deepest);
    }

    fn step_us(&self) -> f64 {
        self.seconds * 1e6 / self.steps as f64
    }
}

/// Follows targets by velocity commands, as the controller does.
fn servo(physics: &mut RapierPhysics, targets: &[(String, f64)]) {
    let positions = physics.joint_positions();
    for (name, target) in targets.iter().filter(|(n, _)| !n.starts_with("gripper")) {
        let (Some(joint), Some(position)) = (physics.find_joint(name), positions.find(name)) else { continue };
        let speed = if name == "lift_joint" { 0.15 } else { 0.8 };
        let velocity = (4.0 * (target - position)).clamp(-speed, speed);
        physics.command_joint(joint, JointTarget::Velocity(velocity));
    }
}

fn command_gripper(physics: &mut RapierPhysics, width_m: f64, force_n: f64) {
    for name in ["gripper_left_joint", "gripper_right_joint"] {
        let joint = physics.find_joint(name).expect("a finger");
        let target = JointTarget::Position { position: 0.5 * width_m, speed: 0.05, max_effort: force_n };
        physics.command_joint(joint, target);
    }
}

struct Grasp {
    held: bool,
    slip_mm: f64,
    creep_mm_per_s: f64,
    turn_deg: f64,
    turn_deg_per_s: f64,
    gripped_n: f64,
    depth_mm: f64,
    tool_error_mm: f64,
    step_us: f64,
}

/// Descends on the object, closes with 30 N, lifts, folds the arm and drives 2 m with a turn.
fn measure_grasp(config: PhysicsConfig, object: &Object) -> (f64, Grasp) {
    let (scene, target) = world(object);
    let mut rig = Rig::new(&scene, "ready_down", GRASP_LIFT_M + 0.15, config);
    rig.run(1.0, |_| {});
    let rest_us = rig.step_us();
    let tool = rig.physics.find_link("tool_frame").expect("a tool");
    let tool_from_object =
        |physics: &RapierPhysics| physics.world_from_link(tool).inv_mul(&physics.world_from_body(target));

    let lift = |z: f64| vec![("lift_joint".to_owned(), z)];
    rig.move_to(&lift(GRASP_LIFT_M), 2.5);
    rig.run(1.5, |physics| command_gripper(physics, 0.0, 30.0));
    let grasped = tool_from_object(&rig.physics);
    rig.note_depth();
    rig.move_to(&lift(GRASP_LIFT_M + 0.2), 2.5);
    let tool_at = rig.physics.world_from_link(tool).translation.vector;
    let tool_error = (tool_at - nalgebra::Vector3::new(TOOL_X_M, 0.0, TOOL_Z_M + 0.2)).norm();

    let before_creep = tool_from_object(&rig.physics);
    rig.run(4.0, |_| {});
    let after_creep = tool_from_object(&rig.physics);
    let creep = (after_creep.translation.vector - before_creep.translation.vector).norm();
    let turning = after_creep.rotation.angle_to(&before_creep.rotation);
    let gripped_n = rig.physics.grip_force_n();
    rig.note_depth();

    let drive = |forward: f64, turn: f64| {
        move |physics: &mut RapierPhysics| {
            physics.command_base(Twist { forward_m_per_s: forward, turn_rad_per_s: turn });
        }
    };
    rig.run(1.5, drive(-0.4, 0.0));
    rig.run(0.5, drive(0.0, 0.0));
    let mut side = posture("side");
    side.push(("lift_joint".to_owned(), 0.1));
    rig.move_to(&side, 4.0);
    rig.move_to(&posture("carry"), 5.0);
    rig.run(2.0, drive(0.0, 0.8));
    rig.run(2.9, drive(0.7, 0.0));
    rig.run(1.0, drive(0.0, 0.0));
    rig.note_depth();
    let end = tool_from_object(&rig.physics);
    let slip = (end.translation.vector - grasped.translation.vector).norm();
    let grasp = Grasp {
        held: slip < 0.03 && rig.physics.grip_force_n() > 5.0,
        slip_mm: slip * 1e3,
        creep_mm_per_s: creep * 1e3 / 4.0,
        turn_deg: end.rotation.angle_to(&grasped.rotation).to_degrees(),
        turn_deg_per_s: turning.to_degrees() / 4.0,
        gripped_n,
        depth_mm: rig.max_depth_m * 1e3,
        tool_error_mm: tool_error * 1e3,
        step_us: rig.step_us(),
    };
    (rest_us, grasp)
}

struct BaseTracking {
    forward_error_mm_per_s: f64,
    turn_error_mrad_per_s: f64,
    side_mm: f64,
}

/// Drives straight, turns, and drives an arc while the arm swings; errors are means after 0.5 s of each command.
fn measure_base(config: PhysicsConfig) -> BaseTracking {
    let mut rig = Rig::new(&floor(), "carry", 0.08, config);
    let (mut forward_error, mut turn_error, mut samples) = (0.0, 0.0, 0.0);
    let mut side = 0.0_f64;
    for (index, twist) in [(0.5, 0.0), (0.0, 1.0), (0.4, 0.5)].into_iter().enumerate() {
        let twist = Twist { forward_m_per_s: twist.0, turn_rad_per_s: twist.1 };
        let arm = posture(if index == 2 { "side" } else { "carry" });
        let command = |physics: &mut RapierPhysics| {
            physics.command_base(twist);
            servo(physics, &arm);
        };
        rig.run(0.5, command);
        rig.run(2.5, |physics| {
            command(physics);
            let velocity = physics.base_velocity();
            forward_error += (velocity.forward_m_per_s - twist.forward_m_per_s).abs();
            turn_error += (velocity.turn_rad_per_s - twist.turn_rad_per_s).abs();
            samples += 1.0;
        });
        if index == 0 {
            side = rig.physics.world_from_base().translation.y.abs();
        }
    }
    BaseTracking {
        forward_error_mm_per_s: forward_error / samples * 1e3,
        turn_error_mrad_per_s: turn_error / samples * 1e3,
        side_mm: side * 1e3,
    }
}
