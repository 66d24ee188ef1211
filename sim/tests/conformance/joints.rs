//! Doors, drawers and lids: what moves on a joint of the scene.

use super::{drive, position, run, set_gripper};
use crate::blocks::{add, add_free, body, cuboid, floor, porter, start};
use dsm::Pose;
use dsm::time::Span;
use dsm_sim::physics::{Engine, Physics};
use dsm_sim::scene::{BodyMotion, JointMotion, SceneBody, SceneGeom, SceneJoint, SceneModel};
use nalgebra::{Point3, UnitQuaternion, Vector3};

/// A joint at the origin of the part, along an axis of the part, at 0 as the scene stands; 5 N or 1.5 Nm of friction.
fn add_joint(
    scene: &mut SceneModel,
    carrier: usize,
    motion: JointMotion,
    axis: Vector3<f64>,
    part: SceneBody,
) -> usize {
    let turned = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let along = UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_else(turned);
    let part_from_joint = Pose::from_parts(Default::default(), along);
    let world_from_carrier = scene.bodies[carrier].world_from_body;
    let carrier_from_joint = world_from_carrier.inv_mul(&(part.world_from_body * part_from_joint));
    let part = add(scene, SceneBody { motion: BodyMotion::Jointed, ..part });
    let friction = if motion == JointMotion::Slide { 5.0 } else { 1.5 };
    scene.joints.push(SceneJoint {
        name: format!("joint_{part}"),
        part,
        carrier,
        motion,
        carrier_from_joint,
        part_from_joint,
        reference: 0.0,
        range: None,
        damping: 2.0,
        friction,
        stiffness: 0.0,
        spring_reference: 0.0,
        armature: 0.0,
    });
    part
}

fn add_geom(scene: &mut SceneModel, body: usize, at: [f64; 3], size: [f64; 3]) {
    let geom = SceneGeom {
        body_from_geom: Pose::translation(at[0], at[1], at[2]),
        shape: cuboid(size[0], size[1], size[2]),
        ..scene.bodies[body].geoms[0].clone()
    };
    scene.bodies[body].geoms.push(geom);
}

fn position_of(scene: &SceneModel, poses: &[Pose], part: usize) -> f64 {
    let joint = scene.find_joint(part).expect("it has one");
    joint.find_position(&poses[joint.carrier], &poses[part])
}

fn joint_position(scene: &SceneModel, physics: &dyn Physics, part: usize) -> f64 {
    let poses: Vec<Pose> = (0..scene.bodies.len()).map(|body| physics.world_from_body(body)).collect();
    position_of(scene, &poses, part)
}

/// A cabinet with a drawer of 4 kg whose bar handle stands between the open fingers; 0.3 m of travel.
fn drawer(tool: &Pose) -> (SceneModel, usize) {
    let mut scene = floor();
    // The tool looks along z and closes along y: the bar is 12 cm long, 14 mm thick, its middle 4 cm off the front.
    let front = tool * Pose::translation(0.0, 0.0, 0.04);
    let cabinet = front * Pose::translation(0.0, 0.0, 0.23);
    let cabinet = add(&mut scene, body("cabinet", cabinet, BodyMotion::Fixed, 0.0, cuboid(0.2, 0.5, 0.4), 0.5));
    let panel = body("drawer", front, BodyMotion::Jointed, 4.0, cuboid(0.18, 0.4, 0.02), 0.5);
    let drawer = add_joint(&mut scene, cabinet, JointMotion::Slide, -Vector3::z(), panel);
    scene.bodies[drawer].geoms[0].body_from_geom = Pose::translation(0.0, 0.0, 0.012);
    add_geom(&mut scene, drawer, [0.0, 0.0, -0.04], [0.12, 0.014, 0.014]);
    for side in [-0.05, 0.05] {
        add_geom(&mut scene, drawer, [side, 0.0, -0.016], [0.012, 0.012, 0.036]);
    }
    scene.joints[0].range = Some([0.0, 0.3]);
    (scene, drawer)
}

/// Where the hand of the robot at the origin is in the posture that reaches ahead.
fn hand(engine: &dyn Engine) -> Pose {
    let physics = engine.build(&floor(), &porter(), &start("ready_front", 0.2)).expect("a valid world");
    physics.world_from_link(physics.find_link("tool_frame").expect("it exists"))
}

fn pull(engine: &dyn Engine) -> (SceneModel, usize, Box<dyn Physics>) {
    let (scene, drawer) = drawer(&hand(engine));
    let mut physics = engine.build(&scene, &porter(), &start("ready_front", 0.2)).expect("a valid world");
    set_gripper(physics.as_mut(), 0.0, 25.0);
    run(physics.as_mut(), 1.5);
    drive(physics.as_mut(), -0.1, 0.0, 2.0);
    drive(physics.as_mut(), 0.0, 0.0, 0.5);
    (scene, drawer, physics)
}

pub(crate) fn a_drawer_slides_out_by_its_handle_and_stops(engine: &dyn Engine) {
    let (scene, drawer, mut physics) = pull(engine);
    let at = |physics: &dyn Physics| joint_position(&scene, physics, drawer);
    let pulled = -physics.world_from_base().translation.x;
    assert!((0.17..0.21).contains(&pulled), "the base backs off: {pulled} m");
    let out = at(physics.as_ref());
    assert!((out - pulled).abs() < 0.01, "the base backs off by {pulled} m, the drawer comes out by {out} m");
    // Farther than it goes: it stops, and the hand slips off.
    drive(physics.as_mut(), -0.1, 0.0, 2.5);
    let stopped = at(physics.as_ref());
    assert!((0.295..0.303).contains(&stopped), "{stopped} m");
    assert!(-physics.world_from_base().translation.x > 0.4);
    // Let go, it stays.
    set_gripper(physics.as_mut(), 0.13, 25.0);
    drive(physics.as_mut(), 0.0, 0.0, 2.0);
    let left = at(physics.as_ref());
    run(physics.as_mut(), 3.0);
    assert!((at(physics.as_ref()) - left).abs() < 1e-3 && left > 0.28, "{left} m");
    let level = position(physics.as_ref(), drawer) - scene.bodies[drawer].world_from_body.translation.vector;
    assert!(level.yz().norm() < 1e-3, "it goes straight: {level}");
}

pub(crate) fn a_door_swings_when_it_is_pushed_and_stays(engine: &dyn Engine) {
    let tool = hand(engine).translation.vector;
    let mut scene = floor();
    // A door of 0.6 m by 0.9 m ahead of the hand, hinged 0.4 m to its left.
    let at = Pose::translation(tool.x + 0.1, tool.y + 0.4, tool.z);
    let door = body("door", at, BodyMotion::Jointed, 8.0, cuboid(0.03, 0.6, 0.9), 0.5);
    let door = add_joint(&mut scene, 0, JointMotion::Hinge, Vector3::z(), door);
    scene.bodies[door].geoms[0].body_from_geom = Pose::translation(0.0, -0.31, 0.0);
    scene.joints[0].range = Some([-0.1, 1.6]);
    let mut physics = engine.build(&scene, &porter(), &start("ready_front", 0.2)).expect("a valid world");
    drive(physics.as_mut(), 0.1, 0.0, 3.0);
    let angle = joint_position(&scene, physics.as_ref(), door);
    // The hand is 0.2 m past where the door was, 0.4 m from its hinge.
    assert!((0.3..0.8).contains(&angle), "{angle} rad");
    let shifted = (position(physics.as_ref(), door) - at.translation.vector).norm();
    assert!(shifted < 2e-3, "the hinge stays where it is: {shifted} m");
    drive(physics.as_mut(), -0.1, 0.0, 2.0);
    let left = joint_position(&scene, physics.as_ref(), door);
    run(physics.as_mut(), 3.0);
    let now = joint_position(&scene, physics.as_ref(), door);
    assert!((now - left).abs() < 1e-3 && (left - angle).abs() < 0.1, "left at {left} rad, now at {now} rad");
}

pub(crate) fn nothing_on_a_joint_moves_untouched(engine: &dyn Engine) {
    let tool = hand(engine) * Pose::translation(0.0, 0.0, 1.0);
    let (mut scene, closed) = drawer(&tool);
    let at = |x: f64, z: f64| Pose::translation(x, 3.0, z);
    let panel = |name: &str, pose| body(name, pose, BodyMotion::Jointed, 2.0, cuboid(0.02, 0.4, 0.4), 0.5);
    let open = add_joint(&mut scene, 0, JointMotion::Slide, Vector3::x(), panel("open", at(0.0, 0.5)));
    let door = add_joint(&mut scene, 0, JointMotion::Hinge, Vector3::z(), panel("door", at(1.0, 0.5)));
    // A sash of 20 N in a frame that holds it with 25 N, a flap whose friction is more than its weight's moment.
    let sash = add_joint(&mut scene, 0, JointMotion::Slide, Vector3::z(), panel("sash", at(2.0, 0.8)));
    let flap = add_joint(&mut scene, 0, JointMotion::Hinge, Vector3::x(), panel("flap", at(3.0, 0.8)));
    scene.bodies[flap].geoms[0].body_from_geom = Pose::translation(0.0, 0.2, 0.0);
    for (part, reference, friction) in [(open, -0.2, 5.0), (door, 1.0, 1.0), (sash, 0.3, 25.0), (flap, 0.0, 6.0)] {
        let joint = scene.joints.iter_mut().find(|joint| joint.part == part).expect("it has one");
        (joint.reference, joint.friction) = (reference, friction);
    }
    let mut physics = engine.build(&scene, &porter(), &start("carry", 0.08)).expect("a valid world");
    run(physics.as_mut(), 10.0);
    for part in [closed, open, door, sash, flap] {
        let moved = joint_position(&scene, physics.as_ref(), part)
            - scene.joint_position(scene.find_joint(part).expect("it has one"));
        assert!(moved.abs() < 1e-3, "{} moved by {moved}", scene.bodies[part].name);
    }
}

pub(crate) fn weight_springs_and_limits_act_on_joints(engine: &dyn Engine) {
    let mut scene = floor();
    let panel = |name: &str, x| {
        body(name, Pose::translation(x, 0.0, 1.0), BodyMotion::Jointed, 2.0, cuboid(0.02, 0.2, 0.2), 0.5)
    };
    // A sash of 20 N that friction holds with 5 N falls to its end; a flap swings down.
    let sash = add_joint(&mut scene, 0, JointMotion::Slide, Vector3::z(), panel("sash", 0.0));
    let flap = add_joint(&mut scene, 0, JointMotion::Hinge, Vector3::x(), panel("flap", 1.0));
    let sprung = add_joint(&mut scene, 0, JointMotion::Slide, Vector3::x(), panel("sprung", 2.0));
    scene.bodies[flap].geoms[0].body_from_geom = Pose::translation(0.0, 0.15, 0.0);
    scene.joints[0].range = Some([-0.3, 0.0]);
    (scene.joints[1].friction, scene.joints[1].range) = (0.1, Some([-1.0, 0.0]));
    (scene.joints[2].stiffness, scene.joints[2].spring_reference) = (200.0, 0.1);
    (scene.joints[2].friction, scene.joints[2].damping) = (0.1, 20.0);
    let poses = engine.settle(&scene, Span::from_s(4.0)).expect("simulated");
    let at = |part| position_of(&scene, &poses, part);
    assert!((at(sash) + 0.3).abs() < 3e-3, "the sash lies at {} m", at(sash));
    assert!((at(flap) + 1.0).abs() < 0.02, "the flap hangs at {} rad", at(flap));
    assert!((at(sprung) - 0.1).abs() < 3e-3, "the spring rests at {} m", at(sprung));
}

pub(crate) fn a_lid_falls_with_its_box(engine: &dyn Engine) {
    let mut scene = floor();
    let chest = add_free(&mut scene, [0.0, 0.0, 0.5], 2.0, cuboid(0.3, 0.3, 0.2), 0.6);
    let lid = body("lid", Pose::translation(-0.15, 0.0, 0.61), BodyMotion::Jointed, 0.5, cuboid(0.3, 0.3, 0.02), 0.6);
    let lid = add_joint(&mut scene, chest, JointMotion::Hinge, -Vector3::y(), lid);
    scene.bodies[lid].geoms[0].body_from_geom = Pose::translation(0.15, 0.0, 0.0);
    scene.joints[0].range = Some([0.0, 1.5]);
    scene.joints[0].friction = 0.05;
    scene.excluded = vec![[chest, lid]];
    let poses = engine.settle(&scene, Span::from_s(3.0)).expect("simulated");
    assert!((poses[chest].translation.z - 0.1).abs() < 5e-3, "the box lies on the floor: {}", poses[chest]);
    let hinge = poses[chest].inverse_transform_point(&Point3::from(poses[lid].translation.vector));
    assert!((hinge - Point3::new(-0.15, 0.0, 0.11)).norm() < 3e-3, "the hinge holds: {hinge}");
    assert!(position_of(&scene, &poses, lid).abs() < 0.02, "the lid is closed");
}

pub(crate) fn pulling_twice_gives_the_same_bytes(engine: &dyn Engine) {
    let trace = || {
        let (scene, _, physics) = pull(engine);
        let poses = (0..scene.bodies.len()).map(|body| physics.world_from_body(body));
        let bits = poses.flat_map(|pose| pose.to_homogeneous().iter().map(|v| v.to_bits()).collect::<Vec<_>>());
        bits.collect::<Vec<_>>()
    };
    assert_eq!(trace(), trace());
}
