//! The robot as a tree of MuJoCo's bodies: links, joints, motors.

use crate::compose::{ROBOT_MEETS, add_mesh, add_pair, geom_name, refused, set_contact, set_pose, wxyz};
use dsm_robot::model::kinematics::{Inertial, Joint, Link};
use dsm_robot::model::shapes::{Geometry, Mesh};
use dsm_robot::model::{JointKind, LinkId};
use dsm_sim::physics::{LINK_FRICTION, MovingJoint, PhysicsError, RobotBody};
use dsm_sim::scene::{BodyMotion, SceneModel};
use mujoco_rs::mujoco_c::{mjtBias, mjtEq, mjtGain, mjtJoint, mjtLimited, mjtSleepPolicy, mjtTrn};
use mujoco_rs::prelude::{MjSpec, MjtGeomBase, MjtObjBase, SpecItem};
use mujoco_rs::wrappers::mj_editing::MjsBody;
use std::sync::Arc;

/// Joints of the base, x, y and yaw, in this order.
pub(crate) const BASE_JOINTS: [&str; 3] = ["base/x", "base/y", "base/yaw"];
/// The gear between the fingers is stiffer than any contact.
const GEAR_SOLREF: [f64; 2] = [0.01, 1.0];
const GEAR_SOLIMP: [f64; 5] = [0.99, 0.999, 0.001, 0.5, 2.0];

/// Inertia of the drives, as the time in which full effort brings it to top speed, seconds. Real gears weigh that much and
/// more; a jaw of 100 g alone would shoot at 1 m/s within one step of its motor's full force.
const GEAR_S: f64 = 0.005;

/// Principal moments that MuJoCo takes for none.
const LEAST_MOMENT_KG_M2: f64 = 1e-14;

/// Name of a link in the model.
pub(crate) fn link_name(link: &str) -> String {
    format!("robot/{link}")
}

/// Adds links, joints, gear and motors. Motors come in the order of the base's joints, then of `joints`.
pub(crate) fn add_robot(spec: &mut MjSpec, robot: &RobotBody, joints: &[MovingJoint]) -> Result<(), PhysicsError> {
    let base = robot.get_link(&robot.base_link)?;
    let meshes = add_meshes(spec, robot)?;
    add_link(spec.world_body_mut(), (robot, &meshes), base, None)?;
    for (a, b) in robot.ignored_links()? {
        let [a, b] = [a, b].map(|link| link_name(&robot.kinematics.links[link].name));
        let exclude = spec.add_exclude();
        exclude.set_bodyname1(&a);
        exclude.set_bodyname2(&b);
    }
    let [left, right] = robot.finger_joints(joints)?;
    let gear = spec.add_equality();
    gear.set_type(mjtEq::mjEQ_JOINT);
    gear.set_objtype(MjtObjBase::mjOBJ_JOINT);
    gear.set_name1(&joints[right].name);
    gear.set_name2(&joints[left].name);
    let data = gear.data_mut();
    data.fill(0.0);
    data[1] = 1.0;
    *gear.solref_mut() = GEAR_SOLREF;
    *gear.solimp_mut() = GEAR_SOLIMP;
    for name in BASE_JOINTS.into_iter().chain(joints.iter().map(|joint| joint.name.as_str())) {
        add_motor(spec, name);
    }
    Ok(())
}

/// A motor whose gains and effort bound are set in the compiled model.
fn add_motor(spec: &mut MjSpec, joint: &str) {
    let motor = spec.add_actuator();
    motor.set_target(joint);
    motor.set_trntype(mjtTrn::mjTRN_JOINT);
    motor.set_gaintype(mjtGain::mjGAIN_FIXED);
    motor.set_biastype(mjtBias::mjBIAS_AFFINE);
    motor.gainprm_mut()[0] = 1.0;
    motor.set_forcelimited(mjtLimited::mjLIMITED_TRUE);
    *motor.forcerange_mut() = [-1.0, 1.0];
}

/// Adds the pairs of finger pads and what may lie between them.
pub(crate) fn add_grip_pairs(spec: &mut MjSpec, robot: &RobotBody, scene: &SceneModel) -> Result<(), PhysicsError> {
    let pads: Vec<String> = robot
        .finger_links()?
        .iter()
        .map(|link| &robot.kinematics.links[*link])
        .flat_map(|link| (0..link.collisions.len()).map(|nth| pad_name(&link.name, nth)))
        .collect();
    for (index, body) in scene.bodies.iter().enumerate().filter(|(_, body)| body.motion != BodyMotion::Fixed) {
        for (nth, geom) in body.geoms.iter().filter(|geom| geom.collides).enumerate() {
            for pad in &pads {
                add_pair(spec, (pad, robot.fingers.friction), (&geom_name(index, nth), geom.friction));
            }
        }
    }
    Ok(())
}

fn pad_name(link: &str, nth: usize) -> String {
    format!("robot/{link}/{nth}")
}

/// Meshes that links collide with; each file once.
type Meshes = Vec<Arc<Mesh>>;

fn mesh_name(index: usize) -> String {
    format!("robot/mesh/{index}")
}

/// Adds the meshes of the links' collision shapes.
fn add_meshes(spec: &mut MjSpec, robot: &RobotBody) -> Result<Meshes, PhysicsError> {
    let mut meshes = Meshes::new();
    for shape in robot.kinematics.links.iter().flat_map(|link| &link.collisions) {
        let Geometry::Mesh(mesh) = &shape.geometry else { continue };
        if meshes.iter().any(|known| Arc::ptr_eq(known, mesh)) {
            continue;
        }
        let vertices: Vec<f32> = mesh.vertices.iter().flat_map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
        add_mesh(spec, &mesh_name(meshes.len()), &vertices, &mesh.triangles)?;
        meshes.push(mesh.clone());
    }
    Ok(meshes)
}

/// Adds a link and all below it; `joint` is what it hangs on.
fn add_link(
    parent: &mut MjsBody,
    (robot, meshes): (&RobotBody, &Meshes),
    index: usize,
    joint: Option<&Joint>,
) -> Result<(), PhysicsError> {
    let link = &robot.kinematics.links[index];
    let body = parent.add_body();
    body.set_name(&link_name(&link.name)).map_err(refused)?;
    // Motors hold the robot's own weight; the fingers' bound is then what they press with.
    body.set_gravcomp(1.0);
    match joint {
        None => {
            body.set_sleep(mjtSleepPolicy::mjSLEEP_NEVER);
            add_base_joints(body)?;
        }
        Some(joint) => {
            set_pose(body, &joint.parent_from_joint);
            if joint.kind != JointKind::Fixed {
                add_joint(body, robot, joint)?;
            }
        }
    }
    add_inertia(body, &link.inertial);
    add_shapes(body, (robot, meshes), link)?;
    if joint.is_none_or(|joint| joint.kind != JointKind::Fixed) && mass_below(robot, LinkId(index)) <= 0.0 {
        return Err(PhysicsError::NoMass { name: link.name.clone(), mass_kg: 0.0 });
    }
    for joint in robot.kinematics.joints.iter().filter(|joint| joint.parent == LinkId(index)) {
        add_link(body, (robot, meshes), joint.child.0, Some(joint))?;
    }
    Ok(())
}

/// Mass of a link and all that is fixed to it, kilograms.
fn mass_below(robot: &RobotBody, link: LinkId) -> f64 {
    let fixed = robot.kinematics.joints.iter().filter(|joint| joint.parent == link && joint.kind == JointKind::Fixed);
    let below: f64 = fixed.map(|joint| mass_below(robot, joint.child)).sum();
    robot.kinematics.links[link.0].inertial.mass_kg + below
}

fn add_base_joints(body: &mut MjsBody) -> Result<(), PhysicsError> {
    let axes = [
        (mjtJoint::mjJNT_SLIDE, [1.0, 0.0, 0.0]),
        (mjtJoint::mjJNT_SLIDE, [0.0, 1.0, 0.0]),
        (mjtJoint::mjJNT_HINGE, [0.0, 0.0, 1.0]),
    ];
    for (name, (kind, axis)) in BASE_JOINTS.into_iter().zip(axes) {
        let joint = body.add_joint();
        joint.set_name(name).map_err(refused)?;
        joint.set_type(kind);
        *joint.axis_mut() = axis;
    }
    Ok(())
}

fn add_joint(body: &mut MjsBody, robot: &RobotBody, joint: &Joint) -> Result<(), PhysicsError> {
    let added = body.add_joint();
    added.set_name(&joint.name).map_err(refused)?;
    let prismatic = joint.kind == JointKind::Prismatic;
    added.set_type(if prismatic { mjtJoint::mjJNT_SLIDE } else { mjtJoint::mjJNT_HINGE });
    *added.axis_mut() = joint.axis.into_inner().into();
    if joint.kind != JointKind::Continuous {
        added.set_limited(mjtLimited::mjLIMITED_TRUE);
        *added.range_mut() = [joint.limits.lower, joint.limits.upper];
    }
    let is_finger = robot.fingers.joints.contains(&joint.name);
    let bound = if is_finger { robot.fingers.max_force_n } else { f64::INFINITY };
    let max_effort = joint.limits.effort.min(bound);
    added.set_armature(GEAR_S * max_effort / joint.limits.velocity);
    // Beside the actuator: what it gives, it gives beyond what carries the arm (`Setpoint::spare_effort`).
    added.set_actgravcomp(true);
    added.set_actfrclimited(mjtLimited::mjLIMITED_TRUE);
    *added.actfrcrange_mut() = [-max_effort, max_effort];
    Ok(())
}

fn add_inertia(body: &mut MjsBody, inertial: &Inertial) {
    if inertial.mass_kg <= 0.0 {
        return;
    }
    let pose = &inertial.link_from_inertial;
    let rotation = pose.rotation.to_rotation_matrix();
    let m = rotation.matrix() * inertial.inertia_kg_m2 * rotation.matrix().transpose();
    body.set_explicitinertial(true);
    body.set_mass(inertial.mass_kg);
    *body.ipos_mut() = pose.translation.vector.into();
    // A point mass has no principal axes, and MuJoCo refuses what no body can have: small parts of a robot come with both.
    if m.symmetric_eigenvalues().min() > LEAST_MOMENT_KG_M2 {
        *body.fullinertia_mut() = [m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(0, 1)], m[(0, 2)], m[(1, 2)]];
    }
}

fn add_shapes(body: &mut MjsBody, (robot, meshes): (&RobotBody, &Meshes), link: &Link) -> Result<(), PhysicsError> {
    let is_finger = robot.fingers.links.contains(&link.name);
    let friction = if is_finger { robot.fingers.friction } else { LINK_FRICTION };
    for (nth, part) in link.collisions.iter().enumerate() {
        let pose = &part.link_from_shape;
        let geom = body.add_geom();
        let (kind, size) = match &part.geometry {
            Geometry::Box { size_m } => (MjtGeomBase::mjGEOM_BOX, (size_m * 0.5).into()),
            Geometry::Cylinder { radius_m, length_m } => {
                (MjtGeomBase::mjGEOM_CYLINDER, [*radius_m, 0.5 * length_m, 0.5 * length_m])
            }
            Geometry::Capsule { radius_m, length_m } => {
                (MjtGeomBase::mjGEOM_CAPSULE, [*radius_m, 0.5 * length_m, 0.5 * length_m])
            }
            Geometry::Sphere { radius_m } => (MjtGeomBase::mjGEOM_SPHERE, [*radius_m; 3]),
            Geometry::Mesh(mesh) => {
                let index = meshes.iter().position(|known| Arc::ptr_eq(known, mesh)).unwrap_or(0);
                geom.set_meshname(&mesh_name(index));
                (MjtGeomBase::mjGEOM_MESH, [0.0; 3])
            }
        };
        let sized = kind != MjtGeomBase::mjGEOM_MESH;
        if sized && !size.iter().all(|value: &f64| value.is_finite() && *value > 0.0) {
            let reason = format!("sizes must be above 0, got {size:?}");
            return Err(PhysicsError::BadShape { owner: link.name.clone(), reason });
        }
        geom.set_name(&pad_name(&link.name, nth)).map_err(refused)?;
        geom.set_type(kind);
        *geom.size_mut() = size;
        *geom.pos_mut() = pose.translation.vector.into();
        *geom.quat_mut() = wxyz(&pose.rotation);
        set_contact(geom, friction);
        geom.set_conaffinity(1 | ROBOT_MEETS as i32);
    }
    Ok(())
}
