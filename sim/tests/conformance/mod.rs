//! Contract of every [`Engine`]: bodies fall, rest, slide and stack as mechanics says; the robot's joints and base
//! follow what they are told within their limits; friction alone holds what the gripper lifts; doors and drawers move on
//! their joints, and stay where they are left; contacts are reported with their force; the same inputs give the same bytes.

mod grip;
mod joints;
mod pairs;

pub(crate) use grip::{
    a_grip_too_weak_for_the_weight_drops_the_object, fingers_that_lose_their_hold_do_not_shoot,
    friction_holds_what_the_gripper_lifts_and_carries, the_grip_force_never_exceeds_the_limit,
    what_is_held_aslant_does_not_turn_between_the_pads,
};
pub(crate) use joints::{
    a_door_swings_when_it_is_pushed_and_stays, a_drawer_slides_out_by_its_handle_and_stops, a_lid_falls_with_its_box,
    nothing_on_a_joint_moves_untouched, pulling_twice_gives_the_same_bytes, weight_springs_and_limits_act_on_joints,
};
pub(crate) use pairs::{
    a_written_center_of_mass_counts, kinds_and_exclusions_decide_what_touches, ties_hold_bodies_together,
};

use crate::blocks::{add, add_free, add_table, body, cuboid, floor, porter, posture, start};
use dsm::Pose;
use dsm_robot::drivers::Twist;
use dsm_robot::model::shapes::{CollisionShape, Geometry, Mesh};
use dsm_sim::physics::{ContactParty, Engine, JointTarget, Physics, PhysicsError, RobotStart};
use dsm_sim::scene::{BodyMotion, SceneGeom, SceneMesh, SceneModel, SceneShape};
use grip::{grasp_world, lift_by};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::sync::Arc;

const G: f64 = 9.80665;

/// The robot folded, far from what is tested.
fn aside() -> RobotStart {
    RobotStart { x_m: -5.0, ..start("carry", 0.08) }
}

fn build(engine: &dyn Engine, scene: &SceneModel, start: &RobotStart) -> Box<dyn Physics> {
    engine.build(scene, &porter(), start).expect("a valid world")
}

fn run(physics: &mut dyn Physics, seconds: f64) {
    for _ in 0..(seconds / physics.step_length().as_s()).round() as usize {
        physics.step();
    }
}

fn drive(physics: &mut dyn Physics, forward_m_per_s: f64, turn_rad_per_s: f64, seconds: f64) {
    physics.command_base(Twist { forward_m_per_s, turn_rad_per_s });
    run(physics, seconds);
}

fn position(physics: &dyn Physics, body: usize) -> Vector3<f64> {
    physics.world_from_body(body).translation.vector
}

fn set_velocity(physics: &mut dyn Physics, joint: &str, velocity: f64) {
    let joint = physics.find_joint(joint).expect("a joint");
    physics.command_joint(joint, JointTarget::Velocity(velocity));
}

fn joint_value(physics: &dyn Physics, joint: &str) -> f64 {
    physics.joint_positions().find(joint).expect("a joint")
}

fn set_gripper(physics: &mut dyn Physics, width_m: f64, max_effort: f64) {
    for name in ["gripper_left_joint", "gripper_right_joint"] {
        let joint = physics.find_joint(name).expect("it exists");
        let target = JointTarget::Position { position: 0.5 * width_m, speed: 0.05, max_effort };
        physics.command_joint(joint, target);
    }
}

pub(crate) fn a_free_body_falls_with_gravity(engine: &dyn Engine) {
    let mut scene = floor();
    let ball = add_free(&mut scene, [0.0, 0.0, 10.0], 1.0, SceneShape::Sphere { radius_m: 0.1 }, 0.5);
    let mut physics = build(engine, &scene, &aside());
    run(physics.as_mut(), 1.0);
    // Air resistance of 0.05 1/s takes about 1.7 % off.
    assert!((10.0 - position(physics.as_ref(), ball).z - 0.5 * G).abs() < 0.12);
    assert_eq!(physics.now().0, 1_000_000_000);
}

pub(crate) fn friction_decides_whether_a_block_slides_down_a_slope(engine: &dyn Engine) {
    // Combined friction is the geometric mean: 0.5 here, so it holds at 20 degrees and slides at 35.
    for (angle_deg, slides) in [(20.0_f64, false), (35.0, true)] {
        let tilt = UnitQuaternion::from_euler_angles(0.0, angle_deg.to_radians(), 0.0);
        let mut scene = floor();
        let at = |height: f64| {
            let offset = tilt * Vector3::new(0.0, 0.0, height);
            Pose::from_parts((Vector3::new(0.0, 0.0, 2.0) + offset).into(), tilt)
        };
        add(&mut scene, body("slope", at(0.0), BodyMotion::Fixed, 0.0, cuboid(6.0, 2.0, 0.1), 0.5));
        let block = add(&mut scene, body("block", at(0.1), BodyMotion::Free, 0.3, cuboid(0.2, 0.2, 0.1), 0.5));
        let mut physics = build(engine, &scene, &aside());
        run(physics.as_mut(), 1.0);
        let slid = (position(physics.as_ref(), block) - at(0.1).translation.vector).norm();
        if slides {
            let angle = angle_deg.to_radians();
            let expected = 0.5 * G * (angle.sin() - 0.5 * angle.cos());
            assert!((slid - expected).abs() < 0.12 * expected, "slid {slid} m, expected {expected} m");
        } else {
            assert!(slid < 0.003, "slid {slid} m");
        }
    }
}

pub(crate) fn a_stack_rests_and_a_round_fruit_stays(engine: &dyn Engine) {
    let mut scene = floor();
    let table = add_table(&mut scene, 1.0, 0.0, 1.0, 0.7);
    let boxes: Vec<usize> = (0..5)
        .map(|i| add_free(&mut scene, [1.0, 0.0, 0.75 + 0.1 * f64::from(i)], 0.3, cuboid(0.12, 0.12, 0.1), 0.5))
        .collect();
    let apple = add_free(&mut scene, [1.0, 0.3, 0.736], 0.18, SceneShape::Sphere { radius_m: 0.035 }, 0.5);
    let mut physics = build(engine, &scene, &aside());
    let before: Vec<_> = boxes.iter().map(|b| position(physics.as_ref(), *b)).collect();
    run(physics.as_mut(), 5.0);
    for (index, (b, at)) in boxes.iter().zip(before).enumerate() {
        let moved = (position(physics.as_ref(), *b) - at).norm();
        assert!(moved < 0.004, "box {index} moved {moved} m");
    }
    assert!((position(physics.as_ref(), apple) - Vector3::new(1.0, 0.3, 0.735)).norm() < 0.01);
    // The table carries the five boxes: the contact's force says so.
    let contacts = physics.contacts();
    let below = (ContactParty::Body(table), ContactParty::Body(boxes[0]));
    let contact = contacts.iter().find(|c| (c.first, c.second) == below).expect("the lowest box stands on the table");
    assert!((contact.force_n - 1.5 * G).abs() < 0.05 * 1.5 * G, "{} N", contact.force_n);
    assert!(contact.depth_m < 0.002 && (contact.point_in_world.z - 0.7).abs() < 0.005);
}

pub(crate) fn what_stands_is_still(engine: &dyn Engine) {
    // A can, and a ball on a small foot, once rocked by a millimetre for ever: they never slept, and a ball that was put
    // down never counted as at rest.
    let mut scene = floor();
    add_table(&mut scene, 1.0, 0.0, 1.2, 0.5);
    let can = SceneShape::Cylinder { radius_m: 0.03, half_length_m: 0.1 };
    let can = add_free(&mut scene, [1.0, -0.3, 0.601], 0.16, can, 0.5);
    let ball = add_free(&mut scene, [1.0, 0.3, 0.501], 0.167, SceneShape::Sphere { radius_m: 0.0415 }, 0.8);
    let geoms = &mut scene.bodies[ball].geoms;
    geoms[0].body_from_geom = Pose::translation(0.0, 0.0, 0.0425);
    let foot = SceneShape::Cylinder { radius_m: 0.0149, half_length_m: 0.003 };
    let foot = SceneGeom { shape: foot, body_from_geom: Pose::translation(0.0, 0.0, 0.003), ..geoms[0].clone() };
    geoms.push(foot);
    let mut physics = build(engine, &scene, &aside());
    run(physics.as_mut(), 2.0);
    for body in [can, ball] {
        let mut last = position(physics.as_ref(), body);
        for _ in 0..60 {
            run(physics.as_mut(), 0.05);
            let now = position(physics.as_ref(), body);
            let speed = (now - last).norm() / 0.05;
            assert!(speed < 0.005, "body {body} moves at {speed} m/s");
            last = now;
        }
    }
}

pub(crate) fn meshes_collide_by_their_surface_or_hull(engine: &dyn Engine) {
    let mut scene = floor();
    let corner = |x: f32, y: f32, z: f32| Point3::new(x, y, z);
    let positions = vec![
        corner(-0.5, -0.5, 0.0),
        corner(0.5, -0.5, 0.0),
        corner(0.5, 0.5, 0.0),
        corner(-0.5, 0.5, 0.0),
        corner(0.0, 0.0, -0.4),
    ];
    let indices = vec![[0, 1, 2], [0, 2, 3], [1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]];
    scene.meshes.push(SceneMesh { name: "pyramid".into(), positions, normals: vec![], uvs: vec![], indices });
    let mesh = SceneShape::Mesh { mesh: 0 };
    add(&mut scene, body("shelf", Pose::translation(0.0, 0.0, 1.0), BodyMotion::Fixed, 0.0, mesh, 0.5));
    let block = add_free(&mut scene, [0.1, 0.1, 1.05], 0.2, cuboid(0.1, 0.1, 0.1), 0.5);
    let mut physics = build(engine, &scene, &aside());
    run(physics.as_mut(), 1.0);
    assert!((position(physics.as_ref(), block).z - 1.05).abs() < 0.003);
}

pub(crate) fn the_arm_holds_its_posture_against_gravity(engine: &dyn Engine) {
    let mut physics = build(engine, &floor(), &start("ready_front", 0.2));
    let tool = physics.find_link("tool_frame").expect("it exists");
    let before = physics.world_from_link(tool).translation.vector;
    run(physics.as_mut(), 5.0);
    let moved = (physics.world_from_link(tool).translation.vector - before).norm();
    assert!(moved < 0.001, "the tool moved {moved} m");
    // What the lift's motor carries is the weight of the arm, carriage and hand, within 5 %.
    let lift = physics.find_joint("lift_joint").expect("it exists");
    assert!((physics.joint_effort(lift) - 11.6 * G).abs() < 0.05 * 11.6 * G, "{} N", physics.joint_effort(lift));
}

pub(crate) fn joints_track_velocities_and_stop_at_their_limits(engine: &dyn Engine) {
    let mut physics = build(engine, &floor(), &start("ready_down", 0.2));
    let before = joint_value(physics.as_ref(), "arm_4_joint");
    set_velocity(physics.as_mut(), "arm_4_joint", -0.5);
    set_velocity(physics.as_mut(), "arm_1_joint", 0.8);
    run(physics.as_mut(), 1.0);
    assert!((joint_value(physics.as_ref(), "arm_4_joint") - (before - 0.5)).abs() < 0.01);
    assert!((joint_value(physics.as_ref(), "arm_1_joint") - 0.8).abs() < 0.015);
    assert!((physics.joint_velocities().find("arm_1_joint").expect("it exists") - 0.8).abs() < 0.02);
    // Into the limits, faster than allowed.
    set_velocity(physics.as_mut(), "arm_4_joint", -50.0);
    set_velocity(physics.as_mut(), "lift_joint", 50.0);
    run(physics.as_mut(), 0.5);
    assert!((joint_value(physics.as_ref(), "lift_joint") - 0.3).abs() < 0.01, "0.2 m/s is its top speed");
    run(physics.as_mut(), 2.5);
    assert!((joint_value(physics.as_ref(), "arm_4_joint") + 0.2).abs() < 0.005);
    assert!((joint_value(physics.as_ref(), "lift_joint") - 0.45).abs() < 0.002);
}

pub(crate) fn the_base_follows_its_twist_and_a_wall_stops_it(engine: &dyn Engine) {
    let mut scene = floor();
    let wall = add(
        &mut scene,
        body("wall", Pose::translation(2.0, 0.0, 0.5), BodyMotion::Fixed, 0.0, cuboid(0.1, 4.0, 1.0), 0.5),
    );
    let mut physics = build(engine, &scene, &start("carry", 0.08));
    drive(physics.as_mut(), 0.5, 0.0, 2.0);
    let base = physics.world_from_base().translation.vector;
    assert!((0.95..1.0).contains(&base.x) && base.y.abs() < 0.002, "{base:?}");
    assert!((physics.base_velocity().forward_m_per_s - 0.5).abs() < 0.01);
    drive(physics.as_mut(), 0.5, 0.0, 4.0);
    let stopped = physics.world_from_base().translation.vector;
    assert!((1.68..1.73).contains(&stopped.x), "the footprint ends at the wall: {stopped:?}");
    let contacts = physics.contacts();
    let push = contacts.iter().find(|c| c.first == ContactParty::Body(wall)).expect("the base pushes the wall");
    assert_eq!(push.second, ContactParty::Link(physics.find_link("base_link").expect("it exists")));
    assert!((150.0..230.0).contains(&push.force_n), "the drive gives at most 200 N: {}", push.force_n);
    // Away from the wall, whose friction would hold it back.
    drive(physics.as_mut(), -0.3, 0.0, 1.0);
    drive(physics.as_mut(), 0.0, 1.0, 1.0);
    let (_, _, yaw) = physics.world_from_base().rotation.euler_angles();
    assert!((yaw - 1.0).abs() < 0.05, "yaw {yaw}");
}

pub(crate) fn links_of_meshes_collide_by_their_hull(engine: &dyn Engine) {
    let mut scene = floor();
    add(&mut scene, body("wall", Pose::translation(2.0, 0.0, 0.5), BodyMotion::Fixed, 0.0, cuboid(0.1, 4.0, 1.0), 0.5));
    // A tetrahedron around the base, whose tip points ahead.
    let corner = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
    let mesh = Mesh {
        file: "nose.stl".into(),
        vertices: vec![corner(0.6, 0.0, 0.3), corner(0.0, 0.3, 0.3), corner(0.0, -0.3, 0.3), corner(0.0, 0.0, 0.4)],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    };
    let mut robot = porter();
    let base = robot.get_link("base_link").expect("it exists");
    let shape = CollisionShape { link_from_shape: Pose::identity(), geometry: Geometry::Mesh(Arc::new(mesh)) };
    robot.kinematics.links[base].collisions.push(shape);
    let mut physics = engine.build(&scene, &robot, &start("carry", 0.08)).expect("a valid world");
    drive(physics.as_mut(), 0.5, 0.0, 5.0);
    let stopped = physics.world_from_base().translation.vector;
    assert!((1.3..1.4).contains(&stopped.x), "the nose ends at the wall: {stopped:?}");
}

pub(crate) fn a_push_does_not_carry_the_base_through_a_heavy_crate(engine: &dyn Engine) {
    let mut scene = floor();
    let crate_body = add_free(&mut scene, [0.8, 0.0, 0.25], 80.0, cuboid(0.5, 0.5, 0.5), 0.6);
    let mut physics = build(engine, &scene, &start("carry", 0.08));
    drive(physics.as_mut(), 0.5, 0.0, 3.0);
    // 80 kg with friction 0.6 needs 470 N; the drive has 200.
    assert!((position(physics.as_ref(), crate_body).x - 0.8).abs() < 0.02);
    assert!(physics.world_from_base().translation.x < 0.33);
}

pub(crate) fn a_standing_base_does_not_creep_under_a_steady_push(engine: &dyn Engine) {
    // The gripper pushes sideways against a heavy crate for 5 s.
    let mut scene = floor();
    add_free(&mut scene, [0.6, 0.35, 0.3], 200.0, cuboid(0.4, 0.4, 0.6), 0.8);
    let mut physics = build(engine, &scene, &start("ready_down", 0.0));
    // 30 Nm, half of what the wheels can hold.
    let shoulder = physics.find_joint("arm_1_joint").expect("it exists");
    physics.command_joint(shoulder, JointTarget::Position { position: 1.5, speed: 0.3, max_effort: 30.0 });
    run(physics.as_mut(), 5.0);
    assert!(!physics.contacts().iter().all(|c| matches!(c.first, ContactParty::Body(0))), "the hand pushes the crate");
    let base = physics.world_from_base();
    assert!(base.translation.vector.norm() < 0.006 && base.rotation.angle() < 0.006, "{base:?}");
}

pub(crate) fn the_folded_robot_touches_nothing_while_it_unfolds(engine: &dyn Engine) {
    let mut physics = build(engine, &floor(), &start("carry", 0.08));
    for goal in ["side", "ready_down", "side", "carry"] {
        // The joints move in step, as `[paths]` of robot.toml asks.
        let target = posture(goal);
        let from = physics.joint_positions();
        let paces: Vec<_> =
            target.iter().map(|(n, value)| (n, (value - from.find(n).expect("it exists")) / 4.0)).collect();
        for _ in 0..400 {
            paces.iter().for_each(|(name, pace)| set_velocity(physics.as_mut(), name, *pace));
            run(physics.as_mut(), 0.01);
            assert!(physics.contacts().is_empty(), "{goal}: {:?}", physics.contacts());
        }
        for (name, value) in &target {
            assert!((joint_value(physics.as_ref(), name) - value).abs() < 0.02, "{name} in {goal}");
        }
    }
}

pub(crate) fn two_runs_give_the_same_bytes(engine: &dyn Engine) {
    let trace = || {
        let (mut scene, object) = grasp_world(SceneShape::Sphere { radius_m: 0.035 }, 0.07, 0.18, 0.5);
        for i in 0..20 {
            let at = [0.5 + 0.01 * f64::from(i), 0.3 + 0.02 * f64::from(i), 0.8 + 0.1 * f64::from(i)];
            add_free(&mut scene, at, 0.2, cuboid(0.06, 0.05, 0.08), 0.5);
        }
        let mut physics = build(engine, &scene, &start("ready_down", 0.25));
        lift_by(physics.as_mut(), -0.1, 1.0);
        set_gripper(physics.as_mut(), 0.0, 25.0);
        drive(physics.as_mut(), -0.3, 0.4, 2.0);
        let mut bits = Vec::new();
        for index in 0..scene.bodies.len() {
            let pose = physics.world_from_body(index);
            bits.extend(pose.translation.vector.iter().chain(pose.rotation.coords.iter()).map(|v| v.to_bits()));
        }
        bits.extend(physics.joint_positions().values().iter().map(|v| v.to_bits()));
        bits.push(physics.grip_force_n().to_bits());
        assert!(object > 0);
        bits
    };
    assert_eq!(trace(), trace());
}

pub(crate) fn reading_never_changes_the_world(engine: &dyn Engine) {
    let scene = floor();
    let (mut read, mut left_alone) = (build(engine, &scene, &aside()), build(engine, &scene, &aside()));
    for _ in 0..50 {
        read.step();
        left_alone.step();
        let _ = (read.contacts(), read.grip_force_n(), read.joint_positions(), read.world_from_base());
    }
    assert_eq!(read.now(), left_alone.now());
    assert_eq!(read.joint_positions(), left_alone.joint_positions());
}

pub(crate) fn bad_input_is_refused_with_its_reason(engine: &dyn Engine) {
    let refuse = |scene: &SceneModel, start: &RobotStart| engine.build(scene, &porter(), start).err().expect("refused");
    let mut scene = floor();
    add_free(&mut scene, [0.0, 0.0, 1.0], 0.0, cuboid(0.1, 0.1, 0.1), 0.5);
    assert!(matches!(refuse(&scene, &aside()), PhysicsError::NoMass { .. }));
    let mut scene = floor();
    add_free(&mut scene, [0.0, 0.0, 1.0], 1.0, cuboid(0.1, 0.0, 0.1), 0.5);
    assert!(matches!(refuse(&scene, &aside()), PhysicsError::BadShape { .. }));
    let mut start = aside();
    start.joints.push(("arm_9_joint".into(), 0.0));
    assert!(matches!(refuse(&floor(), &start), PhysicsError::NoJoint { .. }));
    let mut start = aside();
    start.joints.push(("arm_4_joint".into(), 4.0));
    assert!(matches!(refuse(&floor(), &start), PhysicsError::OutOfRange { .. }));
    let mut robot = porter();
    robot.fingers.friction = 1.5;
    let error = engine.build(&floor(), &robot, &aside()).err().expect("refused");
    assert!(error.to_string().contains("finger_friction = 1.5"), "{error}");
}

/// One test for each clause of the contract, held against an engine.
macro_rules! conformance {
    ($engine:expr) => {
        crate::conformance::conformance! { @each $engine;
            a_free_body_falls_with_gravity
            friction_decides_whether_a_block_slides_down_a_slope
            a_stack_rests_and_a_round_fruit_stays
            what_stands_is_still
            meshes_collide_by_their_surface_or_hull
            the_arm_holds_its_posture_against_gravity
            joints_track_velocities_and_stop_at_their_limits
            the_base_follows_its_twist_and_a_wall_stops_it
            links_of_meshes_collide_by_their_hull
            a_push_does_not_carry_the_base_through_a_heavy_crate
            friction_holds_what_the_gripper_lifts_and_carries
            what_is_held_aslant_does_not_turn_between_the_pads
            a_grip_too_weak_for_the_weight_drops_the_object
            fingers_that_lose_their_hold_do_not_shoot
            the_grip_force_never_exceeds_the_limit
            a_standing_base_does_not_creep_under_a_steady_push
            the_folded_robot_touches_nothing_while_it_unfolds
            two_runs_give_the_same_bytes
            reading_never_changes_the_world
            bad_input_is_refused_with_its_reason
            kinds_and_exclusions_decide_what_touches
            ties_hold_bodies_together
            a_written_center_of_mass_counts
            a_drawer_slides_out_by_its_handle_and_stops
            a_door_swings_when_it_is_pushed_and_stays
            nothing_on_a_joint_moves_untouched
            weight_springs_and_limits_act_on_joints
            a_lid_falls_with_its_box
            pulling_twice_gives_the_same_bytes
        }
    };
    (@each $engine:expr; $($clause:ident)*) => {
        $(
            #[test]
            fn $clause() {
                crate::conformance::$clause(&$engine);
            }
        )*
    };
}
pub(crate) use conformance;
