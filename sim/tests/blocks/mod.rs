//! Worlds of simple blocks for tests and measurements: primitives on tables, and the robot porter.

#![allow(dead_code, reason = "each program that includes this module uses a part of it")]

use dsm::Pose;
use dsm_robot::model::RobotModel;
use dsm_sim::physics::{RobotBody, RobotStart};
use dsm_sim::scene::{BodyMotion, SceneBody, SceneGeom, SceneModel, SceneShape};
use nalgebra::Vector3;
use std::path::Path;

/// An empty world with a floor.
pub(crate) fn floor() -> SceneModel {
    let plane = SceneShape::Plane { half_m: [0.0, 0.0] };
    SceneModel {
        name: "blocks".into(),
        bodies: vec![body("world", Pose::identity(), BodyMotion::Fixed, 0.0, plane, 0.6)],
        // Nothing here is drawn.
        materials: vec![],
        textures: vec![],
        meshes: vec![],
        lights: vec![],
        ..SceneModel::default()
    }
}

/// A body of one geom.
pub(crate) fn body(
    name: &str,
    world_from_body: Pose,
    motion: BodyMotion,
    mass_kg: f64,
    shape: SceneShape,
    friction: f64,
) -> SceneBody {
    let geom = SceneGeom {
        name: None,
        body_from_geom: Pose::identity(),
        shape,
        material: 0,
        friction,
        collides: true,
        kinds: 1,
        touches: 1,
        visible: true,
    };
    SceneBody { name: name.into(), world_from_body, motion, mass_kg, spread: None, geoms: vec![geom] }
}

/// Adds a body and returns its index.
pub(crate) fn add(scene: &mut SceneModel, body: SceneBody) -> usize {
    scene.bodies.push(body);
    scene.bodies.len() - 1
}

/// A box shape by full sizes.
pub(crate) fn cuboid(x: f64, y: f64, z: f64) -> SceneShape {
    SceneShape::Box { half_m: Vector3::new(0.5 * x, 0.5 * y, 0.5 * z) }
}

/// Adds a fixed table: a slab of 0.7 m by `width` whose top is at `top_m`, on the given centre.
pub(crate) fn add_table(scene: &mut SceneModel, x: f64, y: f64, width: f64, top_m: f64) -> usize {
    let name = format!("table_{}", scene.bodies.len());
    let pose = Pose::translation(x, y, top_m - 0.02);
    add(scene, body(&name, pose, BodyMotion::Fixed, 0.0, cuboid(0.7, width, 0.04), 0.5))
}

/// Adds a free body.
pub(crate) fn add_free(scene: &mut SceneModel, at: [f64; 3], mass_kg: f64, shape: SceneShape, friction: f64) -> usize {
    let name = format!("free_{}", scene.bodies.len());
    add(scene, body(&name, Pose::translation(at[0], at[1], at[2]), BodyMotion::Free, mass_kg, shape, friction))
}

/// The model of the robot porter.
pub(crate) fn porter_model() -> RobotModel {
    let mut above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|folder| folder.join("robot/models/porter"));
    let folder = above.find(|folder| folder.exists()).expect("the robot lies in the repository");
    RobotModel::load(&folder).expect("porter loads")
}

/// The robot porter as physics sees it.
pub(crate) fn porter() -> RobotBody {
    RobotBody::of(&porter_model()).expect("porter has a body")
}

/// Joint values of a posture of porter.
pub(crate) fn posture(name: &str) -> Vec<(String, f64)> {
    let posture = porter_model().find_posture(name).expect("a posture");
    posture.iter().map(|(joint, value)| (joint.to_owned(), value)).collect()
}

/// Porter at the origin in a posture, with the lift at `lift_m` and the gripper open.
pub(crate) fn start(posture_name: &str, lift_m: f64) -> RobotStart {
    let mut joints = posture(posture_name);
    joints.retain(|(n, _)| n != "lift_joint" && !n.starts_with("gripper"));
    joints.push(("lift_joint".into(), lift_m));
    joints.push(("gripper_left_joint".into(), 0.065));
    joints.push(("gripper_right_joint".into(), 0.065));
    RobotStart { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0, joints }
}
